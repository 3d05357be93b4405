"""From the seven numbers and a closure set to the coefficients of the equations."""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import equinox as eqx
from jaxtyping import Array, Float

from triboflux.closures import ClosureSet
from triboflux.dropped_rates import DroppedRates, scaled_dropped_rates
from triboflux.errors import OutOfRangeError
from triboflux.hierarchy import MODELS
from triboflux.rates import scaled_rates, transfer_warnings

LONGEST_WAVE = 2.0 * math.pi
"""Wave number of what varies over L."""
MOST_TAKEN_BACK = 0.5
"""Of the electric force by the closed flux of the covariance, for the longest wave."""

Scalar: TypeAlias = float | Float[Array, "..."]
"""One number, or one for each point where the granular temperature varies."""


class TransportCoefficients(eqx.Module):
    """The coefficients of (5.2)-(5.4), dimensionless with L, √Θ and Q0.

    Attributes
    ----------
    flux : Scalar
        1 + η of the kinetic flux.
    triboconductivity : Scalar
        1/τ_σ.
    dispersion : Scalar
        1/Pe.
    gradient_production : Scalar
        P, covariance from the charge gradient.
    field_production : Scalar
        S, covariance from the electric field.
    electric_force : Scalar
        u = u_e/u_k.
    covariance_destruction : Scalar
        R.
    third_moment : Scalar
        K1.
    third_moment_trace : Scalar
        K1 + n_t K2.
    third_moment_coupling : Scalar
        K2.
    shear : Scalar
        G1.
    divergence : Scalar
        G2.
    covariance_dispersion : Scalar
        G1/K1, in front of ∇²C.
    divergence_dispersion : Scalar
        What stands in front of ∇∇·C.
    variance_destruction : Scalar
        F.
    variance_field_production : Scalar
        B.
    variance_collisional_dispersion : Scalar
        Dv_coll.
    variance_flux_destruction : Scalar
        The bracket of (4.3), 1/Dv_kin.
    transferred_fraction : Scalar
        γΘ^(a/2), the mean fraction of the charge difference that a collision passes over.
    granular_temperature : Scalar
        Θ that they hold for, scaled by that of the numbers.
    dropped : DroppedRates or None
        What the paper's derivation drops; None where the equations are without.
    """

    flux: Scalar
    triboconductivity: Scalar
    dispersion: Scalar
    gradient_production: Scalar
    field_production: Scalar
    electric_force: Scalar
    covariance_destruction: Scalar
    third_moment: Scalar
    third_moment_trace: Scalar
    third_moment_coupling: Scalar
    shear: Scalar
    divergence: Scalar
    covariance_dispersion: Scalar
    divergence_dispersion: Scalar
    variance_destruction: Scalar
    variance_field_production: Scalar
    variance_collisional_dispersion: Scalar
    variance_flux_destruction: Scalar
    transferred_fraction: Scalar
    granular_temperature: Scalar = 1.0
    dropped: DroppedRates | None = None

    @property
    def variance_flux_production(self) -> Scalar:
        """By what -∂_i V produces N_i, for R_ij = Θ δ_ij, with collisions where they do so."""
        collisional = 0.0 if self.dropped is None else self.dropped.variance_flux_gradient
        return self.granular_temperature + collisional

    @property
    def force_taken_back(self) -> Scalar:
        """Part of the force u E V on C that a closed T_ij takes back, over squared wave numbers.

        The wave is one of V along E; T_xx = 2 u E N_x (1 − K2/(K1 + 3 K2))/K1.
        """
        flux = self.variance_flux_production / self.variance_flux_destruction
        coupling = self.third_moment_coupling / self.third_moment_trace
        return 2.0 * flux * (1.0 - coupling) / self.third_moment

    @property
    def longitudinal_dispersion(self) -> Scalar:
        """Dispersion of a covariance that is parallel to its own gradient.

        That by collisions is among it where the equations have it.
        """
        kinetic = self.covariance_dispersion + self.divergence_dispersion
        if self.dropped is None:
            return kinetic
        trace = (2.0 * self.shear + 3.0 * self.divergence) / self.third_moment_trace
        by_third = self.dropped.covariance_third_moment * (2.0 * kinetic + trace)
        return kinetic + by_third + 3.0 * self.dropped.covariance_dispersion


