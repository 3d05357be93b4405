"""The algebraic model where its variance makes sense, and where it does not."""

import dataclasses
import math
import sys

import jax.numpy as jnp
import numpy as np
import pytest

import triboflux
from examples.full_model_by_hand import coefficients as coefficients_by_hand
from tests import reduced_by_hand as by_hand
from tests.cases import data
from tests.fields import CASE_A, CASE_B, EVERYTHING
from triboflux import cli, exact, models
from triboflux.case import Case
from triboflux.errors import InputError, OutOfRangeError
from triboflux.integrate import Settings
from triboflux.models import Product, Term
from triboflux.models import operators as o
from triboflux.models import terms as t
from triboflux.models.reduced import gradient
from triboflux.numbers import Numbers

INFINITE = {"tau_p": math.inf, "tau_sigma": math.inf}
PAPER_CASES = {
    f"{name} {closures}": (numbers, closures)
    for name, numbers in (("A", CASE_A), ("B", CASE_B))
    for closures in ("published", "derived")
}
IMPOSSIBLE = [name for name in PAPER_CASES if name != "A derived"]


def paper_case(name, **changes):
    """Return one of the paper's cases with the algebraic model; all runs share a program."""
    numbers, closures = PAPER_CASES[name]
    given = {"model": "algebraic", "closures": closures, "numbers": numbers, "grid__points": [32]}
    run = {"run__t_end": 200.0, "run__stop_at_peak_charge": 0.5, "run__outputs": 3}
    return Case(**data(**(given | run | changes)))


def close(found, expected, tolerance):
    """Compare profiles in the scale of the expected one."""
    atol = tolerance * np.max(np.abs(expected))
    np.testing.assert_allclose(found, expected, rtol=0, atol=atol)


def lowest_denominator(name):
    numbers, closures = PAPER_CASES[name]
    c = coefficients_by_hand(closures, numbers | INFINITE)
    return c["variance_destruction"] - 2.0 * c["force"] / c["covariance_destruction"]


# --- the initial closure, Fig. 6 ------------------------------------------------------------------


@pytest.mark.parametrize("name", PAPER_CASES)
def test_initial_closure_of_the_papers_cases(name):
    numbers, closures = PAPER_CASES[name]
    found = triboflux.initial_closure(paper_case(name))
    c = coefficients_by_hand(closures, numbers | INFINITE)
    x = np.arange(32) / 32
    np.testing.assert_allclose(found["x"], x, rtol=1e-15)
    # Q = -sin 2πx, E = cos(2πx)/2π and ∇Q = -2π cos 2πx in (7.9).
    squared, r = np.cos(2.0 * np.pi * x) ** 2, c["covariance_destruction"]
    above = 2.0 * c["gradient_production"] / r * 4.0 * np.pi**2 * squared
    below = c["variance_destruction"] - 2.0 * c["force"] / r * squared
    expected = above / below
    close(found["variance"], expected, 1e-10)
    field = np.cos(2.0 * np.pi * x) / (2.0 * np.pi)
    close(found["field"][0], field, 1e-13)
    flux = c["gradient_production"] * 2.0 * np.pi * np.cos(2.0 * np.pi * x)
    flux = (flux + c["force"] * expected * field) / r
    # Near a wave of no charge gradient the flux is a small difference of large numbers.
    close(found["covariance"][0], flux, 1e-8)
    # Only the derived case A is regular: 0.442 > 0.090.
    assert (below > 0.0).all() == (name == "A derived")
    assert (found.attrs["nonphysical"] == "") == (name == "A derived")
    assert (float(found["variance"].min()) < -0.1) == (name != "A derived")


def test_initial_closure_is_labelled_like_a_result():
    found = triboflux.initial_closure(paper_case("A published", title="Fig. 6a"))
    assert "time" not in found.dims
    assert "time" not in found.coords
    assert found["covariance"].dims == found["field"].dims == ("component", "x")
    assert found["variance"].dims == ("x",)
    assert found["variance"].attrs["scale"] == "Q0^2"
    assert found["x"].attrs["scale"] == "L"
    assert found.attrs["title"] == "Fig. 6a"
    assert found.attrs["trace_dimensions"] == 1
    assert Case.from_toml_text(found.attrs["case_toml"]).model == "algebraic"
    result = triboflux.solve(paper_case("A published"))
    assert set(found.data_vars) == set(result.dataset.data_vars)
    for name in found.data_vars:
        np.testing.assert_array_equal(found[name], result.dataset[name][0])


