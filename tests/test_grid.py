"""The periodic box: transforms, exact de-aliasing, and peaks between the points."""

import itertools
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from triboflux.calculus import FourierCalculus
from triboflux.grid import Grid

GRIDS = {
    "1-D even": Grid((32,), (1.0,)),
    "1-D odd": Grid((13,), (0.7,)),
    "1-D tiny": Grid((1,), (1.0,)),
    # Up to 96 points a transform is a product with a matrix, beyond it is a fast one.
    "1-D at the limit": Grid((96,), (1.0,)),
    "1-D beyond it": Grid((97,), (1.0,)),
    "2-D": Grid((10, 7), (1.0, 2.5)),
    "2-D thin": Grid((3, 16), (1.0, 1.0)),
    "3-D": Grid((6, 9, 8), (1.0, 0.5, 3.0)),
    "3-D flat": Grid((8, 1, 5), (1.0, 1.0, 1.0)),
}
grids = pytest.mark.parametrize("grid", GRIDS.values(), ids=GRIDS.keys())


@eqx.filter_jit
def peaks(grid, stacked):
    """Return the peaks of several fields."""
    return jax.vmap(grid.peak)(stacked)


def peak_of(grid, values):
    return float(peaks(grid, grid.to_spectral(jnp.asarray(values))[None])[0])


def random_coefficients(grid, seed=0, leading=()):
    """Return coefficients of random real fields that hold kept modes only."""
    values = np.random.default_rng(seed).normal(size=(*leading, *grid.points))
    return grid.to_spectral(jnp.asarray(values))


def full_series(grid, coefficients):
    """Return {mode: complex amplitude} over positive and negative modes."""
    series = {}
    axes = [m.ravel() for m in grid.mode_numbers()]
    array = np.asarray(coefficients[0] + 1j * coefficients[1])
    for place in itertools.product(*(range(len(axis)) for axis in axes)):
        mode = tuple(int(axis[i]) for axis, i in zip(axes, place, strict=True))
        series[mode] = array[place]
        series[tuple(-m for m in mode)] = np.conj(array[place])
    return series


def evaluated(grid, coefficients, positions):
    """Return the Fourier series of a field at positions of shape [n, d], term by term."""
    total = np.zeros(len(positions), dtype=complex)
    for mode, amplitude in full_series(grid, coefficients).items():
        wave = 2.0 * np.pi * np.asarray(mode) / np.asarray(grid.lengths)
        total += amplitude * np.exp(1j * positions @ wave)
    np.testing.assert_allclose(total.imag, 0.0, atol=1e-12)
    return total.real


def shifted(grid, coefficients, shift):
    """Return the coefficients of f(x - shift)."""
    phase = sum(k * s for k, s in zip(grid.wave_vector(), shift, strict=True))
    values = (coefficients[0] + 1j * coefficients[1]) * np.exp(-1j * phase)
    return jnp.stack([values.real, values.imag])


# --- points and modes -----------------------------------------------------------------------------


def test_points_lie_at_whole_multiples_of_the_spacing():
    x, y = Grid((4, 5), (2.0, 1.0)).coordinates()
    np.testing.assert_array_equal(x, [0.0, 0.5, 1.0, 1.5])
    np.testing.assert_allclose(y, [0.0, 0.2, 0.4, 0.6, 0.8], rtol=1e-15)


@pytest.mark.parametrize(
    ("points", "largest"), [(1, 0), (3, 0), (4, 1), (32, 10), (33, 10), (34, 11), (64, 21)]
)
def test_two_thirds_of_the_modes_are_kept(points, largest):
    grid = Grid((points,), (1.0,))
    assert grid.kept == (largest,)
    assert 3 * largest < points
    assert 3 * (largest + 1) >= points


@grids
def test_mode_numbers_have_the_shape_of_the_modes(grid):
    assert np.broadcast_shapes(*(m.shape for m in grid.mode_numbers())) == grid.modes
    assert grid.wave_number_squared().shape == grid.modes


@grids
def test_transforms_are_inverse_on_kept_modes(grid):
    coefficients = random_coefficients(grid, leading=(2, 3))
    assert coefficients.shape == (2, 3, 2, *grid.modes)
    fields = grid.to_fields(coefficients)
    assert fields.shape == (2, 3, *grid.points)
    np.testing.assert_allclose(grid.to_spectral(fields), coefficients, rtol=0, atol=5e-15)


