"""Exact solutions against the solver, against each other and against independent formulas."""

import decimal
import math

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.fields import (
    CASE_A,
    CASE_B,
    EVERYTHING,
    by_fourier,
    difference_rates,
    full_model,
    largest_difference,
)
from triboflux import InputError, exact
from triboflux.calculus import FourierCalculus
from triboflux.case import ComponentMode, Mode
from triboflux.grid import Grid
from triboflux.initial_state import sum_of_modes
from triboflux.models.terms import evaluate
from triboflux.moments import Moments

LENGTHS, POINTS = (0.8, 1.0, 1.3), (18, 16, 14)
OBLIQUE = ((1, -2, 3), (2, 1, -1), (-3, 0, 2), (4, 2, 0))
LINEAR = EVERYTHING | {"energy_ratio": 0.0}
LINEAR_B = CASE_B | {"energy_ratio": 0.0}


def linear_solution(model, dimensions):
    """Return a solution of several oblique modes of charge and covariance, and a net charge."""
    modes = [m[:dimensions] for m in OBLIQUE]
    amplitudes = [(1.0, 0.3), (-0.4, 0.6), (0.2, -0.7), (0.5, 0.1)]
    charge = [
        Mode(mode=m, sine=s, cosine=c) for m, (s, c) in zip(modes[:3], amplitudes, strict=False)
    ]
    charge.append(Mode(mode=(0,) * dimensions, cosine=0.2))
    covariance = [
        ComponentMode(mode=m, component=i % dimensions, sine=c, cosine=-s)
        for i, (m, (s, c)) in enumerate(zip(modes, amplitudes, strict=True))
    ]
    covariance.append(ComponentMode(mode=(0,) * dimensions, component=dimensions - 1, cosine=0.4))
    lengths = LENGTHS[:dimensions]
    return exact.LinearSolution(model.coefficients, lengths, charge, covariance)


@pytest.mark.parametrize(
    ("numbers", "closures"), [(LINEAR, "derived"), (LINEAR, "published"), (LINEAR_B, "published")]
)
@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_linear_solution_is_that_of_the_solver(dimensions, numbers, closures):
    model = full_model(numbers, closures, dimensions)
    grid = Grid(POINTS[:dimensions], LENGTHS[:dimensions])
    solution, time = linear_solution(model, dimensions), 0.07
    charge, covariance = map(jnp.asarray, solution.fields(0.0, grid.coordinates()))
    state = Moments(charge, covariance, jnp.full(grid.points, 2.0))
    # Loose on purpose: the linear part is exact whatever the steps, which the variance sets.
    _, final = by_fourier(model, state, grid, time, 1e-3, 1e-3)
    expected = solution.fields(time, grid.coordinates())
    assert largest_difference(expected[0], charge) > 0.1
    assert largest_difference(final.charge, expected[0]) < 1e-12
    assert largest_difference(final.covariance, expected[1]) < 1e-12


@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_linear_solution_starts_from_its_modes(dimensions):
    grid = Grid(POINTS[:dimensions], LENGTHS[:dimensions])
    solution = linear_solution(full_model(LINEAR, dimensions=dimensions), dimensions)
    charge, covariance = solution.fields(0.0, grid.coordinates())
    assert np.allclose(charge, sum_of_modes(solution.charge, grid), rtol=0.0, atol=1e-13)
    for i, component in enumerate(covariance):
        modes = [mode for mode in solution.covariance if mode.component == i]
        assert np.allclose(component, sum_of_modes(modes, grid), rtol=0.0, atol=1e-13)


