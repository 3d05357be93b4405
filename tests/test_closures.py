"""The closure coefficients against their closed forms, their printed digits and each other."""

import math
from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate

from triboflux import closures
from triboflux.errors import InputError

restitutions = st.floats(0.0, 1.0)
exponents = st.floats(-0.45, 4.0)

EXACT = {
    "triboconductivity": "1.8254",
    "dispersion": "1.8254",
    "collisional_flux": "3.9574",
    "covariance_production_field": "2.1679",
    "covariance_production_gradient": "2.1679",
    "charge_exchange": "21.905",
    "covariance_collision": "0.6667",
    "covariance_exchange": "-0.1333",
    "variance_regain": "85.18",
    "variance_production_field": "14.197",
    "variance_dispersion": "7.0986",
    "third_moment_collision": "1.0667",
    "third_moment_exchange": "-0.1333",
    "third_moment_drag": "2",
    "third_moment_trace": "-0.1333",
    "third_moment_shear": "0.08672",
    "third_moment_divergence": "0.08672",
    "variance_flux_exchange": "0.3667",
    "variance_flux_regain": "0.9138",
    "variance_flux_product": "3.549",
    "exchange_time": "0.08333",
    "collisional_flux_number": "2.1679",
    "transferred_fraction": "3.884",
}
"""The exact column of the table of coefficients at a = 4/5 and e = 1, to four digits or so."""

DROPPED = {
    "charge_third_moment": "0.09",
    "covariance_third_moment": "0.24",
    "covariance_collisional_dispersion": "0.38",
    "third_moment_flux": "0.18",
    "variance_collisional_flux": "8.35844",
    "variance_covariance_exchange": "0.3",
    "variance_covariance_regain": "0.7920",
}
"""What `complete` has besides."""

PRINTED = {
    "triboconductivity": "1.825",
    "dispersion": "1.825",
    "collisional_flux": "5.936",
    "covariance_production_field": "0.5422",
    "covariance_production_gradient": "0.5422",
    "charge_exchange": "21.90",
    "covariance_collision": "0.6667",
    "covariance_exchange": "0.4",
    "variance_regain": "21.29",
    "variance_production_field": "14.20",
    "variance_dispersion": "0.6278",
    "third_moment_collision": "7.786",
    "third_moment_exchange": "3.201",
    "third_moment_drag": "1",
    "third_moment_trace": "-0.509",
    "third_moment_shear": "22.1792",
    "third_moment_divergence": "417.2192",
    "variance_flux_exchange": "2.806",
    "variance_flux_regain": "1.017",
    "variance_flux_product": "20.39",
    "exchange_time": "12",
    "collisional_flux_number": "3.256",
}
"""The paper's numbers at e = 1."""


def assert_rounds_to(value: float, printed: str):
    last_digit = 10.0 ** int(Decimal(printed).as_tuple().exponent)
    assert abs(value - float(printed)) <= 0.5 * last_digit * (1.0 + 1e-9)


@pytest.mark.parametrize("name", EXACT)
def test_exact_value_has_the_printed_digits(name):
    assert_rounds_to(closures.derived(1.0)[name], EXACT[name])


@pytest.mark.parametrize("name", DROPPED)
def test_value_of_what_the_derivation_drops(name):
    assert_rounds_to(closures.complete(1.0)[name], DROPPED[name])


@given(exponent=exponents, restitution=restitutions)
def test_complete_is_derived_with_what_the_derivation_drops(exponent, restitution):
    whole = closures.complete(restitution, exponent).coefficients
    derived = closures.derived(restitution, exponent).coefficients
    assert dict(whole) == dict(derived) | {name: whole[name] for name in DROPPED}
    regain = (1 + 2 * exponent) / 3 * derived["variance_flux_regain"].value
    assert whole["variance_covariance_regain"].value == pytest.approx(regain, rel=1e-13)


@pytest.mark.parametrize("name", PRINTED)
def test_published_value_is_the_papers(name):
    assert_rounds_to(closures.published(1.0)[name], PRINTED[name])