@grids
def test_fields_are_the_fourier_series_at_the_points(grid):
    coefficients = random_coefficients(grid)
    points = np.stack(np.meshgrid(*grid.coordinates(), indexing="ij"), axis=-1)
    expected = evaluated(grid, coefficients, points.reshape(-1, grid.dimensions))
    fields = grid.to_fields(coefficients)
    np.testing.assert_allclose(fields.ravel(), expected, rtol=0, atol=1e-13)


def test_coefficients_of_a_known_field():
    grid = Grid((9, 12), (1.0, 2.0))
    x, y = np.meshgrid(*grid.coordinates(), indexing="ij")
    angle = 2.0 * np.pi * (-2.0 * x + 3.0 * y / 2.0)
    coefficients = grid.to_spectral(jnp.asarray(0.25 + 4.0 * np.cos(angle) + 6.0 * np.sin(angle)))
    expected = np.zeros((2, *grid.modes))
    expected[0, 0, 0] = 0.25
    expected[:, -2, 3] = 2.0, -3.0
    np.testing.assert_allclose(coefficients, expected, rtol=0, atol=1e-14)


@grids
def test_parseval(grid):
    coefficients = random_coefficients(grid, seed=3)
    field = grid.to_fields(coefficients)
    expected = math.sqrt(float(jnp.mean(field**2)))
    assert float(grid.rms(coefficients)) == pytest.approx(expected, rel=1e-13)


# --- de-aliasing ----------------------------------------------------------------------------------


@grids
def test_products_of_kept_fields_have_no_aliasing(grid):
    left, right = random_coefficients(grid, 1), random_coefficients(grid, 2)
    product = grid.to_spectral(grid.to_fields(left) * grid.to_fields(right))
    series, other = full_series(grid, left), full_series(grid, right)
    kept = full_series(grid, product)
    for mode, found in kept.items():
        # The direct convolution: every pair of kept modes that adds up to this one.
        expected = sum(
            amplitude * other.get(tuple(m - n for m, n in zip(mode, part, strict=True)), 0.0)
            for part, amplitude in series.items()
        )
        assert abs(found - expected) < 1e-13, mode


def test_the_rule_is_sharp():
    # One more mode, and a product of the two largest comes back as a kept one.
    points = 30
    largest = Grid((points,), (1.0,)).kept[0] + 1
    x = np.arange(points) / points
    square = np.cos(2 * np.pi * largest * x) ** 2
    aliased = Grid((points,), (1.0,)).to_spectral(jnp.asarray(square - 0.5))
    assert points - 2 * largest == largest
    assert float(jnp.max(jnp.abs(aliased))) < 1e-15
    x = np.arange(points - 1) / (points - 1)
    square = np.cos(2 * np.pi * largest * x) ** 2
    aliased = Grid((points - 1,), (1.0,)).to_spectral(jnp.asarray(square - 0.5))
    assert float(jnp.max(jnp.abs(aliased))) == pytest.approx(0.25)


# --- peaks ----------------------------------------------------------------------------------------


def smooth_coefficients(grid, highest, seed):
    """Return a field whose few modes the points resolve well, of unit order."""
    coefficients = np.array(random_coefficients(grid, seed))
    small = np.ones(grid.modes, dtype=bool)
    for numbers in grid.mode_numbers():
        small &= np.abs(numbers) <= highest
    coefficients *= small
    return jnp.asarray(coefficients / np.abs(coefficients).max())


def dense_peak(grid, coefficients, refinement):
    fine = Grid(tuple(n * refinement for n in grid.points), grid.lengths)
    padded = np.zeros((2, *fine.modes))
    places = [m.ravel() for m in grid.mode_numbers()]
    padded[(slice(None), *np.ix_(*places))] = coefficients
    return float(jnp.max(jnp.abs(fine.to_fields(jnp.asarray(padded)))))


