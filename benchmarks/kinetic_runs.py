"""The relaxations behind `benchmarks.kinetic_verdict`: what is simulated, with which seeds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

from benchmarks.kinetic_models import Prediction, predictions
from benchmarks.kinetic_particles import Reference, Setting, simulate

SEEDS = (20260901, 20260902)
"""The first, and one for a repetition."""
PARTS = {"full": 1.0, "reduced": 0.05}
"""Of the particles, by effort; fewer than the cells need are never taken."""
QUICK = 5e-3
"""τ_c from which on relaxations are cheap: only these are repeated, and done at reduced effort."""

WEAK = tuple(
    Setting(tau_c, 1e6, 192.0, dilute=True, particles=particles)
    for tau_c, particles in ((1e-3, 640_000), (1e-2, 2_560_000), (1e-1, 640_000), (1.0, 640_000))
)
"""The paper's Pe and L/d.

At small τ_c the covariance is small, too, about τ_c times the slope of Q, but not its noise: more
particles bring its error bar below 1 %.
"""
MODERATE = (Setting(1e-3, 200.0, 50.0, particles=204_800),)
MODERATE += tuple(Setting(tau_c, 3.2e4 * tau_c, 20.0) for tau_c in (1e-2, 1e-1, 1.0))
STRONG = (Setting(1e-3, 50.0, 50.0, particles=204_800),)
STRONG += tuple(Setting(tau_c, 8e3 * tau_c, 20.0) for tau_c in (1e-2, 1e-1, 1.0))
"""A collision passes over a fifth of the charge difference; at small τ_c it is dense."""
GROUPS = {"weak": WEAK, "moderate": MODERATE, "strong": STRONG}
"""Without a field, by the strength of the exchange of charge."""
FIELD = tuple(
    Setting(tau_c, 1e6, 192.0, energy_ratio=2.0, particles=particles, dilute=True)
    for tau_c, particles in ((1e-2, 2_560_000), (1e-1, 640_000), (1.0, 640_000))
)
"""A field so weak that it heats by less than 1 %; more particles where C is small, as above."""
CASE_B = tuple(
    Setting(0.1, 1e6, 192.0, 300.0, name, particles=5_120_000, dilute=True)
    for name in ("full", "mean-velocity", "none")
)
"""The paper's case B. A thermostat needs many particles, for it also damps fluctuating means."""
FEWER = tuple(replace(setting, particles=setting.particles // 8) for setting in CASE_B)
FINER = (WEAK[2], STRONG[1], CASE_B[0])
"""Repeated with half the time step and half the width of the collision cells."""

Runs: TypeAlias = dict[tuple[Setting, int, int], Reference]
"""By setting, seed, and what the time step and the width of the cells are divided by."""


def plan(effort: str) -> list[tuple[Setting, int, int]]:
    """Return everything that is simulated: what the particles of `Runs` are found by."""
    settings = [s for group in GROUPS.values() for s in group] + [*FIELD, *CASE_B]
    quick = [s for s in settings if s.tau_c > QUICK]
    if effort == "reduced":
        return [(s, SEEDS[0], 1) for s in quick]
    first = [(s, SEEDS[0], 1) for s in settings] + [(s, SEEDS[0], 2) for s in FINER]
    first += [(s, SEEDS[0], 1) for s in FEWER]
    return first + [(s, SEEDS[1], 1) for s in quick]


def measure(effort: str, told: Callable[[str], None] = lambda _: None) -> Runs:
    """Simulate all relaxations.

    Parameters
    ----------
    effort : str
        ``"full"`` or ``"reduced"``.
    told : Callable, optional
        Called with a line after each.
    """
    runs: Runs = {}
    for key in plan(effort):
        setting, seed, finer = key
        runs[key] = found = simulate(setting, seed, PARTS[effort], finer)
        told(
            f"{label(setting)}, seed {seed}: t* = {found.time:.5f}({found.time_error:.5f}), "
            f"{found.seconds:.0f} s CPU"
        )
    return runs


def predict_all(runs: Runs) -> dict[Setting, dict[tuple[str, str], Prediction]]:
    """Return what the models say about the settings of the first seed, at the particles' t*.

    The models hold mean velocities and Θ fixed: in case B they are compared with the particles
    whose thermostat does so, too.
    """
    return {
        setting: predictions(setting, found.time)
        for (setting, seed, finer), found in runs.items()
        if seed == SEEDS[0] and finer == 1 and setting not in (*CASE_B[1:], *FEWER)
    }


def label(setting: Setting) -> str:
    """Return a setting as a few words."""
    words = f"τ_c = {setting.tau_c:g}, Pe = {setting.peclet:g}, L/d = {setting.length_ratio:g}"
    if setting.energy_ratio > 0.0:
        words += f", u = {setting.energy_ratio:g}, thermostat {setting.thermostat}"
    return words
