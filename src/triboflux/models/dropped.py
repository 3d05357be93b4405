"""What the paper's derivation drops, as terms of the same lists; docs/closures.md.

Collisions answer to T_ij = ⟨ξ'c'_i c'_j⟩ by the vector X_i = 2 ∂_j T_ij + ∂_i T_mm,

    ∂Q/∂t ∋ q ∇·X,    ∂C/∂t ∋ -h X,

and T_ij answers to the gradient of the collisional flux of charge J = E/τ_σ - ∇Q/Pe. A model that
evolves T_ij takes X as it is. The full model puts in the closed T_ij, whose part by C is that of
(3.7), and which has parts by J and by the electric force 2 N_(i E_j) besides. Coefficients that
are ``None`` as a whole make no terms at all.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from triboflux.models import operators as o
from triboflux.models import products as p
from triboflux.models import terms as t
from triboflux.models.coefficients import Scalar, TransportCoefficients

DISPERSION = "dispersion"
"""Group of the covariance's terms that the divergence of T_ij stands for."""
COLLISIONAL_FLUX = "collisional flux"
"""Group of the terms of charge and covariance by which collisions answer to T_ij."""
CLOSED = (DISPERSION, COLLISIONAL_FLUX)
"""Groups of charge and covariance that take T_ij as closed."""


class Part(NamedTuple):
    """A part of a vector that is linear in moments or products, ``coefficient operator(source)``.

    Attributes
    ----------
    name : str
        Of the term that it makes.
    operator : Operator
        Makes a vector of the source.
    source : str or Product
        As of a term.
    coefficient : Scalar
        Dimensionless.
    """

    name: str
    operator: o.Operator
    source: str | t.Product
    coefficient: Scalar


def _terms(
    moment: str, group: str, prefix: str, parts: Iterable[Part], factor: Scalar, outer: bool = False
) -> tuple[t.Term, ...]:
    """Return the terms that a vector makes in an equation, or the divergence of that vector."""
    return tuple(
        t.Term(
            f"{prefix} {part.name}",
            group,
            "dropped",
            moment,
            o.DIVERGENCES[part.operator] if outer else part.operator,
            part.source,
            factor * part.coefficient,
        )
        for part in parts
    )


def variance_flux(c: TransportCoefficients) -> Scalar:
    """Return by what -∂_i V makes N_i, the collisional part of its production included."""
    return c.variance_flux_production / c.variance_flux_destruction


def _closed_vectors(c: TransportCoefficients) -> tuple[tuple[Part, ...], tuple[Part, ...]]:
    """Return ∂_j T_ij of the closed T_ij but for its part by C, and X_i of all of it."""
    d = c.dropped
    assert d is not None
    k_1, k_t = c.third_moment, c.third_moment_trace
    coupling = c.third_moment_coupling / k_t
    # of ∂_i J_j + ∂_j J_i + δ_ij ∇·J where J has no curl: the divergence over ∇∇·J, X over it
    along = (3.0 - 5.0 * coupling) / k_1
    both = 2.0 * along + 5.0 / k_t
    trace = (2.0 * c.shear + 3.0 * c.divergence) / k_t
    force = c.electric_force * variance_flux(c)

    def by_flux(factor: Scalar) -> tuple[Part, ...]:
        return (
            Part(
                "charge gradient",
                o.GRADIENT_OF_LAPLACIAN,
                "charge",
                factor * d.third_moment_gradient,
            ),
            Part("electric field", o.GRADIENT, "charge", -factor * d.third_moment_field),
        )

    divergence = (
        *by_flux(along),
        Part("electric force", o.DIVERGENCE_OF_TENSOR, p.GRADIENT_BY_FIELD, -force / k_1),
        Part(
            "trace of the electric force",
            o.GRADIENT,
            p.GRADIENT_ALONG_FIELD,
            force * coupling / k_1,
        ),
    )
    vector = (
        Part("covariance", o.LAPLACIAN, "covariance", -2.0 * c.covariance_dispersion),
        Part(
            "covariance divergence",
            o.GRADIENT_OF_DIVERGENCE,
            "covariance",
            -2.0 * c.divergence_dispersion - trace,
        ),
        *by_flux(both),
        Part("electric force", o.DIVERGENCE_OF_TENSOR, p.GRADIENT_BY_FIELD, -2.0 * force / k_1),
        Part(
            "trace of the electric force",
            o.GRADIENT,
            p.GRADIENT_ALONG_FIELD,
            force * (2.0 * coupling / k_1 - 1.0 / k_t),
        ),
    )
    return divergence, vector


_CARRIED = (
    Part("third-order moment", o.DIVERGENCE_OF_TENSOR, "covariance_flux", 2.0),
    Part("its trace", o.GRADIENT, "covariance_flux_trace", 1.0),
)
"""X_i of a T_ij that is evolved."""


