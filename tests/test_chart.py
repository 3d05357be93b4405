"""The chart of a reduced model's error: what is drawn, and the command."""

import numpy as np
import pytest
from matplotlib.collections import PolyCollection

from tests.maps import pretended, small, smooth
from tests.powders import POWDER, TOML
from tests.processes import triboflux
from triboflux import numbers
from triboflux.case import Case
from triboflux.figures import chart
from triboflux.figures.chart import Mark, chart_figure, contour_lines
from triboflux.suitability import OUTSIDE, load
from triboflux.suitability_output import NAMES, nearest_point, summary
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
