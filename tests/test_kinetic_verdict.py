"""The models against simulated particles, with few of them, and what docs/verdict.md says of it.

Bounds leave room for the error bars of this reduced effort; the page has the full numbers.
"""

import math

import numpy as np
import pytest

from benchmarks import kinetic_tables, kinetic_verdict
from benchmarks.kinetic_beyond import COMPLETED, TRANSPORTED, Dropped, beyond
from benchmarks.kinetic_models import STREAMING, Prediction, errors_of, free_streaming, predict
from benchmarks.kinetic_particles import (
    ENSEMBLES,
    Setting,
    X,
    free_streaming_time,
    jackknife,
    mean_and_error,
    simulate,
)
from benchmarks.kinetic_runs import (
    CASE_B,
    FEWER,
    FIELD,
    FINER,
    GROUPS,
    SEEDS,
    STRONG,
    WEAK,
    measure,
    plan,
    predict_all,
)
from triboflux import exact
from triboflux.case import MODEL_NAMES, Mode


@pytest.fixture(scope="module")
def runs():
    return measure("reduced")


@pytest.fixture(scope="module")
def predictions(runs):
    return predict_all(runs)


@pytest.fixture(scope="module")
def error_of(runs, predictions):
    def found(setting, model, closure_set):
        reference = runs[setting, SEEDS[0], 1]
        return errors_of(predictions[setting][model, closure_set], reference)

    return found


def test_error_bars_are_small_and_symmetries_hold(runs):
    for reference in runs.values():
        assert 0.0 < reference.time_error < 0.02 * reference.time
        assert reference.moments["charge"].noise < 0.02
        # about 50 scores, of 15 degrees of freedom each, make 1.07 ± 0.13
        assert 0.6 < reference.left_out < 1.6


def test_particles_that_never_collide_stream_freely():
    reference = simulate(Setting(1e4, 1e12, 192.0, dilute=True), 5, 0.5)
    assert reference.time_error < 0.002 * reference.time
    assert reference.time == pytest.approx(free_streaming_time(), abs=4.0 * reference.time_error)
    for name, values in free_streaming(reference.time).moments.items():
        moment = reference.moments[name]
        assert np.all(np.abs(values - moment.values) < 4.5 * moment.errors + 1e-12)
    charge = exact.free_streaming([Mode(mode=(1,), sine=-1.0)], (1.0,), reference.time, [X])
    np.testing.assert_allclose(free_streaming(reference.time).moments["charge"], charge)


def test_full_model_with_derived_closures_holds_at_small_collision_times(error_of):
    """Its t* is 2 % late: the closures take the first Sonine polynomial only."""
    weak = error_of(WEAK[1], "full", "derived")
    assert 0.0 < weak.time < 0.045
    assert weak.moments["variance"] < 0.05
    assert abs(error_of(STRONG[1], "full", "derived").time) < 0.03


def test_published_closures_fail_where_charge_is_exchanged(error_of):
    assert error_of(WEAK[1], "full", "published").moments["variance"] > 0.25
    strong = error_of(STRONG[1], "full", "published")
    assert 0.14 < strong.time < 0.23
    assert strong.moments["variance"] > 10.0
    assert error_of(STRONG[1], "algebraic", "published").time is None
    assert "nonphysical" in error_of(STRONG[1], "algebraic", "published").remark


def test_models_are_ordered_by_what_they_keep(error_of):
    for setting in (WEAK[2], STRONG[2]):
        full, gradient, collisional = (
            abs(error_of(setting, model, "derived").time)
            for model in ("full", "gradient", "collisional")
        )
        assert 0.2 < full < 0.4 < gradient < 0.7 < collisional


def test_hierarchy_and_not_its_coefficients_fails_at_large_collision_times(error_of):
    assert error_of(WEAK[3], "full", "derived").time > 5.0
    assert error_of(WEAK[3], "gradient", "derived").time < -0.9
    assert abs(error_of(WEAK[3], STREAMING, "").time) < 0.045
    for setting in (WEAK[2], WEAK[3], STRONG[2]):
        assert abs(error_of(setting, TRANSPORTED, "derived").time) < 0.07


def test_dropped_terms_are_missed_in_dense_suspensions(predictions):
    """An error of 0.1 % and narrow cells are needed here, thus more particles."""
    reference = simulate(STRONG[1], SEEDS[0], 0.3)
    assert reference.time_error < 0.0015 * reference.time
    without, completed = (
        abs(errors_of(predictions[STRONG[1]][model, "derived"], reference).time)
        for model in (TRANSPORTED, COMPLETED)
    )
    assert completed < 0.5 * without


def test_weak_field_heats_by_less_than_a_percent(runs, error_of):
    for setting in FIELD:
        temperature = runs[setting, SEEDS[0], 1].moments["granular_temperature"]
        assert 0.0 < temperature.values.mean() - 1.0 < 0.01
    assert abs(error_of(FIELD[0], "full", "derived").time) < 0.06


def test_models_break_realizability_in_case_b_and_particles_do_not(runs, predictions):
    excess = {
        name: np.max(found.moments["covariance"] ** 2 - found.moments["variance"])
        for name in ("derived", "published")
        for found in [predictions[CASE_B[0]]["full", name]]
    }
    assert excess["published"] > 3.0 * excess["derived"] > 0.0
    for setting in CASE_B:
        moments = runs[setting, SEEDS[0], 1].moments
        covariance, variance = moments["covariance"], moments["variance"]
        margin = variance.values - covariance.values**2 / moments["granular_temperature_xx"].values
        error = np.hypot(2.0 * covariance.values * covariance.errors, variance.errors)
        assert np.all(margin > -4.0 * error)


