"""From a case to a result: how runs end, what they record, what they refuse."""

import dataclasses
import math
import re

import numpy as np
import pytest
import xarray as xr

import triboflux
from tests.paper_runs import changed, paper_run
from triboflux import segments
from triboflux.case import Case
from triboflux.diagnostics import budget, model_of
from triboflux.errors import InputError, OutOfRangeError
from triboflux.figures import paper_case
from triboflux.result import load
from triboflux.solve import solve

# t*, max |C|, max V, min V, max |E| from an implicit Runge-Kutta method of a general ODE package.
REFERENCE = {
    (1, "published"): (49.14327836, 1.641612e-3, 0.5119121, 0.1957629, 0.06189542),
    (1, "derived"): (107.95618007, 4.841542e-4, 6.745001e-3, 1.969856e-4, 0.07893295),
    (2, "published"): (0.165301694345, 1.135369, 0.4976017, 0.2921383, 0.06311494),
    (2, "derived"): (0.188441749325, 0.7889075, 0.4711671, 0.2749917, 0.07299470),
}
OBLIQUE = {
    2: [
        {"mode": (1, 2), "sine": 0.6},
        {"mode": (2, -1), "cosine": 0.5},
        {"mode": (1, 0), "sine": 0.3},
    ],
    3: [
        {"mode": (1, 2, -1), "sine": 0.6},
        {"mode": (2, -1, 1), "cosine": 0.5},
        {"mode": (1, 0, 1), "sine": 0.3},
    ],
}


def without_stop(**changes):
    """Return case B without its stop rule; six outputs share a compiled program."""
    times = {"run__stop_at_peak_charge": None, "run__outputs": 6, "run__t_end": 0.3}
    return changed(paper_case(2), **(times | changes))


def oblique(dimensions, points, **run):
    """Return a case without any symmetry, with case B's numbers."""
    return Case(
        numbers=paper_case(2).numbers,
        grid={"points": (points,) * dimensions},
        initial={"charge": OBLIQUE[dimensions]},
        run=run,
    )


# ------------------------------------------------------------------ how runs end


@pytest.mark.parametrize(("number", "closures"), REFERENCE)
def test_papers_cases_at_default_tolerance(number, closures):
    result = paper_run(number, closures)
    last = result.dataset.isel(time=-1)
    covariance, field = np.abs(last["covariance"]), np.abs(last["field"])
    found = [last["time"], covariance.max(), last["variance"].max(), last["variance"].min()]
    found = [float(value) for value in (*found, field.max())]
    # 128 points hold the extremes, which lie at multiples of a quarter of the box
    assert found == pytest.approx(REFERENCE[number, closures], rel=1e-4)
    assert found[0] == pytest.approx(REFERENCE[number, closures][0], rel=1e-6)
    assert (result.status, result.stop_reason) == ("ok", "peak charge fell to 0.5")
    assert float(last["peak_charge"]) == pytest.approx(0.5, rel=1e-6)
    assert 0 < result.stats["accepted"] <= 30
    assert 0 <= result.stats["rejected"] <= 5
    assert result.stats["seconds"] >= 0.0
    assert result.dataset.attrs["trace_dimensions"] == (1 if closures == "published" else 3)


def test_early_stop_keeps_the_outputs_before_it():
    stop = REFERENCE[2, "published"][0]
    # two of them within the step in which the run stops, on either side
    outputs = (0.0, 0.1, stop - 1e-5, stop + 1e-5, 0.17, 0.9)
    result = paper_run(2, run__outputs=outputs)
    times = result.dataset["time"].values
    np.testing.assert_array_equal(times[:-1], outputs[:3])
    assert times[-1] == pytest.approx(stop, rel=1e-6)
    peaks = result.dataset["peak_charge"].values
    assert np.all(np.diff(peaks) < 0.0)
    assert peaks[-2] - peaks[-1] == pytest.approx(-1e-5 * rate_of_peak(result), rel=0.05)


def rate_of_peak(result):
    """Return the rate of change of the peak charge, at three quarters of the box."""
    rate = budget(result)["charge"].sum("charge_term")
    return float(rate.sel(x=0.75))


