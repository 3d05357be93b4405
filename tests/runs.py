"""Compiled runs of the solver, their settings, and states without any structure."""

import math

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from triboflux.hierarchy import RANKS
from triboflux.integrate import Settings, advance, begin, integrate
from triboflux.moments import Moments

run = eqx.filter_jit(integrate)
resume = eqx.filter_jit(advance)
start = eqx.filter_jit(begin)


def settings(t_end, rtol=1e-6, atol=None, *, outputs=None, peak=None, rate=None, **others):
    """Return settings whose numbers are arrays, so that other ones do not compile anew."""
    numbers = (t_end, rtol, 1e-3 * rtol if atol is None else atol, outputs, peak, rate)
    return Settings(
        *(None if x is None else jnp.asarray(x, dtype=float) for x in numbers), **others
    )


def random_coefficients(grid, seed=0, evolves=("charge", "covariance", "variance")):
    """Return Fourier coefficients of order one in every kept mode; tensors are symmetric."""
    generator = np.random.default_rng(seed)
    size = math.sqrt(math.prod(grid.points))
    fields = {}
    for name in evolves:
        shape = (grid.dimensions,) * RANKS[name] + grid.points
        field = generator.normal(size=shape) * size
        fields[name] = field + np.swapaxes(field, 0, 1) if RANKS[name] == 2 else field
    return Moments(**{name: grid.to_spectral(jnp.asarray(f)) for name, f in fields.items()})
