"""A run made segment by segment: where it stands, what has come out, how it ended."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from triboflux import breaches
from triboflux.bounds import broken_bounds
from triboflux.case_checks import check_stop_value
from triboflux.errors import InputError
from triboflux.grid import Grid
from triboflux.initial_state import initial_moments
from triboflux.integrate import (
    Carry,
    Outcome,
    Scalar,
    Settings,
    advance,
    begin,
    moved,
)
from triboflux.integrators.linear import distinct_wave_numbers
from triboflux.keeping import Records
from triboflux.models import Model
from triboflux.moments import Moments
from triboflux.progress import Progress, fraction_done
from triboflux.resolution import coarsest_for, ladder, resized

if TYPE_CHECKING:
    from jaxtyping import Array

    from triboflux.case import Case

# A segment has to end often enough to show progress, and seldom enough to cost nothing.
SMALL_GRID, STEPS_SMALL, STEPS_LARGE = 2**14, 256, 4
# Numbers per moment that a segment can put out, and the fewest outputs.
WINDOW, FEWEST_OUTPUTS = 2**21, 4

# A moment that stays zero has an error of zero, which needs something to be smaller than.
LEAST_TOLERANCE = 1e-290

_begin = eqx.filter_jit(begin)
_advance = eqx.filter_jit(advance)
_moved = eqx.filter_jit(moved)
_resized = eqx.filter_jit(resized)


@dataclass(frozen=True)
class Position:
    """All that a run needs to go on, replaced as a whole after every segment.

    Attributes
    ----------
    carry : Carry
        State, integrator and controller.
    grid : Grid
        On which the run works now: the case's or a coarser one.
    accepted, rejected : int
        Steps so far.
    recorded : int
        Outputs so far.
    done : float
        Estimated part of the run that is done.
    ending : tuple of str or None
        Status and reason, once the run is over.
    """

    carry: Carry
    grid: Grid
    accepted: int = 0
    rejected: int = 0
    recorded: int = 0
    done: float = 0.0
    ending: tuple[str, str] | None = None

    @property
    def steps(self) -> int:
        """Accepted and rejected steps."""
        return self.accepted + self.rejected

    @property
    def time(self) -> float:
        """Scaled by L/√Θ."""
        return float(self.carry.time)


class Segments:
    """A run of a case, made segment by segment.

    Where segments end is decided by the case alone, so that a run that goes on from a checkpoint
    makes the same segments with the same compiled program as one that was never interrupted.

    Parameters
    ----------
    case : Case
        What to run.
    model : Model
        The case's, with arrays for numbers.
    grid : Grid
        The case's.

    Raises
    ------
    InputError
        If the stop value lies above the initial peak charge.
    """

    def __init__(self, case: Case, model: Model, grid: Grid) -> None:
        self._case, self._model, self._grid = case, model, grid
        # bounds are looked for on the points, so they need the case's
        bounded = bool(model.limits) or case.run.realizability_bound is not None
        adaptive = case.run.adaptive_points and not bounded
        self._grids = ladder(grid) if adaptive else (grid,)
        self._wanted = np.array(case.run.output_times)
        window = max(WINDOW // math.prod(grid.points), FEWEST_OUTPUTS)
        self._window = min(window, len(self._wanted))
        # many outputs in a large segment would be one more segment for each window
        self._few_outputs = len(self._wanted) <= window
        run = case.run
        self._settings = Settings(
            *map(jnp.asarray, (run.t_end, run.rtol, max(run.atol, LEAST_TOLERANCE))),
            stop_at_peak_charge=_optional(run.stop_at_peak_charge),
            stop_at_rate=_optional(run.stop_at_rate),
            realizability_bound=_optional(run.realizability_bound),
        )
        fields = Moments(**{n: jnp.asarray(f) for n, f in initial_moments(case).items()})
        carry = _begin(model, fields, grid)
        coarsest = coarsest_for(carry.coefficients, self._grids, run.rtol, run.atol)
        self.position = Position(self._on(carry, grid, coarsest), coarsest)
        peak = self._peak_charge(self.position.carry, coarsest)
        check_stop_value(case, peak)
        self._initial_peak = max(peak, 1e-300)

    def advance(self, records: Records, *, estimate: bool = False) -> None:
        """Make the next segment, put its outputs into ``records`` and take the new position.

        Parameters
        ----------
        records : Records
            With as many outputs as the position says.
        estimate : bool
            Estimate which part of the run is done.
        """
        now = self.position
        broken = self._broken_at_start()
        if broken is not None:
            self._record(records, 0.0, self._whole(now.carry.coefficients, now.grid))
            self.position = replace(now, recorded=1, ending=broken)
            return
        outcome = self._segment(records)
        carry, grid, ending = outcome.carry, now.grid, None
        if bool(outcome.finished):
            time = float(carry.time)
            if not len(records) or float(records[len(records) - 1]["time"]) < time:
                self._record(records, time, self._whole(carry.coefficients, grid))
            ending = self._ending(outcome)
        elif bool(outcome.unresolved):
            grid = self._grids[self._grids.index(grid) + 1]
            carry = self._on(carry, now.grid, grid)
        position = Position(
            carry,
            grid,
            now.accepted + int(outcome.accepted),
            now.rejected + int(outcome.rejected),
            len(records),
            now.done,
            ending,
        )
        if estimate:
            peak = self._peak_charge(carry, grid)
            done = fraction_done(self._case.run, float(carry.time), peak, self._initial_peak)
            # The peak may rise again, but what is done stays done.
            position = replace(position, done=max(now.done, done))
        self.position = position

    def progress(self) -> Progress:
        """Return where the run stands."""
        now = self.position
        return Progress(
            float(now.carry.time),
            self._case.run.t_end,
            now.accepted,
            now.rejected,
            self._peak_charge(now.carry, now.grid),
            now.done,
        )

    def stored(self) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Return the position as arrays and numbers for a checkpoint."""
        now = self.position
        arrays = {
            name: np.asarray(leaf) if places is None else np.asarray(leaf)[places]
            for name, leaf, places, _ in self._leaves(now.carry, now.grid)
        }
        numbers = {
            name: getattr(now, name)
            for name in ("accepted", "rejected", "recorded", "done", "ending")
        }
        return arrays, numbers | {"points": now.grid.points}

    def restore(self, arrays: Mapping[str, np.ndarray], numbers: Mapping[str, Any]) -> None:
        """Take a position that was stored.

        Parameters
        ----------
        arrays, numbers : mapping
            From `stored`.

        Raises
        ------
        InputError
            If they do not fit the case.
        """
        grid = next((g for g in self._grids if list(g.points) == numbers["points"]), None)
        if grid is None:
            raise InputError("the checkpoint is damaged: its points do not fit the case.")
        begun = self._on(self.position.carry, self.position.grid, grid)
        leaves: list[Array] = []
        for name, like, places, index in self._leaves(begun, grid):
            found = arrays.get(name)
            shape = like.shape if places is None else np.asarray(like)[places].shape
            if found is None or found.shape != shape or found.dtype != like.dtype:
                raise InputError(f"the checkpoint is damaged: {name} does not fit the case.")
            leaves.append(jnp.asarray(found if index is None else found[..., index]))
        carry = jax.tree.unflatten(jax.tree.structure(begun), leaves)
        ending = numbers["ending"]
        self.position = Position(
            carry,
            grid,
            int(numbers["accepted"]),
            int(numbers["rejected"]),
            int(numbers["recorded"]),
            float(numbers["done"]),
            None if ending is None else (str(ending[0]), str(ending[1])),
        )

    def layout(self) -> dict[str, tuple[int, ...]]:
        """Return the shape of every array of a record."""
        now = self.position
        return {"time": ()} | {
            name: (*leaf.shape[: leaf.ndim - self._grid.dimensions], *self._grid.modes)
            for name in self._model.evolves
            for leaf in [getattr(now.carry.coefficients, name)]
        }

    def _on(self, carry: Carry, grid: Grid, to: Grid) -> Carry:
        """Return a carry on another grid, itself on its own."""
        return carry if to == grid else _moved(self._model, carry, grid, to)

    def _leaves(self, carry: Carry, grid: Grid) -> list[tuple[str, Array, Any, Any]]:
        """Return name, array and, where it depends on |k| only, how it is shortened and restored.

        The integrator's functions of the linear operator are the same for all modes of equal |k|,
        and would make a checkpoint many times larger than the state.
        """
        _, index = distinct_wave_numbers(grid)
        places = np.unique(index, return_index=True)[1]
        modes = (..., *np.unravel_index(places, grid.modes))
        listed: list[tuple[str, Array, Any, Any]] = []
        for path, leaf in jax.tree_util.tree_leaves_with_path(carry):
            name = jax.tree_util.keystr(path)
            shared = name.startswith(".solver_state") and (
                leaf.shape[-grid.dimensions :] == grid.modes
            )
            listed.append((name, leaf, modes if shared else None, index if shared else None))
        return listed

    def _segment(self, records: Records) -> Outcome:
        left, grid = self._wanted[len(records) :], self.position.grid
        small = math.prod(grid.points) <= SMALL_GRID and self._few_outputs
        begun = replace(
            self._settings,
            while_resolved=grid != self._grid,
            max_steps=STEPS_SMALL if small else STEPS_LARGE,
        )
        while True:
            # Times that are done move to the end, and are recorded again only if it is reached.
            pending = np.full(self._window, self._case.run.t_end)
            now = left[: self._window]
            pending[: len(now)] = now
            settings = eqx.tree_at(
                lambda s: s.outputs,
                begun,
                jnp.asarray(pending),
                is_leaf=lambda x: x is None,
            )
            outcome = _advance(self._model, self.position.carry, grid, settings)
            reached = min(int(np.sum(np.isfinite(outcome.times))), len(now))
            outputs = self._whole(outcome.outputs, grid) if reached else None
            for i in range(reached):
                self._record(records, now[i], jax.tree.map(lambda a: a[i], outputs))  # noqa: B023
            left = left[reached:]
            if reached < len(now) or not left.size or left[0] > float(outcome.carry.time):
                return outcome
            # More outputs lie in this segment than fit: it is made again for the others.

    def _record(self, records: Records, time: float, coefficients: Moments) -> None:
        evolved = {name: np.asarray(getattr(coefficients, name)) for name in self._model.evolves}
        records.append({"time": np.asarray(time, dtype=float), **evolved})

    def _whole(self, coefficients: Moments, grid: Grid) -> Moments:
        """Return coefficients of a grid that the run works on as those of the case's."""
        return coefficients if grid == self._grid else _resized(coefficients, grid, self._grid)

    def _peak_charge(self, carry: Carry, grid: Grid) -> float:
        return float(_peak(self._grid, self._whole(carry.coefficients, grid)))

    def _broken_at_start(self) -> tuple[str, str] | None:
        """Return status and reason if the initial state breaks a bound already."""
        if self.position.steps or not (
            self._model.limits or self._settings.realizability_bound is not None
        ):
            return None
        carry, bound = self.position.carry, self._settings.realizability_bound
        broken = _broken(self._model, carry.coefficients, self._grid, bound)
        for name, found in broken.items():
            if bool(found):
                return "nonphysical", self._breach(name, carry)
        return None

    def _breach(self, rule: str, carry: Carry) -> str:
        say = breaches.broken_limit if rule == "nonphysical" else breaches.unrealizable_place
        return say(self._model, self._grid, carry)

    def _ending(self, outcome: Outcome) -> tuple[str, str]:
        """Return status and reason of the end of a run."""
        run = self._case.run
        if bool(outcome.failed):
            carry = self._on(outcome.carry, self.position.grid, self._grid)
            return "diverged", breaches.failed_place(self._model, self._grid, carry)
        for name in ("nonphysical", "unrealizable"):
            if bool(outcome.stopped.get(name, False)):
                return "nonphysical", self._breach(name, outcome.carry)
        if bool(outcome.stopped.get("peak_charge", False)):
            return "ok", f"peak charge fell to {run.stop_at_peak_charge:g}"
        if bool(outcome.stopped.get("rate", False)):
            return "ok", f"the rate of change of the charge fell to {run.stop_at_rate:g}"
        return "ok", f"reached t_end = {run.t_end:g}"


def _optional(value: float | None) -> Array | None:
    return None if value is None else jnp.asarray(value)


@eqx.filter_jit
def _peak(grid: Grid, coefficients: Moments) -> Array:
    return grid.peak(coefficients.charge)


@eqx.filter_jit
def _broken(
    model: Model, coefficients: Moments, grid: Grid, bound: Scalar | None
) -> dict[str, Array]:
    return broken_bounds(model, coefficients, grid, bound)
