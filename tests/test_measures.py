"""The numbers that statements about the paper's figures are measured by."""

import numpy as np
import pytest

from tests.cases import fake_result
from tests.maps import pretended, smooth
from tests.paper_runs import changed
from triboflux.figures import paper_case
from triboflux.figures.measures import (
    distances,
    harmonics,
    limit_at,
    limits,
    nearest,
    places_of_maxima,
    suitable_until,
    unrealizable,
)
from triboflux.result import Result


def wave(charge, **fields):
    """Return a made-up result whose last fields are given."""
    result = fake_result(changed(paper_case(1), grid__points=(len(charge),)))
    dataset = result.dataset.copy(deep=True)
    for name, values in {"charge": charge, **fields}.items():
        dataset[name][{"time": -1}] = values
    return Result(dataset)


def test_distances_are_relative_to_the_full_model():
    x = np.arange(16) / 16
    full = wave(2.0 * np.sin(2 * np.pi * x))
    reduced = wave(2.0 * np.sin(2 * np.pi * x) + 0.1 * np.cos(2 * np.pi * x))
    found = distances(reduced, full)
    assert found["charge"] == pytest.approx((0.05, 0.05))
    assert found["variance"] == (0.0, 0.0)


def test_harmonics_of_a_wave():
    x = np.arange(16) / 16
    sine = np.cos(2 * np.pi * x - 0.3)
    assert harmonics(wave(sine)) < 1e-14
    peaked = np.cos(2 * np.pi * x) + 0.25 * np.cos(4 * np.pi * x)
    assert harmonics(wave(peaked)) == pytest.approx(0.2)


def test_maxima_and_realizability_of_a_wave():
    x = np.arange(16) / 16
    result = wave(x, covariance=np.sin(2 * np.pi * x), variance=0.6)
    np.testing.assert_array_equal(places_of_maxima(result, "covariance"), [-0.25, 0.25])
    assert unrealizable(result) == pytest.approx((6 / 16, 1.0 / 0.6))


# ------------------------------------------------------------------ maps


def test_limits_are_exact_for_powers():
    error, axes = smooth()
    error *= np.linspace(1.0, 3.0, 9)[:, None]
    made = pretended(error, axes=axes)
    expected = 1e-2 / np.linspace(1.0, 3.0, 9)
    np.testing.assert_allclose(limits(made, 0.05), expected, rtol=1e-12)
    assert limit_at(made, 0.05, 1e8) == pytest.approx(1e-2 / 3.0, rel=1e-12)
    half_way = limit_at(made, 0.05, 10**7.625)
    assert half_way == pytest.approx(np.sqrt(expected[-1] * expected[-2]), rel=1e-12)


def test_no_limit_is_found_beside_a_point_without_error():
    error, axes = smooth()
    # the error passes 0.05 between the third and the fourth collision time
    error[3, 5], error[4, 4:], error[5, 4], error[6], error[7] = np.nan, np.nan, np.nan, 0.0, 1.0
    made = pretended(error * 1.1, axes=axes)
    found = np.isfinite(limits(made, 0.05))
    np.testing.assert_array_equal(found, [True, True, True, True, False, False, False, False, True])
    assert limit_at(made, 0.05, axes[0][1][3]) == pytest.approx(1e-2 / 1.1, rel=1e-9)
    assert np.isnan(limit_at(made, 0.05, axes[0][1][3] * 1.1))


def test_the_largest_suitable_time_needs_an_error():
    error, axes = smooth()
    tau_c = axes[1][1]
    error[0, 2:], error[1], error[2] = np.nan, np.nan, 1.0
    found = suitable_until(pretended(error, axes=axes), 0.06)
    np.testing.assert_array_equal(found, [tau_c[1], np.nan, np.nan, *[tau_c[4]] * 6])


def test_the_nearest_point_is_nearest_in_logarithms():
    error, axes = smooth()
    point = nearest(pretended(error, axes=axes), (axes[0][1][2] * 2.0, axes[1][1][5] / 1.7))
    assert (float(point["peclet"]), float(point["tau_c"])) == (axes[0][1][2], axes[1][1][5])
