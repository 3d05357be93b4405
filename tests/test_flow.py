"""The self-consistent model with a mean velocity and a number density of its own."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks import flow_algebra
from tests.fields import (
    HEATED,
    PAPER,
    at_rest,
    by_fourier,
    difference_rates,
    fourier_rates,
    full_model,
)
from triboflux import Case, InputError, mass_coordinate, solve
from triboflux.calculus import FourierCalculus
from triboflux.diagnostics import budget
from triboflux.energy import energy_balance
from triboflux.grid import Grid
from triboflux.hierarchy import FLOW, MODELS, RANKS
from triboflux.moments import Moments
from triboflux.velocity_closures import flight_dispersion, flow_closures, velocity_closures

NAME = "self-consistent-flow"
LENGTH = 0.9


def waves(grid, seed, modes=4):
    """Return a smooth function on the points, of size one at most."""
    random = np.random.default_rng(seed)
    (x,) = grid.coordinates()
    turns = 2.0 * np.pi * np.outer(np.arange(1, modes), x) / grid.lengths[0]
    factors = random.uniform(-1.0, 1.0, (2, modes - 1)) / modes
    return jnp.asarray(factors[0] @ np.cos(turns) + factors[1] @ np.sin(turns))


def some_state(grid):
    """Return fields on points in m that have no symmetry."""
    w = [waves(grid, seed) for seed in range(10)]
    volume = 1.0 + 0.3 * w[8]
    return Moments(
        charge=w[0],
        covariance=0.3 * w[1][None],
        variance=1.0 + 0.4 * w[2],
        covariance_flux=0.3 * w[3][None, None],
        covariance_flux_trace=0.5 * w[4],
        granular_temperature_tensor=(1.3 + 0.4 * w[5])[None, None],
        granular_temperature=1.2 + 0.3 * w[6],
        dissipated_energy=w[7],
        specific_volume=volume / jnp.mean(volume),
        mean_velocity=(w[9] - jnp.mean(w[9]))[None],
    )


def largest(values):
    return float(jnp.abs(values).max())


# ------------------------------------------------------------------ equations


def test_it_evolves_every_moment():
    assert MODELS[NAME].evolves == tuple(RANKS)
    assert set(RANKS) - set(MODELS["self-consistent"].evolves) == set(FLOW)


def test_computer_algebra_finds_the_coefficients():
    forms = flow_algebra.exact_forms()
    e = next(iter(forms["pressure"].free_symbols))
    for name, value in flow_closures(e)._asdict().items():
        assert float((forms[name] - value).subs(e, 0.7)) == pytest.approx(0.0, abs=1e-15), name
        assert float((forms[name] - value).subs(e, 0.2)) == pytest.approx(0.0, abs=1e-15), name
    assert [form for name, form in forms.items() if name.startswith("left of")] == [0, 0, 0]


class Eulerian:
    """The equations in x, for d → 0, as they stand in the documentation."""

    def __init__(self, fields, length, numbers):
        self.f = {name: np.asarray(values).reshape(-1) for name, values in fields.items()}
        self.length, self.numbers = length, numbers
        self.n = 1.0 / self.f["specific_volume"]
        self.g = self.slope("mean_velocity")

    def derivative(self, values):
        waves = 2.0 * np.pi / self.length * np.arange(len(values) // 2 + 1)
        return np.fft.irfft(1j * waves * np.fft.rfft(values), len(values))

    def slope(self, name):
        return self.derivative(self.f[name])

    def outflow(self, values):
        """Return the divergence of a flux per particle."""
        return self.derivative(self.n * values) / self.n

    def rates(self):
        """Return the rates of change along with U."""
        f, n, g, m = self.f, self.n, self.g, self.numbers
        q, c, v = f["charge"], f["covariance"], f["variance"]
        t, r = f["covariance_flux"], f["granular_temperature_tensor"]
        theta, field, u = f["granular_temperature"], f["field"], m["energy_ratio"]
        drag = 1.0 / m["tau_p"]
        flux = -r * self.slope("variance") / drag
        collisions = n * np.sqrt(theta) / m["tau_c"]
        k = velocity_closures(m["restitution"])
        return {
            "specific_volume": g / n,
            "charge": -self.outflow(c),
            "mean_velocity": -self.outflow(r) + u * q * field - drag * f["mean_velocity"],
            "covariance without collisions": -r * self.slope("charge")
            - g * c
            - self.outflow(t)
            + u * v * field
            - drag * c,
            "variance without collisions": -2.0 * c * self.slope("charge") - self.outflow(flux),
            "covariance_flux without collisions": -2.0 * r * self.slope("covariance")
            - c * self.slope("granular_temperature_tensor")
            - 2.0 * g * t
            + 2.0 * u * flux * field
            - 2.0 * drag * t,
            "covariance_flux_trace without collisions": -2.0 * r * self.slope("covariance")
            - 3.0 * c * self.slope("granular_temperature")
            - 2.0 * g * t
            + 2.0 * u * flux * field
            - 2.0 * drag * f["covariance_flux_trace"],
            "granular_temperature_tensor": 2.0 * u * c * field
            - 2.0 * g * r
            - collisions * (k.isotropy * (r - theta) + k.cooling * theta)
            - 2.0 * drag * r
            - self.outflow(self.third(collisions, drag, k)[0]),
            "granular_temperature": 2.0 / 3.0 * u * c * field
            - 2.0 / 3.0 * g * r
            - collisions * k.cooling * theta
            - 2.0 * drag * theta
            - self.outflow(self.third(collisions, drag, k)[1]) / 3.0,
        }

    def third(self, collisions, drag, k):
        """Return S_xxx and S_mmx in balance."""
        slope = self.slope("granular_temperature_tensor")
        r = self.f["granular_temperature_tensor"]
        whole = k.third_moment * collisions + 3.0 * drag
        part = k.third_moment_trace * collisions
        # R_xx ∂R_xx three times; of the trace R_xl ∂_l R_mm + 2 R_ml ∂_l R_mx
        trace = -(3.0 * r * self.slope("granular_temperature") + 2.0 * r * slope)
        trace = trace / (whole + 5.0 * part)
        return (-3.0 * r * slope - 3.0 * part * trace) / whole, trace


@pytest.mark.parametrize("tau_c", [0.03, 1e12])
def test_along_m_the_equations_are_those_in_x(tau_c):
    # nothing but the rates of collisions is shared with the model: not the calculus, nor the terms
    grid = Grid((192,), (LENGTH,))
    changes = {"tau_c": tau_c, "peclet": np.inf, "tau_sigma": np.inf, "length_ratio": 1e13}
    numbers = HEATED | changes
    state = some_state(grid)
    # with the electric force on T; what else `complete` has vanishes with the diameter
    ours = fourier_rates(full_model(numbers, "complete", name=NAME), grid, state)
    observed = {name: np.asarray(getattr(state, name)).reshape(-1) for name in RANKS}
    moved = mass_coordinate.moved_along(observed | {"field": field_of(state, grid)}, LENGTH)
    eulerian = Eulerian({name: moved[name] for name in (*RANKS, "field")}, LENGTH, numbers)
    expected = eulerian.rates()
    found = mass_coordinate.along_x(
        {name: np.asarray(getattr(ours, name)).reshape(-1) for name in RANKS},
        LENGTH,
        observed["specific_volume"],
    )
    for name, values in expected.items():
        moment, _, rest = name.partition(" ")
        if rest and tau_c < 1.0:
            continue
        np.testing.assert_allclose(
            found[moment], values, rtol=0, atol=2e-9 * np.abs(values).max(), err_msg=name
        )


def field_of(state, grid):
    """Return what solves ∂E/∂m = Q - ⟨Q⟩."""
    calculus = FourierCalculus(grid)
    return np.asarray(grid.to_fields(calculus.electric_field(grid.to_spectral(state.charge))))


def test_rates_can_be_differentiated_where_mechanisms_are_absent():
    grid = Grid((16,), (LENGTH,))
    state = some_state(grid)
    absent = {"tau_p": np.inf, "tau_sigma": np.inf, "peclet": np.inf}

    model = full_model(HEATED | absent, name=NAME)

    def size(part):
        volume = 1.0 + part * (state.specific_volume - 1.0)
        found = fourier_rates(model, grid, replace(state, specific_volume=volume))
        return sum(jnp.sum(getattr(found, name) ** 2) for name in RANKS)

    at, width = jnp.asarray(0.7), 1e-5
    expected = (float(size(at + width)) - float(size(at - width))) / (2.0 * width)
    assert float(jax.grad(size)(at)) == pytest.approx(expected, rel=1e-6)


# ------------------------------------------------------------------ conservation


def test_sums_are_kept_whatever_the_state():
    grid = Grid((48,), (LENGTH,))
    state = some_state(grid)
    found = fourier_rates(full_model(HEATED | {"tau_p": np.inf}, name=NAME), grid, state)
    for name in ("specific_volume", "charge", "mean_velocity"):
        values = getattr(found, name)
        assert abs(float(jnp.mean(values))) < 1e-12 * largest(values), name
    # inelastic collisions and drag take what is told
    found = fourier_rates(full_model(HEATED, name=NAME), grid, state)
    field = field_of(state, grid)[0]
    volume, velocity = state.specific_volume, state.mean_velocity[0]
    centred = jnp.asarray(field) - jnp.mean(field * volume)
    # ∂E/∂t at a particle, but for a constant that makes no work
    moving = field_of(found, grid)[0]
    stored = jnp.mean(centred * moving * volume) + 0.5 * jnp.mean(
        centred**2 * found.specific_volume
    )
    parts = [
        HEATED["energy_ratio"] * float(stored),
        float(jnp.mean(1.5 * found.granular_temperature + velocity * found.mean_velocity[0])),
        float(jnp.mean(found.dissipated_energy)),
    ]
    assert min(map(abs, parts)) > 1e-3
    assert abs(sum(parts)) < 1e-7 * max(map(abs, parts))


def test_both_discretisations_agree():
    differences = []
    for points in (48, 96):
        grid = Grid((points,), (LENGTH,))
        state, model = some_state(grid), full_model(HEATED, name=NAME)
        finite, spectral = (f(model, grid, state) for f in (difference_rates, fourier_rates))
        differences.append([largest(getattr(finite, n) - getattr(spectral, n)) for n in RANKS])
    assert (np.log2(np.divide(*differences)) > 4.5).all()


# ------------------------------------------------------------------ positions


@given(st.integers(0, 10**6), st.floats(0.0, 0.8), st.sampled_from([64, 65]))
def test_positions_there_and_back(seed, size, points):
    grid = Grid((points,), (LENGTH,))
    volume = 1.0 + size * waves(grid, seed, 3)
    fields = {"specific_volume": volume / jnp.mean(volume), "charge": waves(grid, seed + 1, 3)}
    there = mass_coordinate.along_x(fields, LENGTH)
    mass = np.mean(1.0 / there["specific_volume"])
    assert mass == pytest.approx(1.0, abs=1e-3 if size > 0.4 else 1e-6)
    back = mass_coordinate.along_m(there, LENGTH)
    for name, values in fields.items():
        np.testing.assert_allclose(back[name], values, atol=1e-2 if size > 0.4 else 1e-5)


def test_positions_of_a_known_density():
    # x = m + a sin m, so that 1/n = 1 + a cos m
    points, size = 128, 0.3
    m = 2.0 * np.pi * np.arange(points) / points
    volume = 1.0 + size * np.cos(m)
    found = mass_coordinate.along_x({"specific_volume": volume, "own": np.sin(m)}, 1.0)
    x = 2.0 * np.pi * np.arange(points) / points
    own = np.copy(x)
    for _ in range(200):
        own = x - size * np.sin(own)
    np.testing.assert_allclose(found["own"], np.sin(own), atol=1e-12)
    np.testing.assert_allclose(found["specific_volume"], 1.0 + size * np.cos(own), atol=1e-12)


# ------------------------------------------------------------------ runs


def case(**changes):
    told = {
        "title": "moving",
        "model": NAME,
        "closures": "derived",
        "numbers": PAPER | {"tau_c": 0.02, "energy_ratio": 30.0, "restitution": 1.0},
        "grid": {"points": [64]},
        "initial": {
            "charge": [{"mode": [1], "sine": -1.0}, {"mode": [2], "sine": 0.2, "cosine": 0.3}]
        },
        "run": {"t_end": 0.2, "outputs": 2},
    }
    return Case(**told | changes)


def test_a_run_keeps_charge_momentum_and_energy(tmp_path):
    result = solve(case())
    data = result.dataset
    assert data.status == "ok"
    density = data.number_density
    np.testing.assert_allclose(density.mean("x"), 1.0, atol=1e-9)
    np.testing.assert_allclose((density * data.charge).mean("x"), 0.0, atol=1e-9)
    momentum = (density * data.mean_velocity).mean("x")
    assert float(abs(data.mean_velocity).max()) > 0.05
    np.testing.assert_allclose(momentum, 0.0, atol=1e-7)
    assert float(abs(energy_balance(result).drift).max()) < 1e-6
    # Gauss's law in x
    field = data.field.isel(component=0, time=-1).values
    charge = (density * data.charge).isel(time=-1).values
    waves = 2.0 * np.pi * np.arange(33)
    slope = np.fft.irfft(1j * waves * np.fft.rfft(field), 64)
    np.testing.assert_allclose(slope, charge, atol=1e-7)
    # a result is a state to go on from
    half = solve(case(run={"t_end": 0.1, "outputs": 2}))
    half.to_netcdf(tmp_path / "half.nc")
    rest = solve(
        case(initial={"file": str(tmp_path / "half.nc")}, run={"t_end": 0.1, "outputs": 2})
    ).dataset
    for name in ("charge", "covariance", "mean_velocity", "number_density"):
        one, other = rest[name].isel(time=-1), data[name].isel(time=-1)
        np.testing.assert_allclose(one, other, atol=1e-5)
    terms = budget(result)
    for name in ("charge", "mean_velocity"):
        assert np.isfinite(terms[name]).all()


def test_an_interrupted_run_ends_with_the_same_bits(tmp_path):
    # fast enough for steps, so that it takes several segments
    strong = case(
        numbers=PAPER | {"tau_c": 0.1, "restitution": 1.0}, run={"t_end": 0.13, "outputs": 2}
    )
    whole, path = solve(strong), tmp_path / "run.checkpoint"

    def stop(progress):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        solve(strong, checkpoint=path, checkpoint_steps=1, on_progress=stop)
    assert path.exists()
    assert whole.stats["accepted"] > 512
    again = solve(strong, checkpoint=path, resume=True).dataset
    for name in whole.dataset.data_vars:
        np.testing.assert_array_equal(again[name].values, whole.dataset[name].values)


def test_sound():
    # frequent collisions: a wave of the mean velocity oscillates with the speed of sound
    grid = Grid((64,), (1.0,))
    (x,) = grid.coordinates()
    small = 1e-3
    state = at_rest(grid, mean_velocity=small * jnp.asarray(np.cos(2 * np.pi * x))[None])
    model = full_model(PAPER | {"tau_c": 1e-3, "length_ratio": 1e6, "peclet": np.inf}, name=NAME)
    half = 0.5 / np.sqrt(5.0 / 3.0)
    outcome, found = by_fourier(model, state, grid, half, 1e-6, 1e-10)
    assert not bool(outcome.failed)
    amplitude = 2.0 * float(jnp.mean(found.mean_velocity[0] * np.cos(2 * np.pi * x))) / small
    # viscosity 5/4 τ_c Θ, conductivity that of the closed third moment: both damp the wave
    viscosity, conductivity = 1.25e-3, flight_conductivity(1e-3)
    damping = 0.5 * (4.0 / 3.0 * viscosity + 0.4 * conductivity) * (2.0 * np.pi) ** 2
    assert amplitude == pytest.approx(-np.exp(-damping * half), rel=2e-3)


def flight_conductivity(tau_c):
    """Return κ of ∂Θ/∂t = κ ∇²Θ times 3/2, per heat capacity."""
    dispersion = flight_dispersion(
        velocity_closures(1.0), temperature=1.0, collision_rate=1.0 / tau_c
    )
    return dispersion.conductivity()


def test_cold_particles_run_into_each_other():
    # without collisions, pressure and charge velocities stay, and volumes go straight to zero
    grid = Grid((64,), (1.0,))
    (m,) = grid.coordinates()
    cold, wave = 1e-12 * jnp.ones(64), jnp.asarray(np.sin(2.0 * np.pi * m))
    state = at_rest(
        grid,
        granular_temperature=cold,
        granular_temperature_tensor=cold[None, None],
        mean_velocity=wave[None],
    )
    numbers = PAPER | {"tau_c": 1e9, "length_ratio": 1e9, "peclet": np.inf}
    outcome, found = by_fourier(full_model(numbers, name=NAME), state, grid, 1.0, 1e-6, 1e-9)
    assert bool(outcome.stopped["nonphysical"])
    assert float(outcome.time) == pytest.approx((1.0 - 1e-3) / (2.0 * np.pi), rel=1e-5)
    volume = 1.0 + 2.0 * np.pi * float(outcome.time) * np.cos(2.0 * np.pi * m)
    np.testing.assert_allclose(found.specific_volume, volume, atol=1e-6)
    np.testing.assert_allclose(found.mean_velocity[0], wave, atol=1e-6)


@pytest.mark.parametrize("points", [[8, 8], [6, 6, 6]])
def test_it_is_for_one_dimension(points):
    modes = {"charge": [{"mode": [1] * len(points), "sine": 1.0}]}
    with pytest.raises(InputError, match=r"grid\.points is \[.*-flow.*one dimension"):
        case(grid={"points": points}, initial=modes)
