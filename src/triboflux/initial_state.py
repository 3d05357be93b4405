"""The fields at time 0, from Fourier modes or from the last time of a result."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from triboflux.errors import InputError, shown_path
from triboflux.fields import FIELDS
from triboflux.hierarchy import MODELS, RANKS, VOLUME, components, moves
from triboflux.mass_coordinate import along_m
from triboflux.scales import Scales

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from triboflux.case import Case, GridSpec, Mode

_ROUND_OFF = 1e-12
_NET_CHARGE_OF_A_FILE = 1e-10


def initial_fields(
    case: Case,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Evaluate the initial state on the points of the grid.

    Point ``i`` of a direction with ``points`` points lies at ``i * length / points``.

    Parameters
    ----------
    case : Case
        A validated case.

    Returns
    -------
    charge : numpy.ndarray
        Mean charge, shape ``points``, scaled by Q0.
    covariance : numpy.ndarray
        Charge-velocity covariance, shape ``(dimensions, *points)``, scaled by Q0 sqrt(Theta).
    variance : numpy.ndarray
        Charge variance, shape ``points``, scaled by Q0^2.

    Raises
    ------
    InputError
        If the variance is negative somewhere, or a file given as initial state can't be read,
        does not fit the grid, or has a net charge.
    """
    moments = initial_moments(case)
    return moments["charge"], moments["covariance"], moments["variance"]


def initial_moments(case: Case) -> dict[str, NDArray[np.float64]]:
    """Evaluate all moments at time 0 on the points of the grid.

    Parameters
    ----------
    case : Case
        A validated case.

    Returns
    -------
    dict of str to numpy.ndarray
        Every moment of `triboflux.hierarchy.RANKS`, shaped and scaled as in `triboflux.moments`.
        Those that the case does not give are zero, as third-order moments are unless a file holds
        them; the granular temperature is one in every direction.

    Raises
    ------
    InputError
        As for `initial_fields`.
    """
    initial, grid = case.initial, case.grid
    if initial.file is not None:
        moments = _moments_of_file(case, initial.file)
    else:
        moments = _at_rest(grid)
        moments["charge"] = sum_of_modes(initial.charge, grid)
        moments["variance"] = sum_of_modes(initial.variance, grid)
        for component, along in enumerate(moments["covariance"]):
            chosen = [m for m in initial.covariance if m.component == component]
            along[...] = sum_of_modes(chosen, grid)
    require_non_negative(moments["variance"], grid)
    return moments


def _at_rest(grid: GridSpec) -> dict[str, NDArray[np.float64]]:
    """Return the moments of particles without charge in a Maxwellian of the first temperature."""
    moments = {
        name: np.zeros((grid.dimensions,) * rank + grid.points) for name, rank in RANKS.items()
    }
    moments["granular_temperature"][...] = 1.0
    moments["specific_volume"][...] = 1.0
    for direction in range(grid.dimensions):
        moments["granular_temperature_tensor"][direction, direction] = 1.0
    return moments


def sum_of_modes(modes: Sequence[Mode], grid: GridSpec) -> NDArray[np.float64]:
    """Evaluate a sum of Fourier modes on the points of a grid.

    Parameters
    ----------
    modes : sequence of Mode
        Modes with as many whole numbers as the grid has dimensions.
    grid : GridSpec
        The periodic box; only the number of points matters.

    Returns
    -------
    numpy.ndarray
        Shape ``grid.points``, in the scale of the amplitudes.
    """
    total = np.zeros(grid.points)
    for mode in modes:
        turns = np.zeros((1,) * grid.dimensions)
        for axis, (waves, points) in enumerate(zip(mode.mode, grid.points, strict=True)):
            shape = [1] * grid.dimensions
            shape[axis] = points
            # whole turns are dropped in integers, so that the phase keeps its accuracy
            turns = turns + (np.arange(points) * waves % points / points).reshape(shape)
        angle = 2 * math.pi * turns
        if mode.sine:
            total += mode.sine * np.sin(angle)
        if mode.cosine:
            total += mode.cosine * np.cos(angle)
    return total


