"""Moments of simulated particles and their standard errors over independent ensembles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from triboflux.kinetic.cells import SUMS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from triboflux.kinetic.ensemble import Ensemble, Parameters

SMOOTH_WAVES = 8
"""Waves of the mean charge that its largest value is found from; shorter ones are noise."""

MOMENTS = ("charge", "covariance", "variance", "field", "potential", "realizability_margin")
MOMENTS += ("number_density", "mean_velocity", "granular_temperature", "granular_temperature_xx")
MOMENTS += ("covariance_flux_xx", "covariance_flux_trace", "variance_flux")
"""What `moments_of` returns."""

_FINE = 1024


def moments_of(ensemble: Ensemble) -> dict[str, NDArray[np.float64]]:
    """Return the moments of one ensemble in each output cell.

    Products of deviations are divided so that their means are right in small cells, too. What the
    slope of the mean charge within a cell adds to the variance is subtracted.

    Parameters
    ----------
    ensemble : Ensemble
        Its particles are sorted on the way.

    Returns
    -------
    dict of str to numpy.ndarray
        Each of shape ``(points,)``, by the names in `MOMENTS`.
    """
    sums, faces = ensemble.sums_and_field()
    s = dict(zip(SUMS, sums, strict=True))
    count = s["count"]
    pairs, triples = count - 1.0, (count - 1.0) * (count - 2.0) / count
    r_xx = s["r_xx"] / pairs
    rise = 0.5 * (np.roll(s["charge"], -1) - np.roll(s["charge"], 1))
    covariance, variance = s["covariance"] / pairs, s["variance"] / pairs - rise**2 / 12.0
    field, potential = _field_and_potential(ensemble.parameters, faces)
    return {
        "charge": s["charge"],
        "covariance": covariance,
        "variance": variance,
        "field": field,
        "potential": potential,
        "realizability_margin": variance - covariance**2 / r_xx,
        "number_density": count * (count.size / len(ensemble.particles)),
        "mean_velocity": s["u_x"],
        "granular_temperature": (s["r_xx"] + s["r_yy"] + s["r_zz"]) / (3.0 * pairs),
        "granular_temperature_xx": r_xx,
        "covariance_flux_xx": s["t_xx"] / triples,
        "covariance_flux_trace": s["t_mm"] / triples,
        "variance_flux": s["n_x"] / triples,
    }


def _field_and_potential(
    p: Parameters, faces: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return both in the middle of the output cells, where the grid points are."""
    width = p.length / p.cells
    potential = np.concatenate([[0.0], -np.cumsum(faces[1:] + faces[:-1]) * (0.5 * width)])
    potential -= potential[1:].mean()
    place = np.linspace(0.0, 1.0, p.cells + 1)
    middle = (np.arange(p.points) + 0.5) / p.points
    return np.interp(middle, place, faces), np.interp(middle, place, potential)


def mean_and_error(
    values: Sequence[NDArray[np.float64]],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the mean over ensembles and its standard error.

    Parameters
    ----------
    values : sequence of numpy.ndarray
        One array of an ensemble each, at least two.
    """
    stacked = np.stack(values)
    return stacked.mean(axis=0), stacked.std(axis=0, ddof=1) / np.sqrt(len(stacked))


def peak_charge(charges: NDArray[np.float64]) -> tuple[float, float]:
    """Return the largest absolute mean charge of all ensembles together, and its standard error.

    Parameters
    ----------
    charges : numpy.ndarray
        Means over the output cells, shape ``(ensembles, points)``.

    Returns
    -------
    tuple of float
        From `SMOOTH_WAVES` waves, undone of the averaging over a cell. The largest of all cells
        would be too large by their noise.
    """
    smooth = _smooth(charges)
    mean, error = mean_and_error(list(smooth))
    place = int(np.abs(mean).argmax())
    return float(abs(mean[place])), float(error[place])


def _smooth(charges: NDArray[np.float64]) -> Any:
    """Return cell means on a fine grid, shape ``(ensembles, fine)``, without short waves."""
    points = charges.shape[-1]
    modes = np.fft.rfft(charges, axis=-1)[:, : min(SMOOTH_WAVES, (points - 1) // 2) + 1]
    modes = modes / (points * np.sinc(np.arange(modes.shape[-1]) / points))
    padded = np.zeros((len(charges), _FINE // 2 + 1), dtype=complex)
    padded[:, : modes.shape[-1]] = modes
    return np.fft.irfft(padded, _FINE, axis=-1) * _FINE
