"""The file that holds where a reduced model is good enough."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING

from triboflux.errors import InputError, shown_path
from triboflux.files import require_file
from triboflux.netcdf_file import require_readable, sealed_at_once

if TYPE_CHECKING:
    import xarray as xr


def save(dataset: xr.Dataset, path: str | PathLike[str], overwrite: bool = False) -> None:
    """Write a map as NetCDF, all of it or nothing.

    Parameters
    ----------
    dataset : xarray.Dataset
        From `triboflux.suitability.suitability`.
    path : path-like
        The file to write; its folder must exist.
    overwrite : bool
        Replace an existing file.

    Raises
    ------
    InputError
        If the folder is missing or the file exists.
    TribofluxError
        If writing fails; no file is left then.
    """
    with sealed_at_once(path, overwrite=overwrite) as partial:
        dataset.to_netcdf(partial, engine="netcdf4")  # pyright: ignore[reportUnknownMemberType] -- untyped keywords in xarray


def load(path: str | PathLike[str]) -> xr.Dataset:
    """Read a map that `save` has written.

    Parameters
    ----------
    path : path-like
        The file.

    Raises
    ------
    InputError
        If the file can't be read or holds something else.
    """
    import xarray as xr

    name = f"map {shown_path(path)}"
    require_file(path, name)
    require_readable(path, name)
    try:
        with xr.open_dataset(path, engine="netcdf4") as opened:  # pyright: ignore[reportUnknownMemberType] -- untyped keywords in xarray
            found = opened.load()  # pyright: ignore[reportUnknownMemberType] -- untyped keywords in xarray
    except Exception as error:  # of many kinds: what the readers raise on files of other programs
        raise InputError(f"{name} is no readable NetCDF file.") from error
    if not {"reduced", "reference"} <= found.attrs.keys() or "error" not in found:
        raise InputError(f"{name} was not written by triboflux chart.")
    return found
