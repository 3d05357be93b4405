"""Runs that work on fewer points than their case has, for as long as these resolve the state."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.cases import data
from tests.runs import random_coefficients
from triboflux import case as cases
from triboflux import segments
from triboflux.errors import InputError
from triboflux.grid import Grid
from triboflux.moments import Moments
from triboflux.resolution import coarsest_for, ladder, unresolved
from triboflux.solve import solve

GRIDS = [((48,), (128,)), ((33,), (50,)), ((16, 9), (20, 32)), ((8, 10, 7), (12, 10, 16))]


def growing(points=192, energy_ratio=3000.0, **changes):
    """Return a case whose spectrum outgrows the coarsest grid on the way."""
    numbers = {
        "peclet": 1e5,
        "tau_c": 0.01,
        "tau_p": 0.05,
        "tau_sigma": 5.0,
        "energy_ratio": energy_ratio,
        "length_ratio": 192.0,
        "restitution": 0.9,
    }
    waves = [
        {"mode": [1], "sine": -0.7, "cosine": 0.2},
        {"mode": [2], "sine": 0.3, "cosine": -0.1},
        {"mode": [3], "sine": 0.1, "cosine": 0.15},
    ]
    tables = data(
        closures="derived",
        numbers=numbers,
        grid__points=[points],
        initial__charge=waves,
        run__t_end=0.2,
        run__outputs=5,
    )
    tables["run"] |= changes
    return cases.Case(**tables)


def worked_on(case):
    """Return the points of all grids that a run works on, its steps and its records."""
    made, records = segments_of(case), []
    grids = [made.position.grid.points]
    while made.position.ending is None:
        made.advance(records)
        grids.append(made.position.grid.points)
    return [points for points, _ in itertools.groupby(grids)], made.position, records


def segments_of(case):
    from triboflux import closures, models

    closure_set = closures.by_name(case.closures, case.numbers.restitution, case.exponent)
    model = models.build(case.model, case.numbers, closure_set, dimensions=case.grid.dimensions)
    grid = Grid(case.grid.points, case.grid.lengths)
    return segments.Segments(case, jax.tree.map(jnp.asarray, model), grid)


@pytest.fixture(scope="module")
def adaptive():
    return solve(growing())


@pytest.mark.parametrize(
    ("points", "expected"),
    [
        ((32,), [(32,)]),
        ((64,), [(64,)]),
        ((128,), [(48,), (128,)]),
        ((256,), [(48,), (96,), (256,)]),
        ((256, 64), [(32, 32), (64, 64), (128, 64), (256, 64)]),
        ((20, 20, 64), [(20, 20, 32), (20, 20, 64)]),
    ],
)
def test_grids_double_up_to_that_of_the_case(points, expected):
    grids = ladder(Grid(points, (2.0,) * len(points)))
    assert [grid.points for grid in grids] == expected
    assert {grid.lengths for grid in grids} == {(2.0,) * len(points)}


@pytest.mark.parametrize(("coarse", "fine"), GRIDS)
def test_a_field_keeps_its_values_on_a_finer_grid(coarse, fine):
    grid, finer = (Grid(points, (1.0, 2.0, 0.5)[: len(points)]) for points in (coarse, fine))
    state = random_coefficients(grid).covariance
    there = grid.resized(state, finer)
    np.testing.assert_array_equal(finer.resized(there, grid), state)
    # the mean of squares and the value in the corner do not depend on the points
    for leaf, same in zip(state, there, strict=True):
        np.testing.assert_allclose(finer.rms(same), grid.rms(leaf), rtol=1e-13)
    corner = (..., *(0,) * grid.dimensions)
    np.testing.assert_allclose(
        finer.to_fields(there)[corner], grid.to_fields(state)[corner], rtol=1e-11
    )


@pytest.mark.parametrize("axis", [0, 1])
def test_the_end_of_a_spectrum_is_looked_at_along_every_axis(axis):
    grid = Grid((64, 64), (1.0, 1.0))

    def wave(number, size):
        phase = 2.0 * np.pi * np.arange(64) / 64.0
        x = np.meshgrid(phase, phase, indexing="ij")[axis]
        field = jnp.asarray(np.sin(x) + size * np.sin(number * x))
        return Moments(charge=grid.to_spectral(field))

    assert grid.kept == (21, 21)
    assert not unresolved(wave(21, 1e-7), grid, 1e-6, 0.0)
    assert unresolved(wave(21, 1e-5), grid, 1e-6, 0.0)
    assert not unresolved(wave(21, 1e-5), grid, 1e-6, 1e-5)
    assert not unresolved(wave(18, 1e-5), grid, 1e-6, 0.0)


def test_one_moment_that_is_not_resolved_is_enough():
    grid = Grid((64,), (1.0,))
    x = 2.0 * np.pi * np.arange(64) / 64.0
    smooth, rough = (grid.to_spectral(jnp.asarray(np.sin(m * x))) for m in (1, 21))
    assert not unresolved(Moments(smooth, smooth[None], smooth), grid, 1e-6, 1e-9)
    assert unresolved(Moments(smooth, smooth[None], smooth + 1e-3 * rough), grid, 1e-6, 1e-9)
    assert unresolved(Moments(smooth, smooth[None], smooth * np.nan), grid, 1e-6, 1e-9)


def test_a_run_starts_on_the_coarsest_grid_that_holds_its_initial_state():
    grids = ladder(Grid((256,), (1.0,)))
    x = 2.0 * np.pi * np.arange(256) / 256.0

    def start(mode):
        state = Moments(charge=grids[-1].to_spectral(jnp.asarray(np.sin(mode * x))))
        return coarsest_for(state, grids, 1e-6, 1e-9).points

    assert [start(mode) for mode in (1, 13, 14, 27, 29)] == [(48,), (48,), (96,), (96,), (256,)]


def test_grids_grow_with_the_spectrum_and_change_less_than_the_tolerance(adaptive):
    fixed = solve(growing(adaptive_points=False))
    grids, *_ = worked_on(growing())
    assert grids == [(48,), (96,), (192,)]
    assert adaptive.stats["points"] == fixed.stats["points"] == [192]
    for name in ("charge", "covariance", "variance"):
        a, b = adaptive.dataset[name], fixed.dataset[name]
        assert float(abs(a - b).max()) < 1e-6 * float(abs(b).max()), name
    means = adaptive.dataset["charge"].mean("x")
    assert float(abs(means).max()) < 1e-15


def test_a_stop_on_a_coarse_grid_is_found_where_the_fine_one_has_it():
    stopping = {"stop_at_peak_charge": 0.8, "outputs": 3}
    adaptive = solve(growing(128, 30.0, **stopping))
    fixed = solve(growing(128, 30.0, adaptive_points=False, **stopping))
    assert (adaptive.stats["points"], fixed.stats["points"]) == ([48], [128])
    assert "peak charge fell" in adaptive.stop_reason
    t, exact = (float(result.dataset["time"][-1]) for result in (adaptive, fixed))
    assert t == pytest.approx(exact, rel=1e-6)


def test_bounds_that_are_looked_for_on_the_points_keep_those_of_the_case():
    assert segments_of(growing()).position.grid.points == (48,)
    assert segments_of(growing(realizability_bound=10.0)).position.grid.points == (192,)
    assert segments_of(growing(adaptive_points=False)).position.grid.points == (192,)


def test_a_run_goes_on_from_any_of_its_grids_bit_for_bit():
    _, end, records = worked_on(growing())
    made, first = segments_of(growing()), []
    made.advance(first)
    assert made.position.grid.points == (96,)
    arrays, numbers = made.stored()
    numbers = {**numbers, "points": list(numbers["points"])}  # as JSON gives them back
    other, again = segments_of(growing()), list(first)
    other.restore(arrays, numbers)
    while other.position.ending is None:
        other.advance(again)
    assert other.position.steps == end.steps
    assert len(again) == len(records)
    for mine, whole in zip(again, records, strict=True):
        for name in whole:
            np.testing.assert_array_equal(mine[name], whole[name])
    with pytest.raises(InputError, match="its points do not fit"):
        other.restore(arrays, numbers | {"points": [100]})
