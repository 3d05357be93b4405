"""A periodic box of one, two or three dimensions and its Fourier transforms."""

from __future__ import annotations

import functools as ft
import math
from collections.abc import Iterable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float, Int

# Up to how many points a transform in one dimension is a product with a matrix.
DENSE_POINTS = 128
# From how many points on fields are transformed one after another: together they leave the cache.
ALONE = 2**15
# How many summits of a field compete for its peak.
SUMMITS = 8


def _integers(values: Iterable[int]) -> tuple[int, ...]:
    return tuple(int(value) for value in values)


def _floats(values: Iterable[float]) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


class Grid(eqx.Module):
    """A periodic box with equally spaced points.

    Products of fields are de-aliased by the 2/3 rule: of the Fourier modes m along an axis with N
    points only ``|m| <= (N - 1) // 3`` are kept, so a product of two kept fields has no aliasing
    error in the kept modes.

    Attributes
    ----------
    points : tuple of int
        Number of points per axis.
    lengths : tuple of float
        Length of the box per axis, dimensionless, scaled by L.
    """

    points: tuple[int, ...] = eqx.field(static=True, converter=_integers)
    lengths: tuple[float, ...] = eqx.field(static=True, converter=_floats)

    @property
    def dimensions(self) -> int:
        """Number of space dimensions."""
        return len(self.points)

    @property
    def kept(self) -> tuple[int, ...]:
        """Largest kept mode number per axis."""
        return tuple((n - 1) // 3 for n in self.points)

    @property
    def modes(self) -> tuple[int, ...]:
        """Shape of the kept Fourier coefficients; the last axis holds non-negative modes only."""
        *others, last = self.kept
        return (*(2 * k + 1 for k in others), last + 1)

    @property
    def _dense(self) -> bool:
        """Whether a product with a matrix is faster than a fast transform."""
        return self.dimensions == 1 and self.points[0] <= DENSE_POINTS

    def coordinates(self) -> tuple[np.ndarray, ...]:
        """Return the positions of the points along each axis, scaled by L, shape ``[points]``."""
        pairs = zip(self.points, self.lengths, strict=True)
        return tuple(np.arange(n) * (length / n) for n, length in pairs)

    def mode_numbers(self) -> tuple[np.ndarray, ...]:
        """Return the kept integer mode numbers per axis, shaped to broadcast over the modes."""
        *others, last = self.kept
        axes = [np.concatenate([np.arange(k + 1), np.arange(-k, 0)]) for k in others]
        axes.append(np.arange(last + 1))
        return tuple(
            axis.reshape([-1 if i == j else 1 for j in range(self.dimensions)])
            for i, axis in enumerate(axes)
        )

    def wave_vector(self) -> tuple[np.ndarray, ...]:
        """Return 2π m / length per axis, scaled by 1/L, shaped to broadcast over the modes."""
        pairs = zip(self.mode_numbers(), self.lengths, strict=True)
        return tuple(2.0 * np.pi * m / length for m, length in pairs)

    def wave_number_squared(self) -> Float[Array, "*modes"]:
        """Return |k|² of the kept modes, scaled by 1/L²."""
        # Made from one small array per axis, so that no program carries a constant of full size.
        return sum((jnp.asarray(k) ** 2 for k in self.wave_vector()), start=jnp.zeros(self.modes))

    def to_spectral(self, field: Float[Array, "*shape"]) -> Float[Array, "*coefficients"]:
        """Return the kept Fourier coefficients of real fields.

        Parameters
        ----------
        field : Array
            Values on the points, shape ``[..., *x]``.

        Returns
        -------
        Array
            Shape ``[..., 2, *modes]``: real and imaginary parts, normalised so that the zeroth
            coefficient is the mean.
        """
        if self._dense:
            _, forward = _dense_transforms(self.points[0])
            flat = field @ jnp.asarray(forward)
            return flat.reshape((*field.shape[:-1], 2, *self.modes))
        d = self.dimensions
        axes = tuple(range(-d, 0))
        if field.ndim > d and math.prod(self.points) >= ALONE:
            return lax.map(self.to_spectral, field)
        full = jnp.fft.rfftn(field, axes=axes, norm="forward")
        full = full[..., : self.kept[-1] + 1]
        for axis, k in zip(axes[:-1], self.kept[:-1], strict=True):
            full = _joined(full, axis, k, 0)
        return jnp.stack([full.real, full.imag], axis=-d - 1)

    def to_fields(self, coefficients: Float[Array, "*coefficients"]) -> Float[Array, "*shape"]:
        """Return the real fields of kept Fourier coefficients; the inverse of `to_spectral`.

        Parameters
        ----------
        coefficients : Array
            Shape ``[..., 2, *modes]``.

        Returns
        -------
        Array
            Values on the points, shape ``[..., *x]``.
        """
        if self._dense:
            inverse, _ = _dense_transforms(self.points[0])
            return coefficients.reshape((*coefficients.shape[:-2], -1)) @ jnp.asarray(inverse)
        d = self.dimensions
        axes = tuple(range(-d, 0))
        if coefficients.ndim > d + 1 and math.prod(self.points) >= ALONE:
            return lax.map(self.to_fields, coefficients)
        real, imaginary = jnp.moveaxis(coefficients, -d - 1, 0)
        full = real + 1j * imaginary
        for axis, k, n in zip(axes[:-1], self.kept[:-1], self.points[:-1], strict=True):
            full = _joined(full, axis, k, n - 2 * k - 1)
        return jnp.fft.irfftn(full, s=self.points, axes=axes, norm="forward")

    def resized(
        self, coefficients: Float[Array, "*coefficients"], to: Grid
    ) -> Float[Array, "*others"]:
        """Return kept Fourier coefficients of this grid as those of another grid of the same box.

        Parameters
        ----------
        coefficients : Array
            Shape ``[..., 2, *modes]``.
        to : Grid
            With more or fewer points per axis; modes that only it keeps become zero, and modes
            that it does not keep are dropped.
        """
        d = self.dimensions
        for axis, (old, new) in enumerate(zip(self.kept, to.kept, strict=True)):
            place, common = axis - d, min(old, new)
            if axis < d - 1:
                coefficients = _joined(coefficients, place, common, 2 * (new - common))
            else:
                low = _slice(coefficients, place, 0, common + 1)
                high = ((0, 0),) * (low.ndim - 1) + ((0, new - common),)
                coefficients = jnp.pad(low, high)
        return coefficients

    def rms(self, coefficients: Float[Array, "2 *modes"]) -> Float[Array, ""]:
        """Return the root mean square of a field over the box, by Parseval's identity."""
        return jnp.sqrt(jnp.sum(jnp.sum(coefficients**2, axis=0) * _conjugate_weight(self)))

    @eqx.filter_jit
    def peak(self, coefficients: Float[Array, "2 *modes"]) -> Float[Array, ""]:
        """Return max |f(x)| of a field over the whole box, not only over the points.

        The highest summits among the points are refined by Newton's method on the Fourier series,
        so the result does not depend on where the points lie, and is smooth in the field but for
        kinks where one summit overtakes another.
        """
        d = self.dimensions
        values = jnp.abs(self.to_fields(coefficients))
        spacing = jnp.asarray(self.lengths) / jnp.asarray(self.points)
        weighted = (coefficients[0] + 1j * coefficients[1]) * _conjugate_weight(self)

        def newton(_: Array, position: Array) -> Array:
            derivatives = _derivatives(self, weighted, position)
            sign = jnp.sign(derivatives[(0,) * d])
            gradient, hessian = _gradient_and_hessian(derivatives, d)
            # The peak of a plane wave is a ridge: its Hessian is singular along the crest.
            ridge = 1e-9 * jnp.max(jnp.abs(hessian)) + 1e-300
            step = _solve(sign * hessian - ridge * jnp.eye(d), -sign * gradient)
            return position + jnp.clip(step, -spacing / 2.0, spacing / 2.0)

        def height(position: Array) -> Array:
            return jnp.abs(_derivatives(self, weighted, position, highest=0)[(0,) * d])

        starts = _summits(values) * spacing[None]
        refined = jax.vmap(lambda start: lax.fori_loop(0, 3, newton, start))(starts)
        # The highest point need not lie below the highest summit: all are refined, then compared.
        positions = lax.stop_gradient(jnp.concatenate([refined, starts]))
        return height(positions[jnp.argmax(jax.vmap(height)(positions))])


@ft.cache
def _dense_transforms(points: int) -> tuple[np.ndarray, np.ndarray]:
    """Return matrices from kept coefficients to values and back, in one dimension."""
    phase = 2.0 * np.pi * np.outer(np.arange((points - 1) // 3 + 1), np.arange(points)) / points
    waves = np.concatenate([np.cos(phase), -np.sin(phase)])
    weight = np.where(np.arange(len(phase)) > 0, 2.0, 1.0)
    return np.tile(weight, 2)[:, None] * waves, waves.T / points


def _conjugate_weight(grid: Grid) -> np.ndarray:
    """Return 2 where a kept coefficient stands for itself and its conjugate too, else 1."""
    weight = np.where(grid.mode_numbers()[-1] > 0, 2.0, 1.0)
    return np.broadcast_to(weight, grid.modes)


def _summits(values: Float[Array, "*x"]) -> Int[Array, "n d"]:
    """Return the indices of the highest points that no neighbour along an axis exceeds."""
    axes = range(values.ndim)
    neighbours = [jnp.roll(values, step, axis) for axis in axes for step in (1, -1)]
    exceeded = jnp.any(jnp.stack(neighbours) > values[None], axis=0)
    heights = jnp.where(exceeded, -1.0, values).ravel()
    _, chosen = lax.top_k(heights, min(SUMMITS, values.size))
    return jnp.stack(jnp.unravel_index(chosen, values.shape), axis=-1)


def _derivatives(
    grid: Grid, weighted: Array, position: Float[Array, " d"], highest: int = 2
) -> Float[Array, "..."]:
    """Return all mixed derivatives of order 0..highest per axis of a Fourier series at a point."""
    result = weighted
    for axis, k in enumerate(grid.wave_vector()):
        wave = jnp.asarray(k.ravel())
        phase = jnp.exp(1j * wave * position[axis])
        powers = jnp.stack([(1j * wave) ** order * phase for order in range(highest + 1)])
        result = jnp.tensordot(result, powers, axes=([0], [1]))
    return result.real


def _gradient_and_hessian(derivatives: Array, d: int) -> tuple[Array, Array]:
    unit = np.eye(d, dtype=int)
    gradient = jnp.stack([derivatives[tuple(unit[i])] for i in range(d)])
    rows = [[derivatives[tuple(unit[i] + unit[j])] for j in range(d)] for i in range(d)]
    return gradient, jnp.stack([jnp.stack(row) for row in rows])


def _solve(matrix: Float[Array, "d d"], vector: Float[Array, " d"]) -> Float[Array, " d"]:
    return vector / matrix[0] if len(vector) == 1 else jnp.linalg.solve(matrix, vector)


def _slice(array: Array, axis: int, start: int, stop: int | None) -> Array:
    index = [slice(None)] * array.ndim
    index[axis] = slice(start, stop)
    return array[tuple(index)]


def _joined(array: Array, axis: int, k: int, zeros: int) -> Array:
    """Return the modes 0 to k along an axis, zeros, and the modes -k to -1."""
    shape = list(array.shape)
    shape[axis] = zeros
    parts = [_slice(array, axis, 0, k + 1), jnp.zeros(shape, array.dtype)]
    parts += [_slice(array, axis, -k, None)] if k else []
    return jnp.concatenate(parts, axis=axis)
