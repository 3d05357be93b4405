"""The dataset of a run: labelled fields and their provenance."""

from __future__ import annotations

import functools
import json
import platform
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib import metadata
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

import triboflux
from triboflux.case import Case
from triboflux.case_checks import DIMENSION_NAMES
from triboflux.fields import dimensions_of, labels_of
from triboflux.realizability import margin_of

FORMAT_VERSION = 1
"""Version of the file format; raised when older programs could not read newer files."""

CONVENTIONS = "CF-1.11"
"""Metadata conventions that a dataset follows; docs/results.md says how far."""

_PAPER = (
    "Montilla, Ansart & Simonin, Charge-velocity correlation transport equations in gas-solid "
    "flow with triboelectric effects, J. Fluid Mech. (2023)"
)
_PACKAGES = ("triboflux", "jax", "diffrax", "equinox", "numpy", "xarray", "netCDF4")


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that decide a result."""
    return {"python": platform.python_version(), **{name: _version(name) for name in _PACKAGES}}


# reading it from disk takes a millisecond, and a sweep asks again for each of its members
@functools.cache
def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        # run from its source folder
        return triboflux.__version__ if package == "triboflux" else "unknown"


def build_dataset(
    case: Case,
    times: ArrayLike,
    charge: ArrayLike,
    covariance: ArrayLike,
    field: ArrayLike,
    potential: ArrayLike,
    peak_charge: ArrayLike,
    *,
    variance: ArrayLike | None = None,
    status: str,
    stop_reason: str,
    stats: Mapping[str, Any],
    warnings: Sequence[str] = (),
    attributes: Mapping[str, str | int | float] | None = None,
    **further: ArrayLike,
) -> xr.Dataset:
    """Label the fields of a run and add its provenance.

    Parameters
    ----------
    case : Case
        What was run.
    times : array_like
        Shape ``(time,)``; the last is the stop time.
    charge, potential : array_like
        Shape ``(time, *points)``.
    covariance, field : array_like
        Shape ``(time, dimensions, *points)``.
    peak_charge : array_like
        Largest absolute charge in the box, shape ``(time,)``.
    variance : array_like, optional
        Shape ``(time, *points)``; without it the model knows none, and the dataset has neither it
        nor the margin of realizability.
    status, stop_reason : str
        How the run ended.
    stats : mapping
        Statistics of the run, such as numbers of steps; must be expressible as JSON.
    warnings : sequence of str
        Sentences that the user must be told.
    attributes : mapping, optional
        Further attributes of the dataset, such as the trace dimension of the closures.
    **further : array_like
        Further variables by their names in `triboflux.fields.FIELDS`, such as
        ``covariance_flux_xx``, shape ``(time, *points)``.

    Returns
    -------
    xarray.Dataset
        All arrays are doubles, dimensionless; ``scale`` names what each was divided by.

    Raises
    ------
    ValueError
        If shapes contradict each other.
    """
    arrays = {
        "charge": charge,
        "covariance": covariance,
        "field": field,
        "potential": potential,
        "peak_charge": peak_charge,
    }
    if variance is not None:
        arrays["variance"] = variance
        arrays["realizability_margin"] = margin_of(arrays | further, case.grid.dimensions)
    arrays |= further
    variables: dict[str, Any] = {}
    for name, values in arrays.items():
        dimensions = dimensions_of(name, case.grid.dimensions)
        variables[name] = (dimensions, np.asarray(values, dtype=np.float64), labels_of(name))
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return xr.Dataset(
        variables,
        coords=_coordinates(case, times),
        attrs={
            "Conventions": CONVENTIONS,
            "source": source_of(case, attributes or {}),
            "history": f"{now} written by triboflux {triboflux.__version__}",
            "references": _PAPER,
            **(attributes or {}),
            "title": case.title,
            "format_version": FORMAT_VERSION,
            "units": "scaled",
            "case_toml": case.to_toml(),
            "status": status,
            "stop_reason": stop_reason,
            **stats_and_warnings(stats, warnings),
            "versions_json": json.dumps(versions()),
            "created": now,
        },
    )


def source_of(case: Case, attributes: Mapping[Any, object]) -> str:
    """Return how data were made, in words.

    Parameters
    ----------
    case : Case
        What was run or simulated.
    attributes : mapping
        Of the dataset; ``method`` tells simulated particles.
    """
    if attributes.get("method") == "kinetic":
        return "simulation of charged particles"
    return f"{case.model} model, {case.closures} closures"


def stats_and_warnings(stats: Mapping[str, Any], warnings: Sequence[str]) -> dict[str, str]:
    """Return the attributes of a dataset that hold statistics and warnings."""
    return {
        "stats_json": json.dumps(dict(stats), default=_plain),
        "warnings_json": json.dumps(list(warnings)),
    }


def _plain(value: Any) -> Any:
    """Turn numpy and JAX numbers into what JSON knows."""
    return value.tolist()


def _coordinates(case: Case, times: ArrayLike) -> dict[str, Any]:
    """Return the labelled coordinates of a dataset."""
    coordinates: dict[str, Any] = {
        "time": ("time", np.asarray(times, dtype=np.float64), labels_of("time")),
        "component": (
            "component",
            np.arange(case.grid.dimensions),
            {"long_name": "vector component: 0 is x, 1 is y, 2 is z", "units": "1"},
        ),
    }
    grid = zip(DIMENSION_NAMES, case.grid.points, case.grid.lengths, strict=False)
    for name, points, length in grid:
        coordinates[name] = (name, np.arange(points) * (length / points), labels_of(name))
    return coordinates
