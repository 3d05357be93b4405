"""Errors that a user may meet, each told in one sentence."""

from __future__ import annotations

import difflib
import reprlib
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from pydantic import BaseModel, ValidationError
    from pydantic_core import ErrorDetails

_SHOWN_WIDTH = 60
_LONGEST_NAME = 100

Error = TypeVar("Error", bound="InputError")

_EXPECTED = {
    "bool_type": "must be true or false",
    "dict_type": "must be a table",
    "model_type": "must be a table",
    "string_type": "must be text",
    "tuple_type": "must be a list",
}
"""What a field must be, by the type of pydantic's complaint."""


class TribofluxError(Exception):
    """Anything this package refuses or fails to do, told in one sentence."""


class InputError(TribofluxError, ValueError):
    """Bad input; ``str(error)`` is one sentence that says what to change.

    Parameters
    ----------
    sentence : str
        The whole message.

    Attributes
    ----------
    field : str or None
        Dotted name of the offending field, such as ``numbers.tau_c``; None for a sentence that
        was not composed by `about`.
    problem : str
        The sentence without the field's name, its full stop and its hint.
    hint : str
        What follows the full stop, such as ``" Did you mean 'full'?"``, or nothing.
    others : int
        How many further problems were found and not told.
    """

    def __init__(self, sentence: str) -> None:
        super().__init__(sentence)
        self.field: str | None = None
        self.problem = sentence
        self.hint = ""
        self.others = 0

    @classmethod
    def about(
        cls: type[Error], field: str, problem: str, *, hint: str = "", others: int = 0
    ) -> Error:
        """Compose the sentence about one field.

        Parameters
        ----------
        field : str
            Dotted name of the field; empty in the validator of one field, where the name is
            added on the way out.
        problem : str
            What follows the field's name, without a full stop: ``"is -1, but must be ..."``, or
            from a colon on: ``": '3 kg' is ..."``.
        hint : str
            What follows the full stop, with its leading space.
        others : int
            How many further problems there are.

        Returns
        -------
        InputError
            Of the class it is called on, with every attribute set; raise it.
        """
        more = f" (and {others} more problem{'s' if others > 1 else ''})" if others else ""
        start = f"{field}{problem}" if problem.startswith(":") else f"{field} {problem}"
        error = cls(f"{start.removeprefix(': ')}{more}.{hint}")
        error.field, error.problem, error.hint, error.others = field, problem, hint, others
        return error


class OutOfRangeError(InputError):
    """A case for which the closures hold no longer."""


def nearest(name: str, valid: Iterable[str]) -> str:
    """Return a question that proposes the valid name most like ``name``.

    Parameters
    ----------
    name : str
        The name as given.
    valid : iterable of str
        The names that would have been accepted.

    Returns
    -------
    str
        ``" Did you mean 'full'?"`` with its leading space, or nothing if no name is similar.
    """
    if len(name) > _LONGEST_NAME:
        return ""
    by_lower_case = {candidate.lower(): candidate for candidate in valid}
    found = difflib.get_close_matches(name.lower(), by_lower_case, n=1)
    return f" Did you mean '{by_lower_case[found[0]]}'?" if found else ""


def require_one_of(field: str, value: object, allowed: Iterable[str]) -> None:
    """Refuse a value that is none of some names.

    Parameters
    ----------
    field : str
        Dotted name of the field.
    value : object
        As given; only text can be allowed.
    allowed : iterable of str
        The names that would have been accepted.

    Raises
    ------
    InputError
        Says which are allowed and proposes the nearest.
    """
    names = tuple(allowed)
    if not isinstance(value, str) or value not in names:
        problem = f"is {shown(value)}, but must be one of {', '.join(names)}"
        hint = nearest(value, names) if isinstance(value, str) else ""
        raise InputError.about(field, problem, hint=hint)


class _Shortened(reprlib.Repr):
    """A repr that is short at any depth and never fails on a huge integer."""

    def repr_int(self, x: int, level: int) -> str:
        # Python refuses to print integers beyond some thousand digits
        return f"an integer of {x.bit_length()} bits" if x.bit_length() > 128 else str(x)


_shortened = _Shortened()
_shortened.maxstring = _shortened.maxother = _SHOWN_WIDTH


def shown(value: object, width: int = _SHOWN_WIDTH) -> str:
    """Return a value as given, on one line, printable and shortened.

    Parameters
    ----------
    value : object
        Anything, of any size and depth.
    width : int
        Most characters to return.

    Returns
    -------
    str
        Its representation with control characters escaped.
    """
    text = repr(value) if isinstance(value, str) and len(value) < width else _shortened.repr(value)
    printable = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
    return printable if len(printable) <= width else printable[: width - 3] + "..."


def shown_path(path: object) -> str:
    """Return a path for a sentence, quoted, printable and at most 200 characters long."""
    return shown(str(path), width=200)


def dotted(location: Iterable[int | str], inner: str = "") -> str:
    """Join the steps to a field into a name such as ``initial.charge[0].mode``.

    Parameters
    ----------
    location : iterable of int or str
        Keys and list indices, outermost first.
    inner : str
        A dotted name to append.

    Returns
    -------
    str
        The dotted name; keys that are no plain words are quoted and shortened.
    """
    name = ""
    for step in location:
        if isinstance(step, int):
            name += f"[{step}]"
            continue
        plain = len(step) <= _SHOWN_WIDTH and step.replace("-", "_").isidentifier()
        name += ("." if name else "") + (step if plain else shown(step))
    return name + ("." if name and inner and not inner.startswith("[") else "") + inner


def input_error(error: ValidationError, model: type[BaseModel]) -> InputError:
    """Turn what pydantic found into one sentence about the first problem.

    Unknown keys come first, because a misspelt key is also the cause of a missing one.

    Parameters
    ----------
    error : pydantic.ValidationError
        Raised while ``model`` was validated.
    model : type of pydantic.BaseModel
        Its fields are the valid keys.

    Returns
    -------
    InputError
        To be raised by the caller; the class is that of the first problem if that is ours.
    """
    found = error.errors(include_url=False)
    # defaults that depend on a wrong field are no problems of their own
    details = [detail for detail in found if detail["type"] != "default_factory_not_called"]
    details.sort(key=lambda detail: detail["type"] != "extra_forbidden")
    first = details[0]
    others = len(details) - 1
    cause = first.get("ctx", {}).get("error")
    if isinstance(cause, InputError):
        if cause.field is None:
            return cause
        field = dotted(first["loc"], cause.field)
        others += cause.others
        return type(cause).about(field, cause.problem, hint=cause.hint, others=others)
    problem, hint = _problem(first, cause, model)
    return InputError.about(dotted(first["loc"]), problem, hint=hint, others=others)


def _problem(detail: ErrorDetails, cause: object, model: type[BaseModel]) -> tuple[str, str]:
    """Return what is wrong with one field, and a hint."""
    kind: str = detail["type"]
    value: Any = detail["input"]
    if kind == "extra_forbidden":
        names = list(model.model_fields)
        key = str(detail["loc"][-1])
        return f"is not a known key; known are {', '.join(names)}", nearest(key, names)
    if kind == "missing":
        field = model.model_fields.get(str(detail["loc"][-1]))
        meaning = f" ({field.description})" if field is not None and field.description else ""
        return f"is missing{meaning}", ""
    if isinstance(cause, ValueError):
        return f"is {shown(value)}, but {cause}", ""
    expected = _EXPECTED.get(kind, detail["msg"].replace("Input should be", "must be"))
    return f"is {shown(value)}, but {expected}", ""
