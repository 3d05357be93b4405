"""Docstrings are plain text with formulas in it; here reStructuredText is told so."""

from __future__ import annotations

import re

from sphinx.application import Sphinx
from sphinx.domains.python import PyObject


def escape(
    app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]
) -> None:
    """Keep |C|² what it is: docstrings here have no substitutions, whose sign the bar is."""
    for index, line in enumerate(lines):
        parts = re.split(r"(``.*?``|`[^`]*`)", line)  # code is every second part
        parts[::2] = [re.sub(r"(?<!\\)\|", r"\\|", part) for part in parts[::2]]
        lines[index] = "".join(parts)


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect it before napoleon, and call attributes what they are."""
    for field in PyObject.doc_field_types:
        if field.name == "variable":
            field.label = "Attributes"
    app.connect("autodoc-process-docstring", escape, priority=400)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
