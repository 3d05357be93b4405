"""Drag times: known limits, formulas written anew, other correlations, energy of a bed."""

import math

import pytest
from fluids.drag import Clift
from hypothesis import given
from hypothesis import strategies as st

from triboflux.drag import LAWS, NAMES, DragState, drag_coefficient, drag_time
from triboflux.errors import InputError

AIR = {"gas_density": 1.2, "gas_viscosity": 1.8e-5}
SAND = {"diameter": 3e-4, "density": 2500.0}


def state(reynolds_number, solid_fraction=1e-3, **changes):
    """Return sand in air at a Reynolds number."""
    values = AIR | SAND | {"solid_fraction": solid_fraction} | changes
    per_speed = values["gas_density"] * values["diameter"] / values["gas_viscosity"]
    return DragState(**values, speed=reynolds_number / per_speed)


states = st.builds(
    state,
    st.floats(1e-6, 1e6),
    st.floats(1e-6, 0.63),
    diameter=st.floats(1e-7, 1e-2),
    density=st.floats(10.0, 1e4),
)


def test_laws_are_the_five_of_the_documentation():
    assert NAMES == ("none", "stokes", "schiller-naumann", "wen-yu", "gidaspow")
    for name, law in LAWS.items():
        assert law.name == name
        assert law.source and law.validity


def test_without_drag_the_time_is_infinite():
    assert drag_time("none", state(1.0)) == math.inf


@given(states)
def test_stokes_time_is_that_of_the_textbook(here):
    expected = here.density * here.diameter**2 / (18.0 * here.gas_viscosity)
    assert drag_time("stokes", here) == pytest.approx(expected, rel=1e-12)


def test_water_droplet_stops_as_in_the_tables():
    """10 um: 0.314 ms in W. C. Hinds, Aerosol Technology (1999), with 2 % for slip."""
    droplet = state(1e-3, diameter=10e-6, density=1000.0, gas_viscosity=1.81e-5)
    assert drag_time("stokes", droplet) == pytest.approx(3.14e-4, rel=0.03)


@pytest.mark.parametrize("name", ["schiller-naumann", "wen-yu", "gidaspow"])
def test_slow_dilute_particles_follow_stokes(name):
    here = state(1e-6, solid_fraction=1e-6)
    assert drag_time(name, here) == pytest.approx(drag_time("stokes", here), rel=1e-4)


@given(st.floats(1e-3, 1e5))
def test_dilute_wen_yu_is_schiller_naumann(reynolds_number):
    here = state(reynolds_number, solid_fraction=1e-9)
    # above Re = 1000 both coefficients are constant, and 0.4 % smaller just below
    rough = 0.01 if 999.9 < reynolds_number < 1000.1 else 1e-7
    assert drag_time("wen-yu", here) == pytest.approx(
        drag_time("schiller-naumann", here), rel=rough
    )


@pytest.mark.parametrize("reynolds_number", [0.01, 0.3, 1.0, 10.0, 100.0, 800.0])
def test_schiller_naumann_agrees_with_another_correlation(reynolds_number):
    """The standard drag curve of Clift, Grace & Weber (1978)."""
    assert drag_coefficient(reynolds_number) == pytest.approx(Clift(reynolds_number), rel=0.05)


def test_schiller_naumann_hardly_jumps_where_it_becomes_constant():
    below, above = drag_coefficient(1000.0), drag_coefficient(1000.1)
    assert above == 0.44
    assert below == pytest.approx(above, rel=5e-3)
    assert below != above


@given(st.floats(1e-3, 1e4), st.floats(1e-3, 0.199))
def test_wen_yu_as_momentum_exchange(reynolds_number, solid_fraction):
    """Written anew as the exchange coefficient per volume of two-fluid models."""
    here = state(reynolds_number, solid_fraction)
    gas = 1.0 - solid_fraction
    coefficient = drag_coefficient(gas * reynolds_number)
    exchange = (
        0.75 * coefficient * gas * solid_fraction * here.gas_density * here.speed / here.diameter
    ) * gas**-2.65
    expected = solid_fraction * here.density / exchange
    assert drag_time("wen-yu", here) == pytest.approx(expected, rel=1e-12)
    assert drag_time("gidaspow", here) == drag_time("wen-yu", here)


@given(st.floats(1e-3, 1e4), st.floats(0.2001, 0.63))
def test_dense_gidaspow_is_ergun(reynolds_number, solid_fraction):
    here = state(reynolds_number, solid_fraction)
    viscous = 150.0 * solid_fraction**2 * here.gas_viscosity / here.diameter**2
    inertial = 1.75 * solid_fraction * here.gas_density * here.speed / here.diameter
    exchange = viscous / (1.0 - solid_fraction) + inertial
    expected = solid_fraction * here.density / exchange
    assert drag_time("gidaspow", here) == pytest.approx(expected, rel=1e-12)


@given(st.floats(1e-6, 1e6))
def test_gidaspow_jumps_as_its_docstring_says(reynolds_number):
    sparse, dense = state(reynolds_number, 0.2), state(reynolds_number, 0.2 + 1e-12)
    jump = drag_time("gidaspow", sparse) / drag_time("gidaspow", dense)
    assert 1.024 < jump < 3.75


@pytest.mark.parametrize(
    ("reynolds_number", "jump"), [(1e-6, 1.153), (5.3, 1.024), (1247.0, 3.744), (1e6, 3.670)]
)
def test_sizes_of_the_jump(reynolds_number, jump):
    sparse, dense = state(reynolds_number, 0.2), state(reynolds_number, 0.2 + 1e-12)
    ratio = drag_time("gidaspow", sparse) / drag_time("gidaspow", dense)
    assert ratio == pytest.approx(jump, rel=1e-3)


def test_bed_begins_to_fluidise_when_its_pressure_drop_carries_the_weight():
    """150 alpha/eps^3 Re + 1.75/eps^3 Re^2 = Ar, with the superficial velocity in Re."""
    solid, gravity = 0.59, 9.81
    gas = 1.0 - solid
    buoyant = (SAND["density"] - AIR["gas_density"]) * gravity
    archimedes = SAND["diameter"] ** 3 * AIR["gas_density"] * buoyant / AIR["gas_viscosity"] ** 2
    linear, square = 150.0 * solid / gas**3, 1.75 / gas**3
    superficial = (math.sqrt(linear**2 + 4.0 * square * archimedes) - linear) / (2.0 * square)
    here = state(superficial / gas, solid)
    # the mean gas pressure, which acts on the particles too, carries the part alpha of the weight
    weight = gas * buoyant / SAND["density"]
    assert here.speed / drag_time("gidaspow", here) == pytest.approx(weight, rel=1e-12)


@given(st.sampled_from(NAMES), states)
def test_times_are_positive_and_shorter_among_other_particles(name, here):
    time = drag_time(name, here)
    assert time > 0.0
    if name in ("wen-yu", "schiller-naumann"):
        assert time <= drag_time("stokes", here) * (1.0 + 1e-12)


def test_unknown_law_proposes_the_nearest():
    with pytest.raises(InputError, match=r"^drag is 'wen', but must be .* 'wen-yu'\?$"):
        drag_time("wen", state(1.0))
