"""An adaptive exponential Runge-Kutta method for stiff semilinear problems, as a Diffrax solver."""

from __future__ import annotations

import functools as ft
import math
from collections.abc import Callable
from typing import Any, ClassVar

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from diffrax import RESULTS
from jax import lax
from jaxtyping import Array, Float, PyTree

from triboflux.integrators.linear import LinearOperator

DEGREE = 3
# Lobatto's interior nodes and the end: the cubic through 0 and these integrates degree five
# exactly.
NODES = ((5.0 - math.sqrt(5.0)) / 10.0, (5.0 + math.sqrt(5.0)) / 10.0, 1.0)
# Through which of the nodes, besides 0, a level interpolates: lines, parabolas, cubics.
LEVELS = ((0,), (0, 2), (0, 1, 2), (0, 1, 2))
# Parts of the error estimate: the error is taken as e²/(ITERATION d) or STIFF_QUADRATURE d²/f.
ITERATION, STIFF_QUADRATURE = 3.0, 0.03


class SemilinearTerm(diffrax.AbstractTerm):
    """The right-hand side ``A y + N_1(y) + ... + N_g(y)``.

    Attributes
    ----------
    linear : LinearOperator
        A, taken exactly.
    nonlinear : tuple of Callable
        The N_i, functions of the state; a level of stages updates them in this order, each with the
        newest values of those before it. A result may leave out vanishing moments as ``None``.
    together : bool
        Whether a part is evaluated for all nodes of a level together; one after the other they need
        less memory, and less time where that of all is more than fits in the cache.
    """

    linear: LinearOperator
    nonlinear: tuple[Callable[[Any], Any], ...]
    together: bool = eqx.field(static=True, default=True)

    def at_nodes(self, part: Callable[[Any], Any], states: PyTree) -> PyTree:
        """Return one of the N_i of stacked states, stacked."""
        return jax.vmap(part)(states) if self.together else lax.map(part, states)

    def vf(self, t: Any, y: PyTree, args: PyTree) -> PyTree:
        """Return the whole right-hand side."""
        return ft.reduce(lambda a, b: a + b, (n(y) for n in self.nonlinear), self.linear.apply(y))

    def contr(self, t0: Any, t1: Any, **kwargs: Any) -> Any:
        """Return the time increment."""
        return t1 - t0

    def prod(self, vf: PyTree, control: Any) -> PyTree:
        """Return the right-hand side times a time increment."""
        return jax.tree.map(lambda v: v * control, vf)


class _Functions(eqx.Module):
    """φ_0(chA), leading axis c; h m! c**(m+1) φ_(m+1)(chA), leading axes m = 0..DEGREE and c.

    The latter are the integrals of ``exp((ch - s) A) (s/h)**m`` over s from 0 to ch.
    """

    zeroth: LinearOperator
    higher: LinearOperator

    @staticmethod
    @eqx.filter_jit
    def make(linear: LinearOperator, step: Array, nodes: Float[Array, " n"]) -> _Functions:
        zeroth, *others = linear.functions(DEGREE + 1, step * nodes)
        weights = [step * math.factorial(m) * nodes ** (m + 1) for m in range(DEGREE + 1)]

        def stack(*functions: Array) -> Array:
            scaled = (
                f * w.reshape((-1,) + (1,) * (f.ndim - 1))
                for f, w in zip(functions, weights, strict=True)
            )
            return jnp.stack(list(scaled))

        return _Functions(zeroth, jax.tree.map(stack, *others))

    def homogeneous(self, y0: PyTree) -> PyTree:
        """Return the states at all nodes without the nonlinear part, stacked."""
        first = jax.tree.map(lambda a: a[None], (self.zeroth, y0))
        return first[0].apply_all(first[1])

    def response(self, polynomials: Any, at: slice = slice(None)) -> PyTree:
        """Return what polynomials through the nonlinear parts add to the states at the nodes."""
        chosen = jax.tree.map(lambda a: a[:, at], self.higher)
        return chosen.apply_all(ft.reduce(lambda a, b: a + b, polynomials))


