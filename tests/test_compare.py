"""Comparisons of models: errors by hand, the paper's cases, the table, the figure, the files."""

import csv
import io
import json
import math
import os
import signal
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

import triboflux
from tests.cases import data
from tests.paper_runs import changed
from tests.processes import command, surroundings
from tests.processes import triboflux as process
from triboflux import cli, compare_output
from triboflux.case import MODELS_WITH_VARIANCE, Case
from triboflux.compare import DEFAULT_MODELS, compare, require_models
from triboflux.compare_figure import LINES, REFERENCE, compare_figure, section
from triboflux.comparison import FIELDS, relative_errors
from triboflux.dataset import build_dataset
from triboflux.errors import InputError, OutOfRangeError, TribofluxError
from triboflux.figures import paper_case
from triboflux.result import Result
from triboflux.scales import Scales

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
RATES = {"full": 1.0, "semi-algebraic": 3.0, "algebraic": 2.0, "gradient": 2.0, "collisional": 0.1}
"""Decay rates of the charge in made-up runs."""
HALF = math.log(2.0)
"""When the charge of the full model has halved in them."""


def pretended(case, *, status="ok", reason=None, until=math.inf, seconds=0.25, points=()):
    """Return a run whose charge decays exponentially and whose other fields are constant."""
    rate, run = RATES[case.model], case.run
    stop = run.stop_at_peak_charge
    end = min(run.t_end, until, math.inf if stop is None else -math.log(stop) / rate)
    times = np.array([t for t in run.outputs if t <= end])
    times = times if end in times else np.append(times, end)
    shape, d = case.grid.points, case.grid.dimensions
    decay = np.exp(-rate * times).reshape(-1, *[1] * d)
    wave = np.cos(2 * np.pi * np.arange(shape[0]) / shape[0]).reshape(-1, *[1] * (d - 1))
    ones = np.ones((len(times), d, *shape))
    covariance = 0.0 if case.model == "collisional" else 0.3 + 0.1 * rate
    variance = np.full((len(times), *shape), 0.2 * rate)
    return Result(
        build_dataset(
            case,
            times,
            charge=decay * wave * np.ones(shape),
            covariance=covariance * ones,
            field=rate * ones,
            potential=decay * wave * np.ones(shape),
            peak_charge=np.exp(-rate * times),
            variance=variance if case.model in MODELS_WITH_VARIANCE else None,
            status=status,
            stop_reason=reason or ("peak charge fell" if end < run.t_end else "reached t_end"),
            stats={"accepted": 7, "rejected": 2, "seconds": seconds, "points": points},
            warnings=[f"beware of {case.run.t_end:.3g}"],
        )
    )


@pytest.fixture
def solver(monkeypatch):
    """Replace the solver by `pretended`; return its calls, and what it shall do by model."""
    calls, behaviour = [], {}

    def solve(case, *, on_progress=None):
        calls.append(case)
        return behaviour.get(case.model, pretended)(case)

    module = ModuleType("triboflux.solve")
    module.solve = solve
    monkeypatch.setitem(sys.modules, "triboflux.solve", module)
    monkeypatch.setenv("TRIBOFLUX_CACHE_DIR", "off")
    return calls, behaviour


def halving(**changes):
    """Return a case that stops when the charge has halved."""
    return Case(**data(**({"run__stop_at_peak_charge": 0.5, "run__t_end": 4.0} | changes)))


# ------------------------------------------------------------------ errors by hand


def test_errors_of_a_scalar_field():
    reference = np.array([0.0, -4.0, 0.0, 3.0])
    found = relative_errors(reference + np.array([0.0, 1.0, -2.0, 0.0]), reference)
    assert found.largest == pytest.approx(2.0 / 4.0)
    assert found.rms == pytest.approx(math.sqrt(5.0) / 5.0)


