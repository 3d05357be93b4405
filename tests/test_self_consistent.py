"""The self-consistent model: its equations, what they conserve, and their limits."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.fields import (
    HEATED,
    PAPER,
    at_rest,
    by_fourier,
    difference_rates,
    fourier_rates,
    full_model,
    sine_state,
    smooth_state,
)
from triboflux import closures
from triboflux.calculus import FourierCalculus
from triboflux.grid import Grid
from triboflux.hierarchy import MODELS
from triboflux.models import conduction
from triboflux.models import operators as o
from triboflux.models import terms as t
from triboflux.models.varying import LocalCoefficients
from triboflux.moments import Moments
from triboflux.numbers import Numbers
from triboflux.realizability import realizability_margin

NAME = "self-consistent"
GRIDS = {1: Grid((9,), (1.1,)), 2: Grid((6, 7), (1.0, 1.3)), 3: Grid((6, 6, 6), (1.0, 1.3, 0.9))}
dimensions = pytest.mark.parametrize("d", [1, 3])


def random_state(grid, *, uniform=False):
    """Return fields on the points, with a granular temperature of one everywhere or near it."""
    d = grid.dimensions
    state, other = (smooth_state(grid, 1, seed, third_order=True) for seed in (1, 2))
    size = 0.0 if uniform else 0.03
    unit = jnp.eye(d).reshape(d, d, *(1,) * d)
    deviation, trace = size * other.covariance_flux, size * other.covariance_flux_trace
    if d == 3:
        # all components are there, and make the traces
        trace = jnp.trace(deviation)
        state = eqx.tree_at(
            lambda s: s.covariance_flux_trace, state, jnp.trace(state.covariance_flux)
        )
    return state + Moments(
        granular_temperature_tensor=unit + deviation,
        granular_temperature=1.0 + trace / 3.0,
        dissipated_energy=other.variance,
    )


def rates(name, numbers, grid, fields, closure_set="derived"):
    """Return a model's right-hand side from the fields that it knows."""
    model = full_model(numbers, closure_set, grid.dimensions, name=name)
    known = Moments(**{moment: getattr(fields, moment) for moment in model.evolves})
    return fourier_rates(model, grid, known)


def largest(values):
    return float(jnp.abs(values).max())


# ------------------------------------------------------------------ equations


@pytest.mark.parametrize(("d", "closure_set"), [(1, "complete"), (3, "derived")])
def test_at_the_first_temperature_it_is_the_third_order_model(d, closure_set):
    grid = GRIDS[d]
    fields = random_state(grid, uniform=True)
    ours, theirs = (
        rates(name, HEATED, grid, fields, closure_set) for name in (NAME, "third-order")
    )
    for moment in MODELS["third-order"].evolves:
        one, other = getattr(ours, moment), getattr(theirs, moment)
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-12 * largest(other))


@pytest.mark.parametrize("closure_set", closures.NAMES)
def test_at_another_temperature_it_is_the_third_order_model_with_other_numbers(closure_set):
    # Θ enters the scales of time, u and the transferred charge, and nothing else
    grid, theta = GRIDS[2], 1.7
    fields = random_state(grid, uniform=True)
    hot = eqx.tree_at(
        lambda f: (f.granular_temperature_tensor, f.granular_temperature),
        fields,
        (theta * fields.granular_temperature_tensor, theta * fields.granular_temperature),
    )
    root, transfer = theta**0.5, theta**0.9
    factors = {
        "peclet": root / transfer,
        "tau_p": root,
        "tau_sigma": root / transfer,
        "energy_ratio": 1.0 / theta,
    }
    changed = HEATED | {name: factor * HEATED[name] for name, factor in factors.items()}
    powers = {"charge": 0, "covariance": 1, "variance": 0}
    powers |= {"covariance_flux": 2, "covariance_flux_trace": 2}
    scaled = Moments(
        **{name: getattr(fields, name) / root**power for name, power in powers.items()}
    )
    ours = rates(NAME, HEATED, grid, hot, closure_set)
    theirs = rates("third-order", changed, grid, scaled, closure_set)
    for moment, power in powers.items():
        one, other = getattr(ours, moment), root ** (power + 1) * getattr(theirs, moment)
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-12 * largest(other))