@pytest.mark.parametrize(
    ("name", "inelastic"),
    [
        ("covariance_collision", (1 + 0.8) / 3),
        ("covariance_exchange", (3 - 0.8) / 5),
        ("third_moment_collision", 6.667 * 1.8 - 1.387 * 1.8**2),
        ("third_moment_trace", 0.2667 * 1.8 - 0.2607 * 1.8**2),
        ("third_moment_shear", 10.68 * 1.8 + 0.2048 * 1.8**2),
        ("third_moment_divergence", 208.2 * 1.8 + 0.2048 * 1.8**2),
    ],
)
def test_published_value_of_inelastic_particles(name, inelastic):
    assert closures.published(0.8)[name] == pytest.approx(inelastic, rel=1e-14)


def test_the_tables_above_are_complete():
    assert set(EXACT) == set(closures.derived(1.0).coefficients)
    # The fraction passed over follows from the collision rule; the paper does not print it.
    assert set(PRINTED) | {"transferred_fraction"} == set(closures.published(1.0).coefficients)


@given(exponent=exponents, restitution=restitutions)
def test_exact_closed_forms(exponent, restitution):
    a, e = exponent, restitution
    c = closures.derived(e, a)
    j_1, j1, j2, j12 = (
        2 ** (p + 1) * math.sqrt(math.pi) * math.gamma((p + 1) / 2)
        for p in (1, 1 + a, 2 + a, 1 + 2 * a)
    )
    expected = {
        "triboconductivity": j1 / 6,
        "collisional_flux": j2 / 6,
        "charge_exchange": 2 * j1,
        "covariance_collision": (1 + e) / 3,
        "covariance_exchange": (2 - (2 + a) * e) / 6,
        "third_moment_collision": (1 + e) * (19 - 3 * e) / 30,
        "third_moment_trace": -(1 + e) * (1 + 3 * e) / 60,
        "third_moment_shear": j2 * (a * e**2 + 3 * e**2 + 2 * e - 1) / (120 * j1),
        "variance_flux_exchange": (5 - (2 + a) * e) / 6,
        "variance_flux_regain": j12 / (2 * j1),
        "variance_flux_product": 3 * j_1 * j12 / j1**2,
        "transferred_fraction": 6 * j_1 / j1,
        "exchange_time": 1 / 12,
    }
    for name, value in expected.items():
        assert c[name] == pytest.approx(value, rel=1e-13, abs=1e-15), name


@given(exponent=exponents, restitution=restitutions)
def test_identities_between_exact_coefficients(exponent, restitution):
    c = closures.derived(restitution, exponent)
    near = {"rel": 1e-13}
    assert c["triboconductivity"] == c["dispersion"]
    assert c["covariance_production_field"] == c["covariance_production_gradient"]
    ratio = c["collisional_flux"] / c["triboconductivity"]
    assert c["covariance_production_field"] == pytest.approx(ratio, **near)
    assert c["collisional_flux_number"] == pytest.approx(ratio, **near)
    assert c["variance_regain"] == pytest.approx(6 * c["variance_production_field"], **near)
    assert c["variance_regain"] == pytest.approx(12 * c["variance_dispersion"], **near)
    assert c["exchange_time"] == pytest.approx(c["dispersion"] / c["charge_exchange"], **near)
    assert c["third_moment_shear"] == c["third_moment_divergence"]
    assert c["third_moment_exchange"] == c["covariance_exchange"]
    product = c["variance_flux_regain"] * c["transferred_fraction"]
    assert c["variance_flux_product"] == pytest.approx(product, **near)


@given(st.floats(-0.9, 12.0))
def test_collision_integral_recurrence(order):
    ahead = closures.collision_integral(order + 2.0)
    assert ahead == pytest.approx(2 * (order + 1) * closures.collision_integral(order), rel=1e-12)


