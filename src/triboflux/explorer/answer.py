"""What the page says in words: the model that suits, coefficients, warnings."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, cast

from triboflux import audit, closures, models
from triboflux.advice import TOLERANCE, Advice
from triboflux.assessment import assess, regime_of
from triboflux.assessment_text import MEANINGS
from triboflux.case import MODEL_NAMES, Case
from triboflux.explorer.live import JUDGED, NOT_JUDGED, REFERENCE, ModelRun
from triboflux.model_errors import OK, ModelError, percent
from triboflux.rates import ClosureRates, scaled_rates, transfer_warnings
from triboflux.scales import Scales
from triboflux.units import format_quantity

if TYPE_CHECKING:
    from collections.abc import Iterable

WITHOUT_COVARIANCE = "collisional"
"""The model whose error says what the correlation of charge and velocity is worth."""

_RATES = {
    "collisional_flux": ("eta", "collisional part of the flux"),
    "gradient_production": ("P", "covariance from the gradient of the charge"),
    "field_production": ("S", "covariance from the electric field"),
    "covariance_destruction": ("R", "destruction of the covariance"),
    "charge_exchange": ("1/tau_xi", "exchange of charge in collisions"),
    "variance_destruction": ("F", "destruction of the variance; it must be positive"),
    "variance_field_production": ("B", "variance from the electric field"),
    "transferred_fraction": (
        "gamma Theta^(a/2)",
        "mean fraction of the charge difference passed over",
    ),
}
"""Symbol and meaning of the scaled coefficients that are shown."""


def model_words() -> dict[str, str]:
    """Return what each model is, in the words of the function that builds it."""
    told: dict[str, str] = {}
    builders = cast("Mapping[str, object]", models.REGISTRY)  # pyright: ignore[reportUnknownMemberType] -- of JAX types
    for name in MODEL_NAMES:
        first = (inspect.getdoc(builders[name]) or "").partition("\n")[0]
        told[name] = first.removeprefix("Return the ").rstrip(".")
    return told


def closure_words() -> dict[str, str]:
    """Return what each closure set is, in the words of the function that makes it."""
    told: dict[str, str] = {}
    for name in closures.NAMES:
        first = (inspect.getdoc(getattr(closures, name)) or "").partition("\n")[0]
        told[name] = first.removeprefix("Return ").rstrip(".")
    return told


def at_once(case: Case) -> dict[str, Any]:
    """Return all that is known of a case without running it.

    Parameters
    ----------
    case : Case
        With or without a suspension.

    Returns
    -------
    dict
        ``advice`` (of the table, or None), ``coefficients``, ``numbers``, ``regime``, ``warnings``
        and ``closures``, as texts.

    Raises
    ------
    InputError
        If a number leaves the range of `Numbers`.
    """
    closure_set = closures.by_name(case.closures, case.numbers.restitution, case.exponent)
    rates = scaled_rates(closure_set, case.numbers)
    numbers = case.numbers.model_dump()
    told: dict[str, Any] = {
        "numbers": [
            [definition, f"{numbers[name]:.6g}", equation]
            for name, (definition, equation) in MEANINGS.items()
        ],
        "closures": _closure_rows(case),
        "advice": None,
    }
    if case.suspension is None:
        warnings = transfer_warnings(float(rates.transferred_fraction), case.exponent, True)
        return told | {
            "regime": regime_of(case.numbers.peclet, rates)[1],
            "coefficients": _scaled_rows(rates),
            "warnings": list(warnings),
        }
    found = assess(case.suspension, case.closures)
    advice = Advice(found.model, found.reasons[1:], found.errors, found.origin)
    return told | {
        "regime": found.reasons[0],
        "coefficients": [
            [q.symbol, q.meaning, format_quantity(q.value, q.unit), q.equation]
            for q in found.coefficients
        ],
        "warnings": list(found.warnings),
        "advice": advice_words(advice, case, {}),
    }


def _scaled_rows(rates: ClosureRates) -> list[list[str]]:
    """Return scaled coefficients as rows of a table."""
    return [
        [symbol, meaning, f"{float(getattr(rates, name)):.6g}", ""]
        for name, (symbol, meaning) in _RATES.items()
    ]


def _closure_rows(case: Case) -> list[list[str]]:
    """Return the exact closure coefficients beside the printed ones as rows of a table."""
    return [
        [
            row.symbol,
            row.name.replace("_", " "),
            f"{row.exact:.6g}",
            "" if row.printed is None else f"{row.printed:.6g}",
            row.verdict,
        ]
        for row in audit.audit(case.numbers.restitution, case.exponent)
    ]


def advice_words(advice: Advice, case: Case, found: Mapping[str, ModelRun]) -> dict[str, Any]:
    """Return the answer that leads the page.

    Parameters
    ----------
    advice : Advice
        From the table or from runs.
    case : Case
        What it is about.
    found : mapping of str to ModelRun
        The runs, by model; empty for the table's.

    Returns
    -------
    dict
        ``model``, ``headline``, ``correlations``, ``when``, ``reasons``, ``origin`` and ``rows``,
        one for each model: name, error as text and number, and whether it suits.
    """
    errors = {error.model: error for error in advice.errors}
    headlines = {
        "none": "No model holds for this case.",
        "full": "The full model is needed."
        if advice.errors
        else "The full model is on the safe side.",
        NOT_JUDGED: "Only the drawn models were run.",
    }
    headline = headlines.get(advice.model, f"The {advice.model} model suits this case.")
    return {
        "model": advice.model,
        "headline": headline,
        "correlations": _correlations(errors.get(WITHOUT_COVARIANCE)),
        "when": _when(case, found.get(REFERENCE)),
        "reasons": list(advice.reasons),
        "origin": advice.origin,
        "tolerance": TOLERANCE,
        "rows": [_row(name, errors.get(name), found.get(name)) for name in MODEL_NAMES],
    }


def _correlations(error: ModelError | None) -> str:
    """Return whether the correlation of charge and velocity matters."""
    if error is None or error.error is None:
        return ""
    left_out = f"without them the mean charge is wrong by {_percent(error.error)}"
    if error.low is not None and error.low > TOLERANCE:
        return f"Correlations of charge and velocity matter here: {left_out}."
    if error.high is not None and error.high <= TOLERANCE:
        return f"Correlations of charge and velocity hardly matter here: {left_out}."
    return f"Correlations of charge and velocity may matter here: {left_out}."


def _when(case: Case, run: ModelRun | None) -> str:
    """Return when the full model's run ends, scaled and, with a suspension, in seconds."""
    if run is None or run.shown is None:
        return ""
    told = f"t* = {stop_text(case, float(run.shown.dataset['time'].values[-1]))}"
    ended = run.reason if run.status == OK else f"{run.status}, {run.reason}"
    return f"The full model ends at {told}: {ended}."


