"""Conduction of the granular temperature tensor R_ij, and the coefficients of its equation.

`triboflux.velocity_closures` has the equations: the flux F_ijk of R_ij is S_ijk = ⟨c'_i c'_j c'_k⟩
in balance, what collisions over a diameter add to it, and what they pass on themselves.
"""

from __future__ import annotations

import functools as ft
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from triboflux.hierarchy import VOLUME
from triboflux.models import operators as o
from triboflux.models import terms as t
from triboflux.models.third_order import with_traces
from triboflux.models.varying import OFF, TEMPERATURE, LocalCoefficients, Place, speed
from triboflux.realizability import TENSOR
from triboflux.velocity_closures import TensorDispersion, flight_dispersion, velocity_closures

TENSOR_GRADIENT = t.Applied(o.GRADIENT_OF_TENSOR, TENSOR)
TEMPERATURE_GRADIENT = t.Applied(o.GRADIENT, TEMPERATURE)
STATE = (TENSOR, TEMPERATURE)


class TemperatureCoefficients(NamedTuple):
    """The coefficients of the equations of R_ij and Θ, scaled by √Θ/L and so on.

    Attributes
    ----------
    isotropy : scalar or array
        r, at which R_ij − Θ δ_ij decays by collisions.
    cooling : scalar or array
        q, at which Θ decays by inelastic collisions.
    drag : scalar
        1/τ_p.
    third, third_trace : scalar or array
        Rates at which S_ijk and its trace part decay, drag included.
    production_shift, flux_shift : scalar
        What collisions over a diameter add to production and flux of S_ijk.
    transfer : scalar or array
        In front of what collisions pass on of R_ij over a diameter.
    electric_force : scalar
        u.
    """

    isotropy: Any
    cooling: Any
    drag: Any
    third: Any
    third_trace: Any
    production_shift: Any
    flux_shift: Any
    transfer: Any
    electric_force: Any


def temperature_coefficients(
    local: LocalCoefficients, place: Place | None
) -> TemperatureCoefficients:
    """Return the coefficients of the equations of R_ij and Θ at a granular temperature.

    Parameters
    ----------
    local : LocalCoefficients
        Of the case.
    place : Place or None
        Granular temperature and density on the points; ``None`` stands for those of the numbers.
    """
    n = local.numbers
    closures = velocity_closures(n.restitution)
    rate, dense = 1.0 / n.tau_c, density_number(local)
    if place is not None:
        rate, dense = speed(place.temperature) * place.density / n.tau_c, dense * place.density
    return TemperatureCoefficients(
        isotropy=closures.isotropy * rate,
        cooling=closures.cooling * rate,
        drag=1.0 / n.tau_p,
        third=closures.third_moment * rate + 3.0 / n.tau_p,
        third_trace=closures.third_moment_trace * rate,
        production_shift=closures.production_shift * dense,
        flux_shift=closures.flux_shift * dense,
        transfer=closures.transfer.laplacian * rate / n.length_ratio**2,
        electric_force=n.energy_ratio,
    )


def density_number(local: LocalCoefficients) -> Any:
    """Return √π d/(√Θ τ_c) at the first density, which is 24 α g0 of a suspension."""
    return math.sqrt(math.pi) / (local.numbers.length_ratio * local.numbers.tau_c)


def along(tensor: Float[Array, "d d *x"], vector: Float[Array, "d *x"]) -> Float[Array, "d *x"]:
    """Return A_ij b_j."""
    return jnp.stack([t.dot(row, vector) for row in tensor])


def deviator(tensor: Float[Array, "d d *x"], temperature: Float[Array, "*x"]) -> Array:
    """Return R_ij − Θ δ_ij."""
    d = len(tensor)
    return jnp.stack(
        [
            jnp.stack([tensor[i, j] - temperature if i == j else tensor[i, j] for j in range(d)])
            for i in range(d)
        ]
    )


def conduction_terms(local: LocalCoefficients, *, moving: bool = False) -> tuple[t.Term, ...]:
    """Return −∂_k F_ijk, linear around R_ij = δ_ij, and what the local Θ and R_ij change.

    Parameters
    ----------
    local : LocalCoefficients
        Of the case.
    moving : bool
        As for `triboflux.models.varying.varying`.
    """
    n = local.numbers
    closures = velocity_closures(n.restitution)
    flight = flight_dispersion(
        closures,
        temperature=1.0,
        collision_rate=1.0 / n.tau_c,
        drag_rate=1.0 / n.tau_p,
        density_number=density_number(local),
    )
    passed = closures.transfer.times(1.0 / (n.tau_c * n.length_ratio**2))
    off = [
        t.Term(
            f"conduction{OFF}",
            "conduction",
            "",
            moment,
            operator,
            product,
            -1.0,
            (local,),
        )
        for moment, operator, product in (
            (TENSOR, o.DIVERGENCE_OF_THIRD, _excess_of(HEAT_FLUX, moving)),
            (TEMPERATURE, o.DIVERGENCE, _excess_of(TRACE_OF_HEAT_FLUX, moving)),
        )
    ]
    return (
        *_dispersed("conduction by flight", flight),
        *_dispersed("conduction by collisions", passed),
        *off,
    )


