"""Integrating in time: segments, outputs, stop rules, and runs that fail."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import triboflux
from tests.cases import data
from tests.fields import CASE_A, CASE_B, full_model, sine_state, smooth_state
from tests.runs import resume, run, settings, start
from triboflux import segments
from triboflux.calculus import FourierCalculus
from triboflux.case import Case
from triboflux.grid import Grid
from triboflux.moments import Moments

LINE = Grid((32,), (1.0,))
PLANE = Grid((14, 12), (1.0, 0.8))


def smooth(grid, size=0.3):
    """Return an asymmetric initial state whose charge is neutral and whose variance is positive."""
    state = smooth_state(grid, 2)
    charge = state.charge - jnp.mean(state.charge)
    return Moments(size * charge, 0.1 * size * state.covariance, 1.0 + 0.1 * state.variance)


def assert_equal(left, right):
    for a, b in zip(jax.tree.leaves(left), jax.tree.leaves(right), strict=True):
        np.testing.assert_array_equal(a, b)


def assert_close(left, right, rtol):
    for a, b in zip(jax.tree.leaves(left), jax.tree.leaves(right), strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=rtol * float(jnp.max(jnp.abs(b))))


# --- segments -------------------------------------------------------------------------------------


@pytest.mark.parametrize("numbers", [CASE_A, CASE_B], ids=["A", "B"])
def test_segments_make_the_steps_of_a_single_run_bit_for_bit(numbers):
    model, state = full_model(numbers, "published"), sine_state(LINE)
    whole = run(model, state, LINE, settings(60.0, peak=0.5))
    carry, accepted, rejected, segments = start(model, state, LINE), 0, 0, 0
    short = settings(60.0, peak=0.5, max_steps=3)
    while True:
        outcome = resume(model, carry, LINE, short)
        carry, segments = outcome.carry, segments + 1
        accepted, rejected = accepted + int(outcome.accepted), rejected + int(outcome.rejected)
        if bool(outcome.finished):
            break
        assert int(outcome.accepted + outcome.rejected) == 3
        assert not bool(outcome.failed)
    assert segments > 3
    assert (accepted, rejected) == (int(whole.accepted), int(whole.rejected))
    assert bool(outcome.stopped["peak_charge"])
    assert_equal(carry.time, whole.carry.time)
    assert_equal(carry.coefficients, whole.carry.coefficients)
    assert_equal(carry.next_step, whole.carry.next_step)


def test_a_solved_case_does_not_depend_on_the_length_of_its_segments(monkeypatch):
    case = Case(
        **data(
            run__t_end=0.6, run__outputs=[0.0, 1e-3, 0.15, 0.18, 0.5], run__stop_at_peak_charge=0.5
        )
    )
    whole = triboflux.solve(case).dataset
    monkeypatch.setattr(segments, "STEPS_SMALL", 2)
    progress = []
    pieces = triboflux.solve(case, on_progress=progress.append)
    assert len(progress) > 4
    fractions = [p.fraction for p in progress]
    assert fractions == sorted(fractions)
    assert fractions[-1] == pytest.approx(1.0)
    assert pieces.dataset["time"].values.tolist() == whole["time"].values.tolist()
    for name in whole.data_vars:
        np.testing.assert_array_equal(pieces.dataset[name], whole[name], err_msg=name)


def test_an_unfinished_run_says_so():
    outcome = run(full_model(CASE_B), sine_state(LINE), LINE, settings(1.0, max_steps=3))
    assert not bool(outcome.finished)
    assert not bool(outcome.failed)
    assert 0.0 < float(outcome.time) < 1.0


# --- outputs --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("numbers", "times"),
    [(CASE_A, [0.0, 5e-5, 3e-4, 0.7, 11.0]), (CASE_B, [0.0, 0.003, 0.1, 0.25, 0.3])],
    ids=["A", "B"],
)
def test_outputs_are_the_states_of_runs_that_end_there(numbers, times):
    model, state, rtol = full_model(numbers), sine_state(LINE), 1e-8
    outcome = run(model, state, LINE, settings(times[-1], rtol, outputs=times))
    assert_equal(outcome.times, jnp.asarray(times))
    scale = [float(jnp.max(jnp.abs(leaf))) for leaf in jax.tree.leaves(outcome.outputs)]
    for i, time in enumerate(times[1:], start=1):
        found = jax.tree.leaves(jax.tree.map(lambda a, i=i: a[i], outcome.outputs))
        ended = run(model, state, LINE, settings(time, rtol)).carry.coefficients
        for f, e, s in zip(found, jax.tree.leaves(ended), scale, strict=True):
            np.testing.assert_allclose(f, e, rtol=0, atol=2e-7 * s, err_msg=f"t = {time}")


def test_output_at_the_start_is_the_initial_state():
    state = smooth(PLANE)
    outcome = run(
        full_model(CASE_B, dimensions=2), state, PLANE, settings(0.05, outputs=[0.0, 0.05])
    )
    first, last = (jax.tree.map(lambda a, i=i: a[i], outcome.outputs) for i in (0, 1))
    assert_close(jax.tree.map(PLANE.to_fields, first), state, 1e-14)
    assert_close(last, outcome.carry.coefficients, 1e-14)


def test_outputs_beyond_the_stop_are_marked():
    times = [0.05, 0.1, 0.5, 0.9]
    outcome = run(
        full_model(CASE_B), sine_state(LINE), LINE, settings(1.0, outputs=times, peak=0.5)
    )
    assert float(outcome.time) == pytest.approx(0.18844, rel=1e-4)
    assert outcome.times.tolist() == [0.05, 0.1, float("inf"), float("inf")]


# --- the end --------------------------------------------------------------------------------------


@pytest.mark.parametrize("t_end", [0.3, 1e-7])
def test_a_run_ends_at_its_end_time(t_end):
    outcome = run(full_model(CASE_B), sine_state(LINE), LINE, settings(t_end))
    assert float(outcome.time) == t_end
    assert bool(outcome.finished)
    assert not bool(outcome.failed)


def test_a_run_that_reaches_neither_stop_value_ends_at_its_end_time():
    outcome = run(full_model(CASE_B), sine_state(LINE), LINE, settings(0.1, peak=0.5, rate=1e-9))
    assert float(outcome.time) == 0.1
    assert not any(bool(rule) for rule in outcome.stopped.values())
    assert bool(outcome.finished)


@pytest.mark.parametrize("stop", [0.9, 0.5, 0.2])
def test_the_peak_at_the_stop_is_the_stop_value(stop):
    grid, state = PLANE, smooth(PLANE)
    charge = state.charge / grid.peak(grid.to_spectral(state.charge))
    state = Moments(charge, state.covariance, state.variance)
    outcome = run(full_model(CASE_B, dimensions=2), state, grid, settings(3.0, peak=stop))
    assert bool(outcome.stopped["peak_charge"])
    assert float(grid.peak(outcome.carry.coefficients.charge)) == pytest.approx(stop, rel=1e-8)


@pytest.mark.parametrize("rate", [1.0, 1e-2])
def test_the_rate_at_the_stop_is_the_stop_value(rate):
    # At the start C = 0 and nothing but the small diffusion moves: the rule waits for a fall.
    model = full_model(CASE_B)
    outcome = run(model, sine_state(LINE), LINE, settings(40.0, rate=rate))
    assert bool(outcome.stopped["rate"])

    @eqx.filter_jit
    def rms_of_rate(coefficients):
        return LINE.rms(model.right_hand_side(FourierCalculus(LINE), coefficients).charge)

    assert float(rms_of_rate(outcome.carry.coefficients)) == pytest.approx(rate, rel=1e-6)
    before = run(model, sine_state(LINE), LINE, settings(0.97 * float(outcome.time)))
    assert float(rms_of_rate(before.carry.coefficients)) > rate


def test_the_rule_that_comes_first_ends_the_run():
    model, state = full_model(CASE_B), sine_state(LINE)
    by_peak = run(model, state, LINE, settings(40.0, peak=0.5, rate=1e-2))
    assert bool(by_peak.stopped["peak_charge"])
    assert not bool(by_peak.stopped["rate"])
    by_rate = run(model, state, LINE, settings(40.0, peak=1e-6, rate=1e-2))
    assert bool(by_rate.stopped["rate"])
    assert not bool(by_rate.stopped["peak_charge"])


# --- what is dropped, what is nothing, what fails -------------------------------------------------


def test_modes_beyond_the_kept_ones_are_dropped_at_the_start():
    x = LINE.coordinates()[0]
    low, high = np.sin(2 * np.pi * x), np.cos(2 * np.pi * (LINE.kept[0] + 1) * x)
    zero = jnp.zeros(32)
    carry = start(full_model(CASE_B), Moments(jnp.asarray(low + high), zero[None], zero), LINE)
    np.testing.assert_allclose(LINE.to_fields(carry.coefficients.charge), low, atol=1e-14)
    assert float(carry.time) == float(carry.next_step) == 0.0


def test_nothing_stays_nothing():
    nothing = jax.tree.map(jnp.zeros_like, sine_state(LINE))
    outcome = run(full_model(CASE_B), nothing, LINE, settings(1.0))
    assert float(outcome.time) == 1.0
    assert all(not leaf.any() for leaf in jax.tree.leaves(outcome.carry.coefficients))


def test_a_state_that_is_no_number_fails_at_once():
    state = sine_state(LINE)
    broken = eqx.tree_at(lambda s: s.charge, state, state.charge.at[3].set(jnp.nan))
    outcome = run(full_model(CASE_B), broken, LINE, settings(1.0))
    assert bool(outcome.failed)
    assert bool(outcome.finished)
    assert float(outcome.time) == 0.0
    assert int(outcome.rejected) < 10


def test_a_collapsing_step_is_reported():
    model = full_model(CASE_B | {"energy_ratio": 1e12})
    outcome = run(model, sine_state(LINE), LINE, settings(1.0))
    assert bool(outcome.failed)
    assert bool(outcome.finished)
    assert 0.0 < float(outcome.time) < 1e-3
    assert all(jnp.isfinite(leaf).all() for leaf in jax.tree.leaves(outcome.carry.coefficients))


def test_a_run_that_diverges_keeps_what_there_was():
    case = Case(**data(numbers__energy_ratio=1e12, run__outputs=3))
    result = triboflux.solve(case)
    assert result.status == "diverged"
    assert "step size collapsed" in result.stop_reason
    times = result.dataset["time"].values
    assert times[0] == 0.0
    assert 0.0 < times[-1] < 1e-3
    assert bool(np.isfinite(result.dataset["charge"]).all())


def test_growth_outside_the_range_of_validity_is_what_the_warning_says():
    # F < 0: a uniform variance grows as exp(28.6 t).
    case = Case(
        **data(
            closures="published",
            numbers__peclet=1e4,
            numbers__energy_ratio=0.0,
            initial__charge=[{"mode": [1], "sine": 1e-9}],
            initial__variance=[{"mode": [0], "cosine": 0.1}],
            run__t_end=0.5,
            run__outputs=2,
            run__allow_out_of_range=True,
        )
    )
    result = triboflux.solve(case)
    assert any("exp(28.6 t)" in warning for warning in result.warnings)
    growth = float(result.dataset["variance"].isel(time=-1).max()) / 0.1
    assert np.log(growth) / 0.5 == pytest.approx(28.6, abs=0.05)
