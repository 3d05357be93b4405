"""The command that writes a result for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from triboflux.cli_options import Overwrite, Quiet

commands = typer.Typer()
"""It becomes a command of the program itself."""


@commands.command(epilog="Example: triboflux convert result.nc -o result.pvd")
def convert(
    result_file: Annotated[
        Path, typer.Argument(metavar="RESULT.nc", help="What run or kinetic wrote.")
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="Its ending says what to write.")
    ],
    time_index: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Which output time, 0 the first and -1 the last: for .vti, .png and .pdf, whose "
            "default is the last, and for .csv, which otherwise has all.",
        ),
    ] = None,
    fps: Annotated[
        float | None,
        typer.Option(metavar="F", help="Frames per second of .gif and .mp4; 10 if absent."),
    ] = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Write a result for other programs, in the units that it has.

    .pvd: all times for ParaView, with images in a folder beside it; .vti: one time. .csv: a table
    with a row for each point at each time. .png, .pdf: a figure. .gif, .mp4: an animation; .mp4
    needs ffmpeg.

    Exit code 0: written. 1: refused or failed, nothing written. 2: wrong usage. 130: interrupted,
    nothing written.
    """
    from triboflux.conversion import Options, command

    command(result_file, output, Options(time_index, fps, overwrite, quiet))