def test_errors_of_a_vector_are_those_of_its_length():
    reference = np.array([[3.0, 0.0], [4.0, 0.0]])
    values = reference + np.array([[0.0, 3.0], [0.0, -4.0]])
    found = relative_errors(values, reference, vector=True)
    assert found == (pytest.approx(1.0), pytest.approx(1.0))
    # taken for two scalar fields the largest value would be 4
    assert relative_errors(values, reference).largest == pytest.approx(1.0)
    smaller = relative_errors(reference * [[1.0, 1.0], [0.5, 1.0]], reference, vector=True)
    assert smaller.largest == pytest.approx(2.0 / 5.0)


def test_no_relative_error_where_the_reference_vanishes():
    assert relative_errors(np.ones(4), np.zeros(4)) == (None, None)


# ------------------------------------------------------------------ what is run


def test_all_models_are_compared_at_the_references_last_time(solver):
    calls, _ = solver
    comparison = compare(halving(), ("gradient", "collisional", "full", "semi-algebraic"))
    assert (comparison.reference, comparison.time) == ("full", pytest.approx(HALF))
    models = ["full", "semi-algebraic", "gradient", "collisional"]
    assert [row.model for row in comparison.rows] == models
    assert list(comparison.results) == list(comparison.states) == models
    for name, state in comparison.states.items():
        assert state.dataset["time"].values.tolist() == [comparison.time]
        assert comparison.row(name).peak_charge == pytest.approx(0.5 ** RATES[name])
    # exp(-r t) at the time when exp(-t) = 1/2, against 1/2
    errors = {row.model: row.errors for row in comparison.rows}
    expected = {"full": 0.0, "semi-algebraic": 0.75, "gradient": 0.5, "collisional": 0.5**-0.9 - 1}
    for name, error in expected.items():
        assert errors[name]["charge"] == (pytest.approx(error), pytest.approx(error))
    assert errors["semi-algebraic"]["field"].rms == pytest.approx(2.0)
    assert errors["semi-algebraic"]["covariance"].largest == pytest.approx(0.5)
    assert errors["semi-algebraic"]["variance"].largest == pytest.approx(2.0)
    assert errors["collisional"]["covariance"] == (1.0, 1.0)
    assert "variance" not in errors["gradient"]
    stops = [row.stop_time for row in comparison.rows]
    assert stops[:3] == [pytest.approx(HALF / RATES[name]) for name in models[:3]]
    assert (stops[3], comparison.rows[3].end_time) == (None, 4.0)
    # a model that stops earlier is run on, without its stop rule; the others are not run again
    longer = [case for case in calls if case.run.stop_at_peak_charge < 0.5]
    assert [case.model for case in longer] == ["semi-algebraic", "gradient"]
    assert {case.run.t_end for case in longer} == {comparison.time}
    # from where their own runs ended, and as many outputs need no other compiled program
    assert [case.run.outputs[0] for case in longer] == stops[1:3]
    assert {len(case.run.outputs) for case in longer} == {len(calls[-1].run.outputs)}
    assert [row.steps for row in comparison.rows] == [7] * 4
    assert [row.rejected for row in comparison.rows] == [2] * 4


def test_a_charge_that_vanishes_is_compared_all_the_same(solver):
    _, behaviour = solver

    def vanish(case):
        stop = case.run.stop_at_peak_charge
        return pretended(case, until=0.4 if stop is not None and stop < 0.5 else math.inf)

    behaviour["gradient"] = vanish
    row = compare(halving(), ("full", "gradient")).row("gradient")
    assert row.errors["charge"].rms == pytest.approx(0.5)


def test_a_rate_that_stops_a_run_is_a_stop_rule_too(solver):
    calls, _ = solver
    compare(halving(run__stop_at_rate=1e-9), ("full", "gradient"))
    assert calls[-1].run.t_end == pytest.approx(HALF)
    assert calls[-1].run.stop_at_rate is None


