"""What a suspension means for the models: coefficients in SI, regime, model, warnings."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from triboflux import closures
from triboflux.advice import advice_without_model, advise
from triboflux.collision import HERTZ_EXPONENT
from triboflux.model_errors import WAVE_NUMBER, ModelError
from triboflux.numbers import Numbers, from_suspension, transport_of
from triboflux.rates import (
    WARN_TRANSFERRED_FRACTION,
    ClosureRates,
    SuspensionTransport,
    closure_rates,
    scaled_rates,
)
from triboflux.scales import Scales

if TYPE_CHECKING:
    from triboflux.suspension import Suspension

_STRONG_COLLISIONS = 0.01
_NEAR_PACKING = 0.9
_LARGE_KNUDSEN = 0.1
_WARM = 0.1
_BREAKDOWN = 3e6
_DISPERSIVE = 0.3


@dataclass(frozen=True)
class Quantity:
    """One number with its meaning.

    Attributes
    ----------
    symbol : str
        The field's notation.
    meaning : str
        In words.
    value : float
        In SI.
    unit : str
        SI unit; empty for a dimensionless number.
    equation : str
        Where the paper defines it; empty where it does not.
    """

    symbol: str
    meaning: str
    value: float
    unit: str
    equation: str = ""


@dataclass(frozen=True)
class Assessment:
    """What `assess` finds.

    Attributes
    ----------
    coefficients : tuple of Quantity
        Transport coefficients and times, SI.
    numbers : Numbers
        The seven dimensionless numbers.
    regime : str
        ``"kinetic"``, ``"dense"`` or ``"intermediate"``.
    model : str
        Name of the cheapest model that suits; ``"none"`` outside the range of the closures.
    reasons : tuple of str
        Sentences that say why, with the numbers that decide.
    errors : tuple of ModelError
        What is known of each reduced model; empty where nothing is.
    origin : str
        Where the errors are from: ``"table"``, ``"computed"``, or ``"none"``.
    warnings : tuple of str
        Sentences about what the models leave out here.
    """

    coefficients: tuple[Quantity, ...]
    numbers: Numbers
    regime: str
    model: str
    reasons: tuple[str, ...]
    errors: tuple[ModelError, ...]
    origin: str
    warnings: tuple[str, ...]


def assess(
    suspension: Suspension, closure_name: str = "derived", *, compute: bool = False
) -> Assessment:
    """Compute the coefficients of a suspension and say which model suits it.

    Parameters
    ----------
    suspension : Suspension
        Particles, gas and state.
    closure_name : str
        One of `triboflux.closures.NAMES`.
    compute : bool
        Run all models for a wave of charge over the whole domain, which takes seconds, instead of
        looking their errors up in the table of `triboflux.model_table`.

    Returns
    -------
    Assessment
        Coefficients, numbers, regime, the model that suits, and what to beware of.

    Raises
    ------
    InputError
        If the closure set is unknown, or a number leaves the range of `Numbers`.
    """
    transport = transport_of(suspension, closure_name)
    rates = _rates(suspension, transport, closure_name)
    numbers = from_suspension(suspension, closure_name)
    closure_set = closures.by_name(closure_name, suspension.restitution)
    scaled = scaled_rates(closure_set, numbers)
    regime, about = regime_of(numbers.peclet, scaled)
    if scaled.transferred_fraction >= closures.fraction_limit(HERTZ_EXPONENT):
        advice = advice_without_model(scaled.transferred_fraction)
    else:
        advice = advise(numbers, closure_name, compute=compute)
    return Assessment(
        coefficients=_coefficients(suspension, transport, rates),
        numbers=numbers,
        regime=regime,
        model=advice.model,
        reasons=(*((about,) if advice.model != "none" else ()), *advice.reasons),
        errors=advice.errors,
        origin=advice.origin,
        warnings=_warnings(suspension, transport, rates, numbers),
    )


def _rates(s: Suspension, transport: SuspensionTransport, closure_name: str) -> ClosureRates:
    """Return the coefficients of the equations in SI."""
    return closure_rates(
        closures.by_name(closure_name, s.restitution),
        restitution=s.restitution,
        diameter=s.diameter,
        velocity=s.velocity_scale,
        collision_time=1.0 / transport.collision_rate,
        drag_rate=1.0 / s.drag_time,
        dispersion=transport.dispersion,
        conduction=transport.conductivity / s.number_density,
    )


def mean_free_path(suspension: Suspension, transport: SuspensionTransport) -> float:
    """Return the mean free path √(8Θ/π) τ_c between collisions, m.

    Parameters
    ----------
    suspension : Suspension
        Gives Θ.
    transport : SuspensionTransport
        Gives τ_c.
    """
    return math.sqrt(8.0 / math.pi) * suspension.velocity_scale / transport.collision_rate


def _coefficients(
    s: Suspension, transport: SuspensionTransport, rates: ClosureRates
) -> tuple[Quantity, ...]:
    """Return what an engineer wants to see in SI."""
    make = Quantity
    return (
        make("m", "mass of a particle", s.mass, "kg"),
        make("n", "particles per volume", s.number_density, "1/m^3"),
        make("g0", "radial distribution at contact", s.contact_radial_distribution, ""),
        make("sigma_p", "triboconductivity", transport.conductivity, "S/m", "(2.25)"),
        make("D_p", "collisional dispersion", transport.dispersion, "m^2/s", "(2.26)"),
        make("eta_coll", "collisional part of the flux", rates.collisional_flux, "", "(2.27)"),
        make("tau_c", "time between collisions", 1.0 / transport.collision_rate, "s", "(3.5)"),
        make("tau_xi", "charge exchange time", 1.0 / rates.charge_exchange, "s", "(3.6)"),
        make("tau_p", "drag time", s.drag_time, "s", "(2.2)"),
        make("1/R", "covariance relaxation", 1.0 / rates.covariance_destruction, "s", "(3.4)"),
        make(
            "epsilon_0/sigma",
            "charge relaxation time",
            s.permittivity / transport.conductivity,
            "s",
            "(5.14)",
        ),
        make(
            "gamma Theta^(a/2)",
            "mean fraction of the charge difference passed over",
            transport.transferred_fraction,
            "",
            "(2.14)",
        ),
        make("l", "mean free path", mean_free_path(s, transport), "m"),
        make("Kn", "Knudsen number, l/L", mean_free_path(s, transport) / s.domain_length, ""),
    )


def regime_of(peclet: float, rates: ClosureRates) -> tuple[str, str]:
    """Return the regime and a sentence about it.

    Parameters
    ----------
    peclet : float
        Péclet number.
    rates : ClosureRates
        Coefficients of the equations, scaled.

    Returns
    -------
    tuple of str
        ``"kinetic"``, ``"dense"`` or ``"intermediate"``, and the sentence.
    """
    kinetic = peclet / rates.covariance_destruction
    regime = "kinetic" if kinetic > 10.0 else "dense" if kinetic < 0.1 else "intermediate"
    carried = {
        "kinetic": "by the random motion of the particles",
        "dense": "by collisions",
        "intermediate": "by collisions and by random motion alike",
    }[regime]
    return regime, (
        f"Peclet number times covariance relaxation time is {kinetic:.3g}: charge disperses "
        f"{carried}."
    )


def _warnings(
    s: Suspension, transport: SuspensionTransport, rates: ClosureRates, numbers: Numbers
) -> tuple[str, ...]:
    """Return sentences about limits of the models that this suspension comes near."""
    found: list[str] = []
    fraction = transport.transferred_fraction
    # the approach velocities g of collisions are distributed as g exp(-g^2/(4 Theta))
    strong = math.exp(-0.25 * (0.5 / fraction) ** (2.0 / HERTZ_EXPONENT)) if fraction else 0.0
    if fraction >= WARN_TRANSFERRED_FRACTION or strong > _STRONG_COLLISIONS:
        found.append(
            f"gamma (g.k)^a is above 1/2 in {strong:.1%} of the collisions, and gamma "
            f"Theta^(a/2) = {fraction:.3g}: the linear law of charge transfer wants both small."
        )
    limit = s.maximum_packing
    if s.solid_fraction > _NEAR_PACKING * limit:
        found.append(
            f"solid_fraction = {s.solid_fraction:g} is near the packing limit {limit:g}: contacts "
            "last, and binary collisions describe them no longer."
        )
    knudsen = mean_free_path(s, transport) / s.domain_length
    if knudsen > _LARGE_KNUDSEN:
        found.append(
            f"The mean free path is {knudsen:.2g} of the domain length: particles cross it with "
            "few collisions, which moment models describe poorly."
        )
    lag = WAVE_NUMBER * s.velocity_scale / (rates.covariance_destruction * s.domain_length)
    if lag > _DISPERSIVE:
        found.append(
            f"2 pi sqrt(Theta)/(R L) = {lag:.2g}: the algebraic third-order moments disperse the "
            "covariance too strongly from about 0.3 on."
        )
    # energy of the field of -Q0 sin(2 pi x/L), over the kinetic energy 3/2 m Theta
    heating = numbers.energy_ratio / (6.0 * WAVE_NUMBER**2)
    if heating > _WARM:
        found.append(
            f"The field of a charge Q0 sin(2 pi x/L) holds {heating:.2g} times the kinetic energy "
            "of the random motion, which it would heat; the granular temperature is held fixed."
        )
    strongest = Scales.of(s).field / WAVE_NUMBER
    if strongest > _BREAKDOWN:
        found.append(
            f"A charge Q0 sin(2 pi x/L) makes a field of {strongest:.2g} V/m; air at ambient "
            f"pressure breaks down at about {_BREAKDOWN:.0e} V/m."
        )
    if s.softened_modulus:
        found.append(
            f"youngs_modulus = {s.youngs_modulus:.3g} Pa is marked as softened: sigma, D and the "
            "transferred fraction grow as its power -2/5."
        )
    return tuple(found)
