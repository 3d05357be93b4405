"""The arrays of a sweep's store: their names, shapes, chunks and labels."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from triboflux.case import Case
from triboflux.case_checks import DIMENSION_NAMES
from triboflux.errors import InputError
from triboflux.sweep_member import FIELDS

if TYPE_CHECKING:
    from triboflux.sweep import Sweep

_CHUNK_BYTES, _CHUNK_MEMBERS = 2**20, 256

_TEXTS = {
    "status": "ok, nonphysical, diverged, refused or failed; empty while missing",
    "stop_reason": "why the run ended, was refused or failed",
    "warnings": "sentences that the user must be told, one a line",
}
_NUMBERS = {
    "stop_time": ("time at which the run stopped", "L / sqrt(Theta)"),
    "peak_charge": ("largest absolute mean charge in the box at the stop time", "Q0"),
    "charge": ("mean charge of a particle at the stop time", "Q0"),
    "covariance": ("charge-velocity covariance at the stop time", "Q0 sqrt(Theta)"),
    "variance": ("charge variance at the stop time", "Q0^2"),
}
_COUNTS = {"accepted": "accepted steps", "rejected": "rejected steps"}
VARIABLES = (*_TEXTS, *_NUMBERS, *_COUNTS)
_RESERVED = {*VARIABLES, *DIMENSION_NAMES, "component", "member"}


def coordinate_names(keys: tuple[str, ...]) -> dict[str, str]:
    """Return the name of each parameter's coordinate: the last part of its key if that is unique.

    Parameters
    ----------
    keys : tuple of str
        Dotted keys such as ``numbers.peclet``.

    Returns
    -------
    dict of str to str
        Such as ``{"numbers.peclet": "peclet"}``.
    """
    short = [key.rpartition(".")[2] for key in keys]
    return {
        key: last if short.count(last) == 1 and last not in _RESERVED else key
        for key, last in zip(keys, short, strict=True)
    }


def lay_out(group: Any, members: Sweep) -> None:
    """Make the arrays of a store, empty, and its coordinates.

    Parameters
    ----------
    group : zarr.Group
        New.
    members : Sweep
        What the store is for.

    Raises
    ------
    InputError
        If the grids of the members differ in their number of dimensions.
    """
    dimensions = _coordinates(group, members)
    points = _points(members)
    space = DIMENSION_NAMES[: len(points)]
    chunk = _chunk_shape(members.shape, 8 * math.prod(points) * len(points))
    for name in VARIABLES:
        sizes, inner = (points, space) if name in FIELDS else ((), ())
        if name == "covariance":
            sizes, inner = (len(points), *points), ("component", *space)
        kind, fill, labels = _kind(name)
        group.create_array(
            name,
            shape=(*members.shape, *sizes),
            chunks=(*chunk, *sizes),
            dtype=kind,
            compressors=_compressors(),
            fill_value=fill,
            dimension_names=(*dimensions, *inner),
            attributes=labels,
        )


def _compressors() -> Any:
    """Return what makes the bytes of a chunk smaller and adds a checksum, which is read first."""
    import zarr.codecs as untyped

    codecs: Any = untyped
    return codecs.ZstdCodec(), codecs.Crc32cCodec()


def require_laid_out(group: Any, members: Sweep) -> None:
    """Refuse arrays that are not those of `lay_out`, before a wrong size is allocated.

    Parameters
    ----------
    group : zarr.Group
        Of a store.
    members : Sweep
        What the store is for.

    Raises
    ------
    ValueError
        If arrays are missing, too many or others, or if coordinates have other values.
    """
    import zarr as untyped

    zarr: Any = untyped
    expected = zarr.create_group(store=zarr.storage.MemoryStore())
    lay_out(expected, members)
    wanted, found = dict(expected.arrays()), dict(group.arrays())
    if set(wanted) != set(found):
        raise ValueError(f"its arrays are {', '.join(sorted(found))}")
    for name, array in wanted.items():
        if _described(found[name]) != _described(array):
            raise ValueError(f"its array {name} is described wrongly")
        if name not in VARIABLES and not np.array_equal(found[name][...], array[...]):
            raise ValueError(f"its coordinate {name} has other values")


def _described(array: Any) -> tuple[Any, ...]:
    """Return what has to be the same in an array, whatever compresses it."""
    about = array.metadata
    fill = str(about.fill_value)
    return (array.shape, array.chunks, array.dtype, fill, about.dimension_names, dict(array.attrs))


def _kind(name: str) -> tuple[Any, Any, dict[str, str]]:
    """Return type, value where there is none, and labels of a variable."""
    if name in _TEXTS:
        return str, "", {"long_name": _TEXTS[name]}
    if name in _COUNTS:
        return "int32", 0, {"long_name": _COUNTS[name], "units": "1"}
    long_name, scale = _NUMBERS[name]
    return "float64", math.nan, {"long_name": long_name, "units": "1", "scale": scale}


def _coordinates(group: Any, members: Sweep) -> tuple[str, ...]:
    """Write the coordinates and return the names of the members' dimensions."""
    names = coordinate_names(tuple(members.parameters))
    listed = members.mode == "list"
    for key, values in members.parameters.items():
        dimensions = ("member",) if listed else (names[key],)
        _save(group, names[key], _coordinate(values), dimensions, {"parameter": key})
    points = _points(members)
    labels = {"long_name": "vector component: 0 is x, 1 is y, 2 is z", "units": "1"}
    _save(group, "component", np.arange(len(points)), ("component",), labels)
    # these may change the lengths of the box from member to member
    if not any(key.startswith(("grid", "suspension")) for key in members.parameters):
        lengths = Case(**members.table(0)).grid.lengths
        for name, number, length in zip(DIMENSION_NAMES, points, lengths, strict=False):
            labels = {"long_name": f"position along {name}", "units": "1", "scale": "L"}
            _save(group, name, np.arange(number) * (length / number), (name,), labels)
    return ("member",) if listed else tuple(names.values())


