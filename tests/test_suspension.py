"""From a powder in engineering units to SI: values, ranges, sentences, files."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from triboflux import collision
from triboflux.drag import drag_time
from triboflux.errors import InputError
from triboflux.suspension import VACUUM_PERMITTIVITY, Charge, Suspension

POWDER = {
    "diameter": "350 um",
    "density": "0.935 g/cm^3",
    "youngs_modulus": "2 GPa",
    "poisson_ratio": 0.4,
    "restitution": "80 %",
    "solid_fraction": 0.3,
    "granular_temperature": "1e-3 m^2/s^2",
    "domain_length": "10 cm",
    "charge_scale": "0.2 pC",
}
REQUIRED = tuple(POWDER)

# What each field accepts in SI, and a value too small and one too large.
RANGES = {
    "diameter": (1e-4, 1e-10, 350.0),
    "density": (2500.0, 0.5, 1e5),
    "youngs_modulus": (7e10, 70.0, 1e13),
    "work_function": (6.7e-19, 1e-21, 4.2),
    "gas_density": (1.2, 0.0, 1e4),
    "gas_viscosity": (1.8e-5, 0.0, 18.0),
    "permittivity": (2e-11, 1e-12, 2.25),
    "granular_temperature": (1e-3, 0.0, 1e7),
    "domain_length": (0.1, 1e-7, 1e6),
    "charge_scale": (1e-12, 0.0, 1.0),
    "slip_velocity": (0.1, -0.1, 1e4),
    "restitution": (0.9, -0.1, 1.1),
    "poisson_ratio": (0.3, -1.0, 0.6),
    "solid_fraction": (0.3, 0.0, 0.75),
    "maximum_packing": (0.6, 0.0, 0.75),
}


def powder(**changes):
    return Suspension(**(POWDER | changes))


def refusal(**changes):
    with pytest.raises(InputError) as caught:
        powder(**changes)
    sentence = str(caught.value)
    assert sentence.isprintable()
    return sentence


def test_text_becomes_si():
    here = powder(work_function="4.2 eV", permittivity="17.7 pF/m", slip_velocity="36 km/h")
    assert (here.diameter, here.density, here.youngs_modulus) == (3.5e-4, 935.0, 2e9)
    assert (here.restitution, here.domain_length, here.charge_scale) == (0.8, 0.1, 2e-13)
    assert here.work_function == 6.7291418628e-19
    assert (here.permittivity, here.slip_velocity) == (1.77e-11, 10.0)


def test_what_need_not_be_given():
    here = powder()
    assert (here.gas_density, here.gas_viscosity) == (1.2, 1.8e-5)
    vacuum = 1.0 / (4e-7 * math.pi * 299792458.0**2)
    assert pytest.approx(vacuum, rel=1e-9, abs=0.0) == VACUUM_PERMITTIVITY
    assert here.permittivity == VACUUM_PERMITTIVITY
    assert here.work_function is None
    assert here.softened_modulus is False
    assert (here.radial_distribution, here.drag) == ("carnahan-starling", "wen-yu")
    assert here.slip_velocity == 0.0


def test_every_value_is_a_float_that_can_be_dumped_and_read_again():
    data = powder(diameter=np.float32(0.5e-3)).model_dump()
    assert Suspension(**data).model_dump() == data
    for name in set(RANGES) - {"work_function"}:
        assert type(data[name]) is float


def test_suspensions_are_immutable():
    with pytest.raises(ValueError, match="frozen"):
        powder().diameter = 1.0


class TestCharge:
    """Charge per particle from charge per mass, surface or volume of the particles."""

    @pytest.mark.parametrize(
        ("text", "amount"),
        [
            ("10 µC/kg", 10e-6 * 935.0 * math.pi / 6.0),
            ("10 nC/g", 10e-6 * 935.0 * math.pi / 6.0),
            ("1e-4 C/m^3", 1e-4 * math.pi / 6.0),
        ],
    )
    def test_of_the_volume(self, text, amount):
        assert powder(charge_scale=text).charge_scale == pytest.approx(
            amount * 3.5e-4**3, rel=1e-15
        )

    def test_of_the_surface(self):
        charge = powder(charge_scale="5 uC/m^2").charge_scale
        assert charge == pytest.approx(5e-6 * math.pi * 3.5e-4**2, rel=1e-15, abs=0.0)

    def test_in_elementary_charges(self):
        assert powder(charge_scale="1000 e").charge_scale == 1.602176634e-16

    @given(st.floats(1e-6, 1e-3), st.floats(100.0, 1e4))
    def test_per_mass_times_mass_is_the_charge(self, diameter, density):
        here = powder(diameter=diameter, density=density, charge_scale="1 uC/kg")
        assert here.charge_scale / here.mass == pytest.approx(1e-6, rel=1e-12, abs=0.0)

    def test_given_as_numbers(self):
        here = powder(charge_scale=Charge(5e-6, "C/m^2"))
        assert here.charge_scale == powder(charge_scale="5 uC/m^2").charge_scale

    def test_given_in_another_unit(self):
        assert refusal(charge_scale=Charge(5.0, "nC")) == (
            "charge_scale is in 'nC', but must be in C, C/kg, C/m^2, C/m^3."
        )

    def test_wrong_kind(self):
        assert refusal(charge_scale="3 kg") == (
            "charge_scale: '3 kg' is a mass, expected a charge, a charge per mass, a charge per "
            "surface or a charge per volume (such as '1.3 pC')."
        )

    def test_a_wrong_diameter_is_told_first(self):
        assert refusal(diameter="3 kg", charge_scale="1 uC/kg").startswith("diameter: '3 kg'")

    def test_negative(self):
        sentence = refusal(charge_scale="-1 uC/kg")
        assert sentence == "charge_scale is '-1 uC/kg', but must be from 1e-24 to 0.001 C."


def test_wrong_dimension():
    expected = "diameter: '3 kg' is a mass, expected a length (such as '500 um')."
    assert refusal(diameter="3 kg") == expected
    with pytest.raises(InputError) as caught:
        Suspension.from_toml_text(toml(POWDER | {"diameter": "3 kg"}))
    assert str(caught.value) == "suspension." + expected


def test_missing_unit():
    assert refusal(diameter="3") == (
        "diameter: '3' has no unit, expected a length (such as '500 um')."
    )


@pytest.mark.parametrize("name", REQUIRED)
def test_missing_fields_say_what_they_are(name):
    data = dict(POWDER)
    del data[name]
    with pytest.raises(InputError, match=rf"^{name} is missing \(.+\)\.$"):
        Suspension(**data)


def test_missing_diameter_in_a_file():
    with pytest.raises(InputError) as caught:
        Suspension.from_toml_text(toml(POWDER).replace("diameter", "#"))
    assert str(caught.value) == (
        "suspension.diameter is missing (particle diameter, a length such as '500 um')."
    )


@pytest.mark.parametrize("name", RANGES)
def test_physical_ranges(name):
    inside, low, high = RANGES[name]
    assert getattr(powder(**{name: inside}), name) == inside
    for value in (low, high, math.inf, -math.inf):
        sentence = refusal(**{name: value})
        assert sentence.startswith(f"{name} is {value!r}, but must be ")
    assert refusal(**{name: math.nan}).startswith(f"{name} is nan, but must be a number")
    for value in (True, [1.0], b"1 m"):
        assert refusal(**{name: value}).startswith(f"{name} is {value!r}, but must be a number")


def test_values_are_told_as_they_were_given():
    assert refusal(diameter="350 km") == "diameter is '350 km', but must be from 1e-09 to 1 m."
    assert (
        refusal(restitution="110 %") == "restitution is '110 %', but must be a number from 0 to 1."
    )


def test_fraction_above_the_maximum_packing():
    assert refusal(solid_fraction=0.65) == (
        "solid_fraction is 0.65, but must be above 0 and below the maximum packing, 0.64."
    )
    assert powder(solid_fraction=0.65, maximum_packing=0.7).solid_fraction == 0.65


def test_maximum_packing_is_the_law_s_own():
    assert powder(radial_distribution="ma-ahmadi").maximum_packing == 0.64356
    assert powder(radial_distribution="ma-ahmadi", maximum_packing="70 %").maximum_packing == 0.7


@pytest.mark.parametrize(
    ("changes", "start", "proposed"),
    [
        ({"diametr": 1}, "diametr is not a known key; known are diameter, ", "diameter"),
        ({"drag": "gidaspov"}, "drag is 'gidaspov', but must be 'none' or ", "gidaspow"),
        ({"radial_distribution": "lun-savge"}, "radial_distribution is ", "lun-savage"),
        ({"preset": "glassbeads"}, "preset is 'glassbeads', but must be one of ", "glass-beads"),
    ],
)
def test_misspelt_names(changes, start, proposed):
    sentence = refusal(**changes)
    assert sentence.startswith(start)
    assert sentence.endswith(f" Did you mean '{proposed}'?")


def test_a_wrong_law_is_one_problem():
    assert "more problem" not in refusal(radial_distribution="x")


class TestDerived:
    """Quantities that follow."""

    def test_mass_and_number(self):
        here = powder()
        assert here.mass == pytest.approx(935.0 * math.pi * 3.5e-4**3 / 6.0, rel=1e-15, abs=0.0)
        assert here.number_density * here.volume == pytest.approx(
            here.solid_fraction, rel=1e-15, abs=0.0
        )
        assert here.velocity_scale**2 == pytest.approx(
            here.granular_temperature, rel=1e-15, abs=0.0
        )

    def test_transfer(self):
        here = powder()
        assert here.contact_length == collision.contact_length(here.mass, 3.5e-4, 2e9, 0.4)
        # beta/gamma = pi epsilon_0 d^2
        ratio = here.field_transfer / here.charge_transfer
        assert ratio == pytest.approx(
            math.pi * here.permittivity * here.diameter**2, rel=1e-14, abs=0.0
        )

    def test_contact_length_in_terms_of_a_hertzian_impact(self):
        """Its deepest overlap x is in m v^2/4 = (2/5) k x^(5/2), with the effective radius d/4.

        (2.12) prints 32 where this gives 16, so its length is smaller by 2^(2/5).
        """
        here, speed = powder(), 0.3
        stiffness = (
            (4.0 / 3.0)
            * (here.youngs_modulus / (2.0 * (1.0 - here.poisson_ratio**2)))
            * math.sqrt(here.diameter / 4.0)
        )
        overlap = (0.25 * here.mass * speed**2 * 2.5 / stiffness) ** 0.4
        assert 2.0**0.4 * here.contact_length * speed**0.8 == pytest.approx(
            overlap, rel=1e-12, abs=0.0
        )

    def test_laws_by_name(self):
        assert powder(radial_distribution="unity").contact_radial_distribution == 1.0
        g0 = powder().contact_radial_distribution
        assert g0 == pytest.approx(0.85 / 0.7**3, rel=1e-15, abs=0.0)
        assert powder(drag="none").drag_time == math.inf
        for name in ("stokes", "gidaspow"):
            here = powder(drag=name)
            assert here.drag_time == drag_time(name, here.drag_state)

    def test_speed_relative_to_the_gas(self):
        here = powder(slip_velocity=0.2)
        assert here.relative_speed == pytest.approx(math.sqrt(0.2**2 + 3e-3), rel=1e-15, abs=0.0)
        assert here.drag_state.reynolds_number == pytest.approx(
            1.2 * here.relative_speed * 3.5e-4 / 1.8e-5, rel=1e-15
        )
        assert here.drag_time < powder().drag_time


def toml(table):
    lines = [f"{name} = {value!r}" for name, value in table.items()]
    return "\n".join(["[suspension]", *lines])


class TestFiles:
    """The table [suspension], alone or in a case."""

    def test_alone(self, tmp_path):
        path = tmp_path / "powder.toml"
        path.write_text(toml(POWDER), encoding="utf-8")
        assert Suspension.from_toml(path) == powder()
        assert Suspension.from_toml_text(toml(POWDER)) == powder()

    def test_in_a_case(self):
        case = 'title = "bed"\nmodel = "full"\nclosures = "derived"\nexponent = 0.8\n' + toml(
            POWDER
        )
        case += "\n[grid]\npoints = [8]\n[initial]\nfile = 'x.nc'\n[run]\nt_end = 1.0"
        assert Suspension.from_toml_text(case) == powder()

    def test_from_a_preset(self):
        here = Suspension.from_toml_text('[suspension]\npreset = "pmma"\ndiameter = "80 um"')
        assert here == Suspension(preset="pmma", diameter=8e-5)
        assert "preset" not in here.model_dump()

    @pytest.mark.parametrize(
        ("text", "start"),
        [
            ("", "suspension is missing (a table with the particles"),
            ("suspension = 3", "suspension is 3, but must be a table"),
            ("[suspensoin]", "suspensoin is not a known key; known are suspension, "),
            ("[suspension]\npreset = 3", "suspension.preset is 3, but must be one of poly"),
            ("[suspension]\npreset = []", "suspension.preset is [], but must be one of poly"),
            ("[suspension]\na.b = 3", "suspension.a is not a known key"),
            ("[suspension", "the suspension is not valid TOML"),
            ("a" * 2**20 + "a", "the suspension has 1,048,577 bytes"),
        ],
    )
    def test_refused(self, text, start):
        with pytest.raises(InputError) as caught:
            Suspension.from_toml_text(text)
        assert str(caught.value).startswith(start)

    def test_missing_file(self, tmp_path):
        with pytest.raises(InputError, match=r"^case file '.*no\.toml' does not exist\.$"):
            Suspension.from_toml(tmp_path / "no.toml")


def test_annotations_are_checked_while_tests_run():
    with pytest.raises(Exception, match="diameter") as caught:
        Charge(1.0, "C").of_sphere("350 um", 935.0)
    assert type(caught.value).__module__.startswith("jaxtyping")
