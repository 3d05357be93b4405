"""The reduced models: where they meet each other, and how accurate they are in time."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from examples.full_model_by_hand import coefficients as coefficients_by_hand
from tests import reduced_by_hand as by_hand
from tests.fields import (
    CASE_A,
    CASE_B,
    EVERYTHING,
    largest_difference,
    sine_state,
)
from tests.reduced import (
    BOXES,
    LENGTH,
    build,
    final,
    rebuilt,
    uneven,
)
from tests.runs import settings
from tests.semilinear import orders
from triboflux import models
from triboflux.grid import Grid
from triboflux.integrate import integrate
from triboflux.integrators.finite_difference import integrate_finite_differences
from triboflux.moments import Moments
from triboflux.numbers import Numbers

CASE_B_BY_HAND = CASE_B | {"tau_p": math.inf, "tau_sigma": math.inf}


# --- limits between the models --------------------------------------------------------------------


def differences_between(pair, moments, changes, t_end, steps):
    """Return the differences of two models for each of some changes of case A or its models."""
    grid, found = BOXES[1], []
    state = Moments(jnp.asarray(-np.sin(2.0 * np.pi * grid.coordinates()[0] / LENGTH)))
    zero = jnp.zeros(grid.points)
    state = Moments(state.charge, zero[None], zero)
    for change, time in zip(changes, t_end, strict=True):
        ends = [final(change(name), state, grid, time, steps, power=3) for name in pair]
        found.append([largest_difference(*(getattr(e, m) for e in ends)) for m in moments])
    return found


def test_full_tends_to_semi_algebraic_at_second_order_in_the_collision_time():
    times = (4e-3, 2e-3, 1e-3)
    found = differences_between(
        ("semi-algebraic", "full"),
        ("charge",),
        [lambda name, t=t: build(name, CASE_A | {"tau_c": t}, "published") for t in times],
        [4e-3 / t for t in times],
        64,
    )
    # Measured: 1.996 and 2.003.
    assert (orders(found) > 1.9).all()
    assert (orders(found) < 2.1).all()


def test_semi_algebraic_tends_to_algebraic_where_the_variance_decays_fast():
    # The force grows with the decay, so that what it does to the charge stays the same.
    found = differences_between(
        ("semi-algebraic", "algebraic"),
        ("charge",),
        [
            lambda name, f=f: rebuilt(build(name, CASE_A), variance_destruction=f, electric_force=f)
            for f in (200.0, 400.0, 800.0)
        ],
        [40.0] * 3,
        128,
    )
    # Measured: 0.98 and 0.96.
    assert (orders(found) > 0.9).all()
    assert (orders(found) < 1.1).all()


def test_gradient_tends_to_collisional_where_the_covariance_decays_fast():
    grid, differences = BOXES[2], []
    for factor in (10.0, 20.0, 40.0):
        ends = []
        for name in ("gradient", "collisional"):
            model = rebuilt(build(name, EVERYTHING, dimensions=2), covariance_destruction=factor)
            ends.append(final(model, uneven(grid, name), grid, 0.1, 2).charge)
        differences.append(largest_difference(*ends))
    # Measured: 0.9993 and 0.9997.
    assert (orders(differences) > 0.9).all()
    assert (orders(differences) < 1.1).all()


# --- in time --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["semi-algebraic", "gradient"])
def test_finite_differences_approach_the_solution_by_hand_at_sixth_order(name):
    c, run = coefficients_by_hand("published", CASE_B_BY_HAND), eqx.filter_jit(by_differences)
    time, charge, _, variance, _ = by_hand.solve_to_peak(name, c, points=64, rtol=1e-11, peak=0.6)
    errors = []
    for points in (32, 64):
        grid = Grid((points,), (1.0,))
        found = run(build(name, CASE_B, "published"), sine_state(grid), grid, jnp.asarray(time))
        every = 64 // points
        errors.append([largest_difference(found.charge, charge[::every])])
        if variance is not None:
            errors[-1].append(largest_difference(found.variance, variance[::every]))
    assert (orders(errors) > 5.5).all()
    assert (orders(errors) < 6.5).all()


def by_differences(model, state, grid, t_end):
    return integrate_finite_differences(
        model, state, grid, t_end=t_end, rtol=1e-11, atol=1e-13
    ).fields


@pytest.mark.parametrize(("numbers", "t_end"), [(CASE_A, 49.0), (CASE_B, 0.048)], ids=["A", "B"])
def test_semi_algebraic_steps_have_order_five(numbers, t_end):
    # What reads the variance comes after what changes it.
    grid = BOXES[1]
    charge = jnp.asarray(-np.sin(2.0 * np.pi * grid.coordinates()[0] / LENGTH))
    state = Moments(charge, None, jnp.zeros(grid.points))
    model = build("semi-algebraic", numbers, "published")
    first, last = model.sweeps()
    assert not [t for t in first if "variance" in t.source.reads]
    assert all("variance" in t.source.reads for t in last)
    reference = final(model, state, grid, t_end, 512)
    errors = []
    for steps in (16, 32, 64):
        found = final(model, state, grid, t_end, steps)
        errors.append(
            [largest_difference(getattr(found, m), getattr(reference, m)) for m in model.evolves]
        )
    # Measured: 4.77 to 5.12.
    assert (orders(errors) > 4.7).all()
    assert (orders(errors) < 5.3).all()


def stop_time(tau_c, energy_ratio, name, grid):
    """Return the stop time of case B with two traced numbers."""
    numbers = Numbers(**CASE_B).model_copy(update={"tau_c": tau_c, "energy_ratio": energy_ratio})
    model = models.build(name, numbers, "published")
    options = settings(1.0, 1e-8, peak=0.5, max_steps=256)
    return integrate(model, sine_state(grid), grid, options).time


def test_gradients_and_batches_of_the_stop_time():
    name, grid = "semi-algebraic", Grid((16,), (1.0,))
    time = eqx.filter_jit(
        jax.vmap(lambda tau_c, u: stop_time(tau_c, u, name, grid), in_axes=(0, 0))
    )
    slopes = eqx.filter_jit(
        jax.grad(lambda tau_c, u: stop_time(tau_c, u, name, grid), argnums=(0, 1))
    )(jnp.asarray(0.1), jnp.asarray(300.0))
    width = 1e-3
    factors = jnp.asarray([[1 + width, 1], [1 - width, 1], [1, 1 + width], [1, 1 - width]])
    times = time(0.1 * factors[:, 0], 300.0 * factors[:, 1])
    expected = [
        (times[0] - times[1]) / (2.0 * width * 0.1),
        (times[2] - times[3]) / (2.0 * width * 300.0),
    ]
    for slope, difference in zip(slopes, expected, strict=True):
        assert float(slope) == pytest.approx(float(difference), rel=1e-5)
