"""The third-order model: its equations, its limits, and what follows from the list of terms."""

import json
import math
from functools import cache

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import expm

import triboflux
from benchmarks import variance_flux
from benchmarks.kinetic_beyond import beyond
from benchmarks.kinetic_particles import Setting
from tests.cases import NUMBERS, fake_result
from tests.fields import (
    CASE_B,
    EVERYTHING,
    by_fourier,
    difference_rates,
    fourier_rates,
    full_model,
    largest_difference,
    smooth_state,
)
from tests.in_process import call
from tests.runs import settings
from tests.test_invariants import (
    BOXES,
    LINE,
    WAVES,
    assert_close,
    asymmetric,
    final,
    phase_and_direction,
    plane_wave,
)
from triboflux import closures, models
from triboflux.case import Case
from triboflux.diagnostics import budget
from triboflux.errors import InputError, OutOfRangeError
from triboflux.explorer.profiles import Drawing
from triboflux.grid import Grid
from triboflux.hierarchy import MODELS, RANKS, TRACES, components
from triboflux.initial_state import initial_moments
from triboflux.integrate import integrate
from triboflux.integrators.isotropy import Part
from triboflux.integrators.linear import block_operator
from triboflux.models.third_order import TRACES_OF_PRODUCTS, covariance_flux_terms, trace_of
from triboflux.moments import Moments
from triboflux.numbers import Numbers
from triboflux.rates import scaled_rates

NAME = "third-order"
T, T_MM = "covariance_flux", "covariance_flux_trace"
K = 2.0 * math.pi


def third_order(numbers, closure_set="derived", dimensions=1):
    return full_model(numbers, closure_set, dimensions, name=NAME)


def from_rest(state, dimensions):
    """Return a state with third-order moments that vanish."""
    zero = jnp.zeros(state.charge.shape)
    return state + Moments(
        covariance_flux=jnp.zeros((dimensions, dimensions, *zero.shape)), covariance_flux_trace=zero
    )


# --- equations ------------------------------------------------------------------------------------


def test_the_table_of_models_is_that_of_the_registry():
    assert list(models.REGISTRY) == list(MODELS)
    for name, known in MODELS.items():
        model = models.build(name, Numbers(**NUMBERS))
        assert model.evolves == known.evolves
        assert {term.moment for term in model.closures} == set(known.closes)
        assert {term.moment for term in model.terms} <= set(known.evolves)


@pytest.mark.parametrize("helicity", [0, 1])
def test_the_steady_third_order_moment_is_the_closure_of_the_full_model(helicity):
    # Whatever k is: -K1 T - ... = 0 solved for T, and its divergence put into the equation of C.
    grid = Grid((9,), (0.8,))
    operators = {
        name: block_operator(full_model(EVERYTHING, dimensions=3, name=name), grid)
        for name in (NAME, "full")
    }
    values = {
        name: {
            (e.target, e.source): np.asarray(x)
            for e, x in zip(o.layout.entries, o.entries, strict=True)
        }
        for name, o in operators.items()
    }
    third = [Part(T, 0), Part(T_MM, 0)] if helicity == 0 else [Part(T, 1)]
    covariance, of = Part("covariance", helicity), values[NAME]
    inner = np.array([[of.get((a, b), 0.0 * of[a, a]) for b in third] for a in third])
    made = np.array([of[a, covariance] for a in third])
    back = np.array([of[covariance, a] for a in third])
    steady = np.linalg.solve(np.moveaxis(inner, -1, 0), -made.T[..., None])[..., 0]
    found = of[covariance, covariance] + np.sum(back.T * steady, axis=1)
    expected = values["full"][covariance, covariance]
    # what depends on k
    np.testing.assert_allclose(found - found[0], expected - expected[0], rtol=1e-10)
    assert np.ptp(expected) > 0.1
    assert found[0] == pytest.approx(expected[0])


def test_the_equation_of_the_trace_is_the_trace_of_the_equation():
    # In three dimensions, where the tensor has all its components.
    grid = BOXES[3]
    model = third_order(EVERYTHING, dimensions=3)
    state = smooth_state(grid, 1, third_order=True)
    tensor = state.covariance_flux
    state = eqx.tree_at(lambda s: s.covariance_flux_trace, state, jnp.trace(tensor))
    rates = fourier_rates(model, grid, state)
    trace = jnp.trace(rates.covariance_flux)
    assert_close(rates.covariance_flux_trace, trace, 1e-12)
    terms = covariance_flux_terms(model.coefficients)
    traces = [trace_of(term, TRACES_OF_PRODUCTS) for term in terms]
    assert [trace.name for trace in traces] == [term.name for term in terms]


