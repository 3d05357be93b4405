"""Where a reduced model is good enough: its error against one that keeps more, over two numbers."""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import resources
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from triboflux import closures
from triboflux.case import MODEL_NAMES, Case
from triboflux.case_text import case_table
from triboflux.comparison import relative_errors
from triboflux.errors import InputError, require_one_of, shown, shown_path
from triboflux.files import require_folder
from triboflux.initial_state import initial_fields
from triboflux.rates import scaled_rates
from triboflux.sweep import Sweep, SweepProgress, sweep
from triboflux.sweep_layout import coordinate_names
from triboflux.sweep_store import readable
from triboflux.sweep_values import ValueRange, plain

if TYPE_CHECKING:
    import xarray as xr

REFERENCE = "full"
"""The model that others are judged against unless another is asked for: the paper's."""


def measure_of(reference: str) -> str:
    """Return what the error is; the paper's Fig. 9 prints no criterion.

    Parameters
    ----------
    reference : str
        The model that another is judged against.
    """
    return (
        f"L2 norm of Q_reduced - Q_{reference} over L2 norm of Q_{reference}, at the time when the "
        f"largest absolute charge of the {reference} model has fallen to half of its initial value"
    )


MEASURE = measure_of(REFERENCE)
"""What the error against the full model is."""

RANGES = {"numbers.peclet": (1e2, 1e8), "numbers.tau_c": (1e-5, 1.0)}
"""The plane of the paper's Fig. 9, and its ends here."""

OUTSIDE = "F <= 0"
"""Status of a point whose charge variance would grow by itself."""
NOT_HALVED = "not halved"
"""Status of a point where the reference's charge did not fall to half by the end of its run."""

_SWEPT = ("numbers.", "suspension.", "exponent")
_HALF = 0.5


def chart_case(closure_name: str = "derived") -> Case:
    """Return the case behind the chart: the paper's, with 64 points and time enough to halve.

    Parameters
    ----------
    closure_name : str
        One of `triboflux.closures.NAMES`.

    Raises
    ------
    InputError
        If the closure set is unknown.
    """
    file = resources.files("triboflux") / "cases" / "fig1.toml"
    case = Case.from_toml_text(file.read_text(encoding="utf-8"))
    tables: dict[str, Any] = case.model_dump()
    # the slowest charge of the chart's plane halves at about 1e3
    tables["run"] |= {"t_end": 1e5, "outputs": 1, "stop_at_peak_charge": None}
    tables["grid"] = {"points": (64,)}
    tables |= {"title": "Chart of a reduced model", "closures": closure_name}
    return Case(**tables)


def chart_axes(points: int) -> tuple[tuple[str, list[float]], ...]:
    """Return the plane of the chart: Péclet numbers and collision times, equal ratios apart.

    Parameters
    ----------
    points : int
        Number of values along each axis, at least 2.

    Raises
    ------
    InputError
        If the number is not allowed.
    """
    if points < 2:
        raise InputError.about("points", f"is {points!r}, but must be at least 2")
    return tuple(
        (key, ValueRange(first=first, last=last, count=points, spacing="logarithmic").values())
        for key, (first, last) in RANGES.items()
    )


@dataclass
class _Point:
    """What is known of one point of the map."""

    status: str
    reason: str
    stop_time: float = np.nan
    error: float = np.nan

    @classmethod
    def of(cls, run: xr.Dataset, place: int) -> _Point:
        """Return what became of a member of a sweep."""
        member = run.isel(member=place)
        time = float(member["stop_time"])
        return cls(str(member["status"].values), str(member["stop_reason"].values), time)


