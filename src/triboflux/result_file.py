"""Writing a result as NetCDF part by part, for results that do not fit in the memory."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from os import PathLike
from typing import TYPE_CHECKING, Any

import netCDF4

from triboflux.netcdf_file import sealed_at_once
from triboflux.result import Result

if TYPE_CHECKING:
    import xarray as xr

PART = 2**17
"""Numbers of a field that are written at once, and compressed together."""

_COMPRESSION: dict[str, Any] = {"zlib": True, "complevel": 1, "fill_value": False}


def times_at_once(points: int) -> int:
    """Return how many times of fields with so many points to write at once."""
    return max(PART // points, 1)


def write_result(
    path: str | PathLike[str],
    times: int,
    parts: Iterable[xr.Dataset],
    final_attributes: Callable[[], Mapping[str, str]],
    *,
    units: str,
    overwrite: bool,
    before_each: Callable[[], None],
) -> Result:
    """Write the datasets of a run, all of them or nothing.

    Parameters
    ----------
    path : path-like
        The file to write.
    times, parts, final_attributes
        As for `write_in_parts`; scaled.
    units : str
        ``"scaled"`` or ``"si"``.
    overwrite : bool
        Replace an existing file.
    before_each : callable
        Called before each part; may raise to stop.

    Returns
    -------
    Result
        The last time, with all attributes.

    Raises
    ------
    TribofluxError
        If writing fails; no file is left then.
    """
    last: list[xr.Dataset] = []

    def converted() -> Iterator[xr.Dataset]:
        for dataset in parts:
            before_each()
            part = Result(dataset)
            part = part.to_si() if units == "si" else part
            last[:] = [part.dataset.isel(time=slice(-1, None))]
            yield part.dataset

    # a run that is kept has locked its output
    with sealed_at_once(path, overwrite=overwrite, alone=True) as partial:
        write_in_parts(partial, times, converted(), final_attributes)
    return Result(last[0].assign_attrs(final_attributes()))


def write_in_parts(
    path: str | PathLike[str],
    times: int,
    parts: Iterable[xr.Dataset],
    final_attributes: Callable[[], Mapping[str, str]],
) -> None:
    """Write the datasets of consecutive times as one, such as `Result.to_netcdf` would.

    Parameters
    ----------
    path : path-like
        The file to write.
    times : int
        How many times all parts have together.
    parts : iterable of xarray.Dataset
        In order of time; the first decides what is the same for all.
    final_attributes : callable
        Returns attributes that are known only when all parts have been made.
    """
    done = 0
    with netCDF4.Dataset(path, "w", format="NETCDF4") as file:
        for part in parts:
            if not done:
                _define(file, part, times)
            stop = done + part.sizes["time"]
            for name, values in part.variables.items():
                if "time" in values.dims:
                    file[str(name)][done:stop] = values.values
            done = stop
        file.setncatts(dict(final_attributes()))


def _define(file: Any, part: xr.Dataset, times: int) -> None:
    """Make dimensions, variables and attributes, and write what does not change with time."""
    for dimension, size in part.sizes.items():
        file.createDimension(str(dimension), times if dimension == "time" else size)
    variables: Any = part.variables
    for name, values in variables.items():
        dimensions = [str(dimension) for dimension in values.dims]
        variable = file.createVariable(
            str(name), values.dtype, dimensions, chunksizes=values.shape, **_COMPRESSION
        )
        variable.setncatts(dict(values.attrs))
        if "time" not in values.dims:
            variable[...] = values.values
    file.setncatts(dict(part.attrs))
