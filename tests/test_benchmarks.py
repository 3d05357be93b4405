"""The benchmarks on the smallest problems: they run, and their tables say what was measured."""

import numpy as np
import pytest

from benchmarks import boxes, faults, first, ours, start_up, timing
from tests.cases import fake_result
from triboflux.case import Case

TINY = first.Effort(
    points=(32,),
    peer_points=(32,),
    groups=(("B", "published"),),
    rtols=(1e-8,),
    ratios=(0.1,),
    repeats=1,
    processes=1,
    slow_peers=False,
)


@pytest.fixture(scope="module")
def measured():
    return first.measure("B", "published", TINY)


def test_all_solvers_reach_the_error_on_the_same_problem(measured):
    assert {m.entry.solver for m in measured} >= {first.OURS, *first.TUNED, *first.PLAIN}
    for m in measured:
        assert m.entry.error < 1e-6, m.entry.solver
        assert m.entry.stopped < 1e-6, m.entry.solver
        assert m.at_time.wall > 0.0
        assert m.at_peak.cpu > 0.0


def test_search_keeps_the_quickest_settings(tmp_path):
    file = tmp_path / "settings.csv"
    first.search(TINY, file)
    rows = first.read_settings(file)
    assert {row["solver"] for row in rows} == {*first.TUNED, *first.PLAIN}
    assert {(row["case"], row["points"], row["rtol"]) for row in rows} == {("B", "32", "1e-08")}
    assert first.read_settings()[0].keys() == rows[0].keys()


def test_tables_of_the_solvers(measured):
    rows = first.solvers_table(measured).splitlines()
    assert len(rows) == 2 + len(measured)
    assert len({row.count("|") for row in rows}) == 1
    reaches = list(first.reach_rows("B", "published", measured))
    assert [row[0] for row in reaches] == ["B published, given time", "B published, stop rule"] * 2
    at_32, best = reaches[0][2], reaches[0][-1]
    assert at_32 == "—"
    assert "met" in best or "missed by a factor" in best


def test_profile_of_a_run():
    parts = ours.profile(ours.problem("B", "published", 32, 0.165), 0.016, count=3, repeats=1)
    assert parts["steps"] >= 5
    assert all(seconds > 0.0 for seconds in parts.values())


def box_result(folder, points, shift=0.0):
    box = boxes.Box(points)
    case = Case.from_toml_text(boxes.case_text(box))
    stats = {"accepted": 14, "rejected": 0, "points": list(points), "seconds": 1.5}
    result = fake_result(case, stats=stats)
    x, y = np.meshgrid(*(np.arange(n) / n for n in points), indexing="ij")
    last = np.sin(2 * np.pi * (x + 2 * y)) + 0.25
    for name in boxes.FIELDS:
        result.dataset[name][:] = last
        result.dataset[name][-1] += shift
    file = folder / f"{points[0]}.nc"
    result.to_netcdf(file)
    return boxes.Ran(box, 10**9, 2.0, 1.5, file)


def test_differences_of_boxes_see_the_common_modes(tmp_path):
    coarse, fine = box_result(tmp_path, (10, 11)), box_result(tmp_path, (16, 14), shift=0.125)
    found = boxes.differences(coarse, fine)
    assert set(found) == set(boxes.FIELDS)
    assert found["charge"] == pytest.approx(0.125 / 1.375, rel=0.05)
    assert boxes.charge_drift(coarse) == 0.0
    assert boxes.charge_drift(fine) == pytest.approx(0.125 / 1.25, rel=0.05)
    table = boxes.runs_table([coarse, fine], {2: coarse})
    assert "10 × 11" in table
    assert "14 + 0" in table


@pytest.mark.parametrize("dimensions", [2, 3])
def test_boxes_are_neither_symmetric_nor_separable(dimensions):
    case = Case.from_toml_text(boxes.case_text(boxes.FULL.fine[dimensions]))
    modes = np.array([mode.mode for mode in case.initial.charge])
    assert np.linalg.matrix_rank(modes) == dimensions
    assert sum(np.count_nonzero(modes, axis=1) > 1) >= 3
    assert all(mode.sine != 0.0 and mode.cosine != 0.0 for mode in case.initial.charge[:3])


def test_child_processes_are_measured_and_their_failure_is_told(tmp_path):
    done = timing.child(["-c", "print(2 + 3)"], tmp_path)
    assert done.output == "5\n"
    assert done.wall > 0.0
    assert done.memory > 2**20
    with pytest.raises(RuntimeError, match="no such thing"):
        timing.child(["-c", "raise SystemExit('no such thing')"], tmp_path)


def test_phases_are_measured_in_fresh_processes_only(tmp_path):
    # The processes time their imports, so what they start with must not import anything heavy.
    code = "import sys, benchmarks.start_up; print('numpy' in sys.modules, 'jax' in sys.modules)"
    assert timing.child(["-c", code], tmp_path).output == "False False\n"
    assert "measure_phases" in start_up.PHASES


def test_sections_of_the_page(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("a\n<!-- begin x -->\nold\n<!-- end x -->\nb\n")
    timing.write_section("x", "new", page)
    assert page.read_text() == "a\n<!-- begin x -->\nnew\n<!-- end x -->\nb\n"
    with pytest.raises(ValueError, match="begin y"):
        timing.write_section("y", "new", page)


def test_verdicts_name_the_factor():
    assert timing.verdict(2.0, 1.0) == "missed by a factor 2"
    assert timing.verdict(0.5, 1.0).startswith("met")


def test_the_page_has_the_sections_that_the_benchmarks_fill():
    text = timing.PAGE.read_text(encoding="utf-8")
    for name in (*first.PARTS, "boxes"):
        assert f"<!-- begin {name} -->" in text
        assert f"<!-- end {name} -->" in text


def test_the_page_on_reliability_has_the_sections_that_faults_fill():
    text = faults.PAGE.read_text(encoding="utf-8")
    for name in faults.SECTIONS:
        assert f"<!-- begin {name} -->" in text
        assert f"<!-- end {name} -->" in text
