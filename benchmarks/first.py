"""Time of the paper's cases A and B beside SciPy's integrators on the same Fourier system.

Run from the root of the repository; nothing is written without ``--write``::

    python -m benchmarks.first --short     # less than two minutes
    python -m benchmarks.first --write     # about ten minutes, fills docs/performance.md
    python -m benchmarks.first --search    # before anything else, renews peer_settings.csv

Every solver has to reach ``max|Q - Q_ref| <= 1e-6 max|Q_ref|``, with Q_ref from Radau's method at
tolerance 1e-11. The package runs with its default tolerances; a row of its own shows the loosest
that reach the error. The peers' tolerances, and the form of the system for the tuned ones, are the
quickest of a search that reach the error, at every number of points; see `peers_fourier`. All are
timed in turn in one process, where compiled programs exist already; what making them takes is
reported apart.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks import ours
from benchmarks.peers_fourier import best_run, reference, relative_error, run_peer
from benchmarks.start_up import phases_table, processes_table, profile_table
from benchmarks.timing import (
    Timing,
    interleaved,
    machine_facts,
    milliseconds,
    table,
    write_section,
)

ERROR = 1e-6
OURS, OURS_LOOSE = "triboflux", "triboflux, loosest"
DEFAULT_RTOL = 1e-6
LOOSER = tuple(10.0 ** (-0.25 * quarter) for quarter in range(12, 24))
POINTS = (48, 64, 128)
PEER_POINTS = (32, *POINTS)
GROUPS = (("A", "published"), ("B", "published"), ("A", "derived"), ("B", "derived"))
TUNED = ("LSODA", "VODE", "BDF", "DOP853")
PLAIN = ("plain LSODA", "plain BDF", "plain DOP853")
# How many times faster than the best of the peers named the package wants to be.
REACHES = {"A": (1.0, "LSODA"), "B": (3.0, "")}
# In case A the explicit method takes tens of seconds at any tolerance: one run, not searched.
SLOW_CASE, SLOW_PEERS = ("A", "published"), {"DOP853": POINTS, "plain DOP853": (48,)}
SLOW_SETTINGS = {"rtol": 1e-6, "atol": 1e-7}
SETTINGS = Path(__file__).with_name("peer_settings.csv")
COLUMNS = ("case", "closures", "solver", "points", "form", "rtol", "atol")


class Effort(NamedTuple):
    """How thoroughly to measure."""

    points: tuple[int, ...]
    peer_points: tuple[int, ...]
    groups: tuple[tuple[str, str], ...]
    rtols: tuple[float, ...]
    ratios: tuple[float, ...]
    repeats: int
    processes: int
    slow_peers: bool


FULL = Effort(
    POINTS,
    PEER_POINTS,
    GROUPS,
    tuple(10.0 ** (-0.5 * half) for half in range(6, 19)),
    (1.0, 0.1, 0.01, 0.001),
    repeats=9,
    processes=5,
    slow_peers=True,
)
SHORT = Effort((48,), (48,), (("B", "published"),), (1e-6, 1e-7), (0.1,), 5, 1, slow_peers=False)


class Entry(NamedTuple):
    """A solver with its settings on one case, and what it reached.

    Attributes
    ----------
    solver : str
        Its name.
    points : int
        Grid points.
    settings : str
        Form of the system and tolerances, or numbers of steps.
    error : float
        Of the charge at the reference's stop time.
    at_time, at_peak : function
        Run to the reference's stop time, and by the stop rule.
    stopped : float
        Relative error of the stop time found by the stop rule.
    """

    solver: str
    points: int
    settings: str
    error: float
    at_time: Callable[[], Any]
    at_peak: Callable[[], Any]
    stopped: float


class Measured(NamedTuple):
    """An entry with its timings, to the given time and by the stop rule."""

    entry: Entry
    at_time: Timing
    at_peak: Timing | None


def our_entry(case: str, closures: str, points: int, rtol: float = DEFAULT_RTOL) -> Entry:
    """Return the package's solver on one case, compiled."""
    exact = reference(case, closures)
    to_time = ours.problem(case, closures, points, exact.time, rtol)
    to_peak = ours.problem(case, closures, points, None, rtol)
    outcome, stopped = ours.solve(to_time), ours.solve(to_peak)
    return Entry(
        OURS if rtol == DEFAULT_RTOL else OURS_LOOSE,
        points,
        f"rtol {rtol:.2g}; {int(outcome.accepted)} + {int(outcome.rejected)} steps",
        relative_error(ours.charge(to_time, outcome), exact.charge),
        partial(ours.solve, to_time),
        partial(ours.solve, to_peak),
        abs(float(stopped.time) / exact.time - 1.0),
    )


