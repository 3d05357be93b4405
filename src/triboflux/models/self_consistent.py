"""The self-consistent model: the third-order one with a granular temperature that the field heats.

The other models hold the granular temperature Θ fixed while the field does work on C. Here
R_ij = ⟨c'_i c'_j⟩ and Θ = R_mm/3 obey equations of their own, for uniform number density and a mean
velocity that is held at zero, docs/self-consistent.md:

    ∂R_ij/∂t = u (C_i E_j + C_j E_i) − r (R_ij − Θ δ_ij) − q Θ δ_ij − (2/τ_p) R_ij − ∂_k S_ijk
               + conduction by collisions,

with the rates of all equations those of the local Θ, and R_ij wherever the others have Θ δ_ij in
terms of particles in flight. What collisions, contacts and drag take is summed up in
`dissipated_energy`, so that kinetic energy, that of the field and this keep their sum.
"""

from __future__ import annotations

import functools as ft
import math
from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from triboflux.hierarchy import MODELS
from triboflux.models import terms as t
from triboflux.models.coefficients import TransportCoefficients
from triboflux.models.model import Model
from triboflux.models.products import symmetric
from triboflux.models.third_order import third_order, trace_of
from triboflux.models.varying import TEMPERATURE, LocalCoefficients, speed, varying
from triboflux.velocity_closures import TensorDispersion, flight_dispersion, velocity_closures

TENSOR = "granular_temperature_tensor"
TENSOR_GRADIENT = t.Applied(t.GRADIENT_OF_TENSOR, TENSOR)
TEMPERATURE_GRADIENT = t.Applied(t.GRADIENT, TEMPERATURE)
COVARIANCE_GRADIENT = t.Applied(t.GRADIENT_OF_VECTOR, "covariance")


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
    local: LocalCoefficients, granular_temperature: Array | None
) -> TemperatureCoefficients:
    """Return the coefficients of the equations of R_ij and Θ at a granular temperature.

    Parameters
    ----------
    local : LocalCoefficients
        Of the case.
    granular_temperature : Array or None
        On the points, scaled by that of the numbers, which ``None`` stands for.
    """
    n = local.numbers
    closures = velocity_closures(n.restitution)
    rate = (1.0 if granular_temperature is None else speed(granular_temperature)) / n.tau_c
    dense = _density_number(local)
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


def _density_number(local: LocalCoefficients) -> Any:
    """Return √π d/(√Θ τ_c), which is 24 α g0 of a suspension."""
    return math.sqrt(math.pi) / (local.numbers.length_ratio * local.numbers.tau_c)


# ------------------------------------------------------------------ pointwise products


def _along(tensor: Float[Array, "d d *x"], vector: Float[Array, "d *x"]) -> Float[Array, "d *x"]:
    """Return A_ij b_j."""
    return jnp.stack([t.dot(row, vector) for row in tensor])


def _deviator(tensor: Float[Array, "d d *x"], temperature: Float[Array, "*x"]) -> Array:
    """Return R_ij − Θ δ_ij."""
    d = len(tensor)
    return jnp.stack(
        [
            jnp.stack([tensor[i, j] - temperature if i == j else tensor[i, j] for j in range(d)])
            for i in range(d)
        ]
    )


def _deviator_along(tensor: Array, temperature: Array, vector: Array) -> Array:
    return _along(_deviator(tensor, temperature), vector)


def _stretching(tensor: Array, temperature: Array, gradient: Float[Array, "d d *x"]) -> Array:
    """Return R'_ik ∂_k C_j + R'_jk ∂_k C_i, of ∂_j C_i at row i, column j."""
    product = jnp.stack([_along(_deviator(tensor, temperature), row) for row in gradient])
    return product + product.swapaxes(0, 1)


def _advection(covariance: Array, gradient: Float[Array, "d d d *x"]) -> Float[Array, "d d *x"]:
    """Return C_k ∂_k R_ij."""
    return jnp.stack([_along(row, covariance) for row in gradient])


