"""Runs in two and three dimensions: memory, time and what refinement changes.

Run from the root of the repository; nothing is written without ``--write``::

    python -m benchmarks.boxes --short    # small boxes, about a minute
    python -m benchmarks.boxes --write    # about ten minutes, fills docs/performance.md

Every run is a process ``triboflux run`` of its own without a compilation cache. The initial charge
is a sum of oblique modes, neither separable nor symmetric. Case B's numbers, derived closures,
t = 0.3.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from math import prod
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from benchmarks.timing import child, machine_facts, table, write_section

CASE = """
closures = "derived"
[numbers]
peclet = 1e6
tau_c = 0.1
energy_ratio = 300.0
length_ratio = 192.0
restitution = 1.0
[grid]
points = {points}
[initial]
charge = [{modes}]
[run]
t_end = 0.3
outputs = {outputs}
rtol = {rtol}
atol = {atol}
adaptive_points = {adaptive}
"""
# Waves along each dimension, sine and cosine amplitudes.
MODES: dict[int, tuple[tuple[tuple[int, ...], float, float], ...]] = {
    2: (
        ((1, 2), -0.5, 0.2),
        ((3, -1), 0.3, -0.1),
        ((-2, 3), 0.1, 0.15),
        ((0, 1), 0.2, 0.0),
    ),
    3: (
        ((1, 1, 0), -0.5, 0.2),
        ((2, -1, 1), 0.25, -0.1),
        ((-1, 1, 2), 0.1, 0.15),
        ((0, 1, -1), 0.2, 0.0),
    ),
}
OUTPUTS = 4
FIELDS = ("charge", "covariance", "variance")
COARSE, FINE = 1e-6, 1e-9


class Box(NamedTuple):
    """One run: points per dimension, tolerance, outputs, and whether it adapts its points."""

    points: tuple[int, ...]
    rtol: float = COARSE
    outputs: int = OUTPUTS
    adaptive: bool = False


class Plan(NamedTuple):
    """What to run.

    Attributes
    ----------
    bare : dict of int to Box
        Tiny boxes per dimension, whose memory counts as that of the program itself.
    coarse, fine : dict of int to Box
        Boxes per dimension between which space is refined; the fine ones are refined in time too.
    memory : tuple of Box
        More runs, for their memory.
    """

    bare: dict[int, Box]
    coarse: dict[int, Box]
    fine: dict[int, Box]
    memory: tuple[Box, ...]


FULL = Plan(
    {2: Box((12, 12)), 3: Box((12, 12, 12))},
    {2: Box((128, 128)), 3: Box((48, 48, 48))},
    {2: Box((256, 256)), 3: Box((64, 64, 64))},
    (
        Box((32, 32, 32)),
        Box((256, 256), outputs=40),
        Box((64, 64, 64), outputs=40),
        Box((256, 256), adaptive=True),
        Box((64, 64, 64), adaptive=True),
    ),
)
SHORT = Plan({2: Box((12, 12))}, {2: Box((32, 32))}, {2: Box((48, 48))}, ())


class Ran(NamedTuple):
    """A finished run.

    Attributes
    ----------
    box : Box
        What was run.
    memory : int
        Peak resident memory of the process, bytes.
    wall, cpu : float
        Seconds of the process.
    file : Path
        The result.
    """

    box: Box
    memory: int
    wall: float
    cpu: float
    file: Path


def case_text(box: Box) -> str:
    """Return the case of a box as TOML."""
    modes = ", ".join(
        f"{{ mode = {list(mode)}, sine = {sine}, cosine = {cosine} }}"
        for mode, sine, cosine in MODES[len(box.points)]
    )
    return CASE.format(
        points=list(box.points),
        modes=modes,
        outputs=box.outputs,
        rtol=box.rtol,
        atol=1e-3 * box.rtol,
        adaptive=str(box.adaptive).lower(),
    )


def run(box: Box, folder: Path) -> Ran:
    """Run a box in a process of its own.

    Parameters
    ----------
    box : Box
        What to run.
    folder : Path
        Where case and result are kept.
    """
    name = f"{'x'.join(map(str, box.points))}-{box.rtol:.0e}-{box.outputs}-{box.adaptive}"
    (folder / f"{name}.toml").write_text(case_text(box), encoding="utf-8")
    arguments = ["-m", "triboflux", "run", f"{name}.toml", "-o", f"{name}.nc", "--overwrite"]
    done = child(arguments, folder, TRIBOFLUX_CACHE_DIR="off")
    return Ran(box, done.memory, done.wall, done.cpu, folder / f"{name}.nc")


def run_all(plan: Plan, folder: Path) -> dict[Box, Ran]:
    """Run every box of a plan, one after the other."""
    boxes = [*plan.bare.values(), *plan.coarse.values(), *plan.fine.values(), *plan.memory]
    boxes += [fine._replace(rtol=FINE) for fine in plan.fine.values()]
    return {box: run(box, folder) for box in boxes}


def on_points(values: Any, points: Sequence[int]) -> Any:
    """Return a periodic field on a finer grid by its trigonometric interpolant.

    Parameters
    ----------
    values : ndarray, shape (n, ...)
        Field on equidistant points, without content at half the points' wave number.
    points : sequence of int
        Number of points wanted per dimension, not fewer than the field has.
    """
    import numpy as np

    spectrum = np.fft.fftshift(np.fft.fftn(values, norm="forward"))
    pads = []
    for wanted, given in zip(points, values.shape, strict=True):
        before = wanted // 2 - given // 2
        pads.append((before, wanted - given - before))
    padded = np.fft.ifftshift(np.pad(spectrum, pads))
    return np.fft.ifftn(padded, norm="forward").real


def differences(one: Ran, other: Ran) -> dict[str, float]:
    """Return the relative difference of two results at the end in the maximum norm.

    Parameters
    ----------
    one, other : Ran
        The grid of `other` is not coarser than that of `one`.

    Returns
    -------
    dict of str to float
        For each moment ``max|f_one - f_other| / max|f_other|`` on the points of `other`.
    """
    import numpy as np

    import triboflux

    last = [triboflux.load(ran.file).dataset.isel(time=-1) for ran in (one, other)]
    found = {}
    for name in FIELDS:
        coarse, fine = (np.asarray(dataset[name]) for dataset in last)
        leading = fine.shape[: fine.ndim - len(other.box.points)]
        parts = [
            np.abs(on_points(coarse[index], other.box.points) - fine[index]).max()
            for index in np.ndindex(*leading)
        ]
        found[name] = float(max(parts) / np.abs(fine).max())
    return found


def charge_drift(ran: Ran) -> float:
    """Return the largest change of the mean charge over the outputs, over the peak at the start."""
    import numpy as np

    import triboflux

    charge = np.asarray(triboflux.load(ran.file).dataset["charge"])
    mean = charge.reshape(len(charge), -1).mean(axis=1)
    return float(np.abs(mean - mean[0]).max() / np.abs(charge[0]).max())


def runs_table(runs: Iterable[Ran], bare: dict[int, Ran]) -> str:
    """Return memory, steps and seconds of the runs as a table."""
    import triboflux
    from triboflux.memory import memory_estimate

    rows = []
    for ran in runs:
        result, size = triboflux.load(ran.file), prod(ran.box.points)
        own = ran.memory - bare[len(ran.box.points)].memory
        rows.append(
            [
                " × ".join(map(str, ran.box.points)),
                " × ".join(map(str, result.stats["points"])),
                f"{ran.box.rtol:.0e}",
                f"{ran.box.outputs}",
                f"{result.stats['accepted']} + {result.stats['rejected']}",
                f"{result.stats['seconds']:.1f}",
                f"{ran.wall:.1f}",
                f"{ran.cpu:.1f}",
                f"{ran.memory / 1e6:,.0f}",
                f"{own / size:,.0f}",
                f"{memory_estimate(result.case, streamed=True) / size:,.0f}",
                f"{charge_drift(ran):.0e}",
            ]
        )
    header = ["points", "worked on", "rtol", "outputs", "steps", "solve, s", "process, s"]
    header += ["CPU, s", "peak, MB"]
    header += ["bytes a point above a tiny run", "estimated", "drift of total charge"]
    return table(header, rows)


def refinement_table(plan: Plan, ran: dict[Box, Ran]) -> str:
    """Return what refinement in space and in time changes as a table."""
    rows = []
    for dimensions, fine in plan.fine.items():
        coarse, accurate = plan.coarse[dimensions], fine._replace(rtol=FINE)
        for label, one, other in (
            (f"space, {coarse.points[0]} → {fine.points[0]} points", coarse, fine),
            (f"time, rtol {COARSE:.0e} → {FINE:.0e}", fine, accurate),
        ):
            found = differences(ran[one], ran[other])
            rows.append([f"{dimensions}-D", label, *(f"{found[name]:.1e}" for name in FIELDS)])
    return table(["box", "refined", *FIELDS], rows)


def report(plan: Plan) -> str:
    """Run everything and return it as Markdown."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        run(next(iter(plan.bare.values())), folder)  # compiles the bytecode
        ran = run_all(plan, folder)
        bare = {dimensions: ran[box] for dimensions, box in plan.bare.items()}
        parts = [machine_facts(), runs_table(ran.values(), bare), refinement_table(plan, ran)]
    return "\n\n".join(parts)


def main(arguments: list[str] | None = None) -> None:
    """Print the report; see the module docstring."""
    parser = argparse.ArgumentParser(description="Memory, time and errors of boxes in 2-D and 3-D.")
    parser.add_argument("--short", action="store_true", help="small boxes in two dimensions only")
    parser.add_argument("--write", action="store_true", help="fill docs/performance.md")
    chosen = parser.parse_args(arguments)
    text = report(SHORT if chosen.short else FULL)
    print(text)
    if chosen.write:
        write_section("boxes", text)


if __name__ == "__main__":
    main()
