"""The map of the page: which model suits over two inputs, by the table or by runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from triboflux.assessment import assess
from triboflux.case import Case
from triboflux.errors import InputError
from triboflux.explorer.fields import FIELDS, NUMBERS, SUSPENSION, position
from triboflux.explorer.live import advice_of, runs
from triboflux.model_errors import CHEAPEST_FIRST
from triboflux.sweep_values import ValueRange
from triboflux.units import EXPECTED, to_si

USUAL_AXES = {
    NUMBERS: ("numbers.peclet", "numbers.tau_c"),
    SUSPENSION: ("suspension.granular_temperature", "suspension.charge_scale"),
}
"""The plane of the map by the kind of inputs; that of the numbers is the paper's."""
SIZES = {NUMBERS: (10, 8), SUSPENSION: (21, 16)}
"""Points along each axis: few where every one is run, more where a table answers."""

UNKNOWN, REFUSED = "unknown", "refused"
"""Of a point that the table does not answer, and of one that is no allowed case."""


@dataclass(frozen=True)
class Axis:
    """One axis of the map.

    Attributes
    ----------
    name : str
        A key of `FIELDS`.
    values : tuple of float
        In the field's unit, equal ratios or equal steps apart.
    """

    name: str
    values: tuple[float, ...]

    def si(self, index: int) -> float:
        """Return a value in SI."""
        unit = FIELDS[self.name].unit
        factor = to_si(f"1 {unit}", *EXPECTED)[0] if unit else 1.0
        return self.values[index] * factor


def axes_of(kind: str, wanted: object) -> tuple[Axis, Axis]:
    """Return the axes of the map.

    Parameters
    ----------
    kind : str
        `NUMBERS` or `SUSPENSION`.
    wanted : object
        Two different names of fields with sliders; anything else gives the usual ones.
    """
    names = USUAL_AXES[kind]
    if isinstance(wanted, list) and len(wanted) == 2:  # pyright: ignore[reportUnknownArgumentType]
        first, second = (str(name) for name in wanted)  # pyright: ignore[reportUnknownVariableType]
        if first != second and {first, second} <= set(choices(kind)):
            names = (first, second)
    return tuple(map(_axis, names, SIZES[kind]))  # pyright: ignore[reportReturnType]


def choices(kind: str) -> list[str]:
    """Return the names of the fields that can be an axis."""
    return [name for name, field in FIELDS.items() if field.group == kind and field.low is not None]


def _axis(name: str, count: int) -> Axis:
    field = FIELDS[name]
    assert field.low is not None
    assert field.high is not None
    spacing = "logarithmic" if field.logarithmic else "linear"
    values = ValueRange(first=field.low, last=field.high, count=count, spacing=spacing).values()
    return Axis(name, tuple(map(float, values)))


def plane_of(case: Case, axes: tuple[Axis, Axis]) -> str:
    """Return a text that is the same for all cases with the same map."""
    table = case.model_dump(include={"closures", "numbers", "suspension", "exponent"})
    changing = {axis.name.partition(".")[2] for axis in axes}
    if table["suspension"] is not None:
        del table["numbers"]
    part = table["suspension"] or table["numbers"]
    kept = {name: value for name, value in part.items() if name not in changing}
    return repr((table["closures"], table["exponent"], sorted(changing), kept))


def point_of(case_texts: dict[str, str], axes: tuple[Axis, Axis]) -> list[float | None]:
    """Return where the fields' texts stand in the plane."""
    return [position(axis.name, case_texts[axis.name]) for axis in axes]


def nearest_first(axes: tuple[Axis, Axis], point: list[float | None]) -> Iterator[tuple[int, int]]:
    """Give the points of the map, those around the current case first."""
    sizes = [len(axis.values) for axis in axes]
    centre: list[int] = []
    for axis, value in zip(axes, point, strict=True):
        where = axis.values[len(axis.values) // 2] if value is None else value
        centre.append(sum(entry < where for entry in axis.values))
    places = [(i, j) for i in range(sizes[0]) for j in range(sizes[1])]
    yield from sorted(places, key=lambda p: (p[0] - centre[0]) ** 2 + (p[1] - centre[1]) ** 2)


def judge(
    case: Case, axes: tuple[Axis, Axis], place: tuple[int, int], check: Callable[[], None]
) -> tuple[str, str]:
    """Return the model that suits at a point of the map, and why.

    Parameters
    ----------
    case : Case
        Everything else.
    axes : pair of Axis
        The plane.
    place : pair of int
        Indices of the point.
    check : callable
        Raises `CancelledError` if nobody waits any longer.

    Returns
    -------
    tuple of str
        Name of a model, ``"none"``, `UNKNOWN` or `REFUSED`; and a sentence.
    """
    changed: dict[str, Any] = {
        axis.name.partition(".")[2]: axis.si(index) for axis, index in zip(axes, place, strict=True)
    }
    try:
        if case.suspension is not None:
            found = assess(
                type(case.suspension)(**(case.suspension.model_dump() | changed)), case.closures
            )
            unknown = found.origin == "none" and found.model != "none"
            return (UNKNOWN if unknown else found.model), found.reasons[-1]
        numbers = case.numbers.model_dump() | changed
        there = Case(**(case.model_dump() | {"numbers": numbers}))
        every = {run.model: run for run in runs(there, models=CHEAPEST_FIRST, check=check)}
    except InputError as error:
        return REFUSED, str(error)
    advice = advice_of(there, every)
    return (advice.model if advice.errors else UNKNOWN), advice.reasons[-1]
