"""Terms: the pieces that a model's equations are the sum of.

A term is ``coefficient * operator(source)`` added to the time derivative of one moment. The source
is a moment, which makes the term linear, or a pointwise product of fields. The exponential
integrator takes the linear terms by the symbols of their operators and the products explicitly; the
finite-difference scheme, the budgets and the documentation read the same list.
"""

from __future__ import annotations

import functools as ft
from collections.abc import Callable
from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from triboflux.calculus import Discretisation
from triboflux.hierarchy import RANKS
from triboflux.moments import Moments


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
    """

    name: str
    symbol: Callable[[Array], Array]
    transverse: Callable[[Array], Array]
    apply: Callable[[Discretisation, Array], Array]
    traceless: Callable[[Array], Array] = jnp.zeros_like

    @property
    def symbols(self) -> tuple[Callable[[Array], Array], ...]:
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
)
GRADIENT = Operator("∇", lambda k: -k, _zero, lambda d, f: d.gradient(f))
DIVERGENCE = Operator("∇·", lambda k: k, _zero, lambda d, f: d.divergence(f))
GRADIENT_OF_DIVERGENCE = Operator(
    "∇∇·", lambda k: -(k**2), _zero, lambda d, f: d.gradient(d.divergence(f))
)
ELECTRIC_FIELD = Operator("E", _inverse, _zero, lambda d, f: d.electric_field(f))
FIELD_DIVERGENCE = Operator(
    "∇·E", lambda k: jnp.where(k > 0.0, 1.0, 0.0), _zero, lambda d, f: d.without_mean(f)
)
DIVERGENCE_OF_TENSOR = Operator(
    "∇·", lambda k: -k, lambda k: k, lambda d, f: _rows(d.divergence, f)
)
SYMMETRIC_GRADIENT = Operator("∇ + ∇ᵀ", lambda k: 2.0 * k, lambda k: -k, _symmetric_gradient)
ISOTROPIC = Operator("δ", jnp.ones_like, _zero, lambda d, f: _isotropic(f, d.grid.dimensions))
ISOTROPIC_DIVERGENCE = Operator(
    "δ ∇·", lambda k: k, _zero, lambda d, f: _isotropic(d.divergence(f), d.grid.dimensions)
)

TRACES = {
    IDENTITY: (IDENTITY, 1.0),
    SYMMETRIC_GRADIENT: (DIVERGENCE, 2.0),
    ISOTROPIC: (IDENTITY, 3.0),
    ISOTROPIC_DIVERGENCE: (DIVERGENCE, 3.0),
}
"""Operator and factor that make the trace over three dimensions of what an operator makes.

