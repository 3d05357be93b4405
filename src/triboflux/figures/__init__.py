"""The paper's figures, drawn from results only."""

from __future__ import annotations

from triboflux.figures.cases import CLOSURES, MAP, PAPER_TIMES, paper_case
from triboflux.figures.profiles import figure_one, figure_two
from triboflux.figures.reproduce import KINDS, Reproduction, reproduce

__all__ = [
    "CLOSURES",
    "KINDS",
    "MAP",
    "PAPER_TIMES",
    "Reproduction",
    "figure_one",
    "figure_two",
    "paper_case",
    "reproduce",
]
