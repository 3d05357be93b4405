"""What the closure set `complete` changes in the paper's two cases, and where it stops holding.

Run from the root of the repository; nothing is written without ``--write``::

    python -m benchmarks.complete_cases            # in a minute
    python -m benchmarks.complete_cases --write    # fills a section of docs/closures.md
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

import numpy as np
import xarray as xr

import triboflux
from benchmarks.timing import ROOT, print_or_write, table
from triboflux.compare import with_changes
from triboflux.figures import paper_case

PAGE = ROOT / "docs" / "closures.md"
SECTION = "complete-cases"
CASE_B = 2
"""Number of the figure that introduces it; case A differs in its collision time."""
COLLISION_TIMES = {1e-4: "A", 0.01: "", 0.02: "", 0.05: "", 0.1: "B"}
MODELS = ("full", "third-order")


def stopped(tau_c: float, model: str, closures: str) -> xr.Dataset:
    """Return the state at which the largest charge has halved."""
    case = paper_case(CASE_B, closures, model)
    numbers = case.numbers.model_copy(update={"tau_c": tau_c})
    run = {"t_end": 200.0, "outputs": [0.0]}
    return triboflux.solve(with_changes(case, numbers=numbers, run=run)).dataset.isel(time=-1)


def row(tau_c: float) -> list[str]:
    """Return the line of one collision time."""
    cells = [f"{tau_c:g}", COLLISION_TIMES[tau_c]]
    for model in MODELS:
        derived, complete = (stopped(tau_c, model, name) for name in ("derived", "complete"))
        later = float(complete["time"] / derived["time"]) - 1.0
        changed = np.abs(complete["variance"] - derived["variance"]).max()
        largest = np.abs(derived["variance"]).max()
        cells += [f"{float(derived['time']):.5g}", f"{100.0 * later:+.2g} %"]
        cells += [f"{100.0 * float(changed / largest):.2g} %"]
    return cells


def section() -> str:
    """Return the section of the page."""
    head = ["τ_c", "case"]
    for model in MODELS:
        head += [f"t*, `{model}` with `derived`", "t* with `complete`", "V, largest difference"]
    return table(head, [row(tau_c) for tau_c in COLLISION_TIMES])


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the section, or write it."""
    parser = argparse.ArgumentParser(description="Dropped terms in the paper's cases.")
    parser.add_argument("--write", action="store_true", help=f"write into {PAGE.name}")
    options = parser.parse_args(arguments)
    print_or_write(SECTION, section(), PAGE, write=options.write)
    return 0


if __name__ == "__main__":
    sys.exit(main())
