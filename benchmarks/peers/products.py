"""The products in one dimension for complex, diagonalised variables, compiled with Numba."""

from __future__ import annotations

from collections.abc import Callable

import numba
import numpy as np

from benchmarks.peers.modal import TWO_PI
from benchmarks.peers.spectral import Spectral


@numba.njit(cache=True, fastmath=True)
def _products(variables, vectors, inverse, force, source, out):
    """Write the products' contributions; state and result are in eigenvectors of the blocks."""
    n = variables.shape[1]
    modes = n - 1
    v, f = np.zeros(2 * n - 1, np.complex128), np.zeros(2 * n - 1, np.complex128)
    e, g = np.zeros(2 * n - 1, np.complex128), np.zeros(2 * n - 1, np.complex128)
    for k in range(n):
        q = vectors[k, 0, 0] * variables[0, k] + vectors[k, 0, 1] * variables[1, k]
        c = -1j * (vectors[k, 1, 0] * variables[0, k] + vectors[k, 1, 1] * variables[1, k])
        wave = TWO_PI * k
        field = -1j * q / wave if k > 0 else 0.0j
        slope = 1j * wave * q
        v[modes + k], f[modes + k] = variables[2, k], c
        v[modes - k], f[modes - k] = np.conj(variables[2, k]), np.conj(c)
        # Backwards, for the convolution.
        e[modes - k], g[modes - k] = field, slope
        e[modes + k], g[modes + k] = np.conj(field), np.conj(slope)
    v[modes], f[modes] = v[modes].real, f[modes].real
    for m in range(n):
        into_c, into_v, squared = 0.0j, 0.0j, 0.0j
        for i in range(m, v.size):
            into_c += v[i] * e[i - m]
            into_v += f[i] * g[i - m]
        if source != 0.0:
            for i in range(m, v.size):
                squared += e[v.size - 1 - i] * e[i - m]
        turned = 1j * force * into_c
        out[0, m] = inverse[m, 0, 1] * turned
        out[1, m] = inverse[m, 1, 1] * turned
        out[2, m] = -2.0 * into_v + source * squared


def products_1d(spectral: Spectral) -> Callable[[np.ndarray], np.ndarray]:
    """Return the products of a problem as a function of the variables of `Spectral.diagonal`.

    Parameters
    ----------
    spectral : Spectral
        In one dimension.
    """
    block, *_ = spectral.blocks()
    _, vectors = np.linalg.eig(block)
    vectors = np.ascontiguousarray(vectors, complex)
    inverse = np.ascontiguousarray(np.linalg.inv(vectors))
    force, source = spectral.c["force"], spectral.c["field_variance"]

    def products(variables: np.ndarray) -> np.ndarray:
        out = np.empty_like(variables)
        _products(variables, vectors, inverse, force, source, out)
        return out

    return products
