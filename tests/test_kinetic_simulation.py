"""A simulation of particles from a case to its result."""

import math

import numpy as np
import pytest

import triboflux as tbf
from triboflux.checkpoint import InterruptionError
from triboflux.errors import InputError, OutOfRangeError
from triboflux.kinetic.ensemble import Parameters

NUMBERS = {
    "peclet": 1e6,
    "tau_c": 0.05,
    "energy_ratio": 300.0,
    "length_ratio": 192.0,
    "restitution": 1.0,
}
KINETIC = {"particles": 4000, "ensembles": 4, "seed": 20, "dilute": True}


def small_case(kinetic=None, run=None, initial=None, **numbers):
    return tbf.Case(
        numbers=NUMBERS | numbers,
        grid={"points": [16]},
        initial=initial or {"charge": [{"mode": [1], "sine": -1.0}]},
        run={"t_end": 0.1, "outputs": 3} | (run or {}),
        kinetic=KINETIC | (kinetic or {}),
    )


def test_the_dataset_is_that_of_a_model_with_errors_and_more(tmp_path):
    case = small_case()
    result = tbf.simulate(case)
    model = tbf.solve(case)
    ours, theirs = result.dataset, model.dataset
    assert set(theirs.variables) <= set(ours.variables)
    for name in theirs.data_vars:
        assert ours[name].dims == theirs[name].dims
        error = {"ancillary_variables": f"{name}_standard_error"}
        assert ours[name].attrs == theirs[name].attrs | error
    for name in ("charge", "covariance", "variance", "granular_temperature", "variance_flux"):
        error = ours[f"{name}_standard_error"]
        assert error.dims == ours[name].dims
        assert bool((error > 0.0).all())
    assert ours.attrs["method"] == "kinetic"
    np.testing.assert_allclose(ours["time"], [0.0, 0.05, 0.1], rtol=1e-15)
    result.to_netcdf(tmp_path / "out.nc")
    assert tbf.load(tmp_path / "out.nc").dataset.equals(ours)


def test_at_the_start_the_moments_are_those_of_the_case():
    covariance = [{"component": 0, "mode": [1], "cosine": 0.3}]
    variance = [{"mode": [0], "cosine": 0.5}]
    charge = [{"mode": [1], "sine": -1.0}]
    initial = {"charge": charge, "covariance": covariance, "variance": variance}
    case = small_case({"particles": 50_000, "ensembles": 8}, {"outputs": [0.0]}, initial)
    start = tbf.simulate(case).dataset.isel(time=0)
    x = start["x"].values
    # the cell's average of a wave is that much smaller than the wave in its middle
    averaged = np.sinc(1.0 / 16.0)
    expected = {
        "charge": -averaged * np.sin(2 * np.pi * x),
        "covariance": averaged * 0.3 * np.cos(2 * np.pi * x),
        "variance": np.full(16, 0.5),
        "granular_temperature": np.ones(16),
        "mean_velocity": np.zeros(16),
        "number_density": np.ones(16),
        "field": averaged * (np.cos(2 * np.pi * x)) / (2 * np.pi),
    }
    for name, values in expected.items():
        error = start[f"{name}_standard_error"].values.reshape(16)
        # 112 values with errors from eight ensembles: six of them are seldom passed
        assert np.abs(start[name].values.reshape(16) - values).max() < 6.0 * error.max() + 2e-3


def test_standard_errors_are_the_scatter_of_independent_simulations():
    runs = [
        tbf.simulate(small_case({"seed": seed, "ensembles": 4}, {"outputs": [0.1]})).dataset
        for seed in range(40, 52)
    ]
    charges = np.stack([run["charge"].values[-1] for run in runs])
    stated = np.stack([run["charge_standard_error"].values[-1] for run in runs])
    scatter = charges.std(axis=0, ddof=1)
    ratio = math.sqrt(np.mean(scatter**2) / np.mean(stated**2))
    assert 0.8 < ratio < 1.25


