"""Boxes, states and runs of the reduced models that several tests share."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from tests.fields import EVERYTHING, smooth_field
from tests.semilinear import one_step
from triboflux import models
from triboflux.calculus import FourierCalculus
from triboflux.grid import Grid
from triboflux.integrate import begin, semilinear_term
from triboflux.moments import Moments
from triboflux.numbers import Numbers

POINTS, LENGTH = 24, 0.8
# Waves of the modes below have the length of the line, and harmonics that are kept together.
MODES = {1: (1,), 2: (1, -2), 3: (1, 1, -1)}
BOXES = {
    1: Grid((POINTS,), (LENGTH,)),
    2: Grid((POINTS, 2 * POINTS), (1.25, 2.0 / math.sqrt(LENGTH**-2 - 1.25**-2))),
    3: Grid((POINTS,) * 3, (1.25, 1.3, 1.0 / math.sqrt(LENGTH**-2 - 1.25**-2 - 1.3**-2))),
}
# A force with which the algebraic variance is positive everywhere.
WEAK = EVERYTHING | {"energy_ratio": 3.0}


def build(name, numbers, closure_set="derived", dimensions=1, exponent=0.8):
    """Return a model with coefficients as arrays, so that compiled functions are reused."""
    model = models.build(
        name, Numbers(**numbers), closure_set, dimensions=dimensions, exponent=exponent
    )
    return jax.tree.map(jnp.asarray, model)


def rebuilt(model, **factors):
    """Return a model of the same name whose coefficients are multiplied by factors."""
    changed = {name: factor * getattr(model.coefficients, name) for name, factor in factors.items()}
    names = tuple(changed)
    coefficients = eqx.tree_at(
        lambda c: [getattr(c, name) for name in names], model.coefficients, list(changed.values())
    )
    return jax.tree.map(jnp.asarray, models.REGISTRY[model.name](coefficients))


def uneven(grid, name, highest=1, mean=0.0, seed=3):
    """Return smooth fields without symmetry of what a model evolves; the variance is positive."""
    charge = smooth_field(grid, highest, seed)
    charge = 0.5 * (charge - charge.mean()) / np.max(np.abs(charge)) + mean
    variance = smooth_field(grid, highest, seed + 1)
    variance = 0.5 + 0.2 * variance / np.max(np.abs(variance))
    evolved = jnp.asarray(variance) if name == "semi-algebraic" else None
    return Moments(charge=jnp.asarray(charge), variance=evolved)


@eqx.filter_jit
def all_fields(model, grid, state):
    calculus = FourierCalculus(grid)
    return model.fields(calculus, jax.tree.map(grid.to_spectral, state))


def final(model, state, grid, t_end, steps, power=1):
    """Return the evolved fields and the fields of all moments after equal steps."""
    term, y = semilinear_term(model, grid), begin(model, state, grid).coefficients
    # With a power above one the first steps are short, as an initial layer wants them.
    for step in np.diff(t_end * np.linspace(0.0, 1.0, steps + 1) ** power):
        y, _ = one_step(term, y, jnp.asarray(step))
    return all_fields(model, grid, jax.tree.map(grid.to_fields, y))
