"""A model: a named list of terms over the moments that it evolves."""

from __future__ import annotations

import equinox as eqx

from triboflux.calculus import Discretisation
from triboflux.models.coefficients import TransportCoefficients
from triboflux.models.terms import Product, Term, evaluate
from triboflux.moments import Moments


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
    """

    name: str = eqx.field(static=True)
    evolves: tuple[str, ...] = eqx.field(static=True)
    terms: tuple[Term, ...]
    coefficients: TransportCoefficients

    def linear_terms(self) -> tuple[Term, ...]:
        """Return the terms that are linear in the moments."""
        return tuple(term for term in self.terms if term.linear)

    def sweeps(self) -> tuple[tuple[Term, ...], ...]:
        """Return the pointwise terms in the order in which a stage of the integrator takes them.

        Where collisions are frequent, the covariance is slaved to the charge and the variance, so
        the products that read it come last, after it has been brought up to date.
        """
        first: list[Term] = []
        last: list[Term] = []
        for term in self.terms:
            if isinstance(term.source, Product):
                (last if "covariance" in term.source.reads else first).append(term)
        return tuple(tuple(group) for group in (first, last) if group)

    def right_hand_side(self, discretisation: Discretisation, state: Moments) -> Moments:
        """Return the time derivative of the state, in the representation of the discretisation."""
        return evaluate(self.terms, discretisation, state)
