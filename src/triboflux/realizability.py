"""How far a state is from what no distribution of charges and velocities can have.

For every direction n the covariance obeys (C·n)² ≤ V n·R n, by Cauchy and Schwarz, where R_ij =
⟨c'_i c'_j⟩ is Θ δ_ij in models that hold the granular temperature fixed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from triboflux.fields import tensor_of
from triboflux.hierarchy import components

TENSOR = "granular_temperature_tensor"
"""The moment that replaces Θ δ_ij where a model evolves it."""


def realizability_margin(covariance: Any, variance: Any, tensor: Any = None) -> Any:
    """Return the variance minus the least that the covariance allows along its own direction.

    Parameters
    ----------
    covariance : array
        Shape ``[component, ...]``, scaled by Q0 √Θ.
    variance : array
        Shape ``[...]``, scaled by Q0².
    tensor : array, optional
        R_ij, shape ``[component, component, ...]``, scaled by Θ; the unit tensor by default.

    Returns
    -------
    array
        V − |C|⁴/(C·R C), which is V − C²/R_xx in one dimension; scaled by Q0². Negative where the
        state is impossible.
    """
    squared = (covariance**2).sum(axis=0)
    if tensor is None:
        return variance - squared
    along = (covariance[:, None] * tensor * covariance[None]).sum(axis=(0, 1))
    # where the covariance vanishes it bounds nothing
    share = squared / (along + (squared == 0.0))
    return variance - squared * share


def margin_of(fields: Mapping[str, Any], dimensions: int) -> np.ndarray:
    """Return the margin from the variables of a dataset.

    Parameters
    ----------
    fields : mapping
        With ``covariance[time, component, *x]``, ``variance[time, *x]`` and, if R_ij is evolved,
        its components.
    dimensions : int
        Of the box.

    Returns
    -------
    numpy.ndarray
        Shape ``[time, *x]``; see `realizability_margin`.
    """
    covariance = np.moveaxis(np.asarray(fields["covariance"]), 1, 0)
    known = set(components(TENSOR, dimensions)) <= fields.keys()
    tensor = tensor_of(fields, TENSOR, dimensions) if known else None
    return realizability_margin(covariance, np.asarray(fields["variance"]), tensor)
