"""The store of a sweep: a Zarr group that is valid after every single write.

The arrays are made before the first member runs, so the store can be opened at any time. Members
are written in the order in which they come. The chunk of ``status`` always goes last and takes its
place by a renaming, so a member has a status only if all else of it is there.
"""

from __future__ import annotations

import json
import math
import os
import shutil
import time
import warnings
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from triboflux.errors import InputError, TribofluxError, shown, shown_path
from triboflux.files import require_folder
from triboflux.sweep_layout import VARIABLES, lay_out, require_laid_out
from triboflux.sweep_member import FIELDS, decisive_versions, decoded

if TYPE_CHECKING:
    from triboflux.sweep import Sweep

FORMAT_VERSION = 1
"""Version of the store's format; raised when older programs could not read newer stores."""
KIND = "sweep"

_PATIENCE = 0.5


class SweepStore:
    """A sweep's store, opened for writing by this process alone; a context manager.

    Parameters
    ----------
    path : path-like
        Folder of the Zarr group; made if absent.
    members : Sweep
        What the store holds or will hold.

    Raises
    ------
    InputError
        If the path holds anything but this sweep, or another process writes it.
    """

    def __init__(self, path: str | PathLike[str], members: Sweep) -> None:
        self._path, self._members = Path(path), members
        self._name = f"store {shown_path(path)}"
        self._pending: dict[tuple[int, ...], list[tuple[int, Mapping[str, Any]]]] = {}
        self._flushed = -math.inf
        self._lock: int | None = None

    def __enter__(self) -> SweepStore:
        """Make the store if it is absent, lock it and read what is done."""
        with self._told():
            if not os.path.lexists(self._path):
                self._create()
            self._lock = self._locked()
            try:
                self._open()
            except BaseException:
                self._unlock()
                raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Write what has come and give the lock back."""
        try:
            self.flush()
        finally:
            self._unlock()

    @property
    def done(self) -> int:
        """Number of members that have a status, written or not yet."""
        return int(np.count_nonzero(self._status))

    @property
    def not_ok(self) -> int:
        """Number of those whose status is not ok."""
        return int(np.count_nonzero(self._status == _NOT_OK))

    def missing(self, *, retry: bool = False) -> list[int]:
        """Return the members to compute.

        Parameters
        ----------
        retry : bool
            Those that failed, too.
        """
        wanted = (self._status == _MISSING) | (retry & self._failed)
        return [int(index) for index in np.flatnonzero(wanted)]

    def add(self, index: int, record: Mapping[str, Any]) -> None:
        """Take a member's record, to be written by `flush`.

        Parameters
        ----------
        index : int
            Of the member.
        record : mapping
            From `triboflux.sweep_member.compute`.
        """
        place = np.unravel_index(index, self._members.shape)
        chunk = tuple(int(i) // size for i, size in zip(place, self._chunk, strict=True))
        self._pending.setdefault(chunk, []).append((index, record))
        self._status[index] = _OK if record["status"] == "ok" else _NOT_OK

    def flush(self, *, patiently: bool = False) -> None:
        """Write what has been added.

        Parameters
        ----------
        patiently : bool
            Only if the last time was half a second ago.

        Raises
        ------
        TribofluxError
            If writing fails.
        """
        if not self._pending or (patiently and time.monotonic() - self._flushed < _PATIENCE):
            return
        with self._told():
            for chunk in sorted(self._pending):
                self._write(chunk, self._pending[chunk])
            self._pending.clear()
        self._flushed = time.monotonic()

    def _write(self, chunk: tuple[int, ...], records: list[tuple[int, Mapping[str, Any]]]) -> None:
        starts = [i * size for i, size in zip(chunk, self._chunk, strict=True)]
        region = tuple(slice(s, s + size) for s, size in zip(starts, self._chunk, strict=True))
        places = [
            tuple(int(i) - s for i, s in zip(np.unravel_index(index, self._members.shape), starts))  # noqa: B905 -- as many as dimensions
            for index, _ in records
        ]
        for name in (*(name for name in VARIABLES if name != "status"), "status"):
            array: Any = self._group[name]
            with readable(self._name):
                block: Any = array[region]
            for place, (_, record) in zip(places, records, strict=True):
                block[place] = array.fill_value
                if name in FIELDS and name in record.get("fields", {}):
                    values = decoded(record["fields"][name])
                    block[(*place, *map(slice, values.shape))] = values
                elif name in record:
                    block[place] = record[name]
            array[region] = block

    def _create(self) -> None:
        """Make the empty store beside its place and move it there in one step."""
        import zarr as untyped

        zarr: Any = untyped
        require_folder(self._path.parent)
        partial = self._path.with_name(f".{self._path.name}.partial")
        shutil.rmtree(partial, ignore_errors=True)
        group = zarr.create_group(partial, zarr_format=3, attributes=self._attributes())
        lay_out(group, self._members)
        with warnings.catch_warnings():
            # not yet part of the format's specification, but what xarray opens quickly
            warnings.filterwarnings("ignore", message="Consolidated metadata")
            zarr.consolidate_metadata(partial)
        os.rename(partial, self._path)

    def _attributes(self) -> dict[str, Any]:
        return {
            "title": str(self._members.case.get("title", "")),
            "kind": KIND,
            "format_version": FORMAT_VERSION,
            "units": "scaled",
            "sweep_toml": self._members.to_toml(),
            "versions_json": json.dumps(decisive_versions()),
        }

    def _open(self) -> None:
        """Open the store, check that it is this sweep's, and read what is done."""
        import zarr as untyped

        zarr: Any = untyped
        try:
            group = zarr.open_group(self._path, mode="r+")
            attributes = dict(group.attrs)
        except PermissionError:
            raise
        except Exception:  # Zarr raises many kinds on anything that is no group
            raise InputError(
                f"{self._name} exists, but is no store of a sweep: choose another name."
            ) from None
        self._require_same(attributes)
        for leftover in self._path.rglob("*.partial"):
            leftover.unlink(missing_ok=True)
        with readable(self._name):
            require_laid_out(group, self._members)
            texts = np.asarray(group["status"][...]).ravel()
        self._group = group
        self._chunk = group["status"].chunks
        self._status = np.where(texts == "", _MISSING, np.where(texts == "ok", _OK, _NOT_OK))
        self._failed = texts == "failed"

    def _require_same(self, attributes: dict[str, Any]) -> None:
        """Refuse a store of another kind, format, sweep or version."""
        if attributes.get("kind") != KIND:
            raise InputError(f"{self._name} is no store of a sweep: choose another name.")
        version = attributes.get("format_version")
        if version != FORMAT_VERSION:
            raise InputError(
                f"{self._name} has format_version {shown(version)}, but this triboflux writes "
                f"{FORMAT_VERSION}."
            )
        ours = self._attributes()
        if attributes.get("sweep_toml") != ours["sweep_toml"]:
            difference = self._difference(str(attributes.get("sweep_toml")))
            raise InputError(
                f"{self._name} holds another sweep: {difference}; choose another name."
            )
        with readable(self._name):
            before = dict(json.loads(str(attributes.get("versions_json"))))
        for name, number in decisive_versions().items():
            if before.get(name) != number:
                raise InputError(
                    f"{self._name} was begun with {name} {before.get(name)}, but this is {number}: "
                    "finish it with that version or choose another name."
                )

    def _difference(self, toml: str) -> str:
        """Return what distinguishes the sweep in the store from ours."""
        from triboflux.sweep import Sweep

        try:
            other = Sweep.from_toml_text(toml)
        except InputError as error:
            return f"one that is not allowed, {str(error).rstrip('.')}"
        mine, theirs = _leaves(self._members), _leaves(other)
        for key in [*mine, *theirs]:
            if mine.get(key) != theirs.get(key):
                told = [
                    f"is {shown(leaves[key])}" if key in leaves else "is not given"
                    for leaves in (theirs, mine)
                ]
                return f"in it {key} {told[0]}, in this one it {told[1]}"
        return "the order of its parameters differs"

    @contextmanager
    def _told(self) -> Generator[None, None, None]:
        """Turn what the file system refuses into one sentence."""
        try:
            yield
        except OSError as error:
            reason = shown(error.strerror or str(error), 200)[1:-1]
            raise TribofluxError(f"{self._name} can't be written: {reason}.") from error

    def _locked(self) -> int | None:
        """Lock the folder against other processes; the lock ends with this one."""
        try:
            import fcntl
        except ImportError:  # Windows
            return None
        handle = os.open(self._path, os.O_RDONLY)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(handle)
            raise InputError(f"{self._name} is being written by another process.") from None
        except OSError:  # a file system without locks
            pass
        return handle

    def _unlock(self) -> None:
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


