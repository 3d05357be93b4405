"""Writing files: all or nothing, never over another one unasked, one process at a time."""

from __future__ import annotations

import errno
import os
import re
import shutil
import tempfile
import uuid
from collections.abc import Generator
from contextlib import contextmanager, suppress
from os import PathLike
from pathlib import Path

from triboflux.errors import InputError, TribofluxError, shown, shown_path

_LITTLE = 2**18
"""Bytes; a disk with less room is full."""

_partial: set[Path] = set()
_temporary: set[Path] = set()
_ATTEMPTS = 5


def require_folder(path: str | PathLike[str]) -> None:
    """Refuse an output folder that is missing or can't be written to.

    Parameters
    ----------
    path : path-like
        The folder.

    Raises
    ------
    InputError
        Names the folder.
    """
    folder = Path(path)
    if not folder.is_dir():
        reason = "is not a folder" if folder.exists() else "does not exist"
        raise InputError(f"output folder {shown_path(folder)} {reason}.")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f"output folder {shown_path(folder)} can't be written to.")


def require_writable(path: str | PathLike[str], *, overwrite: bool = False) -> None:
    """Refuse a path that can't become an output file.

    Parameters
    ----------
    path : path-like
        The file to write.
    overwrite : bool
        Accept an existing file.

    Raises
    ------
    InputError
        If the folder is missing, the path is a folder, or the file exists.
    """
    target = Path(path)
    try:
        require_folder(target.parent)
        if target.is_dir():
            raise InputError(f"output {shown_path(target)} is a folder, but must be a file.")
        exists = target.exists() or target.is_symlink()
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"output {shown_path(target)} is no possible file name.") from None
    if exists and not overwrite:
        raise InputError(
            f"output {shown_path(target)} exists and is replaced only with --overwrite "
            "(overwrite=True in Python)."
        )


def require_file(path: str | PathLike[str], name: str) -> None:
    """Refuse a path that is no file to read.

    Parameters
    ----------
    path : path-like
        The path.
    name : str
        How to call it in a sentence.

    Raises
    ------
    InputError
        If it is missing or a folder.
    """
    if not os.path.isfile(path):
        raise InputError(f"{name} is {'a folder' if os.path.isdir(path) else 'missing'}.")


@contextmanager
def written_at_once(
    path: str | PathLike[str], *, overwrite: bool = False, alone: bool = False
) -> Generator[Path, None, None]:
    """Give a temporary path whose file takes its final name only if all goes well.

    Parameters
    ----------
    path : path-like
        The file to write.
    overwrite : bool
        Replace an existing file.
    alone : bool
        No other process writes this file meanwhile. Then the temporary path is always the same, so
        that what a killed process left there is written over.

    Yields
    ------
    pathlib.Path
        Where to write meanwhile, in the same folder; the suffix is that of ``path``.

    Raises
    ------
    InputError
        If the folder is missing or the file exists.
    TribofluxError
        If writing fails; no file is left then.
    """
    target = Path(path)
    if target in _partial:
        # already a temporary file, whose final name the caller tells in errors
        yield target
        return
    require_writable(target, overwrite=overwrite)
    # in the same folder, because only within a file system is a renaming atomic
    name = f"{target.name}.partial" if alone else uuid.uuid4().hex
    partial = target.with_name(f".{name}{target.suffix[:20]}")
    _partial.add(partial)
    try:
        yield partial
        require_writable(target, overwrite=overwrite)
        replaced_durably(partial, target)
    except (OSError, RuntimeError) as error:
        told = str(error).replace(str(partial), str(target))
        if isinstance(error, RuntimeError) and _is_full(target.parent):
            told = os.strerror(errno.ENOSPC)
        reason = shown(told, 200)[1:-1]
        raise TribofluxError(f"output {shown_path(target)} can't be written: {reason}.") from error
    finally:
        partial.unlink(missing_ok=True)
        _partial.discard(partial)


def _is_full(folder: Path) -> bool:
    """Return whether a disk is full, which the libraries for NetCDF do not tell."""
    try:
        return shutil.disk_usage(folder).free < _LITTLE
    except OSError:
        return False


def replaced_durably(partial: Path, target: Path) -> None:
    """Give a written file its final name such that even a power failure leaves all or nothing.

    Parameters
    ----------
    partial : pathlib.Path
        The complete file, closed, in the folder of ``target``.
    target : pathlib.Path
        Its final name; a file of that name is replaced.

    Raises
    ------
    OSError
        If the file system refuses.
    """
    _synchronise(partial, os.O_RDWR)
    os.replace(partial, target)
    if os.name == "posix":  # Windows opens no folders
        _synchronise(target.parent, os.O_RDONLY)


def _synchronise(path: Path, flags: int) -> None:
    handle = os.open(path, flags)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@contextmanager
def temporary_folder() -> Generator[Path, None, None]:
    """Give an empty folder that is removed afterwards, after an error too.

    Yields
    ------
    pathlib.Path
        In the system's place for temporary files.

    Raises
    ------
    TribofluxError
        If it can't be made.
    """
    try:
        folder = Path(tempfile.mkdtemp(prefix="triboflux-"))
    except OSError as error:
        reason = shown(str(error), 200)[1:-1].rstrip(".")
        raise TribofluxError(f"no temporary folder can be made: {reason}.") from error
    _temporary.add(folder)
    try:
        yield folder
    finally:
        _remove(folder)
        _temporary.discard(folder)


