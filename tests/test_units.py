"""Text with units: exact conversion, hostile text, readable output."""

import math
import time

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.processes import triboflux
from triboflux.errors import InputError
from triboflux.units import EXPECTED, LONGEST_TEXT, format_quantity, to_si

# Units of each kind and what one of them is in SI, from the definitions.
UNITS = {
    "m": {"m": 1.0, "um": 1e-6, "µm": 1e-6, "μm": 1e-6, "nm": 1e-9, "inch": 0.0254, "in": 0.0254},
    "kg/m^3": {"kg/m^3": 1.0, "g/cm³": 1e3, "kg m**-3": 1.0, "kg·m⁻³": 1.0, "g/cm3": 1e3},
    "Pa": {"Pa": 1.0, "GPa": 1e9, "MPa": 1e6, "N/mm^2": 1e6, "bar": 1e5, "kg/(m s^2)": 1.0},
    "J": {"J": 1.0, "eV": 1.602176634e-19, "N*m": 1.0, "erg": 1e-7},
    "Pa s": {"Pa s": 1.0, "Pa*s": 1.0, "cP": 1e-3, "kg/m/s": 1.0, "kg/(m*s)": 1.0},
    "F/m": {"F/m": 1.0, "pF/m": 1e-12, "A s/(V m)": 1.0},
    "m^2/s^2": {"m^2/s^2": 1.0, "m²/s²": 1.0, "cm^2/s^2": 1e-4, "m**2/s**2": 1.0, "J/kg": 1.0},
    "m/s": {"m/s": 1.0, "cm/s": 1e-2, "km/h": 1.0 / 3.6, "m s^-1": 1.0, "m s-1": 1.0},
    "C": {"C": 1.0, "pC": 1e-12, "µC": 1e-6, "e": 1.602176634e-19, "A*s": 1.0},
    "C/kg": {"C/kg": 1.0, "µC/kg": 1e-6, "uC/kg": 1e-6, "nC/g": 1e-6},
    "C/m^2": {"C/m^2": 1.0, "µC/m²": 1e-6, "nC/cm^2": 1e-5},
    "C/m^3": {"C/m^3": 1.0, "mC/m3": 1e-3},
    "": {"": 1.0, "%": 1e-2, "percent": 1e-2},
}
PAIRS = [(si, unit, factor) for si, units in UNITS.items() for unit, factor in units.items()]

numbers = st.floats(-1e100, 1e100).filter(lambda x: x == 0.0 or abs(x) > 1e-100)


def refusal(text, unit="m"):
    with pytest.raises(InputError) as caught:
        to_si(text, unit)
    sentence = str(caught.value)
    assert sentence.isprintable()
    assert len(sentence) < 300
    return sentence


@pytest.mark.parametrize(("si", "unit", "factor"), PAIRS)
def test_every_unit_is_known(si, unit, factor):
    value, found = to_si(f"3 {unit}", si)
    assert (value, found) == (pytest.approx(3.0 * factor, rel=1e-15, abs=0.0), si)
    # "3eV" is no power of ten
    assert to_si(f" 3{unit} ", si) == (value, si)


@given(st.sampled_from(PAIRS), numbers)
def test_numbers_in_any_unit_become_si(pair, number):
    si, unit, factor = pair
    assert to_si(f"{number!r} {unit}", si)[0] == pytest.approx(number * factor, rel=1e-12, abs=0.0)


@given(st.sampled_from(PAIRS), st.floats(1e-30, 1e30))
def test_values_survive_the_way_through_any_unit(pair, value):
    si, unit, factor = pair
    assert to_si(f"{value / factor!r} {unit}", si)[0] == pytest.approx(value, rel=1e-12, abs=0.0)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        *[("350 um", 350e-6), ("0.1 mm", 1e-4), ("3e-1 cm", 3e-3), (".5 m", 0.5), ("5. m", 5.0)],
        *[("+1E3 nm", 1e-6), ("-2 m", -2.0), ("3 m * m / m", 3.0), ("7*mm", 7e-3)],
        ("1e-400 m", 0.0),
    ],
)
def test_decimal_numbers_are_converted_exactly(text, value):
    assert to_si(text, "m") == (value, "m")


