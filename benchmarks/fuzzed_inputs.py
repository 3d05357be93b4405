"""Inputs made by chance, good and bad, given to the commands that read them; see `faults`."""

from __future__ import annotations

import random
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from benchmarks.timing import table

ALLOWED, SIMULATED, WRONG, DAMAGED = 60, 40, 1500, 300
"""Inputs of each kind; the first compile most of them anew."""


def drawn(strategy: Any, count: int, chance: int, check: Callable[..., object]) -> Counter[str]:
    """Return how often each outcome of a check came, over so many inputs."""
    outcomes: Counter[str] = Counter()

    @seed(chance)
    @settings(
        max_examples=count,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(strategy)
    def each(value: Any) -> None:
        outcomes[str(check(*value))] += 1

    each()
    return outcomes


def inputs_table(scale: float, chance: int) -> str:
    """Return the table of inputs; whatever breaks a promise is raised."""
    from tests.damaged_files import KINDS, Damage
    from tests.whole_cases import PROGRAMS, texts, wrong_texts
    from tests.whole_runs import COMMANDS, check_run, check_wrong
    from triboflux import segments

    def many(count: int) -> int:
        return max(round(scale * count), 1)

    segments.STEPS_SMALL = 2
    warnings.simplefilter("error")
    counts = st.integers(1, 4)
    # some of each kind, because every program takes seconds to compile
    some = random.Random(chance).sample(PROGRAMS, 4)
    rows: list[tuple[str, Counter[str]]] = []
    found = drawn(st.tuples(texts(some), counts), many(ALLOWED), chance, check_run)
    rows.append(("case files that are allowed, for `run`", found))
    particles = [((8,), "kinetic")]
    found = drawn(st.tuples(texts(particles), counts), many(SIMULATED), chance, check_run)
    rows.append(("the same for `kinetic`", found))

    def wrong(pair: tuple[str, Any, bool], command: str) -> str:
        return _refused(check_wrong(*pair, command))

    commands = st.sampled_from(sorted(COMMANDS))
    found = drawn(st.tuples(wrong_texts(), commands), many(WRONG), chance, wrong)
    rows.append((f"case files with one thing wrong, for {len(COMMANDS)} commands", found))
    with tempfile.TemporaryDirectory() as folder:
        rows += _damaged(Damage, KINDS, Path(folder), many(DAMAGED), chance)
    told = [(name, str(sum(found.values())), _said(found)) for name, found in rows]
    return table(("input", "tried", "ended"), told)


def _damaged(
    make: Any, kinds: tuple[str, ...], folder: Path, count: int, chance: int
) -> list[tuple[str, Counter[str]]]:
    names = {
        "case": "damaged case files, for 4 commands",
        "result": "damaged NetCDF results of ours, in Python and as `initial.file`",
        "theirs": "the same without our checksum",
        "checkpoint": "damaged checkpoints, for `run` and `kinetic`",
        "records": "damaged outputs beside them",
        "store": "damaged stores of sweeps",
    }
    found = {kind: Counter[str]() for kind in kinds}
    for name in ("run", "kinetic"):
        (folder / name).mkdir()
        damage = make(folder / name, kinetic=name == "kinetic")
        decide = random.Random(chance)
        for kind in kinds:
            both = kind in ("checkpoint", "records")
            for _ in range(count // 2 if both else count * (name == "run")):
                found[kind][_refused(damage.check(kind, decide))] += 1
    return [(names[kind], outcomes) for kind, outcomes in found.items()]


def _refused(refused: bool) -> str:
    return "refused in one sentence" if refused else "allowed or without effect"


def _said(outcomes: Counter[str]) -> str:
    return ", ".join(f"{count} {name}" for name, count in outcomes.most_common())
