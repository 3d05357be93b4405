"""Linear operators whose functions an exponential integrator can evaluate exactly."""

from __future__ import annotations

import functools as ft
from abc import abstractmethod
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float, Int

from triboflux.grid import Grid
from triboflux.integrators.phi import phi_functions
from triboflux.models.model import Model
from triboflux.moments import Moments


class LinearOperator(eqx.Module):
    """A constant linear operator on a state, closed under analytic functions."""

    @abstractmethod
    def functions(self, order: int, times: Float[Array, " n"]) -> tuple[LinearOperator, ...]:
        """Return φ_0(t A), ..., φ_order(t A) as operators with a leading axis over the times."""

    @abstractmethod
    def apply(self, state: Any) -> Any:
        """Return the operator applied to a state, or to part of one."""

    def apply_all(self, states: Any) -> Any:
        """Return ``Σ_m A_mc y_m`` for all c, of operators with leading axes m and c.

        Parameters
        ----------
        states : pytree
            The y_m, stacked along a leading axis.
        """

        def apply(operator: LinearOperator, state: Any) -> Any:
            return jax.vmap(lambda o: o.apply(state))(operator)

        parts = jax.vmap(apply)(self, states)
        return jax.tree.map(lambda a: jnp.sum(a, axis=0), parts)


class DenseOperator(LinearOperator):
    """A matrix acting on a vector; the reference for small problems and for tests."""

    matrix: Float[Array, "*n m m"]

    def functions(self, order: int, times: Float[Array, " n"]) -> tuple[DenseOperator, ...]:
        """Return φ_0(t A), ..., φ_order(t A)."""
        scaled = self.matrix[:, :, None] * times[None, None]
        return tuple(DenseOperator(jnp.moveaxis(f, -1, 0)) for f in phi_functions(scaled, order))

    def apply(self, state: Float[Array, " m"]) -> Float[Array, " m"]:
        """Return A y."""
        return self.matrix @ state


class BlockOperator(LinearOperator):
    """The linear part of a moment model in Fourier space, small blocks for every wave number.

    Isotropy makes the blocks depend on |k| only. With ``c = i k·C/|k|`` they are real: for a model
    with covariance, one couples the charge and the longitudinal covariance c and one, diagonal,
    holds the transverse covariance and the variance; for a model of scalars each has a 1×1 block.
    They are stored once per distinct |k| until a function of the operator is asked for.

    Attributes
    ----------
    grid : Grid
        Whose modes it acts on.
    vector : bool
        Whether the covariance is evolved.
    blocks : Array
        Shape ``[m, m, block, distinct]``, or ``[m, m, block, *modes]`` once expanded, with leading
        axes for several times and functions.
    index : Array or None
        Which distinct |k| a mode has, shape ``[*modes]``; ``None`` once expanded.
    """

    grid: Grid
    vector: bool = eqx.field(static=True)
    blocks: Float[Array, "..."]
    index: Int[Array, "..."] | None

    def functions(self, order: int, times: Float[Array, " n"]) -> tuple[BlockOperator, ...]:
        """Return φ_0(t A), ..., φ_order(t A), expanded over the modes."""
        scaled = self.blocks[None] * times[:, None, None, None, None]
        functions = phi_functions(jnp.moveaxis(scaled, 0, 2), order)
        return tuple(
            BlockOperator(self.grid, self.vector, self._expand(jnp.moveaxis(f, 2, 0)), None)
            for f in functions
        )

    def apply(self, state: Moments) -> Moments:
        """Return the operator applied to Fourier coefficients; ``None`` moments count as zero."""
        blocks = self._expand(self.blocks)[None, None]
        alone = BlockOperator(self.grid, self.vector, blocks, None)
        results = alone.apply_all(jax.tree.map(lambda y: y[None], state))
        return jax.tree.map(lambda y: y[0], results)

    def apply_all(self, states: Moments) -> Moments:
        """Return ``Σ_m A_mc y_m`` for all c; ``None`` moments count as zero.

        Written out as sums over m, which the compiler makes one pass over the modes, and with one
        projection per state instead of one per operator.
        """
        blocks = self._expand(self.blocks)
        if not self.vector:
            scalars = ((0, states.charge), (1, states.variance))
            charge, variance = (_summed(blocks[:, :, 0, 0, i], x, 1) for i, x in scalars)
            return Moments(charge=charge, variance=variance)
        across = blocks[:, :, 0, 0, 1]
        charge = _summed(blocks[:, :, 0, 0, 0], states.charge, 1)
        turned = _summed(blocks[:, :, 1, 0, 0], states.charge, 1)
        rest = None
        if states.covariance is not None:
            unit = lax.optimization_barrier(_unit(self.grid))
            along = jax.vmap(lambda c: _longitudinal(unit, c))(states.covariance)
            charge = _plus(charge, _summed(blocks[:, :, 0, 1, 0], along, 1))
            turned = _plus(turned, _summed(blocks[:, :, 1, 1, 0] - across, along, 1))
            rest = _summed(across, states.covariance, 2)
        if turned is not None:
            unit = lax.optimization_barrier(_unit(self.grid))
            rest = _plus(rest, jax.vmap(lambda a: _vector(unit, a))(turned))
        return Moments(charge, rest, _summed(blocks[:, :, 1, 1, 1], states.variance, 1))

    def _expand(self, table: Array) -> Array:
        return table if self.index is None else table[..., self.index]


