"""What the paper says about Fig. 9 beside what is measured on the maps."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from triboflux.figures.cases import MAP
from triboflux.figures.chart import LEVELS, PAPER_CASES, reasons
from triboflux.figures.findings import PERFECT, Finding, Statement, each, percent
from triboflux.figures.measures import distances, limit_at, limits, nearest, suitable_until
from triboflux.suitability import OUTSIDE

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

FLAT = 0.2
"""Relative change of a collision time up to which it is called constant over decades of Pe."""

USELESS = 0.1
"""Error from which a model is called no alternative, and largest level of the chart's lines."""

_HIGH = (1e6, 1e7, 1e8)
_DECADES = (1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8)
_STATUS = {OUTSIDE: "F ≤ 0"}
_FIGURES = {"A": 7, "B": 8}


def of_the_regions(data: dict[int, Any]) -> list[Statement]:
    """Return what the paper says about Fig. 9 with what was measured.

    Parameters
    ----------
    data : dict
        What was computed for Figs. 7, 8 and 9, by number.
    """
    maps: dict[str, xr.Dataset] = data[MAP]

    def cases(closures: str) -> Finding:
        found = {
            name: distances(*_reduced_and_full(data[figure][closures]))["charge"].mean_square
            for name, figure in _FIGURES.items()
        }
        told = [
            f"{name} {percent(error)} (Fig. {_FIGURES[name]}; nearest point of the map "
            f"{_error_of(nearest(maps[closures], PAPER_CASES[name]))})"
            for name, error in found.items()
        ]
        return Finding(found["A"] <= PERFECT and found["B"] > USELESS, ", ".join(told))

    criterion = f"error of Q at t* up to {percent(PERFECT)}, and above {percent(USELESS)}"
    return [
        each(f"Case A is in the suitable region, case B is not (agrees: {criterion}).", cases),
        each(
            "For high Pe only the collision time matters (agrees if from Pe = 10⁶ on the τ_c* of "
            f"the error {percent(USELESS)} changes by less than {percent(FLAT)}).",
            lambda closures: _high(maps[closures]),
        ),
        each(
            "As Pe falls, the collision time must be smaller (agrees if every line of equal error "
            f"is lower by more than {percent(FLAT)} at its left end than at its right end; given "
            "are both ends and the highest point).",
            lambda closures: _direction(maps[closures]),
        ),
        each(
            "Not discussed: where F ≤ 0 the charge variance would grow by itself; there the map "
            "has no error, and the lines of equal error end.",
            lambda closures: _outside(maps[closures]),
        ),
        each(
            f"Not given: the largest τ_c* of the map with F > 0 and an error up to "
            f"{percent(USELESS)}. Where the line of {percent(USELESS)} has ended, on its left, "
            "this falls with Pe because of F > 0 alone.",
            lambda closures: _region(maps[closures]),
        ),
    ]


def _high(errors: xr.Dataset) -> Finding:
    values = np.array([limit_at(errors, USELESS, peclet) for peclet in _HIGH])
    told = ", ".join(
        f"{value:.3g} at {_power(peclet)}" for value, peclet in zip(values, _HIGH, strict=True)
    )
    return Finding(bool(values.max() <= (1.0 + FLAT) * values.min()), f"τ_c* = {told}")


def _direction(errors: xr.Dataset) -> Finding:
    lines = {level: limits(errors, level) for level in LEVELS}
    ends = [line[np.isfinite(line)][[0, -1]] for line in lines.values() if _exists(line)]
    falls = bool(ends) and all(first < (1.0 - FLAT) * last for first, last in ends)
    peclet = errors["peclet"].values
    return Finding(falls, "; ".join(_told(level, peclet, lines[level]) for level in lines))


def _outside(errors: xr.Dataset) -> Finding:
    status, size = reasons(errors), errors["error"].size
    told = ", ".join(f"{count} {_STATUS.get(name, name)}" for name, count in status.items())
    share = sum(status.values()) / size
    return Finding(None, f"{told or 'none'} of {size} points ({100 * share:.0f} %)")


def _region(errors: xr.Dataset) -> Finding:
    largest = suitable_until(errors, USELESS)
    peclet = errors["peclet"].values
    chosen = sorted({int(np.abs(np.log(peclet / decade)).argmin()) for decade in _DECADES})
    told = [f"{largest[i]:.2g} at Pe = {peclet[i]:.2g}" for i in chosen]
    return Finding(None, f"τ_c* = {', '.join(told)}")


def _reduced_and_full(comparison: Any) -> tuple[Any, Any]:
    return comparison.reduced, comparison.full


def _error_of(point: xr.Dataset) -> str:
    """Return the error of a point, or why it has none."""
    status = str(point["status"].values)
    return percent(float(point["error"])) if status == "ok" else _STATUS.get(status, status)


def _exists(line: NDArray[np.float64]) -> bool:
    return bool(np.isfinite(line).any())


def _told(level: float, peclet: NDArray[np.float64], line: NDArray[np.float64]) -> str:
    """Return where a line of equal error begins, is highest and ends."""
    if not _exists(line):
        return f"{percent(level)}: no line"
    there = np.flatnonzero(np.isfinite(line))
    places = dict.fromkeys((there[0], there[line[there].argmax()], there[-1]))
    points = ", ".join(f"{line[i]:.3g} at Pe = {peclet[i]:.2g}" for i in places)
    return f"{percent(level)}: τ_c* = {points}"


def _power(value: float) -> str:
    """Return a power of ten."""
    digits = str(round(np.log10(value))).translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"Pe = 10{digits}"
