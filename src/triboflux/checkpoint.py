"""Checkpoints of long runs: each is one file that is whole or not there.

A file is a line that names the format, the length of a header, the header in JSON, the arrays one
after another, and a checksum of all that. Nothing in it is ever executed, and no array is made
before the length of the file has been found to be that of all its arrays.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import stat
import time
import tomllib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from io import BufferedReader
from os import PathLike
from pathlib import Path
from typing import Any, cast

import numpy as np

from triboflux.errors import InputError, TribofluxError, shown, shown_path
from triboflux.files import replaced_durably
from triboflux.memory import available_memory

FORMAT_VERSION = 1
"""Version of the file format; raised when older programs could not read newer files."""

_MAGIC = b"triboflux checkpoint\n"
_LENGTH, _DIGEST = 8, 32
_LARGEST_HEADER, _MOST_ARRAYS = 2**24, 10_000
_BLOCK = 2**24
_DTYPES = frozenset(
    ("|b1", "|i1", "|u1", "<i2", "<i4", "<i8", "<u2", "<u4", "<u8", "<f4", "<f8", "<c8", "<c16")
)


class InterruptionError(TribofluxError):
    """A run was asked to stop; what is computed is in its checkpoint."""


@dataclass(frozen=True)
class Checkpoint:
    """Where a run stands.

    Attributes
    ----------
    kind : str
        Of the run, such as ``"solve"`` or ``"kinetic"``.
    case_toml : str
        The case, as `Case.to_toml` writes it.
    versions : mapping of str to str
        Of the packages that decide the digits of the result, triboflux among them.
    arrays : mapping of str to numpy.ndarray
        Numbers or truth values of any shape.
    metadata : mapping
        Anything that JSON can express, such as the state of a random generator.
    """

    kind: str
    case_toml: str
    versions: Mapping[str, str]
    arrays: Mapping[str, np.ndarray]
    metadata: Mapping[str, Any] = field(default_factory=dict[str, Any])


def path_beside(output: str | PathLike[str]) -> Path:
    """Return the path of the checkpoint of a run that writes ``output``."""
    return Path(output).parent / f"{Path(output).name}.checkpoint"


def write(path: str | PathLike[str], checkpoint: Checkpoint) -> None:
    """Write a checkpoint in place of the one before, which stays if anything fails.

    Parameters
    ----------
    path : path-like
        The file; one process may write it at a time, see `files.locked`.
    checkpoint : Checkpoint
        What to write.

    Raises
    ------
    TribofluxError
        If writing fails; the sentence says why.
    """
    target = Path(path)
    partial = _partial(target)
    arrays = {name: _plain(values) for name, values in checkpoint.arrays.items()}
    header = json.dumps(
        {
            "format_version": FORMAT_VERSION,
            "kind": checkpoint.kind,
            "case_toml": checkpoint.case_toml,
            "versions": dict(checkpoint.versions),
            "metadata": dict(checkpoint.metadata),
            "arrays": [[name, a.dtype.str, list(a.shape)] for name, a in arrays.items()],
        }
    ).encode()
    checksum = hashlib.blake2b(digest_size=_DIGEST)
    try:
        with open(partial, "wb") as file:
            for part in (_MAGIC, len(header).to_bytes(_LENGTH, "little"), header):
                checksum.update(part)
                file.write(part)
            for array in arrays.values():
                octets = array.reshape(-1).view(np.uint8).data
                checksum.update(octets)
                file.write(octets)
            file.write(checksum.digest())
        replaced_durably(partial, target)
    except OSError as error:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
        reason = shown(error.strerror or str(error), 200)[1:-1]
        raise TribofluxError(
            f"checkpoint {shown_path(target)} can't be written: {reason}."
        ) from error


def read(
    path: str | PathLike[str], *, kind: str, case_toml: str, versions: Mapping[str, str]
) -> Checkpoint:
    """Read a checkpoint and make sure that it is whole and of this run.

    Parameters
    ----------
    path : path-like
        The file.
    kind, case_toml, versions
        What it has to hold; see `Checkpoint`.

    Returns
    -------
    Checkpoint
        As it was written.

    Raises
    ------
    InputError
        If the file is missing, damaged, of another kind, format, version or case, or too large
        for the memory.
    """
    name = f"checkpoint {shown_path(path)}"
    try:
        status = os.stat(path)
        if not stat.S_ISREG(status.st_mode):
            raise InputError(f"{name} is no regular file.")
        with open(path, "rb") as file:
            header, arrays = _content(file, status.st_size, name)
    except FileNotFoundError:
        raise InputError(f"{name} does not exist.") from None
    except InputError:
        raise
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise InputError(f"{name} can't be read: {shown(str(reason), 200)[1:-1]}.") from None
    found = Checkpoint(
        header["kind"], header["case_toml"], header["versions"], arrays, header["metadata"]
    )
    _require_same(found, kind, case_toml, versions, name)
    return found


def remove(path: str | PathLike[str]) -> None:
    """Remove a checkpoint, and what a killed process left of one, if there is any."""
    for leftover in (Path(path), _partial(Path(path))):
        with suppress(OSError):
            leftover.unlink(missing_ok=True)


class Schedule:
    """When a checkpoint is due.

    Parameters
    ----------
    minutes : float
        Time between two checkpoints; ``inf`` for none by time, 0 for as many as possible.
    steps : int, optional
        Steps between two checkpoints, besides.

    Raises
    ------
    InputError
        If one of them is not allowed.
    """

    def __init__(self, minutes: float = 5.0, steps: int | None = None) -> None:
        if not minutes >= 0.0:
            raise InputError.about("checkpoint_minutes", f"is {minutes}, but must be zero or more")
        if steps is not None and steps < 1:
            raise InputError.about("checkpoint_steps", f"is {steps}, but must be 1 or more")
        self._seconds, self._steps = 60.0 * minutes, math.inf if steps is None else steps
        self._since, self._from = time.monotonic(), 0

    def due(self, steps: int) -> bool:
        """Return whether to write one, ``steps`` being all that the run has made so far."""
        waited = time.monotonic() - self._since
        return waited >= self._seconds or steps - self._from >= self._steps

    def written(self, steps: int) -> None:
        """Begin to wait anew."""
        self._since, self._from = time.monotonic(), steps


def _partial(path: Path) -> Path:
    # always the same, so that those of killed processes do not pile up
    return path.with_name(f".{path.name}.partial")


def _plain(values: np.ndarray) -> np.ndarray:
    """Return an array as it is stored; the layout of its memory does not matter to its reader."""
    array = np.asarray(values, order="C")
    array = array.astype(array.dtype.newbyteorder("<"), copy=False)
    if array.dtype.str not in _DTYPES:
        raise TypeError(f"an array of {array.dtype} can't be stored")
    return array


def _content(
    file: BufferedReader, size: int, name: str
) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Read header and arrays of a file of so many bytes."""
    checksum = hashlib.blake2b(digest_size=_DIGEST)
    damaged = InputError(f"{name} is damaged: its checksum or its length is wrong.")

    def take(count: int) -> bytes:
        part = file.read(count)
        if len(part) < count:
            raise damaged
        checksum.update(part)
        return part

    if size < len(_MAGIC) or take(len(_MAGIC)) != _MAGIC:
        raise InputError(f"{name} is no checkpoint of triboflux.")
    length = int.from_bytes(take(_LENGTH), "little")
    before = len(_MAGIC) + _LENGTH
    if length > min(_LARGEST_HEADER, size - before - _DIGEST):
        raise damaged
    header = _header(take(length), name)
    places = _places(header["arrays"])
    if places is None or before + length + _DIGEST + sum(p[3] for p in places) != size:
        raise damaged
    available = available_memory()
    if available is not None and size > available:
        raise InputError(f"{name} holds {size:,} bytes, more than the memory available.")
    arrays: dict[str, np.ndarray] = {}
    for key, dtype, shape, count in places:
        octets = np.empty(count, np.uint8)
        view = octets.data
        for start in range(0, count, _BLOCK):
            block = view[start : start + _BLOCK]
            if file.readinto(block) != len(block):
                raise damaged
        checksum.update(view)
        arrays[key] = octets.view(dtype).reshape(shape)
    if file.read(_DIGEST + 1) != checksum.digest():
        raise damaged
    return header, arrays


