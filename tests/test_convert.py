"""Results for other programs: tables, and the command that converts by the ending of a name."""

import csv
import os

import numpy as np
import pytest
from matplotlib.animation import FFMpegWriter

from tests.cases import data, fake_result
from tests.processes import triboflux
from tests.test_cli import refused
from triboflux import conversion, presets
from triboflux.case import Case
from triboflux.dataset import build_dataset
from triboflux.errors import InputError
from triboflux.kinetic.dataset import dataset_of
from triboflux.result import Result, load


def result_in(dimensions, **changes):
    points = [6, 5, 4][:dimensions]
    return fake_result(Case(**data(grid__points=points, initial__charge=[], **changes)))


def kinetic_result():
    """Return what particles leave, with a standard error beside each variable."""
    model = result_in(1)
    names = [name for name in model.dataset.data_vars if name != "peak_charge"]
    records = {name: model.dataset[name].values.reshape(3, -1) for name in names}
    records["number_density"] = np.full((3, 6), 1.25)
    records |= {f"{name}_standard_error": 0.1 * abs(part) for name, part in records.items()}
    records["peak_charge"] = model.dataset["peak_charge"].values
    told = {"status": "ok", "stop_reason": "", "stats": {}, "attributes": {"method": "kinetic"}}
    return Result(dataset_of(model.case, model.dataset["time"], records, **told))


def table(path):
    """Return the columns of a file by their heads."""
    with open(path, newline="", encoding="ascii") as file:
        rows = list(csv.DictReader(file))
    return {head: np.array([float(row[head]) for row in rows]) for head in rows[0]}


# ------------------------------------------------------------------------ CSV


@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_a_table_has_every_number_of_every_variable(tmp_path, dimensions):
    result = result_in(dimensions)
    result.to_csv(tmp_path / "out.csv")
    columns = {head.split(" [")[0]: values for head, values in table(tmp_path / "out.csv").items()}
    dataset = result.dataset
    frame = dataset.drop_vars("component").to_dataframe(["time", *"xyz"[:dimensions], "component"])
    for component, letter in enumerate("xyz"[:dimensions]):
        rows = frame.xs(component, level="component").reset_index()
        for name in ("time", *"xyz"[:dimensions], "charge", "variance", "peak_charge"):
            np.testing.assert_array_equal(columns[name], rows[name])
        for name in ("covariance", "field"):
            np.testing.assert_array_equal(columns[f"{name}_{letter}"], rows[name])
    vectors = 2 * (dimensions - 1)
    assert len(columns) == 1 + dimensions + len(dataset.data_vars) + vectors


def test_the_heads_of_a_table_name_the_units(tmp_path):
    fields = data(suspension=presets.glass_beads(), initial={})
    del fields["numbers"]
    result = fake_result(Case(**fields))
    result.to_csv(tmp_path / "scaled.csv", 0)
    result.to_si().to_csv(tmp_path / "si.csv", 0)
    scaled, si = table(tmp_path / "scaled.csv"), table(tmp_path / "si.csv")
    assert list(scaled)[:3] == ["time [L / sqrt(Theta)]", "x [L]", "charge [Q0]"]
    assert list(scaled)[3] == "covariance_x [Q0 sqrt(Theta)]"
    assert list(si)[:4] == ["time [s]", "x [m]", "charge [C]", "covariance_x [C m s-1]"]
    np.testing.assert_array_equal(si["charge [C]"], result.to_si().dataset["charge"][0])


def test_one_time_and_what_is_not_finite(tmp_path):
    result = result_in(1)
    result.dataset["charge"][1, 2] = np.nan
    result.dataset["charge"][1, 3] = np.inf
    result.to_csv(tmp_path / "out.csv", 1)
    columns = table(tmp_path / "out.csv")
    assert set(columns["time [L / sqrt(Theta)]"]) == {0.5}
    np.testing.assert_array_equal(columns["charge [Q0]"], result.dataset["charge"][1])
    with pytest.raises(InputError, match=r"^time is -4, but must be a whole number from -3 to 2"):
        result.to_csv(tmp_path / "other.csv", -4)
    assert os.listdir(tmp_path) == ["out.csv"]