def test_end_time_ends_a_run():
    result = solve(without_stop())
    assert (result.status, result.stop_reason) == ("ok", "reached t_end = 0.3")
    np.testing.assert_array_equal(result.dataset["time"], np.linspace(0.0, 0.3, 6))


def test_list_of_outputs_and_the_end():
    outputs = (0.05, 0.1, 0.15, 0.2, 0.21, 0.25)
    result = solve(without_stop(run__outputs=outputs))
    np.testing.assert_array_equal(result.dataset["time"], (*outputs, 0.3))
    ending = (0.05, 0.1, 0.15, 0.2, 0.21, 0.3)
    result = solve(without_stop(run__outputs=ending))
    np.testing.assert_array_equal(result.dataset["time"], ending)


def test_rate_of_change_ends_a_run():
    case = without_stop(run__stop_at_rate=0.5, run__outputs=1, run__t_end=20.0)
    result = solve(case)
    assert (result.status, result.stop_reason) == (
        "ok",
        "the rate of change of the charge fell to 0.5",
    )
    assert len(result.dataset["time"]) == 2
    rate = budget(result)["charge"].sum("charge_term").values
    assert math.sqrt(np.mean(rate**2)) == pytest.approx(0.5, rel=1e-5)
    # the charge, at rest at first, has to move before it can come to rest
    assert 0.1 < float(result.dataset["time"][-1]) < 20.0


def test_collapse_of_the_step_is_told():
    calls = []

    def give_up(progress):
        calls.append(progress)
        if len(calls) > 20:
            pytest.fail("the run does not end")

    # the field's work on the particles, which the model lets grow without bound
    case = without_stop(numbers__energy_ratio=1e6, grid__points=(32,))
    result = solve(case, on_progress=give_up)
    assert result.status == "diverged"
    time = float(result.dataset["time"][-1])
    assert 0.0 < time < 0.3
    place = re.fullmatch(
        rf"the step size collapsed at t = {time:.6g}; the covariance, of rms (.*), changes by (.*) "
        r"per unit time at x = (.*)",
        result.stop_reason,
    )
    last = result.dataset.isel(time=-1)
    assert float(place[1]) == pytest.approx(float(np.sqrt((last["covariance"] ** 2).mean())), 0.01)
    rate = budget(result)["covariance"].sum("covariance_term")
    assert float(place[2]) == pytest.approx(float(rate.sel(x=float(place[3])).item()), rel=0.01)
    assert float(np.abs(rate).max()) == pytest.approx(abs(float(place[2])), rel=0.01)
    assert float(result.dataset["time"][0]) == 0.0
    assert float(result.dataset["peak_charge"][-1]) > 1e6
    assert result.stats["rejected"] > 10


@pytest.mark.parametrize("value", [1.0, 1.5])
def test_stop_value_above_the_initial_peak_is_refused(value):
    case = changed(paper_case(1), run__stop_at_peak_charge=value)
    sentence = (
        rf"^run\.stop_at_peak_charge: {value:g} is not allowed; "
        r"it must be below the initial peak charge, 1\.$"
    )
    with pytest.raises(InputError, match=sentence):
        solve(case)


def test_numbers_outside_the_closures_range_are_refused():
    case = changed(paper_case(2), numbers__peclet=1e4)
    with pytest.raises(OutOfRangeError, match=r"^numbers: γΘ\^\(a/2\) = 1\.43") as caught:
        solve(case)
    assert "run.allow_out_of_range = true" in str(caught.value)


def test_warnings_about_the_closures_reach_the_result():
    case = without_stop(numbers__tau_c=0.2, run__t_end=0.01)
    told = [sentence for sentence in solve(case).warnings if "F <= 0" in sentence]
    assert len(told) == 1
    assert "λ' = 12 is inverted" in told[0]


# ------------------------------------------------------------------ what they record


def test_recorded_states_are_those_of_a_run_to_that_time():
    tight = {"run__rtol": 1e-9, "run__atol": 1e-12}
    outputs = (0.0, 0.02, 0.05, 0.1, 0.12, 0.15)
    recorded = paper_run(2, run__outputs=outputs, **tight).dataset
    for end in (0.05, 0.12):
        short = paper_run(2, run__t_end=end, run__outputs=6, **tight)
        assert short.stop_reason == f"reached t_end = {end:g}"
        for name in ("charge", "covariance", "variance", "field"):
            expected = short.dataset[name].isel(time=-1).values
            found = recorded[name].sel(time=end).values
            np.testing.assert_allclose(found, expected, atol=1e-8 * np.max(np.abs(expected)))


