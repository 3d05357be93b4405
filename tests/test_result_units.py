"""Results in SI: every field times its scale, there and back, in files, figures and later runs."""

import math

import netCDF4
import numpy as np
import pytest
import xarray as xr

import triboflux
from tests.cases import data, fake_result
from triboflux import presets
from triboflux.case import Case
from triboflux.diagnostics import budget
from triboflux.errors import InputError
from triboflux.figures import figure_one
from triboflux.initial_state import initial_fields
from triboflux.result import Result, load

POWDER = presets.glass_beads(domain_length=0.2, granular_temperature=4e-4, charge_scale=2e-12)

# Unit and scale of every variable, by the definitions of the dimensionless quantities.
VELOCITY, LENGTH, CHARGE = 0.02, 0.2, 2e-12
FIELD = POWDER.number_density * CHARGE * LENGTH / 8.8541878188e-12
UNITS = {
    "charge": ("C", CHARGE),
    "covariance": ("C m s-1", CHARGE * VELOCITY),
    "variance": ("C2", CHARGE**2),
    "field": ("V m-1", FIELD),
    "potential": ("V", FIELD * LENGTH),
    "peak_charge": ("C", CHARGE),
    "realizability_margin": ("C2", CHARGE**2),
    "time": ("s", LENGTH / VELOCITY),
    "x": ("m", LENGTH),
    "y": ("m", LENGTH),
}


def case_in_si(**changes):
    fields = data(**{"suspension": POWDER, "grid__points": [8, 6]} | changes)
    fields["initial"] = {} if "initial__file" not in changes else fields["initial"]
    del fields["numbers"]
    return Case(**fields)


@pytest.fixture
def scaled():
    return fake_result(case_in_si(grid__lengths=[0.5, 1.5]))


@pytest.fixture
def si(scaled):
    return scaled.to_si()


# ------------------------------------------------------------------ there and back


def test_every_variable_is_multiplied_by_its_scale(scaled, si):
    before, after = scaled.dataset, si.dataset
    assert set(UNITS) == {*before.data_vars, *before.coords} - {"component"}
    for name, (unit, scale) in UNITS.items():
        np.testing.assert_allclose(after[name], scale * before[name].values, rtol=1e-14)
        assert after[name].dims == before[name].dims
        assert after[name].attrs["units"] == unit
        assert "scale" not in after[name].attrs
        assert after[name].attrs["long_name"] == before[name].attrs["long_name"]
    xr.testing.assert_identical(after["component"].variable, before["component"].variable)
    # coordinates go with their variables
    np.testing.assert_array_equal(after["charge"]["x"], after["x"])
    np.testing.assert_array_equal(after["charge"].sel(x=after["x"][3])["time"], after["time"])


def test_everything_else_stays(scaled, si):
    assert (scaled.units, si.units) == ("scaled", "si")
    assert si.dataset.attrs == scaled.dataset.attrs | {"units": "si"}
    assert si.case == scaled.case
    assert (si.stats, si.warnings) == (scaled.stats, scaled.warnings)
    assert set(si.dataset.variables) == set(scaled.dataset.variables)


def test_the_original_is_left_alone(scaled):
    before = scaled.dataset.copy(deep=True)
    changed = scaled.to_si()
    changed.dataset["charge"][:] = 0.0
    xr.testing.assert_identical(scaled.dataset, before)


def test_back_to_scaled(scaled, si):
    back = si.to_scaled()
    xr.testing.assert_allclose(back.dataset, scaled.dataset, rtol=4e-16, atol=0.0)
    assert back.dataset.attrs == scaled.dataset.attrs
    for name, variable in scaled.dataset.variables.items():
        assert back.dataset[name].attrs == variable.attrs
    assert si.to_si() is si
    assert scaled.to_scaled() is scaled


def test_margin_is_that_of_the_moments_in_si(si):
    dataset = si.dataset
    squared = (dataset["covariance"] ** 2).sum("component") / POWDER.granular_temperature
    expected = (dataset["variance"] - squared).values
    np.testing.assert_allclose(
        dataset["realizability_margin"], expected, rtol=1e-12, atol=1e-12 * abs(expected).max()
    )


