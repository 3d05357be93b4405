"""Reads all of a NetCDF file in a process that may fail; see `triboflux.netcdf_file`."""

from __future__ import annotations

import math
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import netCDF4


def main(path: str, seconds: str, memory: str) -> None:
    """Read a file within limits, and end the process with a sentence on what is wrong, if anything.

    Parameters
    ----------
    path : str
        The file.
    seconds : str
        Processor time for this.
    memory : str
        Bytes that may be taken besides what the libraries have; negative for any number.
    """
    _limit(int(seconds), int(memory))
    try:
        _read(path, int(memory))
    except Exception as error:  # of many kinds, and from several libraries
        lines = f"{error}".splitlines() or [type(error).__name__]
        print(lines[0].replace(path, Path(path).name))
        sys.exit(1)


def declared_bytes(file: netCDF4.Dataset) -> int:
    """Return how much memory the variables of an open file take, by the sizes that it tells."""
    return sum(_declared(variable) for variable in file.variables.values())


def _declared(variable: Any) -> int:
    # a text of any length has no size of its own
    return math.prod(variable.shape) * getattr(variable.dtype, "itemsize", 8)


def _read(path: str, memory: int) -> None:
    with netCDF4.Dataset(path) as file:
        file.set_auto_maskandscale(False)
        declared = declared_bytes(file)
        if 0 <= memory < declared:
            raise ValueError(f"it holds {declared:,} bytes, more than the memory available")
        for owner in (file, *file.variables.values()):
            for name in owner.ncattrs():
                owner.getncattr(name)
        for variable in file.variables.values():
            variable[...]


def _limit(seconds: int, memory: int) -> None:
    try:
        import resource
    except ImportError:  # Windows
        return
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    if memory < 0:
        return
    with suppress(OSError, ValueError):
        taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (taken + memory, taken + memory))
