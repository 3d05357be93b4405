"""The map of the page: which model suits over two inputs, by the table or by runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias, cast

from triboflux.assessment import assess
from triboflux.case import Case
from triboflux.errors import InputError
from triboflux.explorer.fields import FIELDS, NUMBERS, SUSPENSION, position
from triboflux.explorer.live import advice_of, runs
from triboflux.model_errors import CHEAPEST_FIRST, POINTS
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


Place: TypeAlias = tuple[int, int]


class Cell(NamedTuple):
    """What is known of a point of the map.

    Attributes
    ----------
    model : str
        The one that suits, ``"none"``, `UNKNOWN` or `REFUSED`.
    why : str
        A sentence.
    run : bool
        Whether all models were run for it.
    """

    model: str
    why: str
    run: bool


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


def kind_of(case: Case) -> str:
    """Return how the inputs of a case were told, `NUMBERS` or `SUSPENSION`."""
    return NUMBERS if case.suspension is None else SUSPENSION


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
    given = cast("list[object]", wanted) if isinstance(wanted, list) else []
    known = [name for name in choices(kind) if name in given]
    if len(given) == len(known) == 2:
        names = (str(given[0]), str(given[1]))
    across, up = SIZES[kind]
    return _axis(names[0], across), _axis(names[1], up)


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


def nearest_first(axes: tuple[Axis, Axis], point: Sequence[float | None]) -> Iterator[Place]:
    """Give the points of the map, those around the current case first."""
    sizes = [len(axis.values) for axis in axes]
    centre: list[int] = []
    for axis, value in zip(axes, point, strict=True):
        where = axis.values[len(axis.values) // 2] if value is None else value
        centre.append(sum(entry < where for entry in axis.values))
    places = [(i, j) for i in range(sizes[0]) for j in range(sizes[1])]
    yield from sorted(places, key=lambda p: (p[0] - centre[0]) ** 2 + (p[1] - centre[1]) ** 2)


def judged(
    case: Case,
    axes: tuple[Axis, Axis],
    point: Sequence[float | None],
    cells: dict[Place, Cell],
    check: Callable[[], None],
) -> Iterator[None]:
    """Fill in what is missing of a map, around the current case first.

    Of a suspension all points are first looked up in the table, and then those that it does not
    answer are run; of numbers by hand all are run.

    Parameters
    ----------
    case : Case
        Everything else.
    axes : pair of Axis
        The plane.
    point : sequence of float or None
        Where the current case is.
    cells : dict
        What is known already, by the indices of the point; it is added to.
    check : callable
        Raises `CancelledError` if nobody waits any longer.

    Yields
    ------
    None
        After every point.
    """
    looks = (_looked_up, _run) if case.suspension is not None else (_run,)
    for look in looks:
        for place in nearest_first(axes, point):
            known = cells.get(place)
            if known is not None and (look is _looked_up or known.model != UNKNOWN or known.run):
                continue
            check()
            changed = {
                axis.name.partition(".")[2]: axis.si(index)
                for axis, index in zip(axes, place, strict=True)
            }
            try:
                cells[place] = look(case, changed, check)
            except InputError as error:
                cells[place] = Cell(REFUSED, str(error), False)
            yield


def _looked_up(case: Case, changed: dict[str, float], check: Callable[[], None]) -> Cell:
    """Return what the table says about a suspension."""
    assert case.suspension is not None
    fields: dict[str, Any] = case.suspension.model_dump() | changed
    there = type(case.suspension)(**fields)
    found = assess(there, case.closures)
    unknown = found.origin == "none" and found.model != "none"
    return Cell(UNKNOWN if unknown else found.model, found.reasons[-1], False)


def _run(case: Case, changed: dict[str, float], check: Callable[[], None]) -> Cell:
    """Return which model suits by running all of them along one dimension."""
    tables = case.model_dump(exclude={"numbers"} if case.suspension is not None else set())
    tables[kind_of(case)] |= changed
    if case.grid.dimensions > 1:
        tables["grid"] = {"points": [POINTS]}
        tables["run"] |= {"adaptive_points": False}
        tables["initial"] = {"charge": [{"mode": [1], "sine": -1.0}]}
    there = Case(**tables)
    found = {run.model: run for run in runs(there, models=CHEAPEST_FIRST, check=check)}
    advice = advice_of(there, found)
    return Cell(advice.model if advice.errors else UNKNOWN, advice.reasons[-1], True)
