"""Writing files: all of a file or nothing, never over another one unasked."""

from __future__ import annotations

import os
import uuid
from collections.abc import Generator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

from triboflux.errors import InputError, TribofluxError, shown, shown_path

_partial: set[Path] = set()


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


@contextmanager
def written_at_once(
    path: str | PathLike[str], *, overwrite: bool = False
) -> Generator[Path, None, None]:
    """Give a temporary path whose file takes its final name only if all goes well.

    Parameters
    ----------
    path : path-like
        The file to write.
    overwrite : bool
        Replace an existing file.

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
    partial = target.with_name(f".{uuid.uuid4().hex}{target.suffix[:20]}")
    _partial.add(partial)
    try:
        yield partial
        require_writable(target, overwrite=overwrite)
        os.replace(partial, target)
    except (OSError, RuntimeError) as error:
        reason = shown(str(error).replace(str(partial), str(target)), 200)[1:-1]
        raise TribofluxError(f"output {shown_path(target)} can't be written: {reason}.") from error
    finally:
        partial.unlink(missing_ok=True)
        _partial.discard(partial)


def discard_partial_files() -> None:
    """Remove what other threads are writing, before the process ends under them."""
    for partial in tuple(_partial):
        partial.unlink(missing_ok=True)
