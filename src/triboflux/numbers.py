"""The seven dimensionless numbers of a case, and the way from and to a suspension in SI."""

from __future__ import annotations

import importlib
import itertools
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from pydantic import Field, model_validator

from triboflux import closures
from triboflux.drag import HIGHEST_VISCOUS_REYNOLDS_NUMBER
from triboflux.errors import InputError
from triboflux.rates import SuspensionTransport, suspension_transport
from triboflux.validation import (
    Fraction,
    InputModel,
    NonNegative,
    Positive,
    PositiveOrInfinite,
)

if TYPE_CHECKING:
    from triboflux.suspension import Suspension

_SAME = 1e-6
"""Relative difference up to which numbers typed with a few digits obey the hidden relations."""
_ROUND_OFF = 1e-14
"""Difference of a logarithm that is round-off."""


class Numbers(InputModel):
    r"""The seven dimensionless numbers.

    Lengths are scaled by the box length :math:`L`, velocities by :math:`\sqrt\Theta`
    (:math:`\Theta`: granular temperature), charges by :math:`Q_0`, times by
    :math:`L/\sqrt\Theta`; see Montilla, Ansart & Simonin (2023), section 5. An infinite time or
    Péclet number switches its mechanism off.

    Numbers that come from one real suspension are not independent of each other, see
    `from_suspension`; numbers typed by hand may be any.

    Attributes
    ----------
    peclet : float
        Péclet number :math:`L\sqrt\Theta/D` of triboelectric diffusion; may be inf.
    tau_c : float
        Time between the collisions of a particle. Inf means no collisions, which is accepted
        only if ``peclet`` and ``tau_sigma`` are inf and ``tau_p`` is finite.
    tau_p : float
        Drag time; inf (the default) means no drag.
    tau_sigma : float
        Time of triboelectric conduction; inf (the default) means none.
    energy_ratio : float
        Electric over kinetic energy, :math:`u = n Q_0^2 L^2/(\varepsilon_0 m \Theta)`.
    length_ratio : float
        Box length over particle diameter, :math:`L/d`.
    restitution : float
        Coefficient of restitution, from 0 to 1.

    Raises
    ------
    InputError
        If a number is missing or not allowed.
    """

    peclet: PositiveOrInfinite = Field(description="Péclet number, a positive number or inf")
    tau_c: PositiveOrInfinite = Field(description="collision time, a positive number or inf")
    tau_p: PositiveOrInfinite = math.inf
    tau_sigma: PositiveOrInfinite = math.inf
    energy_ratio: NonNegative = Field(description="electric over kinetic energy, 0 or positive")
    length_ratio: Positive = Field(description="box length over particle diameter, positive")
    restitution: Fraction = Field(description="coefficient of restitution, from 0 to 1")

    @model_validator(mode="after")
    def _collisionless_is_consistent(self) -> Numbers:
        if self.tau_c != math.inf:
            return self
        # every product with tau_c must be 0, and something must still relax the covariance
        for name in ("peclet", "tau_sigma"):
            value: float = getattr(self, name)
            if value != math.inf:
                raise InputError.about(
                    name, f"is {value!r}, but must be inf without collisions (tau_c = inf)"
                )
        if self.tau_p == math.inf:
            raise InputError.about(
                "tau_p", "is inf, but must be finite without collisions (tau_c = inf)"
            )
        return self


def transport_of(suspension: Suspension, closure_name: str = "derived") -> SuspensionTransport:
    """Return collision rate, dispersion and triboconductivity of a suspension, in SI.

    Parameters
    ----------
    suspension : Suspension
        Particles, gas and state.
    closure_name : str
        One of `triboflux.closures.NAMES`; decides λ1.1 and λ1.2 in (2.25) and (2.26).

    Raises
    ------
    InputError
        If the closure set is unknown.
    """
    s = suspension
    closure_set = closures.by_name(closure_name, s.restitution)
    return suspension_transport(
        closure_set,
        closure_set.exponent,
        diameter=s.diameter,
        number_density=s.number_density,
        granular_temperature=s.granular_temperature,
        radial_distribution=s.contact_radial_distribution,
        charge_transfer=s.charge_transfer,
        field_transfer=s.field_transfer,
    )


