"""The values that a sweep's parameters take, and how they are put into a case."""

from __future__ import annotations

import copy
import math
import re
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, cast

from pydantic import AfterValidator, model_validator

from triboflux.errors import InputError, shown
from triboflux.validation import InputModel, Real, Text, Whole, bounded, one_of

SPACINGS = ("linear", "logarithmic")
MOST_MEMBERS = 100_000
"""Most members of a sweep."""

_LARGEST_RANGE = 1e300
# So many digits of a value are kept, for a decade to be 1000.0 and not 999.9999999999998.
_DIGITS = 12
_PLAIN_STEP = re.compile(r"[^.\[\]]+|\[\d{1,6}\]")
_DEEPEST = 8


def _check_count(count: int) -> int:
    if not 1 <= count <= MOST_MEMBERS:
        raise ValueError(f"must be from 1 to {MOST_MEMBERS}")
    return count


class ValueRange(InputModel):
    """Equally spaced values of one parameter.

    Attributes
    ----------
    first, last : float
        The ends, both included.
    count : int
        Number of values.
    spacing : str
        ``"linear"``, or ``"logarithmic"`` for equal ratios.
    """

    first: Annotated[Real, bounded(-_LARGEST_RANGE, _LARGEST_RANGE)]
    last: Annotated[Real, bounded(-_LARGEST_RANGE, _LARGEST_RANGE)]
    count: Annotated[Whole, AfterValidator(_check_count)]
    spacing: Annotated[Text, one_of(SPACINGS)] = "linear"

    @model_validator(mode="after")
    def _ends_fit(self) -> ValueRange:
        if self.spacing == "logarithmic" and not (self.first > 0.0 and self.last > 0.0):
            field = "first" if self.first <= 0.0 else "last"
            problem = f"is {getattr(self, field)!r}, but must be positive with logarithmic spacing"
            raise InputError.about(field, problem)
        if self.count == 1 and self.first != self.last:
            raise InputError.about("count", "is 1, but must be at least 2 between different ends")
        return self

    def values(self) -> list[float]:
        """Return the values; the ends exactly, the others rounded to 12 digits."""
        if self.count == 1:
            return [self.first]
        parts = [i / (self.count - 1) for i in range(1, self.count - 1)]
        if self.spacing == "logarithmic":
            low, high = math.log(self.first), math.log(self.last)
            inner = [math.exp((1.0 - part) * low + part * high) for part in parts]
        else:
            inner = [(1.0 - part) * self.first + part * self.last for part in parts]
        return [self.first, *(float(f"{value:.{_DIGITS}g}") for value in inner), self.last]


def plain(value: Any) -> Any:
    """Turn arrays, tuples and numpy scalars into what TOML and JSON know."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in cast("Mapping[Any, Any]", value).items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in cast("Sequence[Any]", value)]
    return value


def flattened(parameters: Any) -> Any:
    """Return ``{dotted key: list of values}`` from nested tables, lists and ranges."""
    if not isinstance(parameters, Mapping):
        return parameters
    found: dict[str, list[Any]] = {}
    _flatten(cast("Mapping[str, Any]", parameters), "", found)
    return found


def _flatten(table: Mapping[str, Any], prefix: str, found: dict[str, list[Any]]) -> None:
    for key, given in table.items():
        name = f"{prefix}.{key}" if prefix else str(key)
        field = shown(name)
        value: Any = given if isinstance(given, ValueRange) else plain(given)
        if isinstance(value, ValueRange):
            value = value.values()
        elif isinstance(value, dict):
            content = cast("dict[str, Any]", value)
            if content and all(isinstance(entry, list | dict) for entry in content.values()):
                if name.count(".") > _DEEPEST:
                    raise InputError.about(field, "is nested too deeply for a key of a case")
                _flatten(content, name, found)
                continue
            try:
                value = ValueRange(**content).values()
            except InputError as error:
                raise _in_parameter(field, error) from None
        if not isinstance(value, list) or not value:
            problem = (
                f"is {shown(given)}, but must be a list of values or a table with first, last, "
                "count and spacing"
            )
            raise InputError.about(field, problem)
        if name in found:
            raise InputError.about(field, "is given twice")
        found[name] = cast("list[Any]", value)


def _in_parameter(field: str, error: InputError) -> InputError:
    name = f"{field}.{error.field}" if error.field else field
    return InputError.about(name, error.problem, hint=error.hint, others=error.others)


def put(table: dict[str, Any], key: str, value: Any) -> None:
    """Set a value under a dotted key, making tables on the way.

    Parameters
    ----------
    table : dict
        The tables of a case, changed in place.
    key : str
        Such as ``numbers.peclet`` or ``initial.charge[0].sine``.
    value : object
        Copied.

    Raises
    ------
    InputError
        If the key can't be one of a case.
    """
    steps = _PLAIN_STEP.findall(key)
    if "".join(f".{s}" if s[0] != "[" else s for s in steps).lstrip(".") != key:
        raise InputError.about(f"parameters.{shown(key)}", "is no dotted key of a case")
    place: Any = table
    for i, step in enumerate(steps):
        last = i == len(steps) - 1
        if step[0] == "[":
            number = int(step[1:-1])
            if not isinstance(place, list) or number >= len(cast("list[Any]", place)):
                raise InputError.about(f"parameters.{shown(key)}", "is an entry the case has not")
            step = number  # noqa: PLW2901 -- an index is the same thing in another type
        elif not isinstance(place, dict):
            raise InputError.about(f"parameters.{shown(key)}", "is no dotted key of a case")
        if last:
            place[step] = copy.deepcopy(value)
        elif isinstance(step, str):
            place = cast("dict[str, Any]", place).setdefault(step, {})
        else:
            place = cast("list[Any]", place)[step]
