"""Sweeps on local processes and on Dask: the same bits, whatever happens in between."""

import contextlib
import json
import os
import random
import signal
import subprocess
import sys
import time

import numpy as np
import psutil
import pytest
import xarray as xr
import zarr

from tests import sweeps
from tests.processes import READS_CACHE_ONLY, command, surroundings, triboflux
from tests.sweeps import DEADLY, files, tables
from triboflux import sweep_runners
from triboflux.case import Case
from triboflux.errors import TribofluxError
from triboflux.result import load
from triboflux.sweep import Sweep, sweep

MAIN = "from triboflux.cli import main; main()"
SERVE = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from tests.sweeps import serve; serve({name!r})"
)

pytestmark = pytest.mark.skipif(os.name == "nt", reason="needs POSIX signals")


@pytest.fixture(scope="module")
def local(tmp_path_factory):
    """Return a folder with a sweep, its TOML file and the store that two processes make."""
    folder = tmp_path_factory.mktemp("local")
    members = Sweep(**tables())
    (folder / "sweep.toml").write_text(members.to_toml())
    sweep(members, folder / "local.zarr", workers=2).close()
    return folder


# ------------------------------------------------------------------ the real solver


@pytest.mark.slow
def test_members_are_what_single_runs_write(local, tmp_path):
    with xr.open_zarr(local / "local.zarr") as opened:
        flat = opened.load().stack(member=("peclet", "tau_c"))
    status = list(map(str, flat["status"].values))
    assert (status.count("ok"), status.count("refused")) == (11, 1)
    for index in (status.index("refused"), 8):
        table = Sweep(**tables()).table(index)
        # a sweep keeps no other outputs
        table["run"]["outputs"] = 1
        (tmp_path / "case.toml").write_text(Case(**table).to_toml())
        done = triboflux("run", "case.toml", "-o", "out.nc", folder=tmp_path, code=MAIN)
        one = flat.isel(member=index)
        if status[index] == "refused":
            assert done.stderr == f"error: {one['stop_reason'].values}\n"
            assert np.isnan(one["stop_time"])
            continue
        result = load(tmp_path / "out.nc")
        end = result.dataset.isel(time=-1)
        assert str(one["stop_reason"].values) == result.stop_reason
        assert str(one["warnings"].values) == "\n".join(result.warnings)
        assert float(one["stop_time"]) == float(end["time"])
        for name in ("charge", "covariance", "variance", "peak_charge"):
            np.testing.assert_array_equal(one[name], end[name])
        assert int(one["accepted"]) == result.stats["accepted"]
        assert int(one["rejected"]) == result.stats["rejected"]


@contextlib.contextmanager
def cluster(folder, workers=2, nanny=False, **environment):
    """Start a Dask scheduler and workers of one thread on the loopback, and end them."""
    file = folder / "scheduler.json"
    dask = [sys.executable, "-m", "dask"]
    options = {
        "env": surroundings(**environment),
        "stdout": subprocess.DEVNULL,
        "stderr": subprocess.DEVNULL,
        "cwd": folder,
    }
    place = ["--host", "127.0.0.1", "--no-dashboard"]
    started = [
        subprocess.Popen(
            [*dask, "scheduler", *place, "--port", "0", "--scheduler-file", file], **options
        )
    ]
    try:
        more = ["--nthreads", "1", "--nanny" if nanny else "--no-nanny", "--scheduler-file", file]
        for _ in range(workers):
            started.append(subprocess.Popen([*dask, "worker", *place, *more], **options))
        patience = time.monotonic() + 60
        while not file.exists():
            assert time.monotonic() < patience
            time.sleep(0.05)
        yield json.loads(file.read_text())["address"]
    finally:
        for process in reversed(started):
            children = psutil.Process(process.pid).children(recursive=True)
            process.kill()
            process.wait()
            for child in children:
                child.kill()


@pytest.mark.slow
def test_dask_workers_write_the_same_bits(local, tmp_path):
    with cluster(tmp_path) as address:
        done = triboflux(
            *("sweep", local / "sweep.toml", "-o", "dask.zarr", "--scheduler", address),
            folder=tmp_path,
            code=MAIN,
        )
    assert done.stderr == ""
    assert done.returncode == 3
    assert done.stdout == "12 members: 11 ok, 1 refused; written to 'dask.zarr'\n"
    assert files(tmp_path / "dask.zarr") == files(local / "local.zarr")


