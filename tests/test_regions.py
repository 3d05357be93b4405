"""Fig. 9 of the paper, with both closure sets: runs, drawing, statements and files."""

import os
import signal
import subprocess
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import psutil
import pytest
from matplotlib.collections import PolyCollection

from tests.cases import fake_result
from tests.maps import pretended, smooth
from tests.processes import command, surroundings
from triboflux.errors import InputError, TribofluxError
from triboflux.figures import CLOSURES, MAP, Reproduction, cases, paper_case, regions
from triboflux.figures.statements import statements
from triboflux.result import Result
from triboflux.suitability import OUTSIDE, RANGES, chart_case
from triboflux.suitability_file import load
from triboflux.sweep import SweepProgress

NAMES = ("fig9.png", "fig9.pdf", "fig9_published.nc", "fig9_derived.nc")


def holed(*names):
    """Return a map in whose first column the points have no error, for given reasons."""
    error, axes = smooth()
    status = np.full(error.shape, "ok", dtype=object)
    for place, name in enumerate(names):
        status[0, place], error[0, place] = name, np.nan
    return pretended(error, status, axes)


def maps(**changed):
    return {closures: holed(OUTSIDE) for closures in CLOSURES} | changed


# ------------------------------------------------------------------ drawing


def hatches(ax):
    """Return hatch and number of cells by status."""
    cells = [c for c in ax.collections if isinstance(c, PolyCollection) and c.get_hatch()]
    return {c.get_label(): (c.get_hatch(), len(c.get_paths())) for c in cells}


def test_each_closure_set_has_its_panel():
    published, derived = holed(OUTSIDE, OUTSIDE, "refused"), holed("refused", "diverged")
    figure = regions.draw({"published": published, "derived": derived})
    panels = figure.axes[:2]
    for ax, dataset in zip(panels, (published, derived), strict=True):
        mesh = ax.collections[0]
        np.testing.assert_array_equal(mesh.get_array().filled(np.nan), dataset["error"].values.T)
        texts = {text.get_text(): text.xy for text in ax.texts}
        assert texts == {"A": (1e6, 1e-4), "B": (1e6, 1e-1)}
        assert ax.get_xlabel() == "$Pe$"
    assert [ax.get_ylabel() for ax in panels] == [r"$\tau_c^*$", ""]
    first, second = map(hatches, panels)
    assert {name: count for name, (_, count) in first.items()} == {OUTSIDE: 2, "refused": 1}
    assert {name: count for name, (_, count) in second.items()} == {"refused": 1, "diverged": 1}
    # one legend serves both
    assert first["refused"][0] == second["refused"][0]
    assert len({first[OUTSIDE][0], first["refused"][0], second["diverged"][0]}) == 3
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["1%", "5%", "10%", "$F \\leq 0$", "refused", "diverged"]
    titles = [ax.get_title(loc="left").splitlines() for ax in panels]
    assert titles[0][0] == r"$\bf{published\ closures}$"
    assert titles[0][1] == r"hatched: 2 $F \leq 0$, 1 refused of 81 points"


@pytest.mark.parametrize("names", [(), (OUTSIDE, "refused", "diverged", "not halved", "failed")])
def test_every_word_fits_the_figure(names):
    figure = regions.draw(maps(published=holed(*names), derived=holed(*names)))
    figure.canvas.draw()
    width, height = figure.canvas.get_width_height()
    assert width == pytest.approx(180.0 / 25.4 * 200, abs=1)
    left, right = figure.axes[:2]
    for artist in (figure._suptitle, *figure.legends, left._left_title, right._left_title):
        box = artist.get_window_extent()
        assert box.x0 >= 0 and box.y0 >= 0 and box.x1 <= width and box.y1 <= height, artist
        assert 7.0 <= getattr(artist, "get_fontsize", lambda: 8.0)() <= 9.0
    assert left._left_title.get_window_extent().x1 < right._left_title.get_window_extent().x0


# ------------------------------------------------------------------ statements


def compared(part):
    """Return a comparison whose reduced model has a part of the full one's charge."""
    full = fake_result(paper_case(1))
    dataset = full.dataset.copy(deep=True)
    dataset["charge"][{"time": -1}] = part * dataset["charge"][{"time": -1}]
    return SimpleNamespace(full=full, reduced=Result(dataset))


def found(dataset, parts=(1.0, 0.0)):
    """Return verdicts and texts of all statements about a map."""
    pairs = [dict.fromkeys(CLOSURES, compared(part)) for part in parts]
    data = {7: pairs[0], 8: pairs[1], MAP: dict.fromkeys(CLOSURES, dataset)}
    findings = [row.findings["derived"] for row in statements(MAP, data)]
    return [f.agrees for f in findings], [f.measured for f in findings]


def tilted(power):
    """Return a map whose error is 0.05 at tau_c = 1e-2 (Pe/1e8)^power, and no hole."""
    error, axes = smooth()
    return pretended(error * (axes[0][1][:, None] / 1e8) ** -power, axes=axes)


