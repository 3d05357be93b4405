"""Closure coefficients of the moment equations, exact and as printed in the paper.

Every coefficient follows from the collision rule (2.5)-(2.15) through the integrals

    J_p = 2**(p + 1) * sqrt(pi) * Gamma((p + 1) / 2),

where ``J_p n**2 Theta**(p/2)`` is the integral of ``(g.k)**p`` over all approaching pairs of a
Maxwellian. Three named sets exist: `derived`, the exact values for any restitution and any exponent
of the charge-transfer law; `published`, the numbers printed by Montilla, Ansart & Simonin (2023)
together with the choices that their runs made; and `complete`, which adds to `derived` what their
derivation drops.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from triboflux.closure_notes import ABOUT
from triboflux.collision import HERTZ_EXPONENT
from triboflux.errors import InputError, nearest

PAPERS_EQUATIONS = ("derived", "published")
"""The sets that go with the paper's own equations."""
NAMES = (*PAPERS_EQUATIONS, "complete")


@dataclass(frozen=True)
class Coefficient:
    """One closure coefficient with its origin.

    Attributes
    ----------
    symbol : str
        The field's notation, for instance ``"lambda_2.3"``.
    value : float
        Dimensionless value.
    formula : str
        Closed form, or the printed number.
    equation : str
        Where the paper states it.
    note : str
        What a reader has to know; empty where nothing.
    """

    symbol: str
    value: float
    formula: str
    equation: str
    note: str = ""


@dataclass(frozen=True)
class ClosureSet:
    """A named, complete set of closure coefficients.

    Attributes
    ----------
    name : str
        One of `NAMES`.
    restitution : float
        Restitution coefficient of particle-particle collisions.
    exponent : float
        Exponent a of the charge-transfer law, 4/5 for Hertzian contact.
    coefficients : Mapping[str, Coefficient]
        The coefficients by their spelled-out names.
    """

    name: str
    restitution: float
    exponent: float
    coefficients: Mapping[str, Coefficient]

    def __getitem__(self, name: str) -> float:
        """Return the value of the coefficient called `name`.

        Raises
        ------
        InputError
            If there is no coefficient of that name.
        """
        if name not in self.coefficients:
            raise InputError(
                f"closures: there is no coefficient '{name}'.{nearest(name, self.coefficients)}"
            )
        return self.coefficients[name].value

    @property
    def complete(self) -> bool:
        """Whether the equations have the terms that the paper's derivation drops."""
        return self.name == "complete"

    def trace_dimensions(self, grid_dimensions: int) -> int:
        """Return n_t, how many directions the trace of a third-order moment runs over.

        The trace of ⟨ξ'c'_i c'_j⟩ is three-dimensional whatever the grid (A16); the paper's
        one-dimensional equation (5.3) takes one direction, and so does `published` in one
        dimension.
        """
        return 1 if self.name == "published" and grid_dimensions == 1 else 3


def collision_integral(order: float) -> float:
    """Return J_p, the mean of (g.k)**p over approaching Maxwellian pairs, in units n² Θ^(p/2).

    Parameters
    ----------
    order : float
        The power p > -1.

    Notes
    -----
    ``J_p = 2**(p+1) sqrt(pi) Gamma((p+1)/2)``, hence ``J_(p+2) = 2 (p+1) J_p`` and
    ``J_1 = 4 sqrt(pi)``, the collision frequency of (3.5).
    """
    return 2.0 ** (order + 1.0) * math.sqrt(math.pi) * math.gamma((order + 1.0) / 2.0)


def derived(restitution: float, exponent: float = HERTZ_EXPONENT) -> ClosureSet:
    """Return the exact closure set for a restitution coefficient and a transfer exponent.

    Parameters
    ----------
    restitution : float
        e, dimensionless, between 0 and 1.
    exponent : float
        a in the transferred charge ~ (g.k)**a, dimensionless, above -1/2. The integrals exist
        above -1; from -1/2 down a sampled J_(1+2a) has no finite error.

    Raises
    ------
    InputError
        If the exponent is not a finite number above -1/2.
    """
    _check_exponent(exponent)
    values = _derived_values(restitution, exponent)
    return ClosureSet("derived", restitution, exponent, _coefficients(values))


def complete(restitution: float, exponent: float = HERTZ_EXPONENT) -> ClosureSet:
    """Return the exact closure set with the terms that the paper's derivation drops.

    Parameters
    ----------
    restitution, exponent : float
        e and a, as for `derived`.

    Raises
    ------
    InputError
        If the exponent is not a finite number above -1/2.
    """
    _check_exponent(exponent)
    values = _derived_values(restitution, exponent) | _dropped_values(restitution, exponent)
    return ClosureSet("complete", restitution, exponent, _coefficients(values))


