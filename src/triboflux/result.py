"""What a run returns: labelled fields, status, statistics and provenance."""

from __future__ import annotations

import json
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xarray as xr

from triboflux import case_checks
from triboflux.case import Case
from triboflux.case_checks import DIMENSION_NAMES
from triboflux.dataset import FORMAT_VERSION
from triboflux.errors import InputError, shown, shown_path
from triboflux.fields import (
    ANCILLARY,
    FIELDS,
    STANDARD_ERROR,
    dimensions_of,
    labels_of,
    variables_of,
)
from triboflux.files import require_file
from triboflux.memory import available_memory
from triboflux.netcdf_file import require_readable, sealed_at_once
from triboflux.scales import Scales

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_TEXTS = ("case_toml", "status", "stop_reason", "stats_json", "warnings_json", "versions_json")


@dataclass(frozen=True)
class Result:
    """The outcome of a run.

    Attributes
    ----------
    dataset : xarray.Dataset
        Fields over ``time``, ``component`` and ``x``, ``y``, ``z``, scaled as each variable's
        ``scale`` says, or in SI after `to_si`; provenance in the attributes. The last time is the
        stop time.
    """

    dataset: xr.Dataset

    @property
    def status(self) -> str:
        """``"ok"``, or what went wrong, such as ``"nonphysical"`` or ``"diverged"``."""
        return str(self.dataset.attrs["status"])

    @property
    def stop_reason(self) -> str:
        """Why the run ended."""
        return str(self.dataset.attrs["stop_reason"])

    @property
    def stats(self) -> dict[str, Any]:
        """Numbers of steps and other statistics of the run."""
        return json.loads(self.dataset.attrs["stats_json"])

    @property
    def case(self) -> Case:
        """The case that was run."""
        return Case.from_toml_text(self.dataset.attrs["case_toml"])

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences that the user must be told."""
        return tuple(json.loads(self.dataset.attrs["warnings_json"]))

    @property
    def units(self) -> str:
        """``"scaled"``, or ``"si"`` after `to_si`."""
        return str(self.dataset.attrs.get("units", "scaled"))

    def to_si(self) -> Result:
        """Return the same result with every field and coordinate in SI.

        Returns
        -------
        Result
            Each variable's ``units`` attribute names its unit.

        Raises
        ------
        InputError
            If the case has no suspension, hence no scales.
        """
        return self if self.units == "si" else self._in("si")

    def to_scaled(self) -> Result:
        """Return the same result with everything divided by its scale, as it was computed.

        Returns
        -------
        Result
            Equal to the one that `to_si` was called on, to round-off.
        """
        return self if self.units == "scaled" else self._in("scaled")

    def _in(self, units: str) -> Result:
        """Multiply or divide everything by its scale."""
        case = self.case
        case_checks.check_units(case, "si")
        assert case.suspension is not None
        scales = Scales.of(case.suspension)
        changed: dict[Any, Any] = {}
        for name in self.dataset.variables:
            about = FIELDS.get(str(name).removesuffix(STANDARD_ERROR))
            if about is not None:
                old, factor = self.dataset[name], getattr(scales, about[2])
                values = old.values * factor if units == "si" else old.values / factor
                links = {key: old.attrs[key] for key in (ANCILLARY,) if key in old.attrs}
                labels = labels_of(str(name), si=units == "si")
                changed[name] = (old.dims, values, labels | links)
        dataset = self.dataset.assign_coords(  # pyright: ignore[reportUnknownMemberType] -- untyped keywords in xarray
            {name: changed.pop(name) for name in list(self.dataset.coords) if name in changed}
        )
        return Result(dataset.assign(changed).assign_attrs(units=units))

    def to_netcdf(self, path: str | PathLike[str], overwrite: bool = False) -> None:
        """Write the result as NetCDF, all of it or nothing.

        Parameters
        ----------
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
        encoding: dict[Any, dict[str, Any]] = {
            name: {"zlib": True, "complevel": 1, "_FillValue": None}
            for name in self.dataset.variables
        }
        with sealed_at_once(path, overwrite=overwrite) as partial:
            self.dataset.to_netcdf(  # pyright: ignore[reportUnknownMemberType] -- untyped keywords in xarray
                partial, engine="netcdf4", encoding=encoding
            )

    def to_vtk(
        self, path: str | PathLike[str], time: int | None = None, *, overwrite: bool = False
    ) -> None:
        """Write the result for ParaView, PyVista and other programs that read VTK's files.

        Parameters
        ----------
        path : path-like
            With ``.vti`` one output time; with ``.pvd`` all of them, as images in a folder beside
            it: ``out.pvd`` and ``out_vti``.
        time : int, optional
            Index of the output for ``.vti``, the last by default.
        overwrite : bool
            Replace an existing file and folder.

        Raises
        ------
        InputError
            If the ending is another one, there is no such output, the folder is missing, or the
            output exists.
        TribofluxError
            If writing fails; no file is left then.
        """
        from triboflux import vtk_files

        suffix = Path(path).suffix.lower()
        if suffix not in (".vti", ".pvd"):
            problem = f"is {shown_path(path)}, but must end in .vti or .pvd"
            raise InputError.about("path", problem)
        if suffix == ".vti":
            vtk_files.write_image(self, path, -1 if time is None else time, overwrite=overwrite)
            return
        if time is not None:
            raise InputError.about("time", f"is {shown(time)}, but a .pvd file holds all times")
        vtk_files.write_series(self, path, overwrite=overwrite)

    def to_csv(
        self, path: str | PathLike[str], time: int | None = None, *, overwrite: bool = False
    ) -> None:
        """Write the result as comma-separated values, a row for each point at each output time.

        Parameters and errors are those of `triboflux.csv_file.write_csv`.
        """
        from triboflux.csv_file import write_csv

        write_csv(self, path, time, overwrite=overwrite)

    def plot(self, time: int = -1) -> Figure:
        """Draw the result at one output time, the last by default.

        What is drawn, parameters and errors are those of `triboflux.figures.pictures.plot`.
        """
        from triboflux.figures import pictures

        return pictures.plot(self, time)

    def animate(
        self, path: str | PathLike[str], *, fps: float = 10.0, overwrite: bool = False
    ) -> None:
        """Write an animation over all output times, as ``.gif`` or ``.mp4``.

        Parameters and errors are those of `triboflux.figures.pictures.animate`.
        """
        from triboflux.figures import pictures

        pictures.animate(self, path, fps=fps, overwrite=overwrite)

    def _repr_html_(self) -> str:
        """Show the case, how the run ended, its warnings and a small figure in a notebook."""
        from triboflux.result_html import html

        return html(self)