def test_transported_equations_become_the_full_model():
    """As τ_c → 0 T follows its closure, and V is that of the solver."""
    setting = Setting(1e-3, 200.0, 50.0)
    solved = predict(setting, "full", "derived", 1.5)
    time, moments = beyond(setting, "derived", False).at(1.5)
    assert time == pytest.approx(solved.time, rel=1e-5)
    for name, values in solved.moments.items():
        np.testing.assert_allclose(moments[name], values, atol=1e-4 * np.abs(values).max())


def test_dropped_terms_vanish_where_no_charge_is_exchanged():
    setting = Setting(0.1, 1e12, 192.0)
    largest = max(abs(value) for value in vars(Dropped.of(setting)).values())
    assert largest < 1e-6
    assert set(vars(Dropped.none()).values()) == {0.0}


def test_standard_errors():
    values = np.random.default_rng(1).normal(2.0, 3.0, (400, 5))
    mean, error = mean_and_error(values)
    assert np.all(np.abs(mean - 2.0) < 4.0 * 3.0 / 20.0)
    np.testing.assert_allclose(error, 3.0 / 20.0, rtol=0.15)
    left = [np.delete(values, i, axis=0).mean(axis=0) for i in range(len(values))]
    np.testing.assert_allclose(jackknife(left), error)


def test_percentages():
    shown = [kinetic_tables.percent(value) for value in (0.00123, 0.0996, 1.234, 1e5)]
    assert shown == ["0.12", "10", "123", "> 1000"]
    assert kinetic_tables.percent(-0.0167, signed=True) == "-1.7"


def test_everything_is_planned():
    full = plan("full")
    assert len(set(full)) == len(full)
    settings = {setting for group in GROUPS.values() for setting in group}
    assert {s for s, seed, finer in full if (seed, finer) == (SEEDS[0], 1)} == {
        *settings,
        *FIELD,
        *CASE_B,
        *FEWER,
    }
    assert {s for s, _, finer in full if finer == 2} == set(FINER)
    assert set(plan("reduced")) < set(full)
    assert all(setting.transferred_fraction < 0.25 for setting in settings)


def test_page_is_written(runs, predictions, monkeypatch, tmp_path, capsys):
    page = tmp_path / "verdict.md"
    page.write_text(kinetic_verdict.PAGE.read_text(encoding="utf-8"), encoding="utf-8")
    monkeypatch.setattr(kinetic_verdict, "PAGE", page)
    monkeypatch.setattr(kinetic_verdict, "IMAGES", tmp_path / "images")
    monkeypatch.setattr(kinetic_verdict, "measure", lambda effort, told: runs)
    monkeypatch.setattr(kinetic_verdict, "predict_all", lambda found: predictions)
    asked = []
    monkeypatch.setattr(kinetic_verdict.kinetic_closures, "main", asked.append)
    kinetic_verdict.main(["--effort", "reduced", "--write"])
    assert asked == [["--effort", "reduced", "--write"]]
    assert capsys.readouterr().out == ""
    text = page.read_text(encoding="utf-8")
    assert "--effort reduced --write`" in text
    for name, section in kinetic_verdict.sections(runs, predictions).items():
        assert f"<!-- begin {name} -->\n{section}\n<!-- end {name} -->" in text
    figures = sorted(path.name for path in (tmp_path / "images").iterdir())
    assert figures == sorted(
        f"verdict-{name}.png" for name in ("profiles", "times", "streaming", "field")
    )
    assert all(f"images/{name}" in text for name in figures)


def test_error_table_names_reasons(runs):
    reference = runs[WEAK[1], SEEDS[0], 1]
    known = {(model, "derived"): Prediction(2.0 * reference.time) for model in MODEL_NAMES}
    known["full", "published"] = Prediction(None, remark="refused: because")
    text = kinetic_tables.error_table(runs, {WEAK[1]: known}, WEAK[1:2])
    lines = text.splitlines()
    assert lines[3].startswith("| ")
    assert "| full | +100 | – | – | – | – [1] |" in text
    assert lines[-1] == "[1] refused: because."


def test_page_holds_what_the_models_say():
    """The errors of t* on the page follow from the particles' t* beside them."""
    text = kinetic_verdict.PAGE.read_text(encoding="utf-8")
    section = text.partition("<!-- begin summary -->\n")[2].partition("<!-- end")[0]
    lines = [line.split("|")[1:-1] for line in section.splitlines()[2:] if line.startswith("|")]
    settings = [setting for group in GROUPS.values() for setting in group]
    assert len(lines) == len(settings)
    for cells, setting in zip(lines, settings, strict=True):
        assert float(cells[1]) == setting.tau_c
        time = float(cells[2].split("±")[0])
        assert float(cells[2].split("±")[1].split("%")[0]) <= 1.0
        found = predict(setting, "full", "derived", 0.5 * time)
        shown = float(cells[3])
        assert shown == pytest.approx(100.0 * (found.time / time - 1.0), abs=0.06, rel=0.02)


def test_ensembles_give_an_error_of_the_error():
    assert ENSEMBLES >= 8
    assert math.sqrt(0.5 / (ENSEMBLES - 1)) < 0.2
