"""A result file turned into a file for other programs, whose ending says of which kind."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from triboflux.errors import InputError, nearest, shown, shown_path
from triboflux.files import require_writable, written_at_once

if TYPE_CHECKING:
    from triboflux.result import Result

ONE_TIME = (".vti", ".png", ".pdf", ".csv")
"""Endings of what can show a single time."""
ANIMATIONS = (".gif", ".mp4")
"""Endings of what has frames."""
SUFFIXES = (".pvd", *ONE_TIME, *ANIMATIONS)
"""All endings."""

USUAL_SPEED = 10.0
"""Frames per second of an animation unless something else is said."""


@dataclass(frozen=True)
class Options:
    """What the command line says besides the two files.

    Attributes
    ----------
    time_index : int or None
        Which output time, for `ONE_TIME`.
    fps : float or None
        Frames per second, for `ANIMATIONS`.
    overwrite : bool
        Replace existing output.
    quiet : bool
        No progress and no names of files.
    """

    time_index: int | None
    fps: float | None
    overwrite: bool
    quiet: bool


def command(result_file: Path, output: Path, options: Options) -> None:
    """Convert in the background and tell what was written.

    Parameters
    ----------
    result_file : pathlib.Path
        NetCDF of `triboflux.load`.
    output : pathlib.Path
        Its ending is one of `SUFFIXES`.
    options : Options
        How.

    Raises
    ------
    InputError
        If anything is not allowed.
    TribofluxError
        If writing fails; no file is left then.
    """
    from triboflux.terminal import OutputsBar, in_background, interruptible, progress_bar

    with interruptible("nothing was written"):
        written = _checked(result_file, output, options)
        with progress_bar(quiet=options.quiet, kind=OutputsBar) as on_progress:

            def work() -> None:
                from triboflux.result import load

                convert(load(result_file), output, options, on_progress)

            in_background(work)
    if not options.quiet:
        print(f"written to {' and '.join(shown_path(path) for path in written)}")


def _checked(result_file: Path, output: Path, options: Options) -> list[Path]:
    """Return what will be written, having refused what can be refused before reading the result."""
    suffix = output.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError.about(
            "output",
            f"is {shown_path(output)}, but must end in one of {', '.join(SUFFIXES)}",
            hint=nearest(suffix, SUFFIXES),
        )
    if options.time_index is not None and suffix not in ONE_TIME:
        problem = f"is {options.time_index}, but {suffix} shows all times"
        raise InputError.about("time-index", problem)
    if options.fps is not None and suffix not in ANIMATIONS:
        raise InputError.about("fps", f"is {shown(options.fps)}, but {suffix} has no frames")
    require_writable(output, overwrite=options.overwrite)
    written = [output]
    if suffix == ".pvd":
        from triboflux.vtk_files import require_series_folder

        written.append(require_series_folder(output, overwrite=options.overwrite))
    if suffix in ANIMATIONS:
        from triboflux.figures.pictures import movie_writer

        movie_writer(output, _speed(options))
    if output.exists() and result_file.exists() and output.samefile(result_file):
        raise InputError(f"output {shown_path(output)} is the result itself.")
    return written


def _speed(options: Options) -> float:
    return USUAL_SPEED if options.fps is None else options.fps


def convert(
    result: Result,
    output: Path,
    options: Options,
    on_progress: Callable[[Any], None] | None = None,
) -> None:
    """Write a result as the ending of the output says.

    Parameters
    ----------
    result : Result
        Scaled or in SI, as the output is to be.
    output : pathlib.Path
        Its ending is one of `SUFFIXES`.
    options : Options
        How.
    on_progress : callable, optional
        Called after each time of what has all of them.

    Raises
    ------
    InputError
        If there is no such time, or the output can't be written there.
    TribofluxError
        If writing fails; no file is left then.
    """
    overwrite, time = options.overwrite, options.time_index
    suffix = output.suffix.lower()
    if suffix == ".csv":
        result.to_csv(output, time, overwrite=overwrite)
    elif suffix == ".vti":
        result.to_vtk(output, time, overwrite=overwrite)
    elif suffix == ".pvd":
        from triboflux.vtk_files import write_series

        write_series(result, output, overwrite=overwrite, on_progress=on_progress)
    elif suffix in ANIMATIONS:
        from triboflux.figures.pictures import animate

        speed = _speed(options)
        animate(result, output, fps=speed, overwrite=overwrite, on_progress=on_progress)
    else:
        from triboflux.figures.style import save

        figure = result.plot(-1 if time is None else time)
        with written_at_once(output, overwrite=overwrite) as partial:
            save(figure, partial)
