"""Text with units into SI numbers and back; the only module that uses pint.

The text comes from strangers: it is taken apart here, piece by piece, and pint only sees the plain
names of units.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Iterator
from decimal import Decimal
from typing import Any, NamedTuple

from pydantic import BeforeValidator

from triboflux.errors import InputError, nearest, shown

LONGEST_TEXT = 60
"""Most characters of a quantity."""


class Expected(NamedTuple):
    """What a field is.

    Attributes
    ----------
    kind : str
        With its article, such as ``"a length"``.
    example : str
        A text that would be accepted.
    """

    kind: str
    example: str


EXPECTED = {
    "m": Expected("a length", "500 um"),
    "kg/m^3": Expected("a density", "950 kg/m^3"),
    "Pa": Expected("a pressure", "2 GPa"),
    "J": Expected("an energy", "4.2 eV"),
    "Pa s": Expected("a dynamic viscosity", "1.8e-5 Pa s"),
    "F/m": Expected("a permittivity", "8.85 pF/m"),
    "m^2/s^2": Expected("a velocity squared", "1e-3 m^2/s^2"),
    "m/s": Expected("a velocity", "10 cm/s"),
    "C": Expected("a charge", "1.3 pC"),
    "C/kg": Expected("a charge per mass", "10 uC/kg"),
    "C/m^2": Expected("a charge per surface", "5 uC/m^2"),
    "C/m^3": Expected("a charge per volume", "1e-4 C/m^3"),
    "C/s": Expected("a current", "2 pC/s"),
    "C m/s": Expected("a charge times a velocity", "0.1 pC m/s"),
    "C^2": Expected("a charge squared", "1 pC^2"),
    "s": Expected("a time", "20 ms"),
    "": Expected("a pure number", "45 %"),
}
"""What fields can be, by SI unit."""

_OTHER_KINDS = {
    "kg": "a mass",
    "K": "a temperature",
    "mol": "an amount of substance",
    "m^2": "an area",
    "m^3": "a volume",
    "1/s": "a rate",
    "1/m": "a wave number",
    "1/m^3": "a number density",
    "m/s^2": "an acceleration",
    "m^2/s": "a kinematic viscosity",
    "m^3/s": "a volume flow",
    "kg/s": "a mass flow",
    "kg/m^2": "a mass per surface",
    "m^3/kg": "a specific volume",
    "N": "a force",
    "N/m": "a surface tension",
    "W": "a power",
    "V": "a voltage",
    "V/m": "an electric field",
    "F": "a capacitance",
    "ohm": "a resistance",
    "S/m": "a conductivity",
}

_COMMON_UNITS = (
    *("m", "km", "cm", "mm", "um", "µm", "nm", "pm", "micron", "inch", "ft"),
    *("kg", "g", "mg", "ug", "µg", "ng", "lb"),
    *("s", "ms", "us", "min", "hour"),
    *("mPa", "Pa", "kPa", "MPa", "GPa", "bar", "psi", "N", "mN", "J", "kJ", "eV", "meV", "keV"),
    *("C", "mC", "uC", "µC", "nC", "pC", "fC", "e", "F", "pF", "V", "kV", "P", "cP", "K", "%"),
    *(
        "meter",
        "metre",
        "gram",
        "second",
        "pascal",
        "joule",
        "coulomb",
        "farad",
        "litre",
        "percent",
    ),
)
"""What is proposed for a unit that does not exist."""

_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")

# Digits belong to a name only between letters (mmH2O); at its end they are a power (m2).
_PIECE = re.compile(
    r"""\s*(?:
        (?P<operator>[*·⋅/()])
      | (?P<name>%|°?[^\W\d]+(?:[0-9]+[^\W\d]+)*)
        (?:\s*(?:\^|\*\*)?\s*(?P<power>[+-]?[0-9])(?![\w.]))?
    )\s*""",
    re.VERBOSE,
)
_SUPERSCRIPTS = str.maketrans("⁺⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "+-0123456789")


def to_si(text: str, *units: str) -> tuple[float, str]:
    """Return the number of SI units that a text such as ``"350 um"`` means.

    Parameters
    ----------
    text : str
        A number and a unit: names of units with whole powers (``^``, ``**``, superscripts or
        nothing), joined by ``*``, ``·``, blanks or ``/``, one level of brackets.
    *units : str
        SI units of the kinds that are allowed, keys of `EXPECTED`.

    Returns
    -------
    value : float
        In that one of the units which has the dimension of the text; decimal numbers are
        converted exactly and rounded once.
    unit : str
        Which one it is.

    Raises
    ------
    InputError
        If the text can't be read or has another dimension.
    """
    if len(text) > LONGEST_TEXT:
        raise _refusal(text, f"is longer than {LONGEST_TEXT} characters", units)
    number = _NUMBER.match(stripped := text.strip())
    if number is None:
        raise _refusal(text, "does not begin with a number" if stripped else "is empty", units)
    unit_text = stripped[number.end() :].strip()
    if not unit_text and "" not in units:
        raise _refusal(text, "has no unit", units)
    factors = _factors(unit_text)
    if factors is None:
        raise _refusal(text, "has a unit that can't be read", units)
    if not math.isfinite(float(number.group())):
        raise _refusal(text, "is too large", units)
    return _convert(Decimal(number.group()), factors, text, units)


def _refusal(text: str, problem: str, units: tuple[str, ...], hint: str = "") -> InputError:
    """Return the error about a text, without the name of its field."""
    kinds = [EXPECTED[unit].kind for unit in units]
    expected = " or ".join(filter(None, [", ".join(kinds[:-1]), kinds[-1]]))
    example = EXPECTED[units[0]].example
    return InputError.about(
        "", f": {shown(text)} {problem}, expected {expected} (such as '{example}')", hint=hint
    )


def _factors(unit_text: str) -> list[tuple[str, int]] | None:
    """Return the names of units and their powers, None if the text can't be read."""
    factors: list[tuple[str, int]] = []
    sign, group_sign, in_group, needs_factor = 1, 1, False, False
    for piece in _pieces(unit_text.translate(_SUPERSCRIPTS)):
        if piece is None:
            return None
        operator, name, power = piece
        if name is not None:
            factors.append((name, group_sign * sign * int(power or 1)))
            sign, needs_factor = 1, False
        elif operator == "(" and not in_group:
            group_sign, sign, in_group, needs_factor = sign, 1, True, True
        elif operator == ")" and in_group and not needs_factor:
            group_sign, in_group = 1, False
        elif operator not in ("(", ")") and not needs_factor:
            sign, needs_factor = (-1 if operator == "/" else 1), True
        else:
            return None
    return None if needs_factor or in_group else factors


