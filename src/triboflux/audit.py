"""The exact closure coefficients beside the printed ones, one row each, with a verdict."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from typing import TYPE_CHECKING

from triboflux import closures
from triboflux.closures import HERTZ_EXPONENT, ClosureSet, Coefficient
from triboflux.errors import InputError

if TYPE_CHECKING:
    from triboflux.sampling import Estimate

AGREES = "agrees"
DIFFERS = "differs"
OPPOSITE_SIGN = "opposite sign"
INVERTED = "inverted"
NOT_PRINTED = "not printed"
VERDICTS = (AGREES, DIFFERS, OPPOSITE_SIGN, INVERTED, NOT_PRINTED)


@dataclass(frozen=True)
class AuditRow:
    """One closure coefficient, exact and as printed by Montilla, Ansart & Simonin (2023).

    Attributes
    ----------
    name : str
        Spelled-out name, which a `ClosureSet` is asked with.
    symbol : str
        The field's notation, for instance ``"lambda_2.3"``.
    formula : str
        Exact closed form.
    exact : float
        Its value, dimensionless.
    printed_formula : str or None
        What the paper prints; None where it prints nothing.
    printed : float or None
        The value of that, dimensionless.
    ratio : float or None
        Printed over exact; None where either is missing or the exact value vanishes.
    verdict : str
        One of `VERDICTS`; ``"agrees"`` means within the rounding of the printed digits.
    equation : str
        Where the paper states the coefficient.
    note : str
        What a reader has to know; empty where nothing.
    sampled : float or None
        The value by sampling collisions; None where that was not asked for, and for a coefficient
        that collisions have no part in.
    error : float or None
        Its standard error.
    """

    name: str
    symbol: str
    formula: str
    exact: float
    printed_formula: str | None
    printed: float | None
    ratio: float | None
    verdict: str
    equation: str
    note: str
    sampled: float | None = None
    error: float | None = None


def audit(
    restitution: float = 1.0,
    exponent: float = HERTZ_EXPONENT,
    *,
    samples: int | None = None,
    seed: int = 0,
    on_progress: Callable[[float], None] | None = None,
) -> tuple[AuditRow, ...]:
    """Compare the exact closure coefficients with the printed ones, and with sampled ones if asked.

    Parameters
    ----------
    restitution : float
        e, dimensionless, from 0 to 1.
    exponent : float
        a of the charge-transfer law, dimensionless, above -1/2. For another one than 4/5 nothing
        is printed.
    samples : int, optional
        Number of colliding pairs to sample; none by default. See `triboflux.sampling`.
    seed : int
        Of the random numbers of the sampling.
    on_progress : callable, optional
        Called with the part of the sampling that is done, from 0 to 1.

    Returns
    -------
    tuple of AuditRow
        One for each coefficient, in the order of the paper's equations.

    Raises
    ------
    InputError
        If an argument is out of range.
    """
    exact_set = _exact(restitution, exponent)
    printed: Mapping[str, Coefficient] = {}
    if exponent == HERTZ_EXPONENT:
        printed = closures.published(restitution).coefficients
    sampled: Mapping[str, Estimate] = {}
    if samples is not None:
        from triboflux.sampling import sample_closures

        setting = (restitution, exponent)
        sampled = sample_closures([setting], samples, seed, on_progress)[setting]
    rows: list[AuditRow] = []
    for name, exact in exact_set.coefficients.items():
        # the paper gives no number for the one that follows from its other equations
        other = printed.get(name) if name != "transferred_fraction" else None
        rows.append(_row(name, exact, other, sampled.get(name)))
    return tuple(rows)


def _exact(restitution: float, exponent: float) -> ClosureSet:
    """Return the exact set, refusing arguments for which there is none."""
    if not 0.0 <= restitution <= 1.0:
        raise InputError.about(
            "restitution", f"is {restitution!r}, but must be a number from 0 to 1"
        )
    if not (math.isfinite(exponent) and exponent > -0.5):
        raise InputError.about(
            "exponent", f"is {exponent!r}, but must be a finite number above -0.5"
        )
    try:
        found = closures.complete(restitution, exponent)
    except OverflowError:
        found = None
    if found is None or not all(math.isfinite(c.value) for c in found.coefficients.values()):
        raise InputError.about(
            "exponent", f"is {exponent!r}, for which the collision integrals exceed every number"
        )
    return found


def _row(
    name: str, exact: Coefficient, printed: Coefficient | None, sampled: Estimate | None
) -> AuditRow:
    """Compare one coefficient."""
    ratio = None
    if printed is not None and exact.value != 0.0:
        quotient = printed.value / exact.value
        ratio = quotient if math.isfinite(quotient) else None
    return AuditRow(
        name,
        exact.symbol,
        exact.formula,
        exact.value,
        None if printed is None else printed.formula,
        None if printed is None else printed.value,
        ratio,
        NOT_PRINTED if printed is None else _verdict(exact.value, printed),
        exact.equation,
        exact.note,
        None if sampled is None else sampled.value,
        None if sampled is None else sampled.error,
    )


def _verdict(exact: float, printed: Coefficient) -> str:
    """Return how a printed value stands to the exact one."""
    value = printed.value
    if abs(value - exact) <= _rounding(printed.formula) + 1e-12 * abs(exact):
        return AGREES
    if math.isclose(value * exact, 1.0, rel_tol=1e-12):
        return INVERTED
    return OPPOSITE_SIGN if value * exact < 0.0 else DIFFERS


def _rounding(formula: str) -> float:
    """Return half a unit of the last digit of a plain number, 0 for a formula."""
    try:
        exponent = Decimal(formula).as_tuple().exponent
    except InvalidOperation:
        return 0.0
    return 0.5 * 10.0**exponent if isinstance(exponent, int) else 0.0
