"""How far a run is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from triboflux.case import Run


@dataclass(frozen=True)
class Progress:
    """Where a running integration or simulation stands.

    Attributes
    ----------
    time, t_end : float
        Scaled by L/√Θ.
    steps, rejected : int
        Accepted and rejected so far.
    peak_charge : float
        Largest |Q| in the box, scaled by Q0.
    fraction : float
        Estimated part of the run that is done, from 0 to 1.
    """

    time: float
    t_end: float
    steps: int
    rejected: int
    peak_charge: float
    fraction: float


@dataclass(frozen=True)
class OutputProgress:
    """How many output times of a result are written.

    Attributes
    ----------
    done, total : int
        Those that are, and all of them.
    """

    done: int
    total: int

    @property
    def fraction(self) -> float:
        """Part of them that is written, from 0 to 1."""
        return self.done / self.total


def fraction_done(run: Run, time: float, peak: float, initial_peak: float) -> float:
    """Estimate how much of a run is done, by time or by the decay of the charge.

    Parameters
    ----------
    run : Run
        With the end and perhaps a stop value.
    time : float
        Now.
    peak, initial_peak : float
        Largest |Q| now and at time 0.
    """
    fraction = time / run.t_end
    stop = run.stop_at_peak_charge
    if stop is not None and 0.0 < peak < initial_peak:
        fraction = max(fraction, math.log(peak / initial_peak) / math.log(stop / initial_peak))
    return min(fraction, 1.0)
