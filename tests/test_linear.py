"""The linear operators whose functions the integrator takes, against dense matrices."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree
from scipy.linalg import expm

from tests.fields import PAPER, full_model
from tests.runs import random_coefficients
from triboflux.calculus import FourierCalculus
from triboflux.grid import Grid
from triboflux.integrators.linear import DenseOperator, LinearOperator, block_operator
from triboflux.models import Model, Term, evaluate
from triboflux.models.terms import IDENTITY, LAPLACIAN
from triboflux.moments import Moments

GRIDS = {
    "1-D": Grid((9,), (0.8,)),
    "2-D": Grid((5, 7), (1.0, 2.0)),
    "3-D": Grid((4, 5, 4), (1.0, 0.5, 2.0)),
}
ORDER = 4
TIMES = (0.03, 0.7)
grids = pytest.mark.parametrize("grid", GRIDS.values(), ids=GRIDS.keys())


def coupled_model(dimensions):
    """Return the full model with every linear coupling switched on and of comparable size."""
    sizes = {"peclet": 2e3, "tau_sigma": 0.8, "tau_p": 0.6, "tau_c": 0.03, "length_ratio": 30.0}
    return full_model(PAPER | sizes, dimensions=dimensions)


@eqx.filter_jit
def functions_of(operator, times):
    return operator.functions(ORDER, times)


@eqx.filter_jit
def applied(operator, state):
    return operator.apply(state)


def dense_matrix(operator, like):
    """Return an operator as one matrix on all coefficients of a state."""
    flat, unravel = ravel_pytree(like)

    def apply(y):
        return ravel_pytree(operator.apply(unravel(y)))[0]

    return np.asarray(jax.jit(jax.jacobian(apply))(flat))


def dense_functions(matrix):
    """Return φ_0..φ_ORDER of a dense matrix by SciPy's exponential of an augmented one."""
    m = len(matrix)
    augmented = np.zeros((m * (ORDER + 1),) * 2)
    augmented[:m, :m] = matrix
    augmented[: m * ORDER, m:] += np.eye(m * ORDER)
    return [expm(augmented)[:m, j * m : (j + 1) * m] for j in range(ORDER + 1)]


@grids
def test_operator_is_the_sum_of_the_linear_terms(grid):
    model = coupled_model(grid.dimensions)
    state = random_coefficients(grid)
    expected = eqx.filter_jit(evaluate)(model.linear_terms(), FourierCalculus(grid), state)
    found = applied(block_operator(model, grid), state)
    for name in model.evolves:
        f, e = getattr(found, name), getattr(expected, name)
        np.testing.assert_allclose(f, e, rtol=0, atol=1e-13 * float(jnp.max(jnp.abs(e))))


@pytest.mark.parametrize("grid", [GRIDS["1-D"], GRIDS["2-D"]], ids=["1-D", "2-D"])
def test_functions_are_those_of_the_dense_matrix(grid):
    model, state = coupled_model(grid.dimensions), random_coefficients(grid)
    operator = block_operator(model, grid)
    matrix = dense_matrix(operator, state)
    functions = functions_of(operator, jnp.asarray(TIMES))
    y = np.asarray(ravel_pytree(state)[0])
    for i, time in enumerate(TIMES):
        for order, dense in enumerate(dense_functions(time * matrix)):
            function = jax.tree.map(lambda leaf, i=i: leaf[i], functions[order])
            found = np.asarray(ravel_pytree(applied(function, state))[0])
            expected = dense @ y
            np.testing.assert_allclose(
                found, expected, rtol=0, atol=1e-11 * np.abs(expected).max(), err_msg=f"{order}"
            )


def test_transverse_covariance_is_apart_from_the_charge():
    grid = GRIDS["2-D"]
    operator = block_operator(coupled_model(2), grid)
    kx, ky = (np.broadcast_to(k, grid.modes) for k in grid.wave_vector())
    stream = random_coefficients(grid).charge
    rotated = jnp.stack([-ky[None] * stream, kx[None] * stream])
    changed = operator.apply(Moments(covariance=rotated))
    np.testing.assert_allclose(changed.charge, 0.0, atol=1e-10)
    c = coupled_model(2).coefficients
    rate = c.covariance_destruction + c.covariance_dispersion * grid.wave_number_squared()
    np.testing.assert_allclose(
        changed.covariance, -rate[None, None] * rotated, rtol=1e-11, atol=1e-9
    )


