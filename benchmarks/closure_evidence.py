"""The proof of the closure coefficients: exact forms, sampled values and the printed ones.

The exact forms come from `benchmarks.collision_algebra`, the sampled values from
`triboflux.sampling`, the printed values from the published closure set. Run from the root of the
repository; nothing is written without ``--write``::

    python -m benchmarks.closure_evidence --samples 200000     # some seconds
    python -m benchmarks.closure_evidence --write              # minutes, fills docs/closures.md
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from sympy import Expr

from benchmarks.collision_algebra import E, evaluated, exact_forms
from benchmarks.timing import ROOT, table, write_section
from triboflux import closures
from triboflux.closures import Coefficient
from triboflux.collision import HERTZ_EXPONENT
from triboflux.responses import ADDITIONS
from triboflux.sampling import Estimate, batches_of, sample_closures

PAGE = ROOT / "docs" / "closures.md"
RESTITUTIONS = (1.0, 0.8, 0.5)
EXPONENTS = {"4/5": HERTZ_EXPONENT, "1/2": 0.5}
SAMPLES, SEED = 2**23, 1
DOUBTFUL = 4.5
"""So many standard errors from the exact value are not taken for chance."""
ROUND_OFF = 1e-12
LETTERS = {
    "lambda_": "λ",
    "lambda": "λ",
    "rho_": "ρ",
    "chi_": "χ",
    "kappa": "κ",
    "tau": "τ",
    "xi": "ξ",
}
SYMBOLS = {
    "collision_rate": "1/(τ_c n g0 d² √Θ)",
    "third_moment_exchange_trace": "K2, 1/τ_ξ",
    "charge_third_moment_trace": "χ1, by ∇²T_mm",
    "covariance_third_moment_trace": "χ2, by ∂_i T_mm",
    "covariance_collisional_dispersion_divergence": "χ3, by ∇∇·C",
    "third_moment_flux_trace": "χ4, by ∇²Q δ_ij",
    "third_moment_flux_field": "χ4, by ∂_i E_j",
    "third_moment_flux_field_trace": "χ4, by ∇·E δ_ij",
    "variance_production_gradient": "λ3.2, by ∇Q²",
    "variance_production_mixed": "λ3.2, by E·∇Q",
    "variance_covariance_gradient": "V by C·∇Q, over η",
    "variance_covariance_gradient_regain": "V by C·∇Q, over -η_V",
    "variance_covariance_field": "V by C·E, over η",
    "variance_covariance_field_regain": "V by C·E, over -η_V",
    "variance_flux_production": "N by ∇V, over -e η_V",
}


class Row(NamedTuple):
    """One coefficient for one collision rule.

    Attributes
    ----------
    name, form : str
        As in the closure set, and the exact form as the algebra gives it.
    restitution, exponent : float
        e and a.
    exact : float
        Value of the exact form.
    sampled : Estimate or None
        None for drag, which is not collisional.
    printed : Coefficient or None
        None where the paper has no such number.
    """

    name: str
    form: str
    restitution: float
    exponent: float
    exact: float
    sampled: Estimate | None
    printed: Coefficient | None

    def deviation(self) -> float | None:
        """Return how many standard errors the sampled value is above the exact one.

        None where nothing is sampled, or where every single pair gives the exact value.
        """
        if self.sampled is None:
            return None
        difference, round_off = self.sampled.value - self.exact, ROUND_OFF * abs(self.exact)
        if self.sampled.error <= round_off and abs(difference) <= round_off:
            return None
        return difference / self.sampled.error

    def confirmed(self) -> bool:
        """Return whether sampling agrees with the exact form."""
        deviation = self.deviation()
        return deviation is None or abs(deviation) < DOUBTFUL

    def verdict(self) -> str:
        """Return what sampling says about the exact form, and what follows for the print."""
        deviation = self.deviation()
        if self.sampled is None:
            words = ["drag, not sampled"]
        elif deviation is None:
            words = ["confirmed in every pair"]
        elif self.confirmed():
            words = [f"confirmed, z = {deviation:+.1f}"]
        else:
            words = [f"NOT CONFIRMED, z = {deviation:+.1f}"]
        if self.printed is None:
            return words[0]
        printed = self.printed.value
        if abs(printed - self.exact) <= _rounding(self.printed.formula) + ROUND_OFF:
            words.append("agrees with the print")
        elif self.sampled is None or deviation is None:
            words.append(f"the print is {printed / self.exact:.3g} times as large")
        else:
            distance = abs(printed - self.sampled.value) / self.sampled.error
            words.append(f"the print is {distance:,.0f} standard errors away")
        return "; ".join(words)


def with_error(estimate: Estimate) -> str:
    """Return a value with two digits of its standard error in brackets, as in 1.82534(29)."""
    value, error = estimate
    if error <= ROUND_OFF * abs(value):
        return f"{value:.6g}"
    # Rounding can carry 0.00996 to 0.010, which has a digit less.
    digits = 1 - math.floor(math.log10(float(f"{error:.1e}")))
    if digits < 0:
        return f"{value:.0f}({error:.0f})"
    brackets = f"{error:.{digits}f}" if error >= 1.0 else f"{error * 10**digits:.0f}"
    return f"{value:.{digits}f}({brackets})"


def readable(form: Expr) -> str:
    """Return an exact form as the pages write it."""
    return f"`{str(form).replace('**', '^').replace('*', ' ')}`"


def symbol(name: str) -> str:
    """Return the field's notation of a coefficient."""
    known = closures.complete(1.0).coefficients
    text = known[name].symbol if name in known else SYMBOLS[name]
    for word, letter in LETTERS.items():
        text = text.replace(word, letter)
    return text


