"""The error that all solvers are measured by, for NumPy alone."""

from __future__ import annotations

from collections.abc import Sequence
from math import prod

import numpy as np

FINE = 384
"""Points in one dimension on which charges are compared."""


def resampled(values: np.ndarray, points: Sequence[int]) -> np.ndarray:
    """Return a periodic field on other points by its trigonometric interpolant.

    Parameters
    ----------
    values : ndarray
        Field on equidistant points, without content at half the points' wave number.
    points : sequence of int
        Points wanted per dimension; waves too short for them are left out.
    """
    spectrum = np.fft.fftn(values) / values.size
    for axis, wanted in enumerate(points):
        given = spectrum.shape[axis]
        kept = (min(given, wanted) - 1) // 2
        low = np.take(spectrum, range(kept + 1), axis)
        high = np.take(spectrum, range(given - kept, given), axis)
        shape = list(spectrum.shape)
        shape[axis] = wanted - 2 * kept - 1
        spectrum = np.concatenate([low, np.zeros(shape, complex), high], axis)
    return np.fft.ifftn(spectrum).real * prod(points)


def relative_error(charge: np.ndarray, reference: np.ndarray) -> float:
    """Return max|Q - Q_ref| / max|Q_ref|, compared on the finer of both grids, at least `FINE`."""
    if charge.ndim == 1:
        points: tuple[int, ...] = (max(FINE, charge.size, reference.size),)
    else:
        points = tuple(map(max, zip(charge.shape, reference.shape, strict=True)))
    exact = resampled(reference, points)
    return float(np.abs(resampled(charge, points) - exact).max() / np.abs(exact).max())
