"""The package itself, compiled for the grids that a run works on; its defaults are one setting."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.peers.solver import Run, Settings, Solver, ladders, tolerances
from triboflux import models
from triboflux.grid import Grid
from triboflux.integrate import Carry, Outcome, advance, begin, moved
from triboflux.integrate import Settings as RunSettings
from triboflux.moments import Moments
from triboflux.numbers import Numbers
from triboflux.resolution import coarsest_for, ladder


@cache
def _advancing(grid: Grid, finest: Grid) -> Any:
    """Return the compiled integration on a grid until it becomes too coarse."""

    @jax.jit
    def run(model: Any, carry: Carry, settings: RunSettings) -> Outcome:
        return advance(model, carry, grid, replace(settings, while_resolved=grid != finest))

    return run


@cache
def _moving(grid: Grid, to: Grid) -> Any:
    """Return the compiled change of the grid."""
    return jax.jit(lambda model, carry: moved(model, carry, grid, to))


@cache
def _charge(grid: Grid, finest: Grid) -> Any:
    """Return the compiled charge on the points of the result."""

    @jax.jit
    def values(carry: Carry) -> Any:
        return finest.to_fields(grid.resized(carry.coefficients.charge, finest))

    return values


def prepare(problem: Mapping[str, Any], settings: Settings) -> Run:
    """Prepare the integration of fields from time zero to the end."""
    points = tuple(settings["points"])
    grid = Grid(points, (1.0,) * len(points))
    mesh = np.meshgrid(*grid.coordinates(), indexing="ij")
    charge = np.zeros(points)
    for wave, sine, cosine in problem["modes"]:
        phase = 2.0 * np.pi * sum(m * x for m, x in zip(wave, mesh, strict=True))
        charge += sine * np.sin(phase) + cosine * np.cos(phase)
    zero = jnp.zeros(points)
    start = Moments(jnp.asarray(charge), jnp.zeros((len(points), *points)), zero)
    numbers = Numbers(**problem["numbers"])
    model = models.build("full", numbers, problem["closures"], dimensions=len(points))
    rtol, atol = settings["rtol"], settings["atol"]
    traced: Any = jax.tree.map(jnp.asarray, (model, RunSettings(problem["end"], rtol, atol)))
    grids = ladder(grid) if settings["adaptive"] else (grid,)
    initial = begin(traced[0], start, grid)
    coarsest = coarsest_for(initial.coefficients, grids, rtol, atol)
    carry = moved(traced[0], initial, grid, coarsest)

    def run() -> np.ndarray:
        here = coarsest
        outcome = _advancing(here, grid)(traced[0], carry, traced[1])
        while bool(outcome.unresolved):
            finer = grids[grids.index(here) + 1]
            onwards = _moving(here, finer)(traced[0], outcome.carry)
            outcome, here = _advancing(finer, grid)(traced[0], onwards, traced[1]), finer
        return np.asarray(_charge(here, grid)(outcome.carry))

    return run


def series(adaptive: bool, problem: Mapping[str, Any]) -> list[list[Settings]]:
    """Return tolerances and points; the defaults are rtol 1e-6, and 128 points in one dimension."""
    kind = {"adaptive": (adaptive,)}
    if problem["points"]:
        return ladders(problem, tolerances(6, 18), (1e-3,), **kind)
    return ladders(problem, tolerances(6, 20), (1e-3,), (32, 48, 128), **kind)


SOLVERS = {
    "triboflux": Solver(partial(series, True), prepare),
    "triboflux on all points": Solver(partial(series, False), prepare),
}
