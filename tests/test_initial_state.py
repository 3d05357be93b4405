"""The fields at time 0, against their definition and from files."""

import math

import numpy as np
import pytest

from tests.cases import data
from triboflux.case import Case
from triboflux.errors import InputError
from triboflux.initial_state import initial_fields, require_file


def test_one_dimension_by_definition():
    modes = [{"mode": [1], "sine": -1.0}, {"mode": [-3], "sine": 0.5, "cosine": 0.25}]
    charge, covariance, variance = initial_fields(
        Case(**data(initial__charge=modes, grid__lengths=[2.0]))
    )
    x = np.arange(32) / 16
    expected = -np.sin(math.pi * x) - 0.5 * np.sin(3 * math.pi * x) + 0.25 * np.cos(3 * math.pi * x)
    np.testing.assert_allclose(charge, expected, rtol=0, atol=1e-15)
    assert covariance.shape == (1, 32)
    assert not covariance.any()
    assert not variance.any()


def test_three_dimensions_by_definition():
    case = Case(
        **data(
            grid__points=[8, 10, 12],
            grid__lengths=[1.0, 2.0, 0.5],
            initial__charge=[
                {"mode": [1, -2, 3], "sine": 0.3, "cosine": -0.7},
                {"mode": [0, 1, 0], "sine": 1.0},
            ],
            initial__covariance=[
                {"component": 2, "mode": [1, 0, 0], "sine": 0.1},
                {"component": 0, "mode": [0, 0, 1], "cosine": 0.2},
                {"component": 2, "mode": [0, 0, 0], "cosine": 0.4},
            ],
            initial__variance=[{"mode": [0, 0, 0], "cosine": 0.5}],
        )
    )
    charge, covariance, variance = initial_fields(case)
    x, y, z = np.meshgrid(
        np.arange(8) / 8, np.arange(10) * 0.2, np.arange(12) / 24, indexing="ij", sparse=True
    )
    angle = 2 * math.pi * (x - 2 * y / 2 + 3 * z / 0.5)
    expected = 0.3 * np.sin(angle) - 0.7 * np.cos(angle) + np.sin(math.pi * y)
    np.testing.assert_allclose(charge, expected, rtol=0, atol=1e-14)
    wave_x = 0.1 * np.sin(2 * math.pi * x) + 0.4 + 0 * y + 0 * z
    np.testing.assert_allclose(covariance[2], wave_x, rtol=0, atol=1e-15)
    wave_z = 0.2 * np.cos(4 * math.pi * z) + 0 * x + 0 * y
    np.testing.assert_allclose(covariance[0], wave_z, rtol=0, atol=1e-15)
    assert not covariance[1].any()
    assert (variance == 0.5).all()


def test_equal_modes_add():
    modes = [{"mode": [2], "cosine": 0.25}, {"mode": [2], "cosine": 0.5}]
    charge, _, _ = initial_fields(Case(**data(initial__charge=modes)))
    assert charge[0] == 0.75


def test_phases_of_high_modes_keep_their_accuracy():
    modes = [{"mode": [300_000], "sine": 1.0}]
    charge, _, _ = initial_fields(Case(**data(initial__charge=modes, grid__points=[2**20])))
    turn = 300_000 * (2**20 - 1) % 2**20 / 2**20
    assert charge[-1] == pytest.approx(math.sin(2 * math.pi * turn), abs=1e-15)


def test_negative_variance_on_a_large_grid_is_found_too():
    modes = [{"mode": [0, 0, 0], "cosine": 0.1}, {"mode": [1, 0, 0], "cosine": 0.2}]
    case = Case(**data(initial__charge=[], initial__variance=modes, grid__points=[256, 128, 128]))
    with pytest.raises(InputError, match=r"^initial.variance is -0.1 at x = \(0.5, 0, 0\)"):
        initial_fields(case)


def test_missing_file_is_refused_without_being_read(tmp_path):
    path = tmp_path / "none.nc"
    case = Case(**data(initial__charge=[], initial__file=str(path)))
    for refuse in (require_file, initial_fields):
        with pytest.raises(InputError, match=r"^initial.file is '.*none.nc', which is no existing"):
            refuse(case)
