"""What has to hold of every case file that is run, and of every one that is refused."""

import itertools
import tempfile
from pathlib import Path

import numpy as np

from tests.in_process import call, names, sentence_of
from tests.test_long_runs import assert_same
from triboflux import simulate, simulate_to_file, solve, solve_to_file
from triboflux.case import Case
from triboflux.case_checks import mean_of_modes
from triboflux.checkpoint import InterruptionError
from triboflux.errors import InputError
from triboflux.result import load

STATUSES = ("ok", "nonphysical", "diverged")
COMMANDS = {
    "run": ("-o", "out.nc"),
    "kinetic": ("-o", "out.nc"),
    "compare": ("-o", "out"),
    "chart": ("-o", "out"),
    "numbers": (),
    "export": ("--language", "c", "-o", "out.h"),
}
"""The commands that read a case, and where they would write."""


def check_run(text, segments=1):
    """Run a case that is allowed, see what has to hold, and return how it ended.

    Parameters
    ----------
    text : str
        Of the case; with a table ``[kinetic]`` its particles are simulated.
    segments : int
        After so many the run is interrupted, and goes on.
    """
    with tempfile.TemporaryDirectory() as folder:
        return _check_run(text, Path(folder), segments)


def _check_run(text, folder, segments):
    path, out = folder / "case.toml", folder / "out.nc"
    path.write_text(text, encoding="utf-8", newline="")
    case = Case.from_toml(path)
    command = "run" if case.kinetic is None else "kinetic"
    ended = call(command, path, "-o", out)
    if ended.code == 1:
        assert sentence_of(ended).startswith("numbers: "), ended
        assert names(folder) == ["case.toml"]
        return "out of range"
    result = load(out)
    assert result.status in STATUSES
    assert ended.code == (0 if result.status == "ok" else 3)
    assert ended.output.startswith(f"{result.status}: {result.stop_reason}; t = ")
    assert names(folder) == ["case.toml", "out.nc"]
    check_fields(case, result)
    compute = (solve, solve_to_file) if case.kinetic is None else (simulate, simulate_to_file)
    assert_equal(result, compute[0](case))
    out.unlink()
    asked = itertools.count(1)
    try:
        compute[1](case, out, interrupted=lambda: next(asked) >= segments)
    except InterruptionError:
        assert names(folder) == ["case.toml", "out.nc.checkpoint", "out.nc.checkpoint.outputs"]
        assert call(command, path, "-o", out, "--resume").code == ended.code
    assert_equal(load(out), result)
    assert names(folder) == ["case.toml", "out.nc"]
    return result.status


def check_fields(case, result):
    """See that everything is finite and that no charge has come or gone."""
    closed = ("covariance", "variance", "realizability_margin")
    for name, values in result.dataset.variables.items():
        # an algebraic closure may have no value anywhere, which is why such a run ends at once
        if name in closed and case.model == "algebraic" and result.status != "ok":
            continue
        assert np.isfinite(values.values).all(), name
    if case.kinetic is not None:
        # what is shown is averaged over ensembles, whose densities differ
        # the drift is relative to the charges at first, which may grow outside the closures' range
        peaks = result.dataset["peak_charge"].values
        assert result.stats["charge_drift"] <= 1e-12 * max(1.0, peaks.max() / max(peaks[0], 1e-30))
    else:
        charge = result.dataset["charge"]
        means = charge.mean([name for name in charge.dims if name != "time"]).values
        expected = mean_of_modes(case.initial.charge)
        assert np.abs(means - expected).max() <= 1e-12 * float(np.abs(charge).max())
    times = result.dataset["time"].values
    assert (np.diff(times) > 0.0).all()
    assert times[-1] <= case.run.t_end


def assert_equal(left, right):
    """Compare two results bit for bit, but for what tells of clocks."""
    if "method" not in left.dataset.attrs:
        assert_same(left, right)
        return
    assert left.dataset.drop_attrs().identical(right.dataset.drop_attrs())
    numbers = [{k: v for k, v in r.stats.items() if k != "seconds"} for r in (left, right)]
    assert numbers[0] == numbers[1]


def check_wrong(text, told, surely, command="run"):
    """Give a command a case with something wrong, and return whether it was refused.

    Parameters
    ----------
    text, told, surely
        From `whole_cases.wrong_texts`.
    command : str
        One of `COMMANDS`.
    """
    with tempfile.TemporaryDirectory() as folder:
        return _check_wrong(text, told, surely, Path(folder), command)


def _check_wrong(text, told, surely, folder, command):
    path = folder / "case.toml"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    try:
        Case.from_toml(path)
    except InputError as error:
        refused = str(error)
    else:
        assert not surely
        return False
    options = [folder / word if word.startswith("out") else word for word in COMMANDS[command]]
    ended = call(command, path, *options)
    # these read the suspension only, and may find nothing wrong
    if command in ("numbers", "export") and ended.code == 0:
        return True
    sentence = sentence_of(ended)
    assert names(folder) == ["case.toml"]
    if command in ("run", "kinetic"):
        assert sentence == refused
        assert not told or any(word in sentence for word in told), (told, sentence)
    return True
