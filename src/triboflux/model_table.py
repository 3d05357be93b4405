"""The shipped table of the errors of the reduced models, and how it is read between its entries.

The seven numbers of a suspension determine five coordinates that matter, `Coordinates`. The
table holds the errors on a grid of these, for both closure sets; ``python -m
benchmarks.suitability_table --write`` computes it. Between its entries logarithms are interpolated
linearly, and only where every entry around has an error.
"""

from __future__ import annotations

import functools
import itertools
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from os import PathLike
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from triboflux import closures
from triboflux.files import written_at_once
from triboflux.model_errors import CHEAPEST_FIRST, OK, WAVE_NUMBER, ModelError, ModelErrors
from triboflux.numbers import Numbers
from triboflux.radial_distribution import carnahan_starling
from triboflux.rates import scaled_rates

Axes: TypeAlias = tuple[NDArray[np.float64], ...]

FILE = "model_errors.npz"
"""Beside this module."""

RESTITUTION = 0.9
"""Of every entry; other values only matter through the coordinates, see docs/suspension.md."""

OUT_OF_TABLE = "outside the table"
"""Status of a case whose coordinates no entries enclose."""
BESIDE = "beside entries without error"
"""Status of a case, or a model, next to entries that have no error."""
IMPOSSIBLE = "no such suspension"
"""Status of an entry that no suspension has."""

RESOLUTION = 1000.0
"""Steps of a stored logarithm per decade."""


class Coordinates(NamedTuple):
    """What decides which model suits a suspension, all dimensionless.

    Attributes
    ----------
    lag : float
        2π/R: relaxation time of the covariance over the time to cross a wave.
    energy_ratio : float
        u, electric over kinetic energy.
    exchange : float
        R/(4π² τ_ξ): time in which charge disperses over that of its exchange in collisions.
    drag : float
        R (without its part by charge exchange) over that of the same collisions without drag and
        at the table's restitution and radial distribution, which also scales the field production.
    solid_fraction : float
        α.
    """

    lag: float
    energy_ratio: float
    exchange: float
    drag: float
    solid_fraction: float


class _Axis(NamedTuple):
    """How the table treats one of the `Coordinates`.

    Attributes
    ----------
    label : str
        Its name in a sentence.
    below, above : bool
        Whether below the first and above the last value nothing depends on it any longer.
    falls : bool
        Whether the ways of `_corners` go down along it.
    """

    label: str
    below: bool = True
    above: bool = False
    falls: bool = False


_DRAG = _Axis("the drag", above=True, falls=True)
_AXES = (
    _Axis("2 pi/R"),
    _Axis("energy_ratio"),
    _Axis("the exchange rate R/(4 pi^2 tau_xi)", falls=True),
    _DRAG,
    _Axis("solid_fraction"),
)
_LEAST_DRAG = 0.7
_ROUND_OFF = 1e-9


def coordinates(numbers: Numbers, closure_name: str = "derived") -> Coordinates:
    """Return the coordinates of a suspension in the table.

    Parameters
    ----------
    numbers : Numbers
        Of a suspension; solid fraction and radial distribution follow from them.
    closure_name : str
        One of `triboflux.closures.NAMES`.

    Raises
    ------
    InputError
        If the closure set is unknown.
    """
    closure_set = closures.by_name(closure_name, numbers.restitution)
    rates = scaled_rates(closure_set, numbers)
    fraction = numbers.peclet / (6.0 * numbers.tau_sigma * numbers.length_ratio**2)
    contact = math.sqrt(math.pi) / (24.0 * numbers.length_ratio * numbers.tau_c * fraction)
    exchanged = closure_set["covariance_exchange"] * rates.charge_exchange
    per_collision = (rates.covariance_destruction - exchanged) * numbers.tau_c
    own = per_collision * contact / max(numbers.restitution, 1e-300)
    return Coordinates(
        lag=WAVE_NUMBER / rates.covariance_destruction,
        energy_ratio=numbers.energy_ratio,
        exchange=rates.charge_exchange * rates.covariance_destruction / WAVE_NUMBER**2,
        drag=own / _without_drag(closure_name, fraction),
        solid_fraction=fraction,
    )