def test_initial_closure_in_two_dimensions():
    modes = [{"mode": [1, 2], "sine": 0.6}, {"mode": [0, 1], "cosine": 0.4}]
    numbers = EVERYTHING | {"energy_ratio": 3.0}
    case = Case(
        **data(
            model="algebraic",
            numbers=numbers,
            grid={"points": [20, 24], "lengths": [1.0, 1.5]},
            initial={"charge": modes},
        )
    )
    found = triboflux.initial_closure(case)
    box, c = by_hand.Box((20, 24), (1.0, 1.5)), coefficients_by_hand("derived", numbers)
    above, below = by_hand.algebraic_variance(box, found["charge"].values, c)
    assert found["variance"].dims == ("x", "y")
    close(found["variance"], above / below, 1e-10)


@pytest.mark.parametrize("model", [name for name in models.REGISTRY if name != "algebraic"])
def test_other_models_close_no_variance(model):
    with pytest.raises(InputError, match=rf"^model is '{model}', but must be 'algebraic', which"):
        triboflux.initial_closure(paper_case("A derived", model=model))


def test_initial_closure_checks_the_range_of_validity():
    case = paper_case("A derived", numbers=CASE_A | {"peclet": 20.0})
    with pytest.raises(OutOfRangeError, match="γΘ"):
        triboflux.initial_closure(case)


# --- runs -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", IMPOSSIBLE)
def test_singular_from_the_start(name):
    result = triboflux.solve(paper_case(name))
    assert result.status == "nonphysical"
    sentence = result.stop_reason
    assert sentence == (
        f"the denominator of the algebraic variance falls to {lowest_denominator(name):.3g} "
        "at x = 0, t = 0"
    )
    assert sentence == triboflux.initial_closure(paper_case(name)).attrs["nonphysical"]
    # What there is is recorded: the state that was refused.
    assert result.dataset.sizes["time"] == 1
    assert float(result.dataset["time"][0]) == 0.0
    assert result.stats["accepted"] == 0
    assert any("not realizable" in warning for warning in result.warnings)


def test_the_derived_case_a_runs():
    result = triboflux.solve(paper_case("A derived", run__rtol=1e-8))
    assert result.status == "ok"
    assert result.warnings == ()
    c = coefficients_by_hand("derived", CASE_A | INFINITE)
    time, charge, flux, variance, field = by_hand.solve_to_peak("algebraic", c, points=64)
    assert variance is not None
    last = result.dataset.isel(time=-1)
    assert float(last["time"]) == pytest.approx(time, rel=1e-7)
    close(last["charge"], charge[::2], 1e-6)
    close(last["variance"], variance[::2], 1e-6)
    close(last["covariance"][0], flux[0][::2], 1e-6)
    close(last["field"][0], field[0][::2], 1e-6)
    # At the start the variance is already there.
    closed = triboflux.initial_closure(paper_case("A derived"))
    np.testing.assert_array_equal(closed["variance"], result.dataset["variance"][0])
    assert float(closed["variance"].max()) == pytest.approx(0.0336267, rel=1e-5)


def test_the_command_line_says_so_and_keeps_the_file(tmp_path, capsys, monkeypatch):
    (tmp_path / "case.toml").write_text(paper_case("B published").to_toml())
    monkeypatch.setenv("TRIBOFLUX_CACHE_DIR", "off")
    paths = [str(tmp_path / "case.toml"), "-o", str(tmp_path / "out.nc")]
    monkeypatch.setattr(sys, "argv", ["triboflux", "run", *paths])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    code = ended.value.code
    assert code == 3
    told = "".join(capsys.readouterr())
    assert "nonphysical" in told
    assert "the denominator of the algebraic variance falls to -90" in told
    loaded = triboflux.load(tmp_path / "out.nc")
    assert loaded.status == "nonphysical"
    assert loaded.dataset["variance"].shape == (1, 32)


def test_place_in_two_dimensions():
    modes = [{"mode": [1, 1], "cosine": 1.0, "sine": 0.5}, {"mode": [0, 2], "sine": 1.0}]
    modes += [{"mode": [1, 0], "sine": 0.3}]
    case = Case(
        **data(
            model="algebraic",
            numbers=CASE_A | {"energy_ratio": 1e3},
            grid={"points": [16, 18], "lengths": [1.0, 1.5]},
            initial={"charge": modes},
        )
    )
    result = triboflux.solve(case)
    assert result.status == "nonphysical"
    box, c = (
        by_hand.Box((16, 18), (1.0, 1.5)),
        coefficients_by_hand(
            "derived", case.numbers.model_dump() | {"tau_p": math.inf, "tau_sigma": math.inf}
        ),
    )
    charge = result.dataset["charge"][0].values
    _, below = by_hand.algebraic_variance(box, charge, c)
    i, j = np.unravel_index(np.argmax(below < below.min() + 1e-9), below.shape)
    where = f"falls to {below[i, j]:.3g} at x = {i / 16:.4g}, {j * 1.5 / 18:.4g}, t = 0"
    assert i * j > 0
    assert result.stop_reason.endswith(where)


