"""Two Fourier forms of the full model for SciPy's integrators, as fast as NumPy makes them.

Both follow `examples/full_model_by_hand.py`. The right-hand side is one or two products of a small
dense matrix with the state, which beats transforms up to about a hundred points; symmetries of the
initial data are not used.

collocation
    The fields on the points, products taken point by point.
modal
    Real Fourier coefficients below two thirds of the shortest wave, products exact. The linear
    part is tridiagonal in the order chosen here, which LSODA and VODE exploit.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import pi

import numpy as np

from examples.full_model_by_hand import derivatives, electric_field


class FourierSystem:
    """A semi-discrete form of the model, as an integrator wants it.

    Attributes
    ----------
    start : ndarray, shape (size,)
        The initial state Q = -sin(2 pi x), C = V = 0.
    evaluations : int
        Number of calls of `rates` so far.
    """

    start: np.ndarray
    evaluations = 0

    def rates(self, t: float, y: np.ndarray) -> np.ndarray:
        """Return the time derivatives of the state, a new array of shape (size,)."""
        raise NotImplementedError

    def jacobian(self, t: float, y: np.ndarray) -> np.ndarray:
        """Return the exact Jacobian, shape (size, size)."""
        raise NotImplementedError

    def charge(self, y: np.ndarray) -> np.ndarray:
        """Return the mean charge on the grid points, shape (points,), scaled by Q0."""
        raise NotImplementedError


def _linear_blocks(
    c: Mapping[str, float],
    slope: np.ndarray,
    curvature: np.ndarray,
    field: np.ndarray,
    mean_free: np.ndarray,
) -> tuple[np.ndarray, ...]:
    """Return the blocks QQ, QC, CQ, CC, VV of the linear part, each of the operators' shape."""
    if c["field_variance"] != 0.0:
        raise ValueError("tau_sigma must be infinite: the peers leave out the production by E^2.")
    identity = np.eye(len(slope))
    return (
        -c["conduction"] * mean_free + c["diffusion"] * curvature,
        -c["flux"] * slope,
        -c["gradient_production"] * slope + c["field_production"] * field,
        -c["covariance_destruction"] * identity + c["covariance_dispersion"] * curvature,
        -c["variance_destruction"] * identity + c["variance_dispersion"] * curvature,
    )


def _tridiagonal(matrix: np.ndarray) -> np.ndarray:
    """Return the upper, main and lower diagonal in LAPACK's band storage, shape (3, size)."""
    band = np.zeros((3, len(matrix)))
    for row, offset in enumerate((1, 0, -1)):
        diagonal = np.diag(matrix, offset)
        band[row, max(offset, 0) : max(offset, 0) + diagonal.size] = diagonal
    return band


class Collocation(FourierSystem):
    """Fields on the points: the state is Q, C, V one after the other.

    Parameters
    ----------
    c : mapping of str to float
        Coefficients of the model.
    points : int
        Number of grid points.
    """

    def __init__(self, c: Mapping[str, float], points: int) -> None:
        n, identity = points, np.eye(points)
        slope, curvature = (matrix.T for matrix in derivatives(identity))
        field, zero = np.stack([electric_field(row) for row in identity]).T, np.zeros((n, n))
        blocks = _linear_blocks(c, slope, curvature, field, identity - 1.0 / n)
        self.linear = np.block(
            [[blocks[0], blocks[1], zero], [blocks[2], blocks[3], zero], [zero, zero, blocks[4]]]
        )
        force, steepness = c["force"] * field, -2.0 * slope
        self.products = np.vstack([force, steepness])
        self.points, self.diagonal = n, np.arange(n)
        # One product with everything is quickest while it stays in the inner cache.
        self.together = np.vstack(
            [self.linear, np.block([[force, zero, zero], [steepness, zero, zero]])]
        )
        self.of_charge = np.vstack([blocks[0], blocks[2], self.products])
        self.of_covariance = np.vstack([blocks[1], blocks[3]])
        self.of_variance = blocks[4]
        self.start = np.zeros(3 * n)
        self.start[:n] = -np.sin(2.0 * pi * np.arange(n) / n)

    def rates(self, t: float, y: np.ndarray) -> np.ndarray:
        """Return the time derivatives of the state, a new array of shape (3 * points,)."""
        self.evaluations += 1
        n = self.points
        if n <= 64:
            work = self.together.dot(y)
            rates = work[: 3 * n]
            rates[n : 2 * n] += y[2 * n :] * work[3 * n : 4 * n]
            rates[2 * n :] += y[n : 2 * n] * work[4 * n :]
            return rates
        work = self.of_charge.dot(y[:n])
        rates = np.empty(3 * n)
        np.add(work[: 2 * n], self.of_covariance.dot(y[n : 2 * n]), out=rates[: 2 * n])
        rates[n : 2 * n] += y[2 * n :] * work[2 * n : 3 * n]
        np.add(self.of_variance.dot(y[2 * n :]), y[n : 2 * n] * work[3 * n :], out=rates[2 * n :])
        return rates

    def jacobian(self, t: float, y: np.ndarray) -> np.ndarray:
        """Return the exact Jacobian, shape (3 * points, 3 * points), by its nonzero blocks."""
        n, row, out = self.points, self.diagonal, self.linear.copy()
        products = self.products.dot(y[:n])
        out[n : 2 * n, :n] += y[2 * n :, None] * self.products[:n]
        out[2 * n :, :n] += y[n : 2 * n, None] * self.products[n:]
        out[n + row, 2 * n + row] += products[:n]
        out[2 * n + row, n + row] += products[n:]
        return out

    def charge(self, y: np.ndarray) -> np.ndarray:
        """Return the mean charge on the grid points, shape (points,), scaled by Q0."""
        return y[: self.points]


