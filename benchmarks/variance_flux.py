"""N_i = ⟨ξ'ξ'c'_i⟩ closed in two ways and transported, beside simulated particles without a field.

Run from the root of the repository; nothing is written without ``--write``::

    python -m benchmarks.variance_flux            # in seconds
    python -m benchmarks.variance_flux --write    # fills a section of docs/third-order.md

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
from benchmarks.kinetic_field_runs import Kept, load
from benchmarks.kinetic_particles import K, X
from benchmarks.timing import ROOT, print_or_write, table

PAGE = ROOT / "docs" / "third-order.md"
SECTION = "variance-flux"
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


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the section, or write it."""
    parser = argparse.ArgumentParser(description="The flux of the variance, closed or transported.")
    parser.add_argument("--write", action="store_true", help=f"write into {PAGE.name}")
    options = parser.parse_args(arguments)
    print_or_write(SECTION, section(), PAGE, write=options.write)
    return 0


if __name__ == "__main__":
    sys.exit(main())