def _flux_by_field(tensor: Array, temperature: Array, gradient: Array, field: Array) -> Array:
    return symmetric(_deviator_along(tensor, temperature, gradient), field)


def _flux_along_field(tensor: Array, temperature: Array, gradient: Array, field: Array) -> Array:
    return 2.0 * t.dot(_deviator_along(tensor, temperature, gradient), field)


_STATE = (TENSOR, TEMPERATURE)
DEVIATOR_ALONG_GRADIENT = t.Product("R'·∇Q", (*_STATE, t.CHARGE_GRADIENT), _deviator_along)
DEVIATOR_ALONG_VARIANCE = t.Product("R'·∇V", (*_STATE, t.VARIANCE_GRADIENT), _deviator_along)
STRETCHING = t.Product("R'·∇C + (R'·∇C)ᵀ", (*_STATE, COVARIANCE_GRADIENT), _stretching)
ADVECTION = t.Product("C·∇R", ("covariance", TENSOR_GRADIENT), _advection)
FLUX_BY_FIELD = t.Product(
    "R'·∇V E + E R'·∇V", (*_STATE, t.VARIANCE_GRADIENT, t.FIELD), _flux_by_field
)
COVARIANCE_BY_FIELD = t.Product("C E + E C", ("covariance", t.FIELD), symmetric)
TRACES = {
    STRETCHING: t.Product(
        "2 R':∇C",
        STRETCHING.reads,
        lambda r, theta, g: sum(
            (2.0 * t.dot(a, b) for a, b in zip(_deviator(r, theta), g, strict=True)),
            start=jnp.zeros_like(theta),
        ),
    ),
    ADVECTION: t.Product(
        "3 C·∇Θ", ("covariance", TEMPERATURE_GRADIENT), lambda c, g: 3.0 * t.dot(c, g)
    ),
    FLUX_BY_FIELD: t.Product("2 E·R'·∇V", FLUX_BY_FIELD.reads, _flux_along_field),
    COVARIANCE_BY_FIELD: t.Product(
        "2 C·E", COVARIANCE_BY_FIELD.reads, lambda c, e: 2.0 * t.dot(c, e)
    ),
}
"""The trace over three dimensions of products that are tensors."""


# ------------------------------------------------------------------ equations


def _coefficients(local: LocalCoefficients, temperature: Array | None) -> TransportCoefficients:
    return local.reference() if temperature is None else local.at(temperature)


def _third_order(local: LocalCoefficients, temperature: Array | None) -> tuple[t.Term, ...]:
    """Return the equations of the third-order model, which take R_ij for Θ δ_ij."""
    return third_order(_coefficients(local, temperature)).terms


def _with_trace(*terms: t.Term) -> tuple[t.Term, ...]:
    return (*terms, *(trace_of(term, TRACES) for term in terms))


def _anisotropic(local: LocalCoefficients, temperature: Array | None) -> tuple[t.Term, ...]:
    """Return what R_ij − Θ δ_ij and gradients of R_ij add to these."""
    c = _coefficients(local, temperature)
    destruction = c.variance_flux_destruction
    return (
        t.Term(
            "production by charge gradient, anisotropic",
            "production",
            "",
            "covariance",
            t.IDENTITY,
            DEVIATOR_ALONG_GRADIENT,
            -1.0,
        ),
        t.Term(
            "kinetic dispersion, anisotropic",
            "kinetic dispersion",
            "",
            "variance",
            t.DIVERGENCE,
            DEVIATOR_ALONG_VARIANCE,
            1.0 / destruction,
        ),
        *_with_trace(
            t.Term(
                "production by covariance gradient, anisotropic",
                "production",
                "",
                "covariance_flux",
                t.IDENTITY,
                STRETCHING,
                -1.0,
            ),
            t.Term(
                "production by gradient of the granular temperature",
                "production",
                "",
                "covariance_flux",
                t.IDENTITY,
                ADVECTION,
                -1.0,
            ),
            t.Term(
                "electric force, anisotropic",
                "electric force",
                "",
                "covariance_flux",
                t.IDENTITY,
                FLUX_BY_FIELD,
                -c.electric_force / destruction,
            ),
        ),
    )


