"""Initial answers of simulated particles to single causes, from which closure coefficients follow.

Particles collide as in `triboflux kinetic`, by the same compiled loop, but do not fly, so that no
error of a time step comes in. Charges are drawn as ⟨ξ|c⟩ = A + B.c + c.C.c of the causes, one cause
at a time, and sums over all particles are followed for a fraction of a collision time. Lengths are
in diameters, velocities in √Θ, and time is such that n g0 d² √Θ = 1.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from triboflux.collision import HERTZ_EXPONENT
from triboflux.kinetic.cells import COLUMNS
from triboflux.kinetic.collisions import collide
from triboflux.kinetic.compiling import compiled
from triboflux.responses import isotropic_parts

Array: TypeAlias = NDArray[np.float64]
Answers: TypeAlias = dict[str, Any]

CROSS_SECTION = math.pi
"""Collisions of a particle of unit relative speed per time: π n g0 d²."""
WINDOW = 0.6 / (4.0 * math.sqrt(math.pi))
"""Time that the sums are followed for, 0.6 collision times."""
DEGREE, INTERVALS = 4, 6
"""Of the polynomial in time through the sums, and between the times at which they are taken."""
FRACTIONS = (0.1, 0.2)
"""Values of γ; a sum with two charges changes by γ and γ², which two values tell apart."""
FIELD_TRANSFER = 0.1
"""β, where a field acts; all that is measured is proportional to it or its square."""
IN_CELL = 1000
"""Particles of a cell without diameter; each cell is a gas of its own."""
CELLS_IN_DIAMETER, DIAMETERS = 60, 3
"""Cells with a diameter. The middle third of the box is looked at: the ends are a diameter away."""
SUBSTEPS = 2
"""Steps in each interval with a diameter, where cells take turns."""


class Gas(NamedTuple):
    """Particles whose charges are still to be chosen.

    Attributes
    ----------
    particles : array
        As `triboflux.kinetic.cells` tells, in the order of their cells.
    start : array
        Where the particles of each cell begin.
    generator : array
        State of the random numbers of all collisions.
    looked_at : slice
        Particles to be summed over.
    restitution, diameter : float
        e, and the diameter in lengths of the box.
    field : array
        Field along x on the faces of the cells.
    rate : float
        Candidates for a collision per particle, unit speed and time.
    substeps : int
        Steps in each interval.
    """

    particles: Array
    start: NDArray[np.int64]
    generator: NDArray[np.uint64]
    looked_at: slice
    restitution: float
    diameter: float
    field: Array
    rate: float
    substeps: int


def times() -> Array:
    """Return when sums are taken: denser at both ends, where a polynomial needs it."""
    return 0.5 * WINDOW * (1.0 - np.cos(np.pi * np.arange(INTERVALS + 1) / INTERVALS))


def slope_weights(nodes: Array, degree: int) -> Array:
    """Return the weights of changes between times whose sum is the slope at the first time.

    Changes scatter like those of a random walk, independently and with variances proportional to
    their intervals; least squares so weighted, of a polynomial without a constant.

    Parameters
    ----------
    nodes : array
        Times, increasing.
    degree : int
        Of the polynomial, at most the number of intervals.
    """
    powers = np.arange(1, degree + 1)
    shifted = nodes[:, None] - nodes[0]
    changes = np.diff(shifted**powers, axis=0)
    by_variance = changes / np.diff(nodes)[:, None]
    weights: Array = np.linalg.solve(by_variance.T @ changes, by_variance.T)[0]
    return weights


@compiled
def vectors(particles: Any, charges: Any, first: int, end: int) -> Any:
    """Return sums of ξ and ξ c_i: with the charges of time 0, and with what was added since."""
    charge = x = y = z = added = added_x = added_y = added_z = 0.0
    for i in range(first, end):
        p = particles[i]
        old, new = charges[i], p[4] - charges[i]
        charge += old
        x += old * p[1]
        y += old * p[2]
        z += old * p[3]
        added += new
        added_x += new * p[1]
        added_y += new * p[2]
        added_z += new * p[3]
    return np.array(((charge, x, y, z), (added, added_x, added_y, added_z)))


@compiled
def tensors(particles: Any, charges: Any, first: int, end: int) -> Any:
    """Return sums of ξ (c_i c_j - δ_ij) as `vectors` does, for xx, yy, zz, xy, yz and zx."""
    xx = yy = zz = xy = yz = zx = 0.0
    added_xx = added_yy = added_zz = added_xy = added_yz = added_zx = 0.0
    for i in range(first, end):
        p = particles[i]
        x, y, z = p[1], p[2], p[3]
        old, new = charges[i], p[4] - charges[i]
        xx += old * (x * x - 1.0)
        yy += old * (y * y - 1.0)
        zz += old * (z * z - 1.0)
        xy += old * x * y
        yz += old * y * z
        zx += old * z * x
        added_xx += new * (x * x - 1.0)
        added_yy += new * (y * y - 1.0)
        added_zz += new * (z * z - 1.0)
        added_xy += new * x * y
        added_yz += new * y * z
        added_zx += new * z * x
    added = (added_xx, added_yy, added_zz, added_xy, added_yz, added_zx)
    return np.array(((xx, yy, zz, xy, yz, zx), added))


@compiled
def squares(particles: Any, charges: Any, first: int, end: int) -> Any:
    """Return sums of ξξ and ξξ c_x as `vectors` does."""
    square = x = added = added_x = 0.0
    for i in range(first, end):
        p = particles[i]
        old = charges[i] ** 2
        new = p[4] ** 2 - old
        square += old
        x += old * p[1]
        added += new
        added_x += new * p[1]
    return np.array(((square, x), (added, added_x)))


def slopes(
    gas: Gas, charges: Array, sums: Callable[..., Array], gamma: float, beta: float = 0.0
) -> Array:
    """Return how sums per particle begin to change.

    Velocities do not depend on charges: the same gas collides in the same way with every choice of
    charges, γ and β.

    Parameters
    ----------
    gas : Gas
        Not changed.
    charges : array
        At time 0.
    sums : callable
        `vectors`, `tensors` or `squares`.
    gamma, beta : float
        Of the collision law.
    """
    return follow(gas, charges, sums, (gamma, beta))[0]


def follow(
    gas: Gas, charges: Array, sums: Callable[..., Array], transfer: tuple[float, float]
) -> tuple[Array, float]:
    """Return what `slopes` does, and the rate of collisions of a particle at time 0.

    Raises
    ------
    RuntimeError
        If collisions are not drawn at their rate.
    """
    particles, generator = gas.particles.copy(), gas.generator.copy()
    particles[:, 4] = charges
    law = (gas.diameter, gas.restitution, *transfer, HERTZ_EXPONENT)
    nodes, first, end = times(), gas.looked_at.start, gas.looked_at.stop
    found, counts = [sums(particles, charges, first, end)], []
    for interval in np.diff(nodes):
        time, count = interval / gas.substeps, 0
        for step in range(gas.substeps):
            number, largest = collide(
                particles, gas.start, generator, gas.field, time, gas.rate, law, step % 2 == 0
            )
            if largest > 1.0:
                raise RuntimeError(f"a collision has the probability {largest}")
            count += number
        found.append(sums(particles, charges, first, end))
        counts.append(2.0 * count / len(particles))
    weights = slope_weights(nodes, DEGREE)
    changes = np.diff(np.array(found), axis=0) / (end - first)
    slope: Array = np.einsum("t,tij->ij", weights, changes)
    return slope, float(weights @ np.array(counts))


def uniform_gas(restitution: float, cells: int, random: np.random.Generator) -> Gas:
    """Return a homogeneous gas of particles without extent, `IN_CELL` in each cell."""
    # a particle has one partner less than there are particles in its cell
    rate = CROSS_SECTION * IN_CELL / (IN_CELL - 1)
    particles, start, generator = _drawn(cells, IN_CELL, random)
    everyone = slice(0, len(particles))
    field = np.ones(cells + 1)
    return Gas(particles, start, generator, everyone, restitution, 0.0, field, rate, 1)


def slab_gas(restitution: float, in_cell: int, random: np.random.Generator) -> Gas:
    """Return a gas of extended particles, of which the middle third is looked at.

    The field along x is the distance from the middle. What is wrong at the ends, where the box
    closes, is at least a diameter from the middle third and does not matter to initial slopes.
    """
    cells = DIAMETERS * CELLS_IN_DIAMETER
    particles, start, generator = _drawn(cells, in_cell, random)
    middle = slice(int(start[CELLS_IN_DIAMETER]), int(start[-1 - CELLS_IN_DIAMETER]))
    diameter = 1.0 / DIAMETERS
    field = (np.arange(cells + 1) / cells - 0.5) / diameter
    rate = CROSS_SECTION
    return Gas(particles, start, generator, middle, restitution, diameter, field, rate, SUBSTEPS)


def _drawn(
    cells: int, in_cell: int, random: np.random.Generator
) -> tuple[Array, NDArray[np.int64], NDArray[np.uint64]]:
    """Return equally many Maxwellian particles per cell, their order, and random words."""
    number = cells * in_cell
    particles = np.empty((number, COLUMNS))
    particles[:, 0] = (np.repeat(np.arange(cells), in_cell) + random.random(number)) / cells
    particles[:, 1:4] = random.standard_normal((number, 3))
    words = random.integers(0, 2**64, 4, dtype=np.uint64)
    return particles, np.arange(cells + 1) * in_cell, words


def _powers(by_fraction: Sequence[Array]) -> tuple[Array, Array]:
    """Return the factors of γ and γ² from what happens at two values of γ."""
    low, high = (slope / gamma for slope, gamma in zip(by_fraction, FRACTIONS, strict=True))
    second = (high - low) / (FRACTIONS[1] - FRACTIONS[0])
    return low - FRACTIONS[0] * second, second


def vector_and_tensor(gas: Gas) -> Answers:
    """Return the rate of collisions and the answers to C and T, averaged over the axes.

    Parameters
    ----------
    gas : Gas
        From `uniform_gas`.

    Returns
    -------
    dict of str to float
        By the names of `triboflux.responses.Responses`.
    """
    velocity = gas.particles[:, 1:4].T.copy()
    gamma = FRACTIONS[0]
    first, rate = follow(gas, velocity[0], vectors, (gamma, 0.0))
    vector = first[:, 1]
    for axis in (1, 2):
        vector = vector + slopes(gas, velocity[axis], vectors, gamma)[:, 1 + axis]
    # T_xx = 1 and the like, which make T = δ together; then T_xy = T_yx = 1 and the like
    diagonal = [slopes(gas, 0.5 * (v**2 - 1.0), tensors, gamma)[:, :3] for v in velocity]
    trace = np.sum(diagonal, axis=(0, 2))
    product = sum(tensor[:, axis] for axis, tensor in enumerate(diagonal))
    for axis, other in enumerate((1, 2, 0)):
        charges = velocity[axis] * velocity[other]
        product = product + slopes(gas, charges, tensors, gamma)[:, 3 + axis]
    in_trace, in_shear = isotropic_parts(trace, product)
    return {
        "collision_rate": rate,
        "covariance_velocity": vector[0] / 3.0,
        "covariance_exchange": vector[1] / (3.0 * gamma),
        "third_velocity": in_shear[0],
        "third_velocity_trace": in_trace[0],
        "third_exchange": in_shear[1] / gamma,
        "third_exchange_trace": in_trace[1] / gamma,
    }


def squares_and_field(gas: Gas, random: np.random.Generator) -> Answers:
    """Return the answers to V, N and a field.

    Parameters
    ----------
    gas : Gas
        From `uniform_gas`.
    random : numpy.random.Generator
        Gives the signs of charges.

    Returns
    -------
    dict of str to float
        By the names of `triboflux.responses.Responses`.
    """
    c_x = gas.particles[:, 1]
    sign = random.choice((-1.0, 1.0), len(gas.particles))
    nothing = np.zeros_like(sign)
    variance = _powers([slopes(gas, sign, squares, gamma)[1, 0] for gamma in FRACTIONS])
    # ⟨ξξ|c⟩ = 1 + 2 c_x + c_x²: N = 2, and what is even in c_x has no part in the answer
    fluxes = [slopes(gas, sign * (1.0 + c_x), squares, gamma)[:, 1] for gamma in FRACTIONS]
    flux = _powers([found[1] for found in fluxes])
    driven = [slopes(gas, nothing, sums, 0.0, FIELD_TRANSFER)[1] for sums in (vectors, squares)]
    return {
        "covariance_field": driven[0][1] / FIELD_TRANSFER,
        "variance_field": driven[1][0] / FIELD_TRANSFER**2,
        "variance_exchange": variance[0],
        "variance_regain": variance[1],
        "flux_velocity": fluxes[0][0] / 2.0,
        "flux_exchange": flux[0] / 2.0,
        "flux_regain": flux[1] / 2.0,
    }


def gradients(gas: Gas, random: np.random.Generator, regain: float) -> Answers:
    """Return the answers to gradients along x, but for those of C(ξ c_i c_j).

    Parameters
    ----------
    gas : Gas
        From `slab_gas`.
    random : numpy.random.Generator
        Gives the signs of charges.
    regain : float
        Answer of C(ξξ) to V with γ², which is taken off that to ∇²V.

    Returns
    -------
    dict of str to float
        By the names of `triboflux.responses.Responses`.
    """
    x = _place(gas)
    gamma = FRACTIONS[0]
    driven = slopes(gas, np.zeros_like(x), vectors, 0.0, FIELD_TRANSFER)[1]
    linear, curved, divergent = (
        slopes(gas, charges, vectors, gamma)[1]
        for charges in (x, 0.5 * x**2, x * gas.particles[:, 1])
    )
    charges = math.sqrt(0.5) * x * random.choice((-1.0, 1.0), len(x))
    _, spread = _powers([slopes(gas, charges, squares, g)[1, 0] for g in FRACTIONS])
    own = float(np.mean(charges[gas.looked_at] ** 2))
    return {
        "charge_field": driven[0] / FIELD_TRANSFER,
        "charge_laplacian": curved[0] / gamma,
        "charge_covariance": divergent[0] / gamma,
        "covariance_gradient": linear[1] / gamma,
        "variance_laplacian": spread - regain * own,
    }


def covariance_gradients(gas: Gas) -> Answers:
    """Return the answers of C(ξ c_i c_j) to a covariance that changes along x.

    Parameters
    ----------
    gas : Gas
        From `slab_gas`.

    Returns
    -------
    dict of str to float
        By the names of `triboflux.responses.Responses`.
    """
    x, gamma = _place(gas), FRACTIONS[0]
    along, y, z = (x * gas.particles[:, axis] for axis in (1, 2, 3))
    third = slopes(gas, along, tensors, gamma)[1]
    tangential = third[1] + third[2]
    sheared = slopes(gas, y, tensors, gamma)[1, 3] + slopes(gas, z, tensors, gamma)[1, 5]
    # T_xx = 2 ρ1 + ρ2, T_yy = T_zz = ρ2, and ρ1 from each shear: weights near the best ones
    shear = 0.15 * third[0] - 0.075 * tangential + 0.35 * sheared
    divergence = 0.2 * third[0] + 0.4 * tangential - 0.2 * sheared
    return {"third_shear": shear / gamma, "third_divergence": divergence / gamma}


def _place(gas: Gas) -> Array:
    """Return distances from the middle in diameters."""
    place: Array = (gas.particles[:, 0] - 0.5) / gas.diameter
    return place
