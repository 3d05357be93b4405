"""What has to hold of every damaged file that a command reads."""

import itertools
import json
import random
import shutil

from tests.cases import data
from tests.in_process import call, names, sentence_of
from tests.mutated_bytes import mutated
from tests.sweeps import pretend, tables
from tests.whole_runs import COMMANDS, assert_equal
from triboflux import simulate_to_file, solve_to_file, sweep_runners
from triboflux.case import Case
from triboflux.checkpoint import InterruptionError
from triboflux.errors import InputError
from triboflux.result import load
from triboflux.sweep import Sweep, sweep
from triboflux.sweep_store import readable

KINDS = ("case", "result", "theirs", "checkpoint", "records", "store")
SEAL = 48
TIMES = [0.0, 1e-3, 5e-3, 8e-3]


class Damage:
    """Good files of every kind, which are damaged and read again and again.

    Parameters
    ----------
    folder : pathlib.Path
        Empty.
    kinetic : bool
        Whether checkpoints are of simulated particles.
    """

    def __init__(self, folder, kinetic=False):
        self._folder, self._good, self._bad = folder, folder / "good", folder / "bad"
        self._good.mkdir()
        self._command = "kinetic" if kinetic else "run"
        changes = {"grid__points": [8], "run__t_end": 1e-2, "run__outputs": TIMES}
        particles = {"particles": 1000, "ensembles": 2, "dilute": True}
        self._case = Case(**data(**changes), kinetic=particles if kinetic else None)
        (self._good / "case.toml").write_text(self._case.to_toml())
        compute = simulate_to_file if kinetic else solve_to_file
        compute(self._case, self._good / "whole.nc")
        self._whole = load(self._good / "whole.nc")
        asked = itertools.count(1)
        try:
            compute(self._case, self._good / "out.nc", interrupted=lambda: next(asked) >= 2)
        except InterruptionError:
            pass
        started = Case(**data(grid__points=[8], initial__charge=[], initial__file="whole.nc"))
        (self._good / "started.toml").write_text(started.to_toml())
        self._members = Sweep(**tables())
        self._held = self._swept(self._good / "s.zarr")

    def check(self, kind, chance=None):
        """Damage a file of one of `KINDS`, read it, and return whether it was refused."""
        chance = chance or random.Random()
        shutil.rmtree(self._bad, ignore_errors=True)
        shutil.copytree(self._good, self._bad)
        return getattr(self, f"_check_{kind}")(chance)

    def _damaged(self, path, chance, cut=0):
        content = path.read_bytes()
        path.write_bytes(mutated(content[: len(content) - cut], chance))

    def _check_case(self, chance):
        path = self._bad / "case.toml"
        self._damaged(path, chance)
        try:
            Case.from_toml(path)
        except InputError as refused:
            command = chance.choice(["run", "kinetic", "compare", "chart"])
            options = [self._bad / w if w.startswith("out") else w for w in COMMANDS[command]]
            before = names(self._bad)
            assert sentence_of(call(command, path, *options, "--quiet")) == str(refused)
            assert names(self._bad) == before
            return True
        return False

    def _check_result(self, chance, cut=0):
        self._damaged(self._bad / "whole.nc", chance, cut)
        try:
            load(self._bad / "whole.nc")
        except InputError as refused:
            ended = call("run", self._bad / "started.toml", "-o", self._bad / "new.nc")
            assert sentence_of(ended) == str(refused)
            assert not (self._bad / "new.nc").exists()
            return True
        return False

    def _check_theirs(self, chance):
        return self._check_result(chance, SEAL)

    def _check_checkpoint(self, chance, ending=""):
        out = self._bad / "out.nc"
        self._damaged(self._bad / f"out.nc.checkpoint{ending}", chance)
        ended = call(self._command, self._bad / "case.toml", "-o", out, "--resume", "--quiet")
        if ended.code == 0:
            # only what lies behind the records that count may be anything
            assert ending
            assert_equal(load(out), self._whole)
            return False
        sentence_of(ended)
        assert not out.exists()
        return True

    def _check_records(self, chance):
        return self._check_checkpoint(chance, ".outputs")

    def _check_store(self, chance):
        files = sorted(file for file in (self._bad / "s.zarr").rglob("*") if file.is_file())
        self._damaged(chance.choice(files), chance)
        try:
            found = self._swept(self._bad / "s.zarr")
        except InputError as refused:
            assert str(refused).isprintable()
            return True
        assert found.equals(self._held)
        return False

    def _swept(self, path):
        def compute(work, count):
            return ((index, json.loads(pretend(text))) for index, text in work)

        usual, sweep_runners.on_processes = sweep_runners.on_processes, compute
        try:
            with sweep(self._members, path) as opened, readable("store"):
                return opened.load()
        finally:
            sweep_runners.on_processes = usual
