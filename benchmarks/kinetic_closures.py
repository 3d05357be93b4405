"""Which closure coefficients are right, by the dynamics of simulated particles.

Particles of the simulation collide for a fraction of a collision time, and the answers to single
causes (`benchmarks.kinetic_slopes`) give every collisional coefficient with a standard error. No
closure set goes in. Run from the root of the repository; nothing is written without ``--write``::

    python -m benchmarks.kinetic_closures --effort reduced    # half a minute
    python -m benchmarks.kinetic_closures --write             # several minutes, docs/verdict.md

Seeds, sizes and the level of the tests stand below and were fixed before the run.
"""

from __future__ import annotations

import argparse
import itertools
import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from benchmarks import kinetic_slopes as slopes
from benchmarks.closure_evidence import symbol, with_error
from benchmarks.kinetic_slopes import Answers
from benchmarks.timing import ROOT, write_section
from benchmarks.timing import table as markdown
from triboflux import closures
from triboflux.closures import ClosureSet
from triboflux.responses import Responses, coefficients
from triboflux.sampling import Estimate

Array: TypeAlias = NDArray[np.float64]

PAGE = ROOT / "docs" / "verdict.md"
SEEDS = (1, 2)
"""The first, and one for a repetition."""
RESTITUTIONS = (1.0, 0.8, 0.5)
LEVEL = 0.01
"""A set is contradicted where so small a part of all repetitions would be further off."""

TESTED = (
    "collision_rate",
    "triboconductivity",
    "dispersion",
    "collisional_flux",
    "covariance_production_field",
    "covariance_production_gradient",
    "charge_exchange",
    "covariance_collision",
    "covariance_exchange",
    "third_moment_collision",
    "third_moment_trace",
    "third_moment_exchange",
    "third_moment_exchange_trace",
    "third_moment_shear",
    "third_moment_divergence",
    "variance_regain",
    "variance_production_field",
    "variance_dispersion",
    "variance_flux_collision",
    "variance_flux_exchange",
    "variance_flux_regain",
)
"""As many coefficients as there are answers: each is measured for itself."""
CONSEQUENCES = ("exchange_time", "collisional_flux_number", "variance_flux_product")
"""Ratios and products of those, which say nothing new to the joint test."""
NOT_PRINTED = ("collision_rate", "third_moment_exchange_trace")


class Effort(NamedTuple):
    """How much is simulated.

    Attributes
    ----------
    batches : int
        Independent simulations, whose scatter gives the errors.
    tensor_cells, square_cells : int
        Cells of 1000 particles in each, for C and T and for V, N and the field.
    gradients_in_cell, covariance_in_cell : int
        Particles in each of 180 cells with a diameter, for gradients and for ρ1 and ρ2.
    tensor_gases, covariance_gases : tuple of int
        How many gases of C and T, and of ρ1 and ρ2, there are for each restitution coefficient:
        more where a coefficient is small, so that its standard error is below 1 %, too.
    """

    batches: int
    tensor_cells: int
    square_cells: int
    gradients_in_cell: int
    covariance_in_cell: int
    tensor_gases: tuple[int, ...] = (1, 1, 1)
    covariance_gases: tuple[int, ...] = (1, 1, 1)


EFFORTS = {
    "full": Effort(2560, 16, 12, 40, 240, (1, 6, 1), (1, 2, 9)),
    "reduced": Effort(96, 16, 8, 40, 100),
}


class Measured(NamedTuple):
    """All coefficients for one restitution coefficient.

    Attributes
    ----------
    restitution : float
        e.
    values : array
        In the order of `TESTED` and `CONSEQUENCES`.
    covariance : array
        Of the errors of the values.
    batches : int
        Independent simulations behind both.
    """

    restitution: float
    values: Array
    covariance: Array
    batches: int

    def estimate(self, name: str) -> Estimate:
        """Return the value of a coefficient with its standard error."""
        place = (*TESTED, *CONSEQUENCES).index(name)
        return Estimate(self.values[place], math.sqrt(self.covariance[place, place]))

    def deviation(self, name: str, closure: ClosureSet) -> float:
        """Return how many standard errors the measured value is above that of a set."""
        value, error = self.estimate(name)
        return (value - predicted(closure, name)) / error


class Judgement(NamedTuple):
    """What all measured coefficients together say about a closure set.

    Attributes
    ----------
    chi_square, degrees : float, int
        Deviations weighed by the inverse of their covariance, and their number.
    probability : float
        Of a larger one, if the set is right.
    largest : float
        Deviation of a single coefficient, in standard errors.
    largest_probability : float
        That one of as many would be larger, after Šidák.
    """

    chi_square: float
    degrees: int
    probability: float
    largest: float
    largest_probability: float

    def passed(self) -> bool:
        """Return whether the set is not contradicted."""
        return min(self.probability, self.largest_probability) >= LEVEL