def _percent(error: float | None) -> str:
    """Return an error in percent, as text, without a power of ten where it is more than all."""
    return percent(error) if error is None or error < 1.0 else f"{100.0 * error:.0f} %"


def stop_text(case: Case, time: float) -> str:
    """Return a scaled time as text, with a suspension also in seconds."""
    if case.suspension is None:
        return f"{time:.4g}"
    return f"{time:.4g} = {format_quantity(time * Scales.of(case.suspension).time, 's')}"


def _row(name: str, error: ModelError | None, run: ModelRun | None) -> dict[str, Any]:
    """Return the row of a model in the table of the answer."""
    if name == REFERENCE:
        return {"model": name, "text": "reference", "error": 0.0, "suits": True}
    if name not in JUDGED:
        return {"model": name, "text": "beyond the reference", "error": None, "suits": False}
    told = run if error is None else error
    value = None if told is None else told.error
    if value is None:
        status = "" if told is None else told.status
        return {"model": name, "text": status, "error": None, "suits": False}
    high = value if error is None or error.high is None else error.high
    text = _percent(value)
    if error is not None and error.low != error.high:
        text += f" ({_percent(error.low)} to {_percent(error.high)})"
    return {"model": name, "text": text, "error": value, "suits": high <= TOLERANCE}


def run_warnings(runs: Iterable[ModelRun]) -> list[str]:
    """Return what the runs warn of, each sentence once, with the models that it is about."""
    told: dict[str, list[str]] = {}
    for run in runs:
        for sentence in run.warnings:
            told.setdefault(sentence, []).append(run.model)
        if run.status != OK:
            told.setdefault(f"{run.status}: {run.reason}", []).append(run.model)
    return [f"{', '.join(names)}: {sentence}" for sentence, names in told.items()]
