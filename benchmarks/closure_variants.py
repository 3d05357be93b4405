"""The closure sets between the exact and the printed one, and the paper's cases run with them.

An `Entry` is one contradiction between the two sets, a `Variant` any other combination; both carry
the number of their entry in docs/closures.md. `stop_time` runs a case with a set although that may
be outside its range of validity.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from examples.full_model_by_hand import PAPER_CASES
from triboflux import closures, models
from triboflux.closures import ClosureSet
from triboflux.errors import OutOfRangeError
from triboflux.grid import Grid
from triboflux.integrate import Settings, integrate
from triboflux.models import TransportCoefficients
from triboflux.moments import Moments
from triboflux.numbers import Numbers

POINTS, LATEST, PEAK, RTOL = 64, 1000.0, 0.5, 1e-9

_integrate = eqx.filter_jit(integrate)


@dataclass(frozen=True)
class TracedSet(ClosureSet):
    """A closure set whose trace runs over a given number of directions."""

    directions: int = 3

    def trace_dimensions(self, grid_dimensions: int) -> int:
        """Return the number of directions, whatever the grid."""
        return self.directions


@dataclass(frozen=True)
class Entry:
    """A contradiction that lies in the value of coefficients.

    Attributes
    ----------
    number : str
        In docs/closures.md.
    label : str
        What differs.
    names : tuple of str
        The coefficients in question.
    trace : bool
        Whether the directions of the trace differ, too.
    factor : Callable
        By which the coefficients are multiplied where they are printed, for given numbers.
    """

    number: str
    label: str
    names: tuple[str, ...] = ()
    trace: bool = False
    factor: Callable[[Numbers], float] | None = None


def _inverted_ratio(numbers: Numbers) -> float:
    return numbers.length_ratio**2


DISPERSIONS = ("third_moment_shear", "third_moment_divergence")
THIRD_MOMENT = ("third_moment_collision", "third_moment_exchange", "third_moment_trace")
ENTRIES = (
    Entry("1", "λ' (5.20)", ("exchange_time",)),
    Entry("2", "L/d for d/L in (5.3)", DISPERSIONS, factor=_inverted_ratio),
    Entry("3", "λ1.3 through λ'' (5.21)", ("collisional_flux_number",)),
    Entry("4", "λ2.1 (3.4)", ("covariance_production_field",)),
    Entry("4", "λ2.2 (3.4)", ("covariance_production_gradient",)),
    Entry("5", "(3−e)/5 (3.4)", ("covariance_exchange",)),
    Entry("6", "λ2.4, λ2.5 (3.8)", ("third_moment_collision",)),
    Entry("7", "λ2.6 (3.8)", ("third_moment_exchange",)),
    Entry("8", "λ2.7, λ2.8 (3.9)", ("third_moment_trace",)),
    Entry("9", "λ2.9, λ2.11 as ρ1 (3.10)", ("third_moment_shear",)),
    Entry("10", "λ2.10, λ2.11 as ρ2 (3.10)", ("third_moment_divergence",)),
    Entry("11", "λ3.1 (4.2)", ("variance_regain",)),
    Entry("12", "λ3.3 (4.2)", ("variance_dispersion",)),
    Entry("13", "λ3.4 (4.3)", ("variance_flux_exchange",)),
    Entry("14", "λ3.5 as 20.39 (5.4)", ("variance_flux_product",)),
    Entry("15", "1/τ_p for 2/τ_p (3.8)", ("third_moment_drag",)),
    Entry("19", "trace of one direction (5.3)", trace=True),
)
"""Entries of the page whose effect is that of another value in the equations (5.2)-(5.4)."""
TOGETHER = (
    Entry("6–8, 19", "K1, K2 and trace together", THIRD_MOMENT, trace=True),
    Entry(
        "3–19",
        "all of these but 1 and 2",
        tuple(name for entry in ENTRIES[2:] for name in entry.names),
        trace=True,
    ),
)


class Ran(NamedTuple):
    """A run to t*, or why there is none.

    Attributes
    ----------
    time : float or None
        t*, scaled by L/√Θ.
    remark : str
        What is out of range, as a clause; empty where nothing.
    """

    time: float | None
    remark: str


def exact_set() -> ClosureSet:
    """Return the exact set for the restitution and the exponent of the paper's cases."""
    return closures.derived(1.0)


