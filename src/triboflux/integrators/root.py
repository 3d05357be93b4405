"""Locating a stop within a step."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Float, Int


class _Bracket(eqx.Module):
    """An interval with the values at its ends; unknown while there are too few evaluations."""

    ends: Float[Array, "2"]
    values: Float[Array, "2"]
    evaluations: Int[Array, ""]

    def candidate(self) -> Float[Array, ""]:
        """Return where the secant through the ends vanishes."""
        (low, high), (at_low, at_high) = self.ends, self.values
        slope = jnp.where(at_high == at_low, 1.0, at_high - at_low)
        return high - at_high * (high - low) / slope


class Illinois(optx.AbstractRootFinder):
    """Regula falsi with the Illinois modification, one evaluation per step.

    The function is expensive to compile where it contains an integrator's dense output; this method
    has a single place where it is evaluated, the ends of the bracket included.

    Attributes
    ----------
    rtol : float
        Stop when a step changes the root by no more than this part of it.
    atol : float
        Or by no more than this.
    norm : Callable
        Not used; part of Optimistix's interface.

    References
    ----------
    Dowell & Jarratt (1971), https://doi.org/10.1007/BF01934364
    """

    rtol: Any
    atol: Any = 1e-300
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
        ends = jnp.stack([options["lower"], options["upper"]])
        return _Bracket(ends, jnp.zeros(2), jnp.asarray(0))

    def step(
        self, fn: Any, y: Any, args: Any, options: dict[str, Any], state: _Bracket, tags: Any
    ) -> tuple[Any, _Bracket, Any]:
        """Evaluate an end of the bracket, or narrow it."""
        count = state.evaluations
        starting = count < 2
        point = jnp.where(starting, state.ends[jnp.minimum(count, 1)], state.candidate())
        results, aux = fn(point, args)
        # Diffrax gives a value per stop rule, all zero but that of the rule that applies.
        value = jnp.sum(jnp.stack(jax.tree.leaves(results)))
        filled = _Bracket(state.ends, state.values.at[jnp.minimum(count, 1)].set(value), count + 1)
        # The end that stays has its value halved, so that it cannot stay for ever.
        stays = jnp.sign(value) == jnp.sign(state.values[1])
        other = jnp.where(stays, state.ends[0], state.ends[1])
        at_other = jnp.where(stays, state.values[0] / 2.0, state.values[1])
        narrowed = _Bracket(jnp.stack([other, point]), jnp.stack([at_other, value]), count + 1)
        bracket = jax.tree.map(lambda a, b: jnp.where(starting, a, b), filled, narrowed)
        return point, bracket, aux

    def terminate(
        self, fn: Any, y: Any, args: Any, options: dict[str, Any], state: _Bracket, tags: Any
    ) -> tuple[Any, optx.RESULTS]:
        """Stop when the last point is a root or the next would hardly differ."""
        last = state.ends[1]
        change = jnp.abs(state.candidate() - last)
        near = (change <= self.atol + self.rtol * jnp.abs(last)) | (state.values[1] == 0.0)
        return (state.evaluations > 2) & near, optx.RESULTS.successful

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
