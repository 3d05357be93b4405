"""Mean velocity U and volume per particle of the self-consistent model, in one dimension.

What stands in the paper's equations for a frame in which particles are at rest on average holds
along with them. In the coordinate m that moves with U, dm = n dx, see `triboflux.models.varying`,

    ∂(1/n)/∂t = ∂U/∂m,
    ∂U/∂t = −∂(nR_xx + p)/∂m + ∂(n³ ν √Θ ∂U/∂m)/∂m + u Q E − U/τ_p,

p = n² (1+e)/60 √π d/(√Θ τ_c) (2 R_xx + R_mm) being the pressure of collisions over a diameter,
which is (1+e)/12 √π d/(√Θ τ_c) = 2 (1+e) α g0 times n² Θ where R = Θδ, and ν = (1+e)/10 d²/τ_c
their viscosity. With the strain g = n ∂U/∂m,

    ∂C/∂t ∋ −g C,   ∂T_xx/∂t ∋ −2 g T_xx,   ∂R_xx/∂t ∋ −2 g R_xx + what collisions add,

with the same for the traces T_mm and R_mm. Collisions over a diameter meet particles whose mean
velocity differs by d g k_x. For Gaussian velocities with R_ij, R_tt = (R_mm − R_xx)/2, they add

    w_xx = n g √π d/(√Θ τ_c) [(1+e) R_xx/5 − ¾ (1+e)² (R_xx/7 + 2 R_tt/35)]
           + (1+e)(1+3e)/28 n √Θ d²/τ_c g²,
    w_mm = n g √π d/(√Θ τ_c) (1+e)(1−3e)/60 (3 R_xx + 2 R_tt) + (1+e)(1+3e)/20 n √Θ d²/τ_c g²

to R_xx and R_mm. For e = 1 that is the work of pressure and viscosity, else w_lost is lost;
`benchmarks.flow_algebra` derives it. Number densities change how often particles collide, the
radial distribution being held.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from jaxtyping import Array, Float

from triboflux.hierarchy import VELOCITY, VOLUME
from triboflux.models import operators as o
from triboflux.models import terms as t
from triboflux.models.conduction import density_number
from triboflux.models.third_order import with_traces
from triboflux.models.varying import (
    OFF,
    TEMPERATURE,
    LocalCoefficients,
    centred,
    density_of,
    speed,
)
from triboflux.realizability import TENSOR
from triboflux.velocity_closures import flow_closures

LEAST_VOLUME = 1e-3
"""Specific volume at which a run is stopped, in parts of its mean."""
STRAIN = t.Applied(o.GRADIENT_OF_VECTOR, VELOCITY)


def _as_tensor(scalar: Float[Array, " x"]) -> Float[Array, "1 1 x"]:
    return scalar[None, None]


# ------------------------------------------------------------------ momentum


def _stress_excess(
    tensor: Array, temperature: Array, volume: Array, gradient: Array, local: LocalCoefficients
) -> Float[Array, "1 1 x"]:
    """Return by what the flux of momentum differs from its linear form around Θ = n = 1."""
    n, along, pressure = density_of(volume), tensor[0, 0], _pressure(local)
    viscosity = _viscosity(local)
    kinetic = n * along - along - (1.0 - volume)
    collisional = n**2 * (2.0 * along + 3.0 * temperature)
    linear = 2.0 * along + 3.0 * temperature + 10.0 * (1.0 - volume)
    viscous = viscosity * (n**3 * speed(temperature) - 1.0) * gradient[0, 0]
    return _as_tensor(kinetic + pressure * (collisional - linear) - viscous)


def _force(charge: Array, field: Array, volume: Array) -> Float[Array, "1 x"]:
    return t.times(charge, centred(field, volume))


STRESS_EXCESS = t.Product(f"n R_xx{OFF}", (TENSOR, TEMPERATURE, VOLUME, STRAIN), _stress_excess)
FORCE = t.Product("Q E", ("charge", t.FIELD, VOLUME), _force)


def _pressure(local: LocalCoefficients) -> Any:
    """Return what stands in front of 2 R_xx + R_mm in the pressure of collisions."""
    return flow_closures(local.numbers.restitution).pressure * density_number(local)


def _viscosity(local: LocalCoefficients) -> Any:
    return flow_closures(local.numbers.restitution).viscosity * _exchange(local)


def _exchange(local: LocalCoefficients) -> Any:
    """Return d²/τ_c, scaled by L √Θ."""
    return 1.0 / (local.numbers.tau_c * local.numbers.length_ratio**2)


def _momentum(local: LocalCoefficients) -> tuple[t.Term, ...]:
    term, volume = t.maker(VELOCITY), t.maker(VOLUME)
    pressure = _pressure(local)
    along = -1.0 - 2.0 * pressure
    excess = term(f"stress{OFF}", "stress", o.DIVERGENCE_OF_TENSOR, STRESS_EXCESS, -1.0)
    return (
        volume("expansion", "expansion", o.DIVERGENCE, VELOCITY, 1.0),
        term("stress by velocities", "stress", o.DIVERGENCE_OF_TENSOR, TENSOR, along),
        term("stress by the temperature", "stress", o.GRADIENT, TEMPERATURE, -3.0 * pressure),
        term("stress by the density", "stress", o.GRADIENT, VOLUME, 1.0 + 10.0 * pressure),
        term("viscous stress", "stress", o.LAPLACIAN, VELOCITY, _viscosity(local)),
        replace(excess, parameters=(local,)),
        term("electric force", "electric force", o.IDENTITY, FORCE, local.numbers.energy_ratio),
        term("drag", "drag", o.IDENTITY, VELOCITY, -1.0 / local.numbers.tau_p),
    )


# ------------------------------------------------------------------ what a strain does


def _strain(volume: Array, gradient: Array) -> Float[Array, " x"]:
    return density_of(volume) * gradient[0, 0]


def _strained(field: Array, volume: Array, gradient: Array) -> Array:
    return t.times(_strain(volume, gradient), field)


def _trace_strained(tensor: Array, volume: Array, gradient: Array) -> Float[Array, " x"]:
    return _strain(volume, gradient) * tensor[0, 0]


def _pulled(*read: Array) -> Float[Array, "1 1 x"]:
    return _as_tensor(_pulled_excess(*read))


def _pulled_excess(tensor: Array, volume: Array, gradient: Array) -> Float[Array, " x"]:
    """Return by what 2 g R_xx differs from 2 ∂U/∂m."""
    return 2.0 * (density_of(volume) * tensor[0, 0] - 1.0) * gradient[0, 0]


def _collided(
    tensor: Array, temperature: Array, volume: Array, gradient: Array, local: LocalCoefficients
) -> tuple[Array, Array, Array]:
    """Return what collisions add to R_xx and R_mm, and to the energy that is lost."""
    c = flow_closures(local.numbers.restitution)
    n, g, along = density_of(volume), _strain(volume, gradient), tensor[0, 0]
    across = 1.5 * temperature - 0.5 * along
    first = density_number(local) * n * g
    second = _exchange(local) * n * speed(temperature) * g**2
    both = 3.0 * along + 2.0 * across
    return (
        first * (c.work_along * along + c.work_across * across) + c.heating_along * second,
        c.work * first * both + c.heating * second,
        c.lost_work * first * both + c.lost_heating * second,
    )


_COLLIDED = t.Shared((TENSOR, TEMPERATURE, VOLUME, STRAIN), _collided)


def _tensor_of(found: tuple[Array, ...], _: LocalCoefficients) -> Float[Array, "1 1 x"]:
    return _as_tensor(found[0])


def _trace_of(found: tuple[Array, ...], _: LocalCoefficients) -> Float[Array, " x"]:
    return found[1]


def _lost_of(found: tuple[Array, ...], _: LocalCoefficients) -> Float[Array, " x"]:
    return found[2]


STRAINED = {
    name: t.Product(f"g {letter}", (name, VOLUME, STRAIN), _strained)
    for name, letter in (("covariance", "C"), ("covariance_flux", "T"))
}
PULLED = t.Product(f"2 g R{OFF}", (TENSOR, VOLUME, STRAIN), _pulled)
COLLIDED = t.Product("w_{xx}", (_COLLIDED,), _tensor_of)
TRACES = {
    STRAINED["covariance_flux"]: t.Product(
        "g T_{xx}", ("covariance_flux", VOLUME, STRAIN), _trace_strained
    ),
    PULLED: t.Product(f"2 g R_xx{OFF}", PULLED.reads, _pulled_excess),
    COLLIDED: t.Product("w_{mm}", (_COLLIDED,), _trace_of),
}
LOST = t.Product("w_{lost}", (_COLLIDED,), _lost_of)
DRAGGED = t.Product("U²", (VELOCITY,), lambda velocity: t.dot(velocity, velocity))


def _strains(local: LocalCoefficients) -> tuple[t.Term, ...]:
    covariance, tensor = t.maker("covariance"), t.maker("covariance_flux")
    velocities, lost = t.maker(TENSOR), t.maker("dissipated_energy")
    strain = "strain"
    first, second = STRAINED.values()
    by_collisions = velocities("work of collisions", strain, o.IDENTITY, COLLIDED, 1.0)
    by_lost = lost("work of collisions", "inelastic cooling", o.IDENTITY, LOST, 1.0)
    return (
        covariance(strain, strain, o.IDENTITY, first, -1.0),
        *with_traces(
            tensor(strain, strain, o.IDENTITY, second, -2.0),
            velocities(strain, strain, o.SYMMETRIC_GRADIENT, VELOCITY, -1.0),
            velocities(f"{strain}{OFF}", strain, o.IDENTITY, PULLED, -1.0),
            replace(by_collisions, parameters=(local,)),
            products=TRACES,
        ),
        replace(by_lost, parameters=(local,)),
        lost("drag on the mean", "drag", o.IDENTITY, DRAGGED, 1.0 / local.numbers.tau_p),
    )


def _above_the_least(volume: Array) -> Float[Array, " x"]:
    return volume - LEAST_VOLUME


LIMIT = t.Term(
    f"the specific volume less {LEAST_VOLUME:g} of its mean",
    "limit",
    "",
    VOLUME,
    o.IDENTITY,
    t.Product("1/n", (VOLUME,), _above_the_least),
    1.0,
)
"""Has to stay positive; particles closer together are not those of a dilute suspension."""


def flow_terms(local: LocalCoefficients) -> tuple[t.Term, ...]:
    """Return the equations of U and 1/n, and what a strain does to the other moments.

    Parameters
    ----------
    local : LocalCoefficients
        Of the case.
    """
    return (*_momentum(local), *_strains(local))
