"""The command that simulates particles."""

from __future__ import annotations

import typer

commands = typer.Typer()
