"""The exponential integrator: measured orders, dense output, error estimate, reuse of functions."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.fields import CASE_A, CASE_B, full_model, sine_state
from tests.runs import run, settings
from tests.semilinear import (
    DiagonalOperator,
    by_fixed_steps,
    developed,
    hochbruck_ostermann,
    norms,
    one_step,
    orders,
    oscillator,
    slaved,
)
from triboflux.grid import Grid
from triboflux.integrate import semilinear_term
from triboflux.integrators.controller import LadderController
from triboflux.integrators.exponential import ExponentialRungeKutta5, SemilinearTerm
from triboflux.integrators.linear import DenseOperator

SLAVED_TIME = 32.0


def errors_at_the_end(term, start, t_end, counts, reference):
    """Return the errors of every leaf at the end of runs with the given numbers of steps."""
    exact = by_fixed_steps(term, start, t_end, reference)
    return np.array([norms(by_fixed_steps(term, start, t_end, n), exact) for n in counts])


def dense_errors(term, start, t_end, counts, reference):
    """Return the largest errors of every leaf over times that lie anywhere in the steps."""
    times = jnp.linspace(0.0, t_end, 98)[1:-1]
    exact = by_fixed_steps(term, start, t_end, reference, times)
    runs = (by_fixed_steps(term, start, t_end, n, times) for n in counts)
    return np.array(
        [
            [
                float(jnp.max(jnp.abs(a - b)))
                for a, b in zip(*map(jax.tree.leaves, pair), strict=True)
            ]
            for pair in ((found, exact) for found in runs)
        ]
    )


# --- order at the end of the steps ----------------------------------------------------------------


@pytest.mark.parametrize("parts", [1, 2])
def test_order_five_on_a_problem_that_is_not_stiff(parts):
    term, start = oscillator(parts)
    errors = errors_at_the_end(term, start, 4.0, [16, 32, 64], reference=512)
    # Measured: 5.2 and 5.1, or 5.3 and 5.2 in two parts.
    assert orders(errors).min() > 4.8
    assert errors[-1].max() < 3e-6


def test_order_five_on_a_parabolic_problem():
    # Hochbruck & Ostermann's own test problem, on which Cox & Matthews' method has order 2.75 or
    # so.
    term, start, values, solution = hochbruck_ostermann()
    counts = [2, 4, 8, 16, 32]
    ends = [values(by_fixed_steps(term, start, 1.0, n)[-1]) for n in counts]
    errors = [float(jnp.max(jnp.abs(u - solution(1.0)))) for u in ends]
    # Measured: 5.1, 5.7, 5.3, 5.2.
    assert orders(errors).min() > 4.8
    assert errors[-1] < 5e-12


@pytest.mark.parametrize("closure_set", ["published", "derived"])
def test_order_on_the_slaved_covariance(closure_set):
    # Case A after its initial layer, with steps of up to 40 000 relaxation times of the covariance.
    term, start = slaved(closure_set)
    errors = errors_at_the_end(term, start, SLAVED_TIME, [8, 16, 32, 64], reference=256)
    # Measured for (Q, C, V): published 5.1, 4.9, 5.1; derived 4.4, 4.9, 4.4 rising to 4.9, 5.2,
    # 4.9.
    assert orders(errors)[-1].min() > 4.7
    assert orders(errors).min() > 4.2
    assert errors[-1].max() < 3e-12


def test_the_order_of_the_sweeps_matters_on_the_slaved_covariance():
    term, start = slaved("published")
    first, second = term.nonlinear
    together = SemilinearTerm(term.linear, (lambda y: first(y) + second(y),))
    swapped = SemilinearTerm(term.linear, (second, first))
    counts = [16, 32]
    swept, merged, reversed_ = (
        errors_at_the_end(t, start, SLAVED_TIME, counts, reference=256)[:, 0]
        for t in (term, together, swapped)
    )
    # Measured in Q with 32 steps: 2.6e-11 at order 5.1, 3.0e-7 at 3.1, 6.3e-9 at 3.9.
    assert orders(swept)[0] > 4.8
    assert orders(merged)[0] < 3.3
    assert orders(reversed_)[0] < 4.2
    assert merged[-1] > 1e3 * swept[-1]
    assert reversed_[-1] > 30.0 * swept[-1]


# --- dense output ---------------------------------------------------------------------------------


def test_dense_output_keeps_the_order_on_a_problem_that_is_not_stiff():
    term, start = oscillator()
    errors = dense_errors(term, start, 4.0, [16, 32, 64], reference=768)
    # Measured: 5.2 and 5.1; the largest error is that of the steps.
    assert orders(errors).min() > 4.0


def test_dense_output_has_order_four_at_least_on_a_parabolic_problem():
    term, start, values, solution = hochbruck_ostermann()
    times = jnp.linspace(0.0, 1.0, 98)[1:-1]
    exact = jax.vmap(solution)(times)
    errors = [
        float(
            jnp.max(jnp.abs(jax.vmap(values)(by_fixed_steps(term, start, 1.0, n, times)) - exact))
        )
        for n in [2, 4, 8, 16]
    ]
    # Measured: 4.6, 4.8, 5.1.
    assert orders(errors).min() > 4.0


@pytest.mark.parametrize("closure_set", ["published", "derived"])
def test_dense_output_has_order_four_on_the_slaved_covariance(closure_set):
    term, start = slaved(closure_set)
    errors = dense_errors(term, start, SLAVED_TIME, [8, 16, 32, 64], reference=256)
    charge, covariance, variance = orders(errors).T
    # Measured at the end: charge 5.1 (derived 4.9), covariance 4.6 (4.1), variance 5.0 (4.9).
    assert charge[-1] > 4.0
    assert variance[-1] > 4.0
    assert covariance[-1] > 3.8
    assert errors[-1].max() < 1e-10


def test_dense_output_is_exact_for_linear_problems():
    matrix = np.array([[-1.0, 30.0], [-30.0, -1e4]])
    term = SemilinearTerm(DenseOperator(jnp.asarray(matrix)), ())
    start, times = jnp.array([1.0, -0.4]), jnp.array([1e-7, 0.03, 0.5, 0.77, 1.99])
    rates, vectors = np.linalg.eig(matrix)
    weights = np.linalg.solve(vectors, np.asarray(start))
    expected = np.exp(np.outer(times, rates)) * weights @ vectors.T
    found = by_fixed_steps(term, start, 2.0, 2, times)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)


def test_dense_output_starts_and_ends_with_the_step():
    term, start = developed()
    inside = by_fixed_steps(term, start, 0.02, 1, jnp.array([0.0, 1e-9, 0.02 * (1 - 1e-9), 0.02]))
    at_end = by_fixed_steps(term, start, 0.02, 1)
    pick = [jax.tree.map(lambda a, i=i: a[i], inside) for i in range(4)]
    assert norms(pick[0], start).max() < 1e-15
    assert norms(pick[1], start).max() < 1e-7
    end = jax.tree.map(lambda a: a[0], at_end)
    assert norms(pick[3], end).max() < 1e-14
    assert norms(pick[2], end).max() < 1e-7


# --- error estimate -------------------------------------------------------------------------------


def estimates_and_errors(term, start, steps):
    """Return estimated and true errors of single steps, for every leaf."""
    estimated, true = [], []
    for step in steps:
        end, error = one_step(term, start, jnp.asarray(step))
        exact = jax.tree.map(lambda a: a[-1], by_fixed_steps(term, start, step, 32))
        estimated.append(norms(error))
        true.append(norms(end, exact))
    return np.array(estimated), np.array(true)


def test_error_estimate_scales_with_the_sixth_power_of_the_step():
    term, start = oscillator()
    estimated, true = estimates_and_errors(term, start, [0.2, 0.1, 0.05])
    # Measured: 6.0 and 5.8, at three times the true error.
    assert orders(estimated) == pytest.approx(6.0, abs=0.3)
    assert orders(true) == pytest.approx(6.0, abs=0.3)
    assert (estimated / true).min() > 0.2
    assert (estimated / true).max() < 5.0


def test_error_estimate_on_a_parabolic_problem():
    term, start, *_ = hochbruck_ostermann()
    estimated, true = estimates_and_errors(term, start, [0.5, 0.25, 0.125, 0.0625])
    # Measured: 0.7 to 5 times the true error.
    assert (estimated / true).min() > 0.05
    assert (estimated / true).max() < 50.0


@pytest.mark.parametrize(
    ("problem", "steps"),
    [(slaved, [4.0, 1.0]), (developed, [0.04, 0.01])],
    ids=["case A", "case B"],
)
@pytest.mark.parametrize("closure_set", ["published", "derived"])
def test_error_estimate_of_the_full_model(problem, steps, closure_set):
    term, start = problem(closure_set)
    estimated, true = estimates_and_errors(term, start, steps)
    # What the controller looks at: the worst moment, each relative to its size.
    ratio = (estimated / norms(start)).max(axis=1) / (true / norms(start)).max(axis=1)
    # Measured: 0.5 to 2 in case A; 1 to 120 in case B, which is better than it says.
    assert ratio.min() > 0.05
    assert ratio.max() < 300.0


def test_error_estimate_sees_a_moment_that_nothing_depends_on():
    # Without the electric force the variance is an integral over what is known exactly.
    grid = Grid((16,), (1.0,))
    model = full_model(CASE_B | {"energy_ratio": 0.0})
    start = jax.tree.map(grid.to_spectral, sine_state(grid))
    steps = by_fixed_steps(semilinear_term(model, grid), start, 1.0, 1000)
    exact = jax.tree.map(lambda a: a[-1], steps)
    for rtol in (1e-4, 1e-6, 1e-8):
        found = run(model, sine_state(grid), grid, settings(1.0, rtol=rtol)).carry.coefficients
        # Measured in the variance: 2e-6, 1e-7, 2e-9.
        assert (norms(found, exact) / norms(exact)).max() < 3.0 * rtol


# --- reuse ----------------------------------------------------------------------------------------


class CountingOperator(DiagonalOperator):
    """A diagonal operator that counts on the host how often its functions are made."""

    def functions(self, order, times):
        jax.debug.callback(_count.append, times.size)
        return super().functions(order, times)


_count: list = []


def steps_and_functions(controller, first, t_end):
    """Return the numbers of steps and of times that functions were made."""

    def pendulum(y):
        return jnp.stack([y[1], -jnp.sin(y[0])])

    term = SemilinearTerm(CountingOperator(jnp.array([0.0, -0.01])), (pendulum,))
    _count.clear()
    solution = diffrax.diffeqsolve(
        term,
        ExponentialRungeKutta5(),
        0.0,
        t_end,
        first,
        jnp.array([1.0, 0.0]),
        stepsize_controller=controller,
        saveat=diffrax.SaveAt(t1=True),
    )
    jax.block_until_ready(solution.ys)
    jax.effects_barrier()
    return int(solution.stats["num_steps"]), len(_count)


def test_functions_are_made_once_for_equal_steps():
    # 1000 steps of 0.001 accumulate round-off in the time, which must not count as another step.
    steps, made = steps_and_functions(diffrax.ConstantStepSize(), 0.001, 1.0)
    assert steps in (1000, 1001)
    assert made <= 3


def test_functions_are_reused_under_step_control():
    steps, made = steps_and_functions(LadderController(1e-7, 1e-10), None, 60.0)
    assert steps > 30
    # Measured: made 9 times for 62 steps.
    assert made < steps / 3


def test_kept_functions_change_nothing():
    term, start = oscillator()
    solver, step = ExponentialRungeKutta5(), jnp.asarray(0.1)
    take = eqx.filter_jit(solver.step)
    fresh = solver.init(term, jnp.zeros(()), step, start, None)
    stale = solver.init(term, jnp.zeros(()), 3.0 * step, start, None)
    with_fresh = take(term, jnp.zeros(()), step, start, None, fresh, False)
    with_stale = take(term, jnp.zeros(()), step, start, None, stale, False)
    for a, b in zip(jax.tree.leaves(with_fresh), jax.tree.leaves(with_stale), strict=True):
        np.testing.assert_array_equal(a, b)


# --- cost -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("numbers", "closure_set", "t_end", "most"),
    [
        # Measured, rejected steps included: 31, 31, 16 and 16.
        (CASE_A, "published", 49.14327836, 50),
        (CASE_A, "derived", 107.95618007, 50),
        (CASE_B, "published", 0.165301694345, 25),
        (CASE_B, "derived", 0.188441749325, 25),
    ],
    ids=["A published", "A derived", "B published", "B derived"],
)
def test_steps_for_a_millionth_in_the_charge(numbers, closure_set, t_end, most):
    grid, model = Grid((64,), (1.0,)), full_model(numbers, closure_set)
    outcome = run(model, sine_state(grid), grid, settings(t_end))
    exact = run(model, sine_state(grid), grid, settings(t_end, rtol=1e-10))
    charge, expected = (grid.to_fields(o.carry.coefficients.charge) for o in (outcome, exact))
    error = float(jnp.max(jnp.abs(charge - expected)) / jnp.max(jnp.abs(expected)))
    assert error < 1e-6
    assert int(outcome.accepted + outcome.rejected) <= most
