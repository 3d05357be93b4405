"""The variance that the coupled algebraic model starts with: Fig. 6 of the paper."""

# Matplotlib leaves the types of its keyword arguments open.
# pyright: reportUnknownMemberType=false

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from triboflux.figures import style
from triboflux.figures.cases import CLOSURES, PAPER_TIMES, Runs, changed, paper_case

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from triboflux.result import Result

PARTS = len(PAPER_TIMES) * len(CLOSURES)
"""How many results `initial_variances` asks for."""

_POINTS = 2**15
"""Fine enough to show how narrow the singular places of the rare case are."""

_CUT = 0.5
_CASES = {1: "a", 2: "b"}


class _Window(NamedTuple):
    """What an enlarged panel shows."""

    title: str
    x: tuple[float, float]
    variance: tuple[float, float]
    ticks: tuple[float, ...]


_QUARTERS = (-0.5, -0.25, 0.0, 0.25, 0.5)
_ENLARGED = {
    1: _Window("enlarged along the vertical axis", (-0.5, 0.5), (-0.01, 0.05), _QUARTERS),
    2: _Window(
        "enlarged along the horizontal axis", (0.235, 0.265), (-_CUT, _CUT), (0.24, 0.25, 0.26)
    ),
}


class Start(NamedTuple):
    """The start of the algebraic model in one case.

    Attributes
    ----------
    profile : xarray.Dataset
        What `triboflux.diagnostics.initial_closure` returns.
    run : Result
        What became of the run.
    """

    profile: xr.Dataset
    run: Result


def initial_variances(runs: Runs) -> dict[str, Start]:
    """Return the algebraic model's initial variance in both cases with both closure sets.

    Parameters
    ----------
    runs : Runs
        Tries the runs, too.

    Returns
    -------
    dict of str to Start
        By letter of the panel and closure set, such as ``a_published``.
    """
    from triboflux.diagnostics import initial_closure  # imports JAX, which drawing does not need

    found: dict[str, Start] = {}
    for number, letter in _CASES.items():
        for closures in CLOSURES:
            case = paper_case(number, closures, "algebraic")
            fine = initial_closure(changed(case, grid={"points": (_POINTS,)}))
            found[f"{letter}_{closures}"] = Start(fine, runs(case, ("ok", "nonphysical")))
    return found


def broken_at_singularities(
    profile: xr.Dataset, length: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return positions and variance with a gap wherever the variance is singular.

    Parameters
    ----------
    profile : xarray.Dataset
        With ``variance`` over ``x``, which changes sign only where it is singular; so it is
        without triboconductivity, because the numerator of (7.9) is then nowhere negative.
    length : float
        Of the box.

    Returns
    -------
    x, variance : numpy.ndarray
        With NaN between two points of different sign.
    singular : numpy.ndarray
        Where the reciprocal of the variance vanishes, by linear interpolation.
    """
    x, variance = style.centred(profile["variance"], length)
    at = np.flatnonzero(variance[:-1] * variance[1:] < 0.0)
    before, after = 1.0 / variance[at], 1.0 / variance[at + 1]
    singular = x[at] + (x[at + 1] - x[at]) * before / (before - after)
    gaps = np.full(len(at), np.nan)
    return np.insert(x, at + 1, singular), np.insert(variance, at + 1, gaps), singular


def draw(found: dict[str, Start]) -> Figure:
    """Draw the initial variance of both cases, a panel each.

    Parameters
    ----------
    found : dict of str to Start
        From `initial_variances`.

    Returns
    -------
    matplotlib.figure.Figure
        Not known to pyplot.
    """
    with style.page(height=135.0) as figure:
        axes = figure.subplots(2, len(_CASES), height_ratios=(1.5, 1.0))
        for column, (number, letter) in enumerate(_CASES.items()):
            case = paper_case(number)
            length = case.grid.lengths[0]
            for ax in axes[:, column]:
                for closures in CLOSURES:
                    _draw_variance(ax, closures, found[f"{letter}_{closures}"].profile, length)
            tau_c = style.power_of_ten(case.numbers.tau_c)
            label = r"$\langle\xi'_p\xi'_p\rangle/Q_0^2$" if column == 0 else ""
            style.finish_panel(axes[0, column], f"({letter}) $\\tau_c^*$ = {tau_c}", label, length)
            axes[0, column].set_ylim(-_CUT, _CUT)
            title = f"({letter}) {_ENLARGED[number].title}"
            style.finish_panel(axes[1, column], title, label, length)
            axes[1, column].set_xlim(*_ENLARGED[number].x)
            axes[1, column].set_ylim(*_ENLARGED[number].variance)
            axes[1, column].set_xticks(_ENLARGED[number].ticks)
            axes[1, column].set_xlabel("$x^* = x/L$")
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
        figure.align_ylabels(axes[:, 0])
        figure.suptitle(
            "Initial charge variance of the algebraic model "
            f"(axes cut at $\\pm${_CUT:g}; it is unbounded where it is singular)"
        )
    return figure


def _draw_variance(ax: Axes, closures: str, profile: xr.Dataset, length: float) -> None:
    """Draw the variance with one closure set, and lines where it is singular."""
    x, variance, singular = broken_at_singularities(profile, length)
    line = style.CLOSURE_LINES[closures]
    ax.plot(x, variance, **line, label=f"{closures} closures")
    for place in singular:
        ax.axvline(place, color=line["color"], linestyle=":", linewidth=0.7)