def test_missing_moments_count_as_zero():
    grid = GRIDS["2-D"]
    operator = block_operator(coupled_model(2), grid)
    state = random_coefficients(grid)
    parts = [applied(operator, Moments(**{name: getattr(state, name)})) for name in vars(state)]
    total, whole = parts[0] + parts[1] + parts[2], applied(operator, state)
    for name in vars(state):
        np.testing.assert_allclose(
            getattr(total, name), getattr(whole, name), rtol=1e-12, atol=1e-12
        )
    assert parts[0].variance is None
    assert parts[2].charge is None


def test_blocks_are_made_once_per_distinct_wave_number():
    grid = Grid((12, 12), (1.0, 1.0))
    operator = block_operator(coupled_model(2), grid)
    squares = {m * m + n * n for m in range(-3, 4) for n in range(4)}
    assert operator.blocks.shape == (2, 2, 2, len(squares))
    expanded, *_ = functions_of(operator, jnp.asarray(TIMES))
    assert expanded.blocks.shape == (len(TIMES), 2, 2, 2, *grid.modes)


@grids
@pytest.mark.parametrize("present", ["charge", "covariance", "variance", None])
def test_sums_of_applied_operators(grid, present):
    operator = block_operator(coupled_model(grid.dimensions), grid)
    times = jnp.asarray(TIMES)
    # Leading axes: two functions, and what is stacked already, two times.
    functions = jax.tree.map(lambda *a: jnp.stack(a), *functions_of(operator, times)[1:3])
    whole = random_coefficients(grid)
    state = whole if present is None else Moments(**{present: getattr(whole, present)})
    states = jax.tree.map(lambda a: jnp.stack([a, -0.3 * a + 0.1]), state)
    found = eqx.filter_jit(lambda f, y: f.apply_all(y))(functions, states)
    expected = eqx.filter_jit(LinearOperator.apply_all)(functions, states)
    for name in ("charge", "covariance", "variance"):
        one, other = getattr(found, name), getattr(expected, name)
        assert (one is None) == (other is None)
        if one is not None:
            scale = float(jnp.abs(other).max())
            np.testing.assert_allclose(one, other, rtol=0, atol=1e-14 * scale)


def scalar_term(moment, operator, coefficient):
    return Term(moment, moment, "", moment, operator, moment, coefficient)


def test_models_of_scalars_have_single_numbers():
    grid = GRIDS["2-D"]
    coefficients = coupled_model(2).coefficients
    terms = (
        scalar_term("charge", LAPLACIAN, 0.01),
        scalar_term("variance", IDENTITY, -3.0),
    )
    model = Model("scalars", ("charge", "variance"), terms, coefficients)
    operator = block_operator(model, grid)
    assert operator.blocks.shape[:3] == (1, 1, 2)
    state = random_coefficients(grid, evolves=model.evolves)
    exponential = jax.tree.map(lambda leaf: leaf[0], functions_of(operator, jnp.asarray([0.5]))[0])
    after = exponential.apply(state)
    decay = np.exp(-0.005 * grid.wave_number_squared())
    np.testing.assert_allclose(after.charge, decay[None] * state.charge, rtol=1e-13)
    np.testing.assert_allclose(after.variance, np.exp(-1.5) * state.variance, rtol=1e-13)
    assert after.covariance is None
    charge_only = Model("charge", ("charge",), terms[:1], coefficients)
    after = block_operator(charge_only, grid).apply(Moments(charge=state.charge))
    assert after.variance is None
    np.testing.assert_allclose(
        after.charge, -0.01 * grid.wave_number_squared()[None] * state.charge, rtol=1e-13
    )


def test_a_linear_coupling_of_the_variance_is_refused_by_name():
    model = coupled_model(1)
    odd = Term("leak", "leak", "", "variance", IDENTITY, "charge", 1.0)
    broken = eqx.tree_at(lambda m: m.terms, model, (*model.terms, odd))
    with pytest.raises(NotImplementedError, match="'leak' couples charge into variance"):
        block_operator(broken, GRIDS["1-D"])


def test_dense_operator():
    matrix = np.random.default_rng(4).normal(size=(5, 5))
    operator = DenseOperator(jnp.asarray(matrix))
    y = jnp.arange(5.0)
    np.testing.assert_allclose(operator.apply(y), matrix @ np.arange(5.0), rtol=1e-14)
    functions = functions_of(operator, jnp.asarray(TIMES))
    for i, time in enumerate(TIMES):
        for function, expected in zip(functions, dense_functions(time * matrix), strict=True):
            np.testing.assert_allclose(function.matrix[i], expected, rtol=0, atol=1e-13)