def _pieces(unit_text: str) -> Iterator[tuple[str | None, str | None, str | None] | None]:
    """Yield operator, name and power of each piece; None where there is none."""
    position = 0
    while position < len(unit_text):
        piece = _PIECE.match(unit_text, position)
        if piece is None:
            yield None
            return
        yield piece["operator"], piece["name"], piece["power"]
        position = piece.end()


@functools.cache
def _registry() -> Any:
    """Return the registry of units, made when a text is first read; it takes half a second."""
    import pint

    decimal: Any = Decimal  # pint accepts it, its annotation does not
    return pint.UnitRegistry(non_int_type=decimal)


def _unit(factors: list[tuple[str, int]]) -> Any:
    """Return the pint unit of a product of powers."""
    unit = _registry().Unit("")
    for name, power in factors:
        unit *= _registry().Unit(name) ** power
    return unit


def _si_unit(unit: str) -> Any:
    """Return the pint unit of one of our own names."""
    return _unit(_factors(unit.removeprefix("1")) or [])


@functools.cache
def _kinds() -> dict[Any, str]:
    """Return the name of each known dimension."""
    names = {unit: expected.kind for unit, expected in EXPECTED.items()} | _OTHER_KINDS
    return {_si_unit(unit).dimensionality: name for unit, name in names.items()}


def _is_unit(name: str) -> bool:
    """Return whether pint knows a name, which can be any word."""
    try:
        _registry().Unit(name)
    except Exception:  # of many kinds, some of them from Python's tokenizer
        return False
    return True


def _scale(unit: Any, target: Any) -> Decimal | None:
    """Return how many target units one unit is; None for scales with an offset or a logarithm."""
    try:
        return _registry().Quantity(Decimal(1), unit).to(target).magnitude
    except Exception:  # pint has an error for each kind of scale, and decimals add theirs
        return None


def _convert(
    number: Decimal, factors: list[tuple[str, int]], text: str, units: tuple[str, ...]
) -> tuple[float, str]:
    """Return a number in that SI unit which has its dimension, and the unit."""
    for name, _ in factors:
        if not _is_unit(name):
            problem = f"has the unknown unit {shown(name)}"
            raise _refusal(text, problem, units, nearest(name, _COMMON_UNITS))
    unit = _unit(factors)
    for target in units:
        if unit.dimensionality != _si_unit(target).dimensionality:
            continue
        scale = _scale(unit, _si_unit(target))
        if scale is None:
            raise _refusal(text, "has a unit that is no multiple of the SI unit", units)
        value = float(number * scale)
        if not math.isfinite(value):
            raise _refusal(text, "is too large", units)
        return value, target
    kind = _kinds().get(unit.dimensionality)
    product = " ".join(f"{name[1:-1]}^{power:g}" for name, power in unit.dimensionality.items())
    raise _refusal(text, f"is {kind}" if kind else f"has the dimension {product}", units)


def from_text(unit: str) -> BeforeValidator:
    """Return a validator of one field that turns text into SI and leaves anything else alone.

    Parameters
    ----------
    unit : str
        SI unit of the field, a key of `EXPECTED`.
    """

    def convert(value: Any) -> Any:
        return to_si(value, unit)[0] if isinstance(value, str) else value

    return BeforeValidator(convert)


_PREFIXES = {-18: "a", -15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
_PREFIXED = ("m", "s", "g", "C", "Pa", "J", "F", "V", "N", "S", "Hz")
"""Units that take a prefix, alone or first in a product without a power."""


def format_quantity(value: float, unit: str, digits: int = 4) -> str:
    """Return a number of SI units as text, with a prefix that keeps it readable.

    Parameters
    ----------
    value : float
        Anything; inf and nan are kept.
    unit : str
        SI unit such as ``"C/kg"``, where the first name takes the prefix if it has no power;
        ``"kg"`` becomes grams. Empty for a pure number.
    digits : int
        Significant digits.

    Returns
    -------
    str
        Such as ``"1.3 pC"``, which `to_si` reads.
    """
    first = re.match(r"[A-Za-z]*(?![A-Za-z^0-9])", unit)
    name = first.group() if first else ""
    if name == "kg" and unit == "kg":
        value, name, unit = value * 1e3, "g", "g"
    prefix = ""
    if name in _PREFIXED and math.isfinite(value) and value != 0.0:
        # the exponent after rounding, so that 999.99 becomes 1 k and not 1000
        exponent = int(f"{value:.{digits - 1}e}".partition("e")[2])
        power = min(max(3 * (exponent // 3), min(_PREFIXES)), 0 if name == "s" else max(_PREFIXES))
        value, prefix = value / 10.0**power, _PREFIXES[power]
    return f"{value:.{digits}g} {prefix}{unit}".rstrip()
