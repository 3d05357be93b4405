"""The verification of the particle simulation: exact values, measured ones, orders of convergence.

Run from the root of the repository; nothing is written without ``--write``::

    python -m benchmarks.kinetic_verification --particles 8000    # half a minute
    python -m benchmarks.kinetic_verification --write             # minutes, fills docs/kinetic.md
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from benchmarks import kinetic_checks as checks
from benchmarks import kinetic_convergence as convergence
from benchmarks.closure_evidence import with_error
from benchmarks.kinetic_boxes import Effort
from benchmarks.kinetic_checks import Check
from benchmarks.timing import ROOT, table, write_section

PAGE = ROOT / "docs" / "kinetic.md"
EFFORT = Effort(particles=50_000, ensembles=32, seed=1)
DOUBTFUL = 4.5
"""So many standard errors from the exact value are not taken for chance."""


def all_checks(effort: Effort) -> Iterator[Check]:
    """Return all checks against exact values."""
    yield from checks.collision_rates(effort)
    yield from checks.approach_moments(effort, (0.5, 1.0, 1.8, 2.6, 4.0))
    yield from checks.cooling(effort, (0.9, 0.8, 0.5))
    yield from checks.free_flight(effort, 0.0)
    yield from checks.free_flight(effort, 3.0)
    yield from checks.self_diffusion(effort)
    yield from checks.collisional_transport(effort)
    yield from checks.cell_widths(effort)


def check_rows(found: Sequence[Check]) -> Iterator[list[str]]:
    """Return the rows of the table of checks."""
    for check in found:
        deviation = f"{check.deviation:+.1f}" if check.exact else "not judged"
        yield [check.quantity, f"{check.expected:.6g}", with_error(check.measured), deviation]


def step_rows(effort: Effort) -> Iterator[list[str]]:
    """Return the rows of the table of time steps."""
    counts = (2, 4, 8)
    for name, (_, parameters, time) in convergence.RUNS.items():
        found = list(convergence.step_errors(name, effort, counts))
        coarsest = time / counts[0] * parameters.collision_rate
        cells = [f"{100 * e.error.value:+.2f} ± {100 * e.error.error:.2f} %" for e in found]
        shown = convergence.order(found[1:])
        reached = f"{shown.value:.1f} ± {shown.error:.1f}" if shown.error < 0.5 else "lost in noise"
        yield [name, f"{coarsest:g}", *cells, reached]


def energy_rows(effort: Effort) -> Iterator[list[str]]:
    """Return the rows of the table of energy."""
    for steps in (4, 8, 16, 32):
        yield _energy_row(effort, steps, 256)
    for cells in (16, 32, 64, 128):
        yield _energy_row(effort, 128, cells)


def _energy_row(effort: Effort, steps: int, cells: int) -> list[str]:
    box = replace(convergence.HEATED, cells=cells)
    found = convergence.energy_drift(effort, steps, box)
    return [str(steps), str(cells), f"{found.value:+.1e} ± {found.error:.0e}"]


def scatter_rows(effort: Effort) -> Iterator[list[str]]:
    """Return the rows of the table of particle numbers."""
    for number in (1000, 4000, 16000):
        found = convergence.scatter(number, effort)
        yield [f"{number:,}", f"{found:.4f}", f"{found * math.sqrt(number):.3f}"]


def section(effort: Effort) -> tuple[str, list[Check]]:
    """Return the text of the page, and all checks in it."""
    found = list(all_checks(effort))
    judged = [check.deviation for check in found if check.exact]
    wrong = sum(abs(z) > DOUBTFUL for z in judged)
    several = effort._replace(ensembles=max(2, effort.ensembles // 2))
    text = [
        f"Made by `python -m benchmarks.kinetic_verification --particles {effort.particles} "
        f"--ensembles {effort.ensembles} --seed {effort.seed} --write`.",
        "",
        f"Each check has {effort.ensembles} ensembles of {effort.particles:,} particles, whose "
        "scatter gives the last two digits of the standard error in brackets; z is the measured "
        "less the expected value in standard errors. All checks start from the same seed, so their "
        f"deviations are not independent. Of {len(judged)} values {wrong} are further off than "
        f"{DOUBTFUL}; the largest |z| is {max(map(abs, judged)):.1f}.",
        "",
        table(["quantity", "expected", "measured", "z"], check_rows(found)),
        "",
        "Relative error with 2, 4 and 8 time steps against 64, from the same random starts, and "
        "the order that the last two show. 2 steps are of the length given, in τ_c:",
        "",
        table(["result", "step", "2 steps", "4", "8", "order"], step_rows(several)),
        "",
        "Change of kinetic plus field energy until t = 0.16 at u = 300 without thermostat, over "
        "the energy exchanged:",
        "",
        table(["time steps", "cells", "change"], energy_rows(several)),
        "",
        "Scatter of a wave's amplitude over 256 ensembles, which falls with the root of the number "
        "of particles:",
        "",
        table(
            ["particles", "scatter", "times √particles"],
            scatter_rows(effort._replace(ensembles=256)),
        ),
    ]
    return "\n".join(text), found


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the section, or write it; return 1 if a value disagrees."""
    parser = argparse.ArgumentParser(description="Verification of the particle simulation.")
    parser.add_argument("--particles", type=int, default=EFFORT.particles, help="per ensemble")
    parser.add_argument("--ensembles", type=int, default=EFFORT.ensembles, help="per check")
    parser.add_argument("--seed", type=int, default=EFFORT.seed, help="of all random numbers")
    parser.add_argument("--write", action="store_true", help="write the section of docs/kinetic.md")
    options = parser.parse_args(arguments)
    text, found = section(Effort(options.particles, options.ensembles, options.seed))
    if options.write:
        write_section("verification", text, PAGE)
    else:
        print(text)
    return int(any(check.exact and abs(check.deviation) > DOUBTFUL for check in found))


if __name__ == "__main__":
    raise SystemExit(main())
