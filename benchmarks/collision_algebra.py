"""The closure coefficients by computer algebra, for symbolic restitution e and exponent a.

It evaluates the shifted collision integral of Enskog's theory,

    C(ψ) = g0 d² ∫ H(g.k)(g.k) [ψ(c1+,ξ1+) − ψ(c1,ξ1)]
                   f(x,c1,ξ1) f(x + d k,c2,ξ2) dk dc1 dc2 dξ1 dξ2,

with units in which n, Θ, d and g0 are one, and with the field of the collision rule (2.14) at the
contact point x + d k/2. Three steps make every integral a product of one-dimensional ones:

1. With c1 = G + g/2 and c2 = G − g/2 the product of two Maxwellians is exp(−G² − g²/4)/(2π)³: the
   components of G and g are independent Gaussians of variance 1/2 and 2
   (`maxwellian_in_pair_variables`).
2. A coefficient of an isotropic tensor follows from sums over orthonormal axes, which do not change
   when all vectors are rotated together. Averaged over velocities, such a sum is therefore the same
   for every direction k, and the integral over the sphere is 4π times its value at k = (0,0,1).
3. There g.k is the third component of g, and the change of ψ is a polynomial in the others times
   powers of g.k. That leaves Gaussian moments and J_p = 4π ∫ x^p exp(−x²/4)/√(4π) dx over x > 0
   (`prove_collision_integral`).

Charges enter by their first two moments at fixed velocity, (A2) with (A8)-(A10),

    ⟨ξ|c⟩ = Q − T_mm/2 + C.c + c.T.c/2,    ⟨ξ'ξ'|c⟩ = V + N.c,

those of particle 2 at x + d k. As in the paper, products of two of these causes are left out,
except |E|²; `benchmarks.dropped_algebra` has them and whatever else the paper drops. The collision
rule itself is `triboflux.collision.collide`, given symbols::

    python -m benchmarks.collision_algebra     # prints every form, in seconds
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import sympy
from sympy import Expr, Matrix, S, Symbol, eye, zeros

from triboflux.collision import collide
from triboflux.responses import Responses, coefficients, isotropic_parts

E, A = sympy.symbols("e a", positive=True)
BETA, GAMMA = sympy.symbols("beta gamma", positive=True)
APPROACH = Symbol("g_n", positive=True)
POWER = Symbol("g_n**a", positive=True)
CENTRE = sympy.symbols("G_1:4", real=True)
SLIP = sympy.symbols("g_1:3", real=True)
CHARGES = sympy.symbols("xi_1:3", real=True)
K = Matrix([0, 0, 1])
VELOCITY_1 = Matrix(CENTRE) + Matrix([*SLIP, APPROACH]) / 2
VELOCITY_2 = Matrix(CENTRE) - Matrix([*SLIP, APPROACH]) / 2

Observable = Callable[[Matrix, Any], Expr]


class J(sympy.Function):
    """J_p, the mean of (g.k)**p over approaching pairs; recurrence brings p below 3."""

    nargs = 1

    @classmethod
    def eval(cls, order: Expr) -> Expr | None:
        """Apply J_(p+2) = 2 (p+1) J_p while the number in p is 3 or more."""
        number, _ = order.as_coeff_Add()
        return 2 * (order - 1) * cls(order - 2) if number >= 3 else None

    def _eval_rewrite_as_gamma(self, order: Expr, **_: Any) -> Expr:
        return 2 ** (order + 1) * sympy.sqrt(sympy.pi) * sympy.gamma((order + 1) / 2)

    def _sympystr(self, printer: Any) -> str:
        order = self.args[0]
        if order.is_Number:
            return f"J_{order}"
        number, rest = order.as_coeff_Add()
        return f"J_({number}+{printer.doprint(rest).replace('*', '')})"


def prove_collision_integral() -> tuple[Expr, Expr]:
    """Return J_p integrated minus its closed form, and J_(p+2) − 2 (p+1) J_p; both are zero."""
    order, x = sympy.symbols("p x", positive=True)
    density = sympy.exp(-(x**2) / 4) / sympy.sqrt(4 * sympy.pi)
    integral = 4 * sympy.pi * sympy.integrate(x**order * density, (x, 0, sympy.oo))
    closed = J(order).rewrite(sympy.gamma)
    recurrence = closed.subs(order, order + 2) - 2 * (order + 1) * closed
    return sympy.simplify(integral - closed), sympy.simplify(sympy.expand_func(recurrence))


def maxwellian_in_pair_variables() -> tuple[Expr, Expr]:
    """Return |c1|²/2 + |c2|²/2 − |G|² − |g|²/4 and the Jacobian less one; both are zero."""
    velocities = VELOCITY_1.col_join(VELOCITY_2)
    relative = Matrix([*SLIP, APPROACH])
    exponent = (
        velocities.dot(velocities) / 2 - Matrix(CENTRE).dot(CENTRE) - relative.dot(relative) / 4
    )
    jacobian = velocities.jacobian([*CENTRE, *relative]).det()
    return sympy.expand(exponent), abs(jacobian) - 1


class Causes(NamedTuple):
    """What can drive the collision integrals, at particle 1 and by derivatives there.

    Attributes
    ----------
    field, field_gradient
        E_i; ∂_j E_i at row j, column i.
    charge_gradient, charge_hessian
        ∂_i Q; ∂_i∂_j Q. The mean charge at x itself is zero.
    covariance, covariance_gradient
        C_i; ∂_j C_i at row j, column i.
    third
        T_ij = ⟨ξ'c_i c_j⟩.
    variance, variance_hessian
        V; ∂_i∂_j V.
    flux
        N_i = ⟨ξ'ξ'c_i⟩.
    """

    field: Matrix = zeros(3, 1)
    field_gradient: Matrix = zeros(3, 3)
    charge_gradient: Matrix = zeros(3, 1)
    charge_hessian: Matrix = zeros(3, 3)
    covariance: Matrix = zeros(3, 1)
    covariance_gradient: Matrix = zeros(3, 3)
    third: Matrix = zeros(3, 3)
    variance: Expr = S.Zero
    variance_hessian: Matrix = zeros(3, 3)
    flux: Matrix = zeros(3, 1)


def first_moment(causes: Causes, velocity: Matrix, shift: Matrix) -> Expr:
    """Return ⟨ξ|c⟩ − Q(x) at x + shift, (A2) with (A8)-(A10)."""
    charge = causes.charge_gradient.dot(shift) + shift.dot(causes.charge_hessian * shift) / 2
    covariance = causes.covariance + causes.covariance_gradient.T * shift
    third = (velocity.dot(causes.third * velocity) - causes.third.trace()) / 2
    return charge + covariance.dot(velocity) + third


def second_moment(causes: Causes, velocity: Matrix, shift: Matrix) -> Expr:
    """Return ⟨(ξ − Q(x))²|c⟩ at x + shift, without squares of first moments."""
    variance = causes.variance + shift.dot(causes.variance_hessian * shift) / 2
    return variance + causes.flux.dot(velocity)


def maxwellian_moment(power: int, variance: Expr) -> Expr:
    """Return the mean of x**power for a centred Gaussian."""
    if power % 2:
        return S.Zero
    return variance ** (power // 2) * sympy.factorial2(power - 1)


def average(change: Expr) -> Expr:
    """Return the integral of (g.k) times a change of ψ over all approaching pairs, at k = (0,0,1).

    Parameters
    ----------
    change : Expr
        Polynomial in the components of G and g, in g_n and in g_n**a.
    """
    variables = (*CENTRE, *SLIP, APPROACH, POWER)
    variances = (*[S.Half] * 3, *[S(2)] * 2)
    polynomial = sympy.Poly(change.subs(APPROACH**A, POWER), *variables)
    total = S.Zero
    for powers, factor in polynomial.terms():
        *gaussian, normal, transfers = powers
        term = factor * J(1 + normal + transfers * A)
        for power, variance in zip(gaussian, variances, strict=True):
            term *= maxwellian_moment(power, variance)
        total += term
    return sympy.expand(total)


def response(observable: Observable, **causes: Any) -> Expr:
    """Return C(ψ) for some causes, in units of n² g0 d², with powers of β and γ.

    Parameters
    ----------
    observable : callable
        ψ of a velocity and of the charge's deviation from Q(x).
    **causes
        Fields of `Causes`.
    """
    given = Causes(**causes)
    here, there = zeros(3, 1), K
    moments = {
        (0, 0): S.One,
        (1, 0): first_moment(given, VELOCITY_1, here),
        (0, 1): first_moment(given, VELOCITY_2, there),
        (2, 0): second_moment(given, VELOCITY_1, here),
        (0, 2): second_moment(given, VELOCITY_2, there),
        (1, 1): S.Zero,
    }
    return answer(observable, moments, given.field + given.field_gradient.T * K / 2)


def answer(observable: Observable, moments: Mapping[tuple[int, int], Expr], field: Matrix) -> Expr:
    """Return C(ψ), in units of n² g0 d², with powers of β and γ.

    Parameters
    ----------
    observable : callable
        ψ of a velocity and of the charge's deviation from Q(x).
    moments : mapping
        Mean products of these deviations of both particles at fixed velocities, by their powers.
    field : Matrix
        E at the point of contact.
    """
    after = collide(
        (VELOCITY_1, VELOCITY_2),
        CHARGES,
        K,
        restitution=E,
        exponent=A,
        charge_transfer=GAMMA,
        field_transfer=BETA,
        field=field,
    )
    change = observable(after.velocity_1, after.charge_1) - observable(VELOCITY_1, CHARGES[0])
    # The rule's only floating-point numbers are 0.5 and 1.0, which are exact.
    change = sympy.nsimplify(change, rational=True)
    terms = sympy.Poly(sympy.expand(change), *CHARGES).terms()
    return average(sympy.expand(sum(factor * moments[powers] for powers, factor in terms)))


def axis(index: int) -> Matrix:
    """Return a unit vector."""
    return eye(3)[:, index]


def by_vector(observable: Callable[[int], Observable], cause: str) -> Expr:
    """Return s of an answer s v_i to a vector v_i: a third of the sum over the axes."""
    answers = [response(observable(i), **{cause: axis(i)}) for i in range(3)]
    return sympy.expand(sum(answers) / 3)


def by_tensor(cause: str) -> tuple[Expr, Expr]:
    """Return p, s of the answer p A_mm δ_ij + s (A_ij + A_ji)/2 of ξ(c_i c_j − δ_ij) to A_ij."""
    trace = response(lambda c, charge: charge * (c.dot(c) - 3), **{cause: eye(3)})
    product = S.Zero
    for i in range(3):
        for j in range(3):
            single = axis(i) * axis(j).T
            product += response(
                lambda c, charge, i=i, j=j: charge * (c[i] * c[j] - int(i == j)), **{cause: single}
            )
    return isotropic_parts(trace, product)


def responses() -> Responses:
    """Return the answers of the collision integrals, each to one cause, as symbols."""
    # that module is made of parts of this one
    from benchmarks.dropped_algebra import dropped_responses

    def charge(_: Matrix, xi: Any) -> Expr:
        return xi

    def square(_: Matrix, xi: Any) -> Expr:
        return xi**2

    def covariance(i: int) -> Observable:
        return lambda c, xi: xi * c[i]

    def flux(i: int) -> Observable:
        return lambda c, xi: xi**2 * c[i]

    by_covariance = by_vector(covariance, "covariance")
    third, shear = by_tensor("third"), by_tensor("covariance_gradient")
    by_variance = response(square, variance=S.One)
    by_field_square = sum(response(square, field=axis(i)) for i in range(3)) / 3
    by_flux = by_vector(flux, "flux")
    return Responses(
        collision_rate=average(S.One),
        charge_field=response(charge, field_gradient=eye(3)).coeff(BETA) / 3,
        charge_laplacian=response(charge, charge_hessian=eye(3)).coeff(GAMMA) / 3,
        charge_covariance=response(charge, covariance_gradient=eye(3)).coeff(GAMMA) / 3,
        covariance_field=by_vector(covariance, "field").coeff(BETA),
        covariance_gradient=by_vector(covariance, "charge_gradient").coeff(GAMMA),
        covariance_velocity=by_covariance.coeff(GAMMA, 0),
        covariance_exchange=by_covariance.coeff(GAMMA),
        third_velocity=sympy.expand(third[1]).coeff(GAMMA, 0),
        third_velocity_trace=sympy.expand(third[0]).coeff(GAMMA, 0),
        third_exchange=sympy.expand(third[1]).coeff(GAMMA),
        third_exchange_trace=sympy.expand(third[0]).coeff(GAMMA),
        third_shear=sympy.expand(shear[1]).coeff(GAMMA) / 2,
        third_divergence=sympy.expand(shear[0]).coeff(GAMMA),
        variance_exchange=by_variance.coeff(GAMMA),
        variance_regain=by_variance.coeff(GAMMA, 2),
        variance_field=sympy.expand(by_field_square).coeff(BETA, 2),
        variance_laplacian=response(square, variance_hessian=eye(3)).coeff(GAMMA, 2) / 3,
        flux_velocity=by_flux.coeff(GAMMA, 0),
        flux_exchange=by_flux.coeff(GAMMA),
        flux_regain=by_flux.coeff(GAMMA, 2),
        **dropped_responses(),
    )


def drag_factor() -> Expr:
    """Return by how much faster than c_i the product c_i c_j decays under drag, (A1)."""
    time, time_scale = sympy.symbols("t tau_p", positive=True)
    velocity = [component * sympy.exp(-time / time_scale) for component in CENTRE[:2]]
    product = velocity[0] * velocity[1]
    return sympy.simplify(-time_scale * sympy.diff(product, time) / product)


def exact_forms() -> dict[str, Expr]:
    """Return every coefficient of `triboflux.closures.complete` as an expression in e, a and J_p.

    ``expression.rewrite(sympy.gamma)`` turns the J_p into Gamma functions.
    """
    found: Mapping[str, Expr] = coefficients(responses(), E)
    forms = {name: sympy.factor(sympy.cancel(form)) for name, form in found.items()}
    return forms | {"third_moment_drag": drag_factor()}


def evaluated(form: Expr, restitution: float, exponent: float) -> float:
    """Return the value of an exact form."""
    return float(form.rewrite(sympy.gamma).subs({E: restitution, A: exponent}).evalf(17))


def main() -> None:
    """Print all forms."""
    for name, form in exact_forms().items():
        print(f"{name:32s} {form}")


if __name__ == "__main__":
    main()