def test_initial_state_is_recorded():
    start = paper_run(2).dataset.isel(time=0)
    assert float(start["time"]) == 0.0
    x = start["x"].values
    wave = 2.0 * np.pi
    np.testing.assert_allclose(start["charge"], -np.sin(wave * x), atol=1e-14)
    np.testing.assert_allclose(start["field"][0], np.cos(wave * x) / wave, atol=1e-14)
    np.testing.assert_allclose(start["potential"], -np.sin(wave * x) / wave**2, atol=1e-14)
    assert not np.any(start["covariance"])
    assert not np.any(start["variance"])
    assert float(start["peak_charge"]) == pytest.approx(1.0, rel=1e-14)


def test_peak_charge_is_that_of_the_wave_not_of_the_points():
    # the crest of this wave lies between two of the points
    wave = {"charge": [{"mode": (1,), "sine": 0.6, "cosine": 0.8}]}
    case = without_stop(grid__points=(32,), initial=wave, run__t_end=1e-3)
    dataset = solve(case).dataset
    assert float(np.abs(dataset["charge"][0]).max()) < 0.9995
    assert float(dataset["peak_charge"][0]) == pytest.approx(1.0, rel=1e-12)


def test_round_trip_through_a_file(tmp_path):
    result = paper_run(2, "derived")
    result.to_netcdf(tmp_path / "out.nc")
    again = load(tmp_path / "out.nc")
    xr.testing.assert_identical(again.dataset, result.dataset)
    assert again.case == result.case == paper_case(2, "derived")
    assert (again.status, again.stats, again.warnings) == (
        result.status,
        result.stats,
        result.warnings,
    )


def test_a_run_goes_on_from_a_file(tmp_path):
    outputs = {"run__outputs": 6, "run__rtol": 1e-9, "run__atol": 1e-12}
    first = paper_run(2, run__t_end=0.1, **outputs)
    first.to_netcdf(tmp_path / "start.nc")
    file = {"charge": (), "file": str(tmp_path / "start.nc")}
    case = changed(paper_case(2), initial=file, run__t_end=0.05, **outputs)
    second = solve(case).dataset.isel(time=-1)
    whole = paper_run(2, run__t_end=0.15, **outputs).dataset.isel(time=-1)
    for name in ("charge", "covariance", "variance"):
        scale = float(np.abs(whole[name]).max())
        np.testing.assert_allclose(second[name], whole[name], rtol=0, atol=1e-8 * scale)


# ------------------------------------------------------------------ progress


def test_progress_is_monotone_and_segments_change_nothing(monkeypatch):
    # on the way to this stop value the charge swings: its peak rises again more than once
    case = changed(paper_case(2), run__stop_at_peak_charge=0.02, run__t_end=2.0)
    whole = solve(case)
    assert np.any(np.diff(whole.dataset["peak_charge"]) < 0.0)
    monkeypatch.setattr(segments, "STEPS_SMALL", 4)
    seen = []
    result = solve(case, on_progress=seen.append)
    assert len(seen) > 4
    for name in ("time", "steps", "rejected", "fraction"):
        values = [getattr(progress, name) for progress in seen]
        assert values == sorted(values), name
        assert len(set(values)) == len(values) or name in ("rejected", "fraction")
    peaks = [progress.peak_charge for progress in seen]
    assert peaks != sorted(peaks, reverse=True)
    assert all(0.0 <= progress.fraction <= 1.0 for progress in seen)
    assert {progress.t_end for progress in seen} == {2.0}
    last = seen[-1]
    assert last.fraction == pytest.approx(1.0, abs=1e-5)
    assert last.time == float(result.dataset["time"][-1])
    assert last.peak_charge == float(result.dataset["peak_charge"][-1])
    for statistic, value in (("accepted", last.steps), ("rejected", last.rejected)):
        assert result.stats[statistic] == whole.stats[statistic] == value
    for name in ("time", "charge", "covariance", "variance"):
        np.testing.assert_allclose(result.dataset[name], whole.dataset[name], rtol=0, atol=1e-12)
    assert [field.name for field in dataclasses.fields(last)] == [
        "time",
        "t_end",
        "steps",
        "rejected",
        "peak_charge",
        "fraction",
    ]