def test_without_a_stop_rule_all_are_compared_at_the_end(solver):
    comparison = compare(Case(**data()), ("full", "gradient"))
    assert comparison.time == 1.0
    assert [row.stop_time for row in comparison.rows] == [None, None]
    assert comparison.row("gradient").errors["charge"].rms == pytest.approx(1 - math.exp(-1.0))


def test_results_have_the_cases_own_outputs(solver):
    comparison = compare(halving(run__outputs=[0.1, 0.2]), ("full", "gradient"))
    times = {name: found.dataset["time"].values for name, found in comparison.results.items()}
    np.testing.assert_allclose(times["full"], [0.0, 0.1, 0.2, HALF])
    np.testing.assert_allclose(times["gradient"], [0.0, 0.1, 0.2, HALF / 2.0])


def test_cost_is_the_shortest_of_runs_that_need_no_compilation(solver):
    calls, behaviour = solver
    seconds = iter([30.0, 0.3, 0.1, 0.2, *[1.0] * 9])
    behaviour["full"] = lambda case: pretended(case, seconds=next(seconds))
    comparison = compare(halving(), ("full", "collisional"))
    assert comparison.row("full").seconds == 0.1
    full = [case for case in calls if case.model == "full"]
    # the first is a beginning of the run, with as many outputs, to compile; then half a second
    assert full[0].run.t_end < 1e-5 < full[1].run.t_end
    assert len(full[0].run.outputs) == len(full[1].run.outputs)
    assert full[1] == full[2] == full[3]
    assert len(full) == 4


def test_compiling_for_a_finer_grid_within_the_run_does_not_count(solver):
    _, behaviour = solver
    given = iter([(30.0, [32]), (40.0, [64]), (0.6, [64])])

    def run(case):
        seconds, points = next(given)
        return pretended(case, seconds=seconds, points=points)

    behaviour["full"] = run
    assert compare(halving(), ("full", "collisional")).row("full").seconds == 0.6


def test_long_runs_are_not_repeated(solver):
    calls, behaviour = solver
    behaviour["full"] = lambda case: pretended(case, seconds=20.0)
    assert compare(halving(), ("full", "collisional")).row("full").seconds == 20.0
    assert [case.model for case in calls].count("full") == 2


def test_failures_are_listed_and_stop_nothing(solver):
    _, behaviour = solver
    behaviour["algebraic"] = lambda case: pretended(
        case, status="nonphysical", reason="V negative", until=0.1 * case.run.t_end / 4.0
    )

    def refuse(case):
        raise OutOfRangeError("the bracket is negative.")

    behaviour["gradient"] = refuse
    comparison = compare(halving(), ("full", "algebraic", "gradient", "collisional"))
    found = {row.model: (row.status, row.reason) for row in comparison.rows}
    assert found["algebraic"] == ("nonphysical", "V negative")
    assert found["gradient"] == ("refused", "the bracket is negative.")
    assert not comparison.row("algebraic").errors
    assert comparison.row("algebraic").end_time == pytest.approx(0.1)
    assert comparison.row("collisional").errors["charge"].rms > 0.5
    assert list(comparison.states) == ["full", "collisional"]


def test_a_model_that_fails_later_is_compared_all_the_same(solver):
    _, behaviour = solver
    behaviour["algebraic"] = lambda case: pretended(case, status="diverged", until=2.0)
    row = compare(halving(run__stop_at_peak_charge=None, run__t_end=1.5), ("full", "algebraic"))
    assert row.row("algebraic").errors
    # the full model fails after the time of the reference, which is known only then
    behaviour["full"] = lambda case: pretended(case, status="diverged", until=3.0)
    comparison = compare(halving(), ("full", "collisional", "semi-algebraic"))
    assert comparison.reference == "semi-algebraic"
    assert comparison.row("full").status == "diverged"
    assert comparison.row("full").errors["charge"].rms == pytest.approx(0.5 ** (1 / 3) / 0.5 - 1)