_MISSING, _OK, _NOT_OK = 0, 1, 2


@contextmanager
def readable(name: str) -> Generator[None, None, None]:
    """Turn what Zarr raises on a damaged store into one sentence.

    Parameters
    ----------
    name : str
        How to call the store.

    Raises
    ------
    InputError
        If what is done within fails in another way than ours or the file system's.
    TribofluxError
        If the file system refuses, or the store has vanished.
    """
    try:
        yield
    except TribofluxError:
        raise
    except OSError as error:
        reason = shown(error.strerror or str(error), 120)[1:-1].rstrip(".")
        raise TribofluxError(f"{name} can't be read: {reason}.") from error
    except Exception as error:  # of many kinds, from Zarr and its codecs
        reason = shown(str(error).partition("\n")[0], 120)[1:-1].rstrip(".")
        raise InputError(
            f"{name} is damaged ({reason or type(error).__name__}): choose another name, or remove "
            "it to begin anew."
        ) from error


def _leaves(members: Sweep) -> dict[str, Any]:
    """Return what defines a sweep, by dotted key."""
    found: dict[str, Any] = {"sweep.mode": members.mode}

    def walk(table: dict[str, Any], prefix: str) -> None:
        for key, value in table.items():
            if isinstance(value, dict):
                walk(cast("dict[str, Any]", value), f"{prefix}{key}.")
            else:
                found[f"{prefix}{key}"] = value

    walk(members.case, "")
    return found | {f"sweep.parameters.{k}": v for k, v in members.parameters.items()}
