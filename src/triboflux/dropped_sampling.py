"""Sampled answers of the collision integrals to what the paper's derivation drops.

The causes are those of `benchmarks.dropped_algebra`: moments that depend on place, which are put on
the second particle, one diameter away from the first; and products of two causes. The answer to a
product is what changes its sign with one of the two.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from triboflux import observables as psi
from triboflux.observables import Array, Observable

if TYPE_CHECKING:
    from triboflux.sampling import Collisions

CONTACT = 0.5
"""Where the mean field is taken, as a part of the way from the first centre to the second."""


def dropped_responses(collisions: Collisions) -> dict[str, Array]:
    """Return what every single pair contributes to the answers, but for its weight.

    Parameters
    ----------
    collisions : Collisions
        The pairs under one collision rule.

    Returns
    -------
    dict of str to array
        Fields of `triboflux.responses.Responses`, of shape ``(samples,)``.
    """
    return _curved(collisions) | _third(collisions) | _products(collisions)


def _parts(name: str, first: Any, second: Any, matrix: list[list[float]]) -> dict[str, Array]:
    """Return p and q of two answers m p + n q."""
    (a, b), (c, d) = matrix
    determinant = a * d - b * c
    return {
        name: (d * first - b * second) / determinant,
        f"{name}_trace": (a * second - c * first) / determinant,
    }


def _curved(collisions: Collisions) -> dict[str, Array]:
    """Return the answers of C(ξ) and C(ξ c_i) to T_ij and to the curvature of C_i."""
    zero, (_, c, k, _) = collisions.zero, collisions.pairs
    along = np.sum(k * c, axis=0)
    energy = 0.5 * (np.sum(c**2, axis=0) - 3.0)

    def answer(observable: Observable, charge: Array) -> Array:
        return collisions.changes(observable, (np.zeros_like(charge), charge))[1]

    def per_axis(charge: Array) -> Array:
        return answer(psi.covariance, charge) / 3.0

    # T(s) = s_i s_j and s² δ_ij; for each axis e_i s_j + s_i e_j and s_k δ_ij; C = s²/2 and s_i s
    return {
        **_parts(
            "charge_third",
            answer(psi.charge, 0.5 * (along**2 - 1.0)),
            answer(psi.charge, energy + zero),
            [[12.0, 6.0], [6.0, 18.0]],
        ),
        **_parts(
            "covariance_third",
            per_axis(c * along - k),
            per_axis(k * energy),
            [[4.0, 2.0], [1.0, 3.0]],
        ),
        **_parts(
            "covariance_curvature",
            per_axis(0.5 * c),
            per_axis(k * along),
            [[3.0, 1.0], [2.0, 4.0]],
        ),
    }


def _third(collisions: Collisions) -> dict[str, Array]:
    """Return the answers of C(ξ c_i c_j) − δ_ij C(ξ) to the derivatives of a flux of charge."""
    zero, one, axes = collisions.zero, collisions.one, collisions.axes
    k = collisions.pairs.direction
    matrix = [[3.0, 9.0], [12.0, 6.0]]
    # Q(s) = s²/2 and s_i s_j, then E(s) = s and e_i s_j + e_j s_i
    by_charge = (
        collisions.changes(psi.third_trace, (zero, 0.5 * one))[1],
        collisions.changes(psi.third_product, (zero * axes, k[:, None] * k[None]))[1],
    )
    outer = axes[:, :, None] * k[None, None]
    single = CONTACT * (outer + outer.swapaxes(1, 2))
    driven = (
        collisions.after((zero, zero), 0.0, field_transfer=1.0, field=field)
        for field in (CONTACT * k, single)
    )
    trace, product = (
        observable(outcome.velocity_1, outcome.charge_1)
        for observable, outcome in zip((psi.third_trace, psi.third_product), driven, strict=True)
    )
    by_field = _parts("third_field", trace, product, matrix)
    return _parts("third_charge", *by_charge, matrix) | by_field


def _products(collisions: Collisions) -> dict[str, Array]:
    """Return the answers of C(ξξ) to products and to ∇·N, and that of C(ξξ c_i) to ∇V.

    Each particle has the charge that is the mean at its velocity. The squares of those charges do
    not count as a variance; like everything else but the product, they are the same with either
    sign.
    """
    zero, one, axes = collisions.zero, collisions.one, collisions.axes
    c1, c2, k, _ = collisions.pairs

    def mean(charges: tuple[Array, Array], field: Array) -> list[Array]:
        found = collisions.changes(psi.square, charges, field_transfer=1.0, field=field)
        return [part.sum(axis=0) / 3.0 for part in found]

    def odd(plus: list[Array], minus: list[Array]) -> list[Array]:
        return [0.5 * (p - m) for p, m in zip(plus, minus, strict=True)]

    none = zero * axes
    gradient = odd(mean((c1, c2 + k), none), mean((c1, c2 - k), none))
    field = odd(mean((c1, c2), axes), mean((c1, c2), -axes))
    both = odd(mean((c1, c2), none), mean((c1, -c2), none))
    crossed = odd(mean((np.zeros_like(k), k), axes), mean((np.zeros_like(k), k), -axes))
    # A moment N or V that is there with a sign is a charge of 1 with that signed probability.
    along = np.sum(k * c2, axis=0)
    return {
        "variance_covariance_gradient": gradient[1],
        "variance_covariance_gradient_regain": gradient[2],
        "variance_covariance_field": field[0],
        "variance_covariance_field_regain": field[1],
        "variance_covariance": both[1],
        "variance_covariance_regain": both[2],
        "variance_gradient": mean((np.zeros_like(k), k), none)[2],
        "variance_gradient_field": crossed[1],
        "variance_flux": along * collisions.changes(psi.square, (zero, one))[2] / 3.0,
        "flux_variance": collisions.changes(
            lambda velocity, charge: charge**2 * np.sum(k * velocity, axis=0), (zero, one)
        )[2]
        / 3.0,
    }
