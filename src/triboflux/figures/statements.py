"""What the paper says about each of its figures beside what is measured here."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from triboflux.figures.cases import CLOSURES, FREQUENT, MAP, PAPER_TIMES, RARE
from triboflux.figures.comparison import MODELS, Comparison
from triboflux.figures.findings import PERFECT, Finding, Statement, each, percent
from triboflux.figures.measures import (
    distances,
    end,
    harmonics,
    largest,
    mismatch,
    places_of_maxima,
    singular_share,
    sizes,
    unrealizable,
)
from triboflux.figures.region_statements import of_the_regions

if TYPE_CHECKING:
    import xarray as xr

    from triboflux.figures.closure import Start
    from triboflux.result import Result

TIMES_AGREE = 0.05
"""Relative difference up to which a time is called the paper's, which gives two digits."""

NEGLIGIBLE = 0.01
"""Part of the largest term below which a term is called negligible."""

_MOMENTS = ("charge", "covariance", "variance")


# ------------------------------------------------------------------ Figs. 1-3


def _of_profiles(case: int, data: dict[int, Any]) -> list[Statement]:
    results: dict[str, Result] = data[case]
    paper = float(PAPER_TIMES[case])

    def time(closures: str) -> Finding:
        found = end(results[closures])
        off = found / paper - 1.0
        return Finding(abs(off) <= TIMES_AGREE, f"t* = {found:.5g}, {100 * off:+.1f} %")

    def sine(closures: str) -> Finding:
        off = harmonics(results[closures])
        return Finding(off > 0.05, f"up to {percent(off)} of the peak away from its fundamental")

    def maxima(closures: str) -> Finding:
        places = [places_of_maxima(results[closures], name) for name in ("variance", "covariance")]
        same = len(places[0]) == len(places[1]) == 2 and bool((places[0] == places[1]).all())
        told = ["x* = " + ", ".join(f"{x:.3g}" for x in place) for place in places]
        return Finding(same, f"variance: {told[0]}; size of the covariance: {told[1]}")

    def realizable(closures: str) -> Finding:
        share, ratio = unrealizable(results[closures])
        return Finding(
            None, f"broken in {100 * share:.0f} % of the box; covariance² up to {ratio:.2g} V"
        )

    statements = [
        each(
            f"The largest charge has halved at t* ≈ {PAPER_TIMES[case]} "
            f"(agrees within {percent(TIMES_AGREE)}).",
            time,
        ),
        each(
            "The charge profile is far from the sine wave of earlier models "
            "(agrees if the higher harmonics exceed 5 % of the peak).",
            sine,
        ),
        each("The variance has two maxima, where the covariance is largest.", maxima),
        each(
            "Not discussed: any distribution of charges obeys covariance² ≤ variance V "
            "(scaled by the granular temperature).",
            realizable,
        ),
    ]
    if case == RARE:
        statements.append(each(*_growth_of_covariance(data)))
    return statements


def _growth_of_covariance(data: dict[int, Any]) -> tuple[str, Callable[[str], Finding]]:
    def grown(closures: str) -> Finding:
        frequent, rare = (largest(data[n][closures], "covariance") for n in (FREQUENT, RARE))
        return Finding(
            rare > 10.0 * frequent,
            f"{rare:.4g} against {frequent:.4g}, ratio {rare / frequent:.0f}",
        )

    return (
        "The covariance is much larger than where collisions are frequent, Fig. 1 "
        "(agrees if more than ten times).",
        grown,
    )


def _of_the_gradient_model(data: dict[int, Any]) -> list[Statement]:
    pairs: dict[str, Comparison] = data[3]

    def peak(closures: str) -> Finding:
        full, reduced = (largest(r, "charge") for r in pairs[closures][:2])
        return Finding(reduced < full, f"{reduced:.4g} against {full:.4g} of the full model")

    def sine(closures: str) -> Finding:
        full, reduced = (harmonics(r) for r in pairs[closures][:2])
        return Finding(
            reduced < NEGLIGIBLE < full,
            f"higher harmonics {percent(reduced)} of its peak; full model {percent(full)}",
        )

    def early(closures: str) -> Finding:
        full, reduced = (largest(r, "covariance", 1) for r in pairs[closures][:2])
        time = float(pairs[closures].full.dataset["time"][1])
        return Finding(reduced > full, f"at t* = {time:.3g}: {reduced:.4g} against {full:.4g}")

    def late(closures: str) -> Finding:
        full, reduced = (largest(r, "covariance") for r in pairs[closures][:2])
        time = end(pairs[closures].full)
        return Finding(reduced < full, f"at t* = {time:.4g}: {reduced:.4g} against {full:.4g}")

    return [
        each("The gradient model has the lower peak charge at the same time.", peak),
        each(
            "Its profile is like a trigonometric function, that of the full model is not "
            f"(agrees if its higher harmonics stay below {percent(NEGLIGIBLE)}).",
            sine,
        ),
        each("It can overestimate the covariance at the beginning.", early),
        each("It underestimates the covariance later.", late),
        *_own_time(pairs, "gradient"),
    ]


