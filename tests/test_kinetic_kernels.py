"""The compiled loops of the particle simulation, each by itself against exact statements."""

import math
from itertools import islice

import numpy as np
import pytest
from scipy import special

from triboflux import collision
from triboflux.kinetic import cells, collisions

MASK = 2**64 - 1


def unsigned(state):
    """Return words as the compiled functions take them, which return Python's whole numbers."""
    return [np.uint64(word) for word in state]


def draws(state, count):
    """Return numbers from the compiled generator."""
    found = []
    for _ in range(count):
        bits, *state = collisions._draw(*unsigned(state))
        found.append(int(bits))
    return found


def plain_xoshiro(state):
    """Yield the numbers of xoshiro256++ from its definition, in Python's whole numbers."""
    s = list(state)

    def rotated(x, k):
        return ((x << k) | (x >> (64 - k))) & MASK

    while True:
        yield (rotated((s[0] + s[3]) & MASK, 23) + s[0]) & MASK
        t = (s[1] << 17) & MASK
        s[2] ^= s[0]
        s[3] ^= s[1]
        s[1] ^= s[2]
        s[0] ^= s[3]
        s[2] ^= t
        s[3] = rotated(s[3], 45)


def crowd(number, *, seed=5, charges=True):
    """Return particles at random places with Maxwellian velocities and normal charges."""
    random = np.random.default_rng(seed)
    particles = np.empty((number, 5))
    particles[:, 0] = random.random(number)
    particles[:, 1:] = random.standard_normal((number, 4))
    particles[:, 4] *= charges
    return particles


def in_order(particles, count, by=0.0):
    """Return particles in the order of their cells after a flight, and where the cells begin."""
    found, start = np.empty_like(particles), np.zeros(count + 1, np.int64)
    cells.sort(particles, found, start, by)
    return found, start


def words(seed=1):
    return np.random.SeedSequence(seed).generate_state(4, np.uint64)


# ------------------------------------------------------------------ random numbers


def test_generator_gives_the_published_numbers():
    """The reference output of xoshiro256++ for the state 1, 2, 3, 4."""
    assert draws((1, 2, 3, 4), 10) == [
        41943041,
        58720359,
        3588806011781223,
        3591011842654386,
        9228616714210784205,
        9973669472204895162,
        14011001112246962877,
        12406186145184390807,
        15849039046786891736,
        10450023813501588000,
    ]


def test_generator_follows_its_definition_from_any_state():
    state = [int(word) for word in words(9)]
    assert draws(state, 2000) == list(islice(plain_xoshiro(state), 2000))


def test_one_draw_gives_a_fair_choice_and_a_number_from_0_to_1():
    found = [collisions._pair(np.uint64(bits), 7) for bits in draws(words(3), 70_000)]
    counts = np.bincount([whole for whole, _ in found], minlength=7)
    assert counts.size == 7
    # chi squared of 6 degrees of freedom exceeds 33 once in 100 000 times
    assert np.sum((counts - 10_000) ** 2 / 10_000) < 33
    rest = np.array([number for _, number in found])
    assert 0.0 <= rest.min()
    assert rest.max() < 1.0
    assert abs(rest.mean() - 0.5) < 5 / math.sqrt(12 * 70_000)
    assert collisions._pair(np.uint64(MASK), 7)[0] == 6


def test_numbers_are_rounded_without_bias():
    state = words(4)
    found = []
    for _ in range(40_000):
        number, *state = collisions._rounded(2.3, *unsigned(state))
        found.append(number)
    assert set(found) == {2, 3}
    assert abs(np.mean(found) - 2.3) < 5 * math.sqrt(0.21 / 40_000)


