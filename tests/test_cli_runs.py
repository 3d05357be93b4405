"""Runs from the command line: results, exit codes, interruption, progress, cache."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

from tests.cases import data, fake_result
from tests.processes import command, surroundings, triboflux
from triboflux import cli, terminal
from triboflux.case import Case
from triboflux.errors import TribofluxError
from triboflux.result import load

# Runs the command line with a solver that only pretends.
PRETENDING = """
import sys, time
from types import ModuleType, SimpleNamespace
from tests.cases import fake_result
from triboflux import cli, terminal

def solve_to_file(case, path, *, on_progress, overwrite, **others):
    print("solving", flush=True)
    for step in range(11):
        time.sleep(DELAY)
        if on_progress is not None:
            on_progress(SimpleNamespace(
                time=step / 10, t_end=1.0, steps=step, rejected=0,
                peak_charge=1 - step / 20, fraction=step / 10))
    result = fake_result(case)
    result.to_netcdf(path, overwrite)
    return result

module = sys.modules["triboflux.solve"] = ModuleType("triboflux.solve")
module.solve_to_file = solve_to_file
terminal._PATIENCE = 0.05
cli.main()
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "case.toml").write_text(Case(**data()).to_toml())
    return tmp_path


# ------------------------------------------------------------------ runs


