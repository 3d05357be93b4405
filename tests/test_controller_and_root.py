"""The step-size controller and the root finder, each apart from the integrator."""

import math

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.fields import CASE_B, full_model, sine_state
from tests.runs import resume, settings, start
from triboflux.grid import Grid
from triboflux.integrators.controller import (
    LADDER,
    MOST_GROWTH,
    MOST_SHRINKING,
    LadderController,
    moment_norm,
)
from triboflux.integrators.root import Illinois
from triboflux.moments import Moments

ORDER = 6


def rung(step):
    """Return the logarithm of a step to the base √2."""
    return math.log(float(step)) / math.log(LADDER)


@eqx.filter_jit
def _adapt(controller, begin, end, before, after, error, state):
    return controller.adapt_step_size(begin, end, before, after, None, error, ORDER, state)


def adapt(error, *, length=0.25, state=None, before=1.0, after=1.0, rtol=1e-3, atol=0.0, begin=1.0):
    """Return keep, start, end, proposed step and result of a decision about scalars."""
    leaves = [jnp.atleast_1d(jnp.asarray(x, dtype=float)) for x in (before, after, error)]
    keep, at, end, jump, step, result = _adapt(
        LadderController(jnp.asarray(rtol), jnp.asarray(atol)),
        jnp.asarray(begin),
        jnp.asarray(begin + length),
        *leaves,
        jnp.asarray(length if state is None else state),
    )
    assert jump is False or not bool(jump)
    return bool(keep), float(at), float(end), float(step), result


# --- the controller -------------------------------------------------------------------------------


@pytest.mark.parametrize(("error", "kept"), [(0.999e-3, True), (1.001e-3, False), (0.0, True)])
def test_a_step_is_kept_if_its_relative_error_is_allowed(error, kept):
    keep, at, end, step, _ = adapt(error)
    assert keep is kept
    assert at == (1.25 if kept else 1.0)
    assert end == at + step
    assert (step >= 0.25 * (1 - 1e-12)) is kept


def test_the_larger_end_of_the_step_is_the_scale():
    assert adapt(1.5e-3, before=1.0, after=2.0)[0]
    assert adapt(1.5e-3, before=2.0, after=1.0)[0]
    assert not adapt(1.5e-3, before=1.0, after=1.0)[0]


def test_the_absolute_tolerance_adds_to_the_relative_one():
    assert adapt(0.9e-3, before=0.0, after=0.0, atol=1e-3)[0]
    assert not adapt(1.1e-3, before=0.0, after=0.0, atol=1e-3)[0]
    assert adapt(1.9e-3, atol=1e-3)[0]


def test_every_moment_counts_in_its_own_scale():
    # A relative error of 1e-2 in a moment a thousand times smaller than the charge.
    controller = LadderController(jnp.asarray(1e-3), jnp.asarray(0.0))
    sizes = Moments(jnp.ones(4), 1e-3 * jnp.ones((1, 4)), jnp.ones(4))
    for bad in ("charge", "covariance", "variance"):
        none = jax.tree.map(jnp.zeros_like, sizes)
        error = none + Moments(**{bad: 1e-2 * getattr(sizes, bad)})
        keep, *_ = _adapt(
            controller, jnp.zeros(()), jnp.ones(()), sizes, sizes, error, jnp.ones(())
        )
        assert not bool(keep), bad


@given(error=st.floats(1e-12, 1e3), length=st.floats(1e-8, 1e3))
def test_proposed_steps_lie_on_the_ladder(error, length):
    keep, _, _, step, _ = adapt(error, length=length)
    assert rung(step) == pytest.approx(round(rung(step)), abs=1e-6)
    wanted = 0.9 * length * (error / 1e-3) ** (-1.0 / ORDER)
    low, high = (length, MOST_GROWTH * length) if keep else (MOST_SHRINKING * length, 0.9 * length)
    wanted = min(max(wanted, low), high)
    # Rounded down by one rung at most.
    assert wanted / LADDER * (1 - 1e-6) <= step <= wanted * (1 + 1e-6)


def test_a_step_on_the_ladder_that_was_kept_is_not_shortened():
    length = LADDER**-7
    for error in (0.999e-3, 0.5e-3):
        keep, *_, step, _ = adapt(error, length=length)
        assert keep
        assert step == pytest.approx(length, rel=1e-12)


def test_a_step_clipped_to_the_end_does_not_shorten_the_next():
    full = LADDER**-3
    keep, *_, step, _ = adapt(0.99e-3, length=0.01 * full, state=full)
    assert keep
    assert step == pytest.approx(full, rel=1e-12)
    # But one that fails is judged by its own length.
    keep, *_, step, _ = adapt(1.1e-3, length=0.01 * full, state=full)
    assert not keep
    assert step < 0.01 * full


@pytest.mark.parametrize("error", [math.nan, math.inf])
def test_a_step_that_is_not_finite_is_repeated_much_shorter(error):
    keep, at, _, step, result = adapt(error, length=0.25)
    assert not keep
    assert at == 1.0
    assert MOST_SHRINKING / LADDER * 0.25 <= step <= MOST_SHRINKING * 0.25 * (1 + 1e-9)
    assert result == diffrax.RESULTS.successful


