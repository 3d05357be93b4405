"""Runs of the paper's two cases, made once in a process."""

from functools import cache

import triboflux
from triboflux.case import Case
from triboflux.figures import paper_case

CASES = [(1, "published"), (1, "derived"), (2, "published"), (2, "derived")]
"""The figures that show cases A and B, with each closure set."""


def changed(case, **changes):
    """Return a case with ``table__key=value`` changed."""
    data = case.model_dump()
    for name, value in changes.items():
        *outer, key = name.split("__")
        (data[outer[0]] if outer else data)[key] = value
    return Case(**data)


@cache
def paper_run(number, closures="published", **changes):
    """Return the result of a case; six output times and a stop value share a compiled program."""
    return triboflux.solve(changed(paper_case(number, closures), **changes))
