"""The exact closure coefficients, proven by computer algebra for every restitution and exponent."""

import pytest
import sympy
from sympy import Rational, gamma, sqrt
from sympy.parsing import sympy_parser

from benchmarks import collision_algebra as algebra
from benchmarks import dropped_algebra
from benchmarks.collision_algebra import A, E, J
from triboflux import closures
from triboflux.collision import collide
from triboflux.responses import ADDITIONS

J_1, J1, J2, J12 = J(1), J(1 + A), J(2 + A), J(1 + 2 * A)
EXCHANGE = (2 - (2 + A) * E) / 6
SHEAR = J2 * (A * E**2 + 3 * E**2 + 2 * E - 1) / (120 * J1)
FORMS = {
    "triboconductivity": J1 / 6,
    "dispersion": J1 / 6,
    "collisional_flux": J2 / 6,
    "covariance_production_field": J2 / J1,
    "covariance_production_gradient": J2 / J1,
    "charge_exchange": 2 * J1,
    "covariance_collision": (1 + E) / 3,
    "covariance_exchange": EXCHANGE,
    "third_moment_collision": (1 + E) * (19 - 3 * E) / 30,
    "third_moment_exchange": EXCHANGE,
    "third_moment_drag": sympy.Integer(2),
    "third_moment_trace": -(1 + E) * (1 + 3 * E) / 60,
    "third_moment_shear": SHEAR,
    "third_moment_divergence": SHEAR,
    "variance_regain": 72 * J_1 * J12 / J1**2,
    "variance_production_field": 12 * J_1 * J12 / J1**2,
    "variance_dispersion": 6 * J_1 * J12 / J1**2,
    "variance_flux_exchange": (5 - (2 + A) * E) / 6,
    "variance_flux_regain": J12 / (2 * J1),
    "variance_flux_product": 3 * J_1 * J12 / J1**2,
    "exchange_time": Rational(1, 12),
    "collisional_flux_number": J2 / J1,
    "transferred_fraction": 6 * J_1 / J1,
    "collision_rate": 4 * sqrt(sympy.pi),
    "third_moment_exchange_trace": sympy.Integer(0),
    "charge_third_moment": (1 + A) / 20,
    "covariance_third_moment": (2 + (2 + A) * E) / 20,
    "covariance_collisional_dispersion": (1 + (2 + A) * E) / 10,
    "third_moment_flux": ((2 + A) * E**2 - 1) / 10,
    "variance_collisional_flux": J(2 + 2 * A) / 6,
    "variance_covariance_exchange": (1 + A) / 6,
    "variance_covariance_regain": (1 + 2 * A) * J12 / (6 * J1),
    # twice the same, by the two parts of a tensor or by the two causes of a flux of charge
    "charge_third_moment_trace": (1 + A) / 20,
    "covariance_third_moment_trace": (2 + (2 + A) * E) / 20,
    "covariance_collisional_dispersion_divergence": (1 + (2 + A) * E) / 10,
    "third_moment_flux_trace": ((2 + A) * E**2 - 1) / 10,
    "third_moment_flux_field": ((2 + A) * E**2 - 1) / 10,
    "third_moment_flux_field_trace": ((2 + A) * E**2 - 1) / 10,
    "variance_production_gradient": 12 * J_1 * J12 / J1**2,
    "variance_production_mixed": 12 * J_1 * J12 / J1**2,
    "variance_covariance_gradient": sympy.Integer(2),
    "variance_covariance_gradient_regain": sympy.Integer(4),
    "variance_covariance_field": sympy.Integer(2),
    "variance_covariance_field_regain": sympy.Integer(4),
    "variance_flux_production": sympy.Integer(1),
}
"""The table of the exact coefficients, typed once more."""

# Elastic, inelastic and sticking; constant, Hertzian, linear and steeper transfer.
SETTINGS = [(1.0, 0.8), (0.8, 0.8), (0.5, 0.5), (0.3, 0.0), (0.9, 1.0), (0.05, 2.5), (0.7, -0.3)]


@pytest.fixture(scope="module")
def forms():
    return algebra.exact_forms()


def vanishes(expression):
    return sympy.simplify(sympy.gammasimp(expression.rewrite(gamma))) == 0


