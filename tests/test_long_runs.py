"""Long runs: they stream to files, and go on from wherever they were interrupted."""

import itertools
import os
import tracemalloc

import numpy as np
import pytest
import xarray as xr

from tests.cases import data
from triboflux import segments, solve, solve_to_file
from triboflux.case import Case
from triboflux.checkpoint import InterruptionError
from triboflux.errors import InputError, TribofluxError
from triboflux.result import load

TIMES = [0.0, 1e-3, 0.05, 0.1, 0.15, 0.18, 0.19, 0.5]
# what tells when and how long, instead of what
PASSING = ("created", "history", "stats_json")


def case(**changes):
    return Case(**data(**({"run__t_end": 0.6, "run__outputs": TIMES} | changes)))


def stopping(**changes):
    return case(run__stop_at_peak_charge=0.5, run__rtol=1e-8, **changes)


def assert_same(left, right):
    """Compare two results bit for bit, but for what tells of clocks."""
    xr.testing.assert_identical(left.dataset.drop_attrs(), right.dataset.drop_attrs())
    for a, b in zip(left.dataset.variables.values(), right.dataset.variables.values(), strict=True):
        assert dict(a.attrs) == dict(b.attrs)
    attributes = [
        {key: value for key, value in result.dataset.attrs.items() if key not in PASSING}
        for result in (left, right)
    ]
    assert attributes[0] == attributes[1]
    for name in ("accepted", "rejected"):
        assert left.stats[name] == right.stats[name]


def after(count):
    """Return a callable that says stop the ``count``-th time it is asked."""
    asked = itertools.count(1)
    return lambda: next(asked) >= count


@pytest.fixture(autouse=True)
def short_segments(monkeypatch):
    """Make segments of two steps and up to eight outputs, so that one program serves all runs."""
    monkeypatch.setattr(segments, "STEPS_SMALL", 2)
    monkeypatch.setattr(segments, "STEPS_LARGE", 2)
    monkeypatch.setattr(segments, "WINDOW", 8 * 32)


@pytest.fixture
def whole():
    return solve(stopping())


# --- files ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("part", [1, 64, 2**17], ids=["one by one", "two by two", "at once"])
def test_a_run_to_a_file_is_that_in_memory(tmp_path, monkeypatch, whole, part):
    monkeypatch.setattr("triboflux.result_file.PART", part)
    last = solve_to_file(stopping(), tmp_path / "out.nc")
    written = load(tmp_path / "out.nc")
    assert_same(written, whole)
    assert written.warnings
    assert_same(last, type(last)(written.dataset.isel(time=slice(-1, None))))
    assert os.listdir(tmp_path) == ["out.nc"]


def test_a_run_to_a_file_in_si(tmp_path):
    si = Case(
        suspension={"preset": "polyethylene"},
        grid={"points": [32]},
        initial={"charge": [{"mode": [1], "sine": 0.5}]},
        run={"t_end": 0.6, "outputs": TIMES, "stop_at_peak_charge": 0.25},
    )
    solve_to_file(si, tmp_path / "out.nc", units="si")
    assert_same(load(tmp_path / "out.nc"), solve(si).to_si())


def test_more_outputs_than_a_segment_holds_come_out_the_same():
    # two steps make about 0.006 of time
    crowd = np.sort([*TIMES[:4], *np.linspace(0.15, 0.16, 20)])
    found = solve(stopping(run__outputs=crowd)).dataset
    np.testing.assert_array_equal(found["time"][:-1], crowd)
    for part in np.split(crowd, 3):
        expected = solve(stopping(run__outputs=part)).dataset
        assert len(expected["time"]) == 9
        xr.testing.assert_equal(found.sel(time=part), expected.sel(time=part))


def test_memory_does_not_grow_with_the_outputs(tmp_path, monkeypatch):
    monkeypatch.setattr("triboflux.result_file.PART", 2**10)

    def peak(outputs):
        tracemalloc.start()
        try:
            wanted = stopping(run__outputs=outputs)
            solve_to_file(wanted, tmp_path / "out.nc", overwrite=True)
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    peak(40)  # imports and compiles
    few, many = peak(40), peak(3000)
    # what grows are a few numbers per output, and what Python has not collected yet
    assert many - few < load(tmp_path / "out.nc").dataset.nbytes / 2


