"""What the command ``chart`` does: a map, its figure and its files."""

from __future__ import annotations

from collections import Counter
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from triboflux import numbers
from triboflux.case import Case
from triboflux.compare import with_changes
from triboflux.errors import shown_path
from triboflux.files import require_folder, require_writable, written_at_once
from triboflux.initial_state import require_file
from triboflux.suitability import (
    RANGES,
    chart_axes,
    chart_case,
    require_reduced,
    save,
    suitability,
)
from triboflux.suspension import read_suspension_file
from triboflux.terminal import MembersBar, in_background, interruptible, progress_bar

if TYPE_CHECKING:
    import xarray as xr

    from triboflux.suspension import Suspension

NAMES = ("chart.png", "chart.pdf", "chart.nc")
"""Files in the output folder."""
RUNS = "runs"
"""Folder of the stores in the output folder."""

_MARK = "S"


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
    closures : str or None
        Closure set in place of the case's own.
    points : int
        Along each axis.
    suspension : pathlib.Path or None
        File with a suspension to mark.
    workers : int or None
        Local processes.
    overwrite : bool
        Replace existing files.
    quiet : bool
        Draw and print nothing.
    """

    output: Path
    case_file: Path | None
    reduced: str
    closures: str | None
    points: int
    suspension: Path | None
    workers: int | None
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
        case, paths, runs = _case(options), _paths(options), options.output / RUNS
        axes = chart_axes(options.points)
        marked = None if options.suspension is None else read_suspension_file(options.suspension)[0]
        if marked is not None:
            numbers.from_suspension(marked, case.closures)
        runs.mkdir(parents=True, exist_ok=True)
        with progress_bar(quiet=options.quiet, kind=MembersBar) as on_progress:
            dataset = in_background(
                lambda: suitability(
                    case,
                    options.reduced,
                    axes,
                    store_folder=runs,
                    workers=options.workers,
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


def _case(options: Options) -> Case:
    """Return the case, with numbers in place of a suspension."""
    require_reduced(options.reduced)
    if options.case_file is None:
        return chart_case(options.closures or "derived")
    case = Case.from_toml(options.case_file)
    if options.closures is not None:
        case = with_changes(case, closures=options.closures)
    # two of the numbers vary while the others stay, as those of a suspension can't
    case = Case(**case.model_dump(exclude={"suspension"}))
    require_file(case)
    return case


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
    from triboflux import compare_figure
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
                compare_figure.save(figure, partial)


def position(dataset: xr.Dataset, suspension: Suspension) -> tuple[float, float]:
    """Return Péclet number and collision time of a suspension with the map's closures.

    Parameters
    ----------
    dataset : xarray.Dataset
        The map.
    suspension : Suspension
        The suspension.
    """
    found = numbers.from_suspension(suspension, str(dataset.attrs["closures"]))
    return found.peclet, found.tau_c


def _told(dataset: xr.Dataset, suspension: Suspension, file: Path) -> str:
    """Return the name of a suspension and those of its numbers that the map does not show."""
    found = numbers.from_suspension(suspension, str(dataset.attrs["closures"]))
    # a dollar sign begins a formula
    name = shown_path(file.name).strip("'\"").replace("$", r"\$")
    return (
        f"{name}, Pe = {found.peclet:.2g}, tau_c = {found.tau_c:.2g}; its own L/d = "
        f"{found.length_ratio:.3g}, u = {found.energy_ratio:.2g}, e = {found.restitution:.2g}, "
        f"tau_p = {found.tau_p:.2g}, tau_sigma = {found.tau_sigma:.2g}"
    )


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
    model = f"{dataset.attrs['reduced']} against full, {dataset.attrs['closures']} closures"
    return [f"{model}: {error.size} points: {told}", f"error: {good}"]


def nearest_point(dataset: xr.Dataset, suspension: Suspension) -> str:
    """Return a sentence on the point of the map next to a suspension.

    Parameters
    ----------
    dataset : xarray.Dataset
        Over the keys of `triboflux.suitability.RANGES`.
    suspension : Suspension
        The suspension.
    """
    peclet, tau_c = place = position(dataset, suspension)
    told = f"the suspension has Pe = {peclet:.3g} and tau_c = {tau_c:.3g}"
    if not all(a <= v <= b for v, (a, b) in zip(place, RANGES.values(), strict=True)):
        return f"{told}, outside the chart"
    nearest = {
        name: int(np.abs(np.log(dataset[name].values / value)).argmin())
        for name, value in zip(("peclet", "tau_c"), place, strict=True)
    }
    point = dataset.isel(nearest)
    status, error = str(point["status"].values), float(point["error"])
    value = f"error {error:.2g}" if status == "ok" else f"no error: {status}"
    return (
        f"{told}; nearest point of the chart, Pe = {float(point['peclet']):.3g} and tau_c = "
        f"{float(point['tau_c']):.3g}: {value}"
    )
