"""Runs that break a bound or fail: stopped within the step, with what, where and when."""

import re

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from tests.cases import data
from tests.fields import CASE_B, full_model, sine_state
from tests.runs import settings, start
from triboflux import solve
from triboflux.breaches import failed_place
from triboflux.case import Case
from triboflux.errors import InputError
from triboflux.grid import Grid
from triboflux.integrate import advance
from triboflux.integrators.controller import LadderController

LINE = Grid((32,), (1.0,))
TIMES = [0.0, 1e-3, 0.05, 0.1, 0.15, 0.18, 0.19, 0.5]


def bounded(bound, **changes):
    times = {"run__t_end": 0.6, "run__outputs": TIMES, "run__stop_at_peak_charge": 0.5}
    return Case(**data(**(times | changes), run__realizability_bound=bound))


def test_a_breach_ends_the_run_where_it_reaches_the_bound():
    result = solve(bounded(0.05))
    margin = result.dataset["realizability_margin"]
    assert result.status == "nonphysical"
    assert float(margin[-1].min()) == pytest.approx(-0.05, rel=1e-6)
    assert float(margin[:-1].min()) > -0.05
    time = float(result.dataset["time"][-1])
    place = float(margin[-1].idxmin())
    told = re.fullmatch(
        r"\|C\|² exceeds V by 0\.05, the bound, at x = (.*), t = (.*)", result.stop_reason
    )
    assert float(told[2]) == pytest.approx(time, rel=1e-5)
    # two places half a box apart are equal but for round-off
    assert float(told[1]) % 0.5 == pytest.approx(place % 0.5)
    assert result.dataset["time"].values.tolist() == [*(t for t in TIMES if t < time), time]


def test_a_bound_that_is_not_reached_changes_nothing():
    result = solve(bounded(10.0))
    assert (result.status, result.stop_reason) == ("ok", "peak charge fell to 0.5")
    assert float(result.dataset["time"][-1]) == pytest.approx(0.188441749, rel=1e-6)


def test_a_state_that_breaks_the_bound_makes_no_step():
    covariance = [{"component": 0, "mode": [0], "cosine": 0.5}]
    result = solve(bounded(0.1, initial__covariance=covariance))
    assert result.status == "nonphysical"
    assert result.stop_reason == "|C|² exceeds V by 0.25, the bound, at x = 0, t = 0"
    assert result.dataset["time"].values.tolist() == [0.0]
    state = eqx.tree_at(lambda s: s.covariance, sine_state(LINE), jnp.full((1, 32), 0.5))
    model = full_model(CASE_B)
    chosen = settings(1.0, outputs=[0.0, 0.5])
    chosen = eqx.tree_at(
        lambda s: s.realizability_bound, chosen, jnp.asarray(0.1), is_leaf=lambda x: x is None
    )
    outcome = eqx.filter_jit(advance)(model, start(model, state, LINE), LINE, chosen)
    assert bool(outcome.stopped["unrealizable"])
    assert bool(outcome.finished)
    assert (float(outcome.time), int(outcome.accepted)) == (0.0, 0)


def test_a_model_without_variance_has_no_such_bound():
    with pytest.raises(InputError) as refused:
        bounded(0.1, model="gradient")
    assert str(refused.value) == (
        "run.realizability_bound is 0.1, but the model 'gradient' has no variance; those that have "
        "one are self-consistent-flow, self-consistent, third-order, full, semi-algebraic, "
        "algebraic."
    )
    with pytest.raises(InputError, match=r"^run\.realizability_bound is 0\.0, but must be a pos"):
        bounded(0.0)


@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan, 1e200])
def test_a_step_to_a_state_that_is_not_finite_is_never_accepted(value):
    y0, error = jnp.ones(4), jnp.zeros(4)
    keep, start, stop, *_ = LadderController(1e-6, 1e-9).adapt_step_size(
        jnp.asarray(0.0),
        jnp.asarray(0.1),
        y0,
        y0.at[2].set(value),
        None,
        error,
        6,
        jnp.asarray(0.1),
    )
    assert not bool(keep)
    assert float(start) == 0.0
    assert 0.0 < float(stop) < 0.05


def test_growth_without_bound_ends_with_the_last_finite_state():
    # F < 0: a uniform variance grows as exp(28.6 t), exactly, so that no error warns of it
    case = Case(
        **data(
            closures="published",
            numbers__peclet=1e4,
            numbers__energy_ratio=0.0,
            initial__variance=[{"mode": [0], "cosine": 0.1}],
            run__t_end=60.0,
            run__outputs=TIMES,
            run__allow_out_of_range=True,
        )
    )
    result = solve(case)
    assert result.status == "diverged"
    assert "; the variance, of rms " in result.stop_reason
    assert np.isfinite(result.dataset["variance"].values).all()
    assert float(result.dataset["variance"][-1].max()) > 1e150
    assert float(result.dataset["time"][-1]) == pytest.approx(np.log(1e154 * 10) / 28.6, rel=0.05)


def test_the_place_of_what_is_not_finite_is_told():
    model, state = full_model(CASE_B), sine_state(LINE)
    carry = start(model, state, LINE)
    broken = eqx.tree_at(
        lambda c: c.coefficients.variance,
        carry,
        carry.coefficients.variance.at[0, 3].set(jnp.nan),
    )
    assert failed_place(model, LINE, broken) == "the variance is not finite at x = 0, t = 0"
