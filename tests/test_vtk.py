"""VTK files: what PyVista reads back is the result, and nothing is left of what failed."""

import os
import re

import numpy as np
import pytest
import pyvista
from vtkmodules.vtkCommonCore import vtkDataArray

from tests.cases import data, fake_result
from triboflux import presets
from triboflux.case import Case
from triboflux.errors import InputError, TribofluxError
from triboflux.result import Result
from triboflux.vtk_files import series_folder, write_series

POINTS = (6, 5, 4)
LENGTHS = (1.0, 3.0, 0.5)


def result_in(dimensions, **changes):
    fields = data(
        title="<a> & “b”",
        grid__points=list(POINTS[:dimensions]),
        grid__lengths=list(LENGTHS[:dimensions]),
        initial__charge=[],
        **changes,
    )
    return fake_result(Case(**fields))


def on_grid(image, name, dimensions):
    """Return an array of an image as that of the dataset, with the end of the box."""
    values = np.asarray(image[name]).reshape((*image.dimensions[::-1], -1))
    values = values.transpose(3, 2, 1, 0).reshape((-1, *image.dimensions[:dimensions]))
    return values if len(values) > 1 else values[0]


@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_an_image_is_the_state_with_the_end_of_the_box(tmp_path, dimensions):
    result = result_in(dimensions)
    result.to_vtk(tmp_path / "out.vti", 1)
    image = pyvista.read(tmp_path / "out.vti")
    state = result.dataset.isel(time=1)
    counts = [n + 1 for n in POINTS[:dimensions]] + [1] * (3 - dimensions)
    assert image.dimensions == tuple(counts)
    assert image.origin == (0.0, 0.0, 0.0)
    lengths = [*LENGTHS[:dimensions], *[0.0] * (3 - dimensions)]
    np.testing.assert_allclose(image.bounds[1::2], lengths, rtol=1e-15)
    over_space = {name for name in state.data_vars if state[name].ndim}
    assert set(image.point_data.keys()) == over_space
    inside = (slice(-1),) * dimensions
    for name in over_space:
        values = on_grid(image, name, dimensions)
        if "component" in state[name].dims:
            assert len(values) == 3
            assert not values[dimensions:].any()
            values = values[:dimensions]
        np.testing.assert_array_equal(values[(..., *inside)], state[name].values)
        for axis in range(-dimensions, 0):
            np.testing.assert_array_equal(values.take(-1, axis), values.take(0, axis))


def test_an_image_tells_time_units_and_case(tmp_path):
    result = result_in(2)
    result.to_vtk(tmp_path / "out.vti")
    image = pyvista.read(tmp_path / "out.vti")
    assert image.field_data["TimeValue"] == [1.0]
    assert image.field_data["peak_charge"] == [0.5]
    assert list(image.field_data["title"]) == ["<a> & “b”"]
    assert Case.from_toml_text(str(image.field_data["case_toml"][0])) == result.case
    assert "covariance: Q0 sqrt(Theta)" in list(image.field_data["units_of_variables"])
    array = image.GetPointData().GetArray("field")
    assert array.GetInformation().Get(vtkDataArray.UNITS_LABEL()) == "n Q0 L / epsilon_0"
    assert image.active_scalars_name == "charge"
    assert image.active_vectors_name == "field"


def test_an_image_in_si(tmp_path):
    fields = data(suspension=presets.glass_beads(domain_length=0.2), initial={})
    del fields["numbers"]
    result = fake_result(Case(**fields)).to_si()
    result.to_vtk(tmp_path / "out.vti")
    image = pyvista.read(tmp_path / "out.vti")
    np.testing.assert_allclose(image.bounds[1], 0.2)
    np.testing.assert_array_equal(np.asarray(image["charge"])[:-1], result.dataset["charge"][-1])
    array = image.GetPointData().GetArray("covariance")
    assert array.GetInformation().Get(vtkDataArray.UNITS_LABEL()) == "C m s-1"


