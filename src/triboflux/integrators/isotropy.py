"""What isotropy leaves of linear operators: parts of equal helicity, coupled by real numbers.

Rotations about a wave vector k = |k| n sort the moments into parts that no isotropic operator
mixes unless they turn alike, by their helicity:

- 0: scalars s; of vectors ``c = i n·C``; of tensors ``n·T n``;
- 1: of vectors what is transverse to n; of tensors the transverse part of ``i T n``;
- 2: of tensors the transverse rest less half of its trace.

The factors i make every coupling real. A tensor here is that of a three-dimensional state, uniform
in the directions that the box has not, so the trace of its transverse rest is T_mm − n·T n with the
trace T_mm over three dimensions, a moment of its own (`triboflux.hierarchy.TRACES`). Terms of both
have to belong together, `triboflux.models.third_order.trace_of`.

At k = 0, where n is taken as zero, vectors count as transverse and tensors as of helicity 2.
"""

from __future__ import annotations

import functools as ft
from collections.abc import Iterable, Mapping
from typing import NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float

from triboflux.grid import Grid
from triboflux.hierarchy import RANKS, TRACES
from triboflux.moments import Moments


class Part(NamedTuple):
    """The part of a moment that has a helicity."""

    moment: str
    helicity: int


Coupling: TypeAlias = tuple[Part, Part]
"""Target and source."""


class Entry(NamedTuple):
    """Where in the blocks a coupling stands."""

    target: Part
    source: Part
    block: int
    row: int
    column: int


class Layout(NamedTuple):
    """How couplings are arranged in square blocks.

    Attributes
    ----------
    size, number : int
        Of the blocks.
    entries : tuple of Entry
        All elements that do not vanish identically in functions of the operator.
    """

    size: int
    number: int
    entries: tuple[Entry, ...]

    def blocks(self, entries: Float[Array, "entry n"]) -> Float[Array, "m m block n"]:
        """Return the blocks, zero where there are no entries."""
        # gathered, which compiles several times faster than stacking single elements
        places = np.full((self.size, self.size, self.number), len(self.entries))
        for i, entry in enumerate(self.entries):
            places[entry.row, entry.column, entry.block] = i
        return jnp.concatenate([entries, jnp.zeros_like(entries[:1])])[places]

    def chosen(self, blocks: Float[Array, "m m t block n"]) -> Float[Array, "t entry n"]:
        """Return the entries of blocks that have an axis more."""
        rows, columns, of = np.array([[e.row, e.column, e.block] for e in self.entries]).T
        return jnp.moveaxis(blocks, 2, 0)[:, rows, columns, of]


def layout_of(evolves: tuple[str, ...], couplings: Iterable[Coupling]) -> Layout:
    """Return the layout of an operator: as few and as small blocks as its couplings allow.

    Parameters
    ----------
    evolves : tuple of str
        The moments of the state.
    couplings : iterable of Coupling
        Where the operator does not vanish.
    """
    parts = [Part(moment, h) for moment in evolves for h in range(RANKS[moment] + 1)]
    reached = {part: {part} for part in parts}
    pairs = list(couplings)
    for _ in parts:
        for target, source in pairs:
            reached[source] |= reached[target]
    together = {part: {part} for part in parts}
    for target, source in pairs:
        joined = together[target] | together[source]
        for part in joined:
            together[part] = joined
    groups = list(dict.fromkeys(tuple(p for p in parts if p in together[q]) for q in parts))
    size = max(map(len, groups))
    blocks: list[list[Part]] = []
    for group in groups:
        fitting = (block for block in blocks if len(block) + len(group) <= size)
        block = next(fitting, None)
        if block is None:
            blocks.append(list(group))
        else:
            block.extend(group)
    places = {part: (b, i) for b, block in enumerate(blocks) for i, part in enumerate(block)}
    entries = tuple(
        Entry(target, source, places[target][0], places[target][1], places[source][1])
        for target in parts
        for source in parts
        if target in reached[source]
    )
    return Layout(size, len(blocks), entries)


def applied(factors: Mapping[Coupling, Array], states: Moments, grid: Grid) -> Moments:
    """Return ``Σ_m A_mc y_m`` for all c; ``None`` moments count as zero.

    Written out as sums over m, which the compiler makes one pass over the modes, and with one
    projection per state instead of one per operator.

    Parameters
    ----------
    factors : mapping of Coupling to Array
        Elements of the operators A_mc, shape ``[m, c, *modes]``.
    states : Moments
        The y_m, stacked along a leading axis.
    grid : Grid
        Whose modes they have.
    """
    targets = dict.fromkeys(target.moment for target, _ in factors)
    given = [name for name in targets if getattr(states, name) is not None]
    sources = _Sources(factors, states, given, grid)
    ways = (sources.to_scalar, sources.to_vector, sources.to_tensor)
    return Moments(**{name: ways[RANKS[name]](name) for name in targets})


