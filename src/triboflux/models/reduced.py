"""The reduced models: what becomes of the full one where moments are closed algebraically.

Without transport the covariance is ``C = (-P ∇Q + S E + u V E)/R``, the production and force terms
of its equation over its destruction rate, (7.8). A reduced model puts that into the other two
equations.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from jaxtyping import Array

from triboflux.hierarchy import MODELS
from triboflux.models import operators as o
from triboflux.models import terms as t
from triboflux.models.coefficients import Scalar, TransportCoefficients
from triboflux.models.dropped import CLOSED
from triboflux.models.full import charge_terms, covariance_terms, variance_terms
from triboflux.models.model import Model
from triboflux.models.products import (
    COVARIANCE_SQUARED,
    FIELD_ALONG_GRADIENT,
    FIELD_SQUARED,
    FLUX_ALONG_FIELD,
    FLUX_ALONG_GRADIENT,
    GRADIENT_SQUARED,
)

PRODUCTION, FORCE = "production", "electric force"
"""Groups of the covariance's terms that its algebraic value keeps."""


def _numerator(gradient: Array, field: Array, *parameters: Scalar) -> Array:
    """Return B |E|² - 2 C0·∇Q on the points, with C0 = (-P ∇Q + S E)/R.

    With the terms that the paper drops it has (2η - 4η_V) C0·(∇Q - (σ/nD) E) and their production
    by ∇Q, too.
    """
    by_gradient, by_field, _, production, _, *dropped = parameters
    squares, products = t.dot(gradient, gradient), t.dot(field, gradient)
    found = (
        production * t.dot(field, field) + 2.0 * by_gradient * squares - 2.0 * by_field * products
    )
    if not dropped:
        return found
    along_gradient, along_field, by_squares, by_products = dropped
    produced = by_field * products - by_gradient * squares
    carried = by_field * t.dot(field, field) - by_gradient * products
    return (
        found
        + along_gradient * produced
        + along_field * carried
        + by_squares * squares
        + by_products * products
    )


def _denominator(gradient: Array, field: Array, *parameters: Scalar) -> Array:
    """Return F + 2 (u/R) E·∇Q on the points, with the terms that the paper drops theirs, too."""
    _, _, by_force, _, destruction, *dropped = parameters
    products = t.dot(field, gradient)
    found = destruction + 2.0 * by_force * products
    if not dropped:
        return found
    along_gradient, along_field, *_ = dropped
    carried = along_gradient * products + along_field * t.dot(field, field)
    return found - by_force * carried


def _variance(gradient: Array, field: Array, *parameters: Scalar) -> Array:
    """Return V of (7.8)-(7.9) on the points."""
    return _numerator(gradient, field, *parameters) / _denominator(gradient, field, *parameters)


def _force(gradient: Array, field: Array, *parameters: Scalar) -> Array:
    """Return V E on the points, with V of (7.8)-(7.9)."""
    return _variance(gradient, field, *parameters)[None] * field


def _covariance_squared(
    variance: Array, field: Array, gradient: Array, *parameters: Scalar
) -> Array:
    """Return |C|² on the points, with C of (7.8)."""
    by_gradient, by_field, by_force = parameters
    covariance = by_gradient * gradient + (by_field + by_force * variance)[None] * field
    return t.dot(covariance, covariance)


_GRADIENT_AND_FIELD = (t.CHARGE_GRADIENT, t.FIELD)
ALGEBRAIC_VARIANCE = t.Product("V", _GRADIENT_AND_FIELD, _variance)
ALGEBRAIC_FORCE = t.Product("V E", _GRADIENT_AND_FIELD, _force)
NUMERATOR = t.Product("B |E|² - 2 C0·∇Q", _GRADIENT_AND_FIELD, _numerator)
DENOMINATOR = t.Product("F + 2 (u/R) E·∇Q", _GRADIENT_AND_FIELD, _denominator)
FORCE_ALONG_GRADIENT = t.Product(
    "V E·∇Q",
    ("variance", t.FIELD, t.CHARGE_GRADIENT),
    lambda v, e, g: v * t.dot(e, g),
)
FORCE_ALONG_FIELD = t.Product("V |E|²", ("variance", t.FIELD), lambda v, e: v * t.dot(e, e))
CLOSED_COVARIANCE_SQUARED = t.Product(
    "|C|²", ("variance", t.FIELD, t.CHARGE_GRADIENT), _covariance_squared
)


@dataclass(frozen=True)
class _Substitution:
    """What a part of the covariance becomes under ∇· and in its products with ∇Q and E."""

    divergence: o.Operator
    along: dict[t.Product, t.Product]


_SUBSTITUTIONS = {
    o.GRADIENT: _Substitution(
        o.LAPLACIAN,
        {FLUX_ALONG_GRADIENT: GRADIENT_SQUARED, FLUX_ALONG_FIELD: FIELD_ALONG_GRADIENT},
    ),
    o.ELECTRIC_FIELD: _Substitution(
        o.FIELD_DIVERGENCE,
        {FLUX_ALONG_GRADIENT: FIELD_ALONG_GRADIENT, FLUX_ALONG_FIELD: FIELD_SQUARED},
    ),
    o.IDENTITY: _Substitution(
        o.DIVERGENCE,
        {FLUX_ALONG_GRADIENT: FORCE_ALONG_GRADIENT, FLUX_ALONG_FIELD: FORCE_ALONG_FIELD},
    ),
}
"""By the operator of the part."""


