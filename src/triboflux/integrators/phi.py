"""The phi functions of exponential integrators, for many small matrices at once."""

from __future__ import annotations

import functools as ft
import math

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float

MAX_DOUBLINGS = 60
TAYLOR_DEGREE = 12


def phi_functions(matrices: Float[Array, "m m *batch"], order: int) -> tuple[Array, ...]:
    """Return φ_0(A), ..., φ_order(A) by scaling, Taylor series and doubling.

    ``φ_0(z) = exp(z)`` and ``φ_j(z) = ∫₀¹ exp((1-s) z) s**(j-1)/(j-1)! ds``. Every matrix is halved
    until its norm is at most 1/2 and doubled back. With E = exp(z) - 1,

        E(2z) = E² + 2 E,   2**j φ_j(2z) = E φ_j + 2 φ_j + sum_{0<i<j} φ_i/(j-i)!.

    Carrying E instead of exp(z) keeps the relative accuracy of the slow modes of a stiff block
    through many doublings, and damps the errors of its fast ones. No eigenvalues are taken, so
    coinciding and complex ones need no special case.

    Parameters
    ----------
    matrices : Array
        Blocks along the two leading axes, shape ``[m, m, *batch]``.
    order : int
        Highest function, at least 1.

    Returns
    -------
    tuple of Array
        ``order + 1`` arrays of the shape of `matrices`.

    References
    ----------
    Skaflestad & Wright (2009), https://doi.org/10.1016/j.apnum.2008.03.008
    """
    norm = lax.stop_gradient(jnp.max(jnp.sum(jnp.abs(matrices), axis=1), axis=0))
    doublings = jnp.ceil(jnp.log2(jnp.maximum(norm, 0.25))) + 1.0
    doublings = jnp.clip(doublings, 0.0, MAX_DOUBLINGS)
    z = matrices * 2.0 ** (-doublings)[None, None]
    functions = _taylor(z, order)
    carried = jnp.concatenate([_multiply(z, functions[0])[None], functions])
    most = jnp.max(doublings)

    def double(carry: tuple[Array, Array]) -> tuple[Array, Array]:
        current, count = carry
        active = (count < doublings)[None, None, None]
        return jnp.where(active, _doubled(current), current), count + 1.0

    def body(carry: tuple[Array, Array], _: None) -> tuple[tuple[Array, Array], None]:
        return lax.cond(carry[1] < most, double, lambda c: c, carry), None

    (carried, _), _ = lax.scan(body, (carried, jnp.zeros(())), None, length=MAX_DOUBLINGS)
    return (_identity(matrices) + carried[0], *carried[1:])


def _taylor(z: Array, order: int) -> Array:
    """Return φ_1..φ_order of small matrices, stacked."""
    identity = _identity(z)

    def horner(value: Array, coefficient: Array) -> tuple[Array, Array]:
        value = coefficient * identity + _multiply(z, value)
        return value, value

    # One recursion serves both: the series of φ_order, then φ_(j-1) = 1/(j-1)! + z φ_j.
    inverse = [1.0 / math.factorial(n) for n in range(TAYLOR_DEGREE + order, 0, -1)]
    _, values = lax.scan(horner, jnp.zeros_like(z), jnp.asarray(inverse))
    return values[: -order - 1 : -1]


def _doubled(carried: Array) -> Array:
    """Return E, φ_1, ..., φ_order of 2z from those of z."""
    growth = carried[0]
    results = [_multiply(growth, growth) + 2.0 * growth]
    for j in range(1, len(carried)):
        total = _multiply(growth, carried[j]) + 2.0 * carried[j]
        for i in range(1, j):
            total = total + carried[i] / math.factorial(j - i)
        results.append(total / 2.0**j)
    return jnp.stack(results)


def _multiply(left: Array, right: Array) -> Array:
    """Return the matrix product over the two leading axes; the blocks are small.

    Written out, because the compiler makes a sum over an axis a pass of its own over the batch.
    """
    terms = (left[:, i, None] * right[None, i] for i in range(len(right)))
    return ft.reduce(lambda a, b: a + b, terms)


def _identity(like: Array) -> Array:
    m = like.shape[0]
    return jnp.eye(m).reshape((m, m) + (1,) * (like.ndim - 2)) * jnp.ones_like(like)
