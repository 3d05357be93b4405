"""Runs for the page: every model of a case up to the same time, one after the other."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from triboflux.advice import Advice, advice_from, advice_outside
from triboflux.case import MODEL_NAMES, Case
from triboflux.compare import with_changes
from triboflux.comparison import relative_errors
from triboflux.errors import InputError, TribofluxError
from triboflux.model_errors import CHEAPEST_FIRST, OK, ModelError, ModelErrors
from triboflux.suitability import NOT_HALVED
from triboflux.validation import SMALLEST

if TYPE_CHECKING:
    from triboflux.progress import Progress
    from triboflux.result import Result

FRAMES = 31
"""Output times of a run; always as many, so that cases share their compiled programs."""
REFERENCE = "full"
"""The model that the others are measured against, as in `triboflux.suitability.MEASURE`."""
JUDGED = MODEL_NAMES[MODEL_NAMES.index(REFERENCE) :]
"""It and those that close more than it does; one that closes less runs only where it is drawn."""

LARGE = 2**13
"""Points of a grid on which only the drawn models are run."""
NOT_JUDGED = "undecided"
"""The model of an advice where not all models were run."""

_LATE = 0.9
_locks: dict[Any, threading.Lock] = {}
_locks_guard = threading.Lock()
_compiled: set[Any] = set()


class CancelledError(TribofluxError):
    """A run that nobody waits for any longer."""


@dataclass(frozen=True)
class ModelRun:
    """One model of a case.

    Attributes
    ----------
    model : str
        Its name.
    status : str
        As `Result.status`, or ``"refused"``.
    reason : str
        Why its own run ended, or was refused.
    case : Case or None
        Its own run, as the stop rule ends it, with outputs at the times of the page.
    shown : Result or None
        Its states up to the last of these times, whatever its own run does; of a model that is not
        drawn perhaps only the last one.
    stop_time : float or None
        When the stop rule ended its own run, scaled; None if it did not.
    error : float or None
        L2 norm of Q - Q_full over that of Q_full at the last time; None if it did not get there.
    """

    model: str
    status: str
    reason: str
    case: Case | None
    shown: Result | None = None
    stop_time: float | None = None
    error: float | None = None

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences that the user must be told."""
        return () if self.shown is None else self.shown.warnings


def runs(
    case: Case,
    first: tuple[str, ...] = (),
    *,
    models: tuple[str, ...] = JUDGED,
    check: Callable[[], None],
    on_progress: Callable[[str, Progress], None] | None = None,
) -> Iterator[ModelRun]:
    """Run a case with every model up to the time at which the full model's own run ends.

    Parameters
    ----------
    case : Case
        Of any model; its outputs do not matter.
    first : tuple of str
        Models to begin with, after the full one: those that are drawn.
    models : tuple of str
        All that are wanted besides, unless the grid is `LARGE`.
    check : callable
        Called between steps; raises `CancelledError` if nobody waits any longer.
    on_progress : callable, optional
        Called with a model's name and its progress.

    Yields
    ------
    ModelRun
        The full model first.

    Raises
    ------
    InputError
        If the case is refused with the full model.
    """

    def solve(wanted: Case) -> Result:
        return solved(wanted, check, on_progress)

    reference = _reference(case, solve)
    yield reference
    assert reference.shown is not None
    times = tuple(map(float, reference.shown.dataset["time"].values))
    wanted = (*first, *models) if case.grid.size <= LARGE else first
    others = [name for name in wanted if name != REFERENCE]
    for name in dict.fromkeys(others):
        check()
        own = with_changes(case, model=name)
        yield _other(own, times, reference.shown, solve, drawn=name in first)


def _reference(case: Case, solved: Callable[[Case], Result]) -> ModelRun:
    """Return the full model's run with outputs equally far apart up to its end."""
    end = case.run.t_end
    case = with_changes(case, model=REFERENCE)
    if case.run.stop_at_peak_charge is not None:
        end = float(solved(_late(case, None)).dataset["time"].values[-1])
    times = np.linspace(0.0, end, FRAMES).tolist() if end > 0.0 else [0.0]
    own = solved(with_changes(case, run={"outputs": times}))
    stopped = end if end < case.run.t_end and own.status == OK else None
    return ModelRun(REFERENCE, own.status, own.stop_reason, own.case, own, stopped, 0.0)