def test_both_discretisations_agree():
    for dimensions in (1, 2):
        model = third_order(EVERYTHING, dimensions=dimensions)
        differences = []
        for refine in (1, 2):
            grid = Grid(tuple(refine * n for n in (22, 24)[:dimensions]), (0.8, 1.0)[:dimensions])
            state = smooth_state(grid, 2, third_order=True)
            spectral, finite = (f(model, grid, state) for f in (fourier_rates, difference_rates))
            pairs = [(getattr(finite, n), getattr(spectral, n)) for n in model.evolves]
            differences.append([largest_difference(*pair) for pair in pairs])
        order = np.log2(np.divide(*differences))
        assert (order > 5.5).all(), dimensions


def test_without_a_field_it_is_a_matrix_exponential():
    # Written out from the rates, for Q ~ sin, C ~ cos, T ~ sin: the coefficients of section 3.
    numbers = Numbers(**EVERYTHING | {"energy_ratio": 0.0, "tau_sigma": math.inf})
    r = scaled_rates(closures.derived(numbers.restitution), numbers)
    k, e = 2.0 * K / 0.8, numbers.restitution
    k_1 = (1 + e) * (19 - 3 * e) / 30 / numbers.tau_c + 2 / numbers.tau_p
    k_1 += (2 - 2.8 * e) / 6 * r.charge_exchange
    k_2 = -(1 + e) * (1 + 3 * e) / 60 / numbers.tau_c
    g_1, g_2 = r.shear, r.divergence
    matrix = np.array(
        [
            [-k * k / numbers.peclet, (1 + r.collisional_flux) * k, 0, 0],
            [-r.gradient_production * k, -r.covariance_destruction, -k, 0],
            [0, (2 * g_1 + g_2) * k, -k_1, -k_2],
            [0, (2 * g_1 + 3 * g_2) * k, 0, -k_1 - 3 * k_2],
        ]
    )
    grid, time = Grid((16,), (0.8,)), 0.05
    sine, cosine = (f(k * grid.coordinates()[0]) for f in (np.sin, np.cos))
    shapes = dict(zip(["charge", "covariance", T, T_MM], [sine, cosine, sine, sine], strict=True))
    start = np.array([-1.0, 0.3, 0.2, -0.1])
    fields = {n: a * s for (n, s), a in zip(shapes.items(), start, strict=True)}
    state = Moments(
        *map(jnp.asarray, (fields["charge"], fields["covariance"][None], 0.0 * sine)),
        *map(jnp.asarray, (fields[T][None, None], fields[T_MM])),
    )
    model = third_order(vars(numbers) | {})
    found = final(model, state, grid, time)
    # a term of the wrong sign would show at once
    amplitudes = expm(matrix * time) @ start
    for (name, shape), amplitude in zip(shapes.items(), amplitudes, strict=True):
        value = np.squeeze(getattr(found, name))
        np.testing.assert_allclose(value, amplitude * shape, rtol=0, atol=1e-12)
        assert abs(amplitude) > 1e-6


def test_homogeneous_states_decay_as_their_rates_say():
    grid, time = BOXES[2], 0.003
    model = third_order(EVERYTHING, dimensions=2)
    zero = jnp.zeros(grid.points)
    tensor = np.array([[0.4, -0.7], [-0.7, 1.1]])
    one = jnp.ones(grid.points)
    state = Moments(
        zero,
        jnp.stack([0.2 * one, -0.1 * one]),
        0.9 * one,
        jnp.asarray(tensor)[:, :, None, None] * one[None, None],
        2.5 * one,
    )
    found = jax.tree.map(lambda f: np.asarray(f)[..., 0, 0], final(model, state, grid, time))
    c = jax.tree.map(float, model.coefficients)
    trace = 2.5 * math.exp(-c.third_moment_trace * time)
    deviator = (tensor - 2.5 / 3.0 * np.eye(2)) * math.exp(-c.third_moment * time)
    assert found.covariance_flux_trace == pytest.approx(trace, rel=1e-12)
    np.testing.assert_allclose(found.covariance_flux, deviator + trace / 3 * np.eye(2), rtol=1e-11)
    decayed = math.exp(-c.covariance_destruction * time)
    np.testing.assert_allclose(found.covariance, np.array([0.2, -0.1]) * decayed, rtol=1e-12)
    assert found.variance == pytest.approx(0.9 * math.exp(-c.variance_destruction * time))


