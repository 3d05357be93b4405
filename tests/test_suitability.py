"""Where a reduced model is good enough: errors, and points without one."""

import sys

import numpy as np
import pytest
import xarray as xr

from tests.maps import AXES, pretended, small
from triboflux.errors import InputError
from triboflux.solve import solve
from triboflux.suitability import (
    NOT_HALVED,
    OUTSIDE,
    chart_axes,
    chart_case,
    suitability,
)
from triboflux.suitability_file import load, save
from triboflux.sweep import Sweep

# the package gives the function that is named like it
suitability_module = sys.modules["triboflux.suitability"]


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="module")
def found(store):
    """Return a map of nine points with the published closures."""
    return suitability(small(), axes=AXES, store_folder=store, workers=1)


# ------------------------------------------------------------------ errors


@pytest.mark.slow
def test_error_is_that_of_two_runs(found):
    case = small(numbers__peclet=1e6, numbers__tau_c=1e-2, run__stop_at_peak_charge=0.5)
    full = solve(case).dataset.isel(time=-1)
    time = float(full["time"])
    changes = {"model": "semi-algebraic", "run__t_end": time, "numbers__peclet": 1e6}
    reduced = solve(small(**changes, numbers__tau_c=1e-2)).dataset.isel(time=-1)
    point = found.sel(peclet=1e6, tau_c=1e-2)
    assert float(point["stop_time"]) == pytest.approx(time, rel=1e-9)
    assert float(full["peak_charge"]) == pytest.approx(0.5, rel=1e-6)
    difference = reduced["charge"].values - full["charge"].values
    error = np.sqrt(np.sum(difference**2) / np.sum(full["charge"].values ** 2))
    assert float(point["error"]) == pytest.approx(error, rel=1e-6)
    assert 0.01 < error < 0.2


@pytest.mark.slow
def test_points_out_of_range_have_a_reason_and_no_error(found):
    status = found["status"].values
    # the variance grows where a collision passes over much: few collisions, small Pe
    wanted = [["ok", OUTSIDE, OUTSIDE], ["ok"] * 3, ["ok"] * 3]
    np.testing.assert_array_equal(status, np.array(wanted, dtype=object))
    error = found["error"].values
    np.testing.assert_array_equal(np.isnan(error), status != "ok")
    assert str(found["reason"].values[0, 2]).startswith("F = -28.6")
    np.testing.assert_array_equal(np.isnan(found["stop_time"].values), status != "ok")


@pytest.mark.slow
def test_error_grows_with_the_collision_time_at_second_order(found):
    error = found["error"].values[1:]
    assert (np.diff(error, axis=1) > 0.0).all()
    # at a fixed slow time tau_c t, which t* nearly is
    assert error[:, 1] / error[:, 0] == pytest.approx(100.0, rel=0.2)


@pytest.mark.slow
def test_second_call_computes_nothing(found, store, monkeypatch):
    from triboflux import sweep_runners

    def none(tasks, count):
        assert not list(tasks)
        yield from ()

    monkeypatch.setattr(sweep_runners, "on_processes", none)
    again = suitability(small(), axes=AXES, store_folder=store)
    assert again.identical(found)


@pytest.mark.slow
def test_another_model_reuses_the_full_one(found, store):
    stores = set(store.iterdir())
    told = []
    other = suitability(
        small(), "gradient", AXES, store_folder=store, workers=1, on_progress=told.append
    )
    (new,) = set(store.iterdir()) - stores
    assert new.name.startswith("gradient-")
    np.testing.assert_array_equal(other["stop_time"], found["stop_time"])
    # it has no variance for the electric force to act on
    assert float(other["error"].sel(peclet=1e6, tau_c=1e-3)) > 0.1
    assert told[-1].done == told[-1].total == 14