@pytest.mark.parametrize("begin", [1.0, 1e4])
def test_a_step_too_short_for_the_time_ends_the_run(begin):
    length = 8.0 * np.finfo(float).eps * begin
    *_, result = adapt(math.nan, length=length, begin=begin)
    assert result == diffrax.RESULTS.dt_min_reached
    *_, result = adapt(math.nan, length=1e3 * length, begin=begin)
    assert result == diffrax.RESULTS.successful


def test_the_first_step_is_a_part_of_the_time_scale():
    controller = LadderController(jnp.asarray(1e-6), jnp.asarray(0.0))

    def first(y, rate, t_end, given_step=None):
        end, state = controller.init(None, 0.0, t_end, y, given_step, None, lambda *_: rate, ORDER)
        assert float(end) == float(state)
        assert rung(state) == pytest.approx(round(rung(state)), abs=1e-6)
        return float(state)

    step = first(jnp.full(3, 2.0), jnp.full(3, -40.0), 1e3)
    assert 0.01 / 20.0 / LADDER <= step <= 0.01 / 20.0
    assert first(jnp.ones(3), jnp.zeros(3), 2.0) == pytest.approx(2.0)
    assert first(jnp.ones(3), jnp.ones(3), 1e3, given_step=0.3) == pytest.approx(0.25)


def test_the_norm_is_the_euclidean_one():
    assert float(moment_norm(jnp.array([[3.0, 0.0], [0.0, -4.0]]))) == 5.0


def test_the_controller_makes_a_run_climb_the_ladder():
    grid, model = Grid((32,), (1.0,)), full_model(CASE_B)
    carry, rungs = start(model, sine_state(grid), grid), []
    once = settings(0.1, max_steps=1)
    for _ in range(60):
        outcome = resume(model, carry, grid, once)
        carry = outcome.carry
        rungs.append(rung(carry.next_step))
        if bool(outcome.finished):
            break
    assert bool(outcome.finished)
    assert float(carry.time) == pytest.approx(0.1, rel=1e-14)
    np.testing.assert_allclose(rungs, np.round(rungs), atol=1e-6)
    # The initial layer needs steps far shorter than those that follow.
    assert rungs[-1] - rungs[0] > 6


# --- the root finder ------------------------------------------------------------------------------


@eqx.filter_jit
def _root(finder, function, low, high):
    solution = optx.root_find(
        lambda t, args: (function(t), None),
        finder,
        high,
        options={"lower": low, "upper": high},
        has_aux=True,
        max_steps=200,
        throw=False,
    )
    return solution.value, solution.stats["num_steps"], solution.result


def root(function, low, high, rtol=1e-9):
    value, steps, result = _root(Illinois(rtol), function, jnp.asarray(low), jnp.asarray(high))
    assert result == optx.RESULTS.successful
    return float(value), int(steps)


FUNCTIONS = {
    "line": (lambda t: 3.0 - t, 1.0, 7.0, 3.0),
    "decay": (lambda t: jnp.exp(-t) - 0.5, 0.0, 5.0, math.log(2.0)),
    "rising": (lambda t: t**2 - 2.0, 0.0, 2.0, math.sqrt(2.0)),
    "nearly a step": (lambda t: -jnp.tanh(50.0 * (t - 0.3)), 0.0, 1.0, 0.3),
    "flat": (lambda t: -((t - 0.7) ** 3), 0.0, 1.0, 0.7),
    "one end far away": (lambda t: 1.0 / t - 1.0, 1e-3, 2.0, 1.0),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_roots_are_found_to_the_tolerance(name):
    function, low, high, expected = FUNCTIONS[name]
    # Where the function is a cube, steps shrink by a constant factor only.
    rtol, slack = (1e-6, 30.0) if name == "flat" else (1e-9, 1.0)
    value, steps = root(function, low, high, rtol)
    assert value == pytest.approx(expected, rel=slack * rtol)
    assert steps < 60


def test_smooth_roots_take_few_evaluations():
    # Both ends of the bracket included; bisection to 1e-9 would take thirty.
    for name in ("decay", "rising"):
        _, steps = root(*FUNCTIONS[name][:3])
        assert steps <= 12
    assert root(*FUNCTIONS["line"][:3])[1] <= 5


def test_a_root_at_an_end_of_the_bracket():
    assert root(lambda t: t - 1.0, 1.0, 2.0)[0] == pytest.approx(1.0, rel=1e-9)
    assert root(lambda t: t - 2.0, 1.0, 2.0)[0] == pytest.approx(2.0, rel=1e-9)


def test_the_value_may_be_one_of_several_rules():
    # Only the rule that applies is not zero.
    value, _ = root(lambda t: {"peak_charge": 1.5 - t, "rate": jnp.zeros(())}, 1.0, 2.0)
    assert value == pytest.approx(1.5, rel=1e-9)


@given(st.floats(0.05, 0.99), st.floats(0.3, 3.0))
def test_any_monotone_power(expected, power):
    function = eqx.Partial(_power, jnp.asarray(expected), jnp.asarray(power))
    value, _ = root(function, 1e-6, 1.0)
    assert value == pytest.approx(expected, rel=3e-9)


def _power(expected, power, t):
    return expected**power - t**power