class ExponentialInterpolation(diffrax.AbstractLocalInterpolation):
    """Dense output ``φ_0(θhA) y + Σ_m h m! θ**(m+1) φ_(m+1)(θhA) p_m``.

    It is the integrator's own formula with the cubic of the last level, exact in the linear part
    and of uniform order four in stiff problems.
    """

    t0: Any
    t1: Any
    y0: PyTree
    polynomials: tuple[PyTree, ...]
    linear: LinearOperator

    def evaluate(self, t0: Any, t1: Any | None = None, left: bool = True) -> PyTree:
        """Return the state at `t0`, or its increment from `t0` to `t1`."""
        if t1 is not None:
            start, stop = self.evaluate(t0), self.evaluate(t1)
            return jax.tree.map(lambda a, b: b - a, start, stop)
        return _evaluate(self, t0)


@eqx.filter_jit
def _evaluate(interpolation: ExponentialInterpolation, time: Array) -> PyTree:
    step = interpolation.t1 - interpolation.t0
    fraction = (time - interpolation.t0) / step
    functions = _Functions.make(interpolation.linear, step, fraction[None])
    homogeneous = functions.homogeneous(interpolation.y0)
    return _first(_states(functions, homogeneous, interpolation.polynomials))


class _Cache(eqx.Module):
    """Functions of the operator at the nodes, and the step they were made for."""

    step: Float[Array, ""]
    functions: _Functions


class ExponentialRungeKutta5(diffrax.AbstractAdaptiveSolver):
    """Explicit exponential Runge-Kutta method of order five with an embedded error estimate.

    The variation-of-constants formula is applied to polynomials in time through the nonlinear part.
    Their degree grows over the four levels of stages in ``LEVELS``, all at Lobatto's nodes; each
    level gains one order and satisfies the stiff order conditions of its degree by construction.
    The step has stiff order four, and five with the last condition in its weakened form (Hochbruck
    & Ostermann 2005). Within a level the parts of the nonlinearity are updated one after another;
    without that a moment slaved to a moving product gains only half an order per level.

    The error estimate extrapolates the differences that the last levels make, moment by moment: e
    the last, d the one before, f the one before that. The levels contract the error of the
    iteration, which leaves about e²/d; the growing degree contracts that of the interpolation,
    which leaves about d³/f², also where nothing is iterated because a moment drives no other. Both
    scale with the sixth power of the step. A moment that decays within the step loses an order of
    the quadrature and keeps a part of d²/f. The largest of the three is returned, the constants
    being measured.

    The functions of the operator are kept in the solver's state and made anew only when the step
    changes by more than the round-off of the time.

    References
    ----------
    Hochbruck & Ostermann (2005), https://doi.org/10.1137/040611434;
    Luan & Ostermann (2014), https://doi.org/10.1016/j.cam.2013.04.005
    """

    term_structure: ClassVar = diffrax.AbstractTerm
    interpolation_cls: ClassVar = ExponentialInterpolation

    def order(self, terms: PyTree) -> int:
        """Return 5."""
        return 5

    def error_order(self, terms: PyTree) -> int:
        """Return the power of the step that the error estimate scales with, 6."""
        return 6

    def init(self, terms: Any, t0: Any, t1: Any, y0: PyTree, args: PyTree) -> _Cache:
        """Return the functions for the first step."""
        return _make_cache(_inner(terms).linear, jnp.asarray(t1 - t0))

    def func(self, terms: Any, t0: Any, y0: PyTree, args: PyTree) -> PyTree:
        """Return the right-hand side."""
        return terms.vf(t0, y0, args)

    def step(
        self,
        terms: Any,
        t0: Any,
        t1: Any,
        y0: PyTree,
        args: PyTree,
        solver_state: _Cache,
        made_jump: Any,
    ) -> tuple[PyTree, PyTree, dict[str, PyTree], _Cache, RESULTS]:
        """Make one step; see `diffrax.AbstractSolver.step`."""
        term = _inner(terms)
        step = t1 - t0
        round_off = 8.0 * jnp.finfo(step.dtype).eps * jnp.abs(t1)
        cache = lax.cond(
            jnp.abs(step - solver_state.step) <= round_off,
            lambda: solver_state,
            lambda: _make_cache(term.linear, step),
        )
        y1, error, polynomials = _advance(term, y0, cache.functions)
        dense_info = {"y0": y0, "polynomials": polynomials, "linear": term.linear}
        return y1, error, dense_info, cache, RESULTS.successful


