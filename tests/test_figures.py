"""The paper's figures: what is drawn is what was computed, and all files come or none."""

import dataclasses
import itertools
import os
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr
from matplotlib import _pylab_helpers
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from tests.cases import data, fake_result
from tests.fields import CASE_A, CASE_B
from tests.paper_runs import CASES, changed, paper_run
from triboflux import figures
from triboflux.case import Case
from triboflux.errors import InputError, TribofluxError
from triboflux.figures import PAPER_TIMES, figure_one, figure_two, paper_case, reproduce
from triboflux.numbers import Numbers
from triboflux.result import Result, load
from triboflux.solve import Progress

VARIABLES = ("charge", "field", "covariance", "variance")
EXAMPLES = Path(__file__).resolve().parents[1] / "examples"


def fake_pair(number=1, **changes):
    """Return made-up results of both closure sets on few points."""
    small = {"grid__points": (8,)} | changes
    return [
        fake_result(changed(paper_case(number, closures), **small))
        for closures in ("published", "derived")
    ]


def with_last(result, **fields):
    """Return a result whose last fields are replaced."""
    dataset = result.dataset.copy(deep=True)
    for name, values in fields.items():
        dataset[name][{"time": -1}] = values
    return Result(dataset)


def profile(result, variable, time=-1):
    values = result.dataset[variable].isel(time=time)
    return (values.isel(component=0) if "component" in values.dims else values).values


def curves(ax):
    """Return the lines that show data, not the line at zero."""
    return [line for line in ax.lines if len(line.get_xdata()) > 2]


# ------------------------------------------------------------------ cases


@pytest.mark.parametrize("number", [1, 2])
def test_examples_are_the_packaged_cases(number):
    packaged = Path(figures.__file__).parents[1] / "cases" / f"fig{number}.toml"
    assert (EXAMPLES / packaged.name).read_bytes() == packaged.read_bytes()
    assert Case.from_toml(packaged) == paper_case(number)


@pytest.mark.parametrize(("number", "numbers"), [(1, CASE_A), (2, CASE_B)])
def test_cases_are_those_of_the_paper(number, numbers):
    case = paper_case(number)
    assert (case.model, case.closures) == ("full", "published")
    assert case.numbers == Numbers(**numbers)
    assert case.initial.charge[0].model_dump() == {"mode": (1,), "sine": -1.0, "cosine": 0.0}
    assert (len(case.initial.charge), case.initial.covariance, case.initial.variance) == (1, (), ())
    assert (case.grid.points, case.grid.lengths) == ((128,), (1.0,))
    assert case.run.stop_at_peak_charge == 0.5
    derived = paper_case(number, "derived")
    assert derived == changed(case, closures="derived") != case


@pytest.mark.parametrize("number", [0, 10])
def test_other_figures_are_refused(tmp_path, number):
    sentence = rf"^figure is {number}, but must be one of 1, 2, 3, 4, 5, 6, 7, 8, 9\.$"
    with pytest.raises(InputError, match=sentence):
        reproduce(number, tmp_path)
    with pytest.raises(InputError, match=rf"^figure is {number}, but must be one of 1, 2\.$"):
        paper_case(number)
    with pytest.raises(InputError, match="Did you mean 'derived'"):
        paper_case(1, "derive")
    assert os.listdir(tmp_path) == []


# ------------------------------------------------------------------ what is drawn


@pytest.mark.parametrize("points", [8, 9])
@pytest.mark.parametrize("draw", [figure_one, figure_two])
def test_lines_hold_the_last_fields(draw, points):
    results = fake_pair(grid__points=(points,), grid__lengths=(2.0,))
    axes = draw(*results).axes
    for ax, variable in zip(axes, VARIABLES, strict=True):
        lines = curves(ax)
        expected = [profile(result, variable) for result in results]
        if variable == "charge":
            expected.insert(0, profile(results[0], variable, time=0))
        for line, values in zip(lines, expected, strict=True):
            x, y = line.get_xdata(), line.get_ydata()
            np.testing.assert_allclose(x[[0, -1]], [-1.0, 1.0], atol=2.0 / points)
            assert x[-1] - x[0] == pytest.approx(2.0)
            assert y[-1] == y[0]
            np.testing.assert_allclose(np.diff(x), 2.0 / points)
            place = np.round(np.mod(x[:-1], 2.0) / 2.0 * points).astype(int) % points
            np.testing.assert_array_equal(y[:-1], values[place])
            assert sorted(place) == list(range(points))