def test_a_model_that_fails_beyond_its_own_end_is_told(solver):
    _, behaviour = solver

    def fail_later(case):
        if case.run.stop_at_peak_charge != 0.5:
            return pretended(case, status="diverged", reason="the step collapsed", until=0.3)
        return pretended(case)

    behaviour["semi-algebraic"] = fail_later
    comparison = compare(halving(), ("full", "semi-algebraic"))
    row = comparison.row("semi-algebraic")
    assert row.status == "ok"
    assert row.reason == "peak charge fell; run on, it ended diverged: the step collapsed"
    assert not row.errors
    assert "failed after its own end" in compare_figure(comparison).get_suptitle()


def test_nothing_to_compare(solver):
    _, behaviour = solver

    def refuse(case):
        raise OutOfRangeError(f"{case.model} is out.")

    behaviour |= {"full": refuse, "gradient": refuse}
    with pytest.raises(OutOfRangeError, match=r"^full is out\.$"):
        compare(halving(), ("gradient", "full"))
    behaviour["gradient"] = lambda case: pretended(case, status="diverged", reason="not finite")
    sentence = r"^no model's run ended well: gradient diverged \(not finite\); full refused\.$"
    with pytest.raises(TribofluxError, match=sentence):
        compare(halving(), ("gradient", "full"))


@pytest.mark.parametrize(
    ("models", "sentence"),
    [
        (("full", "gradiant"), r"models contains 'gradiant', but known are .*'gradient'\?"),
        (("full", "gradient", "full"), r"models contains 'full' more than once\."),
        (("full",), r"models contains only 'full', but a comparison needs at least two\."),
        ((), r"models contains nothing, but a comparison needs at least two\."),
    ],
)
def test_bad_models(models, sentence):
    with pytest.raises(InputError, match=f"^{sentence}$"):
        require_models(models)


def test_warnings_name_their_models(solver):
    comparison = compare(halving(), ("full", "gradient"))
    assert comparison.warnings == (
        "full: beware of 4",
        "gradient: beware of 4",
        "gradient, run on beyond its own end: beware of 0.693",
    )


# ------------------------------------------------------------------ the data


def test_dataset_has_a_model_dimension(solver, tmp_path):
    comparison = compare(halving(), ("full", "semi-algebraic", "gradient"))
    comparison.to_netcdf(tmp_path / "out.nc")
    with xr.open_dataset(tmp_path / "out.nc") as opened:
        dataset = opened.load()
    assert dataset["model"].values.tolist() == ["full", "semi-algebraic", "gradient"]
    assert dataset["charge"].dims == ("model", "x")
    assert dataset["covariance"].dims == ("model", "component", "x")
    for name in FIELDS:
        for model, state in comparison.states.items():
            if name in state.dataset:
                expected = state.dataset[name].values[-1]
                np.testing.assert_array_equal(dataset[name].sel(model=model), expected)
    assert np.isnan(dataset["variance"].sel(model="gradient")).all()
    error = dataset["error"].sel(model="semi-algebraic", quantity="charge", norm="L2")
    assert float(error) == pytest.approx(0.75)
    assert np.isnan(dataset["error"].sel(model="gradient", quantity="variance")).all()
    assert float(dataset["stop_time"].sel(model="gradient")) == pytest.approx(HALF / 2.0)
    assert float(dataset["time"]) == comparison.time
    assert dataset.attrs["reference"] == "full"
    assert Case.from_toml_text(dataset.attrs["case_toml"]) == comparison.case


