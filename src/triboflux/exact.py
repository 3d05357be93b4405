r"""Exact solutions of the equations in special cases, to test against and to show.

Without an electric force (u = 0) the charge and the covariance obey linear equations. Isotropy
makes them fall apart, for every wave vector k, into a transverse covariance that only decays and

.. math::

    \frac{d}{dt} \begin{pmatrix} q \\ c \end{pmatrix} =
    \begin{pmatrix} -1/\tau_\sigma - k^2/Pe & -(1+\eta) k \\ P k + S/k & -R - D k^2 \end{pmatrix}
    \begin{pmatrix} q \\ c \end{pmatrix}, \qquad c = i \hat k \cdot C,

with D the longitudinal dispersion of the covariance. What the closure set ``complete`` adds to the
matrix is in `linear_matrix`. Everything is dimensionless: lengths are
scaled by L, velocities by √Θ, charges by Q0, times by L/√Θ. Only NumPy is used, and nothing of the
solvers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from triboflux.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from triboflux.case import ComponentMode, Mode
    from triboflux.models.coefficients import TransportCoefficients


@dataclass(frozen=True)
class LinearSolution:
    """Charge and covariance of the full model without electric force (u = 0), in closed form.

    The variance, which the charge and the covariance then do not depend on, is left out.

    Attributes
    ----------
    coefficients : TransportCoefficients
        Of the equations, with concrete values; its electric force is ignored.
    lengths : tuple of float
        Of the periodic box, scaled by L; one to three.
    charge : sequence of Mode
        The charge at time 0, scaled by Q0; a mean is kept, as a uniform background neutralises it.
    covariance : sequence of ComponentMode
        The covariance at time 0, scaled by Q0 √Θ; zero by default.

    Raises
    ------
    InputError
        If a mode does not have a number per dimension, or its component does not exist.
    """

    coefficients: TransportCoefficients
    lengths: tuple[float, ...]
    charge: Sequence[Mode]
    covariance: Sequence[ComponentMode] = ()

    def __post_init__(self) -> None:
        """Check that the modes fit the box."""
        _check_modes("charge", self.charge, self.lengths)
        _check_modes("covariance", self.covariance, self.lengths)
        for mode in self.covariance:
            if not mode.component < len(self.lengths):
                raise InputError(
                    f"covariance: the component {mode.component} is not allowed; "
                    f"it must be below the number of dimensions, {len(self.lengths)}."
                )

    def fields(
        self, time: float, coordinates: Sequence[NDArray[np.float64]]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return charge and covariance on the points of a box.

        Parameters
        ----------
        time : float
            Not negative, scaled by L/√Θ.
        coordinates : sequence of numpy.ndarray
            Positions along each axis, as of `Grid.coordinates`, scaled by L.

        Returns
        -------
        charge : numpy.ndarray
            Shape ``[*x]``, scaled by Q0.
        covariance : numpy.ndarray
            Shape ``[component, *x]``, scaled by Q0 √Θ.
        """
        shape = tuple(len(x) for x in coordinates)
        dimensions = len(self.lengths)
        charge, covariance = np.zeros(shape), np.zeros((dimensions, *shape))
        for mode in (*self.charge, *self.covariance):
            k = wave_vector(mode, self.lengths)
            amplitude = complex(mode.cosine, -mode.sine)
            vector = np.zeros(dimensions, dtype=complex)
            component: int | None = getattr(mode, "component", None)
            if component is not None:
                vector[component], amplitude = amplitude, 0j
            amplitude, vector = self._amplitudes(time, k, amplitude, vector)
            wave = _wave(k, coordinates)
            charge += (amplitude * wave).real
            covariance += np.stack([(v * wave).real for v in vector])
        return charge, covariance

    def _amplitudes(
        self,
        time: float,
        k: NDArray[np.float64],
        charge: complex,
        covariance: NDArray[np.complex128],
    ) -> tuple[complex, NDArray[np.complex128]]:
        """Return the complex amplitudes of one wave vector at a later time."""
        norm = math.hypot(*k)
        decay = math.exp(-transverse_decay_rate(self.coefficients, norm) * time)
        if norm == 0.0:
            return charge, decay * covariance
        direction = k / norm
        along = complex(direction @ covariance)
        transverse = covariance - along * direction
        propagator = exponential(linear_matrix(self.coefficients, norm), time)
        charge, turned = propagator @ np.array([charge, 1j * along])
        return complex(charge), decay * transverse - 1j * turned * direction


