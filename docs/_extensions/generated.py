"""Pieces of pages that are made from the program itself when the pages are built."""

from __future__ import annotations

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from .citation import citation
from .commands import commands
from .equations import coefficients, dropped, equations, rates, terms

PIECES = {
    "citation": citation,
    "coefficients": coefficients,
    "commands": commands,
    "dropped": dropped,
    "equations": equations,
    "rates": rates,
    "terms": terms,
}
"""What a page can ask for, and the function that returns it as Markdown."""


class Generated(SphinxDirective):
    """``{generated} NAME``: the Markdown that one of `PIECES` returns."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return the parsed Markdown, headings included."""
        name = self.arguments[0]
        if name not in PIECES:
            raise self.error(f"'{name}' is not known; allowed are {', '.join(PIECES)}.")
        self.env.note_reread()  # the program may have changed though the page has not
        container = nodes.section()
        container.document = self.state.document
        text = StringList(PIECES[name]().splitlines(), source=f"generated {name}")
        self.state.nested_parse(text, self.content_offset, container, match_titles=True)
        return container.children


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("generated", Generated)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