MATRICES = {
    "zero": [[0.0, 0.0], [0.0, 0.0]],
    "diagonal": [[-1.0, 0.0], [0.0, -3.0]],
    "unit": [[-2.0, 0.0], [0.0, -2.0]],
    "Jordan block": [[-1.0, 1.0], [0.0, -1.0]],
    "coinciding": [[-1.0, 1.0], [-1.0, -3.0]],
    "nearly coinciding": [[-1.0, 1.0], [-1.0 + 1e-13, -3.0]],
    "nearly coinciding, complex": [[-1.0, 1.0], [-1.0 - 1e-13, -3.0]],
    "nearly nilpotent": [[3.3, 1.0], [-(3.3**2) + 1e-13, -3.3 - 1e-7]],
    "rotation": [[0.0, 4.0], [-4.0, 0.0]],
    "spiral": [[-1.0, 7.0], [-3.0, -2.0]],
    "growing": [[2.0, 1.0], [1.0, 1.0]],
    "saddle": [[-2.0, 1.0], [3.0, 1.0]],
}


def precise_exponential(matrix, time):
    """Return exp(t M) by scaling, Taylor series and squaring with a hundred digits."""
    with decimal.localcontext(decimal.Context(prec=100)):
        exact_entries = [decimal.Decimal(float(x)) for x in np.ravel(matrix)]
        scaled = np.array(exact_entries, dtype=object).reshape(2, 2) * decimal.Decimal(time)
        scaled = scaled / 2**40
        term = total = np.array([[decimal.Decimal(i == j) for j in (0, 1)] for i in (0, 1)])
        for n in range(1, 15):
            term = term @ scaled / n
            total = total + term
        for _ in range(40):
            total = total @ total
        return total.astype(float)


@pytest.mark.parametrize("time", [0.0, 0.3, 2.0])
@pytest.mark.parametrize("name", MATRICES)
def test_exponential_of_special_matrices(name, time):
    matrix = np.array(MATRICES[name])
    found, expected = exact.exponential(matrix, time), precise_exponential(matrix, time)
    assert np.max(np.abs(found - expected)) <= 5e-15 * np.max(np.abs(expected))


@given(st.lists(st.floats(-8.0, 8.0), min_size=4, max_size=4), st.floats(0.0, 2.0))
def test_exponential_of_any_matrix(entries, time):
    matrix = np.array(entries).reshape(2, 2)
    found, expected = exact.exponential(matrix, time), precise_exponential(matrix, time)
    assert np.max(np.abs(found - expected)) <= 1e-13 * np.max(np.abs(expected))


def test_exponential_keeps_the_accuracy_of_a_slow_mode_in_a_stiff_system():
    matrix = exact.linear_matrix(full_model(CASE_A).coefficients, 2.0 * math.pi)
    found, expected = exact.exponential(matrix, 50.0), precise_exponential(matrix, 50.0)
    assert np.allclose(found, expected, rtol=1e-14, atol=2e-16)


def test_homogeneous_decay():
    model = full_model(EVERYTHING, dimensions=2)
    grid, time, start = Grid(POINTS[:2], LENGTHS[:2]), 0.03, (0.3, -0.2)
    ones = jnp.ones(grid.points)
    state = Moments(0.1 * ones, jnp.stack([x * ones for x in start]), 1.5 * ones)
    covariance, variance = exact.homogeneous_decay(model.coefficients, start, 1.5, time)
    _, spectral = by_fourier(model, state, grid, time, 1e-8, 1e-11)
    assert np.allclose(spectral.charge, 0.1, rtol=1e-13, atol=0.0)
    assert np.allclose(spectral.variance, variance, rtol=1e-12, atol=0.0)
    assert np.allclose(spectral.covariance, covariance[:, None, None], rtol=1e-12, atol=1e-14)
    # A state that decays at constant rates is known from its derivative too.
    rates = difference_rates(model, grid, state)
    slopes = exact.homogeneous_decay(model.coefficients, start, 1.5, 1e-7)
    assert np.allclose(rates.charge, 0.0, rtol=0.0, atol=1e-12)
    assert np.allclose(rates.variance, (slopes[1] - 1.5) / 1e-7, rtol=1e-4, atol=0.0)
    slope = (slopes[0] - np.array(start))[:, None, None] / 1e-7
    assert np.allclose(rates.covariance, slope, rtol=1e-4, atol=0.0)


