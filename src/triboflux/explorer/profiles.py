"""What the page draws of a run: profiles along a line, and the budget at one time, as arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from triboflux.case_checks import DIMENSION_NAMES
from triboflux.comparison import FIELDS
from triboflux.fields import labels_of

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from xarray import DataArray

    from triboflux.compare_figure import Section
    from triboflux.result import Result

SYMBOLS = {"charge": "Q", "field": "E", "covariance": "C", "variance": "V"}
"""Letters of the profiles, in the paper's notation."""


def line_of(result: Result) -> Section:
    """Return the line through the largest charge at the last time, along which profiles are."""
    from triboflux.compare_figure import section  # imports Matplotlib

    return section(result.dataset["charge"].isel(time=-1))


def panels(result: Result) -> list[dict[str, str]]:
    """Return what the panels show, with the units of a result."""
    si = result.units == "si"
    told: list[dict[str, str]] = []
    for name in FIELDS:
        labels = labels_of(name, si=si)
        unit = labels["units"] if si else labels["scale"]
        told.append(
            {"name": name, "symbol": SYMBOLS[name], "title": labels["long_name"], "unit": unit}
        )
    return told


def positions(result: Result, line: Section) -> NDArray[np.float64]:
    """Return positions along the line from -1/2 to 1/2 of the box, in the result's units."""
    x = result.dataset[line.axis].values
    length = float(x[1] - x[0]) * x.size
    return np.roll(np.where(x < length / 2.0, x, x - length), x.size // 2)


def frames(result: Result, line: Section, times: NDArray[np.float64]) -> dict[str, Any]:
    """Return the profiles of a result at some times.

    Parameters
    ----------
    result : Result
        Scaled or in SI.
    line : Section
        From `line_of` of the reference.
    times : array
        Of the page; nan stands where the result has no such time.

    Returns
    -------
    dict
        A float32 array of shape ``(times, points)`` for each of `FIELDS` that the result has.
    """
    dataset = result.dataset
    own = dataset["time"].values
    found = np.clip(np.searchsorted(own, times * (1.0 - 1e-12)), 0, own.size - 1)
    missing = ~np.isclose(own[found], times, rtol=1e-9, atol=0.0)
    shown: dict[str, Any] = {}
    for name in FIELDS:
        if name not in dataset:
            continue
        values = _along(dataset[name], line)[found]
        values = np.roll(values, values.shape[1] // 2, axis=1)
        values[missing] = np.nan
        # JavaScript draws them; what is beyond its single precision is no number that can be drawn
        with np.errstate(over="ignore", under="ignore"):
            shown[name] = values.astype(np.float32)
    return shown


def _along(values: DataArray, line: Section) -> NDArray[np.float64]:
    """Return a variable over time and the line."""
    if "component" in values.dims:
        values = values.isel(component=DIMENSION_NAMES.index(line.axis))
    return np.array(values.isel(line.place, drop=True).values)


def budget_of(result: Result, line: Section, time: float) -> dict[str, Any]:
    """Return the terms of each equation of a model at one time, along the line.

    Parameters
    ----------
    result : Result
        Scaled or in SI.
    line : Section
        From `line_of` of the reference.
    time : float
        One of the result's times, in its units.

    Returns
    -------
    dict
        ``time``, and ``equations``: for each moment its terms with name, equation number, values
        along the line and the largest absolute one, scaled.
    """
    from triboflux.diagnostics import budget  # imports JAX

    found = budget(result, time)
    equations: list[dict[str, Any]] = []
    for moment in found.data_vars:
        values = found[moment]
        if "component" in values.dims:
            values = values.isel(component=DIMENSION_NAMES.index(line.axis))
        # of the time derivative, too, which is their sum
        along = np.array(values.isel(line.place, drop=True).values)
        along = np.roll(along, along.shape[1] // 2, axis=1)
        terms = [
            {
                "name": str(name),
                "equation": str(equation),
                "values": row.astype(np.float32),
                "largest": float(np.abs(row).max()),
            }
            for name, equation, row in zip(
                found[f"{moment}_term"].values,
                found[f"{moment}_equation"].values,
                along,
                strict=True,
            )
        ]
        total = along.sum(axis=0)
        rate = {
            "name": "sum: rate of change",
            "equation": "",
            "values": total.astype(np.float32),
            "largest": float(np.abs(total).max()),
        }
        equations.append({"moment": str(moment), "terms": [rate, *terms]})
    return {"time": time, "model": result.case.model, "equations": equations}
