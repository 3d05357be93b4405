"""The SI values of everything by which the scaled equations divide."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from triboflux.suspension import Suspension


@dataclass(frozen=True)
class Scales:
    """Scales of a suspension, in SI.

    Attributes
    ----------
    length : float
        L, the length of the domain, m.
    velocity : float
        √Θ, m/s.
    time : float
        L/√Θ, s.
    charge : float
        Q0, C per particle.
    charge_rate : float
        Q0 √Θ/L, C/s.
    covariance : float
        Q0 √Θ, C m/s; (5.9) of the paper prints Q0 Θ.
    variance : float
        Q0², C².
    field : float
        n Q0 L/ε0, V/m.
    potential : float
        n Q0 L²/ε0, V.
    number_density : float
        n, 1/m³.
    temperature : float
        Θ, m²/s².
    covariance_flux : float
        Q0 Θ, C m²/s².
    variance_flux : float
        Q0² √Θ, C² m/s.
    specific_volume : float
        1/n, m³.
    """

    length: float
    velocity: float
    time: float
    charge: float
    charge_rate: float
    covariance: float
    variance: float
    field: float
    potential: float
    number_density: float
    temperature: float
    covariance_flux: float
    variance_flux: float
    specific_volume: float

    @classmethod
    def of(cls, suspension: Suspension) -> Scales:
        """Return the scales of a suspension.

        Parameters
        ----------
        suspension : Suspension
            Gives L, Θ, Q0, n and the permittivity.
        """
        length, charge = suspension.domain_length, suspension.charge_scale
        velocity = suspension.velocity_scale
        field = suspension.number_density * charge * length / suspension.permittivity
        return cls(
            length=length,
            velocity=velocity,
            time=length / velocity,
            charge=charge,
            charge_rate=charge * velocity / length,
            covariance=charge * velocity,
            variance=charge**2,
            field=field,
            potential=field * length,
            number_density=suspension.number_density,
            temperature=velocity**2,
            covariance_flux=charge * velocity**2,
            variance_flux=charge**2 * velocity,
            specific_volume=1.0 / suspension.number_density,
        )
