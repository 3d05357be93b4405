"""Tutorials are executed side by side, and share what is compiled."""

from __future__ import annotations

import os
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

BUILD = Path(__file__).resolve().parents[2] / "build"


def spread(app: Sphinx, environment: BuildEnvironment, pages: list[str]) -> None:
    """Spread the tutorials among the other pages: Sphinx reads them in batches of neighbours."""
    places: dict[str, float] = {}
    for group in (True, False):
        members = [page for page in pages if page.startswith("tutorials/") is group]
        for index, page in enumerate(members):
            places[page] = (index + 0.5) / len(members)
    pages.sort(key=places.__getitem__)


def setup(app: Sphinx) -> dict[str, bool]:
    """Say where compiled programs are kept, and connect."""
    os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(BUILD / "jax"))
    # a limit is what makes JAX lock the folder between processes
    os.environ.setdefault("JAX_COMPILATION_CACHE_MAX_SIZE", "1000000000")
    os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.5")
    # programs that call back into Python, as these checks do, can't be kept; see `terminal`
    os.environ.setdefault("EQX_ON_ERROR", "nan")
    app.connect("env-before-read-docs", spread)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