def our_entries(case: str, closures: str, points: int) -> Iterable[Entry]:
    """Yield the package's solver with its default and with the loosest sufficient tolerance."""
    yield our_entry(case, closures, points)
    for rtol in LOOSER:
        entry = our_entry(case, closures, points, rtol)
        if entry.error <= ERROR:
            yield entry
            return


def peer_entries(case: str, closures: str, effort: Effort) -> Iterable[Entry]:
    """Yield every peer at every number of points, with the settings found by `search`."""
    exact = reference(case, closures)
    for row in read_settings():
        points = int(row["points"])
        if (row["case"], row["closures"]) == (case, closures) and points in effort.peer_points:
            settings = {"rtol": float(row["rtol"]), "atol": float(row["atol"]), "form": row["form"]}
            entry = peer_entry(row["solver"], case, closures, points, 0.0, settings)
            error = relative_error(entry.at_time()["charge"], exact.charge)
            if error <= ERROR:
                yield entry._replace(error=error)


def read_settings(file: Path = SETTINGS) -> list[dict[str, str]]:
    """Return the settings of the peers, one row per case, closure set, solver and points."""
    with file.open(encoding="utf-8", newline="") as lines:
        return list(csv.DictReader(lines))


def search(effort: Effort, file: Path = SETTINGS) -> None:
    """Find the quickest settings of every peer that reach the error, and keep them in a file.

    Parameters
    ----------
    effort : Effort
        Cases, numbers of points, tolerances and their ratios to try.
    file : Path
        Where to keep them.
    """
    with file.open("w", encoding="utf-8", newline="") as lines:
        writer = csv.DictWriter(lines, COLUMNS, lineterminator="\n")
        writer.writeheader()
        for (case, closures), name in product(effort.groups, TUNED + PLAIN):
            if case == "A" and "DOP853" in name:
                continue
            for points in effort.peer_points:
                heavy = points > 100
                best = best_run(
                    name,
                    case,
                    ERROR,
                    closures=closures,
                    forms=("collocation",) if name in PLAIN else ("collocation", "modal"),
                    points=(points,),
                    rtols=effort.rtols[:-2] if heavy else effort.rtols,
                    ratios=effort.ratios[:-1] if heavy else effort.ratios,
                    repeats=1,
                )
                if best is not None:
                    shown = {key: f"{best[key]:.6g}" for key in ("rtol", "atol")}
                    where = {"case": case, "closures": closures, "solver": name}
                    row = where | {"points": points, "form": best["form"]} | shown
                    writer.writerow(row)


def peer_entry(
    name: str, case: str, closures: str, points: int, error: float, settings: dict[str, Any]
) -> Entry:
    """Return a peer with its settings on one case."""
    exact = reference(case, closures).time
    run = partial(run_peer, name, case, points, closures=closures, **settings)
    shown = f"{settings['form']}, {settings['rtol']:.0e}, {settings['atol']:.0e}"
    stopped = 0.0 if case == "A" and "DOP853" in name else abs(run()["time"] / exact - 1.0)
    return Entry(name, points, shown, error, partial(run, stop_time=exact), run, stopped)


def slow_entries(case: str, closures: str) -> Iterable[Entry]:
    """Yield the peers that are run once only, with settings that were not searched."""
    exact = reference(case, closures)
    for name, numbers in SLOW_PEERS.items():
        form = "collocation" if name in PLAIN else "modal"
        for points in numbers:
            entry = peer_entry(name, case, closures, points, 0.0, SLOW_SETTINGS | {"form": form})
            charge: list[Any] = []

            def run(entry: Entry = entry, charge: list[Any] = charge) -> None:
                charge.append(entry.at_time()["charge"])

            seconds = interleaved({"": run}, 1)[""]
            error = relative_error(charge[0], exact.charge)
            yield entry._replace(error=error, at_time=lambda seconds=seconds: seconds)


def measure(case: str, closures: str, effort: Effort) -> list[Measured]:
    """Return all solvers on one case with their timings."""
    entries = [entry for points in effort.points for entry in our_entries(case, closures, points)]
    entries += peer_entries(case, closures, effort)
    runs = {(i, "time"): entry.at_time for i, entry in enumerate(entries)}
    runs |= {(i, "peak"): entry.at_peak for i, entry in enumerate(entries)}
    seconds = interleaved(runs, effort.repeats)
    measured = [
        Measured(entry, seconds[i, "time"], seconds[i, "peak"]) for i, entry in enumerate(entries)
    ]
    if effort.slow_peers and (case, closures) == SLOW_CASE:
        measured += [Measured(slow, slow.at_time(), None) for slow in slow_entries(case, closures)]
    return measured


