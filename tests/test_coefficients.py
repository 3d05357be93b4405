"""The coefficients of the equations, and what is refused as outside their range of validity."""

import math
import re

import equinox as eqx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.cases import NUMBERS
from triboflux import closures, models
from triboflux.errors import OutOfRangeError
from triboflux.numbers import Numbers

INF = math.inf


def coefficients(closure_set="derived", dimensions=1, exponent=0.8, **changes):
    """Return the coefficients and the closure set of case B's numbers with changes."""
    numbers = Numbers(**(NUMBERS | changes))
    chosen = closures.by_name(closure_set, numbers.restitution, exponent)
    return models.transport_coefficients(numbers, chosen, dimensions), chosen


def refusal(found, **options):
    with pytest.raises(OutOfRangeError) as caught:
        models.validity(*found, **options)
    sentence = str(caught.value)
    assert "\n" not in sentence
    assert sentence.startswith("numbers")
    return sentence


def values_of(found):
    """Return all coefficients by name, those of the dropped terms under a heading of their own."""
    values = dict(vars(found))
    dropped = values.pop("dropped")
    if dropped is not None:
        values |= {f"dropped.{name}": value for name, value in dropped._asdict().items()}
    return values


numbers = {
    "restitution": st.floats(0.0, 1.0),
    "peclet": st.floats(1.0, 1e8),
    "tau_c": st.floats(1e-5, 1.0),
    "tau_p": st.floats(1e-3, 1e3) | st.just(INF),
    "tau_sigma": st.floats(1e-3, 1e3) | st.just(INF),
    "length_ratio": st.floats(1.0, 1e3),
}


# --- the formulas ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "dimensions", "n_t"), [("derived", 1, 3), ("published", 2, 3)])
def test_every_coefficient_by_its_definition(name, dimensions, n_t):
    e, tau_c, tau_p, tau_sigma, pe, scale, u = 0.9, 0.02, 0.7, 3.0, 2e5, 150.0, 40.0
    found, c = coefficients(
        name,
        dimensions,
        restitution=e,
        tau_c=tau_c,
        tau_p=tau_p,
        tau_sigma=tau_sigma,
        peclet=pe,
        length_ratio=scale,
        energy_ratio=u,
    )
    tau_xi = c["exchange_time"] * pe / scale**2
    k1 = (
        c["third_moment_collision"] / tau_c
        + c["third_moment_drag"] / tau_p
        + c["third_moment_exchange"] / tau_xi
    )
    k2 = c["third_moment_trace"] / tau_c
    g1 = 1 + c["third_moment_shear"] / (scale * tau_xi)
    g2 = c["third_moment_divergence"] / (scale * tau_xi)
    bracket = (
        (1 + e) / (3 * tau_c)
        + 1 / tau_p
        + (c["variance_flux_exchange"] - c["variance_flux_product"] * tau_c * scale**2 / pe)
        / tau_xi
    )
    expected = {
        "flux": 1 + c["collisional_flux_number"] * scale / pe,
        "triboconductivity": 1 / tau_sigma,
        "dispersion": 1 / pe,
        "gradient_production": 1 + c["covariance_production_gradient"] * e * scale / pe,
        "field_production": c["covariance_production_field"] * e * scale / tau_sigma,
        "electric_force": u,
        "covariance_destruction": (1 + e) / (3 * tau_c)
        + 1 / tau_p
        + c["covariance_exchange"] / tau_xi,
        "third_moment": k1,
        "third_moment_trace": k1 + n_t * k2,
        "third_moment_coupling": k2,
        "shear": g1,
        "divergence": g2,
        "covariance_dispersion": g1 / k1,
        "divergence_dispersion": (g1 + g2 - k2 * (2 * g1 + n_t * g2) / (k1 + n_t * k2)) / k1,
        "variance_destruction": 1 / tau_xi - c["variance_regain"] * tau_c * scale**4 / pe**2,
        "variance_field_production": c["variance_production_field"]
        * tau_c
        * scale**2
        / tau_sigma**2,
        "variance_collisional_dispersion": c["variance_dispersion"] * tau_c * scale**2 / pe**2,
        "variance_flux_destruction": bracket,
        "transferred_fraction": c["transferred_fraction"] * tau_c * scale**2 / pe,
        "granular_temperature": 1.0,
    }
    assert found.dropped is None
    assert set(expected) == set(values_of(found))
    for field, value in expected.items():
        assert float(getattr(found, field)) == pytest.approx(value, rel=1e-13), field


def test_longitudinal_dispersion_in_one_dimension():
    for name, n_t in (("derived", 3), ("published", 1)):
        found, c = coefficients(name, restitution=0.8, tau_c=0.05)
        g1 = found.shear
        g2 = c["third_moment_divergence"] / c["exchange_time"] * 192 / 1e6
        k1, k2 = found.third_moment, c["third_moment_trace"] / 0.05
        expected = (2 * g1 + g2 - k2 * (2 * g1 + n_t * g2) / (k1 + n_t * k2)) / k1
        assert found.longitudinal_dispersion == pytest.approx(expected, rel=1e-13)


