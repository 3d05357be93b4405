"""Tables and figure of the measurements."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from benchmarks.peers.measure import OURS, Measured
from benchmarks.peers.problems import PROBLEMS, Problem
from benchmarks.timing import ROOT, milliseconds, table

PAGE = ROOT / "docs" / "peers.md"
FIGURE = ROOT / "docs" / "peers.png"
SHOWN = (1e-4, 1e-6, 1e-8)
TARGET = 1e-6
WANTED = {1: 1.0, 2: 3.0, 3: 3.0}
"""How many times as fast as the best adaptive peer, by dimensions."""
HINDSIGHT = 3.0
"""At most how many times the best fixed-step peer's time."""


def shown_settings(settings: Mapping[str, Any]) -> str:
    """Return settings as a short text."""
    points, *rest = settings["points"]
    parts = [f"N {points}"] if not rest else []
    if "steps" in settings:
        parts.append(f"{settings['steps']} steps")
        if settings.get("first", 1.0) != 1.0:
            parts.append("graded")
    else:
        parts.append(f"rtol {settings['rtol']:.0e}")
    if "jacobian" in settings:
        parts.append(settings["jacobian"])
    return ", ".join(parts)


def problem_section(problem: Problem, measured: list[Measured], missing: Mapping[str, str]) -> str:
    """Return the table of a problem: CPU time for several errors, settings for one of them.

    Parameters
    ----------
    problem : Problem
        Which.
    measured : list of Measured
        All solvers and levels.
    missing : mapping
        Reasons why environments could not be made.
    """
    default = next((m for m in measured if m.row.level == 0.0), None)
    rows = []
    if default is not None:
        cells = [milliseconds(default.cpu) if default.error <= level else "—" for level in SHOWN]
        settings = f"default: {shown_settings(default.row.settings)}"
        ratio = "1" if default.error <= TARGET else "—"
        rows.append(
            [f"**{OURS}**", *cells, f"{default.error:.1e}", ratio, settings, _setup(OURS, measured)]
        )
    for solver in _by_time(measured):
        at = {m.row.level: m for m in measured if m.row.solver == solver and m.row.level > 0.0}
        cells = [milliseconds(at[level].cpu) if level in at else "—" for level in SHOWN]
        best = at.get(TARGET)
        if best is None:
            rows.append([solver, *cells, "—", "—", "—", "—"])
            continue
        ratio = "—" if default is None else f"{best.cpu / default.cpu:.2g}"
        more = [
            f"{best.error:.1e}",
            ratio,
            shown_settings(best.row.settings),
            _setup(solver, measured),
        ]
        rows.append([f"{solver}, best settings" if solver == OURS else solver, *cells, *more])
    header = ["solver", *(f"{level:.0e}, ms" for level in SHOWN), "error", "/ ours"]
    text = table([*header, "settings for 1e-06", "compile and set-up, s"], rows)
    notes = [f"{name} could not be installed or started: {why}." for name, why in missing.items()]
    return "\n\n".join([text, *notes])


def _setup(solver: str, measured: list[Measured]) -> str:
    """Return the longest set-up: a compiled program serves several settings."""
    return f"{max(m.setup for m in measured if m.row.solver == solver):.2g}"


def _by_time(measured: Iterable[Measured]) -> list[str]:
    """Return the solvers, the quickest at the target first, those that miss it last."""
    order: dict[str, tuple[bool, float]] = {}
    for m in measured:
        if m.row.level > 0.0:
            key = (m.row.level != TARGET, m.cpu)
            order[m.row.solver] = min(order.get(m.row.solver, key), key)
    return sorted(order, key=lambda solver: order[solver])


def reaches(found: Mapping[str, list[Measured]]) -> str:
    """Return how the package with its default settings compares with the best of the peers."""
    rows = []
    for key, measured in found.items():
        mine = next((m for m in measured if m.row.level == 0.0 and m.error <= TARGET), None)
        dimensions = PROBLEMS[key].dimensions
        for fixed, kind in ((False, "adaptive"), (True, "fixed-step, with hindsight")):
            rivals = [
                m
                for m in measured
                if m.row.level == TARGET
                and m.row.fixed_step == fixed
                and not m.row.solver.startswith(OURS)
            ]
            if mine is None or not rivals:
                continue
            best = min(rivals, key=lambda m: m.cpu)
            ratio = best.cpu / mine.cpu
            least = 1.0 / HINDSIGHT if fixed else WANTED[dimensions]
            word = "met" if ratio >= least else f"missed by a factor {least / ratio:.2g}"
            name = f"{best.row.solver} ({milliseconds(best.cpu)} ms)"
            row = [PROBLEMS[key].title, kind, name, milliseconds(mine.cpu), f"{ratio:.2g}"]
            rows.append([*row, f"{least:.2g}", word])
    header = ["problem", "peers", "quickest", "ours by default, ms", "times as fast", "wanted", ""]
    return table(header, rows)


def draw(found: Mapping[str, list[Measured]], file: Path) -> None:
    """Draw error over CPU time of all solvers, a panel for each problem."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    names = sorted({m.row.solver for measured in found.values() for m in measured} - {OURS})
    colours = plt.get_cmap("tab20")
    looks = {
        name: {"color": colours(i % 20), "marker": "osD^vP*X"[i % 8]}
        for i, name in enumerate(names)
    }
    looks[OURS] = {"color": "black", "marker": "o"}
    columns = min(3, len(found))
    lines = -(-len(found) // columns)
    figure, axes = plt.subplots(
        lines, columns, figsize=(5.0 * columns, 4.2 * lines + 1.6), squeeze=False, sharey=True
    )
    handles: dict[str, Any] = {}
    for panel, (key, measured) in zip(axes.flat, found.items(), strict=False):
        for name in [*names, OURS]:
            points = sorted(
                (m.cpu, m.error) for m in measured if m.row.solver == name and m.row.level > 0.0
            )
            if points:
                fixed = any(m.row.fixed_step for m in measured if m.row.solver == name)
                style = {"linestyle": ":" if fixed else "-", "markersize": 4}
                width = 2.2 if name == OURS else 1.0
                [handles[name]] = panel.loglog(
                    *zip(*points, strict=True), linewidth=width, **style, **looks[name]
                )
        for m in measured:
            if m.row.level == 0.0:
                shape = {"marker": "*", "markersize": 15, "linestyle": "none"}
                [handles["triboflux, default"]] = panel.loglog(m.cpu, m.error, color="red", **shape)
        panel.axhline(TARGET, color="grey", linewidth=0.7)
        panel.set_title(PROBLEMS[key].title, fontsize=10)
        panel.set_xlabel("CPU time of the integration, s")
    for panel in axes[:, 0]:
        panel.set_ylabel("error of Q at the end")
    for panel in axes.flat[len(found) :]:
        panel.set_visible(False)
    figure.legend(
        list(handles.values()), list(handles), loc="lower center", ncol=5, fontsize=8, frameon=False
    )
    figure.tight_layout(rect=(0, 1.2 / (4.2 * lines + 1.6), 1, 1))
    figure.savefig(file, dpi=110)
    plt.close(figure)
