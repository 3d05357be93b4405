"""Models, initial states and compiled runs that several test modules share."""

import math

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from tests.cases import NUMBERS
from triboflux import models
from triboflux.grid import Grid
from triboflux.integrate import Settings, integrate
from triboflux.moments import Moments
from triboflux.numbers import Numbers

CASE_A = Numbers(**(NUMBERS | {"tau_c": 1e-4}))
CASE_B = Numbers(**NUMBERS)


def paper_state(grid):
    """Return the paper's initial state, Q = -sin 2πx and C = V = 0, on a one-dimensional grid."""
    (x,) = grid.coordinates()
    zero = jnp.zeros(grid.points)
    return Moments(jnp.asarray(-np.sin(2 * np.pi * x)), zero[None], zero)


def asymmetric_state(grid, amplitude=1.0):
    """Return smooth fields without any symmetry, of a few oblique modes, at any resolution.

    The charge is neutral, the covariance has all components, and the variance is positive.
    """
    generator = np.random.default_rng(7)
    points = np.meshgrid(*grid.coordinates(), indexing="ij")

    def field(waves):
        total = np.zeros(grid.points)
        for _ in range(waves):
            mode = generator.integers(-2, 3, size=grid.dimensions)
            mode[0] = mode[0] or 1
            angle = sum(
                2 * np.pi * m * x / length
                for m, x, length in zip(mode, points, grid.lengths, strict=True)
            )
            total += generator.normal() * np.cos(angle + generator.uniform(0, 2 * np.pi))
        return total

    charge = field(4)
    covariance = np.stack([0.1 * field(3) + 0.02 for _ in range(grid.dimensions)])
    variance = 1.0 + 0.05 * field(3)
    return Moments(*(jnp.asarray(amplitude * f) for f in (charge, covariance, variance)))


def random_coefficients(grid, seed=0, evolves=("charge", "covariance", "variance")):
    """Return Fourier coefficients of unit order in every kept mode."""
    generator = np.random.default_rng(seed)
    shapes = {
        "charge": grid.points,
        "covariance": (grid.dimensions, *grid.points),
        "variance": grid.points,
    }
    fields = {
        name: jnp.asarray(generator.normal(size=shape) * math.sqrt(math.prod(grid.points)))
        for name, shape in shapes.items()
    }
    return Moments(**{name: grid.to_spectral(fields[name]) for name in evolves})


def build(numbers=CASE_B, closure_set="derived", dimensions=1, **changes):
    """Return the full model of given numbers, some of which may be replaced by traced values."""
    return models.build(
        "full", numbers.model_copy(update=changes), closure_set, dimensions=dimensions
    )


def settings(t_end, rtol=1e-6, atol=None, **others):
    """Return settings whose numbers are arrays, so that others do not compile anew."""
    chosen = Settings(
        jnp.asarray(float(t_end)), jnp.asarray(rtol), jnp.asarray(1e-3 * rtol if atol is None else atol)
    )
    values = {
        name: value if name in ("max_steps", "adjoint") else jnp.asarray(value)
        for name, value in others.items()
    }
    names = tuple(values)
    return eqx.tree_at(
        lambda s: tuple(getattr(s, name) for name in names),
        chosen,
        tuple(values.values()),
        is_leaf=lambda leaf: leaf is None,
    ) if names else chosen


run = eqx.filter_jit(integrate)
