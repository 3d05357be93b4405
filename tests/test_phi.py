"""The phi functions against exponentials of an augmented matrix in 80-digit arithmetic.

φ_1, φ_2, ... are accurate in every entry, relative to that entry, unless it is the small difference
of oscillating parts. φ_0 = exp is not, because it is returned as 1 + (exp - 1): its entries are
accurate to the round-off of 1, or of its norm if that is larger. What has decayed to 1e-20 comes
out as zero or as some 1e-17, which harms nothing: a state is multiplied by it, and the sum with the
other functions' contributions is no more accurate than that.
"""

from decimal import Decimal, localcontext

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from triboflux.integrators.phi import phi_functions

ORDER = 4
DIGITS = 80

BLOCKS = {
    "zero": [[0, 0], [0, 0]],
    "nilpotent": [[0, 1], [0, 0]],
    "tiny": [[1e-12, 1e-9], [0, -1e-7]],
    "of order one": [[-0.3, 0.9], [0.5, -1.2]],
    "positive": [[3, 1], [2, 5]],
    "strongly growing": [[20, 1], [2, 30]],
    "defective": [[-3, 1], [0, -3]],
    "stiff and defective": [[-300, 1], [0, -300]],
    "nearly defective": [[-3, 1], [1e-14, -3]],
    "damped oscillation": [[-1, -50], [50, -1]],
    "pure oscillation": [[0, -7], [7, 0]],
    "charge and covariance, case A, a step of 0.3": [[-1.2e-5, -1.9], [1.9, -2000.0]],
    "charge and covariance, case A, a step of 45": [[-0.7, -5650.0], [5650.0, -300150.0]],
    "one slow eigenvalue": [[-1, 0], [3, -1e5]],
    "one slow eigenvalue, coupled": [[-1, 1e4], [-1e-3, -1e5]],
    "one very slow eigenvalue": [[-1e-6, 1e2], [-1e-4, -1e5]],
    "norm beyond 1e9": [[-1e-3, 1e3], [-1e3, -1e9]],
}
ACCURATE_ENTRIES = [name for name in BLOCKS if "oscillation" not in name]


@eqx.filter_jit
def phi(matrices):
    return phi_functions(matrices, ORDER)


def exact(matrix, order=ORDER):
    """Return φ_0..φ_order of a matrix of floats as object arrays of Decimal.

    They are the first block row of exp([[A, 1, 0, ...], [0, 0, 1, ...], ...]).
    """
    with localcontext() as context:
        context.prec = DIGITS
        m = len(matrix)
        size = m * (order + 1)
        augmented = np.full((size, size), Decimal(0), dtype=object)
        augmented[:m, :m] = [[Decimal(float(entry)) for entry in row] for row in matrix]
        for i in range(m * order):
            augmented[i, i + m] = Decimal(1)
        norm = max(sum(abs(entry) for entry in row) for row in augmented)
        halvings = max(0, int(np.ceil(np.log2(float(norm))))) + 4
        augmented = augmented / Decimal(2) ** halvings
        power = np.full((size, size), Decimal(0), dtype=object)
        np.fill_diagonal(power, Decimal(1))
        total = power.copy()
        for n in range(1, 45):
            power = power.dot(augmented) / n
            total = total + power
        for _ in range(halvings):
            total = total.dot(total)
        return [total[:m, j * m : (j + 1) * m] for j in range(order + 1)]


def errors(found, expected):
    """Return the absolute errors of entries, subtracting in high precision."""
    with localcontext() as context:
        context.prec = DIGITS
        differences = [
            Decimal(float(f)) - e for f, e in zip(found.flat, expected.flat, strict=True)
        ]
    return np.abs(np.array(differences, dtype=float)).reshape(found.shape)


@pytest.fixture(scope="module")
def results():
    """Return {name: [(found, expected) for every function]}, all blocks in one batch."""
    batch = jnp.stack([jnp.asarray(b, dtype=float) for b in BLOCKS.values()], axis=-1)
    found = [np.asarray(f) for f in phi(batch)]
    return {
        name: [(f[..., i], e) for f, e in zip(found, exact(block), strict=True)]
        for i, (name, block) in enumerate(BLOCKS.items())
    }


@pytest.mark.parametrize("name", BLOCKS)
def test_functions_are_accurate_in_norm(results, name):
    for order, (found, expected) in enumerate(results[name]):
        size = np.abs(expected.astype(float)).max()
        # exp is the sum of 1 and exp - 1.
        scale = max(size, 1.0) if order == 0 else size
        assert errors(found, expected).max() <= 1e-13 * scale, order