def _own_time(pairs: dict[str, Comparison], model: str) -> list[Statement]:
    def halved(closures: str) -> Finding:
        full, own = end(pairs[closures].full), end(pairs[closures].halved)
        return Finding(None, f"at {own:.5g}, full model at {full:.5g}")

    return [each(f"Not given: when the {model} model's own peak charge has halved.", halved)]


# ------------------------------------------------------------------ Figs. 4-6


def _of_budgets(number: int, data: dict[int, Any]) -> list[Statement]:
    budgets: dict[str, xr.Dataset] = data[number]
    frequent = number == 4
    size = {c: {m: sizes(budgets[c], m) for m in _MOMENTS} for c in CLOSURES}

    def transport(closures: str) -> Finding:
        terms = size[closures]["charge"]
        flux, dispersion = terms["kinetic flux"], terms["collisional dispersion"]
        return Finding(
            flux > 10.0 * dispersion, f"kinetic {flux:.3g}, collisional dispersion {dispersion:.2g}"
        )

    def force(closures: str) -> Finding:
        terms = size[closures]["covariance"]
        told = ", ".join(f"{name} {value:.3g}" for name, value in terms.items())
        sources = (terms["production"], terms["dispersion"])
        return Finding(terms["electric force"] > max(sources), told)

    def production(closures: str) -> Finding:
        terms = size[closures]["covariance"]
        ratio = terms["production"] / max(terms["electric force"], terms["destruction"])
        return Finding(
            0.0 < ratio < 0.5, f"{percent(ratio)} of the larger of electric force and destruction"
        )

    def transient(closures: str) -> Finding:
        terms = size[closures]["covariance"]
        ratios = [terms[n] / max(terms.values()) for n in ("time derivative", "dispersion")]
        small = max(ratios) < NEGLIGIBLE if frequent else min(ratios) > NEGLIGIBLE
        return Finding(
            small, f"time derivative {percent(ratios[0])}, dispersion {percent(ratios[1])}"
        )

    def variance(closures: str) -> Finding:
        terms = dict(size[closures]["variance"])
        told = ", ".join(f"{name} {value:.2g}" for name, value in terms.items())
        terms.pop("time derivative")
        main = ("production by covariance and charge gradient", "kinetic dispersion")
        least = min(terms.pop(name) for name in main)
        return Finding(least > max(terms.values()), told)

    small = "are negligible" if frequent else "are relevant"
    limit = f"{'below' if frequent else 'above'} {percent(NEGLIGIBLE)} of the largest term"
    statements = [
        each("Kinetic transport dominates the charge (agrees if over ten times).", transport),
        each("The electric force contributes most to the covariance.", force),
        each("Production by the charge gradient is small (agrees below one half).", production),
        each(f"Time derivative and dispersion of the covariance {small} ({limit}).", transient),
        each(
            "Production by covariance and charge gradient, and kinetic dispersion, stand out in "
            "the variance.",
            variance,
        ),
        each(
            "Check: the sum of the terms against a difference of outputs.",
            lambda closures: _balance(budgets[closures]),
        ),
    ]
    return (
        statements if frequent else [*statements[:1], each(*_growth_of_flux(data)), *statements[1:]]
    )


def _balance(budget: xr.Dataset) -> Finding:
    told = [f"{name} {mismatch(budget, name):.1e}" for name in _MOMENTS]
    return Finding(None, f"{', '.join(told)} of the largest term")


def _growth_of_flux(data: dict[int, Any]) -> tuple[str, Callable[[str], Finding]]:
    def grown(closures: str) -> Finding:
        flux = [sizes(data[n][closures], "charge")["kinetic flux"] for n in (4, 5)]
        return Finding(flux[1] > flux[0], f"{flux[1]:.3g} against {flux[0]:.3g} in Fig. 4")

    return "Kinetic transport is stronger the rarer the collisions.", grown