def test_numbers_alone_have_no_scales():
    result = fake_result(Case(**data()))
    with pytest.raises(InputError) as caught:
        result.to_si()
    assert str(caught.value) == (
        "units is 'si', but SI needs the scales of a case with a table [suspension]; this one has "
        "[numbers]."
    )
    assert result.to_scaled() is result


@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_round_trip_through_a_file(tmp_path, dimensions):
    made = case_in_si(grid__points=[4 + i for i in range(dimensions)])
    si = fake_result(made).to_si()
    si.to_netcdf(tmp_path / "si.nc")
    again = load(tmp_path / "si.nc")
    assert again.units == "si"
    assert again.case == made
    xr.testing.assert_identical(again.dataset, si.dataset)
    xr.testing.assert_identical(again.to_scaled().dataset, si.to_scaled().dataset)


def test_other_programs_read_the_units(si, tmp_path):
    si.dataset["charge"][-1, 0, 0] = np.nan
    si.to_netcdf(tmp_path / "si.nc")
    with netCDF4.Dataset(tmp_path / "si.nc") as file:
        for name, (unit, _) in UNITS.items():
            assert file[name].units == unit
            np.testing.assert_array_equal(file[name][:], si.dataset[name])
    with xr.open_dataset(tmp_path / "si.nc", decode_times=True) as dataset:
        assert dataset["time"].dtype.kind == "f"


# ------------------------------------------------------------------ damaged and old files


@pytest.mark.parametrize("units", ["cgs", "SI", "", 3, 1.5, ["si", "si"]])
def test_damaged_units_are_refused(scaled, tmp_path, units):
    Result(scaled.dataset.assign_attrs(units=units)).to_netcdf(tmp_path / "a.nc")
    with pytest.raises(InputError, match=r"a.nc' is damaged: its attribute units is ") as caught:
        load(tmp_path / "a.nc")
    assert str(caught.value).isprintable()


def test_si_without_a_suspension_is_refused(tmp_path):
    result = fake_result(Case(**data()))
    Result(result.dataset.assign_attrs(units="si")).to_netcdf(tmp_path / "a.nc")
    with pytest.raises(InputError, match=r"its attribute units is 'si' without a suspension\.$"):
        load(tmp_path / "a.nc")


def test_files_from_before_there_were_units_are_scaled(scaled, tmp_path):
    old = scaled.dataset.copy()
    del old.attrs["units"]
    Result(old).to_netcdf(tmp_path / "old.nc")
    result = load(tmp_path / "old.nc")
    assert result.units == "scaled"
    assert result.to_scaled() is result
    xr.testing.assert_identical(result.to_si().dataset, scaled.to_si().dataset)


# ------------------------------------------------------------------ what is made of results


def test_budget_is_that_of_the_scaled_result(scaled, si):
    expected = budget(scaled)
    found = budget(si)
    xr.testing.assert_allclose(found, expected, rtol=1e-12)
    # times are told as the result has them
    early = budget(si, float(si.dataset["time"][1]))
    xr.testing.assert_allclose(early, budget(scaled, float(scaled.dataset["time"][1])), rtol=1e-12)
    assert not np.allclose(early["charge"], found["charge"])
    with pytest.raises(InputError, match=r"^time: 1\.1e\+01 is not allowed|^time: 11 is not allo"):
        budget(si, 11.0)


def test_figures_are_those_of_the_scaled_result():
    made = fake_result(case_in_si(grid__points=[16]))
    panels = (figure_one(result).axes for result in (made, made.to_si()))
    for ours, theirs in zip(*panels, strict=True):
        assert ours.get_title(loc="left") == theirs.get_title(loc="left")
        assert ours.get_xlabel() == theirs.get_xlabel()
        for one, other in zip(ours.lines, theirs.lines, strict=True):
            np.testing.assert_allclose(one.get_xydata(), other.get_xydata(), rtol=1e-12, atol=1e-12)


# ------------------------------------------------------------------ continuing from a file