@pytest.mark.parametrize(("reduced", "reference"), [("algebraic", "full"), ("full", "third-order")])
def test_other_ends_of_runs_have_their_own_status(tmp_path, monkeypatch, reduced, reference):
    endings = {reference: ["ok", "ok", "refused", "diverged"], reduced: ["nonphysical"]}
    asked = []

    def pretend(members, store, **options):
        asked.append(members)
        assert store.name.startswith(f"{members.case['model']}-")
        assert options["retry"] is True
        status = endings[members.case["model"]]
        assert members.size == len(status)
        values = {
            "status": np.array(status, dtype=object),
            "stop_reason": np.array([f"{name} as it is" for name in status], dtype=object),
            "stop_time": np.array([3.0, 7.0, np.nan, 1.0][: len(status)]),
            "charge": np.ones(len(status)),
        }
        return xr.Dataset({name: ("member", entry) for name, entry in values.items()})

    monkeypatch.setattr(suitability_module, "sweep", pretend)
    axes = ("numbers.peclet", [1e6, 1e7]), ("numbers.tau_c", [1e-3, 1e-2])
    given = {"reference": reference, "store_folder": tmp_path, "retry": True}
    made = suitability(small(run__t_end=7.0), reduced, axes, **given)
    status, reason = made["status"].values.ravel(), made["reason"].values.ravel()
    assert list(status) == ["reduced nonphysical", NOT_HALVED, "refused", "diverged"]
    assert list(reason[[0, 2, 3]]) == [f"{name} as it is" for name in ("nonphysical", *status[2:])]
    assert reason[1] == "the largest charge has not halved by t = 7"
    assert np.isnan(made["error"].values).all()
    assert (made.attrs["reduced"], made.attrs["reference"]) == (reduced, reference)
    assert f"Q_reduced - Q_{reference} over" in made.attrs["measure"]
    judge, judged = asked
    assert judge.case["run"]["stop_at_peak_charge"] == 0.5
    assert "stop_at_peak_charge" not in judged.case["run"]
    assert judged.parameters == {
        "numbers.peclet": [1e6],
        "numbers.tau_c": [1e-3],
        "run.t_end": [3.0],
    }


def test_nothing_valid_needs_no_run(tmp_path):
    axes = ("numbers.peclet", [1e2, 1e3]), ("numbers.tau_c", [0.1, 1.0])
    empty = suitability(small(), axes=axes, store_folder=tmp_path)
    assert set(empty["status"].values.ravel()) == {OUTSIDE}
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("closures", "wide", "paper"), [("published", 426, 15), ("derived", 205, 1)]
)
def test_share_of_the_plane_where_the_variance_grows(closures, wide, paper):
    from triboflux.suitability import _outside

    planes = {
        wide: chart_axes(32),
        paper: [
            ("numbers.peclet", list(np.logspace(4, 7, 8))),
            ("numbers.tau_c", list(np.logspace(-4, -1, 8))),
        ],
    }
    for count, axes in planes.items():
        grid = Sweep(case=chart_case(closures), parameters=dict(axes))
        points = [_outside(grid.table(index)) for index in range(grid.size)]
        assert sum(point.status == OUTSIDE for point in points) == count


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"reduced": "semialgebraic"}, "reduced is 'semialgebraic', but must be one of"),
        ({"reduced": "full"}, "reduced is 'full', but must be one of semi-algebraic"),
        ({"reference": "gradient"}, "reduced is 'semi-algebraic', but must be one of collisional"),
        ({"reference": "collisional"}, "reference is 'collisional', but must be one of"),
        ({"axes": AXES[:1]}, "axes must be two different keys"),
        ({"axes": (AXES[0], AXES[0])}, "axes must be two different keys"),
        ({"axes": (AXES[0], ("run.rtol", [1e-6, 1e-5]))}, "axes is 'run.rtol'"),
        ({"axes": (AXES[0], ("numbers.tauc", [1.0, 2.0]))}, "tauc"),
        ({"axes": (AXES[0], ("numbers.tau_c", [0.1, 0.01]))}, "at least two values, positive"),
        ({"axes": (AXES[0], ("numbers.tau_c", [0.1]))}, "at least two values"),
        ({"axes": (AXES[0], ("numbers.tau_c", [0.0, 1.0]))}, "at least two values"),
        ({"case": small(initial__charge=())}, "initial.charge is zero"),
    ],
)
def test_refusals(tmp_path, changes, words):
    given = {"case": small(), "axes": AXES, "store_folder": tmp_path} | changes
    with pytest.raises(InputError) as caught:
        suitability(**given)
    assert words in str(caught.value)


def test_missing_folder_is_refused(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        suitability(small(), axes=AXES, store_folder=tmp_path / "none")


def test_saved_maps_are_read_again(tmp_path):
    made = pretended([[0.1, 0.2, np.nan]] * 3)
    save(made, tmp_path / "map.nc")
    assert load(tmp_path / "map.nc").identical(made)
    with pytest.raises(InputError, match="exists"):
        save(made, tmp_path / "map.nc")
    (tmp_path / "map.txt").write_text("no map")
    with pytest.raises(InputError, match="is no readable NetCDF file"):
        load(tmp_path / "map.txt")