def _temperature(local: LocalCoefficients, temperature: Array | None) -> tuple[t.Term, ...]:
    """Return the equations of R_ij and Θ but for conduction by flight."""
    c = temperature_coefficients(local, temperature)

    def term(
        name: str, group: str, operator: t.Operator, source: str | t.Product, coefficient: Any
    ) -> t.Term:
        return t.Term(name, group, "", TENSOR, operator, source, coefficient)

    return _with_trace(
        term("heating by the field", "heating", t.IDENTITY, COVARIANCE_BY_FIELD, c.electric_force),
        term("return to isotropy", "return to isotropy", t.IDENTITY, TENSOR, -c.isotropy),
        term("isotropic part", "return to isotropy", t.ISOTROPIC, TEMPERATURE, c.isotropy),
        term("cooling", "inelastic cooling", t.ISOTROPIC, TEMPERATURE, -c.cooling),
        term("drag", "drag", t.IDENTITY, TENSOR, -2.0 * c.drag),
    )


def _energy(local: LocalCoefficients, temperature: Array | None) -> tuple[t.Term, ...]:
    """Return the equation of the energy that is lost.

    Charge that moves along the field takes energy from it; what the velocities do not get of it is
    lost, as what collisions and drag take from them.
    """
    c = _coefficients(local, temperature)
    own = temperature_coefficients(local, temperature)

    def term(name: str, group: str, source: str | t.Product, coefficient: Any) -> t.Term:
        return t.Term(name, group, "", "dissipated_energy", t.IDENTITY, source, coefficient)

    works: list[t.Term] = []
    for moved in third_order(c).terms:
        if moved.moment != "charge":
            continue
        source = str(moved.source)
        _, inner = t.FLUXES[moved.operator]
        read = source if inner is t.IDENTITY else t.Applied(inner, source)
        along = t.Product(f"E·{inner.name} {source}", (read, t.FIELD), t.dot)
        name = f"work of the field by {moved.name}"
        works.append(term(name, "work of the field", along, -c.electric_force * moved.coefficient))
    return (
        *works,
        term(
            "heating of the particles",
            "work of the field",
            TRACES[COVARIANCE_BY_FIELD],
            -0.5 * c.electric_force,
        ),
        term("cooling", "inelastic cooling", TEMPERATURE, 1.5 * own.cooling),
        term("drag", "drag", TEMPERATURE, 3.0 * own.drag),
    )


def self_consistent(local: LocalCoefficients) -> Model:
    """Return the self-consistent model: the third-order one with equations for R_ij and Θ.

    Parameters
    ----------
    local : LocalCoefficients
        Of the case.
    """
    builders = (_third_order, _anisotropic, _temperature, _energy)
    varied = [term for builder in builders for term in varying(builder, local)]
    terms = (*varied, *_conduction(local))
    return Model("self-consistent", MODELS["self-consistent"].evolves, terms, local.reference())


# ------------------------------------------------------------------ conduction


def _conduction(local: LocalCoefficients) -> tuple[t.Term, ...]:
    """Return −∂_k F_ijk, linear around R_ij = δ_ij, and what the local Θ and R_ij change."""
    n = local.numbers
    closures = velocity_closures(n.restitution)
    flight = flight_dispersion(
        closures,
        temperature=1.0,
        collision_rate=1.0 / n.tau_c,
        drag_rate=1.0 / n.tau_p,
        density_number=_density_number(local),
    )
    passed = closures.transfer.times(1.0 / (n.tau_c * n.length_ratio**2))
    off = [
        t.Term(
            "conduction, off the first temperature",
            "conduction",
            "",
            moment,
            operator,
            product,
            -1.0,
            (local,),
        )
        for moment, operator, product in (
            (TENSOR, t.DIVERGENCE_OF_THIRD, HEAT_FLUX_EXCESS),
            (TEMPERATURE, t.DIVERGENCE, TRACE_OF_HEAT_FLUX_EXCESS),
        )
    ]
    return (
        *_dispersed("conduction by flight", flight),
        *_dispersed("conduction by collisions", passed),
        *off,
    )


