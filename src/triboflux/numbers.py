"""The seven dimensionless numbers of a case."""

from __future__ import annotations

import math

from pydantic import Field, model_validator

from triboflux.errors import InputError
from triboflux.validation import (
    Fraction,
    InputModel,
    NonNegative,
    Positive,
    PositiveOrInfinite,
)


class Numbers(InputModel):
    r"""The seven dimensionless numbers, typed by hand.

    Lengths are scaled by the box length :math:`L`, velocities by :math:`\sqrt\Theta`
    (:math:`\Theta`: granular temperature), charges by :math:`Q_0`, times by
    :math:`L/\sqrt\Theta`; see Montilla, Ansart & Simonin (2023), section 5. An infinite time or
    Péclet number switches its mechanism off.

    Numbers that come from one real suspension are not independent of each other; numbers typed
    by hand may be any.

    Attributes
    ----------
    peclet : float
        Péclet number :math:`L\sqrt\Theta/D` of triboelectric diffusion; may be inf.
    tau_c : float
        Time between the collisions of a particle. Inf means no collisions, which is accepted
        only if ``peclet`` and ``tau_sigma`` are inf and ``tau_p`` is finite.
    tau_p : float
        Drag time; inf (the default) means no drag.
    tau_sigma : float
        Time of triboelectric conduction; inf (the default) means none.
    energy_ratio : float
        Electric over kinetic energy, :math:`u = n Q_0^2 L^2/(\varepsilon_0 m \Theta)`.
    length_ratio : float
        Box length over particle diameter, :math:`L/d`.
    restitution : float
        Coefficient of restitution, from 0 to 1.

    Raises
    ------
    InputError
        If a number is missing or not allowed.
    """

    peclet: PositiveOrInfinite = Field(description="Péclet number, a positive number or inf")
    tau_c: PositiveOrInfinite = Field(description="collision time, a positive number or inf")
    tau_p: PositiveOrInfinite = math.inf
    tau_sigma: PositiveOrInfinite = math.inf
    energy_ratio: NonNegative = Field(description="electric over kinetic energy, 0 or positive")
    length_ratio: Positive = Field(description="box length over particle diameter, positive")
    restitution: Fraction = Field(description="coefficient of restitution, from 0 to 1")

    @model_validator(mode="after")
    def _collisionless_is_consistent(self) -> Numbers:
        if self.tau_c != math.inf:
            return self
        # every product with tau_c must be 0, and something must still relax the covariance
        for name in ("peclet", "tau_sigma"):
            value: float = getattr(self, name)
            if value != math.inf:
                raise InputError.about(
                    name, f"is {value!r}, but must be inf without collisions (tau_c = inf)"
                )
        if self.tau_p == math.inf:
            raise InputError.about(
                "tau_p", "is inf, but must be finite without collisions (tau_c = inf)"
            )
        return self
