"""Coefficients that follow a granular temperature which varies from place to place.

The lists of terms of the other models hold for one granular temperature. Here each of their terms
becomes the same one with the coefficient of the local Θ: what it is at Θ = 1 stays a linear term,
which the integrator takes exactly, and the rest is a product.
"""

from __future__ import annotations

import functools as ft
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple, TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from triboflux.closures import ClosureSet
from triboflux.models import operators as o
from triboflux.models import terms as t
from triboflux.models.coefficients import TransportCoefficients, transport_coefficients
from triboflux.numbers import Numbers

Scalar: TypeAlias = float | Float[Array, ""]

TEMPERATURE = "granular_temperature"
OFF = ", off the first temperature"
"""Ends the name of a term that is what another lacks where Θ is not one."""
CONSERVED = ("charge", "variance")
"""Moments that gradients only move from place to place."""
_COLDEST = 1e-12
"""Granular temperature below which coefficients do not fall, so that powers of it stay finite."""
_NEVER = 1e100
"""Stands for an infinite collision time, whose products with absent mechanisms vanish."""


class _Values(NamedTuple):
    """The seven numbers as a pytree."""

    peclet: Any
    tau_c: Any
    tau_p: Any
    tau_sigma: Any
    energy_ratio: Any
    length_ratio: Any
    restitution: Any


class _Closures(eqx.Module):
    """A closure set as a pytree."""

    name: str = eqx.field(static=True)
    exponent: Scalar
    values: dict[str, Any]

    def __getitem__(self, name: str) -> Any:
        return self.values[name]

    @property
    def complete(self) -> bool:
        return self.name == "complete"


class LocalCoefficients(eqx.Module):
    """The coefficients of the transport equations as functions of the granular temperature.

    Attributes
    ----------
    numbers : NamedTuple
        The seven numbers, of the granular temperature that scales the equations.
    closures : Module
        A closure set.
    trace_dimensions : int
        n_t, how many directions the trace of a third-order moment runs over.
    """

    numbers: _Values
    closures: _Closures
    trace_dimensions: int = eqx.field(static=True)

    @classmethod
    def of(
        cls, numbers: Numbers, closure_set: ClosureSet, trace_dimensions: int
    ) -> LocalCoefficients:
        """Return those of a case.

        Parameters
        ----------
        numbers : Numbers
            The seven dimensionless numbers; values may be traced JAX scalars.
        closure_set : ClosureSet
            Made for the restitution of `numbers`.
        trace_dimensions : int
            n_t.
        """
        values = {name: c.value for name, c in closure_set.coefficients.items()}
        return cls(
            _Values(*(getattr(numbers, name) for name in _Values._fields)),
            _Closures(closure_set.name, closure_set.exponent, values),
            trace_dimensions,
        )

    def at(self, granular_temperature: Float[Array, "*x"] | None) -> TransportCoefficients:
        """Return the coefficients on points with these granular temperatures.

        Parameters
        ----------
        granular_temperature : Array or None
            Scaled by that of the numbers, which ``None`` stands for.
        """
        numbers: Any = self.numbers
        closures: Any = self.closures
        velocity: Any = 1.0
        if granular_temperature is not None:
            numbers = numbers._replace(tau_c=jnp.minimum(numbers.tau_c, _NEVER))
            velocity = speed(granular_temperature)
        n_t = self.trace_dimensions
        return transport_coefficients(numbers, closures, n_t, n_t, velocity)


def speed(granular_temperature: Float[Array, "*x"]) -> Float[Array, "*x"]:
    """Return √Θ, also where a truncated series falls below zero."""
    return jnp.sqrt(jnp.maximum(granular_temperature, _COLDEST))


Builder: TypeAlias = Callable[[LocalCoefficients, Any], tuple[t.Term, ...]]
"""Makes terms for a granular temperature, ``None`` being that of the numbers."""


class _CoefficientsOf(NamedTuple):
    """The coefficients of a builder's terms on the points, and by what they exceed those at one."""

    builder: Builder

    def __call__(
        self, temperature: Array, local: LocalCoefficients
    ) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        pairs = zip(self.builder(local, temperature), self.builder(local, None), strict=True)
        found = [(here.coefficient, one.coefficient) for here, one in pairs]
        return tuple(here for here, _ in found), tuple(here - one for here, one in found)


class _Excess(NamedTuple):
    """By what a linear term differs from the same one at Θ = 1."""

    place: int

    def __call__(self, field: Array, found: Any, local: LocalCoefficients) -> Array:
        return t.times(found[1][self.place], field)


class _Local(NamedTuple):
    """A product with a coefficient that depends on place."""

    place: int
    function: Callable[..., Array]

    def __call__(self, *fields: Any) -> Array:
        *factors, found, _ = fields
        return t.times(found[0][self.place], self.function(*factors))


def varying(builder: Builder, local: LocalCoefficients) -> tuple[t.Term, ...]:
    """Return terms whose coefficients follow the granular temperature.

    Parameters
    ----------
    builder : Callable
        Makes the terms; at the top of a module, as programs are compiled for what it is.
    local : LocalCoefficients
        Of the case.
    """
    result: list[t.Term] = []
    closures = local.closures
    which = _vary(builder, closures.name, tuple(closures.values), local.trace_dimensions)
    for index, (term, varies) in enumerate(zip(builder(local, None), which, strict=True)):
        if not varies:
            result.append(term)
        elif isinstance(term.source, t.Product):
            result.append(_local(builder, index, term, term.source, local))
        else:
            result += [term, _excess(builder, index, term, term.source, local)]
    return tuple(result)


def _shared(builder: Builder) -> t.Shared:
    return t.Shared((TEMPERATURE,), _CoefficientsOf(builder))


def _excess(
    builder: Builder, index: int, term: t.Term, source: str, local: LocalCoefficients
) -> t.Term:
    """Return what a linear term lacks where Θ is not one."""
    whole = (o.IDENTITY, term.operator)
    outer, inner = o.FLUXES.get(term.operator, whole) if term.moment in CONSERVED else whole
    read = source if inner is o.IDENTITY else t.Applied(inner, source)
    product = t.Product(f"off Θ = 1: {inner.name}", (read, _shared(builder)), _Excess(index))
    return replace(
        term,
        name=f"{term.name}{OFF}",
        operator=outer,
        source=product,
        coefficient=1.0,
        parameters=(local,),
    )


def _local(
    builder: Builder, index: int, term: t.Term, source: t.Product, local: LocalCoefficients
) -> t.Term:
    """Return a product whose coefficient follows Θ."""
    product = t.Product(
        source.name, (*source.reads, _shared(builder)), _Local(index, source.function)
    )
    return replace(term, source=product, coefficient=1.0, parameters=(local,))


@ft.cache
def _vary(builder: Builder, name: str, names: tuple[str, ...], trace_dimensions: int) -> list[bool]:
    """Return which terms of a closure set depend on Θ, whatever the numbers of the case are."""
    some = _Values(1e3, 0.1, 0.3, 0.7, 2.0, 50.0, 0.9)
    values = {name: 0.37 + 0.01 * i for i, name in enumerate(names)}
    probe = LocalCoefficients(some, _Closures(name, 0.8, values), trace_dimensions)
    with jax.ensure_compile_time_eval():
        lists = [builder(probe, theta) for theta in (None, jnp.asarray(0.5))]
        return [
            not math.isclose(float(one.coefficient), float(other.coefficient), rel_tol=1e-9)
            for one, other in zip(*lists, strict=True)
        ]
