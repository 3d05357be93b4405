"""py-pde with spectral derivatives in place of its finite differences, and SciPy's integrators."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
import pde

from benchmarks.peers.solver import Run, Settings, Solver, ladders, tolerances
from benchmarks.peers.spectral import Spectral


class FullModel(pde.PDEBase):
    """The equations on the fields Q, C_1..C_d and V.

    Parameters
    ----------
    spectral : Spectral
        Their discretisation.
    """

    def __init__(self, spectral: Spectral) -> None:
        super().__init__()
        self.spectral = spectral

    def evolution_rate(self, state: Any, t: float = 0.0) -> Any:
        """Return the time derivatives of all fields."""
        waves = self.spectral.to_waves(state.data) * self.spectral.mask
        rates = self.spectral.linear(waves) + self.spectral.products(waves)
        result = state.copy()
        result.data = self.spectral.to_points(rates)
        return result


def prepare(method: str, problem: Mapping[str, Any], settings: Settings) -> Run:
    """Prepare one of SciPy's methods under py-pde."""
    points = tuple(settings["points"])
    spectral = Spectral(problem["coefficients"], points, problem["modes"], jax=False)
    # The cells' centres stand for the points: the equations do not depend on the place.
    grid = pde.CartesianGrid([[0.0, 1.0]] * len(points), points, periodic=True)
    values = spectral.to_points(spectral.start)
    start = pde.FieldCollection([pde.ScalarField(grid, field) for field in values])
    equations, end = FullModel(spectral), problem["end"]
    tolerance = {"rtol": settings["rtol"], "atol": settings["atol"]}

    def run() -> np.ndarray:
        solver = pde.ScipySolver(equations, backend="numpy", method=method, **tolerance)
        done = pde.Controller(solver, t_range=end, tracker=None).run(start, dt=1e-6 * end)
        return done.data[0]

    return run


def stiff(problem: Mapping[str, Any]) -> list[list[Settings]]:
    """Return what to try with an implicit method."""
    return [] if problem["points"] else ladders(problem, tolerances(6, 18), (0.1, 0.01), (32, 48))


def explicit(problem: Mapping[str, Any]) -> list[list[Settings]]:
    """Return what to try with an explicit method."""
    if problem["points"]:
        return ladders(problem, tolerances(8, 16)[::4], (0.1,))
    return ladders(problem, tolerances(4, 16)[::2], (0.1,), (32,))


SOLVERS = {
    "py-pde LSODA": Solver(stiff, partial(prepare, "LSODA")),
    "py-pde DOP853": Solver(explicit, partial(prepare, "DOP853")),
}