def test_si(solver):
    case = Case.from_toml(EXAMPLES / "polyethylene.toml")
    scaled = compare(case, ("full", "gradient"))
    si, scales = scaled.to_si(), Scales.of(case.suspension)
    assert (scaled.units, si.units, si.to_si()) == ("scaled", "si", si)
    assert si.time == scaled.time * scales.time
    for row, before in zip(si.rows, scaled.rows, strict=True):
        assert row.stop_time == before.stop_time * scales.time
        assert row.peak_charge == before.peak_charge * scales.charge
        assert row.errors == before.errors
    dataset = si.to_dataset()
    assert dataset["stop_time"].attrs["units"] == dataset["time"].attrs["units"] == "s"
    assert dataset["charge"].attrs["units"] == dataset["peak_charge"].attrs["units"] == "C"
    expected = scaled.to_dataset()["charge"] * scales.charge
    np.testing.assert_allclose(dataset["charge"].values, expected.values, rtol=1e-14)
    figure = compare_figure(si)
    assert figure.axes[0].get_ylabel() == "$Q_p$ (C)"
    assert figure.axes[2].get_xlabel() == "$x$ (m)"
    with pytest.raises(InputError, match=r"^units is 'si', but SI needs the scales"):
        compare(halving(), ("full", "gradient")).to_si()


# ------------------------------------------------------------------ the table


def test_table(solver):
    _, behaviour = solver
    behaviour["algebraic"] = lambda case: pretended(
        case, status="nonphysical", reason="V is negative", until=0.0
    )
    models = ("full", "semi-algebraic", "algebraic", "gradient", "collisional")
    lines = compare_output.text(compare(halving(), models), "table").splitlines()
    cells = [line.split() for line in lines]
    assert ["full", "ok", "0.693147", "0.5", "0.250", "7+2"] in cells
    assert ["algebraic", "nonphysical", "-", "-", "0.250", "7+2"] in cells
    assert ["collisional", "ok", ">", "4", "0.933033", "0.250", "7+2"] in cells
    assert [*"semi-algebraic 0.75 0.75 2.0 2.0 0.50 0.50 2.0 2.0".split()] in cells
    assert ["gradient", "0.50", "0.50", "1.0", "1.0", "0.25", "0.25", "-", "-"] in cells
    assert ["algebraic", *["-"] * 8] in cells
    assert lines[-1] == "algebraic, nonphysical: V is negative."
    assert max(map(len, lines)) <= 80


def test_json_and_csv(solver):
    comparison = compare(halving(), ("full", "gradient"))
    document = json.loads(compare_output.text(comparison, "json"))
    assert (document["reference"], document["time"]) == ("full", comparison.time)
    gradient = document["models"][1]
    assert gradient["errors"]["charge"] == {
        "max": comparison.row("gradient").errors["charge"].largest,
        "L2": comparison.row("gradient").errors["charge"].rms,
    }
    assert gradient["errors"]["variance"] is None
    rows = list(csv.DictReader(io.StringIO(compare_output.text(comparison, "csv"))))
    assert [row["model"] for row in rows] == ["full", "gradient"]
    assert float(rows[1]["stop_time"]) == comparison.row("gradient").stop_time
    assert float(rows[1]["field_error_L2"]) == pytest.approx(1.0)
    assert rows[1]["variance_error_max"] == ""


@pytest.mark.parametrize(
    ("error", "shown"),
    [
        (0.0, "0"),
        (1.0, "1.0"),
        (0.0123, "0.012"),
        (7.151e-6, "7.2e-6"),
        (42.0, "42"),
        (1234.0, "1.2e+3"),
    ],
)
def test_errors_are_short(error, shown):
    assert compare_output._short(error) == shown


# ------------------------------------------------------------------ the figure


def curves(ax):
    return [line for line in ax.lines if len(line.get_xdata()) > 2]


