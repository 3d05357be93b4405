"""The table from which `triboflux numbers` reads which model suits, and how exact it is.

Run from the root of the repository; nothing is written without ``--write``::

    python -m benchmarks.suitability_table            # about three minutes on two cores: accuracy
    python -m benchmarks.suitability_table --write    # computes the table too

``--write`` fills src/triboflux/model_errors.npz and a section of docs/suspension.md.
"""

from __future__ import annotations

import argparse
import itertools
import os
from collections import Counter
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks.timing import ROOT, table, write_section
from triboflux import advice, closures, model_table
from triboflux.errors import InputError
from triboflux.model_errors import CHEAPEST_FIRST, FLOOR, OK, POINTS, ModelErrors, measure
from triboflux.model_table import Coordinates, Entries, ModelTable
from triboflux.numbers import Numbers, from_suspension
from triboflux.suitability import MEASURE
from triboflux.suspension import Suspension
from triboflux.sweep_member import ONE_THREAD, decisive_versions

PAGE = ROOT / "docs" / "suspension.md"
DATA = ROOT / "src" / "triboflux" / model_table.FILE

_DECADES = {
    "lag": [-4, -3, -2, -1.5, -1, -0.75, -0.5, -0.25, 0, 0.5],
    "energy_ratio": [-1, 0, 0.5, 1, 1.5, 2, 2.5, 3],
    "exchange": [-3, -2, -1, -0.5, 0, 0.5, 1, 2, 3, 4, 5, 6],
    "drag": [0, 0.5, 1, 2],
    "solid_fraction": np.log10([1e-4, 1e-3, 1e-2, 0.1, 0.3, 0.6]),
}
"""Closest where the errors pass through 5 %; their slopes are constant far from there."""
# The printed closures exchange charge 144 times more slowly, and end where the lag is still small.
_PRINTED = _DECADES | {
    "lag": [-4, -3.5, -3, -2.5, -2, -1.5, -1, -0.75, -0.5, -0.25, 0, 0.5],
    "exchange": [-6, -5, -4, -3, -2, -1, -0.5, 0, 0.5, 1, 2, 3, 4],
}
AXES = {
    name: tuple(10.0 ** np.array(decades[coordinate]) for coordinate in Coordinates._fields)
    for name, decades in (("derived", _DECADES), ("published", _PRINTED))
}

SUSPENSIONS = 1000
"""Random ones, of which the first half sets the spread and the second half checks it."""
STEEP = (100, 100.0)
"""How many entries are computed on twice the points too, and the least u of them."""
MATTERS = (5e-3, 0.5)
"""Errors among which the spread is measured; outside, the choice of a model is clear."""


def prepare() -> None:
    """Set up a process that runs models."""
    from triboflux.terminal import use_compilation_cache

    use_compilation_cache()


def entry(task: tuple[Coordinates, str]) -> ModelErrors:
    """Compute one entry of the table."""
    try:
        numbers = model_table.numbers_at(*task)
    except InputError as error:
        return ModelErrors("refused", str(error))
    if numbers is None:
        return ModelErrors(model_table.IMPOSSIBLE)
    return measure(numbers, task[1])


def computed(task: tuple[Numbers, str]) -> ModelErrors:
    """Run all models for one suspension."""
    return measure(*task)


def steepest(name: str) -> list[tuple[Coordinates, str]]:
    """Return entries of a closure set where the field makes profiles steep, without picking."""
    count, least = STEEP
    steep = [place for place in places(name) if place.energy_ratio >= least]
    chosen = np.random.default_rng(1).permutation(len(steep))[:count]
    return [(steep[number], name) for number in chosen]


def refined(task: tuple[Coordinates, str]) -> list[float]:
    """Return by which fractions an entry's errors above the floor change on twice the points."""
    numbers = model_table.numbers_at(*task)
    if numbers is None or not (coarse := measure(numbers, task[1])).models:
        return []
    fine = measure(numbers, task[1], points=2 * POINTS)
    return [
        abs(b.error / a.error - 1.0)
        for a, b in zip(coarse.models, fine.models, strict=True)
        if a.error is not None and b.error is not None and max(a.error, b.error) > FLOOR
    ]


def resolution(name: str, pool: ProcessPoolExecutor) -> dict[str, Any]:
    """Return how much twice the points change where profiles are steepest."""
    changes = list(pool.map(refined, steepest(name)))
    return {
        "entries": sum(map(bool, changes)),
        "errors": sum(map(len, changes)),
        "largest": max(itertools.chain.from_iterable(changes)),
    }