def test_a_series_has_all_times(tmp_path):
    result, seen = result_in(3), []
    write_series(result, tmp_path / "a&b.pvd", on_progress=seen.append)
    assert sorted(os.listdir(tmp_path)) == ["a&b.pvd", "a&b_vti"]
    reader = pyvista.get_reader(tmp_path / "a&b.pvd")
    assert reader.time_values == [0.0, 0.5, 1.0]
    for number in range(3):
        reader.set_active_time_point(number)
        image = reader.read()[0]
        inside = on_grid(image, "charge", 3)[:-1, :-1, :-1]
        np.testing.assert_array_equal(inside, result.dataset["charge"][number])
    assert [(step.done, step.total, step.fraction) for step in seen][1] == (2, 3, 2 / 3)


def test_what_is_not_finite_or_foreign(tmp_path):
    result = result_in(1)
    result.dataset["charge"][-1, 2] = np.nan
    result.dataset["field"][-1, 0, 1] = -np.inf
    changed = result.dataset.assign(mine=("x", np.zeros(6)), variance_flux=("x", np.zeros(6)))
    Result(changed).to_vtk(tmp_path / "out.vti")
    image = pyvista.read(tmp_path / "out.vti")
    assert np.isnan(image["charge"]).nonzero()[0].tolist() == [2]
    assert image["field"][1, 0] == -np.inf
    assert not {"mine", "variance_flux"} & set(image.point_data.keys())


def test_what_exists_is_replaced_only_when_told(tmp_path):
    result, path = result_in(1), tmp_path / "out.pvd"
    result.to_vtk(path)
    with pytest.raises(InputError, match=r"out\.pvd' exists and is replaced only with --overwrite"):
        result.to_vtk(path)
    path.unlink()
    with pytest.raises(InputError, match=r"folder '.*out_vti' exists and is replaced only with"):
        result.to_vtk(path)
    Result(result.dataset.isel(time=[2])).to_vtk(path, overwrite=True)
    assert os.listdir(series_folder(path)) == ["0000.vti"]
    (series_folder(path) / "thesis.tex").write_text("precious")
    with pytest.raises(InputError, match=r"holds 'thesis\.tex', which is no output, and is never"):
        result.to_vtk(path, overwrite=True)
    assert sorted(os.listdir(series_folder(path))) == ["0000.vti", "thesis.tex"]
    assert sorted(os.listdir(tmp_path)) == ["out.pvd", "out_vti"]


def test_a_file_or_link_in_the_place_of_the_folder_stays(tmp_path):
    result = result_in(1)
    (tmp_path / "out_vti").write_text("precious")
    with pytest.raises(InputError, match=r"out_vti' is no folder, but must become one"):
        result.to_vtk(tmp_path / "out.pvd", overwrite=True)
    (tmp_path / "b_vti").symlink_to(tmp_path)
    with pytest.raises(InputError, match=r"b_vti' is no folder"):
        result.to_vtk(tmp_path / "b.pvd", overwrite=True)
    assert (tmp_path / "out_vti").read_text() == "precious"


@pytest.mark.parametrize("failure", [OSError(28, "No space left"), KeyboardInterrupt()])
def test_a_failure_leaves_what_was_there(tmp_path, failure):
    result, path = result_in(1), tmp_path / "out.pvd"
    Result(result.dataset.isel(time=[2])).to_vtk(path)
    before = path.read_text()

    def fail(progress):
        if progress.done == 2:
            raise failure

    with pytest.raises((TribofluxError, KeyboardInterrupt)) as caught:
        write_series(result, path, overwrite=True, on_progress=fail)
    if isinstance(failure, OSError):
        assert re.match(r"output '.*' can't be written: .*No space left", str(caught.value))
    assert sorted(os.listdir(tmp_path)) == ["out.pvd", "out_vti"]
    assert os.listdir(series_folder(path)) == ["0000.vti"]
    assert path.read_text() == before


def test_bad_choices_are_refused(tmp_path):
    result = result_in(1)
    for path, time, sentence in (
        ("out.vtk", None, r"path is '.*out\.vtk', but must end in \.vti or \.pvd\."),
        ("out.pvd", 1, r"time is 1, but a \.pvd file holds all times\."),
        ("out.vti", 3, r"time is 3, but must be a whole number from -3 to 2\."),
    ):
        with pytest.raises(InputError, match=sentence):
            result.to_vtk(tmp_path / path, time)
    assert os.listdir(tmp_path) == []