def test_figure_shows_every_model_at_the_same_time(solver):
    comparison = compare(halving(), ("semi-algebraic", "gradient", "full"))
    figure = compare_figure(comparison)
    for ax, name in zip(figure.axes, FIELDS, strict=True):
        models = [m for m, s in comparison.states.items() if name in s.dataset]
        lines = curves(ax)[1:] if name == "charge" else curves(ax)
        for model, line in zip(models, lines, strict=True):
            values = comparison.states[model].dataset[name].values[-1].reshape(32)
            np.testing.assert_array_equal(np.sort(line.get_ydata()[:-1]), np.sort(values))
            look = REFERENCE if model == "full" else LINES[model]
            assert line.get_color() == look["color"]
    initial = curves(figure.axes[0])[0].get_ydata()
    assert initial.max() == pytest.approx(1.0)
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts == [
        "initial charge",
        "full, own $t^*$ = 0.69315",
        "semi-algebraic, own $t^*$ = 0.23105",
        "gradient, own $t^*$ = 0.34657",
    ]
    caption = figure.get_suptitle()
    assert "All models at $t^*$ = 0.69315, where the full one ended: peak charge fell" in caption
    # |C|² = 0.16 < V = 0.2 in the full model, 0.36 < 0.6 in the other
    assert "realizable" not in caption


def test_figure_tells_what_is_impossible(solver, monkeypatch):
    monkeypatch.setitem(RATES, "full", 0.5)
    caption = compare_figure(compare(halving(), ("full", "semi-algebraic"))).get_suptitle()
    # |C|² = 0.1225 > V = 0.1
    assert "Not realizable" in caption
    assert caption.endswith("in 100% of the box (full)")


def test_looks_differ_in_colour_and_dashes():
    looks = [REFERENCE, *LINES.values()]
    assert len({look["color"] for look in looks}) == len(looks)
    assert len({str(look["linestyle"]) for look in LINES.values()}) == len(LINES)


def test_a_box_is_cut_through_its_largest_charge(solver):
    case = halving(grid__points=[8, 6], initial__charge=[{"mode": [1, 0], "sine": -1.0}])
    comparison = compare(case, ("full", "gradient"))
    figure = compare_figure(comparison)
    state = comparison.states["gradient"].dataset["charge"].values[-1]
    line = curves(figure.axes[0])[2].get_ydata()
    np.testing.assert_array_equal(np.sort(line[:-1]), np.sort(state[:, 0]))
    assert "Line along $x$ at $y$ = 0, through the largest charge" in figure.get_suptitle()
    assert figure.axes[1].get_title(loc="left").endswith("$x$ component")


def test_section_follows_the_charge():
    x, y, z = np.meshgrid(*(np.arange(n) / n for n in (4, 8, 6)), indexing="ij")
    values = np.sin(2 * np.pi * y) * (1 + 0.1 * np.cos(2 * np.pi * (z - 0.5))) + 0.0 * x
    found = section(xr.DataArray(values, dims=("x", "y", "z")))
    assert found.axis == "y"
    assert found.place == {"x": 0, "z": 3}
    field = xr.DataArray(np.stack([values, 2 * values, 3 * values]), dims=("component", *"xyz"))
    np.testing.assert_array_equal(found.of(field).values, 2 * values[0, :, 3])
    assert found.of(field).dims == ("x",)


# ------------------------------------------------------------------ files and the command


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "case.toml").write_text(halving().to_toml())
    return tmp_path


NAMES = ["case_models.nc", "case_models.pdf", "case_models.png"]


def call(monkeypatch, *arguments):
    """Call `main` in this process and return the exit code."""
    monkeypatch.setattr(sys, "argv", ["triboflux", "compare", *map(str, arguments)])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    return ended.value.code


@pytest.fixture
def quick(monkeypatch):
    """Draw nothing, which takes longer than all the rest."""
    monkeypatch.setattr(Figure, "savefig", lambda self, path, **options: path.touch())


@pytest.mark.parametrize("name", ["new", "present", "some.pdf"])
def test_files(folder, solver, quick, monkeypatch, capsys, name):
    (folder / "present").mkdir()
    assert call(monkeypatch, folder / "case.toml", "-o", folder / name) == 0
    told = capsys.readouterr()
    assert told.out == compare_output.text(compare(halving(), DEFAULT_MODELS), "table")
    assert told.err.count("warning: ") == 5
    assert told.err.count("written: ") == 3
    expected = NAMES if name != "some.pdf" else ["some.nc", "some.pdf", "some.png"]
    where = folder / name if name != "some.pdf" else folder
    assert set(expected) <= set(os.listdir(where))
    assert len(list(folder.rglob("*.*"))) == 4