def printed_set() -> ClosureSet:
    """Return the published set for the restitution of the paper's cases."""
    return closures.published(1.0)


def with_values(
    base: ClosureSet, values: Mapping[str, float], directions: int | None = None
) -> ClosureSet:
    """Return a closure set with other values.

    Parameters
    ----------
    base : ClosureSet
        What it is made from.
    values : mapping of str to float
        By the names of the coefficients.
    directions : int, optional
        Of the trace, those of `base` in one dimension by default.

    Returns
    -------
    ClosureSet
        With the formulas of `base`, which no run reads.
    """
    changed = {
        name: dataclasses.replace(base.coefficients[name], value=value)
        for name, value in values.items()
    }
    count = base.trace_dimensions(1) if directions is None else directions
    coefficients = {**base.coefficients, **changed}
    return TracedSet(base.name, base.restitution, base.exponent, coefficients, count)


def corrected(entry: Entry) -> ClosureSet:
    """Return `published` where only this entry has its exact value."""
    printed, exact = printed_set(), exact_set()
    if entry.factor is not None:  # the published set has made this repair
        return printed
    values = {name: exact[name] for name in entry.names}
    return with_values(printed, values, exact.trace_dimensions(1) if entry.trace else None)


def as_printed(entry: Entry, numbers: Numbers) -> ClosureSet:
    """Return `derived` where only this entry is as printed."""
    printed, exact = printed_set(), exact_set()
    values = {name: printed[name] for name in entry.names}
    if entry.factor is not None:
        values = {name: exact[name] * entry.factor(numbers) for name in entry.names}
    return with_values(exact, values, printed.trace_dimensions(1) if entry.trace else None)


def numbers_of(case: str, **changes: float) -> Numbers:
    """Return the seven numbers of the paper's case ``"A"`` or ``"B"``, with changes."""
    return Numbers(**{**PAPER_CASES[case], **changes})


def stop_time(numbers: Numbers, closure_set: ClosureSet) -> Ran:
    """Integrate the full model to t* although the closures may be out of their range.

    Parameters
    ----------
    numbers : Numbers
        Of the case.
    closure_set : ClosureSet
        Any.

    Returns
    -------
    Ran
        Without a time where a dispersion is negative, which no time integration survives.
    """
    model = models.build("full", numbers, closure_set)
    out_of_range = _out_of_range(model.coefficients, closure_set)
    ill_posed = _ill_posed(model.coefficients)
    if ill_posed:
        return Ran(None, ": ".join(filter(None, (out_of_range, ill_posed))))
    grid = Grid((POINTS,), (1.0,))
    (x,) = grid.coordinates()
    zero = jnp.zeros(POINTS)
    state = Moments(jnp.asarray(-np.sin(2.0 * np.pi * x)), zero[None], zero)
    settings = Settings(LATEST, RTOL, 1e-3 * RTOL, stop_at_peak_charge=PEAK)
    # as arrays, so that all variants share one compiled program
    traced: Any = jax.tree.map(jnp.asarray, (model, settings))
    outcome = _integrate(traced[0], state, grid, traced[1])
    if not bool(outcome.stopped["peak_charge"]):
        return Ran(None, f"not reached at t = {float(outcome.time):.4g}")
    return Ran(float(outcome.time), out_of_range)


def _ill_posed(coefficients: TransportCoefficients) -> str:
    """Say which dispersion is negative, so that short waves grow the faster the shorter."""
    c = coefficients
    dispersions = {
        "C": float(c.longitudinal_dispersion),
        "V": float(c.variance_collisional_dispersion + 1.0 / c.variance_flux_destruction),
    }
    negative = (f"{value:.2g} of {moment}" for moment, value in dispersions.items() if value <= 0.0)
    told = " and ".join(negative)
    return f"ill-posed, with a dispersion of {told}" if told else ""


