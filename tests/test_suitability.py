"""Where a reduced model is good enough: errors, points without one, the chart, the command."""

import sys

import numpy as np
import pytest
import xarray as xr
from matplotlib.collections import PolyCollection

from tests.powders import POWDER, TOML
from tests.processes import triboflux
from triboflux import numbers
from triboflux.case import Case
from triboflux.errors import InputError
from triboflux.figures import chart
from triboflux.figures.chart import Mark, chart_figure, contour_lines
from triboflux.solve import solve
from triboflux.suitability import (
    MEASURE,
    NOT_HALVED,
    OUTSIDE,
    chart_axes,
    chart_case,
    load,
    save,
    suitability,
)
from triboflux.suitability_output import NAMES, nearest_point, summary
from triboflux.suspension import Suspension
from triboflux.sweep import Sweep
from triboflux.sweep_values import put

MAIN = "from triboflux.cli import main; main()"
PECLET, TAU_C = [1e4, 1e6, 1e7], [1e-3, 1e-2, 1e-1]
AXES = (("numbers.peclet", PECLET), ("numbers.tau_c", TAU_C))


# the package gives the function that is named like it
suitability_module = sys.modules["triboflux.suitability"]


def small(**changes):
    """Return the chart's case on few points, with ``a__b=value`` for changes in tables."""
    tables = chart_case("published").model_dump()
    for key, value in ({"grid__points": (32,)} | changes).items():
        put(tables, key.replace("__", "."), value)
    return Case(**tables)


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="module")
def found(store):
    """Return a map of nine points with the published closures."""
    return suitability(small(), axes=AXES, store_folder=store, workers=1)


def pretended(error, status=None, axes=AXES, **changes):
    """Return a map with given errors; status follows from them."""
    error = np.asarray(error, dtype=float)
    if status is None:
        status = np.where(np.isnan(error), OUTSIDE, "ok").astype(object)
    names = [key.rpartition(".")[2] for key, _ in axes]
    coordinates = {
        name: (name, np.asarray(values), {"parameter": key})
        for name, (key, values) in zip(names, axes, strict=True)
    }
    attributes = {
        "reduced": "semi-algebraic",
        "closures": "published",
        "measure": MEASURE,
        "case": small(**changes).to_toml(),
        "versions": "{}",
    }
    texts = np.asarray(status, dtype=object)
    variables = {
        "error": (names, error),
        "stop_time": (names, error),
        "status": (names, texts),
        "reason": (names, texts),
    }
    return xr.Dataset(variables, coordinates, attributes)


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