def test_exit_code_tells_of_failures(folder, solver, quick, monkeypatch, capsys):
    _, behaviour = solver
    behaviour["gradient"] = lambda case: pretended(case, status="diverged", until=0.0)
    assert call(monkeypatch, folder / "case.toml", "-o", folder, "--quiet") == 3
    assert capsys.readouterr().err == ""
    assert set(NAMES) <= set(os.listdir(folder))


def test_closures_replace_the_cases_own(folder, solver, quick, monkeypatch):
    calls, _ = solver
    assert call(monkeypatch, folder / "case.toml", "-o", folder, "--closures", "published") == 0
    assert {case.closures for case in calls} == {"published"}


def test_failed_writing_leaves_nothing(folder, solver, monkeypatch, capsys):
    def fail(self, path, **options):
        path.touch()
        if path.suffix == ".pdf":
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(Figure, "savefig", fail)
    for where in (folder, folder / "new"):
        assert call(monkeypatch, folder / "case.toml", "-o", where) == 1
        assert "case_models.pdf' can't be written: " in capsys.readouterr().err
    assert os.listdir(folder) == ["case.toml"]


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--models", "full,gradiant"], "models contains 'gradiant', but known are"),
        (["--models", "full, full"], "models contains 'full' more than once."),
        (["--models", ","], "models contains nothing, but"),
        (["--format", "jsn"], "format is 'jsn', but must be one of table, json, csv."),
        (["--closures", "publish"], "closures is 'publish', but must be"),
        (["--units", "si"], "units is 'si', but SI needs the scales"),
        (["-o", "figure.svg"], "output is 'figure.svg', but must be a folder or end in .png,"),
        (["-o", "none/none"], "output folder 'none' does not exist."),
        (["-o", "none/a.pdf"], "output folder 'none' does not exist."),
        (["-o", "case.toml/a.pdf"], "output folder 'case.toml' is not a folder."),
        (["-o", "x" * 300], "output 'xxx"),
        (["-o", "old.nc"], "output 'old.nc' exists and is replaced only with --overwrite"),
    ],
)
def test_refusals(folder, solver, monkeypatch, capsys, options, sentence):
    monkeypatch.chdir(folder)
    (folder / "old.nc").touch()
    calls, _ = solver
    assert call(monkeypatch, "case.toml", *options) == 1
    told = capsys.readouterr()
    assert told.err.startswith(f"error: {sentence}")
    assert (told.err.count("\n"), told.out, calls) == (1, "", [])
    assert sorted(os.listdir(folder)) == ["case.toml", "old.nc"]


