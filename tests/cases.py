"""A small valid case for the tests to change."""

import numpy as np

from triboflux.dataset import build_dataset
from triboflux.result import Result

NUMBERS = {
    "peclet": 1e6,
    "tau_c": 0.1,
    "energy_ratio": 300.0,
    "length_ratio": 192.0,
    "restitution": 1.0,
}


def data(**changes):
    """Return a valid case as keywords, with ``a__b=value`` for nested changes."""
    tables = {
        "numbers": dict(NUMBERS),
        "grid": {"points": [32]},
        "initial": {"charge": [{"mode": [1], "sine": -1.0}]},
        "run": {"t_end": 1.0},
    }
    for name, value in changes.items():
        *outer, key = name.split("__")
        table = tables[outer[0]] if outer else tables
        table[key] = value
    return tables


def fake_result(case, **changes):
    """Return a result of the documented shape without running anything."""
    shape = (3, *case.grid.points)
    vector = (3, case.grid.dimensions, *case.grid.points)
    numbers = np.random.default_rng(0)
    options = {
        "status": "ok",
        "stop_reason": "end time",
        "stats": {"accepted": 12, "rejected": 3, "largest": 0.5},
        "warnings": ["covariance is unrealizable"],
        "attributes": {"trace_dimensions": 3},
    }
    return Result(
        build_dataset(
            case,
            times=np.linspace(0, case.run.t_end, 3),
            charge=numbers.normal(size=shape),
            covariance=numbers.normal(size=vector),
            variance=numbers.random(size=shape),
            field=numbers.normal(size=vector),
            potential=numbers.normal(size=shape),
            peak_charge=[1.0, 0.75, 0.5],
            **(options | changes),
        )
    )