def block_operator(model: Model, grid: Grid) -> BlockOperator:
    """Return the linear part of a model on a grid.

    Parameters
    ----------
    model : Model
        Whose linear terms are taken.
    grid : Grid
        Whose kept modes they act on.

    Raises
    ------
    NotImplementedError
        If a linear term couples the variance with another moment.
    """
    wave_numbers, index = distinct_wave_numbers(grid)
    k = jnp.asarray(wave_numbers)
    vector = "covariance" in model.evolves
    places = _places(vector)
    m = 1 + vector
    blocks = [[[jnp.zeros_like(k) for _ in range(2)] for _ in range(m)] for _ in range(m)]
    for term in model.linear_terms():
        if (term.moment, term.source) not in places:
            raise NotImplementedError(
                f"the linear term '{term.name}' couples {term.source} into {term.moment}"
            )
        row, column, block = places[term.moment, str(term.source)]
        added = term.coefficient * term.operator.symbol(k)
        blocks[row][column][block] = blocks[row][column][block] + added
        if term.moment == term.source == "covariance":
            added = term.coefficient * term.operator.transverse(k)
            blocks[0][0][1] = blocks[0][0][1] + added
    stacked = jnp.stack([jnp.stack([jnp.stack(c) for c in row]) for row in blocks])
    return BlockOperator(grid, vector, stacked, jnp.asarray(index))


def _places(vector: bool) -> dict[tuple[str, str], tuple[int, int, int]]:
    """Return row, column and block of each coupling."""
    if not vector:
        return {("charge", "charge"): (0, 0, 0), ("variance", "variance"): (0, 0, 1)}
    coupled = ("charge", "covariance")
    places = {(a, b): (i, j, 0) for i, a in enumerate(coupled) for j, b in enumerate(coupled)}
    return places | {("variance", "variance"): (1, 1, 1)}


def distinct_wave_numbers(grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    """Return the distinct |k| and which one each mode has.

    Parameters
    ----------
    grid : Grid
        Whose kept modes are meant.
    """
    squared = sum((k**2 for k in grid.wave_vector()), start=np.zeros(grid.modes))
    # Round-off must not split modes of equal |k| that differ by the order of summation.
    rounded = np.round(squared / max(squared.max(), 1e-300), 12)
    distinct, index = np.unique(rounded, return_inverse=True)
    values = np.zeros(len(distinct))
    values[index.ravel()] = squared.ravel()
    return np.sqrt(values), index.reshape(grid.modes)


def _unit(grid: Grid) -> list[Array]:
    """Return k/|k| per axis, zero at k = 0."""
    squared = grid.wave_number_squared()
    inverse = jnp.where(squared > 0.0, 1.0 / jnp.sqrt(jnp.where(squared > 0.0, squared, 1.0)), 0.0)
    return [jnp.asarray(k) * inverse for k in grid.wave_vector()]


def _summed(factors: Array, states: Array | None, axes: int) -> Array | None:
    """Return Σ_m f_mc y_m, where the y_m have so many axes more before those of the modes."""
    if states is None:
        return None
    wide = factors.reshape((*factors.shape[:2], *(1,) * axes, *factors.shape[2:]))
    products = (f * y[None] for f, y in zip(wide, states, strict=True))
    return ft.reduce(lambda a, b: a + b, products)


def _plus(left: Array | None, right: Array | None) -> Array | None:
    if left is None or right is None:
        return right if left is None else left
    return left + right


def _longitudinal(
    unit: list[Array], vector: Float[Array, "d 2 *modes"]
) -> Float[Array, "2 *modes"]:
    """Return c = i k·C/|k|; zero at k = 0."""
    pairs = zip(unit, vector, strict=True)
    along = sum((u[None] * f for u, f in pairs), start=jnp.zeros_like(vector[0]))
    return jnp.stack([-along[1], along[0]])


def _vector(unit: list[Array], along: Float[Array, "2 *modes"]) -> Float[Array, "d 2 *modes"]:
    """Return the longitudinal vector -i (k/|k|) c."""
    turned = jnp.stack([along[1], -along[0]])
    return jnp.stack([u[None] * turned for u in unit])
