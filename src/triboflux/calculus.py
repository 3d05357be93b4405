"""The vector calculus that the models need, on Fourier coefficients.

A discretisation offers ``gradient``, ``divergence``, ``laplacian`` and ``electric_field`` on its
own representation of fields, and ``values`` / ``from_values`` to and from values on the grid's
points. The finite-difference one is `triboflux.integrators.finite_difference.FiniteDifferences`.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from triboflux.grid import Grid


@runtime_checkable
class Discretisation(Protocol):
    """What a term needs of a space discretisation; vectors have a leading component axis."""

    grid: Grid

    def gradient(self, scalar: Array) -> Array:
        """Return ∇f."""
        ...

    def divergence(self, vector: Array) -> Array:
        """Return ∇·F."""
        ...

    def laplacian(self, field: Array) -> Array:
        """Return ∇²f of a scalar or, component by component, of a vector."""
        ...

    def electric_field(self, charge: Array) -> Array:
        """Return E with ∇·E = Q - ⟨Q⟩, ⟨E⟩ = 0."""
        ...

    def without_mean(self, scalar: Array) -> Array:
        """Return f - ⟨f⟩."""
        ...

    def values(self, representation: Array) -> Array:
        """Return the values on the points, shape ``[..., *x]``."""
        ...

    def from_values(self, values: Array) -> Array:
        """Return the representation of values on the points."""
        ...


class FourierCalculus(eqx.Module):
    """Exact differentiation of de-aliased Fourier coefficients, shape ``[..., 2, *modes]``."""

    grid: Grid

    def gradient(self, scalar: Float[Array, "2 *modes"]) -> Float[Array, "d 2 *modes"]:
        """Return ∇f, dimensionless, scaled by 1/L."""
        return jnp.stack([_times_i(scalar, k) for k in self.grid.wave_vector()])

    def divergence(self, vector: Float[Array, "d 2 *modes"]) -> Float[Array, "2 *modes"]:
        """Return ∇·F, dimensionless, scaled by 1/L."""
        pairs = zip(vector, self.grid.wave_vector(), strict=True)
        return sum((_times_i(f, k) for f, k in pairs), start=jnp.zeros_like(vector[0]))

    def laplacian(self, field: Float[Array, "*coefficients"]) -> Float[Array, "*coefficients"]:
        """Return ∇²f, dimensionless, scaled by 1/L²."""
        return _broadcast(-self.grid.wave_number_squared(), field) * field

    def electric_field(self, charge: Float[Array, "2 *modes"]) -> Float[Array, "d 2 *modes"]:
        """Return E = -∇φ with ∇²φ = -(Q - ⟨Q⟩), scaled by n Q0 L/ε0."""
        return -self.gradient(self.potential(charge))

    def potential(self, charge: Float[Array, "2 *modes"]) -> Float[Array, "2 *modes"]:
        """Return φ with ∇²φ = -(Q - ⟨Q⟩), ⟨φ⟩ = 0, scaled by n Q0 L²/ε0; (5.6)."""
        squared = self.grid.wave_number_squared()
        inverse = jnp.where(squared > 0.0, 1.0 / jnp.where(squared > 0.0, squared, 1.0), 0.0)
        return charge * _broadcast(inverse, charge)

    def without_mean(self, scalar: Float[Array, "2 *modes"]) -> Float[Array, "2 *modes"]:
        """Return f - ⟨f⟩."""
        return scalar * _broadcast(self.grid.wave_number_squared() > 0.0, scalar)

    def values(self, representation: Float[Array, "*coefficients"]) -> Float[Array, "*shape"]:
        """Return the values on the points."""
        return self.grid.to_fields(representation)

    def from_values(self, values: Float[Array, "*shape"]) -> Float[Array, "*coefficients"]:
        """Return the kept coefficients of values on the points (products are de-aliased here)."""
        return self.grid.to_spectral(values)


def _broadcast(factor: ArrayLike, field: Array) -> Array:
    array = jnp.asarray(factor)
    return array.reshape((1,) * (field.ndim - array.ndim) + array.shape)


def _times_i(coefficients: Array, wave: np.ndarray) -> Array:
    """Return i k f for real and imaginary parts along the leading axis."""
    real, imaginary = coefficients
    return jnp.stack([-wave * imaginary, wave * real])