def test_collision_integral():
    assert algebra.prove_collision_integral() == (0, 0)
    assert J(1).rewrite(gamma) == 4 * sqrt(sympy.pi)
    assert sympy.expand(J(5 + A) - 2 * (4 + A) * 2 * (2 + A) * J(1 + A)) == 0


def test_maxwellian_falls_apart_into_pair_variables():
    assert algebra.maxwellian_in_pair_variables() == (0, 0)


@pytest.mark.parametrize("power", range(7))
@pytest.mark.parametrize("variance", [sympy.S.Half, sympy.Integer(2)])
def test_gaussian_moments(power, variance):
    x = sympy.Symbol("x", real=True)
    density = sympy.exp(-(x**2) / (2 * variance)) / sqrt(2 * sympy.pi * variance)
    integral = sympy.integrate(x**power * density, (x, -sympy.oo, sympy.oo))
    assert sympy.simplify(integral - algebra.maxwellian_moment(power, variance)) == 0


def test_conditional_moments_have_the_moments_they_are_made_for():
    """(A3)-(A5), and the same for the second moment."""
    velocity = sympy.Matrix(algebra.CENTRE)
    names = sympy.symbols("Q C_1:4 T_11 T_12 T_13 T_22 T_23 T_33 V N_1:4", real=True)
    charge, c, t, v, n = names[0], names[1:4], names[4:10], names[10], names[11:]
    third = sympy.Matrix([[t[0], t[1], t[2]], [t[1], t[3], t[4]], [t[2], t[4], t[5]]])
    causes = algebra.Causes(
        charge_hessian=2 * charge * sympy.eye(3),
        covariance=sympy.Matrix(c),
        third=third,
        variance=v,
        flux=sympy.Matrix(n),
    )
    # At unit distance the chosen charge is Q.
    first = algebra.first_moment(causes, velocity, algebra.K)
    second = algebra.second_moment(causes, velocity, algebra.K)

    def mean(expression):
        terms = sympy.Poly(sympy.expand(expression), *velocity).terms()
        moment = algebra.maxwellian_moment
        return sympy.expand(
            sum(factor * sympy.prod(moment(p, sympy.S.One) for p in ps) for ps, factor in terms)
        )

    assert mean(first) == charge
    assert mean(second) == v
    for i in range(3):
        assert mean(first * velocity[i]) == c[i]
        assert mean(second * velocity[i]) == n[i]
        for j in range(3):
            product = velocity[i] * velocity[j] - int(i == j)
            assert mean(first * product) == third[i, j]


def test_every_coefficient_of_the_closure_set_is_derived(forms):
    assert forms.keys() == {*closures.complete(1.0).coefficients, *ADDITIONS} == FORMS.keys()


@pytest.mark.parametrize("name", FORMS)
def test_form(forms, name):
    assert vanishes(forms[name] - FORMS[name])


@pytest.mark.parametrize("setting", SETTINGS)
def test_values_of_the_closure_set(forms, setting):
    known = closures.complete(*setting)
    for name in known.coefficients:
        value = algebra.evaluated(forms[name], *setting)
        assert known[name] == pytest.approx(value, rel=1e-13, abs=1e-14), name


def test_formulas_shown_to_users(forms):
    """Each formula in words of the closure set is the form that was derived."""
    transformations = (
        *sympy_parser.standard_transformations,
        sympy_parser.implicit_multiplication,
        sympy_parser.convert_xor,
    )
    names = {"a": A, "e": E, "J_": J, "J_1": J_1, "rho_1": forms["third_moment_shear"]}
    for name, coefficient in closures.complete(0.8).coefficients.items():
        text = coefficient.formula.rpartition(" = ")[2]
        if text.startswith("lambda"):
            assert text == "lambda_1.3/lambda_1.2"
            shown = forms["collisional_flux"] / forms["dispersion"]
        else:
            # in brackets, because 2e-1 would be read as a number
            shown = sympy_parser.parse_expr(
                text.replace("e", "(e)"),
                local_dict=dict(names),
                transformations=transformations,
            )
        assert vanishes(shown - forms[name]), name


