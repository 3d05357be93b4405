"""A file of equal records that grows while a run goes on and is read after any end of it.

Every record has its own checksum. How many records count is said elsewhere, in a checkpoint: those
beyond are what a killed run wrote last, and are written over.
"""

from __future__ import annotations

import errno
import hashlib
import json
import math
import os
from collections.abc import Mapping
from contextlib import suppress
from os import PathLike
from pathlib import Path
from types import TracebackType

import numpy as np

from triboflux.errors import InputError, TribofluxError, shown, shown_path

_MAGIC = b"triboflux records\n"
_DIGEST = 8


class RecordFile:
    """Records of named arrays of doubles in a file; a context manager.

    Parameters
    ----------
    path : path-like
        The file.
    layout : mapping of str to tuple of int
        Shape of every array of a record.
    run : str
        A name of the run, which a checkpoint of it repeats.
    count : int, optional
        How many records of an existing file to keep; without it the file is made anew.

    Raises
    ------
    InputError
        If an existing file is missing, damaged, of another run or has fewer records.
    TribofluxError
        If it can't be written.
    """

    def __init__(
        self,
        path: str | PathLike[str],
        layout: Mapping[str, tuple[int, ...]],
        run: str,
        count: int | None = None,
    ) -> None:
        self._path, self._layout = Path(path), dict(layout)
        self._name = f"outputs {shown_path(path)}"
        text = json.dumps({"run": run, "layout": {k: list(v) for k, v in layout.items()}})
        self._header = _MAGIC + text.encode() + b"\n"
        self._size = 8 * sum(math.prod(shape) for shape in layout.values()) + _DIGEST
        self._count = 0
        try:
            if count is None:
                self._handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o644)
            else:
                self._handle = os.open(path, os.O_RDWR)
        except FileNotFoundError:
            if count is None:
                raise self._failed(errno.ENOENT) from None
            raise InputError(f"{self._name} of the checkpoint is missing.") from None
        except OSError as error:
            raise self._failed(error.errno) from error
        try:
            self._open(count)
        except BaseException:
            os.close(self._handle)
            raise

    def __enter__(self) -> RecordFile:
        """Return itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close the file, which stays."""
        os.close(self._handle)

    def __len__(self) -> int:
        """Return the number of records."""
        return self._count

    def __getitem__(self, index: int) -> dict[str, np.ndarray]:
        """Return a record; raises InputError if it is damaged."""
        if not 0 <= index < self._count:
            raise IndexError(index)
        octets = os.pread(self._handle, self._size, self._place(index))
        content, checksum = octets[:-_DIGEST], octets[-_DIGEST:]
        if len(octets) != self._size or _digest(content, index) != checksum:
            raise InputError(f"{self._name} is damaged in record {index}.")
        values = np.frombuffer(content, "<f8")
        record: dict[str, np.ndarray] = {}
        start = 0
        for name, shape in self._layout.items():
            stop = start + math.prod(shape)
            record[name] = values[start:stop].reshape(shape)
            start = stop
        return record

    def append(self, record: Mapping[str, np.ndarray]) -> None:
        """Write one more record.

        Parameters
        ----------
        record : mapping of str to numpy.ndarray
            Of the layout.

        Raises
        ------
        TribofluxError
            If writing fails; the records before stay.
        """
        parts = [np.asarray(record[name], "<f8").reshape(-1) for name in self._layout]
        content = np.concatenate(parts).tobytes()
        try:
            # a file in a folder that is gone can be written to, and nobody will ever see it
            if not os.path.samestat(os.fstat(self._handle), os.stat(self._path)):
                raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))
            self._write(content + _digest(content, self._count), self._place(self._count))
        except OSError as error:
            raise self._failed(error.errno) from error
        self._count += 1

    def synchronise(self) -> None:
        """Wait until all records are on the disk.

        Raises
        ------
        TribofluxError
            If the disk refuses.
        """
        try:
            os.fsync(self._handle)
        except OSError as error:
            raise self._failed(error.errno) from error

    def remove(self) -> None:
        """Remove the file's name."""
        with suppress(OSError):
            self._path.unlink(missing_ok=True)

    def _open(self, count: int | None) -> None:
        if count is None:
            try:
                self._write(self._header, 0)
            except OSError as error:
                raise self._failed(error.errno) from error
            return
        if os.pread(self._handle, len(self._header), 0) != self._header:
            raise InputError(f"{self._name} does not belong to the checkpoint.")
        if os.fstat(self._handle).st_size < self._place(count):
            raise InputError(f"{self._name} is damaged: it ends before record {count}.")
        self._count = count

    def _place(self, index: int) -> int:
        return len(self._header) + index * self._size

    def _write(self, content: bytes, place: int) -> None:
        done = 0
        while done < len(content):
            # in parts, because a system writes no more than 2 GiB at once
            done += os.pwrite(self._handle, memoryview(content)[done : done + 2**30], place + done)

    def _failed(self, code: int | None) -> TribofluxError:
        reason = shown(os.strerror(code or 0), 200)[1:-1]
        return TribofluxError(f"{self._name} can't be written: {reason}.")


def _digest(content: bytes, index: int) -> bytes:
    salt = index.to_bytes(8, "little")
    return hashlib.blake2b(content, digest_size=_DIGEST, salt=salt).digest()
