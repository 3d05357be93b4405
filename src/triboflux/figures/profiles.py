"""Profiles of charge, field, covariance and variance: Figs. 1 and 2, and comparisons of models."""

# Matplotlib leaves the types of its keyword arguments open.
# pyright: reportUnknownMemberType=false

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from matplotlib.ticker import MaxNLocator

from triboflux.errors import InputError
from triboflux.figures import style
from triboflux.figures.cases import PAPER_TIMES, paper_case
from triboflux.figures.style import profile

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from triboflux.result import Result

# A curve that this part of its panel's height would hold is drawn once more, enlarged.
_TOO_FLAT = 0.05
_BELOW_THE_OTHERS = (0.16, 0.13, 0.78, 0.21)

IMPOSSIBLE = r"$\langle c_p^*\xi_p^*\rangle^2 > \langle\xi_p^*\xi_p^*\rangle$"

IMPOSSIBLE_VECTOR = r"$|\langle c_p\xi_p\rangle|^2 > \Theta_p\langle\xi_p\xi_p\rangle$"
"""The same with units, or in several dimensions."""


class Panel(NamedTuple):
    """What a panel shows: a variable of the dataset, and the words around it."""

    variable: str
    title: str
    label: str


PANELS = (
    Panel("charge", "(a) mean charge $Q_p^*$", r"$Q_p/Q_0$"),
    Panel("field", "(b) electric field $E^*$", r"$E\,\varepsilon_0/(n_p Q_0 L)$"),
    Panel(
        "covariance",
        r"(c) charge–velocity covariance $\langle c_p^*\xi_p^*\rangle$",
        r"$\langle c'_p\xi'_p\rangle/(Q_0\sqrt{\Theta_p})$",
    ),
    Panel(
        "variance",
        r"(d) charge variance $\langle\xi_p^*\xi_p^*\rangle$",
        r"$\langle\xi'_p\xi'_p\rangle/Q_0^2$",
    ),
)

SI_LABELS = {
    "charge": r"$Q_p$ (C)",
    "field": "$E$ (V/m)",
    "covariance": r"$\langle c'_p\xi'_p\rangle$ (C m/s)",
    "variance": r"$\langle\xi'_p\xi'_p\rangle$ (C$^2$)",
}
"""Labels of the same variables in SI."""


def figure_one(*results: Result) -> Figure:
    """Draw Fig. 1 of the paper: the profiles where collisions are frequent, τ_c = 10⁻⁴.

    Four panels show charge, electric field, covariance and variance over the box at each result's
    last time, dimensionless, and the initial charge as a thin grey line. The box goes from -1/2 to
    1/2 as in section 5 of the paper, whose particles are charged positively on the left.

    Parameters
    ----------
    *results : Result
        In one dimension, with the same numbers; for instance one for each closure set.

    Returns
    -------
    matplotlib.figure.Figure
        Not known to pyplot; its ``savefig`` writes it.

    Raises
    ------
    InputError
        If there is no result, or the results are not of this kind.
    """
    return _profiles(1, results)


def figure_two(*results: Result) -> Figure:
    """Draw Fig. 2 of the paper: the profiles where collisions are rare, τ_c = 10⁻¹.

    What is shown is the same as in `figure_one`.

    Parameters
    ----------
    *results : Result
        In one dimension, with the same numbers; for instance one for each closure set.

    Returns
    -------
    matplotlib.figure.Figure
        Not known to pyplot; its ``savefig`` writes it.

    Raises
    ------
    InputError
        If there is no result, or the results are not of this kind.
    """
    return _profiles(2, results)


