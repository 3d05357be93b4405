"""The finished pages are searched for anything that a browser would fetch from elsewhere."""

from __future__ import annotations

import re
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

FETCHED = re.compile(
    r"""<(?:script|img|iframe|source|video|link(?=[^>]*rel="(?:stylesheet|preload|icon)"))\b
        [^>]*\b(?:src|href)="(?:https?:)?//[^"]*""",
    re.VERBOSE,
)


def foreign(page: str) -> list[str]:
    """Return the elements of a page that load something from another host."""
    return FETCHED.findall(page)


def check(app: Sphinx, failure: Exception | None) -> None:
    """Fail if a page of the site can't do without a network."""
    if failure is not None or app.builder.format != "html":
        return
    for path in sorted(Path(app.outdir).rglob("*.html")):
        found = foreign(path.read_text(encoding="utf-8"))
        if found:
            raise ExtensionError(f"{path} loads from elsewhere: {found[0]}")


def setup(app: Sphinx) -> dict[str, bool]:
    """Search when everything is written."""
    app.connect("build-finished", check)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
