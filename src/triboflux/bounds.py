"""The bounds that a state must not break while it is integrated."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from triboflux.calculus import FourierCalculus
from triboflux.grid import Grid
from triboflux.models.model import Model
from triboflux.moments import Moments
from triboflux.realizability import realizability_margin

Scalar: TypeAlias = float | Float[Array, ""]


def broken_bounds(
    model: Model, coefficients: Moments, grid: Grid, realizability_bound: Scalar | None
) -> dict[str, Bool[Array, ""]]:
    """Return which bounds a state breaks already, by the name of the rule.

    Parameters
    ----------
    model : Model
        Whose limits are bounds.
    coefficients : Moments
        The state.
    grid : Grid
        Where it lives.
    realizability_bound : Scalar or None
        See `triboflux.integrate.Settings`.
    """
    margins = bounds(model, grid, realizability_bound)
    return {name: margin(coefficients) <= 0.0 for name, margin in margins.items()}


def bounds(
    model: Model, grid: Grid, realizability_bound: Scalar | None
) -> dict[str, Callable[[Moments], Array]]:
    """Return functions of the state that have to stay positive.

    Parameters
    ----------
    model, grid, realizability_bound
        As for `broken_bounds`.
    """
    calculus = FourierCalculus(grid)
    found: dict[str, Callable[[Moments], Array]] = {}
    if model.limits:
        found["nonphysical"] = lambda y: model.margin(calculus, y)
    if realizability_bound is not None:

        def margin(y: Moments) -> Array:
            fields = model.fields(calculus, y)
            tensor = fields.granular_temperature_tensor
            margins = realizability_margin(fields.covariance, fields.variance, tensor)
            return realizability_bound + jnp.min(margins)

        found["unrealizable"] = margin
    return found
