"""What the collision integrals answer to single causes, and the closure coefficients that follow.

The integrals are sampled in `triboflux.sampling`; the benchmarks do them by computer algebra. Both
need the same comparison of C(ψ) with the closed equations, which stands here.
"""

from __future__ import annotations

from typing import Any, NamedTuple

ADDITIONS = ("collision_rate", "third_moment_exchange_trace")
"""What `coefficients` returns beside the closure sets: J_1, and the part of K2 with 1/tau_xi, 0."""


class Responses(NamedTuple):
    """What C(ψ) answers to one cause at a time: the factors in isotropic tensors.

    In units of n² g0 d² times powers of Θ, d, β and γ. In the names, ``charge`` is C(ξ),
    ``covariance`` C(ξ c_i), ``third`` C(ξ c_i c_j) − Θ δ_ij C(ξ), ``variance`` C(ξξ) and ``flux``
    C(ξξ c_i), where ξ is always counted from the local mean charge Q. The causes are E and its
    gradient (with β), derivatives of Q, C_i = ⟨ξ'c'_i⟩, T_ij = ⟨ξ'c'_i c'_j⟩, V = ⟨ξ'ξ'⟩ and
    N_i = ⟨ξ'ξ'c'_i⟩.

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
    (5.20) and (5.21). Only arithmetic is done, so arrays and symbols pass through.

    Parameters
    ----------
    responses : Responses
        As sampled or as integrated.
    restitution : scalar
        e, dimensionless.

    Returns
    -------
    dict of str to scalar or array_like
        By the names of `triboflux.closures.derived`, without ``third_moment_drag``, which is not
        collisional; `ADDITIONS` are there too. Where e = 0 the two productions of covariance are
        missing: the equations multiply them by e.
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
    return found
