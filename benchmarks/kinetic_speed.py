"""How fast particles are simulated, what limits it, and the memory that they take.

Run from the root of the repository; nothing is written without ``--write``::

    python -m benchmarks.kinetic_speed --write    # some minutes, fills docs/kinetic.md
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time
from typing import NamedTuple

from benchmarks import kinetic_boxes as b
from benchmarks.kinetic_boxes import DENSE, DILUTE, Effort
from benchmarks.timing import ROOT, child, machine_facts, table, verdict, write_section
from triboflux.kinetic.ensemble import Ensemble, Parameters

PAGE = ROOT / "docs" / "kinetic.md"
REACH = 1e7
"""Collisions per second on two cores that are wanted."""
ROUNDS = 11
EXCHANGE = {"charge_transfer": 0.1, "field_transfer": 0.01}
BOXES = {
    "dilute, 100 per cell": (replace(DILUTE, cells=1000, **EXCHANGE), 100_000),
    "dilute, 1,000 per cell": (replace(DILUTE, cells=100, **EXCHANGE), 100_000),
    "dilute, 10,000 per cell": (replace(DILUTE, cells=100, **EXCHANGE), 1_000_000),
    "dense, 65 per cell": (replace(DENSE, diameter=1 / 192, cells=1536, **EXCHANGE), 100_000),
    "dense, 650 per cell, short": (
        replace(DENSE, diameter=8 / 154, cells=154, **EXCHANGE),
        100_000,
    ),
    "dense, 650 per cell": (replace(DENSE, diameter=1 / 192, cells=1536, **EXCHANGE), 1_000_000),
}
LEFT_OUT: dict[str, dict[str, float]] = {
    "nothing": {},
    "exchange of charge": {"charge_transfer": 0.0, "field_transfer": 0.0},
    "the diameter": {"diameter": 0.0},
}
"""What is left out to see what it costs; without a diameter partners come from the own cell."""
DISSECTED = ("dense, 65 per cell", "dense, 650 per cell, short")
MEMORY = """
import json, resource, sys
from triboflux.kinetic.ensemble import Ensemble, Parameters
from triboflux.kinetic.start import draw_particles
import numpy as np, triboflux as tbf
case = tbf.Case(
    numbers=dict(peclet=1e6, tau_c=0.1, energy_ratio=300.0, length_ratio=192.0, restitution=1.0),
    grid=dict(points=[64]), initial=dict(charge=[dict(mode=[1], sine=-1.0)]),
    run=dict(t_end=1.0), kinetic=dict(particles=10_000_000),
)
def peak():
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
def run(number):
    box = Ensemble(
        Parameters.of(case), draw_particles(case, number, np.random.default_rng(1)),
        np.random.SeedSequence(1).generate_state(4, np.uint64),
    )
    box.advance(1, 0.005)
    box.sums()
run(int(sys.argv[1]))
print(json.dumps(peak()))
"""


class Speed(NamedTuple):
    """What two threads with an ensemble each did.

    Attributes
    ----------
    rate : float
        Collisions per second of both together.
    collision, step : float
        CPU nanoseconds per collision, and per particle and step without collisions.
    """

    rate: float
    collision: float
    step: float


def speed(parameters: Parameters, number: int) -> Speed:
    """Measure how fast particles collide with the default time step of a quarter of τ_c."""
    collisionless = replace(parameters, collision_rate=0.0)
    both = b.boxes(parameters, Effort(number, b.THREADS, 1))
    free = b.boxes(collisionless, Effort(number, b.THREADS, 1))
    steps = max(4, 400_000 // number)

    def run(boxes: Sequence[Ensemble]) -> tuple[float, float, int]:
        before = sum(box.collisions for box in boxes)
        wall, cpu = perf_counter(), process_time()
        b.each(lambda box: box.advance(steps, 0.025), boxes)
        wall, cpu = perf_counter() - wall, process_time() - cpu
        return wall, cpu, sum(box.collisions for box in boxes) - before

    run(both)
    run(free)
    rates: list[float] = []
    costs: list[float] = []
    rests: list[float] = []
    for _ in range(ROUNDS):
        wall, cpu, count = run(both)
        _, without, _ = run(free)
        rates.append(count / wall)
        costs.append(1e9 * (cpu - without) / count)
        rests.append(1e9 * without / (steps * number * b.THREADS))
    return Speed(max(rates), min(costs), min(rests))


def memory(number: int) -> float:
    """Return the bytes that a particle adds to the peak memory of a process, start included.

    The difference of two processes, one of them with twice as many particles, is free of what
    the interpreter and the compiler take.
    """
    with TemporaryDirectory() as folder:
        peaks = [
            json.loads(child(["-c", MEMORY, str(count)], Path(folder)).output)
            for count in (number, 2 * number)
        ]
    return (peaks[1] - peaks[0]) / number


def rows() -> Iterator[list[str]]:
    """Return the rows of the table of speeds."""
    for name, (parameters, number) in BOXES.items():
        found = speed(parameters, number)
        ideal = 1e9 * b.THREADS / (found.collision + found.step * 8)
        # a particle makes eight steps of a quarter of the collision time for every collision
        # of two. A reach is met where its inverse is at most that of what was wanted.
        wanted = verdict(1.0 / ideal, 1.0 / REACH)
        costs = (f"{found.collision:.0f}", f"{found.step:.0f}")
        yield [name, f"{number:,}", *costs, f"{ideal / 1e6:.1f}", wanted, f"{found.rate / 1e6:.1f}"]


def parts() -> Iterator[list[str]]:
    """Return the rows of the table of what a collision costs without one thing or another."""
    for name, changes in LEFT_OUT.items():
        found = [speed(replace(BOXES[box][0], **changes), BOXES[box][1]) for box in DISSECTED]
        yield [name, *(f"{one.collision:.0f}" for one in found)]


def section() -> str:
    """Return the text of the page."""
    header = ["box", "particles", "ns per collision", "ns per particle and step"]
    header += ["10⁶ collisions/s"]
    header += ["wanted 10⁷", "by the wall clock"]
    number = 5_000_000
    return "\n".join(
        [
            "Made by `python -m benchmarks.kinetic_speed --write`.",
            "",
            machine_facts(),
            "",
            "Two threads with an ensemble each, γ and β on, steps of τ_c/4; the best of "
            f"{ROUNDS} short rounds, because other work ran on the machine. Nanoseconds are CPU "
            "times of one core, without collisions and what these add. There are eight steps of a "
            "particle for each collision, so two free cores would make the collisions per second "
            "of the fifth column; the last one is what the wall clock showed.",
            "",
            table(header, rows()),
            "",
            "Nanoseconds of a collision, when something is left out:",
            "",
            table(["left out", *DISSECTED], parts()),
            "",
            f"{number:,} particles take {memory(number):.0f} bytes each at the peak, from start to "
            "moments.",
        ]
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the section, or write it."""
    parser = argparse.ArgumentParser(description="Speed and memory of the particle simulation.")
    parser.add_argument("--write", action="store_true", help="write the section of docs/kinetic.md")
    options = parser.parse_args(arguments)
    text = section()
    if options.write:
        write_section("speed", text, PAGE)
    else:
        print(text)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
