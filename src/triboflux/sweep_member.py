"""One member of a sweep: from the text of a task to the text of its record, in any process."""

from __future__ import annotations

import base64
import functools
import importlib
import json
import os
import queue
import signal
import sys
import threading
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from triboflux.errors import InputError, TribofluxError, shown

if TYPE_CHECKING:
    from triboflux.case import Case

FIELDS = ("charge", "covariance", "variance")
"""What is kept of the fields at the stop time; a model without variance has two."""
READY = "ready"
"""First line of a worker process."""

_LONGEST_REASON = 300
# versions that decide the digits of a result
_DECISIVE = ("triboflux", "jax", "diffrax", "equinox", "numpy")
ONE_THREAD = {
    "NPROC": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
}
"""Environment of a worker: a process per core is as many threads as there are cores."""


@functools.cache
def decisive_versions() -> dict[str, str]:
    """Return the versions that two processes must share to compute the same digits."""
    from triboflux.dataset import versions

    return {name: number for name, number in versions().items() if name in _DECISIVE}


@functools.cache
def _prepare() -> None:
    """Set up this process, unless JAX was imported before."""
    for name, value in ONE_THREAD.items():
        os.environ.setdefault(name, value)
    from triboflux.terminal import use_compilation_cache

    use_compilation_cache()
    # here, because it takes seconds
    importlib.import_module("triboflux.solve")


def compute(task: str) -> str:
    """Run a member.

    Parameters
    ----------
    task : str
        From `triboflux.sweep_runners.task`.

    Returns
    -------
    str
        JSON of its record: status, stop_reason and, if it ran, everything else.

    Raises
    ------
    TribofluxError
        If versions differ from those of the process that made the task; nothing else.
    """
    told = json.loads(task)
    ours = decisive_versions()
    for name, number in told["versions"].items():
        if ours[name] != number:
            raise TribofluxError(
                f"a worker has {name} {ours[name]}, but the sweep is computed with {number}."
            )
    _prepare()
    try:
        from triboflux.case import Case

        return json.dumps(_record(Case(**told["case"])))
    except InputError as error:
        return json.dumps({"status": "refused", "stop_reason": str(error)})
    except Exception as error:
        return json.dumps(failure(f"{type(error).__name__}: {error}"))


def failure(reason: str) -> dict[str, Any]:
    """Return the record of a member that could not be computed."""
    told = shown(reason.partition("\n")[0][:_LONGEST_REASON], 2 * _LONGEST_REASON)[1:-1]
    return {"status": "failed", "stop_reason": told}


def _record(case: Case) -> dict[str, Any]:
    """Return what is kept of a run."""
    from triboflux.solve import solve

    run = case.run.model_copy(update={"outputs": 1})
    result = solve(case.model_copy(update={"run": run}))
    end, stats = result.dataset.isel(time=-1), result.stats
    return {
        "status": result.status,
        "stop_reason": result.stop_reason,
        "warnings": "\n".join(result.warnings),
        "stop_time": float(end["time"]),
        "peak_charge": float(end["peak_charge"]),
        "accepted": int(stats["accepted"]),
        "rejected": int(stats["rejected"]),
        "fields": {name: encoded(end[name].values) for name in FIELDS if name in end.variables},
    }


def encoded(values: np.ndarray) -> dict[str, Any]:
    """Return an array of doubles as JSON, to the last bit; `decoded` returns it again."""
    content = np.ascontiguousarray(values, dtype="<f8").tobytes()
    return {"shape": values.shape, "base64": base64.b64encode(content).decode("ascii")}


def decoded(field: Mapping[str, Any]) -> np.ndarray:
    """Return the array that `encoded` has written."""
    content = base64.b64decode(field["base64"])
    return np.frombuffer(content, dtype="<f8").reshape(field["shape"])


def serve() -> None:
    """Be a worker process: read tasks, a line each, and answer each with a line.

    It ends as soon as its standard input does, that is, also when the parent process is killed.
    """
    # Ctrl-C is for the parent
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.fdopen(os.dup(1), "w", encoding="ascii")
    # whatever else prints must not get between the answers
    os.dup2(2, 1)
    _prepare()
    tasks: queue.SimpleQueue[str] = queue.SimpleQueue()

    def read() -> None:
        for line in sys.stdin:
            tasks.put(line)
        os._exit(0)

    threading.Thread(target=read, daemon=True).start()
    print(READY, file=answers, flush=True)
    while True:
        print(compute(tasks.get()), file=answers, flush=True)
