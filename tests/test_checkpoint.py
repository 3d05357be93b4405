"""Checkpoints: what is written is read, anything else is refused in one sentence."""

import hashlib
import json
import os
import subprocess
import time
import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.faults import on_small_disk
from tests.processes import command, surroundings
from triboflux import checkpoint
from triboflux.checkpoint import Checkpoint
from triboflux.errors import InputError, TribofluxError

CASE = 'model = "full"\n\n[run]\nt_end = 1.0\nrtol = 1e-06\n'
VERSIONS = {"triboflux": "0.1.0", "numpy": "2.4.0"}
KNOWN = {"kind": "solve", "case_toml": CASE, "versions": VERSIONS}
ARRAYS = {
    "charge": np.random.default_rng(1).normal(size=(2, 3, 4)),
    "step": np.array(0.1),
    "nothing": np.zeros((3, 0)),
    "numbers": np.arange(5, dtype=np.uint64),
    "alive": np.array([True, False]),
    "modes": np.array([1j, 2.0 - 1j, np.nan]),
}
MAGIC = b"triboflux checkpoint\n"


def sample(**changes):
    metadata = {"steps": 12, "random": 2**127 + 1, "list": [1.5, None, "x"]}
    return Checkpoint(**(KNOWN | {"arrays": ARRAYS, "metadata": metadata} | changes))


def sealed(header, payload=b""):
    """Return the bytes of a file with a right checksum, whatever it says."""
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    content = MAGIC + len(text).to_bytes(8, "little") + text + payload
    return content + hashlib.blake2b(content, digest_size=32).digest()


def header(arrays, **changes):
    table = {"format_version": 1, "metadata": {}, "arrays": arrays} | KNOWN | changes
    return {key: value for key, value in table.items() if value is not None}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "out.nc.checkpoint"


def refusal(path, content):
    path.write_bytes(content)
    with pytest.raises(InputError) as refused:
        checkpoint.read(path, **KNOWN)
    sentence = str(refused.value)
    assert sentence.startswith("checkpoint '")
    assert sentence.endswith(".")
    assert "\n" not in sentence
    return sentence


# --- what is written is read ----------------------------------------------------------------------


def test_what_is_written_is_read(path):
    checkpoint.write(path, sample())
    found = checkpoint.read(path, **KNOWN)
    assert (found.kind, found.case_toml, found.versions) == ("solve", CASE, VERSIONS)
    assert found.metadata == sample().metadata
    assert list(found.arrays) == list(ARRAYS)
    for name, values in ARRAYS.items():
        np.testing.assert_array_equal(found.arrays[name], values)
        assert found.arrays[name].dtype == values.dtype
        assert found.arrays[name].shape == values.shape
        found.arrays[name][...] = 0  # a run goes on with them


def test_the_layout_in_memory_does_not_matter(path):
    values = np.arange(12.0).reshape(3, 4)
    checkpoint.write(path, sample(arrays={"turned": values.T, "big": values.astype(">f8")}))
    found = checkpoint.read(path, **KNOWN).arrays
    np.testing.assert_array_equal(found["turned"], values.T)
    np.testing.assert_array_equal(found["big"], values)


def test_a_checkpoint_replaces_the_one_before_and_leaves_nothing_else(path):
    for steps in (1, 2):
        checkpoint.write(path, sample(metadata={"steps": steps}))
    assert checkpoint.read(path, **KNOWN).metadata == {"steps": 2}
    assert os.listdir(path.parent) == [path.name]
    path.with_name(f".{path.name}.partial").write_bytes(b"half")
    checkpoint.remove(path)
    checkpoint.remove(path)
    assert os.listdir(path.parent) == []


def test_objects_are_not_stored(path):
    with pytest.raises(TypeError, match="object"):
        checkpoint.write(path, sample(arrays={"x": np.array([{}])}))
    assert os.listdir(path.parent) == []


