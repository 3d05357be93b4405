"""Relaxations of simulated particles with error bars, for `benchmarks.kinetic_verdict`.

All start from Q = -sin 2πx and C = V = 0 in a box of length 1. The initial state and the laws of
motion do not change under a reflection (x, c, ξ) → (-x, -c, -ξ), nor under a shift by half a box
with (x, ξ) → (x + 1/2, -ξ). Means over all simulations therefore have the Fourier modes of `MODES`
only: what the others show is noise, which is left out and, as a check of the error bars, counted.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from time import process_time

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

import triboflux
from triboflux import closures, exact
from triboflux.case_kinetic import THERMOSTATS, Kinetic
from triboflux.kinetic.ensemble import Ensemble, Parameters
from triboflux.kinetic.moments import moments_of
from triboflux.kinetic.start import draw_particles
from triboflux.models import transport_coefficients

Reals = NDArray[np.float64]

POINTS, HIGHEST = 64, 8
"""Cells in which moments are counted, and the highest mode of them that is looked at."""
ENSEMBLES = 16
CELLS_IN_DIAMETER, LEAST_IN_DIAMETER, FEWEST_IN_CELL = 24, 8, 20
"""Collision cells in a diameter where there are particles enough, at least, and what is enough."""
STOP = 0.5
"""Peak charge at t*."""
MARGIN = 0.01
"""The charge has to fall so far below it, lest noise feigns t*."""
WINDOW = 0.1
"""Moments at t* come from parabolas through all samples closer to it than this part of t*."""
SAMPLES, COLLISIONS = 100, 4.0
"""Samples per relaxation at least, and collision times between samples at most."""

MODES: dict[str, tuple[str, range, range]] = {
    "charge": ("sine", range(1, HIGHEST + 1, 2), range(1, 2)),
    "covariance": ("cosine", range(1, HIGHEST + 1, 2), range(1, 2)),
    "variance": ("cosine", range(0, HIGHEST + 1, 2), range(0, 3, 2)),
    "granular_temperature_xx": ("cosine", range(0, HIGHEST + 1, 2), range(1)),
    "granular_temperature": ("cosine", range(0, HIGHEST + 1, 2), range(1)),
}
"""Kind and wave numbers of the modes that the symmetries leave; the last where there is no field.

