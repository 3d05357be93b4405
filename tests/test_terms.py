"""The terms of the full model one by one, and their sum."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.cases import NUMBERS
from tests.fields import EVERYTHING, full_model, smooth_state
from tests.runs import random_coefficients, run, settings
from triboflux import models
from triboflux.calculus import FourierCalculus
from triboflux.errors import InputError
from triboflux.grid import Grid
from triboflux.models import Model, Product, Term, evaluate
from triboflux.models.full import VARIANCE_TIMES_FIELD
from triboflux.models.operators import IDENTITY
from triboflux.models.terms import CHARGE_GRADIENT, FIELD, fields_of
from triboflux.moments import Moments
from triboflux.numbers import Numbers

GRIDS = [Grid((24,), (0.8,)), Grid((12, 15), (1.0, 2.0)), Grid((9, 8, 10), (1.0, 2.0, 0.7))]
grids = pytest.mark.parametrize("grid", GRIDS, ids=["1-D", "2-D", "3-D"])
# Twice the mode, which products reach, is still kept.
MODES = [(2,), (1, -2), (1, -1, 1)]

evaluated = eqx.filter_jit(evaluate)


def at_points(grid, values):
    return jax.tree.map(grid.to_fields, values)


@grids
def test_sum_of_terms_is_the_right_hand_side(grid):
    model, calculus = full_model(EVERYTHING, dimensions=grid.dimensions), FourierCalculus(grid)
    state = random_coefficients(grid)
    whole = eqx.filter_jit(Model.right_hand_side)(model, calculus, state)
    single = [evaluated((term,), calculus, state) for term in model.terms]
    for name in model.evolves:
        parts = [getattr(s, name) for s in single if getattr(s, name) is not None]
        size = max(float(jnp.max(jnp.abs(part))) for part in parts)
        np.testing.assert_allclose(sum(parts), getattr(whole, name), rtol=0, atol=1e-14 * size)


@grids
def test_split_of_the_integrator_is_the_right_hand_side(grid):
    model, calculus = full_model(EVERYTHING, dimensions=grid.dimensions), FourierCalculus(grid)
    state = random_coefficients(grid)
    groups = (model.linear_terms(), *model.sweeps())
    assert len(groups) == 3
    assert sum(map(len, groups)) == len(model.terms)
    parts = [evaluated(group, calculus, state) for group in groups]
    whole = evaluated(model.terms, calculus, state)
    total = parts[0] + parts[1] + parts[2]
    for name in model.evolves:
        expected = getattr(whole, name)
        size = float(jnp.max(jnp.abs(expected)))
        np.testing.assert_allclose(getattr(total, name), expected, rtol=0, atol=1e-13 * size)


def test_products_of_the_slaved_covariance_come_last():
    first, last = full_model(EVERYTHING).sweeps()
    assert [term.name for term in first] == ["electric force", "production by electric field"]
    assert [(term.moment, term.name) for term in last] == [
        ("variance", "production by charge gradient")
    ]


def single_mode_terms(model, k, angle):
    """Return every term of the equations by hand for one wave vector of charge.

    The state is Q = a cos φ, C = b cos φ with a vector b, V = v + w sin φ, where φ = k·x + 0.4.
    """
    a, v, w = 0.7, 0.4, 0.15
    b = np.linspace(0.3, -0.5, len(k))
    sine, cosine = np.sin(angle), np.cos(angle)
    vector = (slice(None),) + (None,) * angle.ndim
    c, k2 = jax.tree.map(float, model.coefficients), k @ k
    charge, covariance, variance = a * cosine, b[vector] * cosine, v + w * sine
    gradient = -a * k[vector] * sine
    # ∇·E = Q is solved by E = k a sin φ/|k|².
    field = a * k[vector] * sine / k2
    terms = {
        ("charge", "kinetic flux"): c.flux * (b @ k) * sine,
        ("charge", "triboconductivity"): -c.triboconductivity * charge,
        ("charge", "collisional dispersion"): -c.dispersion * k2 * charge,
        ("covariance", "production by charge gradient"): -c.gradient_production * gradient,
        ("covariance", "production by electric field"): c.field_production * field,
        ("covariance", "electric force"): c.electric_force * variance * field,
        ("covariance", "destruction"): -c.covariance_destruction * covariance,
        ("covariance", "dispersion"): -c.covariance_dispersion * k2 * covariance,
        ("covariance", "dispersion of the divergence"): -c.divergence_dispersion
        * (b @ k)
        * k[vector]
        * cosine,
        ("variance", "production by charge gradient"): -2 * np.sum(covariance * gradient, axis=0),
        ("variance", "production by electric field"): c.variance_field_production
        * np.sum(field**2, axis=0),
        ("variance", "destruction"): -c.variance_destruction * variance,
        ("variance", "collisional dispersion"): -c.variance_collisional_dispersion * k2 * w * sine,
        ("variance", "kinetic dispersion"): -k2 * w * sine / c.variance_flux_destruction,
    }
    return Moments(*map(jnp.asarray, (charge, covariance, variance))), terms


@pytest.mark.parametrize(
    ("grid", "mode"), list(zip(GRIDS, MODES, strict=True)), ids=["1-D", "2-D", "3-D"]
)
def test_each_term_of_a_single_wave_by_hand(grid, mode):
    model, calculus = full_model(EVERYTHING, dimensions=grid.dimensions), FourierCalculus(grid)
    k = 2 * np.pi * np.asarray(mode) / np.asarray(grid.lengths)
    x = np.stack(np.meshgrid(*grid.coordinates(), indexing="ij"))
    fields, expected = single_mode_terms(model, k, np.tensordot(k, x, axes=1) + 0.4)
    state = jax.tree.map(grid.to_spectral, fields)
    assert {(term.moment, term.name) for term in model.terms} == set(expected)
    for term in model.terms:
        found = at_points(grid, getattr(evaluated((term,), calculus, state), term.moment))
        by_hand = np.asarray(expected[term.moment, term.name])
        close = {"rtol": 0, "atol": 1e-12 * np.abs(by_hand).max()}
        np.testing.assert_allclose(found, by_hand, **close, err_msg=f"{term.moment}: {term.name}")
        assert np.abs(by_hand).max() > 1e-6, "a term that vanishes proves nothing"


@grids
def test_a_term_acts_on_its_moment_only(grid):
    model, calculus = full_model(EVERYTHING, dimensions=grid.dimensions), FourierCalculus(grid)
    state = random_coefficients(grid)
    for term in model.terms[:: len(model.terms) - 1]:
        found = evaluated((term,), calculus, state)
        acted_on = {name for name, value in vars(found).items() if value is not None}
        assert acted_on == {term.moment}


def test_fields_come_back_in_the_order_asked_for():
    grid = GRIDS[1]
    calculus, state = FourierCalculus(grid), random_coefficients(grid)
    names = ("variance", FIELD, "charge", "covariance", CHARGE_GRADIENT)
    found = eqx.filter_jit(fields_of)(calculus, state, names)
    expected = [
        state.variance,
        calculus.electric_field(state.charge),
        state.charge,
        state.covariance,
        calculus.gradient(state.charge),
    ]
    for f, e in zip(found, expected, strict=True):
        np.testing.assert_allclose(f, grid.to_fields(e), rtol=0, atol=1e-12)


@grids
def test_products_are_those_of_the_values_on_the_points(grid):
    # Scalars and vectors share one batch of transforms, so a wrong split would mix them up.
    calculus, state = FourierCalculus(grid), random_coefficients(grid)
    cubed = Product("Q V", ("charge", "variance"), lambda q, v: q * v)
    terms = (
        Term("a", "a", "", "covariance", IDENTITY, VARIANCE_TIMES_FIELD, 2.0),
        Term("b", "b", "", "charge", IDENTITY, cubed, -1.0),
        Term("c", "c", "", "variance", IDENTITY, cubed, 0.5),
    )
    found = evaluated(terms, calculus, state)
    values = at_points(grid, state)
    field = grid.to_fields(calculus.electric_field(state.charge))
    product = grid.to_spectral(values.charge * values.variance)
    close = {"rtol": 0, "atol": 1e-12 * float(jnp.max(jnp.abs(product)))}
    np.testing.assert_allclose(found.charge, -product, **close)
    np.testing.assert_allclose(found.variance, 0.5 * product, **close)
    expected = 2.0 * grid.to_spectral(values.variance[None] * field)
    np.testing.assert_allclose(found.covariance, expected, **close)


def test_names_of_terms_are_unique_within_an_equation():
    keys = [(term.moment, term.name) for term in full_model(EVERYTHING).terms]
    assert len(set(keys)) == len(keys)
    assert all(term.group and term.equation for term in full_model(EVERYTHING).terms)


def test_a_model_without_products_is_integrated_exactly():
    grid = Grid((16,), (1.0,))
    full = full_model(EVERYTHING)
    linear = Model("linear", full.evolves, full.linear_terms(), full.coefficients)
    assert linear.sweeps() == ()
    state = smooth_state(grid, 3)
    # Exact for any step: few steps, and the same answer in one go and in two.
    outcome = run(linear, state, grid, settings(0.4, outputs=[0.2]))
    assert int(outcome.accepted) < 40
    assert int(outcome.rejected) == 0
    half = jax.tree.map(lambda leaf: grid.to_fields(leaf[0]), outcome.outputs)
    again = run(linear, half, grid, settings(0.2, outputs=[0.2]))
    for name in linear.evolves:
        found, expected = (getattr(o.carry.coefficients, name) for o in (again, outcome))
        size = float(jnp.max(jnp.abs(expected)))
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * size)


@pytest.mark.parametrize("name", ["ful", "Full", "fulll"])
def test_unknown_model_proposes_the_nearest(name):
    with pytest.raises(InputError) as caught:
        models.build(name, Numbers(**NUMBERS))
    sentence = str(caught.value)
    assert f"'{name}' is not known" in sentence
    assert sentence.endswith("Did you mean 'full'?")
    assert "\n" not in sentence


def test_closure_sets_by_name_or_as_such():
    numbers = Numbers(**NUMBERS)
    for name in ("derived", "published"):
        by_name = models.build("full", numbers, name)
        as_such = models.build("full", numbers, models.closures.by_name(name, 1.0))
        assert by_name.coefficients == as_such.coefficients
    with pytest.raises(InputError, match="Did you mean 'derived'"):
        models.build("full", numbers, "derivd")
