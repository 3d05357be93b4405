"""The full second-order model: transport equations for charge, covariance and variance."""

from __future__ import annotations

from triboflux.hierarchy import MODELS
from triboflux.models import dropped
from triboflux.models import operators as o
from triboflux.models import terms as t
from triboflux.models.coefficients import TransportCoefficients
from triboflux.models.model import Model
from triboflux.models.products import FIELD_SQUARED, FLUX_ALONG_GRADIENT, VARIANCE_TIMES_FIELD


def charge_terms(c: TransportCoefficients) -> tuple[t.Term, ...]:
    """Return the terms of the mean charge equation (5.2)."""
    return (
        t.Term(
            "kinetic flux", "kinetic flux", "(5.2)", "charge", o.DIVERGENCE, "covariance", -c.flux
        ),
        t.Term(
            "triboconductivity",
            "triboconductivity",
            "(5.2)",
            "charge",
            o.FIELD_DIVERGENCE,
            "charge",
            -c.triboconductivity,
        ),
        t.Term(
            "collisional dispersion",
            "collisional dispersion",
            "(5.2)",
            "charge",
            o.LAPLACIAN,
            "charge",
            c.dispersion,
        ),
        *dropped.charge_terms(c),
    )


def covariance_terms(c: TransportCoefficients) -> tuple[t.Term, ...]:
    """Return the terms of the charge-velocity covariance equation (5.3), in vector form (3.10)."""
    return (
        t.Term(
            "production by charge gradient",
            "production",
            "(5.3)",
            "covariance",
            o.GRADIENT,
            "charge",
            -c.gradient_production,
        ),
        t.Term(
            "production by electric field",
            "production",
            "(5.3)",
            "covariance",
            o.ELECTRIC_FIELD,
            "charge",
            c.field_production,
        ),
        t.Term(
            "electric force",
            "electric force",
            "(5.3)",
            "covariance",
            o.IDENTITY,
            VARIANCE_TIMES_FIELD,
            c.electric_force,
        ),
        t.Term(
            "destruction",
            "destruction",
            "(5.3)",
            "covariance",
            o.IDENTITY,
            "covariance",
            -c.covariance_destruction,
        ),
        t.Term(
            "dispersion",
            "dispersion",
            "(3.7)",
            "covariance",
            o.LAPLACIAN,
            "covariance",
            c.covariance_dispersion,
        ),
        t.Term(
            "dispersion of the divergence",
            "dispersion",
            "(3.7)",
            "covariance",
            o.GRADIENT_OF_DIVERGENCE,
            "covariance",
            c.divergence_dispersion,
        ),
        *dropped.covariance_terms(c),
    )


def variance_terms(c: TransportCoefficients) -> tuple[t.Term, ...]:
    """Return the terms of the charge variance equation (5.4)."""
    return (
        t.Term(
            "production by charge gradient",
            "production by covariance and charge gradient",
            "(5.4)",
            "variance",
            o.IDENTITY,
            FLUX_ALONG_GRADIENT,
            -2.0,
        ),
        t.Term(
            "production by electric field",
            "production by electric field",
            "(5.4)",
            "variance",
            o.IDENTITY,
            FIELD_SQUARED,
            c.variance_field_production,
        ),
        t.Term(
            "destruction",
            "destruction",
            "(5.4)",
            "variance",
            o.IDENTITY,
            "variance",
            -c.variance_destruction,
        ),
        t.Term(
            "collisional dispersion",
            "collisional dispersion",
            "(5.4)",
            "variance",
            o.LAPLACIAN,
            "variance",
            c.variance_collisional_dispersion,
        ),
        t.Term(
            "kinetic dispersion",
            "kinetic dispersion",
            "(5.4)",
            "variance",
            o.LAPLACIAN,
            "variance",
            c.granular_temperature / c.variance_flux_destruction,
        ),
        *dropped.variance_terms(c),
    )


def full(coefficients: TransportCoefficients) -> Model:
    """Return the full second-order model (5.2)-(5.4).

    Parameters
    ----------
    coefficients : TransportCoefficients
        Of the equations.
    """
    return Model(
        "full",
        MODELS["full"].evolves,
        charge_terms(coefficients) + covariance_terms(coefficients) + variance_terms(coefficients),
        coefficients,
    )
