"""From a validated case to a result."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from triboflux import case_checks, closures, diagnostics, models
from triboflux.breaches import RealizabilityWatch
from triboflux.calculus import FourierCalculus
from triboflux.dataset import build_dataset, stats_and_warnings
from triboflux.files import require_writable
from triboflux.grid import Grid
from triboflux.hierarchy import components, moves
from triboflux.keeping import Keeper
from triboflux.mass_coordinate import moved_along
from triboflux.memory import require_memory
from triboflux.moments import Moments
from triboflux.progress import Progress
from triboflux.realizability import TENSOR
from triboflux.result import Result
from triboflux.running import run_in_memory, run_to_file
from triboflux.segments import Segments
from triboflux.sweep_member import decisive_versions

if TYPE_CHECKING:
    import xarray as xr

    from triboflux.case import Case

__all__ = ["Progress", "solve", "solve_to_file"]

KIND = "solve"
"""What the checkpoints are of."""


def solve(
    case: Case,
    *,
    on_progress: Callable[[Progress], None] | None = None,
    checkpoint: str | PathLike[str] | None = None,
    resume: bool = False,
    checkpoint_minutes: float = 5.0,
    checkpoint_steps: int | None = None,
) -> Result:
    """Run a case.

    Parameters
    ----------
    case : Case
        What to run.
    on_progress : Callable, optional
        Called with a `Progress` after every segment of steps.
    checkpoint : path-like, optional
        A file in which to keep what the run needs to go on, with its outputs beside it; both are
        removed at the end. It is also written when the run is interrupted or fails.
    resume : bool
        Go on from the checkpoint if it exists, and end with the same dataset, bit for bit on the
        same machine.
    checkpoint_minutes : float
        Time between two checkpoints, at least; one is written after a segment of steps only.
    checkpoint_steps : int, optional
        Steps between two checkpoints, besides.

    Returns
    -------
    Result
        Its status is ``"ok"`` if the run ended as the case asks, ``"diverged"`` if the step size
        collapsed, ``"nonphysical"`` if an algebraic closure made no sense any longer or the case's
        bound of realizability was reached; everything up to there is in the dataset.

    Raises
    ------
    InputError
        If the stop value lies above the initial peak charge, or the checkpoint is not of this case,
        damaged, or being written by another process.
    OutOfRangeError
        If the numbers are outside the range of validity of the closures.
    TribofluxError
        If the checkpoint can't be written.
    """
    require_memory(case)
    return run_in_memory(
        case,
        lambda keeper: _Run(case, keeper),
        kind=KIND,
        versions=decisive_versions(),
        checkpoint=checkpoint,
        resume=resume,
        checkpoint_minutes=checkpoint_minutes,
        checkpoint_steps=checkpoint_steps,
        on_progress=on_progress,
    )


def solve_to_file(
    case: Case,
    path: str | PathLike[str],
    *,
    units: str = "scaled",
    overwrite: bool = False,
    resume: bool = False,
    checkpoint_minutes: float = 5.0,
    checkpoint_steps: int | None = None,
    on_progress: Callable[[Progress], None] | None = None,
    interrupted: Callable[[], bool] | None = None,
) -> Result:
    """Run a case and write its result, with a memory that does not grow with its outputs.

    Outputs stream into a file beside ``path``, and a checkpoint is kept there while the run goes
    on; both are removed at the end.

    Parameters
    ----------
    case : Case
        What to run.
    path : path-like
        The NetCDF file to write; `triboflux.load` reads it.
    units : str
        ``"scaled"`` or ``"si"``.
    overwrite : bool
        Replace an existing file, and discard a checkpoint unless it is to be resumed.
    resume, checkpoint_minutes, checkpoint_steps, on_progress
        As for `solve`; the checkpoint's name is that of the file with ``.checkpoint`` after it.
    interrupted : callable, optional
        Asked after every segment of steps whether to stop.

    Returns
    -------
    Result
        The last time of the result that was written, with all its attributes.

    Raises
    ------
    InputError
        As for `solve`, and if the file exists or its folder can't be written to.
    OutOfRangeError
        As for `solve`.
    InterruptionError
        If the run was asked to stop; what is computed is in the checkpoint.
    TribofluxError
        If writing fails; what is computed is in the checkpoint if that could still be written.
    """
    case_checks.check_units(case, units)
    require_writable(path, overwrite=overwrite)
    require_memory(case, streamed=True)
    return run_to_file(
        case,
        lambda keeper: _Run(case, keeper),
        path,
        kind=KIND,
        versions=decisive_versions(),
        units=units,
        overwrite=overwrite,
        resume=resume,
        checkpoint_minutes=checkpoint_minutes,
        checkpoint_steps=checkpoint_steps,
        on_progress=on_progress,
        interrupted=interrupted,
    )


class _Run:
    """A run from its case to the datasets of its outputs.

    Parameters
    ----------
    case : Case
        What to run.
    keeper : Keeper
        Where its outputs go, and perhaps where it goes on from.
    """

    def __init__(self, case: Case, keeper: Keeper) -> None:
        self._case, self._keeper = case, keeper
        closure_set = closures.by_name(case.closures, case.numbers.restitution, case.exponent)
        model = models.build(case.model, case.numbers, closure_set, dimensions=case.grid.dimensions)
        self._warnings = [
            *models.validity(
                model.coefficients, closure_set, case.run.allow_out_of_range, model_name=case.model
            ),
            *diagnostics.unused_initial_warnings(case, model),
        ]
        # As arrays, so that a case with other numbers reuses the compiled program.
        self._model = jax.tree.map(jnp.asarray, model)
        self._grid = Grid(case.grid.points, case.grid.lengths)
        n_t = models.trace_dimensions(case.model, closure_set, self._grid.dimensions)
        self._attributes = {"trace_dimensions": n_t}
        self._segments = Segments(case, self._model, self._grid)
        keeper.take(self._segments)
        self._watch = RealizabilityWatch(
            self._grid,
            closed_covariance="covariance" not in model.evolves,
            evolved_temperature=TENSOR in model.evolves,
        )

    def complete(self, on_progress: Callable[[Progress], None] | None) -> None:
        """Make segments until the run is over."""
        segments = self._segments
        while segments.position.ending is None:
            segments.advance(self._keeper.records, estimate=on_progress is not None)
            if on_progress is not None and segments.position.steps:
                on_progress(segments.progress())
            self._keeper.consider()

    def datasets(self, count: int) -> Iterator[xr.Dataset]:
        """Give the outputs, so many times at once, without what `final_attributes` returns."""
        records, position = self._keeper.records, self._segments.position
        assert position.ending is not None
        status, reason = position.ending
        for start in range(0, len(records), count):
            chosen = range(start, min(start + count, len(records)))
            times, fields = self._observed(chosen)
            self._watch.add(times, fields)
            yield build_dataset(
                self._case,
                times,
                status=status,
                stop_reason=reason,
                stats={},
                attributes=self._attributes,
                **fields,
            )

    def final_attributes(self) -> dict[str, str]:
        """Return the attributes that are known only when all datasets have been made."""
        position = self._segments.position
        stats = {
            "accepted": position.accepted,
            "rejected": position.rejected,
            "points": list(position.grid.points),
            "seconds": round(self._keeper.seconds, 3),
        }
        assert position.ending is not None
        # a coarser grid is left before its spectrum would have to be warned of
        resolution = (
            diagnostics.resolution_warnings(self._grid, position.carry.coefficients)
            if position.ending[0] == "ok" and position.grid == self._grid
            else []
        )
        return stats_and_warnings(stats, [*self._warnings, *resolution, *self._watch.warnings()])

    def _observed(self, chosen: Sequence[int]) -> tuple[np.ndarray, dict[str, Any]]:
        """Return times and fields of some outputs."""
        times = np.empty(len(chosen))
        fields: dict[str, Any] = {}
        for place, index in enumerate(chosen):
            record = self._keeper.records[index]
            times[place] = record["time"]
            evolved = {name: jnp.asarray(record[name]) for name in self._model.evolves}
            observed = _observe(self._model, self._grid, Moments(**evolved))
            if moves(self._case.model):
                observed = moved_along(observed, self._grid.lengths[0])
            for name, values in observed.items():
                if name not in fields:
                    fields[name] = np.empty((len(chosen), *values.shape))
                fields[name][place] = values
        return times, fields


@eqx.filter_jit
def _observe(model: models.Model, grid: Grid, coefficients: Moments) -> dict[str, Any]:
    """Return the fields of a result from Fourier coefficients, those that the model knows."""
    calculus = FourierCalculus(grid)
    fields = model.fields(calculus, coefficients)
    electric_field = grid.to_fields(calculus.electric_field(coefficients.charge))
    neglected = fields.covariance is None
    observed = {
        "charge": fields.charge,
        "covariance": jnp.zeros_like(electric_field) if neglected else fields.covariance,
        "field": electric_field,
        "potential": grid.to_fields(calculus.potential(coefficients.charge)),
        "peak_charge": grid.peak(coefficients.charge),
    }
    if fields.variance is not None:
        observed["variance"] = fields.variance
    for moment in model.evolves:
        for name, place in components(moment, grid.dimensions).items():
            observed.setdefault(name, getattr(fields, moment)[place])
    return observed
