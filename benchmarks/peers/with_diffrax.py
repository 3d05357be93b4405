"""Diffrax's stock solvers in double precision."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache, partial
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.peers.solver import Run, Settings, Solver, ladders, tolerances
from benchmarks.peers.spectral import Spectral

jax.config.update("jax_enable_x64", True)
MOST_STEPS = 200_000


@cache
def _spectral(text: str, points: tuple[int, ...]) -> Spectral:
    problem = json.loads(text)
    return Spectral(problem["coefficients"], points, problem["modes"], jax=True)


@cache
def _diffrax(name: str, text: str, points: tuple[int, ...]) -> Any:
    """Return a compiled integration, which serves all tolerances."""
    spectral, end = _spectral(text, points), json.loads(text)["end"]

    def rates(t: Any, y: Any, args: Any) -> Any:
        state = y[0] + 1j * y[1]
        total = spectral.linear(state) + spectral.products(state)
        return jnp.stack([total.real, total.imag])

    def norm(y: Any) -> Any:
        return jnp.sqrt(jnp.mean(y**2))

    @eqx.filter_jit
    def integrate(y: Any, rtol: Any, atol: Any) -> Any:
        controller: Any = diffrax.PIDController(rtol, atol, norm=norm, pcoeff=0.3, icoeff=0.4)
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(rates),
            getattr(diffrax, name)(),
            0.0,
            end,
            None,
            y,
            stepsize_controller=controller,
            saveat=diffrax.SaveAt(t1=True),
            max_steps=MOST_STEPS,
            adjoint=diffrax.ForwardMode(),
            throw=False,
        )
        return solution.ys[-1], diffrax.is_okay(solution.result)

    return integrate


def by_diffrax(name: str, problem: Mapping[str, Any], settings: Settings) -> Run:
    """Prepare a stock solver of Diffrax on real and imaginary parts."""
    text, points = json.dumps(problem), tuple(settings["points"])
    spectral, integrate = _spectral(text, points), _diffrax(name, text, points)
    start = jnp.stack([spectral.start.real, spectral.start.imag])

    def run() -> np.ndarray:
        y, okay = integrate(start, settings["rtol"], settings["atol"])
        if not bool(okay):
            raise RuntimeError("diffeqsolve failed")
        return spectral.charge(np.asarray(y[0]) + 1j * np.asarray(y[1]))

    return run


def explicit(problem: Mapping[str, Any]) -> list[list[Settings]]:
    """Return what to try with an explicit method; stability costs more on more points."""
    if problem["points"]:
        return ladders(problem, tolerances(8, 16)[::4], (0.1,))
    return ladders(problem, tolerances(6, 18)[::2], (0.1,), (32,))


def implicit(problem: Mapping[str, Any]) -> list[list[Settings]]:
    """Return what to try with an implicit method, whose Newton matrix is dense."""
    return [] if problem["points"] else ladders(problem, tolerances(6, 20)[::2], (0.1,), (32, 48))


SOLVERS = {
    "Diffrax Kvaerno5": Solver(implicit, partial(by_diffrax, "Kvaerno5")),
    "Diffrax Dopri8": Solver(explicit, partial(by_diffrax, "Dopri8")),
    "Diffrax Tsit5": Solver(explicit, partial(by_diffrax, "Tsit5")),
}