def _remove(folder: Path) -> None:
    """Remove a folder, even while another thread still adds to it."""
    for _ in range(_ATTEMPTS):
        shutil.rmtree(folder, ignore_errors=True)
        if not folder.exists():
            return


@contextmanager
def folder_written_at_once(
    path: str | PathLike[str], *, pattern: re.Pattern[str], overwrite: bool = False
) -> Generator[Path, None, None]:
    """Give an empty temporary folder that takes its final name only if all goes well.

    Parameters
    ----------
    path : path-like
        The folder to write.
    pattern : re.Pattern
        Names of the files that it will hold.
    overwrite : bool
        Replace an existing folder that holds only files with such names.

    Yields
    ------
    pathlib.Path
        Where to write files meanwhile.

    Raises
    ------
    InputError
        If the folder can't be made, or exists and is not to be replaced.
    TribofluxError
        If writing fails; nothing is left then.
    """
    target = Path(path)
    require_writable_folder(target, pattern=pattern, overwrite=overwrite)
    partial, previous = (target.with_name(f".{uuid.uuid4().hex}") for _ in range(2))
    _temporary.update((partial, previous))
    try:
        partial.mkdir()
        yield partial
        for file in partial.iterdir():
            _synchronise(file, os.O_RDWR)
        require_writable_folder(target, pattern=pattern, overwrite=overwrite)
        if target.exists():
            os.replace(target, previous)
        os.replace(partial, target)
    except OSError as error:
        told = shown(str(error).replace(str(partial), str(target)), 200)[1:-1]
        raise TribofluxError(f"output {shown_path(target)} can't be written: {told}.") from error
    finally:
        for folder in (partial, previous):
            _remove(folder)
            _temporary.discard(folder)


def require_writable_folder(
    path: str | PathLike[str], *, pattern: re.Pattern[str], overwrite: bool = False
) -> None:
    """Refuse a path that can't become an output folder of files with certain names.

    Parameters
    ----------
    path : path-like
        The folder to write.
    pattern : re.Pattern
        Names of its files; a folder that holds something else is never replaced.
    overwrite : bool
        Accept an existing folder.

    Raises
    ------
    InputError
        Says what is in the way.
    """
    target = Path(path)
    require_folder(target.parent)
    if not (target.exists() or target.is_symlink()):
        return
    if target.is_symlink() or not target.is_dir():
        raise InputError(f"output {shown_path(target)} is no folder, but must become one.")
    foreign = [file.name for file in target.iterdir() if not pattern.fullmatch(file.name)]
    if foreign:
        raise InputError(
            f"output folder {shown_path(target)} holds {shown(min(foreign))}, which is no output, "
            "and is never replaced."
        )
    if not overwrite:
        raise InputError(
            f"output folder {shown_path(target)} exists and is replaced only with --overwrite "
            "(overwrite=True in Python)."
        )


def mark_partial(path: Path) -> None:
    """Let a file be removed by `discard_partial_files`, until `mark_kept`."""
    _partial.add(path)


def mark_kept(path: Path) -> None:
    """Let a file stay whatever happens; it need not have been partial."""
    _partial.discard(path)


def discard_partial_files() -> None:
    """Remove what other threads are writing, before the process ends under them."""
    for partial in tuple(_partial):
        partial.unlink(missing_ok=True)
    for folder in tuple(_temporary):
        _remove(folder)


@contextmanager
def locked(path: str | PathLike[str], name: str | None = None) -> Generator[None, None, None]:
    """Keep other processes from writing a file; the lock ends with the process, however it ends.

    Parameters
    ----------
    path : path-like
        The output file; the lock is a hidden file beside it, removed at the end.
    name : str, optional
        How to call the output in sentences.

    Raises
    ------
    InputError
        If another process has the lock.
    TribofluxError
        If the folder can't be written to.
    """
    target = Path(path)
    name = name or f"output {shown_path(target)}"
    lock = target.with_name(f".{target.name}.lock")
    try:
        handle = _acquired(lock)
    except BlockingIOError:
        raise InputError(f"{name} is being written by another process.") from None
    except OSError as error:
        reason = shown(error.strerror or str(error), 200)[1:-1]
        raise TribofluxError(f"{name} can't be written: {reason}.") from error
    mark_partial(lock)
    try:
        yield
    finally:
        # while it is held, so that nobody can be waiting for it; the folder may have vanished
        with suppress(OSError):
            lock.unlink(missing_ok=True)
        mark_kept(lock)
        os.close(handle)


def _acquired(lock: Path) -> int:
    """Return the handle of a locked file that is in its place."""
    try:
        import fcntl
    except ImportError:  # Windows
        return os.open(lock, os.O_RDWR | os.O_CREAT)
    while True:
        handle = os.open(lock, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(handle)
            raise
        except OSError:  # a file system without locks
            return handle
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(handle), os.stat(lock)):
                return handle
        # it was removed by whoever had it before, and may have been made anew
        os.close(handle)
