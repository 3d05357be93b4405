"""Where the semi-algebraic model is good enough, with both closure sets: Fig. 9 of the paper."""

# Matplotlib leaves the types of its keyword arguments open.
# pyright: reportUnknownMemberType=false

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

from triboflux.figures import chart, style
from triboflux.figures.cases import CLOSURES, Runs
from triboflux.suitability import chart_axes, chart_case

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from xarray import Dataset

MODEL = "semi-algebraic"
"""The model that the figure judges."""

POINTS = 32
"""Along each axis of the plane."""

PARTS = len(CLOSURES)
"""How many maps `regions` asks for."""

_CAPTION = (
    f"{MODEL.capitalize()} against full model: relative L2 error of the charge when the full "
    "model's peak has halved\nA, B: the paper's cases; hatched: points without an error"
)
_TITLE_WIDTH = 46
_LEGEND_COLUMNS = 6


def regions(runs: Runs) -> dict[str, Dataset]:
    """Return the error of the semi-algebraic model over Pe and tau_c, by closure set.

    Parameters
    ----------
    runs : Runs
        Computes the maps.
    """
    axes = chart_axes(POINTS)
    return {closures: runs.map(chart_case(closures), MODEL, axes) for closures in CLOSURES}


def draw(maps: dict[str, Dataset]) -> Figure:
    """Draw a panel for every closure set, with one scale and one legend.

    Parameters
    ----------
    maps : dict of str to xarray.Dataset
        From `regions`.

    Returns
    -------
    matplotlib.figure.Figure
        Not known to pyplot.
    """
    datasets = list(maps.values())
    with style.page(height=118.0) as figure:
        panels = figure.subplots(1, len(maps), sharey=True, squeeze=False)[0]
        hatches = chart.hatches_of(datasets)
        colours = None
        for ax, (closures, dataset) in zip(panels, maps.items(), strict=True):
            colours = chart.draw_map(ax, dataset, chart.paper_marks(dataset), hatches)
            ax.set_title(_title(closures, dataset), loc="left")
        for ax in panels[1:]:
            ax.set_ylabel("")
        if colours is not None:
            chart.add_colour_bar(figure, colours)
        handles = chart.legend_handles(datasets)
        columns = min(len(handles), _LEGEND_COLUMNS)
        figure.legend(handles=handles, loc="outside lower center", ncols=columns, frameon=False)
        figure.suptitle(_CAPTION)
    return figure


def _title(closures: str, dataset: Dataset) -> str:
    """Return what a panel shows, and how many points have no error for which reason."""
    told = textwrap.fill(f"hatched: {chart.counted(dataset)}", _TITLE_WIDTH)
    return f"$\\bf{{{closures}\\ closures}}$\n{told}"