def require_non_negative(variance: NDArray[np.float64], grid: GridSpec) -> None:
    """Refuse a variance that is negative beyond round-off.

    Parameters
    ----------
    variance : numpy.ndarray
        Charge variance, shape ``grid.points``.
    grid : GridSpec
        Tells where the offending point lies.

    Raises
    ------
    InputError
        Names the smallest value and its place.
    """
    smallest = float(variance.min())
    if smallest < -_ROUND_OFF * float(np.abs(variance).max()):
        place = np.unravel_index(int(variance.argmin()), variance.shape)
        coordinates = ", ".join(
            f"{i * length / points:.6g}"
            for i, length, points in zip(place, grid.lengths, grid.points, strict=True)
        )
        raise InputError.about(
            "initial.variance",
            f"is {smallest:.6g} at x = ({coordinates}), but must not be negative anywhere",
        )


def require_file(case: Case) -> None:
    """Refuse a case whose initial state is a missing file, without reading it.

    Parameters
    ----------
    case : Case
        A validated case.

    Raises
    ------
    InputError
        If ``initial.file`` is given and no such file exists.
    """
    file = case.initial.file
    if file is not None and not os.path.isfile(file):
        raise InputError.about("initial.file", f"is {shown_path(file)}, which is no existing file")


def _moments_of_file(case: Case, file: str) -> dict[str, NDArray[np.float64]]:
    """Read the last time of a result and check that it fits the case."""
    from triboflux.result import load  # imports xarray, which only files need

    require_file(case)
    start = load(file)
    name = f"is {shown_path(file)}"
    factors = _scale_ratios(start.case, case)
    lengths = [length * factors["length"] for length in start.case.grid.lengths]
    for what, theirs, ours in (
        ("points", start.case.grid.points, case.grid.points),
        ("lengths", lengths, case.grid.lengths),
    ):
        # lengths that are scaled differently agree to round-off
        if len(theirs) != len(ours) or not np.allclose(theirs, ours, rtol=_ROUND_OFF, atol=0.0):
            raise InputError.about(
                "initial.file",
                f"{name}, whose grid has {what} {list(theirs)}, but grid.{what} is {list(ours)}",
            )
    last = start.to_scaled().dataset.isel(time=-1)
    moments = _at_rest(case.grid)
    # What the model closes or neglects need not be there, and need not make sense.
    for moment in MODELS[case.model].evolves:
        for variable, place in components(moment, case.grid.dimensions).items():
            if variable not in last:
                raise InputError.about(
                    "initial.file",
                    f"{name}, a result of the {start.case.model} model, which knows no {variable}, "
                    f"but the {case.model} model starts from one",
                )
            values = np.asarray(last[variable].values, dtype=np.float64) * factors[moment]
            if not np.isfinite(values).all():
                raise InputError.about(
                    "initial.file", f"{name}, whose last {variable} is not finite"
                )
            for at in {place, place[::-1]}:
                moments[moment][at] = values
    if moves(case.model):
        if not moments[VOLUME].min() > 0.0:
            raise InputError.about(
                "initial.file",
                f"{name}, whose last {VOLUME} falls to {moments[VOLUME].min():.6g}, but must be "
                "positive everywhere",
            )
        moments |= along_m(
            {name: moments[name] for name in MODELS[case.model].evolves}, case.grid.lengths[0]
        )
    charge = moments["charge"]
    net, peak = abs(float(charge.mean())), float(np.abs(charge).max())
    if net > _NET_CHARGE_OF_A_FILE * peak and not case.initial.neutralising_background:
        raise InputError.about(
            "initial.file",
            f"{name}, whose last charge has a net of {float(charge.mean()):.6g}, but must be "
            "neutral unless initial.neutralising_background is true",
        )
    return moments


def _scale_ratios(before: Case, now: Case) -> dict[str, float]:
    """Return by what scaled values are multiplied when the suspension changes between cases."""
    scales = {name: FIELDS[next(iter(components(name, 1)))][2] for name in RANKS}
    scales["length"] = "length"
    if before.suspension is None or now.suspension is None:
        return dict.fromkeys(scales, 1.0)
    old, new = Scales.of(before.suspension), Scales.of(now.suspension)
    return {name: getattr(old, scale) / getattr(new, scale) for name, scale in scales.items()}
