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

import jax.numpy as jnp
from jaxtyping import Array, Float

from triboflux.hierarchy import MODELS
from triboflux.models import operators as o
from triboflux.models import terms as t
from triboflux.models.coefficients import TransportCoefficients
from triboflux.models.conduction import (
    STATE,
    TEMPERATURE_GRADIENT,
    TENSOR,
    TENSOR_GRADIENT,
    along,
    conduction_terms,
    deviator,
    temperature_coefficients,
)
from triboflux.models.flow import LIMIT, flow_terms
from triboflux.models.model import Model
from triboflux.models.products import symmetric
from triboflux.models.third_order import carried_charge_terms, third_order, with_traces
from triboflux.models.varying import TEMPERATURE, LocalCoefficients, Place, varying

COVARIANCE_GRADIENT = t.Applied(o.GRADIENT_OF_VECTOR, "covariance")


_WORKS = {
    o.DIVERGENCE: "E·C",
    o.FIELD_DIVERGENCE: "E·E",
    o.LAPLACIAN: "E·∇Q",
    o.DIVERGENCES[o.DIVERGENCE_OF_TENSOR]: "E·(∇·T)",
    o.DIVERGENCES[o.GRADIENT]: "E·∇tr T",
}
"""What the field's work is on the flux of charge whose divergence an operator makes."""


# ------------------------------------------------------------------ pointwise products


def _deviator_along(tensor: Array, temperature: Array, vector: Array) -> Array:
    return along(deviator(tensor, temperature), vector)


def _stretching(tensor: Array, temperature: Array, gradient: Float[Array, "d d *x"]) -> Array:
    """Return R'_ik ∂_k C_j + R'_jk ∂_k C_i, of ∂_j C_i at row i, column j."""
    product = jnp.stack([along(deviator(tensor, temperature), row) for row in gradient])
    return product + product.swapaxes(0, 1)


def _advection(covariance: Array, gradient: Float[Array, "d d d *x"]) -> Float[Array, "d d *x"]:
    """Return C_k ∂_k R_ij."""
    return jnp.stack([along(row, covariance) for row in gradient])


def _flux_by_field(tensor: Array, temperature: Array, gradient: Array, field: Array) -> Array:
    return symmetric(_deviator_along(tensor, temperature, gradient), field)


def _flux_along_field(tensor: Array, temperature: Array, gradient: Array, field: Array) -> Array:
    return 2.0 * t.dot(_deviator_along(tensor, temperature, gradient), field)


