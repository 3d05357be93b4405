"""What the full model leaves out, for relaxations without a field (`benchmarks.kinetic_verdict`).

The full model closes T_ij = ⟨ξ'c'_i c'_j⟩ algebraically, and its derivation drops terms of the same
order as those that it keeps. Without a field Q, C and T stay one wave each, so that both can be put
back in six ordinary differential equations. They tell where an error of the full model comes from.
Without the dropped terms they are the package's model ``third-order``, written independently.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.kinetic_particles import STOP, K, Reals, Setting, X
from triboflux import closures
from triboflux.closures import collision_integral
from triboflux.rates import ClosureRates, scaled_rates

TRANSPORTED, COMPLETED = "full, T transported", "full, T transported, dropped terms back"
_SOLVER = {"method": "LSODA", "rtol": 1e-8, "atol": 1e-12}


@dataclass(frozen=True)
class Dropped:
    """Coefficients of the dropped terms on the right-hand sides, for e = 1; zero without them.

    They follow from the collision integral as those that are kept; lengths in L, times in L/√Θ.

    Attributes
    ----------
    charge : float
        D (1+a)/20, before 2 ∂²T_xx + ∂²T_mm in the equation of Q.
    covariance_flux : float
        -η (4+a)/20, before 2 ∂T_xx + ∂T_mm in that of C.
    covariance_dispersion : float
        D (3+a)/10, before ∇²C + 2 ∇∇·C in that of C.
    third : float
        D (1+a)/10, before 2 ∂_i ∂_j Q + δ_ij ∇²Q in that of T_ij.
    variance_production : float
        2η - 4η_V, before C·∇Q in that of V.
    variance_gradient : float
        λ3.2 τ_c D²/d², before |∇Q|² in that of V.
    variance_covariance : float
        -[(1+a)/6 - (1+2a)/3 λ3.5 γΘ^(a/2)]/τ_ξ, before |C|² in that of V.
    """

    charge: float
    covariance_flux: float
    covariance_dispersion: float
    third: float
    variance_production: float
    variance_gradient: float
    variance_covariance: float

    @classmethod
    def of(cls, setting: Setting) -> Dropped:
        """Return the coefficients of a relaxation."""
        case = setting.case()
        n, a = case.numbers, case.exponent
        exact = closures.derived(1.0, a)
        r = scaled_rates(exact, n)
        fraction, eta = setting.transferred_fraction, r.collisional_flux
        ratio = collision_integral(2.0 + 2.0 * a) / collision_integral(2.0 + a)
        regain = exact["variance_flux_regain"] * fraction
        return cls(
            charge=(1.0 + a) / (20.0 * n.peclet),
            covariance_flux=-eta * (4.0 + a) / 20.0,
            covariance_dispersion=(3.0 + a) / (10.0 * n.peclet),
            third=(1.0 + a) / (10.0 * n.peclet),
            variance_production=2.0 * eta - 4.0 * eta * fraction * ratio,
            variance_gradient=exact["variance_production_field"]
            * n.tau_c
            * (n.length_ratio / n.peclet) ** 2,
            variance_covariance=-r.charge_exchange
            * ((1.0 + a) / 6.0 - (1.0 + 2.0 * a) / 3.0 * regain),
        )

    @classmethod
    def none(cls) -> Dropped:
        """Return zeros."""
        return cls(*(0.0 for _ in fields(cls)))


@dataclass(frozen=True)
class Beyond:
    """Equations of Q, C, T_xx, T_mm and V.

    The steady solution of those of T is the closure of the full model,

        ∂T_ij/∂t = -K1 T_ij - K2 T_mm δ_ij - G1 (∂_i C_j + ∂_j C_i) - G2 ∇·C δ_ij

    with n_t = 3 in both closure sets, and -∂T_xx/∂x comes in the equation of C.
    """

    setting: Setting
    rates: ClosureRates
    dropped: Dropped

    def slope(self, _: float, state: Reals) -> list[float]:
        """Return rates of -Q, C, T_xx, T_mm over sin, cos, sin, sin of 2πx, V = v_0 + v_2 cos 4πx.

        C·∇Q, |∇Q|² and |C|² are all proportional to (1 + cos 4πx)/2.
        """
        r, drop = self.rates, self.dropped
        q, c, t_xx, t_mm, v_0, v_2 = state
        both = 2.0 * t_xx + t_mm
        charge = -(K**2) / self.setting.peclet * q - K * (1.0 + r.collisional_flux) * c
        covariance = K * r.gradient_production * q - r.covariance_destruction * c - K * t_xx
        covariance += drop.covariance_flux * K * both - 3.0 * drop.covariance_dispersion * K**2 * c
        third = K * (2.0 * r.shear + r.divergence) * c + 3.0 * drop.third * K**2 * q
        trace = K * (2.0 * r.shear + 3.0 * r.divergence) * c + 5.0 * drop.third * K**2 * q
        produced = K * q * c - 0.5 * drop.variance_production * K * q * c
        produced += 0.5 * (drop.variance_gradient * (K * q) ** 2 + drop.variance_covariance * c**2)
        dispersion = r.variance_collisional_dispersion + 1.0 / r.variance_flux_destruction
        return [
            charge + drop.charge * K**2 * both,
            covariance,
            third - r.third_moment * t_xx - r.third_moment_trace * t_mm,
            trace - (r.third_moment + 3.0 * r.third_moment_trace) * t_mm,
            produced - r.variance_destruction * v_0,
            produced - (r.variance_destruction + 4.0 * K**2 * dispersion) * v_2,
        ]

    def history(self, times: Reals) -> Reals:
        """Return the six amplitudes at increasing times, shape ``(times, 6)``."""
        end = float(times[-1])
        return solve_ivp(self.slope, (0.0, end), self._start, t_eval=times, **_SOLVER).y.T

    def at(self, time: float) -> tuple[float | None, dict[str, Reals]]:
        """Return t*, None if it comes late, and the moments at a time."""

        def falls(_: float, state: Reals) -> float:
            return float(state[0]) - STOP

        end = 20.0 * self.setting.expected_time()
        found = solve_ivp(self.slope, (0.0, end), self._start, events=falls, **_SOLVER).t_events[0]
        q, c, _, _, v_0, v_2 = self.history(np.array([time]))[-1]
        moments = {
            "charge": -q * np.sin(K * X),
            "covariance": c * np.cos(K * X),
            "variance": v_0 + v_2 * np.cos(2.0 * K * X),
        }
        return (float(found[0]) if len(found) else None), moments

    @property
    def _start(self) -> list[float]:
        return [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]


def beyond(setting: Setting, closure_set: str, with_dropped: bool) -> Beyond:
    """Return the equations of a relaxation without a field."""
    rates = scaled_rates(closures.by_name(closure_set, 1.0), setting.case().numbers)
    return Beyond(setting, rates, Dropped.of(setting) if with_dropped else Dropped.none())
