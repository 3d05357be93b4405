"""Results as VTK image data, which ParaView and PyVista show: one time, or all as a series."""

from __future__ import annotations

import base64
import re
import struct
import zlib
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import XMLGenerator
from xml.sax.xmlreader import AttributesImpl

import numpy as np

from triboflux.case_checks import DIMENSION_NAMES
from triboflux.fields import known_variables, output_index, unit_of
from triboflux.files import (
    folder_written_at_once,
    require_writable,
    require_writable_folder,
    written_at_once,
)
from triboflux.progress import OutputProgress

if TYPE_CHECKING:
    from os import PathLike

    from numpy.typing import NDArray

    from triboflux.result import Result

_IMAGE_NAME = re.compile(r"[0-9]{4,}\.vti")
_COMPRESSION_LEVEL = 1


def write_image(
    result: Result, path: str | PathLike[str], time: int = -1, *, overwrite: bool = False
) -> None:
    """Write one time of a result as a VTK XML file of image data.

    The image has one point more along each axis than the grid: the box is periodic, so its end
    repeats its beginning, and programs that draw cells between points show the whole box. Vectors
    have three components, whatever the dimensions of the box.

    Parameters
    ----------
    result : Result
        Scaled or in SI, as the file is to be.
    path : path-like
        The file to write, usually ``.vti``.
    time : int
        Index of the output, the last by default.
    overwrite : bool
        Replace an existing file.

    Raises
    ------
    InputError
        If there is no such output, the folder is missing, or the file exists.
    TribofluxError
        If writing fails; no file is left then.
    """
    index = output_index(result.dataset, time)
    with (
        written_at_once(path, overwrite=overwrite) as partial,
        _document(partial, "ImageData") as xml,
    ):
        _image(xml, result, index)


def series_folder(path: str | PathLike[str]) -> Path:
    """Return the folder beside a ``.pvd`` file that holds its images.

    Parameters
    ----------
    path : path-like
        Such as ``out.pvd``, whose images are in ``out_vti``.
    """
    return Path(path).with_name(f"{Path(path).stem}_vti")


def require_series_folder(path: str | PathLike[str], *, overwrite: bool = False) -> Path:
    """Return `series_folder`, if it can be written.

    Parameters
    ----------
    path : path-like
        The ``.pvd`` file.
    overwrite : bool
        Accept an existing folder that holds nothing but such images.

    Raises
    ------
    InputError
        Says what is in the way.
    """
    folder = series_folder(path)
    require_writable_folder(folder, pattern=_IMAGE_NAME, overwrite=overwrite)
    return folder


def write_series(
    result: Result,
    path: str | PathLike[str],
    *,
    overwrite: bool = False,
    on_progress: Callable[[OutputProgress], None] | None = None,
) -> None:
    """Write all times of a result: a ``.pvd`` file that lists them, and a folder of images.

    Parameters
    ----------
    result : Result
        Scaled or in SI, as the files are to be.
    path : path-like
        The file to write; the images go into `series_folder`.
    overwrite : bool
        Replace an existing file, and an existing folder if it holds nothing but such images.
    on_progress : callable, optional
        Called after each image.

    Raises
    ------
    InputError
        If the folder is missing, or a file or folder exists.
    TribofluxError
        If writing fails; nothing is left then.
    """
    folder = series_folder(path)
    times = [float(time) for time in result.dataset["time"].values]
    names = [f"{number:04d}.vti" for number in range(len(times))]
    require_writable(path, overwrite=overwrite)
    with (
        written_at_once(path, overwrite=overwrite) as partial,
        folder_written_at_once(folder, overwrite=overwrite, pattern=_IMAGE_NAME) as images,
    ):
        for number, name in enumerate(names):
            with _document(images / name, "ImageData") as xml:
                _image(xml, result, number)
            if on_progress is not None:
                on_progress(OutputProgress(number + 1, len(names)))
        with _document(partial, "Collection") as xml, _element(xml, "Collection"):
            for time, name in zip(times, names, strict=True):
                place = {"timestep": repr(time), "part": "0", "file": f"{folder.name}/{name}"}
                with _element(xml, "DataSet", place):
                    pass
        # it may have come meanwhile, and the folder is not to be there alone
        require_writable(path, overwrite=overwrite)