def _of_the_initial_variance(data: dict[int, Any]) -> list[Statement]:
    starts: dict[str, Start] = data[6]
    statements: list[Statement] = []
    for letter, tau_c in (("a", "10⁻⁴"), ("b", "0.1")):

        def sign(closures: str, letter: str = letter) -> Finding:
            profile = starts[f"{letter}_{closures}"].profile
            negative, singular = singular_share(profile)
            least, most = float(profile["variance"].min()), float(profile["variance"].max())
            told = f"negative in {percent(negative)} of the box, singular at {singular} places"
            bounded = f"regular; between {least:.2g} and {most:.3g}"
            return Finding(negative > 0.0, told if singular or negative else bounded)

        def run(closures: str, letter: str = letter) -> Finding:
            result = starts[f"{letter}_{closures}"].run
            return Finding(result.status == "nonphysical", f"{result.status}: {result.stop_reason}")

        where = f"({letter}), τ_c* = {tau_c}:"
        statements += [
            each(f"{where} the algebraic variance is negative or singular at the start.", sign),
            each(f"{where} the algebraic model can't be run.", run),
        ]
    return statements


# ------------------------------------------------------------------ Figs. 7-8


def _of_the_semi_algebraic_model(number: int, data: dict[int, Any]) -> list[Statement]:
    pairs: dict[str, Comparison] = data[number]

    def distance(closures: str) -> Finding:
        found = distances(pairs[closures].reduced, pairs[closures].full)
        worst = max(d.largest for d in found.values())
        told = ", ".join(
            f"{name} {percent(d.largest)} / {percent(d.mean_square)}" for name, d in found.items()
        )
        return Finding(worst < PERFECT if number == 7 else worst > 0.1, told)

    def peak(closures: str) -> Finding:
        full, reduced = (largest(r, "charge") for r in pairs[closures][:2])
        return Finding(reduced < full, f"peak charge {reduced:.4g} against {full:.4g}")

    def physical(closures: str) -> Finding:
        dataset = pairs[closures].reduced.dataset
        smallest = float(dataset["variance"].isel(time=slice(1, None)).min())
        broken = (dataset["realizability_margin"] < 0.0).mean("x").values
        return Finding(
            smallest >= 0.0,
            f"smallest variance after the start {smallest:.2g}; but covariance² > V in "
            f"{100 * broken[0]:.0f} % of the box at the start, {100 * broken[-1]:.0f} % at the end",
        )

    norms = "largest difference / L2 norm of the difference, relative to the full model"
    judged = (
        f"It matches the full model perfectly (agrees if all fields do within "
        f"{percent(PERFECT)}; {norms})."
        if number == 7
        else f"It fails (agrees if any field is off by more than 10 %; {norms})."
    )
    statements = [
        each(judged, distance),
        each(
            "It gives physical results at all times (agrees if the variance never is negative).",
            physical,
        ),
        *_own_time(pairs, MODELS[number]),
    ]
    if number == 8:
        statements.insert(1, each("It overestimates the transport of charge.", peak))
    return statements


_HEADINGS = {
    1: "Profiles where collisions are frequent, τ_c* = 10⁻⁴",
    2: "Profiles where collisions are rare, τ_c* = 0.1",
    3: "Full and gradient model, τ_c* = 0.1",
    4: "Budgets, τ_c* = 10⁻⁴ (sizes are largest absolute values)",
    5: "Budgets, τ_c* = 0.1 (sizes are largest absolute values)",
    6: "Initial variance of the algebraic model",
    7: "Full and semi-algebraic model, τ_c* = 10⁻⁴",
    8: "Full and semi-algebraic model, τ_c* = 0.1",
    MAP: "Where the semi-algebraic model is good enough",
}


def heading(number: int) -> str:
    """Return what a figure shows.

    Parameters
    ----------
    number : int
        Of the figure.
    """
    return _HEADINGS[number]


def statements(number: int, data: dict[int, Any]) -> list[Statement]:
    """Return the paper's statements about a figure with what was measured.

    Parameters
    ----------
    number : int
        Of the figure.
    data : dict
        What was computed for every figure, by number.
    """
    if number in (1, 2):
        return _of_profiles(number, data)
    if number == 3:
        return _of_the_gradient_model(data)
    if number in (4, 5):
        return _of_budgets(number, data)
    if number == 6:
        return _of_the_initial_variance(data)
    if number == MAP:
        return of_the_regions(data)
    return _of_the_semi_algebraic_model(number, data)
