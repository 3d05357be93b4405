"""The reduced models: their right-hand sides, limits, exact solutions and conserved quantities."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from examples.full_model_by_hand import coefficients as coefficients_by_hand
from tests import reduced_by_hand as by_hand
from tests.fields import (
    CASE_B,
    EVERYTHING,
    difference_rates,
    fourier_rates,
    largest_difference,
)
from tests.reduced import (
    BOXES,
    LENGTH,
    MODES,
    POINTS,
    WEAK,
    all_fields,
    build,
    final,
    uneven,
)
from tests.semilinear import orders
from triboflux import exact, models
from triboflux.calculus import FourierCalculus
from triboflux.case import Mode
from triboflux.grid import Grid
from triboflux.integrate import semilinear_term
from triboflux.models import Model
from triboflux.moments import Moments

MODELS = by_hand.MODELS
dimensions = pytest.mark.parametrize("dimensions", BOXES)
every_model = pytest.mark.parametrize("name", MODELS)
CASES = {
    "everything": (WEAK, "derived", 0.8),
    "another contact law": (WEAK | {"restitution": 0.6}, "derived", 1.3),
    "as printed": (WEAK | {"energy_ratio": 0.5}, "published", 0.8),
}


@eqx.filter_jit
def margin_of(model, grid, state):
    return model.margin(FourierCalculus(grid), jax.tree.map(grid.to_spectral, state))


# --- the right-hand side --------------------------------------------------------------------------


@dimensions
@every_model
@pytest.mark.parametrize("case", CASES)
def test_right_hand_side_by_hand(case, name, dimensions):
    numbers, closure_set, exponent = CASES[case]
    grid = BOXES[dimensions]
    model = build(name, numbers, closure_set, dimensions, exponent)
    c = coefficients_by_hand(closure_set, numbers, exponent)
    state = uneven(grid, name, highest=2, mean=0.1)
    if name == "algebraic":
        assert float(margin_of(model, grid, state)) > 1e-5
    found = fourier_rates(model, grid, state)
    box = by_hand.Box(grid.points, grid.lengths)
    given = np.asarray(state.charge), np.asarray(state.variance)
    charge, variance = by_hand.rates(name, box, *given, c)
    assert largest_difference(found.charge, charge) < 1e-12
    if name == "semi-algebraic":
        assert largest_difference(found.variance, variance) < 1e-12
    else:
        assert found.variance is None
    assert found.covariance is None


@dimensions
@every_model
def test_closed_moments_by_hand(name, dimensions):
    grid = BOXES[dimensions]
    model = build(name, WEAK, dimensions=dimensions)
    c = coefficients_by_hand("derived", WEAK)
    state = uneven(grid, name, highest=2)
    found = all_fields(model, grid, state)
    box = by_hand.Box(grid.points, grid.lengths)
    charge, variance = np.asarray(state.charge), np.asarray(state.variance)
    assert largest_difference(found.charge, charge) < 1e-13
    if name == "algebraic":
        above, below = by_hand.algebraic_variance(box, charge, c)
        variance = above / below
    if name in ("algebraic", "semi-algebraic"):
        assert largest_difference(found.variance, variance) < 1e-12
    else:
        assert found.variance is None
    if name == "collisional":
        assert found.covariance is None
    else:
        expected = by_hand.covariance(name, box, charge, variance, c)
        assert largest_difference(found.covariance, expected) < 1e-12


def test_the_algebraic_moments_balance_the_equations_that_they_close():
    # Without time derivatives and dispersion: the covariance's and the variance's other terms.
    grid, full = BOXES[2], build("full", WEAK, dimensions=2)
    found = all_fields(build("algebraic", WEAK, dimensions=2), grid, uneven(grid, "algebraic"))
    c, box = full.coefficients, by_hand.Box(grid.points, grid.lengths)
    charge, flux, variance = (np.asarray(f) for f in jax.tree.leaves(found))
    slope, e = box.gradient(charge), box.field(charge)
    drive = -float(c.gradient_production) * slope
    drive += (float(c.field_production) + float(c.electric_force) * variance) * e
    assert largest_difference(float(c.covariance_destruction) * flux, drive) < 1e-12
    produced = float(c.variance_field_production) * np.sum(e**2, axis=0)
    produced -= 2.0 * np.sum(flux * slope, axis=0)
    assert largest_difference(float(c.variance_destruction) * variance, produced) < 1e-11


@every_model
def test_sum_of_terms_is_the_right_hand_side(name):
    grid = BOXES[1]
    model, state = build(name, WEAK), uneven(BOXES[1], name)
    total = fourier_rates(model, grid, state)
    calculus = FourierCalculus(grid)
    coefficients = jax.tree.map(grid.to_spectral, state)
    parts = [models.evaluate((term,), calculus, coefficients) for term in model.terms]
    for moment in model.evolves:
        values = [getattr(part, moment) for part in parts if getattr(part, moment) is not None]
        summed = grid.to_fields(jnp.sum(jnp.stack(values), axis=0))
        assert largest_difference(summed, getattr(total, moment)) < 1e-13
        named = [term.name for term in model.terms if term.moment == moment]
        assert len(set(named)) == len(named)
    # And the integrator's split is the same sum.
    split = semilinear_term(model, grid).vf(0.0, coefficients, None)
    for moment in model.evolves:
        again = grid.to_fields(getattr(split, moment))
        assert largest_difference(again, getattr(total, moment)) < 1e-13


@dimensions
@every_model
def test_no_term_makes_charge(name, dimensions):
    grid = BOXES[dimensions]
    model, state = build(name, WEAK, dimensions=dimensions), uneven(grid, name, mean=0.2)
    rates = eqx.filter_jit(Model.right_hand_side)(
        model, FourierCalculus(grid), jax.tree.map(grid.to_spectral, state)
    )
    assert float(jnp.max(jnp.abs(rates.charge))) > 0.05
    assert not rates.charge[(slice(None),) + (0,) * dimensions].any()
    # By differences the sum over the points vanishes to round-off.
    rate = difference_rates(model, grid, state).charge
    assert abs(float(jnp.mean(rate))) < 1e-13 * float(jnp.max(jnp.abs(rate)))


@dimensions
@every_model
def test_total_charge_is_constant(name, dimensions):
    grid, mean = BOXES[dimensions], 0.2
    model, state = build(name, WEAK, dimensions=dimensions), uneven(grid, name, mean=mean)
    charge = final(model, state, grid, 0.1, 5).charge
    assert abs(float(jnp.mean(charge)) - mean) < 1e-14
    assert largest_difference(charge, state.charge) > 0.01


@every_model
def test_finite_difference_right_hand_side_at_sixth_order(name):
    errors = []
    for points in (48, 96):
        grid = Grid((points,), (0.8,))
        model, state = build(name, WEAK), uneven(grid, name, highest=2)
        pair = difference_rates(model, grid, state), fourier_rates(model, grid, state)
        errors.append([largest_difference(*(getattr(p, m) for p in pair)) for m in model.evolves])
    assert (orders(errors) > 5.5).all()
    assert (orders(errors) < 6.5).all()


# --- plane waves ----------------------------------------------------------------------------------


@pytest.mark.parametrize("dimensions", [2, 3])
@every_model
def test_plane_waves_are_those_of_one_dimension(name, dimensions):
    grid, line, mode = BOXES[dimensions], BOXES[1], MODES[dimensions]
    vector = np.array(mode) / np.array(grid.lengths)
    assert np.linalg.norm(vector) == pytest.approx(1.0 / LENGTH, rel=1e-14)
    # Every point of the box has the phase of a point of the line.
    indices = np.indices(grid.points)
    place = np.tensordot(np.sign(mode), indices, axes=1) % POINTS
    along = uneven(line, name)
    wave = jax.tree.map(lambda f: f[place], along)
    end = final(build(name, WEAK, dimensions=dimensions), wave, grid, 0.1, 5)
    line_end = final(build(name, WEAK), along, line, 0.1, 5)
    tolerance = 1e-12
    assert largest_difference(end.charge, line_end.charge[place]) < tolerance
    assert largest_difference(line_end.charge, along.charge) > 0.1
    if end.covariance is not None:
        turned = jnp.stack([x * LENGTH * line_end.covariance[0][place] for x in vector])
        assert largest_difference(end.covariance, turned) < tolerance
    if end.variance is not None:
        assert largest_difference(end.variance, line_end.variance[place]) < tolerance


# --- without electric force -----------------------------------------------------------------------


def wave_state(grid, mode):
    """Return a single mode of charge, and no variance."""
    turns = sum(
        m * x / length
        for m, x, length in zip(
            mode, np.meshgrid(*grid.coordinates(), indexing="ij"), grid.lengths, strict=True
        )
    )
    charge = np.sin(2.0 * np.pi * turns + 0.3)
    return Moments(jnp.asarray(charge), None, jnp.zeros(grid.points))


@dimensions
@pytest.mark.parametrize("numbers", [EVERYTHING, CASE_B], ids=["all terms", "case B"])
def test_without_force_three_models_give_the_exact_decay(numbers, dimensions):
    grid, mode = BOXES[dimensions], MODES[dimensions]
    numbers = numbers | {"energy_ratio": 0.0}
    state = wave_state(grid, mode)
    k = exact.wave_vector(Mode(mode=mode), grid.lengths)
    ends = {}
    for name in ("gradient", "algebraic", "semi-algebraic"):
        model = build(name, numbers, dimensions=dimensions)
        rate = exact.gradient_decay_rate(model.coefficients, float(np.linalg.norm(k)))
        # Two steps, as the products must not come in between either.
        ends[name] = final(model, state, grid, 1.0 / rate, 2)
        assert largest_difference(ends[name].charge, math.exp(-1.0) * state.charge) < 3e-14
        by_gradient, by_field = (
            float(x) / float(model.coefficients.covariance_destruction)
            for x in (model.coefficients.gradient_production, model.coefficients.field_production)
        )
        box = by_hand.Box(grid.points, grid.lengths)
        charge = math.exp(-1.0) * np.asarray(state.charge)
        expected = -by_gradient * box.gradient(charge) + by_field * box.field(charge)
        assert largest_difference(ends[name].covariance, expected) < 1e-13
    for name in ("algebraic", "semi-algebraic"):
        for moment in ("charge", "covariance"):
            pair = (getattr(ends[n], moment) for n in (name, "gradient"))
            assert largest_difference(*pair) < 1e-13
        assert float(jnp.max(ends[name].variance)) > 1e-3