def start_file(tmp_path, suspension=POWDER, *, in_si=False, **changes):
    """Write a result and return it in SI, with its path."""
    result = fake_result(case_in_si(suspension=suspension, **changes))
    for name in ("charge", "covariance", "variance"):
        result.dataset[name][:] = np.random.default_rng(1).random(result.dataset[name].shape)
    result.dataset["charge"][:] -= result.dataset["charge"].mean(("x", "y"))
    path = tmp_path / "start.nc"
    (result.to_si() if in_si else result).to_netcdf(path)
    return result, str(path)


@pytest.mark.parametrize("in_si", [False, True])
def test_continues_from_either_kind_of_file(tmp_path, in_si):
    result, path = start_file(tmp_path, in_si=in_si)
    fields = initial_fields(case_in_si(initial__charge=[], initial__file=path))
    for name, values in zip(("charge", "covariance", "variance"), fields, strict=True):
        np.testing.assert_allclose(values, result.dataset[name][-1], rtol=1e-15)


@pytest.mark.parametrize("in_si", [False, True])
def test_physical_fields_continue_between_suspensions(tmp_path, in_si):
    result, path = start_file(tmp_path, in_si=in_si, grid__lengths=[0.5, 1.0])
    # another charge scale, hotter, and scaled by another length in the same box
    other = POWDER.model_copy(
        update={"charge_scale": 5e-12, "granular_temperature": 1e-2, "domain_length": 0.1}
    )
    now = case_in_si(
        suspension=other, initial__charge=[], initial__file=path, grid__lengths=["10 cm", 2.0]
    )
    charge, covariance, variance = initial_fields(now)
    before = result.to_si().dataset.isel(time=-1)
    np.testing.assert_allclose(charge * 5e-12, before["charge"], rtol=1e-14)
    np.testing.assert_allclose(covariance * 5e-12 * 0.1, before["covariance"], rtol=1e-14)
    np.testing.assert_allclose(variance * 5e-12**2, before["variance"], rtol=1e-14)


def test_another_box_is_refused_in_its_own_scale(tmp_path):
    _, path = start_file(tmp_path)
    other = POWDER.model_copy(update={"domain_length": 0.1})
    now = case_in_si(suspension=other, initial__charge=[], initial__file=path)
    with pytest.raises(InputError) as caught:
        initial_fields(now)
    assert str(caught.value) == (
        f"initial.file is '{path}', whose grid has lengths [2.0, 2.0], but grid.lengths is "
        "[1.0, 1.0]."
    )


@pytest.mark.parametrize("in_si", [False, True])
def test_scaled_fields_continue_where_a_case_has_no_scales(tmp_path, in_si):
    result, path = start_file(tmp_path, in_si=in_si)
    now = Case(**data(grid__points=[8, 6], initial__charge=[], initial__file=path))
    charge, _, _ = initial_fields(now)
    np.testing.assert_allclose(charge, result.dataset["charge"][-1], rtol=1e-15)


# ------------------------------------------------------------------ the physics in SI


@pytest.fixture(scope="module")
def relaxed():
    """Return a run of a powder that conducts, collides and is dragged, told in SI throughout."""
    return triboflux.solve(
        Case(
            suspension=POWDER,
            grid={"points": [24], "lengths": ["0.3 m"]},
            initial={
                "charge": [
                    {"mode": [0], "cosine": "5 fC"},
                    {"mode": [1], "sine": "-20 fC"},
                    {"mode": [2], "cosine": "3 fC"},
                ],
                "covariance": [{"component": 0, "mode": [1], "cosine": "-1 aC m/s"}],
                "variance": [{"mode": [0], "cosine": "50 fC^2"}],
                "neutralising_background": True,
            },
            run={"t_end": "0.4 s", "outputs": [0.0, "1 ms", "0.1 s"], "rtol": 1e-9, "atol": 1e-15},
        )
    ).to_si()


