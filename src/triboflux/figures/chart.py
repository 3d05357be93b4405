"""The chart that says where a reduced model is good enough: Fig. 9 of the paper as a map."""

# Matplotlib leaves the types of its keyword arguments open.
# pyright: reportUnknownMemberType=false

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from contourpy import contour_generator
from matplotlib.colors import ListedColormap, LogNorm
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from triboflux.case import Case
from triboflux.figures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh
    from matplotlib.figure import Figure
    from numpy.typing import NDArray
    from xarray import Dataset

LEVELS: dict[float, Any] = {0.01: (0, (1, 1)), 0.05: (0, (5, 2)), 0.1: "-"}
"""Errors with a contour line, and its dashes."""

PAPER_CASES = {"A": (1e6, 1e-4), "B": (1e6, 1e-1)}
"""The paper's two cases in the plane of Péclet number and collision time."""

_PLANE = ("numbers.peclet", "numbers.tau_c")
_PAPER_NUMBERS = {
    "tau_p": np.inf,
    "tau_sigma": np.inf,
    "energy_ratio": 300.0,
    "length_ratio": 192.0,
    "restitution": 1.0,
}
_SMALLEST, _LARGEST = 1e-4, 1.0
_COLOURS, _PALE = "cividis", "0.95"
_HATCHES = ("////", "\\\\\\\\", "xxxx", "....", "++++", "oo", "----", "||||")
_LABELS = {
    "numbers.peclet": "$Pe$",
    "numbers.tau_c": r"$\tau_c^*$",
    "numbers.tau_p": r"$\tau_p^*$",
    "numbers.tau_sigma": r"$\tau_\sigma^*$",
    "numbers.energy_ratio": "$u_e/u_k$",
    "numbers.length_ratio": "$L/d_p$",
    "numbers.restitution": "$e_c$",
}
_STATUS = {"F <= 0": "$F \\leq 0$"}
_CAPTION_WIDTH = 52


class Mark(NamedTuple):
    """A point of the plane with a letter.

    Attributes
    ----------
    place : tuple of float
        Values of the two numbers.
    told : str
        What the caption says of it.
    """

    place: tuple[float, float]
    told: str


def chart_figure(dataset: Dataset, marks: Mapping[str, Mark] | None = None) -> Figure:
    """Draw the error of a reduced model over two numbers.

    Cells without an error are hatched by reason and counted in the caption; contour lines end
    before them, because between a valid and an invalid point nothing is known.

    Parameters
    ----------
    dataset : xarray.Dataset
        From `triboflux.suitability.suitability`.
    marks : mapping of str to Mark, optional
        Points to be marked, by a short name, besides the paper's two cases. Those are marked where
        the plane and the other numbers are the paper's.

    Returns
    -------
    matplotlib.figure.Figure
        As wide as a column, not known to pyplot.
    """
    given = {**paper_marks(dataset), **(marks or {})}
    caption = _caption(dataset, given)
    with style.page(height=100.0 + 3.6 * caption.count("\n"), width=style.COLUMN) as figure:
        ax = figure.subplots()
        add_colour_bar(figure, draw_map(ax, dataset, given))
        handles = legend_handles([dataset])
        columns = 4 if len(handles) <= 4 else 2
        figure.legend(handles=handles, loc="outside lower center", ncols=columns, frameon=False)
        figure.suptitle(caption, x=0.02, ha="left", fontsize=8.0)
    return figure


