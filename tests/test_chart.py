"""The chart of a reduced model's error: what is drawn, and the command."""

import os
import signal
import subprocess
import time

import numpy as np
import pytest
import zarr
from matplotlib.collections import PolyCollection

from tests.maps import pretended, small, smooth
from tests.powders import POWDER, TOML
from tests.processes import READS_CACHE_ONLY, command, surroundings, triboflux
from triboflux import numbers, suitability_output
from triboflux.case import Case
from triboflux.errors import InputError
from triboflux.figures import chart
from triboflux.figures.chart import Mark, chart_figure, contour_lines
from triboflux.suitability import OUTSIDE, chart_axes, suitability
from triboflux.suitability_file import load
from triboflux.suitability_output import (
    NAMES,
    Options,
    axes_of,
    nearest_point,
    position,
    summary,
)
from triboflux.suspension import Suspension

MAIN = "from triboflux.cli import main; main()"


# ------------------------------------------------------------------ the chart


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


def test_the_reference_is_named():
    error, axes = smooth()
    made = pretended(error, axes=axes).assign_attrs(reduced="full", reference="third-order")
    caption = " ".join(chart_figure(made).get_suptitle().split())
    assert caption.startswith("Full against third-order model, published closures")
    assert caption.endswith("when the third-order model's peak has halved.")
    assert summary(made)[0].startswith("full against third-order, published closures")


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


def test_a_suspension_is_marked_in_any_plane_of_numbers():
    axes = ("numbers.restitution", [0.5, 0.9, 1.0]), ("numbers.length_ratio", [10.0, 1e3, 1e4])
    made = pretended([[0.1, 0.2, 0.3]] * 3, axes=axes)
    found = numbers.from_suspension(powder(), "published")
    assert position(made, powder()) == (found.restitution, found.length_ratio)
    told = f"the suspension has e = {found.restitution:.3g} and L/d = {found.length_ratio:.3g}; "
    assert nearest_point(made, powder()).startswith(told)
    other = pretended([[0.1, 0.2, 0.3]] * 3, axes=(("exponent", [0.5, 0.8, 1.0]), axes[1]))
    with pytest.raises(InputError, match=r"^suspension can't be marked where 'exponent'"):
        position(other, powder())


def test_axes_of_the_command_line():
    usual = axes_of((None, None), 5)
    assert usual == chart_axes(5)
    first, second = axes_of(("numbers.energy_ratio=1:1e4", "numbers.restitution=0.8,0.9,1"), 5)
    assert first == ("numbers.energy_ratio", [1.0, 10.0, 100.0, 1000.0, 1e4])
    assert second == ("numbers.restitution", [0.8, 0.9, 1.0])


def command_options(folder, **changes):
    """Return what the command line says, for a case of the paper in a small plane."""
    given = {
        "output": folder / "out",
        "case_file": None,
        "reduced": "semi-algebraic",
        "reference": "full",
        "closures": None,
        "points": 3,
        "axes": (None, None),
        "suspension": None,
        "workers": 2,
        "retry": False,
        "overwrite": False,
        "quiet": True,
    }
    return Options(**(given | changes))


@pytest.mark.parametrize(
    ("axes", "frozen"),
    [
        ((None, "numbers.restitution=0.8:1"), True),
        (("suspension.diameter=1e-4:1e-3", "suspension.solid_fraction=0.1:0.5"), False),
    ],
)
def test_a_suspension_varies_only_if_it_is_asked_to(tmp_path, monkeypatch, axes, frozen):
    asked = []

    def pretend(case, reduced, axes, **options):
        asked.append((case, options))
        return pretended(np.full((3, 3), 0.1), axes=axes)

    monkeypatch.setattr(suitability_output, "suitability", pretend)
    (tmp_path / "case.toml").write_text(TOML)
    options = command_options(tmp_path, case_file=tmp_path / "case.toml", axes=axes, retry=True)
    suitability_output.command(options)
    ((case, given),) = asked
    assert given["retry"] is True
    assert given["reference"] == "full"
    assert (case.suspension is None) is frozen
    assert case.numbers == Case.from_toml_text(TOML).numbers
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted([*NAMES, "runs"])