def _out_of_range(coefficients: TransportCoefficients, closure_set: ClosureSet) -> str:
    """Say what `triboflux.solve` would refuse or warn of."""
    try:
        models.validity(coefficients, closure_set, allow_out_of_range=True)
    except OutOfRangeError as error:
        return str(error).removeprefix("numbers: ").partition(";")[0]
    destruction = float(coefficients.variance_destruction)
    return f"V grows, F = {destruction:.2g}" if destruction < 0.0 else ""


@dataclass(frozen=True)
class Variant:
    """A combination that is not one entry in one of the two sets.

    Attributes
    ----------
    number : str
        Of its entry in docs/closures.md.
    label : str
        What it is.
    base : {"published", "derived"}
        The set that it changes.
    values : Callable
        From the base and the numbers to the values that are changed.
    directions : int, optional
        Of the trace.
    """

    number: str
    label: str
    base: str
    values: Callable[[ClosureSet, Numbers], Mapping[str, float]] = field(
        default=lambda base, numbers: {}
    )
    directions: int | None = None

    def run(self, numbers: Numbers) -> Ran:
        """Return the outcome for some numbers."""
        base = closures.by_name(self.base, numbers.restitution)
        return stop_time(numbers, with_values(base, self.values(base, numbers), self.directions))


def _printed_ratio(base: ClosureSet, numbers: Numbers) -> dict[str, float]:
    return {name: base[name] * _inverted_ratio(numbers) for name in DISPERSIONS}


def _without_one_half(base: ClosureSet, numbers: Numbers) -> dict[str, float]:
    """Return twice the rates of T_ij: at e = 1 they are proportional to the tensor in ⟨ξ|c⟩."""
    return {name: 2.0 * base[name] for name in THIRD_MOMENT}


def _sign_of_a15(base: ClosureSet, numbers: Numbers) -> dict[str, float]:
    """Return the ρ1 that turns G1 = 1 + (d/L) ρ1/τ_ξ into −1 + (d/L) ρ1/τ_ξ."""
    exchange_time = base["exchange_time"] * numbers.peclet / numbers.length_ratio**2
    shift = 2.0 * exchange_time * numbers.length_ratio
    return {"third_moment_shear": base["third_moment_shear"] - shift}


def _sign_of_b3(base: ClosureSet, numbers: Numbers) -> dict[str, float]:
    """Return the λ3.4 that changes the sign of the whole bracket."""
    bracket = models.build("full", numbers, base).coefficients.variance_flux_destruction
    exchange_time = base["exchange_time"] * numbers.peclet / numbers.length_ratio**2
    value = base["variance_flux_exchange"] - 2.0 * float(bracket) * exchange_time
    return {"variance_flux_exchange": value}


def _printed_product(base: ClosureSet, numbers: Numbers) -> dict[str, float]:
    product = base["variance_flux_regain"] * base["transferred_fraction"]
    return {"variance_flux_product": product}


VARIANTS = (
    Variant("1", "`published` with λ' = 1/12", "published", lambda b, n: {"exchange_time": 1 / 12}),
    Variant("1", "`published` with τ_ξ = ∞", "published", lambda b, n: {"exchange_time": math.inf}),
    Variant("1", "`derived` with λ' = 12", "derived", lambda b, n: {"exchange_time": 12.0}),
    Variant("2", "`published` with L/d, all as printed", "published", _printed_ratio),
    Variant("14", "`published` with 1.017 κ for 20.39", "published", _printed_product),
    Variant("16", "`derived` without the factor ½ in (A10)", "derived", _without_one_half),
    Variant("17", "`published` with the sign of (A15)", "published", _sign_of_a15),
    Variant("18", "`published` with the sign of (B3)", "published", _sign_of_b3),
    Variant("19", "`published` with the trace of three directions", "published", directions=3),
)
