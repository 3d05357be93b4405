"""What the paper's derivation drops of the collision integrals, by computer algebra.

The integral and the way in which it is done are those of `benchmarks.collision_algebra`. Its causes
are derivatives of T_ij, N_i and V and products of two of C, ∇Q and E. Each is put in as the moments
around x that have it: T_ij(x + s) = s_i s_j, say, for second derivatives of T. Where an answer has
two parts, as p ∂_i∂_j T_ij + q ∇²T_mm has, two such moments tell them apart. Factors X, Y and Z
mark C, ∇Q and E in products.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import sympy
from sympy import Expr, Matrix, Rational, S, eye, zeros

from benchmarks.collision_algebra import (
    BETA,
    GAMMA,
    VELOCITY_1,
    VELOCITY_2,
    K,
    Observable,
    answer,
    axis,
)

X, Y, Z = sympy.symbols("X Y Z", real=True)


class Local(NamedTuple):
    """Moments of the particles around x, which vanish there unless they are its own.

    Attributes
    ----------
    charge : Expr
        Mean charge less that at x.
    covariance, third : Matrix
        C_i and T_ij.
    variance : Expr
        V.
    flux : Matrix
        N_i.
    """

    charge: Expr = S.Zero
    covariance: Matrix = zeros(3, 1)
    third: Matrix = zeros(3, 3)
    variance: Expr = S.Zero
    flux: Matrix = zeros(3, 1)

    def deviation(self, velocity: Matrix) -> Expr:
        """Return ⟨ξ'|c⟩, (A2) with (A8)-(A10)."""
        third = (velocity.dot(self.third * velocity) - self.third.trace()) / 2
        return self.covariance.dot(velocity) + third

    def mean(self, velocity: Matrix) -> Expr:
        """Return ⟨ξ − Q(x)|c⟩."""
        return self.charge + self.deviation(velocity)

    def square(self, velocity: Matrix) -> Expr:
        """Return ⟨(ξ − Q(x))²|c⟩, with ⟨ξ'ξ'|c⟩ = V + N.c."""
        crossed = 2 * self.charge * self.deviation(velocity) + self.charge**2
        return self.variance + self.flux.dot(velocity) + crossed


Around = Callable[[Matrix], Local]
Field = Callable[[Matrix], Matrix]


def nowhere(_: Matrix) -> Matrix:
    """Return no field."""
    return zeros(3, 1)


def nothing(_: Matrix) -> Local:
    """Return no moments."""
    return Local()


def response(observable: Observable, around: Around, field: Field = nowhere) -> Expr:
    """Return C(ψ) of moments and a field around x, in units of n² g0 d², products included.

    Parameters
    ----------
    observable : callable
        ψ of a velocity and of the charge's deviation from Q(x).
    around : callable
        Moments at x + s.
    field : callable
        E at x + s.
    """
    here, there = around(zeros(3, 1)), around(K)
    moments = {
        (0, 0): S.One,
        (1, 0): here.mean(VELOCITY_1),
        (0, 1): there.mean(VELOCITY_2),
        (2, 0): here.square(VELOCITY_1),
        (0, 2): there.square(VELOCITY_2),
        (1, 1): here.mean(VELOCITY_1) * there.mean(VELOCITY_2),
    }
    return answer(observable, moments, field(K / 2))


def _charge(_: Matrix, xi: Any) -> Expr:
    return xi


def _square(_: Matrix, xi: Any) -> Expr:
    return xi**2


def _per_axis(observable: Callable[[int], Observable], around: Callable[[int], Around]) -> Expr:
    """Return a third of the sum over the axes, the answer to a unit vector."""
    return sympy.expand(sum(response(observable(i), around(i)) for i in range(3)) / 3)


def _covariance(i: int) -> Observable:
    return lambda c, xi: xi * c[i]


def _flux(i: int) -> Observable:
    return lambda c, xi: xi**2 * c[i]


def _third(i: int, j: int) -> Observable:
    return lambda c, xi: xi * (c[i] * c[j] - int(i == j))


def _solved(first: Expr, second: Expr, matrix: list[list[int]]) -> tuple[Expr, Expr]:
    """Return p and q of two answers m p + n q."""
    p, q = Matrix(matrix).LUsolve(Matrix([first, second]))
    return sympy.expand(p), sympy.expand(q)


def charge_by_third() -> tuple[Expr, Expr]:
    """Return p and q of the answer p ∂_i∂_j T_ij + q ∇²T_mm of C(ξ)."""
    outer = response(_charge, lambda s: Local(third=s * s.T))
    isotropic = response(_charge, lambda s: Local(third=s.dot(s) * eye(3)))
    return _solved(outer, isotropic, [[12, 6], [6, 18]])


