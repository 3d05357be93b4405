"""SciPy's integrators: compiled right-hand sides, exact Jacobians, its own compiled loops."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from scipy.integrate import ode, odeint, solve_ivp

from benchmarks.peers.modal import Modal
from benchmarks.peers.solver import Run, Settings, Solver, ladders, tolerances
from benchmarks.peers.spectral import Packed, Spectral

MOST_STEPS = 10_000_000


def modal(problem: Mapping[str, Any], settings: Settings) -> Modal:
    """Return the equations in one dimension."""
    (points,) = settings["points"]
    modes = [(wave[0], sine, cosine) for wave, sine, cosine in problem["modes"]]
    return Modal(problem["coefficients"], points, modes)


def packed(problem: Mapping[str, Any], settings: Settings) -> Packed:
    """Return the equations in any number of dimensions, by fast transforms."""
    points, modes = tuple(settings["points"]), problem["modes"]
    return Packed(Spectral(problem["coefficients"], points, modes, jax=False))


def on_points(system: Modal, y: np.ndarray) -> np.ndarray:
    """Return the mean charge on the points."""
    return np.fft.irfft(system.charge(y) * system.points, system.points)


def lsoda(problem: Mapping[str, Any], settings: Settings) -> Run:
    """Prepare `odeint`, with the exact Jacobian or a tridiagonal approximation."""
    system = modal(problem, settings)
    jacobian: dict[str, Any] = {"Dfun": system.jacobian}
    if settings["jacobian"] == "band":
        jacobian = {"Dfun": system.band, "ml": 1, "mu": 1}

    def run() -> np.ndarray:
        states, told = odeint(
            system.rates,
            system.start,
            [0.0, problem["end"]],
            tfirst=True,
            rtol=settings["rtol"],
            atol=settings["atol"],
            mxstep=MOST_STEPS,
            full_output=True,
            **jacobian,
        )
        if told["message"] != "Integration successful.":
            raise RuntimeError(told["message"])
        return on_points(system, states[-1])

    return run


def vode(problem: Mapping[str, Any], settings: Settings) -> Run:
    """Prepare `ode` with VODE's BDF formulas and a tridiagonal Jacobian."""
    system = modal(problem, settings)

    def run() -> np.ndarray:
        solver = ode(system.rates, system.band)
        tolerance = {"rtol": settings["rtol"], "atol": settings["atol"], "nsteps": MOST_STEPS}
        solver.set_integrator(
            "vode", method="bdf", with_jacobian=True, lband=1, uband=1, **tolerance
        )
        solver.set_initial_value(system.start)
        y = solver.integrate(problem["end"])
        if not solver.successful():
            raise RuntimeError(f"return code {solver.get_return_code()}")
        return on_points(system, y)

    return run


def dop853(problem: Mapping[str, Any], settings: Settings) -> Run:
    """Prepare `ode` with the compiled Dormand-Prince method of order eight."""
    system = modal(problem, settings)

    def run() -> np.ndarray:
        solver = ode(system.rates)
        solver.set_integrator(
            "dop853", rtol=settings["rtol"], atol=settings["atol"], nsteps=MOST_STEPS
        )
        solver.set_initial_value(system.start)
        # Its test for stiffness would end a stiff run at once; SciPy has no option against it.
        solver._integrator.iwork[3] = -1
        y = solver.integrate(problem["end"])
        if not solver.successful():
            raise RuntimeError(f"return code {solver.get_return_code()}")
        return on_points(system, y)

    return run


def by_class(method: str, problem: Mapping[str, Any], settings: Settings) -> Run:
    """Prepare `solve_ivp`; implicit methods get the exact Jacobian."""
    if problem["points"]:
        boxes = packed(problem, settings)
        system: Any = boxes
        jacobian, charge = {}, boxes.charge
    else:
        system = modal(problem, settings)
        jacobian, charge = {"jac": system.jacobian}, partial(on_points, system)

    def run() -> np.ndarray:
        done = solve_ivp(
            system.rates,
            (0.0, problem["end"]),
            system.start,
            method=method,
            rtol=settings["rtol"],
            atol=settings["atol"],
            t_eval=[problem["end"]],
            **(jacobian if method in ("BDF", "Radau") else {}),
        )
        if not done.success:
            raise RuntimeError(done.message)
        return charge(done.y[:, -1])

    return run


def _stiff(problem: Mapping[str, Any], **options: Any) -> list[list[Settings]]:
    if problem["points"]:
        return []  # their Jacobian would be a dense matrix over all points
    return ladders(problem, tolerances(6, 20), (1.0, 0.01), (32, 48), **options)


def _slow(problem: Mapping[str, Any]) -> list[list[Settings]]:
    return [ladder[::2] for ladder in _stiff(problem)]


def _explicit(problem: Mapping[str, Any]) -> list[list[Settings]]:
    if problem["points"]:
        return ladders(problem, tolerances(6, 18)[::2], (0.1,))
    # At more than 32 points stability costs more still.
    return ladders(problem, tolerances(4, 18), (1.0, 0.1), (32,))


SOLVERS = {
    "SciPy LSODA": Solver(lambda p: _stiff(p, jacobian=("band", "dense")), lsoda),
    "SciPy VODE": Solver(_stiff, vode),
    "SciPy BDF": Solver(_slow, partial(by_class, "BDF")),
    "SciPy Radau": Solver(_slow, partial(by_class, "Radau")),
    "SciPy DOP853": Solver(
        _explicit, lambda p, s: by_class("DOP853", p, s) if p["points"] else dop853(p, s)
    ),
}