@pytest.mark.parametrize(
    ("grid", "highest", "refinement"),
    [
        (Grid((32,), (1.0,)), 5, 512),
        (Grid((31,), (2.0,)), 4, 512),
        (Grid((24, 18), (1.0, 0.5)), 3, 40),
        (Grid((16, 15, 12), (1.0, 2.0, 1.0)), 2, 10),
    ],
)
def test_peak_against_dense_sampling(grid, highest, refinement):
    fields = jnp.stack([smooth_coefficients(grid, highest, seed) for seed in range(6)])
    # Samples miss the top by half a spacing at most, and curvature grows like (2 π highest)².
    steepest = sum((2 * np.pi * highest / n / refinement) ** 2 for n in grid.points) / 8
    for coefficients, peak in zip(fields, peaks(grid, fields).tolist(), strict=True):
        sampled = dense_peak(grid, coefficients, refinement)
        assert sampled <= peak * (1 + 1e-13)
        assert peak <= sampled * (1 + steepest)
        assert float(jnp.max(jnp.abs(grid.to_fields(coefficients)))) < peak * (1 - 1e-6)


@pytest.mark.parametrize(
    ("grid", "highest"),
    [
        (Grid((32,), (1.0,)), 4),
        (Grid((20, 18), (1.0, 3.0)), 2),
        (Grid((12, 15, 12), (1.0, 1.0, 2.0)), 1),
    ],
)
def test_peak_does_not_depend_on_where_the_points_lie(grid, highest):
    coefficients = smooth_coefficients(grid, highest, seed=5)
    spacing = np.asarray(grid.lengths) / np.asarray(grid.points)
    fractions = np.random.default_rng(1).random((24, grid.dimensions))
    copies = jnp.stack([shifted(grid, coefficients, f * spacing) for f in fractions])
    found = np.asarray(peaks(grid, copies))
    np.testing.assert_allclose(found, found[0], rtol=1e-12)
    on_points = np.asarray([jnp.max(jnp.abs(grid.to_fields(copy))) for copy in copies])
    assert np.ptp(on_points) > 1e-3


def test_peak_of_a_sum_of_two_waves_is_known():
    # |cos x + cos 2x / 2| is largest at 0, |sin x + sin 2x / 2| where cos x = 1/2.
    grid = Grid((20,), (1.0,))
    x = 2 * np.pi * (grid.coordinates()[0] - 0.0123)
    assert peak_of(grid, np.cos(x) + np.cos(2 * x) / 2) == pytest.approx(1.5, rel=1e-14)
    expected = 0.75 * math.sqrt(3.0)
    assert peak_of(grid, np.sin(x) + np.sin(2 * x) / 2) == pytest.approx(expected, rel=1e-14)


def test_the_highest_point_need_not_lie_below_the_peak():
    # A summit of height 0.99 lies on a point, those of height 1.02 between points of at most 0.95.
    grid = Grid((16,), (1.0,))
    x = 2 * np.pi * grid.coordinates()[0]
    field = np.cos(3 * x) + 0.02 * np.cos(x - 2 * np.pi / 3)
    assert int(np.argmax(field)) == 0
    assert peak_of(grid, field) == pytest.approx(1.02, rel=1e-14)


def test_peak_of_an_oblique_plane_wave_is_its_amplitude():
    # Its crest is a line, along which the second derivative vanishes.
    grid = Grid((18, 16), (1.0, 2.0))
    x, y = np.meshgrid(*grid.coordinates(), indexing="ij")
    wave = 0.3 * np.sin(2 * np.pi * (2 * x - 3 * y / 2) + 0.4)
    assert peak_of(grid, wave) == pytest.approx(0.3, rel=1e-13)
    assert peak_of(grid, -wave) == pytest.approx(0.3, rel=1e-13)


@pytest.mark.parametrize("name", ["1-D tiny", "2-D thin"])
def test_peak_of_a_constant(name):
    for value in (0.0, 0.7, -0.7):
        assert peak_of(GRIDS[name], np.full(GRIDS[name].points, value)) == pytest.approx(
            abs(value), rel=1e-14
        )