def places(name: str) -> Iterator[Coordinates]:
    """Yield the coordinates of a closure set's entries, the last varying fastest."""
    yield from (Coordinates(*map(float, place)) for place in itertools.product(*AXES[name]))


def entries(name: str, found: Iterable[ModelErrors], statuses: list[str]) -> Entries:
    """Return what is stored of computed entries; new statuses are appended to the list."""
    shape = (len(CHEAPEST_FIRST), *(len(axis) for axis in AXES[name]))
    logarithm = np.zeros(shape, dtype=np.int16).reshape(len(CHEAPEST_FIRST), -1)
    status = np.zeros_like(logarithm, dtype=np.uint8)
    for index, each in enumerate(found):
        for number in range(len(CHEAPEST_FIRST)):
            model = each.models[number] if each.models else None
            told = each.status if model is None else model.status
            if told not in statuses:
                statuses.append(told)
            status[number, index] = statuses.index(told)
            if model is not None and model.error is not None:
                decades = np.log10(max(model.error, FLOOR))
                logarithm[number, index] = round(decades * model_table.RESOLUTION)
    return Entries(AXES[name], logarithm.reshape(shape), status.reshape(shape))


def suspensions(count: int, seed: int = 1) -> Iterator[Suspension]:
    """Yield random suspensions, by orders of magnitude what industry and laboratories have."""
    random = np.random.default_rng(seed)

    def between(low: float, high: float) -> float:
        return float(np.exp(random.uniform(np.log(low), np.log(high))))

    for _ in range(count):
        yield Suspension(
            diameter=between(20e-6, 2e-3),
            density=between(500.0, 5000.0),
            youngs_modulus=between(1e7, 2e11),
            poisson_ratio=float(random.uniform(0.2, 0.5)),
            restitution=float(random.uniform(0.6, 1.0)),
            solid_fraction=between(1e-4, 0.58),
            granular_temperature=between(1e-5, 1.0),
            domain_length=between(0.01, 1.0),
            charge_scale=f"{between(0.01, 10.0)} uC/kg",
            radial_distribution=str(
                random.choice(["carnahan-starling", "lun-savage", "ma-ahmadi"])
            ),
            drag=str(random.choice(["wen-yu", "gidaspow", "none"])),
        )


def pairs(
    found: ModelTable, name: str, pool: ProcessPoolExecutor
) -> list[tuple[ModelErrors, ModelErrors]]:
    """Return what the table says and what is computed, for random suspensions inside it."""
    numbers = [from_suspension(each, name) for each in suspensions(SUSPENSIONS)]
    exact = pool.map(computed, [(each, name) for each in numbers], chunksize=16)
    told = (found.interpolated(model_table.coordinates(n, name), name) for n in numbers)
    return list(zip(told, exact, strict=True))


def ratios(checked: Iterable[tuple[ModelErrors, ModelErrors]], model: int) -> np.ndarray:
    """Return by which factor, 1 or more, interpolated errors of a model differ from computed."""
    found = []
    for told, exact in checked:
        if told.status == exact.status == OK:
            a, b = told.models[model].error, exact.models[model].error
            if a is not None and b is not None and MATTERS[0] <= max(a, b) <= MATTERS[1]:
                found.append(abs(np.log(a / max(b, FLOOR))))
    return np.exp(np.array(found))


