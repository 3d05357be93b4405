"""All of the paper's figures in one go: data, lines, statements, summary and files."""

import os
import sys
from html.parser import HTMLParser
from importlib import import_module
from itertools import pairwise
from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr

from tests.cases import fake_result
from tests.paper_runs import changed
from triboflux import models
from triboflux.errors import InputError, TribofluxError
from triboflux.figures import CLOSURES, Reproduction, paper_case, regions, style, summary
from triboflux.figures import budgets as budget_figures
from triboflux.figures import closure as closure_figure
from triboflux.figures import comparison as comparison_figures
from triboflux.figures.cases import Runs, until
from triboflux.figures.measures import distances
from triboflux.figures.statements import Finding, Statement, statements
from triboflux.result import load
from triboflux.suitability import OUTSIDE
from triboflux.suitability_file import load as load_map

VARIABLES = ("charge", "field", "covariance", "variance")
COMPARED = {3: "gradient", 7: "semi-algebraic", 8: "semi-algebraic"}
PAIRS = {n: [f"{c}_{m}" for c in CLOSURES for m in ("full", COMPARED[n])] for n in COMPARED}
DATA = {
    **dict.fromkeys((1, 2, 4, 5), CLOSURES),
    6: [f"{letter}_{closures}" for letter in "ab" for closures in CLOSURES],
    **PAIRS,
    9: CLOSURES,
}
NAMES = {
    f"fig{number}{ending}"
    for number, names in DATA.items()
    for ending in (".png", ".pdf", *(f"_{name}.nc" for name in names))
} | {"summary.md", "summary.html"}


@pytest.fixture(scope="module")
def everything(tmp_path_factory):
    """Return folder, data and run cases of one reproduction of all figures."""
    folder, cases = tmp_path_factory.mktemp("reproduction"), []
    # the package's attribute of this name is the function
    module = import_module("triboflux.solve")
    solve = module.solve

    def counted(case, **options):
        cases.append(case)
        return solve(case, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "solve", counted)
        patch.setattr(style, "DOTS_PER_INCH", 60)
        patch.setattr(regions, "POINTS", 4)
        reproduction = Reproduction(folder, workers=1)
        for number in reproduction.numbers:
            reproduction.write(number)
        reproduction.write_summary()
    return SimpleNamespace(folder=folder, data=reproduction._data, cases=cases)


def rows(everything, number):
    return statements(number, everything.data)


def verdicts(everything, number):
    """Return agreement with every statement, for published and derived."""
    return [tuple(row.findings[c].agrees for c in CLOSURES) for row in rows(everything, number)]


def lines_of(ax):
    return {line.get_label(): line for line in ax.lines if len(line.get_xdata()) > 2}


# ------------------------------------------------------------------ files and runs


@pytest.mark.slow
def test_every_figure_has_all_of_its_files(everything):
    assert set(os.listdir(everything.folder)) == NAMES
    for number in DATA:
        assert (everything.folder / f"fig{number}.pdf").read_bytes().startswith(b"%PDF")
        _, width, _ = mpl.image.imread(everything.folder / f"fig{number}.png").shape
        assert width == pytest.approx(180.0 / 25.4 * 60, abs=1)


def test_no_case_runs_twice(everything):
    texts = [case.to_toml() for case in everything.cases]
    assert len(texts) == len(set(texts)) == 24
    assert {case.model for case in everything.cases} == {"full", "algebraic", *COMPARED.values()}


# ------------------------------------------------------------------ Figs. 3, 7 and 8


