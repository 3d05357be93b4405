"""A bed that conducts, with and without the terms that the paper's derivation drops.

Two layers of opposite charge relax in a dense bed, ``examples/layered_bed.toml``. Collisions
conduct the charge there, and the covariance of charge and velocity goes along the field, which
takes variance away: that is among the dropped terms. Particles tell how much it is. Run from the
root of the repository; nothing is written without ``--write``::

    python -m benchmarks.complete_terms             # two minutes of CPU time
    python -m benchmarks.complete_terms --write     # fills a section of docs/verdict.md
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence

import numpy as np
import xarray as xr

import triboflux
from benchmarks.timing import ROOT, print_or_write, table
from triboflux.case import Case
from triboflux.compare import with_changes
from triboflux.kinetic.simulation import simulate
from triboflux.scales import Scales

PAGE = ROOT / "docs" / "verdict.md"
CASE = ROOT / "examples" / "layered_bed.toml"
SECTION = "conducting"
MODELS = (
    ("full", "derived"),
    ("full", "complete"),
    ("semi-algebraic", "complete"),
    ("third-order", "complete"),
)
PARTICLES = 12_800
"""In each of the two ensembles, 20 in a cell: the fewest that the cells of the case allow."""
OUTPUTS = (1, 4, 16)
"""Of the seventeen of the case; the first is the initial state."""


def predictions(case: Case) -> dict[tuple[str, str], xr.Dataset]:
    """Return what the models say, by model and closure set."""
    found: dict[tuple[str, str], xr.Dataset] = {}
    for model, closures in MODELS:
        named = with_changes(case, model=model, closures=closures)
        found[model, closures] = triboflux.solve(named).dataset
    return found


def mean_with_error(particles: xr.Dataset, output: int) -> tuple[float, float]:
    """Return the particles' variance on average over the box, and its standard error."""
    values = particles["variance"].values[output]
    errors = particles["variance_standard_error"].values[output]
    return float(values.mean()), float(np.sqrt(np.sum(errors**2)) / errors.size)


def difference(found: xr.Dataset, particles: xr.Dataset, name: str, output: int) -> float:
    """Return the relative L2 difference of a moment."""
    ours, theirs = (dataset[name].values[output] for dataset in (found, particles))
    return float(np.linalg.norm(ours - theirs) / np.linalg.norm(theirs))


def noise(particles: xr.Dataset, name: str, output: int) -> float:
    """Return the relative L2 size of the particles' error bars."""
    errors = particles[f"{name}_standard_error"].values[output]
    return float(np.linalg.norm(errors) / np.linalg.norm(particles[name].values[output]))


def rows(
    particles: xr.Dataset, known: dict[tuple[str, str], xr.Dataset], unit: float
) -> list[list[str]]:
    """Return the lines of the table; `unit` is the seconds that a time of 1 stands for."""
    lines: list[list[str]] = []
    for output in OUTPUTS:
        mean, error = mean_with_error(particles, output)
        seconds = float(particles["time"].values[output]) * unit
        bars = (f"± {noise(particles, name, output):.1%}" for name in ("variance", "charge"))
        lines.append(
            [f"**{seconds:.3g} s**", "error bar of the particles", f"± {error / mean:.1%}", *bars]
        )
        for (model, closures), found in known.items():
            ratio = float(found["variance"].values[output].mean()) / mean
            shown = (difference(found, particles, n, output) for n in ("variance", "charge"))
            name = f"{model}, `{closures}`"
            lines.append(["", name, f"{ratio:.2f} times", *(f"{value:.1%}" for value in shown)])
    return lines


def section() -> str:
    """Return the section of the page."""
    case = Case.from_toml(CASE)
    assert case.kinetic is not None
    kinetic = case.kinetic.model_dump() | {"particles": PARTICLES}
    case = with_changes(case, kinetic=kinetic)
    started = time.process_time()
    particles = simulate(case).dataset
    minutes = (time.process_time() - started) / 60.0
    assert case.suspension is not None
    lines = rows(particles, predictions(case), Scales.of(case.suspension).time)
    head = ["time", "what", "mean V", "V", "Q"]
    count = kinetic["particles"] * kinetic["ensembles"]
    made = (
        f"Made by `python -m benchmarks.complete_terms --write`, {count:,} particles, "
        f"{minutes:.1f} min of CPU time for them. V and Q are relative L2 differences."
    )
    return f"{made}\n\n{table(head, lines)}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the section, or write it."""
    parser = argparse.ArgumentParser(description="Dropped terms in a bed that conducts.")
    parser.add_argument("--write", action="store_true", help="write into docs/verdict.md")
    options = parser.parse_args(arguments)
    text = section()
    print_or_write(SECTION, text, PAGE, write=options.write)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