def test_particles_keep_their_errors(tmp_path):
    result = kinetic_result()
    result.to_csv(tmp_path / "out.csv")
    columns = table(tmp_path / "out.csv")
    error = columns["covariance_standard_error_x [Q0 sqrt(Theta)]"].reshape(3, 6)
    expected = result.dataset["covariance_standard_error"].values[:, 0]
    np.testing.assert_array_equal(error, expected)
    assert set(columns["number_density [n]"]) == {1.25}


# ---------------------------------------------------------------- the command


@pytest.fixture
def folder(tmp_path):
    result_in(2).to_netcdf(tmp_path / "in.nc")
    return tmp_path


@pytest.mark.parametrize("suffix", conversion.SUFFIXES)
def test_each_ending_is_written(folder, suffix, capsys):
    if suffix == ".mp4" and not FFMpegWriter.isAvailable():
        pytest.skip("needs ffmpeg")
    output = folder / f"out{suffix}"
    conversion.command(folder / "in.nc", output, conversion.Options(None, None, False, False))
    assert capsys.readouterr().out.startswith(f"written to '{output}'")
    assert output.stat().st_size > 100
    extra = ["out_vti"] if suffix == ".pvd" else []
    assert sorted(os.listdir(folder)) == sorted(["in.nc", output.name, *extra])


def test_the_command(folder):
    done = triboflux("convert", "in.nc", "-o", "out.csv", "--time-index", "-2", folder=folder)
    assert (done.returncode, done.stdout) == (0, "written to 'out.csv'\n")
    assert set(table(folder / "out.csv")["time [L / sqrt(Theta)]"]) == {0.5}
    shown = triboflux("convert", "--help", folder=folder)
    assert "Example: triboflux convert result.nc -o result.pvd" in shown.stdout
    assert shown.stderr.strip() == "[]"


def test_refusals_cost_and_leave_nothing(folder):
    (folder / "there.csv").write_text("precious")
    for arguments, sentence in (
        (["-o", "out.vtu"], "output is 'out.vtu', but must end in one of .pvd, .vti, .png, .pdf, "),
        (["-o", "there.csv"], "output 'there.csv' exists and is replaced only with --overwrite"),
        (["-o", "no/out.pvd"], "output folder 'no' does not exist."),
        (["-o", "out.gif", "--time-index", "1"], "time-index is 1, but .gif shows all times."),
        (["-o", "out.csv", "--fps", "5"], "fps is 5.0, but .csv has no frames."),
    ):
        found = refused("convert", "in.nc", *arguments, folder=folder)
        assert found.startswith(sentence)


@pytest.mark.parametrize(
    ("name", "options", "sentence"),
    [
        ("none.nc", {}, r"result '.*none\.nc' is missing"),
        ("case.toml", {}, r"is no readable NetCDF file"),
        ("in.nc", {"time_index": 3}, r"^time is 3, but must be a whole number from -3 to 2\."),
        ("in.nc", {"output": "out.gif", "fps": 0.0}, r"^fps is 0\.0, but must be a number from"),
        ("in.csv", {"output": "in.csv", "overwrite": True}, r"in\.csv' is the result itself\."),
    ],
)
def test_a_result_that_cannot_be_converted(folder, name, options, sentence):
    (folder / "case.toml").write_text("model = 'full'")
    (folder / "in.csv").write_bytes((folder / "in.nc").read_bytes())
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    chosen = {"time_index": None, "fps": None, "overwrite": False, "quiet": True} | options
    output = folder / chosen.pop("output", "out.csv")
    with pytest.raises(InputError, match=sentence):
        conversion.command(folder / name, output, conversion.Options(**chosen))
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_a_model_without_variance_converts(folder):
    whole = result_in(1, model="gradient")
    names = ("time", "charge", "covariance", "field", "potential", "peak_charge")
    told = {"status": "ok", "stop_reason": "", "stats": {}}
    dataset = build_dataset(whole.case, *(whole.dataset[name] for name in names), **told)
    Result(dataset).to_netcdf(folder / "gradient.nc")
    load(folder / "gradient.nc").to_csv(folder / "out.csv")
    assert "variance [Q0^2]" not in table(folder / "out.csv")