# --- going on -------------------------------------------------------------------------------------


def test_a_run_that_goes_on_ends_as_if_never_interrupted(tmp_path, whole):
    wanted = stopping()
    # the next test stops after each segment in turn
    for count in itertools.count(1, 3):
        path = tmp_path / f"{count}.nc"
        try:
            solve_to_file(wanted, path, interrupted=after(count))
        except InterruptionError as told:
            assert str(told).startswith("the run up to t = ")
            assert f"is in '{path}.checkpoint' and goes on with --resume" in str(told)
            assert not path.exists()
            solve_to_file(wanted, path, resume=True)
            assert_same(load(path), whole)
        else:
            break
    assert count > 5
    assert sorted(os.listdir(tmp_path)) == sorted(f"{i}.nc" for i in range(1, count + 1, 3))


def test_a_run_may_be_interrupted_after_every_segment(tmp_path, whole):
    interruptions, told = 0, ""
    # until only the writing of the result is left
    while "up to t = 0.188442 " not in told:
        with pytest.raises(InterruptionError) as stopped:
            solve_to_file(stopping(), tmp_path / "out.nc", resume=True, interrupted=after(1))
        interruptions, told = interruptions + 1, str(stopped.value)
        assert interruptions < 100
    assert interruptions > 5
    solve_to_file(stopping(), tmp_path / "out.nc", resume=True)
    assert_same(load(tmp_path / "out.nc"), whole)
    assert os.listdir(tmp_path) == ["out.nc"]


def test_two_dimensions_without_a_variance(tmp_path):
    modes = [{"mode": (1, 2), "sine": 0.6}, {"mode": (2, -1), "cosine": 0.5}]
    wanted = case(grid__points=[14, 12], initial__charge=modes, run__outputs=3, model="gradient")
    with pytest.raises(InterruptionError):
        solve_to_file(wanted, tmp_path / "out.nc", interrupted=after(2))
    # the functions of the operator are kept once for all modes of equal |k|
    assert (tmp_path / "out.nc.checkpoint").stat().st_size < 20_000
    solve_to_file(wanted, tmp_path / "out.nc", resume=True)
    assert_same(load(tmp_path / "out.nc"), solve(wanted))


def test_ctrl_c_in_python_keeps_the_run(tmp_path, whole):
    calls = itertools.count()

    def interrupt(progress):
        if next(calls) == 3:
            raise KeyboardInterrupt

    path = tmp_path / "run.checkpoint"
    with pytest.raises(KeyboardInterrupt):
        solve(stopping(), checkpoint=path, on_progress=interrupt)
    assert sorted(os.listdir(tmp_path)) == ["run.checkpoint", "run.checkpoint.outputs"]
    assert_same(solve(stopping(), checkpoint=path, resume=True), whole)
    assert os.listdir(tmp_path) == []


def test_ctrl_c_within_a_segment_loses_that_segment_only(tmp_path, monkeypatch, whole):
    usual, calls = segments.Segments._record, itertools.count()

    def record(*arguments):
        usual(*arguments)
        if next(calls) == 3:
            raise KeyboardInterrupt

    path = tmp_path / "run.checkpoint"
    monkeypatch.setattr(segments.Segments, "_record", record)
    with pytest.raises(KeyboardInterrupt):
        solve(stopping(), checkpoint=path)
    assert_same(solve(stopping(), checkpoint=path, resume=True), whole)