@pytest.mark.parametrize("order", [0.0, 1.0, 1.8, 2.6, 2.8])
def test_collision_integral_by_quadrature(order):
    # The normal part of the relative velocity of a Maxwellian pair is Gaussian of variance 2.
    def density(g):
        return g**order * math.exp(-(g**2) / 4.0) / math.sqrt(4.0 * math.pi)

    mean, _ = integrate.quad(density, 0.0, np.inf)
    directions = 4.0 * math.pi
    assert closures.collision_integral(order) == pytest.approx(directions * mean, rel=1e-8)


def test_first_collision_integral_is_the_collision_frequency():
    assert closures.collision_integral(1.0) == pytest.approx(4 * math.sqrt(math.pi), rel=1e-15)


@pytest.mark.parametrize("exponent", [0.0, 0.4, 0.8, 2.0])
def test_limit_of_the_transferred_fraction(exponent):
    # There the gain of variance overtakes its destruction: 1 = λ3.1 λ' (fraction/kappa).
    c = closures.derived(0.9, exponent)
    fraction = c["transferred_fraction"] / (c["variance_regain"] * c["exchange_time"])
    assert closures.fraction_limit(exponent) == pytest.approx(fraction, rel=1e-13)
    if exponent == 0.8:
        assert_rounds_to(fraction, "0.547")


@pytest.mark.parametrize(
    ("name", "grid_dimensions", "expected"),
    [
        ("derived", 1, 3),
        ("derived", 2, 3),
        ("derived", 3, 3),
        ("complete", 1, 3),
        ("published", 1, 1),
        ("published", 2, 3),
        ("published", 3, 3),
    ],
)
def test_directions_of_the_trace(name, grid_dimensions, expected):
    assert closures.by_name(name, 1.0).trace_dimensions(grid_dimensions) == expected


@pytest.mark.parametrize("name", closures.NAMES)
def test_every_coefficient_tells_where_it_comes_from(name):
    for coefficient in closures.by_name(name, 0.95).coefficients.values():
        assert math.isfinite(coefficient.value)
        assert coefficient.symbol
        assert coefficient.formula
        assert coefficient.equation.startswith("(") or coefficient.note


def test_set_by_name():
    assert closures.by_name("derived", 0.9, 1.2) == closures.derived(0.9, 1.2)
    assert closures.by_name("published", 0.9) == closures.published(0.9)
    assert closures.by_name("complete", 0.9, 1.2) == closures.complete(0.9, 1.2)
    assert [name for name in closures.NAMES if closures.by_name(name, 1.0).complete] == ["complete"]


@pytest.mark.parametrize("exponent", [0.7999, 1.0, 0.0])
def test_published_exists_for_the_hertzian_exponent_only(exponent):
    with pytest.raises(InputError) as caught:
        closures.by_name("published", 1.0, exponent)
    sentence = str(caught.value)
    assert "exponent" in sentence
    assert str(exponent) in sentence
    assert "0.8" in sentence
    assert "derived" in sentence


@pytest.mark.parametrize("exponent", [-0.5, -3.0, math.nan, math.inf])
def test_exponents_without_collision_integrals_are_refused(exponent):
    with pytest.raises(InputError, match=r"exponent: .* must be a finite number above -0\.5"):
        closures.derived(1.0, exponent)
    with pytest.raises(InputError, match=r"exponent: .* must be a finite number"):
        closures.complete(1.0, exponent)


@pytest.mark.parametrize("name", ["publish", "Published", "publsihed"])
def test_unknown_set_proposes_the_nearest(name):
    with pytest.raises(InputError) as caught:
        closures.by_name(name, 1.0)
    sentence = str(caught.value)
    assert f"'{name}' is not known" in sentence
    assert "derived, published" in sentence
    assert sentence.endswith("Did you mean 'published'?")


def test_unknown_coefficient_proposes_the_nearest():
    with pytest.raises(InputError, match="Did you mean 'dispersion'"):
        closures.derived(1.0)["dispersoin"]
