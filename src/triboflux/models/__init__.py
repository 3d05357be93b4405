"""The hierarchy of moment models."""

from __future__ import annotations

from triboflux import closures
from triboflux.closures import ClosureSet
from triboflux.errors import InputError, nearest
from triboflux.hierarchy import MODELS, carries_trace, moves
from triboflux.models.coefficients import (
    TransportCoefficients,
    transport_coefficients,
    validity,
)
from triboflux.models.full import full
from triboflux.models.model import Model
from triboflux.models.operators import Operator
from triboflux.models.reduced import algebraic, collisional, gradient, semi_algebraic
from triboflux.models.self_consistent import self_consistent, self_consistent_flow
from triboflux.models.terms import Product, Term, evaluate
from triboflux.models.third_order import third_order
from triboflux.models.varying import TEMPERATURE, LocalCoefficients
from triboflux.numbers import Numbers

REGISTRY = {
    "self-consistent-flow": self_consistent_flow,
    "self-consistent": self_consistent,
    "third-order": third_order,
    "full": full,
    "semi-algebraic": semi_algebraic,
    "algebraic": algebraic,
    "gradient": gradient,
    "collisional": collisional,
}

__all__ = [
    "REGISTRY",
    "Model",
    "Operator",
    "Product",
    "Term",
    "TransportCoefficients",
    "build",
    "evaluate",
    "trace_dimensions",
    "transport_coefficients",
    "validity",
]


def build(
    name: str,
    numbers: Numbers,
    closure_set: ClosureSet | str = "derived",
    *,
    dimensions: int = 1,
    exponent: float = closures.HERTZ_EXPONENT,
) -> Model:
    """Return the model called `name` for given numbers and closures.

    Parameters
    ----------
    name : str
        A key of `REGISTRY`.
    numbers : Numbers
        The seven dimensionless numbers; values may be traced JAX scalars.
    closure_set : ClosureSet or str
        A set, or the name of one.
    dimensions : int
        Number of space dimensions.
    exponent : float
        a of the charge-transfer law, where a set is asked for by name.

    Raises
    ------
    InputError
        If the model or the set is unknown, or the model has fewer dimensions.
    """
    if name not in REGISTRY:
        raise InputError(
            f"model: '{name}' is not known; allowed are {', '.join(REGISTRY)}."
            f"{nearest(name, REGISTRY)}"
        )
    if dimensions > 1 and moves(name):
        raise InputError(
            f"model: '{name}' is not allowed in {dimensions} dimensions; it knows one only."
        )
    if isinstance(closure_set, str):
        closure_set = closures.by_name(closure_set, numbers.restitution, exponent)
    n_t = trace_dimensions(name, closure_set, dimensions)
    if TEMPERATURE in MODELS[name].evolves:
        return REGISTRY[name](LocalCoefficients.of(numbers, closure_set, n_t))
    return REGISTRY[name](transport_coefficients(numbers, closure_set, dimensions, n_t))


def trace_dimensions(name: str, closure_set: ClosureSet, dimensions: int) -> int:
    """Return n_t, how many directions the trace of a third-order moment runs over.

    Parameters
    ----------
    name : str
        Of the model; one that evolves the trace evolves that over three dimensions.
    closure_set : ClosureSet
        Which decides for the others.
    dimensions : int
        Number of space dimensions.
    """
    return 3 if carries_trace(name) else closure_set.trace_dimensions(dimensions)
