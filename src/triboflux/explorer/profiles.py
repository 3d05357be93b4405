"""What the page draws of a run: profiles along a line, and the budget at one time, as arrays."""

from __future__ import annotations

from dataclasses import dataclass
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


@dataclass(frozen=True)
class Drawing:
    """Where and when the profiles of all models of a case are drawn.

    Attributes
    ----------
    reference : Result
        Of the reference, scaled or in SI.
    line : Section
        The line through its largest charge at the last time.
    times : array
        Its output times.
    """

    reference: Result
    line: Section
    times: NDArray[np.float64]

    @classmethod
    def of(cls, reference: Result) -> Drawing:
        """Return the drawing that a reference determines."""
        from triboflux.compare_figure import section  # imports Matplotlib

        charge = reference.dataset["charge"]
        return cls(reference, section(charge.isel(time=-1)), charge["time"].values)

    def told(self) -> dict[str, Any]:
        """Return times, positions from -1/2 to 1/2 of the box, and titles, for the page."""
        x = self.reference.dataset[self.line.axis].values
        length = float(x[1] - x[0]) * x.size
        centred = np.roll(np.where(x < length / 2.0, x, x - length), x.size // 2)
        return {
            "times": self.times.tolist(),
            "x": centred,
            "axis": self.line.axis,
            "panels": panels(self.reference),
            "units": self.reference.units,
        }

    def frames(self, result: Result) -> dict[str, Any]:
        """Return the profiles of a result at all times.

        Parameters
        ----------
        result : Result
            In the units of the reference.

        Returns
        -------
        dict
            A float32 array of shape ``(times, points)`` for each of `FIELDS` that the result has;
            nan where it has no such time.
        """
        own = result.dataset["time"].values
        found = np.clip(np.searchsorted(own, self.times * (1.0 - 1e-12)), 0, own.size - 1)
        missing = ~np.isclose(own[found], self.times, rtol=1e-9, atol=0.0)
        shown: dict[str, Any] = {}
        for name in FIELDS:
            if name in result.dataset:
                values = self._along(result.dataset[name])[found]
                values[missing] = np.nan
                shown[name] = values.astype(np.float32)
        return shown

    def _along(self, values: DataArray) -> NDArray[np.float64]:
        """Return a variable over time or terms and the line, of vectors the part along it."""
        if "component" in values.dims:
            values = values.isel(component=DIMENSION_NAMES.index(self.line.axis))
        along = np.array(values.isel(self.line.place, drop=True).values)
        return np.roll(along, along.shape[1] // 2, axis=1)

    def budget(self, result: Result, time: float) -> dict[str, Any]:
        """Return the terms of each equation of a model at one time, along the line.

        Parameters
        ----------
        result : Result
            In the units of the reference.
        time : float
            One of its times.

        Returns
        -------
        dict
            ``time``, ``model``, and ``equations``: for each moment its terms with name, equation
            number, values along the line and the largest absolute one, scaled.
        """
        from triboflux.diagnostics import budget  # imports JAX

        found = budget(result, time)
        equations: list[dict[str, Any]] = []
        for moment in map(str, found.data_vars):
            values = self._along(found[moment])
            # all components of a tensor have the terms of its one equation
            axis = str(found[moment].dims[0])
            names = [str(name) for name in found[axis].values]
            numbers = [
                str(number) for number in found[f"{axis.removesuffix('_term')}_equation"].values
            ]
            terms = [
                {
                    "name": name,
                    "equation": number,
                    "values": row.astype(np.float32),
                    "largest": float(np.abs(row).max()),
                }
                for name, number, row in zip(
                    ["sum: rate of change", *names],
                    ["", *numbers],
                    # the terms add up to the time derivative
                    [values.sum(axis=0), *values],
                    strict=True,
                )
            ]
            equations.append({"moment": moment, "terms": terms})
        return {"time": time, "model": result.case.model, "equations": equations}
