"""SciPy's integrators on the Fourier system of the full model, tuned in their favour.

These are the solvers the package is measured against. They run the fastest forms NumPy allows
(`fourier_systems`), are given the Jacobian, use the compiled loops `odeint` and `ode` where SciPy
has them, and their matrices are built outside the span that is timed. Three more run as a user
calls them: `solve_ivp` without a Jacobian.

Set OPENBLAS_NUM_THREADS=1 before the interpreter starts: threads only disturb matrices this small.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import cache, partial
from itertools import product
from statistics import median
from time import perf_counter, process_time
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import BDF, LSODA, Radau, ode, odeint, solve_ivp
from scipy.optimize import brentq

from benchmarks.fourier_systems import Collocation, FourierSystem, Modal
from examples.full_model_by_hand import PAPER_CASES, coefficients

FORMS = {"collocation": Collocation, "modal": Modal}
FINE_POINTS = 384
PEAK = 0.5
LATEST = 1000.0
MOST_STEPS = 10_000_000


class Reference(NamedTuple):
    """Converged charge at the time when its peak has fallen to one half.

    Attributes
    ----------
    time : float
        Stop time, scaled by L / sqrt(Theta).
    charge : ndarray, shape (384,)
        Mean charge on equidistant points, scaled by Q0.
    """

    time: float
    charge: np.ndarray


def interpolate(values: np.ndarray, points: int = FINE_POINTS) -> np.ndarray:
    """Return a periodic field on another number of points by its trigonometric interpolant.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Field on equidistant points of one period.
    points : int, default 384
        Number of points wanted, at least n.

    Returns
    -------
    ndarray, shape (points,)
        The field there.
    """
    n = values.size
    spectrum = np.fft.rfft(values)
    if n % 2 == 0 and points > n:
        spectrum[-1] *= 0.5
    return np.fft.irfft(spectrum * (points / n), points)


def relative_error(charge: np.ndarray, reference_charge: np.ndarray) -> float:
    """Return max|Q - Q_ref| / max|Q_ref| on the points of the reference.

    Parameters
    ----------
    charge : ndarray, shape (points,)
        Mean charge on any equidistant grid not finer than the reference.
    reference_charge : ndarray, shape (fine points,)
        The charge to compare with.

    Returns
    -------
    float
        The relative error, a number.
    """
    fine = interpolate(charge, reference_charge.size)
    return float(np.abs(fine - reference_charge).max() / np.abs(reference_charge).max())


def _excess(system: FourierSystem, y: np.ndarray) -> float:
    """Return by how much max|Q| over the grid points exceeds the value to stop at."""
    return float(np.abs(system.charge(y)).max()) - PEAK


def _crossing(
    system: FourierSystem, state_at: Callable[[float], np.ndarray], before: float, after: float
) -> float:
    """Return the time between two others at which the peak of the charge meets its stop value."""
    time: Any = brentq(lambda t: _excess(system, state_at(t)), before, after, xtol=1e-13)
    return float(time)


def _step_class(
    method: Any, system: FourierSystem, stop: float | None, rtol: float, atol: float
) -> tuple[float, np.ndarray]:
    """Return time and state at the stop, by the stepper classes LSODA, BDF and Radau."""
    jacobian: dict[str, Any] = {"jac": system.jacobian}
    if method is LSODA and isinstance(system, Modal):
        jacobian = {"jac": system.banded_jacobian, "lband": 1, "uband": 1}
    end = LATEST if stop is None else stop
    solver: Any = method(system.rates, 0.0, system.start, end, rtol=rtol, atol=atol, **jacobian)
    while solver.status == "running":
        message = solver.step()
        if solver.status == "failed":
            raise RuntimeError(f"{method.__name__}: {message}")
        if stop is None and _excess(system, solver.y) <= 0.0:
            dense = solver.dense_output()
            time = _crossing(system, dense, solver.t_old, solver.t)
            return time, dense(time)
    return float(solver.t), solver.y


def _lsoda(
    system: FourierSystem, stop: float | None, rtol: float, atol: float
) -> tuple[float, np.ndarray]:
    """Return time and state at the stop, by `odeint` if the time is given."""
    if stop is None:
        return _step_class(LSODA, system, stop, rtol, atol)
    jacobian: dict[str, Any] = {"Dfun": system.jacobian}
    if isinstance(system, Modal):
        jacobian = {"Dfun": system.banded_jacobian, "ml": 1, "mu": 1}
    states, report = odeint(
        system.rates,
        system.start,
        [0.0, stop],
        tfirst=True,
        rtol=rtol,
        atol=atol,
        mxstep=MOST_STEPS,
        full_output=True,
        **jacobian,
    )
    if report["message"] != "Integration successful.":
        raise RuntimeError(f"LSODA: {report['message']}")
    return stop, states[-1]


def _advance(solver: ode, time: float, step: bool = False) -> np.ndarray:
    """Return the state of an `ode` object at a later time, or after one step towards it."""
    state = solver.integrate(time, step=step)
    if not solver.successful():
        raise RuntimeError(f"ode: return code {solver.get_return_code()} at t = {solver.t}.")
    return state


def _vode(
    system: FourierSystem, stop: float | None, rtol: float, atol: float
) -> tuple[float, np.ndarray]:
    """Return time and state at the stop, by VODE's BDF formulas and a tridiagonal Jacobian."""
    if not isinstance(system, Modal):
        # SciPy 1.17 hands VODE a full Jacobian transposed (its issue 24933).
        raise ValueError("VODE is offered in the modal form only, with a tridiagonal Jacobian.")
    solver = ode(system.rates, system.banded_jacobian)
    solver.set_integrator(
        "vode",
        method="bdf",
        with_jacobian=True,
        lband=1,
        uband=1,
        rtol=rtol,
        atol=atol,
        nsteps=MOST_STEPS,
    )
    solver.set_initial_value(system.start)
    if stop is not None:
        return stop, _advance(solver, stop)
    before = 0.0
    while _excess(system, _advance(solver, LATEST, step=True)) > 0.0:
        before = solver.t
    # Within its last step VODE answers from the interpolating polynomial.
    time = _crossing(system, lambda t: _advance(solver, t), before, solver.t)
    return time, _advance(solver, time)