def test_the_papers_form_of_the_dispersion_in_one_dimension():
    found, c = coefficients("published")
    g2 = c["third_moment_divergence"] / c["exchange_time"] * 192 / 1e6
    expected = (2 * found.shear + g2) / found.third_moment_trace
    assert found.longitudinal_dispersion == pytest.approx(expected, rel=1e-13)


def test_published_takes_the_full_trace_beyond_one_dimension():
    one, two, three = (coefficients("published", d)[0] for d in (1, 2, 3))
    assert two == three
    assert one.third_moment_trace != two.third_moment_trace
    assert coefficients("derived", 1)[0] == coefficients("derived", 3)[0]


@given(**numbers)
def test_exact_production_by_the_gradient_belongs_to_the_flux(**changes):
    # λ2.2 e (√Θ/d) D = e η Θ: both come from one and the same transfer of charge over d.
    found, _ = coefficients(**changes)
    eta = found.flux - 1.0
    expected = 1.0 + changes["restitution"] * eta
    assert found.gradient_production == pytest.approx(expected, rel=1e-13)


@given(**numbers)
def test_exact_production_by_the_field_has_the_weight_of_that_by_the_gradient(**changes):
    # At contact the field drives charge as a difference of charge would: S τ_σ = (P - 1) Pe.
    found, _ = coefficients(**changes)
    left = found.field_production
    gain = changes["restitution"] * closures.derived(1.0)["covariance_production_gradient"]
    assert left == pytest.approx(gain * changes["length_ratio"] / changes["tau_sigma"], rel=1e-13)


@given(exponent=st.floats(-0.4, 3.0), **numbers)
def test_exact_destruction_of_variance_changes_sign_at_the_limit(exponent, **changes):
    found, c = coefficients(exponent=exponent, **changes)
    limit = closures.fraction_limit(exponent)
    rate = changes["length_ratio"] ** 2 / changes["peclet"] / c["exchange_time"]
    expected = rate * (1.0 - found.transferred_fraction / limit)
    assert found.variance_destruction == pytest.approx(expected, rel=1e-9, abs=1e-12 * rate)


# --- limits ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", closures.NAMES)
def test_no_drag_and_no_conduction(name):
    found, _ = coefficients(name, tau_p=INF, tau_sigma=INF)
    assert found.triboconductivity == 0.0
    assert found.field_production == 0.0
    assert found.variance_field_production == 0.0
    almost, _ = coefficients(name, tau_p=1e25, tau_sigma=1e25)
    for field, value in values_of(found).items():
        assert values_of(almost)[field] == pytest.approx(value, rel=1e-13, abs=1e-20), field


@pytest.mark.parametrize("name", closures.NAMES)
def test_collisionless_limit(name):
    found, c = coefficients(name, tau_c=INF, peclet=INF, tau_sigma=INF, tau_p=0.5)
    drag = c["third_moment_drag"] / 0.5
    expected = {
        "flux": 1.0,
        "gradient_production": 1.0,
        "covariance_destruction": 2.0,
        "third_moment": drag,
        "third_moment_trace": drag,
        "covariance_dispersion": 1.0 / drag,
        "divergence_dispersion": 1.0 / drag,
        "variance_flux_destruction": 2.0,
        "shear": 1.0,
        "electric_force": 300.0,
        "granular_temperature": 1.0,
    }
    for field, value in values_of(found).items():
        assert value == expected.get(field, 0.0), field
    # of the closed flux of C, which knows no collisions here but answers to the force
    told = models.validity(found, c)
    assert ["takes back" in sentence for sentence in told] == [True] * (name == "complete")


def test_numbers_may_be_traced():
    @eqx.filter_jit
    def destruction(tau_c):
        changed = Numbers(**NUMBERS).model_copy(update={"tau_c": tau_c})
        c = closures.derived(1.0)
        return models.transport_coefficients(changed, c, 1).covariance_destruction

    found, _ = coefficients(tau_c=0.03)
    assert float(destruction(0.03)) == pytest.approx(found.covariance_destruction, rel=1e-14)


# --- range of validity ----------------------------------------------------------------------------

OUTSIDE = {
    "the covariance destruction rate R": ("derived", {"tau_c": 0.2, "peclet": 1e4}),
    "the relaxation rate of ⟨ξ'ξ'c'⟩ in Dv_kin": ("derived", {"tau_c": 0.07, "peclet": 1e4}),
    "G1 of the third-order moment": (
        "derived",
        {"tau_c": 1e-5, "peclet": 40.0, "restitution": 0.0},
    ),
    "the longitudinal dispersion of the covariance": (
        "derived",
        {"tau_c": 1e-5, "peclet": 50.0, "restitution": 0.0},
    ),
}
"""Numbers that bring each quantity to the wrong side while those checked before it are fine."""


@pytest.mark.parametrize("quantity", OUTSIDE)
@pytest.mark.parametrize("allowed", [False, True])
def test_quantity_that_must_be_positive_is_refused_by_name(quantity, allowed):
    name, changes = OUTSIDE[quantity]
    sentence = refusal(coefficients(name, **changes), allow_out_of_range=allowed)
    assert quantity in sentence
    assert re.search(r" is -\d", sentence)
    assert "must be positive" in sentence
    assert f"'{name}'" in sentence


