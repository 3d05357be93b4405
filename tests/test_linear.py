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
from triboflux.hierarchy import MODELS, RANKS
from triboflux.integrators.isotropy import Part
from triboflux.integrators.linear import DenseOperator, LinearOperator, block_operator
from triboflux.models import Model, Term, evaluate
from triboflux.models.operators import IDENTITY, LAPLACIAN
from triboflux.moments import Moments

GRIDS = {
    "1-D": Grid((9,), (0.8,)),
    "2-D": Grid((5, 7), (1.0, 2.0)),
    "3-D": Grid((4, 5, 4), (1.0, 0.5, 2.0)),
}
ORDER = 4
TIMES = (0.03, 0.7)
grids = pytest.mark.parametrize("grid", GRIDS.values(), ids=GRIDS.keys())


models = pytest.mark.parametrize("name", ["full", "third-order", "self-consistent"])


def coupled_model(dimensions, name="full"):
    """Return a model with every linear coupling switched on and of comparable size."""
    sizes = {"peclet": 2e3, "tau_sigma": 0.8, "tau_p": 0.6, "tau_c": 0.03, "length_ratio": 30.0}
    return full_model(PAPER | sizes, dimensions=dimensions, name=name)


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


@models
@grids
def test_operator_is_the_sum_of_the_linear_terms(grid, name):
    model = coupled_model(grid.dimensions, name)
    state = random_coefficients(grid, evolves=model.evolves)
    expected = eqx.filter_jit(evaluate)(model.linear_terms(), FourierCalculus(grid), state)
    found = applied(block_operator(model, grid), state)
    for moment in model.evolves:
        f, e = getattr(found, moment), getattr(expected, moment)
        np.testing.assert_allclose(f, e, rtol=0, atol=1e-13 * float(jnp.max(jnp.abs(e))))


@pytest.mark.parametrize(
    ("grid", "name"),
    [
        (GRIDS["1-D"], "full"),
        (GRIDS["2-D"], "full"),
        (GRIDS["1-D"], "third-order"),
        (GRIDS["2-D"], "third-order"),
        (Grid((3, 4, 3), (1.0, 0.5, 2.0)), "third-order"),
        (Grid((3, 4), (1.0, 0.5)), "self-consistent"),
    ],
    ids=lambda given: f"{given.dimensions}-D" if isinstance(given, Grid) else given,
)
def test_functions_are_those_of_the_dense_matrix(grid, name):
    model = coupled_model(grid.dimensions, name)
    state = random_coefficients(grid, evolves=model.evolves)
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
    names = ("charge", "covariance", "variance")
    parts = [applied(operator, Moments(**{name: getattr(state, name)})) for name in names]
    total, whole = parts[0] + parts[1] + parts[2], applied(operator, state)
    for name in names:
        np.testing.assert_allclose(
            getattr(total, name), getattr(whole, name), rtol=1e-12, atol=1e-12
        )
    assert parts[0].variance is None
    assert parts[2].charge is None


def test_blocks_are_made_once_per_distinct_wave_number():
    grid = Grid((12, 12), (1.0, 1.0))
    operator = block_operator(coupled_model(2), grid)
    squares = {m * m + n * n for m in range(-3, 4) for n in range(4)}
    # a pair that is coupled and two parts that are not
    assert operator.entries.shape == (6, len(squares))
    assert (operator.layout.size, operator.layout.number) == (2, 2)
    expanded, *_ = functions_of(operator, jnp.asarray(TIMES))
    assert expanded.entries.shape == (len(TIMES), 6, *grid.modes)


def test_tensors_need_no_larger_blocks_than_the_parts_that_turn_alike():
    layout = block_operator(coupled_model(2, "third-order"), GRIDS["2-D"]).layout
    blocks = {}
    for entry in layout.entries:
        blocks.setdefault(entry.block, set()).add(entry.source)
    assert (layout.size, layout.number) == (4, 2)
    names = ("charge", "covariance", "covariance_flux", "covariance_flux_trace")
    assert blocks[0] == {Part(name, 0) for name in names}
    assert len(layout.entries) == 16 + 4 + 1 + 1


@grids
@pytest.mark.parametrize(
    ("name", "present"),
    [
        *(("full", moments) for moments in (["charge"], ["covariance"], ["variance"])),
        ("full", ["charge", "covariance", "variance"]),
        ("third-order", list(MODELS["third-order"].evolves)),
        ("self-consistent", list(MODELS["self-consistent"].evolves)),
        ("third-order", ["covariance_flux", "variance"]),
        ("third-order", ["covariance", "covariance_flux_trace"]),
    ],
)
def test_sums_of_applied_operators(grid, name, present):
    operator = block_operator(coupled_model(grid.dimensions, name), grid)
    times = jnp.asarray(TIMES)
    # Leading axes: two functions, and what is stacked already, two times.
    functions = jax.tree.map(lambda *a: jnp.stack(a), *functions_of(operator, times)[1:3])
    state = random_coefficients(grid, evolves=present)
    states = jax.tree.map(lambda a: jnp.stack([a, -0.3 * a + 0.1]), state)
    found = eqx.filter_jit(lambda f, y: f.apply_all(y))(functions, states)
    expected = eqx.filter_jit(LinearOperator.apply_all)(functions, states)
    for moment in RANKS:
        one, other = getattr(found, moment), getattr(expected, moment)
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
    assert (operator.layout.size, operator.layout.number) == (1, 2)
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


def test_a_linear_coupling_that_no_model_has_finds_its_place():
    grid = GRIDS["2-D"]
    model = coupled_model(2)
    odd = Term("leak", "leak", "", "variance", IDENTITY, "charge", 1.5)
    leaking = eqx.tree_at(lambda m: m.terms, model, (*model.terms, odd))
    state = random_coefficients(grid)
    before, after = (applied(block_operator(m, grid), state) for m in (model, leaking))
    np.testing.assert_allclose(after.variance - before.variance, 1.5 * state.charge, atol=1e-12)
    np.testing.assert_array_equal(after.charge, before.charge)
    # the variance drives nothing, so a function of the operator has no such entries
    sources = {e.source for e in block_operator(leaking, grid).layout.entries if e.row != e.column}
    assert Part("variance", 0) not in sources


def test_dense_operator():
    matrix = np.random.default_rng(4).normal(size=(5, 5))
    operator = DenseOperator(jnp.asarray(matrix))
    y = jnp.arange(5.0)
    np.testing.assert_allclose(operator.apply(y), matrix @ np.arange(5.0), rtol=1e-14)
    functions = functions_of(operator, jnp.asarray(TIMES))
    for i, time in enumerate(TIMES):
        for function, expected in zip(functions, dense_functions(time * matrix), strict=True):
            np.testing.assert_allclose(function.matrix[i], expected, rtol=0, atol=1e-13)
