"""The full model of charge, covariance and variance in one dimension, written out by hand.

One file, NumPy for the equations and SciPy for the time stepping, nothing of the package: it is
meant to be read beside the paper (Montilla, Ansart & Simonin 2023, J. Fluid Mech.) and serves the
tests as an independent statement of the physics. Everything is dimensionless: lengths are scaled
by L, velocities by the square root of the granular temperature, charge by its initial amplitude
Q0, the electric field by n Q0 L / epsilon0.

With Q the mean charge, C the charge-velocity covariance, V the charge variance, E the field::

    dQ/dt = -(1 + eta) C_x - (1/tau_sigma) E_x + (1/Pe) Q_xx
    dC/dt = -P Q_x + S E + u V E - R C + Dc C_xx
    dV/dt = -2 C Q_x - F V + B E^2 + Dv V_xx
    E_x   = Q - mean(Q),   mean(E) = 0

Run it from the root of the repository (about a second)::

    python examples/full_model_by_hand.py --case B --closures published
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from math import gamma, inf, isinf, pi, sqrt

import numpy as np
from scipy.integrate import solve_ivp

COMMON = {"peclet": 1e6, "tau_p": inf, "tau_sigma": inf, "energy_ratio": 300.0}
COMMON |= {"length_ratio": 192.0, "restitution": 1.0}
PAPER_CASES = {"A": {**COMMON, "tau_c": 1e-4}, "B": {**COMMON, "tau_c": 1e-1}}
"""The seven numbers of the two cases in the paper's section 6."""


def impact_integral(p: float) -> float:
    """Return J_p, the integral of (g.k)^p over all collisions, in units of n^2 Theta^(p/2)."""
    return 2.0 ** (p + 1.0) * sqrt(pi) * gamma((p + 1.0) / 2.0)


def coefficients(
    closures: str, numbers: Mapping[str, float], exponent: float = 0.8
) -> dict[str, float]:
    """Return the coefficients of the equations in the module docstring, (5.2) to (5.4).

    Parameters
    ----------
    closures : {"derived", "published"}
        Exact collision integrals, or the constants as the paper prints them.
    numbers : mapping of str to float
        peclet, tau_c, tau_p, tau_sigma, energy_ratio, length_ratio, restitution; times may be inf.
    exponent : float, default 0.8
        Power of the impact speed in the transferred charge; the published set needs the default.

    Returns
    -------
    dict of str to float
        One dimensionless coefficient for each term; ValueError if the set does not exist.
    """
    e, a, pe, ratio = numbers["restitution"], exponent, numbers["peclet"], numbers["length_ratio"]
    s = 1.0 + e
    if closures == "published" and a == 0.8:
        exchange_time, flux, production, swap = 12.0, 3.256, 0.5422, (3.0 - e) / 5.0
        k_c, k_t = 6.667 * s - 1.387 * s**2, 0.2667 * s - 0.2607 * s**2  # (A13), (A14)
        k_drag, k_exchange, trace = 1.0, 3.201, 1.0
        rho_1, rho_2 = 10.68 * s + 0.2048 * s**2, 208.2 * s + 0.2048 * s**2  # (A15)
        gain, source, spread, n_exchange, n_gain = 21.29, 14.20, 0.6278, 2.806, 20.39
    elif closures == "derived":
        j1, j2, j12 = (impact_integral(p) for p in (1.0 + a, 2.0 + a, 1.0 + 2.0 * a))
        square = impact_integral(1.0) * j12 / j1**2
        exchange_time, flux, production, swap = 1 / 12, j2 / j1, j2 / j1, (2.0 - (2.0 + a) * e) / 6
        k_c, k_t = s * (19.0 - 3.0 * e) / 30.0, -s * (1.0 + 3.0 * e) / 60.0
        k_drag, k_exchange, trace = 2.0, swap, 3.0
        rho_1 = rho_2 = j2 * (a * e**2 + 3.0 * e**2 + 2.0 * e - 1.0) / (120.0 * j1)
        gain, source, spread = 72.0 * square, 12.0 * square, 6.0 * square
        n_exchange, n_gain = (5.0 - (2.0 + a) * e) / 6.0, 3.0 * square
    else:
        raise ValueError(f"There are no closures {closures!r} for the exponent {a}.")
    # Without collisions 1/Pe and 1/tau_sigma are zero too, and so is every product with tau_c.
    tau_c = 0.0 if isinf(numbers["tau_c"]) else numbers["tau_c"]
    collision, drag, conduction = (1.0 / numbers[k] for k in ("tau_c", "tau_p", "tau_sigma"))
    exchange = ratio**2 / (exchange_time * pe)  # 1 / tau_xi
    relaxation = s / 3.0 * collision + drag
    k1, k2 = k_c * collision + k_drag * drag + k_exchange * exchange, k_t * collision
    g1, g2 = 1.0 + rho_1 * exchange / ratio, rho_2 * exchange / ratio
    third = 2.0 * g1 + g2 - k2 * (2.0 * g1 + trace * g2) / (k1 + trace * k2)
    kinetic = relaxation + (n_exchange - n_gain * tau_c * ratio**2 / pe) * exchange
    return {
        "flux": 1.0 + flux * ratio / pe,
        "conduction": conduction,
        "diffusion": 1.0 / pe,
        "gradient_production": 1.0 + production * e * ratio / pe,
        "field_production": production * e * ratio * conduction,
        "force": numbers["energy_ratio"],
        "covariance_destruction": relaxation + swap * exchange,
        "covariance_dispersion": third / k1,
        "variance_destruction": exchange - gain * tau_c * ratio**4 / pe**2,
        "field_variance": source * tau_c * (ratio * conduction) ** 2,
        "variance_dispersion": spread * tau_c * (ratio / pe) ** 2 + 1.0 / kinetic,
    }