@pytest.mark.parametrize("number", COMPARED)
@pytest.mark.parametrize("closures", CLOSURES)
def test_models_are_compared_at_the_time_of_the_full_one(everything, number, closures):
    stem = everything.folder / f"fig{number}_{closures}"
    full, reduced = (load(f"{stem}_{model}.nc") for model in ("full", COMPARED[number]))
    assert full.case == paper_case(1 if number == 7 else 2, closures)
    assert (reduced.case.model, reduced.case.closures) == (COMPARED[number], closures)
    assert reduced.case.numbers == full.case.numbers
    times = full.dataset["time"].values, reduced.dataset["time"].values
    assert times[0][-1] == times[1][-1]
    assert float(full.dataset["peak_charge"][-1]) == pytest.approx(0.5, abs=1e-6)
    # the early output too, at which the gradient model's covariance is judged
    assert times[0][1] == times[1][1]


@pytest.mark.parametrize("number", COMPARED)
def test_compared_lines_carry_the_solvers_numbers(everything, number):
    figure = comparison_figures.draw(number, everything.data[number])
    axes = np.reshape(figure.axes, (4, 2))
    for column, closures in enumerate(CLOSURES):
        stem = everything.folder / f"fig{number}_{closures}"
        for model in ("full", COMPARED[number]):
            result = load(f"{stem}_{model}.nc")
            for ax, variable in zip(axes[:, column], VARIABLES, strict=True):
                found = lines_of(ax)
                if variable == "variance" and model == "gradient":
                    assert "gradient model" not in found
                    continue
                values = np.squeeze(result.dataset[variable].values[-1])
                line = found[f"{model} model"]
                np.testing.assert_array_equal(line.get_ydata()[:-1], np.roll(values, 64))
                assert tuple(line.get_xdata()[[0, 64, 128]]) == (-0.5, 0.0, 0.5)


@pytest.mark.parametrize(
    ("number", "times"),
    [
        (3, (0.116986, 0.115918)),
        (7, (49.14299, 107.95598)),
        (8, (0.048347, 0.048056)),
    ],
)
def test_reduced_models_halve_the_charge_when_they_should(everything, number, times):
    found = [float(everything.data[number][c].halved.dataset["time"][-1]) for c in CLOSURES]
    np.testing.assert_allclose(found, times, rtol=2e-5)


def test_statements_about_compared_models(everything):
    assert verdicts(everything, 3) == [(True, True)] * 4 + [(None, None)]
    assert verdicts(everything, 7) == [(True, True), (True, True), (None, None)]
    assert verdicts(everything, 8) == [(True, True)] * 3 + [(None, None)]
    for closures in CLOSURES:
        _, reduced, _ = everything.data[7][closures]
        worst = max(
            d.largest for d in distances(reduced, everything.data[7][closures].full).values()
        )
        assert 0.0 < worst < 2e-5
    assert "charge 97.2 % / " in rows(everything, 8)[0].findings["published"].measured
    broken = rows(everything, 8)[2].findings["published"].measured
    assert broken.endswith("covariance² > V in 100 % of the box at the start, 0 % at the end")


# ------------------------------------------------------------------ Figs. 4 and 5

GROUPS = {
    "charge": {"kinetic flux", "collisional dispersion"},
    "covariance": {"production", "electric force", "destruction", "dispersion"},
    "variance": {"production by", "destruction", "collisional dispersion", "kinetic dispersion"},
}


@pytest.mark.parametrize("number", [4, 5])
@pytest.mark.parametrize("closures", CLOSURES)
def test_budgets_sum_to_the_measured_rate(everything, number, closures):
    with xr.open_dataset(everything.folder / f"fig{number}_{closures}.nc") as terms:
        time = float(everything.data[number - 3][closures].dataset["time"][-1])
        assert float(terms["time"]) == time
        for moment in GROUPS:
            total = terms[moment].sum(f"{moment}_term")
            largest = float(np.abs(terms[moment]).max())
            np.testing.assert_array_equal(total, terms[f"{moment}_rate"])
            measured = terms[f"{moment}_rate_measured"]
            np.testing.assert_allclose(measured, total, rtol=0, atol=1e-7 * largest)
            scale = float(np.abs(measured).max())
            np.testing.assert_allclose(measured, total, rtol=0, atol=2e-4 * scale)


