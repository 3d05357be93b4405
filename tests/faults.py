"""Real faults for tests: a disk that is full, a process that is killed."""

import functools
import shutil
import subprocess

import pytest

# A small disk of one's own, made in a name space of one's own, which needs no rights.
_MOUNT = 'mount -t tmpfs -o size="$1" none "$2" && cd "$2" && shift 2 && exec "$@"'


@functools.cache
def _small_disks():
    if shutil.which("unshare") is None or shutil.which("mount") is None:
        return False
    probe = ["unshare", "-rm", "sh", "-c", "mount -t tmpfs -o size=64k none /tmp"]
    return subprocess.run(probe, check=False, capture_output=True, timeout=30).returncode == 0


def on_small_disk(command, folder, size):
    """Return a command that runs in ``folder`` with an empty disk of ``size`` mounted there."""
    if not _small_disks():
        pytest.skip("this system lets no user mount a disk")
    return ["unshare", "-rm", "sh", "-c", _MOUNT, "sh", size, str(folder), *command]
