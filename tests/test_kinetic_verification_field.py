"""The mean field of the simulation against exact solutions: oscillation, and its own limits."""

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.kinetic_boxes import DILUTE
from triboflux.kinetic.ensemble import Ensemble

LATTICE = replace(DILUTE, cells=100, collision_rate=0.0, energy_ratio=16.0)
NUMBER = 20_000


def cold(amplitude, parameters=LATTICE):
    """Return equal charges at rest, displaced from a lattice by a wave."""
    rest = (np.arange(NUMBER) + 0.5) / NUMBER
    particles = np.zeros((NUMBER, 5))
    particles[:, 0] = (rest + amplitude * np.sin(2 * np.pi * rest)) % 1.0
    particles[:, 4] = 1.0
    words = np.random.SeedSequence(1).generate_state(4, np.uint64)
    return Ensemble(parameters, particles, words), rest


def displacement(found, rest):
    """Return the amplitude of the displacement from the lattice."""
    moved = (np.sort(found.particles[:, 0]) - rest + 0.5) % 1.0 - 0.5
    return 2 * np.mean(moved * np.sin(2 * np.pi * rest))


@pytest.mark.parametrize("length", [1.0, 2.0])
def test_cold_charges_swing_with_the_frequency_of_a_plasma(length):
    """Displaced by s, charges feel the force -u s: ω = √u whatever the wave, 4 here."""
    found, rest = cold(0.01, replace(LATTICE, length=length))
    steps = 40
    swing = []
    for _ in range(4):
        found.advance(steps, 2 * math.pi / 4.0 / (4 * steps))
        swing.append(displacement(found, rest))
    # quarters of a period; the width of the cells changes ω by (k w)²/24, which is 2e-4
    assert swing == pytest.approx([0.0, -0.01, 0.0, 0.01], abs=1e-5)


def test_frequency_converges_with_second_order_in_the_step():
    ends = []
    for steps in (2, 4, 64):
        found, rest = cold(0.01)
        # an eighth of a period
        found.advance(steps, math.pi / 16.0 / steps)
        ends.append(displacement(found, rest))
    coarse, fine = np.array(ends[:2]) - ends[2]
    assert 1e-5 < abs(coarse) < 1e-3
    assert 3.5 < coarse / fine < 4.5


def test_a_uniform_charge_has_no_field():
    found, _ = cold(0.0)
    assert np.abs(found.sums_and_field()[1]).max() < 1e-13
    found.advance(10, 0.1)
    assert np.abs(found.particles[:, 1:4]).max() < 1e-11


def test_field_exerts_no_net_force_but_noise():
    """A random charge pulls itself only as far as charges lie unevenly in their cells."""
    random = np.random.default_rng(2)
    found, _ = cold(0.0)
    found.particles[:, 0] = random.random(NUMBER)
    found.particles[:, 4] = random.standard_normal(NUMBER)
    found.advance(1, 1e-3)
    force = found.particles[:, 1] / 1e-3
    assert np.std(force) > 0.01
    assert abs(force.mean()) < 1e-2 * np.std(force)
