"""Derivatives of the stop time through the whole integration, and batches of cases."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.fields import CASE_A, CASE_B, sine_state
from tests.runs import settings
from triboflux import models
from triboflux.grid import Grid
from triboflux.integrate import integrate
from triboflux.numbers import Numbers

GRID = Grid((32,), (1.0,))
CASES = {"A": CASE_A, "B": CASE_B}


def outcome_of(tau_c, energy_ratio, rtol):
    """Return the outcome of the paper's case with two traced numbers, up to the stop."""
    numbers = Numbers(**CASE_B).model_copy(update={"tau_c": tau_c, "energy_ratio": energy_ratio})
    model = models.build("full", numbers, "published")
    options = settings(200.0, peak=0.5, max_steps=1024)
    options = eqx.tree_at(lambda s: (s.rtol, s.atol), options, (rtol, 1e-3 * rtol))
    return integrate(model, sine_state(GRID), GRID, options)


def stop_time(tau_c, energy_ratio, rtol):
    return outcome_of(tau_c, energy_ratio, rtol).time


single = eqx.filter_jit(stop_time)
gradient = eqx.filter_jit(jax.value_and_grad(stop_time, argnums=(0, 1)))


def central_difference(function, at, relative):
    """Return the derivative by central differences, extrapolated from two widths."""

    def slope(width):
        return (function(at + width) - function(at - width)) / (2.0 * width)

    narrow, wide = slope(relative * at), slope(2.0 * relative * at)
    return narrow + (narrow - wide) / 3.0


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("rtol", [1e-6, 1e-9])
def test_gradient_of_the_stop_time_against_central_differences(name, rtol):
    tau_c, u = jnp.asarray(CASES[name]["tau_c"]), jnp.asarray(CASES[name]["energy_ratio"])
    rtol = jnp.asarray(rtol)
    time, slopes = gradient(tau_c, u, rtol)
    assert float(time) == pytest.approx(float(single(tau_c, u, rtol)), rel=1e-12)
    expected = (
        central_difference(lambda x: single(x, u, rtol), tau_c, 5e-4),
        central_difference(lambda x: single(tau_c, x, rtol), u, 5e-4),
    )
    # Measured: at most 7e-10; what differs are steps that a larger width would change.
    for slope, difference in zip(slopes, expected, strict=True):
        assert float(slope) == pytest.approx(float(difference), rel=1e-5)


def test_the_gradient_holds_at_the_default_tolerance():
    # The method itself is differentiated, and its slope is about as accurate as its answer.
    tau_c, u = jnp.asarray(1e-4), jnp.asarray(300.0)
    _, rough = gradient(tau_c, u, jnp.asarray(1e-6))
    _, fine = gradient(tau_c, u, jnp.asarray(1e-9))
    np.testing.assert_allclose(rough, fine, rtol=1e-4)


def test_a_batch_of_cases_gives_what_single_runs_give():
    tau_c = jnp.array([1e-4, 3e-3, 1e-1])
    u = jnp.array([300.0, 250.0, 300.0])
    rtol = jnp.asarray(1e-6)
    batch = eqx.filter_jit(jax.vmap(outcome_of, in_axes=(0, 0, None)))(tau_c, u, rtol)
    alone = [eqx.filter_jit(outcome_of)(t, e, rtol) for t, e in zip(tau_c, u, strict=True)]
    for i, outcome in enumerate(alone):
        assert float(batch.carry.time[i]) == pytest.approx(float(outcome.time), rel=1e-11)
        assert int(batch.accepted[i]) == int(outcome.accepted)
        assert int(batch.rejected[i]) == int(outcome.rejected)
        pairs = zip(
            jax.tree.leaves(batch.carry.coefficients),
            jax.tree.leaves(outcome.carry.coefficients),
            strict=True,
        )
        for found, expected in pairs:
            size = float(jnp.max(jnp.abs(expected)))
            np.testing.assert_allclose(found[i], expected, rtol=0, atol=1e-9 * size)
