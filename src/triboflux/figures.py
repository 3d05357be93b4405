"""The paper's figures, drawn from results only."""

# Matplotlib leaves the types of its keyword arguments open.
# pyright: reportUnknownMemberType=false

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from importlib import resources
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, MultipleLocator

from triboflux.case import Case
from triboflux.errors import InputError, TribofluxError
from triboflux.files import require_writable, written_at_once

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from triboflux.result import Result
    from triboflux.solve import Progress

PAPER_TIMES = {1: "48", 2: "0.16"}
"""The times that the paper quotes for its figures, scaled by L/√Θ."""

CLOSURES = ("published", "derived")
"""The closure sets that a reproduced figure compares, the paper's own first."""

_MILLIMETRE = 1.0 / 25.4
_SIZE = (180.0 * _MILLIMETRE, 125.0 * _MILLIMETRE)
_DOTS_PER_INCH = 200

_STYLE: dict[Any, Any] = {
    "font.size": 8.5,
    "axes.labelsize": 8.5,
    "axes.titlesize": 8.5,
    "figure.titlesize": 8.5,
    "legend.fontsize": 8.5,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "figure.constrained_layout.h_pad": 0.06,
    "figure.constrained_layout.w_pad": 0.06,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "lines.linewidth": 1.4,
    "axes.formatter.use_mathtext": True,
    "axes.formatter.limits": (-3, 4),
}
# Okabe & Ito's colours, which the colour-blind tell apart; the dashes do it in grey, too.
_LINES: dict[str, dict[str, Any]] = {
    "published": {"color": "#0072B2", "linestyle": "-"},
    "derived": {"color": "#D55E00", "linestyle": (0, (5, 2))},
}
_INITIAL: dict[str, Any] = {"color": "0.6", "linewidth": 0.7}
_ZERO: dict[str, Any] = {"color": "0.85", "linewidth": 0.5, "zorder": 0}

# A curve that this part of its panel's height would hold is drawn once more, enlarged.
_TOO_FLAT = 0.05
_BELOW_THE_OTHERS = (0.16, 0.13, 0.78, 0.21)

_IMPOSSIBLE = r"$\langle c_p^*\xi_p^*\rangle^2 > \langle\xi_p^*\xi_p^*\rangle$"


class _Panel(NamedTuple):
    """What a panel shows: a variable of the dataset, and the words around it."""

    variable: str
    title: str
    label: str


_PANELS = (
    _Panel("charge", "(a) mean charge $Q_p^*$", r"$Q_p/Q_0$"),
    _Panel("field", "(b) electric field $E^*$", r"$E\,\varepsilon_0/(n_p Q_0 L)$"),
    _Panel(
        "covariance",
        r"(c) charge–velocity covariance $\langle c_p^*\xi_p^*\rangle$",
        r"$\langle c'_p\xi'_p\rangle/(Q_0\sqrt{\Theta_p})$",
    ),
    _Panel(
        "variance",
        r"(d) charge variance $\langle\xi_p^*\xi_p^*\rangle$",
        r"$\langle\xi'_p\xi'_p\rangle/Q_0^2$",
    ),
)


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


_DRAWINGS = {1: figure_one, 2: figure_two}


def paper_case(number: int, closures: str = "published") -> Case:
    """Return the case behind a figure of the paper.

    Parameters
    ----------
    number : int
        Of the figure, 1 or 2.
    closures : str
        Name of the closure set, ``published`` being the paper's own.

    Returns
    -------
    Case
        The case in ``examples/fig1.toml`` or ``examples/fig2.toml``, with these closures.

    Raises
    ------
    InputError
        If there is no such figure or closure set.
    """
    if number not in _DRAWINGS:
        raise InputError.about(
            "figure", f"is {number!r}, but must be one of {', '.join(map(str, _DRAWINGS))}"
        )
    file = resources.files("triboflux") / "cases" / f"fig{number}.toml"
    data: dict[str, Any] = Case.from_toml_text(file.read_text(encoding="utf-8")).model_dump()
    data["closures"] = closures
    return Case(**data)