def with_spread(found: ModelTable, name: str, checked: Any) -> ModelTable:
    """Return the table with the spread of one closure set, from half of the suspensions."""
    half = checked[: len(checked) // 2]
    spread = {
        model: round(float(np.quantile(ratios(half, number), 0.95)), 2)
        for number, model in enumerate(CHEAPEST_FIRST)
    }
    return replace(found, spread=found.spread | {name: spread})


def accuracy(found: ModelTable, name: str, checked: Any) -> dict[str, Any]:
    """Return how exact table and advice are for the other half of the suspensions."""
    half = checked[len(checked) // 2 :]
    numbers = [from_suspension(each, name) for each in suspensions(SUSPENSIONS)][-len(half) :]
    verdicts: Counter[str] = Counter()
    for number, (told, exact) in zip(numbers, half, strict=True):
        if exact.status != OK:
            verdicts["no model judged" if told.status != OK else "told, but not judged"] += 1
            continue
        if told.status != OK:
            verdicts["not in the table"] += 1
            continue
        again = found.interpolated(model_table.coordinates(number, name), name)
        order = (*CHEAPEST_FIRST, "full")
        proposed = order.index(advice.choice(again, "table")[0])
        right = order.index(advice.choice(exact, "computed")[0])
        verdicts[
            "the same model"
            if proposed == right
            else "a cheaper model"
            if proposed < right
            else "a dearer model"
        ] += 1
    return {
        "verdicts": dict(verdicts),
        "ratios": {
            model: {
                "count": len(r := ratios(half, number)),
                "median": round(float(np.median(r)), 3),
                "inside": round(float(np.mean(r <= found.spread[name][model])), 3),
            }
            for number, model in enumerate(CHEAPEST_FIRST)
        },
    }


def accuracy_table(found: ModelTable) -> str:
    """Return how exact the table was found to be when it was written."""
    rows = []
    for name in closures.PAPERS_EQUATIONS:
        checked = found.about["accuracy"][name]
        for model, each in checked["ratios"].items():
            factor, inside = found.spread[name][model], f"{each['inside']:.1%}"
            rows.append(
                (name, model, str(each["count"]), f"{each['median']:.3f}", f"{factor:.2f}", inside)
            )
    return table(
        ("closures", "model", "suspensions", "median factor", "told factor", "inside"), rows
    )


def verdicts_table(found: ModelTable) -> str:
    """Return how the advice from the table compares with that from the case itself."""
    names = sorted(
        {k for n in closures.PAPERS_EQUATIONS for k in found.about["accuracy"][n]["verdicts"]}
    )
    rows = [
        (name, *(str(found.about["accuracy"][name]["verdicts"].get(k, 0)) for k in names))
        for name in closures.PAPERS_EQUATIONS
    ]
    return table(("closures", *names), rows)


def resolution_table(found: ModelTable) -> str:
    """Return how much twice the points changed errors where profiles are steepest."""
    rows = [
        (name, str(each["entries"]), str(each["errors"]), f"{each['largest']:.1e}")
        for name, each in found.about["resolution"].items()
    ]
    return table(("closures", "entries", "errors compared", "largest relative change"), rows)


SECTIONS = {
    "table-resolution": resolution_table,
    "table-accuracy": accuracy_table,
    "table-verdicts": verdicts_table,
}


def compute(pool: ProcessPoolExecutor) -> ModelTable:
    """Return the table, without spread and accuracy."""
    statuses = [OK]
    found: dict[str, Entries] = {}
    for name in closures.PAPERS_EQUATIONS:
        tasks = [(place, name) for place in places(name)]
        results = _told(pool.map(entry, tasks, chunksize=64), len(tasks))
        found[name] = entries(name, results, statuses)
    return ModelTable(found, tuple(statuses), {}, {})


def _told(results: Iterable[ModelErrors], count: int) -> Iterator[ModelErrors]:
    """Yield results and print now and then how many there are."""
    for number, result in enumerate(results, 1):
        if number % 2000 == 0:
            print(f"{number} of {count}", flush=True)
        yield result


def main() -> None:
    """Check the table, after computing it with ``--write``."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--write", action="store_true", help="compute and write the table")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes")
    options = parser.parse_args()
    os.environ.update(ONE_THREAD)
    begun = perf_counter()
    context = get_context("spawn")
    with ProcessPoolExecutor(options.workers, mp_context=context, initializer=prepare) as pool:
        found = compute(pool) if options.write else model_table.load()
        print(f"entries after {perf_counter() - begun:.0f} s", flush=True)
        exact = {name: dict.fromkeys(CHEAPEST_FIRST, 1.0) for name in closures.PAPERS_EQUATIONS}
        found = replace(found, spread=exact)
        exactness = {}
        finer = {name: resolution(name, pool) for name in closures.PAPERS_EQUATIONS}
        for name in closures.PAPERS_EQUATIONS:
            checked = pairs(found, name, pool)
            found = with_spread(found, name, checked)
            exactness[name] = accuracy(found, name, checked)
    about = {
        "measure": MEASURE,
        "command": "python -m benchmarks.suitability_table --write",
        "versions": decisive_versions(),
        "resolution": finer,
        "accuracy": exactness,
    }
    found = replace(found, about=about)
    for name, section in SECTIONS.items():
        print(f"{section(found)}\n")
        if options.write:
            write_section(name, section(found), PAGE)
    if options.write:
        found.save(DATA)
    print(f"{perf_counter() - begun:.0f} s")


if __name__ == "__main__":
    main()