DEVIATOR_ALONG_GRADIENT = t.Product("R'·∇Q", (*STATE, t.CHARGE_GRADIENT), _deviator_along)
DEVIATOR_ALONG_VARIANCE = t.Product("R'·∇V", (*STATE, t.VARIANCE_GRADIENT), _deviator_along)
STRETCHING = t.Product("R'·∇C + (R'·∇C)ᵀ", (*STATE, COVARIANCE_GRADIENT), _stretching)
ADVECTION = t.Product("C·∇R", ("covariance", TENSOR_GRADIENT), _advection)
FLUX_BY_FIELD = t.Product(
    "R'·∇V E + E R'·∇V", (*STATE, t.VARIANCE_GRADIENT, t.FIELD), _flux_by_field
)
COVARIANCE_BY_FIELD = t.Product("C E + E C", ("covariance", t.FIELD), symmetric)
TRACES = {
    STRETCHING: t.Product(
        "2 R':∇C",
        STRETCHING.reads,
        lambda r, theta, g: sum(
            (2.0 * t.dot(a, b) for a, b in zip(deviator(r, theta), g, strict=True)),
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


def _third_order(local: LocalCoefficients, place: Place | None) -> tuple[t.Term, ...]:
    """Return the equations of the third-order model, which take R_ij for Θ δ_ij."""
    return third_order(local.at(place)).terms


def _anisotropic(local: LocalCoefficients, place: Place | None) -> tuple[t.Term, ...]:
    """Return what R_ij − Θ δ_ij and gradients of R_ij add to these."""
    c = local.at(place)
    destruction = c.variance_flux_destruction
    covariance, variance = t.maker("covariance"), t.maker("variance")
    tensor = t.maker("covariance_flux")
    return (
        covariance(
            "production by charge gradient, anisotropic",
            "production",
            o.IDENTITY,
            DEVIATOR_ALONG_GRADIENT,
            -1.0,
        ),
        variance(
            "kinetic dispersion, anisotropic",
            "kinetic dispersion",
            o.DIVERGENCE,
            DEVIATOR_ALONG_VARIANCE,
            1.0 / destruction,
        ),
        *with_traces(
            tensor(
                "production by covariance gradient, anisotropic",
                "production",
                o.IDENTITY,
                STRETCHING,
                -1.0,
            ),
            tensor(
                "production by gradient of the granular temperature",
                "production",
                o.IDENTITY,
                ADVECTION,
                -1.0,
            ),
            *_anisotropic_force(c),
            products=TRACES,
        ),
    )


def _anisotropic_force(c: TransportCoefficients) -> tuple[t.Term, ...]:
    """Return what R_ij − Θ δ_ij adds to the electric force on T_ij, which the paper drops."""
    if c.dropped is None:
        return ()
    factor = -c.electric_force / c.variance_flux_destruction
    term = t.maker("covariance_flux", "dropped")
    return (
        term("electric force, anisotropic", "electric force", o.IDENTITY, FLUX_BY_FIELD, factor),
    )


def _temperature(local: LocalCoefficients, place: Place | None) -> tuple[t.Term, ...]:
    """Return the equations of R_ij and Θ but for conduction by flight."""
    c, term = temperature_coefficients(local, place), t.maker(TENSOR)
    return with_traces(
        term("heating by the field", "heating", o.IDENTITY, COVARIANCE_BY_FIELD, c.electric_force),
        term("return to isotropy", "return to isotropy", o.IDENTITY, TENSOR, -c.isotropy),
        term("isotropic part", "return to isotropy", o.ISOTROPIC, TEMPERATURE, c.isotropy),
        term("cooling", "inelastic cooling", o.ISOTROPIC, TEMPERATURE, -c.cooling),
        term("drag", "drag", o.IDENTITY, TENSOR, -2.0 * c.drag),
        products=TRACES,
    )


def _energy(local: LocalCoefficients, place: Place | None) -> tuple[t.Term, ...]:
    """Return the equation of the energy that is lost.

    Charge that moves along the field takes energy from it; what the velocities do not get of it is
    lost, as what collisions and drag take from them.
    """
    c = local.at(place)
    own, term = temperature_coefficients(local, place), t.maker("dissipated_energy")
    by_field = "work of the field"
    works: list[t.Term] = []
    for moved in carried_charge_terms(c):
        source = str(moved.source)
        _, inner = o.FLUXES[moved.operator]
        read = source if inner is o.IDENTITY else t.Applied(inner, source)
        work = t.Product(_WORKS[moved.operator], (read, t.FIELD), t.dot)
        factor = -c.electric_force * moved.coefficient
        works.append(term(f"{by_field} by {moved.name}", by_field, o.IDENTITY, work, factor))
    heat = TRACES[COVARIANCE_BY_FIELD]
    return (
        *works,
        term("heating of the particles", by_field, o.IDENTITY, heat, -0.5 * c.electric_force),
        term("cooling", "inelastic cooling", o.IDENTITY, TEMPERATURE, 1.5 * own.cooling),
        term("drag", "drag", o.IDENTITY, TEMPERATURE, 3.0 * own.drag),
    )


def self_consistent(local: LocalCoefficients) -> Model:
    """Return the self-consistent model: the third-order one with equations for R_ij and Θ.

    Parameters
    ----------
    local : LocalCoefficients
        Of the case.
    """
    return Model(
        "self-consistent", MODELS["self-consistent"].evolves, _terms(local), local.at(None)
    )


def self_consistent_flow(local: LocalCoefficients) -> Model:
    """Return the self-consistent model with a mean velocity and a number density of its own.

    Parameters
    ----------
    local : LocalCoefficients
        Of the case, which has one dimension.
    """
    name = "self-consistent-flow"
    terms = (*_terms(local, moving=True), *flow_terms(local))
    return Model(name, MODELS[name].evolves, terms, local.at(None), limits=(LIMIT,))


def _terms(local: LocalCoefficients, *, moving: bool = False) -> tuple[t.Term, ...]:
    """Return the terms of both models, for a mean velocity of zero or along with it."""
    builders = (_third_order, _anisotropic, _temperature, _energy)
    varied = [term for builder in builders for term in varying(builder, local, moving=moving)]
    return (*varied, *conduction_terms(local, moving=moving))
