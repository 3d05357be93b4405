"""Results as comma-separated values, for spreadsheets and plotting programs."""

from __future__ import annotations

import csv
from typing import TYPE_CHECKING

import numpy as np

from triboflux.case_checks import DIMENSION_NAMES
from triboflux.fields import known_variables, output_index, unit_of
from triboflux.files import written_at_once

if TYPE_CHECKING:
    from os import PathLike

    from numpy.typing import NDArray
    from xarray import Dataset

    from triboflux.result import Result


def write_csv(
    result: Result, path: str | PathLike[str], time: int | None = None, *, overwrite: bool = False
) -> None:
    """Write a result as CSV, with one row for each point at each output time.

    The header names each column and, in brackets, its unit or what it was divided by. A vector has
    a column for each component. What belongs to a whole time is repeated at all of its points.

    Parameters
    ----------
    result : Result
        Scaled or in SI, as the file is to be.
    path : path-like
        The file to write.
    time : int, optional
        Index of the only output to write; all of them by default.
    overwrite : bool
        Replace an existing file.

    Raises
    ------
    InputError
        If there is no such output, the folder is missing, or the file exists.
    TribofluxError
        If writing fails; no file is left then.
    """
    dataset, names = result.dataset, known_variables(result.dataset)
    whole = range(dataset.sizes["time"])
    times = whole if time is None else [output_index(dataset, time)]
    with (
        written_at_once(path, overwrite=overwrite) as partial,
        open(partial, "w", encoding="ascii", newline="") as file,
    ):
        writer = csv.writer(file, lineterminator="\n")
        for number, index in enumerate(times):
            columns = _columns(dataset.isel(time=index), names, si=result.units == "si")
            if not number:
                writer.writerow(columns)
            # Python writes as many digits of a double as tell it from its neighbours
            writer.writerows(np.column_stack(list(columns.values())).tolist())


def _columns(state: Dataset, names: list[str], *, si: bool) -> dict[str, NDArray[np.float64]]:
    """Return what a time holds, each as long as there are points, by the heads of the columns."""
    axes = [name for name in DIMENSION_NAMES if name in state.dims]
    shape = [state.sizes[axis] for axis in axes]
    places = np.meshgrid(*(state[axis].values for axis in axes), indexing="ij")
    columns = {_head("time", "time", si=si): np.broadcast_to(state["time"].values, shape)}
    columns |= {_head(a, a, si=si): place for a, place in zip(axes, places, strict=True)}
    for name in names:
        values = state[name].values
        if "component" in state[name].dims:
            for component, part in zip(DIMENSION_NAMES, values, strict=False):
                columns[_head(f"{name}_{component}", name, si=si)] = part
        else:
            columns[_head(name, name, si=si)] = np.broadcast_to(values, shape)
    return {head: values.ravel() for head, values in columns.items()}


def _head(column: str, variable: str, *, si: bool) -> str:
    return f"{column} [{unit_of(variable, si=si)}]"
