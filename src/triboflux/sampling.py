"""The closure coefficients by sampling collisions, without evaluating any integral.

Pairs of velocities and directions are drawn as they collide in a Maxwellian gas, charges with
prescribed moments at the two places are put on them, `triboflux.collision.collide` is applied, and
the changes are averaged. That is the shifted collision integral of Enskog's theory,

    C(ψ) = g0 d² ∫ H(g.k)(g.k) [ψ(c1+,ξ1+) − ψ(c1,ξ1)]
                   f(x,c1,ξ1) f(x + d k,c2,ξ2) dk dc1 dc2 dξ1 dξ2,

with a Maxwellian of temperature Θ and ⟨ξ|c⟩ = A + C.c/Θ + c.T.c/(2Θ²), (A2) with (A8)-(A10). Units
are such that d, Θ, n and g0 are one, and so are β and γ where they act.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from triboflux import observables
from triboflux.collision import HERTZ_EXPONENT, Collided, collide
from triboflux.dropped_sampling import CONTACT, dropped_responses
from triboflux.errors import InputError
from triboflux.observables import Array, Observable
from triboflux.responses import Responses, coefficients, isotropic_parts

SMALLEST_SAMPLE = 1000
LARGEST_BATCH = 4096
FEWEST_BATCHES = 32
PAIR_WEIGHT = 4.0 * math.sqrt(math.pi)
"""What a pair from `colliding_pairs` stands for, in units of n² d² g0 √Θ."""


class Estimate(NamedTuple):
    """A sampled number.

    Attributes
    ----------
    value, error : float
        Its estimate and its standard error.
    """

    value: float
    error: float


class Pairs(NamedTuple):
    """Pairs of particles about to collide.

    Attributes
    ----------
    first, second : array
        Velocities scaled by √Θ, shape ``(3, samples)``.
    direction : array
        Unit vectors from the first particle to the second, shape ``(3, samples)``.
    rate : array
        Collision rate of pairs drawn regardless of their approach, 2π|g.k|; shape ``(samples,)``.
        Its mean is J_1.
    """

    first: Array
    second: Array
    direction: Array
    rate: Array


def colliding_pairs(count: int, generator: np.random.Generator) -> Pairs:
    """Draw pairs of a Maxwellian gas as they collide.

    Two velocities and a direction are drawn, independent of each other. Pairs collide in proportion
    to g.k > 0, which has the density of a Gaussian of variance 2; the product of both is Rayleigh's
    distribution. So g.k is drawn anew from that, the rest of the velocities stays, and every pair
    stands for the same number of collisions, `PAIR_WEIGHT`.

    Parameters
    ----------
    count : int
        Number of pairs.
    generator : numpy.random.Generator
        Source of random numbers.

    Returns
    -------
    Pairs
        As many as asked for.
    """
    first, second, direction = generator.standard_normal((3, 3, count))
    direction /= np.linalg.norm(direction, axis=0)
    normal = np.sum((first - second) * direction, axis=0)
    approach = generator.rayleigh(math.sqrt(2.0), count)
    half_shift = 0.5 * (approach - normal) * direction
    rate = 2.0 * math.pi * np.abs(normal)
    return Pairs(first + half_shift, second - half_shift, direction, rate)


class Collisions:
    """Some pairs under one collision rule.

    What depends on place is zero at the first particle and exact at the second, one diameter away:
    C(x) = x, for instance, or V(x) = |x|²/2. Vectors that answer to vectors are averaged over the
    three axes; tensors go through `isotropic_parts`.
    """

    def __init__(self, pairs: Pairs, restitution: float, exponent: float) -> None:
        self.pairs = pairs
        self.restitution = restitution
        self.exponent = exponent
        self.zero = np.zeros_like(pairs.rate)
        self.one = np.ones_like(pairs.rate)
        self.axes = np.eye(3)[:, :, None]

    def after(self, charges: tuple[Any, Any], gamma: float, **field: Any) -> Collided:
        """Return the pairs with these charges after their collision."""
        return collide(
            (self.pairs.first, self.pairs.second),
            charges,
            self.pairs.direction,
            restitution=self.restitution,
            exponent=self.exponent,
            charge_transfer=gamma,
            **field,
        )

    def changes(
        self, observable: Observable, charges: tuple[Any, Any], **field: Any
    ) -> list[Array]:
        """Return by how much ψ of the first particle changes, by powers of γ: 0, 1 and 2.

        No ψ here has more than two charges in it, hence three values of γ tell the powers apart.
        """
        before = observable(self.pairs.first, charges[0])
        below, middle, above = (
            observable(outcome.velocity_1, outcome.charge_1) - before
            for outcome in (self.after(charges, gamma, **field) for gamma in (-1.0, 0.0, 1.0))
        )
        return [middle, 0.5 * (above - below), 0.5 * (above + below) - middle]

    def charge(self) -> dict[str, Array]:
        """Return the answers of C(ξ)."""
        zero, (_, c2, k, _) = self.zero, self.pairs
        divergent = self.after((zero, zero), 0.0, field_transfer=1.0, field=CONTACT * k)
        return {
            "charge_field": divergent.charge_1 / 3.0,
            "charge_laplacian": self.changes(observables.charge, (zero, 0.5 * self.one))[1] / 3.0,
            "charge_covariance": self.changes(observables.charge, (zero, np.sum(k * c2, axis=0)))[1]
            / 3.0,
        }

    def covariance(self) -> dict[str, Array]:
        """Return the answers of C(ξ c_i), and that of C(ξξ) to the field, on each axis in turn."""
        zero, (c1, c2, k, _) = self.zero, self.pairs
        driven = self.after((zero, zero), 0.0, field_transfer=1.0, field=self.axes)
        velocity, exchange, _ = self.changes(observables.covariance, (c1, c2))
        return {
            "covariance_field": observables.covariance(driven.velocity_1, driven.charge_1) / 3.0,
            "covariance_gradient": self.changes(observables.covariance, (np.zeros_like(k), k))[1]
            / 3.0,
            "covariance_velocity": velocity / 3.0,
            "covariance_exchange": exchange / 3.0,
            "variance_field": np.sum(driven.charge_1**2, axis=0) / 3.0,
        }

    def third(self) -> dict[str, Array]:
        """Return the answers of C(ξ c_i c_j) − δ_ij C(ξ)."""
        zero, axes, (c1, c2, k, _) = self.zero, self.axes, self.pairs
        # With T_ij = δ_ij, and with each T that has a single element.
        isotropic = [0.5 * (np.sum(c**2, axis=0) - 3.0) for c in (c1, c2)]
        single = [0.5 * (c[:, None] * c[None] - axes) for c in (c1, c2)]
        traces = self.changes(observables.third_trace, (isotropic[0], isotropic[1]))
        products = self.changes(observables.third_product, (single[0], single[1]))
        (velocity_trace, velocity), (exchange_trace, exchange), _ = map(
            isotropic_parts, traces, products
        )
        # The same for the gradient of C.
        divergence, symmetric = isotropic_parts(
            self.changes(observables.third_trace, (zero, np.sum(k * c2, axis=0)))[1],
            self.changes(observables.third_product, (zero * axes, k[:, None] * c2[None]))[1],
        )
        return {
            "third_velocity": velocity,
            "third_velocity_trace": velocity_trace,
            "third_exchange": exchange,
            "third_exchange_trace": exchange_trace,
            "third_shear": 0.5 * symmetric,
            "third_divergence": divergence,
        }

    def variance(self) -> dict[str, Array]:
        """Return the answers of C(ξξ) and C(ξξ c_i) to variances.

        A variance of one is a charge of 1 or -1. A moment N without any variance is such a charge
        where it is there at all, which it is with the signed probability N.c.
        """
        zero, one, (c1, c2, _, _) = self.zero, self.one, self.pairs
        # The second charge takes both signs, which makes the two independent without any noise.
        signs = np.array([1.0, -1.0])[:, None] * one
        _, exchange, regain = (
            part.mean(axis=0) for part in self.changes(observables.square, (one, signs))
        )

        def flux(moment: Array, charges: tuple[Array, Array]) -> list[Array]:
            return self.changes(lambda v, charge: charge**2 * np.sum(moment * v, axis=0), charges)

        on_either = zip(flux(c1, (one, zero)), flux(c2, (zero, one)), strict=True)
        flux_velocity, flux_exchange, flux_regain = (a + b for a, b in on_either)
        half_square = math.sqrt(0.5) * one
        return {
            "variance_exchange": exchange,
            "variance_regain": regain,
            "variance_laplacian": self.changes(observables.square, (zero, half_square))[2] / 3.0,
            "flux_velocity": flux_velocity / 3.0,
            "flux_exchange": flux_exchange / 3.0,
            "flux_regain": flux_regain / 3.0,
        }


def pair_responses(pairs: Pairs, restitution: float, exponent: float) -> Responses:
    """Return what every single pair contributes to the responses, but for its weight.

    Parameters
    ----------
    pairs : Pairs
        From `colliding_pairs`.
    restitution, exponent : float
        e and a, dimensionless.

    Returns
    -------
    Responses
        Fields of shape ``(samples,)``; their means times `PAIR_WEIGHT` are the responses.
    """
    collisions = Collisions(pairs, restitution, exponent)
    return Responses(
        collision_rate=collisions.one,
        **collisions.charge(),
        **collisions.covariance(),
        **collisions.third(),
        **collisions.variance(),
        **dropped_responses(collisions),
    )


def batches_of(samples: int) -> tuple[int, int]:
    """Return how many batches of which equal size are drawn for at least so many samples.

    Parameters
    ----------
    samples : int
        Wanted number of colliding pairs.

    Returns
    -------
    tuple of int
        Number of batches, and pairs in each.

    Raises
    ------
    InputError
        If the number is below `SMALLEST_SAMPLE`.
    """
    if samples < SMALLEST_SAMPLE:
        raise InputError(
            f"samples: {samples} is not allowed; at least {SMALLEST_SAMPLE} are needed."
        )
    batches = max(FEWEST_BATCHES, math.ceil(samples / LARGEST_BATCH))
    return batches, math.ceil(samples / batches)


def sample_closures(
    settings: Sequence[tuple[float, float]],
    samples: int,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
) -> dict[tuple[float, float], dict[str, Estimate]]:
    """Estimate the closure coefficients for several collision rules from the same pairs.

    Parameters
    ----------
    settings : sequence of (float, float)
        Restitution e, from 0 to 1, and exponent a, above -1/2, of each rule.
    samples : int
        Number of colliding pairs, at least `SMALLEST_SAMPLE`; see `batches_of`.
    seed : int
        Of the random numbers.
    progress : callable, optional
        Called with the part that is done, from 0 to 1.

    Returns
    -------
    dict of (float, float) to dict of str to Estimate
        By setting, then by the names of `triboflux.responses.coefficients`.

    Raises
    ------
    InputError
        If a number is outside its range.

    Notes
    -----
    Errors are the jackknife's over batches, because a coefficient is a ratio of averages whose
    numerator and denominator come from the same pairs. Two coefficients that every single pair
    gives in a fixed ratio have an error of round-off in that ratio.
    """
    for restitution, exponent in settings:
        _check(restitution, exponent)
    batches, size = batches_of(samples)
    generator = np.random.default_rng(seed)
    means = np.empty((len(settings), len(Responses._fields), batches))
    rates = np.empty(batches)
    for batch in range(batches):
        pairs = colliding_pairs(size, generator)
        rates[batch] = pairs.rate.mean()
        for row, (restitution, exponent) in zip(means, settings, strict=True):
            row[:, batch] = [np.mean(part) for part in pair_responses(pairs, restitution, exponent)]
        if progress is not None:
            progress((batch + 1) / batches)
    rate = Estimate(float(rates.mean()), float(rates.std(ddof=1)) / math.sqrt(batches))
    return {
        setting: _jackknife(PAIR_WEIGHT * row, setting[0]) | {"collision_rate": rate}
        for setting, row in zip(settings, means, strict=True)
    }


def sample(
    restitution: float, exponent: float = HERTZ_EXPONENT, samples: int = 100_000, seed: int = 0
) -> dict[str, Estimate]:
    """Estimate the closure coefficients for one collision rule.

    Parameters
    ----------
    restitution, exponent : float
        e and a, dimensionless.
    samples, seed : int
        As in `sample_closures`.

    Returns
    -------
    dict of str to Estimate
        By the names of `triboflux.responses.coefficients`.

    Raises
    ------
    InputError
        If a number is outside its range.
    """
    return sample_closures([(restitution, exponent)], samples, seed)[restitution, exponent]


def _jackknife(means: Array, restitution: float) -> dict[str, Estimate]:
    """Return coefficients with errors from the responses of all batches, (responses, batches)."""
    batches = means.shape[1]
    average = means.mean(axis=1)
    without_one = (batches * average[:, None] - means) / (batches - 1)
    values: dict[str, float] = coefficients(Responses(*average), restitution)
    others: dict[str, Array] = coefficients(Responses(*without_one), restitution)
    return {
        name: Estimate(float(value), math.sqrt((batches - 1) * float(np.var(others[name]))))
        for name, value in values.items()
    }


def _check(restitution: float, exponent: float) -> None:
    if not 0.0 <= restitution <= 1.0:
        raise InputError(f"restitution: {restitution} is not allowed; it must be between 0 and 1.")
    if not (math.isfinite(exponent) and exponent > -0.5):
        raise InputError(
            f"exponent: {exponent} is not allowed; it must be a finite number above -0.5."
        )
