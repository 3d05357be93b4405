"""What the collision integrals answer to single causes, and the closure coefficients that follow.

The integrals are sampled in `triboflux.sampling`; the benchmarks do them by computer algebra. Both
need the same comparison of C(ψ) with the closed equations, which stands here.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

ADDITIONS = (
    "collision_rate",
    "third_moment_exchange_trace",
    "charge_third_moment_trace",
    "covariance_third_moment_trace",
    "covariance_collisional_dispersion_divergence",
    "third_moment_flux_trace",
    "third_moment_flux_field",
    "third_moment_flux_field_trace",
    "variance_production_gradient",
    "variance_production_mixed",
    "variance_covariance_gradient",
    "variance_covariance_gradient_regain",
    "variance_covariance_field",
    "variance_covariance_field_regain",
    "variance_flux_production",
)
"""What `coefficients` returns beside the closure sets.

J_1; the part of K2 with 1/tau_xi, which is 0; answers that repeat another coefficient, since a flux
of charge is what counts, whether by E or by ∇Q, and tensors come as 2 A_ij + A_mm δ_ij; the factors
2 of η and 4 of η_V before C·J, and 1 of e η_V before ∇V in the equation of N.
"""


class Responses(NamedTuple):
    """What C(ψ) answers to one cause at a time: the factors in isotropic tensors.

    In units of n² g0 d² times powers of Θ, d, β and γ. In the names, ``charge`` is C(ξ),
    ``covariance`` C(ξ c_i), ``third`` C(ξ c_i c_j) − Θ δ_ij C(ξ), ``variance`` C(ξξ) and ``flux``
    C(ξξ c_i), where ξ is always counted from the local mean charge Q. The causes are E and its
    gradient (with β), derivatives of Q, C_i = ⟨ξ'c'_i⟩, T_ij = ⟨ξ'c'_i c'_j⟩, V = ⟨ξ'ξ'⟩ and
    N_i = ⟨ξ'ξ'c'_i⟩.

    From `charge_third` on they belong to what the paper's derivation drops, and are all there or
    none of them.

    Attributes
    ----------
    collision_rate : scalar or array_like
        All collisions, J_1.
    charge_field, charge_laplacian, charge_covariance : scalar or array_like
        To ∇·E, ∇²Q, ∇·C.
    covariance_field, covariance_gradient : scalar or array_like
        To E, ∇Q.
    covariance_velocity, covariance_exchange : scalar or array_like
        To C, without and with γ.
    third_velocity, third_velocity_trace : scalar or array_like
        To T_ij and to T_mm δ_ij, without γ.
    third_exchange, third_exchange_trace : scalar or array_like
        The same with γ.
    third_shear, third_divergence : scalar or array_like
        To ∂_i C_j + ∂_j C_i and to ∇·C δ_ij.
    variance_exchange, variance_regain : scalar or array_like
        To V, with γ and with γ².
    variance_field, variance_laplacian : scalar or array_like
        To |E|² and to ∇²V.
    flux_velocity, flux_exchange, flux_regain : scalar or array_like
        To N, without γ, with γ and with γ².
    charge_third, charge_third_trace : scalar or array_like
        To ∂_i∂_j T_ij and to ∇²T_mm.
    covariance_third, covariance_third_trace : scalar or array_like
        To ∂_j T_ij and to ∂_i T_mm.
    covariance_curvature, covariance_curvature_trace : scalar or array_like
        To ∇²C and to ∇∇·C.
    third_charge, third_charge_trace : scalar or array_like
        To ∂_i∂_j Q and to ∇²Q δ_ij.
    third_field, third_field_trace : scalar or array_like
        To ∂_i E_j and to ∇·E δ_ij.
    variance_flux, flux_variance : scalar or array_like
        To ∇·N and to ∇V, with γ².
    variance_covariance_gradient, variance_covariance_gradient_regain : scalar or array_like
        To C·∇Q, with γ and with γ².
    variance_covariance_field, variance_covariance_field_regain : scalar or array_like
        To C·E, with β and with β γ.
    variance_covariance, variance_covariance_regain : scalar or array_like
        To |C|², with γ and with γ².
    variance_gradient, variance_gradient_field : scalar or array_like
        To |∇Q|², with γ², and to E·∇Q, with β γ.
    """

    collision_rate: Any
    charge_field: Any
    charge_laplacian: Any
    charge_covariance: Any
    covariance_field: Any
    covariance_gradient: Any
    covariance_velocity: Any
    covariance_exchange: Any
    third_velocity: Any
    third_velocity_trace: Any
    third_exchange: Any
    third_exchange_trace: Any
    third_shear: Any
    third_divergence: Any
    variance_exchange: Any
    variance_regain: Any
    variance_field: Any
    variance_laplacian: Any
    flux_velocity: Any
    flux_exchange: Any
    flux_regain: Any
    charge_third: Any = None
    charge_third_trace: Any = None
    covariance_third: Any = None
    covariance_third_trace: Any = None
    covariance_curvature: Any = None
    covariance_curvature_trace: Any = None
    third_charge: Any = None
    third_charge_trace: Any = None
    third_field: Any = None
    third_field_trace: Any = None
    variance_flux: Any = None
    flux_variance: Any = None
    variance_covariance_gradient: Any = None
    variance_covariance_gradient_regain: Any = None
    variance_covariance_field: Any = None
    variance_covariance_field_regain: Any = None
    variance_covariance: Any = None
    variance_covariance_regain: Any = None
    variance_gradient: Any = None
    variance_gradient_field: Any = None


def isotropic_parts(trace: Any, product: Any) -> tuple[Any, Any]:
    """Return p and s of the isotropic M_ij(A) = p A_mm δ_ij + s (A_ij + A_ji)/2.

    Parameters
    ----------
    trace : scalar or array_like
        M_ii for A_ij = δ_ij, which is 9 p + 3 s.
    product : scalar or array_like
        The sum over i and j of M_ij for the A that is one at i, j alone: 3 p + 6 s.

    Returns
    -------
    tuple of scalar or array_like
        p and s.
    """
    return (2 * trace - product) / 15, (3 * product - trace) / 15


def coefficients(responses: Responses, restitution: Any) -> dict[str, Any]:
    """Return the closure coefficients that the responses of the collision integrals amount to.

    It compares C(ψ) with the closed equations: (2.24)-(2.27), (3.4)-(3.6), (A11), (4.2), (B2),
    (5.20) and (5.21). Only arithmetic is done, so arrays and symbols pass through. What the paper
    drops is compared with docs/closures.md.

    Parameters
    ----------
    responses : Responses
        As sampled or as integrated.
    restitution : scalar
        e, dimensionless.

    Returns
    -------
    dict of str to scalar or array_like
        By the names of `triboflux.closures.complete`, without ``third_moment_drag``, which is not
        collisional; `ADDITIONS` are there too. Where e = 0 the two productions of covariance are
        missing, and that of N is: the equations multiply them by e. Those of the dropped terms are
        missing where no answer to their causes is known.
    """
    r = responses
    conductivity, dispersion, flux = -r.charge_field, r.charge_laplacian, -r.charge_covariance
    exchange = -r.variance_exchange
    found = {
        "triboconductivity": conductivity,
        "dispersion": dispersion,
        "collisional_flux": flux,
        "charge_exchange": exchange,
        "covariance_collision": -r.covariance_velocity / r.collision_rate,
        "covariance_exchange": -r.covariance_exchange / exchange,
        "third_moment_collision": -r.third_velocity / r.collision_rate,
        "third_moment_exchange": -r.third_exchange / exchange,
        "third_moment_trace": -r.third_velocity_trace / r.collision_rate,
        "third_moment_shear": -r.third_shear / exchange,
        "third_moment_divergence": -r.third_divergence / exchange,
        "variance_regain": r.variance_regain * r.collision_rate / dispersion**2,
        "variance_production_field": r.variance_field * r.collision_rate / conductivity**2,
        "variance_dispersion": r.variance_laplacian * r.collision_rate / dispersion**2,
        "variance_flux_exchange": -r.flux_exchange / exchange,
        "variance_flux_regain": r.flux_regain / exchange,
        "exchange_time": dispersion / exchange,
        "collisional_flux_number": flux / dispersion,
        "transferred_fraction": r.collision_rate / dispersion,
        "collision_rate": r.collision_rate,
        "third_moment_exchange_trace": -r.third_exchange_trace / exchange,
    }
    found["variance_flux_product"] = found["variance_flux_regain"] * found["transferred_fraction"]
    if restitution != 0:
        by_field, by_gradient = r.covariance_field, -r.covariance_gradient
        found["covariance_production_field"] = by_field / (restitution * conductivity)
        found["covariance_production_gradient"] = by_gradient / (restitution * dispersion)
    if r.charge_third is None:
        return found
    if restitution != 0:
        found["variance_flux_production"] = r.flux_variance / (restitution * r.variance_flux)
    return found | _dropped(r, found)


def _dropped(r: Responses, found: Mapping[str, Any]) -> dict[str, Any]:
    """Return the coefficients of what the paper's derivation drops."""
    conductivity, dispersion = found["triboconductivity"], found["dispersion"]
    flux, flux_of_variance = found["collisional_flux"], -r.variance_flux
    return {
        "charge_third_moment": r.charge_third / (2 * dispersion),
        "charge_third_moment_trace": r.charge_third_trace / dispersion,
        "covariance_third_moment": -r.covariance_third / (2 * flux),
        "covariance_third_moment_trace": -r.covariance_third_trace / flux,
        "covariance_collisional_dispersion": r.covariance_curvature / dispersion,
        "covariance_collisional_dispersion_divergence": r.covariance_curvature_trace
        / (2 * dispersion),
        "third_moment_flux": r.third_charge / (2 * dispersion),
        "third_moment_flux_trace": r.third_charge_trace / dispersion,
        "third_moment_flux_field": -r.third_field / (2 * conductivity),
        "third_moment_flux_field_trace": -r.third_field_trace / conductivity,
        "variance_collisional_flux": flux_of_variance,
        "variance_covariance_exchange": -r.variance_covariance / found["charge_exchange"],
        "variance_covariance_regain": r.variance_covariance_regain / found["charge_exchange"],
        "variance_production_gradient": r.variance_gradient * r.collision_rate / dispersion**2,
        "variance_production_mixed": -r.variance_gradient_field
        * r.collision_rate
        / (2 * dispersion * conductivity),
        "variance_covariance_gradient": r.variance_covariance_gradient / flux,
        "variance_covariance_gradient_regain": -r.variance_covariance_gradient_regain
        / flux_of_variance,
        "variance_covariance_field": -r.variance_covariance_field / flux,
        "variance_covariance_field_regain": r.variance_covariance_field_regain / flux_of_variance,
    }
