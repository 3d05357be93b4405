"""The self-consistent model in the paper's two cases: energy, realizability, times, costs.

Run from the root of the repository; nothing is written without ``--write``::

    python -m benchmarks.self_consistent            # in five minutes
    python -m benchmarks.self_consistent --write    # fills a section of docs/self-consistent.md
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import triboflux
from benchmarks.timing import print_or_write, table
from triboflux.compare import with_changes
from triboflux.energy import energy_balance
from triboflux.figures import paper_case

PAGE = Path(__file__).parents[1] / "docs" / "self-consistent.md"
SECTION = "cases"
RUNS = (
    ("self-consistent-flow", "derived"),
    ("self-consistent", "derived"),
    ("self-consistent", "complete"),
    ("self-consistent", "published"),
    ("third-order", "derived"),
    ("full", "derived"),
)
"""Models and closures."""
CASES = {"A": (1, 125.0), "B": (2, 0.2)}
"""Numbers of the figures that introduce them, and times after which all models have stopped."""
OUTPUTS = 101


def row(name: str, model: str, closures: str) -> list[str]:
    """Return the line of the table of one run."""
    figure, end = CASES[name]
    run = {"t_end": end, "outputs": OUTPUTS}
    case = with_changes(paper_case(figure, closures, model), run=run)
    result = triboflux.solve(case)
    dataset = result.dataset
    margin = dataset["realizability_margin"]
    if "granular_temperature_xx" in dataset:
        margin = margin * dataset["granular_temperature_xx"]
        heat = f"{float(dataset['granular_temperature'][-1].mean()):.4g}"
        drift = f"{energy_balance(result)['drift'].values[-1]:.1e}"
    else:
        heat, drift = "held", "–"
    stats = result.stats
    return [
        name,
        model,
        closures,
        f"{float(dataset['time'][-1]):.6g}",
        f"{float(np.abs(dataset['covariance']).max()):.4g}",
        f"{float(margin.min()):.2g}",
        heat,
        drift,
        f"{stats['accepted']} + {stats['rejected']}",
    ]


def section() -> str:
    """Return the section of the page."""
    head = ["case", "model", "closures", "t*", "max abs C", "least V R_xx − C²", "Θ at t*"]
    head += ["relative drift of the energy", "steps"]
    rows = [row(name, *run) for name in CASES for run in RUNS]
    told = f"Largest |C| and least margin over the outputs before t*, of {OUTPUTS} to t = 125 and "
    told += "0.2, and at t*; steps accepted + rejected at rtol 1e-6."
    return f"{told}\n\n{table(head, rows)}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the section, or write it."""
    parser = argparse.ArgumentParser(description="The self-consistent model in the paper's cases.")
    parser.add_argument("--write", action="store_true", help=f"write into {PAGE.name}")
    options = parser.parse_args(arguments)
    text = section()
    print_or_write(SECTION, text, PAGE, write=options.write)
    return 0


if __name__ == "__main__":
    sys.exit(main())
