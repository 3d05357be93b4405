"""Maps of errors made up for tests, and the chart's case on few points."""

import numpy as np
import xarray as xr

from triboflux.case import Case
from triboflux.suitability import MEASURE, OUTSIDE, chart_case
from triboflux.sweep_values import put

PECLET, TAU_C = [1e4, 1e6, 1e7], [1e-3, 1e-2, 1e-1]
AXES = (("numbers.peclet", PECLET), ("numbers.tau_c", TAU_C))


def small(**changes):
    """Return the chart's case on few points, with ``a__b=value`` for changes in tables."""
    tables = chart_case("published").model_dump()
    for key, value in ({"grid__points": (32,)} | changes).items():
        put(tables, key.replace("__", "."), value)
    return Case(**tables)


def pretended(error, status=None, axes=AXES, **changes):
    """Return a map with given errors; status follows from them."""
    error = np.asarray(error, dtype=float)
    if status is None:
        status = np.where(np.isnan(error), OUTSIDE, "ok").astype(object)
    names = [key.rpartition(".")[2] for key, _ in axes]
    coordinates = {
        name: (name, np.asarray(values), {"parameter": key})
        for name, (key, values) in zip(names, axes, strict=True)
    }
    attributes = {
        "reduced": "semi-algebraic",
        "reference": "full",
        "closures": "published",
        "measure": MEASURE,
        "case": small(**changes).to_toml(),
        "versions": "{}",
    }
    texts = np.asarray(status, dtype=object)
    variables = {
        "error": (names, error),
        "stop_time": (names, error),
        "status": (names, texts),
        "reason": (names, texts),
    }
    return xr.Dataset(variables, coordinates, attributes)


def smooth(count=9):
    """Return a map whose error is 0.05 where tau_c is 1e-2."""
    tau_c = np.logspace(-4, 0, count)
    error = np.tile(0.05 * (tau_c / 1e-2), (count, 1))
    axes = ("numbers.peclet", np.logspace(2, 8, count)), ("numbers.tau_c", tau_c)
    return error, axes
