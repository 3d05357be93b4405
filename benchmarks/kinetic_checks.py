"""What is checked of the particle simulation: measured values beside exact ones."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from benchmarks import kinetic_boxes as b
from benchmarks.kinetic_boxes import DENSE, DILUTE, Effort
from triboflux.kinetic.cells import sort
from triboflux.kinetic.collisions import collide
from triboflux.kinetic.ensemble import Ensemble
from triboflux.sampling import Estimate

SELF_DIFFUSION = 1.01896
"""Of hard spheres over its first Sonine value 3 τ_c Θ/2, doi:10.1063/1.1706645."""


class Check(NamedTuple):
    """A measured value and what it must be.

    Attributes
    ----------
    quantity : str
        What is measured.
    expected : float
        Exact value.
    measured : Estimate
        With its standard error.
    exact : bool
        Whether the value must agree; otherwise it is of an approximate theory.
    """

    quantity: str
    expected: float
    measured: Estimate
    exact: bool = True

    @property
    def deviation(self) -> float:
        """How many standard errors the measured value is above the exact one."""
        return (self.measured.value - self.expected) / self.measured.error


def collision_rates(effort: Effort) -> Iterator[Check]:
    """Count collisions in equilibrium, against 4√π n g0 d² √Θ."""
    for name, parameters in (("dilute", DILUTE), ("dense", DENSE)):

        def rate(box: Ensemble) -> float:
            box.advance(40, 0.025)
            return 2.0 * box.collisions / len(box.particles)

        found = b.each(rate, b.boxes(parameters, effort))
        yield Check(f"collisions of a particle in 10 τ_c, {name}", 10.0, b.estimate(found))


def approach_moments(effort: Effort, orders: Sequence[float]) -> Iterator[Check]:
    """Measure moments of the approach velocity, against ratios of the collision integrals.

    Spheres with e = -1 pass through each other, so that velocities stay Maxwellian and the charge
    that a uniform field passes over is all that happens: Σ q c_x changes by
    -β (g.k)^a k_x (g_x) in each collision, whose mean is -β (g.k)^(1+a)/3.
    """
    for name, parameters in (("dilute", DILUTE), ("dense", DENSE)):
        for order in orders:
            law = (parameters.diameter, -1.0, 0.0, 1.0, order - 1.0)

            def moment(box: Ensemble, law: tuple[float, ...] = law) -> float:
                cells = box.parameters.cells
                start = np.zeros(cells + 1, np.int64)
                particles = np.empty_like(box.particles)
                sort(box.particles, particles, start, 0.0)
                field, rate = np.ones(cells + 1), 0.25 * math.sqrt(math.pi)
                count, *_ = collide(particles, start, box.generator, field, 6.0, rate, law, True)
                return -3.0 * float(particles[:, 4] @ particles[:, 1]) / count

            found = b.each(moment, b.boxes(parameters, effort))
            exact = b.approach_moment(order)
            yield Check(f"mean of (g·k)^{order:g}, {name}", exact, b.estimate(found))


def excess(restitution: float) -> float:
    """Return a2 of homogeneous cooling, doi:10.1007/s100350050009, (for three dimensions)."""
    e = restitution
    return 16.0 * (1.0 - e) * (1.0 - 2.0 * e * e) / (81.0 - 17.0 * e + 30.0 * e * e * (1.0 - e))


def cooling(effort: Effort, restitutions: Sequence[float]) -> Iterator[Check]:
    """Let a gas cool, against Haff's law: 1/√Θ rises linearly.

    The rate from a Maxwellian start is exact; later velocities have the fourth cumulant a2, which
    changes the rate by the factor 1 + 3 a2/16.
    """
    for e in restitutions:
        parameters = replace(DILUTE, restitution=e)
        maxwellian = (1.0 - e * e) / 6.0

        def rates(box: Ensemble) -> tuple[float, float, float]:
            box.advance(1, 0.002)
            first = 1.0 / math.sqrt(b.granular_temperature(box))
            box.advance(200, 0.01)
            early = 1.0 / math.sqrt(b.granular_temperature(box))
            squares = np.sum(box.particles[:, 1:4] ** 2, axis=1)
            cumulant = 0.6 * float(np.mean(squares**2) / np.mean(squares) ** 2) - 1.0
            box.advance(200, 0.01)
            late = 1.0 / math.sqrt(b.granular_temperature(box))
            return (first - 1.0) / 0.02, (late - early) / 20.0, cumulant

        found = np.transpose(b.each(rates, b.boxes(parameters, effort)))
        first, late, cumulant = map(b.estimate, found)
        yield Check(f"rate of 1/√Θ at first, e = {e:g}", maxwellian, first)
        a2 = cumulant.value
        slower = maxwellian * (1.0 + 3.0 * a2 / 16.0)
        yield Check(f"rate of 1/√Θ later, e = {e:g}, with the measured a2", slower, late)
        yield Check(f"a2, e = {e:g}, against theory of first order", excess(e), cumulant, False)


def free_flight(effort: Effort, drag_rate: float) -> Iterator[Check]:
    """Let particles fly through each other, against the exact decay of a wave."""
    parameters = replace(DILUTE, collision_rate=0.0, drag_rate=drag_rate)

    def amplitudes(box: Ensemble) -> list[float]:
        b.put_wave(box)
        found: list[float] = []
        for _ in range(3):
            box.advance(10, 0.01)
            found.append(b.wave(box))
        return found

    for count, found in enumerate(np.transpose(b.each(amplitudes, b.boxes(parameters, effort)))):
        time = 0.1 * (1 + count)
        path = -math.expm1(-drag_rate * time) / drag_rate if drag_rate else time
        name = f"wave at t = {time:.1f} in free flight" + (", with drag" if drag_rate else "")
        yield Check(name, math.exp(-2.0 * math.pi**2 * path**2), b.estimate(found))


def self_diffusion(effort: Effort) -> Iterator[Check]:
    """Integrate the velocity autocorrelation, against the known coefficient of hard spheres.

    The charge is a label here, by which each particle's first velocity is found.
    """
    step, steps = 0.01, 120
    for name, parameters in (("dilute", DILUTE), ("dense", DENSE)):

        def integral(box: Ensemble) -> float:
            first = box.particles[:, 1:4].copy()
            box.particles[:, 4] = np.arange(len(first))
            correlation = [1.0]
            for _ in range(steps):
                box.advance(1, step)
                label = box.particles[:, 4].astype(int)
                correlation.append(float(np.mean(box.particles[:, 1:4] * first[label])))
            # Simpson's rule, and a tail with the rate of the first Sonine approximation
            weights = np.array([1.0, *[4.0, 2.0] * (steps // 2)])
            weights[-1] = 1.0
            tail = correlation[-1] * 0.15
            return (step / 3.0 * float(weights @ correlation) + tail) / 0.15

        found = b.each(integral, b.boxes(parameters, effort))
        yield Check(f"self-diffusion over 3τ_c Θ/2, {name}", SELF_DIFFUSION, b.estimate(found))


def scaled(found: Estimate, unit: float) -> Estimate:
    """Return an estimate in a unit."""
    return Estimate(found.value / unit, found.error / unit)


def collisional_transport(effort: Effort) -> Iterator[Check]:
    """Measure the decay of a wave by collisional dispersion and conduction alone."""
    diameter, cells = 0.1, 80

    def decay(seed: tuple[np.random.Generator, np.ndarray], gamma: float, beta: float) -> float:
        frozen = b.Frozen(effort.particles, diameter, cells, *seed)
        return frozen.decay(gamma, beta, 3.0, 12)

    small = 1e-3
    found = b.each(lambda seed: decay(seed, small, 0.0), b.seeds(effort))
    exact = b.exact_exchange(small, diameter, cells) / small
    yield Check("rate of collisional dispersion over γ", exact, scaled(b.estimate(found), small))
    found = b.each(lambda seed: decay(seed, 0.0, small), b.seeds(effort))
    exact = b.exact_conduction(small, diameter) / small
    yield Check("rate of collisional conduction over β", exact, scaled(b.estimate(found), small))


def cell_widths(effort: Effort) -> Iterator[Check]:
    """Measure dispersion with wide cells, against the exact effect of their width."""
    for cells in (10, 20, 40):

        def decay(seed: tuple[np.random.Generator, np.ndarray], cells: int = cells) -> float:
            return b.Frozen(effort.particles, 0.1, cells, *seed).decay(1e-3, 0.0, 3.0, 12)

        found = b.estimate(b.each(decay, b.seeds(effort)))
        narrow = b.exact_exchange(1e-3, 0.1, 10**6)
        yield Check(
            f"dispersion with cells of {10 / cells:g} d over its value",
            b.exact_exchange(1e-3, 0.1, cells) / narrow,
            scaled(found, narrow),
        )