@pytest.mark.parametrize(
    ("power", "verdicts"), [(0.0, (True, False)), (0.05, (False, True)), (-0.05, (False, False))]
)
def test_lines_of_equal_error_decide_two_statements(power, verdicts):
    agrees, told = found(tilted(power))
    assert tuple(agrees[1:3]) == verdicts
    assert agrees[3:] == [None, None]
    at_the_end = f"{0.02:.3g} at Pe = 10⁸"
    assert told[1].endswith(at_the_end)
    for level in (0.01, 0.05, 0.1):
        ends = [1e-2 * level / 0.05 * (pe / 1e8) ** power for pe in (1e2, 1e8)]
        assert f"{100 * level:.0f} %: τ_c* = {ends[0]:.3g} at Pe = 1e+02" in told[2]
        assert f"{ends[1]:.3g} at Pe = 1e+08" in told[2]


def test_points_without_error_are_told():
    agrees, told = found(holed(OUTSIDE, OUTSIDE, "refused"))
    assert told[3] == "2 F ≤ 0, 1 refused of 81 points (4 %)"
    # the first Péclet number has its first three points missing, none of the others
    assert told[4].startswith("τ_c* = 0.01 at Pe = 1e+02, 0.01 at Pe = 5.6e+02")
    error, axes = smooth()
    error[:] = np.nan
    agrees, told = found(pretended(error, axes=axes))
    assert agrees[1:3] == [False, False]
    assert told[2] == "1 %: no line; 5 %: no line; 10 %: no line"
    assert told[0] == (
        "A round-off (Fig. 7; nearest point of the map F ≤ 0), "
        "B 100 % (Fig. 8; nearest point of the map F ≤ 0)"
    )


@pytest.mark.parametrize(
    ("parts", "agrees"), [((1.0, 0.0), True), ((0.98, 0.0), False), ((1.0, 0.95), False)]
)
def test_the_papers_cases_lie_on_both_sides(parts, agrees):
    assert found(tilted(0.0), parts)[0][0] is agrees


# ------------------------------------------------------------------ files and runs


@pytest.fixture
def asked(monkeypatch, tmp_path):
    """Replace the computation of maps; return what it was asked for."""
    calls = []
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))

    def suitability(case, reduced, axes, *, store_folder, workers, on_progress):
        calls.append(SimpleNamespace(case=case, reduced=reduced, axes=axes, workers=workers))
        (store_folder / "full.zarr").mkdir()
        for done in (0, 25, 50):
            on_progress(SweepProgress(done, 50, done // 25))
        if workers == 3:
            raise TribofluxError("a worker process does not start.")
        return holed(OUTSIDE)

    monkeypatch.setattr(cases, "suitability", suitability)
    yield calls
    assert list(temporary.iterdir()) == []


def test_both_maps_are_computed_and_written(tmp_path, asked):
    folder, told = tmp_path / "out", []
    folder.mkdir()
    paths = Reproduction(folder, [MAP], workers=2).write(MAP, told.append)
    assert paths == [folder / name for name in NAMES]
    assert sorted(os.listdir(folder)) == sorted(NAMES)
    assert [call.case for call in asked] == [chart_case(closures) for closures in CLOSURES]
    for call in asked:
        assert (call.reduced, call.workers) == ("semi-algebraic", 2)
        ends = {key: (values[0], values[-1]) for key, values in call.axes}
        assert ends == RANGES
        assert [len(values) for _, values in call.axes] == [32, 32]
    assert {progress.total for progress in told} == {2048}
    assert [progress.done for progress in told] == [0, 512, 1024, 1024, 1536, 2048]
    assert [progress.not_ok for progress in told] == [0, 1, 2] * 2
    for name in NAMES[2:]:
        assert load(folder / name).equals(holed(OUTSIDE))


def test_no_folder_is_left_after_an_error(tmp_path, asked):
    with pytest.raises(TribofluxError, match="does not start"):
        Reproduction(tmp_path, [MAP], workers=3).write(MAP)
    assert os.listdir(tmp_path) == ["temporary"]


def test_impossible_number_of_workers_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"^workers is 0, but must be from 1 to "):
        Reproduction(tmp_path, workers=0)


def test_no_temporary_folder_is_told_in_a_sentence(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "none"))
    with pytest.raises(TribofluxError, match=r"^no temporary folder can be made: .*none"):
        Reproduction(tmp_path, [MAP]).write(MAP)


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="needs POSIX signals")
def test_interruption_leaves_nothing(tmp_path):
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    process = subprocess.Popen(
        command(
            *("reproduce", "--figure", "9", "--workers", "1", "-o", "out"),
            code="from triboflux.cli import main; main()",
        ),
        cwd=tmp_path,
        env=surroundings(TMPDIR=str(temporary)),
        stderr=subprocess.PIPE,
        text=True,
    )
    patience = time.monotonic() + 60
    # with chunks of results the runs have begun
    while not list(Path(temporary).glob("triboflux-*/*.zarr/status/c/*")):
        assert process.poll() is None
        assert time.monotonic() < patience
        time.sleep(0.05)
    workers = psutil.Process(process.pid).children(recursive=True)
    assert workers
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert errors == "interrupted: finished figures are kept, nothing else was written\n"
    assert list(temporary.glob("triboflux-*")) == []
    assert os.listdir(tmp_path / "out") == []
    _, alive = psutil.wait_procs(workers, timeout=30)
    assert alive == []
