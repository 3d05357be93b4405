"""All models beside simulated particles with a field, like with like.

Run from the root of the repository; nothing is written without ``--write``::

    python -m benchmarks.kinetic_fields            # prints the tables, in a minute
    python -m benchmarks.kinetic_fields --write    # fills a section of docs/verdict.md

The particles come from the file of `benchmarks.kinetic_field_runs`, the models from the package's
list of them: a further one has its column without a change here.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence

from benchmarks.kinetic_field_runs import Kept, load
from benchmarks.kinetic_models import FIELDS, Errors, errors_beside, predict_at
from benchmarks.kinetic_runs import SEEDS
from benchmarks.kinetic_tables import Remarks, percent, with_error
from benchmarks.kinetic_verdict import PAGE
from benchmarks.timing import print_or_write, table
from triboflux.case_kinetic import THERMOSTATS
from triboflux.hierarchy import MODELS
from triboflux.terminal import use_compilation_cache

SECTION = "fields"
CLOSURES = "derived"
GOOD = 0.05
"""Error that a model may have to be called good."""
WEAK = 1.0
"""u up to which a field heats by less than half a per cent, so that free particles suit all."""

Judged = Mapping[tuple[str, Kept], Errors]
"""Errors by model and relaxation."""


def like(model: str) -> str:
    """Return the thermostat of particles that a model has the assumptions of."""
    evolved = MODELS[model].evolves
    if "mean_velocity" in evolved:
        return "none"
    return "mean-velocity" if any("temperature" in name for name in evolved) else "full"


def is_like(model: str, kept: Kept) -> bool:
    """Return whether particles obey the assumptions of a model."""
    wanted = "none" if kept.setting.energy_ratio <= WEAK else like(model)
    return kept.setting.thermostat == wanted


def judge(relaxations: Sequence[Kept], models: Sequence[str] = tuple(MODELS)) -> Judged:
    """Return the errors of models; a run serves the particles of all thermostats."""
    found: dict[tuple[str, Kept], Errors] = {}
    for group in _by_numbers(relaxations):
        for model in models:
            times = [kept.time for kept in group]
            told = predict_at(group[0].setting, model, CLOSURES, times)
            for kept, prediction in zip(group, told, strict=True):
                found[model, kept] = errors_beside(prediction, kept.time, kept.moments)
    return found


def _by_numbers(relaxations: Sequence[Kept]) -> list[list[Kept]]:
    """Return relaxations in groups that differ in their thermostats only."""
    groups: dict[tuple[float, float], list[Kept]] = {}
    for kept in relaxations:
        key = kept.setting.energy_ratio, kept.setting.tau_c
        groups.setdefault(key, []).append(kept)
    order = THERMOSTATS.index
    return [
        sorted(groups[key], key=lambda kept: order(kept.setting.thermostat))
        for key in sorted(groups)
    ]


def error_table(relaxations: Sequence[Kept], errors: Judged, models: Sequence[str]) -> str:
    """Return the errors for one energy ratio: t* · Q · C · V, bold where like meets like."""
    remarks = Remarks()
    head = ["τ_c", "thermostat", "t* of the particles", "mean Θ", "error bars", *models]
    rows: list[list[str]] = []
    for group in _by_numbers(relaxations):
        for kept in group:
            bars = [kept.time_error / kept.time, *(kept.noise[name] for name in FIELDS)]
            rows.append(
                [
                    f"**{kept.setting.tau_c:g}**" if kept is group[0] else "",
                    kept.setting.thermostat,
                    with_error(kept.time, kept.time_error),
                    f"{kept.amplitudes['granular_temperature'][0]:.3f}",
                    "± " + " · ".join(map(percent, bars)),
                ]
            )
            for model in models:
                cell = _cell(errors[model, kept], remarks)
                rows[-1].append(f"**{cell}**" if is_like(model, kept) else cell)
    return table(head, rows) + remarks.legend()


_LETTERS = {"granular_temperature": "Θ", "granular_temperature_xx": "R_xx"}


def _cell(errors: Errors, remarks: Remarks) -> str:
    """Return the errors of one model, or how it failed."""
    told = f" {remarks.mark(errors.remark)}" if errors.remark else ""
    if errors.time is None:
        return errors.remark.partition(":")[0] + told
    parts = [percent(errors.time, signed=True)]
    parts += [percent(errors.moments[m]) if m in errors.moments else "–" for m in FIELDS]
    # of models that know the temperature
    others = {m: value for m, value in errors.moments.items() if m not in FIELDS}
    parts += [f"{_LETTERS.get(m, m)} {percent(value)}" for m, value in others.items()]
    return " · ".join(parts) + told


def reach_table(relaxations: Sequence[Kept], errors: Judged, models: Sequence[str]) -> str:
    """Return up to which τ_c of those tried each model is good against its own kind."""
    ratios = sorted({kept.setting.energy_ratio for kept in relaxations})
    rows: list[list[str]] = []
    for model in models:
        for what, name in (("t*", None), ("Q", "charge")):
            row = [model if name is None else "", what, like(model)]
            for ratio in ratios:
                own = [k for k in relaxations if k.setting.energy_ratio == ratio]
                own = [k for k in own if is_like(model, k)]
                row.append(reach({k: _size(errors[model, k], name) for k in own}))
            rows.append(row)
    head = ["model", "error of", f"thermostat above u = {WEAK:g}", *(f"u = {r:g}" for r in ratios)]
    return table(head, rows)


def _size(errors: Errors, name: str | None) -> float | None:
    """Return the size of an error, of t* without a name; None if there is none."""
    value = errors.time if name is None else errors.moments.get(name)
    return None if value is None else abs(value)


def reach(sizes: Mapping[Kept, float | None]) -> str:
    """Return up to which τ_c errors are good, and where beyond they are so again."""
    good = {kept.setting.tau_c: size is not None and size <= GOOD for kept, size in sizes.items()}
    times = sorted(good)
    first = next((i for i, time in enumerate(times) if not good[time]), len(times))
    told = f"≤ {times[first - 1]:g}" if first else "nowhere"
    again = ", ".join(f"{time:g}" for time in times[first:] if good[time])
    return f"{told}; {again}" if again else told


def section(relaxations: Sequence[Kept], models: Sequence[str] = tuple(MODELS)) -> str:
    """Return the section of the page."""
    errors = judge(relaxations, models)
    minutes = sum(kept.seconds for kept in relaxations) / 60.0
    number = len(relaxations)
    parts = [
        f"Made by `python -m benchmarks.kinetic_fields --write` from {number} relaxations of "
        f"particles, seed {SEEDS[0]}, {minutes:.0f} min of CPU time. Closures `{CLOSURES}`.",
        f"τ_c of those tried up to which a model is within {GOOD:.0%} of particles with its "
        "assumptions, and where beyond it is so again:",
        reach_table(relaxations, errors, models),
    ]
    for ratio in sorted({kept.setting.energy_ratio for kept in relaxations}):
        own = [kept for kept in relaxations if kept.setting.energy_ratio == ratio]
        parts += [f"**u = {ratio:g}**", error_table(own, errors, models)]
    return "\n\n".join(parts)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the section, or write it."""
    parser = argparse.ArgumentParser(description="All models beside particles with a field.")
    parser.add_argument("--write", action="store_true", help="write into docs/verdict.md")
    options = parser.parse_args(arguments)
    use_compilation_cache()
    text = section(tuple(load().values()))
    print_or_write(SECTION, text, PAGE, write=options.write)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
