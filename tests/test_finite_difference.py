"""Finite differences against the Fourier discretisation, in space and in time."""

from functools import cache

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.fields import (
    CASE_A,
    CASE_B,
    EVERYTHING,
    by_fourier,
    difference_rates,
    fourier_rates,
    full_model,
    largest_difference,
    sine_state,
    smooth_field,
    smooth_state,
)
from triboflux.calculus import FourierCalculus
from triboflux.grid import Grid
from triboflux.integrators.finite_difference import (
    FiniteDifferences,
    integrate_finite_differences,
)
from triboflux.models import Model
from triboflux.moments import Moments

# Unequal lengths and numbers of points, the second grid twice as fine.
GRIDS = {
    d: [Grid(tuple(refine * n for n in (22, 24, 26)[:d]), (0.8, 1.0, 1.3)[:d]) for refine in (1, 2)]
    for d in (1, 2, 3)
}
HIGHEST = 2  # modes per axis of the fields to differentiate

# From an implicit Runge-Kutta method on a Fourier collocation that is not part of the package.
STOP_TIMES = {"derived": 0.188441749325, "published": 0.165301694345}

OPERATORS = {
    "gradient": lambda d, f, v: d.gradient(f),
    "divergence": lambda d, f, v: d.divergence(v),
    "laplacian": lambda d, f, v: d.laplacian(f),
    "vector laplacian": lambda d, f, v: d.laplacian(v),
    "gradient of divergence": lambda d, f, v: d.gradient(d.divergence(v)),
    "potential": lambda d, f, v: d.potential(f),
    "electric field": lambda d, f, v: d.electric_field(f),
    "without mean": lambda d, f, v: d.without_mean(f),
}


@eqx.filter_jit
def by_differences(model, state, grid, t_end, stop=None):
    return integrate_finite_differences(
        model, state, grid, t_end=t_end, rtol=1e-11, atol=1e-13, stop_at_peak_charge=stop
    )


@eqx.filter_jit
def all_operators(grid, scalar, vector):
    """Return every operator on a scalar and a vector, by differences and by Fourier transforms."""
    fourier, differences = FourierCalculus(grid), FiniteDifferences(grid)
    coefficients = grid.to_spectral(scalar), grid.to_spectral(vector)
    ours = {name: f(differences, scalar, vector) for name, f in OPERATORS.items()}
    exact = {name: grid.to_fields(f(fourier, *coefficients)) for name, f in OPERATORS.items()}
    return ours, exact


@cache
def operator_errors(dimensions):
    """Return the error of every operator on the coarse and on the fine grid."""
    errors = {name: [] for name in OPERATORS}
    for grid in GRIDS[dimensions]:
        scalar = smooth_field(grid, HIGHEST, 3)
        vector = np.stack([smooth_field(grid, HIGHEST, (4, i)) for i in range(dimensions)])
        ours, exact = all_operators(grid, jnp.asarray(scalar), jnp.asarray(vector))
        for name, found in errors.items():
            found.append(largest_difference(ours[name], exact[name]))
    return errors


def order(coarse_error, fine_error):
    return np.log2(coarse_error / fine_error)


@pytest.mark.parametrize("name", [name for name in OPERATORS if name != "without mean"])
@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_operators_are_of_sixth_order(dimensions, name):
    errors = operator_errors(dimensions)[name]
    assert 5.5 < order(*errors) < 6.5
    assert errors[1] < 1e-4


@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_mean_is_taken_off_exactly(dimensions):
    assert max(operator_errors(dimensions)["without mean"]) < 1e-14


@pytest.mark.parametrize("closures", ["derived", "published"])
@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_right_hand_side_is_of_sixth_order(dimensions, closures):
    model = full_model(EVERYTHING, closures, dimensions)
    errors = {"charge": [], "covariance": [], "variance": []}
    for grid in GRIDS[dimensions]:
        state = smooth_state(grid, HIGHEST)
        ours, exact = difference_rates(model, grid, state), fourier_rates(model, grid, state)
        for name, found in errors.items():
            found.append(largest_difference(getattr(ours, name), getattr(exact, name)))
    for name, found in errors.items():
        assert 5.5 < order(*found) < 6.5, name


@pytest.mark.parametrize("points", [(32,), (33,), (1,), (12, 15), (8, 9, 10), (6, 1, 5)])
def test_potential_solves_the_discrete_equation_exactly(points):
    grid = Grid(points, (0.8, 1.0, 1.3)[: len(points)])
    differences = FiniteDifferences(grid)
    charge = jnp.asarray(np.random.default_rng(5).normal(size=points))
    left = differences.laplacian(differences.potential(charge))
    assert np.allclose(left, -(charge - charge.mean()), rtol=0.0, atol=1e-12)
    field = differences.electric_field(charge)
    assert np.max(np.abs(np.mean(field, axis=tuple(range(1, field.ndim))))) < 1e-15


