"""What the benchmarks share: interleaved timing, child processes, tables and the page they fill.

Only the standard library is imported here: the peak memory of a child process is never reported
below that of its parent at the start.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from statistics import median
from tempfile import TemporaryFile
from time import perf_counter, process_time
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "performance.md"
PACKAGES = ("numpy", "scipy", "jax", "equinox", "diffrax", "xarray")


class Timing(NamedTuple):
    """Median wall and CPU seconds of one of several things that were timed in turn."""

    wall: float
    cpu: float


class Finished(NamedTuple):
    """What a child process took, in seconds and bytes, and what it printed.

    Attributes
    ----------
    wall, cpu : float
        Seconds.
    memory : int
        Peak resident memory, bytes.
    output : str
        Its standard output.
    """

    wall: float
    cpu: float
    memory: int
    output: str


def interleaved(runs: Mapping[Any, Callable[[], Any]], repeats: int) -> dict[Any, Timing]:
    """Time several functions in turn, so that a disturbance meets them all.

    Parameters
    ----------
    runs : mapping of name to function
        Each is called once per round.
    repeats : int
        Number of rounds.

    Returns
    -------
    dict of name to Timing
        Medians over the rounds.
    """
    seconds: dict[Any, list[tuple[float, float]]] = {name: [] for name in runs}
    for _ in range(repeats):
        for name, run in runs.items():
            wall, cpu = perf_counter(), process_time()
            run()
            seconds[name].append((perf_counter() - wall, process_time() - cpu))
    return {name: Timing(*map(median, zip(*pairs, strict=True))) for name, pairs in seconds.items()}


def child(code_or_arguments: Sequence[str], folder: Path, **environment: str) -> Finished:
    """Run this Python in a process of its own and wait for it.

    Compiled bytecode is kept in `folder`, as a second run of an installed package would find it.

    Parameters
    ----------
    code_or_arguments : sequence of str
        What follows the name of the interpreter.
    folder : Path
        Working folder of the process.
    **environment : str
        Additional variables.

    Returns
    -------
    Finished
        Times, peak memory and output.

    Raises
    ------
    RuntimeError
        If the process fails.
    """
    variables = dict(os.environ)
    variables.pop("PYTHONDONTWRITEBYTECODE", None)
    variables["PYTHONPATH"] = os.pathsep.join([str(ROOT), str(ROOT / "src")])
    variables["PYTHONPYCACHEPREFIX"] = str(folder / "bytecode")
    with TemporaryFile() as output, TemporaryFile() as complaints:
        began = perf_counter()
        process = subprocess.Popen(
            [sys.executable, *code_or_arguments],
            cwd=folder,
            env=variables | environment,
            stdout=output,
            stderr=complaints,
        )
        # Not Popen.wait, because only this tells the resources of this one child.
        _, status, usage = os.wait4(process.pid, 0)
        wall = perf_counter() - began
        process.returncode = os.waitstatus_to_exitcode(status)
        output.seek(0)
        if process.returncode != 0:
            complaints.seek(0)
            text = complaints.read().decode()
            raise RuntimeError(f"{' '.join(code_or_arguments)} failed: {text}")
        unit = 1 if sys.platform == "darwin" else 1024
        cpu = usage.ru_utime + usage.ru_stime
        return Finished(wall, cpu, usage.ru_maxrss * unit, output.read().decode())


def machine_facts() -> str:
    """Return a sentence with what a timing depends on: processor, cores, versions."""
    versions = [f"Python {platform.python_version()}"]
    for package in PACKAGES:
        try:
            versions.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            continue
    kind = f"{platform.system()} on {platform.machine()}, {os.cpu_count()} cores"
    return f"{kind}; {', '.join(versions)}. OPENBLAS_NUM_THREADS=1."


def table(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Return a Markdown table; cells are strings or numbers shown with three digits."""

    def line(cells: Iterable[Any]) -> str:
        shown = (cell if isinstance(cell, str) else f"{cell:.3g}" for cell in cells)
        return f"| {' | '.join(shown)} |"

    return "\n".join([line(header), line(["---"] * len(header)), *map(line, rows)])


def milliseconds(seconds: float) -> str:
    """Return a time in milliseconds with three digits."""
    value = 1e3 * seconds
    return f"{value:,.0f}" if value >= 999.5 else f"{value:.3g}"


def verdict(value: float, most: float) -> str:
    """Return whether a reach is met, a value of at most `most`, and by which factor."""
    if value <= most:
        return f"met, {most / value:.2g} times below"
    return f"missed by a factor {value / most:.2g}"


def write_section(name: str, text: str, page: Path = PAGE) -> None:
    """Replace what stands between the markers of a section of the page.

    Parameters
    ----------
    name : str
        Name in the markers.
    text : str
        Markdown.
    page : Path
        A page that contains the markers.

    Raises
    ------
    ValueError
        If the page lacks the markers.
    """
    begin, end = f"<!-- begin {name} -->", f"<!-- end {name} -->"
    old = page.read_text(encoding="utf-8")
    before, found, rest = old.partition(begin)
    _, closed, after = rest.partition(end)
    if not (found and closed):
        raise ValueError(f"{page.name} lacks the markers {begin} and {end}.")
    page.write_text(f"{before}{begin}\n{text}\n{end}{after}", encoding="utf-8")


def print_or_write(name: str, text: str, page: Path, *, write: bool) -> None:
    """Print the text of a section, or write it into its page.

    Parameters
    ----------
    name, text, page
        As for `write_section`.
    write : bool
        Whether to write.

    Raises
    ------
    ValueError
        If the page lacks the markers.
    """
    if write:
        write_section(name, text, page)
    else:
        print(text)
