"""Linear operators whose functions an exponential integrator can evaluate exactly."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from triboflux.grid import Grid
from triboflux.hierarchy import RANKS
from triboflux.integrators import isotropy
from triboflux.integrators.isotropy import Coupling, Layout, Part, layout_of
from triboflux.integrators.phi import phi_functions
from triboflux.models.model import Model
from triboflux.models.terms import Term
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

    Isotropy makes the blocks depend on |k| only, and couples parts of equal helicity about k only
    (`triboflux.integrators.isotropy`); which of them are coupled is read from the terms. They are
    stored once per distinct |k| until a function of the operator is asked for.

    Attributes
    ----------
    grid : Grid
        Whose modes it acts on.
    layout : Layout
        Which entry of which block an element of `entries` is.
    entries : Array
        Shape ``[entry, distinct]``, or ``[entry, *modes]`` once expanded, with leading axes for
        several times and functions.
    index : Array or None
        Which distinct |k| a mode has, shape ``[*modes]``; ``None`` once expanded.
    """

    grid: Grid
    layout: Layout = eqx.field(static=True)
    entries: Float[Array, "..."]
    index: Int[Array, "..."] | None

    def functions(self, order: int, times: Float[Array, " n"]) -> tuple[BlockOperator, ...]:
        """Return φ_0(t A), ..., φ_order(t A), expanded over the modes."""
        scaled = self.layout.blocks(self.entries)[None] * times[:, None, None, None, None]
        functions = phi_functions(jnp.moveaxis(scaled, 0, 2), order)
        return tuple(
            BlockOperator(self.grid, self.layout, self._expand(self.layout.chosen(f)), None)
            for f in functions
        )

    def apply(self, state: Moments) -> Moments:
        """Return the operator applied to Fourier coefficients; ``None`` moments count as zero."""
        entries = self._expand(self.entries)[None, None]
        alone = BlockOperator(self.grid, self.layout, entries, None)
        results = alone.apply_all(jax.tree.map(lambda y: y[None], state))
        return jax.tree.map(lambda y: y[0], results)

    def apply_all(self, states: Moments) -> Moments:
        """Return ``Σ_m A_mc y_m`` for all c; ``None`` moments count as zero."""
        entries = self._expand(self.entries)
        factors = {
            (entry.target, entry.source): entries[:, :, i]
            for i, entry in enumerate(self.layout.entries)
        }
        return isotropy.applied(factors, states, self.grid)

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
    """
    wave_numbers, index = distinct_wave_numbers(grid)
    k = jnp.asarray(wave_numbers)
    sums: dict[Coupling, Array] = {}
    for term in model.linear_terms():
        for coupling in _couplings(term):
            added = term.coefficient * term.operator.symbols[coupling[0].helicity](k)
            # from zero, as numbers that are not arrays yet have no shape
            sums[coupling] = sums.get(coupling, jnp.zeros_like(k)) + added
    layout = layout_of(model.evolves, sums)
    zero = jnp.zeros_like(k)
    entries = [sums.get((entry.target, entry.source), zero) for entry in layout.entries]
    return BlockOperator(grid, layout, jnp.stack(entries), jnp.asarray(index))


def _couplings(term: Term) -> list[Coupling]:
    """Return target and source of what a linear term couples."""
    source = str(term.source)
    least = min(RANKS[term.moment], RANKS[source])
    return [(Part(term.moment, h), Part(source, h)) for h in range(least + 1)]


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
