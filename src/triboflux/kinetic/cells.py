"""Compiled loops over the particles of the simulation: flight, order, field and sums.

One call works on one ensemble and holds no lock. Particles are rows of a float array: position,
three velocities, charge. Positions count lengths of the box from half an output cell left of its
origin, so that a grid point lies in the middle of its output cell. Velocities are scaled by √Θ,
charges by Q0. Particles lie in the order of their collision cells; `start` tells where the
particles of each cell begin.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from triboflux.kinetic.compiling import compiled

COLUMNS = 5
"""Position, three velocities, charge."""

SUMS = ("count", "charge", "u_x", "u_y", "u_z", "variance", "covariance")
SUMS += ("r_xx", "r_yy", "r_zz", "t_xx", "t_mm", "n_x")
"""What `cell_sums` returns of each cell: a count, means, and sums of products of deviations."""


@compiled
def _cell(position: float, cells: int) -> int:
    # what is not a number any longer has to be in a cell, too
    return min(int(position * cells), cells - 1) if position > 0.0 else 0


@compiled
def _flown(position: float, velocity: float, by: float) -> float:
    place = position + by * velocity
    return place - np.floor(place)


@compiled
def move(particles: Any, by: float) -> None:
    """Let all particles fly freely for a time, in box lengths over √Θ, and stay in the box."""
    for i in range(particles.shape[0]):
        particles[i, 0] = _flown(particles[i, 0], particles[i, 1], by)


@compiled
def sort(particles: Any, sorted_: Any, start: Any, by: float) -> Any:
    """Let particles fly as `move` does, into another array in the order of their cells.

    Parameters
    ----------
    particles : numpy.ndarray
        Not changed.
    sorted_, start : numpy.ndarray
        They are set.
    by : float
        Time in box lengths over √Θ.

    Returns
    -------
    numpy.ndarray
        The charge of each cell.
    """
    cells = start.size - 1
    start[:] = 0
    for i in range(particles.shape[0]):
        start[_cell(_flown(particles[i, 0], particles[i, 1], by), cells) + 1] += 1
    for cell in range(cells):
        start[cell + 1] += start[cell]
    following, charge = start[:-1].copy(), np.zeros(cells)
    for i in range(particles.shape[0]):
        position = _flown(particles[i, 0], particles[i, 1], by)
        cell = _cell(position, cells)
        place = following[cell]
        following[cell] = place + 1
        charge[cell] += particles[i, 4]
        # a loop over the columns would become a call of a function for every particle
        sorted_[place, 0] = position
        sorted_[place, 1] = particles[i, 1]
        sorted_[place, 2] = particles[i, 2]
        sorted_[place, 3] = particles[i, 3]
        sorted_[place, 4] = particles[i, 4]
    return charge


@compiled
def cell_charges(particles: Any, start: Any) -> Any:
    """Return the charge of each cell of sorted particles."""
    charge = np.zeros(start.size - 1)
    for cell in range(charge.size):
        for i in range(start[cell], start[cell + 1]):
            charge[cell] += particles[i, 4]
    return charge


@compiled
def electric_field(charge: Any, number: int, length: float) -> Any:
    """Return the field on the left faces of all cells, scaled by n Q0 L/ε0, exact in 1-D.

    The mean charge is neutralised, the mean field vanishes, and the last entry repeats the first.

    Parameters
    ----------
    charge : numpy.ndarray
        Of each cell, scaled by Q0.
    number : int
        Of particles.
    length : float
        Of the box, scaled by L.
    """
    cells, mean = charge.size, charge.mean()
    field = np.zeros(cells + 1)
    for cell in range(cells):
        field[cell + 1] = field[cell] + (charge[cell] - mean) * (length / number)
    return field - field[1:].mean()


@compiled
def accelerate(particles: Any, start: Any, field: Any, strength: float, slowed: float) -> None:
    """Kick all particles by the force of the field, linear in each cell, and slow them by drag."""
    cells = start.size - 1
    for cell in range(cells):
        rise = field[cell + 1] - field[cell]
        for i in range(start[cell], start[cell + 1]):
            local = field[cell] + (particles[i, 0] * cells - cell) * rise
            particles[i, 1] = slowed * particles[i, 1] + strength * particles[i, 4] * local
            particles[i, 2] *= slowed
            particles[i, 3] *= slowed


@compiled
def cell_sums(particles: Any, start: Any, points: int) -> Any:
    """Return counts, means and sums of products of deviations of groups of cells.

    Returns
    -------
    numpy.ndarray
        Shape ``(len(SUMS), points)``.
    """
    sums = np.zeros((len(SUMS), points))
    group = (start.size - 1) // points
    for point in range(points):
        first, end = start[point * group], start[(point + 1) * group]
        s = sums[:, point]
        s[0] = end - first
        for i in range(first, end):
            s[1] += particles[i, 4]
            s[2] += particles[i, 1]
            s[3] += particles[i, 2]
            s[4] += particles[i, 3]
        s[1:5] /= max(end - first, 1)
        for i in range(first, end):
            charge = particles[i, 4] - s[1]
            x = particles[i, 1] - s[2]
            y = particles[i, 2] - s[3]
            z = particles[i, 3] - s[4]
            s[5] += charge * charge
            s[6] += charge * x
            s[7] += x * x
            s[8] += y * y
            s[9] += z * z
            s[10] += charge * x * x
            s[11] += charge * (x * x + y * y + z * z)
            s[12] += charge * charge * x
    return sums


@compiled
def local_motion(particles: Any, points: int, warm: bool) -> Any:
    """Return the local mean velocities, and factors that bring Θ back to 1 if `warm`.

    Particles need not be in order.

    Returns
    -------
    numpy.ndarray
        Shape ``(points, 4)``: three velocities and a factor.
    """
    count = np.zeros(points)
    motion = np.zeros((points, 4))
    for p in particles:
        point = _cell(p[0], points)
        count[point] += 1.0
        for axis in range(3):
            motion[point, axis] += p[1 + axis]
            motion[point, 3] += p[1 + axis] * p[1 + axis]
    for point in range(points):
        m = motion[point]
        square = m[3]
        m[3] = 1.0
        if count[point] < 2.0:
            m[:3] = 0.0
            continue
        for axis in range(3):
            m[axis] /= count[point]
            square -= count[point] * m[axis] * m[axis]
        if warm and square > 0.0:
            m[3] = math.sqrt(3.0 * (count[point] - 1.0) / square)
    return motion


@compiled
def hold(particles: Any, motion: Any) -> None:
    """Subtract local velocities, and multiply by local factors."""
    for p in particles:
        m = motion[_cell(p[0], motion.shape[0])]
        for axis in range(3):
            p[1 + axis] = (p[1 + axis] - m[axis]) * m[3]