def linear_matrix(coefficients: TransportCoefficients, wave_number: float) -> NDArray[np.float64]:
    """Return the matrix that drives (q, c) of one wave number; see the top of this module.

    Parameters
    ----------
    coefficients : TransportCoefficients
        Of (5.2) and (5.3), with concrete values.
    wave_number : float
        |k| > 0, scaled by 1/L.

    Returns
    -------
    numpy.ndarray
        Shape ``[2, 2]``, scaled by √Θ/L.
    """
    c, k = coefficients, wave_number
    dispersion = float(c.longitudinal_dispersion)
    matrix = np.array(
        [
            [-float(c.triboconductivity) - k**2 * float(c.dispersion), -float(c.flux) * k],
            [
                float(c.gradient_production) * k + float(c.field_production) / k,
                -float(c.covariance_destruction) - dispersion * k**2,
            ],
        ]
    )
    return matrix + _by_third_moment(c, k)


def _by_third_moment(c: TransportCoefficients, k: float) -> NDArray[np.float64]:
    """Return what the third-order moment adds to the matrix if the dropped terms are there.

    With X_i = 2 ∂_j T_ij + ∂_i T_mm = x J'_i - y ∂_i ∇·C, where T_ij is closed and J' is the
    gradient of the divergence of J = E/τ_σ - ∇Q/Pe times minus the coefficient of T_ij by J.
    """
    d = c.dropped
    if d is None:
        return np.zeros((2, 2))
    k_1, k_t = float(c.third_moment), float(c.third_moment_trace)
    single = (3.0 - 5.0 * float(c.third_moment_coupling) / k_t) / k_1
    x = 2.0 * single + 5.0 / k_t
    y = 2.0 * (float(c.covariance_dispersion) + float(c.divergence_dispersion))
    y += (2.0 * float(c.shear) + 3.0 * float(c.divergence)) / k_t
    flux = float(d.third_moment_field) + float(d.third_moment_gradient) * k**2
    into_charge, into_covariance = float(d.charge_third_moment), float(d.covariance_third_moment)
    return np.array(
        [
            [into_charge * x * flux * k**2, into_charge * y * k**3],
            [-(single + into_covariance * x) * flux * k, 0.0],
        ]
    )


def transverse_decay_rate(coefficients: TransportCoefficients, wave_number: float) -> float:
    """Return R + |k|² G1/K1, at which a covariance normal to its wave vector decays, by (5.3).

    With the terms that the paper drops collisions disperse it, too.

    Parameters
    ----------
    coefficients : TransportCoefficients
        With concrete values.
    wave_number : float
        |k| >= 0, scaled by 1/L; at 0 every direction decays at R.
    """
    dispersion = float(coefficients.covariance_dispersion)
    if coefficients.dropped is not None:
        dispersion *= 1.0 + 2.0 * float(coefficients.dropped.covariance_third_moment)
        dispersion += float(coefficients.dropped.covariance_dispersion)
    return float(coefficients.covariance_destruction) + dispersion * wave_number**2


def gradient_decay_rate(coefficients: TransportCoefficients, wave_number: float) -> float:
    """Return the rate at which one mode of the charge decays in the gradient model.

    There the covariance is C = (-P ∇Q + S E)/R, (7.8) at u = 0, which makes the rate in (5.2)
    k² ((1+η) P/R + 1/Pe) + (1+η) S/R + 1/τ_σ.

    Parameters
    ----------
    coefficients : TransportCoefficients
        With concrete values.
    wave_number : float
        |k| > 0, scaled by 1/L.

    Returns
    -------
    float
        Scaled by √Θ/L.
    """
    c = coefficients
    mobility = float(c.flux) / float(c.covariance_destruction)
    diffusivity = mobility * float(c.gradient_production) + float(c.dispersion)
    conduction = mobility * float(c.field_production) + float(c.triboconductivity)
    return wave_number**2 * diffusivity + conduction


def homogeneous_decay(
    coefficients: TransportCoefficients, covariance: Sequence[float], variance: float, time: float
) -> tuple[NDArray[np.float64], float]:
    """Return a uniform covariance and variance after some time: they decay at R and at F.

    With the terms that the paper drops the squared covariance destroys variance, too.

    Parameters
    ----------
    coefficients : TransportCoefficients
        With concrete values.
    covariance : sequence of float
        Components at time 0, scaled by Q0 √Θ.
    variance : float
        At time 0, scaled by Q0².
    time : float
        Scaled by L/√Θ.

    Returns
    -------
    covariance : numpy.ndarray
        Shape ``[component]``.
    variance : float
        It grows where F is negative.
    """
    decayed = math.exp(-float(coefficients.covariance_destruction) * time)
    remaining = math.exp(-float(coefficients.variance_destruction) * time)
    start = np.asarray(covariance, dtype=np.float64)
    left = remaining * variance
    if coefficients.dropped is not None:
        # |C|² decays at 2 R while V does at F
        slower = float(coefficients.variance_destruction)
        rate = 2.0 * float(coefficients.covariance_destruction) - slower
        spent = time if rate == 0.0 else -math.expm1(-rate * time) / rate
        lost = float(coefficients.dropped.variance_covariance_destruction) * remaining * spent
        left -= lost * float(start @ start)
    return decayed * start, left


