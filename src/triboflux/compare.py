"""One case with several models of the hierarchy, compared at the same time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from triboflux.case import MODEL_NAMES, Case
from triboflux.comparison import (
    FIELDS,
    VECTORS,
    Comparison,
    ComparisonRow,
    RelativeErrors,
    relative_errors,
)
from triboflux.errors import InputError, TribofluxError, nearest, shown
from triboflux.validation import SMALLEST

# JAX and xarray are imported where they are needed, so that refusals come at once
if TYPE_CHECKING:
    from triboflux.result import Result
    from triboflux.solve import Progress

DEFAULT_MODELS = ("full", "semi-algebraic", "gradient")
"""What is compared if nothing else is asked for."""

_ENOUGH_SECONDS, _MOST_REPEATS = 0.5, 4
_SHORT = 1e-6
"""Part of a run that is integrated beforehand, to compile everything that the whole one needs."""


def require_models(models: Sequence[str]) -> tuple[str, ...]:
    """Return models in the order of the hierarchy, the most complete first.

    Parameters
    ----------
    models : sequence of str
        At least two different ones of `triboflux.case.MODEL_NAMES`.

    Raises
    ------
    InputError
        If one is unknown or given twice, or if there are fewer than two.
    """
    for name in models:
        if name not in MODEL_NAMES:
            raise InputError.about(
                "models",
                f"contains {shown(name)}, but known are {', '.join(MODEL_NAMES)}",
                hint=nearest(name, MODEL_NAMES),
            )
        if list(models).count(name) > 1:
            raise InputError.about("models", f"contains {shown(name)} more than once")
    if len(models) < 2:
        given = f"only {shown(models[0])}" if models else "nothing"
        raise InputError.about("models", f"contains {given}, but a comparison needs at least two")
    return tuple(sorted(models, key=MODEL_NAMES.index))


def with_changes(case: Case, **changes: Any) -> Case:
    """Return a case with other values of some fields; of the table ``run``, too.

    Parameters
    ----------
    case : Case
        To start from.
    **changes : object
        ``model``, ``closures``, or a mapping ``run`` with what changes there.

    Raises
    ------
    InputError
        If a value is not allowed.
    """
    # what follows from a suspension depends on the closures
    follows = set[str]() if case.suspension is None else {"numbers"}
    data: dict[str, Any] = case.model_dump(exclude=follows)
    data["run"] |= changes.pop("run", {})
    return Case(**(data | changes))


def compare(
    case: Case,
    models: Sequence[str] = DEFAULT_MODELS,
    *,
    on_progress: Callable[[Progress], None] | None = None,
) -> Comparison:
    """Run a case with several models and measure how far they are from the most complete one.

    Each model's own run obeys the case's stop rules. All are compared at one time, the last of the
    most complete model whose run ended well; a model whose own run ends earlier is run once more,
    without stop rules, up to that time.

    Parameters
    ----------
    case : Case
        What to run; its own `model` does not matter.
    models : sequence of str
        Names of the models.
    on_progress : Callable, optional
        Called with a `triboflux.solve.Progress` of all runs together.

    Returns
    -------
    Comparison
        Also of models that were refused, diverged or became nonphysical, with the reason.

    Raises
    ------
    InputError
        If the models are not allowed, or the case is not for every one of them.
    TribofluxError
        If no model's run ended well.
    """
    names = require_models(models)
    results: dict[str, Result] = {}
    refusals: dict[str, InputError] = {}
    states: dict[str, Result] = {}
    costs: dict[str, float] = {}
    reference: str | None = None
    time: float | None = None
    for number, name in enumerate(names):
        first, second = (_part(on_progress, 2 * number + i, 2 * len(names)) for i in (0, 1))
        try:
            own = with_changes(case, model=name, run={"outputs": _outputs(case, time)})
            results[name], costs[name] = _timed(own, first)
        except InputError as error:
            refusals[name] = error
            continue
        if reference is None and results[name].status == "ok":
            reference, time = name, float(results[name].dataset["time"].values[-1])
        if time is not None:
            states[name] = _run_to(time, results[name], second)
    if len(refusals) == len(names):
        raise refusals[names[0]]
    if reference is None or time is None:
        ends = [f"{name} {found.status} ({found.stop_reason})" for name, found in results.items()]
        ends += [f"{name} refused" for name in refusals]
        raise TribofluxError(f"no model's run ended well: {'; '.join(ends)}.")
    # more complete models than the reference were run before the time was known
    states |= {name: _run_to(time, results[name]) for name in results if name not in states}
    arrived = {name: at for name in results if (at := _at(time, states[name])) is not None}
    rows = [
        _row(results[name], costs[name], states[name], arrived.get(name), arrived[reference])
        if name in results
        else ComparisonRow(name, "refused", str(refusals[name]))
        for name in names
    ]
    return Comparison(case, reference, time, tuple(rows), results, arrived)


def _outputs(case: Case, time: float | None) -> tuple[float, ...]:
    """Return the case's own output times, the first and, if it is known already, the common one."""
    outputs = case.run.outputs
    times = np.linspace(0.0, case.run.t_end, outputs) if isinstance(outputs, int) else outputs
    return tuple(sorted({0.0, *map(float, times), *(() if time is None else (time,))}))