def _dop853(
    system: FourierSystem, stop: float | None, rtol: float, atol: float
) -> tuple[float, np.ndarray]:
    """Return time and state at the stop, by the compiled Dormand-Prince method of order eight."""
    accepted: list[tuple[float, np.ndarray]] = [(0.0, system.start)]

    def watch(t: float, y: np.ndarray) -> int:
        accepted[:] = [accepted[-1], (t, y.copy())]
        return -1 if _excess(system, y) <= 0.0 else 0

    def begin(t: float, y: np.ndarray, watched: bool) -> ode:
        solver = ode(system.rates)
        solver.set_integrator("dop853", rtol=rtol, atol=atol, nsteps=MOST_STEPS)
        if watched:
            solver.set_solout(watch)
        solver.set_initial_value(y, t)
        # Its test for stiffness would end case A at once, and SciPy has no option to leave it out.
        solver._integrator.iwork[3] = -1
        return solver

    state = _advance(begin(0.0, system.start, stop is None), LATEST if stop is None else stop)
    if stop is not None:
        return stop, state
    # SciPy keeps the method's interpolant to itself, so the last step is taken again.
    (before, state), (after, _) = accepted

    def state_at(t: float) -> np.ndarray:
        return _advance(begin(before, state, False), t) if t > before else state

    time = _crossing(system, state_at, before, after)
    return time, state_at(time)


def _plain(
    method: str, system: FourierSystem, stop: float | None, rtol: float, atol: float
) -> tuple[float, np.ndarray]:
    """Return time and state at the stop, by `solve_ivp` with nothing but tolerances."""

    class StopAtPeak:
        """An event of solve_ivp that ends the run."""

        terminal = True

        def __call__(self, t: float, y: np.ndarray) -> float:
            return _excess(system, y)

    run = solve_ivp(
        system.rates,
        (0.0, LATEST if stop is None else stop),
        system.start,
        method=method,
        events=StopAtPeak() if stop is None else None,
        rtol=rtol,
        atol=atol,
    )
    if not run.success:
        raise RuntimeError(f"{method}: {run.message}")
    return float(run.t[-1]), run.y[:, -1]


METHODS: dict[str, Callable[..., tuple[float, np.ndarray]]] = {
    "LSODA": _lsoda,
    "VODE": _vode,
    "BDF": partial(_step_class, BDF),
    "Radau": partial(_step_class, Radau),
    "DOP853": _dop853,
    "plain LSODA": partial(_plain, "LSODA"),
    "plain BDF": partial(_plain, "BDF"),
    "plain DOP853": partial(_plain, "DOP853"),
}
PEERS = tuple(METHODS)


