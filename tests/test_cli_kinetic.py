"""The kinetic command, in processes of its own."""

import re
import signal
import subprocess
import time

import pytest

from tests.processes import command, surroundings, triboflux
from triboflux.result import load

CASE = """
[numbers]
peclet = 1e6
tau_c = 0.05
energy_ratio = 30.0
length_ratio = 192.0
restitution = 1.0

[grid]
points = [16]

[initial]
charge = [ { mode = [1], sine = -1.0 } ]

[run]
t_end = 0.6
outputs = 4

[kinetic]
particles = 20_000
ensembles = 2
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "case.toml").write_text(CASE)
    return tmp_path


def test_writes_what_load_reads(folder):
    done = triboflux("kinetic", "case.toml", "-o", "out.nc", folder=folder)
    assert done.returncode == 0
    assert re.match(r"ok: reached t_end = 0.6; t = 0.6, .* collisions .*; written to", done.stdout)
    result = load(folder / "out.nc")
    assert result.dataset.attrs["method"] == "kinetic"
    assert result.stats["collisions_per_particle"] == pytest.approx(12.0, rel=0.02)
    assert sorted(path.name for path in folder.iterdir()) == ["case.toml", "out.nc"]


def test_goes_on_after_sigkill_and_sigterm_as_if_nothing_had_happened(folder):
    whole = triboflux("kinetic", "case.toml", "-o", "whole.nc", folder=folder)
    assert whole.returncode == 0
    checkpoint = folder / "out.nc.checkpoint"
    arguments = ["kinetic", "case.toml", "-o", "out.nc", "--checkpoint-steps", "1", "--resume"]
    # 192 steps, in four intervals of one segment each, leave little time between them
    (folder / "case.toml").write_text(CASE.replace("outputs = 4", "outputs = 40"))
    reference = triboflux("kinetic", "case.toml", "-o", "whole.nc", "--overwrite", folder=folder)
    assert reference.returncode == 0
    for number in (signal.SIGKILL, signal.SIGTERM):
        running = subprocess.Popen(
            command(*arguments),
            cwd=folder,
            env=surroundings(),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        before = checkpoint.stat().st_mtime_ns if checkpoint.exists() else 0
        while running.poll() is None:
            if checkpoint.exists() and checkpoint.stat().st_mtime_ns > before:
                break
            time.sleep(0.002)
        running.send_signal(number)
        _, told = running.communicate(timeout=60)
        assert "Traceback" not in told
        assert running.returncode == (-9 if number == signal.SIGKILL else 143)
        assert checkpoint.exists()
    done = triboflux(*arguments, folder=folder)
    assert done.returncode == 0
    ours, theirs = load(folder / "out.nc"), load(folder / "whole.nc")
    assert ours.dataset.drop_attrs().identical(theirs.dataset.drop_attrs())
    assert ours.stats["collisions"] == theirs.stats["collisions"]
    assert not checkpoint.exists()


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (("particles = 20_000", "particles = 100"), "kinetic.particles is 100, but must be"),
        (("[kinetic]", "[kinetics]"), "kinetics .* Did you mean 'kinetic'"),
        (("ensembles = 2", "ensembles = 2\nthermostat = 'on'"), "kinetic.thermostat is 'on'"),
        (("points = [16]", "points = [2048]"), "kinetic.particles is 20000, but must be at least"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(folder, change, sentence):
    (folder / "case.toml").write_text(CASE.replace(*change))
    done = triboflux("kinetic", "case.toml", "-o", "out.nc", folder=folder)
    assert done.returncode == 1
    lines = done.stderr.splitlines()[:-1]
    assert len(lines) == 1
    assert re.search(sentence, lines[0])
    assert [path.name for path in folder.iterdir()] == ["case.toml"]


def test_help_has_an_example_and_loads_nothing_heavy(folder):
    done = triboflux("kinetic", "--help", folder=folder)
    assert "Example: triboflux kinetic examples/particles.toml" in done.stdout
    assert done.stderr.strip() == "[]"
