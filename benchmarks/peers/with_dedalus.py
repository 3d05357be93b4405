"""Dedalus 3: implicit-explicit methods with steps chosen by hand."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from functools import partial
from typing import Any

import dedalus.public as d3
import numpy as np
from dedalus.core.timesteppers import schemes

from benchmarks.peers.solver import Run, Settings, Solver, counts

PHASE = 8
"""Steps of equal length before it is doubled where they are graded."""
FIRST = (1.0, 1e-4)
"""Length of the first step as a part of the last."""


def _equations(problem: Mapping[str, Any], points: tuple[int, ...]) -> tuple[Any, dict[str, Any]]:
    """Return the initial value problem and its fields."""
    d, c = len(points), problem["coefficients"]
    coordinates = d3.CartesianCoordinates(*"xyz"[:d])
    distributor = d3.Distributor(coordinates, dtype=np.float64)
    # Products are taken on half as many points again, about those of the other solvers.
    bases = [
        d3.RealFourier(coordinates[name], size=2 * (n // 3), bounds=(0.0, 1.0), dealias=3 / 2)
        for name, n in zip("xyz", points, strict=False)
    ]
    fields = {
        "Q": distributor.Field(name="Q", bases=bases),
        "V": distributor.Field(name="V", bases=bases),
        "phi": distributor.Field(name="phi", bases=bases),
        "C": distributor.VectorField(coordinates, name="C", bases=bases),
        "tau": distributor.Field(name="tau"),
    }
    transverse = c.get("transverse_dispersion", 0.0)
    names = fields | {"grad": d3.grad, "div": d3.div, "lap": d3.lap, "integ": d3.integ}
    names |= {"transverse": transverse, "rest": c["covariance_dispersion"] - transverse}
    initial = d3.IVP([fields[name] for name in ("Q", "C", "V", "phi", "tau")], namespace=names | c)
    # A product with zero is no operator any more.
    source = " + field_variance*(grad(phi)@grad(phi))" if c["field_variance"] != 0.0 else ""
    initial.add_equation("dt(Q) + flux*div(C) + conduction*Q - diffusion*lap(Q) = 0")
    initial.add_equation(
        "dt(C) + gradient_production*grad(Q) + field_production*grad(phi)"
        " + covariance_destruction*C - transverse*lap(C) - rest*grad(div(C)) = -force*V*grad(phi)"
    )
    initial.add_equation(
        f"dt(V) + variance_destruction*V - variance_dispersion*lap(V) = -2*(C@grad(Q)){source}"
    )
    initial.add_equation("lap(phi) + tau + Q = 0")
    initial.add_equation("integ(phi) = 0")
    grid = distributor.local_grids(*bases)
    charge = np.zeros(fields["Q"]["g"].shape)
    for wave, sine, cosine in problem["modes"]:
        phase = 2.0 * np.pi * sum(m * x for m, x in zip(wave, grid, strict=True))
        charge = charge + sine * np.sin(phase) + cosine * np.cos(phase)
    return initial, fields | {"start": charge}


def steps_of(end: float, settings: Settings) -> list[float]:
    """Return the lengths of all steps: equal ones, or doubled until they are."""
    last, steps, time = end / settings["steps"], [], 0.0
    length = last * settings["first"]
    while length < last:
        steps += [length] * PHASE
        time += PHASE * length
        length *= 2.0
    count = max(1, int(np.ceil((end - time) / last)))
    return steps + [(end - time) / count] * count


def prepare(scheme: str, problem: Mapping[str, Any], settings: Settings) -> Run:
    """Prepare a time stepper."""
    logging.disable(logging.INFO)
    initial, fields = _equations(problem, tuple(settings["points"]))
    solver = initial.build_solver(schemes[scheme])
    steps = steps_of(problem["end"], settings)

    def run() -> np.ndarray:
        solver.timestepper = schemes[scheme](solver)
        solver.sim_time, solver.iteration = 0.0, 0
        for name in ("C", "V", "phi"):
            fields[name]["c"] = 0.0
        fields["Q"].change_scales(1)
        fields["Q"]["g"] = fields["start"]
        for step in steps:
            solver.step(step)
        fields["Q"].change_scales(1)
        return np.array(fields["Q"]["g"])

    return run


def series(problem: Mapping[str, Any]) -> list[list[Settings]]:
    """Return the numbers of steps to try, with and without small ones first."""
    if problem["points"]:
        return counts(problem, (16, 32, 64, 128, 256, 512), first=(1.0,))
    steps = [round(16 * 2 ** (half / 2)) for half in range(18)]
    return counts(problem, steps, (32, 48), first=FIRST)


SOLVERS = {
    f"Dedalus {scheme}, fixed step": Solver(series, partial(prepare, scheme), fixed_step=True)
    for scheme in ("SBDF4", "RK443")
}
