"""How errors of the particle simulation fall with time step, cells and number of particles."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from benchmarks import kinetic_boxes as b
from benchmarks.kinetic_boxes import DENSE, DILUTE, Effort
from triboflux.kinetic.ensemble import Ensemble, Parameters
from triboflux.sampling import Estimate

HEATED = replace(DILUTE, points=16, cells=64, energy_ratio=300.0)
"""A box in which the field of a charge wave heats particles."""
HELD = replace(HEATED, thermostat="full")
COOLED = replace(DILUTE, restitution=0.5, thermostat="full")


class Error(NamedTuple):
    """The error of a result with a coarse setting, against a fine one.

    Attributes
    ----------
    quantity : str
        Which result.
    setting : float
        Time steps, or what else is refined.
    error : Estimate
        Relative difference to the finest result.
    """

    quantity: str
    setting: float
    error: Estimate


def order(errors: Sequence[Error]) -> Estimate:
    """Return the order of convergence that two errors show, with its standard error."""
    coarse, fine = errors
    refined = math.log(fine.setting / coarse.setting)
    value = math.log(abs(coarse.error.value / fine.error.value)) / refined
    spread = math.hypot(*(e.error.error / e.error.value for e in errors)) / refined
    return Estimate(value, spread)


def decayed(parameters: Parameters, effort: Effort, time: float, steps: int) -> np.ndarray:
    """Return the amplitude of a charge wave after a time, in each ensemble."""

    def amplitude(box: Ensemble) -> float:
        b.put_wave(box)
        box.advance(steps, time / steps)
        return b.wave(box)

    return np.array(b.each(amplitude, b.boxes(parameters, effort)))


def collided(parameters: Parameters, effort: Effort, time: float, steps: int) -> np.ndarray:
    """Return the number of collisions of a particle in each ensemble."""

    def rate(box: Ensemble) -> float:
        box.advance(steps, time / steps)
        return 2.0 * box.collisions / len(box.particles)

    return np.array(b.each(rate, b.boxes(parameters, effort)))


RUNS = {
    "wave, dilute": (decayed, replace(DILUTE, collision_rate=20.0), 0.3),
    "wave, field and no thermostat": (decayed, HEATED, 0.16),
    "wave, field and thermostat": (decayed, HELD, 0.16),
    "collisions, e = 0.5 and thermostat": (collided, COOLED, 0.4),
    "collisions, dense": (collided, DENSE, 0.4),
}
"""What is measured, in which box, and to which time."""


def step_errors(
    name: str, effort: Effort, steps: Sequence[int] = (2, 4, 8), finest: int = 64
) -> Iterator[Error]:
    """Return the errors of a run with few time steps, from the same random starts."""
    measure, parameters, time = RUNS[name]
    best = measure(parameters, effort, time, finest)
    for count in steps:
        found = measure(parameters, effort, time, count)
        yield Error(name, count, b.estimate((found - best) / best.mean()))


def energies(ensemble: Ensemble) -> tuple[float, float]:
    """Return kinetic energy and energy of the field, per particle and scaled by m Θ."""
    _, field = ensemble.sums_and_field()
    left, right = field[:-1], field[1:]
    # the field is linear in each cell
    square = float(np.mean(left * left + left * right + right * right)) / 3.0
    kinetic = 1.5 * b.granular_temperature(ensemble)
    return kinetic, 0.5 * ensemble.parameters.energy_ratio * square


def energy_drift(effort: Effort, steps: int, parameters: Parameters = HEATED) -> Estimate:
    """Return the change of kinetic plus field energy over what has been exchanged."""

    def drift(box: Ensemble) -> tuple[float, float]:
        b.put_wave(box)
        kinetic, field = energies(box)
        box.advance(steps, 0.16 / steps)
        later_kinetic, later_field = energies(box)
        return later_kinetic + later_field - kinetic - field, field - later_field

    changes, exchanged = np.transpose(b.each(drift, b.boxes(parameters, effort)))
    return b.estimate(changes / exchanged.mean())


def scatter(number: int, effort: Effort) -> float:
    """Return the scatter of a decayed wave's amplitude over ensembles of a number of particles."""
    found = decayed(DILUTE, effort._replace(particles=number), 0.2, 8)
    return float(found.std(ddof=1))
