"""Results: labelled, complete, written at once or not at all, read back only if they are ours."""

import json
import os
import subprocess
import sys

import netCDF4
import numpy as np
import pytest
import xarray as xr

from tests.cases import data, fake_result
from triboflux.case import Case
from triboflux.dataset import FORMAT_VERSION, versions
from triboflux.errors import InputError, TribofluxError
from triboflux.files import discard_partial_files, written_at_once
from triboflux.initial_state import initial_fields
from triboflux.kinetic.dataset import dataset_of
from triboflux.result import Result, load

VARIABLES = {
    "charge": ("time", "x", "y"),
    "covariance": ("time", "component", "x", "y"),
    "variance": ("time", "x", "y"),
    "field": ("time", "component", "x", "y"),
    "potential": ("time", "x", "y"),
    "peak_charge": ("time",),
    "realizability_margin": ("time", "x", "y"),
}


@pytest.fixture
def case():
    return Case(
        **data(
            title="two dimensions",
            grid__points=[6, 4],
            grid__lengths=[1.0, 3.0],
            initial__charge=[{"mode": [1, 1], "sine": 0.5}],
        )
    )


@pytest.fixture
def result(case):
    return fake_result(case)


def test_dataset_is_labelled(result):
    dataset = result.dataset
    assert {name: variable.dims for name, variable in dataset.data_vars.items()} == VARIABLES
    for variable in dataset.variables.values():
        assert variable.attrs["units"] == "1"
        assert variable.attrs["long_name"]
    for name in (*VARIABLES, "time", "x", "y"):
        assert dataset[name].dtype == np.float64
        assert dataset[name].attrs["scale"]
    np.testing.assert_allclose(dataset["y"], [0, 0.75, 1.5, 2.25])
    np.testing.assert_array_equal(dataset["component"], [0, 1])


def test_margin_is_variance_less_squared_covariance(result):
    dataset = result.dataset
    expected = dataset["variance"] - (dataset["covariance"] ** 2).sum("component")
    xr.testing.assert_allclose(dataset["realizability_margin"], expected)


def test_result_knows_its_run(result, case):
    assert result.case == case
    assert (result.status, result.stop_reason) == ("ok", "end time")
    assert result.stats == {"accepted": 12, "rejected": 3, "largest": 0.5}
    assert result.warnings == ("covariance is unrealizable",)
    assert result.dataset.attrs["format_version"] == FORMAT_VERSION
    assert result.dataset.attrs["trace_dimensions"] == 3
    assert json.loads(result.dataset.attrs["versions_json"]) == versions()


@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_round_trip_through_a_file(tmp_path, dimensions):
    case = Case(**data(grid__points=[4 + i for i in range(dimensions)], initial__charge=[]))
    result = fake_result(case)
    path = tmp_path / "out.nc"
    result.to_netcdf(path)
    again = load(path)
    assert again.case == case
    assert again.stats == result.stats
    assert again.warnings == result.warnings
    xr.testing.assert_identical(again.dataset, result.dataset)
    assert os.listdir(tmp_path) == ["out.nc"]
    path.unlink()  # which Windows allows only if the file was closed
    assert float(again.dataset["charge"].sum()) == float(result.dataset["charge"].sum())


def test_plain_netcdf4_and_other_programs_can_read_it(result, tmp_path):
    result.to_netcdf(tmp_path / "out.nc")
    with netCDF4.Dataset(tmp_path / "out.nc") as file:
        assert file.format_version == FORMAT_VERSION
        assert file.status == "ok"
        for name, dimensions in VARIABLES.items():
            variable = file[name]
            assert variable.dimensions == dimensions
            assert variable.filters()["zlib"]
            np.testing.assert_array_equal(variable[:], result.dataset[name].values)
            assert "_FillValue" not in variable.ncattrs()
    with xr.open_dataset(tmp_path / "out.nc") as dataset:
        xr.testing.assert_equal(dataset.load(), result.dataset)


