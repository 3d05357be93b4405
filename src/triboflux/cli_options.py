"""Exit codes and options that commands of several modules share."""

from __future__ import annotations

from typing import Annotated

import typer

EXIT_REFUSED = 1
"""Bad input or failure; one line on stderr says why."""
EXIT_NOT_OK = 3
"""The run ended and was written, but its status is not ok."""

Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace existing output.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]
Retry = Annotated[bool, typer.Option("--retry", help="Run failed members again.")]
Workers = Annotated[
    int | None, typer.Option(metavar="N", help="Local processes; one per core if absent.")
]
