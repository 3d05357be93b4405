"""Where the paper's models are good enough: judged by the third-order model, and by particles.

Run from the root of the repository; nothing is written without ``--write``::

    python -m benchmarks.suitability_reference            # prints the tables
    python -m benchmarks.suitability_reference --write    # fills docs/charts.md and its figure

Finished runs are kept in build/suitability, so that it goes on where it was interrupted; the
particles come from the file of `benchmarks.kinetic_field_runs`.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.kinetic_field_runs import COLLISION_TIMES, FIELDS, Kept, load
from benchmarks.kinetic_fields import GOOD, Judged, is_like, judge
from benchmarks.kinetic_models import PAPERS_MODELS
from benchmarks.kinetic_tables import percent
from benchmarks.timing import ROOT, table, write_section
from triboflux.case import Case
from triboflux.suitability import chart_case, suitability
from triboflux.terminal import use_compilation_cache

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

PAGE = ROOT / "docs" / "charts.md"
IMAGE = ROOT / "docs" / "images" / "suitability-third-order.png"
STORES = ROOT / "build" / "suitability"
SECTION = "third-order"

REFERENCE = "third-order"
JUDGED = PAPERS_MODELS
DRAWN = ("full", "semi-algebraic", "gradient")
"""Those that are good somewhere in the plane besides its corners."""

DECADES = np.arange(-5, 0)
TAU_C = tuple(float(f"{digit}e{exponent}") for exponent in DECADES for digit in (1, 2, 5))
PECLET = tuple(float(value) for value in np.logspace(2.0, 8.0, 13))
"""The particles' Pe and τ_c are among them."""
AT = (1e4, 1e6, 1e8)
"""Pe of the table."""
OF_PARTICLES = 1e6
CERTAIN = 2.0
"""Standard errors that an error has to be away from `GOOD` for particles to tell."""

Maps = Mapping[tuple[float, str], "xr.Dataset"]
"""By energy ratio and judged model."""


@dataclass(frozen=True)
class Beside:
    """What particles say about a point of a map.

    Attributes
    ----------
    model : str
        The judged one.
    energy_ratio, tau_c : float
        Where.
    by_model : float or None
        Its error against the reference, None without one.
    by_particles : float or None
        Its error of Q against the particles that have its assumptions.
    noise : float
        Error bar of the particles' Q.
    """

    model: str
    energy_ratio: float
    tau_c: float
    by_model: float | None
    by_particles: float | None
    noise: float

    @property
    def told(self) -> str:
        """Whether particles confirm or contradict what the map says, or can't tell."""
        map_good = self.by_model is not None and self.by_model <= GOOD
        if self.by_particles is None:
            return "contradict" if map_good else "confirm"
        if abs(self.by_particles - GOOD) <= CERTAIN * self.noise:
            return "can't tell"
        return "confirm" if map_good == (self.by_particles <= GOOD) else "contradict"


def maps(folder: Path = STORES) -> Maps:
    """Return the errors of all models against the reference, by energy ratio and model."""
    folder.mkdir(parents=True, exist_ok=True)
    axes = (("numbers.peclet", PECLET), ("numbers.tau_c", TAU_C))
    found: dict[tuple[float, str], xr.Dataset] = {}
    tables = chart_case().model_dump()
    for ratio in FIELDS:
        case = Case(**tables | {"numbers": tables["numbers"] | {"energy_ratio": ratio}})
        for model in JUDGED:
            found[ratio, model] = suitability(
                case, model, axes, reference=REFERENCE, store_folder=folder
            )
            print(f"u = {ratio:g}, {model}: done", flush=True)
    return found


def beside(found: Maps, relaxations: Sequence[Kept], errors: Judged) -> list[Beside]:
    """Return what particles say about the points of the maps at their Pe."""
    told: list[Beside] = []
    for (ratio, model), each in found.items():
        for kept in relaxations:
            if kept.setting.energy_ratio != ratio or not is_like(model, kept):
                continue
            tau_c = kept.setting.tau_c
            error = _at(each, "error", OF_PARTICLES, tau_c)
            by_model = None if np.isnan(error) else float(error)
            by_particles = errors[model, kept].moments.get("charge")
            told.append(Beside(model, ratio, tau_c, by_model, by_particles, kept.noise["charge"]))
    return told


def _at(errors: xr.Dataset, name: str, peclet: float, tau_c: float):
    """Return a value of the point of a map."""
    return errors[name].sel(peclet=peclet, tau_c=tau_c, method="nearest").values[()]


def reach(errors: xr.Dataset, peclet: float) -> str:
    """Return up to which τ_c of the map a model is good."""
    before = None
    for tau_c in TAU_C:
        status = str(_at(errors, "status", peclet, tau_c))
        if status != "ok" and not status.startswith("reduced"):
            return "nowhere" if before is None else f"≤ {before:g}, the end"
        if status != "ok" or not _at(errors, "error", peclet, tau_c) <= GOOD:
            break
        before = tau_c
    return "nowhere" if before is None else f"≤ {before:g}"


def reach_table(found: Maps) -> str:
    """Return up to which τ_c models are good at some Pe."""
    rows: list[list[str]] = []
    for (ratio, model), errors in found.items():
        # all others are outside the range of the closures, or of the reference
        judged = (errors["status"].values == "ok") | np.char.startswith(
            errors["status"].values.astype(str), "reduced"
        )
        share = np.sum(errors["error"].values <= GOOD) / np.sum(judged)
        places = [reach(errors, peclet) for peclet in AT]
        rows.append([f"{ratio:g}", model, *places, f"{share:.0%}"])
    powers = [f"Pe = 10{'⁰¹²³⁴⁵⁶⁷⁸⁹'[round(np.log10(peclet))]}" for peclet in AT]
    head = ["u", "model", *powers, "of the judged points"]
    return table(head, rows)


