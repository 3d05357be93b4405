"""Integrating a model in time: pure functions from pytrees to pytrees.

Nothing here validates, prints, reads or writes; `triboflux.solve` does that around it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeAlias

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from triboflux.bounds import bounds, broken_bounds
from triboflux.calculus import FourierCalculus
from triboflux.grid import Grid
from triboflux.integrators.controller import LadderController
from triboflux.integrators.exponential import ExponentialRungeKutta5, SemilinearTerm
from triboflux.integrators.linear import block_operator
from triboflux.integrators.root import Illinois
from triboflux.models.model import Model
from triboflux.models.terms import Term, evaluate
from triboflux.moments import Moments
from triboflux.resolution import resized, unresolved

# Where in a step a stop lies is found to a thousandth of what the tolerance allows the state, or
# to what the round-off of the time does.
STOP_PRECISION, FINEST = 1e-3, 1e-14
# Above how many times the stop value the peak is not looked for between the points.
FAR = 1.1
# Up to how many points the products at all nodes of a level are evaluated together.
TOGETHER = 2**17
# Comes last in the order of names: of the rules that apply within the same step Diffrax takes the
# first, and one that ends the run must not be lost.
UNRESOLVED = "unresolved"

Scalar: TypeAlias = float | Float[Array, ""]


class Settings(eqx.Module):
    """How far and how accurately to integrate.

    Attributes
    ----------
    t_end : Scalar
        End time, scaled by L/√Θ.
    rtol, atol : Scalar
        Relative and absolute tolerance of the error per step, for the rms of each moment.
    outputs : Array or None
        Non-decreasing times from the current one to `t_end` at which to record the state.
    stop_at_peak_charge : Scalar or None
        Stop when the largest |Q| in the box falls to this value, scaled by Q0.
    stop_at_rate : Scalar or None
        Stop when the rms of ∂Q/∂t falls to this value, scaled by Q0 √Θ/L.
    realizability_bound : Scalar or None
        Stop when |C|² − V, or what takes its place where R_ij is evolved (`realizability_margin`),
        rises to this value on one of the points, scaled by Q0²; for models with a variance.
    while_resolved : bool
        Return after a step at whose end the grid is too coarse; see `resolution.unresolved`.
    max_steps : int
        Steps, rejected ones included, after which to return anyway.
    adjoint : diffrax.AbstractAdjoint
        How to differentiate; reverse mode by default.
    """

    t_end: Scalar
    rtol: Scalar = 1e-6
    atol: Scalar = 1e-9
    outputs: Float[Array, " outputs"] | None = None
    stop_at_peak_charge: Scalar | None = None
    stop_at_rate: Scalar | None = None
    realizability_bound: Scalar | None = None
    while_resolved: bool = eqx.field(static=True, default=False)
    max_steps: int = eqx.field(static=True, default=4096)
    adjoint: diffrax.AbstractAdjoint = diffrax.RecursiveCheckpointAdjoint()


class Carry(eqx.Module):
    """Where an integration stands; what a checkpoint has to hold.

    Attributes
    ----------
    time : Array
        Scaled by L/√Θ.
    coefficients : Moments
        Fourier coefficients of the state.
    solver_state : object
        The integrator's functions of the linear operator and their step.
    next_step : Array
        Length of the next step, not clipped to the end; 0 where none has been made yet.
    """

    time: Float[Array, ""]
    coefficients: Moments
    solver_state: Any
    next_step: Float[Array, ""]


class Outcome(eqx.Module):
    """What an integration, or a segment of one, returns.

    Attributes
    ----------
    carry : Carry
        Where it stands now.
    times : Array or None
        The requested output times that were reached, ``inf`` for the others.
    outputs : Moments or None
        Fourier coefficients at these times, with a leading axis.
    accepted, rejected : Array
        Numbers of steps.
    stopped : dict of str to Array
        Whether the rule ``"peak_charge"``, ``"rate"``, ``"nonphysical"`` or ``"unrealizable"``
        ended it.
    unresolved : Array
        Whether it returned because the grid has become too coarse.
    finished : Array
        Whether it is over: stopped, at the end, or failed; otherwise `max_steps` were made, or it
        goes on on a finer grid.
    failed : Array
        Whether the step size collapsed.
    """

    carry: Carry
    times: Any
    outputs: Any
    accepted: Int[Array, ""]
    rejected: Int[Array, ""]
    stopped: dict[str, Bool[Array, ""]]
    unresolved: Bool[Array, ""]
    finished: Bool[Array, ""]
    failed: Bool[Array, ""]

    @property
    def time(self) -> Float[Array, ""]:
        """The time reached; the stop time where a stop rule ended it, differentiable."""
        return self.carry.time


def semilinear_term(model: Model, grid: Grid) -> SemilinearTerm:
    """Return a model's right-hand side, split for the exponential integrator.

    Parameters
    ----------
    model : Model
        Its linear terms become blocks per wave number, its products explicit functions.
    grid : Grid
        Where it is discretised.
    """
    calculus = FourierCalculus(grid)

    def part(terms: tuple[Term, ...]) -> Callable[[Moments], Moments]:
        return eqx.Partial(evaluate, terms, calculus)

    together = math.prod(grid.points) <= TOGETHER
    return SemilinearTerm(block_operator(model, grid), tuple(map(part, model.sweeps())), together)


def begin(model: Model, state: Moments, grid: Grid) -> Carry:
    """Return the carry of a run that has not made a step.

    Parameters
    ----------
    model : Model
        What will be integrated.
    state : Moments
        Fields at time 0 on the points of the grid.
    grid : Grid
        Where the fields live; modes beyond the kept ones are dropped.
    """
    fields = {name: getattr(state, name) for name in model.evolves}
    coefficients = Moments(**{name: grid.to_spectral(field) for name, field in fields.items()})
    return _not_begun(model, coefficients, grid)


def moved(model: Model, carry: Carry, grid: Grid, to: Grid) -> Carry:
    """Return the carry of a run that goes on on another grid of the same box.

    Parameters
    ----------
    model : Model
        What is integrated.
    carry : Carry
        Of a run on `grid`.
    grid : Grid
        Where it has been so far.
    to : Grid
        Where it goes on; modes that only this grid keeps begin at zero.
    """
    coefficients = resized(carry.coefficients, grid, to)
    fresh = _not_begun(model, coefficients, to)
    return Carry(carry.time, coefficients, fresh.solver_state, carry.next_step)


def _not_begun(model: Model, coefficients: Moments, grid: Grid) -> Carry:
    empty = eqx.filter_eval_shape(
        lambda y: ExponentialRungeKutta5().init(semilinear_term(model, grid), 0.0, 1.0, y, None),
        coefficients,
    )
    cache = jax.tree.map(
        lambda leaf: jnp.zeros(leaf.shape, leaf.dtype) if hasattr(leaf, "shape") else leaf, empty
    )
    return Carry(jnp.zeros(()), coefficients, cache, jnp.zeros(()))


def advance(model: Model, carry: Carry, grid: Grid, settings: Settings) -> Outcome:
    """Integrate on from a carry, for at most ``settings.max_steps`` steps.

    No step is shortened where a segment ends, so a run in segments makes the same steps as one in a
    single segment.

    Parameters
    ----------
    model : Model
        What is integrated.
    carry : Carry
        From `begin` or from an earlier outcome.
    grid : Grid
        Where the state lives.
    settings : Settings
        Output times before the carry's time are not allowed.
    """
    term, solver = semilinear_term(model, grid), ExponentialRungeKutta5()
    broken = broken_bounds(model, carry.coefficients, grid, settings.realizability_bound)
    if broken:
        settings = _ending_at_once(settings, carry, jnp.any(jnp.stack(list(broken.values()))))
    controller = LadderController(settings.rtol, settings.atol)
    step = _first_step(controller, term, carry, settings)
    rules = _stop_rules(model, term, grid, settings)
    solution = diffrax.diffeqsolve(
        term,
        solver,
        carry.time,
        settings.t_end,
        step,
        carry.coefficients,
        stepsize_controller=controller,
        saveat=diffrax.SaveAt(
            subs=_saved(settings),
            solver_state=True,
            controller_state=True,
        ),
        event=_event(rules, grid, settings),
        solver_state=carry.solver_state,
        controller_state=step,
        made_jump=False,
        max_steps=settings.max_steps,
        adjoint=settings.adjoint,
        throw=False,
    )
    return _outcome(solution, broken)


def integrate(model: Model, state: Moments, grid: Grid, settings: Settings) -> Outcome:
    """Integrate a model from fields at time 0 to the end time or a stop rule.

    A pure function without validation or input and output: it can be differentiated, mapped over
    batches and compiled. ``jax.grad`` of ``integrate(...).time`` is the sensitivity of a stop time.

    Parameters
    ----------
    model : Model
        From `triboflux.models.build`; its numbers may be traced.
    state : Moments
        Fields at time 0 on the points of the grid.
    grid : Grid
        The periodic box.
    settings : Settings
        How far and how accurately.

    Returns
    -------
    Outcome
        With Fourier coefficients; ``grid.to_fields`` brings them to the points.
    """
    return advance(model, begin(model, state, grid), grid, settings)


def _event(rules: dict[str, Any], grid: Grid, settings: Settings) -> diffrax.Event | None:
    """Return what ends an integration: rules that fall through zero, or too coarse a grid."""
    root_finder = Illinois(jnp.maximum(STOP_PRECISION * settings.rtol, FINEST)) if rules else None
    if settings.while_resolved:

        def too_coarse(t: Any, y: Moments, args: Any, **kwargs: Any) -> Array:
            return unresolved(y, grid, settings.rtol, settings.atol)

        rules = rules | {UNRESOLVED: too_coarse}
    return diffrax.Event(rules, root_finder, dict.fromkeys(rules, False)) if rules else None


def _saved(settings: Settings) -> dict[str, diffrax.SubSaveAt]:
    saved = {"end": diffrax.SubSaveAt(t1=True)}
    if settings.outputs is not None:
        saved["outputs"] = diffrax.SubSaveAt(ts=settings.outputs)
    return saved


def _ending_at_once(settings: Settings, carry: Carry, broken: Bool[Array, ""]) -> Settings:
    """Return settings that make no step from a state that breaks a bound.

    A rule is found where it changes its sign, which one that is broken already never does.
    """
    times = ("t_end",) if settings.outputs is None else ("t_end", "outputs")
    return eqx.tree_at(
        lambda s: [getattr(s, name) for name in times],
        settings,
        replace_fn=lambda wanted: jnp.where(broken, carry.time, wanted),
    )


def _first_step(
    controller: LadderController, term: SemilinearTerm, carry: Carry, settings: Settings
) -> Array:
    """Return the length of the next step, from the carry or from an estimate."""
    solver = ExponentialRungeKutta5()
    estimate, _ = controller.init(
        term,
        carry.time,
        settings.t_end,
        carry.coefficients,
        None,
        None,
        solver.func,
        solver.error_order(term),
    )
    return jnp.where(carry.next_step > 0.0, carry.next_step, estimate - carry.time)


def _outcome(solution: diffrax.Solution, broken: dict[str, Bool[Array, ""]]) -> Outcome:
    """Return what has come of an integration that may have broken bounds at its start."""
    times: Any = solution.ts
    states: Any = solution.ys
    final = jax.tree.map(lambda y: y[0], states["end"])
    exhausted = solution.result == diffrax.RESULTS.max_steps_reached
    stopped: Any = {} if solution.event_mask is None else dict(solution.event_mask)
    too_coarse = stopped.pop(UNRESOLVED, jnp.asarray(False))
    stopped = stopped | {name: stopped[name] | already for name, already in broken.items()}
    next_step: Any = solution.controller_state
    return Outcome(
        Carry(times["end"][0], final, solution.solver_state, next_step),
        times.get("outputs"),
        states.get("outputs"),
        solution.stats["num_accepted_steps"],
        solution.stats["num_rejected_steps"],
        stopped,
        too_coarse,
        ~exhausted & ~too_coarse,
        ~exhausted & ~diffrax.is_okay(solution.result),
    )


def _stop_rules(
    model: Model, term: SemilinearTerm, grid: Grid, settings: Settings
) -> dict[str, Any]:
    """Return functions of the state that fall through zero where the run is to stop."""
    values: Any = {"peak_charge": settings.stop_at_peak_charge, "rate": settings.stop_at_rate}

    def peak_charge(t: Any, y: Moments, args: Any, **kwargs: Any) -> Array:
        # The points' own maximum is a lower bound, and enough to say that the stop is far.
        largest = jnp.max(jnp.abs(grid.to_fields(y.charge)))
        far = largest > FAR * values["peak_charge"]
        peak = lax.cond(far, lambda: largest, lambda: grid.peak(y.charge))
        return peak - values["peak_charge"]

    def rate(t: Any, y: Moments, args: Any, **kwargs: Any) -> Array:
        return grid.rms(term.vf(t, y, args).charge) - values["rate"]

    def rule(margin: Callable[[Moments], Array]) -> Callable[..., Array]:
        return lambda t, y, args, **kwargs: margin(y)

    rules = {"peak_charge": peak_charge, "rate": rate}
    chosen: dict[str, Any] = {n: rule for n, rule in rules.items() if values[n] is not None}
    margins = bounds(model, grid, settings.realizability_bound)
    return chosen | {name: rule(margin) for name, margin in margins.items()}
