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
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from triboflux.calculus import Discretisation
from triboflux.models import operators as o
from triboflux.moments import Moments


class Applied(NamedTuple):
    """What products can read besides moments: an operator applied to one."""

    operator: o.Operator
    moment: str


class Shared(NamedTuple):
    """What products of one model have in common, evaluated once for all of them.

    Attributes
    ----------
    reads : tuple of str or Applied
        Fields.
    function : Callable
        Of their values on the points and of the term's parameters.
    """

    reads: tuple[str | Applied, ...]
    function: Callable[..., Any]


@dataclass(frozen=True)
class Product:
    """A pointwise product of fields.

    Attributes
    ----------
    name : str
        Mathematical notation.
    reads : tuple of str, Applied or Shared
        The fields it multiplies, see `fields_of`, and what it shares with other products.
    function : Callable
        Values of these on the points, then the term's parameters -> values of the product.
    """

    name: str
    reads: tuple[str | Applied | Shared, ...]
    function: Callable[..., Array]

    def fields(self) -> tuple[str | Applied, ...]:
        """Return the fields that have to be known."""
        return tuple(
            field
            for read in self.reads
            for field in (read.reads if isinstance(read, Shared) else (read,))
        )

    def reads_moment(self, moment: str) -> bool:
        """Return whether a moment, or a derivative of it, is among what it multiplies."""
        return any(
            (read.moment if isinstance(read, Applied) else read) == moment for read in self.fields()
        )


def dot(left: Float[Array, "d *x"], right: Float[Array, "d *x"]) -> Float[Array, "*x"]:
    """Return the scalar product of two vector fields.

    Written out, because the compiler makes a sum over an axis a pass of its own over the points.
    """
    return ft.reduce(lambda a, b: a + b, (x * y for x, y in zip(left, right, strict=True)))


def times(factor: Any, field: Float[Array, "..."]) -> Float[Array, "..."]:
    """Return a number or a scalar field times a field of any rank."""
    missing = field.ndim - jnp.ndim(factor)
    return field * (
        jnp.reshape(factor, (1,) * missing + jnp.shape(factor)) if jnp.ndim(factor) else factor
    )


class Term(eqx.Module):
    """One named contribution to the time derivative of one moment.

    Attributes
    ----------
    name : str
        Unique within the equation of its moment.
    group : str
        Heading under which Figs. 4-5 of the paper plot it.
    equation : str
        Equation number of the paper, or ``"dropped"`` by its derivation.
    moment : str
        A name of `triboflux.hierarchy.RANKS`: whose time derivative it adds to.
    operator : Operator
        Applied to the source.
    source : str or Product
        A moment's name for a linear term, a product otherwise.
    coefficient : float or Array
        Dimensionless factor, sign included.
    parameters : tuple
        What the function of a product needs beside fields: pytrees, dimensionless.
    """

    name: str = eqx.field(static=True)
    group: str = eqx.field(static=True)
    equation: str = eqx.field(static=True)
    moment: str = eqx.field(static=True)
    operator: o.Operator = eqx.field(static=True)
    source: str | Product = eqx.field(static=True)
    coefficient: float | Float[Array, "..."]
    parameters: tuple[Any, ...] = ()

    @property
    def linear(self) -> bool:
        """Whether the exponential integrator treats the term exactly."""
        return isinstance(self.source, str)


def maker(
    moment: str, equation: str = ""
) -> Callable[[str, str, o.Operator, str | Product, Any], Term]:
    """Return a function that makes terms of one equation.

    Parameters
    ----------
    moment : str
        Whose equation it is.
    equation : str
        As of a term.

    Returns
    -------
    Callable
        Name, group, operator, source and coefficient -> term.
    """

    def make(
        name: str, group: str, operator: o.Operator, source: str | Product, coefficient: Any
    ) -> Term:
        return Term(name, group, equation, moment, operator, source, coefficient)

    return make


CHARGE_GRADIENT = Applied(o.GRADIENT, "charge")
FIELD = Applied(o.ELECTRIC_FIELD, "charge")
VARIANCE_GRADIENT = Applied(o.GRADIENT, "variance")


def fields_of(
    discretisation: Discretisation, state: Moments, reads: tuple[str | Applied, ...]
) -> list[Array]:
    """Return values on the points of the named fields, transformed in one batch.

    Parameters
    ----------
    discretisation : Discretisation
        Where the state lives.
    state : Moments
        In the representation of the discretisation.
    reads : tuple of str or Applied
        Moments, and operators applied to them.
    """
    parts = [
        read.operator.apply(discretisation, getattr(state, read.moment))
        if isinstance(read, Applied)
        else getattr(state, read)
        for read in reads
    ]
    scalar = state.charge.ndim
    rows = [part.reshape((-1, *part.shape[part.ndim - scalar :])) for part in parts]
    values = discretisation.values(jnp.concatenate(rows))
    results, at = [], 0
    for part, row in zip(parts, rows, strict=True):
        piece = values[at : at + len(row)]
        results.append(piece.reshape((*part.shape[: part.ndim - scalar], *piece.shape[1:])))
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
    total: dict[str, Array] = {}

    def add(moment: str, value: Array) -> None:
        total[moment] = total[moment] + value if moment in total else value

    for term in terms:
        if isinstance(term.source, str):
            source = getattr(state, term.source)
            add(term.moment, term.coefficient * term.operator.apply(discretisation, source))
    sums: dict[tuple[str, o.Operator], Array] = {}
    for term, value in _products(terms, discretisation, state):
        key = term.moment, term.operator
        sums[key] = sums[key] + value if key in sums else value
    for (moment, operator), field in zip(sums, _back(sums, discretisation), strict=True):
        add(moment, operator.apply(discretisation, field))
    return Moments(**total)


def _products(
    terms: tuple[Term, ...], discretisation: Discretisation, state: Moments
) -> list[tuple[Term, Array]]:
    """Return the terms that are not linear and coefficient times product on the points."""
    products = [(term, term.source) for term in terms if isinstance(term.source, Product)]
    if not products:
        return []
    reads = tuple(dict.fromkeys(field for _, product in products for field in product.fields()))
    fields: dict[Any, Any] = dict(zip(reads, fields_of(discretisation, state, reads), strict=True))
    results: list[tuple[Term, Array]] = []
    for term, product in products:
        for read in product.reads:
            if isinstance(read, Shared) and read not in fields:
                known = (fields[field] for field in read.reads)
                fields[read] = read.function(*known, *term.parameters)
        known = (fields[read] for read in product.reads)
        results.append((term, term.coefficient * product.function(*known, *term.parameters)))
    return results


def _back(sums: dict[Any, Array], discretisation: Discretisation) -> list[Array]:
    """Return values on the points in the representation, transformed in one batch."""
    if not sums:
        return []
    dimensions = discretisation.grid.dimensions
    rows = [value.reshape((-1, *value.shape[-dimensions:])) for value in sums.values()]
    back = discretisation.from_values(jnp.concatenate(rows))
    results, at = [], 0
    for value, row in zip(sums.values(), rows, strict=True):
        piece = back[at : at + len(row)]
        components = value.shape[: value.ndim - dimensions]
        results.append(piece.reshape((*components, *piece.shape[1:])))
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
    products = _products(terms, discretisation, state)
    linear: list[tuple[Term, Array]] = []
    for term in terms:
        if isinstance(term.source, str):
            applied = term.operator.apply(discretisation, getattr(state, term.source))
            linear.append((term, term.coefficient * discretisation.values(applied)))
    for term, value in (*linear, *products):
        total[term.moment] = total[term.moment] + value if term.moment in total else value
    return Moments(**total)