def particle_table(told: Sequence[Beside], relaxations: Sequence[Kept], errors: Judged) -> str:
    """Return the errors by map and by particles, and those of the reference itself."""
    rows: list[list[str]] = []
    for ratio in FIELDS:
        for tau_c in sorted(COLLISION_TIMES):
            own = {t.model: t for t in told if (t.energy_ratio, t.tau_c) == (ratio, tau_c)}
            if not own:
                continue
            (judge_of_all,) = (
                errors[REFERENCE, kept].moments.get("charge")
                for kept in relaxations
                if (kept.setting.energy_ratio, kept.setting.tau_c) == (ratio, tau_c)
                and is_like(REFERENCE, kept)
            )
            noise = next(iter(own.values())).noise
            row = [f"{ratio:g}", f"{tau_c:g}"]
            row += [f"± {percent(noise)}", _shown(judge_of_all)]
            for model in JUDGED:
                cell = f"{_shown(own[model].by_model)} / {_shown(own[model].by_particles)}"
                wrong = own[model].told == "contradict"
                row.append(f"**{cell}**" if wrong else cell)
            rows.append(row)
    return table(["u", "τ_c", "error bar", REFERENCE, *JUDGED], rows)


def _shown(error: float | None) -> str:
    return "–" if error is None else percent(error)


def section(found: Maps, told: Sequence[Beside], particles: str) -> str:
    """Return the section of the page."""
    said = Counter(each.told for each in told)
    counts = [f"particles {name}: {said[name]} of {len(told)}" for name in _MARKS]
    return "\n\n".join(
        [
            "Made by `python -m benchmarks.suitability_reference --write`, closures `derived`.",
            f"τ_c up to which models are within {GOOD:.0%} of `{REFERENCE}`, and at how many of "
            "the points of the plane at which they can be judged:",
            reach_table(found),
            f"Error of Q in per cent at Pe = 10⁶, against `{REFERENCE}` / against particles that "
            f"match (as above); bold where the two disagree about {GOOD:.0%}; {', '.join(counts)}:",
            particles,
        ]
    )


def figure(found: Maps, told: Sequence[Beside]) -> Figure:
    """Draw a panel for each energy ratio and each of the models `DRAWN`."""
    from triboflux.figures import chart, style

    drawn = {key: each for key, each in found.items() if key[1] in DRAWN}
    hatches = chart.hatches_of(list(drawn.values()))
    with style.page(height=190.0) as made:
        panels = made.subplots(len(FIELDS), len(DRAWN), sharex=True, sharey=True)
        colours = None
        for line, ratio in zip(panels, FIELDS, strict=True):
            for ax, model in zip(line, DRAWN, strict=True):
                colours = chart.draw_map(ax, drawn[ratio, model], {}, hatches)
                own = [t for t in told if (t.energy_ratio, t.model) == (ratio, model)]
                _draw_particles(ax, own)
                ax.set_title(f"{model}, $u_e/u_k = {ratio:g}$", loc="left")
                ax.label_outer()
        if colours is not None:
            chart.add_colour_bar(made, colours)
        handles = chart.legend_handles(list(drawn.values()))
        handles += _legend()
        made.legend(handles=handles, loc="outside lower center", ncols=5, frameon=False)
        made.suptitle(
            f"Models of the paper against the {REFERENCE} model: relative L2 error of the charge "
            "when its peak has halved.\nOn the line Pe = 10$^6$: whether simulated particles "
            "agree that the error is within 5 %, or is not"
        )
    return made


_MARKS = {"confirm": ("o", "white"), "contradict": ("X", "#d62728"), "can't tell": ("d", "0.6")}
"""Symbol and colour by what particles say."""


def _draw_particles(ax: Axes, told: Sequence[Beside]) -> None:
    for each in told:
        symbol, colour = _MARKS[each.told]
        ax.plot(
            OF_PARTICLES,
            each.tau_c,
            symbol,
            color=colour,
            markeredgecolor="black",
            markersize=5.0 if symbol != "X" else 7.0,
            zorder=7,
        )


def _legend() -> list[Line2D]:
    """Return the symbols of the particles for a legend."""
    from matplotlib.lines import Line2D

    look: dict[str, Any] = {"linestyle": "", "markeredgecolor": "black"}
    return [
        Line2D([], [], marker=symbol, color=colour, label=f"particles {name}", **look)
        for name, (symbol, colour) in _MARKS.items()
    ]


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the section, or write it and the figure."""
    parser = argparse.ArgumentParser(description="The paper's models, judged by a better one.")
    parser.add_argument("--write", action="store_true", help="write docs/charts.md and its figure")
    options = parser.parse_args(arguments)
    use_compilation_cache()
    found = maps()
    relaxations = [kept for kept in load().values() if kept.setting.energy_ratio > 0.0]
    errors = judge(relaxations, (REFERENCE, *JUDGED))
    told = beside(found, relaxations, errors)
    text = section(found, told, particle_table(told, relaxations, errors))
    if options.write:
        from triboflux.figures import style

        write_section(SECTION, text, PAGE)
        style.save(figure(found, told), IMAGE)
    else:
        print(text)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
