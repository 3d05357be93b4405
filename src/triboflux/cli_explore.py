"""The command that opens the explorer."""

from __future__ import annotations

from typing import Annotated

import typer

from triboflux.cli_options import Quiet

commands = typer.Typer()
"""It becomes a command of the program itself."""


@commands.command(epilog="Example: triboflux explore")
def explore(
    port: Annotated[
        int | None, typer.Option(metavar="N", help="Port to serve at; any free one if absent.")
    ] = None,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Print the address only, open nothing.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Explore cases in the browser: sliders, live profiles, budgets, and which model suits.

    The page is served to this machine only, until Ctrl-C. It needs the extra: pip install
    'triboflux[explorer]'.

    Exit code 0: stopped by Ctrl-C or SIGTERM. 1: refused, nothing was served. 2: wrong usage.
    """
    from triboflux.explorer.server import command

    command(port, browser=not no_browser, quiet=quiet)