def _dispersed(name: str, dispersion: TensorDispersion) -> tuple[t.Term, ...]:
    """Return the five isotropic operators on R_ij, R_mm being 3 Θ."""
    d, term = dispersion, t.maker(TENSOR)
    parts = (
        ("own", o.LAPLACIAN, TENSOR, d.laplacian),
        ("crosswise", o.GRADIENT_OF_TENSOR_DIVERGENCE, TENSOR, d.gradient_divergence),
        ("isotropic", o.ISOTROPIC_DOUBLE_DIVERGENCE, TENSOR, d.double_divergence),
        ("by the trace", o.HESSIANS, TEMPERATURE, 1.5 * d.trace_hessian),
        ("isotropic by the trace", o.ISOTROPIC_LAPLACIAN, TEMPERATURE, 3.0 * d.trace_laplacian),
    )
    return with_traces(
        *(
            term(f"{name}, {part}", "conduction", operator, source, factor)
            for part, operator, source, factor in parts
        )
    )


def _cyclic(vector: Float[Array, "d *x"]) -> Float[Array, "d d d *x"]:
    """Return a_i δ_jk + a_j δ_ik + a_k δ_ij."""
    return _isotropic(vector) + sum(jnp.moveaxis(_isotropic(vector), 2, place) for place in (0, 1))


def _heat_flux(
    tensor: Array, temperature: Array, gradient: Array, slope: Array, c: TemperatureCoefficients
) -> tuple[Float[Array, "d d d *x"], Float[Array, "d *x"]]:
    """Return F_ijk and F_mmk of R_ij, Θ, ∂_k R_ij at i, j, k and ∂_k Θ.

    `triboflux.velocity_closures` tells the equations: S_ijk in balance, what collisions add to its
    flux and what they pass on of R_ij.
    """
    trace_slope = 3.0 * slope
    divergence = ft.reduce(lambda a, b: a + b, (row[:, i] for i, row in enumerate(gradient)))
    # R_kl ∂_l R_ij at i, j, k, and what it is at all cyclic places
    carried = jnp.stack([jnp.stack([along(tensor, slopes) for slopes in row]) for row in gradient])
    shift = c.production_shift * temperature
    shifted = _at_all_places(gradient) + _cyclic(divergence + 0.5 * trace_slope)
    production = -_at_all_places(carried) - t.times(shift, shifted)
    own = ft.reduce(lambda a, b: a + b, (row[:, i] for i, row in enumerate(carried)))
    shifted_trace = 3.5 * (2.0 * divergence + trace_slope)
    trace = -2.0 * own - along(tensor, trace_slope) - t.times(shift, shifted_trace)
    trace = t.times(1.0 / (c.third + 5.0 * c.third_trace), trace)
    third = t.times(1.0 / c.third, production - t.times(c.third_trace, _cyclic(trace)))
    passed = (
        2.0 * _at_all_places(gradient)
        - gradient
        + _isotropic(divergence)
        + 0.5 * _cyclic(trace_slope)
    )
    passed_trace = 7.0 * divergence + 3.5 * trace_slope
    return (
        third + t.times(c.flux_shift, third + 0.5 * _cyclic(trace)) - t.times(c.transfer, passed),
        t.times(1.0 + 3.5 * c.flux_shift, trace) - t.times(c.transfer, passed_trace),
    )


def _at_all_places(field: Float[Array, "d d d *x"]) -> Float[Array, "d d d *x"]:
    """Return A_ijk + A_jki + A_ikj of an A_ijk that is symmetric in i and j."""
    return field + jnp.moveaxis(field, 2, 0) + jnp.moveaxis(field, 2, 1)


def _isotropic(vector: Float[Array, "d *x"]) -> Float[Array, "d d d *x"]:
    """Return δ_ij a_k."""
    d = range(len(vector))
    return jnp.stack([jnp.stack([vector * (i == j) for j in d]) for i in d])


def _heat_flux_excess(
    tensor: Array, temperature: Array, gradient: Array, slope: Array, *given: Any
) -> tuple[Array, Array]:
    """Return by what F_ijk and F_mmk differ from their linear forms around R_ij = δ_ij.

    Last come the volume per particle, where particles move, and the case's coefficients. Then
    derivatives are by m, and the fluxes those through a point that moves along.
    """
    *volumes, local = given
    place = Place.of(temperature, *volumes)
    here, first = (temperature_coefficients(local, at) for at in (place, None))
    along_x = t.times(place.density, gradient), t.times(place.density, slope)
    flux, trace = _heat_flux(tensor, temperature, *along_x, here)
    flux, trace = t.times(place.density, flux), t.times(place.density, trace)
    one = jnp.ones_like(temperature)
    unit = deviator(jnp.zeros_like(tensor), -one)
    linear, linear_trace = _heat_flux(unit, one, gradient, slope, first)
    return flux - linear, trace - linear_trace


def _third_of_trace(fluxes: tuple[Array, Array], _: LocalCoefficients) -> Array:
    return fluxes[1] / 3.0


def _tensor(fluxes: tuple[Array, Array], _: LocalCoefficients) -> Array:
    return fluxes[0]


HEAT_FLUX = ("F", _tensor)
TRACE_OF_HEAT_FLUX = ("tr F/3", _third_of_trace)


def _excess_of(flux: tuple[str, Callable[..., Array]], moving: bool) -> t.Product:
    """Return by what a flux differs from its linear form, as a product."""
    name, chosen = flux
    state = (*STATE, TENSOR_GRADIENT, TEMPERATURE_GRADIENT, *((VOLUME,) if moving else ()))
    return t.Product(f"{name}{OFF}", (t.Shared(state, _heat_flux_excess),), chosen)