def _dispersed(name: str, dispersion: TensorDispersion) -> tuple[t.Term, ...]:
    """Return the five isotropic operators on R_ij, R_mm being 3 Θ."""

    def term(part: str, operator: t.Operator, source: str, coefficient: Any) -> t.Term:
        return t.Term(f"{name}, {part}", "conduction", "", TENSOR, operator, source, coefficient)

    d = dispersion
    return _with_trace(
        term("own", t.LAPLACIAN, TENSOR, d.laplacian),
        term("crosswise", t.GRADIENT_OF_TENSOR_DIVERGENCE, TENSOR, d.gradient_divergence),
        term("isotropic", t.ISOTROPIC_DOUBLE_DIVERGENCE, TENSOR, d.double_divergence),
        term("by the trace", t.HESSIANS, TEMPERATURE, 1.5 * d.trace_hessian),
        term("isotropic by the trace", t.ISOTROPIC_LAPLACIAN, TEMPERATURE, 3.0 * d.trace_laplacian),
    )


def _cyclic(vector: Float[Array, "d *x"]) -> Float[Array, "d d d *x"]:
    """Return a_i δ_jk + a_j δ_ik + a_k δ_ij."""
    d = range(len(vector))
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
    carried = jnp.stack([jnp.stack([_along(tensor, slopes) for slopes in row]) for row in gradient])
    shift = c.production_shift * temperature
    shifted = _at_all_places(gradient) + _cyclic(divergence + 0.5 * trace_slope)
    production = -_at_all_places(carried) - t.times(shift, shifted)
    own = ft.reduce(lambda a, b: a + b, (row[:, i] for i, row in enumerate(carried)))
    shifted_trace = 3.5 * (2.0 * divergence + trace_slope)
    trace = -2.0 * own - _along(tensor, trace_slope) - t.times(shift, shifted_trace)
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
        third + c.flux_shift * (third + 0.5 * _cyclic(trace)) - t.times(c.transfer, passed),
        trace * (1.0 + 3.5 * c.flux_shift) - t.times(c.transfer, passed_trace),
    )


def _at_all_places(field: Float[Array, "d d d *x"]) -> Float[Array, "d d d *x"]:
    """Return A_ijk + A_jki + A_ikj of an A_ijk that is symmetric in i and j."""
    return field + jnp.moveaxis(field, 2, 0) + jnp.moveaxis(field, 2, 1)


def _isotropic(vector: Float[Array, "d *x"]) -> Float[Array, "d d d *x"]:
    """Return δ_ij a_k."""
    d = range(len(vector))
    return jnp.stack([jnp.stack([vector * (i == j) for j in d]) for i in d])


def _heat_flux_excess(
    tensor: Array, temperature: Array, gradient: Array, slope: Array, local: LocalCoefficients
) -> tuple[Array, Array]:
    """Return by what F_ijk and F_mmk differ from their linear forms around R_ij = δ_ij."""
    here, first = (temperature_coefficients(local, at) for at in (temperature, None))
    flux, trace = _heat_flux(tensor, temperature, gradient, slope, here)
    one = jnp.ones_like(temperature)
    unit = _deviator(jnp.zeros_like(tensor), -one)
    linear, linear_trace = _heat_flux(unit, one, gradient, slope, first)
    return flux - linear, trace - linear_trace


_EXCESS = t.Shared((*_STATE, TENSOR_GRADIENT, TEMPERATURE_GRADIENT), _heat_flux_excess)
HEAT_FLUX_EXCESS = t.Product("F, off the first temperature", (_EXCESS,), lambda f, _: f[0])
TRACE_OF_HEAT_FLUX_EXCESS = t.Product(
    "tr F/3, off the first temperature", (_EXCESS,), lambda f, _: f[1] / 3.0
)
