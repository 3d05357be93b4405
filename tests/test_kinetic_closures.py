"""Simulated particles confirm the derived coefficients, contradict printed ones and any altered."""

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks import kinetic_closures as dynamics
from benchmarks import kinetic_slopes as slopes
from benchmarks.kinetic_closures import Effort, Measured, judge
from triboflux import closures

NAMES = (*dynamics.TESTED, *dynamics.CONSEQUENCES)
TINY = Effort(30, 1, 1, 10, 10, (1, 2, 1), (1, 1, 2))


@pytest.fixture(scope="module")
def found():
    return dynamics.measure("reduced")


@pytest.fixture
def tiny(monkeypatch):
    monkeypatch.setitem(dynamics.EFFORTS, "reduced", TINY)


def altered(name, derived=closures.derived):
    """Return a closure set that differs from the exact one in one coefficient."""

    def closure(restitution):
        exact = derived(restitution)
        right = exact.coefficients[name]
        wrong = right.value + math.copysign(0.03 + 0.2 * abs(right.value), right.value)
        return replace(
            exact, coefficients={**exact.coefficients, name: replace(right, value=wrong)}
        )

    return closure


def test_derived_set_is_confirmed(found):
    verdict = judge(found, closures.derived)
    assert verdict.degrees == 63
    assert verdict.passed(), verdict


def test_published_set_is_contradicted(found):
    assert not judge(found, closures.published).passed()
    wrong = dynamics.contradicted([found])
    for name in ("covariance_production_field", "variance_regain", "third_moment_shear"):
        assert name in wrong
    for name in ("triboconductivity", "charge_exchange", "variance_production_field"):
        assert name not in wrong


@pytest.mark.parametrize(
    "name", [name for name in dynamics.TESTED if name in closures.derived(1.0).coefficients]
)
def test_altered_coefficient_is_contradicted(found, name):
    assert not judge(found, altered(name)).passed()


@pytest.mark.parametrize(
    ("name", "off"), [("collision_rate", 0.35), ("third_moment_exchange_trace", 0.03)]
)
def test_altered_value_that_belongs_to_no_set_is_contradicted(found, monkeypatch, name, off):
    """Time is counted in cross-sections: the rate of collisions is measured like the rest."""
    right = dynamics.predicted
    monkeypatch.setattr(
        dynamics, "predicted", lambda closed, asked: right(closed, asked) + off * (asked == name)
    )
    assert not judge(found, closures.derived).passed()


def test_threads_change_nothing(tiny, monkeypatch):
    results = []
    for threads in (1, 3):
        monkeypatch.setattr(dynamics.os, "cpu_count", lambda number=threads: number)
        results.append(dynamics.measure("reduced", seed=5))
    for one, other in zip(*results, strict=True):
        assert np.array_equal(one.values, other.values)
        assert np.array_equal(one.covariance, other.covariance)
    assert [one.restitution for one in results[0]] == [1.0, 0.8, 0.5]
    assert not np.array_equal(results[0][0].values, dynamics.measure("reduced", seed=6)[0].values)


def test_slope_of_a_polynomial_is_exact():
    nodes = slopes.times() + 0.3
    weights = slopes.slope_weights(nodes, slopes.DEGREE)
    for power in range(1, slopes.DEGREE + 1):
        changes = np.diff((nodes - nodes[0]) ** power)
        assert weights @ changes == pytest.approx(float(power == 1), abs=1e-9)


def test_slope_of_a_decay_is_right_to_a_thousandth_of_the_errors_allowed():
    """What follows from the window and the degree: 0.6⁴/1680 where the rate is 1/τ_c."""
    collision_time = 1.0 / closures.collision_integral(1.0)
    weights = slopes.slope_weights(slopes.times(), slopes.DEGREE)
    slope = weights @ np.diff(np.exp(-slopes.times() / collision_time)) * collision_time
    assert slope == pytest.approx(-1.0, abs=1.2e-4)


def test_weights_suit_a_random_walk():
    """No other unbiased weights have a smaller variance, that of the best being degree²/time."""
    nodes = np.linspace(0.0, 1.0, 2001)
    weights = slopes.slope_weights(nodes, 3)
    assert np.sum(weights**2 * np.diff(nodes)) == pytest.approx(9.0, rel=1e-3)


def exact_measurement(errors=1e-3, batches=10_000):
    closed = closures.derived(0.8)
    values = np.array([dynamics.predicted(closed, name) for name in NAMES])
    return Measured(0.8, values, errors**2 * np.eye(len(values)), batches)


