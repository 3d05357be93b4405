"""The table [kinetic] of a case: what it accepts, and one sentence for what it refuses."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.cases import data
from triboflux import closures
from triboflux.case import Case
from triboflux.case_kinetic import THERMOSTATS, Kinetic
from triboflux.errors import InputError
from triboflux.kinetic.ensemble import Parameters
from triboflux.kinetic.start import draw_particles, evaluate

OPTIONS = st.fixed_dictionaries(
    {},
    optional={
        "particles": st.integers(10**3, 10**9),
        "ensembles": st.integers(2, 10**5),
        "seed": st.integers(0, 10**18),
        "cells": st.integers(1, 10**7),
        "time_step": st.floats(1e-30, 1e30),
        "mean_field": st.booleans(),
        "thermostat": st.sampled_from(THERMOSTATS),
        "dilute": st.booleans(),
    },
)


def sentence(caught):
    """Return the message of a refusal, which is one sentence."""
    text = str(caught.value)
    assert text.isprintable()
    assert text.endswith(".") or text.endswith("?")
    assert len(text) < 400
    return text


def refused(**options):
    with pytest.raises(InputError) as caught:
        Case(**data(kinetic=options))
    return sentence(caught)


def unfit(act=Parameters.of, **changes):
    """Return the sentence with which a valid case is refused for particles."""
    case = Case(**data(**changes))
    with pytest.raises(InputError) as caught:
        act(case)
    return sentence(caught)


@given(OPTIONS)
def test_a_case_with_any_options_survives_its_text(options):
    case = Case(**data(kinetic=options))
    again = Case.from_toml_text(case.to_toml())
    assert again == case
    assert again.kinetic == Kinetic(**options)


def test_a_case_needs_no_options():
    assert Case(**data()).kinetic is None
    assert Parameters.of(Case(**data())) == Parameters.of(Case(**data(kinetic={})))


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("particles", 999, "from 1000 to 1e+09"),
        ("particles", 2.5, "whole number"),
        ("particles", True, "whole number"),
        ("ensembles", 1, "from 2 to 100000"),
        ("seed", -1, "from 0 to 1e+18"),
        ("seed", "one", "whole number"),
        ("cells", 0, "from 1 to 1e+07"),
        ("time_step", 0.0, "positive finite"),
        ("time_step", math.inf, "positive finite"),
        ("time_step", math.nan, "number"),
        ("mean_field", 1, "true or false"),
        ("dilute", "no", "true or false"),
        ("thermostat", "fulls", "Did you mean 'full'"),
        ("thermostat", 3, "text"),
    ],
)
def test_options_that_are_not_allowed(name, value, told):
    found = refused(**{name: value})
    assert f"kinetic.{name}" in found
    assert told in found


def test_an_unknown_option_proposes_the_nearest():
    found = refused(particle=5000)
    assert "particle" in found
    assert "Did you mean 'particles'" in found


@given(
    name=st.sampled_from(tuple(Kinetic.model_fields)),
    value=st.one_of(
        st.none(),
        st.booleans(),
        st.text(max_size=20),
        st.floats(),
        st.integers(),
        st.lists(st.integers(), max_size=2),
    ),
)
def test_anything_else_is_accepted_or_refused_with_a_sentence(name, value):
    try:
        case = Case(**data(kinetic={name: value}))
    except InputError as error:
        assert f"kinetic.{name}" in str(error)
        assert str(error).isprintable()
    else:
        assert getattr(case.kinetic, name) == value


# ------------------------------------------------------------------ what particles need


def test_a_case_in_two_dimensions_is_refused():
    found = unfit(grid={"points": [32, 32]}, initial={"charge": [{"mode": [1, 0], "sine": 1.0}]})
    assert "grid.points" in found
    assert "has 2 entries, but must have one" in found


def test_too_few_particles_for_the_grid():
    found = unfit(grid__points=[64], kinetic={"particles": 1200})
    assert "kinetic.particles" in found
    assert "is 1200, but must be at least 1280" in found
    Parameters.of(Case(**data(grid__points=[64], kinetic={"particles": 1280})))


@pytest.mark.parametrize("cells", [33, 31, 16, 320 + 32])
def test_cells_are_whole_parts_of_the_grid(cells):
    found = unfit(kinetic={"particles": 6400, "cells": cells})
    assert "kinetic.cells" in found
    assert f"is {cells}, but must be a multiple of the grid's 32 points and at most 320" in found


def test_charges_without_the_variance_for_their_covariance():
    initial = {
        "charge": [{"mode": [1], "sine": 1.0}],
        "covariance": [{"component": 0, "mode": [1], "cosine": 0.5}],
        "variance": [{"mode": [0], "cosine": 0.2}],
    }
    found = unfit(
        lambda case: draw_particles(case, 1000, np.random.default_rng(1)), initial=initial
    )
    assert "initial.covariance" in found
    assert "is 0.5 at x = 0, but must be at most the root of the variance there, 0.447214" in found


def test_a_step_that_is_much_too_long():
    found = unfit(kinetic={"time_step": 1e3})
    assert "kinetic.time_step is 1000, but must be at most 0.1155, 20 times the usual step" in found


# ------------------------------------------------------------------ defaults


@given(OPTIONS, st.sampled_from([0.0, 1e-3, 300.0]), st.sampled_from([0.01, 0.1, 1.0, math.inf]))
def test_cells_and_steps_of_any_options_fit(options, energy_ratio, tau_c):
    rest = {"peclet": math.inf, "tau_p": 1.0} if tau_c == math.inf else {"peclet": 1e4}
    numbers = {"energy_ratio": energy_ratio, "tau_c": tau_c, "length_ratio": 192.0}
    case = Case(**data(kinetic=options, numbers=numbers | rest | {"restitution": 0.9}))
    try:
        found = Parameters.of(case)
    except InputError as error:
        assert re.search(r"kinetic\.(cells|time_step)", str(error))
        return
    particles = case.kinetic.particles
    assert found.cells % found.points == 0
    assert found.cells * 20 <= particles
    assert (found.diameter == 0.0) == case.kinetic.dilute
    if case.kinetic.time_step is None:
        assert found.time_step <= min(0.25 * tau_c, 0.02)
        if energy_ratio and case.kinetic.mean_field:
            assert found.time_step * math.sqrt(energy_ratio) <= 0.1
    else:
        assert found.time_step == case.kinetic.time_step
    assert found.energy_ratio == (energy_ratio if case.kinetic.mean_field else 0.0)


def test_cells_are_an_eighth_of_a_diameter_or_hold_20_particles():
    def cells(**options):
        return Parameters.of(Case(**data(kinetic=options))).cells

    assert cells(particles=10**6) == 8 * 192
    assert cells(particles=10_000) == 480  # a multiple of 32, at most 500
    assert cells(particles=10_000, dilute=True) == 128
    assert cells(particles=10_000, cells=64) == 64


def test_charge_transfer_gives_the_dispersion_and_conduction_of_the_case():
    """γ and β lead back to Pe and τ_σ by (2.25) and (2.26)."""
    numbers = {
        "peclet": 3e4,
        "tau_c": 0.07,
        "tau_sigma": 5.0,
        "energy_ratio": 0.0,
        "length_ratio": 40.0,
        "restitution": 0.7,
    }
    found = Parameters.of(Case(**data(numbers=numbers, exponent=0.5)))
    exact = closures.derived(0.7, 0.5)
    # n g0 d² √Θ from the collision rate, lengths in L
    density = found.collision_rate / closures.collision_integral(1.0)
    diameter = 1.0 / 40.0
    dispersion = exact["dispersion"] * diameter**2 * found.charge_transfer * density
    conduction = exact["triboconductivity"] * diameter * found.field_transfer * density
    assert 1.0 / dispersion == pytest.approx(3e4, rel=1e-12)
    assert 1.0 / conduction == pytest.approx(5.0, rel=1e-12)


def test_a_box_of_another_length_holds_the_same_spheres():
    one, two = (
        Parameters.of(Case(**data(grid={"points": [32], "lengths": [length]})))
        for length in (1.0, 2.0)
    )
    assert two.diameter == 0.5 * one.diameter
    assert replace(two, length=1.0, diameter=one.diameter, cells=one.cells) == one


@given(st.integers(3, 12), st.integers(0, 10**6))
def test_initial_fields_are_read_between_the_points(points, seed):
    """Against the sum over all modes, at random places."""
    random = np.random.default_rng(seed)
    values, place = random.standard_normal(points), random.random(7)
    waves = np.fft.fftfreq(points, 1 / points)
    modes = np.fft.fft(values) / points
    expected = (modes * np.exp(2j * np.pi * waves * place[:, np.newaxis])).sum(axis=1).real
    assert evaluate(values, place) == pytest.approx(expected, abs=1e-10)