def test_attributes_follow_the_cf_conventions(result, tmp_path):
    result.to_netcdf(tmp_path / "out.nc")
    with xr.open_dataset(tmp_path / "out.nc") as dataset:
        assert dataset.attrs["Conventions"] == "CF-1.11"
        assert dataset.attrs["source"] == "full model, derived closures"
        assert dataset.attrs["history"].startswith(dataset.attrs["created"])
        assert "Montilla" in dataset.attrs["references"]
        # a coordinate variable has its dimension's name and strictly rises
        for name in ("time", "x", "y"):
            assert dataset[name].dims == (name,)
            assert (np.diff(dataset[name]) > 0).all()


def test_a_standard_error_is_named_by_its_variable_in_any_units(tmp_path):
    powder = {"preset": "glass-beads", "granular_temperature": 1e-3, "charge_scale": 1e-12}
    fields = data(suspension=powder, initial={})
    del fields["numbers"]
    case = Case(**fields)
    model = fake_result(case).dataset
    names = ("charge", "covariance", "variance", "field", "potential")
    records = {name: model[name].values.reshape(3, -1) for name in names}
    records |= {f"{name}_standard_error": abs(values) for name, values in records.items()}
    records["peak_charge"] = model["peak_charge"].values
    told = {"status": "ok", "stop_reason": "", "stats": {}, "attributes": {"method": "kinetic"}}
    result = Result(dataset_of(case, model["time"], records, **told))
    assert result.dataset.attrs["source"] == "simulation of charged particles"
    result.to_si().to_netcdf(tmp_path / "out.nc")
    for found in (result, load(tmp_path / "out.nc"), result.to_si().to_scaled()):
        assert "ancillary_variables" not in found.dataset["peak_charge"].attrs
        for name in names:
            error = found.dataset[name].attrs["ancillary_variables"]
            assert found.dataset[error].attrs["units"] == found.dataset[name].attrs["units"]


def test_not_a_number_survives_a_file(result, tmp_path):
    result.dataset["charge"][-1] = np.nan
    result.to_netcdf(tmp_path / "out.nc")
    xr.testing.assert_identical(load(tmp_path / "out.nc").dataset, result.dataset)


def test_existing_file_is_kept_unless_asked(result, tmp_path):
    path = tmp_path / "out.nc"
    path.write_text("precious")
    with pytest.raises(InputError, match=r"out.nc' exists and is replaced only with --overwrite"):
        result.to_netcdf(path)
    assert path.read_text() == "precious"
    result.to_netcdf(path, overwrite=True)
    assert load(path).status == "ok"
    assert os.listdir(tmp_path) == ["out.nc"]


def test_missing_folder_is_named(result, tmp_path):
    with pytest.raises(InputError, match=r"^output folder '.*none' does not exist\.$"):
        result.to_netcdf(tmp_path / "none" / "out.nc")
    with pytest.raises(InputError, match="is a folder, but must be a file"):
        result.to_netcdf(tmp_path)
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("failure", [OSError(28, "No space left"), RuntimeError("HDF error")])
def test_failed_writing_leaves_nothing(result, tmp_path, monkeypatch, failure):
    def fail(self, path, **options):
        path.write_text("half of it")
        raise failure

    monkeypatch.setattr(xr.Dataset, "to_netcdf", fail)
    (tmp_path / "out.nc").write_text("precious")
    with pytest.raises(TribofluxError, match=r"^output '.*out.nc' can't be written: .*"):
        result.to_netcdf(tmp_path / "out.nc", overwrite=True)
    assert os.listdir(tmp_path) == ["out.nc"]
    assert (tmp_path / "out.nc").read_text() == "precious"


def test_interrupted_writing_leaves_nothing(result, tmp_path, monkeypatch):
    def interrupt(self, path, **options):
        path.write_text("half of it")
        raise KeyboardInterrupt

    monkeypatch.setattr(xr.Dataset, "to_netcdf", interrupt)
    with pytest.raises(KeyboardInterrupt):
        result.to_netcdf(tmp_path / "out.nc")
    assert os.listdir(tmp_path) == []