def rows(
    forms: Mapping[str, Expr],
    sampled: Mapping[tuple[float, float], Mapping[str, Estimate]],
    exponent: float,
) -> Iterator[Row]:
    """Return all coefficients at an exponent, those that depend on e at every restitution."""
    for name, form in forms.items():
        depends = E in form.free_symbols
        for restitution in RESTITUTIONS if depends else RESTITUTIONS[:1]:
            printed = None
            # kappa is no number of the paper's
            if exponent == HERTZ_EXPONENT and name != "transferred_fraction":
                printed = closures.published(restitution).coefficients.get(name)
            yield Row(
                name,
                readable(form),
                restitution if depends else math.nan,
                exponent,
                evaluated(form, restitution, exponent),
                sampled[restitution, exponent].get(name),
                printed,
            )


def _rounding(formula: str) -> float:
    """Return half a unit of the last digit of a printed number, or 0 for a formula."""
    if not _is_number(formula):
        return 0.0
    return 0.5 * 10.0 ** -len(formula.partition(".")[2])


def _is_number(formula: str) -> bool:
    return formula.replace(".", "", 1).isdigit()


def _table(found: Sequence[Row], *, printed: bool) -> str:
    header = ["symbol", "exact form", "e", "value", "sampled"]
    header += ["printed", "verdict"] if printed else ["verdict"]

    def print_of(row: Row) -> str:
        if row.printed is None:
            return "–"
        return (
            row.printed.formula if _is_number(row.printed.formula) else f"{row.printed.value:.4g}"
        )

    def cells(row: Row) -> Iterator[str]:
        yield symbol(row.name)
        yield row.form
        yield "any" if math.isnan(row.restitution) else f"{row.restitution:g}"
        yield f"{row.exact:.6g}"
        yield "–" if row.sampled is None else with_error(row.sampled)
        if printed:
            yield print_of(row)
        yield row.verdict()

    return table(header, (list(cells(row)) for row in found))


def section(samples: int, seed: int) -> tuple[str, list[Row]]:
    """Return the text of the page, and all rows in it.

    Parameters
    ----------
    samples : int
        Number of colliding pairs.
    seed : int
        Of the random numbers.
    """
    found_forms = exact_forms()
    order = [*closures.complete(1.0).coefficients, *ADDITIONS]
    forms = {name: found_forms[name] for name in order}
    settings = [(e, a) for a in EXPONENTS.values() for e in RESTITUTIONS]
    sampled = sample_closures(settings, samples, seed)
    found = {name: list(rows(forms, sampled, a)) for name, a in EXPONENTS.items()}
    every = [row for some in found.values() for row in some]
    deviations = [z for row in every if (z := row.deviation()) is not None]
    unconfirmed = [row for row in every if not row.confirmed()]
    spread = math.sqrt(sum(z * z for z in deviations) / len(deviations))
    batches, size = batches_of(samples)
    text = [
        f"Made by `python -m benchmarks.closure_evidence --samples {samples} --seed {seed} "
        "--write`.",
        "",
        "*Exact form* is what the computer algebra returns, with "
        "J_p = 2^(p+1) √π Γ((p+1)/2). *Sampled* comes from "
        f"{batches * size:,} colliding pairs, the same for all e and a, with the last two digits "
        "of the standard error in brackets; e = any was sampled at e = 1. z is the sampled less "
        f"the exact value in standard errors. Of {len(deviations)} sampled values "
        f"{len(unconfirmed)} are further off than {DOUBTFUL}; the largest |z| is "
        f"{max(map(abs, deviations)):.1f} and the root mean square {spread:.2f}, with the same "
        "pairs behind all of them. *In every pair* means a ratio that every single pair gives "
        "exactly.",
    ]
    for name, some in found.items():
        has_print = any(row.printed is not None for row in some)
        text += ["", f"Exponent a = {name}:", "", _table(some, printed=has_print)]
    return "\n".join(text), every


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the section, or write it; return 1 if sampling contradicts an exact form."""
    parser = argparse.ArgumentParser(description="Exact, sampled and printed coefficients.")
    parser.add_argument("--samples", type=int, default=SAMPLES, help="number of colliding pairs")
    parser.add_argument("--seed", type=int, default=SEED, help="of the random numbers")
    parser.add_argument(
        "--write", action="store_true", help="write the section of docs/closures.md"
    )
    options = parser.parse_args(arguments)
    text, every = section(options.samples, options.seed)
    if options.write:
        write_section("proof", text, PAGE)
    else:
        print(text)
    return int(not all(row.confirmed() for row in every))


if __name__ == "__main__":
    raise SystemExit(main())
