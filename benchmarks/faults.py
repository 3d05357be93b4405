"""How many inputs were tried and faults injected, and what was lost; for docs/reliability.md.

Run as ``python -m benchmarks.faults --write``, in about ten minutes; ``--scale 0.1`` tries a
tenth of everything. Inputs are tried in this process, faults are injected into real ones: a run of
a model, a simulation of particles and a sweep, each again and again until the chain of faults is
over, and then to its end. What ends then must be, bit for bit, what was not disturbed.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.timing import ROOT, machine_facts, table, write_section

PAGE = ROOT / "docs" / "reliability.md"
SECTIONS = ("inputs", "faults")
KINDS = {"run": "run", "kinetic": "kinetic", "sweep": "sweep"}
SIGNALS = {"SIGKILL": signal.SIGKILL, "SIGTERM": signal.SIGTERM, "SIGINT": signal.SIGINT}
CODES = {0, *(-number for number in SIGNALS.values()), 128 + signal.SIGTERM, 128 + signal.SIGINT}
CHAIN = 3
"""Faults before a run is let to its end."""

# Slower than in earnest, so that most faults fall into the run and not into its start, which is
# longer than in earnest, too: until the program itself begins, Ctrl-C ends it at once.
SLOW = """
import signal, time
signal.signal(signal.SIGINT, signal.SIG_DFL)
from triboflux import cli, terminal
terminal.use_compilation_cache()
from triboflux import segments
from triboflux.kinetic import segments as of_particles
segments.STEPS_SMALL = 2

def slowed(kind, delay):
    usual = kind.advance

    def advance(self, *arguments, **options):
        usual(self, *arguments, **options)
        time.sleep(delay)

    kind.advance = advance