def test_files_that_another_thread_writes_can_be_discarded(tmp_path):
    with written_at_once(tmp_path / "out.nc") as partial:
        partial.write_text("half of it")
        discard_partial_files()
        assert os.listdir(tmp_path) == []
        partial.write_text("all of it")
    assert os.listdir(tmp_path) == ["out.nc"]
    discard_partial_files()
    assert os.listdir(tmp_path) == ["out.nc"]


class TestLoadingWhatIsNotOurs:
    """Every foreign or damaged file is refused in one printable line."""

    def told(self, path):
        with pytest.raises(InputError) as caught:
            load(path)
        assert str(caught.value).isprintable()
        return str(caught.value)

    def test_no_file(self, tmp_path):
        assert self.told(tmp_path / "none.nc").endswith("none.nc' is missing.")
        assert self.told(tmp_path).endswith("is a folder.")

    def test_no_netcdf(self, tmp_path):
        (tmp_path / "a.nc").write_text("not a result\n")
        assert "is no readable NetCDF file" in self.told(tmp_path / "a.nc")
        (tmp_path / "b.nc").touch()
        assert "is no readable NetCDF file" in self.told(tmp_path / "b.nc")

    def test_another_programs_file(self, tmp_path):
        xr.Dataset({"a": ("x", [1.0])}).to_netcdf(tmp_path / "a.nc")
        assert "was not written by triboflux" in self.told(tmp_path / "a.nc")

    @pytest.mark.parametrize(
        ("change", "sentence"),
        [
            (lambda d: d.assign_attrs(format_version=99), "has format_version "),
            (lambda d: d.drop_attrs(deep=False), "was not written by triboflux"),
            (lambda d: d.drop_vars("charge"), "its variable charge is missing or misshapen"),
            (lambda d: d.assign(charge=d.charge.T), "its variable charge is missing or misshapen"),
            (lambda d: d.isel(x=slice(3)), "charge does not fit its case's grid"),
            (lambda d: d.isel(time=slice(0)), "time does not fit its case's grid"),
            (lambda d: d.assign(charge=d.charge.astype(int)), "charge does not hold numbers"),
            (lambda d: d.assign_attrs(case_toml="a = ["), "its case is not allowed, the case is"),
            (lambda d: d.assign_attrs(stats_json="[1]"), "its attribute stats_json is unreadable"),
            (lambda d: d.assign_attrs(stats_json="{"), "its attribute stats_json is unreadable"),
            (lambda d: d.assign_attrs(status=3), "its attribute status is missing"),
        ],
    )
    def test_changed_files(self, result, tmp_path, change, sentence):
        Result(change(result.dataset)).to_netcdf(tmp_path / "a.nc")
        assert sentence in self.told(tmp_path / "a.nc")

    # HDF5 libraries have been known to crash on damaged files, so the test runs beside this process
    def test_damaged_files(self, tmp_path):
        case = Case(**data(grid__points=[64, 64], initial__charge=[]))
        good = tmp_path / "good.nc"
        fake_result(case).to_netcdf(good)
        content = good.read_bytes()
        for name, part in {"short": slice(len(content) // 2), "tail": slice(-100)}.items():
            (tmp_path / f"{name}.nc").write_bytes(content[part])
        middle = len(content) // 2
        spoilt = content[:middle] + bytes(2000) + content[middle + 2000 :]
        (tmp_path / "spoilt.nc").write_bytes(spoilt)
        code = (
            "import sys, triboflux\n"
            "for path in sys.argv[1:]:\n"
            "    try: triboflux.load(path)\n"
            "    except triboflux.InputError as error: print(error)\n"
        )
        paths = [str(tmp_path / f"{name}.nc") for name in ("short", "tail", "spoilt")]
        done = subprocess.run(
            [sys.executable, "-c", code, *paths], capture_output=True, text=True, check=True
        )
        assert done.stdout.count("is no readable NetCDF file") == 2
        assert done.stdout.count("is damaged: its checksum is wrong") == 1

    def test_larger_than_the_memory(self, result, tmp_path, monkeypatch):
        result.to_netcdf(tmp_path / "a.nc")
        monkeypatch.setattr("triboflux.result.available_memory", lambda: 1000)
        assert "more than the memory available" in self.told(tmp_path / "a.nc")


def test_a_result_is_read_on_a_machine_without_its_initial_state(tmp_path):
    case = Case(**data(initial__charge=[], initial__file=str(tmp_path / "gone.nc")))
    fake_result(case).to_netcdf(tmp_path / "out.nc")
    assert load(tmp_path / "out.nc").case == case


class TestContinuingFromAFile:
    """The last time of a result as initial state."""

    def start(self, tmp_path, **changes):
        start = fake_result(Case(**data(grid__points=[8, 6], initial__charge=[])))
        for name in ("charge", "covariance", "variance"):
            start.dataset[name][:] = np.random.default_rng(1).random(start.dataset[name].shape)
        start.dataset["charge"][:] -= start.dataset["charge"].mean(("x", "y"))
        start.to_netcdf(tmp_path / "start.nc", overwrite=True)
        file = {"initial__charge": [], "initial__file": str(tmp_path / "start.nc")}
        return start, Case(**data(**({"grid__points": [8, 6]} | file | changes)))

    def test_takes_the_last_time(self, tmp_path):
        start, case = self.start(tmp_path)
        fields = initial_fields(case)
        for name, values in zip(("charge", "covariance", "variance"), fields, strict=True):
            np.testing.assert_array_equal(values, start.dataset[name][-1])

    @pytest.mark.parametrize(
        ("changes", "sentence"),
        [
            ({"grid__points": [8, 8]}, r"whose grid has points \[8, 6\], but grid.points is \[8, "),
            ({"grid__lengths": [1.0, 2.0]}, r"whose grid has lengths \[1.0, 1.0\], but grid.leng"),
            ({"grid__points": [8]}, r"whose grid has points \[8, 6\], but grid.points is \[8\]"),
        ],
    )
    def test_refuses_another_grid(self, tmp_path, changes, sentence):
        _, case = self.start(tmp_path, **changes)
        with pytest.raises(InputError, match=r"^initial.file is '.*start.nc', " + sentence):
            initial_fields(case)

    @pytest.mark.parametrize(
        ("field", "value", "sentence"),
        [
            ("charge", 1.0, "whose last charge has a net of 1, but must be neutral"),
            ("covariance", np.nan, "whose last covariance is not finite"),
        ],
    )
    def test_refuses_impossible_fields(self, tmp_path, field, value, sentence):
        start, case = self.start(tmp_path)
        start.dataset[field][-1] = value
        start.to_netcdf(tmp_path / "start.nc", overwrite=True)
        with pytest.raises(InputError, match=sentence):
            initial_fields(case)

    def test_refuses_negative_variance(self, tmp_path):
        start, case = self.start(tmp_path)
        start.dataset["variance"][-1] = -1.0
        start.to_netcdf(tmp_path / "start.nc", overwrite=True)
        with pytest.raises(InputError, match="is -1 at x"):
            initial_fields(case)


def test_numpy_statistics_become_json(case):
    result = fake_result(case, stats={"steps": np.int64(3), "array": np.arange(2)})
    assert result.stats == {"steps": 3, "array": [0, 1]}


def test_unwritable_folder(result, tmp_path, monkeypatch):
    monkeypatch.setattr("triboflux.files.os.access", lambda path, mode: False)
    with pytest.raises(InputError, match="can't be written to"):
        result.to_netcdf(tmp_path / "out.nc")
