"""Where and when a run breaks a bound, fails, or stops being realizable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from triboflux.calculus import FourierCalculus
from triboflux.grid import Grid
from triboflux.models.model import ROUND_OFF, Model
from triboflux.models.terms import values_of
from triboflux.realizability import margin_of, realizability_margin

if TYPE_CHECKING:
    from triboflux.integrate import Carry


def broken_limit(model: Model, grid: Grid, carry: Carry) -> str:
    """Say which limit of an algebraic closure is broken most, where and when.

    Parameters
    ----------
    model : Model
        With limits.
    grid : Grid
        Where the state lives.
    carry : Carry
        Of the run, at the time in question.
    """
    calculus = FourierCalculus(grid)
    worst: list[tuple[float, str]] = []
    for limit in model.limits:
        values = getattr(values_of((limit,), calculus, carry.coefficients), limit.moment)
        values = np.asarray(values)
        scale = max(float(np.abs(values).max()), 1e-300)
        index = _lowest(values, scale)
        relative = float(values[index]) / scale
        sentence = (
            f"{limit.name} falls to {float(values[index]):.3g} at x = {_place(grid, index)}, "
            f"t = {float(carry.time):.6g}"
        )
        worst.append((relative, sentence))
    return min(worst)[1]


def unrealizable_place(model: Model, grid: Grid, carry: Carry) -> str:
    """Say where and when the covariance exceeds its bound most.

    Parameters
    ----------
    model : Model
        With a variance.
    grid : Grid
        Where the state lives.
    carry : Carry
        Of the run, at the time in question.
    """
    fields = model.fields(FourierCalculus(grid), carry.coefficients)
    tensor = fields.granular_temperature_tensor
    variance = np.asarray(fields.variance)
    margin = np.asarray(realizability_margin(fields.covariance, variance, tensor))
    index = _lowest(margin, max(float((variance - margin).max()), 1e-300))
    return (
        f"{_squared(tensor is not None)} exceeds V by {-float(margin[index]):.3g}, the bound, "
        f"at x = {_place(grid, index)}, "
        f"t = {float(carry.time):.6g}"
    )


def failed_place(model: Model, grid: Grid, carry: Carry) -> str:
    """Say of a run whose steps became too short which moment cannot be followed, where and when.

    Parameters
    ----------
    model : Model
        What was integrated.
    grid : Grid
        Where the state lives.
    carry : Carry
        Of the last step that was accepted.
    """
    calculus = FourierCalculus(grid)
    rates = model.right_hand_side(calculus, carry.coefficients)
    when = f"t = {float(carry.time):.6g}"
    values, changes = (
        {name: np.asarray(grid.to_fields(getattr(state, name))) for name in model.evolves}
        for state in (carry.coefficients, rates)
    )
    of_changes = {f"rate of change of the {name}": field for name, field in changes.items()}
    for what, field in (values | of_changes).items():
        if not np.isfinite(field).all():
            index = [int(i) for i in np.argwhere(~np.isfinite(field))[0][-grid.dimensions :]]
            return f"the {what} is not finite at x = {_place(grid, index)}, {when}"
    worst: list[tuple[float, str]] = []
    sizes = {name: _root_mean_square(field) for name, field in values.items()}
    # a moment that is nothing but round-off changes fast without meaning
    negligible = 1e-9 * max(*sizes.values(), 1e-290)
    for name, rate in changes.items():
        fastest = np.unravel_index(int(np.argmax(np.abs(rate))), rate.shape)
        size = sizes[name]
        place = _place(grid, [int(i) for i in fastest[-grid.dimensions :]])
        sentence = f"the {name}, of rms {size:.3g}, changes by {float(rate[fastest]):.3g}"
        relative = float(np.abs(rate[fastest])) / (size + negligible)
        worst.append((relative, f"{sentence} per unit time at x = {place}"))
    return f"the step size collapsed at {when}; {max(worst)[1]}"


def _squared(evolved: bool) -> str:
    """Return what must not exceed the variance."""
    return "|C|²/R_cc" if evolved else "|C|²"


class RealizabilityWatch:
    """Looks for |C|² > V in outputs that come in parts.

    Parameters
    ----------
    grid : Grid
        Of the fields.
    closed_covariance : bool
        Whether the covariance is an algebraic expression.
    evolved_temperature : bool
        Whether R_ij has an equation of its own.
    """

    def __init__(
        self, grid: Grid, *, closed_covariance: bool = False, evolved_temperature: bool = False
    ) -> None:
        self._grid = grid
        self._squared = _squared(evolved_temperature)
        if closed_covariance:
            self._reason = "The algebraic covariance does not know this bound."
        elif evolved_temperature:
            self._reason = "The closed fluxes of C, V and R_ij do not know this bound."
        else:
            self._reason = "Theta is held fixed while the field feeds C."
        self._lowest: list[tuple[float, float]] = []
        self._worst: tuple[float, float, str] = (np.inf, 0.0, "")
        self._last = np.zeros(0)
        self._scale = 1e-300

    def add(self, times: np.ndarray, fields: Mapping[str, np.ndarray]) -> None:
        """Look at the next outputs.

        Parameters
        ----------
        times : np.ndarray
            Their times.
        fields : Mapping
            With ``covariance[time, component, x…]`` and, if the model has them, ``variance[time,
            x…]`` and the components of the granular temperature.
        """
        if "variance" not in fields:
            return
        margin = margin_of(fields, self._grid.dimensions)
        self._scale = max(self._scale, float(np.max(np.abs(fields["variance"]))))
        # whatever the scale will be, the first breach is lower than all before it
        for time, lowest in zip(times, margin.reshape(len(times), -1).min(axis=1), strict=True):
            if not self._lowest or lowest < self._lowest[-1][1]:
                self._lowest.append((float(time), float(lowest)))
        worst = np.unravel_index(int(np.argmin(margin)), margin.shape)
        if margin[worst] < self._worst[0]:
            place = _place(self._grid, [int(i) for i in worst[1:]])
            self._worst = (float(margin[worst]), float(times[worst[0]]), place)
        self._last = margin[-1]

    def warnings(self) -> list[str]:
        """Return a sentence on where and when, if there is a breach."""
        # The Fourier tail of a variance that vanishes at places is not a breach.
        least = -1e-6 * self._scale
        first = next((time for time, lowest in self._lowest if lowest < least), None)
        if first is None:
            return []
        margin, time, place = self._worst
        return [
            f"not realizable: {self._squared} > V from t = {first:.4g} on (first output "
            "that shows it), "
            f"by up to {-margin:.3g} at t = {time:.4g}, x = {place}; "
            f"{float((self._last < least).mean()):.0%} of the box at the end. {self._reason}"
        ]


def _root_mean_square(values: np.ndarray) -> float:
    """Return the rms, also of what has grown so far that its square overflows."""
    largest = max(float(np.abs(values).max()), 1e-300)
    return largest * float(np.sqrt(np.mean((values / largest) ** 2)))


def _lowest(values: np.ndarray, scale: float) -> tuple[int, ...]:
    """Return the first of equally low places, which must not depend on round-off."""
    lowest = int(np.argmax(values <= values.min() + ROUND_OFF * scale))
    return tuple(int(i) for i in np.unravel_index(lowest, values.shape))


def _place(grid: Grid, index: Sequence[int]) -> str:
    """Return the position of a point for a sentence."""
    return ", ".join(f"{x[i]:.4g}" for x, i in zip(grid.coordinates(), index, strict=True))
