"""One binary collision of two charged spheres, (2.5)-(2.17) of the paper.

The functions do arithmetic only, so that floats, NumPy and JAX arrays, symbols and quantities with
units all pass through them.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

HERTZ_EXPONENT = 0.8
"""Exponent a of the impact velocity in the charge that a Hertzian contact passes over."""


class Collided(NamedTuple):
    """Two particles after their collision.

    Attributes
    ----------
    velocity_1, velocity_2 : array_like
        Shape ``(3, ...)``.
    charge_1, charge_2 : array_like
        Shape ``(...)``.
    """

    velocity_1: Any
    velocity_2: Any
    charge_1: Any
    charge_2: Any


def contact_length(mass: Any, diameter: Any, youngs_modulus: Any, poisson_ratio: Any) -> Any:
    """Return X of (2.12): X (g.k)^(4/5) is the deepest overlap of two colliding spheres, a length.

    Hertz's theory for equal spheres has 16 where (2.12) prints 32, and with it an overlap
    2^(2/5) = 1.32 times as deep. X is kept as printed: it is part of the rule that all models
    here start from, and it enters triboconductivity and dispersion alike.

    Parameters
    ----------
    mass : float
        Mass of a particle, kg.
    diameter : float
        Diameter of a particle, m.
    youngs_modulus : float
        Young's modulus of its material, Pa.
    poisson_ratio : float
        Poisson's ratio of its material, dimensionless.

    Returns
    -------
    float
        m^(1/5) s^(4/5), for an approach velocity g.k in m/s.
    """
    compliance = (1.0 - poisson_ratio**2) / (32.0 * youngs_modulus)
    return (30.0 * mass * compliance / diameter**0.5) ** 0.4


def field_transfer(contact_length: Any, diameter: Any, permittivity: Any) -> Any:
    """Return beta of (2.16): -beta E.k (g.k)^a is the charge that the mean field moves.

    Parameters
    ----------
    contact_length : float
        From `contact_length`, m^(1/5) s^(4/5).
    diameter : float
        Diameter of a particle, m.
    permittivity : float
        Permittivity at the contact, F/m.

    Returns
    -------
    float
        C/(V/m) per (m/s)^(4/5).
    """
    return permittivity * math.pi * (diameter / 2.0) * contact_length


def charge_transfer(contact_length: Any, diameter: Any) -> Any:
    """Return gamma: gamma (g.k)^a is the part of the charge difference that is passed over.

    (2.17) prints ``1/(2 epsilon_0 d)`` in front, which has the wrong dimension; (2.10)-(2.14) give
    ``1/(2 d)``, hence ``beta/gamma = pi epsilon_0 d**2``.

    Parameters
    ----------
    contact_length : float
        From `contact_length`, m^(1/5) s^(4/5).
    diameter : float
        Diameter of a particle, m.

    Returns
    -------
    float
        Per (m/s)^(4/5).
    """
    return contact_length / (2.0 * diameter)


def collide(
    velocities: tuple[Any, Any],
    charges: tuple[Any, Any],
    direction: Any,
    *,
    restitution: Any,
    exponent: Any = HERTZ_EXPONENT,
    charge_transfer: Any,
    field_transfer: Any = 0.0,
    field: Any = (0.0, 0.0, 0.0),
) -> Collided:
    """Return two particles after their collision, (2.5), (2.6), (2.14) and (2.15).

    Momentum and charge of the pair are conserved.

    Parameters
    ----------
    velocities : tuple of array_like
        c1 and c2, each with a leading axis of three components.
    charges : tuple of array_like
        xi1 and xi2.
    direction : array_like
        Unit vector k from particle 1 to particle 2, shape ``(3, ...)``; the particles have to
        approach each other, ``(c1 - c2).k > 0``.
    restitution : float
        e, dimensionless.
    exponent : float
        a of the approach velocity, dimensionless.
    charge_transfer, field_transfer : float
        gamma and beta, in units that fit the velocities'.
    field : array_like
        Mean electric field at the contact point, three components.

    Returns
    -------
    Collided
        Velocities and charges afterwards.
    """
    (c1, c2), (xi1, xi2) = velocities, charges
    approach = sum((c1[i] - c2[i]) * direction[i] for i in range(3))
    along = sum(field[i] * direction[i] for i in range(3))
    kick = 0.5 * (1.0 + restitution) * approach
    moved = (charge_transfer * (xi2 - xi1) - field_transfer * along) * approach**exponent
    return Collided(c1 - kick * direction, c2 + kick * direction, xi1 + moved, xi2 - moved)