def _header(text: bytes, name: str) -> dict[str, Any]:
    """Return the header if it has the form of one."""
    try:
        header: Any = json.loads(text)
    except (ValueError, RecursionError):
        header = None
    if isinstance(header, dict):
        table = cast("dict[str, Any]", header)
        version = table.get("format_version")
        if version != FORMAT_VERSION and isinstance(version, int):
            raise InputError(
                f"{name} has format_version {shown(version)}, but this triboflux reads "
                f"{FORMAT_VERSION}."
            )
        expected = {"kind": str, "case_toml": str, "versions": dict, "metadata": dict}
        expected |= {"format_version": int, "arrays": list}
        if all(isinstance(table.get(key), kind) for key, kind in expected.items()):
            return table
    raise InputError(f"{name} is damaged: its header is unreadable.")


def _places(listed: list[Any]) -> list[tuple[str, str, tuple[int, ...], int]] | None:
    """Return name, type, shape and bytes of each array, or None if one makes no sense."""
    places: list[tuple[str, str, tuple[int, ...], int]] = []
    if len(listed) > _MOST_ARRAYS:
        return None
    for entry in listed:
        match entry:
            case [str(key), str(dtype), [*shape]] if dtype in _DTYPES and len(shape) <= 32:
                # truth values count as integers for Python; huge lengths would not fit an array
                if not all(type(n) is int and 0 <= n < 2**40 for n in shape):
                    return None
                count = math.prod(cast("list[int]", shape)) * np.dtype(dtype).itemsize
                places.append((key, dtype, tuple(cast("list[int]", shape)), count))
            case _:
                return None
    return places


def _require_same(
    found: Checkpoint, kind: str, case_toml: str, versions: Mapping[str, str], name: str
) -> None:
    """Refuse a checkpoint of another kind of run, of another version or of another case."""
    if found.kind != kind:
        raise InputError(f"{name} belongs to a run of {shown(found.kind)}, not of {shown(kind)}.")
    for package, number in versions.items():
        before = found.versions.get(package)
        if before != number:
            raise InputError(
                f"{name} was written with {package} {shown(before)}, but this is '{number}': "
                "resume it with that version or start anew."
            )
    if found.case_toml != case_toml:
        difference = _difference(found.case_toml, case_toml)
        raise InputError(f"{name} belongs to another case: {difference}.")


def _difference(theirs: str, ours: str) -> str:
    """Say in what two cases differ."""
    try:
        before, now = (_leaves(tomllib.loads(text), "") for text in (theirs, ours))
    except (ValueError, RecursionError):
        return "its case is unreadable"
    for key in [*now, *before]:
        if before.get(key) != now.get(key):
            told = [
                f"is {shown(leaves[key])}" if key in leaves else "is not given"
                for leaves in (before, now)
            ]
            return f"in it {shown(key)[1:-1]} {told[0]}, in this one it {told[1]}"
    return "its case is written differently"


def _leaves(table: dict[str, Any], prefix: str) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in table.items():
        if isinstance(value, dict):
            found |= _leaves(cast("dict[str, Any]", value), f"{prefix}{key}.")
        else:
            found[f"{prefix}{key}"] = value
    return found