def _profiles(number: int, results: Sequence[Result]) -> Figure:
    """Draw the four panels that Figs. 1 and 2 have in common."""
    results = [result.to_scaled() for result in results]
    _require_comparable(number, results)
    with style.page(height=125.0) as figure:
        axes = figure.subplots(2, 2, sharex=True)
        for ax, panel in zip(axes.flat, PANELS, strict=True):
            _draw_panel(ax, panel, results)
        for ax in axes[-1]:
            ax.set_xlabel("$x^* = x/L$")
        handles, labels = axes.flat[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
        figure.suptitle(_caption(number, results))
    return figure


def _require_comparable(number: int, results: Sequence[Result]) -> None:
    """Refuse results that a figure of profiles can't show side by side."""
    if not results:
        raise InputError.about("results", f"is empty, but Fig. {number} needs at least one")
    cases = [result.case for result in results]
    for case in cases:
        if case.grid.dimensions != 1:
            raise InputError.about(
                "results",
                f"has one in {case.grid.dimensions} dimensions, but Fig. {number} shows profiles "
                "in one dimension",
            )
        if (case.numbers, case.grid.lengths) != (cases[0].numbers, cases[0].grid.lengths):
            raise InputError.about(
                "results", f"differ in their numbers or boxes, but Fig. {number} has a single case"
            )


def _draw_panel(ax: Axes, panel: Panel, results: Sequence[Result]) -> None:
    """Draw one variable of every result at its last time."""
    if panel.variable == "charge":
        ax.plot(*profile(results[0], panel.variable, 0), **style.INITIAL, label="initial charge")
    for result in results:
        time = style.shown_time(result.dataset["time"].values[-1])
        label = f"{result.case.closures} closures, $t^*$ = {time}"
        line = style.CLOSURE_LINES[result.case.closures]
        ax.plot(*profile(result, panel.variable), **line, label=label)
    style.finish_panel(ax, panel.title, panel.label, results[0].case.grid.lengths[0])
    if panel.variable == "variance":
        _enlarge_flat_curves(ax, results)


def _enlarge_flat_curves(ax: Axes, results: Sequence[Result]) -> None:
    """Draw variances that look like zero beside the others once more, between them and zero."""
    tops = [float(profile(result, "variance")[1].max()) for result in results]
    flat = [r for r, top in zip(results, tops, strict=True) if top < _TOO_FLAT * max(tops)]
    others = [r for r, top in zip(results, tops, strict=True) if top >= _TOO_FLAT * max(tops)]
    lowest = min(float(profile(result, "variance")[1].min()) for result in others)
    if not flat or lowest < 0.35 * max(tops):
        return
    inset = ax.inset_axes(_BELOW_THE_OTHERS)
    for result in flat:
        inset.plot(*profile(result, "variance"), **style.CLOSURE_LINES[result.case.closures])
    inset.margins(x=0.0)
    inset.text(0.5, 0.1, "enlarged", transform=inset.transAxes, ha="center", fontsize=7.0)
    inset.set_xticks([])
    inset.yaxis.set_major_locator(MaxNLocator(2, steps=[1, 2, 5, 10]))
    inset.ticklabel_format(axis="y", style="plain")
    inset.tick_params(labelsize=7.0, length=2.0)


def _caption(number: int, results: Sequence[Result]) -> str:
    """Return what the panels have in common, and a warning where the state is impossible."""
    case = results[0].case
    peaks = {f"{float(result.dataset['peak_charge'][-1]):.4g}" for result in results}
    moment = f"when max $|Q_p^*|$ = {peaks.pop()}" if len(peaks) == 1 else "at the last times"
    line = f"{case.model} model, $\\tau_c^*$ = {style.power_of_ten(case.numbers.tau_c)}, {moment}"
    paper = paper_case(number)
    if (case.numbers, case.initial, case.run) == (paper.numbers, paper.initial, paper.run):
        line += f" (the paper's Fig. {number}: $t^* \\approx$ {PAPER_TIMES[number]})"
    shares = {r.case.closures: unrealizable_share(r) for r in results}
    told = [f"{share:.0%} of the box ({name})" for name, share in shares.items() if share >= 0.005]
    warning = f"\nNot realizable, {IMPOSSIBLE}, in {' and '.join(told)}" if told else ""
    return line[0].upper() + line[1:] + warning


def unrealizable_share(result: Result) -> float:
    """Return the part of the box where no distribution of charges has the last moments."""
    margin = result.dataset["realizability_margin"].isel(time=-1)
    return float((margin < 0.0).mean())