def draw_map(
    ax: Axes, dataset: Dataset, marks: Mapping[str, Mark], hatches: Mapping[str, str] | None = None
) -> QuadMesh:
    """Draw colours, contour lines, hatches and marks into a panel.

    Parameters
    ----------
    ax : Axes
        The panel.
    dataset : xarray.Dataset
        From `triboflux.suitability.suitability`.
    marks : mapping of str to Mark
        Points to be marked.
    hatches : mapping of str to str, optional
        Hatch by status, where several panels share one legend; from `hatches_of`.

    Returns
    -------
    matplotlib.collections.QuadMesh
        The colours, for `add_colour_bar`.
    """
    x, y = _axes(dataset)
    keys = [str(dataset[name].attrs["parameter"]) for name in dataset["error"].dims]
    ax.set(xscale="log", yscale="log")
    edges = _edges(x), _edges(y)
    error = dataset["error"].values.T
    colours = ax.pcolormesh(
        *edges,
        np.ma.masked_invalid(np.maximum(error, _SMALLEST / 10.0)),
        norm=LogNorm(_SMALLEST, _LARGEST),
        cmap=_COLOURS,
    )
    _draw_contours(ax, dataset)
    _draw_hatches(ax, dataset, edges, hatches or hatches_of([dataset]))
    for name, mark in marks.items():
        _draw_mark(ax, name, mark)
    ax.set(xlim=edges[0][[0, -1]], ylim=edges[1][[0, -1]])
    ax.set_xlabel(_LABELS.get(keys[0], keys[0]))
    ax.set_ylabel(_LABELS.get(keys[1], keys[1]))
    return colours


def add_colour_bar(figure: Figure, colours: QuadMesh) -> None:
    """Draw the scale of the error on the right of all panels.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        The figure.
    colours : matplotlib.collections.QuadMesh
        From `draw_map`.
    """
    bar = figure.colorbar(colours, ax=figure.axes, extend="both", pad=0.02)
    bar.set_label("relative error of $Q$")


def hatches_of(datasets: Sequence[Dataset]) -> dict[str, str]:
    """Return a hatch for every reason for which some point has no error.

    Parameters
    ----------
    datasets : sequence of xarray.Dataset
        From `triboflux.suitability.suitability`.
    """
    names = [name for dataset in datasets for name in reasons(dataset)]
    found = dict.fromkeys(names)
    return {name: _HATCHES[i % len(_HATCHES)] for i, name in enumerate(found)}


def legend_handles(datasets: Sequence[Dataset]) -> list[Line2D | Patch]:
    """Return the lines and the hatches of some maps, for a legend.

    Parameters
    ----------
    datasets : sequence of xarray.Dataset
        From `triboflux.suitability.suitability`.
    """
    lines: list[Line2D | Patch] = [
        Line2D([], [], label=f"{level:.0%}", **_look(dashes)) for level, dashes in LEVELS.items()
    ]
    patches = [
        Patch(facecolor=_PALE, edgecolor=style.GREY, hatch=hatch, label=_STATUS.get(name, name))
        for name, hatch in hatches_of(datasets).items()
    ]
    return lines + patches


def paper_marks(dataset: Dataset) -> dict[str, Mark]:
    """Return the paper's two cases if the map has their plane and their other numbers.

    Parameters
    ----------
    dataset : xarray.Dataset
        From `triboflux.suitability.suitability`.
    """
    keys = tuple(str(dataset[name].attrs["parameter"]) for name in dataset["error"].dims)
    numbers = Case.from_toml_text(dataset.attrs["case"]).numbers
    same = all(getattr(numbers, name) == value for name, value in _PAPER_NUMBERS.items())
    if keys != _PLANE or not same:
        return {}
    return {
        name: Mark(place, "") for name, place in PAPER_CASES.items() if is_inside(dataset, place)
    }


def is_inside(dataset: Dataset, place: tuple[float, float]) -> bool:
    """Return whether a point lies between the ends of both axes."""
    return all(
        values[0] <= coordinate <= values[-1]
        for values, coordinate in zip(_axes(dataset), place, strict=True)
    )


def contour_lines(dataset: Dataset, level: float) -> list[NDArray[np.float64]]:
    """Return where the error has a value, by interpolation between valid points only.

    Parameters
    ----------
    dataset : xarray.Dataset
        From `triboflux.suitability.suitability`.
    level : float
        The error.

    Returns
    -------
    list of numpy.ndarray
        Lines of shape ``(points, 2)``. Everything is interpolated in logarithms; where one of the
        four points around a place has no error, there is no line.
    """
    # an error may vanish, in logarithms it then is far below every line
    error = np.log(np.maximum(dataset["error"].values.T, 1e-300))
    x, y = (np.log(values) for values in _axes(dataset))
    generator = contour_generator(x, y, np.ma.masked_invalid(error), corner_mask=False)
    lines: Any = generator.lines(float(np.log(level)))
    return [np.exp(line) for line in lines]


