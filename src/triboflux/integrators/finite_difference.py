"""Sixth-order finite differences with an explicit Runge-Kutta method, for cross-checks.

Everything that the production solver does differently is done plainly here: values on the points
instead of Fourier coefficients, explicit steps bounded by stability instead of exponentials. Only
the list of terms is shared. The paper's own figures come from a scheme of this kind.
"""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from triboflux.grid import Grid
from triboflux.integrators.root import Illinois
from triboflux.models.model import Model
from triboflux.moments import Moments

# Weights at distances 1, 2, 3 of the central differences of sixth order; the first derivative is
# odd, the second even with its weight at distance 0 in front.
# Fornberg (1988), https://doi.org/10.1090/S0025-5718-1988-0935077-0
FIRST_DERIVATIVE = (3.0 / 4.0, -3.0 / 20.0, 1.0 / 60.0)
SECOND_DERIVATIVE = (-49.0 / 18.0, 3.0 / 2.0, -3.0 / 20.0, 1.0 / 90.0)

Scalar: TypeAlias = float | Float[Array, ""]


class FiniteDifferences(eqx.Module):
    """Central differences of sixth order on the values at the points of a periodic box.

    Scalars have the shape ``[*x]``, vectors ``[component, *x]``. Products are taken point by point
    and not de-aliased. The sum of a divergence over the points vanishes to round-off, so the total
    charge is constant.

    Attributes
    ----------
    grid : Grid
        Where the points lie. With fewer than seven along an axis the stencil overlaps itself, which
        is correct but no longer accurate.
    """

    grid: Grid

    def gradient(self, scalar: Float[Array, "*x"]) -> Float[Array, "d *x"]:
        """Return ∇f, dimensionless, scaled by 1/L."""
        return jnp.stack([self._slope(scalar, axis) for axis in range(self.grid.dimensions)])

    def divergence(self, vector: Float[Array, "d *x"]) -> Float[Array, "*x"]:
        """Return ∇·F, dimensionless, scaled by 1/L."""
        slopes = (self._slope(component, axis) for axis, component in enumerate(vector))
        return sum(slopes, start=jnp.zeros_like(vector[0]))

    def laplacian(self, field: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
        """Return ∇²f of a scalar or of each component, dimensionless, scaled by 1/L²."""
        total = jnp.zeros_like(field)
        centre, *others = SECOND_DERIVATIVE
        for axis, spacing in enumerate(_spacings(self.grid)):
            at = axis - self.grid.dimensions
            pairs = [jnp.roll(field, -j, at) + jnp.roll(field, j, at) for j in (1, 2, 3)]
            curvature = sum((w * p for w, p in zip(others, pairs, strict=True)), centre * field)
            total = total + curvature / spacing**2
        return total

    def electric_field(self, charge: Float[Array, "*x"]) -> Float[Array, "d *x"]:
        """Return E = -∇φ with ∇²φ = -(Q - ⟨Q⟩), ⟨E⟩ = 0, scaled by n Q0 L/ε0; (5.5), (5.6)."""
        return -self.gradient(self.potential(charge))

    def potential(self, charge: Float[Array, "*x"]) -> Float[Array, "*x"]:
        """Return φ with `laplacian` of φ = -(Q - ⟨Q⟩) to round-off, ⟨φ⟩ = 0, scaled by n Q0 L²/ε0.

        The discrete Laplacian is diagonal in the discrete Fourier modes, where its eigenvalues, not
        -|k|², are divided by.
        """
        inverse = 1.0 / np.where(_is_mean(self.grid), -np.inf, _laplacian_eigenvalues(self.grid))
        spectrum = jnp.fft.rfftn(charge)
        return jnp.fft.irfftn(-jnp.asarray(inverse) * spectrum, s=self.grid.points)

    def without_mean(self, scalar: Float[Array, "*x"]) -> Float[Array, "*x"]:
        """Return f - ⟨f⟩."""
        return scalar - jnp.mean(scalar)

    def values(self, representation: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
        """Return the values on the points, which the representation already is."""
        return representation

    def from_values(self, values: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
        """Return the values on the points unchanged."""
        return values

    def _slope(self, scalar: Array, axis: int) -> Array:
        """Return the first derivative of a scalar along an axis."""
        differences = [jnp.roll(scalar, -j, axis) - jnp.roll(scalar, j, axis) for j in (1, 2, 3)]
        weighted = (w * f for w, f in zip(FIRST_DERIVATIVE, differences, strict=True))
        return sum(weighted, start=jnp.zeros_like(scalar)) / _spacings(self.grid)[axis]


class Outcome(NamedTuple):
    """What `integrate_finite_differences` returns.

    Attributes
    ----------
    time : Array
        The end time, or the time at which the peak charge fell to the stop value; scaled by L/√Θ.
    fields : Moments
        Values on the points at this time.
    stats : dict of str to Array
        Numbers of steps, ``"accepted"`` and ``"rejected"``, and whether the stop rule ended the
        run, ``"stopped"``.
    """

    time: Float[Array, ""]
    fields: Moments
    stats: dict[str, Array]


def integrate_finite_differences(
    model: Model,
    state: Moments,
    grid: Grid,
    *,
    t_end: Scalar,
    rtol: Scalar = 1e-8,
    atol: Scalar = 1e-11,
    stop_at_peak_charge: Scalar | None = None,
    max_steps: int = 100_000,
) -> Outcome:
    """Integrate a model on finite differences with an adaptive explicit method of order eight.

    Meant for checking the production solver `triboflux.integrate`: the number of steps grows with
    the fastest rate, the larger one of 1/τ_c and the dispersion over the spacing squared.

    Parameters
    ----------
    model : Model
        Its term list is evaluated as it stands.
    state : Moments
        Fields at time 0 on the points of the grid.
    grid : Grid
        The periodic box.
    t_end : float or Array
        End time, scaled by L/√Θ.
    rtol, atol : float or Array
        Relative and absolute tolerance of the error per step, for the rms over all values.
    stop_at_peak_charge : float or Array, optional
        Stop when the largest |Q| in the box falls to this value, scaled by Q0. The peak is that of
        the Fourier series through the points, cut at the kept modes (`Grid.peak`): for a resolved
        charge it is much closer than the error of the differences.
    max_steps : int
        Steps, rejected ones included, after which to give up.

    Returns
    -------
    Outcome
        Time, fields and statistics.

    Raises
    ------
    RuntimeError
        If `max_steps` are not enough, as where the solution diverges.

    References
    ----------
    Prince & Dormand (1981), https://doi.org/10.1016/0771-050X(81)90010-3
    """
    differences = FiniteDifferences(grid)

    def rates(t: Any, y: Moments, args: Any) -> Moments:
        return model.right_hand_side(differences, y)

    event = None
    if stop_at_peak_charge is not None:
        event = _stop_at_peak_charge(grid, stop_at_peak_charge, rtol)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(rates),
        diffrax.Dopri8(),
        0.0,
        t_end,
        None,
        Moments(**{name: getattr(state, name) for name in model.evolves}),
        # The proportional part keeps the steps steady where stability, not accuracy, bounds them.
        stepsize_controller=diffrax.PIDController(rtol, atol, pcoeff=0.4, icoeff=0.3),
        event=event,
        max_steps=max_steps,
    )
    times: Any = solution.ts
    last = jax.tree.map(lambda saved: saved[-1], solution.ys)
    stats = {
        "accepted": solution.stats["num_accepted_steps"],
        "rejected": solution.stats["num_rejected_steps"],
        "stopped": jnp.asarray(False) if event is None else solution.event_mask,
    }
    return Outcome(times[-1], last, stats)


def _stop_at_peak_charge(grid: Grid, value: Scalar, rtol: Scalar) -> diffrax.Event:
    """Return the event of the peak charge falling through a value, located within the step."""

    def above(t: Any, y: Moments, args: Any, **kwargs: Any) -> Array:
        charge: Any = y.charge
        return grid.peak(grid.to_spectral(charge)) - value

    return diffrax.Event(above, Illinois(1e-3 * rtol), False)


def _spacings(grid: Grid) -> list[float]:
    return [length / n for n, length in zip(grid.points, grid.lengths, strict=True)]


def _laplacian_eigenvalues(grid: Grid) -> np.ndarray:
    """Return the eigenvalues of the discrete Laplacian, shaped as `jnp.fft.rfftn` of a field."""
    last = grid.dimensions - 1
    total = np.zeros(())
    centre, *others = SECOND_DERIVATIVE
    for axis, (n, spacing) in enumerate(zip(grid.points, _spacings(grid), strict=True)):
        modes = np.arange(n // 2 + 1 if axis == last else n)
        angle = 2.0 * np.pi * modes / n
        pairs = (2.0 * w * np.cos(j * angle) for j, w in enumerate(others, start=1))
        eigenvalues = sum(pairs, start=np.full(len(modes), centre)) / spacing**2
        total = total[..., None] + eigenvalues
    return total


def _is_mean(grid: Grid) -> np.ndarray:
    """Return which discrete Fourier mode is the mean, shaped as `jnp.fft.rfftn` of a field."""
    *others, last = grid.points
    mask = np.zeros((*others, last // 2 + 1), dtype=bool)
    mask[(0,) * grid.dimensions] = True
    return mask
