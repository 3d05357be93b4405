"""N_i = ⟨ξ'ξ'c'_i⟩ closed in two ways and transported, and the force on T_ij, beside particles.

Run from the root of the repository; nothing is written without ``--write``::

    python -m benchmarks.variance_flux            # in two minutes
    python -m benchmarks.variance_flux --write    # fills two sections of docs/third-order.md

The equations of Q, C and T_ij are those of `benchmarks.kinetic_beyond`, the particles those of
`benchmarks.kinetic_field_runs` at u = 0. For a Gaussian joint distribution and R_ij = δ_ij

    ∂N_i/∂t = −∂_i V − 2 T_ij ∂_j Q − 2 C_j ∂_j C_i − N N_i

with the bracket N of (4.3). The package closes it by its first and its last term.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.kinetic_beyond import Beyond, beyond
from benchmarks.kinetic_field_runs import COLLISION_TIMES, LONG, Kept, load
from benchmarks.kinetic_fields import is_like
from benchmarks.kinetic_models import errors_beside, predict_at
from benchmarks.kinetic_particles import K, X
from benchmarks.kinetic_tables import percent
from benchmarks.timing import ROOT, print_or_write, table
from triboflux.terminal import use_compilation_cache

PAGE = ROOT / "docs" / "third-order.md"
SECTION, FORCE = "variance-flux", "force"
MODELS = ("third-order", "self-consistent")
STRONG = (30.0, 300.0)
"""u at which the force is judged."""
CLOSURES = ("derived", "complete")
CLOSED, PRODUCTS, TRANSPORTED = "closed", "closed, with the products", "transported"


def variance(equations: Beyond, how: str, time: float) -> np.ndarray:
    """Return V on the points at a time, N being closed or transported."""
    rates = equations.rates

    def slope(at: float, state: np.ndarray) -> list[float]:
        """Return the rates of the six amplitudes there and of N_x over sin 4πx."""
        *amplitudes, flux = state
        q, c, t_xx, _, _, v_2 = amplitudes
        produced = 2.0 * K * v_2 + (0.0 if how == CLOSED else K * (q * t_xx + c**2))
        destruction = rates.variance_flux_destruction
        known = flux if how == TRANSPORTED else produced / destruction
        changes = equations.slope(at, np.array(amplitudes))
        # takes the place of the dispersion by flight
        changes[5] += 4.0 * K**2 / destruction * v_2 - 2.0 * K * known
        return [*changes, produced - destruction * flux]

    start = [1.0, *(0.0,) * 6]
    found = solve_ivp(slope, (0.0, time), start, method="LSODA", rtol=1e-9, atol=1e-12)
    v_0, v_2 = found.y[4:6, -1]
    return v_0 + v_2 * np.cos(2.0 * K * X)


def row(kept: Kept) -> list[str]:
    """Return the errors of V beside the particles of one collision time."""
    equations, truth = beyond(kept.setting, "derived", False), kept.moments["variance"]
    found = (variance(equations, how, kept.time) for how in (CLOSED, PRODUCTS, TRANSPORTED))
    errors = (np.linalg.norm(each - truth) / np.linalg.norm(truth) for each in found)
    noise = kept.noise["variance"]
    return [f"{kept.setting.tau_c:g}", f"{noise:.2%}", *(f"{error:.1%}" for error in errors)]


def section() -> str:
    """Return the section of the page."""
    relaxations = [kept for kept in load().values() if kept.setting.energy_ratio == 0.0]
    rows = [row(kept) for kept in sorted(relaxations, key=lambda kept: kept.setting.tau_c)]
    return table(["τ_c", "error bar", CLOSED, PRODUCTS, TRANSPORTED], rows)


def force_section() -> str:
    """Return errors of t* and Q with and without the force on T_ij, which `complete` has."""
    head = ["u", "τ_c", *(f"`{model}`, `{name}`" for model in MODELS for name in CLOSURES)]
    rows: list[list[str]] = []
    known = tuple(load().values())
    for ratio in STRONG:
        for tau_c in sorted(time for time in COLLISION_TIMES if time > LONG):
            own = [k for k in known if (k.setting.energy_ratio, k.setting.tau_c) == (ratio, tau_c)]
            cells: list[str] = []
            for model in MODELS:
                (kept,) = (k for k in own if is_like(model, k))
                cells += [_force_cell(kept, model, name) for name in CLOSURES]
            rows.append([f"{ratio:g}", f"{tau_c:g}", *cells])
    return table(head, rows)


def _force_cell(kept: Kept, model: str, closures: str) -> str:
    """Return the errors of t* and Q of one model with one closure set."""
    (told,) = predict_at(kept.setting, model, closures, [kept.time])
    errors = errors_beside(told, kept.time, kept.moments)
    late = "–" if errors.time is None else percent(errors.time, signed=True)
    return f"{late} · {percent(errors.moments['charge'])}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the section, or write it."""
    parser = argparse.ArgumentParser(description="The flux of the variance, closed or transported.")
    parser.add_argument("--write", action="store_true", help=f"write into {PAGE.name}")
    options = parser.parse_args(arguments)
    use_compilation_cache()
    print_or_write(SECTION, section(), PAGE, write=options.write)
    print_or_write(FORCE, force_section(), PAGE, write=options.write)
    return 0


if __name__ == "__main__":
    sys.exit(main())
