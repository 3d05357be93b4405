"""A case: TOML both ways, and one sentence for everything that is not allowed."""

import math
import subprocess
import sys
import time
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import triboflux
from tests.cases import NUMBERS, data
from triboflux import closures
from triboflux.case import CLOSURE_NAMES, Case, GridSpec, Initial, Mode, Run
from triboflux.errors import InputError
from triboflux.numbers import Numbers

TOML = """
title = "Fig. 2"
model = "full"
closures = "published"

[numbers]
peclet = 1e6
tau_c = 0.1
tau_p = inf
energy_ratio = 300
length_ratio = 192.0
restitution = 1.0

[grid]
points = [128]

[initial]
charge = [ { mode = [1], sine = -1.0 } ]

[run]
t_end = 1.0
stop_at_peak_charge = 0.5
"""


def refusal(**changes):
    """Return the sentence with which a changed case is refused."""
    with pytest.raises(InputError) as caught:
        Case(**data(**changes))
    sentence = str(caught.value)
    assert sentence.isprintable()
    assert len(sentence) < 400
    return sentence


def test_reads_the_documented_file():
    case = Case.from_toml_text(TOML)
    assert (case.title, case.model, case.closures, case.exponent) == (
        "Fig. 2",
        "full",
        "published",
        0.8,
    )
    assert case.numbers == Numbers(**NUMBERS)
    assert case.grid == GridSpec(points=(128,), lengths=(1.0,))
    assert case.initial == Initial(charge=(Mode(mode=(1,), sine=-1.0),))
    assert case.run == Run(t_end=1.0, stop_at_peak_charge=0.5)
    assert case.run.outputs == 20


def test_closure_names_are_those_of_the_closures():
    assert CLOSURE_NAMES == closures.NAMES


def test_public_names_are_lazy_and_complete():
    for name in triboflux.__all__:
        if name not in ("integrate", "solve"):
            assert getattr(triboflux, name) is not None
    assert triboflux.Case is Case
    assert set(dir(triboflux)) == set(triboflux.__all__)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = triboflux.nothing


def test_solve_is_the_function_whoever_imported_its_module(monkeypatch):
    module = ModuleType("triboflux.solve")
    module.solve = object()
    monkeypatch.setitem(vars(triboflux), "solve", None)  # restored afterwards
    triboflux.solve = module  # what importing the submodule does
    assert triboflux.solve is module.solve


