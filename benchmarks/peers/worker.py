"""A process that runs the solvers of one environment on request.

Started by `benchmarks.peers.measure` as ``python -m benchmarks.peers.worker MODULE``; requests and
answers are lines of JSON.
"""

from __future__ import annotations

import json
import os
import signal
import sys
from collections.abc import Mapping
from importlib import import_module
from importlib.metadata import version
from statistics import median
from time import perf_counter, process_time
from typing import Any

import numpy as np

from benchmarks.peers.error import relative_error
from benchmarks.peers.solver import Run, Settings, Solver

FINEST = 3e-10
"""A ladder of settings ends where its error is no larger."""
QUICK = 0.3
"""Runs shorter than this many seconds are searched with the median of three."""

PATIENCE = 30.0
"""First runs longer than this, compilation included, are not repeated in the search."""

_prepared: dict[str, Run] = {}
_batches: dict[str, list[Run]] = {}


class OutOfTimeError(Exception):
    """A run took more CPU time than it may."""


def _stop(*_: Any) -> None:
    raise OutOfTimeError("took more CPU time than allowed")


def timed(run: Run) -> tuple[Any, float, float]:
    """Return the result of a run with its wall and CPU seconds."""
    wall, cpu = perf_counter(), process_time()
    charge = run()
    return charge, perf_counter() - wall, process_time() - cpu


def trial(
    solver: Solver, request: Mapping[str, Any], settings: Settings, exact: Any
) -> dict[str, Any]:
    """Run one set of settings, first to compile and then timed."""
    run = solver.prepare(request["problem"], settings)
    # Compiled loops cannot be interrupted; what calls back into Python can.
    signal.setitimer(signal.ITIMER_PROF, PATIENCE + 2.0 * request["limit"])
    try:
        charge, wall, cpu = timed(run)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    # The first run compiles.
    repeats = 3 if cpu < QUICK else 1 if cpu < PATIENCE else 0
    if repeats:
        times = [timed(run)[1:] for _ in range(repeats)]
        wall, cpu = (median(column) for column in zip(*times, strict=True))
    return {"settings": settings, "error": relative_error(charge, exact), "wall": wall, "cpu": cpu}


def search(solver: Solver, request: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Try all settings of a solver on a problem, each ladder until it is good or dear enough."""
    exact, trials = np.load(request["reference"]), []
    for ladder in solver.series(request["problem"]):
        for settings in ladder:
            try:
                done = trial(solver, request, settings, exact)
            except OutOfTimeError as met:
                trials.append({"settings": settings, "failure": str(met)})
                break
            except Exception as met:
                trials.append({"settings": settings, "failure": str(met)[:200]})
                continue
            if np.isfinite(done["error"]):
                trials.append(done)
            else:
                trials.append({"settings": settings, "failure": "not finite"})
            if done["error"] <= FINEST or done["cpu"] > request["limit"]:
                break
    return trials


def prepare(solver: Solver, request: Mapping[str, Any]) -> dict[str, float]:
    """Keep a prepared run; return its error and the seconds of preparing and of the first run."""
    began = perf_counter()
    run = solver.prepare(request["problem"], request["settings"])
    prepared = perf_counter()
    charge = run()
    first = perf_counter() - prepared
    _prepared[request["key"]] = run
    error = relative_error(charge, np.load(request["reference"]))
    return {"setup": prepared - began, "first": first, "error": error}


def batch(solver: Solver, request: Mapping[str, Any]) -> dict[str, float]:
    """Run many problems twice, the first time to compile, and return seconds and largest error."""
    key = json.dumps([request["solver"], request["settings"]])
    began = perf_counter()
    errors = [0.0]
    if key not in _batches:
        _batches[key] = [
            solver.prepare(problem, request["settings"]) for problem in request["problems"]
        ]
        charges = [run() for run in _batches[key]]
        exact = np.load(f"{request['files']}{request['part']}.npy")
        # Over the initial amplitude: some charges have all but vanished at the end.
        errors = [
            relative_error(a, b) * np.abs(b).max() for a, b in zip(charges, exact, strict=True)
        ]
    setup, cpu = perf_counter() - began, process_time()
    for run in _batches[key]:
        run()
    return {"setup": setup, "cpu": process_time() - cpu, "error": float(max(errors))}


def batch_reference(solver: Solver, request: Mapping[str, Any]) -> dict[str, float]:
    """Write the charges of many problems."""
    charges = [solver.prepare(problem, request["settings"])() for problem in request["problems"]]
    np.save(f"{request['files']}{request['part']}.npy", np.stack(charges))
    return {}


def answer(solvers: Mapping[str, Solver], request: Mapping[str, Any]) -> Any:
    """Return the answer to a request."""
    if request["do"] == "solvers":
        return {name: solver.fixed_step for name, solver in solvers.items()}
    if request["do"] == "versions":
        return {name: version(name) for name in request["packages"]}
    if request["do"] == "run":
        _, wall, cpu = timed(_prepared[request["key"]])
        return {"wall": wall, "cpu": cpu}
    solver = solvers[request["solver"]]
    if request["do"] == "search":
        return search(solver, request)
    if request["do"] == "batch":
        return batch(solver, request)
    if request["do"] == "batch reference":
        return batch_reference(solver, request)
    if request["do"] == "prepare":
        return prepare(solver, request)
    if request["do"] == "charge":
        np.save(request["file"], solver.prepare(request["problem"], request["settings"])())
        return {}
    raise ValueError(f"no such request: {request['do']}")


def main() -> None:
    """Answer requests until there are no more."""
    # What libraries print must not come between the answers.
    signal.signal(signal.SIGPROF, _stop)
    with os.fdopen(os.dup(1), "w", encoding="utf-8") as out:
        os.dup2(2, 1)
        solvers = import_module(f"benchmarks.peers.{sys.argv[1]}").SOLVERS
        for line in sys.stdin:
            try:
                said = {"answer": answer(solvers, json.loads(line))}
            except Exception as met:
                said = {"failure": f"{type(met).__name__}: {met}"[:500]}
            print(json.dumps(said), file=out, flush=True)


if __name__ == "__main__":
    main()
