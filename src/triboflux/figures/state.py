"""The state of a result at one time: profiles in one dimension, maps in two and three."""

# Matplotlib leaves the types of its keyword arguments open.
# pyright: reportUnknownMemberType=false

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.ticker import MaxNLocator

from triboflux.case_checks import DIMENSION_NAMES
from triboflux.dataset import source_of
from triboflux.errors import shown
from triboflux.fields import STANDARD_ERROR
from triboflux.figures import style
from triboflux.figures.profiles import IMPOSSIBLE_VECTOR, PANELS, SI_LABELS, Panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray
    from xarray import DataArray, Dataset

    from triboflux.result import Result

HEIGHT = {1: 130.0, 2: 115.0, 3: 120.0}
"""Of the figure by the dimensions of the box, in millimetres."""

_BAND: dict[str, Any] = {"color": style.SKY, "alpha": 0.5, "linewidth": 0.0}
_MISSING = "0.8"
_MOST_ELONGATED = 3.0
_ROOM = 0.04


def state_picture(result: Result, figure: Figure, times: slice) -> Profiles | Maps:
    """Return what draws any of some output times of a result into a figure.

    Parameters
    ----------
    result : Result
        Scaled or in SI, as the figure is to be.
    figure : matplotlib.figure.Figure
        Empty, from `triboflux.figures.style.page` with a `HEIGHT` from here.
    times : slice
        Outputs that will be shown. If there are several, axes and colours fit all of them. A box of
        three dimensions is cut through the largest charge at the first of them.
    """
    picture = Profiles if result.case.grid.dimensions == 1 else Maps
    return picture(result, figure, times)


class Profiles:
    """Charge, electric field, covariance and variance over a box of one dimension.

    Parameters
    ----------
    result, figure, times
        As for `state_picture`.
    """

    def __init__(self, result: Result, figure: Figure, times: slice) -> None:
        self._result, self._figure = result, figure
        self._shown = result.dataset.isel(time=times)
        (self._length,) = _lengths(result)
        self._axes = figure.subplots(2, 2, sharex=True)

    def show(self, time: int) -> None:
        """Draw one time in place of the one before.

        Parameters
        ----------
        time : int
            Index of the output, which may count from the end.
        """
        for ax, panel in zip(self._axes.flat, PANELS, strict=True):
            ax.clear()
            title, label = _words(panel, self._result)
            if panel.variable in self._result.dataset:
                self._draw(ax, panel, time)
                style.finish_panel(ax, title, label, self._length)
            else:
                told = f"the {self._result.case.model} model has none"
                ax.text(0.5, 0.5, told, transform=ax.transAxes, ha="center")
                ax.set_yticks([])
                ax.set_title(title, loc="left")
        for ax in self._axes[-1]:
            ax.set_xlabel(_position("x", self._result))
        if not self._figure.legends:
            handles, labels = self._axes.flat[0].get_legend_handles_labels()
            place: dict[str, Any] = {"loc": "outside lower center", "ncols": len(labels)}
            self._figure.legend(handles, labels, frameon=False, **place)
        self._figure.suptitle(self.caption(time))

    def caption(self, time: int) -> str:
        """Return what stands above the panels."""
        return _caption(self._result, time)

    def _draw(self, ax: Axes, panel: Panel, time: int) -> None:
        """Draw a variable over the box, with its standard error where it has one."""
        dataset, name = self._result.dataset, panel.variable
        error = f"{name}{STANDARD_ERROR}"
        if name == "charge":
            first = style.centred(dataset[name].isel(time=0), self._length)
            ax.plot(*first, **style.INITIAL, label="first output")
        x, values = style.centred(dataset[name].isel(time=time), self._length)
        low = high = self._shown[name].values
        if error in dataset:
            spread = 2.0 * style.centred(dataset[error].isel(time=time), self._length)[1]
            ax.fill_between(
                x, values - spread, values + spread, **_BAND, label="±2 standard errors"
            )
            spread = 2.0 * self._shown[error].values
            low, high = low - spread, high + spread
        ax.plot(x, values, color=style.BLUE, label="this time")
        if self._shown.sizes["time"] > 1:
            bottom, top = _range_of(np.stack([low, high]))
            room = _ROOM * (top - bottom)
            ax.set_ylim(bottom - room, top + room)


class Maps:
    """Charge and size of the electric field in a plane of a box of two or three dimensions.

    Parameters
    ----------
    result, figure, times
        As for `state_picture`.
    """

    def __init__(self, result: Result, figure: Figure, times: slice) -> None:
        self._result, self._figure = result, figure
        shown = result.dataset.isel(time=times)
        self._plane = _plane(shown["charge"].isel(time=0))
        charge, field = _charge_and_field(shown, self._plane)
        (_, largest_field), largest = _range_of(field), max(map(abs, _range_of(charge)))
        self._looks = (
            _Look("(a) mean charge $Q_p^*$", PANELS[0], Normalize(-largest, largest), "RdBu_r"),
            _Look(
                "(b) electric field $|E^*|$", PANELS[1], Normalize(0.0, largest_field), "cividis"
            ),
        )
        self._axes = figure.subplots(1, 2, sharex=True, sharey=True)
        for ax, look in zip(self._axes, self._looks, strict=True):
            bar = figure.colorbar(ScalarMappable(look.norm, look.colours), ax=ax, location="bottom")
            label = _words(look.panel, result)[1]
            bar.set_label(label.replace("E", "|E|", 1) if look.panel.variable == "field" else label)

    def show(self, time: int) -> None:
        """Draw one time in place of the one before.

        Parameters
        ----------
        time : int
            Index of the output, which may count from the end.
        """
        maps = _charge_and_field(self._result.dataset.isel(time=time), self._plane)
        lengths = _lengths(self._result)[:2]
        elongated = max(lengths) > _MOST_ELONGATED * min(lengths)
        for ax, look, values in zip(self._axes, self._looks, maps, strict=True):
            ax.clear()
            closed, (left, right), (bottom, top) = _centred(values, lengths)
            # points are in the middle of their cells, of which the outermost are cut
            half = [0.5 * length / n for length, n in zip(lengths, values.shape, strict=True)]
            ax.imshow(
                np.ma.masked_invalid(closed.T),
                norm=look.norm,
                cmap=look.colours,
                origin="lower",
                extent=(left - half[0], right + half[0], bottom - half[1], top + half[1]),
                aspect="auto" if elongated else "equal",
                interpolation="nearest",
            )
            ax.set_facecolor(_MISSING)
            for axis in (ax.xaxis, ax.yaxis):
                axis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
            ax.set(xlim=(left, right), ylim=(bottom, top), xlabel=_position("x", self._result))
            ax.set_title(_without_stars(look.title, self._result), loc="left")
        self._axes[0].set_ylabel(_position("y", self._result))
        self._figure.suptitle(self.caption(time))

    def caption(self, time: int) -> str:
        """Return what stands above the maps."""
        place = _plane_words(self._result, self._plane)
        told = f"\nPlane {place}, through the largest charge" if place else ""
        return _caption(self._result, time) + told


