"""Cases in SI: one sentence for wrong units, wrong forms and impossible suspensions."""

import math
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.cases import data
from tests.powders import POWDER, TOML, refusal, told_by
from triboflux.case import Case
from triboflux.errors import InputError

# ------------------------------------------------------------------ wrong units


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (
            {"run__t_end": "3 kg"},
            "run.t_end: '3 kg' is a mass, expected a time (such as '20 ms').",
        ),
        (
            {"run__outputs": ["1 s", "3 m"]},
            "run.outputs[1]: '3 m' is a length, expected a time (such as '20 ms').",
        ),
        (
            {"grid__lengths": ["1 s"]},
            "grid.lengths[0]: '1 s' is a time, expected a length (such as '500 um').",
        ),
        (
            {"run__stop_at_peak_charge": "1 pC/s"},
            "run.stop_at_peak_charge: '1 pC/s' is a current, expected a charge, a charge per mass, "
            "a charge per surface or a charge per volume (such as '1.3 pC').",
        ),
        (
            {"run__stop_at_rate": "1 pC"},
            "run.stop_at_rate: '1 pC' is a charge, expected a current (such as '2 pC/s').",
        ),
        (
            {"initial__charge": [{"mode": [1], "sine": "1 pF"}]},
            "initial.charge[0].sine: '1 pF' is a capacitance, expected a charge, a charge per mass,"
            " a charge per surface or a charge per volume (such as '1.3 pC').",
        ),
        (
            {"initial__covariance": [{"component": 0, "mode": [1], "cosine": "1 pC"}]},
            "initial.covariance[0].cosine: '1 pC' is a charge, expected a charge times a velocity "
            "(such as '0.1 pC m/s').",
        ),
        (
            {"initial__variance": [{"mode": [0]}, {"mode": [1], "sine": "1 pC"}]},
            "initial.variance[1].sine: '1 pC' is a charge, expected a charge squared (such as "
            "'1 pC^2').",
        ),
        ({"run__t_end": "3"}, "run.t_end: '3' has no unit, expected a time (such as '20 ms')."),
        ({"run__t_end": ""}, "run.t_end: '' is empty, expected a time (such as '20 ms')."),
        (
            {"run__t_end": "3 sek"},
            "run.t_end: '3 sek' has the unknown unit 'sek', expected a time (such as '20 ms').",
        ),
        (
            {"suspension": POWDER | {"diameter": "3 kg"}},
            "suspension.diameter: '3 kg' is a mass, expected a length (such as '500 um').",
        ),
        (
            {"suspension": POWDER | {"charge_scale": "3 kg"}},
            "suspension.charge_scale: '3 kg' is a mass, expected a charge, a charge per mass, ",
        ),
    ],
)
def test_wrong_kinds(changes, sentence):
    assert refusal(**changes).startswith(sentence)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"grid__lengths": "10 cm"}, "grid.lengths is '10 cm', but must be a list."),
        ({"run__outputs": "1 s"}, "run.outputs is '1 s', but must be a count or a list of times."),
        ({"run__t_end": ["1 s"]}, "run.t_end is ['1 s'], but must be a number."),
        ({"initial__charge": "1 pC"}, "initial.charge is '1 pC', but must be a list."),
        ({"initial__charge": ["1 pC"]}, "initial.charge[0] is '1 pC', but must be a table."),
        (
            {"initial__charge": [{"mode": "1", "sine": "1 pC"}]},
            "initial.charge[0].mode is '1', but must be a list.",
        ),
        ({"grid__points": ["1 m"]}, "grid.points[0] is '1 m', but must be a whole number."),
        ({"run__rtol": "1 s"}, "run.rtol is '1 s', but must be a number."),
        ({"run__t_end": "-1 s"}, "run.t_end is -0.1, but must be finite and above 0."),
        ({"run__outputs": ["2 s", "1 s"]}, "run.outputs is [0.2, 0.1], but must have finite times"),
        ({"run__outputs": ["1 s"] * 1001}, "run.outputs has 1001 entries with units, but may have"),
        (
            {"initial__charge": [{"mode": [1], "sine": "1 pC"}] * 1001},
            "initial.charge[0].sine is '1 pC', but must be a number (and 1000 more problems).",
        ),
        ({"run": 3}, "run is 3, but must be a table."),
        ({"grid": "1 m"}, "grid is '1 m', but must be a table."),
        (
            {"closures": "derive"},
            "closures is 'derive', but must be 'derived' or 'published' or 'complete'.",
        ),
        ({"closures": ["derived"]}, "closures is ['derived'], but must be text."),
    ],
)
def test_wrong_forms_are_told_as_without_units(changes, sentence):
    assert refusal(**changes).startswith(sentence)