@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_total_charge_is_constant(dimensions):
    # The net charge is not zero: conduction must not drain it.
    grid = Grid((16, 14, 12)[:dimensions], (0.8, 1.0, 1.3)[:dimensions])
    state = smooth_state(grid, HIGHEST)
    mean = jnp.mean(state.charge)
    assert abs(mean) > 1e-2
    model = full_model(EVERYTHING, dimensions=dimensions)
    outcome = by_differences(model, state, grid, jnp.asarray(0.01))
    assert largest_difference(outcome.fields.charge, state.charge) > 0.01
    assert abs(jnp.mean(outcome.fields.charge) - mean) < 1e-13


@pytest.mark.parametrize("closures", ["derived", "published"])
def test_case_b_approaches_fourier_at_sixth_order(closures):
    fine, t_end = Grid((128,), (1.0,)), jnp.asarray(0.05)
    model = full_model(CASE_B, closures)
    _, reference = by_fourier(model, sine_state(fine), fine, t_end, 1e-11, 1e-14)
    errors = []
    for points in (32, 64, 128):
        grid = Grid((points,), (1.0,))
        found = by_differences(model, sine_state(grid), grid, t_end).fields
        shared = jax.tree.map(lambda a, s=128 // points: a[..., ::s], reference)
        errors.append(largest_difference(found, shared))
    assert 5.5 < order(*errors[:2]) < 6.5
    assert 5.5 < order(*errors[1:]) < 6.5
    assert errors[2] < 2e-9


@pytest.mark.parametrize("closures", ["derived", "published"])
def test_stop_time_of_case_b(closures):
    grid = Grid((128,), (1.0,))
    outcome = by_differences(
        full_model(CASE_B, closures), sine_state(grid), grid, jnp.asarray(1.0), jnp.asarray(0.5)
    )
    assert outcome.stats["stopped"]
    # The error of the differences, 1.1e-9 and -2.5e-10 relative, falls by 64 per halving.
    assert abs(outcome.time / STOP_TIMES[closures] - 1.0) < 2e-9
    assert abs(jnp.max(jnp.abs(outcome.fields.charge)) - 0.5) < 1e-11


def test_a_run_that_does_not_reach_the_stop_value_ends_at_the_end_time():
    grid = Grid((128,), (1.0,))
    outcome = by_differences(
        full_model(CASE_B), sine_state(grid), grid, jnp.asarray(0.02), jnp.asarray(0.5)
    )
    assert not outcome.stats["stopped"]
    assert outcome.time == 0.02


def test_start_of_case_a():
    grid, t_end = Grid((128,), (1.0,)), jnp.asarray(0.02)
    model = full_model(CASE_A, "published")
    _, exact = by_fourier(model, sine_state(grid), grid, t_end, 1e-11, 1e-14)
    found = by_differences(model, sine_state(grid), grid, t_end).fields
    # What sixth-order differences leave: (2π/128)**6/140 = 1.0e-10, in products a multiple of it.
    assert largest_difference(found, exact) < 5e-10
    assert largest_difference(found.charge, exact.charge) < 1e-12


def test_an_explicit_run_that_needs_too_many_steps_is_refused():
    grid = Grid((16,), (1.0,))
    with pytest.raises(RuntimeError, match="maximum number of solver steps"):
        integrate_finite_differences(
            full_model(CASE_A), sine_state(grid), grid, t_end=1.0, max_steps=10
        )


def test_products_are_taken_on_the_points():
    differences = FiniteDifferences(Grid((8,), (1.0,)))
    values = jnp.asarray(np.random.default_rng(6).normal(size=(2, 8)))
    assert differences.values(values) is values
    assert differences.from_values(values) is values


def test_moments_that_a_model_does_not_evolve_are_left_out():
    grid = Grid((16,), (1.0,))
    model = full_model(CASE_B)
    terms = tuple(t for t in model.terms if t.moment == t.source == "charge")
    alone = Model("charge alone", ("charge",), terms, model.coefficients)
    outcome = integrate_finite_differences(alone, sine_state(grid), grid, t_end=1.0)
    assert isinstance(outcome.fields, Moments)
    assert outcome.fields.covariance is None
    assert outcome.fields.variance is None