@pytest.mark.parametrize("thermostat", ["full", "mean-velocity", "none"])
def test_a_thermostat_holds_fixed_what_it_says(thermostat):
    case = small_case({"thermostat": thermostat, "particles": 20_000}, {"outputs": [0.1]})
    last = tbf.simulate(case).dataset.isel(time=-1)
    temperature = float(last["granular_temperature"].mean())
    speed = float(np.abs(last["mean_velocity"]).max())
    # at this energy ratio the field would heat the particles by a quarter within the run
    assert (temperature < 1.02) == (thermostat == "full")
    assert (speed > 0.1) == (thermostat == "none")


@pytest.mark.parametrize(("restitution", "tau_p"), [(0.6, math.inf), (1.0, 0.1)])
def test_random_forces_return_what_collisions_and_drag_take(restitution, tau_p):
    """They leave the covariance to decay as at a fixed temperature; scaling would not."""
    still = {
        "covariance": [{"component": 0, "mode": [0], "cosine": 0.9}],
        "variance": [{"mode": [0], "cosine": 1.0}],
    }
    options = {"particles": 100_000, "ensembles": 8}
    numbers = {"restitution": restitution, "tau_p": tau_p, "energy_ratio": 0.0, "tau_c": 0.1}
    case = small_case(options, {"t_end": 0.1, "outputs": 2}, still, **numbers)
    found = tbf.simulate(case).dataset
    covariance = found["covariance"].mean("x").values[:, 0]
    rate = math.log(covariance[0] / covariance[-1]) / 0.1
    # the rate (1+e)/(3 tau_c) + 1/tau_p is the initial one; later decay is a few per cent slower
    expected = (1.0 + restitution) / 0.3 + 1.0 / tau_p
    assert rate == pytest.approx(expected, rel=0.03)
    assert float(found["granular_temperature"].isel(time=-1).mean()) == pytest.approx(1.0, abs=0.01)


def test_the_number_of_threads_does_not_matter_but_the_seed_does():
    one = tbf.simulate(small_case(), workers=1).dataset
    three = tbf.simulate(small_case(), workers=3).dataset
    other = tbf.simulate(small_case({"seed": 21})).dataset
    assert one.equals(three)
    assert not one["charge"].equals(other["charge"])


def test_the_stop_rule_is_located_between_its_checks():
    case = small_case({"particles": 50_000}, {"t_end": 2.0, "stop_at_peak_charge": 0.5})
    result = tbf.simulate(case)
    assert result.status == "ok"
    assert result.stop_reason == "peak charge fell to 0.5"
    stop, error = (result.stats[name] for name in ("stop_time", "stop_time_standard_error"))
    last = float(result.dataset["time"][-1])
    # here there is a check after every step
    assert last - 1.001 * result.dataset.attrs["time_step"] <= stop <= last
    assert float(result.dataset["peak_charge"][-1]) <= 0.5
    model = float(tbf.solve(case).dataset["time"][-1])
    # the model is off by a tenth here
    assert abs(stop - model) < 0.2 * model
    assert 0.0 < error < 0.01 * stop


def test_what_collisions_conserve_is_conserved():
    free = {"mean_field": False, "thermostat": "none", "dilute": False}
    stats = tbf.simulate(small_case(free, tau_sigma=3.0)).stats
    assert stats["charge_drift"] < 1e-14
    assert stats["momentum_drift"] < 1e-14
    assert stats["kinetic_energy_drift"] < 1e-13
    assert stats["largest_probability"] <= 1.0
    # two collision times
    assert stats["collisions_per_particle"] == pytest.approx(2.0, rel=0.05)


