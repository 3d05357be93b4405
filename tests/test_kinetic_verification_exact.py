"""What the particle simulation keeps exactly: charge, momentum, energy, reproducibility, memory."""

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.kinetic_boxes import DENSE, DILUTE, maxwellian
from tests.cases import data
from triboflux.case import Case
from triboflux.kinetic.cells import SUMS
from triboflux.kinetic.collisions import collide
from triboflux.kinetic.ensemble import Ensemble, Parameters
from triboflux.kinetic.start import draw_particles

NUMBER = 10_000
TRANSFERS = [(0.0, 0.0), (0.2, 0.0), (0.0, 0.3), (0.2, 0.3)]


def words(seed=1):
    return np.random.SeedSequence(seed).generate_state(4, np.uint64)


def ensemble(parameters, *, seed=1, number=NUMBER):
    """Return charged particles, more positive than negative ones."""
    random = np.random.default_rng(seed)
    particles = maxwellian(number, random)
    particles[:, 4] = 0.1 + np.sin(2 * np.pi * particles[:, 0]) + random.standard_normal(number)
    return Ensemble(parameters, particles, words(seed))


def totals(found):
    """Return charge, momentum and twice the kinetic energy of all particles."""
    p = found.particles
    return np.array([p[:, 4].sum(), *p[:, 1:4].sum(axis=0), (p[:, 1:4] ** 2).sum()])


# ------------------------------------------------------------------ conservation


@pytest.mark.parametrize("box", [DILUTE, DENSE], ids=["dilute", "dense"])
@pytest.mark.parametrize(("gamma", "beta"), TRANSFERS)
@pytest.mark.parametrize("restitution", [1.0, 0.7])
def test_collisions_conserve_charge_and_momentum(box, gamma, beta, restitution):
    parameters = replace(box, charge_transfer=gamma, field_transfer=beta, restitution=restitution)
    found = ensemble(parameters)
    before = totals(found)
    charges = np.sort(found.particles[:, 4])
    found.advance(40, 0.025)
    assert found.collisions > 3 * NUMBER
    change = totals(found) - before
    # 10 collisions of 10 000 particles with numbers of order one: round-off adds up as a root
    assert np.abs(change[:4]).max() < 1e-11
    if restitution == 1.0:
        assert abs(change[4]) < 1e-10
    else:
        assert change[4] < -0.3 * before[4]
    same = np.array_equal(np.sort(found.particles[:, 4]), charges)
    assert same == (gamma == beta == 0.0)


@pytest.mark.parametrize("thermostat", ["none", "mean-velocity", "full"])
@pytest.mark.parametrize("drag_rate", [0.0, 2.0])
def test_every_option_conserves_the_charge(thermostat, drag_rate):
    parameters = replace(
        DENSE,
        points=20,
        energy_ratio=100.0,
        drag_rate=drag_rate,
        restitution=0.9,
        charge_transfer=0.1,
        field_transfer=0.1,
        thermostat=thermostat,
    )
    found = ensemble(parameters)
    before = totals(found)[0]
    found.advance(40, 0.01)
    assert abs(totals(found)[0] - before) < 1e-11
    sums = dict(zip(SUMS, found.sums(), strict=True))
    assert sums["count"].sum() == NUMBER
    assert np.sum(sums["count"] * sums["charge"]) == pytest.approx(before, abs=1e-11)
    if thermostat != "none":
        assert np.abs([sums["u_x"], sums["u_y"], sums["u_z"]]).max() < 1e-13
    if thermostat == "full":
        squares = sums["r_xx"] + sums["r_yy"] + sums["r_zz"]
        assert squares == pytest.approx(3 * (sums["count"] - 1), rel=1e-12)


def test_a_pair_takes_the_field_where_it_touches():
    """In a field that rises along the box, the charge tells where it was taken."""
    field = np.linspace(0.0, 1.0, 9)
    start = np.array([0, 0, 0, 1, 1, 1, 1, 2, 2])
    before = np.array([[0.3, 2.0, 0.7, 0.0, 0.0], [0.8, -3.0, 0.0, 0.4, 0.0]])
    found = 0
    for seed in range(300):
        particles = before.copy()
        law = (0.5, 1.0, 0.0, 1.0, 0.8)
        done, *_ = collide(particles, start, words(seed), field, 0.02, 1.0, law, True)
        assert particles[0, 4] == -particles[1, 4]
        if done != 1:
            continue
        found += 1
        impulse = before[0, 1:4] - particles[0, 1:4]
        approach = np.linalg.norm(impulse)
        k = impulse / approach
        # half a diameter from the one or the other, whichever looked for a partner
        places = np.array([0.3 + 0.25 * k[0], 0.8 - 0.25 * k[0]]) % 1.0
        expected = -places * k[0] * approach**0.8
        assert np.abs(particles[0, 4] - expected).min() < 1e-12
    assert found > 15


