"""Operators: what the terms of a model do to moments and products."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import jax.numpy as jnp
from jaxtyping import Array

from triboflux.calculus import Discretisation

Symbol: TypeAlias = Callable[[Array], Array]
"""|k| -> factor."""


@dataclass(frozen=True)
class Operator:
    """A linear, isotropic operator with constant coefficients.

    In Fourier space a vector C splits into the scalar ``c = i k·C/|k|`` and a transverse rest, and
    a symmetric tensor T, with n = k/|k|, into the scalar ``n·T n``, the transverse part of
    ``i T n``, and the traceless transverse rest (`triboflux.integrators.linear`). In terms of these
    every operator here is multiplication by a real number, one for each helicity.

    Attributes
    ----------
    name : str
        Mathematical notation.
    symbol : Callable
        |k| -> factor between scalar parts; at k = 0 it has to be finite.
    transverse : Callable
        |k| -> factor between transverse vectors.
    apply : Callable
        ``(discretisation, representation) -> representation``.
    traceless : Callable
        |k| -> factor between traceless transverse tensors.
    derivatives : int
        How many it takes.
    """

    name: str
    symbol: Symbol
    transverse: Symbol
    apply: Callable[[Discretisation, Array], Array]
    traceless: Symbol = jnp.zeros_like
    derivatives: int = 0

    @property
    def symbols(self) -> tuple[Symbol, ...]:
        """The factors by helicity: scalar parts, transverse vectors, traceless tensors."""
        return self.symbol, self.transverse, self.traceless


def _zero(k: Array) -> Array:
    return jnp.zeros_like(k)


def _rows(apply: Callable[[Array], Array], field: Array) -> Array:
    """Return what becomes of each component along the leading axis."""
    return jnp.stack([apply(row) for row in field])


def _symmetric_gradient(discretisation: Discretisation, vector: Array) -> Array:
    """Return ∂_i C_j + ∂_j C_i."""
    gradient = _rows(discretisation.gradient, vector)
    return gradient + jnp.swapaxes(gradient, 0, 1)


def _isotropic(scalar: Array, dimensions: int) -> Array:
    """Return s δ_ij."""
    zero, along = jnp.zeros_like(scalar), range(dimensions)
    return jnp.stack([jnp.stack([scalar if i == j else zero for j in along]) for i in along])


def _inverse(k: Array) -> Array:
    return jnp.where(k > 0.0, 1.0 / jnp.where(k > 0.0, k, 1.0), 0.0)


IDENTITY = Operator("1", jnp.ones_like, jnp.ones_like, lambda _, f: f, jnp.ones_like)
LAPLACIAN = Operator(
    "∇²",
    lambda k: -(k**2),
    lambda k: -(k**2),
    lambda d, f: d.laplacian(f),
    lambda k: -(k**2),
    derivatives=2,
)
GRADIENT = Operator("∇", lambda k: -k, _zero, lambda d, f: d.gradient(f), derivatives=1)
DIVERGENCE = Operator("∇·", lambda k: k, _zero, lambda d, f: d.divergence(f), derivatives=1)
GRADIENT_OF_DIVERGENCE = Operator(
    "∇∇·", lambda k: -(k**2), _zero, lambda d, f: d.gradient(d.divergence(f)), derivatives=2
)
ELECTRIC_FIELD = Operator("E", _inverse, _zero, lambda d, f: d.electric_field(f))
FIELD_DIVERGENCE = Operator(
    "∇·E",
    lambda k: jnp.where(k > 0.0, 1.0, 0.0),
    _zero,
    lambda d, f: d.without_mean(f),
    derivatives=1,
)
DIVERGENCE_OF_TENSOR = Operator(
    "∇·", lambda k: -k, lambda k: k, lambda d, f: _rows(d.divergence, f), derivatives=1
)
SYMMETRIC_GRADIENT = Operator(
    "∇ + ∇ᵀ", lambda k: 2.0 * k, lambda k: -k, _symmetric_gradient, derivatives=1
)
ISOTROPIC = Operator("δ", jnp.ones_like, _zero, lambda d, f: _isotropic(f, d.grid.dimensions))
ISOTROPIC_DIVERGENCE = Operator(
    "δ ∇·",
    lambda k: k,
    _zero,
    lambda d, f: _isotropic(d.divergence(f), d.grid.dimensions),
    derivatives=1,
)


def composed(outer: Operator, inner: Operator) -> Operator:
    """Return an operator after another.

    Parameters
    ----------
    outer, inner : Operator
        The second makes what the first acts on.
    """

    def after(left: Symbol, right: Symbol) -> Symbol:
        return lambda k: left(k) * right(k)

    return Operator(
        f"({outer.name}){inner.name}" if " + " in outer.name else f"{outer.name}{inner.name}",
        after(outer.symbol, inner.symbol),
        after(outer.transverse, inner.transverse),
        lambda d, f: outer.apply(d, inner.apply(d, f)),
        after(outer.traceless, inner.traceless),
        outer.derivatives + inner.derivatives,
    )


GRADIENT_OF_LAPLACIAN = composed(GRADIENT, LAPLACIAN)
HESSIANS = composed(SYMMETRIC_GRADIENT, GRADIENT)
ISOTROPIC_LAPLACIAN = composed(ISOTROPIC, LAPLACIAN)
FIELD_GRADIENTS = composed(SYMMETRIC_GRADIENT, ELECTRIC_FIELD)
ISOTROPIC_CHARGE = composed(ISOTROPIC, FIELD_DIVERGENCE)

DIVERGENCES = {
    operator: composed(DIVERGENCE, operator)
    for operator in (
        LAPLACIAN,
        GRADIENT,
        GRADIENT_OF_DIVERGENCE,
        GRADIENT_OF_LAPLACIAN,
        DIVERGENCE_OF_TENSOR,
    )
}
"""The divergence of what an operator makes."""


def _of_products(name: str, apply: Callable[[Discretisation, Array], Array]) -> Operator:
    """Return an operator of first order for products, which the linear terms have no need of."""
    return Operator(name, _zero, _zero, apply, derivatives=1)


DIVERGENCE_OF_THIRD = _of_products(
    "∇·", lambda d, f: _rows(lambda row: _rows(d.divergence, row), f)
)
"""Of a tensor of rank three, over its last direction; only products are of that rank."""
GRADIENT_OF_VECTOR = _of_products("∇", lambda d, f: _rows(d.gradient, f))
"""∂_j C_i at row i, column j, for products to read."""
GRADIENT_OF_TENSOR = _of_products("∇", lambda d, f: _rows(lambda row: _rows(d.gradient, row), f))
"""∂_k R_ij at i, j, k, for products to read."""
GRADIENT_OF_TENSOR_DIVERGENCE = composed(SYMMETRIC_GRADIENT, DIVERGENCE_OF_TENSOR)
ISOTROPIC_DOUBLE_DIVERGENCE = composed(ISOTROPIC_DIVERGENCE, DIVERGENCE_OF_TENSOR)

TRACES = {
    IDENTITY: (IDENTITY, 1.0),
    LAPLACIAN: (LAPLACIAN, 1.0),
    SYMMETRIC_GRADIENT: (DIVERGENCE, 2.0),
    ISOTROPIC: (IDENTITY, 3.0),
    ISOTROPIC_DIVERGENCE: (DIVERGENCE, 3.0),
    HESSIANS: (DIVERGENCES[GRADIENT], 2.0),
    ISOTROPIC_LAPLACIAN: (LAPLACIAN, 3.0),
    FIELD_GRADIENTS: (FIELD_DIVERGENCE, 2.0),
    ISOTROPIC_CHARGE: (FIELD_DIVERGENCE, 3.0),
    GRADIENT_OF_TENSOR_DIVERGENCE: (DIVERGENCES[DIVERGENCE_OF_TENSOR], 2.0),
    ISOTROPIC_DOUBLE_DIVERGENCE: (DIVERGENCES[DIVERGENCE_OF_TENSOR], 3.0),
}
"""Operator and factor that make the trace over three dimensions of what an operator makes.

Of the identity and of ∇² on a tensor they are the same on its trace.
"""

FLUXES = {
    LAPLACIAN: (DIVERGENCE, GRADIENT),
    DIVERGENCE: (DIVERGENCE, IDENTITY),
    FIELD_DIVERGENCE: (DIVERGENCE, ELECTRIC_FIELD),
    **{whole: (DIVERGENCE, inner) for inner, whole in DIVERGENCES.items()},
}
"""The outer and the inner derivative of operators that conserve a scalar.

Between both stands a coefficient that depends on place.
"""
