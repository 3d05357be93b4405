"""From a validated case to the result of a particle simulation."""

from __future__ import annotations

import math
import os
import time as clock
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from importlib import metadata
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from triboflux import checkpoint as checkpoints
from triboflux.case_kinetic import Kinetic
from triboflux.checkpoint import InterruptionError, Schedule
from triboflux.errors import InputError, shown_path
from triboflux.fields import STANDARD_ERROR
from triboflux.kinetic.dataset import dataset_of
from triboflux.kinetic.ensemble import Ensemble, Parameters
from triboflux.kinetic.moments import mean_and_error, moments_of, peak_charge
from triboflux.kinetic.saved import KIND, State, from_checkpoint, to_checkpoint
from triboflux.kinetic.start import draw_particles
from triboflux.memory import require_memory_for_particles
from triboflux.progress import Progress, fraction_done
from triboflux.result import Result

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from triboflux.case import Case

_CHECKS = 1000
"""How often at least the stop rule is looked at in a run."""
_PARTICLE_STEPS = 2e7
"""Work of an ensemble between two reports of progress, about a second."""


def simulate(
    case: Case,
    *,
    workers: int | None = None,
    checkpoint: str | PathLike[str] | None = None,
    resume: bool = False,
    schedule: Schedule | None = None,
    interrupted: Callable[[], bool] | None = None,
    on_progress: Callable[[Progress], None] | None = None,
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
    checkpoint : path-like, optional
        File from which an interrupted simulation can go on; it is removed at the end.
    resume : bool
        Go on from the checkpoint. The result is bit for bit that of an uninterrupted run.
    schedule : Schedule, optional
        When a checkpoint is due; every five minutes by default.
    interrupted : Callable, optional
        Asked about once a second whether to write a checkpoint and stop.
    on_progress : Callable, optional
        Called with a `triboflux.progress.Progress` about once a second.

    Returns
    -------
    Result
        Its dataset has the variables of a model's result and ``number_density``,
        ``mean_velocity``, ``granular_temperature``, ``granular_temperature_xx``,
        ``covariance_flux_xx``, ``covariance_flux_trace`` and ``variance_flux``, averaged over the
        cells around the grid points, each with a standard error. ``stats`` tells the time at which
        the peak charge fell to the value of the stop rule, with its standard error.

    Raises
    ------
    InputError
        If the case does not fit a particle simulation, or the checkpoint not the case.
    InterruptionError
        If it was interrupted; the checkpoint, if any, is written.
    TribofluxError
        If a checkpoint can't be written.
    """
    started = clock.perf_counter()
    parameters = Parameters.of(case)
    _check_rules(case)
    options = case.kinetic or Kinetic()
    require_memory_for_particles(options.particles * options.ensembles)
    keeper = None if checkpoint is None else _Keeper(case, checkpoint, schedule or Schedule())
    with ThreadPoolExecutor(workers or len(os.sched_getaffinity(0))) as pool:
        run = _Simulation(case, parameters, pool)
        if resume and keeper is not None:
            run.state = keeper.read(parameters)
        else:
            run.begin()
        status, reason = _finish(run, keeper, interrupted, on_progress)
    if keeper is not None:
        keeper.remove()
    stats = run.statistics() | {"seconds": round(clock.perf_counter() - started, 3)}
    return Result(run.dataset(status, reason, stats))


def _finish(
    run: _Simulation,
    keeper: _Keeper | None,
    interrupted: Callable[[], bool] | None,
    on_progress: Callable[[Progress], None] | None,
) -> tuple[str, str]:
    """Run to the end, keeping checkpoints, and return status and reason."""
    ending = None
    while ending is None:
        ending = run.go_on()
        if on_progress is not None:
            on_progress(run.progress())
        if ending is None and interrupted is not None and interrupted():
            where = f"at t = {run.state.time:.6g}"
            if keeper is None:
                raise InterruptionError(f"interrupted {where}; without a checkpoint all is lost.")
            keeper.write(run.state)
            raise InterruptionError(f"interrupted {where}; {keeper.told}")
        if ending is None and keeper is not None:
            keeper.write_if_due(run.state)
    return ending


class _Keeper:
    """Writes and reads the checkpoints of a simulation."""

    def __init__(self, case: Case, path: str | PathLike[str], schedule: Schedule) -> None:
        self._case, self._path, self._schedule = case, path, schedule
        names = ("triboflux", "numpy", "numba")
        self._versions = {name: metadata.version(name) for name in names}
        self.told = f"the checkpoint is {shown_path(path)}."

    def read(self, parameters: Parameters) -> State:
        saved = checkpoints.read(
            self._path, kind=KIND, case_toml=self._case.to_toml(), versions=self._versions
        )
        options = self._case.kinetic or Kinetic()
        return from_checkpoint(saved, parameters, (options.ensembles, options.particles))

    def write(self, state: State) -> None:
        checkpoints.write(self._path, to_checkpoint(self._case, self._versions, state))

    def write_if_due(self, state: State) -> None:
        steps = state.ensembles[0].steps
        if self._schedule.due(steps):
            self.write(state)
            self._schedule.written(steps)

    def remove(self) -> None:
        checkpoints.remove(self._path)


class _Simulation:
    """A simulation that goes on step by step."""

    def __init__(self, case: Case, parameters: Parameters, pool: ThreadPoolExecutor) -> None:
        self._case, self._parameters, self._pool = case, parameters, pool
        self._options = case.kinetic or Kinetic()
        outputs = case.run.output_times
        self._targets = outputs if outputs[-1] == case.run.t_end else (*outputs, case.run.t_end)
        self.state: State

    def begin(self) -> None:
        """Draw the particles."""
        seeds = np.random.SeedSequence(self._options.seed).spawn(self._options.ensembles)
        ensembles = list(self._pool.map(self._draw, seeds))
        none = (0.0, math.inf, math.inf)
        self.state = State(ensembles, _totals(ensembles), 0.0, 0, 0, 0.0, [], [], none, none)
        self._check_peak()
        self.state.initial_peak = peak = self.state.peak[1]
        stop = self._case.run.stop_at_peak_charge
        if stop is not None and stop >= peak:
            raise InputError(
                f"run.stop_at_peak_charge: {stop:g} is not allowed; it must be below the initial "
                f"peak charge, {peak:.6g}."
            )
        if self._targets[0] == 0.0:
            self._record()
            self.state.interval = 1

    def _draw(self, seed: np.random.SeedSequence) -> Ensemble:
        of_particles, of_collisions = seed.spawn(2)
        random = np.random.default_rng(of_particles)
        particles = draw_particles(self._case, self._options.particles, random)
        words = of_collisions.generate_state(4, np.uint64).astype(np.uint64)
        return Ensemble(self._parameters, particles, words)

    def go_on(self) -> tuple[str, str] | None:
        """Make some steps; return status and reason if that was the end."""
        run, state = self._case.run, self.state
        start = self._targets[state.interval - 1] if state.interval else 0.0
        end = self._targets[state.interval]
        steps = max(1, math.ceil((end - start) / self._parameters.time_step - 1e-9))
        size = (end - start) / steps
        chunk = self._chunk(size, steps)
        list(self._pool.map(lambda ensemble: ensemble.advance(chunk, size), state.ensembles))
        state.step += chunk
        state.time = end if state.step == steps else start + state.step * size
        if not all(np.isfinite(e.particles).all() for e in state.ensembles):
            return "diverged", f"particles were not finite any longer at t = {state.time:.6g}"
        self._check_peak()
        stop = run.stop_at_peak_charge
        if stop is not None and state.peak[1] <= stop:
            self._record()
            return "ok", f"peak charge fell to {stop:g}"
        if state.step == steps:
            self._record()
            state.interval, state.step = state.interval + 1, 0
        if state.interval == len(self._targets):
            return "ok", f"reached t_end = {run.t_end:g}"
        return None

    def _chunk(self, size: float, steps: int) -> int:
        """Return how many steps to make until the next check or report."""
        particles = len(self.state.ensembles[0].particles)
        most = max(1, int(_PARTICLE_STEPS / particles))
        if self._case.run.stop_at_peak_charge is not None:
            every = max(1, int(self._case.run.t_end / (_CHECKS * size)))
            most = min(most, every - self.state.step % every)
        return min(most, steps - self.state.step)

    def _check_peak(self) -> None:
        state, points = self.state, self._parameters.points
        charges = list(self._pool.map(lambda e: e.sums()[1], state.ensembles))
        state.before = state.peak
        state.peak = (state.time, *peak_charge(np.stack(charges).reshape(-1, points)))

    def _record(self) -> None:
        state = self.state
        found = list(self._pool.map(moments_of, state.ensembles))
        values: dict[str, Any] = {}
        for name in found[0]:
            values[name], values[name + STANDARD_ERROR] = mean_and_error([f[name] for f in found])
        values["peak_charge"], values["peak_charge" + STANDARD_ERROR] = map(
            np.float64, state.peak[1:]
        )
        state.times.append(state.time)
        state.records.append(values)

    def progress(self) -> Progress:
        """Return how far the simulation is."""
        run, state = self._case.run, self.state
        done = fraction_done(run, state.time, state.peak[1], state.initial_peak)
        steps = state.ensembles[0].steps
        return Progress(state.time, run.t_end, steps, 0, state.peak[1], done)

    def statistics(self) -> dict[str, Any]:
        """Return what the run counted and conserved."""
        state = self.state
        drift = np.abs(_totals(state.ensembles) - state.initial_totals).max(axis=0)
        collisions = sum(e.collisions for e in state.ensembles)
        particles = sum(len(e.particles) for e in state.ensembles)
        stats = {
            "steps": state.ensembles[0].steps,
            "collisions": collisions,
            "collisions_per_particle": 2.0 * collisions / particles,
            "largest_probability": max(e.largest_probability for e in state.ensembles),
            "momentum_drift": float(drift[:3].max()),
            "charge_drift": float(drift[3]),
            "kinetic_energy_drift": float(drift[4]),
        }
        stop = self._case.run.stop_at_peak_charge
        (before, high, _), (after, low, error) = state.before, state.peak
        if stop is not None and low <= stop < high:
            slope = (high - low) / (after - before)
            stats["stop_time"] = before + (high - stop) / slope
            stats["stop_time_standard_error"] = error / slope
        return stats

    def dataset(self, status: str, reason: str, stats: dict[str, Any]) -> Any:
        """Label what was put out."""
        p, records, options = self._parameters, self.state.records, self._options
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
        return dataset_of(
            self._case,
            self.state.times,
            {name: np.stack([r[name] for r in records]) for name in records[0]},
            status=status,
            stop_reason=reason,
            stats=stats,
            attributes=attributes,
        )


def _totals(ensembles: list[Ensemble]) -> NDArray[np.float64]:
    """Return momentum, charge and kinetic energy of each ensemble, per particle."""
    totals: list[tuple[float, ...]] = []
    for particles in (e.particles for e in ensembles):
        squares = np.einsum("ij,ij->", particles[:, 1:4], particles[:, 1:4])
        energy = 0.5 * float(squares) / len(particles)
        totals.append((*map(float, particles[:, 1:].mean(axis=0)), energy))
    return np.array(totals)


def _check_rules(case: Case) -> None:
    """Refuse a stop rule that noise makes meaningless; raises InputError."""
    if case.run.stop_at_rate is not None:
        raise InputError.about(
            "run.stop_at_rate",
            f"is {case.run.stop_at_rate:g}, but must be absent for particles, whose noise never "
            "comes to rest",
        )
