"""Cases in SI: numbers that follow from a suspension, and texts with units everywhere else."""

import math

import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from tests.cases import NUMBERS, data
from tests.powders import (
    CHARGE,
    LENGTH,
    MASS,
    POWDER,
    SURFACE,
    TIME,
    TOML,
    VELOCITY,
    case,
    from_powder,
    refusal,
    told_by,
)
from triboflux import numbers, presets
from triboflux.case import CLOSURE_NAMES, Case, Mode, Run
from triboflux.errors import InputError
from triboflux.scales import Scales
from triboflux.suspension import Suspension

# ------------------------------------------------------------------ numbers follow


@pytest.mark.parametrize("closures", CLOSURE_NAMES)
def test_numbers_follow_from_the_suspension(closures):
    made = case(closures=closures)
    assert made.suspension == Suspension(**POWDER)
    assert made.numbers == from_powder(closures)
    assert from_powder("derived") != from_powder("published")


def test_suspension_may_be_an_object():
    fields = data(suspension=presets.pmma())
    del fields["numbers"]
    assert Case(**fields).numbers == numbers.from_suspension(presets.pmma())


def test_equal_numbers_may_be_given_too():
    made = case()
    assert Case(**made.model_dump()) == made
    assert case(numbers=made.numbers) == made
    assert case(numbers=made.numbers.model_dump()) == made


@pytest.mark.parametrize("given", [NUMBERS, {}, None, 3])
def test_other_numbers_are_refused(given):
    sentence = refusal(numbers=given)
    assert sentence == (
        "numbers is given beside suspension, from which other numbers follow; give one."
    )


def test_numbers_of_the_other_closures_are_refused():
    assert refusal(numbers=from_powder("published")).startswith("numbers is given beside")
    case(numbers=from_powder("published"), closures="published")


def test_neither_is_given():
    fields = data()
    del fields["numbers"]
    with pytest.raises(InputError, match=r"^numbers is missing \(.* suspension, in SI\)\.$"):
        Case(**fields)
    with pytest.raises(InputError, match=r"^numbers is missing"):
        Case(**fields, suspension=None)


def test_contacts_are_hertzian():
    for exponent in (0.5, math.nan, "0.8", [1], "a" * 1000):
        assert refusal(exponent=exponent).startswith("exponent is ")
        assert refusal(exponent=exponent).endswith(
            ", but must be 0.8 with a suspension, whose contacts are Hertzian."
        )
    assert case(exponent=0.8).exponent == 0.8


def test_suspension_whose_numbers_leave_the_range():
    hot = dict(POWDER) | {"granular_temperature": 1e-14, "domain_length": 1e5, "charge_scale": 1e-3}
    sentence = refusal(suspension=hot)
    assert sentence.startswith("suspension is out of range, because its energy_ratio is ")
    assert sentence.endswith("e+45, but must be zero or positive and finite (up to 1e+30).")


# ------------------------------------------------------------------ texts with units


def test_texts_are_divided_by_their_scales():
    made = case(
        grid__points=[16, 16],
        grid__lengths=["10 cm", 0.75],
        run__t_end="3 s",
        run__outputs=["500 ms", 0.1, "0.05 min"],
        run__stop_at_peak_charge="0.5 pC",
        run__stop_at_rate="1 fC/s",
        initial__charge=[{"mode": [1, 0], "sine": "-1 pC", "cosine": 0.25}],
        initial__covariance=[{"component": 1, "mode": [1, 0], "cosine": "1 pC mm/s"}],
        initial__variance=[{"mode": [0, 0], "cosine": "0.04 pC^2"}],
    )
    close = pytest.approx
    assert made.grid.lengths == close((0.1 / LENGTH, 0.75), rel=1e-15)
    assert made.run.t_end == close(3 / TIME, rel=1e-15)
    assert made.run.outputs == close((0.5 / TIME, 0.1, 3 / TIME), rel=1e-15)
    assert made.run.stop_at_peak_charge == close(0.5e-12 / CHARGE, rel=1e-15)
    assert made.run.stop_at_rate == close(1e-15 / (CHARGE / TIME), rel=1e-15)
    (charge,), (covariance,), (variance,) = (
        made.initial.charge,
        made.initial.covariance,
        made.initial.variance,
    )
    assert (charge.sine, charge.cosine) == close((-1e-12 / CHARGE, 0.25), rel=1e-15)
    assert covariance.cosine == close(1e-15 / (CHARGE * VELOCITY), rel=1e-15)
    assert variance.cosine == close(0.04e-24 / CHARGE**2, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "coulombs"),
    [
        ("-1 pC", -1e-12),
        ("3 uC/kg", 3e-6 * MASS),
        ("5 nC/m^2", 5e-9 * SURFACE),
        ("1e-4 C/m^3", 1e-4 * math.pi / 6 * 5e-4**3),
    ],
)
def test_charges_may_be_told_by_what_carries_them(text, coulombs):
    (mode,) = case(initial__charge=[{"mode": [1], "cosine": text}]).initial.charge
    assert mode.cosine == pytest.approx(coulombs / CHARGE, rel=1e-14, abs=0.0)
    stop = case(run__stop_at_peak_charge=text.removeprefix("-")).run.stop_at_peak_charge
    assert stop == pytest.approx(abs(coulombs) / CHARGE, rel=1e-14, abs=0.0)


def test_plain_numbers_keep_their_scaled_meaning():
    made, plain = case(run__t_end=0.3, run__outputs=(0.1, 0.2)), Case(**data(run__t_end=0.3))
    assert made.run.t_end == plain.run.t_end
    assert made.run.outputs == (0.1, 0.2)
    assert made.initial == plain.initial
    assert case(run=Run(t_end=0.5), initial__charge=[Mode(mode=(1,), sine=-1.0)]).run.t_end == 0.5


