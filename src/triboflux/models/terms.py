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
from triboflux.moments import Moments


@dataclass(frozen=True)
class Operator:
    """A linear, isotropic operator with constant coefficients.

    In Fourier space a vector splits into the scalar ``c = i k·C/|k|`` and a transverse rest. In
    terms of scalars and these ``c`` every operator here is multiplication by a real number.

    Attributes
    ----------
    name : str
        Mathematical notation.
    symbol : Callable
        |k| -> factor on scalars and on ``c``; at k = 0 it has to be finite.
    transverse : Callable
        |k| -> factor on the transverse part of a vector.
    apply : Callable
        ``(discretisation, representation) -> representation``.
    """

    name: str
    symbol: Callable[[Array], Array]
    transverse: Callable[[Array], Array]
    apply: Callable[[Discretisation, Array], Array]


def _zero(k: Array) -> Array:
    return jnp.zeros_like(k)


def _inverse(k: Array) -> Array:
    return jnp.where(k > 0.0, 1.0 / jnp.where(k > 0.0, k, 1.0), 0.0)


IDENTITY = Operator("1", jnp.ones_like, jnp.ones_like, lambda _, f: f)
LAPLACIAN = Operator("∇²", lambda k: -(k**2), lambda k: -(k**2), lambda d, f: d.laplacian(f))
GRADIENT = Operator("∇", lambda k: -k, _zero, lambda d, f: d.gradient(f))
DIVERGENCE = Operator("∇·", lambda k: k, _zero, lambda d, f: d.divergence(f))
GRADIENT_OF_DIVERGENCE = Operator(
    "∇∇·", lambda k: -(k**2), _zero, lambda d, f: d.gradient(d.divergence(f))
)
ELECTRIC_FIELD = Operator("E", _inverse, _zero, lambda d, f: d.electric_field(f))
FIELD_DIVERGENCE = Operator(
    "∇·E", lambda k: jnp.where(k > 0.0, 1.0, 0.0), _zero, lambda d, f: d.without_mean(f)
)


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
        ``"charge"``, ``"covariance"`` or ``"variance"``: whose time derivative it adds to.
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
        Among ``charge``, ``covariance``, ``variance``, ``charge_gradient``, ``electric_field``.
    """
    derived = {
        "charge_gradient": lambda: discretisation.gradient(state.charge),
        "electric_field": lambda: discretisation.electric_field(state.charge),
    }
    parts = [derived[n]() if n in derived else getattr(state, n) for n in names]
    vectors = [name in ("covariance", *derived) for name in names]
    rows = [
        part if is_vector else part[None] for part, is_vector in zip(parts, vectors, strict=True)
    ]
    values = discretisation.values(jnp.concatenate(rows))
    results, at = [], 0
    for row, is_vector in zip(rows, vectors, strict=True):
        results.append(values[at : at + len(row)] if is_vector else values[at])
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
        results[key] = piece if value.ndim > dimensions else piece[0]
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