@pytest.mark.parametrize("name", ACCURATE_ENTRIES)
def test_every_entry_is_accurate_from_the_first_order_on(results, name):
    for order, (found, expected) in enumerate(results[name]):
        if order > 0:
            bound = 1e-13 * np.abs(expected.astype(float))
            assert (errors(found, expected) <= bound).all(), order


def test_the_slow_eigenvalue_survives_many_doublings():
    # λ = -1e-6 beside -1e5: eighteen doublings, each of which may lose what a slow mode has done.
    block = [[-1e-6, 0.0], [0.0, -1e5]]
    exponential, first, *_ = (np.asarray(f)[..., 0] for f in phi(jnp.asarray(block)[..., None]))
    assert exponential[0, 0] - 1.0 == pytest.approx(np.expm1(-1e-6), rel=1e-9)
    assert first[0, 0] == pytest.approx(-np.expm1(-1e-6) / 1e-6, rel=1e-15)
    assert first[1, 1] == pytest.approx(1e-5, rel=1e-14)


def test_single_numbers_and_larger_matrices():
    numbers = [0.0, -1e-9, -0.7, 2.0, -40.0, -1e5]
    found = [np.asarray(f) for f in phi(jnp.asarray(numbers).reshape(1, 1, -1))]
    for i, number in enumerate(numbers):
        for order, (f, e) in enumerate(zip(found, exact([[number]]), strict=True)):
            bound = 1e-14 * (max(float(e[0, 0]), 1.0) if order == 0 else float(e[0, 0]))
            assert errors(f[..., i], e)[0, 0] <= bound
    matrix = np.random.default_rng(0).normal(size=(3, 3)) * 4.0
    for f, e in zip(phi(jnp.asarray(matrix)[..., None]), exact(matrix), strict=True):
        assert errors(np.asarray(f)[..., 0], e).max() <= 1e-14 * np.abs(e.astype(float)).max()


def test_a_batch_may_have_any_shape():
    batch = jnp.asarray(np.random.default_rng(1).normal(size=(2, 2, 3, 4)) * 10.0)
    together = phi(batch)
    flat = phi(batch.reshape(2, 2, 12))
    for f, g in zip(together, flat, strict=True):
        assert f.shape == batch.shape
        np.testing.assert_array_equal(f.reshape(2, 2, 12), g)


def test_a_stiff_neighbour_in_the_batch_changes_nothing():
    alone = phi(jnp.asarray(BLOCKS["of order one"])[..., None])
    pair = phi(jnp.asarray([BLOCKS["of order one"], BLOCKS["norm beyond 1e9"]]).transpose(1, 2, 0))
    for f, g in zip(alone, pair, strict=True):
        np.testing.assert_array_equal(f[..., 0], g[..., 0])


@pytest.mark.parametrize(
    "name", ["zero", "defective", "stiff and defective", "nearly defective", "one slow eigenvalue"]
)
def test_derivatives_where_eigenvalues_coincide(name):
    # φ([[A, B], [0, A]]) has the derivative of φ at A in the direction B as its upper right block.
    block = np.asarray(BLOCKS[name], dtype=float)
    direction = np.array([[0.3, -0.7], [0.9, 0.4]])
    doubled = np.block([[block, direction], [np.zeros((2, 2)), block]])
    expected = [e[:2, 2:].astype(float) for e in exact(doubled)]
    _, found = eqx.filter_jit(jax.jvp)(
        phi, (jnp.asarray(block)[..., None],), (jnp.asarray(direction)[..., None],)
    )
    for order, (f, e) in enumerate(zip(found, expected, strict=True)):
        size = max(np.abs(e).max(), 1e-16 if order == 0 else 0.0)
        assert np.abs(np.asarray(f)[..., 0] - e).max() <= 1e-10 * size, order


def test_reverse_derivatives_agree_with_forward_ones():
    blocks = jnp.stack([jnp.asarray(b, dtype=float) for b in BLOCKS.values()], axis=-1)[..., :-1]
    weights = jnp.asarray(np.random.default_rng(2).normal(size=(ORDER + 1, *blocks.shape)))

    def total(matrices):
        return sum(
            jnp.sum(w * f) for w, f in zip(weights, phi_functions(matrices, ORDER), strict=True)
        )

    gradient = eqx.filter_jit(jax.grad(total))(blocks)
    assert bool(jnp.isfinite(gradient).all())
    direction = jnp.asarray(np.random.default_rng(3).normal(size=blocks.shape))
    _, slope = eqx.filter_jit(jax.jvp)(total, (blocks,), (direction,))
    assert float(jnp.sum(gradient * direction)) == pytest.approx(float(slope), rel=1e-12)
