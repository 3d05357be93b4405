"""Collision coefficients of the velocities' moments: by algebra, sampled, and in particles."""

import math

import numpy as np
import pytest
import sympy

from benchmarks import velocity_algebra as algebra
from benchmarks import velocity_particles
from benchmarks.collision_algebra import E
from triboflux import sampling
from triboflux.kinetic.ensemble import Ensemble, Parameters
from triboflux.sampling import colliding_pairs
from triboflux.velocity_closures import (
    TensorDispersion,
    VelocityClosures,
    flight_dispersion,
    third_moment,
    velocity_closures,
)

CHANCE = 4.0
ROOT_PI = math.sqrt(math.pi)
RATE, DRAG, DENSITY = sympy.symbols("rate drag density", positive=True)


# ------------------------------------------------------------------ algebra


def closed_forms():
    """Return the closed forms by the names of the algebra."""
    own = velocity_closures(E)
    shift = sympy.sqrt(sympy.pi)
    transfer = {f"transfer_{name}": value for name, value in own.transfer._asdict().items()}
    return transfer | {
        "cooling": own.cooling,
        "cooling_by_temperature": 3 * own.cooling / 2,
        "isotropy": own.isotropy,
        "third_moment": own.third_moment,
        "third_moment_trace": own.third_moment_trace,
        "transfer_flux": own.transfer_flux,
        "transfer_loss": own.transfer_loss,
        "flux_shift_divergence": shift * own.flux_shift,
        "flux_shift_heat": shift * own.flux_shift / 2,
        "flux_shift_heat_gradient": shift * own.flux_shift / 2,
        "momentum_shift_divergence": shift * own.momentum_shift * 2,
        "momentum_shift_trace": shift * own.momentum_shift,
        "production_shift_gradient": shift * own.production_shift,
        "production_shift_divergence": shift * own.production_shift,
        "production_shift_trace": shift * own.production_shift / 2,
    }


def test_algebra_gives_the_closed_forms():
    found, expected = algebra.exact_forms(), closed_forms()
    assert found.keys() == expected.keys()
    wrong = {name for name in found if sympy.simplify(found[name] - expected[name]) != 0}
    assert not wrong


def test_third_hermite_tensors_make_the_third_moment_and_no_drift():
    drift, left = algebra.third_hermite_moments()
    assert not any(drift)
    assert not any(left)


def test_held_mean_velocity_leaves_the_usual_production():
    assert not any(algebra.production_left_over())


def test_forms_follow_the_collision_rule(monkeypatch):
    """With the momentum of two collisions the cooling (1 − e²)/3 becomes another."""
    right = algebra.collide

    def twice(velocities, charges, direction, **named):
        after = right(velocities, charges, direction, **named)
        return after._replace(velocity_1=2 * after.velocity_1 - velocities[0])

    monkeypatch.setattr(algebra, "collide", twice)
    algebra.after.cache_clear()
    try:
        answer = algebra.average(sum(sympy.expand(algebra.change((i, i))) for i in range(3)))
    finally:
        algebra.after.cache_clear()
    # 2 κ² − κ with the kick κ = 1 + e in place of (1 + e)/2, times 4/3
    assert sympy.simplify(algebra.in_collisions(answer) - 4 * (1 + E) * E) == 0


def test_known_limits():
    """Chapman & Cowling's for elastic spheres; 24 α g0 is the density number."""
    elastic = velocity_closures(sympy.Integer(1))
    heat = elastic.third_moment + 5 * elastic.third_moment_trace
    assert elastic.cooling == 0
    assert elastic.isotropy == sympy.Rational(4, 5)
    assert heat == elastic.isotropy * 2 / 3
    packing = DENSITY / 24
    flight = flight_dispersion(
        elastic, temperature=1, collision_rate=RATE, density_number=DENSITY
    ).conductivity()
    dilute = sympy.Rational(25, 8) / RATE
    enskog = dilute * (1 + sympy.Rational(12, 5) * packing) ** 2
    assert sympy.simplify(flight - enskog) == 0
    # d²/τ_c² is (24 α g0)²/π, hence (32/25π) (b ρ χ)² of the dilute value
    collisional = elastic.transfer.conductivity() * DENSITY**2 / sympy.pi / RATE
    dense = dilute * 32 / (25 * sympy.pi) * (4 * packing) ** 2
    assert sympy.simplify(collisional - dense) == 0


