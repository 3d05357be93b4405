"""What of a particle is averaged over sampled collisions: ψ of its velocity and its charge.

Velocities have shape ``(3, samples)``. A charge with leading axes stands for one on each axis, or
for one on each pair of axes, each with the ψ of that axis or pair; these are then summed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Observable: TypeAlias = Callable[[Array, Array], Array]


def charge(_: Array, charge: Array) -> Array:
    """Return ξ."""
    return charge


def square(_: Array, charge: Array) -> Array:
    """Return ξξ."""
    return charge**2


def covariance(velocity: Array, charge: Array) -> Array:
    """Return the sum of ξ_i c_i over the axes."""
    return np.sum(charge * velocity, axis=0)


def third_trace(velocity: Array, charge: Array) -> Array:
    """Return the trace of ξ (c_i c_j − δ_ij)."""
    return charge * (np.sum(velocity**2, axis=0) - 3.0)


def third_product(velocity: Array, charge: Array) -> Array:
    """Return the sum of ξ_ij (c_i c_j − δ_ij)."""
    product: Array = np.einsum("ijs,is,js->s", charge, velocity, velocity)
    return product - np.trace(charge)
