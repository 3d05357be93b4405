"""From a validated case to the result of a particle simulation."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from importlib import metadata
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np

from triboflux import case_checks
from triboflux.dataset import stats_and_warnings
from triboflux.errors import InputError
from triboflux.files import require_writable
from triboflux.keeping import Keeper
from triboflux.kinetic.dataset import dataset_of
from triboflux.kinetic.segments import ParticleSegments
from triboflux.memory import require_memory_for_particles
from triboflux.rates import transfer_warnings
from triboflux.result import Result
from triboflux.running import run_in_memory, run_to_file

if TYPE_CHECKING:
    import xarray as xr

    from triboflux.case import Case
    from triboflux.progress import Progress

KIND = "kinetic"
"""What the checkpoints are of."""


def simulate(
    case: Case,
    *,
    workers: int | None = None,
    on_progress: Callable[[Progress], None] | None = None,
    checkpoint: str | PathLike[str] | None = None,
    resume: bool = False,
    checkpoint_minutes: float = 5.0,
    checkpoint_steps: int | None = None,
) -> Result:
    """Simulate the particles of a case.

    Spheres fly, collide by the rule that the closures are made from, and are accelerated by the
    electric field of their mean charge. Numbers, initial state, outputs and the rules ``t_end`` and
    ``stop_at_peak_charge`` have the same meaning as for `triboflux.solve`; model, closures and
    tolerances have none. The table ``[kinetic]`` says how many particles there are, and what is
    held fixed.

    Parameters
    ----------
    case : Case
        In one space dimension; velocities have three.
    workers : int, optional
        Number of threads; one per usable core by default. It does not change the result.
    on_progress : Callable, optional
        Called with a `triboflux.progress.Progress` about once a second.
    checkpoint, resume, checkpoint_minutes, checkpoint_steps
        As for `triboflux.solve`.

    Returns
    -------
    Result
        Its dataset has the variables of a model's result and ``number_density``,
        ``mean_velocity``, ``granular_temperature``, ``granular_temperature_xx``,
        ``covariance_flux_xx``, ``covariance_flux_trace`` and ``variance_flux``, averaged over the
        cells around the grid points, each with a standard error. ``stats`` tells the time at which
        the peak charge fell to the value of the stop rule, with its standard error, in L/√Θ.

    Raises
    ------
    InputError
        If the case does not fit a particle simulation, or the checkpoint not the case.
    OutOfRangeError
        If collisions on average pass over more than the charge difference.
    TribofluxError
        If a checkpoint can't be written.
    """
    _check(case)
    with _pool(workers) as pool:
        return run_in_memory(
            case,
            lambda keeper: _Simulation(case, pool, keeper),
            kind=KIND,
            versions=_decisive_versions(),
            checkpoint=checkpoint,
            resume=resume,
            checkpoint_minutes=checkpoint_minutes,
            checkpoint_steps=checkpoint_steps,
            on_progress=on_progress,
        )


def simulate_to_file(
    case: Case,
    path: str | PathLike[str],
    *,
    workers: int | None = None,
    units: str = "scaled",
    overwrite: bool = False,
    resume: bool = False,
    checkpoint_minutes: float = 5.0,
    checkpoint_steps: int | None = None,
    on_progress: Callable[[Progress], None] | None = None,
    interrupted: Callable[[], bool] | None = None,
) -> Result:
    """Simulate the particles of a case and write the result.

    Outputs stream into a file beside ``path``, and a checkpoint is kept there meanwhile.

    Parameters
    ----------
    case : Case
        As for `simulate`.
    path : path-like
        The NetCDF file to write; `triboflux.load` reads it.
    workers : int, optional
        As for `simulate`.
    units, overwrite, resume, checkpoint_minutes, checkpoint_steps, on_progress, interrupted
        As for `triboflux.solve.solve_to_file`.

    Returns
    -------
    Result
        The last time of the result that was written, with all its attributes.

    Raises
    ------
    InputError
        As for `simulate`, and if the file exists or its folder can't be written to.
    InterruptionError
        If the simulation was asked to stop; what is computed is in the checkpoint.
    TribofluxError
        If writing fails; what is computed is in the checkpoint if that could still be written.
    """
    case_checks.check_units(case, units)
    _check(case)
    require_writable(path, overwrite=overwrite)
    with _pool(workers) as pool:
        return run_to_file(
            case,
            lambda keeper: _Simulation(case, pool, keeper),
            path,
            kind=KIND,
            versions=_decisive_versions(),
            units=units,
            overwrite=overwrite,
            resume=resume,
            checkpoint_minutes=checkpoint_minutes,
            checkpoint_steps=checkpoint_steps,
            on_progress=on_progress,
            interrupted=interrupted,
        )


class _Simulation:
    """A simulation from its case to the datasets of its outputs."""

    def __init__(self, case: Case, pool: ThreadPoolExecutor, keeper: Keeper) -> None:
        self._case, self._keeper = case, keeper
        self._segments = ParticleSegments(case, pool)
        fraction = self._segments.parameters.charge_transfer
        self._warnings = transfer_warnings(fraction, case.exponent, case.run.allow_out_of_range)
        keeper.take(self._segments)

    def complete(self, on_progress: Callable[[Progress], None] | None) -> None:
        """Make segments until the simulation is over."""
        while self._segments.position.ending is None:
            self._segments.advance(self._keeper.records)
            if on_progress is not None:
                on_progress(self._segments.progress())
            self._keeper.consider()

    def datasets(self, count: int) -> Iterator[xr.Dataset]:
        """Give the outputs, so many times at once, without what `final_attributes` returns."""
        p, options = self._segments.parameters, self._segments.options
        records, ending = self._keeper.records, self._segments.position.ending
        assert ending is not None
        attributes: dict[str, str | int | float] = {
            "method": "kinetic",
            "particles": options.particles,
            "ensembles": options.ensembles,
            "seed": options.seed,
            "cells": p.cells,
            "time_step": p.time_step,
            "thermostat": p.thermostat,
            "mean_field": int(options.mean_field),
            "dilute": int(options.dilute),
        }
        for start in range(0, len(records), count):
            chosen = [records[i] for i in range(start, min(start + count, len(records)))]
            stacked = {name: np.stack([r[name] for r in chosen]) for name in chosen[0]}
            yield dataset_of(
                self._case,
                stacked.pop("time"),
                stacked,
                status=ending[0],
                stop_reason=ending[1],
                stats={},
                attributes=attributes,
            )

    def final_attributes(self) -> dict[str, str]:
        """Return the attributes that are known only at the end."""
        stats = self._segments.statistics() | {"seconds": round(self._keeper.seconds, 3)}
        return stats_and_warnings(stats, self._warnings)


def _check(case: Case) -> None:
    """Refuse a stop rule that noise makes meaningless, and too many particles."""
    if case.run.stop_at_rate is not None:
        raise InputError.about(
            "run.stop_at_rate",
            f"is {case.run.stop_at_rate:g}, but must be absent for particles, whose noise never "
            "comes to rest",
        )
    require_memory_for_particles(case)


def _pool(workers: int | None) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(workers or len(os.sched_getaffinity(0)))


def _decisive_versions() -> dict[str, str]:
    return {name: metadata.version(name) for name in ("triboflux", "numpy", "numba")}
