"""The closed coefficients of the transport equations, written once for all units.

Everything follows from six quantities: diameter, root of the granular temperature, collision time,
drag rate, collisional dispersion D and conduction σ/n. In SI these come from the state of a
suspension, `suspension_transport`; scaled by L, √Θ and Q0 they are d/L, 1, τ_c, 1/τ_p, 1/Pe and
1/τ_σ. `closure_rates` turns either into the coefficients of the equations;
`triboflux.dropped_rates` adds those of the terms that the paper's derivation drops.

The functions do arithmetic only, so that floats, JAX arrays, symbols and quantities with units all
pass through them.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol, runtime_checkable

from triboflux.closures import collision_integral, fraction_limit
from triboflux.errors import OutOfRangeError

WARN_TRANSFERRED_FRACTION = 0.25
"""The γΘ^(a/2) from which the linear law of charge transfer is told to be strained."""


@runtime_checkable
class ClosureValues(Protocol):
    """Values of closure coefficients by their spelled-out names, such as a `ClosureSet`."""

    def __getitem__(self, name: str, /) -> Any:
        """Return the value of one coefficient."""
        ...


class SuspensionTransport(NamedTuple):
    """What a suspension brings into the closures.

    Attributes
    ----------
    collision_rate : float
        1/τ_c, collisions of a particle per time, 1/s; (3.5).
    dispersion : float
        D, collisional dispersion of the mean charge, m²/s; (2.26).
    conductivity : float
        σ, triboconductivity, S/m; (2.25).
    transferred_fraction : float
        γΘ^(a/2), the mean part of the charge difference that a collision passes over.
    """

    collision_rate: Any
    dispersion: Any
    conductivity: Any
    transferred_fraction: Any


def suspension_transport(
    closures: ClosureValues,
    exponent: Any,
    *,
    diameter: Any,
    number_density: Any,
    granular_temperature: Any,
    radial_distribution: Any,
    charge_transfer: Any,
    field_transfer: Any,
) -> SuspensionTransport:
    """Return collision rate, dispersion and triboconductivity of a suspension, (2.25)-(3.5).

    Parameters
    ----------
    closures : ClosureValues
        With ``"dispersion"`` (λ1.2) and ``"triboconductivity"`` (λ1.1) by name.
    exponent : float
        a of the charge-transfer law, dimensionless.
    diameter : float
        d, m.
    number_density : float
        n, particles per m³.
    granular_temperature : float
        Θ, m²/s².
    radial_distribution : float
        g0 at contact, dimensionless.
    charge_transfer, field_transfer : float
        γ, per (m/s)^a, and β, C/(V/m) per (m/s)^a; see `triboflux.collision`.

    Returns
    -------
    SuspensionTransport
        In SI, or in any other consistent units.
    """
    velocity = granular_temperature**0.5
    fraction = charge_transfer * velocity**exponent
    pairs = radial_distribution * number_density * diameter**2
    return SuspensionTransport(
        collision_rate=collision_integral(1.0) * pairs * velocity,
        dispersion=closures["dispersion"] * pairs * diameter**2 * fraction * velocity,
        conductivity=closures["triboconductivity"]
        * (pairs * number_density * diameter)
        * (field_transfer * velocity**exponent * velocity),
        transferred_fraction=fraction,
    )


class ClosureRates(NamedTuple):
    """The closed coefficients of the equations for Q, C and V.

    Units are SI; the scaled equations have the same with L = √Θ = Q0 = 1 and E in n Q0 L/ε0.

    Attributes
    ----------
    collisional_flux : float
        η of (2.27), dimensionless.
    charge_exchange : float
        1/τ_ξ of (3.6), 1/s.
    gradient_production : float
        Θ P, covariance from the charge gradient, m²/s²; (3.4).
    field_production : float
        S, covariance from the electric field, C²/kg; (3.4).
    covariance_destruction : float
        R, 1/s; (3.3) and (3.4).
    third_moment : float
        K1, 1/s; (3.8).
    third_moment_trace : float
        K2, 1/s; (3.9).
    shear, divergence : float
        Θ G1 and Θ G2, in front of ∂_i C_j + ∂_j C_i and ∇·C δ_ij, m²/s²; (3.10).
    variance_destruction : float
        F, 1/s; (4.2).
    variance_field_production : float
        B, in front of |E|², C⁴ s³/(kg² m²); (4.2).
    variance_collisional_dispersion : float
        Dv_coll, m²/s; (4.2).
    variance_flux_destruction : float
        The bracket of (4.3), 1/s.
    transferred_fraction : float
        γΘ^(a/2), dimensionless.
    """

    collisional_flux: Any
    charge_exchange: Any
    gradient_production: Any
    field_production: Any
    covariance_destruction: Any
    third_moment: Any
    third_moment_trace: Any
    shear: Any
    divergence: Any
    variance_destruction: Any
    variance_field_production: Any
    variance_collisional_dispersion: Any
    variance_flux_destruction: Any
    transferred_fraction: Any


def closure_rates(
    closures: ClosureValues,
    *,
    restitution: Any,
    diameter: Any,
    velocity: Any,
    collision_time: Any,
    drag_rate: Any,
    dispersion: Any,
    conduction: Any,
) -> ClosureRates:
    """Return the coefficients of (2.24), (3.1)-(3.10) and (4.1)-(4.3).

    Parameters
    ----------
    closures : ClosureValues
        All closure coefficients, made for `restitution`.
    restitution : float
        e, dimensionless.
    diameter : float
        d, m; scaled d/L.
    velocity : float
        √Θ, m/s; scaled 1.
    collision_time : float
        τ_c, s; inf without collisions.
    drag_rate : float
        1/τ_p, 1/s; 0 without drag.
    dispersion : float
        D, m²/s; scaled 1/Pe.
    conduction : float
        σ/n, S m²; scaled 1/τ_σ.

    Returns
    -------
    ClosureRates
        Not checked; see `triboflux.models.validity`.
    """
    c = closures
    collision_rate = 1.0 / collision_time
    swept = dispersion / diameter**2
    exchange = swept / c["exchange_time"]
    temperature = velocity**2
    # A mechanism is absent, not infinitely strong, where both factors are at their limits.
    per_collision = _times(collision_time, swept)
    conducted = _times(collision_time, conduction) * conduction / diameter**2
    speed = restitution * velocity / diameter
    destruction = c["covariance_collision"] * collision_rate + drag_rate
    return ClosureRates(
        collisional_flux=c["collisional_flux_number"] * swept * diameter / velocity,
        charge_exchange=exchange,
        gradient_production=temperature + c["covariance_production_gradient"] * speed * dispersion,
        field_production=c["covariance_production_field"] * speed * conduction,
        covariance_destruction=destruction + c["covariance_exchange"] * exchange,
        third_moment=c["third_moment_collision"] * collision_rate
        + c["third_moment_drag"] * drag_rate
        + c["third_moment_exchange"] * exchange,
        third_moment_trace=c["third_moment_trace"] * collision_rate,
        shear=temperature + c["third_moment_shear"] * diameter * velocity * exchange,
        divergence=c["third_moment_divergence"] * diameter * velocity * exchange,
        variance_destruction=exchange - c["variance_regain"] * per_collision * swept,
        variance_field_production=c["variance_production_field"] * conducted,
        variance_collisional_dispersion=c["variance_dispersion"] * per_collision * dispersion,
        variance_flux_destruction=destruction
        + (c["variance_flux_exchange"] - c["variance_flux_product"] * per_collision) * exchange,
        transferred_fraction=c["transferred_fraction"] * per_collision,
    )


def scaled_rates(
    closures: ClosureValues, numbers: Any, velocity: Any = 1.0, transfer: Any = 1.0
) -> ClosureRates:
    """Return the coefficients of the scaled equations (5.2)-(5.4).

    Parameters
    ----------
    closures : ClosureValues
        All closure coefficients, made for the restitution of `numbers`.
    numbers : Numbers
        The seven dimensionless numbers; values may be traced JAX scalars.
    velocity : scalar
        Root of a granular temperature other than that of the numbers, scaled by √Θ.
    transfer : scalar
        ``velocity**(1 + a)``, what the charge that collisions pass over grows with.

    Returns
    -------
    ClosureRates
        Scaled by L, √Θ and Q0.
    """
    return closure_rates(
        closures,
        restitution=numbers.restitution,
        diameter=1.0 / numbers.length_ratio,
        velocity=velocity,
        collision_time=numbers.tau_c / velocity,
        drag_rate=1.0 / numbers.tau_p,
        dispersion=transfer / numbers.peclet,
        conduction=transfer / numbers.tau_sigma,
    )


def _times(time: Any, rate: Any) -> Any:
    """Return time * rate, 0 where the rate vanishes identically and the time may be infinite."""
    return 0.0 if isinstance(rate, float) and rate == 0.0 else time * rate


def transfer_warnings(
    fraction: float, exponent: float, allow_out_of_range: bool = False
) -> tuple[str, ...]:
    """Refuse collisions that pass over too much charge, or say so, in a sentence.

    Parameters
    ----------
    fraction : float
        γΘ^(a/2), dimensionless.
    exponent : float
        a of the collision rule.
    allow_out_of_range : bool
        Warn instead of refusing.

    Raises
    ------
    OutOfRangeError
        If collisions on average pass over more than the charge difference.
    """
    limit = fraction_limit(exponent)
    sentence = (
        f"γΘ^(a/2) = {fraction:.4g}: collisions on average pass over more than the charge "
        f"difference (the limit is {limit:.4g})"
    )
    if fraction >= limit:
        if not allow_out_of_range:
            raise OutOfRangeError(
                f"numbers: {sentence}; take a smaller tau_c or a larger peclet, "
                "or set run.allow_out_of_range = true."
            )
        return (f"{sentence}, outside the range of the closures.",)
    if fraction >= WARN_TRANSFERRED_FRACTION:
        return (
            f"γΘ^(a/2) = {fraction:.4g}: collisions pass over a large part of the charge "
            f"difference; the linear law wants it well below 1/2.",
        )
    return ()
