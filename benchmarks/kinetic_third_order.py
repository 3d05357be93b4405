"""The third-order model against simulated particles where the full one fails.

Run from the root of the repository; nothing is written without ``--write``::

    python -m benchmarks.kinetic_third_order --effort 0.1   # rough, in some seconds
    python -m benchmarks.kinetic_third_order --write        # fills a section of docs/verdict.md

Without a field these are the relaxations of `benchmarks.kinetic_verdict`, weak exchange, at
collision times in between; the other two are its weak field and, with fewer particles, its case B.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from benchmarks.kinetic_beyond import COMPLETED, beyond
from benchmarks.kinetic_models import FIELDS, Errors, Prediction, errors_of, predict
from benchmarks.kinetic_particles import Reference, Setting, simulate
from benchmarks.kinetic_runs import FEWER, FIELD, SEEDS
from benchmarks.kinetic_tables import Remarks, percent, time_error, time_of
from benchmarks.kinetic_verdict import PAGE
from benchmarks.timing import print_or_write, table

SECTION = "third-order"
MODELS = ("third-order", "full", "gradient")
WITHOUT_FIELD = tuple(
    Setting(tau_c, 1e6, 192.0, dilute=True) for tau_c in (0.02, 0.05, 0.1, 0.2, 0.5)
)
SETTINGS = (*WITHOUT_FIELD, FIELD[1], FEWER[0])


def rows(reference: Reference, remarks: Remarks) -> list[list[str]]:
    """Return the lines of the table about a relaxation, the error bar of the particles first."""
    setting = reference.setting
    noise = [reference.time_error / reference.time]
    noise += [reference.moments[name].noise for name in FIELDS]
    head = [f"**{setting.tau_c:g}**", f"{setting.energy_ratio:g}", time_of(reference)]
    found = [[*head, "error bar of the particles", *(f"± {percent(value)}" for value in noise)]]
    known = {m: predict(setting, m, "derived", reference.time) for m in MODELS}
    if setting.energy_ratio == 0.0:
        completed = beyond(setting, "derived", True)
        known[COMPLETED] = Prediction(*completed.at(reference.time))
    for name, prediction in known.items():
        found.append(["", "", "", name, *_cells(errors_of(prediction, reference), remarks)])
    return found


def _cells(errors: Errors, remarks: Remarks) -> list[str]:
    shown = (percent(errors.moments[m]) if m in errors.moments else "–" for m in FIELDS)
    return [time_error(errors, remarks), *shown]


def section(references: Sequence[Reference], option: str) -> str:
    """Return the section of the page."""
    remarks = Remarks()
    head = ["τ_c", "u", "t* of the particles", "what", "t*", "Q", "C", "V"]
    lines = [line for reference in references for line in rows(reference, remarks)]
    seconds = sum(reference.seconds for reference in references)
    made = (
        f"Made by `python -m benchmarks.kinetic_third_order{option} --write`, seed {SEEDS[0]}, "
        f"{seconds / 60.0:.1f} min of CPU time for the particles. Closures `derived`."
    )
    return f"{made}\n\n{table(head, lines)}{remarks.legend()}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the section, or write it."""
    parser = argparse.ArgumentParser(description="The third-order model against particles.")
    parser.add_argument("--effort", type=float, default=1.0, help="part of the particles")
    parser.add_argument("--write", action="store_true", help="write into docs/verdict.md")
    options = parser.parse_args(arguments)
    references: list[Reference] = []
    for setting in SETTINGS:
        references.append(simulate(setting, SEEDS[0], options.effort))
        print(f"tau_c = {setting.tau_c:g}: {time_of(references[-1])}", file=sys.stderr, flush=True)
    option = "" if options.effort == 1.0 else f" --effort {options.effort:g}"
    text = section(references, option)
    print_or_write(SECTION, text, PAGE, write=options.write)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