def free_streaming(
    charge: Sequence[Mode],
    lengths: tuple[float, ...],
    time: float,
    coordinates: Sequence[NDArray[np.float64]],
) -> NDArray[np.float64]:
    """Return the mean charge of particles that keep charge and velocity, the limit τ_c → ∞.

    A Maxwellian of velocities smears every mode by exp(-|k|² t²/2), Landau's phase mixing; from
    Q = -sin 2πx it makes -sin(2πx) exp(-2π² t²). No finite number of moments gives this.

    Parameters
    ----------
    charge : sequence of Mode
        The charge at time 0, uncorrelated with velocity, scaled by Q0.
    lengths : tuple of float
        Of the periodic box, scaled by L.
    time : float
        Scaled by L/√Θ.
    coordinates : sequence of numpy.ndarray
        Positions along each axis, scaled by L.

    Returns
    -------
    numpy.ndarray
        Shape ``[*x]``, scaled by Q0.

    Raises
    ------
    InputError
        If a mode does not have a number per dimension.
    """
    _check_modes("charge", charge, lengths)
    total = np.zeros(tuple(len(x) for x in coordinates))
    for mode in charge:
        k = wave_vector(mode, lengths)
        smeared = math.exp(-0.5 * float(k @ k) * time**2)
        total += smeared * (complex(mode.cosine, -mode.sine) * _wave(k, coordinates)).real
    return total


def exponential(matrix: NDArray[np.float64], time: float) -> NDArray[np.float64]:
    """Return exp(t M) of a real 2×2 matrix in closed form.

    With s half the trace and δ² = s² - det M, the eigenvalues are s ± δ. For real ones

        exp(t M) = exp(λ t) [1 + (M - λ) (1 - exp(-2δt))/(2δ)],   λ = s + δ,

    and for complex ones exp(st) [cos ωt + (M - s) sin(ωt)/ω] with ω² = -δ². Both are smooth where
    the eigenvalues coincide. In a stiff, decaying system λ is a small difference of large numbers;
    where the signs are those of `linear_matrix`, det M/(s - δ) gives it without cancellation. The
    error, relative to the largest entry of the result, is then a few units of round-off times
    1 + |λ| t, and otherwise times 1 + ‖M‖ t.

    Parameters
    ----------
    matrix : numpy.ndarray
        Shape ``[2, 2]``.
    time : float
        Not negative.

    Returns
    -------
    numpy.ndarray
        Shape ``[2, 2]``.
    """
    (a, b), (c, d) = ((float(value) for value in row) for row in matrix)
    half_trace, identity = 0.5 * (a + d), np.eye(2)
    squared = (0.5 * (a - d)) ** 2 + b * c
    root = math.sqrt(abs(squared))
    if squared < 0.0:
        sine = time * float(np.sinc(root * time / math.pi))
        rest = matrix - half_trace * identity
        return math.exp(half_trace * time) * (math.cos(root * time) * identity + sine * rest)
    slowest = half_trace + root
    if half_trace < 0.0 and a * d >= 0.0 >= b * c:
        slowest = (a * d - b * c) / (half_trace - root)
    span = 2.0 * root * time
    weight = time if span == 0.0 else -math.expm1(-span) / span * time
    return math.exp(slowest * time) * (identity + weight * (matrix - slowest * identity))


def wave_vector(mode: Mode, lengths: Sequence[float]) -> NDArray[np.float64]:
    """Return 2π m/length per axis, scaled by 1/L, shape ``[dimensions]``."""
    return 2.0 * np.pi * np.array(mode.mode) / np.array(lengths)


def _wave(
    k: NDArray[np.float64], coordinates: Sequence[NDArray[np.float64]]
) -> NDArray[np.complex128]:
    """Return exp(i k·x) on the points."""
    result = np.ones((), dtype=complex)
    for component, x in zip(k, coordinates, strict=True):
        result = result[..., None] * np.exp(1j * component * x)
    return result


def _check_modes(name: str, modes: Sequence[Mode], lengths: tuple[float, ...]) -> None:
    for mode in modes:
        if len(mode.mode) != len(lengths):
            raise InputError(
                f"{name}: the mode {list(mode.mode)} is not allowed; "
                f"it must have one whole number per dimension, {len(lengths)}."
            )
