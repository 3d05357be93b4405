"""What all validated data share: strict number types and errors of one sentence."""

from __future__ import annotations

import math
import numbers
import operator
from collections.abc import Callable
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Strict, ValidationError

from triboflux.errors import InputError, input_error, nearest, shown

SMALLEST = 1e-30
"""Smallest positive coefficient accepted: products of a few must not underflow."""
LARGEST = 1e30
"""Largest finite coefficient accepted: products of a few must not overflow."""


class InputModel(BaseModel):
    """Immutable data that refuses unknown keys and tells problems in one sentence.

    Raises
    ------
    InputError
        If a key is unknown or missing, or a value is not allowed.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    def __init__(self, /, **data: Any) -> None:
        try:
            super().__init__(**data)
        except ValidationError as error:
            raise input_error(error, type(self)) from None


def _scalar(value: Any) -> Any:
    """Unwrap an array without dimensions."""
    if getattr(value, "ndim", None) == 0 and hasattr(value, "item"):
        return value.item()
    return value


def _real(value: Any) -> float:
    """Return a finite or infinite number, refusing text, truth values and nan."""
    value = _scalar(value)
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise ValueError("must be a number")
    try:
        number = float(value)
    except OverflowError:
        raise ValueError("must be a number of at most 1e308") from None
    if math.isnan(number):
        raise ValueError("must be a number")
    return number


def _whole(value: Any) -> int:
    """Return an integer, refusing floats and truth values."""
    value = _scalar(value)
    if isinstance(value, bool):
        raise ValueError("must be a whole number")
    try:
        return operator.index(value)
    except TypeError:
        raise ValueError("must be a whole number") from None


def _listed(value: Any) -> Any:
    """Turn a numpy or JAX array into lists."""
    return value.tolist() if hasattr(value, "tolist") else value


Flag = Annotated[bool, Strict()]
Text = Annotated[str, Strict()]
Real = Annotated[float, BeforeValidator(_real)]
Whole = Annotated[int, BeforeValidator(_whole)]
Reals = Annotated[tuple[Real, ...], BeforeValidator(_listed)]
Wholes = Annotated[tuple[Whole, ...], BeforeValidator(_listed)]


def _require(holds: Callable[[float], bool], allowed: str) -> AfterValidator:
    """Return a validator that refuses numbers for which ``holds`` is false."""

    def check(value: float | int) -> float | int:
        if not holds(value):
            raise ValueError(f"must be {allowed}")
        return value

    return AfterValidator(check)


_RANGE = f"from {SMALLEST:g} to {LARGEST:g}"

Positive = Annotated[
    Real, _require(lambda x: SMALLEST <= x <= LARGEST, f"a positive finite number ({_RANGE})")
]
PositiveOrInfinite = Annotated[
    Real,
    _require(
        lambda x: SMALLEST <= x <= LARGEST or x == math.inf, f"a positive number ({_RANGE}) or inf"
    ),
]
NonNegative = Annotated[
    Real, _require(lambda x: 0 <= x <= LARGEST, f"zero or positive and finite (up to {LARGEST:g})")
]
Fraction = Annotated[Real, _require(lambda x: 0 <= x <= 1, "a number from 0 to 1")]
Amplitude = Annotated[
    Real, _require(lambda x: abs(x) <= LARGEST, f"a finite number (up to {LARGEST:g} in size)")
]


def bounded(low: float, high: float, *, open_ends: bool = False) -> AfterValidator:
    """Return a validator for numbers of an interval.

    Parameters
    ----------
    low, high : float
        The ends.
    open_ends : bool
        Refuse ``low``, and ``high`` if it is infinite.
    """
    if open_ends and high == math.inf:
        return _require(lambda x: low < x < high, f"finite and above {low:g}")
    if open_ends:
        return _require(lambda x: low < x <= high, f"above {low:g} and at most {high:g}")
    return _require(lambda x: low <= x <= high, f"a number from {low:g} to {high:g}")


def one_of(names: tuple[str, ...]) -> AfterValidator:
    """Return a validator that accepts the given names and proposes the nearest."""

    def check(name: str) -> str:
        if name not in names:
            quoted = " or ".join(f"'{valid}'" for valid in names)
            raise InputError.about(
                "", f"is {shown(name)}, but must be {quoted}", hint=nearest(name, names)
            )
        return name

    return AfterValidator(check)


def printable(longest_text: int) -> AfterValidator:
    """Return a validator that bounds a text and refuses control characters."""

    def check(text: str) -> str:
        if len(text) > longest_text or not text.isprintable():
            raise ValueError(f"must be one line of at most {longest_text} printable characters")
        return text

    return AfterValidator(check)


def longest(count: int) -> AfterValidator:
    """Return a validator that bounds the length of a list."""

    def check(entries: tuple[Any, ...]) -> tuple[Any, ...]:
        if len(entries) > count:
            problem = f"has {len(entries)} entries, but must have at most {count}"
            raise InputError.about("", problem)
        return entries

    return AfterValidator(check)
