"""Budgets of the three equations: Figs. 4 and 5 of the paper."""

# Matplotlib leaves the types of its keyword arguments open.
# pyright: reportUnknownMemberType=false

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from triboflux.figures import style
from triboflux.figures.cases import CASE_OF_FIGURE, CLOSURES, Runs, changed, paper_case

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PARTS = 2 * len(CLOSURES)
"""How many results `budgets` asks for."""

_STEP = 2e-3
"""Between the outputs that measure the time derivative, as a part of the time itself."""

_TOLERANCE = 1e-10
"""Relative tolerance of the run that measures the time derivative."""


class _Equation(NamedTuple):
    moment: str
    title: str
    label: str


_EQUATIONS = (
    _Equation("charge", "(a) mean charge $Q_p^*$", r"terms$\,/(Q_0\sqrt{\Theta_p}/L)$"),
    _Equation(
        "covariance",
        r"(b) covariance $\langle c_p^*\xi_p^*\rangle$",
        r"terms$\,/(Q_0\Theta_p/L)$",
    ),
    _Equation(
        "variance",
        r"(c) variance $\langle\xi_p^*\xi_p^*\rangle$",
        r"terms$\,/(Q_0^2\sqrt{\Theta_p}/L)$",
    ),
)

_SOLID, _DASHED, _DOTTED, _MIXED = "-", (0, (5, 2)), (0, (1, 1.2)), (0, (6, 1.5, 1, 1.5))
_GROUPS: dict[str, dict[str, Any]] = {
    "kinetic flux": {"color": style.BLUE, "linestyle": _SOLID},
    "triboconductivity": {"color": style.PURPLE, "linestyle": _DASHED},
    "collisional dispersion": {"color": style.GREEN, "linestyle": _MIXED},
    "production": {"color": style.ORANGE, "linestyle": _SOLID},
    "electric force": {"color": style.VERMILION, "linestyle": _DASHED},
    "destruction": {"color": style.PURPLE, "linestyle": _MIXED},
    "dispersion": {"color": style.SKY, "linestyle": _SOLID},
    "production by covariance and charge gradient": {"color": style.ORANGE, "linestyle": _SOLID},
    "production by electric field": {"color": style.VERMILION, "linestyle": _DASHED},
    "kinetic dispersion": {"color": style.SKY, "linestyle": _SOLID},
}
_SHORT = {
    "production by covariance and charge gradient": (
        r"production by $\langle c_p^*\xi_p^*\rangle\,\partial Q_p^*/\partial x^*$"
    )
}
_RATE_LABELS = ("time derivative: the sum of these terms", "time derivative measured on the run")
_ROWS = (1.0, 0.09, 1.0, 0.09, 1.0, 0.09, 0.09)
_RATE: dict[str, Any] = {"color": style.BLACK, "linestyle": _DOTTED, "linewidth": 1.6}
_MEASURED: dict[str, Any] = {
    "color": style.BLACK,
    "linestyle": "none",
    "marker": "o",
    "markersize": 3.2,
    "markerfacecolor": "none",
    "markeredgewidth": 0.7,
}


def budgets(number: int, runs: Runs) -> dict[str, xr.Dataset]:
    """Return the budgets that a figure shows, by closure set.

    Parameters
    ----------
    number : int
        Of the figure: 4 or 5.
    runs : Runs
        Computes the results.

    Returns
    -------
    dict of str to xarray.Dataset
        What `triboflux.diagnostics.budget` returns, and for each moment ``…_rate``, the sum of its
        terms, and ``…_rate_measured``, a difference of outputs before and after.
    """
    from triboflux.diagnostics import budget  # imports JAX, which drawing does not need

    found: dict[str, xr.Dataset] = {}
    for closures in CLOSURES:
        case = paper_case(CASE_OF_FIGURE[number], closures)
        time = float(runs(case).dataset["time"][-1])
        step = _STEP * time
        times = tuple(time + i * step for i in range(-2, 3))
        # six output times and a stop value, like the case itself, share its compiled program
        around = {"outputs": (0.0, *times), "stop_at_peak_charge": 1e-9, "rtol": _TOLERANCE}
        result = runs(changed(case, run=around | {"atol": 1e-3 * _TOLERANCE}))
        terms = budget(result, time)
        added: dict[str, Any] = {}
        for name in (equation.moment for equation in _EQUATIONS):
            rate = terms[name].sum(f"{name}_term")
            before2, before, _, after, after2 = (
                result.dataset[name].values[i] for i in range(1, 6)
            )
            measured = (before2 - 8.0 * before + 8.0 * after - after2) / (12.0 * step)
            added[f"{name}_rate"] = rate
            added[f"{name}_rate_measured"] = (rate.dims, measured)
        attributes = {
            "title": f"Fig. {number}: terms of the equations with {closures} closures",
            "case_toml": result.case.to_toml(),
        }
        found[closures] = terms.assign(added).assign_attrs(attributes)
    return found


