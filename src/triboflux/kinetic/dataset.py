"""The dataset of a particle simulation: that of a model's result, and what only particles tell."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from triboflux.dataset import build_dataset
from triboflux.fields import ANCILLARY, STANDARD_ERROR, dimensions_of, labels_of

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from triboflux.case import Case


def dataset_of(
    case: Case,
    times: ArrayLike,
    records: Mapping[str, NDArray[np.float64]],
    **provenance: Any,
) -> xr.Dataset:
    """Label the moments of a simulation and add its provenance.

    Parameters
    ----------
    case : Case
        What was simulated.
    times : array_like
        Of the outputs.
    records : mapping of str to numpy.ndarray
        Each variable and, with the ending `triboflux.fields.STANDARD_ERROR`, its standard error, of
        shape ``(time, points)``, but ``(time,)`` for ``peak_charge``.
    **provenance
        Status, stop reason, statistics, warnings and attributes for `build_dataset`.

    Returns
    -------
    xarray.Dataset
        The variables of `build_dataset`, those of `triboflux.fields.PARTICLE_FIELDS`, and a
        standard error beside each. The margin of realizability is that of the measured
        temperature in the direction of the box.
    """
    shaped = {
        name: values[:, np.newaxis] if "component" in dimensions_of(name, 1) else values
        for name, values in records.items()
    }
    names = ("charge", "covariance", "field", "potential", "peak_charge", "variance")
    dataset = build_dataset(case, times, **{name: shaped[name] for name in names}, **provenance)
    more = {
        name: (dimensions_of(name, 1), values, labels_of(name))
        for name, values in shaped.items()
        if name not in names
    }
    whole = dataset.assign(more)
    for name in (name for name in records if f"{name}{STANDARD_ERROR}" in records):
        whole[name].attrs[ANCILLARY] = f"{name}{STANDARD_ERROR}"
    return whole