# --- anything else is refused ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"kind": "kinetic"}, "belongs to a run of 'kinetic', not of 'solve'."),
        (
            {"versions": VERSIONS | {"numpy": "1.0"}},
            "was written with numpy '1.0', but this is '2.4.0': "
            "resume it with that version or start anew.",
        ),
        (
            {"case_toml": CASE.replace("1e-06", "1e-07")},
            "belongs to another case: in it run.rtol is 1e-07, in this one it is 1e-06.",
        ),
        (
            {"case_toml": CASE + "atol = 1.0\n"},
            "belongs to another case: in it run.atol is 1.0, in this one it is not given.",
        ),
        ({"case_toml": "= ="}, "belongs to another case: its case is unreadable."),
    ],
)
def test_a_checkpoint_of_something_else_is_refused(path, changes, expected):
    checkpoint.write(path, sample(**changes))
    assert refusal(path, path.read_bytes()) == f"checkpoint '{path}' {expected}"


@given(data=st.data())
def test_damaged_bytes_are_always_refused(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "damaged"
    checkpoint.write(path, sample())
    whole = path.read_bytes()
    kind = data.draw(st.sampled_from(["flip", "cut", "longer", "swap"]))
    place = data.draw(st.integers(0, len(whole) - 1))
    if kind == "flip":
        changed = bytearray(whole)
        changed[place] ^= data.draw(st.integers(1, 255))
    elif kind == "cut":
        changed = whole[:place]
    elif kind == "longer":
        changed = whole[:place] + data.draw(st.binary(min_size=1, max_size=40)) + whole[place:]
    else:
        changed = whole[place:] + whole[:place]
    if bytes(changed) != whole:
        refusal(path, bytes(changed))


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"triboflux",
        b"\x89HDF\r\n\x1a\n" + bytes(200),
        bytes(1000),
        MAGIC,
        MAGIC + b"\xff" * 8,
        MAGIC + (2**62).to_bytes(8, "little") + bytes(100),
        sealed(b"[" * 100_000),
        sealed(b"\xff\xfe"),
        sealed(header([], kind=None)),
        sealed(header([], metadata=[])),
        sealed(header([], format_version="1")),
        sealed(header([["x", "<f8", [2**61]]])),
        sealed(header([["x", "<f8", [2**28]]])),
        sealed(header([["x", "<f8", [2**39, 2**39, 2**39]]])),
        sealed(header([["x", "<f8", [-1]]]), bytes(8)),
        sealed(header([["x", "<f8", [-1, -1]]]), bytes(8)),
        sealed(header([["x", "<f8", [True]]]), bytes(8)),
        sealed(header([["x", "<f8", [1.0]]]), bytes(8)),
        sealed(header([["x", "|O", [1]]]), bytes(8)),
        sealed(header([["x", "<f8"]]), bytes(8)),
        sealed(header([["x", "<f8", [0, *[2**39] * 20]]])),
        sealed(header([["x", "<f8", [2]]]), bytes(8)),
        sealed(header([["x", "<f8", [1]]]), bytes(9)),
    ],
)
def test_foreign_and_hostile_files_are_refused_without_allocating(path, content):
    tracemalloc.start()
    try:
        refusal(path, content)
        assert tracemalloc.get_traced_memory()[1] < 2**24
    finally:
        tracemalloc.stop()


def test_a_newer_format_is_named(path):
    sentence = refusal(path, sealed(header([], format_version=2)))
    assert sentence.endswith("has format_version 2, but this triboflux reads 1.")


def test_what_does_not_fit_the_memory_is_refused(path, monkeypatch):
    checkpoint.write(path, sample())
    monkeypatch.setattr(checkpoint, "available_memory", lambda: 100)
    assert "more than the memory available" in refusal(path, path.read_bytes())


@pytest.mark.skipif(os.name == "nt", reason="needs POSIX files")
def test_what_is_no_file_is_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for name, reason in (
        ("", "is no regular file"),
        ("pipe", "is no regular file"),
        ("none", "does not exist"),
        ("x" * 5000, "can't be read"),
        ("a\0b", "can't be read"),
    ):
        with pytest.raises(InputError, match=reason):
            checkpoint.read(f"{tmp_path}/{name}", **KNOWN)