def started(folder, store, **environment):
    """Start a sweep of a file in a folder from the command line."""
    return subprocess.Popen(
        command("sweep", "sweep.toml", "-o", store, "--workers", "1", code=MAIN),
        cwd=folder,
        env=surroundings(**environment),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def recorded(store):
    """Return how many members a store has now."""
    if not store.exists():
        return 0
    return int(np.count_nonzero(zarr.open_group(store, mode="r")["status"][...] != ""))


def wait_for(process, store, least):
    """Wait until a store has some members; return its process's children."""
    patience = time.monotonic() + 60
    while recorded(store) < least:
        assert process.poll() is None
        assert time.monotonic() < patience
        time.sleep(0.1)
    return psutil.Process(process.pid).children(recursive=True)


@pytest.mark.slow
def test_killed_twice_at_random_moments(tmp_path):
    # many members of many steps, for the sweep to last several seconds on a fast machine too
    given = tables()
    given["case"]["run"]["rtol"] = 1e-12
    given["parameters"]["numbers.peclet"] = [1e3, *np.geomspace(1e5, 1e8, 149)]
    members = Sweep(**given)
    (tmp_path / "sweep.toml").write_text(members.to_toml())
    whole = sweep(members, tmp_path / "whole.zarr", workers=2)
    assert set(map(str, whole["status"].values.ravel())) == {"ok", "refused"}
    killed, seed, kept = tmp_path / "killed.zarr", random.SystemRandom().randrange(10**6), 0
    print("seed", seed)
    moments = random.Random(seed)
    for _ in range(2):
        process = started(tmp_path, "killed.zarr", **READS_CACHE_ONLY)
        children = wait_for(process, killed, kept + moments.randint(1, members.size // 10))
        time.sleep(moments.uniform(0.0, 0.5))
        process.kill()
        process.communicate()
        assert process.returncode == -signal.SIGKILL
        # the workers do not outlive it
        assert psutil.wait_procs(children, timeout=10)[1] == []
        assert kept < recorded(killed) < members.size
        kept = recorded(killed)
    last = []
    sweep(members, killed, workers=1, on_progress=lambda progress: last.append(progress.done))
    assert last[-1] == members.size
    # nothing was computed again
    assert last[0] >= kept
    assert files(killed) == files(tmp_path / "whole.zarr")


@pytest.mark.slow
def test_interrupted_sweep_says_how_to_go_on(tmp_path):
    given = tables()
    given["parameters"]["numbers.peclet"] = list(np.geomspace(1e5, 1e8, 300))
    (tmp_path / "sweep.toml").write_text(Sweep(**given).to_toml())
    process = started(tmp_path, "s.zarr")
    children = wait_for(process, tmp_path / "s.zarr", 1)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == 130
    assert errors == (
        "interrupted: what is finished is kept in 's.zarr'; the same command goes on from there\n"
    )
    assert psutil.wait_procs(children, timeout=10)[1] == []
    assert 0 < recorded(tmp_path / "s.zarr") < 900


# ------------------------------------------------------------------ workers that die


@pytest.fixture
def serving(monkeypatch):
    """Return a function that chooses what worker processes do."""

    def choose(name):
        monkeypatch.setattr(sweep_runners, "_SERVE", SERVE.format(name=name))

    return choose


def test_death_of_a_process_is_recorded(tmp_path, serving):
    serving("deadly")
    members = Sweep(**tables())
    seen = []
    dataset = sweep(members, tmp_path / "s.zarr", workers=2, on_progress=seen.append)
    dead = dataset.sel(peclet=DEADLY)
    assert list(map(str, dead["status"].values)) == ["failed"] * 3
    reason = "its worker process died (exit code 3: it said nothing)"
    assert list(map(str, dead["stop_reason"].values)) == [reason] * 3
    alive = dataset.drop_sel(peclet=DEADLY)
    assert set(map(str, alive["status"].values.ravel())) == {"ok", "refused"}
    assert (seen[-1].done, seen[-1].total, seen[-1].not_ok) == (12, 12, 4)
    assert seen[-1].fraction == 1.0
    # they stay failed, unless asked for
    serving("pretend")
    seen.clear()
    sweep(members, tmp_path / "s.zarr", workers=2, on_progress=seen.append)
    assert seen == []
    sweep(members, tmp_path / "s.zarr", workers=2, retry=True)
    sweep(members, tmp_path / "whole.zarr", workers=1)
    assert files(tmp_path / "s.zarr") == files(tmp_path / "whole.zarr")


def test_exception_in_a_member_is_recorded(tmp_path, serving):
    serving("broken")
    dataset = sweep(Sweep(**tables()), tmp_path / "s.zarr", workers=1)
    one = dataset.sel(peclet=DEADLY).isel(tau_c=0)
    assert str(one["status"].values) == "failed"
    assert str(one["stop_reason"].values) == "ZeroDivisionError: as it had to come"
    assert int((dataset["status"] == "ok").sum()) == 8


def test_worker_that_does_not_start(tmp_path, monkeypatch):
    monkeypatch.setattr(sweep_runners, "_SERVE", "raise ImportError('no such thing')")
    with pytest.raises(TribofluxError, match="does not start: ImportError: no such thing"):
        sweep(Sweep(**tables()), tmp_path / "s.zarr", workers=2)
    assert recorded(tmp_path / "s.zarr") == 0


@pytest.mark.slow
def test_death_of_a_dask_worker_is_recorded(tmp_path, monkeypatch):
    monkeypatch.setattr(sweep_runners, "compute", sweeps.deadly)
    # one worker that is started again and again; its other members are not to blame
    none = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"}
    with cluster(tmp_path, workers=1, nanny=True, **none) as address:
        dataset = sweep(Sweep(**tables()), tmp_path / "s.zarr", scheduler=address)
    dead = dataset.sel(peclet=DEADLY)
    assert list(map(str, dead["stop_reason"].values)) == ["its worker process died"] * 3
    alive = dataset.drop_sel(peclet=DEADLY)
    assert set(map(str, alive["status"].values.ravel())) == {"ok", "refused"}


def test_versions_of_workers_must_agree(monkeypatch):
    from triboflux import sweep_member

    task = sweep_runners.task(Sweep(**tables()).table(0))
    ours = sweep_member.decisive_versions()
    monkeypatch.setattr(sweep_member, "decisive_versions", lambda: ours | {"jax": "99"})
    with pytest.raises(TribofluxError, match="a worker has jax 99, but the sweep is computed with"):
        sweep_member.compute(task)


# ------------------------------------------------------------------ command line


def test_command_line_tells_what_is_done(tmp_path, monkeypatch, capsys):
    from triboflux import cli

    monkeypatch.setattr(
        sweep_runners,
        "on_processes",
        lambda tasks, count: ((i, json.loads(sweeps.pretend(text))) for i, text in tasks),
    )
    (tmp_path / "sweep.toml").write_text(Sweep(**tables()).to_toml())

    def call(*options):
        arguments = ["sweep", str(tmp_path / "sweep.toml"), "-o", str(tmp_path / "s.zarr")]
        monkeypatch.setattr(sys, "argv", ["triboflux", *arguments, *options])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        return ended.value.code, *capsys.readouterr()

    place = repr(str(tmp_path / "s.zarr"))
    assert call() == (3, f"12 members: 11 ok, 1 refused; written to {place}\n", "")
    again = f"12 members: 11 ok, 1 refused; nothing was missing; written to {place}\n"
    assert call() == (3, again, "")
    assert call("--quiet") == (3, "", "")
    code, _, errors = call("--workers", "0")
    assert (code, errors) == (1, "error: workers is 0, but must be from 1 to 1024.\n")


def test_bar_counts_members():
    from types import SimpleNamespace

    from triboflux.terminal import MembersBar

    bar = MembersBar(since=0.0)
    assert bar._text(SimpleNamespace(done=3, total=12, not_ok=0)) == "3 of 12"
    assert bar._text(SimpleNamespace(done=3, total=12, not_ok=2)) == "3 of 12, 2 not ok"
