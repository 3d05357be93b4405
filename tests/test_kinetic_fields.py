"""Models beside particles with a field: the kept relaxations, the tables, and what pages say."""

import re

import numpy as np
import pytest

from benchmarks import kinetic_field_runs, kinetic_fields, suitability_reference
from benchmarks.kinetic_field_runs import FILE, Kept, load, plan
from benchmarks.kinetic_fields import error_table, is_like, judge, like, reach
from benchmarks.kinetic_models import Errors, predict, predict_at
from benchmarks.kinetic_particles import MODES, Setting, simulate
from benchmarks.kinetic_runs import SEEDS
from benchmarks.kinetic_tables import with_error
from benchmarks.suitability_reference import PECLET, TAU_C, Beside
from tests.maps import pretended
from triboflux.hierarchy import MODELS, Known


@pytest.fixture(scope="module")
def relaxations():
    return load()


def near(relaxations, energy_ratio, tau_c):
    """Return the relaxations of all thermostats at a point."""
    place = energy_ratio, tau_c
    return [k for k in relaxations.values() if (k.setting.energy_ratio, k.setting.tau_c) == place]


def test_the_file_holds_what_is_planned(relaxations):
    assert set(relaxations) == set(plan())
    assert FILE.stat().st_size < 100_000
    for kept in relaxations.values():
        assert kept.seed == SEEDS[0]
        assert kept.particles == kept.setting.particles
        assert 0.0 < kept.time_error < 0.01 * kept.time
        assert 0.6 < kept.left_out < 1.6


def test_a_kept_relaxation_is_that_of_the_particles():
    setting = Setting(0.5, 1e6, 192.0, 30.0, "full", particles=40_960, dilute=True)
    reference = simulate(setting, 5)
    kept = Kept.from_line(Kept.of(reference).line())
    assert kept.setting == setting
    assert kept.time == pytest.approx(reference.time, rel=1e-5)
    for name in MODES:
        found, wanted = kept.moments[name], reference.moments[name]
        np.testing.assert_allclose(found, wanted.values, atol=1e-5 * np.abs(wanted.values).max())
        assert kept.noise[name] == pytest.approx(wanted.noise, rel=1e-5)


def test_missing_relaxations_are_simulated_and_appended(tmp_path, monkeypatch):
    few = Setting(0.5, 1e6, 192.0, particles=40_960, dilute=True)
    monkeypatch.setattr(kinetic_field_runs, "FILE", tmp_path / "few.jsonl")
    monkeypatch.setattr(kinetic_field_runs, "plan", lambda: (few,))
    kinetic_field_runs.main([])
    (kept,) = load(tmp_path / "few.jsonl").values()
    assert kept.time == pytest.approx(0.1954, abs=5.0 * kept.time_error)
    before = (tmp_path / "few.jsonl").read_bytes()
    monkeypatch.setattr(kinetic_field_runs, "simulate", None)
    kinetic_field_runs.main([])
    assert (tmp_path / "few.jsonl").read_bytes() == before


def test_like_meets_like(relaxations, monkeypatch):
    more = {
        "heated": Known(("charge", "granular_temperature")),
        "moved": Known(("charge", "granular_temperature", "mean_velocity")),
    }
    monkeypatch.setattr(kinetic_fields, "MODELS", MODELS | more)
    assert [like(m) for m in ("full", "heated", "moved")] == ["full", "mean-velocity", "none"]
    strong = near(relaxations, 300.0, 0.1)
    assert [k.setting.thermostat for k in strong if is_like("heated", k)] == ["mean-velocity"]
    # free particles suit all models where a field hardly heats
    weak = near(relaxations, 1.0, 0.1)
    assert [k.setting.thermostat for k in weak if is_like("full", k)] == ["none"]


def test_one_run_serves_several_times():
    setting = Setting(0.1, 1e6, 192.0, 30.0)
    both = predict_at(setting, "gradient", "derived", [0.22, 0.2])
    for at, told in zip((0.22, 0.2), both, strict=True):
        alone = predict(setting, "gradient", "derived", at)
        assert told.time == alone.time
        for name, values in alone.moments.items():
            np.testing.assert_allclose(told.moments[name], values, atol=1e-5)