def predicted(closure: ClosureSet, name: str) -> float:
    """Return the value of a coefficient in a closure set."""
    if name == "collision_rate":
        return closures.collision_integral(1.0)
    if name == "third_moment_exchange_trace":
        return 0.0
    return closure["covariance_collision" if name == "variance_flux_collision" else name]


def measure(effort: str = "full", seed: int = SEEDS[0]) -> list[Measured]:
    """Measure all coefficients for each restitution coefficient.

    Parameters
    ----------
    effort : str
        ``"full"`` or ``"reduced"``.
    seed : int
        Of all random numbers; the result does not depend on the number of threads.
    """
    sizes = EFFORTS[effort]
    found = []
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for place, source in enumerate(np.random.SeedSequence(seed).spawn(len(RESTITUTIONS))):
            restitution = RESTITUTIONS[place]
            print(f"seed {seed}, e = {restitution:g}", file=sys.stderr, flush=True)
            batches = source.spawn(sizes.batches)
            answers = list(pool.map(lambda s, p=place: _answers(sizes, p, s), batches))
            found.append(_jackknifed(np.array(answers), restitution))
    return found


def _answers(sizes: Effort, place: int, source: np.random.SeedSequence) -> list[float]:
    """Return the answers of one batch in the order of `Responses`, to what the paper keeps."""
    random = np.random.default_rng(source)
    e = RESTITUTIONS[place]
    found = _mean(
        slopes.vector_and_tensor(slopes.uniform_gas(e, sizes.tensor_cells, random))
        for _ in range(sizes.tensor_gases[place])
    )
    gas = slopes.uniform_gas(e, sizes.square_cells, random)
    found |= slopes.squares_and_field(gas, random)
    gas = slopes.slab_gas(e, sizes.gradients_in_cell, random)
    found |= slopes.gradients(gas, random, found["variance_regain"])
    found |= _mean(
        slopes.covariance_gradients(slopes.slab_gas(e, sizes.covariance_in_cell, random))
        for _ in range(sizes.covariance_gases[place])
    )
    return [found[name] for name in Responses._fields if name not in Responses._field_defaults]


def _mean(answers: Iterable[Answers]) -> Answers:
    """Return the mean answers of several gases."""
    every = list(answers)
    return {name: sum(one[name] for one in every) / len(every) for name in every[0]}


def _coefficients(answers: Array, restitution: float) -> Array:
    """Return coefficients in the order of the names, from answers along the first axis."""
    responses = Responses(*answers)
    found: dict[str, Any] = coefficients(responses, restitution)
    found["variance_flux_collision"] = -responses.flux_velocity / responses.collision_rate
    return np.array([found[name] for name in (*TESTED, *CONSEQUENCES)])


def _jackknifed(answers: Array, restitution: float) -> Measured:
    """Return coefficients and their covariance from the answers of all batches."""
    batches = len(answers)
    mean = answers.mean(axis=0)
    others = _coefficients(((batches * mean - answers) / (batches - 1)).T, restitution)
    covariance = (batches - 1) ** 2 / batches * np.cov(others)
    return Measured(restitution, _coefficients(mean, restitution), covariance, batches)


def judge(found: Sequence[Measured], closure: Callable[[float], ClosureSet]) -> Judgement:
    """Return what measured coefficients say about a closure set.

    The covariance is itself estimated, so Hotelling's distribution takes the place of χ² for each
    restitution coefficient, and Student's that of the normal one.

    Parameters
    ----------
    found : sequence of Measured
        From `measure`.
    closure : callable
        `triboflux.closures.derived` or the like: gives the set for a restitution coefficient.
    """
    number = len(TESTED)
    total = equivalent = largest = 0.0
    least = 1.0
    for one in found:
        closed = closure(one.restitution)
        expected = [predicted(closed, name) for name in TESTED]
        difference = one.values[:number] - expected
        distance = float(difference @ np.linalg.solve(one.covariance[:number, :number], difference))
        scaled = distance * (one.batches - number) / (one.batches - 1)
        probability = stats.f.sf(scaled / number, number, one.batches - number)
        total += scaled
        equivalent += stats.chi2.isf(probability, number)
        extreme = max(abs(one.deviation(name, closed)) for name in TESTED)
        least = min(least, 2.0 * float(stats.t.sf(extreme, one.batches - 1)))
        largest = max(largest, extreme)
    degrees = number * len(found)
    probability = float(stats.chi2.sf(equivalent, degrees))
    corrected = -math.expm1(degrees * math.log1p(-least)) if least < 1.0 else 1.0
    return Judgement(total, degrees, probability, largest, corrected)


def bound(degrees: int) -> float:
    """Return the deviation that one of so many right coefficients passes with the chance LEVEL."""
    return float(stats.norm.isf(-0.5 * math.expm1(math.log1p(-LEVEL) / degrees)))


def table(*runs: Sequence[Measured]) -> str:
    """Return the comparison as a Markdown table.

    Parameters
    ----------
    *runs : sequence of Measured
        From `measure`, one for each seed.
    """
    header = ["symbol", "e", "derived"]
    for run in range(len(runs)):
        header += [f"measured, seed {SEEDS[run]}", "z"]
    return markdown([*header, "printed", "z of the print"], _lines(runs))


