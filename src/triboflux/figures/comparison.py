"""A reduced model beside the full one at the same time: Figs. 3, 7 and 8 of the paper."""

# Matplotlib leaves the types of its keyword arguments open.
# pyright: reportUnknownMemberType=false

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from triboflux.figures import style
from triboflux.figures.cases import (
    CASE_OF_FIGURE,
    CLOSURES,
    Runs,
    paper_case,
    until,
)
from triboflux.figures.profiles import IMPOSSIBLE, PANELS, unrealizable_share
from triboflux.figures.style import profile

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from triboflux.result import Result

MODELS = {3: "gradient", 7: "semi-algebraic", 8: "semi-algebraic"}
"""The reduced model that a figure compares with the full one."""

PARTS = 3 * len(CLOSURES)
"""How many results `compare` asks for."""

_FULL: dict[str, Any] = {"color": style.SKY, "linewidth": 3.0}
_REDUCED: dict[str, Any] = {"color": style.BLACK, "linewidth": 1.1, "linestyle": (0, (4, 2))}


class Comparison(NamedTuple):
    """A reduced model beside the full one, with one closure set.

    Attributes
    ----------
    full : Result
        It ends when the largest charge has fallen to the case's stop value.
    reduced : Result
        It ends at the same time.
    halved : Result
        The reduced model until its own largest charge has fallen to the stop value.
    """

    full: Result
    reduced: Result
    halved: Result


def compare(number: int, runs: Runs) -> dict[str, Comparison]:
    """Return what a figure compares, by closure set.

    Parameters
    ----------
    number : int
        Of the figure: 3, 7 or 8.
    runs : Runs
        Computes the results.
    """
    found: dict[str, Comparison] = {}
    for closures in CLOSURES:
        full = runs(paper_case(CASE_OF_FIGURE[number], closures))
        case = paper_case(CASE_OF_FIGURE[number], closures, MODELS[number])
        reduced = runs(until(case, float(full.dataset["time"][-1])))
        found[closures] = Comparison(full, reduced, runs(case))
    return found


def draw(number: int, comparisons: dict[str, Comparison]) -> Figure:
    """Draw charge, field, covariance and variance of both models, one column per closure set.

    Parameters
    ----------
    number : int
        Of the figure.
    comparisons : dict of str to Comparison
        From `compare`.

    Returns
    -------
    matplotlib.figure.Figure
        Not known to pyplot.
    """
    with style.page(height=205.0) as figure:
        axes = figure.subplots(4, len(comparisons), sharex=True, squeeze=False)
        for column, (closures, comparison) in enumerate(comparisons.items()):
            for ax, panel in zip(axes[:, column], PANELS, strict=True):
                if panel.variable == "charge":
                    start = profile(comparison.full, "charge", 0)
                    ax.plot(*start, **style.INITIAL, label="initial charge")
                for result, line in ((comparison.full, _FULL), (comparison.reduced, _REDUCED)):
                    if panel.variable in result.dataset:
                        label = f"{result.case.model} model"
                        ax.plot(*profile(result, panel.variable), **line, label=label)
                length = comparison.full.case.grid.lengths[0]
                label = panel.label if column == 0 else ""
                style.finish_panel(ax, panel.title, label, length)
            title = f"{_heading(closures, comparison)}\n{PANELS[0].title}"
            axes[0, column].set_title(title, loc="left")
            if "variance" not in comparison.reduced.dataset:
                note = f"The {comparison.reduced.case.model} model has no variance."
                axes[-1, column].text(
                    0.5, 0.2, note, transform=axes[-1, column].transAxes, ha="center"
                )
            axes[-1, column].set_xlabel("$x^* = x/L$")
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
        figure.align_ylabels(axes[:, 0])
        figure.suptitle(_caption(comparisons))
    return figure


def _heading(closures: str, comparison: Comparison) -> str:
    time = style.shown_time(comparison.full.dataset["time"].values[-1])
    own = style.shown_time(comparison.halved.dataset["time"].values[-1])
    model = comparison.reduced.case.model
    return f"$\\bf{{{closures}\\ closures}}$, $t^*$ = {time}\n({model} reaches 1/2 at {own})"


def _caption(comparisons: dict[str, Comparison]) -> str:
    """Return what the panels have in common, and a warning where a state is impossible."""
    first = next(iter(comparisons.values()))
    tau_c = style.power_of_ten(first.full.case.numbers.tau_c)
    line = (
        f"Full and {first.reduced.case.model} model at the same time, $\\tau_c^*$ = {tau_c}, "
        "when max $|Q_p^*|$ of the full model = 0.5"
    )
    told = [
        f"{share:.0%} of the box ({closures}, {result.case.model})"
        for closures, comparison in comparisons.items()
        for result in comparison[:2]
        if "variance" in result.dataset and (share := unrealizable_share(result)) >= 0.005
    ]
    return line + (f"\nNot realizable, {IMPOSSIBLE}, in {', '.join(told)}" if told else "")
