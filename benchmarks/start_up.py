"""What happens before and around a solve: imports, compilation and whole processes.

Everything is measured in processes of its own; this module imports nothing but the standard library
so that such a process can time its imports.
"""

from __future__ import annotations

import json
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

from benchmarks.timing import ROOT, child, milliseconds, table, verdict

CASE_FILE = ROOT / "examples" / "fig2.toml"
WARM_ALLOWANCE, COLD_ALLOWANCE, HELP_REACH = 2.0, 6.0, 0.5
BARE = ("-c", "import jax, diffrax, xarray")
PHASES = "from benchmarks.start_up import measure_phases; print(measure_phases({!r}, {}, {}))"
PROFILE = "from benchmarks.start_up import measure_profile; print(measure_profile({!r}, {}))"
STEP_OF_PROFILE = {"A": 3.0, "B": 0.016}


def measure_phases(case: str, points: int, with_stop_rule: bool) -> str:
    """Return as JSON the seconds of imports and compilation in this fresh process."""
    began = perf_counter()
    import diffrax  # noqa: F401
    import jax  # noqa: F401
    import xarray  # noqa: F401

    bare = perf_counter()
    import triboflux.solve  # noqa: F401

    ours = perf_counter()
    from benchmarks.ours import compile_phases, problem

    run = problem(case, "published", points, None if with_stop_rule else 0.1)
    return json.dumps(
        {"import of jax, diffrax, xarray": bare - began, "of triboflux": ours - bare}
        | compile_phases(run)
    )


def measure_profile(case: str, points: int) -> str:
    """Return as JSON the seconds of the parts of a run."""
    from benchmarks.ours import problem, profile

    stop = {"A": 49.14327836, "B": 0.165301694345}[case]
    return json.dumps(profile(problem(case, "published", points, stop), STEP_OF_PROFILE[case]))


def phases_table(points: tuple[int, ...], repeats: int) -> str:
    """Return the medians of imports and compilation as a table, seconds."""
    rows, medians = [], {}
    with TemporaryDirectory() as folder:
        _json(PHASES.format("B", points[0], False), Path(folder))
        for count in points:
            for stop in (False, True):
                code = PHASES.format("B", count, stop)
                runs = [_json(code, Path(folder)) for _ in range(repeats)]
                medians = {name: median(run[name] for run in runs) for name in runs[0]}
                rows.append([f"{count}", "peak charge" if stop else "time", *medians.values()])
    header = ["N", "stops at", *medians]
    return "Seconds, medians of processes that start from nothing:\n\n" + table(header, rows)


def profile_table(points: tuple[int, ...]) -> str:
    """Return where the time of a solve goes as a table."""
    rows = []
    with TemporaryDirectory() as folder:
        for case in "AB":
            for count in points:
                parts = _json(PROFILE.format(case, count), Path(folder))
                rest = parts["whole"] - parts["call"] - parts["steps"] * parts["step"]
                rows.append(
                    [
                        case,
                        f"{count}",
                        *(milliseconds(1e3 * parts[name]) for name in ("step", "functions")),
                        *(milliseconds(parts[name]) for name in ("call", "whole")),
                        f"{parts['steps']:.0f}",
                        milliseconds(rest),
                    ]
                )
    header = [
        "case",
        "N",
        "one step, µs",
        "functions for a new step, µs",
        "call, ms",
        "whole solve, ms",
        "steps",
        "functions and loop, ms",
    ]
    return table(header, rows)


def processes_table(repeats: int, case_file: Path = CASE_FILE) -> tuple[str, list[list[str]]]:
    """Time whole processes in turn: bare imports, warm and cold runs, help.

    Parameters
    ----------
    repeats : int
        Rounds, whose medians count; one more comes before and is not counted.
    case_file : Path
        The case to run.

    Returns
    -------
    table : str
        Seconds of wall and CPU time.
    reaches : list of list of str
        Name, value and verdict of each reach.
    """
    seconds: dict[str, list[tuple[float, float]]] = {}
    with TemporaryDirectory() as name:
        folder = Path(name)
        for turn in range(repeats + 1):
            run = ("-m", "triboflux", "run", str(case_file), "-o", "out.nc", "--overwrite")
            commands: dict[str, tuple[tuple[str, ...], str]] = {
                "bare imports": (BARE, "off"),
                "run, warm cache": (run, str(folder / "warm")),
                "run, cold cache": (run, str(folder / f"cold{turn}")),
                "help": (("-m", "triboflux", "--help"), "off"),
            }
            for label, (arguments, cache) in commands.items():
                done = child(arguments, folder, TRIBOFLUX_CACHE_DIR=cache)
                if turn > 0:
                    seconds.setdefault(label, []).append((done.wall, done.cpu))
    medians = {
        label: [median(column) for column in zip(*s, strict=True)] for label, s in seconds.items()
    }
    wall = {label: values[0] for label, values in medians.items()}
    bare = wall["bare imports"]
    text = table(["process", "wall, s", "CPU, s"], [[k, *v] for k, v in medians.items()])
    limits = {
        "run, warm cache": ("bare imports + 2 s", bare + WARM_ALLOWANCE),
        "run, cold cache": ("bare imports + 6 s", bare + COLD_ALLOWANCE),
        "help": ("0.5 s", HELP_REACH),
    }
    reaches = [
        [label, f"{wall[label]:.2f} s", f"{what} = {most:.2f} s", verdict(wall[label], most)]
        for label, (what, most) in limits.items()
    ]
    return text, reaches


def _json(code: str, folder: Path) -> dict[str, Any]:
    return json.loads(child(["-c", code], folder).output.splitlines()[-1])