def test_no_probability_passes_1_when_speeds_rise():
    found = ensemble(replace(DILUTE, restitution=1.0, energy_ratio=3000.0, points=10))
    # one particle with nearly all energy makes slow ones fast
    found.particles[0, 1:4] = 300.0
    found.advance(20, 0.01)
    assert found.collisions > 100
    assert found.largest_probability == 1.0


# ------------------------------------------------------------------ reproducibility


def relaxation(**kinetic):
    """Return a case with a field, and where particles exchange charge."""
    kinetic = {"particles": 4000, "ensembles": 4, "seed": 7} | kinetic
    return Case(**data(kinetic=kinetic, numbers__peclet=1e4))


def moments(case, threads):
    """Return what all ensembles of a case are after some steps."""
    parameters, ensembles = Parameters.of(case), []
    for seed in np.random.SeedSequence(case.kinetic.seed).spawn(case.kinetic.ensembles):
        a, b = seed.spawn(2)
        particles = draw_particles(case, case.kinetic.particles, np.random.default_rng(a))
        ensembles.append(Ensemble(parameters, particles, b.generate_state(4, np.uint64)))
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(lambda one: one.advance(5, parameters.time_step), ensembles))
    return np.array([one.sums() for one in ensembles])


def test_a_seed_gives_the_same_numbers_with_any_number_of_threads():
    case = relaxation()
    one, many = moments(case, 1), moments(case, 4)
    assert np.array_equal(one, many)
    assert len({ensemble.tobytes() for ensemble in one}) == 4
    assert not np.array_equal(one, moments(relaxation(seed=8), 1))


def test_steps_in_pieces_are_those_in_one_go():
    one, two = (ensemble(replace(DENSE, restitution=0.9, thermostat="full")) for _ in range(2))
    one.advance(7, 0.01)
    for steps in (1, 2, 4):
        two.advance(steps, 0.01)
    assert np.array_equal(one.particles, two.particles)
    assert np.array_equal(one.generator, two.generator)
    assert (one.collisions, one.steps) == (two.collisions, two.steps)


# ------------------------------------------------------------------ memory


def test_arrays_of_an_ensemble_take_at_most_100_bytes_a_particle():
    found = ensemble(DILUTE)
    found.advance(1, 0.01)
    arrays = [value for value in vars(found).values() if isinstance(value, np.ndarray)]
    by_particle = [array.nbytes for array in arrays if array.shape[0] == NUMBER]
    assert len(by_particle) == 2
    assert sum(by_particle) <= 100 * NUMBER
    assert sum(array.nbytes for array in arrays) - sum(by_particle) < 1000


# ------------------------------------------------------------------ start


def wanted(x):
    """Return charge, covariance and variance at some places."""
    return np.sin(2 * np.pi * x), 0.3 * np.cos(2 * np.pi * x), 0.2 + 0.0 * x


def test_particles_start_with_the_fields_of_the_case():
    case = Case(
        **data(
            initial={
                "charge": [{"mode": [1], "sine": 1.0}],
                "covariance": [{"component": 0, "mode": [1], "cosine": 0.3}],
                "variance": [{"mode": [0], "cosine": 0.2}],
            },
            kinetic={"particles": 400_000},
        )
    )
    particles = draw_particles(case, 400_000, np.random.default_rng(3))
    found = Ensemble(Parameters.of(case), particles, words())
    sums = dict(zip(SUMS, found.sums(), strict=True))
    count = sums["count"]
    assert np.abs(count - 400_000 / 32).max() <= 1.0
    charge, covariance, variance = wanted(np.arange(32) / 32)
    # a mean over a cell is 1 - (k w)²/24 of the value in its middle; 5 standard errors are 0.02
    assert np.abs(sums["charge"] - charge).max() < 0.022
    assert np.abs(sums["covariance"] / count - covariance).max() < 0.025
    spread = variance + (2 * math.pi / 32) ** 2 / 12 * np.cos(2 * math.pi * np.arange(32) / 32) ** 2
    assert np.abs(sums["variance"] / count - spread).max() < 0.015
    velocity = particles[:, 1:4]
    assert np.abs(velocity.mean(axis=0)).max() < 1e-14
    assert np.mean(velocity**2) == pytest.approx(1.0, rel=1e-12)