# --- limits ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("u", [300.0, 0.0], ids=["field", "no field"])
def test_it_tends_to_the_full_model_with_the_collision_time(u):
    # At fixed slow time; what T's memory adds is of fourth order. V lasts as long as Q here.
    grid = Grid((16,), (1.0,))
    state = Moments(-jnp.sin(K * grid.coordinates()[0]), jnp.zeros((1, 16)), jnp.zeros(16))
    differences = []
    for tau_c in (8e-3, 4e-3, 2e-3):
        numbers = CASE_B | {"tau_c": tau_c, "energy_ratio": u, "peclet": 1e9}
        ends = [
            by_fourier(model, start, grid, 4e-3 / tau_c, 1e-10, 1e-13)[1].charge
            for model, start in (
                (full_model(numbers), state),
                (third_order(numbers), from_rest(state, 1)),
            )
        ]
        differences.append(largest_difference(*ends))
    found = -np.diff(np.log2(differences))
    # Measured: 3.67 and 3.94 with a field, 4.03 and 4.01 without.
    assert abs(found[-1] - 4.0) < 0.1
    assert abs(found[-1] - 4.0) < abs(found[0] - 4.0) < 0.4


# --- what holds for every solution ----------------------------------------------------------------


@pytest.mark.parametrize("dimensions", BOXES)
def test_total_charge_is_constant(dimensions):
    grid = BOXES[dimensions]
    state = from_rest(asymmetric(grid, 0.21), dimensions)
    noise = smooth_state(grid, 1, third_order=True)
    state = state + Moments(
        covariance_flux=0.05 * noise.covariance_flux,
        covariance_flux_trace=0.05 * noise.covariance_flux_trace,
    )
    charge = final(third_order(CASE_B, dimensions=dimensions), state, grid, 0.1).charge
    assert abs(float(jnp.mean(charge)) - float(jnp.mean(state.charge))) < 1e-13
    assert float(jnp.max(jnp.abs(charge - state.charge))) > 0.05


@pytest.mark.parametrize("name", ["(1, 1, 1)", "(-1, 2)"])
def test_a_plane_wave_is_the_solution_of_one_dimension(name):
    grid, mode = WAVES[name]
    t_end, d = 0.12, grid.dimensions
    expected = final(third_order(CASE_B), from_rest(plane_wave(LINE, (1,)), 1), LINE, t_end)
    start = from_rest(plane_wave(grid, mode), d)
    found = final(third_order(CASE_B, dimensions=d), start, grid, t_end)
    phase, direction = phase_and_direction(grid, mode)
    place = np.rint(phase / K * LINE.points[0]).astype(int) % LINE.points[0]
    carried = jax.tree.map(lambda f: np.asarray(f)[..., place], expected)
    assert_close(found.charge, carried.charge, 1e-10)
    assert_close(found.covariance, direction * carried.covariance, 1e-10)
    assert_close(found.variance, carried.variance, 1e-10)
    assert_close(found.covariance_flux_trace, carried.covariance_flux_trace, 1e-10)
    # Symmetric about the direction of the wave, and of the trace over three dimensions.
    across = 0.5 * (carried.covariance_flux_trace - carried.covariance_flux[0, 0])
    outer = direction[:, None] * direction[None]
    unit = np.eye(d).reshape((d, d) + (1,) * d)
    tensor = carried.covariance_flux[0, 0] * outer + across * (unit - outer)
    assert_close(found.covariance_flux, tensor, 1e-9)
    assert float(jnp.max(jnp.abs(across))) > 0.01