def test_transfer_of_elastic_spheres_conserves_energy():
    """What C(c²) answers to ∇²Θ is the divergence of the flux, and for e < 1 a loss besides."""
    own = velocity_closures(E)
    whole = own.transfer.conductivity()
    assert sympy.simplify(whole - own.transfer_flux - own.transfer_loss) == 0
    assert own.transfer_loss.subs(E, 1) == 0
    isotropic, hessian = own.transfer.of_temperature()
    assert sympy.simplify(isotropic - (1 + E) * (1 + 3 * E) / 120) == 0
    assert sympy.simplify(hessian - 2 * isotropic) == 0


# ------------------------------------------------------------------ the closure of S


def wave_answer(operator, wave, tensor):
    """Return the operator applied to a wave of R, as minus its Fourier factor."""
    along = tensor @ wave
    trace = np.trace(tensor)
    return (
        operator.laplacian * (wave @ wave) * tensor
        + operator.gradient_divergence * (np.outer(wave, along) + np.outer(along, wave))
        + operator.double_divergence * (wave @ along) * np.eye(3)
        + operator.trace_hessian * np.outer(wave, wave) * trace
        + operator.trace_laplacian * (wave @ wave) * np.eye(3) * trace
    )


def with_two_others(tensor):
    """Return M_ijk + M_jik + M_kij of an M that is symmetric in its last two indices."""
    return tensor + tensor.transpose(1, 0, 2) + tensor.transpose(1, 2, 0)


@pytest.mark.parametrize("restitution", [1.0, 0.8, 0.3])
@pytest.mark.parametrize("density", [0.0, 1.7])
def test_flight_dispersion_is_the_flux_of_the_closed_third_moment(restitution, density):
    """A wave of R with i k for ∂, tensor by tensor instead of the five factors."""
    random = np.random.default_rng(4)
    own = velocity_closures(restitution)
    wave, tensor = random.standard_normal(3), random.standard_normal((3, 3))
    tensor, unit = tensor + tensor.T, np.eye(3)
    temperature, rates = 1.3, {"collision_rate": 0.7, "drag_rate": 0.2}
    gradient = with_two_others(wave[:, None, None] * tensor)
    divergence = with_two_others((tensor @ wave)[:, None, None] * unit)
    trace = with_two_others(wave[:, None, None] * unit * np.trace(tensor))
    more = density * own.production_shift
    production = -temperature * ((1 + more) * gradient + more * (divergence + trace / 2))
    traces = np.einsum("imm->i", production)
    third = third_moment(production, with_two_others(traces[:, None, None] * unit), own, **rates)
    heat = np.einsum("imm->i", third)
    # production and destruction are in balance, with the traces that it has itself
    destroyed = 0.7 * (
        own.third_moment * third
        + own.third_moment_trace * with_two_others(heat[:, None, None] * unit)
    )
    np.testing.assert_allclose(production, destroyed + 0.6 * third, atol=1e-12)
    # i k times i k is −k k
    flux = np.einsum("k,ijk->ij", wave, third)
    beyond = density * own.flux_shift
    flux = (1 + beyond) * flux + beyond / 2 * (
        unit * (wave @ heat) + np.outer(wave, heat) + np.outer(heat, wave)
    )
    operator = flight_dispersion(own, temperature=temperature, density_number=density, **rates)
    np.testing.assert_allclose(wave_answer(operator, wave, tensor), -flux, atol=1e-12)


def test_operators_add_and_reduce_to_one_axis():
    operator = TensorDispersion(1.0, 2.0, 3.0, 5.0, 7.0)
    doubled = operator.plus(operator)
    assert doubled == operator.times(2.0)
    tensor, axis = np.diag([1.0, 0.5, 0.25]), np.array([1.0, 0.0, 0.0])
    answer = wave_answer(operator, axis, tensor)
    (own, by_trace), (of_trace, trace) = operator.along_axis()
    assert answer[0, 0] == own * 1.0 + by_trace * 1.75
    assert np.trace(answer) == of_trace * 1.0 + trace * 1.75
    isotropic, hessian = operator.of_temperature()
    np.testing.assert_array_equal(
        wave_answer(operator, axis, np.eye(3)), np.diag([isotropic + hessian, *[isotropic] * 2])
    )
    assert operator.conductivity() == isotropic + hessian / 3