Without a field the motion knows nothing of x and ξ and is linear in ξ, so that Q and C keep the one
wave that they start with, and V has that of its square.
"""

K = 2.0 * math.pi
"""Wave number of the initial charge."""
X, FINE = np.arange(POINTS) / POINTS, np.arange(1024) / 1024


@dataclass(frozen=True)
class Setting:
    """One relaxation.

    Attributes
    ----------
    tau_c, peclet, length_ratio, energy_ratio : float
        τ_c*, Pe, L/d and u; elastic particles without drag and triboconductivity.
    thermostat : str
        As in a case's table ``[kinetic]``.
    particles : int
        Of all ensembles together, at full effort.
    dilute : bool
        Particles collide at one place, not a diameter apart.
    """

    tau_c: float
    peclet: float
    length_ratio: float
    energy_ratio: float = 0.0
    thermostat: str = "none"
    particles: int = 640_000
    dilute: bool = False

    @property
    def transferred_fraction(self) -> float:
        """γΘ^(a/2), the mean part of the charge difference that a collision passes over."""
        kappa = closures.derived(1.0)["transferred_fraction"]
        return kappa * self.tau_c * self.length_ratio**2 / self.peclet

    def case(self, model: str = "full", closure_set: str = "derived", **run: object):
        """Return the case of a model; `run` replaces what stops it at t*."""
        return triboflux.Case(
            model=model,
            closures=closure_set,
            numbers={
                "tau_c": self.tau_c,
                "peclet": self.peclet,
                "length_ratio": self.length_ratio,
                "energy_ratio": self.energy_ratio,
                "restitution": 1.0,
            },
            grid={"points": [POINTS]},
            initial={"charge": [{"mode": [1], "sine": -1.0}]},
            run=run or {"t_end": 1e6, "stop_at_peak_charge": STOP, "outputs": 2},
        )

    def expected_time(self) -> float:
        """Return about t*: free streaming, then diffusion, whichever is slower."""
        numbers = self.case().numbers
        coefficients = transport_coefficients(numbers, closures.derived(1.0), 1)
        diffusive = math.log(2.0) / exact.gradient_decay_rate(coefficients, K)
        return math.hypot(free_streaming_time(), diffusive)


def free_streaming_time() -> float:
    """Return t* of particles that never collide."""
    return math.sqrt(math.log(1.0 / STOP) / 2.0) / math.pi


@dataclass(frozen=True)
class Estimate:
    """Profile of a moment at t*, on the points `X`.

    Attributes
    ----------
    values, errors : numpy.ndarray
        Means over the ensembles and their standard errors.
    """

    values: Reals
    errors: Reals

    @property
    def noise(self) -> float:
        """L2 norm of the errors over that of the values."""
        return float(np.linalg.norm(self.errors) / np.linalg.norm(self.values))


@dataclass(frozen=True)
class Reference:
    """What the particles of a setting do.

    Attributes
    ----------
    setting : Setting
        What was simulated.
    seed, particles : int
        Of the run.
    time, time_error : float
        t* and its standard error.
    moments : dict of str to Estimate
        At t*, by the names of `MODES`.
    times, peak, peak_error : numpy.ndarray
        Largest |Q| over time.
    left_out : float
        Root mean square of all left-out modes in standard errors; 1.07 is expected of 16 ensembles.
    seconds : float
        CPU time that it took.
    """

    setting: Setting
    seed: int
    particles: int
    time: float
    time_error: float
    moments: dict[str, Estimate]
    times: Reals
    peak: Reals
    peak_error: Reals
    left_out: float
    seconds: float


def simulate(setting: Setting, seed: int, effort: float = 1.0, finer: int = 1) -> Reference:
    """Simulate a relaxation until a little after t*.

    Parameters
    ----------
    setting : Setting
        What to simulate.
    seed : int
        Of everything random; the setting's own numbers are mixed in.
    effort : float
        Fraction of the setting's particles.
    finer : int
        Divides the time step and the width of the collision cells.
    """
    began = process_time()
    expected = setting.expected_time()
    groups = 2 if setting.dilute else math.ceil(LEAST_IN_DIAMETER * setting.length_ratio / POINTS)
    fewest = FEWEST_IN_CELL * POINTS * finer * groups
    number = max(round(effort * setting.particles / ENSEMBLES), fewest)
    case = _case(setting, number, expected, finer)
    parameters = Parameters.of(case)
    words = (seed, *(round(1e6 * v) for v in (setting.tau_c, setting.energy_ratio)))
    words += (round(setting.peclet), THERMOSTATS.index(setting.thermostat), finer)
    ensembles: list[Ensemble] = []
    for sequence in np.random.SeedSequence(words).spawn(ENSEMBLES):
        first, second = sequence.spawn(2)
        particles = draw_particles(case, number, np.random.default_rng(first))
        ensembles.append(Ensemble(parameters, particles, second.generate_state(4, np.uint64)))
    step = parameters.time_step
    between = min(expected / SAMPLES, COLLISIONS * setting.tau_c)
    times, spectra = _sampled(ensembles, max(1, round(between / step)), step, expected)
    if max(e.largest_probability for e in ensembles) > 1.0:
        raise RuntimeError("an acceptance probability passed 1")
    found = _Samples(times, spectra, linear=setting.energy_ratio == 0.0)
    time, time_error = found.stop()
    return Reference(
        setting,
        seed,
        number * ENSEMBLES,
        time,
        time_error,
        found.moments(time),
        times,
        *found.peaks(),
        found.left_out(time),
        process_time() - began,
    )


def _case(setting: Setting, number: int, expected: float, finer: int) -> triboflux.Case:
    """Return the case that the particles obey."""
    options = {
        "particles": number,
        "thermostat": setting.thermostat,
        "dilute": setting.dilute,
        "mean_field": setting.energy_ratio > 0.0,
    }
    case = setting.case().model_copy(update={"kinetic": Kinetic(**options)})
    usual = Parameters.of(case)
    cells = usual.cells
    if not setting.dilute:
        wanted = math.ceil(CELLS_IN_DIAMETER * setting.length_ratio / POINTS)
        cells = POINTS * min(wanted, number // (FEWEST_IN_CELL * POINTS * finer))
    options["time_step"] = min(usual.time_step, expected / SAMPLES) / finer
    options["cells"] = cells * finer
    return case.model_copy(update={"kinetic": Kinetic(**options)})


def _sampled(
    ensembles: Sequence[Ensemble], stride: int, step: float, expected: float
) -> tuple[Reals, NDArray[np.complex128]]:
    """Advance all ensembles a window past t*.

    Returns
    -------
    times : numpy.ndarray
        Of the samples.
    spectra : numpy.ndarray
        Shape ``(samples, ensembles, moments, modes)``: Fourier coefficients of the moments.
    """
    # of a field whose means over the cells have the coefficients 1
    sharpened = np.sinc(np.arange(HIGHEST + 1) / POINTS) * POINTS

    def sample(ensemble: Ensemble) -> NDArray[np.complex128]:
        if times:
            ensemble.advance(stride, step)
        moments = moments_of(ensemble)
        profiles = np.stack([moments[name] for name in MODES])
        return np.fft.rfft(profiles)[:, : HIGHEST + 1] / sharpened

    waves = np.sin(2.0 * np.pi * np.outer(MODES["charge"][1], FINE))
    times: list[float] = []
    spectra: list[NDArray[np.complex128]] = []
    last = math.inf
    with ThreadPoolExecutor() as pool:
        while not times or times[-1] < last:
            spectra.append(np.stack(list(pool.map(sample, ensembles))))
            times.append(stride * step * len(times))
            odd = 2.0 * spectra[-1][:, 0, 1::2].mean(axis=0).imag
            if last == math.inf and np.abs(odd @ waves).max() < STOP - MARGIN:
                last = times[-1] * (1.0 + WINDOW)
            if times[-1] > 20.0 * expected:
                raise RuntimeError("the charge does not relax")
    return np.array(times), np.stack(spectra)


class _Samples:
    """Moments of all ensembles over time."""

    def __init__(self, times: Reals, spectra: NDArray[np.complex128], linear: bool) -> None:
        self.times = times
        self.spectra = spectra
        self.modes = {
            name: (kind, np.array(few if linear else all_))
            for name, (kind, all_, few) in MODES.items()
        }

    def amplitudes(self, name: str) -> Reals:
        """Return the kept amplitudes of a moment, shape ``(samples, ensembles, kept modes)``."""
        kind, waves = self.modes[name]
        found = self.spectra[:, :, list(MODES).index(name), waves]
        return np.where(waves > 0, 2.0, 1.0) * (found.real if kind == "cosine" else -found.imag)

    def profile(self, name: str, amplitudes: Reals, x: Reals = X) -> Reals:
        """Return the sum of the kept modes at some places."""
        kind, waves = self.modes[name]
        phases = 2.0 * np.pi * np.outer(waves, x)
        return amplitudes @ (np.cos(phases) if kind == "cosine" else np.sin(phases))

    def parabolas(self, values: Reals, time: float) -> Reals:
        """Return the three coefficients, in time/t* - 1, of a fit around a time t*."""
        near = np.abs(self.times - time) <= WINDOW * time
        powers = np.vander(self.times[near] / time - 1.0, 3, increasing=True)
        flat = values[near].reshape(len(powers), -1)
        return np.linalg.lstsq(powers, flat)[0].reshape(3, *values.shape[1:])

    def peaks(self) -> tuple[Reals, Reals]:
        """Return the largest |Q| of the mean at all times, and its standard error."""
        charge = self.amplitudes("charge")
        mean = np.abs(self.profile("charge", charge.mean(axis=1), FINE)).max(axis=-1)
        left = [
            np.abs(self.profile("charge", np.delete(charge, i, axis=1).mean(axis=1), FINE)).max(-1)
            for i in range(charge.shape[1])
        ]
        return mean, jackknife(left)

    def stop(self) -> tuple[float, float]:
        """Return t* and its standard error."""
        charge = self.amplitudes("charge")
        first = int(np.argmax(self.peaks()[0] < STOP))
        about = float(self.times[first])
        fit = self.parabolas(charge, about)

        def time_of(part: Reals) -> float:
            def excess(time: float) -> float:
                now = (time / about - 1.0) ** np.arange(3) @ part
                return float(np.abs(self.profile("charge", now, FINE)).max()) - STOP

            return brentq(excess, (1.0 - WINDOW) * about, (1.0 + WINDOW) * about, xtol=1e-10)

        left = [time_of(np.delete(fit, i, axis=1).mean(axis=1)) for i in range(fit.shape[1])]
        return time_of(fit.mean(axis=1)), float(jackknife(left))

    def moments(self, time: float) -> dict[str, Estimate]:
        """Return all moments at a time."""
        found: dict[str, Estimate] = {}
        for name in self.modes:
            fit = self.parabolas(self.amplitudes(name), time)[0]
            found[name] = Estimate(*mean_and_error(self.profile(name, fit)))
        return found

    def left_out(self, time: float) -> float:
        """Return the root mean square of what the symmetries forbid, in standard errors."""
        scores: list[Reals] = []
        for place, (kind, waves) in enumerate(self.modes.values()):
            fit = self.parabolas(self.spectra[:, :, place], time)[0]
            kept = np.zeros(HIGHEST + 1, dtype=bool)
            kept[waves] = True
            wanted, other = (fit.real, fit.imag) if kind == "cosine" else (fit.imag, fit.real)
            for part in (wanted[:, ~kept], other):
                mean, error = mean_and_error(part)
                # the mean charge and the imaginary parts of means do not vary
                scores.append(mean[error > 1e-12] / error[error > 1e-12])
        return float(np.sqrt(np.mean(np.concatenate(scores) ** 2)))


def mean_and_error(values: Reals) -> tuple[Reals, Reals]:
    """Return the mean over the first axis, and its standard error."""
    return values.mean(axis=0), values.std(axis=0, ddof=1) / math.sqrt(len(values))


def jackknife(values: Sequence[float] | Sequence[Reals]) -> Reals:
    """Return the standard error of what was found once without each ensemble."""
    return np.std(values, axis=0) * math.sqrt(len(values) - 1.0)
