"""Particles at time 0, drawn from the initial fields of a case."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from triboflux.errors import InputError
from triboflux.initial_state import initial_fields
from triboflux.kinetic.cells import COLUMNS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from triboflux.case import Case

_ROUND_OFF = 1e-12
_BLOCK = 2**16


def draw_particles(case: Case, number: int, random: np.random.Generator) -> NDArray[np.float64]:
    """Return particles with the charge, covariance and variance of a case's initial state.

    Positions are equally spaced but for a random part of the spacing, velocities are Maxwellian
    with no mean and a granular temperature of exactly 1. A charge is its mean plus a part that is
    proportional to the velocity, plus normal noise.

    Parameters
    ----------
    case : Case
        In one dimension.
    number : int
        Of particles, at least 2.
    random : numpy.random.Generator
        Gives everything random.

    Returns
    -------
    numpy.ndarray
        Shape ``(number, 5)``, as `triboflux.kinetic.cells` tells.

    Raises
    ------
    InputError
        If no charges have the covariance and variance asked for, C² > V somewhere.
    """
    fields = initial_fields(case)
    charge, covariance, variance = fields[0], fields[1][0], fields[2]
    require_realizable(case, covariance, variance)
    particles = np.empty((number, COLUMNS))
    velocity = particles[:, 1:4]
    for axis in range(3):
        velocity[:, axis] = random.standard_normal(number)
    velocity -= velocity.mean(axis=0)
    velocity *= np.sqrt(3.0 * number / np.einsum("ij,ij->", velocity, velocity))
    # in blocks, so that what is needed in between takes no memory
    for first in range(0, number, _BLOCK):
        block = particles[first : first + _BLOCK]
        place = (first + np.arange(len(block)) + random.random(len(block))) / number
        block[:, 0] = (place + 0.5 / case.grid.points[0]) % 1.0
        block[:, 4] = evaluate(charge, place)
        if variance.any():
            along = evaluate(covariance, place)
            rest = np.sqrt(np.maximum(evaluate(variance, place) - along**2, 0.0))
            block[:, 4] += along * block[:, 1] + rest * random.standard_normal(len(block))
    return particles


def require_realizable(
    case: Case, covariance: NDArray[np.float64], variance: NDArray[np.float64]
) -> None:
    """Refuse a covariance that no charges of the given variance can have.

    Parameters
    ----------
    case : Case
        Tells where the grid points are.
    covariance, variance : numpy.ndarray
        On the grid points.

    Raises
    ------
    InputError
        Names the worst place.
    """
    excess = covariance**2 - variance
    worst = int(excess.argmax())
    if excess[worst] > _ROUND_OFF * float(np.max(variance, initial=1.0)):
        x = worst * case.grid.lengths[0] / case.grid.points[0]
        raise InputError.about(
            "initial.covariance",
            f"is {covariance[worst]:.6g} at x = {x:.6g}, but must be at most the root of the "
            f"variance there, {variance[worst] ** 0.5:.6g}, or no particles have it",
        )


def evaluate(values: NDArray[np.float64], place: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the trigonometric interpolant of values on equally spaced points.

    Parameters
    ----------
    values : numpy.ndarray
        On the points ``0, 1/n, ...`` of a period.
    place : numpy.ndarray
        Where, in periods.
    """
    modes = np.fft.rfft(values) / len(values)
    total = np.full_like(place, modes[0].real)
    small = _ROUND_OFF * float(np.abs(modes).max(initial=0.0))
    for waves in range(1, len(modes)):
        if abs(modes[waves]) > small:
            # the highest mode of an even number of points has no partner
            twice = 1.0 if 2 * waves == len(values) else 2.0
            total += twice * (modes[waves] * np.exp(2j * np.pi * waves * place)).real
    return total
