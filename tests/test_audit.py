"""The comparison of exact and printed coefficients."""

import dataclasses
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from triboflux import audit, closures
from triboflux.errors import InputError

VERDICTS = {
    "triboconductivity": audit.AGREES,
    "dispersion": audit.AGREES,
    "collisional_flux": audit.DIFFERS,
    "covariance_production_field": audit.DIFFERS,
    "covariance_production_gradient": audit.DIFFERS,
    "charge_exchange": audit.AGREES,
    "covariance_collision": audit.AGREES,
    "covariance_exchange": audit.OPPOSITE_SIGN,
    "third_moment_collision": audit.DIFFERS,
    "third_moment_exchange": audit.OPPOSITE_SIGN,
    "third_moment_drag": audit.DIFFERS,
    "third_moment_trace": audit.DIFFERS,
    "third_moment_shear": audit.DIFFERS,
    "third_moment_divergence": audit.DIFFERS,
    "variance_regain": audit.DIFFERS,
    "variance_production_field": audit.AGREES,
    "variance_dispersion": audit.DIFFERS,
    "variance_flux_exchange": audit.DIFFERS,
    "variance_flux_regain": audit.DIFFERS,
    "variance_flux_product": audit.DIFFERS,
    "exchange_time": audit.INVERTED,
    "collisional_flux_number": audit.DIFFERS,
    "transferred_fraction": audit.NOT_PRINTED,
    "charge_third_moment": audit.NOT_PRINTED,
    "covariance_third_moment": audit.NOT_PRINTED,
    "covariance_collisional_dispersion": audit.NOT_PRINTED,
    "third_moment_flux": audit.NOT_PRINTED,
    "variance_collisional_flux": audit.NOT_PRINTED,
    "variance_covariance_exchange": audit.NOT_PRINTED,
    "variance_covariance_regain": audit.NOT_PRINTED,
}
"""What the description of the model says about each coefficient at e = 1."""

AGREEING = {name for name, verdict in VERDICTS.items() if verdict == audit.AGREES}


def test_verdicts_for_elastic_particles():
    assert {row.name: row.verdict for row in audit.audit()} == VERDICTS


def test_rows_hold_both_sets():
    exact, printed = closures.complete(0.9), closures.published(0.9)
    rows = {row.name: row for row in audit.audit(0.9)}
    assert list(rows) == list(exact.coefficients)
    for name, row in rows.items():
        assert row.exact == exact[name]
        assert row.formula == exact.coefficients[name].formula
        assert row.symbol == exact.coefficients[name].symbol
        if VERDICTS[name] == audit.NOT_PRINTED:
            assert (row.printed, row.printed_formula, row.ratio) == (None, None, None)
        else:
            assert row.printed == printed[name]
            assert row.printed_formula == printed.coefficients[name].formula
            assert row.ratio == pytest.approx(printed[name] / exact[name], rel=1e-15)
        assert (row.sampled, row.error) == (None, None)


@given(restitution=st.floats(0.0, 1.0))
def test_the_same_coefficients_agree_for_every_restitution(restitution):
    rows = audit.audit(restitution)
    assert {row.name for row in rows if row.verdict == audit.AGREES} == AGREEING
    assert all(row.ratio is None or math.isfinite(row.ratio) for row in rows)
    assert all(row.verdict in audit.VERDICTS for row in rows)


@given(restitution=st.floats(0.0, 1.0), exponent=st.floats(-0.4, 4.0).filter(lambda a: a != 0.8))
def test_nothing_is_printed_for_another_exponent(restitution, exponent):
    for row in audit.audit(restitution, exponent):
        assert (row.printed, row.printed_formula, row.ratio) == (None, None, None)
        assert row.verdict == audit.NOT_PRINTED
        assert math.isfinite(row.exact)


def test_no_ratio_to_a_coefficient_that_vanishes():
    rows = {row.name: row for row in audit.audit(2.0 / 2.8)}
    assert rows["covariance_exchange"].exact == 0.0
    assert rows["covariance_exchange"].ratio is None
    assert rows["covariance_exchange"].verdict == audit.DIFFERS


@pytest.mark.parametrize(
    ("printed", "verdict"),
    [(1.825, audit.AGREES), (1.826, audit.DIFFERS), (1.83, audit.AGREES), (1.84, audit.DIFFERS)],
)
def test_agreement_is_within_the_printed_digits(monkeypatch, printed, verdict):
    changed = closures.published(1.0)
    one = dataclasses.replace(
        changed.coefficients["dispersion"], value=printed, formula=str(printed)
    )
    replaced = dataclasses.replace(
        changed, coefficients={**changed.coefficients, "dispersion": one}
    )
    monkeypatch.setattr(closures, "published", lambda restitution: replaced)
    assert {row.name: row.verdict for row in audit.audit()}["dispersion"] == verdict


@pytest.mark.parametrize("restitution", [1.0, 0.8])
def test_whatever_differs_is_explained(restitution):
    rows = audit.audit(restitution)
    for row in rows:
        assert row.equation.startswith("(")
        assert row.note or row.verdict == audit.AGREES, row.name


@pytest.mark.parametrize("name", closures.NAMES)
def test_notes_are_those_of_the_sets(name):
    coefficients = closures.by_name(name, 0.7).coefficients
    rows = {row.name: row for row in audit.audit(0.7)}
    for key, coefficient in coefficients.items():
        assert (rows[key].note, rows[key].equation) == (coefficient.note, coefficient.equation)


@pytest.mark.parametrize("restitution", [-0.1, 1.1, math.nan, math.inf])
def test_restitutions_that_do_not_exist(restitution):
    with pytest.raises(
        InputError, match=r"^restitution is .*, but must be a number from 0 to 1\.$"
    ):
        audit.audit(restitution)


@pytest.mark.parametrize("exponent", [-0.5, -2.0, math.nan, math.inf])
def test_exponents_without_integrals(exponent):
    with pytest.raises(InputError, match=r"^exponent is .*, but must be a finite number above"):
        audit.audit(1.0, exponent)


@pytest.mark.parametrize("exponent", [150.0, 300.0, 1e300])
def test_exponents_whose_integrals_overflow(exponent):
    with pytest.raises(InputError, match=r"^exponent is .*collision integrals exceed"):
        audit.audit(1.0, exponent)


def test_sampled_values():
    done = []
    rows = audit.audit(0.8, 0.5, samples=20_000, seed=3, on_progress=done.append)
    assert done == sorted(done)
    assert done[-1] == 1.0
    for row in rows:
        if row.name == "third_moment_drag":
            assert (row.sampled, row.error) == (None, None)
        else:
            assert row.error >= 0.0
            assert abs(row.sampled - row.exact) <= 5.0 * row.error + 1e-12
    again = audit.audit(0.8, 0.5, samples=20_000, seed=4)
    assert rows[0].sampled != again[0].sampled


def test_too_few_samples():
    with pytest.raises(InputError, match="samples: 10 is not allowed"):
        audit.audit(samples=10)