def test_peak_is_differentiable():
    grid = Grid((32,), (1.0,))
    direction = smooth_coefficients(grid, 4, seed=9)
    gradient = eqx.filter_jit(jax.grad(grid.peak))
    x = grid.coordinates()[0]
    on_a_point = grid.to_spectral(jnp.asarray(np.sin(2 * np.pi * x)))
    for coefficients in (smooth_coefficients(grid, 4, seed=2), on_a_point + 1e-3 * direction):
        slope = float(jnp.sum(gradient(coefficients) * direction))
        ahead, behind = peaks(
            grid, jnp.stack([coefficients + 1e-5 * direction, coefficients - 1e-5 * direction])
        )
        assert slope == pytest.approx(float(ahead - behind) / 2e-5, rel=1e-8)


def test_the_gradient_of_a_peak_on_a_point_is_the_field_there():
    # Exactly on a point two ways to the same value meet; the gradient must not fall between them.
    grid = Grid((32,), (1.0,))
    x = grid.coordinates()[0]
    coefficients = grid.to_spectral(
        jnp.asarray(np.cos(2 * np.pi * x) + 0.1 * np.cos(4 * np.pi * x))
    )
    gradient = eqx.filter_jit(jax.grad(grid.peak))(coefficients)
    expected = np.zeros((2, *grid.modes))
    expected[0] = np.where(np.arange(grid.modes[0]) > 0, 2.0, 1.0)
    np.testing.assert_allclose(gradient, expected, rtol=0, atol=1e-12)


# --- calculus -------------------------------------------------------------------------------------


def oblique_wave(grid, mode, amplitude, phase=0.3):
    angle = phase + sum(
        2 * np.pi * m * x / length
        for m, x, length in zip(
            mode, np.meshgrid(*grid.coordinates(), indexing="ij"), grid.lengths, strict=True
        )
    )
    return amplitude * np.cos(angle), -amplitude * np.sin(angle)


@pytest.mark.parametrize(
    ("grid", "mode"),
    [
        (Grid((16,), (0.5,)), (3,)),
        (Grid((12, 15), (1.0, 2.0)), (-2, 3)),
        (Grid((9, 12, 10), (1.0, 2.0, 0.7)), (1, -3, 2)),
    ],
)
def test_calculus_of_a_plane_wave(grid, mode):
    calculus = FourierCalculus(grid)
    k = 2 * np.pi * np.asarray(mode) / np.asarray(grid.lengths)
    cosine, minus_sine = oblique_wave(grid, mode, 0.8)
    coefficients = calculus.from_values(jnp.asarray(cosine + 0.25))
    close = {"rtol": 0, "atol": 1e-12 * float(k @ k)}
    along = (-1,) + (1,) * grid.dimensions
    gradient = calculus.gradient(coefficients)
    np.testing.assert_allclose(calculus.values(gradient), k.reshape(along) * minus_sine, **close)
    laplacian = calculus.values(calculus.laplacian(coefficients))
    np.testing.assert_allclose(laplacian, -(k @ k) * cosine, **close)
    twice = calculus.laplacian(gradient)
    np.testing.assert_allclose(twice, calculus.gradient(calculus.laplacian(coefficients)), **close)
    np.testing.assert_allclose(
        calculus.divergence(gradient), calculus.laplacian(coefficients), **close
    )
    field = calculus.electric_field(coefficients)
    # E = -∇φ with -∇²φ = Q - ⟨Q⟩
    np.testing.assert_allclose(
        calculus.values(field), -k.reshape(along) * minus_sine / (k @ k), **close
    )
    charge = calculus.values(calculus.divergence(field))
    np.testing.assert_allclose(charge, cosine, **close)
    np.testing.assert_allclose(
        calculus.values(calculus.without_mean(coefficients)), cosine, **close
    )
    potential = calculus.potential(coefficients)
    np.testing.assert_allclose(calculus.values(potential), cosine / (k @ k), **close)


@grids
def test_electric_field_has_no_mean_and_no_curl(grid):
    calculus = FourierCalculus(grid)
    field = calculus.electric_field(random_coefficients(grid, 4))
    values = np.asarray(calculus.values(field))
    np.testing.assert_allclose(values.reshape(grid.dimensions, -1).mean(axis=1), 0.0, atol=1e-15)
    slopes = np.stack([calculus.gradient(component) for component in field])
    np.testing.assert_allclose(slopes, slopes.swapaxes(0, 1), rtol=0, atol=1e-13)
