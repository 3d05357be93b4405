"""rkstiff: adaptive and fixed-step exponential and integrating-factor methods."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from rkstiff.etd4 import ETD4
from rkstiff.etd5 import ETD5
from rkstiff.etd34 import ETD34
from rkstiff.etd35 import ETD35
from rkstiff.if45dp import IF45DP
from rkstiff.solveras import SolverConfig

from benchmarks.peers.products import products_1d
from benchmarks.peers.solver import Run, Settings, Solver, counts, ladders, tolerances
from benchmarks.peers.spectral import Spectral

SAFETY = 0.9
FIRST_STEP = 1e-3


def prepare(method: Any, problem: Mapping[str, Any], settings: Settings) -> Run:
    """Prepare a method on variables that make the linear part diagonal."""
    points = tuple(settings["points"])
    spectral = Spectral(problem["coefficients"], points, problem["modes"], jax=False)
    rates, forth, back = spectral.diagonal()
    shape = rates.shape
    products = products_1d(spectral) if spectral.dimensions == 1 else None

    def nonlinear(flat: np.ndarray) -> np.ndarray:
        variables = flat.reshape(shape)
        if products is not None:
            return products(variables).ravel()
        return forth(spectral.products(back(variables))).ravel()

    start, linear, end = (
        forth(spectral.start).ravel(),
        rates.ravel().astype(complex),
        problem["end"],
    )

    def run() -> np.ndarray:
        if "steps" in settings:
            solver, step = method(linear, nonlinear), end / settings["steps"]
            state = start
            for _ in range(settings["steps"]):
                state = solver.step(state, step)
        else:
            config = SolverConfig(
                epsilon=settings["rtol"], safety_f=SAFETY, adapt_cutoff=settings["cutoff"]
            )
            solver = method(linear, nonlinear, config=config)
            state = solver.evolve(start, 0.0, end, h_init=FIRST_STEP * end, store_data=False)
        return spectral.charge(back(state.reshape(shape)))

    return run


def adaptive(problem: Mapping[str, Any]) -> list[list[Settings]]:
    """Return what to try with an adaptive method."""
    if problem["points"]:
        return ladders(problem, tolerances(4, 18)[::2], (1.0,), cutoff=(1e-2,))
    return ladders(problem, tolerances(4, 22)[::2], (1.0,), (32, 48), cutoff=(1e-2, 1e-8))


def fixed(problem: Mapping[str, Any]) -> list[list[Settings]]:
    """Return the numbers of steps to try with a fixed-step method."""
    if problem["points"]:
        return counts(problem, (8, 12, 16, 24, 32, 48, 64, 96, 128))
    steps = [round(6 * 2 ** (half / 2)) for half in range(28)]
    return counts(problem, steps, (32, 48))


SOLVERS = {
    "rkstiff ETD35": Solver(adaptive, partial(prepare, ETD35)),
    "rkstiff ETD34": Solver(adaptive, partial(prepare, ETD34)),
    "rkstiff IF45DP": Solver(adaptive, partial(prepare, IF45DP)),
    "rkstiff ETD5, fixed step": Solver(fixed, partial(prepare, ETD5), fixed_step=True),
    "rkstiff ETD4, fixed step": Solver(fixed, partial(prepare, ETD4), fixed_step=True),
}