def reproduce(
    number: int,
    folder: str | PathLike[str],
    *,
    overwrite: bool = False,
    on_progress: Callable[[Progress], None] | None = None,
) -> list[Path]:
    """Run the case behind a figure of the paper with both closure sets, and draw it.

    Parameters
    ----------
    number : int
        Of the figure, 1 or 2.
    folder : path-like
        An existing folder for ``fig1.png``, ``fig1.pdf``, ``fig1_published.nc`` and
        ``fig1_derived.nc``.
    overwrite : bool
        Replace existing files.
    on_progress : Callable, optional
        Called with a `triboflux.solve.Progress` of both runs together.

    Returns
    -------
    list of pathlib.Path
        The files, all of which were written; after an error none was.

    Raises
    ------
    InputError
        If there is no such figure, the folder is missing, or a file exists.
    TribofluxError
        If a run fails or a file can't be written.
    """
    cases = [paper_case(number, closures) for closures in CLOSURES]
    endings = (".png", ".pdf", *(f"_{closures}.nc" for closures in CLOSURES))
    paths = [Path(folder) / f"fig{number}{ending}" for ending in endings]
    for path in paths:
        require_writable(path, overwrite=overwrite)
    from triboflux.solve import solve  # imports JAX, which drawing does not need

    results = [
        _require_success(solve(case, on_progress=_part(on_progress, part, len(cases))))
        for part, case in enumerate(cases)
    ]
    figure = _DRAWINGS[number](*results)
    with ExitStack() as stack:
        for path, content in zip(paths, (figure, figure, *results), strict=True):
            # The files get their names together, when all of them are complete.
            partial = stack.enter_context(written_at_once(path, overwrite=overwrite))
            if isinstance(content, Figure):
                # Without a date the same result gives the same file.
                undated = {"CreationDate": None} if path.suffix == ".pdf" else None
                content.savefig(partial, dpi=_DOTS_PER_INCH, metadata=undated)
            else:
                content.to_netcdf(partial)
    return paths


def _require_success(result: Result) -> Result:
    if result.status != "ok":
        raise TribofluxError(
            f"the run with {result.case.closures} closures ended as {result.status}: "
            f"{result.stop_reason}."
        )
    return result


def _part(
    on_progress: Callable[[Progress], None] | None, part: int, parts: int
) -> Callable[[Progress], None] | None:
    """Return a callback for one of several runs that reports the fraction of all of them."""
    if on_progress is None:
        return None
    return lambda now: on_progress(replace(now, fraction=(part + now.fraction) / parts))


def _profiles(number: int, results: Sequence[Result]) -> Figure:
    """Draw the four panels that Figs. 1 and 2 have in common."""
    results = [result.to_scaled() for result in results]
    _require_comparable(number, results)
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=_SIZE, dpi=_DOTS_PER_INCH, layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots(2, 2, sharex=True)
        for ax, panel in zip(axes.flat, _PANELS, strict=True):
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


def _draw_panel(ax: Axes, panel: _Panel, results: Sequence[Result]) -> None:
    """Draw one variable of every result at its last time."""
    if panel.variable == "charge":
        ax.plot(*_profile(results[0], panel.variable, 0), **_INITIAL, label="initial charge")
    for result in results:
        time = f"{result.dataset['time'].values[-1]:#.5g}".rstrip(".")
        label = f"{result.case.closures} closures, $t^*$ = {time}"
        style = _LINES[result.case.closures]
        ax.plot(*_profile(result, panel.variable, -1), **style, label=label)
    ax.axhline(0.0, **_ZERO)
    ax.margins(x=0.0)
    # Ticks that depend on the panel's height would outgrow the room that the layout gave them.
    ax.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    ax.xaxis.set_major_locator(MultipleLocator(results[0].case.grid.lengths[0] / 4.0))
    # A power of ten on the left would push the title up.
    ax.yaxis.set_offset_position("right")
    ax.set_title(panel.title, loc="left")
    ax.set_ylabel(panel.label)
    if panel.variable == "variance":
        _enlarge_flat_curves(ax, results)