def test_identities(forms):
    """Those that hold for every exponent, several of which the printed set breaks."""
    flux_number = forms["collisional_flux_number"]
    assert forms["covariance_production_field"] == flux_number
    assert forms["covariance_production_gradient"] == flux_number
    assert vanishes(forms["collisional_flux"] / forms["triboconductivity"] - flux_number)
    assert forms["variance_regain"] == 6 * forms["variance_production_field"]
    assert forms["variance_regain"] == 12 * forms["variance_dispersion"]
    assert forms["triboconductivity"] == forms["dispersion"]
    assert forms["third_moment_shear"] == forms["third_moment_divergence"]
    assert forms["covariance_exchange"] == forms["third_moment_exchange"]
    assert vanishes(forms["variance_flux_exchange"] - forms["covariance_exchange"] - Rational(1, 2))


def test_what_is_dropped_repeats_what_is_kept():
    """Of |J|² the derivation keeps σ²E², of C·J nothing; squares of first moments are products."""
    found, products = algebra.responses(), dropped_algebra.products()
    assert products["EE"] == found.variance_field * algebra.BETA**2
    squared = products["EE"] / algebra.BETA**2
    assert vanishes(products["QQ"] / algebra.GAMMA**2 - squared)
    # |C|² in C(ξξ) is what two charges share on average, 2γ(g.k)^a ξ1 ξ2 less twice its square
    shared = products["CC"].coeff(algebra.GAMMA), products["CC"].coeff(algebra.GAMMA, 2)
    for power, (part, sign) in enumerate(zip(shared, (1, -1), strict=True), 1):
        order = 1 + power * A
        # of C.c1 C.c2 the parts across k cancel; along it (1 - (g.k)²/2)/2 is left, a third of it
        left = sign * 2 * (J(order) / 2 - order_moment(order) / 4) / 3
        assert vanishes(part - left), power


def order_moment(order):
    """Return J_(p+2) by its recurrence."""
    return 2 * (order + 1) * J(order)


def test_variance_grows_from_the_fraction_limit_on():
    """The destruction of variance changes sign where γΘ^(a/2) = J_(1+a)/J_(1+2a)."""
    found = algebra.responses()
    limit = -found.variance_exchange / found.variance_regain
    assert vanishes(limit - J1 / J12)
    value = algebra.evaluated(limit, 1.0, 0.8)
    assert closures.fraction_limit(0.8) == pytest.approx(value, rel=1e-13)


def test_swap_of_all_charges_needs_no_integral(forms):
    """At a = 0 and γ = 1 the two particles swap their charges.

    Then ξ1 c1+ + ξ2 c2+ of the pair with charges swapped and of the pair without add up to
    (ξ1 + ξ2)(c1 + c2), in which momentum is conserved. With ξ = C.c or ξξ = N.c this leaves
    g g C/2, so that the rates with and without swap add up to a third of ⟨g g⟩/2 per collision,
    (J_3 + 4 J_1)/(6 J_1) = 4/3.
    """
    values = {name: form.subs(A, 0).doit() for name, form in forms.items()}
    collision = values["covariance_collision"]
    # The exchange rate is 1/tau_xi = 2 J_1 there, twice the collision rate.
    swapped = collision + 2 * values["covariance_exchange"]
    assert sympy.expand(swapped + collision - Rational(4, 3)) == 0
    flux = values["variance_flux_exchange"] - values["variance_flux_regain"]
    assert sympy.simplify(collision + 2 * flux + collision - Rational(4, 3)) == 0


@pytest.mark.parametrize(
    ("name", "factor", "wrong"),
    [
        ("dispersion", 2, {"charge_transfer": 2}),
        ("triboconductivity", 3, {"field_transfer": 3}),
        ("charge_exchange", 1, {"field_transfer": 3}),
    ],
)
def test_forms_follow_the_collision_rule(monkeypatch, forms, name, factor, wrong):
    def other(*positional, **named):
        scaled = {key: named[key] * times for key, times in wrong.items()}
        return collide(*positional, **(named | scaled))

    monkeypatch.setattr(algebra, "collide", other)
    assert vanishes(algebra.exact_forms()[name] - factor * forms[name])


def test_main_prints_all_forms(capsys, forms):
    algebra.main()
    printed = capsys.readouterr().out
    assert len(printed.splitlines()) == len(forms)
    assert "-(a*e + 2*e - 2)/6" in printed
    assert "(a*e**2 + 3*e**2 + 2*e - 1)*J_(2+a)/(120*J_(1+a))" in printed
