"""NetCDF files that may have been damaged: sealed when written, examined before they are read.

The libraries beneath NetCDF trust a file: some of those that a bit of damage makes of a good one
keep them busy for ever, or make them ask for any amount of memory. Ours therefore end in a
checksum, which these libraries ignore, and a file with a right one is read at once. A file without,
because another program wrote or edited it, is first read by a process of its own that may fail.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import BinaryIO

from triboflux.errors import InputError, shown
from triboflux.files import written_at_once
from triboflux.memory import available_memory

_MAGIC = b"triboflux sealed"
_DIGEST = 32
_BLOCK = 2**16

_PATIENCE, _BYTES_PER_SECOND = 10.0, 2e6
"""Processor time that a file may take to be read, in seconds, and what larger ones get besides."""
_WAIT = 20
"""Times as much on the clock, for a busy machine or a slow disk."""
# Not by name and path, because the process must import what this one would.
_EXAMINE = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from triboflux.netcdf_probe import main; main(*sys.argv[2:])"
)


@contextmanager
def sealed_at_once(
    path: str | PathLike[str], *, overwrite: bool = False, alone: bool = False
) -> Generator[Path, None, None]:
    """Give a temporary path for a NetCDF file that is sealed and takes its final name at the end.

    Parameters
    ----------
    path, overwrite, alone
        As for `triboflux.files.written_at_once`.

    Yields
    ------
    pathlib.Path
        Where to write meanwhile; closed again before the end.

    Raises
    ------
    InputError
        If the folder is missing or the file exists.
    TribofluxError
        If writing fails; no file is left then.
    """
    with written_at_once(path, overwrite=overwrite, alone=alone) as partial:
        yield partial
        with partial.open("r+b") as file:
            seal = _MAGIC + _digest(file, os.fstat(file.fileno()).st_size)
            file.seek(0, os.SEEK_END)
            file.write(seal)


def require_readable(path: str | PathLike[str], name: str) -> None:
    """Refuse a NetCDF file that is damaged or can't be read, in bounded time and memory.

    Parameters
    ----------
    path : path-like
        An existing file.
    name : str
        How to call it in a sentence.

    Raises
    ------
    InputError
        If its checksum is wrong, or if it has none and a process that tries to read it fails.
    """
    try:
        sealed = _seal_holds(path)
    except OSError as error:
        reason = shown(error.strerror or str(error), 120)[1:-1]
        raise InputError(f"{name} can't be read: {reason}.") from error
    if sealed is None:
        _examine(path, name)
    elif not sealed:
        raise InputError(f"{name} is damaged: its checksum is wrong.")


def _seal_holds(path: str | PathLike[str]) -> bool | None:
    """Return whether a checksum is right, None if there is none."""
    with open(path, "rb") as file:
        size = os.fstat(file.fileno()).st_size - len(_MAGIC) - _DIGEST
        if size < 0:
            return None
        file.seek(size)
        seal = file.read()
        if not seal.startswith(_MAGIC):
            return None
        return seal == _MAGIC + _digest(file, size)


def _digest(file: BinaryIO, size: int) -> bytes:
    """Return the checksum of the first bytes of an open file."""
    checksum = hashlib.blake2b(digest_size=_DIGEST)
    file.seek(0)
    while size > 0:
        part = file.read(min(size, _BLOCK))
        if not part:
            break
        checksum.update(part)
        size -= len(part)
    return checksum.digest()


def _examine(path: str | PathLike[str], name: str) -> None:
    """Let another process read all of a file, and refuse it if that fails."""
    seconds = _PATIENCE + os.path.getsize(path) / _BYTES_PER_SECOND
    memory = available_memory()
    paths = json.dumps([entry or os.getcwd() for entry in sys.path])
    limits = [str(int(seconds)), str(-1 if memory is None else memory)]
    try:
        done = subprocess.run(
            [sys.executable, "-c", _EXAMINE, paths, os.fspath(path), *limits],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            check=False,
            timeout=_WAIT * seconds,
        )
    except subprocess.TimeoutExpired:
        raise InputError(f"{name} is damaged: reading it does not end.") from None
    if done.returncode == 0:
        return
    told = done.stdout.decode("utf-8", "replace").strip().split("\n")[-1]
    if done.returncode == 1 and told:
        raise InputError(f"{name} is no readable NetCDF file: {shown(told, 120)[1:-1]}.")
    raise InputError(
        f"{name} is damaged: a process that tries to read it "
        f"{'does not end' if _ran_out_of_time(done.returncode) else 'dies'}."
    )


def _ran_out_of_time(code: int) -> bool:
    import signal

    return hasattr(signal, "SIGXCPU") and code in (-signal.SIGXCPU, -signal.SIGKILL)