def _image(xml: XMLGenerator, result: Result, time: int) -> None:
    """Write the element of an image: what belongs to it, its grid, and its fields."""
    dataset, case = result.dataset.isel(time=time), result.case
    points = case.grid.points + (0,) * (3 - case.grid.dimensions)
    extent = " ".join(f"0 {count}" for count in points)
    # from two positions of the file, so that they are in its units
    spacings = [float(dataset[name].values[1]) for name in DIMENSION_NAMES[: case.grid.dimensions]]
    spacings += [1.0] * (3 - len(spacings))
    grid = {
        "WholeExtent": extent,
        "Origin": "0 0 0",
        "Spacing": " ".join(map(repr, spacings)),
    }
    names = known_variables(result.dataset)
    over_space = [name for name in names if dataset[name].ndim]
    with _element(xml, "ImageData", grid):
        with _element(xml, "FieldData"):
            _numbers(xml, "TimeValue", dataset["time"].values, NumberOfTuples="1")
            for name in names:
                if name not in over_space:
                    _numbers(xml, name, dataset[name].values, NumberOfTuples="1")
            for name in ("title", "status", "stop_reason", "units", "case_toml"):
                _texts(xml, name, [str(dataset.attrs.get(name, ""))])
            units = [f"{name}: {unit_of(name, si=result.units == 'si')}" for name in names]
            _texts(xml, "units_of_variables", units)
        with (
            _element(xml, "Piece", {"Extent": extent}),
            _element(xml, "PointData", {"Scalars": "charge", "Vectors": "field"}),
        ):
            for name in over_space:
                values = _closed(dataset[name].values, case.grid.dimensions)
                is_vector = dataset[name].dims[0] == "component"
                unit = unit_of(name, si=result.units == "si")
                components = "3" if is_vector else "1"
                _numbers(xml, name, values, unit=unit, NumberOfComponents=components)


def _closed(values: NDArray[np.float64], dimensions: int) -> NDArray[np.float64]:
    """Return values with the beginning of the box repeated at its end, in VTK's order.

    The component of a vector changes fastest, then x, then y, then z.
    """
    vectors = values.ndim - dimensions
    if vectors:
        values = np.pad(values, [(0, 3 - dimensions)] + [(0, 0)] * dimensions)
    values = np.pad(values, [(0, 0)] * vectors + [(0, 1)] * dimensions, mode="wrap")
    # of (component, x, y, z) the transpose (z, y, x, component) in the order of C
    return values.transpose()


@contextmanager
def _document(path: Path, kind: str) -> Generator[XMLGenerator, None, None]:
    """Give what writes into the outermost element of a VTK file."""
    attributes = {
        "type": kind,
        "version": "1.0",
        "byte_order": "LittleEndian",
        "header_type": "UInt64",
        "compressor": "vtkZLibDataCompressor",
    }
    with open(path, "w", encoding="utf-8") as file:
        xml = XMLGenerator(file, "utf-8", short_empty_elements=True)
        xml.startDocument()
        with _element(xml, "VTKFile", attributes):
            yield xml


@contextmanager
def _element(
    xml: XMLGenerator, name: str, attributes: Mapping[str, str] | None = None
) -> Generator[None, None, None]:
    """Write what happens meanwhile between the beginning and the end of an element."""
    xml.startElement(name, AttributesImpl(dict(attributes or {})))
    yield
    xml.endElement(name)
    xml.characters("\n")


def _numbers(
    xml: XMLGenerator, name: str, values: NDArray[Any], unit: str = "", **shape: str
) -> None:
    """Write an array of numbers; programs that know VTK's key for units find the unit, too."""
    about = {"type": "Float64", "Name": name, "format": "binary", **shape}
    with _element(xml, "DataArray", about):
        xml.characters(_encoded(np.ascontiguousarray(values, dtype="<f8").tobytes()))
        if unit:
            key = {"name": "UNITS_LABEL", "location": "vtkDataArray"}
            with _element(xml, "InformationKey", key):
                xml.characters(unit)


def _texts(xml: XMLGenerator, name: str, texts: list[str]) -> None:
    """Write an array of texts."""
    shape = {"type": "String", "Name": name, "format": "binary", "NumberOfTuples": str(len(texts))}
    with _element(xml, "Array", shape):
        # a text ends with a zero
        xml.characters(_encoded(b"".join(text.encode() + b"\0" for text in texts)))


def _encoded(content: bytes) -> str:
    """Return bytes as VTK has them in XML: compressed in one block, after the sizes."""
    block = zlib.compress(content, _COMPRESSION_LEVEL)
    # blocks, size of each, size of a partial last one, and the compressed size of each
    sizes = struct.pack("<4Q", 1, len(content), 0, len(block))
    return (base64.b64encode(sizes) + base64.b64encode(block)).decode("ascii")