class _Look(NamedTuple):
    title: str
    panel: Panel
    norm: Normalize
    colours: str


def _lengths(result: Result) -> tuple[float, ...]:
    """Return the lengths of the box in the units of the result."""
    names, points = DIMENSION_NAMES, result.case.grid.points
    return tuple(
        float(result.dataset[name].values[1]) * count
        for name, count in zip(names, points, strict=False)
    )


def _words(panel: Panel, result: Result) -> tuple[str, str]:
    """Return title and label of a panel in the units of a result."""
    label = SI_LABELS[panel.variable] if result.units == "si" else panel.label
    return _without_stars(panel.title, result), label


def _without_stars(title: str, result: Result) -> str:
    """Return a title without the stars of what is scaled, if nothing is."""
    return title.replace("^*", "") if result.units == "si" else title


def _position(name: str, result: Result) -> str:
    return f"${name}$ (m)" if result.units == "si" else f"${name}^* = {name}/L$"


def _plane(charge: DataArray) -> int | None:
    """Return the index along z of the largest charge, None in less than three dimensions."""
    if "z" not in charge.dims:
        return None
    sizes = np.abs(charge.values)
    sizes = np.where(np.isfinite(sizes), sizes, -1.0)
    return int(np.unravel_index(int(np.argmax(sizes)), sizes.shape)[2])


def _plane_words(result: Result, plane: int | None) -> str:
    """Return where a plane lies, in a box around 0; nothing in two dimensions."""
    if plane is None:
        return ""
    length, position = _lengths(result)[2], float(result.dataset["z"].values[plane])
    position -= length if position >= length / 2.0 else 0.0
    return f"$z = {position:.4g}$ m" if result.units == "si" else f"$z^* = {position:.4g}$"


def _charge_and_field(
    state: Dataset, plane: int | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return charge and size of the field in the plane."""
    if plane is not None:
        state = state.isel(z=plane)
    # as a norm, because the square of a field in SI may leave the range of numbers
    axis = state["field"].dims.index("component")
    return state["charge"].values, np.linalg.norm(state["field"].values, axis=axis)


def _centred(
    values: NDArray[np.float64], lengths: tuple[float, ...]
) -> tuple[NDArray[np.float64], tuple[float, float], tuple[float, float]]:
    """Return a map with 0 in the middle and its beginning repeated at its end, and its sides."""
    sides: list[tuple[float, float]] = []
    for axis, (count, length) in enumerate(zip(values.shape, lengths, strict=True)):
        values = np.roll(values, count // 2, axis)
        first = -(count // 2) * (length / count)
        sides.append((first, first + length))
    return np.pad(values, (0, 1), mode="wrap"), sides[0], sides[1]


def _range_of(values: NDArray[np.float64]) -> tuple[float, float]:
    """Return the least and the largest finite value, apart even if they are equal."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return 0.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    if low < high:
        return low, high
    return (low, low + abs(low)) if low else (0.0, 1.0)


def _caption(result: Result, time: int) -> str:
    """Return what is shown and when, and a warning where the state is impossible."""
    case, dataset, si = result.case, result.dataset.isel(time=time), result.units == "si"
    what = source_of(case, dataset.attrs)
    numbers = case.numbers
    when, peak = float(dataset["time"]), style.shown_number(float(dataset["peak_charge"]))
    moment = f"$t$ = {style.shown_time(when)} s" if si else f"$t^*$ = {style.shown_time(when)}"
    largest = f"max $|Q_p|$ = {peak} C" if si else f"max $|Q_p^*|$ = {peak}"
    line = (
        f"{what[0].upper()}{what[1:]}, $Pe$ = {style.shown_number(numbers.peclet)}, "
        f"$\\tau_c^*$ = {style.shown_number(numbers.tau_c)}, {moment}, {largest}"
    )
    if result.status != "ok":
        # a dollar of a foreign file would begin a formula
        line += "; status " + shown(result.status)[1:-1].replace("$", r"\$")
    if dataset.attrs.get("method") == "kinetic" or "realizability_margin" not in dataset:
        return line
    share = float((dataset["realizability_margin"] < 0.0).mean())
    return line + (
        f"\nNot realizable, {IMPOSSIBLE_VECTOR}, in {share:.0%} of the box"
        if share >= 0.005
        else ""
    )
