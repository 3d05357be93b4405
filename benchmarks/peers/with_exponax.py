"""Exponax' exponential method in double precision."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from typing import Any

import equinox as eqx
import exponax
import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.peers.solver import Run, Settings, Solver, counts
from benchmarks.peers.spectral import Spectral

jax.config.update("jax_enable_x64", True)


@cache
def _spectral(text: str, points: tuple[int, ...]) -> Spectral:
    problem = json.loads(text)
    return Spectral(problem["coefficients"], points, problem["modes"], jax=True)


@cache
def _exponax(text: str, points: tuple[int, ...]) -> Any:
    """Return the products, a compiled loop and the diagonal form, which serve all steps."""
    spectral = _spectral(text, points)
    rates, forth, back = spectral.diagonal()

    class Products(exponax.nonlin_fun.BaseNonlinearFun):
        """The products of fields, de-aliased by the equations themselves."""

        def __call__(self, u_hat: Any) -> Any:
            return forth(spectral.products(back(u_hat)))

    @eqx.filter_jit
    def integrate(stepper: Any, state: Any, steps: Any) -> Any:
        return jax.lax.fori_loop(0, steps, lambda _, u: stepper.step_fourier(u), state)

    nonlinear = Products(spectral.dimensions, points[0])
    linear = jnp.asarray(rates, complex)

    def stepper(step: float) -> Any:
        return exponax.etdrk.ETDRK4(step, linear, nonlinear)

    return stepper, integrate, forth(jnp.asarray(spectral.start)), back


def by_exponax(problem: Mapping[str, Any], settings: Settings) -> Run:
    """Prepare equal steps of Exponax' ETDRK4 on variables that make the linear part diagonal."""
    text, points = json.dumps(problem), tuple(settings["points"])
    spectral = _spectral(text, points)
    make, integrate, start, back = _exponax(text, points)
    stepper = make(problem["end"] / settings["steps"])

    def run() -> np.ndarray:
        state = integrate(stepper, start, settings["steps"])
        return spectral.charge(back(state))

    return run


def fixed(problem: Mapping[str, Any]) -> list[list[Settings]]:
    """Return the numbers of equal steps to try."""
    if problem["points"]:
        return counts(problem, (8, 12, 16, 24, 32, 48, 64, 96, 128))
    return counts(problem, [round(8 * 2 ** (half / 2)) for half in range(30)], (32, 48))


SOLVERS = {"Exponax ETDRK4, fixed step": Solver(fixed, by_exponax, fixed_step=True)}
