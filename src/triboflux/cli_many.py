"""The commands that run many cases."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from triboflux.cli_options import EXIT_NOT_OK, Overwrite, Quiet, Retry, Workers

commands = typer.Typer()
"""They become commands of the program itself."""


@commands.command(epilog="Example: triboflux sweep sweep.toml -o sweep.zarr --workers 4")
def sweep(
    sweep_file: Annotated[
        Path, typer.Argument(metavar="SWEEP.toml", help="A case with a table [sweep].")
    ],
    store: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="STORE", help="Zarr store to begin or go on with."),
    ],
    workers: Workers = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="tcp://HOST:PORT", help="Dask scheduler whose workers compute."),
    ] = None,
    retry: Retry = False,
    quiet: Quiet = False,
) -> None:
    """Run many cases into one store; the same command goes on where it was interrupted.

    Exit code 0: all members ended well. 1: refused, or stopped by a failure. 2: wrong usage. 3: the
    store is complete, but some members are not ok. 130: interrupted.
    """
    from triboflux.sweep_output import command

    if not command(
        sweep_file, store, workers=workers, scheduler=scheduler, retry=retry, quiet=quiet
    ):
        raise typer.Exit(EXIT_NOT_OK)


# As long as the list of what it takes.
@commands.command(epilog="Example: triboflux chart --closures published --points 32 -o chart")
def chart(
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", metavar="DIR", help="Folder, made if absent, also for the runs."
        ),
    ],
    case_file: Annotated[
        Path | None,
        typer.Argument(metavar="CASE.toml", help="Everything else; the paper's case if absent."),
    ] = None,
    reduced: Annotated[
        str, typer.Option(metavar="MODEL", help="The model to judge.")
    ] = "semi-algebraic",
    reference: Annotated[
        str, typer.Option(metavar="MODEL", help="The model to judge it against, which keeps more.")
    ] = "full",
    closures: Annotated[
        str | None,
        typer.Option(
            metavar="derived|published|complete",
            help="Closure set; otherwise the case's, or derived.",
        ),
    ] = None,
    points: Annotated[int, typer.Option(metavar="N", help="Points along each axis.")] = 32,
    x: Annotated[
        str | None,
        typer.Option(
            "--x",
            metavar="KEY=FIRST:LAST",
            help="First number, such as numbers.peclet=1e2:1e8, or a list of its values: KEY=A,B,C",
        ),
    ] = None,
    y: Annotated[
        str | None, typer.Option("--y", metavar="KEY=FIRST:LAST", help="Second number.")
    ] = None,
    suspension: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Mark the suspension of this file in the chart."),
    ] = None,
    workers: Workers = None,
    retry: Retry = False,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Draw where a reduced model is good enough, over Pe and tau_c or two other numbers.

    Writes chart.png, chart.pdf and chart.nc, and keeps the runs in DIR/runs: the same command goes
    on where it was interrupted. Exit code 0: written. 1: refused, or stopped by a failure. 2: wrong
    usage. 130: interrupted.
    """
    from triboflux.suitability_output import Options, command

    command(
        Options(
            output=output,
            case_file=case_file,
            reduced=reduced,
            reference=reference,
            closures=closures,
            points=points,
            axes=(x, y),
            suspension=suspension,
            workers=workers,
            retry=retry,
            overwrite=overwrite,
            quiet=quiet,
        )
    )
