"""Records of outputs: written one by one, read after any end of a run."""

import os

import numpy as np
import pytest

from triboflux.errors import InputError, TribofluxError
from triboflux.record_file import RecordFile

LAYOUT = {"time": (), "charge": (2, 3), "none": (0,)}


def record(index):
    values = np.random.default_rng(index).normal(size=(2, 3))
    return {"time": np.array(float(index)), "charge": values, "none": np.zeros(0)}


def assert_holds(records, indices):
    assert len(records) == len(indices)
    for place, index in enumerate(indices):
        found, expected = records[place], record(index)
        assert list(found) == list(LAYOUT)
        for name, values in expected.items():
            np.testing.assert_array_equal(found[name], values)
            assert found[name].shape == LAYOUT[name]
    with pytest.raises(IndexError):
        records[len(indices)]


@pytest.fixture
def path(tmp_path):
    with RecordFile(tmp_path / "outputs", LAYOUT, "run 1") as records:
        for index in range(4):
            records.append(record(index))
        records.synchronise()
        assert_holds(records, [0, 1, 2, 3])
    return tmp_path / "outputs"


def test_records_beyond_the_count_are_written_over(path):
    with RecordFile(path, LAYOUT, "run 1", 2) as records:
        assert_holds(records, [0, 1])
        records.append(record(7))
        assert_holds(records, [0, 1, 7])
        records.remove()
    assert not path.exists()


def test_a_new_run_forgets_the_records_of_another(path):
    with RecordFile(path, LAYOUT, "run 2") as records:
        assert_holds(records, [])


def test_what_does_not_fit_the_checkpoint_is_refused(path):
    for run, layout in (("run 2", LAYOUT), ("run 1", LAYOUT | {"charge": (3, 2)})):
        with pytest.raises(InputError, match=r"^outputs '.*' does not belong to the checkpoint\.$"):
            RecordFile(path, layout, run, 1)
    with pytest.raises(InputError, match=r"is damaged: it ends before record 5\.$"):
        RecordFile(path, LAYOUT, "run 1", 5)
    path.unlink()
    with pytest.raises(InputError, match=r"of the checkpoint is missing\.$"):
        RecordFile(path, LAYOUT, "run 1", 1)


def test_every_flipped_bit_of_a_record_is_found(path):
    whole = path.read_bytes()
    size = 8 * 7 + 8
    for place in range(len(whole) - size, len(whole)):
        changed = bytearray(whole)
        changed[place] ^= 4
        path.write_bytes(changed)
        with RecordFile(path, LAYOUT, "run 1", 4) as records:
            records[2]
            with pytest.raises(InputError, match=r"is damaged in record 3\.$"):
                records[3]


def test_records_in_another_order_are_found(path):
    whole = path.read_bytes()
    size = 8 * 7 + 8
    path.write_bytes(whole[: -2 * size] + whole[-size:] + whole[-2 * size : -size])
    with RecordFile(path, LAYOUT, "run 1", 4) as records, pytest.raises(InputError):
        records[2]


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs a device that is always full")
def test_a_full_disk_is_named():
    with pytest.raises(TribofluxError, match=r"can't be written: No space left on device\.$"):
        RecordFile("/dev/full", LAYOUT, "run 1")


def test_a_folder_that_vanished_is_named(tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()
    with RecordFile(folder / "outputs", LAYOUT, "run 1") as records:
        records.append(record(0))
        (folder / "outputs").unlink()
        folder.rmdir()
        with pytest.raises(TribofluxError, match=r"can't be written: No such file or directory"):
            records.append(record(1))
        assert_holds(records, [0])
    with pytest.raises(TribofluxError, match="No such file"):
        RecordFile(folder / "outputs", LAYOUT, "run 1")
