"""A particle simulation made segment by segment: where it stands, and what has come out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from triboflux.case_checks import check_stop_value
from triboflux.case_kinetic import Kinetic
from triboflux.errors import TribofluxError
from triboflux.fields import STANDARD_ERROR
from triboflux.kinetic.cells import COLUMNS
from triboflux.kinetic.ensemble import Ensemble, Parameters
from triboflux.kinetic.moments import MOMENTS, mean_and_error, moments_of, peak_charge
from triboflux.kinetic.start import draw_particles
from triboflux.progress import Progress, fraction_done

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from triboflux.case import Case
    from triboflux.keeping import Records

_CHECKS = 1000
"""How often at least the stop rule is looked at in a run."""
_PARTICLE_STEPS = 2e7
"""Work of an ensemble in a segment, about a second."""
_TOTALS = ("momentum", "momentum", "momentum", "charge", "kinetic_energy")


@dataclass(frozen=True)
class Position:
    """All but the particles that a simulation needs to go on, replaced after every segment.

    Attributes
    ----------
    interval, step : int
        How many output times and ends are reached, and steps done since.
    time : float
        Scaled by L/√Θ.
    steps : int
        All steps so far.
    recorded : int
        Outputs so far.
    before, peak : tuple of float
        Time, largest charge and its standard error, at the check before the last and at the last.
    ending : tuple of str or None
        Status and reason, once the simulation is over.
    """

    interval: int = 0
    step: int = 0
    time: float = 0.0
    steps: int = 0
    recorded: int = 0
    before: tuple[float, float, float] = (0.0, math.inf, math.inf)
    peak: tuple[float, float, float] = (0.0, math.inf, math.inf)
    ending: tuple[str, str] | None = None


class ParticleSegments:
    """A simulation of a case, made segment by segment.

    Where segments end is decided by the case alone, so that one that goes on from a checkpoint
    draws the same random numbers as one that was never interrupted.

    Parameters
    ----------
    case : Case
        What to simulate.
    pool : concurrent.futures.ThreadPoolExecutor
        Works on the ensembles.

    Raises
    ------
    InputError
        If the case does not fit a particle simulation.
    """

    def __init__(self, case: Case, pool: ThreadPoolExecutor) -> None:
        self._case, self._pool = case, pool
        self.options = case.kinetic or Kinetic()
        self.parameters = Parameters.of(case)
        outputs = case.run.output_times
        self._targets = outputs if outputs[-1] == case.run.t_end else (*outputs, case.run.t_end)
        seeds = np.random.SeedSequence(self.options.seed).spawn(self.options.ensembles)
        self.ensembles = list(pool.map(self._draw, seeds))
        self._whole = True
        self._initial_totals = self._totals()
        self.position = Position(peak=(0.0, *self._peak_charge()))
        self._initial_peak = self.position.peak[1]
        check_stop_value(case, self._initial_peak)

    def _draw(self, seed: np.random.SeedSequence) -> Ensemble:
        of_particles, of_collisions = seed.spawn(2)
        random = np.random.default_rng(of_particles)
        particles = draw_particles(self._case, self.options.particles, random)
        words = of_collisions.generate_state(4, np.uint64).astype(np.uint64)
        return Ensemble(self.parameters, particles, words)

    def advance(self, records: Records) -> None:
        """Make the next segment, put its output into ``records`` and take the new position.

        Parameters
        ----------
        records : Records
            With as many outputs as the position says.
        """
        now = self.position
        if self._targets[now.interval] == now.time and not now.steps:
            self._record(records, now)
            self.position = replace(now, interval=1, recorded=1, ending=self._end_of(1))
            return
        start = self._targets[now.interval - 1] if now.interval else 0.0
        end = self._targets[now.interval]
        steps = max(1, math.ceil((end - start) / self.parameters.time_step - 1e-9))
        size = (end - start) / steps
        chunk = self._chunk(size, steps)
        self._whole = False
        list(self._pool.map(lambda ensemble: ensemble.advance(chunk, size), self.ensembles))
        self._whole = True
        done = now.step + chunk
        time = end if done == steps else start + done * size
        now = replace(now, step=done, time=time, steps=now.steps + chunk)
        if not all(np.isfinite(e.particles).all() for e in self.ensembles):
            reason = f"particles were not finite any longer at t = {time:.6g}"
            if not len(records):
                self._record_start(records)
            self.position = replace(now, recorded=len(records), ending=("diverged", reason))
            return
        now = replace(now, before=now.peak, peak=(time, *self._peak_charge()))
        stop = self._case.run.stop_at_peak_charge
        stopped = stop is not None and now.peak[1] <= stop
        if stopped or done == steps:
            self._record(records, now)
            interval = now.interval + 1
            now = replace(now, interval=interval, step=0, recorded=len(records))
            told = ("ok", f"peak charge fell to {stop:g}") if stopped else self._end_of(interval)
            now = replace(now, ending=told)
        self.position = now

    def _end_of(self, interval: int) -> tuple[str, str] | None:
        if interval < len(self._targets):
            return None
        return "ok", f"reached t_end = {self._case.run.t_end:g}"

    def _chunk(self, size: float, steps: int) -> int:
        """Return how many steps to make until the next check or report."""
        done = self.position.step
        most = max(1, int(_PARTICLE_STEPS / self.options.particles))
        if self._case.run.stop_at_peak_charge is not None:
            every = max(1, int(self._case.run.t_end / (_CHECKS * size)))
            most = min(most, every - done % every)
        return min(most, steps - done)

    def _peak_charge(self) -> tuple[float, float]:
        charges = list(self._pool.map(lambda ensemble: ensemble.sums()[1], self.ensembles))
        return peak_charge(np.stack(charges))

    def _record(self, records: Records, now: Position) -> None:
        found = list(self._pool.map(moments_of, self.ensembles))
        record = {"time": np.array(now.time), "peak_charge": np.array(now.peak[1])}
        record[f"peak_charge{STANDARD_ERROR}"] = np.array(now.peak[2])
        for name in MOMENTS:
            mean, error = mean_and_error([moments[name] for moments in found])
            record |= {name: mean, f"{name}{STANDARD_ERROR}": error}
        records.append(record)

    def _record_start(self, records: Records) -> None:
        """Record the initial state, the last that is known where all outputs lie further on."""
        seeds = np.random.SeedSequence(self.options.seed).spawn(self.options.ensembles)
        for ensemble, seed in zip(self.ensembles, seeds, strict=True):
            # one after the other: there may be no memory for all particles once more
            ensemble.particles = self._draw(seed).particles
        self._record(records, Position(peak=(0.0, *self._peak_charge())))

    def progress(self) -> Progress:
        """Return how far the simulation is."""
        run, now = self._case.run, self.position
        done = fraction_done(run, now.time, now.peak[1], self._initial_peak)
        return Progress(now.time, run.t_end, now.steps, 0, now.peak[1], done)

    def layout(self) -> dict[str, tuple[int, ...]]:
        """Return the shape of every array of a record."""
        points = (self.parameters.points,)
        shapes: dict[str, tuple[int, ...]] = {"time": (), "peak_charge": ()}
        shapes |= dict.fromkeys(MOMENTS, points)
        errors = {f"{name}{STANDARD_ERROR}": s for name, s in shapes.items() if name != "time"}
        return shapes | errors

    def stored(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Return particles and position as arrays and numbers for a checkpoint.

        Raises
        ------
        TribofluxError
            In the middle of a segment.
        """
        if not self._whole:
            raise TribofluxError("the particles are in the middle of a segment.")
        arrays: dict[str, NDArray[Any]] = {}
        for number, ensemble in enumerate(self.ensembles):
            arrays[f"particles {number}"] = ensemble.particles
            arrays[f"generator {number}"] = ensemble.generator
        counts = [[e.collisions, e.largest_probability] for e in self.ensembles]
        return arrays, asdict(self.position) | {"counts": counts}

    def restore(self, arrays: Mapping[str, NDArray[Any]], numbers: Mapping[str, Any]) -> None:
        """Take what was stored.

        Parameters
        ----------
        arrays, numbers : mapping
            From `stored`.

        Raises
        ------
        LookupError, TypeError, ValueError
            If they do not fit the case.
        """
        shape = (self.options.particles, COLUMNS)
        for number, ensemble in enumerate(self.ensembles):
            particles, words = arrays[f"particles {number}"], arrays[f"generator {number}"]
            if particles.shape != shape or words.shape != (4,) or words.dtype != np.uint64:
                raise ValueError("the particles of the checkpoint do not fit the case")
            ensemble.particles, ensemble.generator = particles, words
            collisions, largest = numbers["counts"][number]
            ensemble.collisions, ensemble.largest_probability = int(collisions), float(largest)
            ensemble.steps = int(numbers["steps"])
        fields = {name: numbers[name] for name in asdict(self.position)}
        for name in ("before", "peak", "ending"):
            fields[name] = None if fields[name] is None else tuple(fields[name])
        self.position = Position(**fields)

    def statistics(self) -> dict[str, Any]:
        """Return what the simulation counted and conserved."""
        now = self.position
        collisions = sum(ensemble.collisions for ensemble in self.ensembles)
        drift = np.abs(self._totals() - self._initial_totals).max(axis=0)
        stats: dict[str, Any] = {
            "steps": now.steps,
            "collisions": collisions,
            "collisions_per_particle": 2.0
            * collisions
            / (self.options.particles * self.options.ensembles),
            "largest_probability": max(e.largest_probability for e in self.ensembles),
        }
        for name, change in zip(_TOTALS, drift, strict=True):
            key = f"{name}_drift"
            stats[key] = max(stats.get(key, 0.0), float(change))
        stop = self._case.run.stop_at_peak_charge
        (before, high, _), (after, low, error) = now.before, now.peak
        if stop is not None and low <= stop < high:
            slope = (high - low) / (after - before)
            stats["stop_time"] = before + (high - stop) / slope
            stats["stop_time_standard_error"] = error / slope
        return stats

    def _totals(self) -> NDArray[np.float64]:
        """Return momentum, charge and kinetic energy of each ensemble, per particle."""
        totals: list[tuple[float, ...]] = []
        for particles in (ensemble.particles for ensemble in self.ensembles):
            squares = np.einsum("ij,ij->", particles[:, 1:4], particles[:, 1:4])
            energy = 0.5 * float(squares) / len(particles)
            totals.append((*map(float, particles[:, 1:].mean(axis=0)), energy))
        return np.array(totals)