@pytest.mark.parametrize("closures", ["derived", "published"])
def test_gradient_decay_rate_is_that_of_the_terms_with_covariance_in_equilibrium(closures):
    model = full_model(EVERYTHING, closures, 2)
    grid = Grid((16, 12), (0.8, 1.0))
    calculus = FourierCalculus(grid)
    mode = Mode(mode=(2, -1), sine=0.6, cosine=0.3)
    charge = grid.to_spectral(jnp.asarray(sum_of_modes([mode], grid)))
    production = tuple(t for t in model.terms if t.moment == "covariance" and t.source == "charge")
    covariance = evaluate(production, calculus, Moments(charge)).covariance
    covariance = covariance / model.coefficients.covariance_destruction
    terms = tuple(t for t in model.terms if t.moment == "charge")
    change = evaluate(terms, calculus, Moments(charge, covariance)).charge
    k = np.linalg.norm(exact.wave_vector(mode, grid.lengths))
    expected = -exact.gradient_decay_rate(model.coefficients, k) * charge
    assert largest_difference(change, expected) < 1e-13


def test_gradient_model_is_the_limit_of_frequent_collisions():
    k, differences = 2.0 * math.pi, []
    for tau_c in (1e-3, 1e-4):
        coefficients = full_model(CASE_A | {"tau_c": tau_c}).coefficients
        slowest = np.linalg.eigvals(exact.linear_matrix(coefficients, k)).max()
        differences.append(abs(-slowest / exact.gradient_decay_rate(coefficients, k) - 1.0))
    assert differences[1] < 1e-5
    assert 1.9 < math.log10(differences[0] / differences[1]) < 2.1


def test_free_streaming_of_the_papers_initial_charge():
    x = np.linspace(0.0, 1.0, 41)
    charge = exact.free_streaming([Mode(mode=(1,), sine=-1.0)], (1.0,), 0.13, (x,))
    expected = -np.sin(2.0 * np.pi * x) * math.exp(-2.0 * math.pi**2 * 0.13**2)
    assert np.allclose(charge, expected, rtol=0.0, atol=1e-15)


def test_free_streaming_averages_over_a_maxwellian():
    modes = [Mode(mode=(1, -2), sine=0.7, cosine=0.4), Mode(mode=(0, 1), cosine=-0.5)]
    lengths, time = (0.8, 1.3), 0.09
    x, y = np.linspace(0.0, 0.8, 9), np.linspace(0.0, 1.3, 7)
    velocities, weights = np.polynomial.hermite_e.hermegauss(40)
    weights = weights / weights.sum()
    average = np.zeros((len(x), len(y)))
    for u, from_u in zip(velocities, weights, strict=True):
        for v, from_v in zip(velocities, weights, strict=True):
            origin = (x - u * time, y - v * time)
            average += from_u * from_v * exact.free_streaming(modes, lengths, 0.0, origin)
    found = exact.free_streaming(modes, lengths, time, (x, y))
    assert np.allclose(found, average, rtol=0.0, atol=1e-13)


def test_modes_that_do_not_fit_the_box_are_refused():
    coefficients = full_model(LINEAR).coefficients
    mode, two = Mode(mode=(1,), sine=1.0), Mode(mode=(1, 2), sine=1.0)
    component = ComponentMode(mode=(1,), component=1, sine=1.0)
    with pytest.raises(InputError, match=r"charge: the mode \[1, 2\] .* per dimension, 1\."):
        exact.LinearSolution(coefficients, (1.0,), [two])
    with pytest.raises(InputError, match=r"covariance: the component 1 .* dimensions, 1"):
        exact.LinearSolution(coefficients, (1.0,), [mode], [component])
    with pytest.raises(InputError, match=r"charge: the mode \[1\] .* per dimension, 2\."):
        exact.free_streaming([mode], (1.0, 1.0), 0.0, (np.zeros(1), np.zeros(1)))