class _Sources:
    """The parts of some states, and what operators make of them.

    Vectors that are to count by their transverse part stand here whole: what their longitudinal
    part adds is taken from the factors of the scalars.
    """

    def __init__(
        self, factors: Mapping[Coupling, Array], states: Moments, given: list[str], grid: Grid
    ) -> None:
        self._factors, self._states, self._grid = factors, states, grid
        self._scalars: dict[str, Array] = {}
        self._vectors: dict[str, Array] = {}
        for name in given:
            state, rank = getattr(states, name), RANKS[name]
            if rank == 0:
                self._scalars[name] = state
                continue
            unit = self._unit()
            if rank == 2:
                state = jax.vmap(lambda t: _times_i(_along(unit, t)))(state)  # noqa: B023
                self._scalars[name] = -jax.vmap(lambda y: _longitudinal(unit, y))(state)  # noqa: B023
            else:
                self._scalars[name] = jax.vmap(lambda c: _longitudinal(unit, c))(state)  # noqa: B023
            self._vectors[name] = state

    def to_scalar(self, name: str) -> Array | None:
        """Return a moment of rank 0."""
        return self._scalar(Part(name, 0), {})

    def to_vector(self, name: str) -> Array | None:
        """Return a moment of rank 1."""
        rest, along = self._transverse(Part(name, 1), None)
        turned = self._scalar(Part(name, 0), along)
        if turned is None:
            return rest
        unit = self._unit()
        return _plus(rest, jax.vmap(lambda a: _vector(unit, a))(turned))

    def to_tensor(self, name: str) -> Array | None:
        """Return a moment of rank 2.

        With f the factor of helicity 2, v the change of ``T n`` beyond f and a and b those of
        ``n·T n`` and T_mm it is ``f T + ½ (b − a) δ + ½ (3a − b) n n + n v + v n``, v transverse.
        """
        own = self._factors[Part(name, 2), Part(name, 2)]
        trace, weight = TRACES[name]
        rest = _summed(own, getattr(self._states, name), 3)
        a = self._scalar(Part(name, 0), {name: own})
        b = _times(1.0 / weight, self._scalar(Part(trace, 0), {trace: own}))
        turned, along = self._transverse(Part(name, 1), own)
        # of ``i v`` the longitudinal part counts twice in n v + v n
        beyond = self._weighted({source: 2.0 * factor for source, factor in along.items()})
        unit = self._unit()
        isotropic = _plus(_times(0.5, b), _times(-0.5, a))
        lengthwise = _plus(_plus(_times(-0.5, b), _times(1.5, a)), beyond)
        if isotropic is not None and lengthwise is not None:
            both = jax.vmap(lambda s, p: _axial(unit, s, p))(isotropic, lengthwise)
            rest = _plus(rest, both)
        if turned is not None:
            rest = _plus(rest, jax.vmap(lambda v: _symmetric(unit, v))(turned))
        return rest

    def _unit(self) -> list[Array]:
        return lax.optimization_barrier(_unit(self._grid))

    def _scalar(self, target: Part, less: Mapping[str, Array]) -> Array | None:
        """Return a part of helicity 0, from factors that are reduced for some sources."""
        weights: dict[str, Array] = {}
        for name in self._scalars:
            factor = self._factors.get((target, Part(name, 0)))
            if name in less:
                factor = -less[name] if factor is None else factor - less[name]
            if factor is not None:
                weights[name] = factor
        return self._weighted(weights)

    def _weighted(self, weights: Mapping[str, Array]) -> Array | None:
        total = None
        for name, factor in weights.items():
            total = _plus(total, _summed(factor, self._scalars[name], 1))
        return total

    def _transverse(
        self, target: Part, less: Array | None
    ) -> tuple[Array | None, dict[str, Array]]:
        """Return a part of helicity 1, and the weights of the longitudinal part that it has, too.

        Parameters
        ----------
        target : Part
            What is asked for.
        less : Array or None
            By what the factor of the target's own moment is reduced.
        """
        total, along = None, dict[str, Array]()
        for name, vector in self._vectors.items():
            factor = self._factors.get((target, Part(name, 1)))
            if factor is None:
                continue
            if less is not None and name == target.moment:
                factor = factor - less
            total = _plus(total, _summed(factor, vector, 2))
            # of i T n the longitudinal part is minus n·T n
            along[name] = -factor if RANKS[name] == 2 else factor
        return total, along


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


def _times(factor: float, array: Array | None) -> Array | None:
    return None if array is None else factor * array


def _along(unit: list[Array], tensor: Float[Array, "d d 2 *modes"]) -> Float[Array, "d 2 *modes"]:
    """Return T n."""
    columns = zip(unit, jnp.swapaxes(tensor, 0, 1), strict=True)
    return ft.reduce(lambda a, b: a + b, (u[None, None] * column for u, column in columns))


def _times_i(vector: Float[Array, "d 2 *modes"]) -> Float[Array, "d 2 *modes"]:
    """Return i C."""
    return jnp.stack([-vector[:, 1], vector[:, 0]], axis=1)


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


def _axial(
    unit: list[Array], isotropic: Float[Array, "2 *modes"], along: Float[Array, "2 *modes"]
) -> Float[Array, "d d 2 *modes"]:
    """Return the tensor s δ + p n n."""
    rows = []
    for i, row in enumerate(unit):
        parts = [(row * column)[None] * along for column in unit]
        parts[i] = parts[i] + isotropic
        rows.append(jnp.stack(parts))
    return jnp.stack(rows)


def _symmetric(
    unit: list[Array], turned: Float[Array, "d 2 *modes"]
) -> Float[Array, "d d 2 *modes"]:
    """Return n v + v n from the vector i v."""
    vector = jnp.stack([turned[:, 1], -turned[:, 0]], axis=1)
    product = jnp.stack([u[None, None] * vector for u in unit])
    return product + jnp.swapaxes(product, 0, 1)
