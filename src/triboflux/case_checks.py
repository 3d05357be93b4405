"""Checks of a case that concern more than one number, each with its own sentence."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, cast

from triboflux.errors import InputError, nearest, shown

if TYPE_CHECKING:
    from triboflux.case import Case, Mode

DIMENSION_NAMES = ("x", "y", "z")
"""Names of the box's directions."""

UNITS = ("scaled", "si")
"""What the values of a result are: divided by their scales, or SI."""

FEWEST_POINTS = 4
MOST_POINTS = 2**20
MOST_OUTPUTS = 100_000

# evaluating the variance while a case is read must take a fraction of a second only
_CHEAP_EVALUATIONS = 2**22
_ROUND_OFF = 1e-12
_LATEST = 1e300


def check_points(points: tuple[int, ...]) -> tuple[int, ...]:
    """Refuse numbers of points that make no grid; raises ValueError."""
    if not 1 <= len(points) <= len(DIMENSION_NAMES):
        raise ValueError("must have 1, 2 or 3 entries, one per dimension")
    if not all(FEWEST_POINTS <= number <= MOST_POINTS for number in points):
        raise ValueError(f"must have entries from {FEWEST_POINTS} to {MOST_POINTS}")
    return points


def parse_outputs(outputs: Any) -> Any:
    """Return a count or a tuple of increasing times; raises ValueError."""
    if hasattr(outputs, "tolist"):
        outputs = outputs.tolist()
    if isinstance(outputs, int) and not isinstance(outputs, bool):
        if not 1 <= outputs <= MOST_OUTPUTS:
            raise ValueError(f"must be a count from 1 to {MOST_OUTPUTS} or a list of times")
        return outputs
    if not isinstance(outputs, list | tuple):
        raise ValueError("must be a count or a list of times")
    entries = cast("Sequence[Any]", outputs)
    if not all(isinstance(time, int | float) and not isinstance(time, bool) for time in entries):
        raise ValueError("must be a count or a list of times")
    # integers may be too large for a float, and nan fails this comparison
    times = tuple(float(time) if abs(time) < _LATEST else math.inf for time in entries)
    if not 1 <= len(times) <= MOST_OUTPUTS:
        raise ValueError(f"must have 1 to {MOST_OUTPUTS} times")
    in_order = all(before < after for before, after in itertools.pairwise(times))
    if not (in_order and 0 <= times[0] and times[-1] < math.inf):
        raise ValueError("must have finite times in increasing order, none negative")
    return times


def largest_mode(points: int) -> int:
    """Return the largest wave number that ``points`` points resolve after 2/3 de-aliasing."""
    return (points - 1) // 3


def check_closures(case: Case) -> None:
    """Refuse an exponent that the closures don't know; raises InputError."""
    if case.closures == "published" and case.exponent != 0.8:
        raise InputError.about(
            "exponent",
            f"is {case.exponent!r}, but must be 0.8 for the published closures",
            hint=" The derived closures accept any.",
        )


def check_realizability_bound(case: Case, with_variance: Sequence[str]) -> None:
    """Refuse a bound on what a model does not know; raises InputError."""
    if case.run.realizability_bound is not None and case.model not in with_variance:
        raise InputError.about(
            "run.realizability_bound",
            f"is {case.run.realizability_bound!r}, but the model '{case.model}' has no variance; "
            f"those that have one are {', '.join(with_variance)}",
        )


def check_dimensions(case: Case, *, one: bool) -> None:
    """Refuse a box of more than the one dimension that a model may know; raises InputError."""
    if one and case.grid.dimensions > 1:
        raise InputError.about(
            "grid.points",
            f"is {list(case.grid.points)}, but must have one entry: the model '{case.model}' knows "
            "one dimension only",
        )


def check_units(case: Case, units: str) -> None:
    """Refuse units that do not exist or that the case has no scales for; raises InputError."""
    if units not in UNITS:
        raise InputError.about(
            "units", f"is {shown(units)}, but must be 'scaled' or 'si'", hint=nearest(units, UNITS)
        )
    if units == "si" and case.suspension is None:
        raise InputError.about(
            "units",
            "is 'si', but SI needs the scales of a case with a table [suspension]; this one has "
            "[numbers]",
        )


def check_modes(case: Case) -> None:
    """Refuse modes and components that the grid does not have; raises InputError."""
    initial = case.initial
    groups = (
        ("charge", initial.charge),
        ("covariance", initial.covariance),
        ("variance", initial.variance),
    )
    for name, modes in groups:
        for index, mode in enumerate(modes):
            _check_mode(case, f"initial.{name}[{index}].mode", mode)
    for index, mode in enumerate(initial.covariance):
        if not 0 <= mode.component < case.grid.dimensions:
            raise InputError.about(
                f"initial.covariance[{index}].component",
                f"is {mode.component}, but must be 0 or more and below the grid's number of "
                f"dimensions, {case.grid.dimensions}",
            )


def _check_mode(case: Case, field: str, mode: Mode) -> None:
    if len(mode.mode) != case.grid.dimensions:
        raise InputError.about(
            field,
            f"is {list(mode.mode)}, but must have one whole number per dimension of the grid, "
            f"{case.grid.dimensions}",
        )
    for waves, points, direction in zip(mode.mode, case.grid.points, DIMENSION_NAMES, strict=False):
        largest = largest_mode(points)
        if abs(waves) > largest:
            raise InputError.about(
                field,
                f"is {list(mode.mode)}, but {points} points along {direction} resolve no more "
                f"than {largest} waves after de-aliasing ({abs(waves)} waves need "
                f"{3 * abs(waves) + 1} points)",
            )


def mean_of_modes(modes: tuple[Mode, ...]) -> float:
    """Return the box mean of a sum of modes, 0 if it is only round-off."""
    constants = [mode.cosine for mode in modes if not any(mode.mode)]
    mean = math.fsum(constants)
    return mean if abs(mean) > _ROUND_OFF * math.fsum(map(abs, constants)) else 0.0


def check_neutrality(case: Case) -> None:
    """Refuse a net charge without a neutralising background; raises InputError."""
    net = mean_of_modes(case.initial.charge)
    if net != 0 and not case.initial.neutralising_background:
        raise InputError.about(
            "initial.charge",
            f"has a net charge of {net!r}, but must be neutral unless "
            "initial.neutralising_background is true",
        )


def check_variance(case: Case) -> None:
    """Refuse a variance that is negative somewhere, if cheap to find; raises InputError."""
    variance = case.initial.variance
    if variance and len(variance) * case.grid.size <= _CHEAP_EVALUATIONS:
        from triboflux.initial_state import require_non_negative, sum_of_modes

        require_non_negative(sum_of_modes(variance, case.grid), case.grid)


def check_stop_value(case: Case, peak: float) -> None:
    """Refuse a stop value that the initial peak charge has reached already; raises InputError."""
    value = case.run.stop_at_peak_charge
    if value is not None and value >= (1.0 - _ROUND_OFF) * peak:
        raise InputError(
            f"run.stop_at_peak_charge: {value:g} is not allowed; it must be below the initial peak "
            f"charge, {peak:.6g}."
        )