def test_summary_counts():
    errors = [[0.01, 0.04, np.nan], [0.2, 0.001, 0.09], [np.nan] * 3]
    first, second = summary(pretended(errors))
    assert first.endswith("9 points: 5 ok, 4 F <= 0")
    assert second == "error: 2 within 1%, 3 within 5%, 4 within 10%"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--reduced", "full"], "reduced is 'full', but must be one of semi-algebraic"),
        (
            ["--reference", "fuller"],
            "reference is 'fuller', but must be one of self-consistent-flow, ",
        ),
        (["--closures", "printed"], "closures is 'printed'"),
        (["--points", "1"], "points is 1, but must be at least 2"),
        (["--suspension", "none.toml"], "none.toml"),
        (["none.toml"], "none.toml"),
        (["--workers", "0"], "workers is 0, but must be from 1 to"),
        (["--x", "numbers.peclet"], "x is 'numbers.peclet', but must be KEY=FIRST:LAST"),
        (["--x", "numbers.peclet=1:2:3"], "must be KEY=FIRST:LAST or KEY=VALUE,VALUE"),
        (["--y", "numbers.tau_c=1e-2:1e-3"], "its ends must be positive, finite and increasing"),
        (["--y", "numbers.tau_c=2,1"], "at least two values, positive, finite and increasing"),
        (["--y", "numbers.tauc=1:2"], "is not a known key"),
        (["--x", "numbers.tau_c=1:2"], "axes must be two different keys"),
        (["--x", "run.rtol=1e-8:1e-6"], "axes is 'run.rtol', but must be a number of"),
        (
            ["--y", "exponent=0.5:1", "--suspension", "powder.toml"],
            "only in a plane of two numbers",
        ),
        (["-o", "a/b"], "output folder 'a' does not exist"),
        (["-o", "full"], "'full/chart.pdf' exists and is replaced only with --overwrite"),
    ],
)
def test_command_refuses(tmp_path, arguments, words):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "chart.pdf").touch()
    (tmp_path / "powder.toml").write_text(TOML)
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


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="needs POSIX signals")
def test_killed_chart_goes_on_to_the_same_map(tmp_path):
    # runs of many steps, for the chart to last several seconds on a fast machine too
    case = small(run__rtol=1e-12)
    (tmp_path / "case.toml").write_text(case.to_toml())
    plane = ["--x", "numbers.peclet=1e6:1e8", "--y", "numbers.tau_c=1e-3:1e-2", "--points", "4"]
    arguments = ["chart", "case.toml", *plane, "--workers", "1", "-o", "out"]
    process = subprocess.Popen(
        command(*arguments, code=MAIN),
        cwd=tmp_path,
        env=surroundings(**READS_CACHE_ONLY),
        stderr=subprocess.PIPE,
    )
    runs, patience = tmp_path / "out" / "runs", time.monotonic() + 60

    def recorded():
        """Return how many members each store has."""
        return {
            store.name: int((zarr.open_group(store, mode="r")["status"][...] != "").sum())
            for store in runs.glob("*-*.zarr")
        }

    while not any(recorded().values()):
        assert process.poll() is None
        assert time.monotonic() < patience
        time.sleep(0.05)
    process.kill()
    process.communicate()
    assert process.returncode == -signal.SIGKILL
    ((name, kept),) = recorded().items()
    assert name.startswith("full-")
    assert 0 < kept < 16
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["runs"]
    done = triboflux(*arguments, folder=tmp_path, code=MAIN)
    assert done.returncode == 0, done.stderr
    (tmp_path / "whole").mkdir()
    axes = axes_of((plane[1], plane[3]), 4)
    whole = suitability(case, axes=axes, store_folder=tmp_path / "whole", workers=2)
    assert load(tmp_path / "out" / "chart.nc").identical(whole)
    assert set(whole["status"].values.ravel()) == {"ok"}