def _without_drag(closure_name: str, solid_fraction: float) -> float:
    """Return R τ_c g0/e by collisions of the table's particles."""
    destruction = closures.by_name(closure_name, RESTITUTION)["covariance_collision"]
    return destruction * carnahan_starling(solid_fraction) / RESTITUTION


def numbers_at(place: Coordinates, closure_name: str = "derived") -> Numbers | None:
    """Return the numbers of the table's suspension at given coordinates, None if there is none.

    Parameters
    ----------
    place : Coordinates
        `coordinates` of the returned numbers.
    closure_name : str
        One of `triboflux.closures.NAMES`.

    Raises
    ------
    InputError
        If the closure set is unknown, or a number leaves the range of `Numbers`.
    """
    closure_set = closures.by_name(closure_name, RESTITUTION)
    destruction = WAVE_NUMBER / place.lag
    exchange = place.exchange * WAVE_NUMBER**2 / destruction
    velocity_change = destruction - closure_set["covariance_exchange"] * exchange
    if not velocity_change > 0.0:
        return None
    tau_c = place.drag * closure_set["covariance_collision"] / velocity_change
    drag_rate = velocity_change * (1.0 - 1.0 / place.drag)
    contact = carnahan_starling(place.solid_fraction)
    diameter = 24.0 * contact * place.solid_fraction * tau_c / math.sqrt(math.pi)
    peclet = 1.0 / (diameter**2 * exchange * closure_set["exchange_time"])
    return Numbers(
        peclet=peclet,
        tau_c=tau_c,
        tau_p=1.0 / drag_rate if drag_rate > 0.0 else math.inf,
        tau_sigma=peclet * diameter**2 / (6.0 * place.solid_fraction),
        energy_ratio=place.energy_ratio,
        length_ratio=1.0 / diameter,
        restitution=RESTITUTION,
    )


@dataclass(frozen=True)
class Entries:
    """The entries of one closure set.

    Attributes
    ----------
    axes : tuple of array
        Increasing values along each of the `Coordinates`.
    logarithm : array of int
        log10 of the error in steps of 1/`RESOLUTION`, by model and `Coordinates`; 0 where the
        status is not ``"ok"``.
    status : array of int
        Index into `ModelTable.statuses`: that of the full model where nothing can be judged, else
        that of the reduced one.
    """

    axes: Axes
    logarithm: NDArray[np.int16]
    status: NDArray[np.uint8]


@dataclass(frozen=True)
class ModelTable:
    """The errors of `CHEAPEST_FIRST` on a grid of coordinates.

    Attributes
    ----------
    entries : mapping of str to Entries
        By closure set.
    statuses : tuple of str
        What a status means; the first is ``"ok"``.
    spread : mapping of str to mapping of str to float
        By closure set and model: the factor within which 19 of 20 interpolated errors were when
        it was set.
    about : mapping of str to object
        Measure, command, versions and how exact the table was found to be.
    """

    entries: Mapping[str, Entries]
    statuses: tuple[str, ...]
    spread: Mapping[str, Mapping[str, float]]
    about: Mapping[str, Any]

    def interpolated(self, place: Coordinates, closure_name: str) -> ModelErrors:
        """Return the errors at given coordinates.

        Parameters
        ----------
        place : Coordinates
            Anywhere; outside there are no errors but where they no longer depend on a coordinate.
        closure_name : str
            One of `triboflux.closures.NAMES`.
        """
        if closure_name not in self.entries:
            return ModelErrors(OUT_OF_TABLE, f"it has no runs with the {closure_name} closures")
        entries = self.entries[closure_name]
        outside = _outside(place, entries.axes)
        if outside:
            return ModelErrors(OUT_OF_TABLE, outside)
        corners = _corners(place, entries.axes)
        found: list[ModelError] = []
        for number, model in enumerate(CHEAPEST_FIRST):
            codes = {int(entries.status[(number, *index)]) for index, _ in corners}
            around = {self.statuses[code] for code in codes}
            if around != {OK}:
                without = ", ".join(sorted(around - {OK}))
                alike = len(around) == 1
                found.append(ModelError(model, without if alike else f"{BESIDE} ({without})"))
                continue
            steps = sum(weight * int(entries.logarithm[(number, *i)]) for i, weight in corners)
            error = 10.0 ** (steps / RESOLUTION)
            factor = self.spread[closure_name][model]
            found.append(ModelError(model, OK, error, error / factor, error * factor))
        if all(model.error is None for model in found):
            return ModelErrors(BESIDE, f"the case is {BESIDE}, {found[0].status}")
        return ModelErrors(OK, models=tuple(found))

    def save(self, path: str | PathLike[str]) -> None:
        """Write the table, all of it or nothing; the same table gives the same bytes.

        Parameters
        ----------
        path : path-like
            The file, which is replaced.

        Raises
        ------
        InputError
            If its folder does not exist.
        """
        arrays: dict[str, NDArray[Any]] = {}
        for name, entries in self.entries.items():
            for coordinate, values in zip(Coordinates._fields, entries.axes, strict=True):
                arrays[f"{name}_{coordinate}"] = values
            arrays[f"{name}_logarithm"] = entries.logarithm
            arrays[f"{name}_status"] = entries.status
        texts = {"statuses": self.statuses, "spread": self.spread, "about": self.about}
        arrays["texts"] = np.array(json.dumps(texts))
        with written_at_once(path, overwrite=True) as partial, partial.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, **arrays)