def test_the_initial_file_is_not_replaced(folder, solver, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    pretended(halving(run__outputs=[0.0])).to_netcdf(folder / "start.nc")
    case = halving(initial={"file": str(folder / "start.nc")})
    (folder / "case.toml").write_text(case.to_toml())
    assert call(monkeypatch, "case.toml", "-o", "start.png", "--overwrite") == 1
    assert capsys.readouterr().err.endswith("start.nc' is the case's own initial.file.\n")


SLOW = """
import sys, time
from types import ModuleType
from triboflux import cli

def solve(case, *, on_progress=None):
    print("solving", flush=True)
    time.sleep(20)

module = sys.modules["triboflux.solve"] = ModuleType("triboflux.solve")
module.solve = solve
cli.main()
"""


@pytest.mark.skipif(os.name == "nt", reason="needs POSIX signals")
def test_interrupted_comparison_leaves_nothing(folder):
    with subprocess.Popen(
        command("compare", "case.toml", "-o", "new", code=SLOW),
        cwd=folder,
        env=surroundings(TRIBOFLUX_CACHE_DIR="off"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as running:
        started = running.stdout.readline()
        running.send_signal(signal.SIGINT)
        _, errors = running.communicate(timeout=30)
    assert started == "solving\n"
    assert running.returncode == 130
    assert errors == "interrupted: nothing was written\n"
    assert os.listdir(folder) == ["case.toml"]


def test_refusal_imports_nothing_heavy(folder):
    done = process("compare", "case.toml", "--models", "full", folder=folder)
    assert done.returncode == 1
    sentence, imported = done.stderr.splitlines()
    assert sentence.startswith("error: models contains only 'full'")
    assert imported == "[]"


# ------------------------------------------------------------------ the real solver


@pytest.mark.slow
def test_case_b_gives_the_reference_values():
    case = changed(paper_case(2), grid__points=(64,))
    seen = []
    comparison = triboflux.compare(case, on_progress=seen.append)
    assert isinstance(comparison, triboflux.Comparison)
    # values of another method; see tests/test_reference_table.py
    expected = {"full": 0.165302, "semi-algebraic": 0.048347, "gradient": 0.116986}
    for name, time in expected.items():
        assert comparison.row(name).stop_time == pytest.approx(time, rel=1e-5)
        assert comparison.row(name).status == "ok"
    assert comparison.time == comparison.row("full").stop_time
    assert comparison.row("full").errors["charge"] == (0.0, 0.0)
    # the gradient model's single mode decays exponentially, and has halved at its own stop time
    decay = 0.5 ** (comparison.time / comparison.row("gradient").stop_time)
    gradient = comparison.row("gradient")
    assert gradient.peak_charge == pytest.approx(decay, rel=1e-6)
    x = np.arange(64) / 64
    full = comparison.states["full"].dataset["charge"].values[-1]
    difference = -decay * np.sin(2 * np.pi * x) - full
    norms = [np.max(np.abs(difference)) / 0.5, np.sqrt(np.mean(difference**2) / np.mean(full**2))]
    np.testing.assert_allclose(gradient.errors["charge"], norms, rtol=1e-5)
    # the full model drives the covariance above what the gradient gives, by the ratio 0.4712/1.1354
    # at most
    assert 0.5 < gradient.errors["covariance"].largest < 1.0
    semi = comparison.row("semi-algebraic").errors
    assert all(0.2 < value < 1.0 for norms in semi.values() for value in norms)
    assert all(0.0 < row.seconds < 1.0 for row in comparison.rows)
    fractions = [progress.fraction for progress in seen]
    assert fractions == sorted(fractions)
    assert 0.5 < fractions[-1] <= 1.0


@pytest.mark.slow
def test_the_command_with_the_real_solver(folder):
    case = changed(paper_case(1), grid__points=(64,))
    (folder / "case.toml").write_text(case.to_toml())
    models = "semi-algebraic,full,algebraic"
    done = process(
        "compare", "case.toml", "--models", models, "--format", "json", "-o", "out", folder=folder
    )
    assert done.returncode == 3
    document = json.loads(done.stdout)
    full, semi, algebraic = document["models"]
    assert full["stop_time"] == pytest.approx(49.14328, rel=1e-6)
    assert semi["stop_time"] == pytest.approx(49.14299, rel=1e-6)
    # frequent collisions: the paper finds that the semi-algebraic model matches perfectly
    assert all(0.0 < norm < 1e-5 for error in semi["errors"].values() for norm in error.values())
    assert (algebraic["status"], algebraic["end_time"]) == ("nonphysical", 0.0)
    assert "denominator" in algebraic["reason"]
    assert sorted(path.name for path in (folder / "out").iterdir()) == NAMES
    with xr.open_dataset(folder / "out" / "case_models.nc") as dataset:
        assert dataset["model"].values.tolist() == ["full", "semi-algebraic", "algebraic"]
        assert float(dataset["error"].sel(model="semi-algebraic").max()) < 1e-5
    assert done.stderr.splitlines()[-4].startswith("written: ")
