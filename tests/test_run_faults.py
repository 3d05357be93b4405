"""Real faults of `triboflux run`: killed, terminated, full disk, vanished folder, two at once."""

import os
import signal
import subprocess
import time

import numpy as np
import pytest

from tests.cases import data
from tests.faults import on_small_disk
from tests.processes import command, surroundings
from tests.test_long_runs import TIMES, assert_same
from triboflux.case import Case
from triboflux.result import load

pytestmark = pytest.mark.skipif(os.name == "nt", reason="needs POSIX signals")

# Runs the command line with a solver that tells every segment and then waits.
SLOW = """
import os, sys, time
from triboflux import cli, terminal
terminal.use_compilation_cache()
from triboflux import segments
segments.STEPS_SMALL = 2
usual = segments.Segments.advance
delays = [float(delay) for delay in os.environ["DELAYS"].split()]

def advance(self, records, **options):
    usual(self, records, **options)
    print("segment", flush=True)
    time.sleep(delays.pop(0) if len(delays) > 1 else delays[0])

segments.Segments.advance = advance
cli.main()
"""
CASE = Case(
    **data(run__t_end=0.6, run__outputs=TIMES, run__stop_at_peak_charge=0.5, run__rtol=1e-8)
)


def arguments(*options, output="out.nc"):
    return command("run", "case.toml", "-o", output, "--quiet", *options, code=SLOW)


def start(folder, *options, delays="0", output="out.nc"):
    """Start a run in a folder and return its process."""
    (folder / "case.toml").write_text(CASE.to_toml())
    return subprocess.Popen(
        arguments(*options, output=output),
        cwd=folder,
        env=surroundings(TRIBOFLUX_CACHE_DIR="", DELAYS=delays),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def finished(process, code=0):
    """Wait for a process, check its exit code and return what it wrote to stderr."""
    _, errors = process.communicate(timeout=400)
    assert process.returncode == code, errors
    assert "Traceback" not in errors
    return errors


def wait_for_segments(process, count):
    for _ in range(count):
        assert process.stdout.readline() == "segment\n"


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory):
    """Give the runs a cache of compiled programs of their own, which a killed one may damage."""
    with pytest.MonkeyPatch.context() as changed:
        folder = tmp_path_factory.mktemp("cache")
        changed.setenv("JAX_COMPILATION_CACHE_DIR", str(folder))
        yield


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return the result of a run that nothing happens to."""
    folder = tmp_path_factory.mktemp("whole")
    assert finished(start(folder)) == ""
    assert sorted(os.listdir(folder)) == ["case.toml", "out.nc"]
    return load(folder / "out.nc")


def test_a_run_that_is_told_to_stop_goes_on_later(tmp_path, whole):
    for number, code in ((signal.SIGTERM, 143), (signal.SIGINT, 130)):
        process = start(tmp_path, "--resume", delays="0.2")
        wait_for_segments(process, 3)
        process.send_signal(number)
        first, second = finished(process, code).splitlines()
        assert first.startswith("interrupted: finishing the running segment of steps")
        assert second.startswith("interrupted: the run up to t = ")
        assert second.endswith(
            "is in 'out.nc.checkpoint' and goes on with --resume (resume=True in Python)."
        )
        kept = ["case.toml", "out.nc.checkpoint", "out.nc.checkpoint.outputs"]
        assert sorted(os.listdir(tmp_path)) == kept
    assert finished(start(tmp_path, "--resume")) == ""
    assert_same(load(tmp_path / "out.nc"), whole)
    assert sorted(os.listdir(tmp_path)) == ["case.toml", "out.nc"]


def test_two_runs_cannot_write_the_same_file_and_told_twice_one_stops_at_once(tmp_path):
    first = start(tmp_path, delays="0 600")
    wait_for_segments(first, 2)
    told = "error: output 'out.nc' is being written by another process.\n"
    assert finished(start(tmp_path, "--overwrite"), 1) == told
    first.send_signal(signal.SIGTERM)
    assert first.stderr.readline().startswith("interrupted: finishing the running segment")
    first.send_signal(signal.SIGINT)
    assert finished(first, 130) == "interrupted: nothing was written\n"
    assert os.listdir(tmp_path) == ["case.toml"]


def test_a_run_that_is_killed_again_and_again_loses_nothing(tmp_path, whole):
    generator = np.random.default_rng()
    for _ in range(2):
        process = start(tmp_path, "--resume", "--checkpoint-steps", "1", delays="0.05")
        wait_for_segments(process, 2)
        time.sleep(generator.uniform(0.0, 0.2))
        process.kill()
        process.communicate()
    assert not (tmp_path / "out.nc").exists()
    assert (tmp_path / "out.nc.checkpoint").exists()
    assert finished(start(tmp_path, "--resume")) == ""
    assert_same(load(tmp_path / "out.nc"), whole)
    assert sorted(os.listdir(tmp_path)) == ["case.toml", "out.nc"]


def test_a_folder_that_vanishes_is_told_and_what_is_in_it_is_good(tmp_path, whole):
    folder, moved = tmp_path / "folder", tmp_path / "moved"
    folder.mkdir()
    output = folder / "out.nc"
    process = start(folder, "--checkpoint-steps", "1", delays="0.2", output=output)
    wait_for_segments(process, 4)
    folder.rename(moved)
    sentence = finished(process, 1)
    assert sentence.startswith("error: ")
    assert sentence.count("\n") == 1
    assert "No such file or directory" in sentence
    assert finished(start(moved, "--resume")) == ""
    assert_same(load(moved / "out.nc"), whole)


# Runs on a small disk: until it is full, then with more room; then with a disk that is read-only.
ON_A_DISK = """
set -e
cp {folder}/case.toml.kept case.toml
"$@" --checkpoint-steps 1 2>{folder}/first && exit 11
ls >{folder}/names
mount -o remount,size=8m .
"$@" --resume 2>{folder}/second
mount -o remount,ro .
"$@" --overwrite 2>/dev/stdout && exit 12
cp out.nc {folder}
"""


def test_a_run_survives_a_disk_that_is_full(tmp_path, whole):
    disk, kept = tmp_path / "disk", tmp_path / "kept"
    disk.mkdir()
    kept.mkdir()
    (kept / "case.toml.kept").write_text(CASE.to_toml())
    script = ON_A_DISK.format(folder=kept)
    done = subprocess.run(
        on_small_disk(["sh", "-c", script, "sh", *arguments()], disk, "44k"),
        env=surroundings(TRIBOFLUX_CACHE_DIR="", DELAYS="0"),
        capture_output=True,
        check=False,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    first = (kept / "first").read_text()
    assert first.startswith("error: ")
    assert "No space left on device; the run up to t = " in first
    assert first.count("\n") == 1
    assert "out.nc.checkpoint\n" in (kept / "names").read_text()
    assert (kept / "second").read_text() == ""
    assert "error: output folder '.' can't be written to." in done.stdout
    assert_same(load(kept / "out.nc"), whole)
