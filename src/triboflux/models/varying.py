"""Coefficients that follow a granular temperature, and a density, that vary from place to place.

The lists of terms of the other models hold for one granular temperature and one number density.
Here each of their terms becomes the same one with the coefficient of the local Θ: what it is at
Θ = 1 stays a linear term, which the integrator takes exactly, and the rest is a product.

Where particles move, x in these terms is the coordinate m that moves with their mean velocity in
one dimension, dm = n dx with n scaled by its mean: a derivative ∂/∂x is n ∂/∂m, the divergence of a
flux F per particle, (1/n) ∂(nF)/∂x, is ∂(nF)/∂m, and ∂E/∂x = nQ is ∂E/∂m = Q, so that the field
stays linear in the charge. Only its mean over x instead of m has to be taken off.
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
from triboflux.hierarchy import VOLUME
from triboflux.models import operators as o
from triboflux.models import terms as t
from triboflux.models.coefficients import TransportCoefficients, transport_coefficients
from triboflux.numbers import Numbers

Scalar: TypeAlias = float | Float[Array, ""]

TEMPERATURE = "granular_temperature"
OFF = ", off the first state"
"""Ends the name of a term that is what another lacks where Θ or n is not one."""
CONSERVED = ("charge", "variance")
"""Moments that gradients only move from place to place."""
_COLDEST = 1e-12
"""Granular temperature below which coefficients do not fall, so that powers of it stay finite."""
_SMALLEST = 1e-6
"""Volume per particle below which its inverse does not rise."""
_NEVER = 1e100
"""Stands for infinite numbers, so that products with absent mechanisms and slopes are finite."""


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


class Place(NamedTuple):
    """What coefficients depend on, on the points.

    Attributes
    ----------
    temperature : Array
        Θ, scaled by that of the numbers.
    density : Array or float
        n, scaled by that of the numbers.
    """

    temperature: Any
    density: Any = 1.0

    @classmethod
    def of(cls, temperature: Array, volume: Array | None = None) -> Place:
        """Return it from the granular temperature and the volume per particle, if that varies."""
        return cls(temperature) if volume is None else cls(temperature, density_of(volume))


def density_of(volume: Float[Array, "*x"]) -> Float[Array, "*x"]:
    """Return n, also where a truncated series of the volume falls below zero."""
    return 1.0 / jnp.maximum(volume, _SMALLEST)


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

    def at(self, place: Place | None) -> TransportCoefficients:
        """Return the coefficients on points with these granular temperatures and densities.

        Parameters
        ----------
        place : Place or None
            ``None`` stands for the granular temperature and density of the numbers. Collisions are
            as many more as particles: the radial distribution is held.
        """
        numbers: Any = self.numbers
        closures: Any = self.closures
        velocity: Any = 1.0
        if place is not None:
            collisional = {
                name: jnp.minimum(getattr(numbers, name), _NEVER) / place.density
                for name in ("tau_c", "peclet", "tau_sigma")
            }
            numbers = numbers._replace(**collisional)
            velocity = speed(place.temperature)
        n_t = self.trace_dimensions
        return transport_coefficients(numbers, closures, n_t, n_t, velocity)


def speed(granular_temperature: Float[Array, "*x"]) -> Float[Array, "*x"]:
    """Return √Θ, also where a truncated series falls below zero."""
    return jnp.sqrt(jnp.maximum(granular_temperature, _COLDEST))


Builder: TypeAlias = Callable[[LocalCoefficients, Any], tuple[t.Term, ...]]
"""Makes terms for a `Place`, ``None`` being the granular temperature and density of the numbers."""


class _Found(NamedTuple):
    """What the terms of a builder share on the points.

    Attributes
    ----------
    here, first : tuple
        The coefficients of all terms, and those at Θ = n = 1.
    density, volume : Array or None
        n and 1/n, where particles move.
    """

    here: tuple[Any, ...]
    first: tuple[Any, ...]
    density: Any
    volume: Any

    def stretch(self, derivatives: int) -> Any:
        """Return what turns so many derivatives by m into those by x."""
        return 1.0 if self.density is None or not derivatives else self.density**derivatives

    def along_x(self, derivatives: int | None, field: Array) -> Array:
        """Return a field that was made by derivatives by m as if they were by x.

        ``None`` derivatives tell the electric field.
        """
        if self.density is None:
            return field
        if derivatives is None:
            return centred(field, self.volume)
        return t.times(self.stretch(derivatives), field) if derivatives else field


def centred(field: Float[Array, "... x"], volume: Float[Array, " x"]) -> Float[Array, "... x"]:
    """Return a field less its mean over x, on points that are equally spaced in m."""
    return field - jnp.mean(t.times(volume, field), axis=-1, keepdims=True)


class _CoefficientsOf(NamedTuple):
    """Finds what the terms of a builder share."""

    builder: Builder

    def __call__(self, temperature: Array, *given: Any) -> _Found:
        *volumes, local = given
        volume = volumes[0] if volumes else None
        place = Place.of(temperature, volume)
        here, first = (
            tuple(term.coefficient for term in self.builder(local, at)) for at in (place, None)
        )
        return _Found(here, first, None if volume is None else place.density, volume)


class _Excess(NamedTuple):
    """By what a linear term differs from the same one at Θ = n = 1."""

    place: int
    outer: int
    inner: int | None

    def __call__(self, field: Array, found: _Found, local: LocalCoefficients) -> Array:
        here = found.here[self.place] * found.stretch(self.outer + (self.inner or 0))
        excess = t.times(here - found.first[self.place], field)
        if self.inner is None:
            excess = excess + t.times(here, found.along_x(None, field) - field)
        return excess


class _Local(NamedTuple):
    """A product with a coefficient that depends on place."""

    place: int
    outer: int
    inner: tuple[int | None, ...]
    function: Callable[..., Array]

    def __call__(self, *fields: Any) -> Array:
        *factors, found, _ = fields
        factors = [found.along_x(*pair) for pair in zip(self.inner, factors, strict=True)]
        here = found.here[self.place] * found.stretch(self.outer)
        return t.times(here, self.function(*factors))


def varying(
    builder: Builder, local: LocalCoefficients, *, moving: bool = False
) -> tuple[t.Term, ...]:
    """Return terms whose coefficients follow the granular temperature.

    Parameters
    ----------
    builder : Callable
        Makes the terms; at the top of a module, as programs are compiled for what it is.
    local : LocalCoefficients
        Of the case.
    moving : bool
        Whether particles move and are as dense as that makes them; in one dimension.
    """
    result: list[t.Term] = []
    closures = local.closures
    names, shared = tuple(closures.values), _shared(builder, moving)
    which = _vary(builder, closures.name, names, local.trace_dimensions, moving)
    for index, (term, varies) in enumerate(zip(builder(local, None), which, strict=True)):
        if not (varies or (moving and _stretches(term))):
            result.append(term)
        elif isinstance(term.source, t.Product):
            result.append(_local(shared, index, term, term.source, local))
        else:
            result += [term, _excess(shared, index, term, term.source, local, moving)]
    return tuple(result)


def _shared(builder: Builder, moving: bool) -> t.Shared:
    return t.Shared((TEMPERATURE, VOLUME) if moving else (TEMPERATURE,), _CoefficientsOf(builder))


def _derivatives(read: str | t.Applied | t.Shared) -> int | None:
    """Return how many derivatives by x a field that is read has, ``None`` for the electric field.

    What products share has none.
    """
    if not isinstance(read, t.Applied):
        return 0
    return None if read.operator is o.ELECTRIC_FIELD else read.operator.derivatives


def _stretches(term: t.Term) -> bool:
    """Return whether a term is another one along m than along x."""
    reads = term.source.reads if isinstance(term.source, t.Product) else ()
    within = any(_derivatives(read) != 0 for read in reads)
    return within or term.operator is o.ELECTRIC_FIELD or term.operator.derivatives > 0


def _parts(term: t.Term, moving: bool) -> tuple[o.Operator, o.Operator]:
    """Return what acts on a flux, and what makes that of the source."""
    if term.moment in CONSERVED and term.operator in o.FLUXES:
        return o.FLUXES[term.operator]
    if moving and term.operator is o.DIVERGENCE_OF_TENSOR:
        return term.operator, o.IDENTITY
    return o.IDENTITY, term.operator


def _excess(
    shared: t.Shared,
    index: int,
    term: t.Term,
    source: str,
    local: LocalCoefficients,
    moving: bool,
) -> t.Term:
    """Return what a linear term lacks where Θ or n is not one."""
    outer, inner = _parts(term, moving)
    read = source if inner is o.IDENTITY else t.Applied(inner, source)
    function = _Excess(index, outer.derivatives, _derivatives(read))
    product = t.Product(f"off Θ = 1: {inner.name}", (read, shared), function)
    return replace(
        term,
        name=f"{term.name}{OFF}",
        operator=outer,
        source=product,
        coefficient=1.0,
        parameters=(local,),
    )


def _local(
    shared: t.Shared, index: int, term: t.Term, source: t.Product, local: LocalCoefficients
) -> t.Term:
    """Return a product whose coefficient follows Θ and n."""
    inner = tuple(map(_derivatives, source.reads))
    function = _Local(index, term.operator.derivatives, inner, source.function)
    product = t.Product(source.name, (*source.reads, shared), function)
    return replace(term, source=product, coefficient=1.0, parameters=(local,))


@ft.cache
def _vary(
    builder: Builder, name: str, names: tuple[str, ...], trace_dimensions: int, moving: bool
) -> list[bool]:
    """Return which terms depend on Θ, and on n if particles move, whatever the numbers are."""
    some = _Values(1e3, 0.1, 0.3, 0.7, 2.0, 50.0, 0.9)
    values = {name: 0.37 + 0.01 * i for i, name in enumerate(names)}
    probe = LocalCoefficients(some, _Closures(name, 0.8, values), trace_dimensions)
    with jax.ensure_compile_time_eval():
        other = Place(jnp.asarray(0.5), jnp.asarray(0.7 if moving else 1.0))
        lists = [builder(probe, place) for place in (None, other)]
        return [
            not math.isclose(float(one.coefficient), float(other.coefficient), rel_tol=1e-9)
            for one, other in zip(*lists, strict=True)
        ]
