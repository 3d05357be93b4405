"""Closure coefficients of the moment equations, exact and as printed in the paper.

Every coefficient follows from the collision rule (2.5)-(2.15) through the integrals

    J_p = 2**(p + 1) * sqrt(pi) * Gamma((p + 1) / 2),

where ``J_p n**2 Theta**(p/2)`` is the integral of ``(g.k)**p`` over all approaching pairs of a
Maxwellian. Two named sets exist: `derived`, the exact values for any restitution and any exponent
of the charge-transfer law, and `published`, the numbers printed by Montilla, Ansart & Simonin
(2023) together with the choices that their runs made.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from triboflux.collision import HERTZ_EXPONENT
from triboflux.errors import InputError, nearest

NAMES = ("derived", "published")


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
        ``"derived"`` or ``"published"``.
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
        a in the transferred charge ~ (g.k)**a, dimensionless, above -1/2 (J_(1+2a) has to exist).

    Raises
    ------
    InputError
        If the exponent is not a finite number above -1/2.
    """
    if not (math.isfinite(exponent) and exponent > -0.5):
        raise InputError(
            f"exponent: {exponent} is not allowed; it must be a finite number above -0.5."
        )
    e, a = restitution, exponent
    j_1 = collision_integral(1.0)
    j1 = collision_integral(1.0 + a)
    j2 = collision_integral(2.0 + a)
    j12 = collision_integral(1.0 + 2.0 * a)
    exchange = (2.0 - (2.0 + a) * e) / 6.0
    shear = j2 * (a * e**2 + 3.0 * e**2 + 2.0 * e - 1.0) / (120.0 * j1)
    square = j_1 * j12 / j1**2
    make = Coefficient
    coefficients = {
        "triboconductivity": make("lambda_1.1", j1 / 6.0, "J_(1+a)/6", "(2.25)"),
        "dispersion": make("lambda_1.2", j1 / 6.0, "J_(1+a)/6", "(2.26)"),
        "collisional_flux": make("lambda_1.3", j2 / 6.0, "J_(2+a)/6", "(2.27)"),
        "covariance_production_field": make("lambda_2.1", j2 / j1, "J_(2+a)/J_(1+a)", "(3.4)"),
        "covariance_production_gradient": make("lambda_2.2", j2 / j1, "J_(2+a)/J_(1+a)", "(3.4)"),
        "charge_exchange": make("lambda_2.3", 2.0 * j1, "2 J_(1+a)", "(3.6)"),
        "covariance_collision": make("C rate, 1/tau_c", (1.0 + e) / 3.0, "(1+e)/3", "(3.4)"),
        "covariance_exchange": make(
            "C rate, 1/tau_xi",
            exchange,
            "(2-(2+a)e)/6",
            "(3.4)",
            "Negative for nearly elastic particles: charge exchange prefers fast collisions.",
        ),
        "third_moment_collision": make(
            "K1, 1/tau_c", (1.0 + e) * (19.0 - 3.0 * e) / 30.0, "(1+e)(19-3e)/30", "(3.8)"
        ),
        "third_moment_exchange": make("K1, 1/tau_xi", exchange, "(2-(2+a)e)/6", "(3.8)"),
        "third_moment_drag": make(
            "K1, 1/tau_p", 2.0, "2", "(A1)", "Drag acts on both velocities; (3.8) prints 1."
        ),
        "third_moment_trace": make(
            "K2, 1/tau_c", -(1.0 + e) * (1.0 + 3.0 * e) / 60.0, "-(1+e)(1+3e)/60", "(3.9)"
        ),
        "third_moment_shear": make(
            "rho_1", shear, "J_(2+a)(a e^2+3e^2+2e-1)/(120 J_(1+a))", "(3.10)"
        ),
        "third_moment_divergence": make("rho_2", shear, "rho_1", "(3.10)"),
        "variance_regain": make("lambda_3.1", 72.0 * square, "72 J_1 J_(1+2a)/J_(1+a)^2", "(4.2)"),
        "variance_production_field": make(
            "lambda_3.2", 12.0 * square, "12 J_1 J_(1+2a)/J_(1+a)^2", "(4.2)"
        ),
        "variance_dispersion": make(
            "lambda_3.3", 6.0 * square, "6 J_1 J_(1+2a)/J_(1+a)^2", "(4.2)"
        ),
        "variance_flux_exchange": make(
            "lambda_3.4", (5.0 - (2.0 + a) * e) / 6.0, "(5-(2+a)e)/6", "(4.3)"
        ),
        "variance_flux_regain": make(
            "lambda_3.5", j12 / (2.0 * j1), "J_(1+2a)/(2 J_(1+a))", "(4.3)"
        ),
        "variance_flux_product": make(
            "lambda_3.5 kappa", 3.0 * square, "3 J_1 J_(1+2a)/J_(1+a)^2", "(5.4)"
        ),
        "exchange_time": make("lambda'", 1.0 / 12.0, "lambda_1.2/lambda_2.3 = 1/12", "(5.20)"),
        "collisional_flux_number": make("lambda''", j2 / j1, "lambda_1.3/lambda_1.2", "(5.21)"),
        "transferred_fraction": _transferred_fraction(a),
    }
    return ClosureSet("derived", restitution, exponent, coefficients)


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
    e = restitution
    s = 1.0 + e
    make = Coefficient
    coefficients = {
        "triboconductivity": make("lambda_1.1", 1.825, "1.825", "(2.25)"),
        "dispersion": make("lambda_1.2", 1.825, "1.825", "(2.26)"),
        "collisional_flux": make("lambda_1.3", 5.936, "5.936", "(2.27)", "3/2 of the exact value."),
        "covariance_production_field": make(
            "lambda_2.1", 0.5422, "0.5422", "(3.4)", "A quarter of the exact value."
        ),
        "covariance_production_gradient": make(
            "lambda_2.2", 0.5422, "0.5422", "(3.4)", "A quarter of the exact value."
        ),
        "charge_exchange": make("lambda_2.3", 21.90, "21.90", "(3.6)"),
        "covariance_collision": make("C rate, 1/tau_c", s / 3.0, "(1+e)/3", "(3.4)"),
        "covariance_exchange": make("C rate, 1/tau_xi", (3.0 - e) / 5.0, "(3-e)/5", "(3.4)"),
        "third_moment_collision": make(
            "K1, 1/tau_c", 6.667 * s - 1.387 * s**2, "6.667(1+e)-1.387(1+e)^2", "(3.8)"
        ),
        "third_moment_exchange": make("K1, 1/tau_xi", 3.201, "3.201", "(3.8)"),
        "third_moment_drag": make("K1, 1/tau_p", 1.0, "1", "(3.8)", "(A1) has 2/tau_p."),
        "third_moment_trace": make(
            "K2, 1/tau_c", 0.2667 * s - 0.2607 * s**2, "0.2667(1+e)-0.2607(1+e)^2", "(3.9)"
        ),
        "third_moment_shear": make(
            "rho_1", 10.68 * s + 0.2048 * s**2, "10.68(1+e)+0.2048(1+e)^2", "(3.10)"
        ),
        "third_moment_divergence": make(
            "rho_2", 208.2 * s + 0.2048 * s**2, "208.2(1+e)+0.2048(1+e)^2", "(3.10)"
        ),
        "variance_regain": make(
            "lambda_3.1", 21.29, "21.29", "(4.2)", "A quarter of the exact value."
        ),
        "variance_production_field": make("lambda_3.2", 14.20, "14.20", "(4.2)"),
        "variance_dispersion": make("lambda_3.3", 0.6278, "0.6278", "(4.2)"),
        "variance_flux_exchange": make("lambda_3.4", 2.806, "2.806", "(4.3)"),
        "variance_flux_regain": make("lambda_3.5", 1.017, "1.017", "(4.3)"),
        "variance_flux_product": make(
            "lambda_3.5 kappa",
            20.39,
            "20.39",
            "(5.4)",
            "Not 1.017 kappa = 3.95; the printed SI and dimensionless forms differ.",
        ),
        "exchange_time": make(
            "lambda'", 12.0, "12", "(5.20)", "Inverted: (2.26) and (3.6) give 1/12."
        ),
        "collisional_flux_number": make("lambda''", 3.256, "3.256", "(5.21)"),
        "transferred_fraction": _transferred_fraction(HERTZ_EXPONENT),
    }
    return ClosureSet("published", restitution, HERTZ_EXPONENT, coefficients)


def by_name(name: str, restitution: float, exponent: float = HERTZ_EXPONENT) -> ClosureSet:
    """Return the closure set called `name`.

    Parameters
    ----------
    name : str
        ``"derived"`` or ``"published"``.
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


def _transferred_fraction(exponent: float) -> Coefficient:
    """Return kappa in γΘ^(a/2) = kappa τ_c (L/d)²/Pe, an identity of the collision rule."""
    value = 6.0 * collision_integral(1.0) / collision_integral(1.0 + exponent)
    return Coefficient("kappa", value, "6 J_1/J_(1+a)", "", "Follows from (2.26) and (3.5).")
