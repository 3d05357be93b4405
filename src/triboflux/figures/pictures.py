"""A result as a figure, as an animation, and in words for those who can't see them."""

# Matplotlib leaves the types of its keyword arguments open.
# pyright: reportUnknownMemberType=false

from __future__ import annotations

import subprocess
from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.animation import FFMpegWriter, PillowWriter

from triboflux.errors import InputError, TribofluxError, shown, shown_path
from triboflux.fields import output_index, unit_of
from triboflux.figures import style
from triboflux.figures.state import HEIGHT, state_picture
from triboflux.files import require_writable, written_at_once
from triboflux.progress import OutputProgress

if TYPE_CHECKING:
    from matplotlib.animation import AbstractMovieWriter
    from matplotlib.figure import Figure

    from triboflux.result import Result

SUFFIXES = (".gif", ".mp4")
"""Endings of animations."""
SLOWEST, FASTEST = 0.1, 60.0
"""Frames per second that are allowed."""

_DOTS_PER_INCH = 100
_LAYOUTS = 2
"""Only the second layout knows how large the first one has made maps of equal aspect."""


def plot(result: Result, time: int = -1) -> Figure:
    """Draw a result at one output time.

    In one dimension four panels show charge, electric field, covariance and variance, with two
    standard errors to both sides if particles were simulated. In two dimensions two maps show the
    charge and the size of the field; in three they show the plane of equal z through the largest
    charge, which the caption names. The box goes from -1/2 to 1/2 of its length.

    Parameters
    ----------
    result : Result
        Scaled or in SI, as the figure is to be.
    time : int
        Index of the output, the last by default.

    Returns
    -------
    matplotlib.figure.Figure
        Not known to pyplot; its ``savefig`` writes it.

    Raises
    ------
    InputError
        If there is no such output.
    """
    index = output_index(result.dataset, time)
    with style.page(height=HEIGHT[result.case.grid.dimensions]) as figure:
        state_picture(result, figure, slice(index, index + 1)).show(index)
        # what Matplotlib makes late would not have the settings of the page
        figure.draw_without_rendering()
    return figure


def animate(
    result: Result,
    path: str | PathLike[str],
    *,
    fps: float = 10.0,
    overwrite: bool = False,
    on_progress: Callable[[OutputProgress], None] | None = None,
) -> None:
    """Write an animation that shows what `plot` shows, with one frame for each output time.

    Parameters
    ----------
    result : Result
        Scaled or in SI, as the figure is to be.
    path : path-like
        The file to write, ``.gif`` or ``.mp4``; the latter needs the program ffmpeg.
    fps : float
        Frames per second.
    overwrite : bool
        Replace an existing file.
    on_progress : callable, optional
        Called after each frame.

    Raises
    ------
    InputError
        If the ending is another one, ``fps`` is not allowed, the folder is missing, the file
        exists, or ffmpeg is missing.
    TribofluxError
        If writing fails; no file is left then.
    """
    writer = movie_writer(path, fps)
    require_writable(path, overwrite=overwrite)
    times = result.dataset.sizes["time"]
    with (
        style.page(height=HEIGHT[result.case.grid.dimensions]) as figure,
        written_at_once(path, overwrite=overwrite) as partial,
        # another than white would shine through in some formats
        mpl.rc_context({"savefig.facecolor": "white"}),
    ):
        picture = state_picture(result, figure, slice(None))
        # what is highest leaves room for all
        picture.show(max(range(times), key=lambda time: picture.caption(time).count("\n")))
        # panels that move from frame to frame would make changes of the state hard to see
        for _ in range(_LAYOUTS):
            figure.draw_without_rendering()
        figure.set_layout_engine("none")
        try:
            with writer.saving(figure, str(partial), _DOTS_PER_INCH):
                for time in range(times):
                    picture.show(time)
                    writer.grab_frame()
                    if on_progress is not None:
                        on_progress(OutputProgress(time + 1, times))
        except subprocess.CalledProcessError as error:
            raise TribofluxError(
                f"output {shown_path(path)} can't be written: ffmpeg ended with exit code "
                f"{error.returncode}."
            ) from error


def movie_writer(path: str | PathLike[str], fps: float) -> AbstractMovieWriter:
    """Return what writes an animation, having checked that it can.

    Parameters
    ----------
    path : path-like
        Its ending decides.
    fps : float
        Frames per second.

    Raises
    ------
    InputError
        If the ending is unknown, ``fps`` is not allowed, or ffmpeg is needed and missing.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        allowed = " or ".join(SUFFIXES)
        raise InputError.about("path", f"is {shown_path(path)}, but must end in {allowed}")
    if not isinstance(fps, (int, float)) or not SLOWEST <= fps <= FASTEST:
        allowed = f"must be a number from {SLOWEST:g} to {FASTEST:g}"
        raise InputError.about("fps", f"is {shown(fps)}, but {allowed}")
    kind: Any = PillowWriter if suffix == ".gif" else FFMpegWriter
    if not kind.isAvailable():
        raise InputError(
            "an animation in MP4 needs the program ffmpeg, which is not on the path of this "
            "machine; install it, or write .gif."
        )
    return kind(fps=fps)


def description(result: Result, time: int = -1) -> str:
    """Return in words what `plot` shows: the time and the range of each variable.

    Parameters
    ----------
    result : Result
        Scaled or in SI.
    time : int
        Index of the output, the last by default.

    Raises
    ------
    InputError
        If there is no such output.
    """
    state = result.dataset.isel(time=output_index(result.dataset, time))
    si, dimensions = result.units == "si", result.case.grid.dimensions
    where = ("Profiles along x", "Maps over x and y", "Maps of a plane of equal z")[dimensions - 1]
    told: list[str] = []
    for name in ("charge", "field", "covariance", "variance"):
        if name not in state or (dimensions > 1 and name not in ("charge", "field")):
            continue
        values, words = state[name].values, name
        if dimensions > 1 and name == "field":
            values, words = np.linalg.norm(values, axis=0), "size of the field"
        told.append(f"{words} from {_range(values)}{f' {unit_of(name, si=True)}' if si else ''}")
    when = f"{float(state['time']):.5g}{' s' if si else ' (scaled)'}"
    box = ", in the whole box" if dimensions == 3 else ""
    return f"{where} at time {when}: {', '.join(told)}{box}."


def _range(values: Any) -> str:
    finite = values[np.isfinite(values)]
    if not finite.size:
        return "no finite number to none"
    return f"{finite.min():.4g} to {finite.max():.4g}"