def test_judgement_of_exact_values():
    verdict = judge([exact_measurement()], closures.derived)
    assert verdict.chi_square == verdict.largest == 0.0
    assert verdict.degrees == 21
    assert verdict.probability == verdict.largest_probability == 1.0


def test_one_bad_coefficient_among_many_good_ones():
    """χ² alone would not see it."""
    one = exact_measurement()
    one.values[3] += 5e-3
    verdict = judge([one, exact_measurement(), exact_measurement()], closures.derived)
    assert verdict.largest == pytest.approx(5.0)
    assert verdict.probability > 0.9
    assert verdict.largest_probability == pytest.approx(63 * 5.73e-7, rel=0.05)
    assert not verdict.passed()


def test_many_slightly_bad_coefficients():
    """No single one would tell."""
    one = exact_measurement()
    one.values[:] += 2.2e-3
    verdict = judge([one], closures.derived)
    assert verdict.largest_probability > 0.1
    assert verdict.probability < 1e-6


def test_correlated_errors_are_no_excuse():
    """Two deviations that cannot be of opposite sign by chance."""
    one = exact_measurement()
    one.covariance[0, 1] = one.covariance[1, 0] = 0.99e-6
    one.values[0] += 1e-3
    assert judge([one], closures.derived).probability < 1e-3
    one.values[1] += 1e-3
    assert judge([one], closures.derived).probability > 0.9


def test_few_batches_are_trusted_less():
    many, few = exact_measurement(), exact_measurement(batches=30)
    for one in (many, few):
        one.values[:] += 2e-3
    assert judge([many], closures.derived).probability < 1e-6
    assert judge([few], closures.derived).probability > 0.1


def test_bound_for_many_comparisons():
    assert dynamics.bound(1) == pytest.approx(2.5758, abs=1e-4)
    assert dynamics.bound(63) == pytest.approx(3.776, abs=1e-3)


def test_jackknife_gives_the_errors_of_means_and_ratios():
    random = np.random.default_rng(1)
    exact = 1.0 + np.arange(21.0)
    scatter = 0.02 * random.standard_normal((4000, 21))
    measured = dynamics._jackknifed(exact * (1.0 + scatter), 0.8)
    assert measured.batches == 4000
    error = 0.02 / math.sqrt(4000)
    rate = measured.estimate("collision_rate")
    assert rate.error == pytest.approx(error * rate.value, rel=0.05)
    ratio = measured.estimate("covariance_collision")
    assert ratio.error == pytest.approx(math.sqrt(2.0) * error * abs(ratio.value), rel=0.05)


def test_section_is_written_between_its_markers(tiny, monkeypatch, tmp_path, capsys):
    page = tmp_path / "verdict.md"
    page.write_text("before\n<!-- begin closures -->\nold\n<!-- end closures -->\nafter\n")
    monkeypatch.setattr(dynamics, "PAGE", page)
    dynamics.main(["--effort", "reduced", "--write"])
    text = page.read_text()
    assert "`python -m benchmarks.kinetic_closures --effort reduced --write`" in text
    assert text.startswith("before\n<!-- begin closures -->\nMade by")
    assert text.endswith("<!-- end closures -->\nafter\n")
    assert len([line for line in text.splitlines() if line.startswith("| λ3.5 |")]) == 3
    assert capsys.readouterr().out == ""


def test_contradiction_of_the_derived_set_fails(found, monkeypatch, capsys):
    monkeypatch.setattr(dynamics, "measure", lambda effort, seed: found)
    assert dynamics.main(["--effort", "reduced"]) == 0
    assert "| derived | 1 |" in capsys.readouterr().out
    wrong = altered("third_moment_collision")
    monkeypatch.setattr(closures, "derived", wrong)
    assert dynamics.main(["--effort", "reduced"]) == 1


def test_page_holds_a_confirmed_table():
    """The documentation's own section, made with more particles than a test can have."""
    section = dynamics.PAGE.read_text(encoding="utf-8").partition("<!-- begin closures -->")[2]
    section = section.partition("<!-- end closures -->")[0]
    assert "`python -m benchmarks.kinetic_closures --write`" in section
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in section.splitlines()]
    judged = [line[-1] for line in cells if line and line[0] in ("derived", "published")]
    assert judged == ["passes", "passes", "FAILS", "FAILS"]
    values = {
        (line[0], line[1]): float(line[2]) for line in cells if len(line) == 9 and "λ" in line[0]
    }
    for e in dynamics.RESTITUTIONS:
        for name in dynamics.TESTED[1:6]:
            shown = values[dynamics._symbol(name), f"{e:g}"]
            assert shown == pytest.approx(dynamics.predicted(closures.derived(e), name), rel=1e-5)