def run_peer(
    name: str,
    case: str,
    points: int,
    rtol: float,
    atol: float,
    *,
    form: str = "modal",
    closures: str = "published",
    stop_time: float | None = None,
) -> dict[str, Any]:
    """Integrate one of the paper's cases with one of SciPy's methods.

    Parameters
    ----------
    name : str
        One of `PEERS`.
    case : {"A", "B"}
        The paper's case.
    points : int
        Number of grid points; a multiple of four puts one on the crest of the charge.
    rtol, atol : float
        Tolerances handed to the method; the state is dimensionless.
    form : {"modal", "collocation"}
        Semi-discrete form, see `fourier_systems`; "plain" peers are meant for collocation.
    closures : {"published", "derived"}
        Closure set.
    stop_time : float, optional
        Time to integrate to, scaled by L / sqrt(Theta). Without it the run stops when max|Q| over
        the points has fallen to one half.

    Returns
    -------
    dict
        charge (points,), time, wall and cpu (seconds of the integration alone), setup (seconds
        for the matrices) and rhs_evaluations.

    Raises
    ------
    ValueError
        If the peer does not exist or not in this form.
    RuntimeError
        If the integration fails.
    """
    if name not in METHODS:
        raise ValueError(f"peer is {name!r}; it must be one of {', '.join(METHODS)}.")
    began = perf_counter()
    system = FORMS[form](coefficients(closures, PAPER_CASES[case]), points)
    setup, wall, cpu = perf_counter() - began, perf_counter(), process_time()
    time, state = METHODS[name](system, stop_time, rtol, atol)
    cpu, wall = process_time() - cpu, perf_counter() - wall
    return {
        "charge": system.charge(state),
        "time": time,
        "wall": wall,
        "cpu": cpu,
        "setup": setup,
        "rhs_evaluations": system.evaluations,
    }


@cache
def reference(case: str, closures: str = "published", points: int = 96) -> Reference:
    """Return the converged charge at t*, by Radau's fifth-order method at tolerance 1e-11.

    Parameters
    ----------
    case : {"A", "B"}
        The paper's case.
    closures : {"published", "derived"}
        Closure set.
    points : int, default 96
        Collocation points.

    Returns
    -------
    Reference
        Stop time and charge, good to about 1e-9; takes a few seconds, kept for the next call.
    """
    system = Collocation(coefficients(closures, PAPER_CASES[case]), points)
    near, _ = _step_class(Radau, system, None, 1e-11, 1e-14)
    # Radau's interpolant has order three only: integrate to its stop time, then shift to the root.
    _, state = _step_class(Radau, system, near, 1e-11, 1e-14)
    charge, rate = state[:points], system.rates(near, state)[:points]
    crest = int(np.abs(charge).argmax())
    shift = (PEAK - abs(charge[crest])) / (np.sign(charge[crest]) * rate[crest])
    return Reference(float(near + shift), interpolate(charge + shift * rate))


def best_run(
    name: str,
    case: str,
    error: float,
    *,
    closures: str = "published",
    forms: Iterable[str] = tuple(FORMS),
    points: Sequence[int] = (32, 48, 64, 128),
    rtols: Sequence[float] = tuple(10.0 ** (-0.5 * half) for half in range(4, 19)),
    ratios: Sequence[float] = (1.0, 0.1, 0.01, 0.001),
    repeats: int = 7,
) -> dict[str, Any] | None:
    """Return the quickest settings with which a peer reaches t* within an error.

    Parameters
    ----------
    name, case, closures : str
        See `run_peer`.
    error : float
        Largest `relative_error` of the charge at the reference's t*.
    forms : iterable of str
        Forms to try; those the peer is not offered in are passed over.
    points : sequence of int
        Resolutions to try.
    rtols, ratios : sequence of float
        Relative tolerances, and absolute as a multiple of them.
    repeats : int, default 7
        Runs of the best settings, after the search, whose medians are returned.

    Returns
    -------
    dict or None
        The settings, the error reached, median wall and cpu seconds, rhs_evaluations; None if no
        settings reach the error.
    """
    stop, exact = reference(case, closures)
    best: dict[str, Any] | None = None
    for form, count, rtol, ratio in product(forms, points, rtols, ratios):
        settings = {"form": form, "points": count, "rtol": rtol, "atol": rtol * ratio}
        try:
            run = run_peer(name, case, closures=closures, stop_time=stop, **settings)
        except (RuntimeError, ValueError):
            continue
        reached = relative_error(run["charge"], exact)
        if reached <= error and (best is None or run["wall"] < best["wall"]):
            best = {**settings, "error": reached, "wall": run["wall"]}
    if best is None:
        return None
    settings = {key: best[key] for key in ("form", "points", "rtol", "atol")}
    runs = [
        run_peer(name, case, closures=closures, stop_time=stop, **settings) for _ in range(repeats)
    ]
    times = {key: median(run[key] for run in runs) for key in ("wall", "cpu")}
    return {**best, **times, "rhs_evaluations": runs[0]["rhs_evaluations"]}