def test_reading_a_case_imports_nothing_heavy():
    code = (
        "import sys, triboflux; triboflux.Case.from_toml_text(sys.argv[1]); "
        "print([m for m in ('jax', 'xarray', 'pint', 'matplotlib') if m in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, TOML], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


# ------------------------------------------------------------------ round trip

positive = st.floats(1e-30, 1e30)
positive_or_infinite = positive | st.just(math.inf)
amplitude = st.floats(-1e30, 1e30)
title = st.text(st.characters(exclude_categories=["C", "Zl", "Zp"]), max_size=200).filter(
    str.isprintable
)


@st.composite
def cases(draw):
    points = tuple(draw(st.lists(st.integers(4, 40), min_size=1, max_size=3)))
    dimensions = len(points)
    waves = st.tuples(*(st.integers(-((n - 1) // 3), (n - 1) // 3) for n in points))
    mode = st.fixed_dictionaries({"mode": waves, "sine": amplitude, "cosine": amplitude})
    component = st.fixed_dictionaries(
        {"mode": waves, "sine": amplitude, "component": st.integers(0, dimensions - 1)}
    )
    times = st.lists(st.floats(0, 1), min_size=1, max_size=5, unique=True).map(sorted)
    optional = positive | st.none()
    return {
        "title": draw(title),
        "closures": "derived",
        "exponent": draw(st.floats(-0.5, 4, exclude_min=True)),
        "numbers": {
            "peclet": draw(positive_or_infinite),
            "tau_c": draw(positive),
            "tau_p": draw(positive_or_infinite),
            "tau_sigma": draw(positive_or_infinite),
            "energy_ratio": draw(st.floats(0, 1e30)),
            "length_ratio": draw(positive),
            "restitution": draw(st.floats(0, 1)),
        },
        "grid": {
            "points": points,
            "lengths": tuple(draw(positive) for _ in points),
        },
        "initial": {
            "charge": draw(st.lists(mode, max_size=3)),
            "covariance": draw(st.lists(component, max_size=3)),
            "variance": [{"mode": (0,) * dimensions, "cosine": draw(positive)}],
            "neutralising_background": True,
        },
        "run": {
            "t_end": draw(st.floats(1, 1e300)),
            "stop_at_peak_charge": draw(optional),
            "stop_at_rate": draw(optional),
            "outputs": draw(st.integers(1, 100_000) | times),
            "rtol": draw(st.floats(1e-12, 0.1)),
            "atol": draw(st.floats(0, 1e30)),
            "allow_out_of_range": draw(st.booleans()),
        },
    }


@given(cases())
def test_toml_round_trip_is_exact(fields):
    case = Case(**fields)
    text = case.to_toml()
    again = Case.from_toml_text(text)
    assert again == case
    assert again.to_toml() == text


def test_file_of_the_initial_state_is_relative_to_the_case_file(tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(TOML.replace("charge = [ { mode = [1], sine = -1.0 } ]", 'file = "start.nc"'))
    case = Case.from_toml(path)
    assert case.initial.file == str(tmp_path / "start.nc")
    assert Case.from_toml_text(case.to_toml()) == case
    plain = Case(**data(initial__charge=[], initial__file="start.nc"))
    assert Case.from_toml_text(plain.to_toml()) == plain


def test_accepts_what_windows_editors_write(tmp_path):
    path = tmp_path / "case.toml"
    path.write_bytes(b"\xef\xbb\xbf" + TOML.replace("\n", "\r\n").encode())
    assert Case.from_toml(path) == Case.from_toml_text(TOML)


def test_python_may_give_arrays():
    case = Case(**data(run__outputs=np.linspace(0, 1, 3), grid__points=np.array([32])))
    assert case.run.outputs == (0.0, 0.5, 1.0)
    assert case.grid.points == (32,)


# ------------------------------------------------------------------ refusals


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"modle": "full"}, "modle is not a known key; .* Did you mean 'model'?"),
        ({"run__tend": 1}, "run.tend is not a known key; .* Did you mean 't_end'?"),
        (
            {"model": "fulll"},
            "model is 'fulll', but must be 'self-consistent-flow' or .*. Did you mean 'full'?",
        ),
        (
            {"closures": "publishd"},
            "closures is 'publishd', but must be 'derived' or 'published' or 'complete'."
            " Did you mean 'published'?",
        ),
        ({"model": 3}, "model is 3, but must be text."),
        ({"numbers": 3}, "numbers is 3, but must be a table."),
        ({"numbers__tau_c": -0.1}, "numbers.tau_c is -0.1, but must be a positive number"),
        ({"numbers__tau_p": 0}, "numbers.tau_p is 0, but must be a positive number"),
        ({"numbers__tau_c": math.nan}, "numbers.tau_c is nan, but must be a number."),
        ({"numbers__restitution": 1.5}, "numbers.restitution is 1.5, but must be a number from 0"),
        ({"exponent": math.inf}, "exponent is inf, but must be above -0.5 and at most 4."),
        ({"exponent": -0.5}, "exponent is -0.5, but must be above -0.5 and at most 4."),
        (
            {"closures": "published", "exponent": 1.0},
            "exponent is 1.0, but must be 0.8 for the published closures.",
        ),
        ({"grid__points": [0]}, "grid.points is [0], but must have entries from 4 to 1048576."),
        ({"grid__points": [-8]}, "grid.points is [-8], but must have entries from 4"),
        ({"grid__points": [2**21]}, "grid.points is [2097152], but must have entries from 4"),
        ({"grid__points": []}, "grid.points is [], but must have 1, 2 or 3 entries"),
        ({"grid__points": [8] * 4}, "grid.points is [8, 8, 8, 8], but must have 1, 2 or 3"),
        ({"grid__points": [32.0]}, "grid.points[0] is 32.0, but must be a whole number."),
        ({"grid__points": 32}, "grid.points is 32, but must be a list."),
        ({"grid__lengths": [1.0, 1.0]}, "grid.lengths has 2 entries, but must have as many"),
        ({"grid__lengths": [math.inf]}, "grid.lengths[0] is inf, but must be a positive finite"),
        ({"grid__lengths": [0]}, "grid.lengths[0] is 0, but must be a positive finite number"),
        ({"run__t_end": 0}, "run.t_end is 0, but must be finite and above 0."),
        ({"run__t_end": -1.0}, "run.t_end is -1.0, but must be finite and above 0."),
        ({"run__t_end": math.inf}, "run.t_end is inf, but must be finite and above 0."),
        ({"run__stop_at_peak_charge": 0.0}, "run.stop_at_peak_charge is 0.0, but must be a pos"),
        ({"run__stop_at_rate": -1}, "run.stop_at_rate is -1, but must be a positive finite"),
        ({"run__outputs": 0}, "run.outputs is 0, but must be a count from 1 to 100000"),
        ({"run__outputs": 100_001}, "run.outputs is 100001, but must be a count from 1 to"),
        ({"run__outputs": []}, "run.outputs is [], but must have 1 to 100000 times."),
        ({"run__outputs": [0.5, 0.5]}, "run.outputs is [0.5, 0.5], but must have finite times in"),
        ({"run__outputs": [math.nan]}, "run.outputs is [nan], but must have finite times in"),
        ({"run__outputs": [-0.1, 1]}, "run.outputs is [-0.1, 1], but must have finite times in"),
        ({"run__outputs": [0.5, 1.5]}, "run.outputs ends at 1.5, but its times must not exceed"),
        ({"run__outputs": [10**400]}, "run.outputs is [an integer of 1329 bits], but must have"),
        ({"run__outputs": True}, "run.outputs is True, but must be a count or a list of times."),
        ({"run__rtol": 1e-13}, "run.rtol is 1e-13, but must be a number from 1e-12 to 0.1."),
        ({"run__rtol": 0.5}, "run.rtol is 0.5, but must be a number from 1e-12 to 0.1."),
        ({"run__atol": -1e-9}, "run.atol is -1e-09, but must be zero or positive and finite"),
        ({"run__atol": math.inf}, "run.atol is inf, but must be zero or positive and finite"),
        ({"run__allow_out_of_range": 1}, "run.allow_out_of_range is 1, but must be true or false."),
        ({"title": "a\nb"}, "title is 'a\\nb', but must be one line of at most 200 printable"),
        ({"title": "a\x00b"}, "title is 'a\\x00b', but must be one line of at most 200 printable"),
        ({"title": "a" * 201}, "title is 'aaaa"),
    ],
)
def test_refusals(changes, sentence):
    head, *tail = sentence.split(".*")
    told = refusal(**changes)
    assert told.startswith(head)
    for part in tail:
        assert part in told


@pytest.mark.parametrize(
    ("charge", "sentence"),
    [
        ([{"mode": [1, 1]}], "initial.charge[0].mode is [1, 1], but must have one whole number"),
        ([{"mode": [1]}, {"mode": []}], "initial.charge[1].mode is [], but must have one whole"),
        ([{"mode": 1}], "initial.charge[0].mode is 1, but must be a list."),
        ([{"mode": [1.5]}], "initial.charge[0].mode[0] is 1.5, but must be a whole number."),
        ([{"sine": 1.0}], "initial.charge[0].mode is missing"),
        ([{"mode": [1], "sin": 1.0}], "initial.charge[0].sin is not a known key"),
        ([{"mode": [1], "sine": math.nan}], "initial.charge[0].sine is nan, but must be a number."),
        ([{"mode": [1], "cosine": -math.inf}], "initial.charge[0].cosine is -inf, but must be a f"),
        ([{"mode": [0], "cosine": 0.1}], "initial.charge has a net charge of 0.1, but must be"),
        ({"mode": [1]}, "initial.charge is {'mode': [1]}, but must be a list."),
        ([{"mode": [1]}] * 1001, "initial.charge has 1001 entries, but must have at most 1000."),
        (
            [{"mode": [-11]}],
            "initial.charge[0].mode is [-11], but 32 points along x resolve no more than 10 waves "
            "after de-aliasing (11 waves need 34 points).",
        ),
    ],
)
def test_refused_modes(charge, sentence):
    assert refusal(initial__charge=charge).startswith(sentence)


def test_the_proposed_number_of_points_is_the_smallest_that_works():
    mode = [{"mode": [11], "sine": 1.0}]
    Case(**data(initial__charge=mode, grid__points=[34]))
    assert "34 points" in refusal(initial__charge=mode, grid__points=[33])


def test_component_outside_the_grid():
    told = refusal(initial__covariance=[{"mode": [1], "component": 1, "sine": 0.1}])
    assert told.startswith("initial.covariance[0].component is 1, but must be 0 or more and below")


def test_net_charge_needs_a_background():
    net = [{"mode": [0], "cosine": 1.0}]
    case = Case(**data(initial__charge=net, initial__neutralising_background=True))
    assert case.initial.charge[0].cosine == 1.0
    cancelling = [{"mode": [0], "cosine": value} for value in (0.1, 0.2, -0.3)]
    Case(**data(initial__charge=cancelling))


def test_negative_variance_names_its_place():
    modes = [{"mode": [0], "cosine": 0.1}, {"mode": [1], "cosine": 0.2}]
    told = refusal(initial__variance=modes)
    assert told == "initial.variance is -0.1 at x = (0.5), but must not be negative anywhere."
    touching = [{"mode": [0], "cosine": 0.1}, {"mode": [1], "cosine": 0.1}]
    Case(**data(initial__variance=touching))


def test_file_and_modes_exclude_each_other():
    assert refusal(initial__file="a.nc").startswith("initial.charge is given beside initial.file")


def test_file_name_with_a_nul():
    assert refusal(initial__charge=[], initial__file="a\0").startswith("initial.file is 'a\\x00', ")


# ------------------------------------------------------------------ hostile files


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("a = [", "the case is not valid TOML: Invalid value (at end of document)."),
        ("a = " + "9" * 5000, "the case is not valid TOML: a number has too many digits."),
        ("title = 'a\x00'", "the case contains the control character U+0000 on line 1."),
        ("\n\na = '\x1b[31m'", "the case contains the control character U+001B on line 3."),
        ("a = " + "[" * 200_000, "the case is nested too deeply."),
        ("a." * 200_000 + "a = 1", "the case is nested too deeply."),
        ("[" + '"a" . ' * 100_000 + "a]", "the case is nested too deeply."),
        ("a = { " + "b.'c'." * 100_000 + "a = 1 }", "the case is nested too deeply."),
        ("a" * 2_000_000, "the case has 2,000,000 bytes, but may have at most 1,048,576."),
    ],
)
def test_hostile_text(text, sentence):
    began = time.monotonic()
    with pytest.raises(InputError) as caught:
        Case.from_toml_text(text)
    assert str(caught.value) == sentence
    # a quadratic parser takes minutes here
    assert time.monotonic() - began < 5


@given(st.text(max_size=200) | st.binary(max_size=200).map(lambda b: b.decode("latin-1")))
def test_any_text_is_refused_in_one_printable_sentence(text):
    with pytest.raises(InputError) as caught:
        Case.from_toml_text(text)
    assert str(caught.value).isprintable()


@given(st.integers(0, len(TOML) - 1), st.characters())
def test_one_wrong_character_is_survived(position, character):
    text = TOML[:position] + character + TOML[position + 1 :]
    try:
        Case.from_toml_text(text)
    except InputError as error:
        assert str(error).isprintable()


def test_unreadable_files(tmp_path):
    def told(path):
        with pytest.raises(InputError) as caught:
            Case.from_toml(path)
        return str(caught.value)

    assert told(tmp_path / "none.toml").endswith("none.toml' does not exist.")
    assert told(tmp_path).endswith("is a folder, but must be a TOML file.")
    assert "can't be read" in told("a\0b")
    large = tmp_path / "large.toml"
    with large.open("wb") as file:
        file.truncate(10_000_000)  # sparse: refused from its size, without being read
    assert told(large).endswith("has 10,000,000 bytes, but may have at most 1,048,576.")
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"title = '\xff'")
    assert told(binary).endswith("is not UTF-8 text (byte 9).")
