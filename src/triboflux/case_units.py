"""Cases in SI: numbers from a suspension, and texts with units divided by its scales."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, cast

from triboflux.collision import HERTZ_EXPONENT
from triboflux.errors import InputError, shown
from triboflux.numbers import Numbers, from_suspension
from triboflux.scales import Scales
from triboflux.suspension import CHARGE_UNITS, Charge, Suspension

_PLACES = (
    ("grid", "lengths", "length"),
    ("run", "t_end", "time"),
    ("run", "outputs", "time"),
    ("run", "stop_at_peak_charge", "charge"),
    ("run", "stop_at_rate", "charge_rate"),
    ("run", "realizability_bound", "variance"),
    ("initial", "charge", "charge"),
    ("initial", "covariance", "covariance"),
    ("initial", "variance", "variance"),
    ("kinetic", "time_step", "time"),
)
"""Where a text with a unit may stand: table, key, name of the scale."""
_LISTS = ("lengths", "outputs")
"""Keys with a list of quantities."""
_AMPLITUDES = ("sine", "cosine")
"""Quantities in the tables of a list of modes."""
_MOST_TEXTS = 1000
"""In a list, for each takes a millisecond; more modes than this are refused later."""
_UNITS = {
    "length": ("m",),
    "time": ("s",),
    "charge": CHARGE_UNITS,
    "charge_rate": ("C/s",),
    "covariance": ("C m/s",),
    "variance": ("C^2",),
}
"""SI units of each scale."""


def resolve_suspension(data: Any, known_closures: Sequence[str]) -> Any:
    """Give a case with a suspension its numbers, and scale its texts with units.

    Parameters
    ----------
    data : object
        What a `Case` is made of; anything but a mapping is returned as it is.
    known_closures : sequence of str
        Names of the closure sets.

    Returns
    -------
    object
        The same with `numbers`, and plain numbers in place of texts such as ``"20 ms"``.

    Raises
    ------
    InputError
        If the suspension is not allowed, its numbers contradict given ones, a text can't be read,
        or there are texts with units but no suspension.
    """
    if not isinstance(data, Mapping):
        return data
    case = dict(cast("Mapping[str, Any]", data))
    if case.get("suspension") is None:
        # a case without both may have misspelt one, which is told first
        if "numbers" in case:
            _replace_texts(case, _refuse)
        return case
    suspension = case["suspension"] = _suspension(case["suspension"])
    exponent = case.get("exponent", HERTZ_EXPONENT)
    if exponent != HERTZ_EXPONENT:
        raise InputError.about(
            "exponent",
            f"is {shown(exponent)}, but must be {HERTZ_EXPONENT} with a suspension, whose contacts "
            "are Hertzian",
        )
    # a wrong name is refused later, among the fields
    name = case.get("closures", known_closures[0])
    numbers = _numbers(suspension, name if name in known_closures else known_closures[0])
    given = case.get("numbers", numbers)
    if given != numbers and given != numbers.model_dump():
        raise InputError.about(
            "numbers", "is given beside suspension, from which other numbers follow; give one"
        )
    case["numbers"] = numbers
    scales = Scales.of(suspension)

    def scaled(text: str, scale: str, field: str) -> float:
        return _in_si(text, scale, field, suspension) / getattr(scales, scale)

    _replace_texts(case, scaled)
    return case


def _numbers(suspension: Suspension, closure_name: str) -> Numbers:
    """Return the numbers of a suspension, or refuse the suspension."""
    try:
        return from_suspension(suspension, closure_name)
    except InputError as error:
        problem = f"is out of range, because its {error.field} {error.problem}"
        raise InputError.about("suspension", problem, others=error.others) from None


def _replace_texts(case: dict[str, Any], convert: Callable[[str, str, str], float]) -> None:
    """Replace every text that stands where one with a unit may, by `convert(text, scale, field)`.

    Anything that is not of the right form is left alone, to be refused among the fields.
    """
    for table, key, scale in _PLACES:
        content = case.get(table)
        if not isinstance(content, Mapping) or key not in content:
            continue
        values = case[table] = dict(cast("Mapping[str, Any]", content))
        value, field = values[key], f"{table}.{key}"
        if isinstance(value, str) and table in ("run", "kinetic") and key not in _LISTS:
            values[key] = convert(value, scale, field)
        elif isinstance(value, list | tuple):
            entries = cast("Sequence[Any]", value)
            is_list = key in _LISTS
            texts = sum(isinstance(entry, str if is_list else Mapping) for entry in entries)
            if texts <= _MOST_TEXTS:
                values[key] = [
                    _entry(entry, is_list, convert, scale, f"{field}[{index}]")
                    for index, entry in enumerate(entries)
                ]
            elif is_list:
                problem = f"has {texts} entries with units, but may have at most {_MOST_TEXTS}"
                raise InputError.about(field, problem)


def _entry(
    entry: Any, is_quantity: bool, convert: Callable[[str, str, str], float], scale: str, field: str
) -> Any:
    """Replace an entry of a list if it is a text, or the amplitudes of a mode if they are."""
    if is_quantity:
        return convert(entry, scale, field) if isinstance(entry, str) else entry
    if not isinstance(entry, Mapping):
        return entry
    mode = dict(cast("Mapping[str, Any]", entry))
    for key in _AMPLITUDES:
        if isinstance(mode.get(key), str):
            mode[key] = convert(mode[key], scale, f"{field}.{key}")
    return mode


def _refuse(text: str, scale: str, field: str) -> float:
    """Refuse a text in a case without a suspension."""
    raise InputError.about(
        field,
        f"is {shown(text)}, but must be a number in a case with a table [numbers]; units need the "
        "scales of a table [suspension]",
    )


def _in_si(text: str, scale: str, field: str, suspension: Suspension) -> float:
    """Return a text with a unit in SI."""
    from triboflux.units import to_si

    try:
        number, unit = to_si(text, *_UNITS[scale])
    except InputError as error:
        raise InputError.about(field, error.problem, hint=error.hint) from None
    if scale == "charge":
        return Charge(number, unit).of_sphere(suspension.diameter, suspension.density)
    return number


def _suspension(value: Any) -> Suspension:
    """Validate the table of a suspension."""
    if isinstance(value, Suspension):
        return value
    if not isinstance(value, Mapping):
        raise InputError.about("suspension", "must be a table")
    try:
        return Suspension(**cast("Mapping[str, Any]", value))
    except InputError as error:
        if error.field is None:
            raise
        name = f"suspension.{error.field}"
        problem, hint, others = error.problem, error.hint, error.others
        raise InputError.about(name, problem, hint=hint, others=others) from None