class Modal(FourierSystem):
    """Real Fourier coefficients of the waves shorter than a third of the points.

    The state is (Q, C, V) of the mean, then for each wave number the cosine of Q and the sine of
    C, the sine of Q and the cosine of C, the cosine and the sine of V. In this order the linear
    part, and the force of the mean variance, are tridiagonal.

    Parameters
    ----------
    c : mapping of str to float
        Coefficients of the model.
    points : int
        Number of points on which products are taken.
    """

    def __init__(self, c: Mapping[str, float], points: int) -> None:
        modes = (points - 1) // 3
        wave, count = 2.0 * pi * np.arange(1, modes + 1), 2 * modes + 1
        size, sines, cosines = 3 * count, np.arange(2, count, 2), np.arange(1, count, 2)
        slope, field, mean_free = np.zeros((count, count)), np.zeros((count, count)), np.eye(count)
        slope[cosines, sines], slope[sines, cosines] = wave, -wave
        field[sines, cosines], field[cosines, sines] = 1.0 / wave, -1.0 / wave
        mean_free[0, 0] = 0.0
        first = np.arange(3, size, 6)[:, None]
        charge, covariance, variance = (
            np.concatenate([[mean], (first + offsets).ravel()])
            for mean, offsets in ((0, [0, 2]), (1, [3, 1]), (2, [4, 5]))
        )
        qq, qc, cq, cc, vv = _linear_blocks(c, slope, slope @ slope, field, mean_free)
        self.linear = np.zeros((size, size))
        for rows, columns, block in (
            (charge, charge, qq),
            (charge, covariance, qc),
            (covariance, charge, cq),
            (covariance, covariance, cc),
            (variance, variance, vv),
        ):
            self.linear[np.ix_(rows, columns)] = block
        angle = np.outer(np.arange(points) / points, wave)
        values = np.ones((points, count))
        values[:, cosines], values[:, sines] = np.cos(angle), np.sin(angle)
        weights = values.T * 2.0 / points
        weights[0] *= 0.5
        self.left, self.right = np.zeros((2 * points, size)), np.zeros((2 * points, size))
        self.mixing = np.zeros((size, 2 * points))
        self.left[:points, variance], self.left[points:, covariance] = values, values
        self.right[:points, charge] = c["force"] * values @ field
        self.right[points:, charge] = -2.0 * values @ slope
        self.mixing[covariance, :points], self.mixing[variance, points:] = weights, weights
        self.size, self.points = size, points
        self.together = np.vstack([self.linear, self.left, self.right])
        self.of_charge, self.values = charge, values
        force = np.zeros((size, size))
        force[np.ix_(covariance, charge)] = c["force"] * field
        self.band, self.force_band = _tridiagonal(self.linear), _tridiagonal(force)
        self.start = np.zeros(size)
        self.start[charge[2]] = -1.0

    def rates(self, t: float, y: np.ndarray) -> np.ndarray:
        """Return the time derivatives of the state, a new array of shape (size,)."""
        self.evaluations += 1
        n, size = 2 * self.points, self.size
        work = self.together.dot(y)
        rates = work[:size]
        rates += self.mixing.dot(work[size : size + n] * work[size + n :])
        return rates

    def jacobian(self, t: float, y: np.ndarray) -> np.ndarray:
        """Return the exact Jacobian, shape (size, size)."""
        return self.linear + self.mixing @ (
            (self.left @ y)[:, None] * self.right + (self.right @ y)[:, None] * self.left
        )

    def banded_jacobian(self, t: float, y: np.ndarray) -> np.ndarray:
        """Return the three diagonals of a Jacobian that sees the mean variance only."""
        return self.band + y[2] * self.force_band

    def charge(self, y: np.ndarray) -> np.ndarray:
        """Return the mean charge on the grid points, shape (points,), scaled by Q0."""
        return self.values.dot(y[self.of_charge])