def test_run_starts_and_ends_as_told(relaxed):
    dataset = relaxed.dataset
    np.testing.assert_allclose(dataset["time"], [0.0, 1e-3, 0.1, 0.4], rtol=1e-14)
    np.testing.assert_allclose(dataset["x"], 0.3 / 24 * np.arange(24), rtol=1e-14)
    turn = 2 * np.pi * dataset["x"].values / 0.3
    charge = 1e-15 * (5 - 20 * np.sin(turn) + 3 * np.cos(2 * turn))
    np.testing.assert_allclose(dataset["charge"][0], charge, rtol=0, atol=1e-28)
    np.testing.assert_allclose(
        dataset["covariance"][0, 0], -1e-18 * np.cos(turn), rtol=0, atol=1e-32
    )
    np.testing.assert_allclose(dataset["variance"][0], 5e-29, rtol=1e-13)
    peak = dataset["peak_charge"].values
    assert (peak >= abs(dataset["charge"].values).max(axis=1) * (1 - 1e-12)).all()
    assert (peak <= abs(dataset["charge"].values).max(axis=1) * 1.05).all()


def test_it_is_the_scaled_run_of_its_numbers(relaxed):
    made = relaxed.case
    fields = made.model_dump()
    del fields["suspension"]
    scaled = triboflux.solve(Case(**fields)).dataset
    for name, (_, scale) in UNITS.items():
        if name in relaxed.dataset.variables:
            expected = scale * scaled[name].values
            np.testing.assert_allclose(
                relaxed.dataset[name], expected, rtol=1e-13, atol=1e-14 * abs(expected).max()
            )


def test_charge_of_the_box_is_constant_in_coulombs(relaxed):
    particles = POWDER.number_density * 0.3 / 24  # at a grid point, for each square metre
    total = particles * relaxed.dataset["charge"].sum("x").values
    np.testing.assert_allclose(total, POWDER.number_density * 0.3 * 5e-15, rtol=1e-13)


def derivative(values):
    """Return d/dx of periodic values in the box of 0.3 m."""
    waves = 2j * np.pi * np.fft.fftfreq(24, 0.3 / 24)
    return np.fft.ifft(waves * np.fft.fft(values)).real


def test_gauss_law_holds_in_volts_and_metres(relaxed):
    for step in range(4):
        now = relaxed.dataset.isel(time=step)
        charge, field, potential = (
            now[name].values.reshape(24) for name in ("charge", "field", "potential")
        )
        density = POWDER.number_density * (charge - charge.mean())
        largest = abs(density).max() / POWDER.permittivity
        np.testing.assert_allclose(
            derivative(field), density / POWDER.permittivity, rtol=0, atol=1e-12 * largest
        )
        np.testing.assert_allclose(
            -derivative(potential), field, rtol=0, atol=1e-12 * abs(field).max()
        )


def test_the_first_millisecond_follows_the_equations_in_si(relaxed):
    s = POWDER
    n, theta, d, e, mass = (
        s.number_density,
        s.granular_temperature,
        s.diameter,
        s.restitution,
        s.mass,
    )
    j1 = 2**1.8 * math.sqrt(math.pi) * math.gamma(1.4) * 2  # J_(1+a)
    j2 = 2**2.8 * math.sqrt(math.pi) * math.gamma(1.9) * 2  # J_(2+a)
    contacts = n * s.contact_radial_distribution * d**2
    exchange = 2 * j1 * contacts * s.charge_transfer * theta**0.9  # 1/tau_xi
    dispersion = exchange * d**2 / 12
    conduction = math.pi * s.permittivity * d * dispersion  # sigma/n
    collisions = 4 * math.sqrt(math.pi * theta) * contacts
    decay = (1 + e) / 3 * collisions + 1 / s.drag_time + (2 - 2.8 * e) / 6 * exchange

    first = relaxed.dataset.isel(time=0)
    charge, covariance, variance, field = (
        first[name].values.reshape(24) for name in ("charge", "covariance", "variance", "field")
    )
    gain = j2 / j1 * e * math.sqrt(theta) / d
    sources = (
        -(theta + gain * dispersion) * derivative(charge),
        gain * conduction * field,
        variance * field / mass,
    )
    source = sum(sources)
    assert min(abs(part).max() for part in sources) > 0.05 * abs(source).max()
    # the variation of the source within a millisecond is left out
    time = 1e-3
    expected = source / decay + (covariance - source / decay) * math.exp(-decay * time)
    found = relaxed.dataset["covariance"][1, 0].values
    assert abs(expected - covariance).max() > 0.5 * abs(covariance).max()
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-4 * abs(expected).max())