def test_a_run_can_be_differentiated():
    grid = Grid((8,), (1.0,))
    state = Moments(-jnp.sin(K * grid.coordinates()[0]), jnp.zeros((1, 8)), jnp.zeros(8))

    def amplitude(tau_c):
        numbers = Numbers(**CASE_B).model_copy(update={"tau_c": tau_c})
        model = models.build(NAME, numbers)
        options = settings(0.1, 1e-8, max_steps=64)
        outcome = integrate(model, from_rest(state, 1), grid, options)
        return outcome.carry.coefficients.charge[1, 1]

    single, slope = eqx.filter_jit(amplitude), eqx.filter_jit(jax.grad(amplitude))
    at, width = jnp.asarray(0.1), 1e-4
    expected = (float(single(at + width)) - float(single(at - width))) / (2 * width)
    assert float(slope(at)) == pytest.approx(expected, rel=1e-5)
    assert abs(expected) > 0.01


# --- runs of cases --------------------------------------------------------------------------------


def relaxation(tau_c=0.1, model=NAME, **changes):
    numbers = {"peclet": 1e6, "tau_c": tau_c, "length_ratio": 192.0, "energy_ratio": 0.0}
    tables = {
        "model": model,
        "numbers": numbers | {"restitution": 1.0} | changes.pop("numbers", {}),
        "grid": {"points": changes.pop("points", [32])},
        "initial": changes.pop("initial", {"charge": [{"mode": [1], "sine": -1.0}]}),
        "run": {"t_end": 10.0, "stop_at_peak_charge": 0.5, "outputs": 2} | changes.pop("run", {}),
    }
    return Case(**(tables | changes))


# Stop times of particles without a field in the dilute limit, an Enskog simulation that is not part
# of this package; to half a unit of the last digit and 0.3 %.
PARTICLES = {0.02: 0.611, 0.05: 0.312, 0.1: 0.238, 0.2: 0.210}
TRANSPORTED = {0.02: 0.624, 0.05: 0.324, 0.1: 0.248, 0.2: 0.217}


def test_stop_times_without_a_field_are_those_of_particles():
    for tau_c, particles in PARTICLES.items():
        found = float(triboflux.solve(relaxation(tau_c)).dataset["time"][-1])
        # the same equations, written down independently for one wave
        apart, _ = beyond(Setting(tau_c, 1e6, 192.0, dilute=True), "derived", False).at(found)
        assert found == pytest.approx(apart, rel=1e-5)
        assert found == pytest.approx(TRANSPORTED[tau_c], abs=5e-4)
        assert abs(found / particles - 1.0) < 0.05
    closed = float(triboflux.solve(relaxation(0.2, "full")).dataset["time"][-1])
    assert closed / PARTICLES[0.2] - 1.0 > 0.8


def test_a_flux_of_the_variance_with_an_equation_of_its_own():
    # closed it is the model's; transported it is that where collisions are frequent, and not beyond
    for tau_c, same in ((1e-3, True), (0.1, False)):
        equations = beyond(Setting(tau_c, 1e6, 192.0, dilute=True), "derived", False)
        time = equations.setting.expected_time()
        _, moments = equations.at(time)
        closed, transported = (
            variance_flux.variance(equations, how, time)
            for how in (variance_flux.CLOSED, variance_flux.TRANSPORTED)
        )
        np.testing.assert_allclose(closed, moments["variance"], rtol=1e-6)
        apart = np.linalg.norm(transported - closed) / np.linalg.norm(closed)
        assert (apart < 1e-3) if same else (apart > 0.1)


PLANE = {
    "points": [12, 10],
    "numbers": {"energy_ratio": 300.0},
    "initial": {
        "charge": [{"mode": [1, 0], "sine": -1.0}, {"mode": [1, 2], "cosine": 0.4}],
        "covariance": [{"component": 1, "mode": [0, 1], "sine": 0.1}],
        "variance": [{"mode": [0, 0], "cosine": 0.3}],
    },
    "run": {"t_end": 0.08, "stop_at_peak_charge": None, "outputs": [0.04, 0.0402, 0.0404]},
}


@cache
def whole():
    """Return the result of a run in two dimensions."""
    return triboflux.solve(relaxation(**PLANE))