@pytest.mark.parametrize("number", [4, 5])
def test_budget_lines_are_the_groups(everything, number):
    figure = budget_figures.draw(number, everything.data[number])
    panels = [ax for ax in figure.axes if ax.get_title(loc="left")]
    legends = [ax.get_legend() for ax in figure.axes if ax.get_legend()]
    assert len(legends) == 4
    for ax, (moment, closures) in zip(
        panels, [(m, c) for m in GROUPS for c in CLOSURES], strict=True
    ):
        terms = everything.data[number][closures]
        found = {
            "production by" if name.startswith("production by") else name: line.get_ydata()
            for name, line in lines_of(ax).items()
        }
        rate = found.pop("time derivative: the sum of these terms")
        measured = found.pop("time derivative measured on the run")
        assert set(found) == GROUPS[moment]
        np.testing.assert_allclose(sum(found.values()), rate, rtol=0, atol=1e-12)
        expected = np.squeeze(terms[f"{moment}_rate"].values)
        np.testing.assert_array_equal(rate[:-1], np.roll(expected, 64))
        expected = np.squeeze(terms[f"{moment}_rate_measured"].values)
        np.testing.assert_array_equal(measured[:-1], np.roll(expected, 64)[::8])
        for name, values in found.items():
            selected = [str(g).startswith(name) for g in terms[f"{moment}_group"].values]
            by_hand = np.squeeze(terms[moment].values[selected].sum(axis=0))
            np.testing.assert_array_equal(values[:-1], np.roll(by_hand, 64))
    assert "Not drawn, because zero: triboconductivity (charge)" in figure.get_suptitle()


def test_statements_about_budgets(everything):
    assert verdicts(everything, 4) == [
        (True, True),
        (True, False),
        (True, False),
        (True, True),
        (True, False),
        (None, None),
    ]
    assert verdicts(everything, 5) == [(True, True)] * 6 + [(None, None)]
    published, derived = (rows(everything, 4)[1].findings[c].measured for c in CLOSURES)
    assert published.startswith("production 2.87, electric force 9.51, destruction 10.9")
    assert derived.startswith("production 3.07, electric force 0.16, destruction 3.23")


# ------------------------------------------------------------------ Fig. 6


@pytest.mark.parametrize("closures", CLOSURES)
@pytest.mark.parametrize(("letter", "number"), [("a", 1), ("b", 2)])
def test_singular_places_are_where_the_denominator_vanishes(everything, letter, number, closures):
    case = paper_case(number, closures)
    c = models.build("full", case.numbers, closures).coefficients
    # E ∂Q/∂x = -cos²(2πx) for Q = -sin(2πx)
    squared = c.variance_destruction * c.covariance_destruction / (2.0 * c.electric_force)
    profile = everything.data[6][f"{letter}_{closures}"].profile
    x, variance, singular = closure_figure.broken_at_singularities(profile, 1.0)
    assert np.count_nonzero(np.isnan(variance)) == len(singular)
    if squared >= 1.0:
        assert (letter, closures) == ("a", "derived")
        assert len(singular) == 0
        assert profile.attrs["nonphysical"] == ""
        return
    away = np.arcsin(np.sqrt(squared)) / (2.0 * np.pi)
    np.testing.assert_allclose(
        singular, [-0.25 - away, -0.25 + away, 0.25 - away, 0.25 + away], atol=2e-6
    )
    for place, before, after in zip(singular, x, x[1:], strict=False):
        assert before < after
        assert np.isnan(variance[x == place]).all()
    inside = np.abs(np.abs(x) - 0.25) < 0.99 * away
    assert (variance[inside] >= 0.0).all()
    assert (variance[np.abs(np.abs(x) - 0.25) > 1.01 * away] < 0.0).all()


