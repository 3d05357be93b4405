"""The package's own solver, as a user of `triboflux.integrate` would run the paper's cases."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from examples.full_model_by_hand import PAPER_CASES
from triboflux import models
from triboflux.grid import Grid
from triboflux.integrate import Outcome, Settings, begin, integrate, semilinear_term
from triboflux.integrators.exponential import ExponentialRungeKutta5
from triboflux.moments import Moments
from triboflux.numbers import Numbers

LATEST, PEAK = 1000.0, 0.5
_integrate = eqx.filter_jit(integrate)


class Problem(NamedTuple):
    """The arguments of `triboflux.integrate.integrate`; all numbers are traced."""

    model: models.Model
    state: Moments
    grid: Grid
    settings: Settings


def problem(
    case: str, closures: str, points: int, stop_time: float | None, rtol: float | None = None
) -> Problem:
    """Return one of the paper's cases.

    Parameters
    ----------
    case : {"A", "B"}
        The paper's case.
    closures : {"published", "derived"}
        Closure set.
    points : int
        Number of grid points.
    stop_time : float or None
        Time to integrate to, scaled by L / sqrt(Theta); None stops at a peak charge of one half.
    rtol : float, optional
        Relative tolerance instead of the default.

    Returns
    -------
    Problem
        Its numbers are arrays: a compiled program serves every case and closure set.
    """
    grid = Grid((points,), (1.0,))
    (x,) = grid.coordinates()
    zero = jnp.zeros(points)
    state = Moments(jnp.asarray(-np.sin(2.0 * np.pi * x)), zero[None], zero)
    model = models.build("full", Numbers(**PAPER_CASES[case]), closures)
    options = {} if rtol is None else {"rtol": rtol}
    if stop_time is None:
        settings = Settings(LATEST, stop_at_peak_charge=PEAK, **options)
    else:
        settings = Settings(stop_time, **options)
    traced: Any = jax.tree.map(jnp.asarray, (model, settings))
    return Problem(traced[0], state, grid, traced[1])


def solve(run: Problem) -> Outcome:
    """Integrate and wait for the result."""
    return jax.block_until_ready(_integrate(*run))


def charge(run: Problem, outcome: Outcome) -> np.ndarray:
    """Return the charge at the end on the grid points, shape (points,), scaled by Q0."""
    return np.asarray(run.grid.to_fields(outcome.carry.coefficients.charge))


def compile_phases(run: Problem) -> dict[str, float]:
    """Return the seconds of tracing, lowering and compiling, and of the first call.

    To be called in a process that has traced nothing yet, without a compilation cache.

    Parameters
    ----------
    run : Problem
        What to compile for.
    """
    arrays, rest = eqx.partition(tuple(run), eqx.is_array)

    def program(arrays: Any) -> Any:
        return eqx.filter(integrate(*eqx.combine(arrays, rest)), eqx.is_array)

    began = perf_counter()
    traced = jax.jit(program).trace(arrays)
    lowering = perf_counter()
    lowered = traced.lower()
    compiling = perf_counter()
    compiled = lowered.compile()
    calling = perf_counter()
    jax.block_until_ready(compiled(arrays))
    return {
        "trace": lowering - began,
        "lower": compiling - lowering,
        "compile": calling - compiling,
        "first call": perf_counter() - calling,
    }


def profile(run: Problem, step: float, count: int = 200, repeats: int = 9) -> dict[str, float]:
    """Return the seconds that the parts of a run take, each timed alone in a compiled loop.

    Parameters
    ----------
    run : Problem
        What to integrate.
    step : float
        Length of the steps in the loops, scaled by L / sqrt(Theta).
    count : int
        Passes of a loop.
    repeats : int
        Runs, whose smallest time counts.

    Returns
    -------
    dict of str to float
        ``step``, one step with functions of the operator that are at hand; ``functions``, making
        them for another step; ``call``, a compiled call with the same arguments that only
        transforms the initial state; ``whole``, the run; and ``steps``, how many it makes.
    """
    term, solver = semilinear_term(run.model, run.grid), ExponentialRungeKutta5()
    start = begin(run.model, run.state, run.grid).coefficients

    @eqx.filter_jit
    def steps(term: Any, start: Moments, step: Any) -> Any:
        cache = solver.init(term, 0.0, step, start, None)

        def again(_: Any, carry: Any) -> Any:
            return solver.step(term, 0.0, step, carry[0], None, cache, False)[:2]

        return lax.fori_loop(0, count, again, (start, start))

    @eqx.filter_jit
    def functions(term: Any, start: Moments, step: Any) -> Any:
        def again(i: Any, cache: Any) -> Any:
            return solver.init(term, 0.0, step * (1.0 + 1e-3 * i), start, None)

        return lax.fori_loop(0, count, again, solver.init(term, 0.0, step, start, None))

    prepare = eqx.filter_jit(begin)
    outcome = solve(run)
    length = jnp.asarray(step)
    return {
        "step": _quickest(lambda: steps(term, start, length), repeats) / count,
        "functions": _quickest(lambda: functions(term, start, length), repeats) / count,
        "call": _quickest(lambda: prepare(run.model, run.state, run.grid), repeats),
        "whole": _quickest(lambda: solve(run), repeats),
        "steps": float(outcome.accepted + outcome.rejected),
    }


def _quickest(function: Callable[[], Any], repeats: int) -> float:
    jax.block_until_ready(function())
    seconds = []
    for _ in range(repeats):
        began = perf_counter()
        jax.block_until_ready(function())
        seconds.append(perf_counter() - began)
    return min(seconds)