def test_directions_have_the_density_of_their_projection():
    """With density (c.k)+, (c.k)²/c² is uniform, and the rest is isotropic around c."""
    velocity = np.array([0.0, 0.3, -1.2, 0.7, 0.0])
    axis = velocity[1:4] / np.linalg.norm(velocity[1:4])
    across = np.cross(axis, [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    state = words(6)
    found = np.empty((40_000, 3))
    for k in found:
        k[:], *state = collisions._direction(velocity[np.newaxis], 0, *unsigned(state))
    assert np.allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-14)
    along = found @ axis
    assert along.min() >= 0.0
    angle = np.arctan2(found @ across, found @ np.cross(axis, across)) / (2 * math.pi) % 1.0
    for uniform in (along**2, angle):
        steps = np.arange(1, len(uniform) + 1) / len(uniform)
        # Kolmogorov and Smirnov's statistic exceeds 2.4 once in 100 000 times
        assert math.sqrt(len(uniform)) * np.abs(np.sort(uniform) - steps).max() < 2.4


# ------------------------------------------------------------------ places and order


def test_particles_fly_and_stay_in_the_box():
    particles = crowd(1000)
    particles[0, :2] = 0.0, -1e-20
    before = particles.copy()
    cells.move(particles, 7.3)
    moved = before[:, 0] + 7.3 * before[:, 1]
    distance = (particles[:, 0] - moved + 0.5) % 1.0 - 0.5
    assert np.abs(distance).max() < 1e-13
    assert particles[:, 0].min() >= 0.0
    assert particles[:, 0].max() <= 1.0
    assert np.array_equal(particles[:, 1:], before[:, 1:])


def test_a_particle_at_the_end_of_the_box_is_in_the_last_cell():
    particles = crowd(10)
    # they end at 1, not at 0 or at 1 less the smallest number, by round-off
    particles[:, 0], particles[:, 1] = 0.0, -1e-20
    found, start = in_order(particles, 7, 1.0)
    assert np.all(found[:, 0] == 1.0)
    assert start.tolist() == [0] * 7 + [10]


def test_order_of_the_cells():
    particles = crowd(5000)
    found, start = in_order(particles, 37)
    assert (start[0], start[-1]) == (0, 5000)
    for cell in range(37):
        inside = found[start[cell] : start[cell + 1], 0]
        assert np.all((inside >= cell / 37) & (inside < (cell + 1) / 37))
    # stable: exactly what NumPy makes of it
    assert np.array_equal(found, particles[np.argsort(particles[:, 0] * 37 // 1, kind="stable")])


# ------------------------------------------------------------------ one collision


@pytest.mark.parametrize("restitution", [1.0, 0.8, 0.0])
@pytest.mark.parametrize(("gamma", "beta"), [(0.0, 0.0), (0.2, 0.0), (0.0, 0.3), (0.2, 0.3)])
def test_one_collision_is_that_of_the_models(restitution, gamma, beta):
    first, second = crowd(2)
    k = np.array([0.6, -0.48, 0.64])
    approach = float((first[1:4] - second[1:4]) @ k)
    if approach < 0.0:
        k, approach = -k, -approach
    field = 0.7
    expected = collision.collide(
        (first[1:4].copy(), second[1:4].copy()),
        (first[4], second[4]),
        k,
        restitution=restitution,
        field_transfer=beta,
        charge_transfer=gamma,
        field=np.array([field, 0.0, 0.0]),
        exponent=0.8,
    )
    law = (0.0, restitution, gamma, beta, 0.8)
    particles = np.array([second, first])
    struck, *_ = collisions._strike(particles, 1, 0, tuple(k), 1.0, 0.0, law)
    assert struck == pytest.approx(approach, rel=1e-14)
    pairs, impacts = np.array([[1, 0]]), np.array([[struck, k[0]]])
    collisions._exchange(particles, pairs, impacts, 1, np.full(4, field), 3, law)
    second, first = particles
    found = (first[1:4], second[1:4], first[4], second[4])
    for ours, theirs in zip(found, expected, strict=True):
        assert ours == pytest.approx(np.asarray(theirs), abs=1e-14)


@pytest.mark.parametrize("number", [2, 3, 6])
def test_few_particles_of_a_cell_collide_at_their_rate(number):
    """With two, every choice falls on the pair that was chosen last.

    Elastic particles of a cell are equally often at all velocities of their energy and momentum, so
    that (g/g_max)² of a pair has a beta distribution.
    """
    random = np.random.default_rng(3)
    largest = math.sqrt(2 * number)
    mean, time = largest, 20_000.0 / number
    if number > 2:
        rest = 1.5 * (number - 2)
        mean *= special.beta(2.0, rest) / special.beta(1.5, rest)
    expected = time / number * (number * (number - 1) / 2) * mean
    found = []
    for _ in range(100):
        particles = np.zeros((number, 5))
        velocity = random.standard_normal((number, 3))
        velocity -= velocity.mean(axis=0)
        particles[:, 1:4] = velocity * math.sqrt(number / np.sum(velocity**2))
        count, most_likely = collisions.collide(
            particles,
            np.array([0, number]),
            random.integers(0, 2**64, 4, dtype=np.uint64),
            np.zeros(2),
            time,
            1.0,
            (0.0, 1.0, 0.0, 0.0, 0.8),
            True,
        )
        assert most_likely <= 1.0
        found.append(count)
    error = np.std(found) / math.sqrt(100)
    assert error < 0.002 * expected
    assert abs(np.mean(found) - expected) < 4.5 * error


@pytest.mark.parametrize("reach", [0, 1, 3, 20, 60])
def test_no_cell_in_reach_has_more_particles_than_the_bound(reach):
    count = np.random.default_rng(reach).integers(0, 1000, 47)
    most = collisions._most(np.append(0, np.cumsum(count)), reach)
    around = [np.roll(count, shift) for shift in range(-reach, reach + 1)]
    assert np.all(most >= np.max(around, axis=0))
    assert np.all(most <= count.max())
    if reach == 0:
        assert np.array_equal(most, count)


# ------------------------------------------------------------------ field


def test_field_is_exact_in_one_dimension():
    """Gauss's law in every cell, no mean field, and the mean charge neutralised."""
    particles = crowd(5000)
    particles[:, 4] += 0.4
    particles, start = in_order(particles, 37)
    field = cells.electric_field(cells.cell_charges(particles, start), 5000, 2.5)
    charge = np.array([particles[start[c] : start[c + 1], 4].sum() for c in range(37)])
    density = (charge - charge.mean()) / (5000 / 37)
    assert np.diff(field) == pytest.approx(density * 2.5 / 37, abs=1e-14)
    assert field[0] == pytest.approx(field[-1], abs=1e-13)
    # the integral of a field that is linear in each cell
    assert abs(np.mean(field[1:] + field[:-1])) < 1e-14


def test_field_of_a_wave():
    """-sin 2πx has the field cos(2πx)/2π, on the faces of cells of any width."""
    number, count = 64_000, 64
    particles = np.zeros((number, 5))
    particles[:, 0] = (np.arange(number) + 0.5) / number
    particles[:, 4] = -np.sin(2 * np.pi * particles[:, 0])
    found, start = in_order(particles, count)
    faces = np.arange(count + 1) / count
    exact = np.cos(2 * np.pi * faces) / (2 * np.pi)
    charge = cells.cell_charges(found, start)
    assert cells.electric_field(charge, number, 1.0) == pytest.approx(exact, abs=1e-8)


def test_force_is_that_of_the_field_at_the_particle():
    particles, start = in_order(crowd(3000), 20)
    field = np.random.default_rng(1).standard_normal(21)
    before = particles.copy()
    cells.accelerate(particles, start, field, 0.3, 0.9)
    local = np.interp(before[:, 0], np.arange(21) / 20, field)
    assert particles[:, 1] == pytest.approx(0.9 * before[:, 1] + 0.3 * before[:, 4] * local)
    assert np.array_equal(particles[:, 2:4], 0.9 * before[:, 2:4])
    assert np.array_equal(particles[:, [0, 4]], before[:, [0, 4]])


# ------------------------------------------------------------------ moments and thermostat


def test_sums_are_those_of_numpy():
    particles, start = in_order(crowd(4000), 12)
    found = dict(zip(cells.SUMS, cells.cell_sums(particles, start, 4), strict=True))
    for point in range(4):
        some = particles[(particles[:, 0] * 4).astype(int) == point]
        charge, *velocity = (some[:, [4, 1, 2, 3]] - some[:, [4, 1, 2, 3]].mean(axis=0)).T
        x, y, z = velocity
        expected = {
            "count": len(some),
            "charge": some[:, 4].mean(),
            "u_x": some[:, 1].mean(),
            "u_y": some[:, 2].mean(),
            "u_z": some[:, 3].mean(),
            "variance": np.sum(charge**2),
            "covariance": np.sum(charge * x),
            "r_xx": np.sum(x**2),
            "r_yy": np.sum(y**2),
            "r_zz": np.sum(z**2),
            "t_xx": np.sum(charge * x**2),
            "t_mm": np.sum(charge * (x**2 + y**2 + z**2)),
            "n_x": np.sum(charge**2 * x),
        }
        assert {name: sums[point] for name, sums in found.items()} == pytest.approx(expected)


def test_sums_of_an_empty_cell_are_zero():
    particles = crowd(10)
    particles[:, 0] *= 0.5
    found, start = in_order(particles, 2)
    assert not cells.cell_sums(found, start, 2)[:, 1].any()


@pytest.mark.parametrize("warm", [False, True])
def test_local_motion_is_taken_away(warm):
    particles = crowd(4000)
    particles[:, 1:4] *= 1.0 + particles[:, :1]
    particles[:, 1] += np.sin(2 * np.pi * particles[:, 0])
    before = particles.copy()
    cells.hold(particles, cells.local_motion(particles, 5, warm))
    for point in range(5):
        inside = (before[:, 0] * 5).astype(int) == point
        velocity = particles[inside, 1:4]
        assert np.abs(velocity.mean(axis=0)).max() < 1e-14
        rest = before[inside, 1:4] - before[inside, 1:4].mean(axis=0)
        factor = math.sqrt((3 * inside.sum() - 3) / np.sum(rest**2)) if warm else 1.0
        assert velocity == pytest.approx(factor * rest, abs=1e-12)


def test_a_lonely_particle_keeps_its_velocity():
    particles = crowd(1)
    before = particles.copy()
    cells.hold(particles, cells.local_motion(particles, 3, True))
    assert np.array_equal(particles, before)


def test_random_forces_are_normal_and_independent():
    particles = np.zeros((40_000, 5))
    generator = words(8)
    collisions.agitate(particles, generator, 0.25)
    velocity = particles[:, 1:4]
    assert not particles[:, [0, 4]].any()
    error = 1 / math.sqrt(40_000)
    assert np.abs(velocity.mean(axis=0)).max() < 5 * 0.5 * error
    assert np.abs(np.cov(velocity.T) - 0.25 * np.eye(3)).max() < 5 * math.sqrt(2) * 0.25 * error
    # the fourth moment of normal numbers has a variance of 96 sigma^8
    assert np.abs(np.mean(velocity**4, axis=0) / 0.1875 - 1).max() < 5 * math.sqrt(96) / 3 * error


def test_particles_that_are_not_finite_have_a_cell():
    """A run finds out after some steps only; until then they must not write anywhere else."""
    particles = crowd(100)
    particles[10, 0], particles[20, 1], particles[30, 2] = math.nan, math.inf, -math.inf
    for _ in range(3):
        found, start = in_order(particles, 7, 0.01)
        assert start[-1] == 100
        assert np.all(np.diff(start) >= 0)
        count, _ = collisions.collide(
            found, start, words(), np.zeros(8), 1.0, 1.0, (0.1, 1.0, 0.1, 0.1, 0.8), True
        )
        assert 0 <= count < 10_000
        cells.hold(found, cells.local_motion(found, 7, True))
        particles = found