def from_suspension(suspension: Suspension, closure_name: str = "derived") -> Numbers:
    """Return the seven numbers of a suspension, by their definitions (5.13)-(5.19).

    They go through τ_c, D and σ of the suspension, which are not independent: with the solid
    fraction α = π n d³/6 and the radial distribution g0, ``tau_sigma = peclet (d/L)²/(6 α)`` and
    ``tau_c = (d/L) √π/(24 g0 α)``.

    Parameters
    ----------
    suspension : Suspension
        Particles, gas and state.
    closure_name : str
        One of `triboflux.closures.NAMES`; decides λ1.1 and λ1.2 in (2.25) and (2.26).

    Raises
    ------
    InputError
        If the closure set is unknown, or a number leaves the range of `Numbers`.
    """
    s = suspension
    transport = transport_of(s, closure_name)
    velocity, length = s.velocity_scale, s.domain_length
    charge_density = s.number_density * s.charge_scale
    return Numbers(
        peclet=length * velocity / transport.dispersion,
        tau_c=velocity / (transport.collision_rate * length),
        tau_p=s.drag_time * velocity / length,
        tau_sigma=s.permittivity * velocity / (transport.conductivity * length),
        energy_ratio=charge_density
        * s.charge_scale
        * length**2
        / (s.permittivity * s.mass * s.granular_temperature),
        length_ratio=length / s.diameter,
        restitution=s.restitution,
    )


def to_suspension(
    numbers: Numbers, reference: Suspension, closure_name: str = "derived"
) -> Suspension:
    """Return the suspension that has these numbers and resembles a given one.

    Solid fraction, Young's modulus, domain length, charge scale and restitution follow from the
    numbers, and so does the gas viscosity if `tau_p` is finite. Everything else is that of the
    reference: diameter, density, Poisson's ratio, granular temperature, gas density, permittivity,
    and the laws of drag and radial distribution.

    Parameters
    ----------
    numbers : Numbers
        They have to obey the relation between `tau_sigma` and `peclet`; see `from_suspension`.
    reference : Suspension
        Where everything comes from that the numbers leave open.
    closure_name : str
        The closure set of `from_suspension`.

    Returns
    -------
    Suspension
        `from_suspension` returns `numbers` again, to round-off; near the maximum packing that of
        the solid fraction is amplified by the steep radial distribution.

    Raises
    ------
    InputError
        If no such suspension exists; the sentence names the number.
    """
    for name in ("tau_c", "peclet"):
        if getattr(numbers, name) == math.inf:
            raise InputError.about(name, "is inf, but particles of a suspension collide")
    length = numbers.length_ratio * reference.diameter
    placed = _changed(
        reference,
        numbers,
        restitution=numbers.restitution,
        domain_length=length,
        solid_fraction=_solid_fraction(numbers, reference),
    )
    _require_conduction(numbers, placed)
    velocity = reference.velocity_scale
    # D tau_c is proportional to the contact length, and that to Young's modulus to the power -2/5;
    # unlike D alone it does not contain the radial distribution, which is steep near packing
    transport = transport_of(placed, closure_name)
    per_collision = transport.dispersion / transport.collision_rate
    softer = length**2 * numbers.tau_c / numbers.peclet / per_collision
    charge = math.sqrt(
        numbers.energy_ratio * reference.permittivity * reference.mass / placed.number_density
    )
    if numbers.tau_p == math.inf:
        drag: dict[str, Any] = {"drag": "none"}
    else:
        drag = {"gas_viscosity": _viscosity(numbers.tau_p * length / velocity, placed)}
    return _changed(
        placed,
        numbers,
        youngs_modulus=reference.youngs_modulus * softer**-2.5,
        charge_scale=charge * velocity / length,
        **drag,
    )


_ORIGINS = {
    "solid_fraction": "tau_c",
    "domain_length": "length_ratio",
    "youngs_modulus": "peclet",
    "charge_scale": "energy_ratio",
    "gas_viscosity": "tau_p",
}
"""The number from which each field of a suspension follows."""