def suitability(
    case: Case,
    reduced: str = "semi-algebraic",
    axes: Sequence[tuple[str, Sequence[float]]] | None = None,
    *,
    reference: str = REFERENCE,
    store_folder: str | PathLike[str],
    workers: int | None = None,
    retry: bool = False,
    on_progress: Callable[[SweepProgress], None] | None = None,
) -> xr.Dataset:
    """Return the error of a reduced model against a more complete one over two numbers of a case.

    The error of a point is the L2 norm of the difference of the mean charges over that of the
    reference's, both at the time t* at which the reference's largest absolute charge has fallen to
    half of its initial value. So it is 0 for a perfect model and of order 1 for a useless one; it
    judges pace and shape together. The paper's Fig. 9 shows a boundary without saying of what.

    A model is judged only where its reference is valid. There is no error where the closures are
    refused, where F <= 0 (the charge variance would grow by itself; with both closure sets), or
    where the reference does not get to t*.

    Parameters
    ----------
    case : Case
        Everything else; its model, stop rules and outputs have no effect.
    reduced : str
        The model to judge.
    reference : str
        The model to judge it against, which keeps more: earlier in `triboflux.hierarchy.MODELS`.
    axes : pair of (str, sequence of float), optional
        Two dotted keys in ``numbers`` or ``suspension``, or ``exponent``, each with at least two
        increasing positive values; `chart_axes` of 32 points by default.
    store_folder : path-like
        Existing folder for the stores of two sweeps. The same call goes on where it was
        interrupted, and other models over the same points find the reference's runs there.
    workers : int, optional
        Number of local processes; one per usable core by default.
    retry : bool
        Run those of an earlier call again that failed, by an exception or the death of their
        process.
    on_progress : Callable, optional
        Called with a `SweepProgress` of both sweeps together.

    Returns
    -------
    xarray.Dataset
        Over the two numbers: ``error`` (NaN where there is none), ``stop_time`` (t*), ``status``
        and ``reason``. Status is ``"ok"``; ``"F <= 0"``; ``"refused"``, ``"diverged"`` or
        ``"failed"`` of the reference; ``"not halved"`` by the end of the run; or ``"reduced "`` and
        the status of the reduced model. Attributes hold case, both models, measure and versions.

    Raises
    ------
    InputError
        If a model, an axis or the folder is not allowed, or the case has no initial charge.
    TribofluxError
        If workers fail; see `triboflux.sweep`.
    """
    require_models(reduced, reference)
    folder = Path(store_folder)
    require_folder(folder)
    grid, stop = require_plane(case, axes or chart_axes(32))
    points = [_outside(grid.table(index)) for index in range(grid.size)]
    inside = [index for index, point in enumerate(points) if point.status == "ok"]
    report = _progress_of_two(on_progress, len(inside))

    run = {"model": reference, "run": {"stop_at_peak_charge": stop}}
    judge = _run(grid, inside, run, {}, folder / reference, workers, retry, report)
    reached: dict[int, int] = {}
    for place, index in enumerate(inside):
        points[index] = point = _Point.of(judge, place)
        if point.status == "ok" and point.stop_time < case.run.t_end:
            reached[index] = place
        elif point.status == "ok":
            problem = f"the largest charge has not halved by t = {case.run.t_end:g}"
            points[index] = _Point(NOT_HALVED, problem)
    report = _progress_of_two(on_progress, len(reached), len(inside))
    times = {"run.t_end": [points[index].stop_time for index in reached]}
    run = {"model": reduced}
    other = _run(grid, list(reached), run, times, folder / reduced, workers, retry, report)
    for place, (index, of_judge) in enumerate(reached.items()):
        point = _Point.of(other, place)
        if point.status != "ok":
            points[index].status, points[index].reason = f"reduced {point.status}", point.reason
            continue
        charges = other["charge"].values[place], judge["charge"].values[of_judge]
        error = relative_errors(*charges).rms
        # a charge that has halved does not vanish
        points[index].error = np.nan if error is None else error
    return _dataset(grid, points, case, (reduced, reference))


def require_models(reduced: str, reference: str) -> None:
    """Refuse a reference that does not keep more than the model that it judges.

    Parameters
    ----------
    reduced, reference : str
        See `suitability`.

    Raises
    ------
    InputError
        If a model is unknown, or there is none that leaves out more than the reference.
    """
    require_one_of("reference", reference, MODEL_NAMES[:-1])
    require_one_of("reduced", reduced, MODEL_NAMES[MODEL_NAMES.index(reference) + 1 :])


def require_plane(case: Case, axes: Sequence[tuple[str, Sequence[float]]]) -> tuple[Sweep, float]:
    """Return the points of a plane and where the reference's runs stop, or refuse the plane.

    Parameters
    ----------
    case : Case
        Everything else.
    axes : pair of (str, sequence of float)
        See `suitability`.

    Returns
    -------
    tuple of Sweep and float
        The points, and half of the largest absolute charge at the start.

    Raises
    ------
    InputError
        If an axis is not allowed, or the case has no initial charge.
    """
    grid = Sweep(case=_tables(case), parameters=_parameters(axes))
    return grid, _HALF * _initial_peak(case)


def _tables(case: Case) -> dict[str, Any]:
    """Return the tables of a case without what each of the two sweeps decides."""
    tables = case_table(case.to_toml(), Path(), "the case")
    kept = ("rtol", "atol", "allow_out_of_range", "t_end")
    tables["run"] = {"outputs": 1} | {key: tables["run"][key] for key in kept}
    return tables