Of the identity on a tensor it is the identity on its trace.
"""


@dataclass(frozen=True)
class Product:
    """A pointwise product of fields.

    Attributes
    ----------
    name : str
        Mathematical notation.
    reads : tuple of str
        Names of the fields it multiplies, see `fields_of`.
    function : Callable
        Values of these fields on the points, then the term's parameters -> values of the product.
    """

    name: str
    reads: tuple[str, ...]
    function: Callable[..., Array]


def dot(left: Float[Array, "d *x"], right: Float[Array, "d *x"]) -> Float[Array, "*x"]:
    """Return the scalar product of two vector fields.

    Written out, because the compiler makes a sum over an axis a pass of its own over the points.
    """
    return ft.reduce(lambda a, b: a + b, (x * y for x, y in zip(left, right, strict=True)))


class Term(eqx.Module):
    """One named contribution to the time derivative of one moment.

    Attributes
    ----------
    name : str
        Unique within the equation of its moment.
    group : str
        Heading under which Figs. 4-5 of the paper plot it.
    equation : str
        Equation number of the paper.
    moment : str
        A name of `triboflux.hierarchy.RANKS`: whose time derivative it adds to.
    operator : Operator
        Applied to the source.
    source : str or Product
        A moment's name for a linear term, a product otherwise.
    coefficient : float or Array
        Dimensionless factor, sign included.
    parameters : tuple of float or Array
        What the function of a product needs beside fields, dimensionless.
    """

    name: str = eqx.field(static=True)
    group: str = eqx.field(static=True)
    equation: str = eqx.field(static=True)
    moment: str = eqx.field(static=True)
    operator: Operator = eqx.field(static=True)
    source: str | Product = eqx.field(static=True)
    coefficient: float | Float[Array, ""]
    parameters: tuple[float | Float[Array, ""], ...] = ()

    @property
    def linear(self) -> bool:
        """Whether the exponential integrator treats the term exactly."""
        return isinstance(self.source, str)


DERIVED_FIELDS = ("charge_gradient", "electric_field", "variance_gradient")
"""Vectors that products can read besides the moments."""


def fields_of(
    discretisation: Discretisation, state: Moments, names: tuple[str, ...]
) -> list[Array]:
    """Return values on the points of the named fields, transformed in one batch.

    Parameters
    ----------
    discretisation : Discretisation
        Where the state lives.
    state : Moments
        In the representation of the discretisation.
    names : tuple of str
        Moments, or among `DERIVED_FIELDS`.
    """
    derived = {
        "charge_gradient": lambda: discretisation.gradient(state.charge),
        "electric_field": lambda: discretisation.electric_field(state.charge),
        "variance_gradient": lambda: discretisation.gradient(state.variance),
    }
    parts = [derived[n]() if n in derived else getattr(state, n) for n in names]
    ranks = [1 if n in derived else RANKS[n] for n in names]
    rows = [
        part[None] if rank == 0 else part.reshape((-1, *part.shape[rank:]))
        for part, rank in zip(parts, ranks, strict=True)
    ]
    values = discretisation.values(jnp.concatenate(rows))
    results, at = [], 0
    for part, rank, row in zip(parts, ranks, rows, strict=True):
        piece = values[at : at + len(row)]
        results.append(piece.reshape((*part.shape[:rank], *piece.shape[1:])))
        at += len(row)
    return results


def evaluate(terms: tuple[Term, ...], discretisation: Discretisation, state: Moments) -> Moments:
    """Return the sum of terms in the representation of the discretisation.

    The fields that the products read are brought to the points in one batch, and so are the
    products back; this is where the transforms of a pseudo-spectral step are spent.

    Parameters
    ----------
    terms : tuple of Term
        Any subset of a model's terms.
    discretisation : Discretisation
        Fourier or finite differences.
    state : Moments
        In its representation.

    Returns
    -------
    Moments
        ``None`` for moments that no term acts on.
    """
    sources = {t.name + t.moment: getattr(state, str(t.source)) for t in terms if t.linear}
    sources |= _product_sources(terms, discretisation, state)
    total: dict[str, Array] = {}
    for term in terms:
        value = term.coefficient * term.operator.apply(
            discretisation, sources[term.name + term.moment]
        )
        total[term.moment] = total[term.moment] + value if term.moment in total else value
    return Moments(**total)


def _product_sources(
    terms: tuple[Term, ...], discretisation: Discretisation, state: Moments
) -> dict[str, Array]:
    products = {t.name + t.moment: (t.source, t) for t in terms if isinstance(t.source, Product)}
    if not products:
        return {}
    names = tuple(sorted({name for product, _ in products.values() for name in product.reads}))
    fields = dict(zip(names, fields_of(discretisation, state, names), strict=True))
    values = [
        product.function(*(fields[name] for name in product.reads), *term.parameters)
        for product, term in products.values()
    ]
    dimensions = discretisation.grid.dimensions
    rows = [value.reshape((-1, *value.shape[-dimensions:])) for value in values]
    back = discretisation.from_values(jnp.concatenate(rows))
    results, at = {}, 0
    for key, value, row in zip(products, values, rows, strict=True):
        piece = back[at : at + len(row)]
        components = value.shape[: value.ndim - dimensions]
        results[key] = piece.reshape((*components, *piece.shape[1:]))
        at += len(row)
    return results


def values_of(terms: tuple[Term, ...], discretisation: Discretisation, state: Moments) -> Moments:
    """Return the sum of terms on the points, without filtering the products.

    Parameters
    ----------
    terms : tuple of Term
        Linear ones, and products under the identity.
    discretisation : Discretisation
        Fourier or finite differences.
    state : Moments
        In its representation.

    Returns
    -------
    Moments
        Values on the points; ``None`` for moments that no term adds to.
    """
    total: dict[str, Array] = {}
    for term in terms:
        if isinstance(term.source, Product):
            fields = fields_of(discretisation, state, term.source.reads)
            values = term.source.function(*fields, *term.parameters)
        else:
            applied = term.operator.apply(discretisation, getattr(state, term.source))
            values = discretisation.values(applied)
        value = term.coefficient * values
        total[term.moment] = total[term.moment] + value if term.moment in total else value
    return Moments(**total)