def closed_covariance(
    c: TransportCoefficients, groups: tuple[str, ...] = (PRODUCTION, FORCE)
) -> tuple[t.Term, ...]:
    """Return the parts of the algebraic covariance (7.8)."""
    return tuple(
        replace(part, equation="(7.8)", coefficient=part.coefficient / c.covariance_destruction)
        for part in covariance_terms(c)
        if part.group in groups
    )


def closed_charge_terms(c: TransportCoefficients, parts: tuple[t.Term, ...]) -> tuple[t.Term, ...]:
    """Return the terms of the charge equation, the kinetic flux being that of a closed covariance.

    Parameters
    ----------
    c : TransportCoefficients
        Of the equations.
    parts : tuple of Term
        The covariance, from `closed_covariance`; without any there is no kinetic flux.

    Notes
    -----
    Like the dispersion of the covariance, what takes the third-order moment as closed is left out.
    """
    flux, *others = (term for term in charge_terms(c) if term.group not in CLOSED)
    closed = (
        replace(
            flux,
            name=f"{flux.name}, {part.name}",
            operator=_SUBSTITUTIONS[part.operator].divergence,
            source=part.source,
            coefficient=flux.coefficient * part.coefficient,
            parameters=part.parameters,
        )
        for part in parts
    )
    return (*closed, *others)


def closed_variance_terms(
    c: TransportCoefficients, parts: tuple[t.Term, ...]
) -> tuple[t.Term, ...]:
    """Return the terms of the variance equation, produced by a closed covariance.

    Parameters
    ----------
    c : TransportCoefficients
        Of the equations.
    parts : tuple of Term
        The covariance, from `closed_covariance`.
    """
    by_gradient, by_field, by_force = (part.coefficient for part in parts)
    closed: list[t.Term] = []
    for term in variance_terms(c):
        if term.source in (FLUX_ALONG_GRADIENT, FLUX_ALONG_FIELD):
            closed += [
                replace(
                    term,
                    name=f"{term.name}, {part.name}",
                    source=_SUBSTITUTIONS[part.operator].along[term.source],
                    coefficient=term.coefficient * part.coefficient,
                )
                for part in parts
            ]
        elif term.source == COVARIANCE_SQUARED:
            parameters = (by_gradient, by_field, by_force)
            closed.append(replace(term, source=CLOSED_COVARIANCE_SQUARED, parameters=parameters))
        else:
            closed.append(term)
    return tuple(closed)


def semi_algebraic(c: TransportCoefficients) -> Model:
    """Return the semi-algebraic model: equations for Q and V, the covariance from (7.8).

    Parameters
    ----------
    c : TransportCoefficients
        Of the equations.
    """
    parts = closed_covariance(c)
    terms = closed_charge_terms(c, parts) + closed_variance_terms(c, parts)
    return Model("semi-algebraic", MODELS["semi-algebraic"].evolves, terms, c, parts)


def algebraic(c: TransportCoefficients) -> Model:
    """Return the coupled algebraic model: an equation for Q, C and V from (7.8)-(7.9).

    ``V = (B |E|² - 2 C0·∇Q)/(F + 2 (u/R) E·∇Q)`` with ``C0 = (-P ∇Q + S E)/R``, which makes sense
    where the denominator is positive and the numerator is not negative.

    Parameters
    ----------
    c : TransportCoefficients
        Of the equations.
    """
    by_gradient, by_field, by_force = closed_covariance(c)
    parameters = (
        -by_gradient.coefficient,
        by_field.coefficient,
        by_force.coefficient,
        c.variance_field_production,
        c.variance_destruction,
        *_dropped_parameters(c),
    )
    force = replace(by_force, source=ALGEBRAIC_FORCE, parameters=parameters)
    parts = (by_gradient, by_field, force)

    def pointwise(name: str, source: t.Product) -> t.Term:
        return t.Term(name, name, "(7.9)", "variance", o.IDENTITY, source, 1.0, parameters)

    return Model(
        "algebraic",
        MODELS["algebraic"].evolves,
        closed_charge_terms(c, parts),
        c,
        closures=(*parts, pointwise("variance", ALGEBRAIC_VARIANCE)),
        limits=(
            pointwise("the denominator of the algebraic variance", DENOMINATOR),
            pointwise("the algebraic variance", NUMERATOR),
        ),
    )


def _dropped_parameters(c: TransportCoefficients) -> tuple[Scalar, ...]:
    """Return what the algebraic variance needs of the terms that the paper drops.

    That is before C·∇Q, -C·E, |∇Q|² and E·∇Q. |C|² is not among them: it would make V the root of a
    quadratic equation.
    """
    d = c.dropped
    if d is None:
        return ()
    return (
        d.covariance_along_gradient,
        -d.covariance_along_field,
        d.variance_gradient_production,
        -2.0 * d.variance_mixed_production,
    )


def gradient(c: TransportCoefficients) -> Model:
    """Return the gradient model of Montilla et al. (2020): (7.8) without the electric force.

    Parameters
    ----------
    c : TransportCoefficients
        Of the equations.
    """
    parts = closed_covariance(c, (PRODUCTION,))
    return Model("gradient", MODELS["gradient"].evolves, closed_charge_terms(c, parts), c, parts)


def collisional(c: TransportCoefficients) -> Model:
    """Return the model without covariance, as in Ceresiat, Kolehmainen & Ozel (2021).

    Parameters
    ----------
    c : TransportCoefficients
        Of the equations.
    """
    return Model("collisional", MODELS["collisional"].evolves, closed_charge_terms(c, ()), c)