@pytest.mark.parametrize("diameter", [0.0, 0.003])
def test_slow_waves_of_the_moment_equations_decay_by_conduction(diameter):
    """The operator that simulated particles are compared with, at τ_c k = 0.0006."""
    setting = velocity_particles.Setting(diameter, 1e-4, 1.0)
    own, number = velocity_closures(1.0), ROOT_PI * diameter / setting.tau_c
    flight = flight_dispersion(own, temperature=1.0, collision_rate=1e4, density_number=number)
    whole = flight.plus(own.transfer.times(diameter**2 / setting.tau_c)).conductivity()
    slowest = max(np.linalg.eigvals(velocity_particles.moment_matrix(setting)).real)
    np.testing.assert_allclose(slowest, -whole * (2.0 * math.pi) ** 2, rtol=2e-3)


# ------------------------------------------------------------------ sampled collisions


def expected_answers(own: VelocityClosures):
    """Return what single components of C(ψ) answer to single components of a cause."""
    t, f, p = own.transfer, ROOT_PI * own.flux_shift, ROOT_PI * own.production_shift
    isotropic, hessian = t.of_temperature()
    return {
        "Θ: cc": -3.0 * own.cooling,
        "R_xy: xy": -own.isotropy,
        "R_xx - R_yy: cc": 0.0,
        "S_xyz: xyz": -own.third_moment,
        "S_xxx: xxx": -own.third_moment - 3.0 * own.third_moment_trace,
        "S_xxx: xyy": -own.third_moment_trace,
        "dx Θ: xx": 0.0,
        "dx Θ: x": -5.0 * ROOT_PI * own.momentum_shift,
        "dx dx Θ: xx": isotropic + hessian,
        "dx dx Θ: yy": isotropic,
        "dx dx R_xx: xx": sum(t) + t.gradient_divergence,
        "dx dx R_xx: yy": t.double_divergence + t.trace_laplacian,
        "dx dx R_yy: yy": t.laplacian + t.trace_laplacian,
        "dx dx R_yy: xx": t.trace_hessian + t.trace_laplacian,
        "dx dx R_yy: zz": t.trace_laplacian,
        "dx S_xyy: xx": -1.5 * f,
        "dx S_xyy: yy": -1.5 * f,
        "dx S_xyy: zz": -0.5 * f,
        "dx R_xx: xxx": -7.5 * p,
        "dx R_xx: xyy": -1.5 * p,
        "dx R_yy: xyy": -1.5 * p,
        "dx R_yy: xzz": -0.5 * p,
    }


def causes(pairs):
    """Return the factors that f1 f2 is multiplied with, each for a unit of its cause."""
    first, second, (k_x, _, _), _ = pairs
    both = (first, second)
    x, y, z = second
    warmer = 0.5 * (x**2 + y**2 + z**2 - 3.0)
    wide, high = 0.5 * (x**2 - 1.0), 0.5 * (y**2 - 1.0)
    return {
        "Θ": np.ones_like(x),
        "R_xy": sum(c[0] * c[1] for c in both),
        "R_xx - R_yy": sum(0.5 * (c[0] ** 2 - c[1] ** 2) for c in both),
        "S_xyz": sum(c[0] * c[1] * c[2] for c in both),
        "S_xxx": sum(c[0] * (c[0] * c[0] - 3.0) / 6.0 for c in both),
        "dx Θ": k_x * warmer,
        "dx dx Θ": 0.5 * k_x**2 * warmer,
        "dx dx R_xx": 0.5 * k_x**2 * wide,
        "dx dx R_yy": 0.5 * k_x**2 * high,
        "dx S_xyy": k_x * x * high,
        "dx R_xx": k_x * wide,
        "dx R_yy": k_x * high,
    }


def changes(pairs, restitution):
    """Return the changes of the first particle's moments; the odd ones less the force's share."""
    after = sampling.collide(
        (pairs.first, pairs.second),
        (0.0, 0.0),
        pairs.direction,
        restitution=restitution,
        charge_transfer=0.0,
    ).velocity_1
    drift = after[0] - pairs.first[0]

    def change(moment):
        return moment(*after) - moment(*pairs.first)

    found = {
        "x": drift,
        "xx": change(lambda x, y, z: x * x),
        "yy": change(lambda x, y, z: y * y),
        "zz": change(lambda x, y, z: z * z),
        "xy": change(lambda x, y, z: x * y),
        "xyz": change(lambda x, y, z: x * y * z),
        "xxx": change(lambda x, y, z: x * x * x) - 3.0 * drift,
        "xyy": change(lambda x, y, z: x * y * y) - drift,
        "xzz": change(lambda x, y, z: x * z * z) - drift,
    }
    return found | {"cc": found["xx"] + found["yy"] + found["zz"]}


