"""What a solver has to offer to be measured; only the standard library is needed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

Settings = dict[str, Any]
Run = Callable[[], Any]
"""Integrates to the end and returns the mean charge on the points."""


class Solver(NamedTuple):
    """One way to solve a problem.

    Attributes
    ----------
    series : function
        Problem, as `problems.described` gives it -> lists of settings to try, each from cheap and
        loose to costly and accurate.
    prepare : function
        Problem and settings -> a function that integrates. All that need not be done again for
        another initial state is done here.
    fixed_step : bool
        Whether the settings fix the steps, so that they are chosen with hindsight.
    """

    series: Callable[[Mapping[str, Any]], Iterable[list[Settings]]]
    prepare: Callable[[Mapping[str, Any], Settings], Run]
    fixed_step: bool = False


POINTS = (32, 48, 64)
"""Points in one dimension that peers choose among; more only cost more."""


def tolerances(first: int, last: int) -> list[float]:
    """Return powers of ten and half ones, the exponents given in halves."""
    return [10.0 ** (-0.5 * half) for half in range(first, last + 1)]


def ladders(
    problem: Mapping[str, Any],
    rtols: Iterable[float],
    ratios: Iterable[float] = (1.0, 0.1, 0.01),
    points: Iterable[int] = POINTS,
    **options: Iterable[Any],
) -> list[list[Settings]]:
    """Return ladders of tolerances, for every ratio of both, number of points and option.

    Parameters
    ----------
    problem : mapping
        Prescribes the points or does not.
    rtols : iterable of float
        Relative tolerances from loose to tight.
    ratios : iterable of float
        Absolute over relative tolerance.
    points : iterable of int
        Points in one dimension to choose among.
    **options : iterable
        Values of further settings.
    """
    chosen: list[Settings] = [{}]
    grids: list[Any] = [problem["points"]] if problem["points"] else [(n,) for n in points]
    for name, values in ({"points": grids} | options).items():
        chosen = [settings | {name: value} for settings in chosen for value in values]
    rtols = list(rtols)
    return [
        [settings | {"rtol": rtol, "atol": ratio * rtol} for rtol in rtols]
        for settings in chosen
        for ratio in ratios
    ]


def counts(
    problem: Mapping[str, Any], steps: Iterable[int], points: Iterable[int] = POINTS, **options: Any
) -> list[list[Settings]]:
    """Return ladders of numbers of equal steps, otherwise as `ladders`."""
    steps = list(steps)
    return [
        [{k: v for k, v in base.items() if k not in ("rtol", "atol")} | {"steps": n} for n in steps]
        for [base] in ladders(problem, [1.0], [1.0], points, **options)
    ]
