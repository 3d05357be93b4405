"""The full model in one dimension as ordinary differential equations, compiled with Numba.

The unknowns are the complex Fourier coefficients of Q, C and V below two thirds of the shortest
wave on N points, as the package keeps them; products are exact convolutions, which at these sizes
cost less than transforms. The order of the unknowns makes the linear part tridiagonal::

    Q_0 C_0 V_0, then for each wave  Re Q, Im C, Im Q, Re C, Re V, Im V

Only the coefficients of the equations come from outside, so nothing here depends on the package.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numba
import numpy as np

NAMES = (
    "flux",
    "conduction",
    "diffusion",
    "gradient_production",
    "field_production",
    "force",
    "covariance_destruction",
    "covariance_dispersion",
    "variance_destruction",
    "field_variance",
    "variance_dispersion",
)
"""Coefficients of the equations, in the order in which the compiled functions take them."""
TWO_PI = 2.0 * np.pi


@numba.njit(cache=True, fastmath=True)
def _spread(y, first, second, modes, real, imaginary):
    """Fill the two-sided coefficients of a moment, found at two places of every wave."""
    for k in range(1, modes + 1):
        a, b = y[6 * k - 3 + first], y[6 * k - 3 + second]
        real[modes + k], imaginary[modes + k] = a, b
        real[modes - k], imaginary[modes - k] = a, -b


@numba.njit(cache=True, fastmath=True)
def _convolve(fr, fi, gr, gi, m):
    """Return coefficient m of a product; the second factor is given backwards."""
    real, imaginary = 0.0, 0.0
    for i in range(m, fr.size):
        real += fr[i] * gr[i - m] - fi[i] * gi[i - m]
        imaginary += fr[i] * gi[i - m] + fi[i] * gr[i - m]
    return real, imaginary


@numba.njit(cache=True, fastmath=True)
def fill_rates(y, out, c):
    """Write the time derivatives of the unknowns."""
    modes = (y.size // 3 - 1) // 2
    work = np.zeros((8, 2 * modes + 1))
    vr, vi, cr, ci, er, ei, gr, gi = work
    vr[modes], cr[modes] = y[2], y[1]
    _spread(y, 4, 5, modes, vr, vi)
    _spread(y, 3, 1, modes, cr, ci)
    for k in range(1, modes + 1):
        q, p, wave = y[6 * k - 3], y[6 * k - 1], TWO_PI * k
        # Backwards, for the convolution: E = Q/(ik) and dQ/dx = ik Q.
        er[modes - k], ei[modes - k] = p / wave, -q / wave
        er[modes + k], ei[modes + k] = p / wave, q / wave
        gr[modes - k], gi[modes - k] = -wave * p, wave * q
        gr[modes + k], gi[modes + k] = -wave * p, -wave * q
    for m in range(modes + 1):
        fr, fi = _convolve(vr, vi, er, ei, m)
        pr, pi = _convolve(cr, ci, gr, gi, m)
        sr, si = -2.0 * pr, -2.0 * pi
        if c[9] != 0.0:
            # The field forwards is its backwards self with the imaginary part turned round.
            br, bi = _convolve(er, -ei, er, ei, m)
            sr += c[9] * br
            si += c[9] * bi
        if m == 0:
            out[0] = 0.0
            out[1] = -c[6] * y[1] + c[5] * fr
            out[2] = -c[8] * y[2] + sr
            continue
        j, wave = 6 * m - 3, TWO_PI * m
        square = wave * wave
        into = c[3] * wave + c[4] / wave
        lost_q = c[1] + c[2] * square
        lost_c = c[6] + c[7] * square
        lost_v = c[8] + c[10] * square
        out[j] = -lost_q * y[j] + c[0] * wave * y[j + 1]
        out[j + 1] = -lost_c * y[j + 1] - into * y[j] + c[5] * fi
        out[j + 2] = -lost_q * y[j + 2] - c[0] * wave * y[j + 3]
        out[j + 3] = -lost_c * y[j + 3] + into * y[j + 2] + c[5] * fr
        out[j + 4] = -lost_v * y[j + 4] + sr
        out[j + 5] = -lost_v * y[j + 5] + si


@numba.njit(cache=True, fastmath=True)
def _add_product(out, rows, columns, fr, fi, factor, turn):
    """Add the derivative of a product by one factor, when the other has coefficients f.

    `rows` and `columns` are the places of real and imaginary part within a wave. What is
    differentiated by is multiplied by i (2 pi k)^turn first if `turn` is not zero.
    """
    modes = fr.size // 2
    for m in range(modes + 1):
        row, row_i = (6 * m - 3 + rows[0], 6 * m - 3 + rows[1]) if m > 0 else (rows[2], -1)
        if turn == 0:
            out[row, columns[2]] += factor * fr[modes + m]
            if m > 0:
                out[row_i, columns[2]] += factor * fi[modes + m]
        for k in range(1, modes + 1):
            lr, li = fr[modes + m - k] if m - k >= -modes else 0.0, fi[modes + m - k]
            ur, ui = 0.0, 0.0
            if m + k <= modes:
                ur, ui = fr[modes + m + k], fi[modes + m + k]
            rr, ri = factor * (lr + ur), factor * (ui - li)
            ir, ii = factor * (li + ui), factor * (lr - ur)
            if turn != 0:
                # d/d(Q) of a product with i w Q: the parts change places, one changes sign.
                wave = (TWO_PI * k) ** turn * (1.0 if turn > 0 else -1.0)
                rr, ri, ir, ii = wave * ri, -wave * rr, wave * ii, -wave * ir
            a, b = 6 * k - 3 + columns[0], 6 * k - 3 + columns[1]
            out[row, a] += rr
            out[row, b] += ri
            if m > 0:
                out[row_i, a] += ir
                out[row_i, b] += ii


_Q, _C, _V = (0, 2, 0), (3, 1, 1), (4, 5, 2)


@numba.njit(cache=True, fastmath=True)
def fill_jacobian(y, out, c):
    """Write the exact Jacobian."""
    modes = (y.size // 3 - 1) // 2
    work = np.zeros((8, 2 * modes + 1))
    vr, vi, cr, ci, er, ei, gr, gi = work
    vr[modes], cr[modes] = y[2], y[1]
    _spread(y, 4, 5, modes, vr, vi)
    _spread(y, 3, 1, modes, cr, ci)
    out[:] = 0.0
    out[1, 1], out[2, 2] = -c[6], -c[8]
    for k in range(1, modes + 1):
        j, wave = 6 * k - 3, TWO_PI * k
        q, p = y[j], y[j + 2]
        er[modes + k], ei[modes + k] = p / wave, -q / wave
        er[modes - k], ei[modes - k] = p / wave, q / wave
        gr[modes + k], gi[modes + k] = -wave * p, wave * q
        gr[modes - k], gi[modes - k] = -wave * p, -wave * q
        square = wave * wave
        into = c[3] * wave + c[4] / wave
        out[j, j] = out[j + 2, j + 2] = -c[1] - c[2] * square
        out[j + 1, j + 1] = out[j + 3, j + 3] = -c[6] - c[7] * square
        out[j + 4, j + 4] = out[j + 5, j + 5] = -c[8] - c[10] * square
        out[j, j + 1], out[j + 2, j + 3] = c[0] * wave, -c[0] * wave
        out[j + 1, j], out[j + 3, j + 2] = -into, into
    _add_product(out, _C, _V, er, ei, c[5], 0)
    _add_product(out, _C, _Q, vr, vi, c[5], -1)
    _add_product(out, _V, _C, gr, gi, -2.0, 0)
    _add_product(out, _V, _Q, cr, ci, -2.0, 1)
    if c[9] != 0.0:
        _add_product(out, _V, _Q, er, ei, 2.0 * c[9], -1)


@numba.njit(cache=True, fastmath=True)
def fill_band(y, out, c):
    """Write the three diagonals, upper first, of a Jacobian that sees the mean variance only."""
    modes = (y.size // 3 - 1) // 2
    out[:] = 0.0
    out[1, 1], out[1, 2] = -c[6], -c[8]
    for k in range(1, modes + 1):
        j, wave = 6 * k - 3, TWO_PI * k
        square = wave * wave
        into = c[3] * wave + (c[4] + c[5] * y[2]) / wave
        out[1, j] = out[1, j + 2] = -c[1] - c[2] * square
        out[1, j + 1] = out[1, j + 3] = -c[6] - c[7] * square
        out[1, j + 4] = out[1, j + 5] = -c[8] - c[10] * square
        out[0, j + 1], out[0, j + 3] = c[0] * wave, -c[0] * wave
        out[2, j], out[2, j + 2] = -into, into


class Modal:
    """The equations on N points for an integrator.

    Parameters
    ----------
    coefficients : mapping of str to float
        By the names in `NAMES`.
    points : int
        Number of points.
    modes : sequence of (int, float, float)
        Wave number, sine and cosine amplitude of the parts of the initial charge.
    """

    def __init__(
        self,
        coefficients: Mapping[str, float],
        points: int,
        modes: Sequence[tuple[int, float, float]],
    ) -> None:
        self.points, self.kept = points, (points - 1) // 3
        self.size = 3 * (2 * self.kept + 1)
        self.c = np.array([coefficients[name] for name in NAMES])
        self.start = np.zeros(self.size)
        for wave, sine, cosine in modes:
            self.start[6 * wave - 3] = 0.5 * cosine
            self.start[6 * wave - 1] = -0.5 * sine

    def rates(self, t: float, y: np.ndarray) -> np.ndarray:
        """Return the time derivatives, a new array of shape (size,)."""
        out = np.empty(self.size)
        fill_rates(y, out, self.c)
        return out

    def jacobian(self, t: float, y: np.ndarray) -> np.ndarray:
        """Return the exact Jacobian, a new array of shape (size, size)."""
        out = np.empty((self.size, self.size))
        fill_jacobian(y, out, self.c)
        return out

    def band(self, t: float, y: np.ndarray) -> np.ndarray:
        """Return the three diagonals of the approximate Jacobian in LAPACK's storage."""
        out = np.empty((3, self.size))
        fill_band(y, out, self.c)
        return out

    def moments(self, y: np.ndarray) -> np.ndarray:
        """Return the one-sided complex coefficients of Q, C and V, shape (3, kept + 1)."""
        waves = y[3:].reshape(self.kept, 6).T
        rest = np.stack(
            [waves[0] + 1j * waves[2], waves[3] + 1j * waves[1], waves[4] + 1j * waves[5]]
        )
        return np.concatenate([y[:3, None].astype(complex), rest], axis=1)

    def unknowns(self, moments: np.ndarray) -> np.ndarray:
        """Return the unknowns of one-sided coefficients; the inverse of `moments`."""
        q, c, v = moments[:, 1:]
        waves = np.stack([q.real, c.imag, q.imag, c.real, v.real, v.imag], axis=1)
        return np.concatenate([moments[:, 0].real, waves.ravel()])

    def charge(self, y: np.ndarray) -> np.ndarray:
        """Return the one-sided coefficients of the mean charge, shape (kept + 1,)."""
        return self.moments(y)[0]
