"""Work and precision of the package beside its peers, run from the root of the repository.

Nothing is written without ``--write``::

    python -m benchmarks.peers --short                # two problems, a minute or two
    python -m benchmarks.peers --write                # all, fills docs/peers.md and its figures
    python -m benchmarks.peers --search               # first renews settings.jsonl; an hour or two
    python -m benchmarks.peers --problem B --module with_rkstiff   # parts of it

The peers' environments are made in ``.peers``, or in the folder that the variable TRIBOFLUX_PEERS
names, when they are missing.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.peers import batch, growth
from benchmarks.peers.environments import ENVIRONMENTS
from benchmarks.peers.measure import (
    Measured,
    available,
    make_reference,
    read_rows,
    search,
    timed,
    write_rows,
)
from benchmarks.peers.problems import PROBLEMS, described
from benchmarks.peers.report import FIGURE, PAGE, draw, problem_section, reaches
from benchmarks.timing import machine_facts, write_section

SHORT = {"problems": ("A", "B"), "modules": ("with_triboflux", "with_scipy")}
LIMIT, LIMIT_OF_BOXES = 0.1, 20.0
"""CPU seconds of a run after which the search tries nothing costlier."""


def measured_problem(
    key: str, modules: tuple[str, ...], renew: bool, repeats: int, folder: Path
) -> tuple[list[Measured], dict[str, str]]:
    """Return the measurements of a problem and why solvers are missing."""
    problem, file = described(PROBLEMS[key]), folder / f"{key}.npy"
    make_reference(problem, file)
    environments, missing = available(modules)
    if renew:
        limit = LIMIT_OF_BOXES if problem["points"] else LIMIT
        for module, environment in environments.items():  # what was found stays, if the next fails
            write_rows(search({module: environment}, key, problem, file, limit))
    rows = [row for row in read_rows() if row.problem == key]
    return timed(environments, problem, rows, file, repeats), missing


def main(arguments: list[str] | None = None) -> None:
    """Print the report; see the module docstring."""
    parser = argparse.ArgumentParser(description="Measure the package beside its peers.")
    parser.add_argument("--short", action="store_true", help="cases A and B beside SciPy only")
    parser.add_argument("--problem", choices=PROBLEMS, action="append", help="these only")
    modules = [environment.module for environment in ENVIRONMENTS]
    parser.add_argument("--module", choices=modules, action="append", help="these solvers only")
    parser.add_argument("--search", action="store_true", help="renew the settings first")
    parser.add_argument("--repeats", type=int, default=9, help="rounds of timing")
    parser.add_argument("--part", choices=("problems", "batch", "growth"), help="this part only")
    parser.add_argument("--write", action="store_true", help="fill the page and its figures")
    chosen = parser.parse_args(arguments)
    problems = tuple(chosen.problem or (SHORT["problems"] if chosen.short else PROBLEMS))
    wanted = tuple(chosen.module or (SHORT["modules"] if chosen.short else ()))
    found: dict[str, list[Measured]] = {}
    with TemporaryDirectory() as name:
        for key in problems if chosen.part in (None, "problems") else ():
            measured, missing = measured_problem(
                key, wanted, chosen.search, chosen.repeats, Path(name)
            )
            found[key] = measured
            text = problem_section(PROBLEMS[key], measured, missing)
            print(f"## {PROBLEMS[key].title}\n\n{text}\n", flush=True)
            if chosen.write:
                write_section(f"problem {key}", text, PAGE)
    if found:
        text = f"{machine_facts()}\n\n{reaches(found)}"
        print(text, flush=True)
        if chosen.write and len(found) > 1:
            draw(found, FIGURE)
            write_section("reaches", text, PAGE)
    for part in (batch, growth):
        name = part.__name__.rpartition(".")[2]
        if chosen.part == name or (chosen.part is None and not (chosen.short or chosen.problem)):
            text = part.report()
            print(text, flush=True)
            if chosen.write:
                write_section(name, text, PAGE)


if __name__ == "__main__":
    main()
