"""The self-consistent model in the paper's two cases: energy, realizability, times, costs.

Run from the root of the repository; nothing is written without ``--write``::

    python -m benchmarks.self_consistent            # in a minute or two
    python -m benchmarks.self_consistent --write    # fills a section of docs/self-consistent.md
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import triboflux
from benchmarks.timing import table, write_section
from triboflux.energy import energy_balance

PAGE = Path(__file__).parents[1] / "docs" / "self-consistent.md"
SECTION = "cases"
MODELS = ("self-consistent", "third-order", "full")
CASES = {"A": 1e-4, "B": 0.1}


def case(tau_c: float, model: str) -> triboflux.Case:
    """Return a case of the paper with the exact closures."""
    return triboflux.Case.model_validate(
        {
            "title": f"tau_c = {tau_c:g}",
            "model": model,
            "numbers": {
                "peclet": 1e6,
                "tau_c": tau_c,
                "energy_ratio": 300.0,
                "length_ratio": 192.0,
                "restitution": 1.0,
            },
            "grid": {"points": [128]},
            "initial": {"charge": [{"mode": [1], "sine": -1.0}]},
            "run": {"t_end": 200.0, "stop_at_peak_charge": 0.5, "outputs": 50},
        }
    )


def row(name: str, model: str) -> list[str]:
    """Return the line of the table of one run."""
    result = triboflux.solve(case(CASES[name], model))
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
        f"{float(dataset['time'][-1]):.6g}",
        f"{float(np.abs(dataset['covariance']).max()):.4g}",
        f"{float(margin.min()):.2g}",
        heat,
        drift,
        f"{stats['accepted']} + {stats['rejected']}",
    ]


def section() -> str:
    """Return the section of the page."""
    head = ["case", "model", "t*", "max abs C", "least V R_xx − C²", "Θ at t*"]
    head += ["relative drift of the energy", "steps"]
    rows = [row(name, model) for name in CASES for model in MODELS]
    told = "Largest |C| and least margin over 52 outputs; steps accepted + rejected at rtol 1e-6."
    return f"{told}\n\n{table(head, rows)}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the section, or write it."""
    parser = argparse.ArgumentParser(description="The self-consistent model in the paper's cases.")
    parser.add_argument("--write", action="store_true", help=f"write into {PAGE.name}")
    options = parser.parse_args(arguments)
    text = section()
    if options.write:
        write_section(SECTION, text, PAGE)
    else:
        print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
