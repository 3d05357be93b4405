"""A wave of temperature in simulated particles, against the moment equations of the velocities.

Elastic spheres fill a periodic box, their granular temperature is 1 + 0.3 sin(2πx) at first, and
mean velocities are held at zero, so that the density stays uniform. The linear moment equations of
`triboflux.velocity_closures` for R_xx, R_mm, S_xxx and S_xmm say how the wave decays, with nothing
fitted. To tell what each part of them is worth, they are solved without the transfer over a
diameter, without the shifts of flux and production, and without both. Holding the velocities takes
some heat, that of the noise in their local means, hence the column of the mean Θ::

    python -m benchmarks.velocity_particles          # some minutes
    python -m benchmarks.velocity_particles --particles 100000
"""

from __future__ import annotations

import argparse
import math
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from triboflux.kinetic.ensemble import Ensemble, Parameters
from triboflux.velocity_closures import velocity_closures

AMPLITUDE = 0.3
WAVE_NUMBER = 2.0 * math.pi
POINTS, CELLS = 32, 256
STEPS_IN_COLLISION = 10
# holds mean velocities, which elastic spheres without any force are not made to do
HARDLY_ANY_DRAG = 1e-9


class Setting(NamedTuple):
    """A gas: diameter and collision time, scaled by the box and its √Θ, and how long to look."""

    diameter: float
    tau_c: float
    time: float


SETTINGS = (Setting(0.0, 0.008, 0.5), Setting(0.03, 0.01, 0.3), Setting(0.03, 0.0025, 0.12))


def moment_matrix(setting: Setting, *, transfer: bool = True, shifts: bool = True) -> NDArray:
    """Return the operator of R_xx, R_mm, S_xxx and S_xmm of a wave at Θ = 1."""
    own, rate = velocity_closures(1.0), 1.0 / setting.tau_c
    number = math.sqrt(math.pi) * setting.diameter * rate * shifts
    more, made = number * own.flux_shift, number * own.production_shift
    disperses = own.transfer.times(transfer * setting.diameter**2 * rate).along_axis()
    matrix = np.zeros((4, 4), complex)
    matrix[:2, :2] = -(WAVE_NUMBER**2) * np.array(disperses)
    matrix[0, :2] -= np.array([1.0, -1.0 / 3.0]) * own.isotropy * rate
    matrix[:2, 2:] = -1j * WAVE_NUMBER * np.array([[1.0 + more, 1.5 * more], [0, 1.0 + 3.5 * more]])
    produced = [[3.0 + 6.0 * made, 1.5 * made], [2.0 + 7.0 * made, 1.0 + 3.5 * made]]
    matrix[2:, :2] = -1j * WAVE_NUMBER * np.array(produced)
    a1, a2 = own.third_moment * rate, own.third_moment_trace * rate
    matrix[2:, 2:] = -np.array([[a1, 3.0 * a2], [0.0, a1 + 5.0 * a2]])
    return matrix


def predicted(setting: Setting, **parts: bool) -> float:
    """Return what is left of the wave of Θ."""
    state = expm(moment_matrix(setting, **parts) * setting.time) @ np.array([1.0, 3.0, 0.0, 0.0])
    return float(state[1].real) / 3.0


def simulated(setting: Setting, particles: int, seed: int) -> tuple[float, float]:
    """Return what is left of the wave of Θ in one ensemble, and of its mean."""
    random = np.random.default_rng(seed)
    drawn = np.zeros((particles, 5))
    drawn[:, 0] = (np.arange(particles) + random.random(particles)) / particles
    temperature = 1.0 + AMPLITUDE * np.sin(WAVE_NUMBER * drawn[:, 0])
    drawn[:, 1:4] = random.standard_normal((particles, 3)) * np.sqrt(temperature)[:, None]
    step = setting.tau_c / STEPS_IN_COLLISION
    parameters = Parameters(
        points=POINTS,
        cells=CELLS,
        length=1.0,
        diameter=setting.diameter,
        collision_rate=1.0 / setting.tau_c,
        restitution=1.0,
        exponent=0.8,
        charge_transfer=0.0,
        field_transfer=0.0,
        energy_ratio=0.0,
        drag_rate=HARDLY_ANY_DRAG,
        time_step=step,
        thermostat="mean-velocity",
    )
    words = np.random.SeedSequence(seed).generate_state(4, np.uint64)
    ensemble = Ensemble(parameters, drawn, words)
    first = amplitude(ensemble), ensemble.particles[:, 1:4].var()
    ensemble.advance(round(setting.time / step), step)
    return amplitude(ensemble) / first[0], ensemble.particles[:, 1:4].var() / first[1]


def amplitude(ensemble: Ensemble) -> float:
    """Return the amplitude of sin(2πx) in Θ."""
    place, velocity = ensemble.particles[:, 0], ensemble.particles[:, 1:4]
    square = np.einsum("ij,ij->i", velocity, velocity)
    return 2.0 * float(np.mean(square * np.sin(WAVE_NUMBER * place))) / 3.0


def main() -> None:
    """Print what is left of each wave."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--particles", type=int, default=600_000, help="of each ensemble")
    parser.add_argument("--ensembles", type=int, default=6)
    parser.add_argument("--workers", type=int, default=2, help="threads")
    options = parser.parse_args()
    print("| d | τ_c | t | particles | mean Θ | all | no transfer | no shifts | neither |")
    print("|---|---|---|---|---|---|---|---|---|")
    for setting in SETTINGS:
        with ThreadPoolExecutor(options.workers) as pool:
            seeds = range(1, options.ensembles + 1)
            runs = list(pool.map(lambda s, at=setting: simulated(at, options.particles, s), seeds))
        left, mean = np.array(runs).T
        error = np.std(left, ddof=1) / math.sqrt(len(left))
        parts = [(True, True), (False, True), (True, False), (False, False)]
        models = [predicted(setting, transfer=one, shifts=two) for one, two in parts]
        row = [f"{value:g}" for value in setting]
        row += [f"{left.mean():.4f} ± {error:.4f}", f"{mean.mean():.4f}"]
        row += [f"{value:.4f}" for value in models]
        print("| " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    main()