@pytest.mark.parametrize(
    "field",
    [
        "run.t_end",
        "run.stop_at_peak_charge",
        "run.stop_at_rate",
        "run.outputs[1]",
        "grid.lengths[0]",
        "initial.charge[0].sine",
        "initial.variance[0].cosine",
    ],
)
@pytest.mark.parametrize("text", ["20 ms", "20", "", "a" * 500, "\x1b[31m 3 s"])
def test_texts_need_a_suspension(field, text):
    changes = {
        "run.t_end": {"run__t_end": text},
        "run.stop_at_peak_charge": {"run__stop_at_peak_charge": text},
        "run.stop_at_rate": {"run__stop_at_rate": text},
        "run.outputs[1]": {"run__outputs": [0.1, text]},
        "grid.lengths[0]": {"grid__lengths": [text]},
        "initial.charge[0].sine": {"initial__charge": [{"mode": [1], "sine": text}]},
        "initial.variance[0].cosine": {"initial__variance": [{"mode": [0], "cosine": text}]},
    }
    with pytest.raises(InputError) as caught:
        Case(**data(**changes[field]))
    sentence = str(caught.value)
    assert sentence.isprintable()
    assert sentence.startswith(f"{field} is '{text[:20] if text.isprintable() else ''}")
    assert sentence.endswith(
        ", but must be a number in a case with a table [numbers]; units need the scales of a table "
        "[suspension]."
    )


# ------------------------------------------------------------------ the table of a suspension


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"diameter": -1e-4}, "suspension.diameter is -0.0001, but must be from 1e-09 to 1 m."),
        ({"diametr": 1e-4}, "suspension.diametr is not a known key; known are diameter, "),
        ({"density": "1 kg"}, "suspension.density: '1 kg' is a mass, expected a density (such as "),
        ({"solid_fraction": 0.65}, "suspension.solid_fraction is 0.65, but must be above 0 and "),
        ({"drag": "stoke"}, "suspension.drag is 'stoke', but must be "),
        ({"preset": "glas-beads"}, "suspension.preset is 'glas-beads', but must be one of "),
        ({"diameter": math.nan}, "suspension.diameter is nan, but must be a number."),
        ({"diameter": True}, "suspension.diameter is True, but must be a number."),
        ({"diameter": None}, "suspension.diameter is None, but must be a number."),
        ({"diameter": [1]}, "suspension.diameter is [1], but must be a number."),
        ({"diameter": "9" * 5000}, "suspension.diameter: '999"),
        ({"diameter": "1e400 m"}, "suspension.diameter: '1e400 m' is too large, expected a length"),
        ({"diameter": "__import__('os')"}, "suspension.diameter: \"__import__('os')\" does not "),
        ({"diameter": "3 m" + "\x00"}, "suspension.diameter: '3 m\\x00' has a unit that can't be "),
        ({"softened_modulus": 1}, "suspension.softened_modulus is 1, but must be true or false."),
    ],
)
def test_refused_suspensions(changes, sentence):
    assert refusal(suspension=POWDER | changes).startswith(sentence)


def test_near_misses_are_proposed():
    assert refusal(suspension=POWDER | {"diametr": 1}).endswith("Did you mean 'diameter'?")
    assert refusal(suspension=POWDER | {"drag": "stoke"}).endswith("Did you mean 'stokes'?")
    assert refusal(suspension={"preset": "glas-beads"}).endswith("Did you mean 'glass-beads'?")
    misspelt = told_by(TOML.replace("[suspension]", "[suspensoin]"))
    assert misspelt.startswith("suspensoin is not a known key; ")
    assert misspelt.endswith("Did you mean 'suspension'?")


@pytest.mark.parametrize("field", [f for f in POWDER if f != "diameter"])
def test_missing_fields_say_what_they_are(field):
    rest = {name: value for name, value in POWDER.items() if name != field}
    sentence = refusal(suspension=rest)
    assert sentence.startswith(f"suspension.{field} is missing (")
    assert sentence.endswith(").")


def test_missing_diameter_is_told_with_an_example():
    rest = {name: value for name, value in POWDER.items() if name != "diameter"}
    assert refusal(suspension=rest) == (
        "suspension.diameter is missing (particle diameter, a length such as '500 um')."
    )


@pytest.mark.parametrize("value", [3, "glass-beads", [], True, math.nan])
def test_suspension_is_a_table(value):
    assert refusal(suspension=value).startswith("suspension ")
    assert refusal(suspension=value).endswith("must be a table.")


def test_further_problems_are_counted():
    bad = POWDER | {"diameter": -1, "density": -1, "restitution": 2}
    assert refusal(suspension=bad).endswith(" (and 2 more problems).")


# ------------------------------------------------------------------ hostile files


@given(st.integers(0, len(TOML) - 1), st.characters())
def test_one_wrong_character_is_survived(position, character):
    text = TOML[:position] + character + TOML[position + 1 :]
    try:
        Case.from_toml_text(text)
    except InputError as error:
        assert str(error).isprintable()


@pytest.mark.parametrize(
    "hostile",
    [
        "outputs = " + "[" * 480 + "]" * 480,
        "outputs = [" + '"1 s", ' * 100_000 + "]",
        "stop_at_rate = '" + "(" * 500_000 + "'",
        "stop_at_rate = '1 " + "m/m/" * 100_000 + "'",
        "stop_at_rate = '1 m**9999999999'",
    ],
)
def test_hostile_text_is_refused_at_once(hostile):
    began = time.monotonic()
    told = told_by(TOML + hostile)
    assert len(told) < 400
    assert time.monotonic() - began < 5
