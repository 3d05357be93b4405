"""The figure of a comparison: four fields of all models at the same time."""

# Matplotlib leaves the types of its keyword arguments open.
# pyright: reportUnknownMemberType=false

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from triboflux.case_checks import DIMENSION_NAMES
from triboflux.comparison import FIELDS, VECTORS
from triboflux.figures import style
from triboflux.figures.profiles import IMPOSSIBLE_VECTOR, PANELS, SI_LABELS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from xarray import DataArray, Dataset

    from triboflux.comparison import Comparison

LINES: dict[str, dict[str, Any]] = {
    "self-consistent-flow": {"color": style.WINE, "linestyle": (0, (2, 1, 8, 1))},
    "self-consistent": {"color": style.BROWN, "linestyle": (0, (8, 2))},
    "third-order": {"color": style.ORANGE, "linestyle": (0, (6, 1.5, 1, 1.5, 1, 1.5))},
    "full": {"color": style.PURPLE, "linestyle": "-"},
    "semi-algebraic": {"color": style.BLACK, "linestyle": (0, (5, 2))},
    "algebraic": {"color": style.BLUE, "linestyle": (0, (5, 1.5, 1, 1.5))},
    "gradient": {"color": style.VERMILION, "linestyle": (0, (1, 1))},
    "collisional": {"color": style.GREEN, "linestyle": (0, (2.5, 1.5))},
}
"""Colour and, for print in grey, dashes of each model that is not the reference."""

REFERENCE: dict[str, Any] = {"color": style.SKY, "linestyle": "-", "linewidth": 3.2}
"""Wide, light and below the others, so that a curve that coincides with it is seen."""

LONG = 38
"""Characters of a legend's entry of which three do not fit beside each other."""

_LARGER = 1.0 + 1e-6


class Section(NamedTuple):
    """A line through the box along one of its directions.

    Attributes
    ----------
    axis : str
        ``"x"``, ``"y"`` or ``"z"``.
    place : dict of str to int
        Index of the point along every other direction.
    """

    axis: str
    place: dict[str, int]

    def of(self, values: DataArray) -> DataArray:
        """Return a field on the line over ``x``, of vectors the component along it."""
        if "component" in values.dims:
            values = values.isel(component=DIMENSION_NAMES.index(self.axis))
        values = values.isel(self.place, drop=True)
        return values if self.axis == "x" else values.rename({self.axis: "x"})


def section(charge: DataArray) -> Section:
    """Return the line through the largest absolute charge along which the charge varies most.

    Parameters
    ----------
    charge : xarray.DataArray
        Over ``x``, ``y`` and ``z``, or the first of them.
    """
    values = charge.values
    size = np.abs(values)
    # of values that are equal but for round-off, the first
    place = np.unravel_index(int(np.argmax(size * _LARGER >= size.max())), values.shape)
    spreads: list[float] = []
    for number in range(values.ndim):
        line = tuple(slice(None) if n == number else p for n, p in enumerate(place))
        spreads.append(float(np.ptp(values[line])))
    largest = max(spreads)
    along = next(n for n, spread in enumerate(spreads) if spread * _LARGER >= largest)
    names = [str(name) for name in charge.dims]
    others = {
        name: int(p) for n, (name, p) in enumerate(zip(names, place, strict=True)) if n != along
    }
    return Section(names[along], others)