def transport_coefficients(
    numbers: Any,
    closure_set: Any,
    dimensions: int,
    trace_dimensions: int | None = None,
    velocity: Scalar = 1.0,
) -> TransportCoefficients:
    """Return the coefficients of the transport equations.

    Parameters
    ----------
    numbers : Numbers
        The seven dimensionless numbers. Values may be traced JAX scalars.
    closure_set : ClosureSet
        Made for the restitution of `numbers`, or its values in a pytree.
    dimensions : int
        Number of space dimensions of the grid, which `published` takes as that of a trace.
    trace_dimensions : int, optional
        n_t, instead of what the closure set takes.
    velocity : Scalar or Array
        Root of a granular temperature other than that of the numbers, scaled by √Θ; an array makes
        arrays of the coefficients that depend on it.

    Returns
    -------
    TransportCoefficients
        Not checked; see `validity`.
    """
    transfer = velocity ** (1.0 + closure_set.exponent)
    rates = scaled_rates(closure_set, numbers, velocity, transfer)
    k1, k2 = rates.third_moment, rates.third_moment_trace
    g1, g2 = rates.shear, rates.divergence
    n_t = trace_dimensions
    n_t = closure_set.trace_dimensions(dimensions) if n_t is None else n_t
    trace_part = k2 * (2.0 * g1 + n_t * g2) / (k1 + n_t * k2)
    return TransportCoefficients(
        flux=1.0 + rates.collisional_flux,
        triboconductivity=transfer / numbers.tau_sigma,
        dispersion=transfer / numbers.peclet,
        gradient_production=rates.gradient_production,
        field_production=rates.field_production,
        electric_force=numbers.energy_ratio,
        covariance_destruction=rates.covariance_destruction,
        third_moment=k1,
        third_moment_trace=k1 + n_t * k2,
        third_moment_coupling=k2,
        shear=g1,
        divergence=g2,
        covariance_dispersion=g1 / k1,
        divergence_dispersion=(g1 + g2 - trace_part) / k1,
        variance_destruction=rates.variance_destruction,
        variance_field_production=rates.variance_field_production,
        variance_collisional_dispersion=rates.variance_collisional_dispersion,
        variance_flux_destruction=rates.variance_flux_destruction,
        transferred_fraction=rates.transferred_fraction,
        granular_temperature=velocity**2,
        dropped=scaled_dropped_rates(closure_set, rates, numbers, velocity, transfer)
        if closure_set.complete
        else None,
    )


def covariance_destroys_variance(dropped: DroppedRates) -> bool:
    """Return whether |C|² takes variance away, as it does unless γΘ^(a/2) is large.

    Parameters
    ----------
    dropped : DroppedRates
        With concrete values.
    """
    return float(dropped.variance_covariance_destruction) >= 0.0


def _closed_force_warnings(c: TransportCoefficients) -> list[str]:
    """Say so if the closed T_ij of `complete` answers more to the electric force than it can."""
    taken = float(c.force_taken_back) * LONGEST_WAVE**2
    if c.dropped is None or not float(c.electric_force) > 0.0 or taken <= MOST_TAKEN_BACK:
        return []
    return [
        f"the closed flux of the covariance takes back {taken:.0%} of the electric force on a "
        "variance that varies over L, and more over shorter lengths: collisions are too rare for "
        "it, so take the third-order model, or derived closures."
    ]


def validity(
    coefficients: TransportCoefficients,
    closure_set: ClosureSet,
    allow_out_of_range: bool = False,
    *,
    model_name: str = "full",
) -> tuple[str, ...]:
    """Check the range of validity of the closures and return warnings, one sentence each.

    Parameters
    ----------
    coefficients : TransportCoefficients
        With concrete values.
    closure_set : ClosureSet
        Where they come from.
    allow_out_of_range : bool
        Accept collisions that on average pass over more than the charge difference.
    model_name : str
        Only what this model contains is checked.

    Raises
    ------
    OutOfRangeError
        If a quantity that has to be positive is not, or γΘ^(a/2) is at or above its limit; the
        sentence names the quantity.
    """
    c = coefficients
    positive = {
        "the covariance destruction rate R": c.covariance_destruction,
        "K1 of the third-order moment": c.third_moment,
        "K1 + n_t K2 of the third-order moment": c.third_moment_trace,
        "the relaxation rate of ⟨ξ'ξ'c'⟩ in Dv_kin": c.variance_flux_destruction,
        "G1 of the third-order moment": c.shear,
        "the longitudinal dispersion of the covariance": c.longitudinal_dispersion,
    }
    first, *_ = positive
    contained = {
        "self-consistent-flow": tuple(positive),
        "self-consistent": tuple(positive),
        "third-order": tuple(positive),
        "full": tuple(positive),
        "semi-algebraic": (first, "the relaxation rate of ⟨ξ'ξ'c'⟩ in Dv_kin"),
        "algebraic": (first,),
        "gradient": (first,),
        "collisional": (),
    }
    for name in contained[model_name]:
        value = positive[name]
        if not float(value) > 0.0:
            raise OutOfRangeError(
                f"numbers: {name} is {float(value):.4g}; it must be positive for the "
                f"'{closure_set.name}' closures to hold: take a smaller tau_c or a larger peclet."
            )
    fraction = float(coefficients.transferred_fraction)
    warnings = list(transfer_warnings(fraction, closure_set.exponent, allow_out_of_range))
    growth = -float(coefficients.variance_destruction)
    has_variance = "variance" in MODELS[model_name].evolves
    if c.dropped is not None and has_variance and not covariance_destroys_variance(c.dropped):
        warnings.append(
            f"γΘ^(a/2) = {fraction:.4g}: collisions are so strong that the squared covariance "
            "produces variance instead of destroying it."
        )
    if model_name == "full":
        warnings += _closed_force_warnings(c)
    if has_variance and (growth > 0.0 or (growth == 0.0 and fraction > 0.0)):
        origin = (
            "because the printed λ' = 12 is inverted"
            if closure_set.name == "published"
            else "outside the range of the closures"
        )
        warnings.append(f"F <= 0: the charge variance grows as exp({growth:.3g} t), {origin}.")
    return tuple(warnings)