def test_initial_variance_is_drawn_with_gaps(everything):
    figure = closure_figure.draw(everything.data[6])
    for ax, letter in zip(figure.axes, "abab", strict=True):
        for closures in CLOSURES:
            line = lines_of(ax)[f"{closures} closures"]
            profile = everything.data[6][f"{letter}_{closures}"].profile
            _, variance, singular = closure_figure.broken_at_singularities(profile, 1.0)
            np.testing.assert_array_equal(line.get_ydata(), variance)
            dotted = [a for a in ax.lines if a.get_linestyle() == ":"]
            assert {float(a.get_xdata()[0]) for a in dotted} >= set(singular)
            kept = np.isfinite(variance)[:-1]
            values = profile["variance"].values
            np.testing.assert_array_equal(variance[:-1][kept], np.roll(values, len(values) // 2))
    assert [ax.get_ylim() for ax in figure.axes[:2]] == [(-0.5, 0.5)] * 2
    assert "axes cut at $\\pm$0.5" in figure.get_suptitle()


def test_statements_about_the_initial_variance(everything):
    assert verdicts(everything, 6) == [(True, False), (True, False), (True, True), (True, True)]
    told = rows(everything, 6)[0].findings
    assert told["published"].measured == "negative in 88.2 % of the box, singular at 4 places"
    assert told["derived"].measured.endswith("and 0.0336")


# ------------------------------------------------------------------ Fig. 9


@pytest.mark.parametrize("closures", CLOSURES)
def test_maps_are_kept_beside_their_figure(everything, closures):
    made = load_map(everything.folder / f"fig9_{closures}.nc")
    assert made.equals(everything.data[9][closures])
    assert made.attrs["closures"] == closures
    outside = made["status"].values == OUTSIDE
    np.testing.assert_array_equal(np.isnan(made["error"].values), outside)
    # most of the left half, where collisions pass over much of the charge
    assert outside[:2].sum() >= 3
    assert not outside[-1].any()
    assert (np.diff(made["error"].values[-1]) > 0.0).all()


def test_statements_about_regions(everything):
    assert verdicts(everything, 9)[0] == (True, True)
    told = rows(everything, 9)[0].findings["published"].measured
    assert told.startswith("A 6.8e-04 % (Fig. 7; nearest point of the map ")
    assert "), B 96.9 % (Fig. 8; " in told
    # the plane is too coarse for lines of equal error
    assert verdicts(everything, 9)[3:] == [(None, None)] * 2


# ------------------------------------------------------------------ Figs. 1 and 2, summary


def test_statements_about_profiles(everything):
    assert verdicts(everything, 1) == [(True, False), (True, False), (True, True), (None, None)]
    assert verdicts(everything, 2) == [
        (True, False),
        *[(True, True)] * 2,
        (None, None),
        (True, True),
    ]
    told = [row.findings["published"].measured for row in rows(everything, 1)]
    assert told[0] == "t* = 49.143, +2.4 %"
    assert told[2] == "variance: x* = -0.5, 0; size of the covariance: x* = -0.5, 0"
    broken = rows(everything, 2)[3].findings
    assert [broken[c].measured[:31] for c in CLOSURES] == [
        "broken in 61 % of the box; cova",
        "broken in 39 % of the box; cova",
    ]


class _Page(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.open, self.images, self.links, self.texts = [], [], [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        if tag == "img":
            self.images.append(dict(attrs)["src"])
        elif tag != "meta":
            self.open.append(tag)
        self.links += [value for name, value in attrs if name == "href"]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)


@pytest.mark.parametrize("name", ["summary.md", "summary.html"])
def test_summary_holds_every_statement(everything, name):
    text = (everything.folder / name).read_text(encoding="utf-8")
    assert "http" not in text
    if name.endswith(".html"):
        page = _Page(text)
        assert page.open == []
        assert page.images == [f"fig{n}.png" for n in sorted(DATA)]
        assert page.links == [f"fig{n}.pdf" for n in sorted(DATA)]
        text = "".join(page.texts)
    for number in DATA:
        assert (everything.folder / f"fig{number}.png").exists()
        assert f"Fig. {number}: " in text
        for row in rows(everything, number):
            assert row.paper in text
            for finding in row.findings.values():
                assert finding.measured in text
    assert text.count("differs") >= 8


def test_pages_escape_what_they_show(monkeypatch):
    row = Statement("V & <w>", dict.fromkeys(CLOSURES, Finding(False, "a | b < c")))
    monkeypatch.setattr(summary, "statements", lambda number, data: [row])
    markdown, html = summary.pages({1: None})
    assert r"**differs**: a \| b < c" in markdown
    assert '<td>V &amp; &lt;w&gt;</td><td><b class="differs">differs</b>: a | b &lt; c' in html


# ------------------------------------------------------------------ without running anything


@pytest.fixture
def solved(monkeypatch):
    """Replace the solver; return the list of the cases that it is given."""
    cases = []

    def solve(case, *, on_progress=None):
        cases.append(case)
        return fake_result(case)

    monkeypatch.setitem(sys.modules, "triboflux.solve", SimpleNamespace(solve=solve))
    return cases


@pytest.mark.parametrize("name", ["fig8_derived_semi-algebraic.nc", "fig6.pdf", "summary.html"])
def test_any_existing_file_is_refused_before_the_first_run(tmp_path, solved, name):
    (tmp_path / name).write_text("precious")
    with pytest.raises(InputError, match=rf"{name}' exists and is replaced only with --overwrite"):
        Reproduction(tmp_path)
    assert os.listdir(tmp_path) == [name]
    assert solved == []
    Reproduction(tmp_path, overwrite=True)


def test_single_figure_comes_without_summary(tmp_path, solved):
    (tmp_path / "summary.md").write_text("precious")
    reproduction = Reproduction(tmp_path, [2])
    assert reproduction.numbers == (2,)
    reproduction.write(2)
    assert (tmp_path / "summary.md").read_text() == "precious"
    assert not (tmp_path / "summary.html").exists()


def test_an_error_keeps_earlier_figures_and_names_the_real_file(tmp_path, solved, monkeypatch):
    reproduction = Reproduction(tmp_path)
    finished = reproduction.write(1)

    def fail(self, path, **options):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(xr.Dataset, "to_netcdf", fail)
    with pytest.raises(TribofluxError) as caught:
        reproduction.write(2)
    told = str(caught.value)
    assert told.startswith(f"output '{tmp_path / 'fig2_published.nc'}' can't be written: ")
    assert told.count("fig2_published.nc") == 2
    assert "/." not in told
    assert sorted(os.listdir(tmp_path)) == sorted(path.name for path in finished)


def test_runs_are_kept_and_their_failure_is_told(solved):
    runs = Runs()
    case = paper_case(1)
    assert runs(case) is runs(paper_case(1))
    assert solved == [case]
    runs._results[case.to_toml()] = fake_result(case, status="nonphysical", stop_reason="negative")
    assert runs(case, ("ok", "nonphysical")).status == "nonphysical"
    with pytest.raises(TribofluxError, match="published closures ended as nonphysical: negative"):
        runs(case)


@pytest.mark.parametrize(("time", "outputs"), [(50.0, 6), (15.0, 3), (150.0, 6)])
def test_a_run_until_a_time_records_its_end(time, outputs):
    case = until(paper_case(1), time)
    assert case.run.t_end == time
    assert len(case.run.outputs) == outputs
    assert all(a < b for a, b in pairwise(case.run.outputs))
    assert case.run.stop_at_peak_charge < 1e-6
    assert changed(case, run=paper_case(1).run.model_dump()) == paper_case(1)


# ------------------------------------------------------------------ texts


@pytest.mark.parametrize(
    ("value", "text"), [(1e-4, "$10^{-4}$"), (0.1, "0.1"), (0.0002, "0.0002"), (1e6, "$10^{6}$")]
)
def test_power_of_ten(value, text):
    assert style.power_of_ten(value) == text