def derivatives(field: np.ndarray, length: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Return the first and second derivative of a periodic field by Fourier transform.

    Parameters
    ----------
    field : ndarray, shape (..., points)
        Values on the equidistant points of one period.
    length : float, default 1.0
        The period, in units of L.

    Returns
    -------
    tuple of two ndarray, shape (..., points)
        First and second derivative.
    """
    points = field.shape[-1]
    wave = 2.0 * pi * np.fft.rfftfreq(points, length / points)
    # On an even grid the shortest wave is a cosine only; its slope vanishes on every point.
    slope = np.where(np.arange(wave.size) * 2 == points, 0.0, 1j * wave)
    spectrum = np.fft.rfft(field)
    return np.fft.irfft(slope * spectrum, points), np.fft.irfft(-(wave**2) * spectrum, points)


def electric_field(charge: np.ndarray, length: float = 1.0) -> np.ndarray:
    """Return the periodic field of zero mean whose divergence is the charge less its mean.

    Parameters
    ----------
    charge : ndarray, shape (points,)
        Mean charge, scaled by Q0.
    length : float, default 1.0
        The period, in units of L.

    Returns
    -------
    ndarray, shape (points,)
        Electric field, scaled by n Q0 L / epsilon0, (5.5) and (5.6).
    """
    points = charge.size
    spectrum = np.fft.rfft(charge)
    wave = 2.0 * pi * np.fft.rfftfreq(points, length / points)
    inner = slice(1, (points + 1) // 2)
    field = np.zeros_like(spectrum)
    field[inner] = spectrum[inner] / (1j * wave[inner])
    return np.fft.irfft(field, points)


def right_hand_side(
    t: float, y: np.ndarray, coefficients: Mapping[str, float], length: float = 1.0
) -> np.ndarray:
    """Return the time derivatives of charge, covariance and variance.

    Parameters
    ----------
    t : float
        Time, scaled by L / sqrt(Theta); the equations do not depend on it.
    y : ndarray, shape (3, points) or (3 * points,)
        Rows are the charge Q, the covariance C and the variance V.
    coefficients : mapping of str to float
        What the function `coefficients` returns.
    length : float, default 1.0
        The period, in units of L.

    Returns
    -------
    ndarray, same shape as `y`
        Time derivatives, (5.2) to (5.4).
    """
    c = coefficients
    q, cov, var = state = np.reshape(y, (3, -1))
    (q_x, cov_x, _), (q_xx, cov_xx, var_xx) = derivatives(state, length)
    e = electric_field(q, length)
    rates = np.empty_like(state)
    rates[0] = -c["flux"] * cov_x - c["conduction"] * (q - q.mean()) + c["diffusion"] * q_xx
    rates[1] = -c["gradient_production"] * q_x + (c["field_production"] + c["force"] * var) * e
    rates[1] += -c["covariance_destruction"] * cov + c["covariance_dispersion"] * cov_xx
    rates[2] = -2.0 * cov * q_x - c["variance_destruction"] * var
    rates[2] += c["field_variance"] * e**2 + c["variance_dispersion"] * var_xx
    return rates.reshape(np.shape(y))


def solve_to_peak(
    coefficients: Mapping[str, float], points: int, peak: float = 0.5, rtol: float = 1e-8
) -> tuple[float, np.ndarray]:
    """Integrate from Q = -sin(2 pi x), C = V = 0 until max|Q| over the points falls to `peak`.

    Parameters
    ----------
    coefficients : mapping of str to float
        What the function `coefficients` returns.
    points : int
        Number of grid points; a multiple of four puts one on the crest of the charge.
    peak : float, default 0.5
        Value of max|Q| at which to stop, scaled by Q0.
    rtol : float, default 1e-8
        Relative tolerance of the time integration; the absolute one is a thousandth of it.

    Returns
    -------
    tuple of float and ndarray of shape (3, points)
        The stop time, scaled by L / sqrt(Theta), and the state there.

    Raises
    ------
    RuntimeError
        If the integration fails or the peak is not reached by t = 1000.
    """

    class StopAtPeak:
        """An event of solve_ivp that ends the run where it changes sign."""

        terminal = True

        def __call__(self, t: float, y: np.ndarray) -> float:
            return float(np.abs(y[:points]).max()) - peak

    start = np.zeros((3, points))
    start[0] = -np.sin(2.0 * pi * np.arange(points) / points)
    run = solve_ivp(
        lambda t, y: right_hand_side(t, y, coefficients),
        (0.0, 1000.0),
        start.ravel(),
        method="Radau",
        events=StopAtPeak(),
        rtol=rtol,
        atol=1e-3 * rtol,
    )
    if not run.success or run.t_events is None or run.t_events[0].size == 0:
        raise RuntimeError(f"max|Q| has not fallen to {peak}: {run.message}")
    return float(run.t_events[0][0]), run.y_events[0][0].reshape(3, points)


def main() -> None:
    """Run one of the paper's cases and print the numbers of its profile at the stop time."""
    parser = argparse.ArgumentParser(description="Full model in one dimension, by hand.")
    parser.add_argument("--case", choices=sorted(PAPER_CASES), default="B")
    parser.add_argument("--closures", choices=("derived", "published"), default="published")
    parser.add_argument("--points", type=int, default=32)
    arguments = parser.parse_args()
    values = coefficients(arguments.closures, PAPER_CASES[arguments.case])
    stop, (charge, covariance, variance) = solve_to_peak(values, arguments.points)
    print(f"t*     = {stop:.6g}")
    print(f"max|C| = {np.abs(covariance).max():.6g}")
    print(f"max V  = {variance.max():.6g}")
    print(f"min V  = {variance.min():.6g}")
    print(f"max|E| = {np.abs(electric_field(charge)).max():.6g}")


if __name__ == "__main__":
    main()
