"""Small sweeps, and members that only pretend, for tests and the worker processes they start."""

import json
import os

import numpy as np

from tests.cases import NUMBERS

DEADLY = 1e5


def tables(**changes):
    """Return the keywords of a sweep of twelve members, two of them out of range."""
    numbers = {key: value for key, value in NUMBERS.items() if key not in ("peclet", "tau_c")}
    case = {
        "closures": "derived",
        "numbers": numbers,
        "grid": {"points": [16]},
        "initial": {"charge": [{"mode": [1], "sine": -1.0}]},
        "run": {"t_end": 1000.0, "stop_at_peak_charge": 0.5},
    }
    parameters = {
        "numbers.peclet": [1e3, 1e5, 1e6, 1e7],
        "numbers.tau_c": {"first": 1e-4, "last": 1e-2, "count": 3, "spacing": "logarithmic"},
    }
    return {"case": case, "parameters": parameters, **changes}


def pretend(task):
    """Stand in for `triboflux.sweep_member.compute`, at once and without JAX."""
    from triboflux import sweep_member

    numbers = json.loads(task)["case"]["numbers"]
    peclet, tau_c = numbers["peclet"], numbers["tau_c"]
    if peclet == 1e3 and tau_c > 1e-3:
        return json.dumps({"status": "refused", "stop_reason": "numbers: out of range."})
    fields = {
        "charge": np.sin(np.arange(16.0) * tau_c),
        "covariance": np.full((1, 16), 1.0 / peclet),
        "variance": np.full(16, tau_c),
    }
    return json.dumps(
        {
            "status": "ok",
            "stop_reason": "pretended",
            "warnings": "",
            "stop_time": peclet * tau_c,
            "peak_charge": 0.5,
            "accepted": 10,
            "rejected": 1,
            "fields": {name: sweep_member.encoded(values) for name, values in fields.items()},
        }
    )


def deadly(task):
    """Stand in for `compute` and die over some members."""
    if json.loads(task)["case"]["numbers"]["peclet"] == DEADLY:
        os._exit(3)
    return pretend(task)


def broken(task):
    """Stand in for `compute` with a solver that raises for some members."""
    from triboflux import sweep_member

    def record(case):
        if case.numbers.peclet == DEADLY:
            raise ZeroDivisionError("as it had to come")
        return json.loads(pretend(task))

    sweep_member._record = record
    return broken.__wrapped__(task)


def serve(name):
    """Be a worker process with one of the functions above."""
    from triboflux import sweep_member

    globals()[name].__dict__["__wrapped__"] = sweep_member.compute
    sweep_member.compute = globals()[name]
    sweep_member._prepare = lambda: None
    sweep_member.serve()


def files(store):
    """Return the content of every file of a store."""
    return {
        str(path.relative_to(store)): path.read_bytes()
        for path in sorted(store.rglob("*"))
        if path.is_file()
    }
