"""The moments and the models by name: ranks of tensors, and who evolves or closes what.

Everything that handles a state, a dataset or a checkpoint asks here which moments there are, so
that a model with more of them needs no other change. Nothing here imports arrays.
"""

from __future__ import annotations

from typing import NamedTuple

from triboflux.case_checks import DIMENSION_NAMES

RANKS = {
    "charge": 0,
    "covariance": 1,
    "variance": 0,
    "covariance_flux": 2,
    "covariance_flux_trace": 0,
    "granular_temperature_tensor": 2,
    "granular_temperature": 0,
    "dissipated_energy": 0,
    "specific_volume": 0,
    "mean_velocity": 1,
}
"""Rank of each moment; tensors are symmetric and have the components of the box's dimensions."""

TRACES = {
    "covariance_flux": ("covariance_flux_trace", 1.0),
    "granular_temperature_tensor": ("granular_temperature", 1.0 / 3.0),
}
"""The moment that is so many times a tensor's trace over three dimensions, and how many.

Whatever those of the box: together they are the tensor of a three-dimensional state that is uniform
in the other directions.
"""


class Known(NamedTuple):
    """What a model knows.

    Attributes
    ----------
    evolves : tuple of str
        Moments that have an equation of their own, in the order of `RANKS`.
    closes : tuple of str
        Moments that follow algebraically.
    """

    evolves: tuple[str, ...]
    closes: tuple[str, ...] = ()


VOLUME, VELOCITY = "specific_volume", "mean_velocity"
FLOW = (VOLUME, VELOCITY)
"""Moments of a model whose particles move on average."""

MODELS = {
    "self-consistent-flow": Known(tuple(RANKS)),
    "self-consistent": Known(tuple(name for name in RANKS if name not in FLOW)),
    "third-order": Known(
        ("charge", "covariance", "variance", "covariance_flux", "covariance_flux_trace")
    ),
    "full": Known(("charge", "covariance", "variance")),
    "semi-algebraic": Known(("charge", "variance"), ("covariance",)),
    "algebraic": Known(("charge",), ("covariance", "variance")),
    "gradient": Known(("charge",), ("covariance",)),
    "collisional": Known(("charge",)),
}
"""The models, the most complete first."""


def carries_trace(model: str) -> bool:
    """Return whether a model evolves the three-dimensional trace of a third-order moment."""
    return any(trace in MODELS[model].evolves for trace, _ in TRACES.values())


def moves(model: str) -> bool:
    """Return whether particles move on average, which a model knows in one dimension only."""
    return set(FLOW) <= set(MODELS[model].evolves)


def components(moment: str, dimensions: int) -> dict[str, tuple[int, ...]]:
    """Return the names and places of the different components of a moment.

    A scalar and a vector are one variable of a dataset each, the latter with an axis of components.
    A tensor is a variable for each pair of directions, of which symmetry leaves ``xx``, ``xy``,
    ``yy`` in two dimensions.

    Parameters
    ----------
    moment : str
        A key of `RANKS`.
    dimensions : int
        Of the box.

    Returns
    -------
    dict of str to tuple of int
        Such as ``{"covariance_flux_xx": (0, 0)}``; places are empty but for tensors.
    """
    if RANKS[moment] < 2:
        return {moment: ()}
    name = moment.removesuffix("_tensor")
    return {
        f"{name}_{DIMENSION_NAMES[i]}{DIMENSION_NAMES[j]}": (i, j)
        for i in range(dimensions)
        for j in range(i, dimensions)
    }


def variables(model: str, dimensions: int) -> tuple[str, ...]:
    """Return the variables of a dataset that hold the moments which a model evolves.

    Parameters
    ----------
    model : str
        A key of `MODELS`.
    dimensions : int
        Of the box.
    """
    moments = MODELS[model].evolves
    return tuple(name for moment in moments for name in components(moment, dimensions))