def test_tensors_and_their_traces_stay_together():
    grid = GRIDS[3]
    found = rates(NAME, HEATED, grid, random_state(grid), "complete")
    for name, trace, weight in (
        ("covariance_flux", "covariance_flux_trace", 1.0),
        ("granular_temperature_tensor", "granular_temperature", 1.0 / 3.0),
    ):
        own = getattr(found, name)
        sums = weight * jnp.trace(own)
        np.testing.assert_allclose(getattr(found, trace), sums, atol=1e-12 * largest(sums))
        np.testing.assert_allclose(own, own.swapaxes(0, 1), atol=1e-12 * largest(own))


@dimensions
def test_conduction_is_linear_near_the_first_temperature_and_a_flux_elsewhere(d):
    grid = GRIDS[d]
    fields, calculus = random_state(grid), FourierCalculus(GRIDS[d])
    closure_set = closures.by_name("derived", HEATED["restitution"])
    local = LocalCoefficients.of(Numbers(**HEATED), closure_set, 3)
    state = jax.tree.map(grid.to_spectral, fields)
    terms = conduction.conduction_terms(local)
    linear = t.evaluate(tuple(term for term in terms if term.linear), calculus, state)
    slopes = grid.to_fields(calculus.gradient(state.granular_temperature))
    gradient = grid.to_fields(
        o.GRADIENT_OF_TENSOR.apply(calculus, state.granular_temperature_tensor)
    )
    one = jnp.ones_like(fields.granular_temperature)
    unit = jnp.broadcast_to(jnp.eye(d).reshape(d, d, *(1,) * d), (d, d, *grid.points))
    first = conduction.temperature_coefficients(local, None)
    flux, trace = conduction._heat_flux(unit, one, gradient, slopes, first)
    own = -o.DIVERGENCE_OF_THIRD.apply(calculus, grid.to_spectral(flux))
    of_trace = -calculus.divergence(grid.to_spectral(trace)) / 3.0
    for found, expected in (
        (linear.granular_temperature_tensor, own),
        (linear.granular_temperature, of_trace),
    ):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * largest(expected))
    everything = t.evaluate(terms, calculus, state)
    mean = jax.tree.map(lambda f: jnp.mean(grid.to_fields(f)), everything)
    assert abs(float(mean.granular_temperature)) < 1e-13 * largest(of_trace)


# ------------------------------------------------------------------ conservation


@pytest.mark.parametrize(("d", "closure_set"), [(1, "published"), (2, "complete"), (3, "derived")])
def test_energy_and_charge_keep_their_sums_whatever_the_state(d, closure_set):
    grid = GRIDS[d]
    fields = random_state(grid)
    found = rates(NAME, HEATED, grid, fields, closure_set)
    potential = grid.to_fields(FourierCalculus(grid).potential(grid.to_spectral(fields.charge)))
    parts = [
        HEATED["energy_ratio"] * float(jnp.mean(potential * found.charge)),
        1.5 * float(jnp.mean(found.granular_temperature)),
        float(jnp.mean(found.dissipated_energy)),
    ]
    assert min(abs(part) for part in parts) > 1e-3
    assert abs(sum(parts)) < 1e-12 * max(map(abs, parts))
    assert abs(float(jnp.mean(found.charge))) < 1e-13 * largest(found.charge)