def test_a_result_holds_every_component_and_its_budget(tmp_path):
    result = whole()
    names = [*components(T, 2), T_MM]
    assert names == ["covariance_flux_xx", "covariance_flux_xy", "covariance_flux_yy", T_MM]
    terms = budget(result, time=0.0402)
    for name in names:
        before, _, after = (result.dataset[name].values[i] for i in range(3))
        total = terms[name].sum(f"{name if name == T_MM else T}_term").values
        np.testing.assert_allclose(total, (after - before) / 4e-4, atol=1e-3 * abs(total).max())
    told = Drawing.of(result).budget(result, 0.0402)["equations"]
    assert [equation["moment"] for equation in told] == ["charge", "covariance", "variance", *names]
    assert [len(equation["terms"]) for equation in told[3:]] == [5] * len(names)
    assert result.dataset.attrs["trace_dimensions"] == 3
    result.to_netcdf(tmp_path / "out.nc")
    again = triboflux.load(tmp_path / "out.nc")
    assert again.dataset.identical(result.dataset)
    for suffix in ("vti", "csv"):
        getattr(result, {"vti": "to_vtk", "csv": "to_csv"}[suffix])(tmp_path / f"out.{suffix}", -1)
        assert b"covariance_flux_xy" in (tmp_path / f"out.{suffix}").read_bytes()


def test_a_run_starts_from_all_moments_of_a_file(tmp_path):
    whole().to_netcdf(tmp_path / "whole.nc")
    found = initial_moments(relaxation(**PLANE | {"initial": {"file": str(tmp_path / "whole.nc")}}))
    last = whole().dataset.isel(time=-1)
    np.testing.assert_array_equal(found[T_MM], last[T_MM])
    for name, (i, j) in components(T, 2).items():
        np.testing.assert_array_equal(found[T][i, j], last[name])
        np.testing.assert_array_equal(found[T][j, i], last[name])
    fake_result(relaxation(**PLANE | {"model": "full"})).to_netcdf(tmp_path / "full.nc")
    start = {"file": str(tmp_path / "full.nc")}
    with pytest.raises(InputError, match="which knows no covariance_flux_xx, but the third-order"):
        initial_moments(relaxation(**PLANE | {"initial": start}))


def test_an_interrupted_run_ends_with_the_same_bits(tmp_path):
    case, path = relaxation(**PLANE), tmp_path / "run.checkpoint"

    def stop(progress):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        triboflux.solve(case, checkpoint=path, checkpoint_steps=1, on_progress=stop)
    assert path.exists()
    again = triboflux.solve(case, checkpoint=path, resume=True).dataset
    for name in whole().dataset.data_vars:
        np.testing.assert_array_equal(again[name].values, whole().dataset[name].values)


def test_it_is_what_the_others_are_compared_with(tmp_path):
    (tmp_path / "case.toml").write_text(relaxation().to_toml(), encoding="utf-8")
    words = ("compare", tmp_path / "case.toml", "--models", "full,third-order", "--format", "json")
    done = call(*words, "-o", tmp_path / "out")
    assert done.code == 0, done
    document = json.loads(done.output)
    assert [row["model"] for row in document["models"]] == [NAME, "full"]
    assert document["reference"] == NAME
    assert document["models"][0]["stop_time"] == pytest.approx(TRANSPORTED[0.1], abs=5e-4)
    assert document["models"][1]["errors"]["charge"]["L2"] > 0.15
    assert (tmp_path / "out" / "case_models.nc").is_file()


def test_the_trace_is_that_of_three_dimensions_with_the_printed_closures_too():
    numbers = Numbers(**NUMBERS | {"energy_ratio": 0.0})
    printed = closures.published(1.0)
    one, three = (models.build(NAME, numbers, printed, dimensions=d).coefficients for d in (1, 3))
    assert one == three
    assert models.trace_dimensions("full", printed, 1) == 1
    assert models.trace_dimensions(NAME, printed, 1) == 3
    assert one.third_moment_trace == one.third_moment + 3 * one.third_moment_coupling


def test_what_has_no_range_of_validity_is_refused():
    # fast charge exchange makes the rate of T negative long before anything else fails
    coefficients = models.build(NAME, Numbers(**NUMBERS)).coefficients
    broken = eqx.tree_at(lambda c: c.third_moment, coefficients, -1.0)
    with pytest.raises(OutOfRangeError, match="K1 of the third-order moment is -1"):
        models.validity(broken, closures.derived(1.0), model_name=NAME)


def test_tensors_have_a_trace():
    assert {name for name, rank in RANKS.items() if rank == 2} == set(TRACES)
    assert list(RANKS) == list(vars(Moments()))