def covariance_by_third() -> tuple[Expr, Expr]:
    """Return p and q of the answer p ∂_j T_ij + q ∂_i T_mm of C(ξ c_i)."""
    outer = _per_axis(_covariance, lambda i: lambda s: Local(third=axis(i) * s.T + s * axis(i).T))
    isotropic = _per_axis(_covariance, lambda i: lambda s: Local(third=s[i] * eye(3)))
    return _solved(outer, isotropic, [[4, 2], [1, 3]])


def covariance_by_itself() -> tuple[Expr, Expr]:
    """Return p and q of the answer p ∇²C_i + q ∂_i ∇.C of C(ξ c_i)."""
    half = Rational(1, 2)
    parallel = _per_axis(
        _covariance, lambda i: lambda s: Local(covariance=half * s.dot(s) * axis(i))
    )
    outer = _per_axis(_covariance, lambda i: lambda s: Local(covariance=s[i] * s))
    return _solved(parallel, outer, [[3, 1], [2, 4]])


def third_by_charge() -> tuple[Expr, Expr]:
    """Return p and q of the answer p ∂_i∂_j Q + q δ_ij ∇²Q of C(ξ c_i c_j) − δ_ij C(ξ)."""
    trace, product = S.Zero, S.Zero
    for i in range(3):
        trace += response(_third(i, i), lambda s: Local(charge=s.dot(s) / 2))
        for j in range(3):
            product += response(_third(i, j), lambda s, i=i, j=j: Local(charge=s[i] * s[j]))
    return _solved(trace, product, [[3, 9], [12, 6]])


def third_by_field() -> tuple[Expr, Expr]:
    """Return p and q of the answer p ∂_i E_j + q δ_ij ∇.E, where E has no curl."""
    trace, product = S.Zero, S.Zero
    for i in range(3):
        trace += response(_third(i, i), nothing, lambda s: s)
        for j in range(3):
            product += response(
                _third(i, j), nothing, lambda s, i=i, j=j: axis(i) * s[j] + axis(j) * s[i]
            )
    return _solved(trace, product, [[3, 9], [12, 6]])


def products() -> dict[str, Expr]:
    """Return the answers of C(ξξ) to products of C, ∇Q and E, by the letters of both."""

    def along(i: int) -> Expr:
        return response(
            _square,
            lambda s: Local(charge=Y * s[i], covariance=X * axis(i)),
            lambda _: Z * axis(i),
        )

    total = sympy.Poly(sympy.expand(sum(map(along, range(3))) / 3), X, Y, Z)
    marks = {"C": X, "Q": Y, "E": Z}
    pairs = ("CQ", "CE", "CC", "QQ", "QE", "EE")
    return {
        pair: sympy.expand(total.coeff_monomial(marks[pair[0]] * marks[pair[1]])) for pair in pairs
    }


def dropped_responses() -> dict[str, Expr]:
    """Return the answers to what the paper's derivation drops.

    Returns
    -------
    dict of str to Expr
        Fields of `triboflux.responses.Responses`.
    """
    product = products()
    parts = {
        "charge_third": charge_by_third(),
        "covariance_third": covariance_by_third(),
        "covariance_curvature": covariance_by_itself(),
        "third_charge": third_by_charge(),
        "third_field": third_by_field(),
    }
    found: dict[str, Expr] = {}
    for name, (first, second) in parts.items():
        mark = BETA if name == "third_field" else GAMMA
        found |= {name: first.coeff(mark), f"{name}_trace": second.coeff(mark)}
    return found | {
        "variance_flux": (response(_square, lambda s: Local(flux=s)) / 3).coeff(GAMMA, 2),
        "flux_variance": _per_axis(_flux, lambda i: lambda s: Local(variance=s[i])).coeff(GAMMA, 2),
        "variance_covariance_gradient": product["CQ"].coeff(GAMMA),
        "variance_covariance_gradient_regain": product["CQ"].coeff(GAMMA, 2),
        "variance_covariance_field": product["CE"].coeff(GAMMA, 0).coeff(BETA),
        "variance_covariance_field_regain": product["CE"].coeff(GAMMA).coeff(BETA),
        "variance_covariance": product["CC"].coeff(GAMMA),
        "variance_covariance_regain": product["CC"].coeff(GAMMA, 2),
        "variance_gradient": product["QQ"].coeff(GAMMA, 2),
        "variance_gradient_field": product["QE"].coeff(GAMMA).coeff(BETA),
    }