def _check_exponent(exponent: float) -> None:
    if not (math.isfinite(exponent) and exponent > -0.5):
        raise InputError(
            f"exponent: {exponent} is not allowed; it must be a finite number above -0.5."
        )


def _derived_values(restitution: Any, exponent: float) -> dict[str, tuple[Any, str]]:
    """Return value and closed form of each exact coefficient."""
    e, a = restitution, exponent
    j_1 = collision_integral(1.0)
    j1 = collision_integral(1.0 + a)
    j2 = collision_integral(2.0 + a)
    j12 = collision_integral(1.0 + 2.0 * a)
    exchange = (2.0 - (2.0 + a) * e) / 6.0
    shear = j2 * (a * e**2 + 3.0 * e**2 + 2.0 * e - 1.0) / (120.0 * j1)
    square = j_1 * j12 / j1**2
    ratio = j2 / j1
    return {
        "triboconductivity": (j1 / 6.0, "J_(1+a)/6"),
        "dispersion": (j1 / 6.0, "J_(1+a)/6"),
        "collisional_flux": (j2 / 6.0, "J_(2+a)/6"),
        "covariance_production_field": (ratio, "J_(2+a)/J_(1+a)"),
        "covariance_production_gradient": (ratio, "J_(2+a)/J_(1+a)"),
        "charge_exchange": (2.0 * j1, "2 J_(1+a)"),
        "covariance_collision": ((1.0 + e) / 3.0, "(1+e)/3"),
        "covariance_exchange": (exchange, "(2-(2+a)e)/6"),
        "third_moment_collision": ((1.0 + e) * (19.0 - 3.0 * e) / 30.0, "(1+e)(19-3e)/30"),
        "third_moment_exchange": (exchange, "(2-(2+a)e)/6"),
        "third_moment_drag": (2.0, "2"),
        "third_moment_trace": (-(1.0 + e) * (1.0 + 3.0 * e) / 60.0, "-(1+e)(1+3e)/60"),
        "third_moment_shear": (shear, "J_(2+a)(a e^2+3e^2+2e-1)/(120 J_(1+a))"),
        "third_moment_divergence": (shear, "rho_1"),
        "variance_regain": (72.0 * square, "72 J_1 J_(1+2a)/J_(1+a)^2"),
        "variance_production_field": (12.0 * square, "12 J_1 J_(1+2a)/J_(1+a)^2"),
        "variance_dispersion": (6.0 * square, "6 J_1 J_(1+2a)/J_(1+a)^2"),
        "variance_flux_exchange": ((5.0 - (2.0 + a) * e) / 6.0, "(5-(2+a)e)/6"),
        "variance_flux_regain": (j12 / (2.0 * j1), "J_(1+2a)/(2 J_(1+a))"),
        "variance_flux_product": (3.0 * square, "3 J_1 J_(1+2a)/J_(1+a)^2"),
        "exchange_time": (1.0 / 12.0, "lambda_1.2/lambda_2.3 = 1/12"),
        "collisional_flux_number": (ratio, "lambda_1.3/lambda_1.2"),
        "transferred_fraction": _transferred_fraction(a),
    }


def _dropped_values(restitution: Any, exponent: float) -> dict[str, tuple[Any, str]]:
    """Return value and closed form of each coefficient that the paper's derivation drops."""
    e, a = restitution, exponent
    regain = collision_integral(1.0 + 2.0 * a) / (6.0 * collision_integral(1.0 + a))
    return {
        "charge_third_moment": ((1.0 + a) / 20.0, "(1+a)/20"),
        "covariance_third_moment": ((2.0 + (2.0 + a) * e) / 20.0, "(2+(2+a)e)/20"),
        "covariance_collisional_dispersion": ((1.0 + (2.0 + a) * e) / 10.0, "(1+(2+a)e)/10"),
        "third_moment_flux": (((2.0 + a) * e**2 - 1.0) / 10.0, "((2+a)e^2-1)/10"),
        "variance_collisional_flux": (collision_integral(2.0 + 2.0 * a) / 6.0, "J_(2+2a)/6"),
        "variance_covariance_exchange": ((1.0 + a) / 6.0, "(1+a)/6"),
        "variance_covariance_regain": (
            (1.0 + 2.0 * a) * regain,
            "(1+2a)J_(1+2a)/(6 J_(1+a))",
        ),
    }


def published(restitution: float) -> ClosureSet:
    """Return the closure set as printed by Montilla, Ansart & Simonin (2023), for a = 4/5.

    It keeps the paper's own choices: ``lambda' = 12``, drag factor 1 in K1, the trace of one
    direction in one dimension, and 20.39 in (5.4). One repair is made, without which the paper's
    figures do not come out: the factor of the collisional part of (5.3) is d/L, not L/d.

    Parameters
    ----------
    restitution : float
        e, dimensionless, between 0 and 1.
    """
    values = _published_values(restitution)
    return ClosureSet("published", restitution, HERTZ_EXPONENT, _coefficients(values))