def test_reach_ends_at_the_first_bad_error(relaxations):
    own = sorted(
        (k for k in relaxations.values() if k.setting.energy_ratio == 0.0),
        key=lambda kept: kept.setting.tau_c,
    )
    errors = [0.01, 0.05, 0.06, None, 0.02, 0.3, 0.4]
    assert reach(dict(zip(own, errors, strict=True))) == "≤ 0.01; 0.1"
    assert reach(dict.fromkeys(own, 0.01)) == "≤ 0.5"
    assert reach(dict.fromkeys(own, 0.1)) == "nowhere"


def test_failures_are_named(relaxations):
    group = near(relaxations, 300.0, 0.1)
    failed = Errors(None, {}, "diverged: because")
    known = Errors(-0.1, {"charge": 0.02, "granular_temperature": 0.3})
    found = {("full", k): failed for k in group} | {("gradient", k): known for k in group}
    text = error_table(group, found, ("full", "gradient"))
    assert "| **diverged [1]** | **-10 · 2 · – · – · Θ 30** |" in text
    assert text.count("diverged [1]") == 3
    assert text.endswith("[1] diverged: because.")


def test_page_holds_what_particles_and_models_say(relaxations):
    text = kinetic_fields.PAGE.read_text(encoding="utf-8")
    section = text.partition("<!-- begin fields -->\n")[2].partition("<!-- end fields")[0]
    for kept in relaxations.values():
        assert f"| {with_error(kept.time, kept.time_error)} |" in section
    group = near(relaxations, 30.0, 0.05)
    errors = judge(group, ("gradient",))
    for line in error_table(group, errors, ("gradient",)).splitlines()[2:]:
        *start, cell = [part.strip() for part in line.strip("| ").split(" | ")]
        (shown,) = (row for row in section.splitlines() if start[-3] in row)
        assert cell in shown


@pytest.mark.parametrize(
    ("by_model", "by_particles", "noise", "told"),
    [
        (0.01, 0.02, 0.002, "confirm"),
        (0.2, 0.1, 0.002, "confirm"),
        (0.01, 0.1, 0.002, "contradict"),
        (0.1, 0.01, 0.002, "contradict"),
        (0.01, 0.053, 0.002, "can't tell"),
        (None, None, 0.002, "confirm"),
        (0.01, None, 0.002, "contradict"),
    ],
)
def test_particles_confirm_or_contradict(by_model, by_particles, noise, told):
    assert Beside("full", 1.0, 0.1, by_model, by_particles, noise).told == told


def test_reach_on_a_map():
    error = np.full((len(PECLET), len(TAU_C)), 0.01)
    status = np.full(error.shape, "ok", dtype=object)
    error[:, 8:] = 0.1
    error[0, 4:], status[0, 4:] = np.nan, "F <= 0"
    error[1, 5:], status[1, 5:] = np.nan, "reduced nonphysical"
    error[2, 0] = 0.2
    axes = ("numbers.peclet", PECLET), ("numbers.tau_c", TAU_C)
    made = pretended(error, status, axes)
    found = [suitability_reference.reach(made, peclet) for peclet in PECLET[:4]]
    wanted = [f"≤ {TAU_C[3]:g}, the end", f"≤ {TAU_C[4]:g}", "nowhere", f"≤ {TAU_C[7]:g}"]
    assert found == wanted


def test_map_is_beside_the_particles():
    text = suitability_reference.PAGE.read_text(encoding="utf-8")
    section = text.partition("<!-- begin third-order -->\n")[2].partition("<!-- end")[0]
    (told,) = re.findall(r"contradict: (\d+) of (\d+)", section)
    bold = re.findall(r"\*\*.*?/.*?\*\*", section)
    assert len(bold) == int(told[0])
    rows = re.findall(r"^\| (?:1|30|300) \| 0\.\d+ \|", section, re.MULTILINE)
    assert 5 * len(rows) == int(told[1])
