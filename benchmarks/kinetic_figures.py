"""The figures of docs/verdict.md, for `benchmarks.kinetic_verdict`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.ticker import FuncFormatter, NullLocator

import triboflux
from benchmarks.kinetic_beyond import COMPLETED, TRANSPORTED, beyond
from benchmarks.kinetic_models import FIELDS, STREAMING, Prediction, errors_of
from benchmarks.kinetic_particles import STOP, K, Reals, Reference, Setting, X
from benchmarks.kinetic_runs import CASE_B, GROUPS, STRONG, WEAK, Runs
from benchmarks.kinetic_tables import first_runs
from triboflux.figures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Predictions = Mapping[Setting, Mapping[tuple[str, str], Prediction]]
Key = tuple[str, str]

LINES: dict[Key, dict[str, Any]] = {
    ("full", "derived"): {"color": style.VERMILION, "linestyle": (0, (5, 2))},
    ("full", "published"): {"color": style.BLUE, "linestyle": "-"},
    ("gradient", "derived"): {"color": style.ORANGE, "linestyle": (0, (1, 1))},
    ("semi-algebraic", "derived"): {"color": style.ORANGE, "linestyle": (0, (1, 1))},
    ("semi-algebraic", "published"): {"color": style.SKY, "linestyle": (0, (1, 1))},
    ("gradient", "published"): {"color": style.SKY, "linestyle": (0, (3, 1, 1, 1))},
    (TRANSPORTED, "derived"): {"color": style.GREEN, "linestyle": (0, (7, 2, 1, 2))},
    (COMPLETED, "derived"): {"color": style.PURPLE, "linestyle": (0, (2, 2))},
    (STREAMING, ""): {"color": style.GREY, "linestyle": "-", "linewidth": 1.0},
}
PARTICLES: dict[str, Any] = {"color": style.BLACK, "linestyle": "none", "marker": "o"}
PARTICLES |= {"markersize": 2.6, "linewidth": 0.8}
MARKERS = {"full": "o", "gradient": "v", TRANSPORTED: "s", COMPLETED: "D", STREAMING: "x"}
SYMBOLS = {"charge": "$Q$", "covariance": "$C$", "variance": "$V$"}
ROOM = 1.7
"""Panels reach so many times as far as the particles: some closures give far more."""


def named(key: Key) -> str:
    """Return the label of a curve."""
    model, name = key
    return f"{model}, {name}" if name else model


def profiles(runs: Runs, predictions: Predictions) -> Figure:
    """Draw Q, C and V at the particles' t* for three relaxations without a field."""
    chosen = [("weak", WEAK[1]), ("strong", STRONG[1]), ("weak", WEAK[2])]
    keys: list[Key] = [("full", "derived"), ("full", "published")]
    keys += [("semi-algebraic", "derived"), (TRANSPORTED, "derived")]
    with style.page(170.0) as figure:
        axes = figure.subplots(len(chosen), len(FIELDS), squeeze=False)
        for row, (group, setting) in zip(axes, chosen, strict=True):
            reference = first_runs(runs, [setting])[0]
            for ax, name in zip(row, FIELDS, strict=True):
                title = f"{group}, $\\tau_c$ = {setting.tau_c:g}, $t$ = {reference.time:.4g}"
                style.finish_panel(ax, title if name == "charge" else "", SYMBOLS[name], 1.0)
                draw_models(ax, predictions[setting], keys, name)
                draw_particles(ax, reference, name)
        for ax in axes[-1]:
            ax.set_xlabel("$x/L$")
        finish(figure, axes[0][-1])
    return figure


def draw_models(ax: Axes, known: Mapping[Key, Prediction], keys: Sequence[Key], name: str) -> None:
    """Draw one moment of some models."""
    for key in keys:
        if name in known[key].moments:
            ax.plot(*closed(known[key].moments[name]), **LINES[key], label=named(key))


def closed(values: Reals) -> tuple[Reals, Reals]:
    """Return places and values up to the end of the box, which is its beginning."""
    return np.append(X, 1.0), np.append(values, values[0])


def draw_particles(ax: Axes, reference: Reference, name: str) -> None:
    """Draw one moment of the particles with bars of two standard errors, and fit the panel."""
    moment = reference.moments[name]
    ax.errorbar(
        X[::2], moment.values[::2], 2.0 * moment.errors[::2], **PARTICLES, label="particles"
    )
    top = float(np.abs(moment.values).max())
    low = 0.0 if name == "variance" else -top
    ax.set_ylim(min(ROOM * low, -0.04 * top), ROOM * top)
    ax.set_xlim(0.0, 1.0)


