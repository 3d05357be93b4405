"""Which model and which closure set are right: all of them against simulated particles.

Run from the root of the repository; nothing is written without ``--write``::

    python -m benchmarks.kinetic_verdict --effort reduced   # a minute, prints the tables
    python -m benchmarks.kinetic_verdict --write            # fills docs/verdict.md and its figures

What is simulated stands in `benchmarks.kinetic_runs`, how in `benchmarks.kinetic_particles`. The
section on closure coefficients comes from `benchmarks.kinetic_closures`, which is run as well.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence

from benchmarks import kinetic_closures, kinetic_figures, kinetic_tables
from benchmarks.kinetic_runs import FIELD, GROUPS, PARTS, SEEDS, Runs, measure, predict_all
from benchmarks.timing import ROOT, write_section

PAGE = ROOT / "docs" / "verdict.md"
IMAGES = ROOT / "docs" / "images"


def sections(runs: Runs, predictions: kinetic_tables.Predictions) -> Mapping[str, str]:
    """Return the sections of the page by the names of their markers."""
    tables = kinetic_tables
    found = {"summary": tables.summary(runs, predictions)}
    for group, settings in GROUPS.items():
        found[group] = tables.error_table(runs, predictions, settings)
    found["field"] = tables.error_table(runs, predictions, FIELD)
    found["heating"] = tables.heating(runs)
    found["strong-field"] = tables.realizability(runs, predictions)
    found["thermostats"] = tables.thermostats(runs)
    found["particles"] = tables.particle_table(runs)
    found["systematics"] = tables.systematics(runs)
    return found


def spent(runs: Runs, effort: str) -> str:
    """Return what made the page, and what the simulations took."""
    processor = sum(reference.seconds for reference in runs.values())
    option = "" if effort == "full" else f" --effort {effort}"
    return (
        f"Made by `python -m benchmarks.kinetic_verdict{option} --write`: seeds "
        f"{' and '.join(map(str, SEEDS))}, {len(runs)} relaxations, {processor / 60.0:.0f} min of "
        "CPU time for the particles."
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Print all sections, or write them and the figures."""
    parser = argparse.ArgumentParser(description="Models and closures against particles.")
    parser.add_argument("--effort", choices=tuple(PARTS), default="full")
    parser.add_argument("--write", action="store_true", help="write docs/verdict.md and figures")
    options = parser.parse_args(arguments)
    runs = measure(options.effort, lambda line: print(line, file=sys.stderr, flush=True))
    predictions = predict_all(runs)
    found = dict(sections(runs, predictions))
    found["effort"] = spent(runs, options.effort)
    for name, text in found.items():
        if options.write:
            write_section(name, text, PAGE)
        else:
            print(f"{name}\n\n{text}\n")
    if options.write:
        IMAGES.mkdir(exist_ok=True)
        kinetic_figures.write(IMAGES, runs, predictions)
    closure_arguments = ["--effort", options.effort, *(["--write"] if options.write else [])]
    return kinetic_closures.main(closure_arguments)


if __name__ == "__main__":
    raise SystemExit(main())
