"""The sensitivity of a stop time, by reverse-mode differentiation and by central differences."""

from __future__ import annotations

import functools as ft

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from triboflux import models
from triboflux.grid import Grid
from triboflux.integrate import Settings, integrate
from triboflux.moments import Moments
from triboflux.numbers import Numbers

GRID = Grid((48,), (1.0,))
TAU_C = {"A": 1e-4, "B": 1e-1}
NUMBERS = Numbers(peclet=1e6, tau_c=0.1, energy_ratio=300.0, length_ratio=192.0, restitution=1.0)


def stop_time(parameters):
    """Return t* as a function of tau_c and the energy ratio."""
    numbers = NUMBERS.model_copy(update={"tau_c": parameters[0], "energy_ratio": parameters[1]})
    (x,) = GRID.coordinates()
    start = Moments(jnp.asarray(-np.sin(2 * np.pi * x)), jnp.zeros((1, 48)), jnp.zeros(48))
    settings = Settings(200.0, 1e-9, 1e-12, stop_at_peak_charge=0.5, max_steps=512)
    return integrate(models.build("full", numbers, "published"), start, GRID, settings).time


@ft.cache
def compiled():
    return eqx.filter_jit(stop_time), eqx.filter_jit(jax.value_and_grad(stop_time))


@pytest.mark.parametrize("case", ["A", "B"])
def test_gradient_of_the_stop_time(case):
    value_of, value_and_gradient = compiled()
    at = jnp.array([TAU_C[case], 300.0])
    value, gradient = value_and_gradient(at)
    assert float(value) == pytest.approx({"A": 49.1433, "B": 0.165302}[case], rel=1e-5)
    for i in range(2):
        step = 1e-4 * at[i] * jnp.eye(2)[i]
        difference = (value_of(at + step) - value_of(at - step)) / (2e-4 * at[i])
        assert float(gradient[i]) == pytest.approx(float(difference), rel=1e-5)


def test_a_batch_equals_single_runs():
    value_of, _ = compiled()
    batch = jnp.array([[0.1, 300.0], [0.05, 200.0], [0.2, 100.0]])
    together = eqx.filter_jit(jax.vmap(stop_time))(batch)
    alone = [float(value_of(row)) for row in batch]
    np.testing.assert_allclose(together, alone, rtol=1e-9)
