"""On how many points a run works: as many as its spectrum needs, and no more than its case has."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from triboflux.grid import Grid
from triboflux.integrators.controller import moment_norm
from triboflux.moments import Moments

# Below these many points per axis a step costs no less, by dimensions of the box.
COARSEST = {1: 48, 2: 32, 3: 32}
# A grid between the coarsest and the case's has to have fewer points than this part of the latter's
# per axis: every grid that a run works on is a program to compile.
WORTHWHILE = 0.7
# Which part of the modes along each axis counts as the end of the spectrum.
SPECTRUM_END = 0.1


def ladder(grid: Grid) -> tuple[Grid, ...]:
    """Return grids on which a run can work, from the coarsest to the given one.

    Parameters
    ----------
    grid : Grid
        On which the result is wanted.
    """
    rungs: list[Grid] = []
    coarsest, finest = COARSEST[grid.dimensions], max(grid.points)
    while coarsest <= WORTHWHILE * finest:
        rungs.append(Grid(tuple(min(coarsest, n) for n in grid.points), grid.lengths))
        coarsest *= 2
    return (*rungs, grid)


def unresolved(
    state: Moments, grid: Grid, rtol: float | Array, atol: float | Array
) -> Bool[Array, ""]:
    """Return whether a grid is too coarse for a state: whether its spectrum has not decayed.

    It has if, for each moment, the last tenth of the kept modes along each axis, and all beyond,
    hold no more than what a time step may err, ``atol + rtol`` times the moment, in the norm of the
    step control.

    Parameters
    ----------
    state : Moments
        Fourier coefficients on this grid or a finer one.
    grid : Grid
        The grid in question.
    rtol, atol : Scalar
        Tolerances of a time step.
    """

    def decayed(leaf: Array) -> Bool[Array, ""]:
        allowed = atol + rtol * moment_norm(leaf)
        return moment_norm(leaf * _end_of_spectrum(leaf, grid)) <= allowed

    # written so that a state that is not finite counts as unresolved
    return ~jnp.all(jnp.stack([decayed(leaf) for leaf in jax.tree.leaves(state)]))


def coarsest_for(state: Moments, grids: tuple[Grid, ...], rtol: float, atol: float) -> Grid:
    """Return the coarsest of some grids that resolves a state, and the last if none does.

    Parameters
    ----------
    state : Moments
        Fourier coefficients on the last of the grids.
    grids : tuple of Grid
        From `ladder`.
    rtol, atol : float
        Tolerances of a time step.
    """
    if len(grids) == 1:
        return grids[0]
    too_coarse = np.asarray(_unresolved(state, grids[:-1], jnp.asarray(rtol), jnp.asarray(atol)))
    return next((g for g, bad in zip(grids, too_coarse, strict=False) if not bad), grids[-1])


@eqx.filter_jit
def _unresolved(
    state: Moments, grids: tuple[Grid, ...], rtol: Array, atol: Array
) -> Bool[Array, " grids"]:
    return jnp.stack([unresolved(state, grid, rtol, atol) for grid in grids])


def resized(state: Moments, grid: Grid, to: Grid) -> Moments:
    """Return the Fourier coefficients of a state as those of another grid of the same box.

    Parameters
    ----------
    state : Moments
        Coefficients on `grid`, with any leading axes.
    grid, to : Grid
        Modes that only `to` keeps become zero, and modes that it does not keep are dropped.
    """
    return jax.tree.map(lambda leaf: grid.resized(leaf, to), state)


def _end_of_spectrum(leaf: Array, grid: Grid) -> Float[Array, "..."]:
    """Return 1 for the modes at the end of a grid's spectrum and beyond, else 0."""
    *others, last = leaf.shape[leaf.ndim - grid.dimensions :]
    axes = [np.concatenate([np.arange(n // 2 + 1), np.arange(-(n // 2), 0)]) for n in others]
    axes.append(np.arange(last))
    end = jnp.zeros((1,) * leaf.ndim)
    for axis, (numbers, kept) in enumerate(zip(axes, grid.kept, strict=True)):
        # one small array per axis, so that no program carries a constant of full size
        beyond = jnp.asarray(np.abs(numbers) > (1.0 - SPECTRUM_END) * kept, float)
        after = (1,) * (grid.dimensions - 1 - axis)
        end = jnp.maximum(end, beyond.reshape((*(1,) * (leaf.ndim - 1 - len(after)), -1, *after)))
    return end