def compare_figure(comparison: Comparison) -> Figure:
    """Draw charge, electric field, covariance and variance of every model at the same time.

    A box of two or three dimensions is cut along the line through the reference's largest charge,
    in the direction in which its charge varies most; of vectors the component along it is shown.

    Parameters
    ----------
    comparison : Comparison
        Scaled or in SI, as the figure is to be.

    Returns
    -------
    matplotlib.figure.Figure
        Not known to pyplot; its ``savefig`` writes it.
    """
    case = comparison.case
    states = {name: state.dataset.isel(time=-1) for name, state in comparison.states.items()}
    reference = states.pop(comparison.reference)
    states = {comparison.reference: reference, **states}
    line = section(reference["charge"])
    number = DIMENSION_NAMES.index(line.axis)
    length = float(reference[line.axis].values[1]) * case.grid.points[number]
    with style.page(height=135.0) as figure:
        axes = figure.subplots(2, 2, sharex=True)
        initial = comparison.results[comparison.reference].dataset["charge"].isel(time=0)
        for ax, name, panel in zip(axes.flat, FIELDS, PANELS, strict=True):
            if name == "charge":
                ax.plot(
                    *style.centred(line.of(initial), length),
                    **style.INITIAL,
                    label="initial charge",
                )
            _draw_models(ax, name, states, comparison, line, length)
            label = panel.label if comparison.units == "scaled" else SI_LABELS[name]
            title = panel.title
            if name in VECTORS and case.grid.dimensions > 1:
                # the whole words would not leave room for a power of ten
                title = f"{title.replace('charge–velocity ', '')}, ${line.axis}$ component"
            if comparison.units == "si":
                title = title.replace("^*", "")
            style.finish_panel(ax, title, label, length)
        for ax in axes[-1]:
            star = f"${line.axis}^* = {line.axis}/L$"
            ax.set_xlabel(star if comparison.units == "scaled" else f"${line.axis}$ (m)")
        handles, labels = axes.flat[0].get_legend_handles_labels()
        columns = 2 if max(map(len, labels)) > LONG else 3
        figure.legend(handles, labels, loc="outside lower center", ncols=columns, frameon=False)
        figure.suptitle(_caption(comparison, states, line))
    return figure


def _draw_models(
    ax: Axes,
    variable: str,
    states: dict[str, Dataset],
    comparison: Comparison,
    line: Section,
    length: float,
) -> None:
    """Draw one variable of every model that has it."""
    for name, state in states.items():
        if variable not in state:
            continue
        look: dict[str, Any] = (
            REFERENCE if name == comparison.reference else {"linewidth": 1.2} | LINES[name]
        )
        stop = comparison.row(name).stop_time
        own = "" if stop is None else f", own {_moment(stop, comparison)}"
        label = f"{name}{own}"
        ax.plot(*style.centred(line.of(state[variable]), length), **look, label=label)


def _caption(comparison: Comparison, states: dict[str, Dataset], line: Section) -> str:
    """Return what the panels have in common, and a warning where a state is impossible."""
    case, si = comparison.case, comparison.units == "si"
    reference = comparison.row(comparison.reference)
    moment = _moment(comparison.time, comparison)
    numbers = case.numbers
    lines = [
        f"{case.closures.capitalize()} closures, Pe = {style.shown_number(numbers.peclet)}, "
        f"$\\tau_c^*$ = {style.shown_number(numbers.tau_c)}",
        f"All models at {moment}, where the {comparison.reference} one ended: {reference.reason}"
        + (" (scaled)" if si else ""),
    ]
    if line.place:
        lines.append(
            f"Line along ${line.axis}$ at {_place(comparison, line)}, through the largest charge "
            f"of the {comparison.reference} model"
        )
    shares = {
        name: float((state["realizability_margin"] < 0.0).mean())
        for name, state in states.items()
        if "realizability_margin" in state
    }
    told = [f"{share:.0%} of the box ({name})" for name, share in shares.items() if share >= 0.005]
    if told:
        lines.append(f"Not realizable, {IMPOSSIBLE_VECTOR}, in {' and '.join(told)}")
    absent = [
        f"{row.model} ({'failed after its own end' if row.status == 'ok' else row.status})"
        for row in comparison.rows
        if row.model not in states
    ]
    if absent:
        lines.append(f"Not shown, without a state at this time: {', '.join(absent)}")
    return "\n".join(lines)


def _place(comparison: Comparison, line: Section) -> str:
    """Return where a line lies, in a box around 0 as `style.centred` has it."""
    state = comparison.states[comparison.reference].dataset
    unit = " m" if comparison.units == "si" else ""
    places: list[str] = []
    for name, index in line.place.items():
        positions = state[name].values
        length = positions[1] * positions.size
        position = positions[index] - (length if positions[index] >= length / 2.0 else 0.0)
        places.append(f"${name}$ = {position:.4g}{unit}")
    return ", ".join(places)


def _moment(time: float, comparison: Comparison) -> str:
    shown = style.shown_time(time)
    return f"$t$ = {shown} s" if comparison.units == "si" else f"$t^*$ = {shown}"
