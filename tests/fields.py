"""Models and smooth fields without any symmetry, for comparing discretisations."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from triboflux import models
from triboflux.calculus import FourierCalculus
from triboflux.hierarchy import RANKS
from triboflux.integrate import Settings, integrate
from triboflux.integrators.finite_difference import FiniteDifferences
from triboflux.moments import Moments
from triboflux.numbers import Numbers

PAPER = {"peclet": 1e6, "energy_ratio": 300.0, "length_ratio": 192.0, "restitution": 1.0}
CASE_A, CASE_B = PAPER | {"tau_c": 1e-4}, PAPER | {"tau_c": 1e-1}
# No term is negligible.
EVERYTHING = {
    "peclet": 3e3,
    "tau_c": 2e-3,
    "tau_p": 0.05,
    "tau_sigma": 0.7,
    "energy_ratio": 40.0,
    "length_ratio": 12.0,
    "restitution": 0.85,
}
# The same for models that evolve the granular temperature, which stays near one.
HEATED = {
    "peclet": 300.0,
    "tau_c": 0.03,
    "tau_p": 0.2,
    "tau_sigma": 0.5,
    "energy_ratio": 30.0,
    "length_ratio": 20.0,
    "restitution": 0.8,
}


def full_model(numbers, closures="derived", dimensions=1, exponent=0.8, name="full"):
    """Return the full model with coefficients as arrays, so that compiled functions are reused."""
    model = models.build(
        name, Numbers(**numbers), closures, dimensions=dimensions, exponent=exponent
    )
    return jax.tree.map(jnp.asarray, model)


def smooth_field(grid, highest, seed):
    """Return a random field of the modes up to `highest` per axis; its mean is not zero."""
    generator = np.random.default_rng(seed)
    numbers = np.arange(-highest, highest + 1)
    parts = generator.normal(size=(2, *[len(numbers)] * grid.dimensions))
    field = parts[0] + 1j * parts[1]
    for x, length in zip(grid.coordinates(), grid.lengths, strict=True):
        waves = np.exp(2j * np.pi * np.outer(numbers, x) / length)
        field = np.tensordot(field, waves, axes=([0], [0]))
    return field.real / math.sqrt(parts[0].size)


def smooth_state(grid, highest, seed=1, third_order=False):
    """Return random smooth moments; the same functions on every grid of the same lengths."""
    d = grid.dimensions
    charge, variance, *covariance = (smooth_field(grid, highest, (seed, i)) for i in range(2 + d))
    state = Moments(jnp.asarray(charge), jnp.asarray(np.stack(covariance)), jnp.asarray(variance))
    if not third_order:
        return state
    trace, *tensor = (smooth_field(grid, highest, (seed, 9 + i)) for i in range(1 + d * d))
    tensor = np.stack(tensor).reshape((d, d, *grid.points))
    tensor = jnp.asarray(tensor + tensor.swapaxes(0, 1))
    return state + Moments(covariance_flux=tensor, covariance_flux_trace=jnp.asarray(trace))


def sine_state(grid):
    """Return the initial state of the paper's cases, Q = -sin 2πx."""
    (x,) = grid.coordinates()
    charge = jnp.asarray(-np.sin(2.0 * np.pi * x))
    return Moments(charge, jnp.zeros((1, *grid.points)), jnp.zeros(grid.points))


@eqx.filter_jit
def fourier_rates(model, grid, state):
    """Return the right-hand side by Fourier transforms, from fields to fields."""
    coefficients = jax.tree.map(grid.to_spectral, state)
    rates = model.right_hand_side(FourierCalculus(grid), coefficients)
    return jax.tree.map(grid.to_fields, rates)


@eqx.filter_jit
def difference_rates(model, grid, state):
    """Return the right-hand side by finite differences."""
    return model.right_hand_side(FiniteDifferences(grid), state)


@eqx.filter_jit
def _integrate(model, state, grid, settings):
    outcome = integrate(model, state, grid, settings)
    return outcome, jax.tree.map(grid.to_fields, outcome.carry.coefficients)


def by_fourier(model, state, grid, t_end, rtol, atol, stop=None):
    """Integrate with the production solver; return its outcome and the fields at the end."""
    numbers = (None if x is None else jnp.asarray(x) for x in (t_end, rtol, atol, stop))
    t_end, rtol, atol, stop = numbers
    settings = Settings(t_end, rtol, atol, stop_at_peak_charge=stop)
    return _integrate(model, state, grid, settings)


def at_rest(grid, **changes):
    """Return all moments on points of a line, without charge or motion and at Θ = n = 1."""
    one = jnp.ones(grid.points)
    fields = {name: jnp.zeros((1,) * rank + grid.points) for name, rank in RANKS.items()}
    fields |= {"granular_temperature": one, "granular_temperature_tensor": one[None, None]}
    return Moments(**fields | {"specific_volume": one} | changes)


def largest_difference(left, right):
    """Return max |left - right| / max |right| of arrays; of states, the largest of any moment."""
    if isinstance(left, Moments):
        names = [name for name in RANKS if getattr(right, name) is not None]
        pairs = [(getattr(left, name), getattr(right, name)) for name in names]
        # Unlike the built-in one, this maximum does not pass over NaN.
        return float(np.max([largest_difference(*pair) for pair in pairs]))
    left, right = np.asarray(left), np.asarray(right)
    assert left.shape == right.shape
    return float(np.max(np.abs(left - right)) / np.max(np.abs(right)))
