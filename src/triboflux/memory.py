"""Whether a case fits in this machine's memory."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from triboflux.case_kinetic import Kinetic
from triboflux.errors import InputError
from triboflux.hierarchy import MODELS, RANKS

if TYPE_CHECKING:
    from triboflux.case import Case

BYTES_OF_PARTICLE = 100
"""Upper bound of what the simulation of particles needs for each."""

_BYTES = 8
_STREAMED = 4
"""Outputs held at a time while they stream to a file: on the points as they are written, and as
Fourier coefficients, which are smaller, in a segment of steps of a large grid."""
_GIBIBYTE = 2**30


def memory_estimate(case: Case, *, streamed: bool = False) -> int:
    """Estimate the peak memory of a run on top of the bare program.

    With ``d`` dimensions, the integrator of the full model needs about ``180 + 30 d`` arrays of
    doubles on the grid for stages, functions of the operator and transforms, and every output time
    twice ``3 d + 5`` arrays for charge, covariance, variance, field, potential and realizability
    margin, as they come and as they are stacked; of outputs that stream to a file a few are held at
    a time. A model with more moments needs as many times more as it has more components.
    ``python -m benchmarks.boxes`` measures both.

    Parameters
    ----------
    case : Case
        A validated case.
    streamed : bool
        Whether outputs go to a file as they come.

    Returns
    -------
    int
        Bytes.
    """
    dimensions = case.grid.dimensions
    outputs = case.run.outputs
    # the initial and the last time are kept besides a count of outputs
    times = outputs + 2 if isinstance(outputs, int) else len(outputs) + 1
    times = min(times, _STREAMED) if streamed else times
    known = _components("full", dimensions)
    components = max(_components(case.model, dimensions), known)
    working = (180 + 30 * dimensions) * components / known
    kept = 3 * dimensions + 5 + components - known
    return int(_BYTES * case.grid.size * (working + 2 * times * kept))


def _components(model: str, dimensions: int) -> int:
    """Return how many numbers the state of a model has at a point."""
    return sum(dimensions ** RANKS[moment] for moment in MODELS[model].evolves)


def available_memory() -> int | None:
    """Return the memory that this process can still take, in bytes, or None if unknown."""
    limits = [
        limit for limit in (_available_by_kernel(), _limit_of_container()) if limit is not None
    ]
    return min(limits, default=None)


def _available_by_kernel() -> int | None:
    try:
        for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    except (OSError, ValueError, IndexError):
        pass  # not Linux: the installed memory is the next best bound
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return None


def _limit_of_container() -> int | None:
    try:
        return int(Path("/sys/fs/cgroup/memory.max").read_text(encoding="ascii"))
    except (OSError, ValueError):
        return None  # no such file, or "max"


def require_memory(case: Case, *, streamed: bool = False) -> None:
    """Refuse a case that does not fit in the available memory.

    Parameters
    ----------
    case : Case
        A validated case.
    streamed : bool
        Whether outputs go to a file as they come.

    Raises
    ------
    InputError
        Names the estimate, what is available, and what to change.
    """
    needed, available = memory_estimate(case, streamed=streamed), available_memory()
    if available is None or needed <= available:
        return
    outputs = case.run.outputs
    count = outputs if isinstance(outputs, int) else len(outputs)
    held = "" if streamed else f" with {count} outputs"
    raise InputError.about(
        "grid.points",
        f"is {list(case.grid.points)}, which{held} needs about "
        f"{needed / _GIBIBYTE:,.3g} GiB of memory, but must fit in the available "
        f"{available / _GIBIBYTE:,.3g} GiB",
    )


def require_memory_for_particles(case: Case) -> None:
    """Refuse more simulated particles than fit in the available memory.

    Parameters
    ----------
    case : Case
        Whose table ``[kinetic]`` says how many there are.

    Raises
    ------
    InputError
        Names the estimate and what is available.
    """
    options = case.kinetic or Kinetic()
    particles = options.particles * options.ensembles
    needed, available = BYTES_OF_PARTICLE * particles, available_memory()
    if available is not None and needed > available:
        raise InputError.about(
            "kinetic.particles",
            f"makes {particles} in all ensembles, which need about {needed / _GIBIBYTE:,.3g} GiB "
            f"of memory, but must fit in the available {available / _GIBIBYTE:,.3g} GiB",
        )
