"""The reduced models in one to three dimensions, by NumPy's transforms and without the package.

Written from (7.8) and (7.9) with the coefficients of the example; fields are NumPy arrays over the
points of a periodic box.
"""

import numpy as np
from scipy.integrate import solve_ivp

MODELS = ("semi-algebraic", "algebraic", "gradient", "collisional")


class Box:
    """Derivatives on the points of a periodic box."""

    def __init__(self, points, lengths):
        self.points = points
        numbers = [np.fft.fftfreq(n, 1.0 / n) for n in points]
        k = np.meshgrid(
            *(2.0 * np.pi * m / x for m, x in zip(numbers, lengths, strict=True)), indexing="ij"
        )
        self.k = np.stack(k)
        self.squared = np.sum(self.k**2, axis=0)
        inside = [np.abs(m) <= (n - 1) // 3 for m, n in zip(numbers, points, strict=True)]
        self.kept = np.all(np.stack(np.meshgrid(*inside, indexing="ij")), axis=0)

    def _apply(self, symbol, field):
        return np.fft.ifftn(symbol * np.fft.fftn(field)).real

    def gradient(self, f):
        return np.stack([self._apply(1j * k, f) for k in self.k])

    def divergence(self, f):
        return sum(self._apply(1j * k, x) for k, x in zip(self.k, f, strict=True))

    def laplacian(self, f):
        return self._apply(-self.squared, f)

    def field(self, charge):
        """Return E = -∇φ of the charge without its mean."""
        inverse = np.where(self.squared > 0.0, 1.0 / np.where(self.squared > 0, self.squared, 1), 0)
        return -self.gradient(self._apply(inverse, charge))

    def filtered(self, f):
        """Return a product without the modes that the two-thirds rule drops."""
        return self._apply(self.kept, f)


def algebraic_variance(box, charge, c):
    """Return numerator and denominator of (7.9) divided by D1."""
    slope, e = box.gradient(charge), box.field(charge)
    r = c["covariance_destruction"]
    without_force = (-c["gradient_production"] * slope + c["field_production"] * e) / r
    above = c["field_variance"] * np.sum(e**2, axis=0) - 2.0 * np.sum(without_force * slope, axis=0)
    below = c["variance_destruction"] + 2.0 * c["force"] / r * np.sum(e * slope, axis=0)
    return above, below


def covariance(name, box, charge, variance, c, filtered=False):
    """Return the covariance (7.8) of a model."""
    slope, e = box.gradient(charge), box.field(charge)
    if name == "collisional":
        return 0.0 * e
    force = 0.0 * e
    if name != "gradient":
        force = c["force"] * variance * e
        if filtered:
            force = np.stack([box.filtered(x) for x in force])
    both = -c["gradient_production"] * slope + c["field_production"] * e + force
    return both / c["covariance_destruction"]


def rates(name, box, charge, variance, c):
    """Return the time derivatives of charge and variance; the latter is None if closed."""
    if name == "algebraic":
        above, below = algebraic_variance(box, charge, c)
        variance = above / below
    flux = covariance(name, box, charge, variance, c, filtered=True)
    charge_rate = -c["flux"] * box.divergence(flux) + c["diffusion"] * box.laplacian(charge)
    charge_rate -= c["conduction"] * (charge - charge.mean())
    if name != "semi-algebraic":
        return charge_rate, None
    slope, e = box.gradient(charge), box.field(charge)
    flux = covariance(name, box, charge, variance, c)
    produced = c["field_variance"] * np.sum(e**2, axis=0) - 2.0 * np.sum(flux * slope, axis=0)
    return charge_rate, (
        box.filtered(produced)
        - c["variance_destruction"] * variance
        + c["variance_dispersion"] * box.laplacian(variance)
    )


def solve_to_peak(name, c, points=64, peak=0.5, t_end=300.0, rtol=1e-10):
    """Return t* and the profiles (Q, C, V, E) there, from Q = -sin 2πx and V = 0 in the box 1."""
    box = Box((points,), (1.0,))
    x = np.arange(points) / points
    evolved = 2 if name == "semi-algebraic" else 1

    def right_hand_side(t, y):
        state = y.reshape(evolved, points)
        found = rates(name, box, state[0], state[-1], c)
        return np.concatenate([part for part in found if part is not None])

    def stop(t, y):
        return np.max(np.abs(y[:points])) - peak

    stop.terminal = True  # pyright: ignore[reportFunctionMemberAccess] -- what SciPy asks for
    start = np.zeros((evolved, points))
    start[0] = -np.sin(2.0 * np.pi * x)
    done = solve_ivp(
        right_hand_side,
        (0.0, t_end),
        start.ravel(),
        method="DOP853",
        rtol=rtol,
        atol=1e-3 * rtol,
        events=stop,
    )
    assert done.status == 1
    state = done.y_events[0][0].reshape(evolved, points)
    charge, variance = state[0], state[-1] if evolved == 2 else None
    if name == "algebraic":
        above, below = algebraic_variance(box, charge, c)
        variance = above / below
    return (
        done.t_events[0][0],
        charge,
        covariance(name, box, charge, variance, c),
        variance,
        box.field(charge),
    )