def _lines(runs: Sequence[Sequence[Measured]]) -> Iterator[list[str]]:
    for name in (*TESTED, *CONSEQUENCES):
        for found in zip(*runs, strict=True):
            restitution = found[0].restitution
            derived, printed = closures.derived(restitution), closures.published(restitution)
            cells = [_symbol(name), f"{restitution:g}", f"{predicted(derived, name):.6g}"]
            for one in found:
                cells += [with_error(one.estimate(name)), f"{one.deviation(name, derived):+.1f}"]
            if name in NOT_PRINTED:
                yield [*cells, "–", "–"]
                continue
            off = [f"{one.deviation(name, printed):+,.1f}" for one in found]
            yield [*cells, f"{predicted(printed, name):.4g}", ", ".join(off)]


def _symbol(name: str) -> str:
    return "N rate, 1/τ_c" if name == "variance_flux_collision" else symbol(name)


def contradicted(runs: Sequence[Sequence[Measured]]) -> list[str]:
    """Return the printed coefficients that are too far off for chance with every seed."""
    most = bound(len(TESTED) * len(RESTITUTIONS))

    def off(name: str, run: Sequence[Measured]) -> bool:
        sets = [(one, closures.published(one.restitution)) for one in run]
        return max(abs(one.deviation(name, printed)) for one, printed in sets) > most

    names = [name for name in (*TESTED, *CONSEQUENCES) if name not in NOT_PRINTED]
    return [name for name in names if all(off(name, run) for run in runs)]


def _told(judgement: Judgement) -> list[str]:
    """Return a judgement in words, in detail and in one."""
    low = 1e-9
    first, second = (
        f"p < {low:.0e}" if p < low else f"p = {p:.2g}"
        for p in (judgement.probability, judgement.largest_probability)
    )
    numbers = f"χ² = {judgement.chi_square:,.1f} on {judgement.degrees}, {first}"
    extreme = f"largest deviation {judgement.largest:,.1f}, {second}"
    return [f"{numbers}; {extreme}", "passes" if judgement.passed() else "FAILS"]


def _large_errors(run: Sequence[Measured]) -> list[str]:
    """Return where a standard error is above 1 % of the derived value, worst first."""
    found = []
    for one, name in itertools.product(run, TESTED):
        value, error = predicted(closures.derived(one.restitution), name), one.estimate(name).error
        if 0.0 < 0.01 * abs(value) < error:
            percent = 100.0 * error / abs(value)
            text = f"{_symbol(name)} at e = {one.restitution:g} ({percent:.3g} %)"
            found.append((percent, text))
    return [text for _, text in sorted(found, reverse=True)]


def section(runs: Sequence[Sequence[Measured]], effort: str) -> str:
    """Return the text between the markers of the page.

    Parameters
    ----------
    runs : sequence of sequence of Measured
        From `measure`, one for each of `SEEDS`.
    effort : str
        That they were made with.
    """
    wrong = contradicted(runs)
    agree = [_symbol(name) for name in TESTED if name not in wrong and name not in NOT_PRINTED]
    worst = ", ".join(text for run in runs for text in _large_errors(run))
    option = "" if effort == "full" else f" --effort {effort}"
    tests = len(TESTED) * len(RESTITUTIONS)
    judged = [
        [name, str(seed), *_told(judge(run, closure))]
        for name, closure in (("derived", closures.derived), ("published", closures.published))
        for seed, run in zip(SEEDS, runs, strict=True)
    ]
    paragraphs = [
        f"Made by `python -m benchmarks.kinetic_closures{option} --write`: "
        f"{EFFORTS[effort].batches} independent batches for each e and seed.",
        f"A set passes if both probabilities are at least {LEVEL}; at that level one of "
        f"{tests} right coefficients may be off by {bound(tests):.2f} standard errors.",
        markdown(["set", "seed", "joint test", "verdict"], judged),
        "Standard errors (both seeds) are below 1 % of the value"
        + (f", except {worst}." if worst else "."),
        f"Printed and contradicted with both seeds: {', '.join(map(_symbol, wrong))}.",
        f"Printed and not contradicted: {', '.join(agree)}.",
        table(*runs),
    ]
    return "\n\n".join(paragraphs)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the section, or write it; return 1 if the derived set is contradicted."""
    parser = argparse.ArgumentParser(description="Closure coefficients by simulated particles.")
    parser.add_argument("--effort", choices=EFFORTS, default="full", help="how much is simulated")
    parser.add_argument("--write", action="store_true", help="write the section of docs/verdict.md")
    options = parser.parse_args(arguments)
    runs = [measure(options.effort, seed) for seed in SEEDS]
    text = section(runs, options.effort)
    if options.write:
        write_section("closures", text, PAGE)
    else:
        print(text)
    return int(not all(judge(run, closures.derived).passed() for run in runs))


if __name__ == "__main__":
    raise SystemExit(main())