def solvers_table(measured: list[Measured]) -> str:
    """Return the timings of all solvers on one case as a table."""
    same = {m.entry.points: m.at_time for m in measured if m.entry.solver == OURS}
    quickest = min(same.values(), key=lambda timing: timing.wall)
    own_best = {id(m) for m in best_of_each(measured)}
    rows = []
    for m in measured:
        base = same.get(m.entry.points)
        rows.append(
            [
                m.entry.solver,
                f"{m.entry.points}{' *' if id(m) in own_best else ''}",
                m.entry.settings,
                f"{m.entry.error:.1e}",
                milliseconds(m.at_time.wall),
                milliseconds(m.at_time.cpu),
                "—" if base is None else f"{m.at_time.wall / base.wall:.3g}",
                f"{m.at_time.wall / quickest.wall:.3g}",
                "—" if m.at_peak is None else milliseconds(m.at_peak.wall),
                "—" if m.at_peak is None else f"{m.entry.stopped:.0e}",
            ]
        )
    header = ["solver", "N", "settings", "error", "wall, ms", "CPU, ms", "/ ours, same N"]
    header += ["/ our best", "stop rule, ms", "error of t*"]
    return table(header, rows)


def best_of_each(measured: list[Measured]) -> list[Measured]:
    """Return every solver at its own best number of points."""
    best: dict[str, Measured] = {}
    for m in measured:
        now = best.get(m.entry.solver)
        if now is None or m.at_time.wall < now.at_time.wall:
            best[m.entry.solver] = m
    return list(best.values())


def reach_rows(case: str, closures: str, measured: list[Measured]) -> Iterable[list[str]]:
    """Yield name, value and verdict of the reaches of one case, tuned and plain peers apart."""
    factor, name = REACHES[case]
    for kind, peers in (("tuned", TUNED), ("plain", PLAIN)):
        rivals = tuple(peer for peer in peers if name in peer)
        for span, rule in (("at_time", "given time"), ("at_peak", "stop rule")):
            cells = []
            for points in (*POINTS, None):
                mine = _quickest(measured, (OURS,), span, points)
                cells.append(_cell(mine, _quickest(measured, rivals, span, points), factor))
            what = f"{factor:g} × as fast as {kind} {name or 'peers'}"
            yield [f"{case} {closures}, {rule}", what, *cells]


def _quickest(
    measured: list[Measured], solvers: Sequence[str], span: str, points: int | None
) -> tuple[float, str]:
    """Return the smallest wall time of some solvers, at one or any number of points."""
    return min(
        (
            (getattr(m, span).wall, m.entry.solver.removeprefix("plain "))
            for m in measured
            if m.entry.solver in solvers
            and getattr(m, span) is not None
            and points in (None, m.entry.points)
        ),
        default=(0.0, ""),
    )


def _cell(mine: tuple[float, str], theirs: tuple[float, str], factor: float) -> str:
    """Return how many times faster we are than the quickest rival, and whether that is enough."""
    if not mine[1] or not theirs[1]:
        return "—"
    ratio = theirs[0] / mine[0]
    reached = "met" if ratio >= factor else f"missed by a factor {factor / ratio:.2g}"
    return f"{ratio:.2g} ({theirs[1]}): {reached}"


def solve_report(effort: Effort) -> str:
    """Measure the solve itself and return it as Markdown."""
    parts, reaches = [machine_facts()], []
    for case, closures in effort.groups:
        measured = measure(case, closures, effort)
        parts += [f"### Case {case}, {closures} closures", solvers_table(measured)]
        reaches += reach_rows(case, closures, measured)
    header = ["reach", "wanted", *(f"N = {n}" for n in POINTS), "each at its own best N"]
    parts += ["### Reaches of the solve", table(header, reaches)]
    parts += ["### Where the time of a solve goes", profile_table(effort.points)]
    return "\n\n".join(parts)


def start_up_report(effort: Effort) -> str:
    """Measure imports, compilation and whole processes and return it as Markdown."""
    parts = [machine_facts()]
    parts += ["### Imports and compilation", phases_table(effort.points, min(effort.processes, 3))]
    processes, reaches = processes_table(effort.processes)
    parts += ["### Whole processes", processes]
    parts += [table(["reach", "value", "wanted at most", ""], reaches)]
    return "\n\n".join(parts)


PARTS = {"solve": solve_report, "start-up": start_up_report}


def main(arguments: list[str] | None = None) -> None:
    """Print the report; see the module docstring."""
    parser = argparse.ArgumentParser(description="Time cases A and B beside SciPy's integrators.")
    parser.add_argument("--short", action="store_true", help="case B at 48 points only")
    parser.add_argument("--part", choices=PARTS, help="measure this part only")
    parser.add_argument("--search", action="store_true", help="renew the settings of the peers")
    parser.add_argument("--write", action="store_true", help="fill docs/performance.md")
    chosen = parser.parse_args(arguments)
    if chosen.search:
        search(FULL)
    for name, report in PARTS.items():
        if chosen.part in (None, name):
            text = report(SHORT if chosen.short else FULL)
            print(text, flush=True)
            if chosen.write:
                write_section(name, text)


if __name__ == "__main__":
    main()
