"""Search of every solver's best settings, and their timing in turn."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Iterable, Mapping
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from benchmarks.peers.environments import ENVIRONMENTS, Environment, interpreter
from benchmarks.timing import ROOT

LEVELS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
"""Errors for which the cheapest settings are timed."""
SETTINGS = Path(__file__).with_name("settings.jsonl")
SLOW = 2.0
"""Seconds from which on a run is timed once only."""
DEFAULTS = {"points": [128], "rtol": 1e-6, "atol": 1e-9, "adaptive": True}
"""Of the package."""
OURS = "triboflux"
REFERENCES = {1: ("SciPy Radau", {"points": [96], "rtol": 1e-11, "atol": 1e-14})}
REFERENCES[2] = ("SciPy DOP853", {"points": [96, 96], "rtol": 1e-11, "atol": 1e-14})
REFERENCES[3] = ("SciPy DOP853", {"points": [48, 48, 48], "rtol": 1e-11, "atol": 1e-14})


class Worker:
    """A process with the solvers of one environment.

    Parameters
    ----------
    environment : Environment
        Which.
    """

    def __init__(self, environment: Environment) -> None:
        variables = dict(os.environ, OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1")
        paths = [str(ROOT)] if environment.requirements else [str(ROOT), str(ROOT / "src")]
        variables["PYTHONPATH"] = os.pathsep.join(paths)
        self.process = subprocess.Popen(
            [interpreter(environment), "-m", "benchmarks.peers.worker", environment.module],
            cwd=ROOT,
            env=variables,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )

    def ask(self, do: str, **request: Any) -> Any:
        """Return the answer to a request.

        Raises
        ------
        RuntimeError
            If the other side fails.
        """
        self.send(do, **request)
        return self.receive()

    def send(self, do: str, **request: Any) -> None:
        """Ask without waiting."""
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps({"do": do} | request) + "\n")
        self.process.stdin.flush()

    def receive(self) -> Any:
        """Wait for an answer; raises like `ask`."""
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line:
            raise RuntimeError(f"the process ended with code {self.process.wait()}")
        said = json.loads(line)
        if "failure" in said:
            raise RuntimeError(said["failure"])
        return said["answer"]

    def close(self) -> None:
        """End the process."""
        self.process.communicate()


class Row(NamedTuple):
    """Settings of a solver that are worth timing.

    Attributes
    ----------
    problem, module, solver : str
        Which.
    fixed_step : bool
        Whether the steps were chosen with hindsight.
    level : float
        The error that was asked for; 0 for the package's defaults.
    settings : dict
        The cheapest that were found.
    """

    problem: str
    module: str
    solver: str
    fixed_step: bool
    level: float
    settings: dict[str, Any]


class Measured(NamedTuple):
    """A row with what was measured.

    Attributes
    ----------
    row : Row
        What was run.
    error : float
        Reached.
    wall, cpu : float
        Median seconds of the integration alone.
    setup : float
        Wall seconds of preparing and of what the first run takes longer, compilation above all.
    """

    row: Row
    error: float
    wall: float
    cpu: float
    setup: float


def available(modules: Iterable[str] = ()) -> tuple[dict[str, Environment], dict[str, str]]:
    """Return the environments by module, and the reasons why others could not be made."""
    found, missing = {}, {}
    for environment in ENVIRONMENTS:
        if modules and environment.module not in modules:
            continue
        try:
            interpreter(environment)
            worker = Worker(environment)
            worker.ask("solvers")
            worker.close()
        except (RuntimeError, OSError, subprocess.CalledProcessError) as met:
            missing[environment.module.removeprefix("with_")] = str(met)
        else:
            found[environment.module] = environment
    return found, missing


def make_reference(problem: Mapping[str, Any], file: Path) -> None:
    """Write the converged charge of a problem by a method that is not the package's."""
    name, settings = REFERENCES[len(problem["modes"][0][0])]
    worker = Worker(next(e for e in ENVIRONMENTS if e.module == "with_scipy"))
    worker.ask("charge", solver=name, problem=problem, settings=settings, file=str(file))
    worker.close()


