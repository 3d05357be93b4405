"""The third-order model: the full one with an equation for T_ij = ⟨ξ'c'_i c'_j⟩.

The full model takes T_ij for what it is after many collisions, (3.7). Here it obeys the equation of
which that is the steady solution without a field, docs/third-order.md:

    ∂T_ij/∂t = −K1 T_ij − K2 T_mm δ_ij − G1 (∂_i C_j + ∂_j C_i) − G2 ∇·C δ_ij
               [+ u (N_i E_j + N_j E_i)],    N = −Dv_kin ∇V,

and −∂_j T_ij takes the place of the dispersion of C. The paper leaves the electric force in
brackets out, and so does every closure set but `complete`, see `triboflux.models.dropped`. T_mm is
the trace over three dimensions, whatever those of the box.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from triboflux.hierarchy import MODELS, TRACES
from triboflux.models import dropped
from triboflux.models import operators as o
from triboflux.models import terms as t
from triboflux.models.coefficients import TransportCoefficients
from triboflux.models.full import charge_terms, covariance_terms, variance_terms
from triboflux.models.model import Model
from triboflux.models.products import GRADIENT_ALONG_FIELD, GRADIENT_BY_FIELD

TRACES_OF_PRODUCTS = {GRADIENT_BY_FIELD: GRADIENT_ALONG_FIELD}


def covariance_flux_terms(c: TransportCoefficients) -> tuple[t.Term, ...]:
    """Return the terms of the equation of T_ij, (A1) with (A11)."""
    term = t.maker("covariance_flux", "(A1)")
    return (
        term(
            "production by covariance gradient",
            "production",
            o.SYMMETRIC_GRADIENT,
            "covariance",
            -c.shear,
        ),
        term(
            "production by covariance divergence",
            "production",
            o.ISOTROPIC_DIVERGENCE,
            "covariance",
            -c.divergence,
        ),
        term("destruction", "destruction", o.IDENTITY, "covariance_flux", -c.third_moment),
        term(
            "destruction of the trace",
            "destruction",
            o.ISOTROPIC,
            "covariance_flux_trace",
            -c.third_moment_coupling,
        ),
        *dropped.covariance_flux_terms(c),
    )


def trace_of(term: t.Term, products: Mapping[t.Product, t.Product]) -> t.Term:
    """Return the term of a tensor's three-dimensional trace that belongs to one of the tensor.

    Parameters
    ----------
    term : Term
        Of an equation of a moment in `triboflux.hierarchy.TRACES`.
    products : mapping
        The traces of products that are tensors.
    """
    operator, factor = o.TRACES[term.operator]
    moment, weight = TRACES[term.moment]
    source: str | t.Product
    if isinstance(term.source, t.Product):
        source = products[term.source]
    elif operator in (o.IDENTITY, o.LAPLACIAN) and term.source in TRACES:
        source, of_source = TRACES[term.source]
        factor = factor / of_source
    else:
        source = term.source
    return replace(
        term,
        moment=moment,
        operator=operator,
        source=source,
        coefficient=weight * factor * term.coefficient,
    )


def with_traces(
    *terms: t.Term, products: Mapping[t.Product, t.Product] = MappingProxyType({})
) -> tuple[t.Term, ...]:
    """Return terms of a tensor and those of its trace; parameters as for `trace_of`."""
    return (*terms, *(trace_of(term, products) for term in terms))


def _without_closed(terms: tuple[t.Term, ...]) -> tuple[t.Term, ...]:
    """Return the terms but for those that take T_ij as closed."""
    return tuple(term for term in terms if term.group not in dropped.CLOSED)


def carried_charge_terms(c: TransportCoefficients) -> tuple[t.Term, ...]:
    """Return the terms of the mean charge equation (5.2), T_ij being evolved."""
    return _without_closed(charge_terms(c)) + dropped.carried_charge_terms(c)


def third_order(coefficients: TransportCoefficients) -> Model:
    """Return the third-order model: the full one with an equation for ⟨ξ'c'c'⟩.

    Parameters
    ----------
    coefficients : TransportCoefficients
        Of the equations.
    """
    c = coefficients
    flux = t.Term(
        "flux",
        dropped.DISPERSION,
        "(3.1)",
        "covariance",
        o.DIVERGENCE_OF_TENSOR,
        "covariance_flux",
        -1.0,
    )
    terms = (
        *carried_charge_terms(c),
        *_without_closed(covariance_terms(c)),
        flux,
        *dropped.carried_covariance_terms(c),
        *variance_terms(c),
        *with_traces(*covariance_flux_terms(c), products=TRACES_OF_PRODUCTS),
    )
    return Model("third-order", MODELS["third-order"].evolves, terms, c)
