"""The command line called in this process, which is much cheaper than in one of its own."""

import contextlib
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

from triboflux import cli

LONGEST = 700
"""Most characters of a sentence."""


@dataclass(frozen=True)
class Ended:
    """How a command ended: exit code, standard output and standard error."""

    code: int
    output: str
    errors: str


def call(*arguments):
    """Run a command of the program; anything but an orderly exit is raised."""
    words = ["triboflux", *map(str, arguments)]
    with (
        tempfile.TemporaryFile("w+", encoding="utf-8") as output,
        tempfile.TemporaryFile("w+", encoding="utf-8") as errors,
        mock.patch.object(sys, "argv", words),
    ):
        with contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors):
            try:
                cli.main()
                code = 0
            except SystemExit as ended:
                code = ended.code or 0
        output.seek(0)
        errors.seek(0)
        return Ended(code, output.read(), errors.read())


def sentence_of(ended):
    """Return the one sentence with which a command refused something, and nothing else happened."""
    assert ended.code == 1, ended
    assert ended.output == "", ended
    assert ended.errors.startswith("error: "), ended
    assert ended.errors.endswith("\n"), ended
    sentence = ended.errors.removeprefix("error: ")[:-1]
    assert sentence.isprintable(), ended
    assert len(sentence) < LONGEST, ended
    assert sentence[-1] in ".?", ended
    return sentence


def names(folder):
    """Return the names of all files below a folder."""
    return sorted(str(path.relative_to(folder)) for path in Path(folder).rglob("*"))