def times(runs: Runs, predictions: Predictions) -> Figure:
    """Draw the error of t* over τ_c for each strength of exchange."""
    keys: list[Key] = [
        ("full", "derived"),
        ("full", "published"),
        ("gradient", "derived"),
        ("gradient", "published"),
        (TRANSPORTED, "derived"),
        (COMPLETED, "derived"),
        (STREAMING, ""),
    ]
    with style.page(90.0) as figure:
        axes = figure.subplots(1, len(GROUPS), sharey=True)
        for ax, (group, settings) in zip(axes, GROUPS.items(), strict=True):
            found = first_runs(runs, settings)
            tau_c = [r.setting.tau_c for r in found]
            bars = [100.0 * r.time_error / r.time for r in found]
            ax.fill_between(tau_c, bars, 1e-3, color="0.88", linewidth=0.0, label="error bar")
            for key in keys:
                errors = [errors_of(predictions[r.setting][key], r).time for r in found]
                sizes = [np.nan if e is None else 100.0 * abs(e) for e in errors]
                open_ = {"markerfacecolor": "none"} if key[1] == "published" else {}
                line = LINES[key] | {"marker": MARKERS[key[0]], "markersize": 4.0, "linewidth": 1.0}
                ax.loglog(tau_c, sizes, **line, **open_, label=named(key))
            ax.set_title(f"{group} exchange", loc="left")
            ax.set_xlabel("$\\tau_c$")
            ax.set_ylim(0.03, 2000.0)
            ax.axhline(1.0, **style.ZERO)
            ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            ax.yaxis.set_minor_locator(NullLocator())
        axes[0].set_ylabel("|error of $t^*$|, %")
        finish(figure, axes[0], columns=3)
    return figure


def streaming(runs: Runs) -> Figure:
    """Draw the decay of the largest charge where moments fail, beside free streaming."""
    keys: list[Key] = [("full", "derived"), ("full", "published"), ("gradient", "derived")]
    keys += [(TRANSPORTED, "derived")]
    with style.page(80.0) as figure:
        axes = figure.subplots(1, 2, sharey=True)
        for ax, setting in zip(axes, (WEAK[2], WEAK[3]), strict=True):
            reference = first_runs(runs, [setting])[0]
            fine = np.linspace(0.0, float(reference.times[-1]), 201)
            streamed = np.exp(-0.5 * (K * fine) ** 2)
            ax.plot(fine, streamed, **LINES[STREAMING, ""], label=STREAMING)
            for key in keys:
                ax.plot(fine, peaks(setting, key, fine), **LINES[key], label=named(key))
            few = slice(None, None, max(1, len(reference.times) // 30))
            ax.errorbar(
                reference.times[few],
                reference.peak[few],
                2.0 * reference.peak_error[few],
                **PARTICLES,
                label="particles",
            )
            ax.axhline(STOP, **style.ZERO)
            ax.set_title(f"$\\tau_c$ = {setting.tau_c:g}", loc="left")
            ax.set_xlabel("$t$")
            ax.margins(x=0.0)
            ax.set_ylim(0.0, 1.05)
        axes[0].set_ylabel("max $|Q|$")
        finish(figure, axes[0])
    return figure


def peaks(setting: Setting, key: Key, times: Reals) -> Reals:
    """Return the largest |Q| of a model at some times."""
    model, name = key
    if model == TRANSPORTED:
        return np.abs(beyond(setting, name, False).history(times)[:, 0])
    run = {"t_end": float(times[-1]), "outputs": times.tolist()}
    return triboflux.solve(setting.case(model, name, **run)).dataset["peak_charge"].values


def strong_field(runs: Runs, predictions: Predictions) -> Figure:
    """Draw Q, C and the realizability margin V - C² of case B."""
    keys: list[Key] = [("full", "derived"), ("full", "published"), ("semi-algebraic", "derived")]
    reference = first_runs(runs, CASE_B)[0]
    known = predictions[CASE_B[0]]
    with style.page(72.0) as figure:
        axes = figure.subplots(1, 3)
        for ax, name in zip(axes, ("charge", "covariance"), strict=False):
            style.finish_panel(ax, "", SYMBOLS[name], 1.0)
            draw_models(ax, known, keys, name)
            draw_particles(ax, reference, name)
        margin = axes[2]
        style.finish_panel(margin, "", "$V - C^2$", 1.0)
        for key in keys:
            m = known[key].moments
            margin.plot(*closed(m["variance"] - m["covariance"] ** 2), **LINES[key])
        c, v = reference.moments["covariance"], reference.moments["variance"]
        r_xx = reference.moments["granular_temperature_xx"].values
        error = np.hypot(2.0 * c.values * c.errors, v.errors)
        margin.errorbar(X[::2], (v.values - c.values**2)[::2], 2.0 * error[::2], **PARTICLES)
        hollow = PARTICLES | {"markerfacecolor": "white", "markeredgewidth": 0.6}
        real = v.values - c.values**2 / r_xx
        label = "particles, $V - C^2/R_{xx}$"
        axes[0].plot([], [], **hollow, label=label)
        margin.plot(X[::2], real[::2], **hollow)
        margin.set_xlim(0.0, 1.0)
        for ax in axes:
            ax.set_xlabel("$x/L$")
        figure.suptitle(
            f"Case B, thermostat full, $t$ = {reference.time:.4g}",
        )
        finish(figure, axes[0])
    return figure


def finish(figure: Figure, ax: Axes, columns: int = 3) -> None:
    """Put the legend of a panel below the figure."""
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, frameon=False)


def write(folder: Path, runs: Runs, predictions: Predictions) -> list[Path]:
    """Write all figures as PNG and return their paths."""
    drawn = {
        "profiles": profiles(runs, predictions),
        "times": times(runs, predictions),
        "streaming": streaming(runs),
        "field": strong_field(runs, predictions),
    }
    written: list[Path] = []
    for name, figure in drawn.items():
        path = folder / f"verdict-{name}.png"
        figure.savefig(path, dpi=130)
        written.append(path)
    return written