def _enlarge_flat_curves(ax: Axes, results: Sequence[Result]) -> None:
    """Draw variances that look like zero beside the others once more, between them and zero."""
    tops = [float(_profile(result, "variance", -1)[1].max()) for result in results]
    flat = [r for r, top in zip(results, tops, strict=True) if top < _TOO_FLAT * max(tops)]
    others = [r for r, top in zip(results, tops, strict=True) if top >= _TOO_FLAT * max(tops)]
    lowest = min(float(_profile(result, "variance", -1)[1].min()) for result in others)
    if not flat or lowest < 0.35 * max(tops):
        return
    inset = ax.inset_axes(_BELOW_THE_OTHERS)
    for result in flat:
        inset.plot(*_profile(result, "variance", -1), **_LINES[result.case.closures])
    inset.margins(x=0.0)
    inset.text(0.5, 0.1, "enlarged", transform=inset.transAxes, ha="center", fontsize=7.0)
    inset.set_xticks([])
    inset.yaxis.set_major_locator(MaxNLocator(2, steps=[1, 2, 5, 10]))
    inset.ticklabel_format(axis="y", style="plain")
    inset.tick_params(labelsize=7.0, length=2.0)


def _profile(
    result: Result, variable: str, time: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return positions from one end of the box to the other, 0 in the middle, and values there."""
    values = result.dataset[variable].isel(time=time)
    if "component" in values.dims:
        values = values.isel(component=0)
    length = result.case.grid.lengths[0]
    x, y = values["x"].values, values.values
    beyond = int(np.count_nonzero(x >= length / 2.0))
    x, y = np.roll(np.where(x < length / 2.0, x, x - length), beyond), np.roll(y, beyond)
    # The box is periodic, so its end is its beginning.
    return np.append(x, x[0] + length), np.append(y, y[0])


def _caption(number: int, results: Sequence[Result]) -> str:
    """Return what the panels have in common, and a warning where the state is impossible."""
    case = results[0].case
    peaks = {f"{float(result.dataset['peak_charge'][-1]):.4g}" for result in results}
    moment = f"when max $|Q_p^*|$ = {peaks.pop()}" if len(peaks) == 1 else "at the last times"
    line = f"{case.model} model, $\\tau_c^*$ = {_power_of_ten(case.numbers.tau_c)}, {moment}"
    paper = paper_case(number)
    if (case.numbers, case.initial, case.run) == (paper.numbers, paper.initial, paper.run):
        line += f" (the paper's Fig. {number}: $t^* \\approx$ {PAPER_TIMES[number]})"
    shares = {r.case.closures: _unrealizable_share(r) for r in results}
    told = [f"{share:.0%} of the box ({name})" for name, share in shares.items() if share >= 0.005]
    warning = f"\nNot realizable, {_IMPOSSIBLE}, in {' and '.join(told)}" if told else ""
    return line[0].upper() + line[1:] + warning


def _unrealizable_share(result: Result) -> float:
    """Return the part of the box where no distribution of charges has the last moments."""
    margin = result.dataset["realizability_margin"].isel(time=-1)
    return float((margin < 0.0).mean())


def _power_of_ten(value: float) -> str:
    """Return a number, as a power of ten if it is one and is far from 1."""
    exponent = round(math.log10(value)) if 0.0 < value < math.inf else 0
    is_power = math.isclose(value, 10.0**exponent, rel_tol=1e-12)
    return f"$10^{{{exponent}}}$" if is_power and abs(exponent) > 2 else f"{value:g}"
