"""The coefficients of the terms that the paper's derivation drops, written once for all units.

As those of `triboflux.rates` they are SI or scaled, depending on what they are made of, and take
floats, JAX arrays, symbols and quantities with units alike.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from triboflux.rates import ClosureRates, ClosureValues


class DroppedRates(NamedTuple):
    """The coefficients of the terms that the paper's derivation drops.

    Units are SI; the scaled equations have the same, as for `ClosureRates`. N_i = ⟨ξ'ξ'c'_i⟩.

    Attributes
    ----------
    charge_third_moment : float
        Before 2 ∂_i∂_j T_ij + ∇²T_mm in the equation of Q, s.
    covariance_third_moment : float
        Before −(2 ∂_j T_ij + ∂_i T_mm) in that of C, dimensionless.
    covariance_dispersion : float
        Before ∇²C + 2 ∇∇·C in that of C, m²/s.
    third_moment_gradient, third_moment_field : float
        Before 2 ∂_i∂_j Q + ∇²Q δ_ij and −(∂_i E_j + ∂_j E_i + ∇·E δ_ij) in that of T_ij, m⁴/s³ and
        C² m²/(kg s).
    variance_flux : float
        η_V, before −∇·N in that of V, dimensionless.
    variance_flux_gradient : float
        e η_V Θ, before −∂_i V in that of N_i, m²/s².
    covariance_along_gradient, covariance_along_field : float
        Before C·∇Q and −C·E in that of V, dimensionless and C² s²/(kg m²).
    variance_gradient_production, variance_mixed_production : float
        Before |∇Q|² and −2 E·∇Q in that of V, m²/s and C² s/kg.
    variance_covariance_destruction : float
        Before −|C|² in that of V, s/m².
    """

    charge_third_moment: Any
    covariance_third_moment: Any
    covariance_dispersion: Any
    third_moment_gradient: Any
    third_moment_field: Any
    variance_flux: Any
    variance_flux_gradient: Any
    covariance_along_gradient: Any
    covariance_along_field: Any
    variance_gradient_production: Any
    variance_mixed_production: Any
    variance_covariance_destruction: Any


def dropped_rates(
    closures: ClosureValues,
    rates: ClosureRates,
    *,
    restitution: Any,
    diameter: Any,
    velocity: Any,
    dispersion: Any,
    conduction: Any,
) -> DroppedRates:
    """Return the coefficients of the terms that the paper's derivation drops.

    Parameters
    ----------
    closures : ClosureValues
        All coefficients of `triboflux.closures.complete`, made for `restitution`.
    rates : ClosureRates
        `closure_rates` of the same arguments.
    restitution, diameter, velocity, dispersion, conduction : float
        As for `closure_rates`.
    """
    c = closures
    temperature = velocity**2
    fraction = rates.transferred_fraction
    produced = c["variance_production_field"] * fraction / c["transferred_fraction"]
    # η and η_V over D, of which the first is the flux by ∇Q and, through σ/(nD), by E
    flux = c["collisional_flux_number"] / (diameter * velocity)
    flux_of_variance = (
        c["variance_collisional_flux"] / c["dispersion"] * fraction / (diameter * velocity)
    )
    along_flux = 2.0 * flux - 4.0 * flux_of_variance
    variance_flux = flux_of_variance * dispersion
    lost = c["variance_covariance_regain"] * fraction
    return DroppedRates(
        charge_third_moment=c["charge_third_moment"] * dispersion / temperature,
        covariance_third_moment=c["covariance_third_moment"] * rates.collisional_flux,
        covariance_dispersion=c["covariance_collisional_dispersion"] * dispersion,
        third_moment_gradient=c["third_moment_flux"] * temperature * dispersion,
        third_moment_field=c["third_moment_flux"] * temperature * conduction,
        variance_flux=variance_flux,
        variance_flux_gradient=restitution * variance_flux * temperature,
        covariance_along_gradient=along_flux * dispersion,
        covariance_along_field=along_flux * conduction,
        variance_gradient_production=produced * dispersion,
        variance_mixed_production=produced * conduction,
        variance_covariance_destruction=(c["variance_covariance_exchange"] - lost)
        * rates.charge_exchange
        / temperature,
    )


def scaled_dropped_rates(
    closures: ClosureValues,
    rates: ClosureRates,
    numbers: Any,
    velocity: Any = 1.0,
    transfer: Any = 1.0,
) -> DroppedRates:
    """Return the coefficients of the dropped terms in the scaled equations.

    Parameters
    ----------
    closures : ClosureValues
        All coefficients of `triboflux.closures.complete`, made for the restitution of `numbers`.
    rates : ClosureRates
        `scaled_rates` of the same arguments.
    numbers : Numbers
        The seven dimensionless numbers; values may be traced JAX scalars.
    velocity, transfer : scalar
        As for `scaled_rates`.
    """
    return dropped_rates(
        closures,
        rates,
        restitution=numbers.restitution,
        diameter=1.0 / numbers.length_ratio,
        velocity=velocity,
        dispersion=transfer / numbers.peclet,
        conduction=transfer / numbers.tau_sigma,
    )
