"""Errors of the transport models against simulated particles, for `benchmarks.kinetic_verdict`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

import triboflux
from benchmarks.kinetic_beyond import COMPLETED, TRANSPORTED, beyond
from benchmarks.kinetic_particles import (
    K,
    Reals,
    Reference,
    Setting,
    X,
    free_streaming_time,
)
from triboflux.case import MODEL_NAMES
from triboflux.closures import PAPERS_EQUATIONS
from triboflux.errors import OutOfRangeError

FIELDS = ("charge", "covariance", "variance")
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
        Those of `FIELDS` that the model knows, on the points, at the particles' t*.
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
    found = {
        name: float(np.linalg.norm(values - reference.moments[name].values))
        / float(np.linalg.norm(reference.moments[name].values))
        for name, values in prediction.moments.items()
    }
    time = None if prediction.time is None else prediction.time / reference.time - 1.0
    return Errors(time, found, prediction.remark)


def predictions(setting: Setting, at: float) -> dict[tuple[str, str], Prediction]:
    """Return what all models with both closure sets say, and what else is known without a field.

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
        for model in MODEL_NAMES
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
    try:
        stopped = triboflux.solve(setting.case(model, closure_set))
    except OutOfRangeError as error:
        return Prediction(None, remark=f"refused: {error}")
    if stopped.status != "ok":
        return Prediction(None, remark=f"{stopped.status}: {stopped.stop_reason}")
    time = float(stopped.dataset["time"][-1])
    there = triboflux.solve(setting.case(model, closure_set, t_end=at, outputs=[at]))
    if there.status != "ok":
        return Prediction(time, remark=f"{there.status}: {there.stop_reason}")
    last = there.dataset.isel(time=-1)
    moments = {"charge": last["charge"].values, "covariance": last["covariance"].values[0]}
    if "variance" in last:
        moments["variance"] = last["variance"].values
    return Prediction(time, moments)


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