def grouped(terms: xr.Dataset, moment: str) -> dict[str, xr.DataArray]:
    """Return the sums of the terms of one equation over each group, in the model's order.

    Parameters
    ----------
    terms : xarray.Dataset
        From `triboflux.diagnostics.budget`.
    moment : str
        ``charge``, ``covariance`` or ``variance``.
    """
    groups = terms[f"{moment}_group"].values
    axis = f"{moment}_term"
    return {
        str(group): terms[moment].isel({axis: np.flatnonzero(groups == group)}).sum(axis)
        for group in dict.fromkeys(groups)
    }


def draw(number: int, found: dict[str, xr.Dataset]) -> Figure:
    """Draw the groups of terms of each equation, one column per closure set.

    Parameters
    ----------
    number : int
        Of the figure.
    found : dict of str to xarray.Dataset
        From `budgets`.

    Returns
    -------
    matplotlib.figure.Figure
        Not known to pyplot.
    """
    case = paper_case(CASE_OF_FIGURE[number])
    length = case.grid.lengths[0]
    zero: dict[str, None] = {}
    rates: dict[str, Any] = {}
    with style.page(height=215.0) as figure:
        rows = figure.add_gridspec(2 * len(_EQUATIONS) + 1, len(found), height_ratios=_ROWS)
        for row, equation in enumerate(_EQUATIONS):
            axes = [figure.add_subplot(rows[2 * row, column]) for column in range(len(found))]
            for ax, (closures, terms) in zip(axes, found.items(), strict=True):
                zero |= dict.fromkeys(_draw_equation(ax, equation.moment, terms, length))
                title = equation.title
                if row == 0:
                    time = style.shown_time(float(terms["time"]))
                    title = f"$\\bf{{{closures}\\ closures}}$, $t^*$ = {time}\n{title}"
                label = equation.label if ax is axes[0] else ""
                style.finish_panel(ax, title, label, length)
                if row == len(_EQUATIONS) - 1:
                    ax.set_xlabel("$x^* = x/L$")
            groups, rates = _handles(axes)
            _legend(figure.add_subplot(rows[2 * row + 1, :]), groups)
        _legend(figure.add_subplot(rows[-1, :]), rates)
        tau_c = style.power_of_ten(case.numbers.tau_c)
        figure.suptitle(
            f"Budgets of the full model, $\\tau_c^*$ = {tau_c}, when max $|Q_p^*|$ = 0.5"
            + (f"\nNot drawn, because zero: {', '.join(zero)}" if zero else "")
        )
        figure.align_ylabels()
    return figure


def _handles(axes: Sequence[Axes]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the lines of an equation's groups, and those of the time derivative, by label."""
    lines: dict[str, Any] = {}
    for ax in axes:
        handles, labels = ax.get_legend_handles_labels()
        lines = dict(zip(labels, handles, strict=True)) | lines
    rates = {label: lines.pop(label) for label in _RATE_LABELS}
    return lines, rates


def _legend(ax: Axes, lines: dict[str, Any]) -> None:
    """Fill a place with a legend."""
    ax.set_axis_off()
    tight = {"columnspacing": 1.2, "handlelength": 1.8, "handletextpad": 0.5, "frameon": False}
    legend = ax.legend(lines.values(), lines.keys(), loc="center", ncols=len(lines), **tight)
    # wider than the panels, it would take room from them
    legend.set_in_layout(False)


def _draw_equation(ax: Axes, moment: str, terms: xr.Dataset, length: float) -> list[str]:
    """Draw the groups of one equation; return those that are zero."""
    zero: list[str] = []
    for group, values in grouped(terms, moment).items():
        if not np.any(values):
            zero.append(f"{group} ({moment})")
            continue
        label = _SHORT.get(group, group)
        ax.plot(*style.centred(values, length), **_GROUPS[group], label=label)
    ax.plot(*style.centred(terms[f"{moment}_rate"], length), **_RATE, label=_RATE_LABELS[0])
    x, measured = style.centred(terms[f"{moment}_rate_measured"], length)
    ax.plot(x[::8], measured[::8], **_MEASURED, label=_RATE_LABELS[1])
    return zero
