"""Errors of the transport models against simulated particles, for `benchmarks.kinetic_verdict`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

import triboflux
from benchmarks.kinetic_beyond import COMPLETED, TRANSPORTED, beyond
from benchmarks.kinetic_particles import (
    MODES,
    STOP,
    K,
    Reals,
    Reference,
    Setting,
    X,
    free_streaming_time,
)
from triboflux.case import MODEL_NAMES
from triboflux.closures import PAPERS_EQUATIONS
from triboflux.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

PAPERS_MODELS = MODEL_NAMES[MODEL_NAMES.index("full") :]
"""Those of the paper; `benchmarks.kinetic_third_order` and `kinetic_fields` have the others."""
FIELDS = ("charge", "covariance", "variance")
_OUTPUTS = 3
"""Always as many, if there are not more, because another number is another compiled program."""
STREAMING = "free streaming, exact"
"""What particles do that never collide; no model."""


@dataclass(frozen=True)
class Prediction:
    """What a model says about a relaxation.

    Attributes
    ----------
    time : float or None
        t*; None if there is none.
    moments : mapping of str to numpy.ndarray
        Those of `MODES` that the model knows, on the points, at the particles' t*.
    remark : str
        Why something is missing.
    """

    time: float | None
    moments: Mapping[str, Reals] = field(default_factory=dict)
    remark: str = ""


@dataclass(frozen=True)
class Errors:
    """How far a prediction is off.

    Attributes
    ----------
    time : float or None
        Relative error of t*, with its sign.
    moments : dict of str to float
        L2 norm of the difference from the particles over that of the particles, at their t*.
    remark : str
        Why something is missing.
    """

    time: float | None
    moments: dict[str, float]
    remark: str = ""


def errors_of(prediction: Prediction, reference: Reference) -> Errors:
    """Return how far a prediction is from the particles."""
    moments = {name: each.values for name, each in reference.moments.items()}
    return errors_beside(prediction, reference.time, moments)


def errors_beside(prediction: Prediction, time: float, moments: Mapping[str, Reals]) -> Errors:
    """Return how far a prediction is from what particles have at their t*."""
    found = {
        name: float(np.linalg.norm(values - moments[name]) / np.linalg.norm(moments[name]))
        for name, values in prediction.moments.items()
    }
    late = None if prediction.time is None else prediction.time / time - 1.0
    return Errors(late, found, prediction.remark)


def predictions(setting: Setting, at: float) -> dict[tuple[str, str], Prediction]:
    """Return what the paper's models with both sets say, and what else is known without a field.

    Parameters
    ----------
    setting : Setting
        The relaxation.
    at : float
        The particles' t*.

    Returns
    -------
    dict
        By model and closure set; `STREAMING` has none.
    """
    found = {
        (model, name): predict(setting, model, name, at)
        for model in PAPERS_MODELS
        for name in PAPERS_EQUATIONS
    }
    if setting.energy_ratio == 0.0:
        for name in PAPERS_EQUATIONS:
            found[TRANSPORTED, name] = Prediction(*beyond(setting, name, False).at(at))
        found[COMPLETED, "derived"] = Prediction(*beyond(setting, "derived", True).at(at))
        found[STREAMING, ""] = free_streaming(at)
    return found


def predict(setting: Setting, model: str, closure_set: str, at: float) -> Prediction:
    """Return what a model with a closure set says."""
    return predict_at(setting, model, closure_set, [at])[0]


def predict_at(
    setting: Setting, model: str, closure_set: str, times: Sequence[float]
) -> list[Prediction]:
    """Return what a model with a closure set says at several t* of particles."""
    stopping = {"t_end": 1e6, "stop_at_peak_charge": STOP, "outputs": _OUTPUTS}
    try:
        stopped = triboflux.solve(setting.case(model, closure_set, **stopping))
    except InputError as error:
        return [Prediction(None, remark=f"refused: {error}")] * len(times)
    if stopped.status != "ok":
        ended = Prediction(None, remark=f"{stopped.status}: {stopped.stop_reason}")
        return [ended] * len(times)
    time = float(stopped.dataset["time"][-1])
    outputs = sorted(set(times))
    outputs = [*np.linspace(0.0, outputs[0], _OUTPUTS + 1 - len(outputs))[:-1], *outputs]
    run = triboflux.solve(setting.case(model, closure_set, t_end=outputs[-1], outputs=outputs))
    reached = run.dataset["time"].values
    missing = f"{run.status}: {run.stop_reason}"
    return [
        Prediction(time, _moments(run.dataset.isel(time=int(np.argmax(reached == at)))))
        if at in reached
        else Prediction(time, remark=missing)
        for at in times
    ]


def _moments(state: xr.Dataset) -> dict[str, Reals]:
    """Return the moments in one output of a model that particles have, too."""
    return {name: state[name].values.reshape(-1) for name in MODES if name in state}


def free_streaming(at: float) -> Prediction:
    """Return what particles do that never collide."""
    smeared = math.exp(-0.5 * K**2 * at**2)
    moments = {
        "charge": -smeared * np.sin(K * X),
        "covariance": K * at * smeared * np.cos(K * X),
        "variance": 0.5 * (1.0 - smeared**4 * np.cos(2.0 * K * X)) - (smeared * np.sin(K * X)) ** 2,
    }
    return Prediction(free_streaming_time(), moments)


def excess(prediction: Prediction) -> float:
    """Return the largest C² - V of a prediction, positive where no charges have such moments."""
    moments = prediction.moments
    return float(np.max(moments["covariance"] ** 2 - moments["variance"]))