def _changed(suspension: Suspension, numbers: Numbers, **fields: Any) -> Suspension:
    """Return a suspension with other fields, or refuse the number from which they follow."""
    try:
        return type(suspension)(**(suspension.model_dump() | fields))
    except InputError as error:
        if error.field not in _ORIGINS:
            raise
        name = _ORIGINS[error.field]
        raise InputError.about(
            name,
            f"is {getattr(numbers, name)!r}, from which follows that {error.field} {error.problem}",
        ) from None


def _solid_fraction(numbers: Numbers, reference: Suspension) -> float:
    """Return the solid fraction at which particles collide as often as the numbers say."""
    wanted = math.sqrt(math.pi) / (24.0 * numbers.tau_c * numbers.length_ratio)

    def excess(log_fraction: float) -> float:
        fraction = math.exp(log_fraction)
        there = reference.model_copy(update={"solid_fraction": fraction})
        return math.log(fraction * there.contact_radial_distribution / wanted)

    packed = math.log(reference.maximum_packing)
    log_fraction = _root(excess, packed - 150.0, packed - 1e-12)
    if log_fraction is None:
        raise InputError.about(
            "tau_c",
            f"is {numbers.tau_c!r}, but no solid fraction below {reference.maximum_packing:g} "
            f"gives it at length_ratio = {numbers.length_ratio!r}",
        )
    return math.exp(log_fraction)


def _require_conduction(numbers: Numbers, suspension: Suspension) -> None:
    """Refuse a conduction time that does not belong to the dispersion."""
    related = numbers.peclet / (6.0 * suspension.solid_fraction * numbers.length_ratio**2)
    if not math.isclose(numbers.tau_sigma, related, rel_tol=_SAME):
        raise InputError.about(
            "tau_sigma",
            f"is {numbers.tau_sigma!r}, but in a suspension it follows from peclet, length_ratio "
            f"and the solid fraction {suspension.solid_fraction:.6g} that tau_c implies: "
            f"{related!r}",
        )


def _viscosity(drag_time: float, suspension: Suspension) -> float:
    """Return a gas viscosity at which the drag law gives the drag time, the largest, in SI."""
    if suspension.drag == "none":
        raise InputError.about("tau_p", "is finite, but the reference suspension has drag = 'none'")

    def excess(log_viscosity: float) -> float:
        there = suspension.model_copy(update={"gas_viscosity": math.exp(log_viscosity)})
        return math.log(there.drag_time / drag_time)

    # at high Reynolds numbers the viscosity does not matter
    if abs(excess(math.log(suspension.gas_viscosity))) <= _ROUND_OFF:
        return suspension.gas_viscosity
    # the drag coefficient of a sphere jumps, at a Reynolds number with or without the gas fraction
    state = suspension.drag_state
    jump = math.log(state.gas_density * state.speed * state.diameter)
    jump -= math.log(HIGHEST_VISCOUS_REYNOLDS_NUMBER)
    ends = (math.log(1e-12), jump + math.log(state.gas_fraction), jump, math.log(1e6))
    for high, low in itertools.pairwise(sorted(ends, reverse=True)):
        log_viscosity = _root(excess, low + _ROUND_OFF, high - _ROUND_OFF)
        if log_viscosity is not None:
            return math.exp(log_viscosity)
    raise InputError.about(
        "tau_p",
        f"means a drag time of {drag_time:.6g} s, which the law '{suspension.drag}' gives at no "
        "gas viscosity",
    )


def _root(function: Callable[[float], float], low: float, high: float) -> float | None:
    """Return where a monotonic function vanishes, or None if it does not in the interval."""
    if low >= high:
        return None
    for end in (high, low):
        if abs(function(end)) <= _ROUND_OFF:
            return end
    if function(low) * function(high) > 0.0:
        return None
    brentq: Any = importlib.import_module("scipy.optimize").brentq  # without types
    # in the logarithm, an absolute tolerance is a relative one of the quantity
    return float(brentq(function, low, high, xtol=1e-15, rtol=1e-15))
