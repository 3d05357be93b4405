"""What the paper says of a figure, and what was found: the rows of the summary's tables."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from triboflux.figures.cases import CLOSURES

PERFECT = 0.01
"""Relative difference of every field up to which a match is called perfect."""


class Finding(NamedTuple):
    """What was measured with one closure set.

    Attributes
    ----------
    agrees : bool or None
        Whether the paper's statement holds; None where it makes none.
    measured : str
        Numbers.
    """

    agrees: bool | None
    measured: str


class Statement(NamedTuple):
    """A statement, and what was measured about it.

    Attributes
    ----------
    paper : str
        What the paper says, in other words, and how agreement is decided.
    findings : dict of str to Finding
        By closure set.
    """

    paper: str
    findings: dict[str, Finding]


def each(paper: str, finding: Callable[[str], Finding]) -> Statement:
    """Return a statement with what a function finds for every closure set.

    Parameters
    ----------
    paper : str
        See `Statement`.
    finding : Callable
        ``closures -> Finding``.
    """
    return Statement(paper, {closures: finding(closures) for closures in CLOSURES})


def percent(part: float) -> str:
    """Return a ratio as percents.

    Parameters
    ----------
    part : float
        The ratio.
    """
    if part < 1e-12:
        return "round-off"
    return f"{100 * part:.3g} %" if part >= 1e-4 else f"{100 * part:.1e} %"
