"""Numbers that the paper's statements about its figures are measured by."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from triboflux.figures import style
from triboflux.figures.budgets import grouped
from triboflux.figures.closure import broken_at_singularities

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from triboflux.result import Result

FIELDS = ("charge", "field", "covariance", "variance")
"""What the figures of profiles show."""


class Distance(NamedTuple):
    """Difference between two profiles, relative to the second.

    Attributes
    ----------
    largest : float
        Largest difference over largest value.
    mean_square : float
        L2 norm of the difference over L2 norm of the second profile.
    """

    largest: float
    mean_square: float


def _last(result: Result, variable: str, time: int = -1) -> NDArray[np.float64]:
    return style.profile(result, variable, time)[1][:-1]


def distances(reduced: Result, full: Result) -> dict[str, Distance]:
    """Return how far a reduced model is from the full one at their last times, by variable.

    Parameters
    ----------
    reduced, full : Result
        In one dimension, on the same points.
    """
    found: dict[str, Distance] = {}
    for variable in FIELDS:
        if variable in reduced.dataset:
            expected = _last(full, variable)
            difference = _last(reduced, variable) - expected
            found[variable] = Distance(
                float(np.abs(difference).max() / np.abs(expected).max()),
                float(np.linalg.norm(difference) / np.linalg.norm(expected)),
            )
    return found


def largest(result: Result, variable: str, time: int = -1) -> float:
    """Return the largest absolute value of a variable over the points.

    Parameters
    ----------
    result : Result
        In one dimension.
    variable : str
        Of its dataset.
    time : int
        Index of the output, the last by default.
    """
    return float(np.abs(_last(result, variable, time)).max())


def end(result: Result) -> float:
    """Return the last time of a result."""
    return float(result.dataset["time"][-1])


def harmonics(result: Result) -> float:
    """Return how far the last charge profile is from its own fundamental sine wave.

    Parameters
    ----------
    result : Result
        In one dimension.

    Returns
    -------
    float
        Largest difference over the largest value of the profile.
    """
    charge = _last(result, "charge")
    modes = np.fft.rfft(charge)
    modes[2:] = 0.0
    return float(np.abs(charge - np.fft.irfft(modes, len(charge))).max() / np.abs(charge).max())


def places_of_maxima(result: Result, variable: str) -> NDArray[np.float64]:
    """Return where the last profile of a variable's size has its local maxima.

    Parameters
    ----------
    result : Result
        In one dimension.
    variable : str
        Of its dataset.
    """
    x, values = style.profile(result, variable)
    size = np.abs(values[:-1])
    return x[:-1][(size > np.roll(size, 1)) & (size >= np.roll(size, -1))]


def unrealizable(result: Result) -> tuple[float, float]:
    """Return the part of the box where |C|² > V at the end, and the largest |C|²/V.

    Parameters
    ----------
    result : Result
        With a variance.
    """
    ratio = _last(result, "covariance") ** 2 / _last(result, "variance")
    return float((ratio > 1.0).mean()), float(ratio.max())


def sizes(terms: xr.Dataset, moment: str) -> dict[str, float]:
    """Return the largest absolute value of each group of an equation and of ``time derivative``.

    Parameters
    ----------
    terms : xarray.Dataset
        From `triboflux.figures.budgets.budgets`.
    moment : str
        ``charge``, ``covariance`` or ``variance``.
    """
    found = {group: float(np.abs(v).max()) for group, v in grouped(terms, moment).items()}
    return found | {"time derivative": float(np.abs(terms[f"{moment}_rate"]).max())}


def mismatch(terms: xr.Dataset, moment: str) -> float:
    """Return how far the sum of terms is from the difference of outputs.

    Parameters
    ----------
    terms : xarray.Dataset
        From `triboflux.figures.budgets.budgets`.
    moment : str
        ``charge``, ``covariance`` or ``variance``.

    Returns
    -------
    float
        Largest difference over the largest term of the equation.
    """
    difference = np.abs(terms[f"{moment}_rate"] - terms[f"{moment}_rate_measured"]).max()
    return float(difference / max(sizes(terms, moment).values()))


def singular_share(profile: xr.Dataset) -> tuple[float, int]:
    """Return in which part of the box a variance is negative, and at how many places singular.

    Parameters
    ----------
    profile : xarray.Dataset
        From `triboflux.diagnostics.initial_closure`, in one dimension.
    """
    length = len(profile["x"]) * float(profile["x"][1] - profile["x"][0])
    _, _, singular = broken_at_singularities(profile, length)
    return float((profile["variance"] < 0.0).mean()), len(singular)


def limits(errors: xr.Dataset, level: float) -> NDArray[np.float64]:
    """Return the collision time at which the error passes a level, for every Péclet number.

    Parameters
    ----------
    errors : xarray.Dataset
        From `triboflux.suitability.suitability`, over Pe and tau_c.
    level : float
        The error.

    Returns
    -------
    numpy.ndarray
        Between two neighbours that both have an error, interpolated in logarithms as the chart's
        lines are; nan where the level is not passed so.
    """
    tau_c = np.log(errors["tau_c"].values)
    # an error may vanish, in logarithms it then is far below every level
    excess = np.log(np.maximum(errors["error"].values, 1e-300)) - np.log(level)
    found = np.full(len(excess), np.nan)
    for i, row in enumerate(excess):
        # no comparison with nan holds
        passing = np.flatnonzero((row[:-1] <= 0.0) & (row[1:] > 0.0))
        if len(passing):
            j = passing[0]
            part = row[j] / (row[j] - row[j + 1])
            found[i] = np.exp(tau_c[j] + part * (tau_c[j + 1] - tau_c[j]))
    return found


def limit_at(errors: xr.Dataset, level: float, peclet: float) -> float:
    """Return the collision time at which the error passes a level, at any Péclet number.

    Parameters
    ----------
    errors : xarray.Dataset
        From `triboflux.suitability.suitability`, over Pe and tau_c.
    level : float
        The error.
    peclet : float
        The number; between two of the map interpolated in logarithms, nan if one has no limit.
    """
    places = np.log(errors["peclet"].values)
    # at a place of the map itself a neighbour without limit shall not count
    place, values = np.log(peclet), np.log(limits(errors, level))
    exact = np.flatnonzero(np.isclose(places, place, rtol=1e-9))
    return float(np.exp(values[exact[0]] if len(exact) else np.interp(place, places, values)))


def suitable_until(errors: xr.Dataset, level: float) -> NDArray[np.float64]:
    """Return the largest collision time of the map with at most some error, by Péclet number.

    Parameters
    ----------
    errors : xarray.Dataset
        From `triboflux.suitability.suitability`, over Pe and tau_c.
    level : float
        The error.

    Returns
    -------
    numpy.ndarray
        One of the map's collision times; nan where there is none.
    """
    # no comparison with nan holds
    good = errors["error"].values <= level
    largest = np.where(good, errors["tau_c"].values, 0.0).max(axis=1)
    return np.where(largest > 0.0, largest, np.nan)


def nearest(errors: xr.Dataset, place: tuple[float, float]) -> xr.Dataset:
    """Return the point of a map that is next to a place, in logarithms.

    Parameters
    ----------
    errors : xarray.Dataset
        From `triboflux.suitability.suitability`, over Pe and tau_c.
    place : tuple of float
        Péclet number and collision time.
    """
    indices = {
        name: int(np.abs(np.log(errors[name].values / value)).argmin())
        for name, value in zip(("peclet", "tau_c"), place, strict=True)
    }
    return errors.isel(indices)
