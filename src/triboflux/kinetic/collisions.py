"""Compiled collisions of the particle simulation: Montanero & Santos' Enskog method.

The method is that of doi:10.1103/PhysRevE.54.438, with candidates chosen so that most of them do
collide; each pair collides at its exact rate. Particles lie as `triboflux.kinetic.cells` tells.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from triboflux.kinetic.compiling import compiled

_TO_UNIT = 1.0 / 2**32
_LOW = np.uint64(2**32 - 1)
_HALF = np.uint64(32)
_TOGETHER = 256
"""Pairs whose charges are changed at once, while which no other work waits for the powers."""


@compiled
def _draw(a: Any, b: Any, c: Any, d: Any) -> Any:
    """Return 64 random bits and the next state of xoshiro256++ (doi:10.1145/3460772)."""
    sum_ = a + d
    bits = ((sum_ << np.uint64(23)) | (sum_ >> np.uint64(41))) + a
    shifted = b << np.uint64(17)
    c ^= a
    d ^= b
    b ^= c
    a ^= d
    c ^= shifted
    return bits, a, b, c, (d << np.uint64(45)) | (d >> np.uint64(19))


@compiled
def _pair(bits: Any, count: int) -> Any:
    """Return a whole number below a count, and a number from 0 to 1, from 32 bits each."""
    whole = ((bits >> _HALF) * np.uint64(count)) >> _HALF
    return np.int64(whole), np.int64(bits & _LOW) * _TO_UNIT


@compiled
def _rounded(value: float, a: Any, b: Any, c: Any, d: Any) -> Any:
    """Return a whole number whose mean is the value, and the next state of the generator."""
    bits, a, b, c, d = _draw(a, b, c, d)
    return int(value + _pair(bits, 1)[1]), a, b, c, d


@compiled
def _cell(position: float, cells: int) -> int:
    # what is not a number any longer has to be in a cell, too
    return min(int(position * cells), cells - 1) if position > 0.0 else 0


@compiled
def _field_at(field: Any, position: float, cells: int) -> float:
    inside = position - np.floor(position)
    cell = _cell(inside, cells)
    return field[cell] + (inside * cells - cell) * (field[cell + 1] - field[cell])


@compiled
def agitate(particles: Any, generator: Any, variance: float) -> None:
    """Add independent normal numbers of a variance to all velocities (Box & Muller 1958).

    Parameters
    ----------
    particles : numpy.ndarray
        They are changed.
    generator : numpy.ndarray
        Four 64-bit words; they are changed.
    variance : float
        Of each component, scaled by Θ.
    """
    a, b, c, d = generator
    for p in particles:
        for axis in range(1, 4):
            bits, a, b, c, d = _draw(a, b, c, d)
            # from 1 down to 2^-32, of which there is a logarithm
            radius = math.sqrt(-2.0 * variance * math.log(1.0 - _pair(bits, 1)[1]))
            angle = 2.0 * math.pi * np.int64(bits >> _HALF) * _TO_UNIT
            p[axis] += radius * math.cos(angle)
    generator[0], generator[1], generator[2], generator[3] = a, b, c, d


@compiled
def _square(particles: Any, i: int) -> float:
    x, y, z = particles[i, 1], particles[i, 2], particles[i, 3]
    return x * x + y * y + z * z


@compiled
def _fastest(particles: Any, first: int, end: int) -> float:
    square = 0.0
    for i in range(first, end):
        square = max(square, _square(particles, i))
    return square


@compiled
def _most(start: Any, reach: int) -> Any:
    """Return for each cell a bound on the particles of those cells that are in reach."""
    cells = start.size - 1
    count = start[1:] - start[:-1]
    if reach == 0:
        return count
    # a block is no narrower than the reach, so all that is in reach is in three of them
    blocks = max(1, cells // reach)
    first = (np.arange(blocks + 1) * cells + blocks - 1) // blocks
    of_block = np.zeros(blocks, np.int64)
    for block in range(blocks):
        of_block[block] = np.max(count[first[block] : first[block + 1]])
    most = np.empty_like(count)
    for block in range(blocks):
        around = max(of_block[block - 1], of_block[(block + 1) % blocks])
        most[first[block] : first[block + 1]] = max(of_block[block], around)
    return most


@compiled
def _direction(particles: Any, i: int, a: Any, b: Any, c: Any, d: Any) -> Any:
    """Return a unit vector k with density (c.k)+, and the next state of the generator."""
    x, y, z = particles[i, 1], particles[i, 2], particles[i, 3]
    # a point of a disc, lifted to the half of a sphere above it, has the density of its height
    square = 2.0
    first = second = 0.0
    while square >= 1.0:
        bits, a, b, c, d = _draw(a, b, c, d)
        first = np.int64(bits >> _HALF) * (2.0 * _TO_UNIT) - 1.0
        second = np.int64(bits & _LOW) * (2.0 * _TO_UNIT) - 1.0
        square = first * first + second * second
    height = math.sqrt(1.0 - square)
    # the velocity's direction is (along, across u), with a unit vector u in the y-z plane
    flat = y * y + z * z
    over = 1.0 / math.sqrt(x * x + flat)
    across = math.sqrt(flat)
    u_y, u_z = (y / across, z / across) if across > 0.0 else (1.0, 0.0)
    along, across = x * over, across * over
    k_x = height * along + first * across
    in_plane = height * across - first * along
    k_y = in_plane * u_y + second * u_z
    k_z = in_plane * u_z - second * u_y
    return (k_x, k_y, k_z), a, b, c, d


@compiled
def _strike(particles: Any, i: int, j: int, k: Any, most: float, drawn: float, law: Any) -> Any:
    """Let two particles collide, (2.5), if their probability to do so is above a number drawn.

    Returns
    -------
    tuple of float
        Approach velocity (g.k), or 0 without a collision; its probability; and the squares of both
        velocities.
    """
    x, y, z = particles[i, 1], particles[i, 2], particles[i, 3]
    x_2, y_2, z_2 = particles[j, 1], particles[j, 2], particles[j, 3]
    along = x * k[0] + y * k[1] + z * k[2]
    against = x_2 * k[0] + y_2 * k[1] + z_2 * k[2]
    approach = along - against
    bound = most * (along + max(-against, 0.0))
    if approach <= 0.0 or drawn * bound >= approach:
        return 0.0, 0.0, 0.0, 0.0
    impulse = 0.5 * (1.0 + law[1]) * approach
    x, y, z = x - impulse * k[0], y - impulse * k[1], z - impulse * k[2]
    x_2, y_2, z_2 = x_2 + impulse * k[0], y_2 + impulse * k[1], z_2 + impulse * k[2]
    particles[i, 1], particles[i, 2], particles[i, 3] = x, y, z
    particles[j, 1], particles[j, 2], particles[j, 3] = x_2, y_2, z_2
    square, square_2 = x * x + y * y + z * z, x_2 * x_2 + y_2 * y_2 + z_2 * z_2
    return approach, approach / bound, square, square_2


@compiled
def _exchange(
    particles: Any, pairs: Any, impacts: Any, number: int, field: Any, cells: int, law: Any
) -> None:
    """Change the charges of pairs that have collided, one after the other, (2.15).

    Parameters
    ----------
    particles : numpy.ndarray
        They are changed.
    pairs, impacts : numpy.ndarray
        Indices of both particles; (g.k) and the component of k along the box. Impacts are changed.
    number : int
        Of pairs.
    field, cells, law
        As in `collide`.
    """
    diameter, _, gamma, beta, exponent = law
    for one in range(number):
        impacts[one, 0] = math.exp(exponent * math.log(impacts[one, 0]))
    for one in range(number):
        i, j = pairs[one, 0], pairs[one, 1]
        passed = gamma * (particles[j, 4] - particles[i, 4])
        if beta > 0.0:
            contact = particles[i, 0] + 0.5 * diameter * impacts[one, 1]
            passed -= beta * impacts[one, 1] * _field_at(field, contact, cells)
        passed *= impacts[one, 0]
        particles[i, 4] += passed
        particles[j, 4] -= passed


@compiled
def collide(  # noqa: PLR0912, PLR0915 - one loop, see below
    particles: Any,
    start: Any,
    generator: Any,
    field: Any,
    time: float,
    rate: float,
    law: Any,
    forward: bool,
) -> Any:
    """Let particles collide for a time, cell after cell.

    A candidate is a first particle, chosen with a probability proportional to its speed, a
    direction k with density (c1.k)+ around its velocity, and a second particle from the cell that
    holds the position d k away. It collides with the probability (g.k)+ / ((c1.k)+ + (-c2.k)+)
    times the relative density there. As each pair can come up in both orders, it collides at its
    rate g0 d^2 (g.k)+, and no probability can pass 1.

    Parameters
    ----------
    particles, start : numpy.ndarray
        Sorted particles; they are changed.
    generator : numpy.ndarray
        Four 64-bit words; they are changed.
    field : numpy.ndarray
        On the faces of the cells.
    time, rate : float
        Duration, and √π/(4 τ_c): candidates per particle, unit speed and time at mean density.
    law : tuple of float
        Diameter in box lengths, restitution, γ, β and exponent.
    forward : bool
        Whether the cells come in increasing order.

    Returns
    -------
    tuple of int and float
        Number of collisions, and largest probability of an acceptance.
    """
    # One loop, longer than a page: in parts it would hand the state of the generator and the
    # bound on the speed to and fro.
    diameter, exchanging = law[0], law[2] > 0.0 or law[3] > 0.0
    a, b, c, d = generator
    cells = start.size - 1
    reach = int(diameter * cells) + 1 if diameter > 0.0 else 0
    most, fastest = _most(start, reach), np.zeros(cells)
    pairs, impacts = np.empty((_TOGETHER, 2), np.int64), np.empty((_TOGETHER, 2))
    seen = waiting = collisions = 0
    largest = 0.0
    for step in range(cells):
        # what comes into reach is read in order first, for the cache
        while seen <= min(step + reach, cells - 1):
            cell = seen if forward else cells - 1 - seen
            fastest[cell] = _fastest(particles, start[cell], start[cell + 1])
            seen += 1
        own = step if forward else cells - 1 - step
        first = start[own]
        count = start[own + 1] - first
        # squared, so that the largest probability is 1 without round-off
        top = fastest[own]
        expected = rate * time * most[own] * cells / particles.shape[0] * count * math.sqrt(top)
        left, a, b, c, d = _rounded(expected, a, b, c, d)
        # While a pair (i, j) waits for its second particle to come from memory, the next candidate
        # is chosen. A choice that falls on the pair is put off until that has collided or not, so
        # all is as if one came after the other; only a higher bound comes one choice late.
        i = j = -1
        k = (0.0, 0.0, 0.0)
        other = own
        drawn = relative = 0.0
        put_off, chosen, level = False, first, 0.0
        while put_off or left > 0 or i >= 0:
            found = False
            square = 0.0
            while put_off or left > 0:
                if not put_off:
                    left -= 1
                    bits, a, b, c, d = _draw(a, b, c, d)
                    choice, level = _pair(bits, count)
                    chosen = first + choice
                put_off = chosen in (i, j)
                if put_off:
                    break
                square = _square(particles, chosen)
                found = level * level * top < square
                if found:
                    largest = max(largest, square / top)
                    break
            next_j, next_other, next_k = -1, own, k
            next_drawn = next_relative = 0.0
            if found:
                next_k, a, b, c, d = _direction(particles, chosen, a, b, c, d)
                if diameter > 0.0:
                    place = particles[chosen, 0] + diameter * next_k[0]
                    next_other = _cell(place - np.floor(place), cells)
                others = start[next_other + 1] - start[next_other]
                next_relative = most[own] / max(others, 1)
                bits, a, b, c, d = _draw(a, b, c, d)
                choice, next_drawn = _pair(bits, max(others, 1))
                next_j = start[next_other] + choice if others > 0 else chosen
            if i >= 0 and i != j:
                approach, probability, square, square_2 = _strike(
                    particles, i, j, k, relative, drawn, law
                )
                if approach > 0.0:
                    collisions += 1
                    largest = max(largest, probability)
                    pairs[waiting, 0], pairs[waiting, 1] = i, j
                    impacts[waiting, 0], impacts[waiting, 1] = approach, k[0]
                    waiting += exchanging
                    if waiting == _TOGETHER:
                        _exchange(particles, pairs, impacts, waiting, field, cells, law)
                        waiting = 0
                    # the bound on the speed follows, and with it the number of candidates left
                    if other != own:
                        fastest[other] = max(fastest[other], square_2)
                    else:
                        square = max(square, square_2)
                    if square > top:
                        left, a, b, c, d = _rounded(left * math.sqrt(square / top), a, b, c, d)
                        top = square
            i = chosen if found else -1
            j, other, k = next_j, next_other, next_k
            drawn, relative = next_drawn, next_relative
    _exchange(particles, pairs, impacts, waiting, field, cells, law)
    generator[0], generator[1], generator[2], generator[3] = a, b, c, d
    return collisions, largest
