"""The fields of the page: names, labels, ranges of the sliders and what they start with."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from triboflux import presets
from triboflux.drag import LAWS as DRAG_LAWS
from triboflux.model_errors import POINTS
from triboflux.radial_distribution import LAWS as RADIAL_LAWS
from triboflux.suitability import RANGES
from triboflux.suspension import Suspension
from triboflux.units import EXPECTED, to_si

NUMBERS, SUSPENSION = "numbers", "suspension"
"""How the inputs are told: by the seven numbers, or by particles, gas and state."""


@dataclass(frozen=True)
class Field:
    """One field of the page.

    Attributes
    ----------
    name : str
        Dotted, as in a case.
    label : str
        What stands beside it.
    start : str
        The text it starts with.
    group : str
        Where it stands: `NUMBERS`, `SUSPENSION`, ``"more"`` for a suspension's rarer fields,
        ``"case"`` for what both have.
    unit : str
        Of the slider and of texts that the page writes; empty for a pure number.
    low, high : float or None
        Ends of the slider, in `unit`; None for a field without one.
    logarithmic : bool
        Whether the slider goes by equal ratios.
    options : tuple of str
        Names to choose from; empty for a text.
    hint : str
        A few words below it.
    """

    name: str
    label: str
    start: str
    group: str
    unit: str = ""
    low: float | None = None
    high: float | None = None
    logarithmic: bool = True
    options: tuple[str, ...] = ()
    hint: str = ""

    def text(self, value: float) -> str:
        """Return a value in SI as a text in the field's unit."""
        scaled = value / to_si(f"1 {self.unit}", *EXPECTED)[0] if self.unit else value
        return f"{scaled:.6g} {self.unit}".rstrip()


def _number(name: str, label: str, start: str, low: float, high: float, hint: str) -> Field:
    return Field(f"numbers.{name}", label, start, NUMBERS, low=low, high=high, hint=hint)


def _particle(name: str, label: str, unit: str, low: float, high: float, hint: str = "") -> Field:
    return Field(f"suspension.{name}", label, "", SUSPENSION, unit, low, high, hint=hint)


_PECLET, _TAU_C = RANGES["numbers.peclet"], RANGES["numbers.tau_c"]
_OFF = "inf switches it off"

_SEVEN = (
    _number("peclet", "Péclet number Pe", "1e6", *_PECLET, f"L√Θ/D; {_OFF}"),
    _number("tau_c", "Collision time τ_c*", "1e-3", *_TAU_C, "between collisions, in L/√Θ"),
    _number("energy_ratio", "Energy ratio u", "300", 1e-2, 1e5, "electric over kinetic energy"),
    _number("length_ratio", "Length ratio L/d", "192", 10.0, 1e4, "box over particle diameter"),
    Field("numbers.restitution", "Restitution e", "1", NUMBERS, "", 0.0, 1.0, False),
    _number("tau_p", "Drag time τ_p*", "inf", 1e-4, 1e4, f"in L/√Θ; {_OFF}"),
    _number("tau_sigma", "Conduction time τ_σ*", "inf", 1e-2, 1e6, f"in L/√Θ; {_OFF}"),
)

_PARTICLES = (
    _particle("solid_fraction", "Solid fraction α", "", 1e-4, 0.6),
    _particle("granular_temperature", "Granular temperature Θ", "m^2/s^2", 1e-6, 1.0),
    _particle("charge_scale", "Charge of a particle Q0", "fC", 1e-4, 1e4, "or per kg, m² or m³"),
    _particle("diameter", "Particle diameter d", "um", 1.0, 5e3),
    _particle("domain_length", "Box length L", "cm", 0.1, 1e3),
    _particle("youngs_modulus", "Young's modulus", "GPa", 1e-3, 1e2),
    _particle("density", "Particle density", "kg/m^3", 100.0, 1e4),
    Field("suspension.restitution", "Restitution e", "", SUSPENSION, "", 0.0, 1.0, False),
    Field("suspension.poisson_ratio", "Poisson's ratio", "", "more"),
    Field("suspension.slip_velocity", "Slip velocity", "", "more", "m/s"),
    Field("suspension.gas_density", "Gas density", "", "more", "kg/m^3"),
    Field("suspension.gas_viscosity", "Gas viscosity", "", "more", "Pa s"),
    Field("suspension.maximum_packing", "Densest packing", "", "more"),
    Field("suspension.drag", "Drag law", "", "more", options=tuple(DRAG_LAWS)),
    Field(
        "suspension.radial_distribution",
        "Radial distribution",
        "",
        "more",
        options=tuple(RADIAL_LAWS),
    ),
)

_CASE = (
    Field("title", "Title", "", "case", hint="one line, kept in all files"),
    Field("initial.waves", "Waves in the box", "1", "case"),
    Field("grid.dimensions", "Dimensions", "1", "case", options=("1", "2")),
    Field(
        "grid.points",
        "Points per dimension",
        str(POINTS),
        "case",
        options=("32", "64", "128", "256", "512"),
    ),
    Field(
        "run.stop_at_peak_charge",
        "Stop when the peak charge is",
        "0.5",
        "case",
        hint="part of Q0; empty: run to the end",
    ),
    Field("run.t_end", "Latest end", "1e5", "case", hint="in L/√Θ"),
)

FIELDS = {field.name: field for field in (*_SEVEN, *_PARTICLES, *_CASE)}
"""All fields by name, in the order of the page."""

USUAL_PRESET = "glass-beads"
"""What a suspension starts with."""


def preset_texts(name: str) -> dict[str, str]:
    """Return the texts of a suspension's fields for a preset.

    Parameters
    ----------
    name : str
        One of `triboflux.presets.NAMES`.

    Raises
    ------
    InputError
        If there is no such preset.
    """
    return suspension_texts(Suspension(**presets.fill(name, {})))


def suspension_texts(suspension: Suspension) -> dict[str, str]:
    """Return the texts that the page has for a suspension."""
    texts: dict[str, str] = {}
    for field in _PARTICLES:
        value = getattr(suspension, field.name.removeprefix("suspension."))
        texts[field.name] = value if isinstance(value, str) else field.text(value)
    return texts


def starts() -> dict[str, str]:
    """Return the texts that all fields start with."""
    return {name: field.start for name, field in FIELDS.items()} | preset_texts(USUAL_PRESET)


def described() -> list[dict[str, Any]]:
    """Return the fields as plain data for the page."""
    first = starts()
    return [asdict(field) | {"start": first[field.name]} for field in FIELDS.values()]


def position(name: str, text: str) -> float | None:
    """Return where a text stands on the slider of its field, None if nowhere.

    Parameters
    ----------
    name : str
        A key of `FIELDS`.
    text : str
        What stands in the field.
    """
    field = FIELDS[name]
    try:
        if not field.unit:
            value = float(text)
        else:
            si, unit = to_si(text, *EXPECTED)
            target, target_unit = to_si(f"1 {field.unit}", *EXPECTED)
            value = si / target if unit == target_unit else math.nan
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def positions(texts: Mapping[str, str]) -> dict[str, float]:
    """Return where texts stand on the sliders of their fields, by name."""
    found = {name: position(name, texts[name]) for name in texts if FIELDS[name].low is not None}
    return {name: place for name, place in found.items() if place is not None}