@pytest.mark.parametrize("unit", EXPECTED)
def test_every_example_is_of_its_own_kind(unit):
    assert to_si(EXPECTED[unit].example, unit)[1] == unit
    assert refusal("3 mol", unit).startswith("'3 mol' is an amount of substance, expected ")


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("3 kg", "is a mass"),
        ("3 degC", "is a temperature"),
        ("3 °F", "is a temperature"),
        ("45 %", "is a pure number"),
        ("3 kg^2", "has the dimension mass^2"),
        ("3", "has no unit"),
        ("1e3 ", "has no unit"),
        ("", "is empty"),
        ("  ", "is empty"),
        ("m", "does not begin with a number"),
        ("nan m", "does not begin with a number"),
        ("inf m", "does not begin with a number"),
        ("−3 m", "does not begin with a number"),
        ("1,5 mm", "has a unit that can't be read"),
        ("9**9**9 m", "has a unit that can't be read"),
        ("3 kg**1e9", "has a unit that can't be read"),
        ("3 m^99", "has a unit that can't be read"),
        ("3 m^0.5", "has a unit that can't be read"),
        ("3 m/", "has a unit that can't be read"),
        ("3 m//s", "has a unit that can't be read"),
        ("3 (m", "has a unit that can't be read"),
        ("3 m)", "has a unit that can't be read"),
        ("3 ((m))", "has a unit that can't be read"),
        ("3 m()", "has a unit that can't be read"),
        ("3 m; import os", "has a unit that can't be read"),
        ("3 __import__('os')", "has a unit that can't be read"),
        ("1e999 m", "is too large"),
        ("1e999999999999 m", "is too large"),
        ("1e300 km^9/m^8", "is too large"),
        ("3 degC*m/K", "has a unit that is no multiple of the SI unit"),
        ("3 parsecs_", "has the unknown unit 'parsecs_'"),
        ("3 nan", "has the unknown unit 'nan'"),
        ("3 lambda", "is a volume"),
        ("3 None", "has the unknown unit 'None'"),
        ("3 __class__", "has the unknown unit '__class__'"),
    ],
)
def test_text_that_is_no_length(text, problem):
    start = f"{text!r} {problem}, expected a length (such as '500 um')."
    assert refusal(text).startswith(start)


def test_logarithmic_units_are_no_pure_numbers():
    assert "is no multiple of the SI unit" in refusal("3 dB", "")


@pytest.mark.parametrize(
    ("text", "unit", "proposed"),
    [
        ("3 mm2x", "m", "mm"),
        ("3 Um", "m", "um"),
        ("2 Gpa", "Pa", "GPa"),
        ("1 coulom", "C", "coulomb"),
    ],
)
def test_unknown_units_propose_the_nearest(text, unit, proposed):
    assert refusal(text, unit).endswith(f". Did you mean '{proposed}'?")


def test_several_kinds_are_named():
    with pytest.raises(InputError) as caught:
        to_si("3 kg", "C", "C/kg", "C/m^2")
    assert str(caught.value) == (
        "'3 kg' is a mass, expected a charge, a charge per mass or a charge per surface "
        "(such as '1.3 pC')."
    )
    assert to_si("2 nC/g", "C", "C/kg") == (2e-6, "C/kg")


def test_long_text_is_refused_before_it_is_looked_at():
    assert f"is longer than {LONGEST_TEXT} characters" in refusal("3 " + "m*" * 10**6 + "m")
    assert "is longer" in refusal("9" * 10**6)


PIECES = """
    1 3 1e9 m kg ^9 ** / * ( ) nan degC dB e if lambda None in ² delta_degC mmH2O Fr pi ٣ _ °
""".split()

hostile = st.one_of(
    st.text(max_size=70),
    st.text(st.sampled_from("0123456789eE.+-*/^() mkgsCµ°%²⁻·_in"), max_size=60),
    st.lists(st.sampled_from([*PIECES, " ", "\x00"]), max_size=12).map("".join),
)


@given(hostile, st.sampled_from(sorted(EXPECTED)))
def test_any_text_is_a_number_or_a_sentence(text, unit):
    before = time.process_time()
    try:
        value, _ = to_si(text, unit)
    except InputError as error:
        assert str(error).isprintable()
        assert len(str(error)) < 300
    else:
        assert math.isfinite(value)
    # the registry itself takes up to a second, once
    assert time.process_time() - before < 2.0


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (1.3e-12, "C", "1.3 pC"),
        (0.0, "C", "0 C"),
        (math.inf, "s", "inf s"),
        (-3e-7, "S/m", "-300 nS/m"),
        (3.5e-4, "m", "350 µm"),
        (999.99999, "m", "1 km"),
        (2.3e-8, "kg", "23 µg"),
        (935.0, "kg/m^3", "935 kg/m^3"),
        (1.8e-5, "Pa s", "18 µPa s"),
        (4e5, "s", "4e+05 s"),
        (2e-3, "s", "2 ms"),
        (1e-3, "m^2/s^2", "0.001 m^2/s^2"),
        (5e-6, "C/kg", "5 µC/kg"),
        (1e-30, "C", "1e-12 aC"),
        (5.0, "1/s", "5 1/s"),
        (0.123456, "", "0.1235"),
    ],
)
def test_readable_numbers(value, unit, text):
    assert format_quantity(value, unit) == text


@given(st.sampled_from(sorted(EXPECTED)), st.floats(-1e30, 1e30), st.integers(1, 17))
def test_readable_numbers_can_be_read(unit, value, digits):
    assume(value == 0.0 or abs(value) > 1e-30)
    text = format_quantity(value, unit, digits)
    assert to_si(text, unit)[0] == pytest.approx(value, rel=1e-15 + 10.0 ** (1 - digits))


def test_numbers_and_presets_do_not_import_pint(tmp_path):
    code = """
import sys
from triboflux.presets import polyethylene
from triboflux.units import format_quantity
polyethylene(diameter=3e-4).contact_radial_distribution, format_quantity(1e-3, "m")
assert "pint" not in sys.modules
assert polyethylene(diameter="300 um").diameter == 3e-4
assert "pint" in sys.modules
"""
    done = triboflux(folder=tmp_path, code=code)
    assert done.stderr == ""
    assert done.returncode == 0
