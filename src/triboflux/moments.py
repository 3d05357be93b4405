"""The state of a moment model: mean charge, charge-velocity covariance and charge variance."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
from jaxtyping import Array

# Every module with arrays imports this one: the equations are stiff and need double precision.
jax.config.update("jax_enable_x64", True)


class Moments(eqx.Module):
    """Fields of the moments, or their Fourier coefficients.

    As fields on a grid with points ``*x`` the shapes are ``[*x]``, ``[component, *x]`` and
    ``[*x]``; as Fourier coefficients (`Grid.to_spectral`) ``[2, *modes]``, ``[component, 2,
    *modes]`` and ``[2, *modes]``, real and imaginary parts along the axis of length two. A moment
    that a model does not evolve, or a contribution that vanishes identically, is ``None``.

    Attributes
    ----------
    charge : Array or None
        Mean charge Q, dimensionless, scaled by Q0.
    covariance : Array or None
        Charge-velocity covariance C = ⟨ξ'c'⟩, dimensionless, scaled by Q0 √Θ.
    variance : Array or None
        Charge variance V = ⟨ξ'ξ'⟩, dimensionless, scaled by Q0².
    """

    charge: Any = None
    covariance: Any = None
    variance: Any = None

    def __add__(self, other: Moments) -> Moments:
        """Add two states moment by moment; ``None`` counts as zero."""
        return Moments(
            _add(self.charge, other.charge),
            _add(self.covariance, other.covariance),
            _add(self.variance, other.variance),
        )


def _add(left: Array | None, right: Array | None) -> Array | None:
    if left is None:
        return right
    return left if right is None else left + right