def test_panels_are_lettered_and_scaled():
    figure = figure_one(*fake_pair())
    titles = [ax.get_title(loc="left") for ax in figure.axes]
    assert [title[:3] for title in titles] == ["(a)", "(b)", "(c)", "(d)"]
    words = ["mean charge", "electric field", "covariance", "variance"]
    assert all(word in title for word, title in zip(words, titles, strict=True))
    labels = [ax.get_ylabel() for ax in figure.axes]
    scales = ["/Q_0", r"\varepsilon_0/(n_p Q_0 L)", r"/(Q_0\sqrt{\Theta_p})", "/Q_0^2"]
    assert all(scale in label for scale, label in zip(scales, labels, strict=True))
    assert figure.get_size_inches()[0] * 25.4 == pytest.approx(180.0)
    for text in figure.findobj(mpl.text.Text):
        assert 7.0 <= text.get_fontsize() <= 9.0 or not text.get_text()


def test_closure_sets_differ_in_colour_and_dashes():
    figure = figure_one(*fake_pair())
    _, published, derived = curves(figure.axes[0])
    assert (to_hex(published.get_color()), published.get_linestyle()) == ("#0072b2", "-")
    assert (to_hex(derived.get_color()), derived.get_linestyle()) == ("#d55e00", "--")
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts == [
        "initial charge",
        "published closures, $t^*$ = 200.00",
        "derived closures, $t^*$ = 200.00",
    ]
    alone = figure_one(fake_pair()[1])
    assert len(curves(alone.axes[3])) == 1
    assert to_hex(curves(alone.axes[3])[0].get_color()) == "#d55e00"


@pytest.mark.parametrize(("number", "tau_c"), [(1, "$10^{-4}$"), (2, "0.1")])
def test_caption_tells_the_case_and_the_papers_time(number, tau_c):
    caption = (figure_one, figure_two)[number - 1](*fake_pair(number)).get_suptitle()
    assert caption.startswith(f"Full model, $\\tau_c^*$ = {tau_c}, when max $|Q_p^*|$ = 0.5 (")
    assert f"$t^* \\approx$ {PAPER_TIMES[number]})" in caption


def test_caption_claims_nothing_of_other_cases():
    results = fake_pair(numbers__tau_c=0.02)
    caption = figure_one(*results).get_suptitle()
    assert "= 0.02, when" in caption
    assert "paper" not in caption
    results[0].dataset["peak_charge"][-1] = 0.7
    assert "at the last times" in figure_one(*results).get_suptitle()


def test_impossible_moments_are_told():
    good = {"covariance": 0.1, "variance": 0.5, "realizability_margin": 0.49}
    results = [with_last(result, **good) for result in fake_pair()]
    assert "realizable" not in figure_one(*results).get_suptitle()
    results[1].dataset["realizability_margin"][-1, :2] = -0.1
    told = figure_one(*results).get_suptitle().splitlines()[1]
    assert told.startswith("Not realizable, ")
    assert told.endswith("in 25% of the box (derived)")


def test_flat_variance_is_enlarged():
    results = fake_pair()
    wave = np.cos(np.arange(8))
    pair = [with_last(r, variance=v) for r, v in zip(results, (4 + wave, 0.01 * wave), strict=True)]
    axes = figure_one(*pair).axes[3]
    (inset,) = axes.child_axes
    (line,) = inset.lines
    np.testing.assert_array_equal(line.get_ydata(), curves(axes)[1].get_ydata())
    assert line.get_color() == curves(axes)[1].get_color()
    # where there is no room, or nothing flat
    for variances in ((4 + 4 * wave, 0.01 * wave), (4 + wave, 1 + wave), (0 * wave, 0 * wave)):
        pair = [with_last(r, variance=v) for r, v in zip(results, variances, strict=True)]
        assert not figure_one(*pair).axes[3].child_axes