@pytest.fixture
def pretend(monkeypatch):
    """Replace the solver; return a function that calls `main` in this process."""
    monkeypatch.setenv("TRIBOFLUX_CACHE_DIR", "off")

    def call(*arguments, result=fake_result):
        def solve_to_file(case, path, *, on_progress, overwrite, **others):
            assert on_progress is None
            made = result(case)
            made.to_netcdf(path, overwrite)
            return made

        module = ModuleType("triboflux.solve")
        module.solve_to_file = solve_to_file
        monkeypatch.setitem(sys.modules, "triboflux.solve", module)
        monkeypatch.setattr(sys, "argv", ["triboflux", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        return ended.value.code

    return call


def test_run_writes_a_result_and_tells(folder, pretend, capsys):
    out = folder / "out.nc"
    assert pretend("run", folder / "case.toml", "-o", out) == 0
    told = capsys.readouterr()
    assert told.err == "warning: covariance is unrealizable\n"
    assert told.out == (
        "ok: end time; t = 1, peak charge 0.5, steps 12 accepted and 3 rejected; "
        f"written to '{out}'\n"
    )
    assert load(out).case == Case(**data())


def test_overwriting_is_asked_for(folder, pretend):
    out = folder / "out.nc"
    out.write_text("old")
    assert pretend("run", folder / "case.toml", "-o", out, "--overwrite") == 0
    assert load(out).status == "ok"


def test_quiet_run_is_silent(folder, pretend, capsys):
    assert pretend("run", folder / "case.toml", "-o", folder / "out.nc", "--quiet") == 0
    told = capsys.readouterr()
    assert (told.out, told.err) == ("", "")
    assert (folder / "out.nc").is_file()


def test_status_decides_the_exit_code(folder, pretend, capsys):
    def diverged(case):
        return fake_result(case, status="diverged", stop_reason="not finite")

    out = folder / "out.nc"
    assert pretend("run", folder / "case.toml", "-o", out, result=diverged) == 3
    assert capsys.readouterr().out.startswith("diverged: not finite; ")
    assert load(out).status == "diverged"


@pytest.mark.parametrize("error", [TribofluxError("the sky fell."), MemoryError()])
def test_failing_solver_writes_nothing(folder, pretend, capsys, error):
    def fail(case):
        raise error

    assert pretend("run", folder / "case.toml", "-o", folder / "out.nc", result=fail) == 1
    told = capsys.readouterr().err
    assert told.startswith("error: the ")
    assert told.count("\n") == 1
    assert not (folder / "out.nc").exists()


def test_reproduce_prints_what_it_wrote(folder, monkeypatch, capsys):
    monkeypatch.setenv("TRIBOFLUX_CACHE_DIR", "off")
    calls = []

    class Reproduction:
        def __init__(self, folder, numbers=None, *, overwrite=False, workers=None):
            self.folder, self.overwrite, self.workers = folder, overwrite, workers
            self.numbers = (1, 2) if numbers is None else numbers

        def write(self, number, on_progress=None):
            calls.append((number, self.overwrite, self.workers))
            return [self.folder / f"figure{number}.png"]

        def write_summary(self):
            calls.append("summary")
            return [self.folder / "summary.md"]

    module = ModuleType("triboflux.figures")
    module.Reproduction, module.MAP = Reproduction, 2
    kinds = []

    @contextlib.contextmanager
    def progress_bar(*, quiet, kind):
        kinds.append(kind)
        yield None

    monkeypatch.setattr(terminal, "progress_bar", progress_bar)
    monkeypatch.setitem(sys.modules, "triboflux.figures", module)
    monkeypatch.setattr("triboflux.figures", module, raising=False)
    for arguments in ([], ["--figure", "2", "--overwrite", "--workers", "3"]):
        monkeypatch.setattr(sys, "argv", ["triboflux", "reproduce", "-o", str(folder), *arguments])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        assert ended.value.code == 0
    assert calls == [(1, False, None), (2, False, None), "summary", (2, True, 3)]
    # the figure of maps has points to count
    assert kinds == [terminal.ProgressBar, terminal.MembersBar, terminal.MembersBar]
    names = [Path(line).name for line in capsys.readouterr().out.splitlines()]
    assert names == ["figure1.png", "figure2.png", "summary.md", "figure2.png"]


@pytest.mark.skipif(os.name == "nt", reason="needs POSIX signals")
def test_interrupted_run_leaves_nothing(folder):
    code = PRETENDING.replace("DELAY", "1.0")
    process = subprocess.Popen(
        command("run", "case.toml", "-o", "out.nc", code=code),
        cwd=folder,
        env=surroundings(TRIBOFLUX_CACHE_DIR="off"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "solving\n"
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == 130
    assert errors == "interrupted: nothing was written\n"
    assert sorted(path.name for path in folder.iterdir()) == ["case.toml"]


# ------------------------------------------------------------------ progress and cache


@pytest.mark.skipif(os.name == "nt", reason="needs a POSIX pseudo-terminal")
@pytest.mark.parametrize(
    ("delay", "options", "expected"),
    [("0.05", (), True), ("0.0", (), False), ("0.05", ("--quiet",), False)],
)
def test_progress_bar_on_a_terminal(folder, delay, options, expected):
    import pty

    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        command(
            "run", "case.toml", "-o", "out.nc", *options, code=PRETENDING.replace("DELAY", delay)
        ),
        cwd=folder,
        env=surroundings(TRIBOFLUX_CACHE_DIR="off", TERM="xterm"),
        stdout=subprocess.PIPE,
        stderr=theirs,
    )
    os.close(theirs)
    assert process.wait(30) == 0
    os.set_blocking(ours, False)
    try:
        # what a terminal holds may end within a letter
        drawn = os.read(ours, 100_000).decode(errors="replace")
    except OSError:  # nothing was ever written
        drawn = ""
    finally:
        os.close(ours)
        process.stdout.close()
    assert ("peak charge 0." in drawn) == expected


def test_progress_bar_waits_a_second(monkeypatch):
    clock = iter([0.5, 0.99])
    monkeypatch.setattr(terminal.time, "monotonic", lambda: next(clock))
    monkeypatch.setattr(terminal, "_rich_bar", lambda: pytest.fail("too early"))
    bar = terminal.ProgressBar(since=0.0)
    for fraction in (0.1, 0.2):
        bar(SimpleNamespace(time=0.1, t_end=1.0, peak_charge=1.0, fraction=fraction))
    bar.close()


def test_cache_folder(monkeypatch, tmp_path):
    monkeypatch.setenv("TRIBOFLUX_CACHE_DIR", str(tmp_path))
    assert terminal.cache_folder() == tmp_path
    monkeypatch.setenv("TRIBOFLUX_CACHE_DIR", "off")
    assert terminal.cache_folder() is None
    monkeypatch.delenv("TRIBOFLUX_CACHE_DIR")
    monkeypatch.setenv("LOCALAPPDATA" if os.name == "nt" else "XDG_CACHE_HOME", str(tmp_path))
    assert terminal.cache_folder() == tmp_path / "triboflux" / "jax"


@pytest.mark.parametrize("kind", ["folder", "unwritable", "jax"])
def test_cache_is_set_up_in_silence(folder, kind):
    code = (
        "from triboflux.terminal import use_compilation_cache\n"
        "use_compilation_cache()\n"
        "import jax; print(jax.config.jax_compilation_cache_dir)\n"
    )
    (folder / "file").touch()
    environment = {"TRIBOFLUX_CACHE_DIR": str(folder / ("cache" if kind == "folder" else "file/a"))}
    if kind == "jax":
        environment = {"JAX_COMPILATION_CACHE_DIR": "theirs"}
    else:
        environment["JAX_COMPILATION_CACHE_DIR"] = ""
    done = triboflux(folder=folder, code=code, environment=environment)
    assert (done.returncode, done.stderr) == (0, "")
    expected = {"folder": str(folder / "cache"), "unwritable": "", "jax": "theirs"}[kind]
    assert done.stdout.strip() == expected


# ------------------------------------------------------------------ the real solver

CASE_B = {
    "numbers__tau_c": 0.1,
    "closures": "published",
    "grid__points": [64],
    "run__stop_at_peak_charge": 0.5,
}


@pytest.mark.slow
def test_real_run(folder):
    (folder / "case.toml").write_text(Case(**data(**CASE_B)).to_toml())
    done = triboflux("run", "case.toml", "-o", "out.nc", folder=folder)
    assert done.returncode == 0
    assert done.stdout.startswith("ok: peak charge fell to 0.5; t = 0.1653")
    assert " None " not in done.stdout
    warnings = done.stderr.splitlines()[:-1]
    assert warnings
    assert all(line.startswith("warning: ") for line in warnings)
    result = load(folder / "out.nc")
    assert float(result.dataset["peak_charge"][-1]) == pytest.approx(0.5, abs=1e-6)
    assert result.case == Case(**data(**CASE_B))
    assert sorted(path.name for path in folder.iterdir()) == ["case.toml", "out.nc"]


def test_stop_value_above_the_initial_peak(folder):
    (folder / "case.toml").write_text(Case(**data(run__stop_at_peak_charge=1.5)).to_toml())
    done = triboflux("run", "case.toml", "-o", "out.nc", folder=folder)
    assert done.returncode == 1
    assert done.stderr.startswith("error: run.stop_at_peak_charge")
    assert done.stderr.count("\n") == 2
    assert not (folder / "out.nc").exists()


@pytest.mark.skipif(os.name == "nt", reason="needs POSIX signals")
def test_real_run_is_interrupted_while_it_compiles(folder):
    case = Case(**data(grid__points=[64, 64, 64], initial__charge=[], run__outputs=1))
    (folder / "case.toml").write_text(case.to_toml())
    process = subprocess.Popen(
        command("run", "case.toml", "-o", "out.nc", code="from triboflux.cli import main; main()"),
        cwd=folder,
        env=surroundings(TRIBOFLUX_CACHE_DIR="off"),
        stderr=subprocess.PIPE,
        text=True,
    )
    time.sleep(4)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 130
    assert errors == "interrupted: nothing was written\n"
    assert sorted(path.name for path in folder.iterdir()) == ["case.toml"]
