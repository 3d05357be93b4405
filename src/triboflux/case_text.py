"""TOML text to plain tables and back, safe against hostile files."""

from __future__ import annotations

import os
import re
import stat
import tomllib
from os import PathLike
from pathlib import Path
from typing import Any

from triboflux.errors import InputError, shown, shown_path

LARGEST_FILE = 2**20
"""Most bytes of a case file."""

_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")

# tomllib takes quadratic time on dotted keys of many parts; a case nests three deep
_MANY_PARTS = re.compile(
    r"""(?:(?<![\w"'-])(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){16}[\w"'-]"""
)


def read_case_file(path: str | PathLike[str]) -> tuple[str, str]:
    """Read a case file without trusting it.

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    text : str
        Its content.
    name : str
        How to call it in a sentence.

    Raises
    ------
    InputError
        If it is missing, no regular file, not readable, too large or not UTF-8.
    """
    name = f"case file {shown_path(path)}"
    try:
        status = os.stat(path)
        if not stat.S_ISREG(status.st_mode):
            kind = "a folder" if stat.S_ISDIR(status.st_mode) else "not a regular file"
            raise InputError(f"{name} is {kind}, but must be a TOML file.")
        _check_size(name, status.st_size)
        with open(path, "rb") as file:
            content = file.read(LARGEST_FILE + 1)
        _check_size(name, len(content))
        return content.decode("utf-8-sig"), name
    except FileNotFoundError:
        raise InputError(f"{name} does not exist.") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{name} is not UTF-8 text (byte {error.start}).") from None
    except InputError:
        raise
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise InputError(f"{name} can't be read: {shown(str(reason))[1:-1]}.") from None


def _check_size(name: str, size: int) -> None:
    if size > LARGEST_FILE:
        raise InputError(f"{name} has {size:,} bytes, but may have at most {LARGEST_FILE:,}.")


def case_table(text: str, folder: Path, name: str) -> dict[str, Any]:
    """Parse TOML and resolve the path of the initial state.

    Parameters
    ----------
    text : str
        The TOML document.
    folder : pathlib.Path
        What a relative ``initial.file`` is relative to.
    name : str
        How to call the document in a sentence.

    Returns
    -------
    dict
        Nested tables, not validated.

    Raises
    ------
    InputError
        If it is too large, nested too deeply, or not TOML.
    """
    _check_size(name, len(text))
    control = _CONTROL.search(text)
    if control is not None:
        line = text.count("\n", 0, control.start()) + 1
        code = f"U+{ord(control.group()):04X}"
        raise InputError(f"{name} contains the control character {code} on line {line}.")
    if _MANY_PARTS.search(text):
        raise InputError(f"{name} is nested too deeply.")
    try:
        table = tomllib.loads(text)
    except RecursionError:
        raise InputError(f"{name} is nested too deeply.") from None
    except ValueError as error:
        # besides its own errors tomllib lets through that of an integer of too many digits
        own = isinstance(error, tomllib.TOMLDecodeError)
        reason = shown(str(error), 160)[1:-1] if own else "a number has too many digits"
        raise InputError(f"{name} is not valid TOML: {reason}.") from None
    tables: dict[str, dict[str, Any]] = {k: v for k, v in table.items() if isinstance(v, dict)}
    file: object = tables.get("initial", {}).get("file")
    if isinstance(file, str):
        tables["initial"]["file"] = _joined(folder, file)
    return table


def _joined(folder: Path, file: str) -> str:
    return file if folder == Path() else os.path.join(folder, file)


def case_text(table: dict[str, Any]) -> str:
    """Write nested tables as TOML.

    Parameters
    ----------
    table : dict
        The fields of a case, without None.

    Returns
    -------
    str
        The TOML document; empty lists are left out.
    """
    import tomli_w  # only writers need it, readers start faster

    initial: dict[str, Any] = table["initial"]
    filled = {key: value for key, value in initial.items() if value != ()}
    return tomli_w.dumps({**table, "initial": filled})