def test_what_can_not_be_shown_is_refused():
    with pytest.raises(InputError, match=r"^results is empty, but Fig\. 1 needs at least one\.$"):
        figure_one()
    plane = fake_result(Case(**data(grid__points=[4, 4], initial__charge=[])))
    with pytest.raises(InputError, match=r"results has one in 2 dimensions, but Fig\. 2 shows"):
        figure_two(plane)
    with pytest.raises(InputError, match="results differ in their numbers or boxes"):
        figure_one(fake_pair(1)[0], fake_pair(2)[0])


def test_global_state_of_matplotlib_is_kept(tmp_path):
    with mpl.rc_context({"font.size": 30.0, "lines.linewidth": 7.0}):
        before = dict(mpl.rcParams)
        figure = figure_one(*fake_pair())
        figure.savefig(tmp_path / "a.png")
        assert dict(mpl.rcParams) == before
    assert _pylab_helpers.Gcf.figs == {}
    assert curves(figure.axes[0])[-1].get_linewidth() < 2.0
    assert figure.axes[0].xaxis.label.get_fontsize() < 10.0


# ------------------------------------------------------------------ files

NAMES = ("fig1.png", "fig1.pdf", "fig1_published.nc", "fig1_derived.nc")


@pytest.fixture
def solved(monkeypatch):
    """Replace the solver; return the list of the cases that it is given."""
    cases = []

    def solve(case, *, on_progress=None):
        cases.append(case)
        for fraction in (0.0, 0.5, 1.0) if on_progress else ():
            on_progress(Progress(0.0, 1.0, 1, 0, 1.0, fraction))
        return fake_result(case)

    module = ModuleType("triboflux.solve")
    module.solve = solve
    monkeypatch.setitem(sys.modules, "triboflux.solve", module)
    return cases


def test_all_files_are_written(tmp_path, solved):
    seen = []
    paths = reproduce(1, tmp_path, on_progress=seen.append)
    assert paths == [tmp_path / name for name in NAMES]
    assert sorted(os.listdir(tmp_path)) == sorted(NAMES)
    assert solved == [paper_case(1, closures) for closures in ("published", "derived")]
    height, width, _ = mpl.image.imread(tmp_path / "fig1.png").shape
    assert width == pytest.approx(180.0 / 25.4 * 200, abs=1)
    assert height == pytest.approx(125.0 / 25.4 * 200, abs=1)
    assert (tmp_path / "fig1.pdf").read_bytes().startswith(b"%PDF")
    for case, name in zip(solved, NAMES[2:], strict=True):
        again = load(tmp_path / name)
        assert again.case == case
        xr.testing.assert_equal(again.dataset, fake_result(case).dataset)
    assert [progress.fraction for progress in seen] == [0.0, 0.25, 0.5, 0.5, 0.75, 1.0]


def test_the_same_result_gives_the_same_files(tmp_path, solved):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        reproduce(2, tmp_path / folder)
    for name in ("fig2.png", "fig2.pdf"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


@pytest.mark.parametrize("name", NAMES)
def test_existing_files_are_kept_unless_asked(tmp_path, solved, name):
    (tmp_path / name).write_text("precious")
    with pytest.raises(InputError, match=rf"{name}' exists and is replaced only with --overwrite"):
        reproduce(1, tmp_path)
    assert solved == []
    assert os.listdir(tmp_path) == [name]
    assert (tmp_path / name).read_text() == "precious"


def test_a_stale_folder_is_renewed(tmp_path, solved):
    for name in (*NAMES, "fig2.png", "notes.txt"):
        (tmp_path / name).write_text("old")
    reproduce(1, tmp_path, overwrite=True)
    assert sorted(os.listdir(tmp_path)) == sorted((*NAMES, "fig2.png", "notes.txt"))
    stale = {name for name in os.listdir(tmp_path) if (tmp_path / name).read_bytes() == b"old"}
    assert stale == {"fig2.png", "notes.txt"}


def test_missing_folder_is_refused_before_any_run(tmp_path, solved):
    with pytest.raises(InputError, match=r"^output folder '.*none' does not exist\.$"):
        reproduce(1, tmp_path / "none")
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"^output folder '.*file' is not a folder\.$"):
        reproduce(1, tmp_path / "file")
    assert solved == []
    assert os.listdir(tmp_path) == ["file"]


