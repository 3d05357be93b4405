"""Locating a stop within a step."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Float


class _Bracket(eqx.Module):
    low: Float[Array, ""]
    at_low: Float[Array, ""]
    high: Float[Array, ""]
    at_high: Float[Array, ""]
    evaluations: Any


class Illinois(optx.AbstractRootFinder):
    """Regula falsi with the Illinois modification, one evaluation per step.

    The function is expensive to compile where it contains an integrator's dense output; this method
    has a single place where it is evaluated, the ends of the bracket included.

    Attributes
    ----------
    rtol, atol : float
        The bracket's width, relative to its upper end and absolute, at which to stop.
    norm : Callable
        Not used; part of Optimistix's interface.

    References
    ----------
    Dowell & Jarratt (1971), https://doi.org/10.1007/BF01934364
    """

    rtol: float
    atol: float
    norm: Callable[[Any], Any] = optx.max_norm

    def init(
        self,
        fn: Any,
        y: Any,
        args: Any,
        options: dict[str, Any],
        f_struct: Any,
        aux_struct: Any,
        tags: Any,
    ) -> _Bracket:
        """Return the bracket ``options["lower"], options["upper"]``, not yet evaluated."""
        unknown = jnp.asarray(0.0)
        return _Bracket(options["lower"], unknown, options["upper"], unknown, jnp.asarray(0))

    def step(
        self, fn: Any, y: Any, args: Any, options: dict[str, Any], state: _Bracket, tags: Any
    ) -> tuple[Any, _Bracket, Any]:
        """Evaluate an end of the bracket, or narrow it."""
        point = jnp.where(state.evaluations == 0, state.low, self._candidate(state))
        point = jnp.where(state.evaluations == 1, state.high, point)
        values, aux = fn(point, args)
        # Diffrax gives a value per stop rule, all zero but that of the rule that applies.
        value = jnp.sum(jnp.stack(jax.tree.leaves(values)))
        same = jnp.sign(value) == jnp.sign(state.at_high)
        low, at_low = state.low, jnp.where(state.evaluations == 0, value, state.at_low)
        # The end that stays has its value halved, so that it cannot stay for ever.
        crossed = _Bracket(state.high, state.at_high, point, value, state.evaluations + 1)
        kept = _Bracket(low, at_low / 2.0, point, value, state.evaluations + 1)
        first = _Bracket(low, at_low, state.high, state.at_high, state.evaluations + 1)
        second = _Bracket(low, at_low, state.high, value, state.evaluations + 1)

        def choose(f: Array, s: Array, c: Array, k: Array) -> Array:
            narrowed = jnp.where(same, k, c)
            return jnp.where(
                state.evaluations == 0, f, jnp.where(state.evaluations == 1, s, narrowed)
            )

        bracket = _Bracket(
            *(
                choose(*values)
                for values in zip(
                    *(vars(b).values() for b in (first, second, crossed, kept)), strict=True
                )
            )
        )
        return point, bracket, aux

    def terminate(
        self, fn: Any, y: Any, args: Any, options: dict[str, Any], state: _Bracket, tags: Any
    ) -> tuple[Any, optx.RESULTS]:
        """Stop when the last point is a root or the bracket is narrow enough."""
        width = jnp.abs(self._candidate(state) - state.high)
        narrow = width <= self.atol + self.rtol * jnp.abs(state.high)
        done = (state.evaluations > 1) & (narrow | (state.at_high == 0.0))
        return done, optx.RESULTS.successful

    def postprocess(
        self,
        fn: Any,
        y: Any,
        aux: Any,
        args: Any,
        options: dict[str, Any],
        state: _Bracket,
        tags: Any,
        result: optx.RESULTS,
    ) -> tuple[Any, Any, dict[str, Any]]:
        """Return the last point."""
        return y, aux, {}

    def _candidate(self, state: _Bracket) -> Array:
        """Return where the secant through the ends vanishes."""
        slope = state.at_high - state.at_low
        safe = jnp.where(slope == 0.0, 1.0, slope)
        return state.high - state.at_high * (state.high - state.low) / safe