def load(path: str | PathLike[str]) -> Result:
    """Read a result that `Result.to_netcdf` wrote.

    Parameters
    ----------
    path : path-like
        The NetCDF file; it is read whole and closed.

    Returns
    -------
    Result
        Equal to the one that was written.

    Raises
    ------
    InputError
        If the file is missing, damaged, too large for the memory, or not one of ours.
    """
    name = f"result {shown_path(path)}"
    require_file(path, name)
    require_readable(path, name)
    try:
        opened = xr.open_dataset(  # pyright: ignore[reportUnknownMemberType] -- untyped keywords in xarray
            path, engine="netcdf4", decode_cf=False
        )
        with opened:
            _require_ours(opened, name)
            return Result(opened.load())  # pyright: ignore[reportUnknownMemberType] -- untyped keywords in xarray
    except InputError:
        raise
    except Exception as error:  # of many kinds: what the readers raise on files of other programs
        reason = shown(str(error).partition("\n")[0], 120)[1:-1]
        raise InputError(f"{name} is no readable NetCDF file: {reason}.") from error


def _require_ours(dataset: xr.Dataset, name: str) -> None:
    """Refuse a dataset that is not a complete result of a known format."""
    version = dataset.attrs.get("format_version")
    if version is None:
        raise InputError(f"{name} was not written by triboflux (it has no format_version).")
    if version != FORMAT_VERSION:
        raise InputError(
            f"{name} has format_version {shown(version)}, but this triboflux reads "
            f"{FORMAT_VERSION}."
        )
    for attribute in _TEXTS:
        if not isinstance(dataset.attrs.get(attribute), str):
            raise InputError(f"{name} is damaged: its attribute {attribute} is missing.")
    for attribute, kind in (("stats_json", dict), ("warnings_json", list)):
        try:
            readable = isinstance(json.loads(dataset.attrs[attribute]), kind)
        except (ValueError, RecursionError):
            readable = False
        if not readable:
            raise InputError(f"{name} is damaged: its attribute {attribute} is unreadable.")
    if Result(dataset).units not in case_checks.UNITS:
        raise InputError(
            f"{name} is damaged: its attribute units is {shown(Result(dataset).units)}."
        )
    try:
        case = Result(dataset).case
    except InputError as error:
        raise InputError(f"{name} is damaged: its case is not allowed, {error}") from None
    if Result(dataset).units == "si" and case.suspension is None:
        raise InputError(f"{name} is damaged: its attribute units is 'si' without a suspension.")
    _require_shapes(dataset, case, name)
    available = available_memory()
    if available is not None and dataset.nbytes > available:
        raise InputError(f"{name} holds {dataset.nbytes:,} bytes, more than the memory available.")


def _require_shapes(dataset: xr.Dataset, case: Case, name: str) -> None:
    """Refuse a dataset whose variables do not fit its case's grid."""
    sizes = dict(zip(DIMENSION_NAMES, case.grid.points, strict=False))
    sizes |= {"component": case.grid.dimensions, "time": dataset.sizes.get("time", 0)}
    for variable in variables_of(case.model, case.grid.dimensions):
        expected = dimensions_of(variable, case.grid.dimensions)
        if variable not in dataset.variables or dataset[variable].dims != expected:
            raise InputError(f"{name} is damaged: its variable {variable} is missing or misshapen.")
        if any(dataset.sizes[step] != sizes[step] for step in expected) or not sizes["time"]:
            raise InputError(f"{name} is damaged: {variable} does not fit its case's grid.")
        if dataset[variable].dtype.kind != "f":
            raise InputError(f"{name} is damaged: {variable} does not hold numbers.")
