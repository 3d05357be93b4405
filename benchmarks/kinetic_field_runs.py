"""Relaxations of simulated particles with fields of four strengths, kept in a small file.

Run from the root of the repository; what the file has already is not simulated again::

    python -m benchmarks.kinetic_field_runs             # fills what is missing, 20 min of CPU time
    python -m benchmarks.kinetic_field_runs --renew     # all of it anew

Elastic particles at the paper's Pe and L/d collide at one place and start from Q = -sin 2πx, under
each assumption that the simulation knows. With the seed and a setting's number of particles, both
in the file, every line can be made again. `benchmarks.kinetic_fields` compares models with it.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.kinetic_particles import MODES, Reals, Reference, Setting, X, simulate
from benchmarks.kinetic_runs import SEEDS, label
from benchmarks.timing import ROOT
from triboflux.case_kinetic import THERMOSTATS

FILE = ROOT / "benchmarks" / "kinetic_fields.jsonl"
"""One relaxation a line."""
DIGITS = 6
"""Significant ones that are kept; error bars are larger than the third."""

COLLISION_TIMES = (1e-3, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)
FIELDS = (1.0, 30.0, 300.0)
"""Energy ratios u besides 0."""
LONG = 5e-3
"""τ_c below which relaxations are long, and simulated with few particles."""
USUAL, MANY, FEW = 1_280_000, 2_560_000, 40_960


def plan() -> tuple[Setting, ...]:
    """Return what is simulated, the quickest first."""
    settings: list[Setting] = []
    for tau_c in sorted(COLLISION_TIMES, reverse=True):
        kinds = [(0.0, "none"), *((u, name) for u in FIELDS for name in THERMOSTATS)]
        for energy_ratio, thermostat in kinds:
            number = particles_of(tau_c, energy_ratio, thermostat)
            if number:
                settings.append(_setting(tau_c, energy_ratio, thermostat, number))
    return tuple(settings)


def particles_of(tau_c: float, energy_ratio: float, thermostat: str) -> int:
    """Return how many particles a relaxation is made with, 0 if it can't be afforded.

    A thermostat makes an error that falls with the number of particles in a cell of the grid, as
    their velocities are not independent if their mean is held: with 40 of them t* was 4 % late at
    τ_c = 1e-3 and u = 1. The one that holds mean velocities only cools besides, the more the longer
    a relaxation takes.
    """
    if tau_c > LONG:
        # where collisions damp C at a high rate, what the thermostat adds matters less
        many = thermostat == "mean-velocity" or (thermostat == "full" and tau_c > 0.02)
        return MANY if many else USUAL
    if thermostat == "none":
        return FEW if energy_ratio > 0.0 else 2 * FEW
    return 4 * FEW if thermostat == "full" and energy_ratio > 100.0 else 0


def _setting(tau_c: float, energy_ratio: float, thermostat: str, particles: int) -> Setting:
    return Setting(tau_c, 1e6, 192.0, energy_ratio, thermostat, particles, dilute=True)


@dataclass(frozen=True, eq=False)
class Kept:
    """What is kept of a relaxation.

    Attributes
    ----------
    setting : Setting
        What was simulated.
    seed, particles : int
        Of the run.
    time, time_error : float
        t* and its standard error.
    amplitudes : mapping of str to sequence of float
        Of the waves of `MODES`, at t*, by moment.
    noise : mapping of str to float
        L2 norm of a moment's standard error over that of the moment.
    left_out : float
        As `Reference.left_out`.
    seconds : float
        CPU time that it took.
    """

    setting: Setting
    seed: int
    particles: int
    time: float
    time_error: float
    amplitudes: Mapping[str, list[float]]
    noise: Mapping[str, float]
    left_out: float
    seconds: float

    @classmethod
    def of(cls, reference: Reference) -> Kept:
        """Return what is kept of a simulation."""
        profiles = {name: reference.moments[name] for name in MODES}
        return cls(
            reference.setting,
            reference.seed,
            reference.particles,
            reference.time,
            reference.time_error,
            {name: (waves_of(name) @ each.values).tolist() for name, each in profiles.items()},
            {name: each.noise for name, each in profiles.items()},
            reference.left_out,
            reference.seconds,
        )

    @property
    def moments(self) -> dict[str, Reals]:
        """All moments at t*, on the points `X`."""
        return {
            name: np.asarray(np.linalg.pinv(waves_of(name)) @ np.array(values), dtype=float)
            for name, values in self.amplitudes.items()
        }

    def line(self) -> str:
        """Return it as a line of the file."""
        return json.dumps(_rounded(asdict(self)))

    @classmethod
    def from_line(cls, line: str) -> Kept:
        """Return what stands in a line of the file."""
        told = json.loads(line)
        return cls(**told | {"setting": Setting(**told["setting"])})


def waves_of(name: str) -> Reals:
    """Return what takes a moment on the points `X` to the amplitudes of its waves."""
    kind, waves, _ = MODES[name]
    phases = 2.0 * np.pi * np.outer(waves, X)
    shapes = np.sin(phases) if kind == "sine" else np.cos(phases)
    return shapes / np.sum(shapes**2, axis=1, keepdims=True)


def _rounded(told: Any) -> Any:
    """Return floats with `DIGITS`, in whatever they stand."""
    if isinstance(told, dict):
        return {key: _rounded(value) for key, value in told.items()}
    if isinstance(told, list):
        return [_rounded(value) for value in told]
    return float(f"{told:.{DIGITS}g}") if isinstance(told, float) else told


def load(file: Path = FILE) -> dict[Setting, Kept]:
    """Return what the file holds, by setting; empty without one."""
    if not file.exists():
        return {}
    lines = file.read_text(encoding="utf-8").splitlines()
    return {kept.setting: kept for kept in map(Kept.from_line, lines)}


def main(arguments: list[str] | None = None) -> int:
    """Simulate what the file lacks, and append each relaxation to it."""
    parser = argparse.ArgumentParser(description="Particles with fields of four strengths.")
    parser.add_argument("--renew", action="store_true", help="begin with an empty file")
    options = parser.parse_args(arguments)
    if options.renew:
        FILE.unlink(missing_ok=True)
    known = load(FILE)
    for setting in plan():
        if setting in known:
            continue
        kept = Kept.of(simulate(setting, SEEDS[0]))
        with FILE.open("a", encoding="utf-8") as file:
            file.write(f"{kept.line()}\n")
        told = f"t* = {kept.time:.5f}({kept.time_error:.5f}), {kept.seconds:.0f} s CPU"
        print(f"{label(setting)}: {told}", file=sys.stderr, flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
