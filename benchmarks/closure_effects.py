"""What each contradiction of the paper does to the relaxation times of its two cases.

Run from the root of the repository::

    python -m benchmarks.closure_effects            # prints the tables, in half a minute
    python -m benchmarks.closure_effects --write    # and fills docs/closures.md

t* is the time at which the peak charge has fallen to one half. The numbers of the entries are those
of docs/closures.md.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

import triboflux
from benchmarks.closure_variants import (
    ENTRIES,
    TOGETHER,
    VARIANTS,
    Ran,
    as_printed,
    corrected,
    exact_set,
    numbers_of,
    printed_set,
    stop_time,
)
from benchmarks.timing import ROOT, table, write_section
from examples.full_model_by_hand import PAPER_CASES
from triboflux import closures
from triboflux.figures import paper_case
from triboflux.numbers import Numbers
from triboflux.radial_distribution import carnahan_starling

PAGE = ROOT / "docs" / "closures.md"
SAME = 1e-6
"""Relative difference of t* below which two runs are called the same."""
POINTS, OUTPUTS = 256, 3000
"""Points and output times in which a breach of realizability is looked for."""
ROUND_OFF = 1e-9
"""A breach of less than this is none: C and V start at zero."""


class Cells:
    """Table cells of runs, and the remarks that they refer to."""

    def __init__(self) -> None:
        self.remarks: list[str] = []

    def __call__(self, ran: Ran, base: float | None = None) -> str:
        """Return t* with its change against `base` and the number of its remark."""
        mark = self._mark(ran.remark)
        if ran.time is None:
            return f"none{mark}"
        if base is None:
            return f"{ran.time:.6g}{mark}"
        percent = 100.0 * (ran.time / base - 1.0)
        shown = f"{percent:+.0f} %" if abs(percent) >= 10.0 else f"{percent:+.2g} %"
        told = "same" if abs(percent) < 100.0 * SAME else shown
        return f"{ran.time:.6g} ({told}){mark}"

    def _mark(self, remark: str) -> str:
        if not remark:
            return ""
        if remark not in self.remarks:
            self.remarks.append(remark)
        return f" [{self.remarks.index(remark) + 1}]"

    def legend(self) -> str:
        """Return the remarks as a sentence."""
        return "; ".join(f"[{i}] {remark}" for i, remark in enumerate(self.remarks, start=1))


def one_at_a_time() -> str:
    """Return the table of the sets in which one entry at a time is taken from the other set."""
    cells = Cells()
    base = {
        (case, name): stop_time(numbers_of(case), made())
        for case in PAPER_CASES
        for name, made in (("published", printed_set), ("derived", exact_set))
    }
    head = ["entry", "what"]
    for case in PAPER_CASES:
        head += [f"{case}, `published` with it exact", f"{case}, `derived` with it as printed"]
    rows = [["", "the sets themselves", *(cells(ran) for ran in base.values())]]
    for entry in (*ENTRIES, *TOGETHER):
        row = [entry.number, entry.label]
        for case in PAPER_CASES:
            numbers = numbers_of(case)
            for name, changed in (
                ("published", corrected(entry)),
                ("derived", as_printed(entry, numbers)),
            ):
                row.append(cells(stop_time(numbers, changed), base[case, name].time))
        rows.append(row)
    told = f"“Same”: to better than {SAME:g} relatively. {cells.legend()}."
    return f"{table(head, rows)}\n\n{told}"


def variants() -> str:
    """Return the table of the other combinations."""
    cells = Cells()
    rows = [
        [v.number, v.label, *(cells(v.run(numbers_of(case))) for case in PAPER_CASES)]
        for v in VARIANTS
    ]
    return f"{table(['entry', 'what', 't* in A', 't* in B'], rows)}\n\n{cells.legend()}."


class Implied(NamedTuple):
    """What a real suspension would have where the paper chooses freely, dimensionless."""

    packing: float
    solid_fraction: float
    tau_sigma: float


def implied(numbers: Numbers) -> Implied:
    """Return α g0, α and τ_σ* of the particles that have these τ_c*, Pe and L/d.

    Parameters
    ----------
    numbers : Numbers
        τ_c* = (d/L) √π/(24 α g0) and τ_σ* = Pe (d/L)²/(6 α).

    Returns
    -------
    Implied
        With g0 of Carnahan & Starling.
    """
    packing = math.sqrt(math.pi) / (24.0 * numbers.length_ratio * numbers.tau_c)
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if middle * carnahan_starling(middle) < packing:
            low = middle
        else:
            high = middle
    return Implied(packing, low, numbers.peclet / (6.0 * low * numbers.length_ratio**2))


def suspensions() -> str:
    """Return the table of what the seven numbers imply."""
    head = ["case", "α g0", "α", "τ_σ*", "t* `published`", "t* `derived`"]
    rows = []
    for case in PAPER_CASES:
        found = implied(numbers_of(case))
        numbers = numbers_of(case, tau_sigma=found.tau_sigma)
        sets = (printed_set(), exact_set())
        times = [Cells()(stop_time(numbers, closure_set)) for closure_set in sets]
        rows.append([case, *(f"{value:.4g}" for value in found), *times])
    return table(head, rows)


class Breach(NamedTuple):
    """Where a run leaves the distributions that exist: |C|² > V.

    Attributes
    ----------
    onset, place : float
        The first time, and where; scaled by L/√Θ and L.
    excess, when : float
        Largest C² − V, scaled by Q0² Θ, and its time.
    final_excess, final_share : float
        At t*: the same, and the part of the box.
    """

    onset: float
    place: float
    excess: float
    when: float
    final_excess: float
    final_share: float


def breach(case: str, name: str) -> Breach | None:
    """Return how a run of the paper's case breaks |C|² ≤ V, or None.

    Parameters
    ----------
    case : {"A", "B"}
        The paper's case.
    name : {"published", "derived"}
        Closure set.
    """
    found = stop_time(numbers_of(case), closures.by_name(name, 1.0)).time
    if found is None:
        raise RuntimeError(f"case {case} with {name} has no t*.")
    data = paper_case({"A": 1, "B": 2}[case], name).model_dump()
    data["grid"]["points"] = [POINTS]
    # geometric from the initial layer on, where case A ends only much later
    half = OUTPUTS // 2
    times = np.union1d(np.geomspace(1e-5, found, half), np.linspace(0.0, found, half))
    data["run"] |= {"t_end": found, "stop_at_peak_charge": None, "outputs": times.tolist()}
    dataset = triboflux.solve(triboflux.Case(**data)).dataset
    margin = dataset["realizability_margin"].values
    broken = margin < -ROUND_OFF
    if not broken.any():
        return None
    x, t = dataset["x"].values, dataset["time"].values
    first = int(np.argmax(broken.any(axis=1)))
    worst = int(np.argmin(margin.min(axis=1)))
    return Breach(
        float(t[first]),
        float(x[int(np.argmin(margin[first]))]),
        -float(margin[worst].min()),
        float(t[worst]),
        -float(margin[-1].min()),
        float(broken[-1].mean()),
    )


def breaches() -> str:
    """Return the table of realizability."""
    head = ["case", "set", "C² > V from t", "at x", "largest C² − V", "at t", "C² − V at t*"]
    head.append("part of the box at t*")
    rows = []
    for case in PAPER_CASES:
        for name in closures.PAPERS_EQUATIONS:
            found = breach(case, name)
            if found is None:
                rows.append([case, f"`{name}`", "never", *["—"] * 5])
                continue
            onset, place, *excesses, share = found
            numbers = (f"{value:.3g}" for value in excesses)
            rows.append(
                [case, f"`{name}`", f"{onset:#.2g}", f"{place:.3g}", *numbers, f"{share:.0%}"]
            )
    return table(head, rows)


def parts() -> Iterator[tuple[str, str]]:
    """Yield the headings and the tables of the page."""
    yield "One at a time", one_at_a_time()
    yield "Combinations", variants()
    yield "What the seven numbers imply", suspensions()
    yield "Realizability", breaches()


def main(arguments: list[str] | None = None) -> None:
    """Print the tables; see the module docstring."""
    parser = argparse.ArgumentParser(description="Effects of the paper's contradictions on t*.")
    parser.add_argument("--write", action="store_true", help="fill docs/closures.md")
    chosen = parser.parse_args(arguments)
    text = "\n\n".join(f"### {heading}\n\n{content}" for heading, content in parts())
    print(text)
    if chosen.write:
        write_section("effects", text, PAGE)


if __name__ == "__main__":
    main()
