"""What the command ``chart`` does: a map, its figure and its files."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from triboflux import numbers
from triboflux.case import Case
from triboflux.compare import with_changes
from triboflux.errors import InputError, shown, shown_path
from triboflux.files import require_folder, require_writable, written_at_once
from triboflux.initial_state import require_file
from triboflux.suitability import (
    chart_axes,
    chart_case,
    require_models,
    require_plane,
    suitability,
)
from triboflux.suitability_file import save
from triboflux.suspension import read_suspension_file
from triboflux.sweep_runners import require_runner
from triboflux.sweep_values import ValueRange
from triboflux.terminal import MembersBar, in_background, interruptible, progress_bar

if TYPE_CHECKING:
    import xarray as xr

    from triboflux.suspension import Suspension

NAMES = ("chart.png", "chart.pdf", "chart.nc")
"""Files in the output folder."""
RUNS = "runs"
"""Folder of the stores in the output folder."""

_MARK = "S"
_NUMBERS = "numbers."
_SHORT = {
    "peclet": "Pe",
    "tau_c": "tau_c",
    "length_ratio": "L/d",
    "energy_ratio": "u",
    "restitution": "e",
    "tau_p": "tau_p",
    "tau_sigma": "tau_sigma",
}


@dataclass(frozen=True)
class Options:
    """What the command line says.

    Attributes
    ----------
    output : pathlib.Path
        Folder, made if absent.
    case_file : pathlib.Path or None
        The case; `triboflux.suitability.chart_case` if None.
    reduced : str
        Model to judge.
    reference : str
        Model to judge it against.
    closures : str or None
        Closure set in place of the case's own.
    points : int
        Along each axis.
    axes : tuple of str or None
        What ``--x`` and ``--y`` say.
    suspension : pathlib.Path or None
        File with a suspension to mark.
    workers : int or None
        Local processes.
    retry : bool
        Run failed members again.
    overwrite : bool
        Replace existing files.
    quiet : bool
        Draw and print nothing.
    """

    output: Path
    case_file: Path | None
    reduced: str
    reference: str
    closures: str | None
    points: int
    axes: tuple[str | None, str | None]
    suspension: Path | None
    workers: int | None
    retry: bool
    overwrite: bool
    quiet: bool


def command(options: Options) -> None:
    """Compute a chart under a progress bar, write its files and print a summary.

    Parameters
    ----------
    options : Options
        What to do.

    Raises
    ------
    InputError
        If anything is not allowed.
    TribofluxError
        If workers fail or a file can't be written.
    """
    kept = f"finished runs are kept in {shown_path(options.output / RUNS)}; the same command "
    with interruptible(f"{kept}goes on from there"):
        axes = axes_of(options.axes, options.points)
        case, paths, runs = _case(options, axes), _paths(options), options.output / RUNS
        require_plane(case, axes)
        require_runner(options.workers, None)
        marked = _marked(options, case, [key for key, _ in axes])
        runs.mkdir(parents=True, exist_ok=True)
        with progress_bar(quiet=options.quiet, kind=MembersBar) as on_progress:
            dataset = in_background(
                lambda: suitability(
                    case,
                    options.reduced,
                    axes,
                    reference=options.reference,
                    store_folder=runs,
                    workers=options.workers,
                    retry=options.retry,
                    on_progress=on_progress,
                )
            )
        _write(dataset, paths, options, marked)
    if not options.quiet:
        for sentence in summary(dataset):
            print(sentence)
        if marked is not None:
            print(nearest_point(dataset, marked))
        for path in paths:
            print(f"written to {shown_path(path)}")


def axes_of(
    given: tuple[str | None, str | None], points: int
) -> tuple[tuple[str, list[float]], ...]:
    """Return the axes that the command line asks for.

    Parameters
    ----------
    given : tuple of str or None
        For each axis ``KEY=FIRST:LAST``, equal ratios apart, or ``KEY=VALUE,VALUE,...``; None for
        that of `triboflux.suitability.chart_axes`.
    points : int
        Number of values between FIRST and LAST.

    Raises
    ------
    InputError
        If a text is not of this form.
    """
    usual = chart_axes(points)
    return tuple(
        axis if text is None else _axis(option, text, points)
        for option, text, axis in zip(("x", "y"), given, usual, strict=True)
    )


def _axis(option: str, text: str, points: int) -> tuple[str, list[float]]:
    """Return key and values of one axis."""
    key, _, told = text.partition("=")
    separator = ":" if ":" in told else ","
    try:
        values = [float(value) for value in told.split(separator)]
    except ValueError:
        values = []
    if not key or len(values) < 2 or (separator == ":" and len(values) != 2):
        problem = (
            f"is {shown(text)}, but must be KEY=FIRST:LAST or KEY=VALUE,VALUE,... such as "
            "numbers.peclet=1e2:1e8"
        )
        raise InputError.about(option, problem)
    if separator == ",":
        return key, values
    first, last = values
    if not 0.0 < first < last < math.inf:
        problem = f"is {shown(text)}, but its ends must be positive, finite and increasing"
        raise InputError.about(option, problem)
    spread = ValueRange(first=first, last=last, count=points, spacing="logarithmic")
    return key, spread.values()


def _case(options: Options, axes: tuple[tuple[str, list[float]], ...]) -> Case:
    """Return the case, with numbers in place of a suspension unless that is what varies."""
    require_models(options.reduced, options.reference)
    if options.case_file is None:
        return chart_case(options.closures or "derived")
    case = Case.from_toml(options.case_file)
    if options.closures is not None:
        case = with_changes(case, closures=options.closures)
    if not any(key.startswith("suspension.") for key, _ in axes):
        # two of the numbers vary while the others stay, as those of a suspension can't
        case = Case(**case.model_dump(exclude={"suspension"}))
    require_file(case)
    return case


def _marked(options: Options, case: Case, keys: Sequence[str]) -> Suspension | None:
    """Return the suspension to be marked, having checked that it can be."""
    if options.suspension is None:
        return None
    _require_numbers(keys)
    suspension, _ = read_suspension_file(options.suspension)
    _values_of(suspension, case.closures, keys)
    return suspension


def _paths(options: Options) -> list[Path]:
    """Return where to write, having checked that it can be."""
    folder = options.output
    if not folder.exists():
        require_folder(folder.parent)
        return [folder / name for name in NAMES]
    require_folder(folder)
    for name in NAMES:
        require_writable(folder / name, overwrite=options.overwrite)
    return [folder / name for name in NAMES]


def _write(
    dataset: xr.Dataset, paths: list[Path], options: Options, marked: Suspension | None
) -> None:
    """Write figure and data, all files or none."""
    from triboflux.figures import style
    from triboflux.figures.chart import Mark, chart_figure, is_inside

    marks: dict[str, Mark] = {}
    if marked is not None and options.suspension is not None:
        place, told = position(dataset, marked), _told(dataset, marked, options.suspension)
        if not is_inside(dataset, place):
            told += ", outside the chart"
        marks[_MARK] = Mark(place, told)
    figure = chart_figure(dataset, marks)
    with ExitStack() as stack:
        for path in paths:
            # the files get their names together, when all of them are complete
            partial = stack.enter_context(written_at_once(path, overwrite=options.overwrite))
            if path.suffix == ".nc":
                save(dataset, partial)
            else:
                style.save(figure, partial)


def position(dataset: xr.Dataset, suspension: Suspension) -> tuple[float, float]:
    """Return where a suspension is in the plane of a map, with the map's closures.

    Parameters
    ----------
    dataset : xarray.Dataset
        The map.
    suspension : Suspension
        The suspension.

    Raises
    ------
    InputError
        If the plane is not one of two numbers.
    """
    x, y = _values_of(suspension, str(dataset.attrs["closures"]), _keys(dataset))
    return x, y


def _values_of(suspension: Suspension, closures: str, keys: Sequence[str]) -> list[float]:
    """Return some of the numbers of a suspension."""
    _require_numbers(keys)
    found = numbers.from_suspension(suspension, closures)
    return [float(getattr(found, key.removeprefix(_NUMBERS))) for key in keys]


def _require_numbers(keys: Sequence[str]) -> None:
    """Refuse axes on which a suspension has no place."""
    for key in keys:
        if not key.startswith(_NUMBERS):
            problem = f"can't be marked where {shown(key)} varies, only in a plane of two numbers"
            raise InputError.about("suspension", problem)


def _keys(dataset: xr.Dataset) -> list[str]:
    return [str(dataset[name].attrs["parameter"]) for name in dataset["error"].dims]


def _told(dataset: xr.Dataset, suspension: Suspension, file: Path) -> str:
    """Return the name of a suspension and those of its numbers that the map does not show."""
    found = numbers.from_suspension(suspension, str(dataset.attrs["closures"]))
    # a dollar sign begins a formula
    name = shown_path(file.name).strip("'\"").replace("$", r"\$")
    drawn = [key.removeprefix(_NUMBERS) for key in _keys(dataset)]
    shown_ones, others = (
        ", ".join(
            f"{_SHORT[number]} = {getattr(found, number):.3g}"
            for number in _SHORT
            if (number in drawn) is wanted
        )
        for wanted in (True, False)
    )
    return f"{name}, {shown_ones}; its own {others}"


def summary(dataset: xr.Dataset) -> list[str]:
    """Return sentences on how many points have an error, and of which size.

    Parameters
    ----------
    dataset : xarray.Dataset
        From `triboflux.suitability.suitability`.
    """
    status = Counter(str(text) for text in dataset["status"].values.ravel())
    error = dataset["error"].values
    told = ", ".join(f"{count} {name}" for name, count in status.most_common())
    good = ", ".join(
        f"{int(np.sum(error <= part))} within {part:.0%}" for part in (0.01, 0.05, 0.1)
    )
    models = f"{dataset.attrs['reduced']} against {dataset.attrs['reference']}"
    model = f"{models}, {dataset.attrs['closures']} closures"
    return [f"{model}: {error.size} points: {told}", f"error: {good}"]


def nearest_point(dataset: xr.Dataset, suspension: Suspension) -> str:
    """Return a sentence on the point of the map next to a suspension.

    Parameters
    ----------
    dataset : xarray.Dataset
        Over two of the seven numbers.
    suspension : Suspension
        The suspension.
    """
    place = position(dataset, suspension)
    dimensions = [str(name) for name in dataset["error"].dims]
    labels = [_SHORT.get(key.removeprefix(_NUMBERS), key) for key in _keys(dataset)]
    told = f"the suspension has {_pair(labels, place)}"
    axes = [dataset[name].values for name in dimensions]
    if not all(axis[0] <= value <= axis[-1] for value, axis in zip(place, axes, strict=True)):
        return f"{told}, outside the chart"
    nearest = {
        name: int(np.abs(np.log(axis / value)).argmin())
        for name, axis, value in zip(dimensions, axes, place, strict=True)
    }
    point = dataset.isel(nearest)
    status, error = str(point["status"].values), float(point["error"])
    value = f"error {error:.2g}" if status == "ok" else f"no error: {status}"
    beside = [float(point[name]) for name in dimensions]
    return f"{told}; nearest point of the chart, {_pair(labels, beside)}: {value}"


def _pair(labels: Sequence[str], values: Sequence[float]) -> str:
    return " and ".join(f"{label} = {v:.3g}" for label, v in zip(labels, values, strict=True))