def sampled_answers(restitutions, batches=256, size=2**13, seed=11):
    """Return mean and standard error of every answer, for each restitution."""
    generator = np.random.default_rng(seed)
    names = list(expected_answers(velocity_closures(1.0)))
    means = {e: np.empty((batches, len(names))) for e in restitutions}
    for batch in range(batches):
        pairs = colliding_pairs(size, generator)
        weights = causes(pairs)
        for e in restitutions:
            change = changes(pairs, e)
            for column, name in enumerate(names):
                cause, moment = name.split(": ")
                means[e][batch, column] = np.mean(weights[cause] * change[moment])
    return {
        e: {
            name: (column.mean(), column.std(ddof=1) / math.sqrt(batches))
            for name, column in zip(names, found.T, strict=True)
        }
        for e, found in means.items()
    }


def test_sampled_collisions_agree():
    for restitution, found in sampled_answers((1.0, 0.8)).items():
        expected = expected_answers(velocity_closures(restitution))
        scores = {}
        for name, (value, error) in found.items():
            off = value - expected[name]
            scores[name] = 0.0 if abs(off) < 1e-12 else off / error
            assert error < 0.05 * max(abs(expected[name]), 0.1), name
        far = {name: z for name, z in scores.items() if abs(z) > CHANCE}
        assert not far, restitution
        assert 0.3 < np.mean(np.square(list(scores.values()))) < 2.5


# ------------------------------------------------------------------ simulated particles


def homogeneous(velocities, restitution):
    """Return an ensemble of particles in one cell that collide once a unit of time."""
    particles = np.zeros((len(velocities), 5))
    particles[:, 1:4] = velocities - velocities.mean(axis=0)
    particles[:, 0] = np.random.default_rng(1).random(len(velocities))
    parameters = Parameters(
        points=1,
        cells=1,
        length=1.0,
        diameter=0.0,
        collision_rate=1.0,
        restitution=restitution,
        exponent=0.8,
        charge_transfer=0.0,
        field_transfer=0.0,
        energy_ratio=0.0,
        drag_rate=0.0,
        time_step=0.05,
        thermostat="none",
    )
    words = np.random.SeedSequence(2).generate_state(4, np.uint64)
    return Ensemble(parameters, particles, words)


def mean_and_error(values):
    return values.mean(), values.std() / math.sqrt(len(values))


def test_simulated_particles_forget_anisotropy_and_skewness():
    random, number, time = np.random.default_rng(3), 200_000, 1.0
    velocities = random.standard_normal((number, 3)) * np.sqrt([1.2, 0.8, 1.0])
    # of variance 1 and third moment 1/2
    skewed = (random.gamma(16.0, size=number) - 16.0) / 4.0
    velocities[:, 2] = skewed
    own = velocity_closures(1.0)
    ensemble = homogeneous(velocities, 1.0)
    ensemble.advance(20, time / 20)
    x, y, z = ensemble.particles[:, 1:4].T
    value, error = mean_and_error(x**2 - y**2)
    assert error < 0.005
    assert abs(value - 0.4 * math.exp(-own.isotropy * time)) < CHANCE * error
    heat = math.exp(-(own.third_moment + 5.0 * own.third_moment_trace) * time)
    traceless = math.exp(-own.third_moment * time)
    value, error = mean_and_error(z * (x**2 + y**2 + z**2))
    assert error < 0.015
    assert abs(value - 0.5 * heat) < CHANCE * error
    value, error = mean_and_error(z**3)
    assert abs(value - 0.5 * (0.6 * heat + 0.4 * traceless)) < CHANCE * error


def test_simulated_particles_cool_as_haff_says():
    """With the fourth moment of Maxwell, which the true one leaves by a percent."""
    random, number, time = np.random.default_rng(5), 200_000, 2.0
    ensemble = homogeneous(random.standard_normal((number, 3)), 0.8)
    ensemble.advance(40, time / 40)
    value, error = mean_and_error(np.sum(ensemble.particles[:, 1:4] ** 2, axis=1) / 3.0)
    expected = (1.0 + 0.5 * velocity_closures(0.8).cooling * time) ** -2
    assert error < 0.002
    assert abs(value - expected) < CHANCE * error
