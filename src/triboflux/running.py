"""A run from its keeper to its result, the same for transport models and for particles."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from os import PathLike
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from triboflux.checkpoint import Schedule, path_beside
from triboflux.errors import shown_path
from triboflux.keeping import FileKeeper, Keeper
from triboflux.result import Result
from triboflux.result_file import times_at_once, write_result

if TYPE_CHECKING:
    import xarray as xr

    from triboflux.case import Case
    from triboflux.progress import Progress


@runtime_checkable
class Run(Protocol):
    """A run from its case to the datasets of its outputs."""

    def complete(self, on_progress: Callable[[Progress], None] | None) -> None:
        """Make segments until the run is over."""
        ...

    def datasets(self, count: int) -> Iterator[xr.Dataset]:
        """Give the outputs, so many times at once, without what `final_attributes` returns."""
        ...

    def final_attributes(self) -> dict[str, str]:
        """Return the attributes that are known only when all datasets have been made."""
        ...


def run_in_memory(
    case: Case,
    begin: Callable[[Keeper], Run],
    *,
    kind: str,
    versions: Mapping[str, str],
    checkpoint: str | PathLike[str] | None,
    resume: bool,
    checkpoint_minutes: float,
    checkpoint_steps: int | None,
    on_progress: Callable[[Progress], None] | None,
) -> Result:
    """Run a case to its end and return the result.

    Parameters
    ----------
    case : Case
        What to run.
    begin : callable
        Makes the run, given its keeper.
    kind, versions
        Of checkpoints; see `FileKeeper`.
    checkpoint, resume, checkpoint_minutes, checkpoint_steps, on_progress
        As for `triboflux.solve`.
    """
    if checkpoint is None:
        keeper = Keeper()
    else:
        keeper = FileKeeper(
            checkpoint,
            case,
            kind=kind,
            versions=versions,
            name=f"checkpoint {shown_path(checkpoint)}",
            resume=resume,
            overwrite=False,
            schedule=Schedule(checkpoint_minutes, checkpoint_steps),
            interrupted=None,
        )
    with keeper:
        run = begin(keeper)
        run.complete(on_progress)
        (dataset,) = run.datasets(len(keeper.records))
        return Result(dataset.assign_attrs(run.final_attributes()))


def run_to_file(
    case: Case,
    begin: Callable[[Keeper], Run],
    path: str | PathLike[str],
    *,
    kind: str,
    versions: Mapping[str, str],
    units: str,
    overwrite: bool,
    resume: bool,
    checkpoint_minutes: float,
    checkpoint_steps: int | None,
    on_progress: Callable[[Progress], None] | None,
    interrupted: Callable[[], bool] | None,
) -> Result:
    """Run a case to its end, write the result, and return its last time.

    Parameters
    ----------
    case, begin, kind, versions
        As for `run_in_memory`.
    path, units, overwrite, resume, checkpoint_minutes, checkpoint_steps, on_progress, interrupted
        As for `triboflux.solve_to_file`.
    """
    keeper = FileKeeper(
        path_beside(path),
        case,
        kind=kind,
        versions=versions,
        name=f"output {shown_path(path)}",
        resume=resume,
        overwrite=overwrite,
        schedule=Schedule(checkpoint_minutes, checkpoint_steps),
        interrupted=interrupted,
    )
    with keeper:
        run = begin(keeper)
        run.complete(on_progress)
        return write_result(
            path,
            len(keeper.records),
            run.datasets(times_at_once(case.grid.size)),
            run.final_attributes,
            units=units,
            overwrite=overwrite,
            before_each=keeper.consider_stopping,
        )
