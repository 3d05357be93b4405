"""The state of a moment model: mean charge, charge-velocity covariance, variance and more."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
from jaxtyping import Array

from triboflux.hierarchy import RANKS

# Every module with arrays imports this one: the equations are stiff and need double precision.
jax.config.update("jax_enable_x64", True)


class Moments(eqx.Module):
    """Fields of the moments, or their Fourier coefficients.

    As fields on a grid with points ``*x`` the shapes are ``[*x]`` for scalars, ``[component, *x]``
    for vectors and ``[component, component, *x]`` for symmetric tensors; as Fourier coefficients
    (`Grid.to_spectral`) ``[..., 2, *modes]``, real and imaginary parts along the axis of length
    two. A moment that a model does not evolve, or a contribution that vanishes identically, is
    ``None``. `triboflux.hierarchy.RANKS` lists the moments in this order.

    Attributes
    ----------
    charge : Array or None
        Mean charge Q, a scalar, dimensionless, scaled by Q0.
    covariance : Array or None
        Charge-velocity covariance C = ⟨ξ'c'⟩, a vector, dimensionless, scaled by Q0 √Θ.
    variance : Array or None
        Charge variance V = ⟨ξ'ξ'⟩, a scalar, dimensionless, scaled by Q0².
    covariance_flux : Array or None
        Third-order moment T_ij = ⟨ξ'c'_i c'_j⟩, a tensor, dimensionless, scaled by Q0 Θ.
    covariance_flux_trace : Array or None
        Its trace T_mm = ⟨ξ'c'·c'⟩ over three dimensions, a scalar, scaled by Q0 Θ.
    granular_temperature_tensor : Array or None
        R_ij = ⟨c'_i c'_j⟩, a tensor, scaled by Θ at time 0.
    granular_temperature : Array or None
        A third of its trace over three dimensions, a scalar, scaled by Θ at time 0.
    dissipated_energy : Array or None
        What collisions, contacts and drag have taken of the particles' kinetic energy and the
        field's since time 0, a scalar, per mass of particles, scaled by Θ at time 0.
    specific_volume : Array or None
        Volume per particle 1/n, a scalar, scaled by its mean.
    mean_velocity : Array or None
        Mean velocity U, a vector, scaled by √Θ at time 0.
    """

    charge: Any = None
    covariance: Any = None
    variance: Any = None
    covariance_flux: Any = None
    covariance_flux_trace: Any = None
    granular_temperature_tensor: Any = None
    granular_temperature: Any = None
    dissipated_energy: Any = None
    specific_volume: Any = None
    mean_velocity: Any = None

    def __add__(self, other: Moments) -> Moments:
        """Add two states moment by moment; ``None`` counts as zero."""
        return Moments(*(_add(getattr(self, name), getattr(other, name)) for name in RANKS))


def _add(left: Array | None, right: Array | None) -> Array | None:
    if left is None:
        return right
    return left if right is None else left + right