# --- faults ---------------------------------------------------------------------------------------

WRITE_TWICE = """
import sys
import numpy as np
from triboflux import checkpoint
from triboflux.errors import TribofluxError
known = {"kind": "solve", "case_toml": "", "versions": {}}
for size in (1000, 100_000):
    arrays = {"x": np.full(size, 1.5)}
    try:
        checkpoint.write("c", checkpoint.Checkpoint(arrays=arrays, metadata={"n": size}, **known))
    except TribofluxError as error:
        print(error)
import os
print(checkpoint.read("c", **known).metadata, os.listdir("."))
"""


def test_the_last_checkpoint_survives_a_full_disk(tmp_path):
    done = subprocess.run(
        on_small_disk(command(code=WRITE_TWICE), tmp_path, "200k"),
        env=surroundings(),
        capture_output=True,
        check=False,
        text=True,
        timeout=60,
    )
    assert done.stdout.splitlines() == [
        "checkpoint 'c' can't be written: No space left on device.",
        "{'n': 1000} ['c']",
    ]


def test_the_last_checkpoint_survives_a_limit_on_file_size(tmp_path):
    limited = f"import resource as r; r.setrlimit(r.RLIMIT_FSIZE, (20000, 20000))\n{WRITE_TWICE}"
    done = subprocess.run(
        command(code=limited),
        cwd=tmp_path,
        env=surroundings(),
        capture_output=True,
        check=False,
        text=True,
        timeout=60,
    )
    assert done.stdout.splitlines() == [
        "checkpoint 'c' can't be written: File too large.",
        "{'n': 1000} ['c']",
    ]


WRITE_FOR_EVER = """
import itertools
import numpy as np
from triboflux import checkpoint
for n in itertools.count():
    arrays = {"x": np.full(200_000, float(n))}
    checkpoint.write(
        "c", checkpoint.Checkpoint("solve", "", {}, arrays, {"n": n})
    )
    if n == 2:
        print("writing", flush=True)
"""


def test_a_kill_at_any_moment_leaves_a_whole_checkpoint(tmp_path):
    wait = np.random.default_rng()
    for _ in range(4):
        process = subprocess.Popen(
            command(code=WRITE_FOR_EVER),
            cwd=tmp_path,
            env=surroundings(),
            stdout=subprocess.PIPE,
        )
        assert process.stdout.readline() == b"writing\n"
        time.sleep(wait.uniform(0.0, 0.1))
        process.kill()
        process.communicate()
        found = checkpoint.read(tmp_path / "c", kind="solve", case_toml="", versions={})
        assert (found.arrays["x"] == found.metadata["n"]).all()
        assert set(os.listdir(tmp_path)) <= {"c", ".c.partial"}


def test_a_folder_that_is_gone_is_named(tmp_path):
    with pytest.raises(TribofluxError, match=r"can't be written: No such file or directory\.$"):
        checkpoint.write(tmp_path / "gone" / "c", sample())


# --- schedule -------------------------------------------------------------------------------------


def test_a_checkpoint_is_due_by_time_or_by_steps(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(checkpoint.time, "monotonic", lambda: now[0])
    schedule = checkpoint.Schedule(minutes=2.0, steps=100)
    assert not schedule.due(99)
    assert schedule.due(100)
    now[0] = 120.0
    assert schedule.due(0)
    schedule.written(99)
    assert not schedule.due(198)
    assert schedule.due(199)
    assert not checkpoint.Schedule(minutes=float("inf")).due(10**9)


@pytest.mark.parametrize("options", [{"minutes": -1.0}, {"minutes": float("nan")}, {"steps": 0}])
def test_a_schedule_that_makes_no_sense_is_refused(options):
    with pytest.raises(InputError, match=f"^checkpoint_{next(iter(options))} is "):
        checkpoint.Schedule(**options)
