"""NetCDF files that accidents have changed: refused in one sentence, in bounded time and memory."""

import os

import netCDF4
import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.cases import data, fake_result
from tests.mutated_bytes import FOREIGN, mutated
from triboflux import netcdf_file
from triboflux.case import Case
from triboflux.errors import InputError, TribofluxError
from triboflux.netcdf_file import require_readable, sealed_at_once
from triboflux.result import load
from triboflux.suitability_file import load as load_map

SEAL = 48


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """Return the path of a good result."""
    path = tmp_path_factory.mktemp("good") / "out.nc"
    fake_result(Case(**data(grid__points=[4]))).to_netcdf(path)
    return path


@pytest.fixture
def never_examined(monkeypatch):
    monkeypatch.setattr(netcdf_file, "_examine", lambda *_: pytest.fail("a process was started"))


def refusal(path, content, read=load):
    """Return the sentence with which some bytes are refused."""
    path.write_bytes(content)
    with pytest.raises(InputError) as refused:
        read(path)
    sentence = str(refused.value)
    assert sentence.isprintable()
    assert sentence.startswith(f"{'result' if read is load else 'map'} '{path}' ")
    return sentence


# --- good files -----------------------------------------------------------------------------------


def test_sealed_files_are_read_at_once_and_by_other_programs(good, never_examined):
    import h5py

    assert load(good).status == "ok"
    with h5py.File(good) as file, xr.open_dataset(good) as dataset:
        np.testing.assert_array_equal(file["charge"], dataset["charge"])


@pytest.mark.parametrize("kind", ["NETCDF3_64BIT", "NETCDF4"])
def test_files_that_other_programs_wrote_or_edited_are_read(good, tmp_path, kind):
    path, whole = tmp_path / "theirs.nc", load(good)
    if kind == "NETCDF4":
        path.write_bytes(good.read_bytes())
        with netCDF4.Dataset(path, "a") as file:
            file["charge"][0, 0] = 7.0
    else:
        changed = whole.dataset.copy(deep=True)
        changed["charge"][0, 0] = 7.0
        changed.to_netcdf(path, format=kind)
    found = load(path)
    assert float(found.dataset["charge"][0, 0]) == 7.0
    np.testing.assert_array_equal(found.dataset["field"], whole.dataset["field"])
    # what is edited has lost the checksum, and is not taken for something damaged
    assert b"triboflux sealed" not in path.read_bytes()[-SEAL:]


# --- damaged files --------------------------------------------------------------------------------


@given(chance=st.randoms(use_true_random=False))
@settings(max_examples=50)
def test_a_changed_file_with_a_checksum_is_never_read(good, chance):
    content = mutated(good.read_bytes()[:-SEAL], chance)
    path = good.with_name("changed.nc")
    if content in FOREIGN:
        return
    path.write_bytes(content + good.read_bytes()[-SEAL:])
    with pytest.raises(InputError, match=r"is damaged: its checksum is wrong\.$"):
        load(path)


@given(chance=st.randoms(use_true_random=False))
@settings(max_examples=8)
def test_a_changed_file_without_a_checksum_is_read_or_refused(good, chance):
    path = good.with_name("theirs.nc")
    path.write_bytes(mutated(good.read_bytes()[:-SEAL], chance))
    try:
        assert isinstance(load(path).status, str)
    except InputError as refused:
        assert str(refused).isprintable()


def test_files_of_other_kinds_are_refused(tmp_path):
    # some look like NetCDF from their first bytes, and are left to a process of their own
    for content in FOREIGN[::3]:
        assert "is no readable NetCDF file" in refusal(tmp_path / "a.nc", content)
    assert "is no readable NetCDF file" in refusal(tmp_path / "a.nc", FOREIGN[2], load_map)


def test_a_file_that_keeps_the_library_busy_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(netcdf_file, "_PATIENCE", 2.0)
    path = tmp_path / "endless.nc"
    with netCDF4.Dataset(path, "w") as file:
        file.createDimension("x", 2)
        file.createVariable("v", "f8", ("x",))[:] = 1.0
    content = path.read_bytes()
    # an object of size zero in the heap that names the dimensions: HDF5 looks at it again and again
    size = content.index(b"GCOL") + 24
    told = refusal(path, content[:size] + bytes(8) + content[size + 8 :])
    # later versions of HDF5 may notice it
    assert told.endswith("does not end.") or "is no readable NetCDF file" in told


@pytest.mark.skipif(os.name == "nt", reason="needs POSIX signals")
@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ("while True: pass", "a process that tries to read it does not end."),
        ("os.kill(os.getpid(), signal.SIGSEGV)", "a process that tries to read it dies."),
        ("time.sleep(60)", "reading it does not end."),
        ("bytearray(2**40)", "no readable NetCDF file: MemoryError."),
        ("raise KeyError('a\\x1b[31m\\n b')", r"no readable NetCDF file: 'a\\x1b[31m\\n b'."),
    ],
)
def test_whatever_becomes_of_reading_is_told(good, monkeypatch, body, sentence):
    usual = netcdf_file._EXAMINE.replace("main(*sys.argv[2:])", "")
    code = f"{usual}\nfrom triboflux import netcdf_probe as probe\nimport os, signal, time\n"
    code += f"def read(path, memory):\n    {body}\nprobe._read = read\nmain(*sys.argv[2:])"
    monkeypatch.setattr(netcdf_file, "_EXAMINE", code)
    monkeypatch.setattr(netcdf_file, "_PATIENCE", 1.0)
    monkeypatch.setattr(netcdf_file, "_WAIT", 3 if "sleep" in body else 60)
    monkeypatch.setattr(netcdf_file, "available_memory", lambda: 2**33)
    path = good.with_name("theirs.nc")
    assert refusal(path, good.read_bytes()[:-SEAL]).endswith(sentence)


def test_declared_sizes_are_refused_before_anything_is_allocated(tmp_path):
    path = tmp_path / "large.nc"
    with netCDF4.Dataset(path, "w") as file:
        file.createDimension("time", 2**40)
        # a coordinate, which xarray reads at once
        file.createVariable("time", "f8", ("time",), chunksizes=[1024])
        file.format_version = 1
    assert path.stat().st_size < 20_000
    told = refusal(path, path.read_bytes())
    assert told.endswith("it holds 8,796,093,022,208 bytes, more than the memory available.")


def test_a_file_that_cannot_be_sealed_is_not_left_behind(tmp_path):
    with (
        pytest.raises(TribofluxError, match=r"^output '.*a\.nc' can't be written: .*No such file"),
        sealed_at_once(tmp_path / "a.nc"),
    ):
        pass  # writes nothing
    assert os.listdir(tmp_path) == []


def test_what_is_not_there_is_named(tmp_path):
    with pytest.raises(InputError, match=r"^it can't be read: No such file or directory\.$"):
        require_readable(tmp_path / "none.nc", "it")
    with pytest.raises(InputError, match=r"^map '.*none\.nc' is missing\.$"):
        load_map(tmp_path / "none.nc")