def _published_values(restitution: Any) -> dict[str, tuple[Any, str]]:
    """Return value and printed form of each published coefficient."""
    e = restitution
    s = 1.0 + e
    return {
        "triboconductivity": (1.825, "1.825"),
        "dispersion": (1.825, "1.825"),
        "collisional_flux": (5.936, "5.936"),
        "covariance_production_field": (0.5422, "0.5422"),
        "covariance_production_gradient": (0.5422, "0.5422"),
        "charge_exchange": (21.90, "21.90"),
        "covariance_collision": (s / 3.0, "(1+e)/3"),
        "covariance_exchange": ((3.0 - e) / 5.0, "(3-e)/5"),
        "third_moment_collision": (6.667 * s - 1.387 * s**2, "6.667(1+e)-1.387(1+e)^2"),
        "third_moment_exchange": (3.201, "3.201"),
        "third_moment_drag": (1.0, "1"),
        "third_moment_trace": (0.2667 * s - 0.2607 * s**2, "0.2667(1+e)-0.2607(1+e)^2"),
        "third_moment_shear": (10.68 * s + 0.2048 * s**2, "10.68(1+e)+0.2048(1+e)^2"),
        "third_moment_divergence": (208.2 * s + 0.2048 * s**2, "208.2(1+e)+0.2048(1+e)^2"),
        "variance_regain": (21.29, "21.29"),
        "variance_production_field": (14.20, "14.20"),
        "variance_dispersion": (0.6278, "0.6278"),
        "variance_flux_exchange": (2.806, "2.806"),
        "variance_flux_regain": (1.017, "1.017"),
        "variance_flux_product": (20.39, "20.39"),
        "exchange_time": (12.0, "12"),
        "collisional_flux_number": (3.256, "3.256"),
        "transferred_fraction": _transferred_fraction(HERTZ_EXPONENT),
    }


def values_for(name: str, restitution: Any) -> dict[str, Any]:
    """Return the values of the closure set called `name` for Hertzian contacts.

    Parameters
    ----------
    name : str
        One of `NAMES`.
    restitution : object
        e, dimensionless: a number, or a symbol if code is to be generated.

    Returns
    -------
    dict
        By the coefficients' spelled-out names; of the kind that arithmetic with `restitution`
        gives.

    Raises
    ------
    InputError
        If the name is unknown.
    """
    by_name(name, 1.0)  # refuses an unknown name
    if name == "published":
        found = _published_values(restitution)
    else:
        found = _derived_values(restitution, HERTZ_EXPONENT)
    if name == "complete":
        found |= _dropped_values(restitution, HERTZ_EXPONENT)
    return {key: value for key, (value, _) in found.items()}


def by_name(name: str, restitution: float, exponent: float = HERTZ_EXPONENT) -> ClosureSet:
    """Return the closure set called `name`.

    Parameters
    ----------
    name : str
        One of `NAMES`.
    restitution : float
        e, dimensionless, between 0 and 1.
    exponent : float
        a, dimensionless; `published` exists for 4/5 only.

    Raises
    ------
    InputError
        If the name is unknown, or `published` is asked for with another exponent.
    """
    if name == "derived":
        return derived(restitution, exponent)
    if name == "complete":
        return complete(restitution, exponent)
    if name == "published":
        if exponent != HERTZ_EXPONENT:
            raise InputError(
                f"exponent: {exponent} is not allowed with closures = 'published', "
                "which were printed for 0.8 only; use closures = 'derived'."
            )
        return published(restitution)
    raise InputError(
        f"closures: '{name}' is not known; allowed are {', '.join(NAMES)}.{nearest(name, NAMES)}"
    )


def fraction_limit(exponent: float) -> float:
    """Return the γΘ^(a/2) from which collisions on average pass over more than the difference.

    It is J_(1+a)/J_(1+2a), 0.547 for a = 4/5; the exact destruction of variance changes sign there.
    """
    return collision_integral(1.0 + exponent) / collision_integral(1.0 + 2.0 * exponent)


def _transferred_fraction(exponent: float) -> tuple[float, str]:
    """Return kappa in γΘ^(a/2) = kappa τ_c (L/d)²/Pe, an identity of the collision rule."""
    return 6.0 * collision_integral(1.0) / collision_integral(1.0 + exponent), "6 J_1/J_(1+a)"


def _coefficients(values: Mapping[str, tuple[float, str]]) -> dict[str, Coefficient]:
    """Return coefficients from their values and formulas, with what is known about each."""
    return {
        name: Coefficient(ABOUT[name][0], value, formula, *ABOUT[name][1:])
        for name, (value, formula) in values.items()
    }