# ------------------------------------------------------------------ states of every kind


def test_homogeneous_moments_decay():
    initial = {
        "charge": [{"mode": (0,), "cosine": 0.4}],
        "covariance": [{"mode": (0,), "component": 0, "cosine": 0.2}],
        "variance": [{"mode": (0,), "cosine": 0.3}],
        "neutralising_background": True,
    }
    result = solve(without_stop(initial=initial, closures="derived"))
    c = model_of(result).coefficients
    for state in result.dataset.transpose("time", ...).isel(component=0).groupby("time"):
        time, fields = state
        expected = {
            "charge": 0.4,
            "covariance": 0.2 * math.exp(-c.covariance_destruction * time),
            "variance": 0.3 * math.exp(-c.variance_destruction * time),
            "field": 0.0,
        }
        for name, value in expected.items():
            np.testing.assert_allclose(fields[name], value, rtol=1e-12, atol=1e-14)
    assert result.status == "ok"
    assert result.stats["accepted"] < 5


def test_nothing_stays_nothing():
    result = solve(without_stop(initial={}))
    assert (result.status, result.warnings) == ("ok", ())
    for name in ("charge", "covariance", "variance", "field", "potential", "peak_charge"):
        assert not np.any(result.dataset[name])
    np.testing.assert_array_equal(result.dataset["time"], np.linspace(0.0, 0.3, 6))


def check_oblique(result):
    """Check what holds for any run: finite fields, charge, the field's equations."""
    dataset = result.dataset
    dimensions = result.case.grid.dimensions
    axes = tuple(range(-dimensions, 0))
    assert result.status == "ok"
    assert result.dataset.attrs["trace_dimensions"] == 3
    assert all(np.all(np.isfinite(dataset[name])) for name in dataset.data_vars)
    assert np.max(np.abs(dataset["charge"].values.mean(axis=axes))) < 1e-13
    last = dataset.isel(time=-1)
    waves = 2 * np.pi * np.fft.fftfreq(dataset.sizes["x"], 1.0 / dataset.sizes["x"])
    wave_vector = np.meshgrid(*[waves] * dimensions, indexing="ij")
    field, potential = (np.fft.fftn(last[n].values, axes=axes) for n in ("field", "potential"))
    charge = np.fft.fftn(last["charge"].values)
    scale = np.max(np.abs(charge))
    divergence = sum(1j * k * e for k, e in zip(wave_vector, field, strict=True))
    np.testing.assert_allclose(divergence, charge, rtol=0, atol=1e-12 * scale)
    for k, e in zip(wave_vector, field, strict=True):
        np.testing.assert_allclose(e, -1j * k * potential, rtol=0, atol=1e-12 * scale)
    assert float(last["peak_charge"]) >= float(np.abs(last["charge"]).max()) * (1 - 1e-12)
    assert float(last["peak_charge"]) < float(dataset["peak_charge"][0])


def test_two_dimensions():
    case = oblique(2, 32, t_end=0.12, outputs=6)
    result = solve(case)
    check_oblique(result)
    # with the axes exchanged everything is exchanged
    modes = [mode | {"mode": mode["mode"][::-1]} for mode in OBLIQUE[2]]
    turned = solve(changed(case, initial={"charge": modes})).dataset
    assert float(turned["charge"].isel(time=-1).std()) > 0.1
    for name in ("charge", "covariance", "variance", "field"):
        values = np.swapaxes(result.dataset[name].values, -1, -2)
        values = values[:, ::-1] if name in ("covariance", "field") else values
        scale = np.max(np.abs(values))
        np.testing.assert_allclose(turned[name].values, values, rtol=0, atol=1e-9 * scale)


def test_three_dimensions():
    result = solve(oblique(3, 16, t_end=0.05, outputs=3))
    check_oblique(result)
    assert result.dataset["covariance"].shape == (3, 3, 16, 16, 16)
    assert sum("spectrum along" in sentence for sentence in result.warnings) == 3


def test_solve_is_the_packages():
    assert triboflux.solve is solve
