"""The full model in one to three dimensions on Fourier coefficients, for NumPy and for JAX alike.

The state is an array of complex coefficients ``[Q, C_1..C_d, V]`` of a real transform, cut on the
last axis to the waves that are kept and masked on the others (two thirds of the shortest wave).
Products are taken on the points.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import prod
from typing import Any

import numpy as np
import scipy.fft

TWO_PI = 2.0 * np.pi


def _numpy_transforms(points: tuple[int, ...]) -> tuple[Any, Any]:
    axes = tuple(range(-len(points), 0))
    kept = (points[-1] - 1) // 3 + 1

    def to_points(waves: Any) -> Any:
        return scipy.fft.irfftn(waves, s=points, axes=axes, norm="forward")

    def to_waves(values: Any) -> Any:
        return scipy.fft.rfftn(values, axes=axes, norm="forward")[..., :kept]

    return to_points, to_waves


def _jax_transforms(points: tuple[int, ...]) -> tuple[Any, Any]:
    import jax.numpy as jnp

    axes = tuple(range(-len(points), 0))
    kept = (points[-1] - 1) // 3 + 1
    if len(points) == 1 and points[0] <= 96:
        # At this size a product with a matrix beats the transform.
        phase = TWO_PI * np.outer(np.arange(kept), np.arange(points[0])) / points[0]
        twice = np.where(np.arange(kept) > 0, 2.0, 1.0)[:, None]
        cosine, sine = jnp.asarray(twice * np.cos(phase)), jnp.asarray(twice * np.sin(phase))
        back = jnp.asarray(np.exp(-1j * phase.T) / points[0])
        return (
            lambda waves: waves.real @ cosine - waves.imag @ sine,
            lambda values: values @ back.real + 1j * (values @ back.imag),
        )

    def to_points(waves: Any) -> Any:
        return jnp.fft.irfftn(waves, s=points, axes=axes, norm="forward")

    def to_waves(values: Any) -> Any:
        return jnp.fft.rfftn(values, axes=axes, norm="forward")[..., :kept]

    return to_points, to_waves


class Spectral:
    """The equations in a unit box.

    Parameters
    ----------
    coefficients : mapping of str to float
        Those of `benchmarks.peers.modal.NAMES` and, beyond one dimension, the
        ``transverse_dispersion`` of the covariance.
    points : tuple of int
        Points per dimension.
    modes : sequence of (wave numbers, float, float)
        Waves per dimension, sine and cosine amplitude of the parts of the initial charge.
    jax : bool
        Whether arrays are JAX's.
    """

    def __init__(
        self,
        coefficients: Mapping[str, float],
        points: tuple[int, ...],
        modes: Sequence[Any],
        jax: bool,
    ) -> None:
        self.c, self.points, self.dimensions = coefficients, tuple(points), len(points)
        if jax:
            import jax.numpy as jnp

            self.xp: Any = jnp
        else:
            self.xp = np
        make = _jax_transforms if jax else _numpy_transforms
        self.to_points, self.to_waves = make(self.points)
        d, axes = self.dimensions, []
        self.kept = tuple((n - 1) // 3 for n in self.points)
        for i, n in enumerate(self.points):
            numbers = np.fft.fftfreq(n, 1.0 / n) if i < d - 1 else np.arange(self.kept[-1] + 1)
            axes.append(numbers.reshape([-1 if i == j else 1 for j in range(d)]))
        self.shape = tuple(axis.size for axis in axes)
        self.mask = np.ones(self.shape, bool)
        for axis, kept in zip(axes, self.kept, strict=True):
            self.mask &= np.abs(axis) <= kept
        self.waves = [TWO_PI * axis for axis in axes]
        self.square = sum((k**2 for k in self.waves), start=np.zeros(self.shape))
        with np.errstate(divide="ignore"):
            self.inverse = np.where(self.square > 0.0, 1.0 / self.square, 0.0)
        self.start = np.zeros((2 + d, *self.shape), complex)
        grid = np.meshgrid(*(np.arange(n) / n for n in self.points), indexing="ij")
        charge = np.zeros(self.points)
        for numbers, sine, cosine in modes:
            phase = TWO_PI * sum(m * x for m, x in zip(np.atleast_1d(numbers), grid, strict=True))
            charge += sine * np.sin(phase) + cosine * np.cos(phase)
        self.start[0] = _numpy_transforms(self.points)[1](charge) * self.mask
        # As arrays of the right kind, so that nothing is converted again at every call.
        self._waves = [self.xp.asarray(k) for k in self.waves]
        self._mask = self.xp.asarray(self.mask.astype(float))
        self._fields = [self.xp.asarray(-1j * k * self.inverse) for k in self.waves]
        self._slopes = [self.xp.asarray(1j * k + np.zeros(self.shape)) for k in self.waves]

    def products(self, state: Any) -> Any:
        """Return what the products of fields add to the time derivatives."""
        xp, d, c = self.xp, self.dimensions, self.c
        charge, covariance, variance = state[0], state[1:-1], state[-1]
        waves = [variance, *(f * charge for f in self._fields), *covariance]
        values = self.to_points(xp.stack([*waves, *(s * charge for s in self._slopes)]))
        field, flux, slope = (values[1 + i * d : 1 + (i + 1) * d] for i in range(3))
        source = -2.0 * xp.sum(flux * slope, axis=0)
        if c["field_variance"] != 0.0:
            source = source + c["field_variance"] * xp.sum(field**2, axis=0)
        force = c["force"] * values[:1] * field
        back = self.to_waves(xp.concatenate([force, source[None]])) * self._mask
        return xp.concatenate([xp.zeros_like(back[:1]), back])

    def linear(self, state: Any) -> Any:
        """Return the linear part of the time derivatives."""
        xp, c = self.xp, self.c
        charge, covariance, variance = state[0], state[1:-1], state[-1]
        square = xp.asarray(self.square)
        divergence = sum(s * f for s, f in zip(self._slopes, covariance, strict=True))
        lost = c["conduction"] * (square > 0.0) + c["diffusion"] * square
        transverse = c.get("transverse_dispersion", 0.0)
        rest = c["covariance_dispersion"] - transverse
        rates = [-c["flux"] * divergence - lost * charge]
        for i in range(self.dimensions):
            rates.append(
                -c["gradient_production"] * self._slopes[i] * charge
                + c["field_production"] * self._fields[i] * charge
                - (c["covariance_destruction"] + transverse * square) * covariance[i]
                + rest * self._slopes[i] * divergence
            )
        decay = c["variance_destruction"] + c["variance_dispersion"] * square
        return xp.stack([*rates, -decay * variance])

    def blocks(self) -> tuple[np.ndarray, ...]:
        """Return the 2 x 2 block of Q and c = i k.C/|k|, and the rates of transverse C and V."""
        c, k = self.c, np.sqrt(self.square)
        block = np.zeros((*self.shape, 2, 2))
        block[..., 0, 0] = -c["conduction"] * (k > 0.0) - c["diffusion"] * self.square
        block[..., 0, 1] = -c["flux"] * k
        block[..., 1, 0] = c["gradient_production"] * k + c["field_production"] * k * self.inverse
        block[..., 1, 1] = -c["covariance_destruction"] - c["covariance_dispersion"] * self.square
        transverse = c.get("transverse_dispersion", 0.0)
        across = -c["covariance_destruction"] - transverse * self.square
        decay = -c["variance_destruction"] - c["variance_dispersion"] * self.square
        return block, across, decay

    def diagonal(self) -> tuple[np.ndarray, Any, Any]:
        """Return rates of independent variables, and the maps of a state to them and back.

        The variables are the two eigenvectors of the block of Q and c, the transverse covariance
        (beyond one dimension) and the variance. Where |k| = 0 all of C counts as transverse, in one
        dimension as longitudinal.
        """
        xp, d = self.xp, self.dimensions
        block, across, decay = self.blocks()
        rates, vectors = np.linalg.eig(block)
        inverse = np.linalg.inv(vectors)
        if np.linalg.cond(vectors).max() > 1e6:
            raise ValueError("the linear part is too close to one without two eigenvectors.")
        length = np.sqrt(self.square)
        with np.errstate(invalid="ignore", divide="ignore"):
            unit = [np.where(length > 0.0, k / length, float(d == 1)) for k in self.waves]
        into = [[xp.asarray(inverse[..., i, j]) for j in range(2)] for i in range(2)]
        out = [[xp.asarray(vectors[..., i, j]) for j in range(2)] for i in range(2)]
        unit = [xp.asarray(u) for u in unit]
        diagonal = np.concatenate(
            [np.moveaxis(rates, -1, 0), np.stack([across] * (d if d > 1 else 0) + [decay])]
        )

        def forth(state: Any) -> Any:
            along = sum(u * f for u, f in zip(unit, state[1:-1], strict=True))
            pair = [row[0] * state[0] + row[1] * 1j * along for row in into]
            rest = [f - u * along for u, f in zip(unit, state[1:-1], strict=True)] if d > 1 else []
            return xp.stack([*pair, *rest, state[-1]])

        def back(variables: Any) -> Any:
            charge, turned = (row[0] * variables[0] + row[1] * variables[1] for row in out)
            along = -1j * turned
            rest = variables[2:-1] if d > 1 else [0.0]
            vector = [u * along + f for u, f in zip(unit, rest, strict=True)]
            return xp.stack([charge, *vector, variables[-1]])

        return diagonal, forth, back

    def charge(self, state: Any) -> np.ndarray:
        """Return the mean charge on the points."""
        return _numpy_transforms(self.points)[0](np.asarray(state[0]))


class Packed:
    """The same for an integrator of real vectors: only kept coefficients, real parts first.

    Parameters
    ----------
    spectral : Spectral
        With NumPy's arrays.
    """

    def __init__(self, spectral: Spectral) -> None:
        self.spectral = spectral
        self.places = np.flatnonzero(spectral.mask)
        self.rows = 2 + spectral.dimensions
        self.size = 2 * self.rows * self.places.size
        self.start = self.pack(spectral.start)

    def pack(self, state: np.ndarray) -> np.ndarray:
        """Return a state as a real vector, shape (size,)."""
        kept = state.reshape(self.rows, -1)[:, self.places]
        return np.ascontiguousarray(kept).view(float).ravel()

    def unpack(self, y: np.ndarray) -> np.ndarray:
        """Return the state of a real vector."""
        state = np.zeros((self.rows, self.spectral.mask.size), complex)
        state[:, self.places] = np.ascontiguousarray(y).view(complex).reshape(self.rows, -1)
        return state.reshape(self.rows, *self.spectral.shape)

    def rates(self, t: float, y: np.ndarray) -> np.ndarray:
        """Return the time derivatives, a new array of shape (size,)."""
        state = self.unpack(y)
        return self.pack(self.spectral.linear(state) + self.spectral.products(state))

    def charge(self, y: np.ndarray) -> np.ndarray:
        """Return the mean charge on the points."""
        return self.spectral.charge(self.unpack(y))


def size_of(points: Sequence[int]) -> int:
    """Return the number of points."""
    return prod(points)
