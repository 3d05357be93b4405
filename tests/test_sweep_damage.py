"""Stores of sweeps that accidents have changed: as they were, or refused in one sentence."""

import json
import shutil

import pytest
import xarray as xr
import zarr
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.mutated_bytes import mutated
from tests.sweeps import pretend, tables
from triboflux import sweep_layout, sweep_runners
from triboflux.errors import InputError, TribofluxError
from triboflux.sweep import Sweep, sweep
from triboflux.sweep_store import readable

MEMBERS = Sweep(**tables())


@pytest.fixture(scope="module", autouse=True)
def pretending():
    """Let members be computed in this process, at once."""

    def compute(tasks, count):
        return ((index, json.loads(pretend(text))) for index, text in tasks)

    with pytest.MonkeyPatch.context() as changed:
        changed.setattr(sweep_runners, "on_processes", compute)
        yield


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return the path of a complete store and what it holds."""
    path = tmp_path_factory.mktemp("whole") / "s.zarr"
    return path, sweep(MEMBERS, path).load()


def opened(path):
    """Return all that a store holds, as the chart reads it."""
    with sweep(MEMBERS, path) as dataset, readable("store 's'"):
        return dataset.load()


def refusal(path):
    with pytest.raises(InputError) as refused:
        opened(path)
    assert str(refused.value).isprintable()
    assert str(refused.value).startswith("store '")
    return str(refused.value)


@given(chance=st.randoms(use_true_random=False))
@settings(max_examples=25)
def test_a_changed_store_is_refused_or_what_it_was(whole, chance):
    good, held = whole
    path = good.with_name("changed.zarr")
    shutil.rmtree(path, ignore_errors=True)
    shutil.copytree(good, path)
    file = chance.choice(sorted(file for file in path.rglob("*") if file.is_file()))
    file.write_bytes(mutated(file.read_bytes(), chance))
    try:
        assert opened(path).equals(held)
    except InputError as refused:
        assert str(refused).isprintable()


@pytest.mark.parametrize(
    ("name", "change", "sentence"),
    [
        ("charge", {"shape": [2**40, 3, 16]}, "its array charge is described wrongly"),
        ("status", {"shape": [2**40, 2**20]}, "its array status is described wrongly"),
        ("peclet", {"shape": [2**40]}, "its array peclet is described wrongly"),
        ("charge", {"attributes": {"scale_factor": "x"}}, "its array charge is described wrongly"),
        ("charge", {"codecs": []}, "is no store of a sweep"),
    ],
)
def test_sizes_are_refused_before_anything_is_allocated(whole, name, change, sentence):
    path = whole[0].with_name("sizes.zarr")
    shutil.rmtree(path, ignore_errors=True)
    shutil.copytree(whole[0], path)
    about = json.loads((path / "zarr.json").read_text())
    about["consolidated_metadata"]["metadata"][name] |= change
    (path / "zarr.json").write_text(json.dumps(about))
    assert sentence in refusal(path)


def test_a_flipped_bit_of_a_chunk_is_found(whole):
    path = whole[0].with_name("chunk.zarr")
    shutil.copytree(whole[0], path)
    chunk = next(file for file in (path / "variance" / "c").rglob("*") if file.is_file())
    content = bytearray(chunk.read_bytes())
    content[len(content) // 2] ^= 1
    chunk.write_bytes(content)
    assert "is damaged (Stored and computed checksum do not match" in refusal(path)


def test_unreadable_versions(whole):
    path = whole[0].with_name("versions.zarr")
    shutil.copytree(whole[0], path)
    zarr.open_group(path, mode="r+").attrs["versions_json"] = "{"
    assert "is damaged (Expecting property name" in refusal(path)


def test_stores_of_before_the_checksum_go_on(whole, tmp_path, monkeypatch):
    with monkeypatch.context() as before:
        before.setattr(sweep_layout, "_compressors", lambda: "auto")
        before.setattr(sweep_runners, "on_processes", lambda *_: (_ for _ in ()))
        sweep(MEMBERS, tmp_path / "s.zarr").close()
    xr.testing.assert_equal(opened(tmp_path / "s.zarr"), whole[1])


def test_a_store_that_vanishes_is_told(tmp_path, monkeypatch):
    def compute(work, count):
        for index, text in work:
            yield index, json.loads(pretend(text))
        (tmp_path / "s.zarr").rename(tmp_path / "moved.zarr")

    monkeypatch.setattr(sweep_runners, "on_processes", compute)
    with pytest.raises(TribofluxError, match=r"^store '.*s\.zarr' can't be read: ") as told:
        sweep(MEMBERS, tmp_path / "s.zarr")
    assert str(told.value).isprintable()