def test_both_discretisations_agree():
    differences = []
    for points in (24, 48):
        grid = Grid((points,), (0.9,))
        (x,) = grid.coordinates()
        waves = [np.sin(2.0 * np.pi * m * x / 0.9 + 0.3 * m**2) for m in (1, 2, 3, 1, 2)]
        fields = Moments(
            charge=waves[0],
            covariance=0.3 * waves[1][None],
            variance=1.0 + 0.1 * waves[2],
            covariance_flux=0.2 * waves[3][None, None],
            covariance_flux_trace=0.4 * waves[4],
            granular_temperature_tensor=(1.4 + 0.2 * waves[1])[None, None],
            granular_temperature=1.2 + 0.1 * waves[0],
            dissipated_energy=waves[2],
        )
        fields = jax.tree.map(jnp.asarray, fields)
        model = full_model(HEATED, name=NAME)
        finite, spectral = (f(model, grid, fields) for f in (difference_rates, fourier_rates))
        differences.append(
            [largest(getattr(finite, n) - getattr(spectral, n)) for n in model.evolves]
        )
    order = np.log2(np.divide(*differences))
    assert (order > 5.5).all()


LINE = Grid((64,), (1.0,))


def run(numbers, stop=0.5, end=200.0, **changes):
    """Run a case of the paper; one program for all."""
    start = at_rest(LINE, **{"charge": sine_state(LINE).charge} | changes)
    # without the electric force on T the margin falls to -0.02 in case B
    model = full_model(numbers, "complete", name=NAME)
    outcome, found = by_fourier(model, start, LINE, end, 1e-6, 1e-9, stop)
    assert not bool(outcome.failed)
    return outcome, found


@pytest.mark.parametrize(
    "changes", [{"tau_c": 1e-4}, {"tau_c": 0.1}, {"tau_c": 0.1, "restitution": 0.8, "tau_p": 1.0}]
)
def test_a_run_keeps_its_energy_and_stays_realizable(changes):
    outcome, fields = run(PAPER | changes)
    field = LINE.to_fields(FourierCalculus(LINE).electric_field(outcome.carry.coefficients.charge))
    energy = 0.5 * 300.0 * float(jnp.mean(field[0] ** 2)) + float(
        jnp.mean(1.5 * fields.granular_temperature + fields.dissipated_energy)
    )
    first = 1.5 + 0.25 * 300.0 / (2.0 * np.pi) ** 2
    # no more than the tolerance of the steps
    assert abs(energy / first - 1.0) < 1e-6
    assert float(fields.granular_temperature.max()) > (1.05 if "tau_p" in changes else 1.5)
    tensor_xx = fields.granular_temperature_tensor
    margin = realizability_margin(fields.covariance, fields.variance, tensor_xx)
    assert float(margin.min()) > -1e-8
    # where Θ is held, case B is far from that
    if changes == {"tau_c": 0.1}:
        assert float((fields.variance - fields.covariance[0] ** 2).min()) < -0.3


def test_homogeneous_limits():
    # Haff's law, the decay of anisotropy and drag; without charge nothing else happens
    quiet, one = jnp.zeros(64), jnp.ones(64)
    time, tau = 0.4, 0.05
    numbers = PAPER | {"tau_c": tau, "restitution": 0.7}
    _, fields = run(numbers, -1.0, time, charge=quiet)
    haff = (1.0 + (1.0 - 0.7**2) * time / (6.0 * tau)) ** -2
    np.testing.assert_allclose(fields.granular_temperature, haff, rtol=1e-6)
    np.testing.assert_allclose(fields.granular_temperature_tensor[0, 0], haff, rtol=1e-6)
    np.testing.assert_allclose(fields.dissipated_energy, 1.5 * (1.0 - haff), rtol=1e-6)
    stretched = {"granular_temperature_tensor": 1.6 * one[None, None]}
    _, fields = run(PAPER | {"tau_c": tau}, -1.0, time, charge=quiet, **stretched)
    left = 0.6 * np.exp(-0.8 * time / tau)
    np.testing.assert_allclose(fields.granular_temperature_tensor[0, 0], 1.0 + left, rtol=1e-6)
    np.testing.assert_allclose(fields.granular_temperature, 1.0, rtol=1e-12)
    _, fields = run(PAPER | {"tau_c": tau, "tau_p": 0.7}, -1.0, time, charge=quiet)
    np.testing.assert_allclose(fields.granular_temperature, np.exp(-2.0 * time / 0.7), rtol=1e-6)
