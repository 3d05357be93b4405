"""A model: a named list of terms over the moments that it evolves."""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from triboflux.calculus import Discretisation
from triboflux.models.coefficients import TransportCoefficients
from triboflux.models.terms import Product, Term, evaluate, values_of
from triboflux.moments import Moments

ROUND_OFF = 1e-9
"""By how much of its largest value a limit may fall below zero."""


class Model(eqx.Module):
    """A moment model as a list of terms.

    Attributes
    ----------
    name : str
        As in the registry.
    evolves : tuple of str
        The moments that have an equation of their own.
    terms : tuple of Term
        Their sum is the right-hand side.
    coefficients : TransportCoefficients
        What the terms were made from.
    closures : tuple of Term
        Their sums are the moments that have no equation but an algebraic expression.
    limits : tuple of Term
        Pointwise quantities that have to be positive for the algebraic expressions to make sense.
    """

    name: str = eqx.field(static=True)
    evolves: tuple[str, ...] = eqx.field(static=True)
    terms: tuple[Term, ...]
    coefficients: TransportCoefficients
    closures: tuple[Term, ...] = ()
    limits: tuple[Term, ...] = ()

    def fields(self, discretisation: Discretisation, state: Moments) -> Moments:
        """Return the moments on the points, those included that follow algebraically.

        Products are evaluated on the points and not filtered, so that a variance that is singular
        somewhere is right elsewhere.

        Parameters
        ----------
        discretisation : Discretisation
            Where the state lives.
        state : Moments
            The moments that the model evolves.

        Returns
        -------
        Moments
            ``None`` for a moment that the model does not know.
        """
        evolved = {name: discretisation.values(getattr(state, name)) for name in self.evolves}
        return Moments(**evolved) + values_of(self.closures, discretisation, state)

    def margin(self, discretisation: Discretisation, state: Moments) -> Array:
        """Return how far the limits are from being broken, negative where one is.

        Parameters
        ----------
        discretisation : Discretisation
            Where the state lives.
        state : Moments
            The moments that the model evolves.

        Returns
        -------
        Array
            The smallest value of any limit over the points, each limit scaled by its largest;
            round-off counts as nothing broken.
        """
        margins: list[Array] = []
        for limit in self.limits:
            values = getattr(values_of((limit,), discretisation, state), limit.moment)
            scale = jnp.maximum(jnp.max(jnp.abs(values)), 1e-300)
            margins.append(jnp.min(values) / scale + ROUND_OFF)
        return jnp.min(jnp.stack(margins))

    def linear_terms(self) -> tuple[Term, ...]:
        """Return the terms that are linear in the moments."""
        return tuple(term for term in self.terms if term.linear)

    def sweeps(self) -> tuple[tuple[Term, ...], ...]:
        """Return the pointwise terms in the order in which a stage of the integrator takes them.

        Where collisions are frequent, the covariance is slaved to the charge and the variance, so
        the products that read it come last, after it has been brought up to date. In a model
        without it the same holds for the variance, which is slaved where it decays fast.
        """
        slaved = "covariance" if "covariance" in self.evolves else "variance"
        first: list[Term] = []
        last: list[Term] = []
        for term in self.terms:
            if isinstance(term.source, Product):
                (last if term.source.reads_moment(slaved) else first).append(term)
        return tuple(tuple(group) for group in (first, last) if group)

    def right_hand_side(self, discretisation: Discretisation, state: Moments) -> Moments:
        """Return the time derivative of the state, in the representation of the discretisation."""
        return evaluate(self.terms, discretisation, state)