slowed(segments.Segments, 0.1)
slowed(of_particles.ParticleSegments, 0.05)
signal.signal(signal.SIGINT, signal.default_int_handler)
cli.main()
"""
MAIN = """
import signal
signal.signal(signal.SIGINT, signal.SIG_DFL)
from triboflux.cli import main
signal.signal(signal.SIGINT, signal.default_int_handler)
main()
"""
PARTICLES = """
[numbers]
peclet = 1e6
tau_c = 0.05
energy_ratio = 30.0
length_ratio = 192.0
restitution = 1.0
[grid]
points = [16]
[initial]
charge = [ { mode = [1], sine = -1.0 } ]
[run]
t_end = 0.6
outputs = 40
[kinetic]
particles = 20_000
ensembles = 2
"""
# Runs on a small disk until it is full, then with more room, then on one that is read-only.
ON_A_DISK = """
cp {kept}/*.toml .
touch {kept}/first {kept}/second {kept}/third
"$@" {eager} 2>{kept}/first; code=$?
echo $code >{kept}/code
mount -o remount,size=32m .
[ $code = 0 ] || "$@" {resume} 2>{kept}/second || exit 11
cp -r {out} {kept}/
mount -o remount,ro .
"$@" {again} 2>{kept}/third && exit 12
exit 0
"""


class Job(NamedTuple):
    """One of the three things that are disturbed."""

    kind: str
    out: str
    arguments: tuple[str, ...]
    code: str


JOBS = (
    Job("run", "out.nc", ("run", "case.toml", "-o", "out.nc", "--quiet"), SLOW),
    Job("kinetic", "out.nc", ("kinetic", "particles.toml", "-o", "out.nc", "--quiet"), SLOW),
    Job("sweep", "s.zarr", ("sweep", "sweep.toml", "-o", "s.zarr", "--quiet"), MAIN),
)
EAGER = ("--checkpoint-steps", "1", "--resume")


def prepared(folder: Path) -> Path:
    """Write the three cases into a folder."""
    from tests.sweeps import tables
    from tests.test_run_faults import CASE
    from triboflux.sweep import Sweep

    folder.mkdir(exist_ok=True)
    few = {"numbers.peclet": [1e5, 1e6], "numbers.tau_c": [1e-4, 1e-3]}
    (folder / "case.toml").write_text(CASE.to_toml())
    (folder / "particles.toml").write_text(PARTICLES)
    (folder / "sweep.toml").write_text(Sweep(**tables(parameters=few)).to_toml())
    return folder


def started(job: Job, folder: Path, *options: str) -> subprocess.Popen[str]:
    """Start a job in a folder."""
    from tests.processes import command, surroundings

    return subprocess.Popen(
        command(*job.arguments, *options, code=job.code),
        cwd=folder,
        env=surroundings(),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )


def options_of(job: Job) -> tuple[str, ...]:
    """Return the options with which a job goes on wherever it stands."""
    return () if job.kind == "sweep" else EAGER


def contents(job: Job, folder: Path) -> Any:
    """Return what a job has written, without what tells of clocks."""
    import xarray as xr

    from triboflux.result import load

    if job.kind == "sweep":
        with xr.open_zarr(folder / job.out) as opened:
            return opened.load()
    return load(folder / job.out).dataset.drop_attrs()


class Undisturbed(NamedTuple):
    """What a job ends with, and how many seconds it takes."""

    content: Any
    seconds: float


def undisturbed(job: Job, folder: Path) -> Undisturbed:
    """Run a job in peace, twice, because the first compiles."""
    seconds = 0.0
    for name in ("first", "second"):
        began = time.perf_counter()
        place = prepared(folder / f"{job.kind}-{name}")
        finish(job, place)
        seconds = time.perf_counter() - began
    return Undisturbed(contents(job, place), seconds)


def finish(job: Job, folder: Path) -> None:
    """Let a job go on to its end."""
    process = started(job, folder, *options_of(job))
    _, errors = process.communicate(timeout=300)
    told = [line for line in errors.splitlines() if not line.startswith(("note: ", "warning"))]
    if process.returncode or told:
        raise AssertionError(f"{job.kind} ended with {process.returncode}: {errors}")


def is_clean(errors: str) -> bool:
    """Return whether a disturbed process told what happened to it, in sentences."""
    kinds = ("error: ", "interrupted: ", "note: ", "warning")
    return all(line.startswith(kinds) for line in errors.splitlines())


def well_told(job: Job, code: int, expected: set[int], errors: str) -> bool:
    """Return whether a process ended as documented, and show if it did not."""
    if code in expected and is_clean(errors):
        return True
    print(f"{job.kind} ended with {code}: {errors}", file=sys.stderr)
    return False


def signalled(job: Job, whole: Undisturbed, number: int, folder: Path, chance: Any) -> Counter[str]:
    """Send signals at random moments, then let the job end; return what happened."""
    found: Counter[str] = Counter()
    prepared(folder)
    for _ in range(CHAIN):
        process = started(job, folder, *options_of(job))
        time.sleep(chance.uniform(0.1, 0.9) * whole.seconds)
        process.send_signal(number)
        _, errors = process.communicate(timeout=300)
        found["injected"] += process.returncode != 0
        found["unclean"] += not well_told(job, process.returncode, CODES, errors)
        # a signal may come when all is written already
        if process.returncode == 0 or (job.kind != "sweep" and (folder / job.out).exists()):
            break
    return found + ended(job, whole, folder)


def ended(job: Job, whole: Undisturbed, folder: Path) -> Counter[str]:
    """Let a job end if it has not, and compare."""
    if job.kind == "sweep" or not (folder / job.out).exists():
        finish(job, folder)
    same = contents(job, folder).identical(whole.content)
    # a result that was being written when its process was killed
    left = [name for name in os.listdir(folder) if name.startswith((".", "out.nc."))]
    if left:
        print(f"{job.kind} left {', '.join(left)}", file=sys.stderr)
    return Counter({"ends": 1, "lost": int(not same), "hidden files left": len(left)})


def vanished(job: Job, whole: Undisturbed, folder: Path, chance: Any) -> Counter[str]:
    """Rename the folder of a job at a random moment."""
    folder, moved = folder / "here", folder / "there"
    folder.parent.mkdir()
    prepared(folder)
    absolute = tuple(
        str(folder / w) if w.endswith((".nc", ".toml", ".zarr")) else w for w in job[2]
    )
    process = started(job._replace(arguments=absolute), folder.parent, *options_of(job))
    time.sleep(chance.uniform(0.3, 0.9) * whole.seconds)
    folder.rename(moved)
    _, errors = process.communicate(timeout=300)
    found = Counter({"injected": int(process.returncode != 0)})
    found["unclean"] = int(not well_told(job, process.returncode, {0, 1}, errors))
    return found + ended(job, whole, moved)


def on_a_disk(job: Job, whole: Undisturbed, folder: Path, chance: Any) -> Counter[str]:
    """Run a job on a disk that is full, then read-only."""
    from tests.faults import on_small_disk
    from tests.processes import command, surroundings

    kept, disk = prepared(folder), folder / "disk"
    disk.mkdir()
    sweeping = job.kind == "sweep"
    script = ON_A_DISK.format(
        kept=kept,
        out=job.out,
        eager="" if sweeping else " ".join(EAGER),
        resume="" if sweeping else "--resume",
        # a sweep that is complete is only read, which a read-only disk allows
        again="" if sweeping else "--overwrite",
    )
    size = f"{chance.randrange(16, 90)}k" if not sweeping else f"{chance.randrange(60, 200)}k"
    run = command(*job.arguments, code=job.code)
    done = subprocess.run(
        on_small_disk(["sh", "-c", script, "sh", *run], disk, size),
        env=surroundings(),
        capture_output=True,
        check=False,
        text=True,
        timeout=600,
    )
    code = int((kept / "code").read_text())
    told = [(kept / name).read_text() for name in ("first", "second", "third")]
    found = Counter({"injected": int(code != 0) + 1, "ends": 1})
    found["unclean"] = int(code not in (0, 1) or done.returncode not in (0, 12 * sweeping))
    found["unclean"] += sum(not is_clean(text) for text in told)
    found["lost"] = int(done.returncode == 11 or not contents(job, kept).identical(whole.content))
    if found["unclean"] or found["lost"]:
        print(job.kind, size, code, done.returncode, *told, done.stderr, file=sys.stderr)
    return found


def injections() -> dict[str, Callable[..., Counter[str]]]:
    """Return what is done to a job, by its name in the table."""

    def by_signal(number: int) -> Callable[..., Counter[str]]:
        return lambda job, whole, *rest: signalled(job, whole, number, *rest)

    found = {name: by_signal(number) for name, number in SIGNALS.items()}
    return {
        **found,
        "folder renamed": vanished,
        "disk full, then read-only": on_a_disk,
    }


def faults(chains: int, folder: Path, chance: Any) -> Iterator[tuple[str, str, Counter[str]]]:
    """Inject every fault into every job, in so many chains each; yield what came of it."""
    for job in JOBS:
        whole = undisturbed(job, folder)
        for name, inject in injections().items():
            total: Counter[str] = Counter()
            for number in range(chains):
                place = folder / f"{job.kind}-{name.replace(' ', '-')}-{number}"
                total += inject(job, whole, place, chance)
            print(name, job.kind, dict(total), file=sys.stderr, flush=True)
            yield name, job.kind, total


def faults_table(chains: int, chance: Any) -> str:
    """Return the table of faults."""
    rows: dict[str, list[str]] = {name: [name] for name in injections()}
    sums: dict[str, Counter[str]] = {name: Counter() for name in rows}
    with scratch() as folder:
        for name, _, total in faults(chains, folder, chance):
            rows[name].append(f"{total['injected']} in {total['ends']}")
            sums[name] += total
    for name, total in sums.items():
        rows[name] += [nothing(total["lost"]), nothing(total["unclean"])]
    header = ("fault, at random moments", *(f"`{kind}`" for kind in KINDS), "lost", "not told well")
    return table(header, rows.values())


def nothing(count: int) -> str:
    """Return a count for a table."""
    return str(count) if count else "nothing"


@contextmanager
def scratch() -> Iterator[Path]:
    """Give a folder with a cache of compiled programs that no killed process has damaged."""
    with tempfile.TemporaryDirectory() as name:
        os.environ["JAX_COMPILATION_CACHE_DIR"] = str(Path(name, "cache"))
        os.environ |= {"TRIBOFLUX_CACHE_DIR": "", "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0"}
        yield Path(name)


def main() -> None:
    """Print both tables, or write them into the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="fill docs/reliability.md")
    parser.add_argument("--scale", type=float, default=1.0, help="part of everything to try")
    parser.add_argument("--only", choices=SECTIONS, help="one of the two tables")
    given = parser.parse_args()
    seed = random.randrange(2**32)
    about = f"Seed {seed}. {machine_facts()}"
    for name in SECTIONS if given.only is None else (given.only,):
        if name == "inputs":
            from benchmarks.fuzzed_inputs import inputs_table

            text = inputs_table(given.scale, seed)
        else:
            text = faults_table(max(round(2 * given.scale), 1), random.Random(seed))
        text = f"{text}\n\n{about}"
        print(text, flush=True)
        if given.write:
            write_section(name, text, PAGE)


if __name__ == "__main__":
    main()
