"""Which model suits a case: the cheapest whose error is small enough, by the table or computed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from triboflux import closures
from triboflux.collision import HERTZ_EXPONENT
from triboflux.model_errors import (
    CHEAPEST_FIRST,
    OK,
    ModelError,
    ModelErrors,
    measure,
    outside,
    percent,
)

if TYPE_CHECKING:
    from triboflux.numbers import Numbers

TOLERANCE = 0.05
"""Error up to which a reduced model is proposed, as `triboflux.suitability.MEASURE` defines it."""

_COMPUTE = "`triboflux numbers --compute` runs all models for exactly this case."


@dataclass(frozen=True)
class Advice:
    """Which model suits, and why.

    Attributes
    ----------
    model : str
        The cheapest whose error is within `TOLERANCE`, its range included; ``"full"`` if there is
        none; ``"none"`` outside the range of the closures.
    reasons : tuple of str
        Sentences.
    errors : tuple of ModelError
        What is known of each reduced model; empty where nothing is.
    origin : str
        ``"table"``, ``"computed"``, or ``"none"``.
    """

    model: str
    reasons: tuple[str, ...]
    errors: tuple[ModelError, ...]
    origin: str


def advice_without_model(transferred_fraction: float) -> Advice:
    """Return the advice outside the range of the closures.

    Parameters
    ----------
    transferred_fraction : float
        γΘ^(a/2), which is too large.
    """
    limit = closures.fraction_limit(HERTZ_EXPONENT)
    reason = (
        f"gamma Theta^(a/2) is {transferred_fraction:.3g}, not below {limit:.3g}: collisions "
        "on average pass over more than the charge difference, and no model holds."
    )
    return Advice("none", (reason,), (), "none")


def advise(numbers: Numbers, closure_name: str = "derived", *, compute: bool = False) -> Advice:
    """Return which model suits a wave of charge over the whole domain.

    Parameters
    ----------
    numbers : Numbers
        Of a suspension, within the range of the closures.
    closure_name : str
        One of `triboflux.closures.NAMES`.
    compute : bool
        Run all models instead of asking the table.

    Raises
    ------
    InputError
        If the closure set is unknown.
    """
    beyond = advice_outside(numbers, closure_name)
    if beyond is not None:
        return beyond
    if compute:
        origin, found = "computed", measure(numbers, closure_name)
    else:
        from triboflux import model_table

        origin, place = "table", model_table.coordinates(numbers, closure_name)
        found = model_table.load().interpolated(place, closure_name)
    return advice_from(found, origin)


def advice_outside(numbers: Numbers, closure_name: str) -> Advice | None:
    """Return the advice outside the range in which models are judged, None inside.

    Parameters
    ----------
    numbers : Numbers
        Of the case.
    closure_name : str
        One of `triboflux.closures.NAMES`.

    Raises
    ------
    InputError
        If the closure set is unknown.
    """
    found = outside(numbers, closure_name)
    if found is None:
        return None
    reason = f"{found.reason}: no model is judged against the full one."
    return Advice("full", (reason,), (), "none")


def advice_from(found: ModelErrors, origin: str) -> Advice:
    """Return which model suits by the errors of the reduced ones.

    Parameters
    ----------
    found : ModelErrors
        Of any status.
    origin : str
        ``"table"`` or ``"computed"``.
    """
    if found.status != OK:
        return Advice("full", _unknown(found, origin), (), "none")
    model, reasons = _choice(found, origin)
    return Advice(model, reasons, found.models, origin)


def _unknown(found: ModelErrors, origin: str) -> tuple[str, ...]:
    """Return why nothing is known of the reduced models."""
    if origin == "computed":
        return (f"No reduced model can be judged: {found.reason}.",)
    told = f"The table of the models' errors does not answer: {found.reason}"
    return (f"{told}. The full model is on the safe side; {_COMPUTE}",)


def _choice(found: ModelErrors, origin: str) -> tuple[str, tuple[str, ...]]:
    """Return the cheapest model that suits, and why.

    Parameters
    ----------
    found : ModelErrors
        With status ``"ok"``.
    origin : str
        ``"table"`` or ``"computed"``.
    """
    errors = {each.model: each for each in found.models}
    suitable = [name for name in CHEAPEST_FIRST if _suits(errors[name])]
    reasons: list[str] = []
    if "gradient" in suitable and not _suits(errors["semi-algebraic"]):
        suitable.remove("gradient")
        reasons.append(
            f"The gradient model's error of {_described(errors['gradient'])} is luck: the "
            "semi-algebraic model, which leaves out less, has "
            f"{_described(errors['semi-algebraic'])}."
        )
    model = suitable[0] if suitable else "full"
    before = CHEAPEST_FIRST.index(model) if suitable else len(CHEAPEST_FIRST)
    near = [name for name in CHEAPEST_FIRST[:before] if _undecided(errors[name])]
    if suitable:
        reasons.append(
            f"The {model} model is the cheapest within {percent(TOLERANCE)}: its error is "
            f"{_described(errors[model])}."
        )
    else:
        range_counts = ", the range of its error included" if origin == "table" else ""
        reasons.append(
            f"No reduced model is within {percent(TOLERANCE)} of the full one{range_counts}."
        )
    if origin == "table" and near:
        reasons.append(f"The table leaves open whether {' or '.join(near)} is, too; {_COMPUTE}")
    return model, tuple(reasons)


def _suits(error: ModelError) -> bool:
    """Return whether a model is accurate enough, at the upper end of its range."""
    return error.high is not None and error.high <= TOLERANCE


def _undecided(error: ModelError) -> bool:
    """Return whether a model may be accurate enough; where the table has no error, it may."""
    if error.low is None or error.high is None:
        return error.status != "nonphysical"
    return error.low <= TOLERANCE < error.high


def _described(error: ModelError) -> str:
    """Return an error in percent with its range, or why there is none."""
    if error.error is None:
        return error.status
    told = percent(error.error)
    if error.low == error.high:
        return told
    return f"{told} ({percent(error.low)} to {percent(error.high)})"