def _axes(dataset: Dataset) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    first, second = dataset["error"].dims
    return dataset[first].values, dataset[second].values


def _edges(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the edges of cells around values, half-way in logarithms."""
    logs = np.log(values)
    inner = (logs[1:] + logs[:-1]) / 2.0
    return np.exp(np.concatenate([[2 * logs[0] - inner[0]], inner, [2 * logs[-1] - inner[-1]]]))


def _look(dashes: Any) -> dict[str, Any]:
    return {"color": style.BLACK, "linestyle": dashes, "linewidth": 1.3}


def _draw_contours(ax: Axes, dataset: Dataset) -> None:
    """Draw the lines of equal error."""
    for level, dashes in LEVELS.items():
        for line in contour_lines(dataset, level):
            # light below dark, to be seen on any colour
            ax.plot(*line.T, color="white", linewidth=2.6, solid_capstyle="butt")
            ax.plot(*line.T, **_look(dashes))


def _draw_hatches(
    ax: Axes, dataset: Dataset, edges: tuple[Any, Any], hatches: Mapping[str, str]
) -> None:
    """Hatch the cells without an error, by reason."""
    status = dataset["status"].values.T.astype(str)
    for name in reasons(dataset):
        there = np.ma.masked_where(status != name, np.ones(status.shape))
        cells = ax.pcolor(
            *edges,
            there,
            cmap=ListedColormap([_PALE]),
            hatch=hatches[name],
            linewidth=0.0,
            antialiased=False,
        )
        # snapped to pixels, neighbours leave no seam between them
        cells.set(edgecolor=style.GREY, label=name, snap=True)


def _draw_mark(ax: Axes, name: str, mark: Mark) -> None:
    """Draw a dot and its name beside it."""
    ax.plot(*mark.place, "o", color="white", markeredgecolor="black", markersize=5.0, zorder=7)
    ax.annotate(
        name,
        mark.place,
        xytext=(5, 5),
        textcoords="offset points",
        fontweight="bold",
        zorder=6,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0},
    )


def reasons(dataset: Dataset) -> dict[str, int]:
    """Return how many points have which status but ok, the most frequent first.

    Parameters
    ----------
    dataset : xarray.Dataset
        From `triboflux.suitability.suitability`.
    """
    found = Counter(str(text) for text in dataset["status"].values.ravel())
    del found["ok"]
    return dict(sorted(found.items(), key=lambda entry: (-entry[1], entry[0])))


def counted(dataset: Dataset) -> str:
    """Return how many points have no error for which reason, for a caption.

    Parameters
    ----------
    dataset : xarray.Dataset
        From `triboflux.suitability.suitability`.
    """
    found = reasons(dataset)
    told = ", ".join(f"{count} {_STATUS.get(name, name)}" for name, count in found.items())
    share = sum(found.values()) / dataset["error"].size
    return f"{told or 'none'} of {dataset['error'].size} points ({share:.0%})"


def _caption(dataset: Dataset, marks: Mapping[str, Mark]) -> str:
    """Return what is shown, and how many points have no error for which reason."""
    reference = dataset.attrs["reference"]
    paragraphs = [
        f"{str(dataset.attrs['reduced']).capitalize()} against {reference} model, "
        f"{dataset.attrs['closures']} closures: relative L2 error of the charge when the "
        f"{reference} model's peak has halved.",
    ]
    if reasons(dataset):
        paragraphs.append(f"Hatched, without an error: {counted(dataset)}.")
    paragraphs += [f"{name}: {mark.told}" for name, mark in marks.items() if mark.told]
    return "\n".join(line for p in paragraphs for line in textwrap.wrap(p, _CAPTION_WIDTH))
