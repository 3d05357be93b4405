"""Real particles in a gas: the way from a powder to the coefficients of the model."""

from __future__ import annotations

import math
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, NamedTuple, Protocol, cast, runtime_checkable

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from triboflux import closures, collision
from triboflux.case_text import case_table, read_case_file
from triboflux.drag import LAWS as DRAG_LAWS
from triboflux.drag import DragState, drag_time
from triboflux.errors import InputError, shown
from triboflux.radial_distribution import CLOSEST_PACKING, check_fraction
from triboflux.radial_distribution import LAWS as RADIAL_LAWS
from triboflux.units import from_text, to_si
from triboflux.validation import Flag, InputModel, Real, Text, bounded, one_of

VACUUM_PERMITTIVITY = 8.8541878188e-12
"""F/m; CODATA 2022."""


CHARGE_UNITS = ("C", "C/kg", "C/m^2", "C/m^3")
"""Units in which the charge of a particle may be told."""


class Charge(NamedTuple):
    """A charge of particles, absolute or by what it is spread over.

    Attributes
    ----------
    value : float
        In `unit`.
    unit : str
        ``"C"`` per particle, ``"C/kg"``, ``"C/m^2"`` of its surface or ``"C/m^3"`` of its volume.
    """

    value: float
    unit: str

    def of_sphere(self, diameter: float, density: float) -> float:
        """Return the charge of one particle.

        Parameters
        ----------
        diameter : float
            m.
        density : float
            kg/m³.

        Returns
        -------
        float
            C.

        Raises
        ------
        InputError
            If `unit` is none of the four.
        """
        volume = math.pi / 6.0 * diameter**3
        amount = {
            "C": 1.0,
            "C/kg": density * volume,
            "C/m^2": math.pi * diameter**2,
            "C/m^3": volume,
        }
        if self.unit not in amount:
            problem = f"is in {shown(self.unit)}, but must be in {', '.join(amount)}"
            raise InputError.about("", problem)
        return self.value * amount[self.unit]


def _within(low: float, high: float, unit: str) -> AfterValidator:
    """Return a validator for physical quantities of an interval."""

    def check(value: float) -> float:
        if not low <= value <= high:
            raise ValueError(f"must be from {low:g} to {high:g} {unit}")
        return value

    return AfterValidator(check)


@runtime_checkable
class _Earlier(Protocol):
    """What pydantic tells a validator; its own protocol can't be checked at run time."""

    @property
    def data(self) -> dict[str, Any]:
        """The fields before this one, those that are valid."""
        ...


def _charge_per_particle(value: Any, info: _Earlier) -> Any:
    """Turn the charge of a mass, a surface or a volume into that of a particle."""
    if isinstance(value, str):
        value = Charge(*to_si(value, "C", "C/kg", "C/m^2", "C/m^3"))
    if not isinstance(value, Charge):
        return value
    # where one of these is wrong, that is told and the charge does not matter
    return value.of_sphere(info.data.get("diameter", 1e-4), info.data.get("density", 1e3))


Diameter = Annotated[Real, from_text("m"), _within(1e-9, 1.0, "m")]
Length = Annotated[Real, from_text("m"), _within(1e-6, 1e5, "m")]
Density = Annotated[Real, from_text("kg/m^3"), _within(1.0, 3e4, "kg/m^3")]
GasDensity = Annotated[Real, from_text("kg/m^3"), _within(1e-6, 1e3, "kg/m^3")]
GasViscosity = Annotated[Real, from_text("Pa s"), _within(1e-7, 1e-2, "Pa s")]
Modulus = Annotated[Real, from_text("Pa"), _within(1e3, 2e12, "Pa")]
WorkFunction = Annotated[Real, from_text("J"), _within(1e-20, 2e-18, "J")]
Permittivity = Annotated[Real, from_text("F/m"), _within(8.8e-12, 1e-7, "F/m")]
GranularTemperature = Annotated[Real, from_text("m^2/s^2"), _within(1e-14, 1e6, "m^2/s^2")]
Speed = Annotated[Real, from_text("m/s"), _within(0.0, 1e3, "m/s")]
ParticleCharge = Annotated[Real, BeforeValidator(_charge_per_particle), _within(1e-24, 1e-3, "C")]
Poisson = Annotated[Real, from_text(""), bounded(-1.0, 0.5, open_ends=True)]
Packing = Annotated[Real, from_text(""), bounded(0.0, CLOSEST_PACKING, open_ends=True)]
ClosureName = Annotated[Text, one_of(closures.NAMES)]
Restitution = Annotated[Real, from_text(""), bounded(0.0, 1.0)]
RadialName = Annotated[Text, one_of(tuple(RADIAL_LAWS))]
DragName = Annotated[Text, one_of(tuple(DRAG_LAWS))]


