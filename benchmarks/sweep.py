"""Whether a batch of like members is faster under vmap than one after the other or on processes.

Run as ``python -m benchmarks.sweep``; a table goes to standard output, within about two minutes.
The members are 64 points of (Pe, tau_c) on a box of 64 points, each integrated until the largest
charge has halved. Compiling is timed apart; a sweep on processes is timed whole, with their start.
Last come both models on 32 x 32 points, on two processes.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from time import perf_counter
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

import triboflux as tbf
from triboflux import models
from triboflux.grid import Grid
from triboflux.initial_state import initial_fields
from triboflux.integrate import Settings, integrate
from triboflux.moments import Moments
from triboflux.sweep import Sweep, sweep
from triboflux.terminal import use_compilation_cache

CASE = {
    "closures": "derived",
    "numbers": {"energy_ratio": 300.0, "length_ratio": 192.0, "restitution": 1.0},
    "grid": {"points": [64]},
    "initial": {"charge": [{"mode": [1], "sine": -1.0}]},
    "run": {"t_end": 1000.0, "stop_at_peak_charge": 0.5},
}
BATCHES = (8, 64)
REPEATS = 3


def members(count: int = 8) -> Sweep:
    """Return a sweep of count² members, all within the range of the closures."""
    return Sweep(
        case=CASE,
        parameters={
            "numbers.peclet": {"first": 1e5, "last": 1e8, "count": count, "spacing": "logarithmic"},
            "numbers.tau_c": {
                "first": 1e-4,
                "last": 1e-2,
                "count": count,
                "spacing": "logarithmic",
            },
        },
    )


def whole_chart() -> Sweep:
    """Return the chart of both models over the plane of Pe and tau_c."""
    return Sweep(
        case=CASE,
        parameters={
            "numbers.peclet": {"first": 1e2, "last": 1e8, "count": 32, "spacing": "logarithmic"},
            "numbers.tau_c": {"first": 1e-5, "last": 1.0, "count": 32, "spacing": "logarithmic"},
            "model": ["full", "semi-algebraic"],
        },
    )


def programs(cases: list[tbf.Case]) -> tuple[list[Any], Any]:
    """Return the models of the cases and the function that integrates one."""
    case = cases[0]
    grid = Grid(case.grid.points, case.grid.lengths)
    state = Moments(*map(jnp.asarray, initial_fields(case)))
    settings = Settings(
        *map(jnp.asarray, (case.run.t_end, case.run.rtol, case.run.atol)),
        stop_at_peak_charge=jnp.asarray(case.run.stop_at_peak_charge),
        max_steps=256,
    )

    def end(model: Any) -> Any:
        outcome = integrate(model, state, grid, settings)
        return outcome.time, outcome.carry.coefficients.charge

    built = [models.build(case.model, case.numbers, case.closures) for case in cases]
    return [jax.tree.map(jnp.asarray, model) for model in built], end


def timed(work: Any) -> tuple[float, float]:
    """Return the seconds of the first call and the least of some further ones."""
    seconds = []
    for _ in range(1 + REPEATS):
        begun = perf_counter()
        jax.block_until_ready(work())
        seconds.append(perf_counter() - begun)
    return seconds[0], min(seconds[1:])


def main() -> None:
    """Print the table."""
    use_compilation_cache()
    chart = members()
    cases = [tbf.Case(**chart.table(index)) for index in range(chart.size)]
    built, end = programs(cases)
    rows: list[tuple[str, float, float]] = []

    one = eqx.filter_jit(end)
    first, again = timed(lambda: [one(model) for model in built])
    rows.append(("integrate, one after the other", first - again, again))
    times = np.array([float(one(model)[0]) for model in built])
    for size in BATCHES:
        many = eqx.filter_jit(eqx.filter_vmap(end))
        batches = [
            jax.tree.map(lambda *leaves: jnp.stack(leaves), *built[i : i + size])
            for i in range(0, len(built), size)
        ]
        first, again = timed(lambda: [many(batch) for batch in batches])  # noqa: B023 -- called at once
        rows.append((f"integrate under vmap, batches of {size}", first - again, again))
        together = np.concatenate([many(batch)[0] for batch in batches])
        np.testing.assert_allclose(together, times, rtol=1e-9)

    first, again = timed(lambda: [tbf.solve(case).stop_reason for case in cases])
    rows.append(("solve, one after the other", first - again, again))
    with tempfile.TemporaryDirectory() as folder:
        for workers in (1, 2):
            begun = perf_counter()
            sweep(chart, Path(folder) / f"{workers}.zarr", workers=workers)
            rows.append((f"sweep, {workers} process(es)", 0.0, perf_counter() - begun))
        begun = perf_counter()
        sweep(whole_chart(), Path(folder) / "chart.zarr", workers=2)
        whole = perf_counter() - begun

    print(f"{len(cases)} members, N = 64; seconds")
    print(f"{'':42} {'compile':>8} {'all':>8} {'a member':>9}")
    for name, compiling, seconds in rows:
        print(f"{name:42} {compiling:8.2f} {seconds:8.3f} {seconds / len(cases):9.4f}")
    print(f"both models on 32 x 32 points, 2 processes: {whole:.0f} s")


if __name__ == "__main__":
    main()