def test_an_interrupted_simulation_goes_on_bit_for_bit(tmp_path):
    case = small_case({"thermostat": "none"}, {"t_end": 0.2, "stop_at_peak_charge": 0.3})
    whole = tbf.simulate(case)
    path = tmp_path / "out.nc.checkpoint"
    calls = iter([False, False, True] * 3 + [False] * 10_000)
    for attempt in range(3):
        with pytest.raises(InterruptionError, match="goes on with --resume"):
            tbf.simulate_to_file(
                case,
                tmp_path / "out.nc",
                resume=attempt > 0,
                interrupted=lambda: next(calls),
            )
        assert path.exists()
    resumed = tbf.simulate(case, checkpoint=path, resume=True, checkpoint_steps=1)
    assert resumed.dataset.equals(whole.dataset)
    without = {"seconds"}
    assert {k: v for k, v in resumed.stats.items() if k not in without} == {
        k: v for k, v in whole.stats.items() if k not in without
    }
    assert not path.exists()


def test_gamma_and_beta_follow_from_the_numbers():
    case = small_case({"dilute": False}, tau_sigma=3.0, peclet=1e4)
    p = Parameters.of(case)
    exact = tbf.closures.derived(1.0)
    n = case.numbers
    assert p.diameter == 1.0 / 192.0
    assert p.charge_transfer == pytest.approx(
        exact["transferred_fraction"] * n.tau_c * n.length_ratio**2 / n.peclet, rel=1e-14
    )
    # beta/gamma = pi epsilon_0 d^2, and 6 alpha = Pe (d/L)^2/tau_sigma
    ratio = n.peclet / (n.length_ratio * n.tau_sigma)
    assert p.field_transfer == pytest.approx(p.charge_transfer * ratio, rel=1e-14)
    assert Parameters.of(small_case({"mean_field": False})).energy_ratio == 0.0
    assert Parameters.of(small_case({"dilute": True})).diameter == 0.0


SI_CASE = """
[suspension]
diameter = "1 mm"
density = "935 kg/m^3"
youngs_modulus = "1 GPa"
poisson_ratio = 0.46
restitution = 0.8
solid_fraction = 0.05
granular_temperature = "1e-2 m^2/s^2"
domain_length = "5 cm"
charge_scale = "0.1 uC/kg"
radial_distribution = "lun-savage"
maximum_packing = 0.63
drag = "gidaspow"
[grid]
points = [16]
lengths = ["5 cm"]
[initial]
charge = [{ mode = [1], sine = "-0.1 uC/kg" }]
[run]
t_end = "20 ms"
outputs = ["0 s", "20 ms"]
[kinetic]
particles = 4000
ensembles = 4
time_step = "2 ms"
"""


def test_a_suspension_gives_moments_and_errors_in_si(tmp_path):
    case = tbf.Case.from_toml_text(SI_CASE)
    # L/√Θ is half a second
    assert Parameters.of(case).time_step == pytest.approx(4e-3)
    assert Parameters.of(case).diameter == pytest.approx(0.02)
    tbf.simulate_to_file(case, tmp_path / "out.nc", units="si")
    found = tbf.load(tmp_path / "out.nc")
    scaled = tbf.simulate(case)
    assert (found.units, scaled.units) == ("si", "scaled")
    assert found.stats["steps"] == 10
    np.testing.assert_allclose(found.dataset["time"], [0.0, 0.02], rtol=1e-14)
    mass = 935.0 * math.pi / 6.0 * 1e-9
    factors = {
        "charge": (1e-7 * mass, "C"),
        "covariance": (1e-8 * mass, "C m s-1"),
        "variance": (1e-14 * mass**2, "C2"),
        "number_density": (0.05 * 6.0 / math.pi * 1e9, "m-3"),
        "mean_velocity": (0.1, "m s-1"),
        "granular_temperature": (0.01, "m2 s-2"),
        "variance_flux": (1e-15 * mass**2, "C2 m s-1"),
    }
    for name, (factor, units) in factors.items():
        for key in (name, f"{name}_standard_error"):
            ours, theirs = found.dataset[key], scaled.dataset[key]
            assert ours.attrs["units"] == units
            np.testing.assert_allclose(ours.values, factor * theirs.values, rtol=1e-13)
            assert bool((ours[-1] > 0.0).all()) or not key.endswith("_error")


