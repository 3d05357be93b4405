"""Step-size control on a ladder of steps."""

from __future__ import annotations

from typing import Any

import diffrax
import jax
import jax.numpy as jnp
from diffrax import RESULTS
from jax import lax
from jaxtyping import Array, Float, PyTree

LADDER = 2.0**0.5
SAFETY = 0.9
MOST_GROWTH = 10.0
MOST_SHRINKING = 0.1


def moment_norm(leaf: Array) -> Float[Array, ""]:
    """Return the Euclidean norm of the Fourier coefficients, between rms/√2 and the rms."""
    return jnp.sqrt(jnp.sum(leaf**2))


class LadderController(diffrax.AbstractAdaptiveStepSizeController):
    """Accept steps by the relative error of each moment and keep them on a ladder of powers of √2.

    A step is accepted if ``|error| <= atol + rtol max(|y0|, |y1|)`` for every leaf of the state,
    each in its Euclidean norm. Proposed steps are rounded down to a power of √2, so that an
    exponential integrator seldom has to make its functions anew, and a step that was accepted is
    never shortened; one to a state that is not finite is always rejected. Its state is the
    unclipped length of the next step, from which a run can be continued.

    Attributes
    ----------
    rtol, atol : Scalar
        Relative and absolute tolerance; the latter in the units of each leaf.
    norm : Callable
        Of one leaf.
    """

    rtol: Any
    atol: Any
    norm: Any = moment_norm

    def wrap(self, direction: Any) -> LadderController:
        """Return the controller itself; time runs forwards."""
        return self

    def init(
        self,
        terms: Any,
        t0: Any,
        t1: Any,
        y0: PyTree,
        dt0: Any,
        args: PyTree,
        func: Any,
        error_order: Any,
    ) -> tuple[Any, Any]:
        """Return the end of the first step and the state, from `dt0` or a part of |y|/|dy/dt|."""
        if dt0 is None:
            rates = jax.tree.leaves(func(terms, t0, y0, args))
            size = jnp.sqrt(sum(self.norm(leaf) ** 2 for leaf in jax.tree.leaves(y0)))
            rate = jnp.sqrt(sum(self.norm(leaf) ** 2 for leaf in rates))
            dt0 = 0.01 * (size + self.atol) / jnp.maximum(rate, 1e-300)
        step = lax.stop_gradient(_on_ladder(jnp.minimum(dt0, t1 - t0)))
        return t0 + step, step

    def adapt_step_size(
        self,
        t0: Any,
        t1: Any,
        y0: PyTree,
        y1_candidate: PyTree,
        args: PyTree,
        y_error: PyTree,
        error_order: Any,
        controller_state: Any,
    ) -> tuple[Any, Any, Any, Any, Any, RESULTS]:
        """Accept or reject a step and propose the next; see the base class."""

        def ratio(start: Array, stop: Array, error: Array) -> Array:
            size = self.norm(stop)
            scale = self.atol + self.rtol * jnp.maximum(self.norm(start), size)
            # Beside a state that has overflowed every error is small.
            return jnp.where(jnp.isfinite(size), self.norm(error) / scale, jnp.inf)

        ratios = jax.tree.leaves(jax.tree.map(ratio, y0, y1_candidate, y_error))
        worst = lax.stop_gradient(jnp.max(jnp.stack(ratios)))
        keep = worst <= 1.0
        factor = SAFETY * jnp.maximum(worst, 1e-30) ** (-1.0 / error_order)
        lowest = jnp.where(keep, 1.0, MOST_SHRINKING)
        factor = jnp.clip(factor, lowest, jnp.where(keep, MOST_GROWTH, SAFETY))
        factor = jnp.where(jnp.isfinite(worst), factor, MOST_SHRINKING)
        # A step that was clipped to the end of the run says nothing against the one on the ladder.
        made = jnp.where(keep, jnp.maximum(t1 - t0, controller_state), t1 - t0)
        step = _on_ladder(lax.stop_gradient(made) * factor)
        start = jnp.where(keep, t1, t0)
        # Below a few units in the last place of the time, rounding decides how long a step is; and
        # a step that is no number, from data that are none, will never be one.
        collapsed = ~(step > 4.0 * jnp.finfo(step.dtype).eps * jnp.abs(start))
        result = RESULTS.where(collapsed, RESULTS.dt_min_reached, RESULTS.successful)
        return keep, start, start + step, False, step, result


def _on_ladder(step: Array) -> Array:
    return LADDER ** jnp.floor(jnp.log(step) / jnp.log(LADDER) + 1e-9)