def charge_terms(c: TransportCoefficients) -> tuple[t.Term, ...]:
    """Return the terms of the charge equation that the paper drops, T_ij being closed."""
    return () if c.dropped is None else _charge(c, _closed_vectors(c)[1])


def carried_charge_terms(c: TransportCoefficients) -> tuple[t.Term, ...]:
    """Return the terms of the charge equation that the paper drops, T_ij being evolved."""
    return _charge(c, _CARRIED)


def _charge(c: TransportCoefficients, parts: tuple[Part, ...]) -> tuple[t.Term, ...]:
    if c.dropped is None:
        return ()
    factor = c.dropped.charge_third_moment
    return _terms("charge", COLLISIONAL_FLUX, "collisional flux by", parts, factor, outer=True)


def covariance_terms(c: TransportCoefficients) -> tuple[t.Term, ...]:
    """Return the terms of the covariance equation that the paper drops, T_ij being closed."""
    if c.dropped is None:
        return ()
    divergence, vector = _closed_vectors(c)
    factor = c.dropped.covariance_dispersion
    moment, group = "covariance", "collisional dispersion"
    return (
        t.Term(
            "collisional dispersion", group, "dropped", moment, o.LAPLACIAN, "covariance", factor
        ),
        t.Term(
            "collisional dispersion of the divergence",
            group,
            "dropped",
            moment,
            o.GRADIENT_OF_DIVERGENCE,
            "covariance",
            2.0 * factor,
        ),
        *_terms(moment, DISPERSION, "dispersion by", divergence, -1.0),
        *_covariance_flux(c, vector),
    )


def carried_covariance_terms(c: TransportCoefficients) -> tuple[t.Term, ...]:
    """Return the terms of the covariance equation by which collisions answer to an evolved T_ij."""
    return _covariance_flux(c, _CARRIED)


def _covariance_flux(c: TransportCoefficients, parts: tuple[Part, ...]) -> tuple[t.Term, ...]:
    if c.dropped is None:
        return ()
    factor = -c.dropped.covariance_third_moment
    return _terms("covariance", COLLISIONAL_FLUX, "collisional flux by", parts, factor)


def variance_terms(c: TransportCoefficients) -> tuple[t.Term, ...]:
    """Return the terms of the variance equation that the paper drops."""
    d = c.dropped
    if d is None:
        return ()
    term = t.maker("variance", "dropped")
    by_gradient = "production by covariance and charge gradient"
    by_field, by_flux = "production by covariance and field", "production by collisional flux"
    dispersion = 1.0 / c.variance_flux_destruction
    return (
        term(
            "collisional production by charge gradient",
            by_gradient,
            o.IDENTITY,
            p.FLUX_ALONG_GRADIENT,
            d.covariance_along_gradient,
        ),
        term(
            "collisional production by electric field",
            by_field,
            o.IDENTITY,
            p.FLUX_ALONG_FIELD,
            -d.covariance_along_field,
        ),
        term(
            "production by squared charge gradient",
            by_flux,
            o.IDENTITY,
            p.GRADIENT_SQUARED,
            d.variance_gradient_production,
        ),
        term(
            "production by field and charge gradient",
            by_flux,
            o.IDENTITY,
            p.FIELD_ALONG_GRADIENT,
            -2.0 * d.variance_mixed_production,
        ),
        term(
            "destruction by covariance",
            "destruction",
            o.IDENTITY,
            p.COVARIANCE_SQUARED,
            -d.variance_covariance_destruction,
        ),
        term(
            "kinetic dispersion by collisions",
            "kinetic dispersion",
            o.LAPLACIAN,
            "variance",
            d.variance_flux_gradient * dispersion,
        ),
        term(
            "collisional flux",
            COLLISIONAL_FLUX,
            o.LAPLACIAN,
            "variance",
            d.variance_flux * variance_flux(c),
        ),
    )


def covariance_flux_terms(c: TransportCoefficients) -> tuple[t.Term, ...]:
    """Return the terms of the equation of T_ij that the paper drops."""
    d = c.dropped
    if d is None:
        return ()
    term = t.maker("covariance_flux", "dropped")
    group, charge = "production by collisional flux", "charge"
    by_gradient, by_field = d.third_moment_gradient, -d.third_moment_field
    force = -c.electric_force * variance_flux(c)
    return (
        term("production by charge curvature", group, o.HESSIANS, charge, by_gradient),
        term("production by charge Laplacian", group, o.ISOTROPIC_LAPLACIAN, charge, by_gradient),
        term("production by field gradient", group, o.FIELD_GRADIENTS, charge, by_field),
        term("production by field divergence", group, o.ISOTROPIC_CHARGE, charge, by_field),
        term("electric force", "electric force", o.IDENTITY, p.GRADIENT_BY_FIELD, force),
    )
