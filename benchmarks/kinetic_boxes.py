"""Boxes of simulated particles with known answers, for tests and for the table of the page."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from triboflux.closures import collision_integral
from triboflux.kinetic.cells import cell_charges, electric_field, sort
from triboflux.kinetic.collisions import collide
from triboflux.kinetic.ensemble import Ensemble, Parameters
from triboflux.sampling import Estimate

Array = NDArray[np.float64]
Result = TypeVar("Result")

THREADS = 2
DILUTE = Parameters(
    points=1,
    cells=50,
    length=1.0,
    diameter=0.0,
    collision_rate=10.0,
    restitution=1.0,
    exponent=0.8,
    charge_transfer=0.0,
    field_transfer=0.0,
    energy_ratio=0.0,
    drag_rate=0.0,
    time_step=0.025,
    thermostat="none",
)
"""A box in which particles only collide, τ_c = 0.1, at a point."""
DENSE = replace(DILUTE, diameter=0.02, cells=400)
"""The same with spheres of a 50th of the box."""


class Effort(NamedTuple):
    """How many particles are simulated, and where their randomness starts.

    Attributes
    ----------
    particles, ensembles : int
        In each ensemble, and how many of these.
    seed : int
        Of everything random.
    """

    particles: int
    ensembles: int
    seed: int


def seeds(effort: Effort) -> list[tuple[np.random.Generator, NDArray[np.uint64]]]:
    """Return for each ensemble a generator of starts, and the words of its collisions."""
    found: list[tuple[np.random.Generator, NDArray[np.uint64]]] = []
    for seed in np.random.SeedSequence(effort.seed).spawn(effort.ensembles):
        start, collisions = seed.spawn(2)
        words = collisions.generate_state(4, np.uint64)
        found.append((np.random.default_rng(start), words))
    return found


def maxwellian(number: int, random: np.random.Generator) -> Array:
    """Return uncharged particles at random places, with no mean velocity and Θ = 1."""
    particles = np.zeros((number, 5))
    particles[:, 0] = random.random(number)
    velocity = random.standard_normal((number, 3))
    velocity -= velocity.mean(axis=0)
    particles[:, 1:4] = velocity * math.sqrt(3.0 * number / np.sum(velocity**2))
    return particles


def boxes(parameters: Parameters, effort: Effort) -> list[Ensemble]:
    """Return ensembles that start with uncharged Maxwellian particles."""
    return [
        Ensemble(parameters, maxwellian(effort.particles, random), words)
        for random, words in seeds(effort)
    ]


def each(function: Callable[[Any], Result], things: Sequence[Any]) -> list[Result]:
    """Apply a function to each of some ensembles in threads, and return what it returns."""
    with ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(function, things))


def estimate(values: Any) -> Estimate:
    """Return the mean of independent values and its standard error."""
    found = np.asarray(values, dtype=float)
    return Estimate(float(found.mean()), float(found.std(ddof=1)) / math.sqrt(found.size))


def granular_temperature(ensemble: Ensemble) -> float:
    """Return Θ of all particles."""
    return float(np.mean(ensemble.particles[:, 1:4] ** 2))


def put_wave(ensemble: Ensemble) -> None:
    """Give particles the charge -sin 2πx, and spread them evenly."""
    particles = ensemble.particles
    x = (np.arange(len(particles)) + particles[:, 0]) / len(particles)
    particles[:, 0], particles[:, 4] = x, -np.sin(2 * np.pi * x)


def wave(ensemble: Ensemble) -> float:
    """Return the amplitude of -sin 2πx in the mean charge."""
    particles = ensemble.particles
    return -2.0 * float(np.mean(particles[:, 4] * np.sin(2 * np.pi * particles[:, 0])))


def approach_moment(order: float) -> float:
    """Return the mean of (g.k)^order over the collisions of a Maxwellian gas."""
    return collision_integral(1.0 + order) / collision_integral(1.0)


class Frozen:
    """Particles that collide where they are, with fresh Maxwellian velocities again and again.

    Without flight, and without a correlation of charge and velocity, only collisional transport
    is left, and it has exact rates at any wave number.

    Parameters
    ----------
    number : int
        Of particles, which carry the charge cos 2πx.
    diameter : float
        In box lengths.
    cells : int
        Of the collisions.
    random : numpy.random.Generator
        Of starts and velocities.
    words : numpy.ndarray
        State of the collisions' generator.
    """

    def __init__(
        self,
        number: int,
        diameter: float,
        cells: int,
        random: np.random.Generator,
        words: NDArray[np.uint64],
    ) -> None:
        particles = maxwellian(number, random)
        particles[:, 0] = (np.arange(number) + random.random(number)) / number
        particles[:, 4] = np.cos(2 * np.pi * particles[:, 0])
        self.particles = np.empty_like(particles)
        self.start = np.zeros(cells + 1, np.int64)
        sort(particles, self.particles, self.start, 0.0)
        self.diameter, self.random, self.words = diameter, random, words

    def decay(self, gamma: float, beta: float, time: float, steps: int) -> float:
        """Return the rate at which the charge's wave has decayed, for τ_c = 1 and a = 4/5."""
        p = self.particles
        wave = np.cos(2 * np.pi * p[:, 0])
        before = float(p[:, 4] @ wave)
        law = (self.diameter, 1.0, gamma, beta, 0.8)
        rate, step = 0.25 * math.sqrt(math.pi), time / steps
        for _ in range(steps):
            field = electric_field(cell_charges(p, self.start), len(p), 1.0)
            # the order of the cells has an effect in one sweep, but not in two opposite ones
            for forward in (True, False):
                collide(p, self.start, self.words, field, 0.5 * step, rate, law, forward)
            p[:, 1:4] = self.random.permutation(p[:, 1:4])
        return math.log(before / float(p[:, 4] @ wave)) / time


def exact_exchange(gamma: float, diameter: float, cells: int) -> float:
    """Return the rate of `Frozen.decay` by γ, with what the width w of the cells adds.

    A partner is d k + w (U' − U) away, with U and U' uniform in their cells, so the wave's mean at
    the partner's place is sinc(k d) sinc²(k w/2) of that here.
    """
    wave = 2 * math.pi
    cell = np.sinc(1.0 / cells) ** 2
    there = np.sinc(wave * diameter / math.pi) * cell
    return gamma * approach_moment(0.8) * (1.0 - float(there))


def exact_conduction(beta: float, diameter: float) -> float:
    """Return the rate of `Frozen.decay` by β, for narrow cells."""
    wave = 2 * math.pi
    x = 0.5 * wave * diameter
    bessel = math.sin(x) / x**2 - math.cos(x) / x
    return beta * approach_moment(0.8) * bessel / wave
