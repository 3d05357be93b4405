"""What all solvers are given: the equations' coefficients, the initial charge and the end time."""

from __future__ import annotations

from math import inf, pi, sqrt
from typing import Any, NamedTuple

from benchmarks.boxes import MODES
from examples.full_model_by_hand import PAPER_CASES, coefficients

ONE_WAVE = (((1,), -1.0, 0.0),)
THREE_WAVES = (((1,), -0.7, 0.2), ((2,), 0.3, -0.1), ((3,), 0.1, 0.15))
SOLID_FRACTION, CONTACT_VALUE, LENGTH_RATIO, DENSE_PECLET = 0.5, 6.0, 192.0, 1e5
# A real suspension: its times follow from the solid fraction and the diffusivity.
DENSE = {
    "peclet": DENSE_PECLET,
    "tau_c": sqrt(pi) / (24.0 * SOLID_FRACTION * CONTACT_VALUE * LENGTH_RATIO),
    "tau_p": inf,
    "tau_sigma": DENSE_PECLET / (6.0 * SOLID_FRACTION * LENGTH_RATIO**2),
    "energy_ratio": 300.0,
    "length_ratio": LENGTH_RATIO,
    "restitution": 0.9,
}
DRAG = {"peclet": 1e5, "tau_c": 1e-2, "tau_p": 0.05, "tau_sigma": 5.0, "energy_ratio": 300.0}
DRAG |= {"length_ratio": LENGTH_RATIO, "restitution": 0.9}


class Problem(NamedTuple):
    """One of the problems.

    Attributes
    ----------
    title : str
        What the tables call it.
    numbers : dict of str to float
        The seven dimensionless numbers.
    closures : str
        Closure set.
    modes : tuple
        Waves per dimension, sine and cosine amplitudes of the initial charge.
    end : float
        Time to integrate to, scaled by L / sqrt(Theta).
    points : tuple of int or None
        Prescribed points per dimension; every solver chooses its best if there are none.
    """

    title: str
    numbers: dict[str, float]
    closures: str
    modes: tuple[Any, ...]
    end: float
    points: tuple[int, ...] | None = None

    @property
    def dimensions(self) -> int:
        """Number of dimensions of the box."""
        return len(self.modes[0][0])


PROBLEMS = {
    "A": Problem("case A, published", PAPER_CASES["A"], "published", ONE_WAVE, 49.14328),
    "B": Problem("case B, published", PAPER_CASES["B"], "published", ONE_WAVE, 0.165302),
    "dense": Problem("dense suspension, derived", DENSE, "derived", THREE_WAVES, 1.0),
    "drag": Problem("triboconductivity and drag, derived", DRAG, "derived", THREE_WAVES, 2.0),
    "2-D": Problem("case B on 256 × 256", PAPER_CASES["B"], "derived", MODES[2], 0.3, (256, 256)),
    "3-D": Problem("case B on 64³", PAPER_CASES["B"], "derived", MODES[3], 0.3, (64, 64, 64)),
}


def described(problem: Problem) -> dict[str, Any]:
    """Return a problem as plain data for a process that lacks the package.

    Parameters
    ----------
    problem : Problem
        Which.

    Returns
    -------
    dict
        ``coefficients`` of the equations by name, ``modes``, ``end`` and ``points``.
    """
    values: dict[str, Any] = coefficients(problem.closures, problem.numbers)
    if problem.dimensions > 1:
        values["transverse_dispersion"] = transverse_dispersion(problem)
    return {
        "coefficients": values,
        "modes": problem.modes,
        "end": problem.end,
        "points": problem.points,
        "numbers": problem.numbers,
        "closures": problem.closures,
    }


def transverse_dispersion(problem: Problem) -> float:
    """Return the dispersion of a covariance across its own gradient, G1/K1."""
    from triboflux import models
    from triboflux.numbers import Numbers

    numbers, d = Numbers(**problem.numbers), problem.dimensions
    return float(
        models.build(
            "full", numbers, problem.closures, dimensions=d
        ).coefficients.covariance_dispersion
    )
