"""The store of a sweep: what it holds, and that nothing is lost or computed twice."""

import json
import random

import numpy as np
import pytest
import xarray as xr

from tests.sweeps import files, pretend, tables
from triboflux import sweep_runners, sweep_store
from triboflux.errors import InputError, TribofluxError
from triboflux.sweep import Sweep, sweep


@pytest.fixture
def pretending(monkeypatch):
    """Let members be computed in this process, at once; return the list of those computed."""
    computed = []

    def compute(tasks, count):
        for index, text in tasks:
            computed.append(index)
            yield index, json.loads(pretend(text))

    monkeypatch.setattr(sweep_runners, "on_processes", compute)
    return computed


# ------------------------------------------------------------------ content


def test_store_opens_as_a_dataset_over_the_grid(tmp_path, pretending):
    members = Sweep(**tables())
    sweep(members, tmp_path / "s.zarr")
    with xr.open_zarr(tmp_path / "s.zarr") as dataset:
        assert dataset.sizes == {"peclet": 4, "tau_c": 3, "x": 16, "component": 1}
        assert dataset["charge"].dims == ("peclet", "tau_c", "x")
        assert dataset["covariance"].dims == ("peclet", "tau_c", "component", "x")
        assert dataset["peclet"].attrs["parameter"] == "numbers.peclet"
        one = dataset.sel(peclet=1e6, tau_c=1e-3)
        assert float(one["stop_time"]) == 1e6 * 1e-3
        np.testing.assert_array_equal(one["charge"], np.sin(np.arange(16.0) * 1e-3))
        np.testing.assert_array_equal(one["covariance"], np.full((1, 16), 1e-6))
        assert (int(one["accepted"]), int(one["rejected"])) == (10, 1)
        refused = dataset.sel(peclet=1e3, tau_c=1e-2)
        assert str(refused["status"].values) == "refused"
        assert str(refused["stop_reason"].values) == "numbers: out of range."
        assert np.isnan(refused["charge"]).all()
        assert np.isnan(refused["stop_time"])
        assert Sweep.from_toml_text(dataset.attrs["sweep_toml"]) == members
        assert "created" not in dataset.attrs


def test_list_has_one_dimension(tmp_path, pretending):
    parameters = {"numbers.peclet": [1e5, 1e6], "numbers.tau_c": [1e-3, 1e-4]}
    dataset = sweep(Sweep(**tables(mode="list", parameters=parameters)), tmp_path / "s.zarr")
    assert dataset["stop_time"].dims == ("member",)
    np.testing.assert_array_equal(dataset["tau_c"], [1e-3, 1e-4])
    np.testing.assert_allclose(dataset["stop_time"], [100.0, 100.0])


def test_names_and_tables_as_coordinates(tmp_path, pretending):
    parameters = {
        "model": ["full", "gradient"],
        "grid.points": [[16], [32]],
        "run.t_end": [1, 2],
        "numbers.tau_c": [1e-3],
        "numbers.peclet": [1e6],
    }
    dataset = sweep(Sweep(**tables(parameters=parameters)), tmp_path / "s.zarr")
    assert list(map(str, dataset["model"].values)) == ["full", "gradient"]
    assert list(map(str, dataset["points"].values)) == ["[16]", "[32]"]
    # the finest grid decides the shape
    assert dataset.sizes["x"] == 32
    assert "x" not in dataset.coords
    charge = dataset["charge"].sel(model="full", t_end=2, points="[16]").squeeze()
    assert np.isfinite(charge[:16]).all()
    assert np.isnan(charge[16:]).all()


def test_numbers_of_dimensions_do_not_fit_into_one_store(tmp_path, pretending):
    modes = [[{"mode": [1], "sine": 1.0}], [{"mode": [1, 0], "sine": 1.0}]]
    parameters = {"grid.points": [[16], [8, 8]], "initial.charge": modes}
    given = tables(parameters=parameters, mode="list")
    given["case"]["numbers"] |= {"peclet": 1e6, "tau_c": 1e-3}
    with pytest.raises(InputError, match="is swept over numbers of dimensions"):
        sweep(Sweep(**given), tmp_path / "s.zarr")
    assert not (tmp_path / "s.zarr").exists()


# ------------------------------------------------------------------ going on


def test_finished_sweep_does_nothing(tmp_path, pretending):
    members, store = Sweep(**tables()), tmp_path / "s.zarr"
    sweep(members, store)
    assert pretending == list(range(12))
    before = files(store)
    sweep(members, store)
    assert len(pretending) == 12
    assert files(store) == before


def test_only_what_is_missing_is_computed(tmp_path, pretending, monkeypatch):
    members = Sweep(**tables())
    sweep(members, tmp_path / "whole.zarr")
    pretending.clear()

    def first_five(tasks, count):
        for index, text in tasks:
            if index == 5:
                raise TribofluxError("the power failed.")
            yield index, json.loads(pretend(text))

    with monkeypatch.context() as patched:
        patched.setattr(sweep_runners, "on_processes", first_five)
        with pytest.raises(TribofluxError, match="the power failed"):
            sweep(members, tmp_path / "s.zarr")
    with xr.open_zarr(tmp_path / "s.zarr") as dataset:
        assert int((dataset["status"] != "").sum()) == 5
    # what a kill in the middle of a file leaves
    (tmp_path / "s.zarr" / "charge" / "c" / "0.123.partial").write_text("half")
    sweep(members, tmp_path / "s.zarr")
    assert pretending == list(range(5, 12))
    assert files(tmp_path / "s.zarr") == files(tmp_path / "whole.zarr")


