"""The package itself, compiled for the grids that a run works on; its defaults are one setting."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
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


class _Programs:
    """The compiled steps of a run, made when they are first needed.

    Parameters
    ----------
    grids : tuple of Grid
        On which the run can work, the last being that of the result.
    """

    def __init__(self, grids: tuple[Grid, ...]) -> None:
        self._grids, self._compiled = grids, {}

    def advance(self, model: Any, carry: Carry, grid: Grid, settings: RunSettings) -> Outcome:
        """Integrate on a grid until it becomes too coarse."""

        def run(model: Any, carry: Carry, settings: RunSettings) -> Outcome:
            asked = replace(settings, while_resolved=grid != self._grids[-1])
            return advance(model, carry, grid, asked)

        return self._run("advance", grid, run, model, carry, settings)

    def moved(self, model: Any, carry: Carry, grid: Grid, to: Grid) -> Carry:
        """Return a carry on another grid."""
        return self._run("moved", grid, lambda m, c: moved(m, c, grid, to), model, carry)

    def charge(self, carry: Carry, grid: Grid) -> np.ndarray:
        """Return the charge on the points of the result."""

        def values(carry: Carry) -> Any:
            resized = grid.resized(carry.coefficients.charge, self._grids[-1])
            return self._grids[-1].to_fields(resized)

        return np.asarray(self._run("charge", grid, values, carry))

    def _run(self, name: str, grid: Grid, function: Any, *arguments: Any) -> Any:
        if (name, grid) not in self._compiled:
            self._compiled[name, grid] = jax.jit(function).lower(*arguments).compile()
        return self._compiled[name, grid](*arguments)


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
    programs = _Programs(grids)

    def run() -> np.ndarray:
        here = coarsest
        outcome = programs.advance(traced[0], carry, here, traced[1])
        while bool(outcome.unresolved):
            finer = grids[grids.index(here) + 1]
            onwards = programs.moved(traced[0], outcome.carry, here, finer)
            outcome, here = programs.advance(traced[0], onwards, finer, traced[1]), finer
        return programs.charge(outcome.carry, here)

    return run


def series(problem: Mapping[str, Any]) -> list[list[Settings]]:
    """Return tolerances and points; the defaults are rtol 1e-6, and 128 points by dimension one."""
    kinds = {"adaptive": (True, False)}
    if problem["points"]:
        return ladders(problem, tolerances(6, 18), (1e-3,), **kinds)
    return ladders(problem, tolerances(6, 20), (1e-3,), (32, 48, 128), **kinds)


SOLVERS = {"triboflux": Solver(series, prepare)}
