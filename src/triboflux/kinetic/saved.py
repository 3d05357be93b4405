"""The state of a particle simulation as a checkpoint, and back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from triboflux.checkpoint import Checkpoint
from triboflux.errors import InputError
from triboflux.kinetic.cells import COLUMNS
from triboflux.kinetic.ensemble import Ensemble, Parameters

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from triboflux.case import Case

KIND = "kinetic"


@dataclass
class State:
    """Where a simulation stands.

    Attributes
    ----------
    ensembles : list of Ensemble
        The particles.
    initial_totals : numpy.ndarray
        Mean momentum, charge and kinetic energy of each ensemble at time 0.
    initial_peak : float
        Largest charge then.
    interval, step : int
        How many target times are reached, and steps done since.
    time : float
        Scaled by L/√Θ.
    times : list of float
        Of the outputs so far.
    records : list of dict
        What was put out then.
    before, peak : tuple of float
        Time, largest charge and its standard error, at the check before the last and at the last.
    """

    ensembles: list[Ensemble]
    initial_totals: NDArray[np.float64]
    initial_peak: float
    interval: int
    step: int
    time: float
    times: list[float]
    records: list[dict[str, NDArray[np.float64]]]
    before: tuple[float, float, float]
    peak: tuple[float, float, float]


def to_checkpoint(case: Case, versions: dict[str, str], state: State) -> Checkpoint:
    """Return all that a simulation needs to go on.

    Parameters
    ----------
    case : Case
        What is simulated.
    versions : dict of str to str
        Of the packages that decide its digits.
    state : State
        Where it stands; arrays are not copied.
    """
    arrays: dict[str, NDArray[Any]] = {
        "initial_totals": state.initial_totals,
        "times": np.array(state.times),
    }
    for name in state.records[0] if state.records else ():
        arrays[f"record {name}"] = np.stack([record[name] for record in state.records])
    for number, e in enumerate(state.ensembles):
        arrays[f"particles {number}"], arrays[f"generator {number}"] = e.particles, e.generator
    counts = [[e.collisions, e.steps, e.largest_probability] for e in state.ensembles]
    plain = ("initial_peak", "interval", "step", "time", "before", "peak")
    metadata = {name: getattr(state, name) for name in plain} | {"counts": counts}
    return Checkpoint(KIND, case.to_toml(), versions, arrays, metadata)


def from_checkpoint(saved: Checkpoint, parameters: Parameters, shape: tuple[int, int]) -> State:
    """Return the state that `to_checkpoint` was given.

    Parameters
    ----------
    saved : Checkpoint
        Whole, and of the same case.
    parameters : Parameters
        Of that case.
    shape : tuple of int
        Numbers of ensembles and of particles in each.

    Raises
    ------
    InputError
        If something is missing or misshapen.
    """
    arrays, meta = saved.arrays, saved.metadata
    try:
        ensembles: list[Ensemble] = []
        for number in range(shape[0]):
            particles, words = arrays[f"particles {number}"], arrays[f"generator {number}"]
            if particles.shape != (shape[1], COLUMNS) or words.shape != (4,):
                raise ValueError(number)
            ensemble = Ensemble(parameters, particles, words)
            ensemble.collisions, ensemble.steps, largest = meta["counts"][number]
            ensemble.largest_probability = float(largest)
            ensembles.append(ensemble)
        stacks = {n[7:]: values for n, values in arrays.items() if n.startswith("record ")}
        times = [float(time) for time in arrays["times"]]
        records = [{n: v[i] for n, v in stacks.items()} for i in range(len(times))]
        return State(
            ensembles,
            arrays["initial_totals"],
            float(meta["initial_peak"]),
            int(meta["interval"]),
            int(meta["step"]),
            float(meta["time"]),
            times,
            records,
            _three(meta["before"]),
            _three(meta["peak"]),
        )
    except (LookupError, TypeError, ValueError) as error:
        raise InputError("the checkpoint does not hold a whole particle simulation.") from error


def _three(values: Any) -> tuple[float, float, float]:
    time, peak, error = map(float, values)
    return time, peak, error