def test_a_time_step_with_a_unit_needs_a_suspension():
    with pytest.raises(InputError, match=r"kinetic\.time_step is '1 ms', but must be a number in"):
        small_case({"time_step": "1 ms"})


@pytest.mark.parametrize("outputs", [[0.1], [0.0, 0.1]])
def test_particles_that_diverge_leave_the_states_before(tmp_path, outputs):
    """Each collision multiplies charges by 10⁸, and the output to come lies after the overflow."""
    numbers = {"tau_c": 1e-3, "peclet": 1e-6}
    run = {"allow_out_of_range": True}
    case = small_case({"ensembles": 2}, run | {"outputs": outputs}, **numbers)
    begun = small_case({"ensembles": 2}, run | {"outputs": [0.0]}, **numbers)
    found = tbf.simulate(case)
    assert found.status == "diverged"
    assert found.stop_reason == "particles were not finite any longer at t = 0.1"
    assert found.dataset["time"].values.tolist() == [0.0]
    for name, values in tbf.simulate(begun).dataset.isel(time=[0]).data_vars.items():
        assert found.dataset[name].equals(values)
    assert found.stats["collisions"] > 0
    tbf.simulate_to_file(case, tmp_path / "out.nc")
    assert tbf.load(tmp_path / "out.nc").status == "diverged"
    assert tbf.load(tmp_path / "out.nc").dataset["charge"].equals(found.dataset["charge"])
    assert [path.name for path in tmp_path.iterdir()] == ["out.nc"]


def test_a_step_follows_fast_drag():
    """Much longer ones would need random forces beyond the largest number."""
    case = small_case({"particles": 1000, "ensembles": 2}, {"t_end": 1e-4}, tau_p=1e-6)
    assert Parameters.of(case).time_step == pytest.approx(2.5e-7)
    last = tbf.simulate(case).dataset.isel(time=-1)
    assert float(last["granular_temperature"].mean()) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"kinetic": {"thermostat": "ful"}}, r"kinetic.thermostat is 'ful', but must be"),
        ({"kinetic": {"particles": 300}}, "particles"),
        ({"kinetic": {"cells": 40}}, "kinetic.cells is 40, but must be a multiple of"),
        ({"kinetic": {"cells": 1600}}, "at most 200"),
        ({"kinetic": {"ensembles": 1}}, "ensembles"),
        ({"kinetic": {"seed": -1}}, "seed"),
        ({"run": {"stop_at_rate": 1e-3}}, "run.stop_at_rate is 0.001, but must be absent"),
        ({"run": {"stop_at_peak_charge": 2.0}}, "must be below the initial peak"),
        (
            {"initial": {"covariance": [{"component": 0, "mode": [1], "cosine": 0.3}]}},
            "initial.covariance is 0.3 at x = 0, but must be at most the root of the variance",
        ),
    ],
)
def test_bad_input_is_one_sentence(change, sentence):
    with pytest.raises(InputError, match=sentence) as told:
        tbf.simulate(small_case(**change))
    assert "\n" not in str(told.value)


def test_more_dimensions_are_refused():
    case = tbf.Case(numbers=NUMBERS, grid={"points": [8, 8]}, run={"t_end": 1.0})
    with pytest.raises(InputError, match="one space dimension"):
        tbf.simulate(case)


def test_too_many_particles_for_the_memory_are_refused():
    with pytest.raises(InputError, match=r"kinetic\.particles makes .* GiB"):
        tbf.simulate(small_case({"particles": 10**9, "ensembles": 1000}))


def test_collisions_that_pass_over_too_much_charge_are_refused_or_told():
    numbers = {"peclet": 1e3, "tau_c": 0.02, "length_ratio": 1e3, "energy_ratio": 0.0}
    with pytest.raises(OutOfRangeError, match="pass over more than the charge difference"):
        tbf.simulate(small_case(**numbers))
    told = tbf.simulate(small_case(run={"allow_out_of_range": True, "t_end": 1e-3}, **numbers))
    assert "pass over more than the charge difference" in told.warnings[0]