@pytest.mark.parametrize("owner", [Figure, Result])
@pytest.mark.parametrize("calls", [1, 2])
def test_failed_writing_changes_nothing(tmp_path, solved, monkeypatch, owner, calls):
    method = "savefig" if owner is Figure else "to_netcdf"
    write, count = getattr(owner, method), itertools.count(1)

    def fail(self, path, **options):
        write(self, path, **options)
        if next(count) == calls:
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(owner, method, fail)
    for name in NAMES:
        (tmp_path / name).write_text("precious")
    name = NAMES[calls - 1 if owner is Figure else calls + 1]
    with pytest.raises(TribofluxError, match=rf"^output '.*{name}' can't be written: .*No space"):
        reproduce(1, tmp_path, overwrite=True)
    assert sorted(os.listdir(tmp_path)) == sorted(NAMES)
    assert {(tmp_path / name).read_text() for name in NAMES} == {"precious"}


def test_a_failed_run_is_told(tmp_path, monkeypatch):
    def solve(case, *, on_progress=None):
        return fake_result(case, status="diverged", stop_reason="the step size collapsed")

    monkeypatch.setitem(sys.modules, "triboflux.solve", SimpleNamespace(solve=solve))
    sentence = "^the run with published closures ended as diverged: the step size collapsed.$"
    with pytest.raises(TribofluxError, match=sentence):
        reproduce(1, tmp_path)
    assert os.listdir(tmp_path) == []


# ------------------------------------------------------------------ what the paper says


def test_reproduced_time_is_the_papers(tmp_path):
    seen = []
    reproduce(2, tmp_path, on_progress=seen.append)
    fractions = [progress.fraction for progress in seen]
    assert fractions == sorted(fractions)
    assert fractions[-1] == pytest.approx(1.0, abs=1e-6)
    assert all(dataclasses.is_dataclass(progress) for progress in seen)
    published, derived = (load(tmp_path / f"fig2_{name}.nc") for name in ("published", "derived"))
    time = float(published.dataset["time"][-1])
    assert time == pytest.approx(0.165301694345, rel=1e-6)
    assert time == pytest.approx(float(PAPER_TIMES[2]), rel=0.04)
    assert float(derived.dataset["time"][-1]) == pytest.approx(0.188441749325, rel=1e-6)


def maxima(values):
    """Return how many local maxima a periodic profile has."""
    return int(np.sum((values > np.roll(values, 1)) & (values >= np.roll(values, -1))))


@pytest.mark.parametrize(("number", "closures"), CASES)
def test_profiles_have_the_papers_shape(number, closures):
    result = paper_run(number, closures)
    charge, field, covariance, variance = (profile(result, name) for name in VARIABLES)
    mirrored = (-np.arange(128)) % 128
    scales = (charge, field, covariance, variance)
    signs = (-1, 1, 1, 1)
    for values, sign in zip(scales, signs, strict=True):
        np.testing.assert_allclose(values[mirrored], sign * values, atol=1e-9 * np.ptp(values))
    # positive on the left of a box from -1/2 to 1/2, as the paper has it
    assert charge[96] == pytest.approx(0.5, rel=1e-5) == -charge[32]
    assert [maxima(v) for v in (charge, field, covariance)] == [1, 1, 1]
    # the variance and the size of the covariance have two maxima, at the same places
    assert maxima(variance) == maxima(np.abs(covariance)) == 2
    for values in (variance, np.abs(covariance)):
        assert {0, 64} == {int(i) for i in np.flatnonzero(values > 0.999999 * values.max())}


def test_published_charge_is_no_longer_a_sine():
    x = np.arange(128) / 128
    for number in (1, 2):
        deviations = {}
        for closures in ("published", "derived"):
            charge = profile(paper_run(number, closures), "charge")
            deviations[closures] = np.max(np.abs(charge + 0.5 * np.sin(2 * np.pi * x)))
        assert deviations["published"] > 0.1
        assert deviations["derived"] < deviations["published"]


@pytest.mark.parametrize("closures", ["published", "derived"])
def test_covariance_grows_with_the_collision_time(closures):
    frequent, rare = (profile(paper_run(n, closures), "covariance") for n in (1, 2))
    assert np.max(rare) > 500 * np.max(frequent)
