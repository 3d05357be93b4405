"""SUNDIALS' CVODE through scikit-sundae."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from sksundae.cvode import CVODE, CVODEPrecond

from benchmarks.peers.modal import fill_band, fill_jacobian, fill_rates
from benchmarks.peers.solver import Run, Settings, Solver, ladders, tolerances
from benchmarks.peers.with_scipy import modal, on_points, packed

MOST_STEPS = 10_000_000


def one_dimension(problem: Mapping[str, Any], settings: Settings) -> Run:
    """Prepare the BDF formulas with an exact dense or an approximate tridiagonal Jacobian."""
    system = modal(problem, settings)
    c, size = system.c, system.size
    band, above, on = np.empty((3, size)), np.arange(size - 1), np.arange(size)

    def rates(t: float, y: np.ndarray, out: np.ndarray) -> None:
        fill_rates(y, out, c)

    def exact(t: float, y: np.ndarray, rate: np.ndarray, out: np.ndarray) -> None:
        fill_jacobian(y, out, c)

    def tridiagonal(t: float, y: np.ndarray, rate: np.ndarray, out: np.ndarray) -> None:
        fill_band(y, band, c)
        out[on, on] = band[1]
        out[above, above + 1], out[above + 1, above] = band[0, 1:], band[2, :-1]

    linear = {"linsolver": "dense", "jacfn": exact}
    if settings["jacobian"] == "band":
        linear = {"linsolver": "band", "lband": 1, "uband": 1, "jacfn": tridiagonal}
    span = np.array([0.0, problem["end"]])

    def run() -> np.ndarray:
        solver = CVODE(
            rates,
            rtol=settings["rtol"],
            atol=settings["atol"],
            max_num_steps=MOST_STEPS,
            **linear,
        )
        done = solver.solve(span, system.start)
        if not done.success:
            raise RuntimeError(done.message)
        return on_points(system, done.y[-1])

    return run


def boxes(problem: Mapping[str, Any], settings: Settings) -> Run:
    """Prepare the BDF formulas with GMRES and the exact linear part as its preconditioner."""
    system = packed(problem, settings)
    spectral = system.spectral
    rates_of, forth, back = spectral.diagonal()
    kept: dict[str, Any] = {}

    def rates(t: float, y: np.ndarray, out: np.ndarray) -> None:
        out[:] = system.rates(t, y)

    def set_up(t: float, y: Any, rate: Any, usable: Any, renewed: Any, gamma: float) -> None:
        renewed[0] = 1
        kept["inverse"] = 1.0 / (1.0 - gamma * rates_of)

    def apply(
        t: float, y: Any, rate: Any, right: Any, out: Any, gamma: float, delta: float, side: int
    ) -> None:
        out[:] = system.pack(back(kept["inverse"] * forth(system.unpack(right))))

    span = np.array([0.0, problem["end"]])

    def run() -> np.ndarray:
        solver = CVODE(
            rates,
            rtol=settings["rtol"],
            atol=settings["atol"],
            max_num_steps=MOST_STEPS,
            linsolver="gmres",
            krylov_dim=settings["krylov"],
            precond=CVODEPrecond(set_up, apply),
        )
        done = solver.solve(span, system.start)
        if not done.success:
            raise RuntimeError(done.message)
        return system.charge(done.y[-1])

    return run


def series(problem: Mapping[str, Any]) -> list[list[Settings]]:
    """Return what to try."""
    if problem["points"]:
        return ladders(problem, tolerances(6, 18)[::2], (0.1,), krylov=(5,))
    return ladders(problem, tolerances(6, 20), (1.0, 0.01), (32, 48), jacobian=("dense", "band"))


SOLVERS = {
    "SUNDIALS CVODE": Solver(series, lambda p, s: (boxes if p["points"] else one_dimension)(p, s))
}