@eqx.filter_jit
def _advance(
    term: SemilinearTerm, y0: PyTree, functions: _Functions
) -> tuple[PyTree, PyTree, tuple[PyTree, ...]]:
    """Return the state after a step, its error estimate and the last level's polynomials."""
    homogeneous = functions.homogeneous(y0)
    start = [part(y0) for part in term.nonlinear]
    constants = tuple(jax.tree.map(_constant, n0) for n0 in start)

    def level(carry: tuple[Any, ...], basis: Array) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        newest = list(carry)
        for i, part in enumerate(term.nonlinear):
            values = term.at_nodes(part, _states(functions, homogeneous, newest))
            newest[i] = jax.tree.map(ft.partial(_coefficients, basis), start[i], values)
        return tuple(newest), tuple(newest)

    bases = jnp.asarray(np.stack([_monomial_basis(chosen) for chosen in LEVELS]))
    polynomials, history = lax.scan(level, constants, bases)

    end = slice(len(NODES) - 1, None)
    states = jax.tree.map(lambda a: a[end], homogeneous)
    y1 = _first(_states(functions, states, polynomials, end))
    zero = jax.tree.map(jnp.zeros_like, states)

    def difference(newer: int) -> PyTree:
        made = jax.tree.map(lambda a: a[newer] - a[newer - 1], history)
        return _first(_states(functions, zero, made, end))

    error = lax.stop_gradient(jax.tree.map(_estimate, *map(difference, (-1, -2, -3))))
    return y1, error, polynomials


def _states(
    functions: _Functions, homogeneous: PyTree, polynomials: Any, at: slice = slice(None)
) -> PyTree:
    """Return the states at the nodes, stacked."""
    return homogeneous + functions.response(polynomials, at) if polynomials else homogeneous


def _inner(terms: Any) -> SemilinearTerm:
    """Return our own term from inside the one that Diffrax wraps around it."""
    return getattr(terms, "term", terms)


def _make_cache(linear: LinearOperator, step: Array) -> _Cache:
    return _Cache(step, _Functions.make(linear, step, jnp.asarray(NODES)))


def _monomial_basis(chosen: tuple[int, ...]) -> np.ndarray:
    """Return the matrix from values at 0 and all nodes to DEGREE + 1 monomial coefficients.

    Columns of nodes that are not chosen and rows of powers that are not reached vanish.
    """
    nodes = [0.0, *(NODES[i] for i in chosen)]
    basis = np.zeros((DEGREE + 1, len(NODES) + 1))
    columns = [0, *(1 + i for i in chosen)]
    basis[: len(nodes), columns] = np.linalg.inv(np.vander(nodes, increasing=True))
    return basis


def _constant(n0: Array) -> Array:
    return jnp.zeros((DEGREE + 1, *n0.shape), n0.dtype).at[0].set(n0)


def _coefficients(basis: Array, n0: Array, values: Array) -> Array:
    # Sums written out become one pass over the modes; a product with so small a matrix does not.
    columns = [basis[:, i].reshape((-1,) + (1,) * n0.ndim) for i in range(basis.shape[1])]
    terms = (c * v[None] for c, v in zip(columns, [n0, *values], strict=True))
    return ft.reduce(lambda a, b: a + b, terms)


def _first(stacked: PyTree) -> PyTree:
    return jax.tree.map(lambda a: a[0], stacked)


def _estimate(last: Array, before: Array, earlier: Array) -> Array:
    """Return the error of a step from the differences that its last three levels make."""
    e, d, f = (jnp.sqrt(jnp.sum(x**2)) for x in (last, before, earlier))
    iteration = e / jnp.sqrt(jnp.maximum(e**2 + (ITERATION * d) ** 2, 1e-300))
    smooth = d**2 / jnp.maximum(d**2 + f**2, 1e-300)
    stiff = STIFF_QUADRATURE * d / jnp.maximum(d + f, 1e-300)
    quadrature = jnp.maximum(smooth, stiff)
    return jnp.where(iteration * e >= quadrature * d, iteration * last, quadrature * before)
