"""From a validated case to a result."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from triboflux import closures, diagnostics, models
from triboflux.calculus import FourierCalculus
from triboflux.errors import InputError
from triboflux.grid import Grid
from triboflux.initial_state import initial_fields
from triboflux.integrate import Carry, Outcome, Settings, advance, begin
from triboflux.memory import require_memory
from triboflux.moments import Moments
from triboflux.progress import Progress, fraction_done
from triboflux.result import Result, build_dataset

if TYPE_CHECKING:
    from jaxtyping import Array

    from triboflux.case import Case

# A segment has to end often enough to show progress, and seldom enough to cost nothing.
SMALL_GRID, STEPS_SMALL, STEPS_LARGE = 2**14, 256, 4

_begin = eqx.filter_jit(begin)
_advance = eqx.filter_jit(advance)


@dataclass
class _Record:
    """What has come out of the segments so far."""

    times: list[float] = field(default_factory=list)
    fields: list[dict[str, np.ndarray]] = field(default_factory=list)
    accepted: int = 0
    rejected: int = 0

    def add(self, model: models.Model, grid: Grid, time: float, coefficients: Moments) -> None:
        self.times.append(time)
        observed = _observe(model, grid, coefficients)
        self.fields.append({name: np.asarray(values) for name, values in observed.items()})

    def stacked(self) -> dict[str, np.ndarray]:
        return {name: np.stack([f[name] for f in self.fields]) for name in self.fields[0]}


def solve(case: Case, *, on_progress: Callable[[Progress], None] | None = None) -> Result:
    """Run a case.

    Parameters
    ----------
    case : Case
        What to run.
    on_progress : Callable, optional
        Called with a `Progress` after every segment of steps.

    Returns
    -------
    Result
        Its status is ``"ok"`` if the run ended as the case asks, ``"diverged"`` if the step size
        collapsed, ``"nonphysical"`` if an algebraic closure made no sense any longer; everything
        up to there is in the dataset.

    Raises
    ------
    InputError
        If the stop value lies above the initial peak charge.
    OutOfRangeError
        If the numbers are outside the range of validity of the closures.
    """
    started = clock.perf_counter()
    require_memory(case)
    closure_set = closures.by_name(case.closures, case.numbers.restitution, case.exponent)
    model = models.build(case.model, case.numbers, closure_set, dimensions=case.grid.dimensions)
    warnings = [
        *models.validity(
            model.coefficients, closure_set, case.run.allow_out_of_range, model_name=case.model
        ),
        *diagnostics.unused_initial_warnings(case, model),
    ]
    # As arrays, so that a case with other numbers reuses the compiled program.
    model = jax.tree.map(jnp.asarray, model)
    grid = Grid(case.grid.points, case.grid.lengths)
    carry = _begin(model, Moments(*map(jnp.asarray, initial_fields(case))), grid)
    _check_stop_value(case, float(_peak(grid, carry.coefficients)))

    record = _Record()
    if model.limits and float(_margin(model, grid, carry.coefficients)) <= 0.0:
        record.add(model, grid, 0.0, carry.coefficients)
        status, reason = "nonphysical", diagnostics.broken_limit(model, grid, carry)
    else:
        outcome = _run_segments(case, model, grid, carry, record, on_progress)
        carry = outcome.carry
        status, reason = _ending(case, model, grid, outcome)
    times, fields = np.array(record.times), record.stacked()
    if status == "ok":
        warnings += diagnostics.resolution_warnings(grid, carry.coefficients)
    warnings += diagnostics.realizability_warnings(
        grid, times, fields, closed_covariance="covariance" not in model.evolves
    )
    stats = {
        "accepted": record.accepted,
        "rejected": record.rejected,
        "seconds": round(clock.perf_counter() - started, 3),
    }
    dataset = build_dataset(
        case,
        times,
        **fields,
        status=status,
        stop_reason=reason,
        stats=stats,
        warnings=warnings,
        attributes={"trace_dimensions": closure_set.trace_dimensions(grid.dimensions)},
    )
    return Result(dataset)


def _check_stop_value(case: Case, peak: float) -> None:
    value = case.run.stop_at_peak_charge
    if value is not None and value >= peak:
        raise InputError(
            f"run.stop_at_peak_charge: {value:g} is not allowed; it must be below the initial peak "
            f"charge, {peak:.6g}."
        )


def _run_segments(
    case: Case,
    model: models.Model,
    grid: Grid,
    carry: Carry,
    record: _Record,
    on_progress: Callable[[Progress], None] | None,
) -> Outcome:
    """Integrate segment by segment, recording outputs, until the run is over."""
    run = case.run
    wanted = np.array(run.output_times)
    small = math.prod(grid.points) <= SMALL_GRID
    settings = Settings(
        *map(jnp.asarray, (run.t_end, run.rtol, run.atol)),
        stop_at_peak_charge=_optional(run.stop_at_peak_charge),
        stop_at_rate=_optional(run.stop_at_rate),
        max_steps=STEPS_SMALL if small else STEPS_LARGE,
    )
    initial_peak = max(float(_peak(grid, carry.coefficients)), 1e-300)
    done = 0.0
    while True:
        # Times that are done move to the end, where they are recorded again only if it is reached.
        pending = np.full_like(wanted, run.t_end)
        left = wanted[len(record.times) :]
        pending[: len(left)] = left
        segment = eqx.tree_at(
            lambda s: s.outputs, settings, jnp.asarray(pending), is_leaf=lambda x: x is None
        )
        outcome = _advance(model, carry, grid, segment)
        reached = min(int(np.sum(np.isfinite(outcome.times))), len(left))
        for i in range(reached):
            record.add(model, grid, left[i], jax.tree.map(lambda a: a[i], outcome.outputs))  # noqa: B023
        record.accepted += int(outcome.accepted)
        record.rejected += int(outcome.rejected)
        carry = outcome.carry
        if on_progress is not None:
            peak = float(_peak(grid, carry.coefficients))
            # The peak may rise again, but what is done stays done.
            done = max(done, fraction_done(run, float(carry.time), peak, initial_peak))
            now = Progress(
                float(carry.time), run.t_end, record.accepted, record.rejected, peak, done
            )
            on_progress(now)
        if bool(outcome.finished):
            break
    time = float(carry.time)
    if not record.times or record.times[-1] < time:
        record.add(model, grid, time, carry.coefficients)
    return outcome


def _optional(value: float | None) -> Array | None:
    return None if value is None else jnp.asarray(value)


def _ending(case: Case, model: models.Model, grid: Grid, outcome: Outcome) -> tuple[str, str]:
    """Return status and reason of the end of a run."""
    if bool(outcome.failed):
        return "diverged", f"the step size collapsed at t = {float(outcome.carry.time):.6g}"
    if bool(outcome.stopped.get("nonphysical", False)):
        return "nonphysical", diagnostics.broken_limit(model, grid, outcome.carry)
    if bool(outcome.stopped.get("peak_charge", False)):
        return "ok", f"peak charge fell to {case.run.stop_at_peak_charge:g}"
    if bool(outcome.stopped.get("rate", False)):
        return "ok", f"the rate of change of the charge fell to {case.run.stop_at_rate:g}"
    return "ok", f"reached t_end = {case.run.t_end:g}"


@eqx.filter_jit
def _peak(grid: Grid, coefficients: Moments) -> Array:
    return grid.peak(coefficients.charge)


@eqx.filter_jit
def _margin(model: models.Model, grid: Grid, coefficients: Moments) -> Array:
    return model.margin(FourierCalculus(grid), coefficients)


@eqx.filter_jit
def _observe(model: models.Model, grid: Grid, coefficients: Moments) -> dict[str, Any]:
    """Return the fields of a result from Fourier coefficients; no variance if none is modelled."""
    calculus = FourierCalculus(grid)
    fields = model.fields(calculus, coefficients)
    electric_field = grid.to_fields(calculus.electric_field(coefficients.charge))
    neglected = fields.covariance is None
    observed = {
        "charge": fields.charge,
        "covariance": jnp.zeros_like(electric_field) if neglected else fields.covariance,
        "field": electric_field,
        "potential": grid.to_fields(calculus.potential(coefficients.charge)),
        "peak_charge": grid.peak(coefficients.charge),
    }
    return observed if fields.variance is None else observed | {"variance": fields.variance}
