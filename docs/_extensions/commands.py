"""The command line as Markdown, from the Typer application."""

from __future__ import annotations

import inspect
import re
from typing import Any

import typer
from typer.main import get_command

from triboflux.cli import app


def commands() -> str:
    """Return a section for each command: what it does, its arguments and options, an example."""
    program: Any = get_command(app)
    context = typer.Context(program, info_name="triboflux")
    sections = [_section(program, context)]
    for name, command in program.commands.items():
        sections.append(_section(command, typer.Context(command, info_name=name, parent=context)))
    return "\n\n".join(sections)


def _section(command: Any, context: typer.Context) -> str:
    usage = f"{context.command_path} {' '.join(command.collect_usage_pieces(context))}"
    parts = [
        f"## {context.command_path}",
        _marked(inspect.cleandoc(command.help or "")),
        f"```text\n{usage}\n```",
    ]
    records = [parameter.get_help_record(context) for parameter in command.params]
    parts += [_entry(*record) for record in records if record]
    if command.epilog:
        example = command.epilog.removeprefix("Example: ")
        parts.append(f"Example:\n\n```text\n{example}\n```")
    return "\n\n".join(parts)


def _entry(name: str, text: str) -> str:
    """Return an argument or option as an entry of a definition list."""
    remarks = r"\s*\[((?:required|default: |\d|x).*)\]$"
    said, _, remark = re.sub(remarks, r"\0\1", text).partition("\0")
    return f"`{name}`\n: {_marked(said)}" + (f" *({remark})*" if remark else "")


def _marked(text: str) -> str:
    """Mark the options that a text names as code."""
    return re.sub(r"(?<![\w`-])--[a-z][a-z-]*", r"`\g<0>`", text)