def test_a_checkpoint_is_written_when_it_is_due(tmp_path):
    path, seen = tmp_path / "run.checkpoint", []

    def look(progress):
        seen.append((progress.steps + progress.rejected, path.exists()))

    solve(stopping(), checkpoint=path, checkpoint_steps=5, on_progress=look)
    # the call after a segment comes before its checkpoint
    assert [exists for steps, exists in seen if steps <= 6] == [False] * 3
    assert all(exists for steps, exists in seen if steps > 6)
    seen.clear()
    solve(stopping(), checkpoint=path, on_progress=look)
    assert not any(exists for _, exists in seen)
    solve(stopping(), checkpoint=path, on_progress=look, checkpoint_minutes=0.0)
    assert seen[-1][1]


# --- what is refused ------------------------------------------------------------------------------


@pytest.fixture
def interrupted(tmp_path):
    """Return the output of a run that was interrupted."""
    with pytest.raises(InterruptionError):
        solve_to_file(stopping(), tmp_path / "out.nc", interrupted=after(3))
    return tmp_path / "out.nc"


def listing(path):
    return {file.name: file.read_bytes() for file in path.parent.iterdir()}


def test_an_unfinished_run_is_not_forgotten(interrupted, whole):
    before = listing(interrupted)
    with pytest.raises(InputError, match=r"of an unfinished run exists: continue it with --resume"):
        solve_to_file(stopping(), interrupted)
    assert listing(interrupted) == before
    solve_to_file(stopping(), interrupted, overwrite=True)
    assert_same(load(interrupted), whole)


@pytest.mark.parametrize(
    ("damage", "expected"),
    [
        (lambda c, o: c.write_bytes(c.read_bytes()[:-1]), "is damaged: its checksum or its length"),
        (lambda c, o: c.write_bytes(b"hello"), "is no checkpoint of triboflux"),
        (lambda c, o: o.unlink(), "outputs '.*' of the checkpoint is missing"),
        (lambda c, o: o.write_bytes(b""), "does not belong to the checkpoint"),
        (lambda c, o: o.write_bytes(o.read_bytes()[:-9]), "it ends before record"),
    ],
)
def test_a_damaged_checkpoint_is_refused_and_left_alone(interrupted, damage, expected):
    names = [
        interrupted.with_name(f"out.nc.{kind}") for kind in ("checkpoint", "checkpoint.outputs")
    ]
    damage(*names)
    before = listing(interrupted)
    with pytest.raises(InputError, match=expected) as refused:
        solve_to_file(stopping(), interrupted, resume=True)
    assert "\n" not in str(refused.value)
    assert listing(interrupted) == before


def test_a_damaged_output_is_found_at_the_end(interrupted):
    path = interrupted.with_name("out.nc.checkpoint.outputs")
    content = bytearray(path.read_bytes())
    content[-100] ^= 1
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"is damaged in record \d+; the run up to t = 0\.18"):
        solve_to_file(stopping(), interrupted, resume=True)
    assert not interrupted.exists()


def test_a_checkpoint_of_another_case_is_refused(interrupted):
    other = stopping(run__atol=1e-8)
    with pytest.raises(InputError, match=r"in it run\.atol is 1e-09, in this one it is 1e-08\.$"):
        solve_to_file(other, interrupted, resume=True)


def test_a_failure_before_anything_is_computed_leaves_nothing(tmp_path):
    wrong = case(run__stop_at_peak_charge=1.5)
    with pytest.raises(InputError, match="stop_at_peak_charge"):
        solve_to_file(wrong, tmp_path / "out.nc")
    assert os.listdir(tmp_path) == []


def test_a_failure_while_the_result_is_written_keeps_the_run(tmp_path, monkeypatch, whole):
    def full(*arguments):
        raise OSError(28, "No space left on device")

    told = r"No space left.*; the run up to t = 0\.188442 is in"
    with monkeypatch.context() as broken, pytest.raises(TribofluxError, match=told):
        broken.setattr("triboflux.result_file.write_in_parts", full)
        solve_to_file(stopping(), tmp_path / "out.nc")
    made = []
    monkeypatch.setattr(segments, "_advance", lambda *arguments: made.append(arguments))
    solve_to_file(stopping(), tmp_path / "out.nc", resume=True)
    assert made == []
    assert_same(load(tmp_path / "out.nc"), whole)