def _late(case: Case, first: float | None) -> Case:
    """Return a case whose outputs lie so late that few are made before a stop rule ends its run.

    Parameters
    ----------
    case : Case
        With any outputs.
    first : float or None
        A time that has to be among them.
    """
    end = case.run.t_end
    begin = _LATE * end if first is None else max(_LATE * end, 0.5 * (first + end))
    times = np.linspace(begin, end, FRAMES if first is None else FRAMES - 1).tolist()
    return with_changes(case, run={"outputs": times if first is None else [first, *times]})


def _other(
    case: Case,
    times: tuple[float, ...],
    reference: Result,
    solved: Callable[[Case], Result],
    *,
    drawn: bool,
) -> ModelRun:
    """Return how another model's own run ends, and what it shows up to the last time."""
    last, end = times[-1], case.run.t_end
    own_case = with_changes(case, run={"outputs": times})
    try:
        shown = own = solved(_late(case, last) if 0.0 < last < end else own_case)
    except InputError as error:
        return ModelRun(case.model, "refused", str(error), None)
    own_end = float(own.dataset["time"].values[-1])
    stopped = own_end if own.status == OK and own_end < end else None
    if 0.0 < last < end and (drawn or own_end < last):
        if own.status != OK and own_end < last:
            shown = solved(own_case)
        else:
            # a stop value that is never reached needs no other compiled program
            longer: dict[str, Any] = {"t_end": last, "outputs": times}
            if case.run.stop_at_peak_charge is not None:
                longer["stop_at_peak_charge"] = SMALLEST
            shown = solved(with_changes(case, run=longer))
    at_end = np.flatnonzero(shown.dataset["time"].values == last)
    error = None
    if at_end.size and (shown.status == OK or own_end >= last):
        charge = shown.dataset["charge"].values[at_end[0]]
        error = relative_errors(charge, reference.dataset["charge"].values[-1]).rms
    return ModelRun(case.model, own.status, own.stop_reason, own_case, shown, stopped, error)


def solved(
    case: Case,
    check: Callable[[], None],
    on_progress: Callable[[str, Progress], None] | None = None,
) -> Result:
    """Solve a case; of the first callers of a program all but one wait until it is compiled.

    Parameters
    ----------
    case : Case
        What to solve.
    check : callable
        Called between segments of steps; raises `CancelledError` if nobody waits any longer.
    on_progress : callable, optional
        Called with the model's name and its progress.
    """
    from triboflux.solve import solve  # imports JAX

    def report(progress: Progress) -> None:
        check()
        if on_progress is not None:
            on_progress(case.model, progress)

    check()
    program = (
        case.model,
        case.grid,
        case.run.stop_at_peak_charge is None,
        len(case.run.output_times),
    )
    if program in _compiled:
        return solve(case, on_progress=report)
    with _locks_guard:
        lock = _locks.setdefault(program, threading.Lock())
    with lock:
        check()
        result = solve(case, on_progress=report)
        _compiled.add(program)
    return result


def advice_of(case: Case, found: dict[str, ModelRun]) -> Advice:
    """Return which model suits, from runs of all of them; as `triboflux.advice.advise` does.

    Parameters
    ----------
    case : Case
        What was run.
    found : dict of str to ModelRun
        By model.
    """
    beyond = advice_outside(case.numbers, case.closures)
    if beyond is not None:
        return beyond
    if not set(CHEAPEST_FIRST) <= set(found):
        reason = f"On more than {LARGE} points only the drawn models are run."
        return Advice(NOT_JUDGED, (reason,), (), "none")
    return advice_from(_errors(case, found), "computed")


def _errors(case: Case, found: dict[str, ModelRun]) -> ModelErrors:
    """Return the errors of the reduced models, or why there are none."""
    full = found[REFERENCE]
    if full.status != OK:
        return ModelErrors(full.status, f"the full model: {full.reason}")
    if full.stop_time is None and case.run.stop_at_peak_charge is not None:
        reason = f"{NOT_HALVED}: the largest charge has not fallen by t = {case.run.t_end:g}"
        return ModelErrors(NOT_HALVED, reason)
    errors = tuple(
        ModelError(name, OK, error, error, error)
        if (error := found[name].error) is not None
        else ModelError(name, _status(found[name]))
        for name in CHEAPEST_FIRST
    )
    return ModelErrors(OK, models=errors)


def _status(run: ModelRun) -> str:
    return run.status if run.status != OK else "without a state at this time"
