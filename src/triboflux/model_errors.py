"""The errors of the reduced models for one wave of charge, measured by running all models."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from triboflux import closures
from triboflux.errors import InputError
from triboflux.rates import scaled_rates

# what runs models is imported where it is needed, so that reading a table is quick
if TYPE_CHECKING:
    from triboflux.case import Case
    from triboflux.numbers import Numbers

CHEAPEST_FIRST = ("collisional", "gradient", "algebraic", "semi-algebraic")
"""The reduced models, by what a run costs."""

OK = "ok"
"""Status of a model that has an error."""

FLOOR = 1e-4
"""Smaller errors are not told apart; the table holds none."""
POINTS = 64
"""Points of the box; `benchmarks.suitability_table` measures what twice as many would change."""

# of the longest wave in the box, -sin(2 pi x/L)
WAVE_NUMBER = 2.0 * math.pi
_HALF = 0.5
# The full model halves the charge within a few relaxation times of the gradient model, and where
# particles cross the wave between collisions, within a few such crossings and collisions.
_RELAXATIONS, _CROSSINGS = 30.0, 3.0


@dataclass(frozen=True)
class ModelError:
    """What is known of the error of a reduced model.

    Attributes
    ----------
    model : str
        Its name.
    status : str
        ``"ok"``, or why there is no error.
    error : float or None
        As `triboflux.suitability.MEASURE` defines it.
    low, high : float or None
        Where the true error lies in about nine of ten suspensions; the error itself if computed.
    """

    model: str
    status: str
    error: float | None = None
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class ModelErrors:
    """The errors of the reduced models in one case.

    Attributes
    ----------
    status : str
        ``"ok"``, or why there is nothing to judge: that of a point of the chart.
    reason : str
        The same in a sentence, without its full stop; empty if the status is ok.
    models : tuple of ModelError
        One for each of `CHEAPEST_FIRST`; empty unless the status is ok.
    stop_time : float or None
        When the full model's largest charge has halved, scaled by L/√Θ, if that was computed.
    """

    status: str
    reason: str = ""
    models: tuple[ModelError, ...] = ()
    stop_time: float | None = None


def outside(numbers: Numbers, closure_name: str) -> ModelErrors | None:
    """Return why a case is outside the range in which models are judged, None if it is inside.

    Parameters
    ----------
    numbers : Numbers
        Of the case.
    closure_name : str
        One of `triboflux.closures.NAMES`.

    Raises
    ------
    InputError
        If the closure set is unknown.
    """
    rates = scaled_rates(closures.by_name(closure_name, numbers.restitution), numbers)
    destruction = float(rates.variance_destruction)
    # without exchange of charge F vanishes, and so does what would regain variance
    if destruction > 0.0 or (destruction == 0.0 and rates.transferred_fraction == 0.0):
        return None
    from triboflux.suitability import OUTSIDE

    growth = f"F = {destruction:.3g}, so the charge variance would grow by itself"
    return ModelErrors(OUTSIDE, growth)


def measure(
    numbers: Numbers, closure_name: str = "derived", *, points: int = POINTS
) -> ModelErrors:
    """Run every model for a wave of charge -Q0 sin(2πx/L) and return the errors.

    The full model runs until its largest charge has halved, the others to the same time.

    Parameters
    ----------
    numbers : Numbers
        Of the case.
    closure_name : str
        One of `triboflux.closures.NAMES`.
    points : int
        Of the box, in one dimension.

    Raises
    ------
    InputError
        If the closure set is unknown.
    """
    from triboflux.case import Case
    from triboflux.comparison import relative_errors
    from triboflux.solve import solve  # imports JAX
    from triboflux.suitability import NOT_HALVED

    refused = outside(numbers, closure_name)
    if refused is not None:
        return refused
    rates = scaled_rates(closures.by_name(closure_name, numbers.restitution), numbers)
    square = WAVE_NUMBER**2
    source = square * rates.gradient_production + rates.field_production
    decay = square / numbers.peclet + 1.0 / numbers.tau_sigma
    decay += (1.0 + rates.collisional_flux) * source / rates.covariance_destruction
    t_end = _RELAXATIONS / decay
    t_end += _CROSSINGS * (1.0 + WAVE_NUMBER / rates.covariance_destruction)

    def case(model: str, **run: float) -> Case:
        tables: dict[str, Any] = {
            "numbers": numbers,
            "grid": {"points": [points]},
            "initial": {"charge": [{"mode": [1], "sine": -1.0}]},
            "run": {"outputs": 1} | run,
        }
        return Case(model=model, closures=closure_name, **tables)

    try:
        full = solve(case("full", t_end=t_end, stop_at_peak_charge=_HALF))
    except InputError as error:
        return ModelErrors("refused", str(error).removesuffix("."))
    if full.status != OK:
        return ModelErrors(full.status, f"the full model: {full.stop_reason}")
    time = float(full.dataset["time"][-1])
    if time >= t_end:
        return ModelErrors(NOT_HALVED, f"the largest charge has not halved by t = {t_end:.3g}")
    charge = full.dataset["charge"].values[-1]
    found: list[ModelError] = []
    for model in CHEAPEST_FIRST:
        try:
            reduced = solve(case(model, t_end=time))
        except InputError:
            found.append(ModelError(model, "refused"))
            continue
        if reduced.status != OK:
            found.append(ModelError(model, reduced.status))
            continue
        error = relative_errors(reduced.dataset["charge"].values[-1], charge).rms
        found.append(ModelError(model, OK, error, error, error))
    return ModelErrors(OK, models=tuple(found), stop_time=time)


def percent(error: float | None) -> str:
    """Return an error in percent, as text.

    Parameters
    ----------
    error : float or None
        At most `FLOOR` is not told apart; None gives an empty text.
    """
    if error is None:
        return ""
    return f"{100.0 * error:.2g} %" if error > FLOOR else f"< {100.0 * FLOOR:.2g} %"