def test_kinetic_dispersion_of_the_published_set_is_refused():
    assert "Dv_kin" in refusal(coefficients("published", tau_c=0.2, peclet=1e4))


@given(closure_set=st.sampled_from(closures.NAMES), dimensions=st.integers(1, 3), **numbers)
def test_the_denominators_of_the_third_moment_never_fail_first(closure_set, dimensions, **changes):
    # With numbers of either set R turns negative before K1 and K1 + n_t K2 do; at e = 1 without
    # drag R and K1 + 3 K2 are the same number, hence the margin.
    found, _ = coefficients(closure_set, dimensions, **changes)
    margin = 1e-9 * abs(found.covariance_destruction) + 1e-12 / changes["tau_c"]
    if closure_set == "published":
        assert min(found.third_moment, found.third_moment_trace) > 0.0
    else:
        assert found.third_moment > found.covariance_destruction - margin
        assert found.third_moment_trace > found.covariance_destruction - margin


@pytest.mark.parametrize(
    ("field", "quantity"),
    [
        ("covariance_destruction", "R"),
        ("third_moment", "K1 of"),
        ("third_moment_trace", "K1 + n_t K2 of"),
        ("variance_flux_destruction", "Dv_kin"),
        ("shear", "G1"),
        ("divergence_dispersion", "longitudinal dispersion"),
    ],
)
@pytest.mark.parametrize("bad", [-1e3, math.nan])
def test_each_quantity_is_looked_at(field, quantity, bad):
    found, c = coefficients()
    broken = eqx.tree_at(lambda f: getattr(f, field), found, bad)
    assert quantity in refusal((broken, c), allow_out_of_range=True)


def test_zero_is_not_positive():
    found, c = coefficients()
    broken = eqx.tree_at(lambda f: f.third_moment, found, 0.0)
    assert "K1 of" in refusal((broken, c))


def test_too_large_a_transferred_fraction_is_refused_unless_allowed():
    found = coefficients(tau_c=0.04, peclet=1e4)
    fraction = found[0].transferred_fraction
    assert fraction == pytest.approx(0.5727, abs=1e-4)
    sentence = refusal(found)
    assert "γΘ^(a/2) = 0.5727" in sentence
    assert "0.5471" in sentence
    assert "allow_out_of_range" in sentence
    warnings = models.validity(*found, allow_out_of_range=True)
    assert any("0.5727" in warning for warning in warnings)
    assert any("F <= 0" in warning for warning in warnings)


@pytest.mark.parametrize("exponent", [0.4, 0.8, 1.6])
def test_the_limit_belongs_to_the_exponent(exponent):
    c = closures.derived(1.0, exponent)
    at_limit = closures.fraction_limit(exponent) / c["transferred_fraction"] * 1e6 / 192.0**2
    models.validity(*coefficients(exponent=exponent, tau_c=0.999 * at_limit))
    assert "γΘ^(a/2)" in refusal(coefficients(exponent=exponent, tau_c=1.001 * at_limit))


def test_a_large_transferred_fraction_is_warned_about_from_a_quarter_on():
    kappa = closures.derived(1.0)["transferred_fraction"]
    quarter = 0.25 / kappa * 1e6 / 192.0**2
    (warning,) = models.validity(*coefficients(tau_c=1.001 * quarter))
    assert "γΘ^(a/2) = 0.2502" in warning
    assert models.validity(*coefficients(tau_c=0.999 * quarter)) == ()


def test_published_variance_grows_and_the_warning_says_why():
    found = coefficients("published", tau_c=0.1, peclet=1e4)
    assert found[0].transferred_fraction == pytest.approx(1.43, abs=5e-3)
    assert "γΘ^(a/2) = 1.432" in refusal(found)
    warnings = models.validity(*found, allow_out_of_range=True)
    growth = next(warning for warning in warnings if "F <= 0" in warning)
    assert "exp(28.6 t)" in growth
    assert "λ' = 12" in growth


def test_published_sign_change_is_far_below_the_limit_and_does_not_refuse():
    c = closures.published(1.0)
    turn = c["transferred_fraction"] / (c["variance_regain"] * c["exchange_time"])
    assert turn == pytest.approx(0.0152, abs=5e-5)
    tau_c = turn / c["transferred_fraction"] * 1e6 / 192.0**2
    assert models.validity(*coefficients("published", tau_c=0.999 * tau_c)) == ()
    (warning,) = models.validity(*coefficients("published", tau_c=1.001 * tau_c))
    assert "λ' = 12" in warning
    assert "variance grows" in warning


@pytest.mark.parametrize(("name", "expected"), [("published", 15), ("derived", 1)])
def test_how_much_of_the_papers_range_has_growing_variance(name, expected):
    growing = [
        coefficients(name, tau_c=tau_c, peclet=peclet)[0].variance_destruction <= 0.0
        for tau_c in np.logspace(-4, -1, 8).tolist()
        for peclet in np.logspace(4, 7, 8).tolist()
    ]
    assert sum(growing) == expected