class Suspension(InputModel):
    r"""Equal spheres in a gas, and the box they fill.

    Numbers are SI; a text with a unit, such as ``"350 um"`` or ``"2 GPa"``, is converted.

    Attributes
    ----------
    diameter : float
        Particle diameter d, m.
    density : float
        Density of the particles' material, kg/m³.
    youngs_modulus : float
        Young's modulus of the particles, Pa.
    poisson_ratio : float
        Poisson's ratio of the particles, above -1 and at most 0.5.
    restitution : float
        Coefficient of restitution e, from 0 to 1.
    work_function : float or None
        Effective work function of the particles' surface, J. Reserved: no model uses it yet.
    softened_modulus : bool
        Whether `youngs_modulus` was lowered to make a simulation faster. Then contacts are
        longer, and more charge is passed over, than in reality.
    gas_density : float
        kg/m³; by default that of air.
    gas_viscosity : float
        Pa s; by default that of air.
    permittivity : float
        F/m, at the contact of two particles and in Gauss' law; by default that of vacuum.
    solid_fraction : float
        Part α of the volume that is particles, above 0 and below `maximum_packing`.
    granular_temperature : float
        Θ, a third of the mean square of the particles' fluctuating velocity, m²/s².
    domain_length : float
        Length L of the box or of the variation of charge, m.
    charge_scale : float
        Charge of one particle that serves as scale Q0, C. A text may also give it per mass
        (``"10 uC/kg"``), per surface (``"5 uC/m^2"``) or per volume of the particles
        (``"1e-4 C/m^3"``).
    radial_distribution : str
        Law of the contact value g0, one of `triboflux.radial_distribution.NAMES`.
    maximum_packing : float
        Solid fraction of the densest packing; by default the law's own.
    drag : str
        Drag law, one of `triboflux.drag.NAMES`; ``"none"`` switches drag off.
    slip_velocity : float
        Mean velocity of the gas relative to the particles, m/s.

    Raises
    ------
    InputError
        If a field is missing, unknown, of another dimension or outside its physical range.
    """

    diameter: Diameter = Field(description="particle diameter, a length such as '500 um'")
    density: Density = Field(description="density of the particle material, such as '950 kg/m^3'")
    youngs_modulus: Modulus = Field(description="Young's modulus, a pressure such as '2 GPa'")
    poisson_ratio: Poisson = Field(description="Poisson's ratio, above -1 and at most 0.5")
    restitution: Restitution = Field(description="coefficient of restitution, from 0 to 1")
    work_function: WorkFunction | None = None
    softened_modulus: Flag = False
    gas_density: GasDensity = 1.2
    gas_viscosity: GasViscosity = 1.8e-5
    permittivity: Permittivity = VACUUM_PERMITTIVITY
    solid_fraction: Packing = Field(description="part of the volume that is particles, such as 0.3")
    granular_temperature: GranularTemperature = Field(
        description="granular temperature, such as '1e-3 m^2/s^2'"
    )
    domain_length: Length = Field(description="length of the box, such as '10 cm'")
    charge_scale: ParticleCharge = Field(
        description="charge of one particle, such as '1.3 pC', '10 uC/kg' or '5 uC/m^2'"
    )
    radial_distribution: RadialName = "carnahan-starling"
    maximum_packing: Packing = Field(
        default_factory=lambda data: _own_packing(data.get("radial_distribution"))
    )
    drag: DragName = "wen-yu"
    slip_velocity: Speed = 0.0

    @model_validator(mode="before")
    @classmethod
    def _fill_from_preset(cls, data: Any) -> Any:
        table: object = data
        if not isinstance(table, dict) or "preset" not in table:
            return data
        from triboflux.presets import fill  # presets are made of suspensions

        given = dict(cast("dict[str, Any]", data))
        return fill(given.pop("preset"), given)

    @model_validator(mode="after")
    def _below_the_maximum_packing(self) -> Suspension:
        check_fraction(self.solid_fraction, self.maximum_packing)
        return self

    @classmethod
    def from_toml(cls, path: str | PathLike[str]) -> Suspension:
        """Read the table ``[suspension]`` of a TOML file, which may be a whole case.

        Parameters
        ----------
        path : path-like
            The file, at most 1 MiB of UTF-8. ``preset = "polyethylene"`` in the table fills
            the fields that are not given.

        Returns
        -------
        Suspension
            The validated suspension.

        Raises
        ------
        InputError
            If the file can't be read, is not TOML, or the suspension is not allowed.
        """
        return read_suspension_file(path)[0]

    @classmethod
    def from_toml_text(cls, text: str) -> Suspension:
        """Read the table ``[suspension]`` of TOML in a string.

        Parameters
        ----------
        text : str
            The TOML document, at most 1 MiB.

        Returns
        -------
        Suspension
            The validated suspension.

        Raises
        ------
        InputError
            If the text is not TOML or the suspension is not allowed.
        """
        return _File(**case_table(text, Path(), "the suspension")).suspension

    @property
    def volume(self) -> float:
        """Volume of a particle, π d³/6, m³."""
        return math.pi / 6.0 * self.diameter**3

    @property
    def mass(self) -> float:
        """Mass m of a particle, ρ π d³/6, kg."""
        return self.density * self.volume

    @property
    def number_density(self) -> float:
        """Particles per volume, n = 6 α/(π d³), 1/m³."""
        return self.solid_fraction / self.volume

    @property
    def velocity_scale(self) -> float:
        """Root √Θ of the granular temperature, m/s."""
        return math.sqrt(self.granular_temperature)

    @property
    def contact_length(self) -> float:
        """X of (2.12), for the exponent 4/5, m^(1/5) s^(4/5)."""
        return collision.contact_length(
            self.mass, self.diameter, self.youngs_modulus, self.poisson_ratio
        )

    @property
    def field_transfer(self) -> float:
        """β of (2.16), C/(V/m) per (m/s)^(4/5)."""
        return collision.field_transfer(self.contact_length, self.diameter, self.permittivity)

    @property
    def charge_transfer(self) -> float:
        """γ of (2.17), per (m/s)^(4/5)."""
        return collision.charge_transfer(self.contact_length, self.diameter)

    @property
    def contact_radial_distribution(self) -> float:
        """Contact value g0 by the law `radial_distribution`, dimensionless."""
        law = RADIAL_LAWS[self.radial_distribution]
        return law.function(self.solid_fraction, self.maximum_packing)

    @property
    def relative_speed(self) -> float:
        """Root mean square √(slip² + 3 Θ) of the speed between particle and gas, m/s."""
        return math.sqrt(self.slip_velocity**2 + 3.0 * self.granular_temperature)

    @property
    def drag_state(self) -> DragState:
        """What the drag laws depend on."""
        return DragState(
            diameter=self.diameter,
            density=self.density,
            solid_fraction=self.solid_fraction,
            gas_density=self.gas_density,
            gas_viscosity=self.gas_viscosity,
            speed=self.relative_speed,
        )

    @property
    def drag_time(self) -> float:
        """τ_p by the law `drag` at the speed `relative_speed`, s; inf without drag."""
        return drag_time(self.drag, self.drag_state)


def _own_packing(law: str | None) -> float:
    """Return the maximum packing of a law, of any law if the name is wrong."""
    return RADIAL_LAWS[law or "carnahan-starling"].maximum_packing


def read_suspension_file(path: str | PathLike[str]) -> tuple[Suspension, str]:
    """Read the suspension of a TOML file, and the name of the closure set that goes with it.

    Parameters
    ----------
    path : path-like
        The file, at most 1 MiB of UTF-8; it may be a whole case.

    Returns
    -------
    suspension : Suspension
        From the table ``[suspension]``.
    closures : str
        What the key ``closures`` says, ``"derived"`` without it.

    Raises
    ------
    InputError
        If the file can't be read, is not TOML, or one of the two is not allowed.
    """
    text, name = read_case_file(path)
    found = _File(**case_table(text, Path(), name))
    return found.suspension, found.closures


class _File(InputModel):
    """A TOML file with a suspension; what else a case has is not looked at."""

    suspension: Suspension = Field(description="a table with the particles, the gas and the box")
    title: Any = None
    model: Any = None
    closures: ClosureName = "derived"
    exponent: Any = None
    numbers: Any = None
    grid: Any = None
    initial: Any = None
    run: Any = None
