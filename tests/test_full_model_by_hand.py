"""The model written out by hand, which knows nothing of the term list, against the package."""

import math

import jax.numpy as jnp
import numpy as np
import pytest

from examples import full_model_by_hand as by_hand
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
    smooth_state,
)
from triboflux.grid import Grid
from triboflux.moments import Moments

INFINITE = {"tau_p": math.inf, "tau_sigma": math.inf}
COLLISIONLESS = INFINITE | {"peclet": math.inf, "tau_c": math.inf, "tau_p": 0.2}
CASES = {
    "everything": (EVERYTHING, "derived", 0.8),
    "elastic": (EVERYTHING | {"restitution": 1.0}, "derived", 0.8),
    "perfectly inelastic": (EVERYTHING | {"restitution": 0.0}, "derived", 0.8),
    "another contact law": (EVERYTHING, "derived", 0.5),
    "steep contact law": (EVERYTHING | {"restitution": 0.6}, "derived", 1.3),
    "without conduction": (EVERYTHING | {"tau_sigma": math.inf}, "derived", 0.8),
    "without drag": (EVERYTHING | {"tau_p": math.inf}, "derived", 0.8),
    "without collisions": (EVERYTHING | COLLISIONLESS, "derived", 0.8),
    "as printed": (EVERYTHING, "published", 0.8),
    "as printed, elastic": (EVERYTHING | {"restitution": 1.0} | INFINITE, "published", 0.8),
    "case A": (CASE_A | INFINITE, "derived", 0.8),
    "case A as printed": (CASE_A | INFINITE, "published", 0.8),
    "case B": (CASE_B | INFINITE, "derived", 0.8),
    "case B as printed": (CASE_B | INFINITE, "published", 0.8),
}


def rates_by_hand(case, state, length):
    numbers, closures, exponent = CASES[case]
    rows = np.stack([state.charge, state.covariance[0], state.variance])
    values = by_hand.coefficients(closures, numbers, exponent)
    rates = by_hand.right_hand_side(0.0, rows, values, length)
    return Moments(*map(jnp.asarray, (rates[0], rates[1:2], rates[2])))


def model_of(case, dimensions=1):
    numbers, closures, exponent = CASES[case]
    return full_model(numbers, closures, dimensions, exponent)


@pytest.mark.parametrize("case", CASES)
def test_fourier_right_hand_side(case):
    # Products of two of these fields reach mode 20, which the grid keeps: nothing is aliased.
    grid = Grid((64,), (0.8,))
    state = smooth_state(grid, 10, seed=7)
    found = fourier_rates(model_of(case), grid, state)
    assert largest_difference(found, rates_by_hand(case, state, 0.8)) < 1e-12


@pytest.mark.parametrize("case", CASES)
def test_finite_difference_right_hand_side_at_sixth_order(case):
    errors = []
    for points in (48, 96):
        grid = Grid((points,), (0.8,))
        state = smooth_state(grid, 4, seed=8)
        found = difference_rates(model_of(case), grid, state)
        errors.append(largest_difference(found, rates_by_hand(case, state, 0.8)))
    assert 5.5 < math.log2(errors[0] / errors[1]) < 6.5


@pytest.mark.parametrize("mode", [(0, 1), (1, -2), (0, 0, 1), (2, 1, -1)])
@pytest.mark.parametrize("case", ["everything", "perfectly inelastic", "another contact law"])
def test_plane_waves_in_two_and_three_dimensions(case, mode):
    # Along the wave vector the equations are those of one dimension; crests lie on grid points.
    points, lengths = 32, (0.8, 1.0, 1.3)[: len(mode)]
    grid = Grid((points,) * len(mode), lengths)
    vector = np.array(mode) / np.array(lengths)
    length = 1.0 / float(np.linalg.norm(vector))
    direction = vector * length
    place = sum(m * i for m, i in zip(mode, np.indices(grid.points), strict=True)) % points
    along = smooth_state(Grid((points,), (length,)), 2, seed=9)

    def wave(moments):
        components = [x * moments.covariance[0][place] for x in direction]
        return Moments(moments.charge[place], jnp.stack(components), moments.variance[place])

    found = fourier_rates(model_of(case, len(mode)), grid, wave(along))
    assert largest_difference(found, wave(rates_by_hand(case, along, length))) < 1e-12


@pytest.mark.parametrize("closures", ["derived", "published"])
def test_stop_time_of_case_b(closures):
    numbers = by_hand.PAPER_CASES["B"]
    expected, profile = by_hand.solve_to_peak(by_hand.coefficients(closures, numbers), points=48)
    grid = Grid((64,), (1.0,))
    model = full_model(CASE_B, closures)
    outcome, fields = by_fourier(model, sine_state(grid), grid, 1.0, 1e-9, 1e-12, stop=0.5)
    assert abs(outcome.time / expected - 1.0) < 1e-7
    assert abs(jnp.max(fields.variance) / profile[2].max() - 1.0) < 1e-6
    assert abs(jnp.max(jnp.abs(fields.covariance)) / np.abs(profile[1]).max() - 1.0) < 1e-6


def test_the_example_knows_nothing_of_the_package():
    names = vars(by_hand).values()
    assert not [x for x in names if getattr(x, "__module__", "").startswith("triboflux")]
    assert not [x for x in names if getattr(x, "__name__", "").startswith(("triboflux", "jax"))]
