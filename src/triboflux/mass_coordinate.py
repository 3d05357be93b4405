"""From the coordinate that moves with the particles of a box in one dimension to x, and back.

In m, dm = n dx with n scaled by its mean, particles stay where they are. A periodic box has the
same length in both, and x(m) is m where averages over m are concerned: the mean momentum is zero.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from triboflux.hierarchy import VOLUME

Reals = NDArray[np.float64]

_PRECISION = 1e-13
"""Of a position, in parts of the length."""
_MOST_ITERATIONS = 200
_AT_ONCE = 2**22
"""Up to how many values of waves are kept at a time."""


def along_x(fields: Mapping[str, Any], length: float, volume: Any = None) -> dict[str, Reals]:
    """Return fields on points that are equally spaced in x from those on points in m.

    Parameters
    ----------
    fields : mapping
        By name, ``[..., m]``.
    length : float
        Of the box, scaled by L.
    volume : array_like, optional
        Specific volume ``[m]``; by default it is among the fields.

    Returns
    -------
    dict of str to numpy.ndarray
        The same names, ``[..., x]``.
    """
    stretch = np.asarray(fields[VOLUME] if volume is None else volume)
    stretch = stretch / stretch.mean()
    ahead = _primitive(stretch - 1.0, length)
    return _at(_inverse(stretch, ahead - ahead.mean(), length), fields)


def along_m(fields: Mapping[str, Any], length: float) -> dict[str, Reals]:
    """Return fields on points that are equally spaced in m from those on points in x.

    Parameters
    ----------
    fields : mapping
        By name, ``[..., x]``, with a positive ``specific_volume``.
    length : float
        Of the box, scaled by L.
    """
    density = 1.0 / np.asarray(fields[VOLUME])
    density /= density.mean()
    behind = _primitive(density - 1.0, length)
    return _at(_inverse(density, behind - (behind * density).mean(), length), fields)


def moved_along(observed: Mapping[str, Any], length: float) -> dict[str, Any]:
    """Return what is observed of a state whose particles move, on points in x.

    Parameters
    ----------
    observed : mapping
        Variables of a dataset at one time; the electric field solves ∂E/∂m = Q, so far.
    length : float
        Of the box, scaled by L.
    """
    fields = {name: values for name, values in observed.items() if np.ndim(values)}
    found = along_x(fields, length)
    found["field"] = found["field"] - found["field"].mean(axis=-1, keepdims=True)
    found["potential"] = -_primitive(found["field"][0], length)
    return {**observed, **found, "number_density": 1.0 / found[VOLUME]}


def _inverse(slope: Reals, shift: Reals, length: float) -> Reals:
    """Return in units of the length where y + shift(y) is on a point, ``slope`` being 1 + shift'.

    Newton's method that a bracket holds, as the sum of waves rises everywhere.
    """
    targets = np.arange(len(slope)) / len(slope)
    reach = float(np.abs(shift).max()) / length + 1.0 / len(slope)
    low, high = targets - reach, targets + reach
    found = targets - shift / length
    for _ in range(_MOST_ITERATIONS):
        (value, steepness) = _waves(np.stack([shift / length, slope]), found)
        miss = found + value - targets
        low, high = np.where(miss < 0.0, found, low), np.where(miss < 0.0, high, found)
        better = found - miss / steepness
        inside = (better > low) & (better < high) & (steepness > 0.0)
        step = np.where(inside, better, 0.5 * (low + high)) - found
        found = found + step
        if float(np.abs(step).max()) < _PRECISION:
            break
    return found


def _at(places: Reals, fields: Mapping[str, Any]) -> dict[str, Reals]:
    """Return all fields at places in units of the length."""
    arrays = {name: np.asarray(values) for name, values in fields.items()}
    points = len(places)
    rows = np.concatenate([values.reshape(-1, points) for values in arrays.values()])
    moved, at = _waves(rows, places), 0
    results: dict[str, Reals] = {}
    for name, values in arrays.items():
        count = values.size // points
        results[name] = moved[at : at + count].reshape(values.shape)
        at += count
    return results


def _primitive(values: Reals, length: float) -> Reals:
    """Return the periodic function with this derivative, of mean zero."""
    spectrum = np.fft.rfft(values)
    waves = 2.0 * np.pi / length * np.arange(len(spectrum))
    spectrum[0] = 0.0
    spectrum[1:] /= 1j * waves[1:]
    return np.fft.irfft(spectrum, len(values))


def _waves(rows: Reals, places: Reals) -> Reals:
    """Return the trigonometric interpolants of rows at places in units of the length."""
    points = rows.shape[-1]
    spectra = np.fft.rfft(rows) * (2.0 / points)
    spectra[:, 0] *= 0.5
    if points % 2 == 0:
        spectra[:, -1] *= 0.5
    results = np.empty((len(rows), len(places)))
    numbers = np.arange(spectra.shape[1])
    stride = max(_AT_ONCE // len(numbers), 1)
    for start in range(0, len(places), stride):
        chosen = slice(start, start + stride)
        turns = np.exp(2j * np.pi * np.outer(numbers, places[chosen]))
        results[:, chosen] = (spectra @ turns).real
    return results
