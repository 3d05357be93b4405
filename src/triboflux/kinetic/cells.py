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
    return min(int(position * cells), cells - 1)


@compiled
def move(particles: Any, by: float) -> None:
    """Let all particles fly freely for a time, in box lengths over √Θ, and stay in the box."""
    for p in particles:
        position = p[0] + by * p[1]
        p[0] = position - math.floor(position)


@compiled
def sort(particles: Any, sorted_: Any, cell_of: Any, start: Any) -> None:
    """Copy particles to `sorted_` in the order of their cells, and set `start`."""
    cells = start.size - 1
    start[:] = 0
    for i in range(particles.shape[0]):
        cell = _cell(particles[i, 0], cells)
        cell_of[i] = cell
        start[cell + 1] += 1
    for cell in range(cells):
        start[cell + 1] += start[cell]
    following = start[:-1].copy()
    for i in range(particles.shape[0]):
        place = following[cell_of[i]]
        following[cell_of[i]] = place + 1
        for column in range(COLUMNS):
            sorted_[place, column] = particles[i, column]


@compiled
def electric_field(particles: Any, start: Any, length: float) -> Any:
    """Return the field on the left faces of all cells, scaled by n Q0 L/ε0, exact in 1-D.

    The mean charge is neutralised, the mean field vanishes, and the last entry repeats the first.
    """
    cells = start.size - 1
    charge = np.zeros(cells)
    for cell in range(cells):
        for i in range(start[cell], start[cell + 1]):
            charge[cell] += particles[i, 4]
    charge -= charge.mean()
    field = np.zeros(cells + 1)
    for cell in range(cells):
        field[cell + 1] = field[cell] + charge[cell] * (length / particles.shape[0])
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
