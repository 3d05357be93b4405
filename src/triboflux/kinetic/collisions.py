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
    return min(int(position * cells), cells - 1)


@compiled
def _field_at(field: Any, position: float, cells: int) -> float:
    inside = position - math.floor(position)
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
def _square(p: Any) -> float:
    return p[1] * p[1] + p[2] * p[2] + p[3] * p[3]


@compiled
def _fastest(particles: Any, first: int, end: int) -> float:
    square = 0.0
    for i in range(first, end):
        square = max(square, _square(particles[i]))
    return square


@compiled
def _direction(p: Any, a: Any, b: Any, c: Any, d: Any) -> Any:
    """Return a unit vector k with density (c.k)+, and the next state of the generator."""
    radius = 2.0
    x = y = 0.0
    while radius >= 1.0:
        bits, a, b, c, d = _draw(a, b, c, d)
        x = np.int64(bits >> _HALF) * (2.0 * _TO_UNIT) - 1.0
        y = np.int64(bits & _LOW) * (2.0 * _TO_UNIT) - 1.0
        radius = x * x + y * y
    # a point of the unit sphere (Marsaglia 1972), added to the direction of the velocity
    scale = 2.0 * math.sqrt(1.0 - radius)
    over = 1.0 / math.sqrt(_square(p))
    x = p[1] * over + x * scale
    y = p[2] * over + y * scale
    z = p[3] * over + (1.0 - 2.0 * radius)
    over = 1.0 / math.sqrt(x * x + y * y + z * z)
    return (x * over, y * over, z * over), a, b, c, d


@compiled
def _hit(p: Any, q: Any, k: Any, approach: float, pull: float, law: Any) -> None:
    """Change velocities and charges of two particles that collide, (2.5)-(2.15)."""
    _, restitution, gamma, beta, exponent = law
    impulse = 0.5 * (1.0 + restitution) * approach
    for axis in range(3):
        p[1 + axis] -= impulse * k[axis]
        q[1 + axis] += impulse * k[axis]
    if gamma > 0.0 or beta > 0.0:
        passed = (gamma * (q[4] - p[4]) - beta * pull) * approach**exponent
        p[4] += passed
        q[4] -= passed


@compiled
def collide(
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
    # One loop, a little longer than a page: in parts it would hand the state of the generator and
    # the bound on the speed to and fro.
    diameter = law[0]
    a, b, c, d = generator
    cells = start.size - 1
    most = np.max(start[1:] - start[:-1])
    density = rate * time * most * cells / particles.shape[0]
    collisions, largest = 0, 0.0
    for step in range(cells):
        own = step if forward else cells - 1 - step
        first = start[own]
        count = start[own + 1] - first
        # squared, so that the largest probability is 1 without round-off
        fastest = _fastest(particles, first, first + count)
        left, a, b, c, d = _rounded(density * count * math.sqrt(fastest), a, b, c, d)
        while left > 0:
            left -= 1
            bits, a, b, c, d = _draw(a, b, c, d)
            choice, threshold = _pair(bits, count)
            p = particles[first + choice]
            square = _square(p)
            largest = max(largest, square / fastest)
            if threshold * threshold * fastest >= square:
                continue
            k, a, b, c, d = _direction(p, a, b, c, d)
            other, contact = own, p[0]
            if diameter > 0.0:
                there = p[0] + diameter * k[0]
                other = _cell(there - math.floor(there), cells)
                contact += 0.5 * diameter * k[0]
            others = start[other + 1] - start[other]
            bits, a, b, c, d = _draw(a, b, c, d)
            choice_2, threshold = _pair(bits, max(others, 1))
            if others == 0 or start[other] + choice_2 == first + choice:
                continue
            q = particles[start[other] + choice_2]
            along = p[1] * k[0] + p[2] * k[1] + p[3] * k[2]
            against = q[1] * k[0] + q[2] * k[1] + q[3] * k[2]
            approach = along - against
            bound = most * (along + max(-against, 0.0))
            if approach <= 0.0 or threshold * bound >= others * approach:
                continue
            largest = max(largest, others * approach / bound)
            collisions += 1
            pull = _field_at(field, contact, cells) * k[0] if law[3] > 0.0 else 0.0
            _hit(p, q, k, approach, pull, law)
            # the bound on the speed follows, and with it the number of candidates left
            square = _square(p) if other != own else max(_square(p), _square(q))
            if square > fastest:
                left, a, b, c, d = _rounded(left * math.sqrt(square / fastest), a, b, c, d)
                fastest = square
    generator[0], generator[1], generator[2], generator[3] = a, b, c, d
    return collisions, largest