def test_scales_are_those_of_the_documentation():
    s = Suspension(**POWDER)
    scales = Scales.of(s)
    n = 6 * 0.1 / (math.pi * 5e-4**3)
    field = n * CHARGE * LENGTH / s.permittivity
    expected = {
        "length": LENGTH,
        "velocity": VELOCITY,
        "time": TIME,
        "charge": CHARGE,
        "charge_rate": CHARGE / TIME,
        "covariance": CHARGE * VELOCITY,
        "variance": CHARGE**2,
        "field": field,
        "potential": field * LENGTH,
        "number_density": n,
        "temperature": VELOCITY**2,
        "covariance_flux": CHARGE * VELOCITY**2,
        "variance_flux": CHARGE**2 * VELOCITY,
        "specific_volume": 1 / n,
    }
    assert vars(scales) == pytest.approx(expected, rel=1e-14, abs=0.0)


# ------------------------------------------------------------------ TOML


def test_reads_a_file_in_si():
    made = Case.from_toml_text(TOML)
    assert made == case(
        title="Powder",
        closures="published",
        grid__points=[16],
        grid__lengths=["10 cm"],
        initial__charge=[{"mode": [1], "sine": "-1 pC"}],
        run__t_end="3 s",
    )
    assert made.numbers == from_powder("published")


def test_file_names_its_wrong_unit():
    told = told_by(TOML.replace('"500 um"', '"3 kg"'))
    assert told == "suspension.diameter: '3 kg' is a mass, expected a length (such as '500 um')."
    told = told_by(TOML.replace('"3 s"', '"3 kg"'))
    assert told == "run.t_end: '3 kg' is a mass, expected a time (such as '20 ms')."


def test_preset_in_a_file():
    start, end = TOML.index("diameter ="), TOML.index("[grid]")
    table = 'preset = "glass-beads"\ndiameter = "1 mm"\ncharge_scale = "5 nC/m^2"\n\n'
    made = Case.from_toml_text(TOML[:start] + table + TOML[end:])
    assert made.suspension == presets.glass_beads(diameter=1e-3, charge_scale="5 nC/m^2")
    assert made.suspension.charge_scale == pytest.approx(5e-9 * math.pi * 1e-6, rel=1e-12, abs=0.0)


def test_written_case_gives_the_suspension_and_not_its_numbers():
    made = Case.from_toml_text(TOML)
    text = made.to_toml()
    assert "[numbers]" not in text
    assert "peclet" not in text
    assert "diameter = 0.0005\n" in text
    assert Case.from_toml_text(text) == made
    assert "[suspension]" not in Case(**data()).to_toml()


def logarithmic(low, high):
    return st.floats(math.log(low) + 1e-9, math.log(high) - 1e-9).map(math.exp)


def quantity(low, high, *units):
    """Return numbers with one of the units."""
    return st.builds(
        lambda value, unit: f"{value!r} {unit}", st.floats(low, high), st.sampled_from(units)
    )


@st.composite
def cases_in_si(draw):
    packing = draw(st.floats(0.3, 0.74))
    charges = quantity(-5, 5, "pC", "uC/kg", "nC/m^2", "mC/m^3") | st.floats(-1, 1)
    return {
        "title": "Powder",
        "closures": draw(st.sampled_from(CLOSURE_NAMES)),
        "suspension": {
            "diameter": draw(quantity(1, 1000, "um", "µm")),
            "density": draw(logarithmic(100, 1e4)),
            "youngs_modulus": draw(quantity(1, 200, "MPa", "GPa")),
            "poisson_ratio": draw(st.floats(-0.5, 0.5)),
            "restitution": draw(st.floats(0, 1)),
            "solid_fraction": draw(st.floats(1e-4, 0.99)) * packing,
            "maximum_packing": packing,
            "granular_temperature": draw(logarithmic(1e-8, 10)),
            "domain_length": draw(quantity(0.1, 100, "cm", "m")),
            "charge_scale": draw(quantity(0.1, 10, "pC", "uC/kg", "uC/m^2")),
            "radial_distribution": draw(st.sampled_from(["lun-savage", "ma-ahmadi", "unity"])),
            "drag": draw(st.sampled_from(["none", "stokes", "gidaspow"])),
            "softened_modulus": draw(st.booleans()),
            "work_function": draw(st.none() | quantity(1, 10, "eV")),
        },
        "grid": {
            "points": (8, 12),
            "lengths": (draw(quantity(1, 100, "mm")), draw(st.floats(1, 2))),
        },
        "initial": {
            "charge": [{"mode": (1, 0), "sine": draw(charges), "cosine": draw(charges)}],
            "covariance": [
                {"mode": (0, 1), "component": 1, "sine": draw(quantity(0, 9, "pC m/s"))}
            ],
            "variance": [{"mode": (0, 0), "cosine": draw(quantity(0, 9, "pC^2"))}],
        },
        "run": {
            "t_end": draw(quantity(1, 100, "s", "min")),
            "stop_at_peak_charge": draw(st.none() | quantity(0.01, 1, "pC", "uC/kg")),
            "stop_at_rate": draw(st.none() | quantity(0.01, 1, "pC/s")),
        },
    }


@settings(max_examples=50)  # a text takes a millisecond to read
@given(cases_in_si())
def test_toml_round_trip_is_exact(fields):
    try:
        made = Case(**fields)
    except InputError as error:
        # a gas of tiny particles at rest with strong charges
        assert "out of range" in str(error)
        reject()
    text = made.to_toml()
    again = Case.from_toml_text(text)
    assert again == made
    assert again.to_toml() == text
    assert Case(**made.model_dump()) == made