def test_other_ends_of_runs_have_their_own_status(tmp_path, monkeypatch):
    endings = {
        "full": ["ok", "ok", "refused", "diverged"],
        "algebraic": ["nonphysical"],
    }
    asked = []

    def pretend(members, store, **_):
        asked.append(members)
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
    made = suitability(small(run__t_end=7.0), "algebraic", axes, store_folder=tmp_path)
    status, reason = made["status"].values.ravel(), made["reason"].values.ravel()
    assert list(status) == ["reduced nonphysical", NOT_HALVED, "refused", "diverged"]
    assert list(reason[[0, 2, 3]]) == [f"{name} as it is" for name in ("nonphysical", *status[2:])]
    assert reason[1] == "the largest charge has not halved by t = 7"
    assert np.isnan(made["error"].values).all()
    full, algebraic = asked
    assert full.case["run"]["stop_at_peak_charge"] == 0.5
    assert "stop_at_peak_charge" not in algebraic.case["run"]
    assert algebraic.parameters == {
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
    with pytest.raises(InputError, match="can't be read"):
        load(tmp_path / "map.txt")


# ------------------------------------------------------------------ the chart


def smooth(count=9):
    """Return a map whose error is 0.05 where tau_c is 1e-2."""
    tau_c = np.logspace(-4, 0, count)
    error = np.tile(0.05 * (tau_c / 1e-2), (count, 1))
    axes = ("numbers.peclet", np.logspace(2, 8, count)), ("numbers.tau_c", tau_c)
    return error, axes


def test_contours_are_exact_for_powers():
    error, axes = smooth()
    for level in chart.LEVELS:
        (line,) = contour_lines(pretended(error, axes=axes), level)
        np.testing.assert_allclose(line[:, 1], 1e-2 * level / 0.05, rtol=1e-9)
        np.testing.assert_allclose(np.sort(line[:, 0])[[0, -1]], [1e2, 1e8])


def test_contours_do_not_cross_points_without_error():
    error, axes = smooth()
    # a hole beside the line 0.05 at tau_c = 1e-2
    error[4, 4] = np.nan
    lines = contour_lines(pretended(error, axes=axes), 0.04)
    assert len(lines) == 2
    peclet = axes[0][1]
    for line in lines:
        inside = (line[:, 0] > peclet[3] * 1.001) & (line[:, 0] < peclet[5] * 0.999)
        assert not inside.any()


def hatched(figure):
    """Return the number of hatched cells by status."""
    cells = [
        c for c in figure.axes[0].collections if isinstance(c, PolyCollection) and c.get_hatch()
    ]
    assert len({c.get_hatch() for c in cells}) == len(cells)
    return {c.get_label(): len(c.get_paths()) for c in cells}


def test_points_without_error_are_hatched_and_counted():
    error, axes = smooth()
    status = np.full(error.shape, "ok", dtype=object)
    status[0, :5], status[1, :2], error[:2, :5] = OUTSIDE, "refused", np.nan
    status[1, 2:5] = "refused"
    figure = chart_figure(pretended(error, status, axes))
    assert hatched(figure) == {OUTSIDE: 5, "refused": 5}
    caption = " ".join(figure.get_suptitle().split())
    assert "5 $F \\leq 0$, 5 refused of 81 points (12%)" in caption
    assert "published closures" in caption
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["1%", "5%", "10%", "$F \\leq 0$", "refused"]
    (mesh,) = [c for c in figure.axes[0].collections if not isinstance(c, PolyCollection)]
    np.testing.assert_array_equal(np.ma.getmaskarray(mesh.get_array()), np.isnan(error).T)


def marks_of(figure):
    return {text.get_text(): text.xy for text in figure.axes[0].texts}


def test_the_papers_cases_are_marked_where_they_belong():
    error, axes = smooth()
    figure = chart_figure(pretended(error, axes=axes), {"S": Mark((1e5, 1e-3), "a powder")})
    assert marks_of(figure) == {"A": (1e6, 1e-4), "B": (1e6, 1e-1), "S": (1e5, 1e-3)}
    assert figure.get_suptitle().endswith("S: a powder")
    other = pretended(error, axes=axes, numbers__energy_ratio=3.0)
    assert not marks_of(chart_figure(other))
    swapped = ("numbers.tau_c", axes[1][1]), ("numbers.peclet", axes[0][1])
    assert not marks_of(chart_figure(pretended(error, axes=swapped)))


@pytest.mark.parametrize("status", ["ok", OUTSIDE])
def test_every_word_fits_the_figure(status):
    error, axes = smooth()
    if status != "ok":
        error[:] = np.nan
    figure = chart_figure(pretended(error, axes=axes), {"S": Mark((1e5, 1e-3), "powder " * 30)})
    figure.canvas.draw()
    width, height = figure.canvas.get_width_height()
    texts = [figure._suptitle, *figure.legends, figure.axes[0].yaxis.label]
    for artist in texts:
        box = artist.get_window_extent()
        assert box.x0 >= 0 and box.y0 >= 0 and box.x1 <= width and box.y1 <= height, artist
    assert figure.axes[0].get_window_extent().height > 0.4 * width


# ------------------------------------------------------------------ the command


def powder(**changes):
    return Suspension(**POWDER | changes)


def test_the_nearest_point_is_told():
    error, axes = smooth()
    place = numbers.from_suspension(powder(), "published")
    column = np.abs(np.log(axes[0][1] / place.peclet)).argmin()
    row = np.abs(np.log(axes[1][1] / place.tau_c)).argmin()
    error[column, row] = 0.0123
    made = pretended(error, axes=axes)
    assert nearest_point(made, powder()).endswith(
        f"Pe = {axes[0][1][column]:.3g} and tau_c = {axes[1][1][row]:.3g}: error 0.012"
    )
    error[column, row] = np.nan
    assert nearest_point(pretended(error, axes=axes), powder()).endswith("no error: F <= 0")
    # particles that hardly collide
    assert nearest_point(made, powder(solid_fraction=1e-9)).endswith(", outside the chart")


def test_summary_counts():
    errors = [[0.01, 0.04, np.nan], [0.2, 0.001, 0.09], [np.nan] * 3]
    first, second = summary(pretended(errors))
    assert first.endswith("9 points: 5 ok, 4 F <= 0")
    assert second == "error: 2 within 1%, 3 within 5%, 4 within 10%"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--reduced", "full"], "reduced is 'full', but must be one of semi-algebraic"),
        (["--closures", "printed"], "closures is 'printed'"),
        (["--points", "1"], "points is 1, but must be at least 2"),
        (["--suspension", "none.toml"], "none.toml"),
        (["none.toml"], "none.toml"),
        (["-o", "a/b"], "output folder 'a' does not exist"),
        (["-o", "full"], "'full/chart.pdf' exists and is replaced only with --overwrite"),
    ],
)
def test_command_refuses(tmp_path, arguments, words):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "chart.pdf").touch()
    output = [] if "-o" in arguments else ["-o", "out"]
    done = triboflux("chart", *arguments, *output, folder=tmp_path)
    assert done.returncode == 1, done.stderr
    assert words in done.stderr
    assert done.stderr.startswith("error: ")
    assert done.stderr.splitlines()[1:] == ["[]"]
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_command_writes_all_files_and_resumes(tmp_path):
    (tmp_path / "case.toml").write_text(small().to_toml())
    (tmp_path / "powder.toml").write_text(TOML)
    arguments = ["case.toml", "--points", "3", "--suspension", "powder.toml", "-o", "out"]
    options = ["--workers", "1", "--closures", "derived"]
    done = triboflux("chart", *arguments, *options, folder=tmp_path, code=MAIN)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0].startswith("semi-algebraic against full, derived closures: 9 points: ")
    assert lines[2].startswith("the suspension has Pe = ")
    out = tmp_path / "out"
    assert sorted(path.name for path in out.iterdir()) == sorted([*NAMES, "runs"])
    assert (out / "chart.png").read_bytes()[:4] == b"\x89PNG"
    assert (out / "chart.pdf").read_bytes()[:4] == b"%PDF"
    made = load(out / "chart.nc")
    assert made["error"].shape == (3, 3)
    np.testing.assert_array_equal(np.isnan(made["error"]), made["status"] != "ok")
    assert Case.from_toml_text(made.attrs["case"]).closures == "derived"
    before = sorted((out / "runs").rglob("*"))
    again = triboflux("chart", *arguments, *options, "--overwrite", folder=tmp_path, code=MAIN)
    assert again.stdout == done.stdout
    assert sorted((out / "runs").rglob("*")) == before
    assert load(out / "chart.nc").identical(made)