# --- a limit that is reached on the way -----------------------------------------------------------
#
# As its denominator falls to zero, the algebraic variance rises and with it the flux along the
# field, which drives the denominator up again: no smooth state that makes sense becomes one that
# does not. The stop is therefore tried on the gradient model with a limit whose end is known.


def model_with_limit(coefficients, wave_number, lowest):
    """Return the gradient model, limited to a mode's |∇Q|² + k² Q² above `lowest` k²."""
    plain = gradient(coefficients)
    product = Product(
        "amplitude",
        ("charge", t.CHARGE_GRADIENT),
        lambda q, g: jnp.sum(g**2, axis=0) + wave_number**2 * (q**2 - lowest),
    )
    limit = Term("the amplitude", "", "", "variance", o.IDENTITY, product, 1.0)
    return dataclasses.replace(plain, name="algebraic", limits=(limit,))


@pytest.mark.parametrize("rtol", [1e-5, 1e-9])
def test_a_run_that_breaks_a_limit_is_stopped_there(monkeypatch, rtol):
    k = 2.0 * math.pi
    monkeypatch.setitem(models.REGISTRY, "gradient", lambda c: model_with_limit(c, k, 0.3))
    times = {"run__outputs": [0.0, 0.01, 0.02, 0.5], "run__t_end": 1.0, "run__rtol": rtol}
    result = triboflux.solve(Case(**data(model="gradient", grid__points=[12], **times)))
    assert result.status == "nonphysical"
    rate = exact.gradient_decay_rate(models.build("full", Numbers(**CASE_B)).coefficients, k)
    time = -0.5 * math.log(0.3) / rate
    assert "the amplitude falls to " in result.stop_reason
    assert result.stop_reason.endswith(f"t = {time:.6g}")
    # Everything up to there is kept, and the last time is that of the stop.
    times = result.dataset["time"].values
    np.testing.assert_allclose(times, [0.0, 0.01, 0.02, time], rtol=max(1e-2 * rtol, 1e-9))
    amplitude = abs(result.dataset["charge"]).max("x")
    np.testing.assert_allclose(amplitude, np.exp(-rate * times), rtol=1e-9)
    assert float(amplitude[-1]) ** 2 == pytest.approx(0.3, rel=max(1e-2 * rtol, 1e-8))


@pytest.mark.parametrize("seed", range(4))
def test_a_variance_that_makes_sense_goes_on_to(seed):
    # Close to the singularity at the start, and away from it later.
    generator = np.random.default_rng(seed)
    amplitudes = generator.normal(size=(3, 2)) / np.arange(1, 4)[:, None]
    modes = [
        {"mode": [i + 1], "sine": float(a), "cosine": float(b)}
        for i, (a, b) in enumerate(amplitudes)
    ]
    case = paper_case("A derived", initial={"charge": modes})
    first = triboflux.initial_closure(case)
    box, c = by_hand.Box((32,), (1.0,)), coefficients_by_hand("derived", CASE_A | INFINITE)

    def lowest(charge, u):
        _, below = by_hand.algebraic_variance(box, charge, c | {"force": u})
        return float(below.min()) / c["variance_destruction"]

    charge = first["charge"].values
    u = 300.0 * 0.98 / (1.0 - lowest(charge, 300.0))
    assert lowest(charge, u) == pytest.approx(0.02, rel=1e-9)
    result = triboflux.solve(
        case.model_copy(
            update={
                "numbers": Numbers(**(CASE_A | {"energy_ratio": u})),
                "run": case.run.model_copy(
                    update={"t_end": 20.0, "outputs": 3, "stop_at_peak_charge": 1e-3}
                ),
            }
        )
    )
    assert result.status == "ok"
    later = [lowest(charge, u) for charge in result.dataset["charge"].values]
    assert later[0] < 0.03 < later[1] < later[2]


def test_integrate_stops_at_once_where_the_closure_makes_no_sense():
    numbers, closures = PAPER_CASES["A published"]
    model = models.build("algebraic", Numbers(**numbers), closures)
    grid = triboflux.Grid((32,), (1.0,))
    zero = jnp.zeros(32)
    start = triboflux.Moments(-jnp.sin(2.0 * jnp.pi * grid.coordinates()[0]), zero[None], zero)
    outcome = triboflux.integrate(
        model, start, grid, Settings(t_end=400.0, outputs=jnp.array([0.0, 400.0]))
    )
    assert bool(outcome.stopped["nonphysical"])
    assert bool(outcome.finished)
    assert (float(outcome.carry.time), int(outcome.accepted)) == (0.0, 0)
    assert float(jnp.max(outcome.times)) == 0.0