@functools.cache
def load() -> ModelTable:
    """Return the table that comes with the package."""
    with (resources.files("triboflux") / FILE).open("rb") as file, np.load(file) as arrays:
        texts = json.loads(str(arrays["texts"]))
        return ModelTable(
            entries={
                name: Entries(
                    tuple(arrays[f"{name}_{field}"] for field in Coordinates._fields),
                    arrays[f"{name}_logarithm"],
                    arrays[f"{name}_status"],
                )
                for name in texts["spread"]
            },
            statuses=tuple(texts["statuses"]),
            spread=texts["spread"],
            about=texts["about"],
        )


def _outside(place: Coordinates, axes: Axes) -> str:
    """Return a sentence about the first coordinate that a table does not reach."""
    for value, axis, kind in zip(place, axes, _AXES, strict=True):
        first, last = float(axis[0]), float(axis[-1])
        if (value < first and not kind.below) or (value > last and not kind.above):
            return f"{kind.label} is {value:.3g}, and the table goes from {first:.3g} to {last:.3g}"
    if place.drag < _LEAST_DRAG:
        return f"{_DRAG.label} is {place.drag:.3g}, and the table begins at 1"
    return ""


def _corners(place: Coordinates, axes: Axes) -> list[tuple[tuple[int, ...], float]]:
    """Return index and weight of the entries among which to interpolate.

    They are the corners of the simplex that contains the place, when a cell is divided into those
    whose corners lie on the ways along its edges from one corner to the opposite one. The ways
    go up in some coordinates and down in others, such that γΘ^(a/2), which grows with the square of
    the lag, the exchange and the drag, varies little: so few corners are out of range.
    """
    index: list[int] = []
    steps: list[int] = []
    parts: list[float] = []
    for value, axis, kind in zip(place, axes, _AXES, strict=True):
        inside = min(max(value, float(axis[0])), float(axis[-1]))
        right = min(max(int(np.searchsorted(axis, inside)), 1), len(axis) - 1)
        low, high = math.log(axis[right - 1]), math.log(axis[right])
        part = (math.log(inside) - low) / (high - low)
        index.append(right if kind.falls else right - 1)
        steps.append(-1 if kind.falls else 1)
        parts.append(1.0 - part if kind.falls else part)
    order = sorted(range(len(parts)), key=lambda i: -parts[i])
    bounds = [1.0, *(parts[i] for i in order), 0.0]
    corners: list[tuple[tuple[int, ...], float]] = []
    for number, (before, after) in enumerate(itertools.pairwise(bounds)):
        if number:
            index[order[number - 1]] += steps[order[number - 1]]
        if before - after > _ROUND_OFF:
            corners.append((tuple(index), before - after))
    return corners