def _timed(case: Case, on_progress: Callable[[Progress], None] | None) -> tuple[Result, float]:
    """Return a result and the shortest time in seconds that it took, without compilation."""
    from triboflux.solve import solve  # imports JAX

    outputs = case.run.outputs
    assert isinstance(outputs, tuple)
    beginning = {"t_end": _SHORT * case.run.t_end, "outputs": tuple(_SHORT * t for t in outputs)}
    first = solve(with_changes(case, run=beginning))
    result = solve(case, on_progress=on_progress)
    seconds = [float(result.stats["seconds"])]
    if result.stats.get("points") != first.stats.get("points"):
        # the program of the finer grid was compiled within the run
        seconds = [float(solve(case).stats["seconds"])]
    while sum(seconds) < _ENOUGH_SECONDS and len(seconds) <= _MOST_REPEATS:
        seconds.append(float(solve(case).stats["seconds"]))
    return result, min(seconds)


def _run_to(
    time: float, own: Result, on_progress: Callable[[Progress], None] | None = None
) -> Result:
    """Return a run that goes on to a time if the model's own run ended well before it."""
    from triboflux.solve import solve  # imports JAX

    times = own.dataset["time"].values
    if time in times or (own.status != "ok" and times[-1] < time):
        return own
    # A stop rule that hardly ever holds and as many outputs need no other compiled program.
    outputs = own.case.run.outputs
    count = outputs if isinstance(outputs, int) else len(outputs)
    # outputs before its own end would only repeat the warnings of its own run
    begin = min(float(times[-1]), 0.9 * time)
    run: dict[str, Any] = {"t_end": time, "outputs": np.linspace(begin, time, count).tolist()}
    if own.case.run.stop_at_peak_charge is not None:
        run["stop_at_peak_charge"] = SMALLEST
    run["stop_at_rate"] = None
    longer = solve(with_changes(own.case, run=run), on_progress=on_progress)
    if longer.status != "ok" or time in longer.dataset["time"].values:
        return longer
    # the charge has vanished altogether
    return solve(with_changes(own.case, run=run | {"stop_at_peak_charge": None}))


def _at(time: float, result: Result) -> Result | None:
    """Return a result's state at a time, or None if it has none."""
    from triboflux.result import Result

    found = np.flatnonzero(result.dataset["time"].values == time)
    return Result(result.dataset.isel(time=found)) if found.size else None


def _row(
    own: Result, seconds: float, longer: Result, state: Result | None, reference: Result
) -> ComparisonRow:
    """Return what the table says about a model that was run."""
    end = float(own.dataset["time"].values[-1])
    stopped = own.status == "ok" and end < own.case.run.t_end
    reason = own.stop_reason
    if longer.status != own.status:
        reason += f"; run on, it ended {longer.status}: {longer.stop_reason}"
    return ComparisonRow(
        own.case.model,
        own.status,
        reason,
        stop_time=end if stopped else None,
        end_time=end,
        peak_charge=None if state is None else float(state.dataset["peak_charge"].values[-1]),
        errors={} if state is None else _errors(state, reference),
        seconds=seconds,
        steps=int(own.stats["accepted"]),
        rejected=int(own.stats["rejected"]),
    )


def _errors(state: Result, reference: Result) -> dict[str, RelativeErrors]:
    """Return the relative errors of the fields that both states have."""
    return {
        name: relative_errors(
            state.dataset[name].values[-1],
            reference.dataset[name].values[-1],
            vector=name in VECTORS,
        )
        for name in FIELDS
        if name in state.dataset and name in reference.dataset
    }


def _part(
    on_progress: Callable[[Progress], None] | None, part: int, parts: int
) -> Callable[[Progress], None] | None:
    """Return a callback for one of several runs that reports the fraction of all of them."""
    if on_progress is None:
        return None
    return lambda now: on_progress(replace(now, fraction=(part + now.fraction) / parts))