def _points(members: Sweep) -> tuple[int, ...]:
    """Return the numbers of points that hold every member's fields."""
    on_grids = any(key.startswith("grid") for key in members.parameters)
    indices = range(members.size) if on_grids else (0,)
    found = {tuple(members.table(i)["grid"]["points"]) for i in indices}
    if len({len(points) for points in found}) > 1:
        raise InputError.about(
            "grid.points", "is swept over numbers of dimensions, but a store has one of them"
        )
    return tuple(int(max(sizes)) for sizes in zip(*found, strict=True))


def _chunk_shape(shape: tuple[int, ...], member_bytes: int) -> tuple[int, ...]:
    """Return how many members along each dimension share a file, the last ones first."""
    left = max(1, min(_CHUNK_MEMBERS, _CHUNK_BYTES // member_bytes))
    chunk: list[int] = []
    for size in reversed(shape):
        chunk.insert(0, min(size, left))
        left = max(1, left // size)
    return tuple(chunk)


def _coordinate(values: list[Any]) -> np.ndarray:
    """Return values as numbers if all are, as texts otherwise."""
    if all(isinstance(value, bool) for value in values):
        return np.array(values)
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        return np.array(values, dtype=float)
    texts = [value if isinstance(value, str) else json.dumps(value) for value in values]
    return np.array(texts, dtype=object)


def _save(
    group: Any,
    name: str,
    values: np.ndarray,
    dimensions: tuple[str, ...],
    labels: dict[str, str],
) -> None:
    """Write a coordinate as one chunk."""
    text = values.dtype == object
    array = group.create_array(
        name,
        shape=values.shape,
        chunks=values.shape,
        dtype=str if text else values.dtype,
        compressors=_compressors(),
        dimension_names=dimensions,
        attributes=labels,
    )
    array[...] = values
