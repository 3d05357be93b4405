"""A batch of many cases over two processes, beside the best peer on the same list."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.peers.environments import ENVIRONMENTS
from benchmarks.peers.measure import DEFAULTS, OURS, Worker
from benchmarks.peers.problems import ONE_WAVE, Problem, described
from benchmarks.timing import table

PROCESSES, COUNT, ERROR, WANTED, REPEATS = 2, 8, 1e-6, 3.0, 3
TIMES, PECLETS = np.logspace(-4, -1, COUNT), np.logspace(4, 7, COUNT)
COMMON = {"tau_p": float("inf"), "tau_sigma": float("inf"), "energy_ratio": 300.0}
COMMON |= {"length_ratio": 192.0, "restitution": 1.0}
REFERENCE = {"points": [128], "rtol": 1e-10, "atol": 1e-13, "jacobian": "dense"}
TRIED = {
    "SUNDIALS CVODE": [
        {"points": [n], "rtol": rtol, "atol": 0.01 * rtol, "jacobian": jacobian}
        for n in (32, 48, 64)
        for jacobian in ("band", "dense")
        for rtol in (1e-6, 1e-7, 1e-8)
    ],
    "SciPy LSODA": [
        {"points": [n], "rtol": rtol, "atol": 0.01 * rtol, "jacobian": "band"}
        for n in (32, 48, 64)
        for rtol in (1e-6, 1e-7, 1e-8)
    ],
    OURS: [DEFAULTS, DEFAULTS | {"points": [64]}, DEFAULTS | {"points": [48]}],
}
MODULES = {"SUNDIALS CVODE": "with_sundials", "SciPy LSODA": "with_scipy", OURS: "with_triboflux"}


def members() -> tuple[list[dict[str, Any]], int]:
    """Return the cases that the closures allow, as plain data, and how many they refuse."""
    from triboflux import closures, models
    from triboflux.errors import OutOfRangeError
    from triboflux.models.coefficients import validity
    from triboflux.numbers import Numbers

    found, refused = [], 0
    for tau_c in TIMES:
        for peclet in PECLETS:
            numbers = COMMON | {"tau_c": float(tau_c), "peclet": float(peclet)}
            model = models.build("full", Numbers(**numbers), "derived")
            try:
                validity(model.coefficients, closures.derived(restitution=1.0))
            except OutOfRangeError:
                refused += 1
                continue
            found.append(described(Problem("", numbers, "derived", ONE_WAVE, 1.0)))
    return found, refused


class Pair:
    """Two processes that share a batch."""

    def __init__(self, solver: str) -> None:
        environment = next(e for e in ENVIRONMENTS if e.module == MODULES[solver])
        self.solver, self.workers = solver, [Worker(environment) for _ in range(PROCESSES)]

    def ask(self, do: str, cases: list[dict[str, Any]], **request: Any) -> list[Any]:
        """Return the answers of both, which work at the same time on every other case."""
        for i, worker in enumerate(self.workers):
            asked = {"solver": self.solver, "problems": cases[i::PROCESSES], "part": i}
            worker.send(do, **(asked | request))
        return [worker.receive() for worker in self.workers]

    def close(self) -> None:
        """End both."""
        for worker in self.workers:
            worker.close()


def cpu_of(answers: list[dict[str, float]]) -> float:
    """Return the CPU seconds of the process that took longest."""
    return max(answer["cpu"] for answer in answers)


def report() -> str:
    """Measure and return the table."""
    cases, refused = members()
    rows, best = [], {}
    with TemporaryDirectory() as folder:
        files = str(Path(folder) / "reference")
        reference = Pair("SUNDIALS CVODE")
        reference.ask("batch reference", cases, settings=REFERENCE, files=files)
        reference.close()
        pairs, runs = {name: Pair(name) for name in TRIED}, {}
        for name, tried in TRIED.items():
            good = []
            for settings in tried:
                ask = partial(pairs[name].ask, "batch", cases, settings=settings, files=files)
                answers = ask()
                error = max(answer["error"] for answer in answers)
                setup = max(answer["setup"] for answer in answers)
                if error <= ERROR or settings is DEFAULTS:
                    good.append((cpu_of(answers), error, setup, settings, ask))
            if good:
                chosen = min(good, key=lambda entry: entry[0])
                runs[name] = chosen
                if name == OURS and chosen[3] is not DEFAULTS:
                    default = next(entry for entry in good if entry[3] is DEFAULTS)
                    runs[f"{name}, default"] = default
        seconds: dict[str, list[float]] = {name: [] for name in runs}
        for _ in range(REPEATS):
            for name, entry in runs.items():
                seconds[name].append(cpu_of(entry[4]()))
        for pair in pairs.values():
            pair.close()
    for name, (_, error, setup, settings, _ask) in runs.items():
        best[name] = min(seconds[name])
        rows.append([name, f"{settings['points'][0]}", f"{settings['rtol']:.0e}", f"{error:.1e}"])
        rows[-1] += [f"{best[name]:.3g}", f"{setup:.3g}"]
    header = ["solver", "N", "rtol", "largest error", "CPU of the longer process, s"]
    text = table([*header, "compile and set-up, s"], rows)
    mine = best.get(f"{OURS}, default", best.get(OURS, float("inf")))
    rivals = [value for name, value in best.items() if not name.startswith(OURS)]
    if not rivals:
        return f"{text}\n\nNo peer reached the error."
    rival = min(rivals)
    ratio = rival / mine
    word = "met" if ratio >= WANTED else f"missed by a factor {WANTED / ratio:.2g}"
    told = f"{len(cases)} cases, {refused} refused by the closures. By default the package is"
    return f"{text}\n\n{told} {ratio:.2g} times as fast as the best peer; wanted 3: {word}."