def test_order_does_not_matter(tmp_path, pretending, monkeypatch):
    members = Sweep(**tables())
    sweep(members, tmp_path / "a.zarr")

    def shuffled(tasks, count):
        tasks = list(tasks)
        random.Random(1).shuffle(tasks)
        for index, text in tasks:
            yield index, json.loads(pretend(text))

    monkeypatch.setattr(sweep_runners, "on_processes", shuffled)
    # a file each, so that the order in which files are written changes too
    monkeypatch.setattr(sweep_store, "_PATIENCE", 0.0)
    sweep(members, tmp_path / "b.zarr")
    assert files(tmp_path / "a.zarr") == files(tmp_path / "b.zarr")


def test_status_is_written_last(tmp_path, pretending, monkeypatch):
    """What a kill between two files leaves is a member without a status."""
    import zarr

    members, written = Sweep(**tables()), []
    original = zarr.Array.__setitem__

    def write(array, selection, values):
        written.append(array.basename)
        if array.basename == "status" and "charge" in written:
            raise OSError("No space left on device")
        original(array, selection, values)

    with monkeypatch.context() as patched:
        patched.setattr(zarr.Array, "__setitem__", write)
        with pytest.raises(TribofluxError, match="can't be written: No space left on device"):
            sweep(members, tmp_path / "s.zarr")
    assert written[-1] == "status"
    with xr.open_zarr(tmp_path / "s.zarr") as dataset:
        assert np.isfinite(dataset["stop_time"]).any()
        assert (dataset["status"] == "").all()
    sweep(members, tmp_path / "s.zarr")
    sweep(members, tmp_path / "whole.zarr")
    assert files(tmp_path / "s.zarr") == files(tmp_path / "whole.zarr")


# ------------------------------------------------------------------ refused


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (
            {"parameters": {"numbers.peclet": [1e6], "numbers.tau_c": [1e-3]}},
            "in it sweep.parameters.numbers.peclet is [1000.0, 100000.0, 1000000.0, 10000000.0], "
            "in this one it is [1000000.0]",
        ),
        (
            {"mode": "list", "parameters": {"numbers.peclet": [1e6], "numbers.tau_c": [1e-3]}},
            "in it sweep.mode is 'grid', in this one it is 'list'",
        ),
    ],
)
def test_store_of_another_sweep(tmp_path, pretending, changes, sentence):
    sweep(Sweep(**tables()), tmp_path / "s.zarr")
    with pytest.raises(InputError, match="holds another sweep") as refused:
        sweep(Sweep(**tables(**changes)), tmp_path / "s.zarr")
    assert sentence in str(refused.value)


def test_store_of_another_case(tmp_path, pretending):
    sweep(Sweep(**tables()), tmp_path / "s.zarr")
    given = tables()
    given["case"]["run"]["rtol"] = 1e-8
    with pytest.raises(InputError, match=r"in it run\.rtol is not given, in this one it is 1e-08"):
        sweep(Sweep(**given), tmp_path / "s.zarr")


def test_store_of_another_version(tmp_path, pretending, monkeypatch):
    sweep(Sweep(**tables()), tmp_path / "s.zarr")
    newer = sweep_store.decisive_versions() | {"jax": "99"}
    monkeypatch.setattr(sweep_store, "decisive_versions", lambda: newer)
    with pytest.raises(InputError, match=r"was begun with jax [\d.]+, but this is 99"):
        sweep(Sweep(**tables()), tmp_path / "s.zarr")


@pytest.mark.parametrize("kind", ["file", "folder", "group"])
def test_what_is_no_store_is_left_alone(tmp_path, pretending, kind):
    store = tmp_path / "s.zarr"
    if kind == "file":
        store.write_text("precious")
    elif kind == "folder":
        store.mkdir()
    else:
        xr.Dataset({"a": 1}).to_zarr(store, consolidated=False)
    before = files(tmp_path)
    with pytest.raises(InputError, match="is no store of a sweep: choose another name"):
        sweep(Sweep(**tables()), store)
    assert files(tmp_path) == before


def test_two_sweeps_do_not_share_a_store(tmp_path):
    members = Sweep(**tables())
    with sweep_store.SweepStore(tmp_path / "s.zarr", members):
        with pytest.raises(InputError, match="is being written by another process"):
            sweep(members, tmp_path / "s.zarr")


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"workers": 0}, "workers is 0, but must be from 1 to 1024."),
        ({"workers": 2, "scheduler": "tcp://127.0.0.1:1"}, "workers is given beside scheduler"),
        ({"scheduler": "127.0.0.1:1"}, "scheduler is '127.0.0.1:1', but must be an address such"),
        ({"scheduler": "tcp://127.0.0.1:1"}, "scheduler: tcp://127.0.0.1:1 can't be reached: "),
    ],
)
def test_refused_workers(tmp_path, monkeypatch, options, sentence):
    monkeypatch.setattr(sweep_runners, "_CONNECT", 0.5)
    with pytest.raises(InputError) as refused:
        sweep(Sweep(**tables()), tmp_path / "s.zarr", **options)
    assert str(refused.value).startswith(sentence)
    assert list(tmp_path.iterdir()) == []