def search(
    environments: Mapping[str, Environment],
    key: str,
    problem: Mapping[str, Any],
    file: Path,
    limit: float,
) -> list[Row]:
    """Try the settings of all solvers and return the cheapest for every level of error.

    Parameters
    ----------
    environments : mapping
        From `available`.
    key : str
        Of the problem in `problems.PROBLEMS`.
    problem : mapping
        From `problems.described`.
    file : Path
        The reference.
    limit : float
        CPU seconds of a run after which no costlier settings are tried.
    """
    rows = []
    for module, environment in environments.items():
        worker = Worker(environment)
        for name, fixed in worker.ask("solvers").items():
            asked = {"solver": name, "problem": problem, "reference": str(file), "limit": limit}
            for level, settings in cheapest(name, worker.ask("search", **asked)):
                rows.append(Row(key, module, name, fixed, level, settings))
        worker.close()
    return rows


def cheapest(name: str, trials: list[dict[str, Any]]) -> list[tuple[float, dict[str, Any]]]:
    """Return the cheapest settings for every level, and the package's defaults as level 0.

    Parameters
    ----------
    name : str
        Of the solver.
    trials : list of dict
        What a worker answered.
    """
    good = [trial for trial in trials if "error" in trial]
    found = []
    for level in LEVELS:
        enough = [trial for trial in good if trial["error"] <= level]
        if enough:
            found.append((level, min(enough, key=lambda trial: trial["cpu"])["settings"]))
    if name == OURS:
        found += [(0.0, trial["settings"]) for trial in good if is_default(trial["settings"])]
    return found


def is_default(settings: Mapping[str, Any]) -> bool:
    """Return whether settings of the package are its defaults, for the points where prescribed."""
    close = abs(settings["rtol"] / DEFAULTS["rtol"] - 1.0) < 1e-6 and settings["adaptive"]
    return close and (len(settings["points"]) > 1 or list(settings["points"]) == DEFAULTS["points"])


def timed(
    environments: Mapping[str, Environment],
    problem: Mapping[str, Any],
    rows: list[Row],
    file: Path,
    repeats: int,
) -> list[Measured]:
    """Time rows of one problem in turn.

    Parameters
    ----------
    environments, problem, file
        As for `search`.
    rows : list of Row
        What to time; rows of environments that are not there are left out.
    repeats : int
        Rounds, whose medians count; runs of seconds take part in the first only.
    """
    rows = [row for row in rows if row.module in environments]
    workers: dict[str, Worker] = {}
    told, seconds = [], [[] for _ in rows]
    for index, row in enumerate(rows):
        if row.module not in workers:
            workers[row.module] = Worker(environments[row.module])
        asked = {"solver": row.solver, "settings": row.settings, "reference": str(file)}
        worker = workers[row.module]
        told.append(worker.ask("prepare", key=str(index), problem=problem, **asked))
    for turn in range(repeats):
        for index, row in enumerate(rows):
            if turn == 0 or seconds[index][0][1] < SLOW:
                took = workers[row.module].ask("run", key=str(index))
                seconds[index].append((took["wall"], took["cpu"]))
    for worker in workers.values():
        worker.close()
    measured = []
    for row, pairs, first in zip(rows, seconds, told, strict=True):
        wall, cpu = (median(column) for column in zip(*pairs, strict=True))
        setup = first["setup"] + max(0.0, first["first"] - wall)
        measured.append(Measured(row, first["error"], wall, cpu, setup))
    return measured


def read_rows(file: Path = SETTINGS) -> list[Row]:
    """Return the settings that were found, one row per problem, solver and level."""
    with file.open(encoding="utf-8") as lines:
        return [Row(**json.loads(line)) for line in lines]


def write_rows(new: list[Row], file: Path = SETTINGS) -> None:
    """Keep settings in place of older ones of the same problems and environments."""
    renewed = {(row.problem, row.module) for row in new}
    old = read_rows(file) if file.exists() else []
    rows = [row for row in old if (row.problem, row.module) not in renewed] + new
    rows.sort(key=lambda row: (row.problem, row.module, row.solver, -row.level))
    text = "".join(json.dumps(row._asdict()) + "\n" for row in rows)
    file.write_text(text, encoding="utf-8")
