"""One process at a time may write a file."""

import os
import signal
import subprocess

import pytest

from tests.processes import command, surroundings
from triboflux.errors import InputError, TribofluxError
from triboflux.files import locked, written_at_once

HOLD = """
import sys, time
from triboflux.files import locked
with locked("out.nc"):
    print("locked", flush=True)
    sys.stdin.readline()
"""


@pytest.fixture
def holder(tmp_path):
    """Start another process that has the lock of out.nc until it is told to end."""
    process = subprocess.Popen(
        command(code=HOLD),
        cwd=tmp_path,
        env=surroundings(),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "locked\n"
    yield process
    process.kill()
    process.communicate()


def test_two_processes_cannot_write_the_same_file(tmp_path, holder):
    expected = r"^output '.*out.nc' is being written by another process\.$"
    with pytest.raises(InputError, match=expected), locked(tmp_path / "out.nc"):
        pass
    with locked(tmp_path / "another.nc"):
        pass
    holder.communicate("end\n", timeout=30)
    with locked(tmp_path / "out.nc"):
        assert os.listdir(tmp_path) == [".out.nc.lock"]
    assert os.listdir(tmp_path) == []


def test_a_killed_process_leaves_no_lock(tmp_path, holder):
    holder.send_signal(signal.SIGKILL)
    holder.wait(30)
    with locked(tmp_path / "out.nc"):
        pass
    assert os.listdir(tmp_path) == []


def test_nor_can_two_threads(tmp_path):
    with locked(tmp_path / "out.nc"), pytest.raises(InputError), locked(tmp_path / "out.nc"):
        pass


def test_a_lock_that_was_removed_meanwhile_is_no_lock(tmp_path, monkeypatch):
    """Another process may remove the file between its opening and its locking."""
    import fcntl

    usual, calls = fcntl.flock, []

    def removed_before(handle, operation):
        calls.append(handle)
        if len(calls) == 1:
            (tmp_path / ".out.nc.lock").unlink()
        usual(handle, operation)

    monkeypatch.setattr(fcntl, "flock", removed_before)
    with locked(tmp_path / "out.nc"):
        assert len(calls) == 2
        with pytest.raises(InputError), locked(tmp_path / "out.nc"):
            pass


def test_a_folder_that_vanishes_does_not_hide_what_happened(tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()
    with pytest.raises(KeyError, match="first"), locked(folder / "out.nc"):
        (folder / ".out.nc.lock").unlink()
        folder.rmdir()
        raise KeyError("first")
    with pytest.raises(TribofluxError, match="No such file"), locked(folder / "out.nc"):
        pass


def test_what_a_killed_process_left_of_a_file_is_written_over(tmp_path):
    with written_at_once(tmp_path / "out.nc", alone=True) as partial:
        partial.write_text("half of it")
        left = partial.read_bytes()
        name = partial
    name.write_bytes(left)
    with written_at_once(tmp_path / "out.nc", overwrite=True, alone=True) as partial:
        assert partial == name
        partial.write_text("all of it")
    assert os.listdir(tmp_path) == ["out.nc"]
    assert (tmp_path / "out.nc").read_text() == "all of it"
