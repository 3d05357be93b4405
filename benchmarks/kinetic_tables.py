"""The tables of docs/verdict.md about models, for `benchmarks.kinetic_verdict`."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np

import triboflux
from benchmarks.kinetic_beyond import COMPLETED, TRANSPORTED
from benchmarks.kinetic_models import FIELDS, STREAMING, Errors, Prediction, errors_of
from benchmarks.kinetic_particles import Estimate, Reference, Setting
from benchmarks.kinetic_runs import CASE_B, FEWER, FIELD, FINER, GROUPS, SEEDS, Runs, label
from benchmarks.timing import table
from triboflux.closures import PAPERS_EQUATIONS

Predictions = Mapping[Setting, Mapping[tuple[str, str], Prediction]]

MOST = 1000
"""Percent above which an error is only called larger."""
SUMMARY = (
    ("full", "derived"),
    ("full", "published"),
    ("gradient", "derived"),
    ("gradient", "published"),
    (TRANSPORTED, "derived"),
    (COMPLETED, "derived"),
    (STREAMING, ""),
)
"""Columns of the first table. Without a field all algebraic closures of C give the same t*."""


class Remarks:
    """Numbered remarks below a table."""

    def __init__(self) -> None:
        self.known: list[str] = []

    def mark(self, remark: str) -> str:
        """Return the number of a remark in brackets, nothing for none."""
        if not remark:
            return ""
        if remark not in self.known:
            self.known.append(remark)
        return f"[{self.known.index(remark) + 1}]"

    def legend(self) -> str:
        """Return all remarks as lines after the table."""
        told = "; ".join(f"[{i}] {remark}" for i, remark in enumerate(self.known, start=1))
        return f"\n\n{told}." if told else ""


def percent(value: float, signed: bool = False) -> str:
    """Return a fraction in percent with two digits, as far as they mean something."""
    shown = 100.0 * value
    if abs(shown) > MOST:
        return f"> {MOST}"
    plus = "+" if signed else ""
    return f"{shown:{plus}.0f}" if abs(shown) >= 9.95 else f"{shown:{plus}.2g}"


def first_runs(runs: Runs, settings: Iterable[Setting]) -> list[Reference]:
    """Return what was simulated of some settings with the first seed."""
    return [runs[s, SEEDS[0], 1] for s in settings if (s, SEEDS[0], 1) in runs]


def summary(runs: Runs, predictions: Predictions) -> str:
    """Return the table of the errors of t* without a field."""
    remarks = Remarks()
    head = ["exchange", "τ_c", "t* of the particles"]
    head += [f"{model}, `{name}`" if name else model for model, name in SUMMARY]
    rows: list[list[str]] = []
    for group, settings in GROUPS.items():
        for reference in first_runs(runs, settings):
            row = [group, f"{reference.setting.tau_c:g}", time_of(reference)]
            for key in SUMMARY:
                found = errors_of(predictions[reference.setting][key], reference)
                row.append(time_error(found, remarks))
            rows.append(row)
    return table(head, rows) + remarks.legend()


def time_of(reference: Reference) -> str:
    """Return t* with its standard error."""
    return with_error(reference.time, reference.time_error)


def with_error(time: float, error: float) -> str:
    """Return a time with as many digits as its standard error allows, and that."""
    digits = 1 - math.floor(math.log10(error))
    return f"{time:.{digits}f} ± {percent(error / time)} %"


def time_error(errors: Errors, remarks: Remarks) -> str:
    """Return a cell with the error of t*."""
    shown = "–" if errors.time is None else percent(errors.time, signed=True)
    return shown + (" " + remarks.mark(errors.remark) if errors.remark else "")


def error_table(runs: Runs, predictions: Predictions, settings: Iterable[Setting]) -> str:
    """Return the errors of all models in some settings."""
    remarks = Remarks()
    names = ("t*", "Q", "C", "V")
    head = ["τ_c", "what", *(f"{n}, `{name}`" for name in PAPERS_EQUATIONS for n in names)]
    rows: list[list[str]] = []
    for reference in first_runs(runs, settings):
        noise = [reference.time_error / reference.time]
        noise += [reference.moments[name].noise for name in FIELDS]
        bars = [f"± {percent(value)}" for value in noise]
        rows.append(
            [f"**{reference.setting.tau_c:g}**", "error bar of the particles", *bars, *bars]
        )
        known = predictions[reference.setting]
        for model in dict.fromkeys(model for model, _ in known):
            row = ["", model]
            for name in PAPERS_EQUATIONS:
                found = known.get((model, name), known.get((model, "")))
                if found is None or ((model, "") in known and name != PAPERS_EQUATIONS[0]):
                    row += [""] * len(names)
                    continue
                errors = errors_of(found, reference)
                row.append(time_error(errors, remarks))
                row += [
                    percent(errors.moments[moment]) if moment in errors.moments else "–"
                    for moment in FIELDS
                ]
            rows.append(row)
    return table(head, rows) + remarks.legend()


def particle_table(runs: Runs) -> str:
    """Return what was simulated, with error bars, and how the second seed compares."""
    head = [
        "exchange",
        "τ_c",
        "Pe",
        "L/d",
        "γΘ^(a/2)",
        "α g0",
        "u",
        "thermostat",
        "particles",
        "t*",
    ]
    head += ["Q", "C", "V", "left out", "second seed"]
    rows: list[list[str]] = []
    kinds = {s: group for group, settings in GROUPS.items() for s in settings}
    scores: list[float] = []
    for key, reference in runs.items():
        s = reference.setting
        if key[1:] != (SEEDS[0], 1) or s in FEWER:
            continue
        other = runs.get((s, SEEDS[1], 1))
        score = "–"
        if other is not None:
            z = (other.time - reference.time) / math.hypot(other.time_error, reference.time_error)
            scores.append(z)
            score = f"{z:+.1f}"
        packing = math.sqrt(math.pi) / (24.0 * s.length_ratio * s.tau_c)
        rows.append(
            [
                kinds.get(s, "weak"),
                f"{s.tau_c:g}",
                f"{s.peclet:g}",
                f"{s.length_ratio:g}",
                f"{s.transferred_fraction:.2g}",
                f"{packing:.2g}",
                f"{s.energy_ratio:g}",
                s.thermostat if s.energy_ratio > 0.0 else "–",
                f"{reference.particles:,}",
                time_of(reference),
                *(f"± {percent(reference.moments[name].noise)} %" for name in FIELDS),
                f"{reference.left_out:.2f}",
                score,
            ]
        )
    text = table(head, rows)
    if scores:
        square = sum(z * z for z in scores)
        text += (
            f"\n\n*Second seed*: how many standard errors t* is above that of the first; "
            f"χ² = {square:.1f} for {len(scores)} repetitions."
        )
    return text


def systematics(runs: Runs) -> str:
    """Return what half the time step with half the cells changes, and fewer particles."""
    head = ["relaxation", "changed", "t*, %", "C, %", "V, %"]
    halved = "time step and cells halved"
    pairs = [(halved, (s, SEEDS[0], 1), (s, SEEDS[0], 2)) for s in FINER]
    for usual, fewer in zip(CASE_B, FEWER, strict=True):
        pairs.append((f"{fewer.particles:,} particles", (usual, SEEDS[0], 1), (fewer, SEEDS[0], 1)))
    rows: list[list[str]] = []
    for what, before, after in pairs:
        if before not in runs or after not in runs:
            continue
        usual, changed = runs[before], runs[after]
        error = math.hypot(changed.time_error, usual.time_error) / usual.time
        row = [label(before[0]), what]
        row.append(f"{percent(changed.time / usual.time - 1.0, signed=True)} ± {percent(error)}")
        # without a field the amplitude of Q at t* is one half in all
        for name in ("covariance", "variance"):
            a, b = usual.moments[name], changed.moments[name]
            apart = float(np.linalg.norm(b.values - a.values) / np.linalg.norm(a.values))
            row.append(f"{percent(apart)} (noise {percent(math.hypot(a.noise, b.noise))})")
        rows.append(row)
    return table(head, rows)


def heating(runs: Runs) -> str:
    """Return how much the weak field heats until t*."""
    head = ["τ_c", "mean of Θ at t*", "largest Θ", "largest R_xx"]
    rows: list[list[str]] = []
    for reference in first_runs(runs, FIELD):
        temperature = reference.moments["granular_temperature"]
        rows.append(
            [
                f"{reference.setting.tau_c:g}",
                f"{temperature.values.mean():.4f}",
                largest(temperature),
                largest(reference.moments["granular_temperature_xx"]),
            ]
        )
    return table(head, rows)


def largest(estimate: Estimate, sign: float = 1.0) -> str:
    """Return the largest value over the box (the smallest for the sign -1) with its error."""
    place = int(np.argmax(sign * estimate.values))
    return f"{estimate.values[place]:.4f} ± {estimate.errors[place]:.4f}"


def realizability(runs: Runs, predictions: Predictions) -> str:
    """Return how far the models break C² ≤ V in case B, and what the particles do."""
    reference = runs[CASE_B[0], SEEDS[0], 1]
    remarks = Remarks()
    head = ["model", "closures", "t*, %", "Q, %", "C, %", "V, %"]
    head += ["largest C² - V", "of the box", "broken from t ="]
    rows: list[list[str]] = []
    for (model, name), found in predictions[CASE_B[0]].items():
        errors = errors_of(found, reference)
        row = [model, f"`{name}`", time_error(errors, remarks)]
        row += [percent(errors.moments[m]) if m in errors.moments else "–" for m in FIELDS]
        if "variance" in found.moments:
            excess = found.moments["covariance"] ** 2 - found.moments["variance"]
            broken = f"{first_breach(model, name, reference.time):.3g}" if excess.max() > 0 else "–"
            row += [f"{excess.max():.3f}", f"{np.mean(excess > 0.0):.0%}", broken]
        else:
            row += ["–"] * 3
        rows.append(row)
    return table(head, rows) + remarks.legend()


def first_breach(model: str, closure_set: str, until: float) -> float:
    """Return the first time at which a model's C² exceeds its V."""
    times = np.linspace(0.0, until, 401)[1:]
    case = CASE_B[0].case(model, closure_set, t_end=until, outputs=times.tolist())
    margin = triboflux.solve(case).dataset["realizability_margin"].min("x")
    return float(times[int(np.argmax(margin.values < -1e-9))])


def thermostats(runs: Runs) -> str:
    """Return what the particles of case B do with each thermostat."""
    head = ["thermostat", "t*", "mean Θ", "largest C", "largest V", "largest R_xx"]
    head += ["largest C² - V", "smallest V - C²/R_xx"]
    rows: list[list[str]] = []
    for reference in first_runs(runs, CASE_B):
        m = reference.moments
        covariance, variance, r_xx = m["covariance"], m["variance"], m["granular_temperature_xx"]
        error = np.hypot(2.0 * covariance.values * covariance.errors, variance.errors)
        excess = Estimate(covariance.values**2 - variance.values, error)
        margin = Estimate(variance.values - covariance.values**2 / r_xx.values, error)
        rows.append(
            [
                reference.setting.thermostat,
                time_of(reference),
                f"{m['granular_temperature'].values.mean():.3f}",
                largest(covariance),
                largest(variance),
                largest(r_xx),
                largest(excess),
                largest(margin, sign=-1.0),
            ]
        )
    return table(head, rows)
