"""The hierarchy of moment models."""

from __future__ import annotations

from triboflux import closures
from triboflux.closures import ClosureSet
from triboflux.errors import InputError, nearest
from triboflux.models.coefficients import (
    TransportCoefficients,
    transport_coefficients,
    validity,
)
from triboflux.models.full import full
from triboflux.models.model import Model
from triboflux.models.reduced import algebraic, collisional, gradient, semi_algebraic
from triboflux.models.terms import Operator, Product, Term, evaluate
from triboflux.numbers import Numbers

REGISTRY = {
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
        If the model or the set is unknown.
    """
    if name not in REGISTRY:
        raise InputError(
            f"model: '{name}' is not known; allowed are {', '.join(REGISTRY)}."
            f"{nearest(name, REGISTRY)}"
        )
    if isinstance(closure_set, str):
        closure_set = closures.by_name(closure_set, numbers.restitution, exponent)
    return REGISTRY[name](transport_coefficients(numbers, closure_set, dimensions))
