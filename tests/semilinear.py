"""Semilinear problems and fixed-step runs for measuring the exponential integrator."""

import functools as ft

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tests.fields import CASE_A, CASE_B, full_model, sine_state
from tests.runs import run, settings
from triboflux.grid import Grid
from triboflux.integrate import semilinear_term
from triboflux.integrators.exponential import ExponentialRungeKutta5, SemilinearTerm
from triboflux.integrators.linear import DenseOperator, LinearOperator
from triboflux.integrators.phi import phi_functions


class DiagonalOperator(LinearOperator):
    """A diagonal matrix acting on a vector."""

    rates: Float[Array, "..."]

    def functions(self, order, times):
        scaled = self.rates[None] * times[:, None]
        return tuple(DiagonalOperator(f[0, 0]) for f in phi_functions(scaled[None, None], order))

    def apply(self, state):
        return self.rates * state


def oscillator(parts=1):
    """Return a non-stiff problem of two variables, its nonlinearity in one or two parts."""

    def first(y):
        return jnp.stack([jnp.sin(y[1]) * y[0], 0.0])

    def second(y):
        return jnp.stack([0.0, y[0] ** 2 / (1.0 + y[1] ** 2)])

    nonlinear = (first, second) if parts == 2 else (lambda y: first(y) + second(y),)
    matrix = jnp.array([[-0.5, 1.0], [-1.0, -0.3]])
    return SemilinearTerm(DenseOperator(matrix), nonlinear), jnp.array([1.0, 0.5])


def hochbruck_ostermann(points=200):
    """Return the parabolic problem of Hochbruck & Ostermann (2005), section 6, and its solution.

    u_t = u_xx + 1/(1 + u²) + f with u = 0 at both ends and f such that u = x (1 - x) exp(t), by
    second differences, which are exact for it. The sum 1/(1 + u²) + f does not vanish at the ends,
    which is what makes methods lose order. Time is the last variable.
    """
    x = np.arange(1, points + 1) / (points + 1)
    waves = np.arange(1, points + 1)
    sines = jnp.asarray(np.sin(np.pi * np.outer(x, waves)))
    analysis = sines.T * (2.0 / (points + 1))
    rates = -4.0 * (points + 1) ** 2 * np.sin(np.pi * waves / (2.0 * (points + 1))) ** 2
    shape = jnp.asarray(x * (1.0 - x))

    def solution(t):
        return shape * jnp.exp(t)

    def values(y):
        return sines @ y[:-1]

    def nonlinear(y):
        u, exact = values(y), solution(y[-1])
        forcing = exact + 2.0 * jnp.exp(y[-1]) - 1.0 / (1.0 + exact**2)
        return jnp.concatenate([analysis @ (1.0 / (1.0 + u**2) + forcing), jnp.ones(1)])

    term = SemilinearTerm(DiagonalOperator(jnp.asarray([*rates, 0.0])), (nonlinear,))
    return term, jnp.concatenate([analysis @ solution(0.0), jnp.zeros(1)]), values, solution


@ft.cache
def slaved(closure_set="published", time=4.0, points=32):
    """Return case A's semilinear problem and its state after the initial layer."""
    return _developed(CASE_A, closure_set, time, points)


@ft.cache
def developed(closure_set="published", time=0.05, points=32):
    """Return case B's semilinear problem and its state when the covariance has grown."""
    return _developed(CASE_B, closure_set, time, points)


def _developed(numbers, closure_set, time, points):
    grid = Grid((points,), (1.0,))
    model = full_model(numbers, closure_set)
    outcome = run(model, sine_state(grid), grid, settings(time, rtol=1e-9))
    return semilinear_term(model, grid), outcome.carry.coefficients


@eqx.filter_jit
def fixed_steps(term, start, step, t_end, times=None):
    """Return the state at the end of equal steps, or at several times, with a leading axis."""
    saved = diffrax.SaveAt(t1=True) if times is None else diffrax.SaveAt(ts=times)
    return diffrax.diffeqsolve(
        term,
        ExponentialRungeKutta5(),
        jnp.zeros(()),
        t_end,
        step,
        start,
        stepsize_controller=diffrax.ConstantStepSize(),
        saveat=saved,
        max_steps=4096,
    ).ys


def by_fixed_steps(term, start, t_end, count, times=None):
    """Return what `fixed_steps` does for a number of steps."""
    t_end = jnp.asarray(float(t_end))
    return fixed_steps(term, start, t_end / count, t_end, times)


@eqx.filter_jit
def one_step(term, start, step):
    """Return the state after one step and the estimate of its error."""
    solver = ExponentialRungeKutta5()
    cache = solver.init(term, jnp.zeros(()), step, start, None)
    end, error, *_ = solver.step(term, jnp.zeros(()), step, start, None, cache, False)
    return end, error


def norms(left, right=None):
    """Return the Euclidean norms of a state's leaves, or of a difference of states."""
    difference = left if right is None else jax.tree.map(lambda a, b: a - b, left, right)
    return np.array([float(jnp.linalg.norm(leaf)) for leaf in jax.tree.leaves(difference)])


def orders(errors):
    """Return the observed orders between errors whose steps halve from one to the next."""
    errors = np.asarray(errors)
    return np.log2(errors[:-1] / errors[1:])
