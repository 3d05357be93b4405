"""The package itself, compiled for a number of points; its defaults are one of the settings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.peers.solver import Run, Settings, Solver, ladders, tolerances
from triboflux import models
from triboflux.grid import Grid
from triboflux.integrate import Settings as RunSettings
from triboflux.integrate import integrate
from triboflux.moments import Moments
from triboflux.numbers import Numbers

_integrate = eqx.filter_jit(integrate)


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
    tolerance = RunSettings(problem["end"], settings["rtol"], settings["atol"])
    traced: Any = jax.tree.map(jnp.asarray, (model, tolerance))

    def run() -> np.ndarray:
        outcome = _integrate(traced[0], start, grid, traced[1])
        return np.asarray(grid.to_fields(outcome.carry.coefficients.charge))

    return run


def series(problem: Mapping[str, Any]) -> list[list[Settings]]:
    """Return tolerances and numbers of points; the defaults are rtol 1e-6 and 128 points."""
    if problem["points"]:
        return ladders(problem, tolerances(6, 18), (1e-3,))
    return ladders(problem, tolerances(6, 20), (1e-3,), (32, 48, 128))


SOLVERS = {"triboflux": Solver(series, prepare)}