def _parameters(axes: Sequence[tuple[str, Sequence[float]]]) -> dict[str, list[float]]:
    """Return the axes as parameters of a sweep, or refuse them."""
    if len(axes) != 2 or len({key for key, _ in axes}) < len(axes):
        raise InputError.about("axes", "must be two different keys with their values")
    parameters: dict[str, list[float]] = {}
    for key, given in axes:
        if not key.startswith(_SWEPT):
            problem = f"is {shown(key)}, but must be a number of {', '.join(_SWEPT)}"
            raise InputError.about("axes", problem)
        values: list[Any] = plain(given)
        numbers = all(isinstance(v, int | float) and 0.0 < v < np.inf for v in values)
        increasing = numbers and all(b > a for a, b in itertools.pairwise(values))
        if len(values) < 2 or not increasing:
            problem = "must have at least two values, positive, finite and increasing"
            raise InputError.about(f"axes.{shown(key)}", problem)
        parameters[key] = values
    return parameters


def _initial_peak(case: Case) -> float:
    """Return the largest absolute charge on the points at time 0."""
    peak = float(np.abs(initial_fields(case)[0]).max())
    if not peak > 0.0:
        raise InputError.about("initial.charge", "is zero, but must be something that can halve")
    return peak


def _outside(table: dict[str, Any]) -> _Point:
    """Return why a point is outside the closures' range, as far as that is known at once."""
    try:
        case = Case(**table)
    except InputError as error:
        return _Point("refused", str(error))
    closure_set = closures.by_name(case.closures, case.numbers.restitution, case.exponent)
    rates = scaled_rates(closure_set, case.numbers)
    destruction = float(rates.variance_destruction)
    # without exchange of charge F vanishes, and so does what would regain variance
    if destruction < 0.0 or (destruction == 0.0 and float(rates.transferred_fraction) > 0.0):
        growth = f"F = {destruction:.4g}, so the charge variance would grow by itself"
        return _Point(OUTSIDE, growth)
    return _Point("ok", "")


def _run(
    grid: Sweep,
    indices: Sequence[int],
    changes: dict[str, Any],
    lists: dict[str, list[float]],
    store: Path,
    workers: int | None,
    retry: bool,
    report: Callable[[SweepProgress], None] | None,
) -> xr.Dataset:
    """Run some points of a grid with a model and return them over ``member``, in memory."""
    import xarray as xr

    if not indices:
        return xr.Dataset()
    case = grid.case | changes | {"run": grid.case["run"] | changes.get("run", {})}
    values = [grid.values(index) for index in indices]
    chosen = {key: [entry[key] for entry in values] for key in grid.parameters}
    members = Sweep(case=case, parameters=chosen | lists, mode="list")
    # a store takes one sweep only, so each gets its own
    digest = hashlib.sha256(members.to_toml().encode()).hexdigest()[:12]
    place = store.with_name(f"{store.name}-{digest}.zarr")
    with (
        sweep(members, place, workers=workers, retry=retry, on_progress=report) as opened,
        readable(f"store {shown_path(place)}"),
    ):
        return opened.load()  # pyright: ignore[reportUnknownMemberType] -- untyped keywords in xarray


def _progress_of_two(
    on_progress: Callable[[SweepProgress], None] | None, members: int, before: int = 0
) -> Callable[[SweepProgress], None] | None:
    """Return a callback for one of two sweeps that reports both; the second may be smaller."""
    if on_progress is None:
        return None
    total = before + members if before else 2 * members

    def report(progress: SweepProgress) -> None:
        on_progress(SweepProgress(before + progress.done, total, progress.not_ok))

    return report


def _dataset(
    grid: Sweep, points: Sequence[_Point], case: Case, models: tuple[str, str]
) -> xr.Dataset:
    """Label the map of a reduced model and its reference."""
    import xarray as xr

    from triboflux.dataset import versions  # imports xarray

    reduced, reference = models
    names = coordinate_names(tuple(grid.parameters))
    dimensions = tuple(names.values())
    long_names = {
        "error": measure_of(reference),
        "stop_time": f"t*, when the {reference} model's largest charge has halved",
        "status": "ok, or why there is no error",
        "reason": "the same in a sentence",
    }
    variables: dict[str, Any] = {}
    for name, long_name in long_names.items():
        text = name in ("status", "reason")
        values = np.array([getattr(p, name) for p in points], dtype=object if text else float)
        labels = {"long_name": long_name} | ({} if text else {"units": "1"})
        variables[name] = (dimensions, values.reshape(grid.shape), labels)
    variables["stop_time"][2]["scale"] = "L / sqrt(Theta)"
    coordinates = {
        names[key]: (names[key], np.array(values, dtype=float), {"parameter": key})
        for key, values in grid.parameters.items()
    }
    attributes = {
        "reduced": reduced,
        "reference": reference,
        "closures": case.closures,
        "measure": measure_of(reference),
        "case": case.to_toml(),
        "versions": json.dumps(versions()),
    }
    return xr.Dataset(variables, coordinates, attributes)
