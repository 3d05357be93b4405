"""What a sweep is made of, and what is refused."""

import math

import numpy as np
import pytest

import triboflux as tbf
from tests.cases import data
from tests.sweeps import tables
from triboflux.errors import InputError
from triboflux.sweep import Sweep
from triboflux.sweep_layout import coordinate_names
from triboflux.sweep_values import ValueRange

TOML = """
title = "a map"
closures = "derived"
[numbers]
energy_ratio = 300.0
length_ratio = 192.0
restitution = 1.0
[grid]
points = [16]
[initial]
charge = [{ mode = [1], sine = -1.0 }]
[run]
t_end = 1.0
[sweep.parameters]
numbers.peclet = { first = 1e2, last = 1e8, count = 7, spacing = "logarithmic" }
"numbers.tau_c" = [1e-4, 1e-3]
model = ["full", "semi-algebraic"]
"""


def refusal(**changes):
    with pytest.raises(InputError) as refused:
        Sweep(**tables(**changes))
    return str(refused.value)


# ------------------------------------------------------------------ members


def test_grid_from_toml(tmp_path):
    (tmp_path / "sweep.toml").write_text(TOML)
    sweep = tbf.Sweep.from_toml(tmp_path / "sweep.toml")
    assert sweep.shape == (7, 2, 2)
    assert sweep.size == 28
    assert sweep.parameters["numbers.peclet"] == [1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8]
    assert sweep.values(0) == {"numbers.peclet": 1e2, "numbers.tau_c": 1e-4, "model": "full"}
    # the last parameter varies fastest
    index = np.ravel_multi_index((3, 1, 1), sweep.shape)
    case = tbf.Case(**sweep.table(int(index)))
    assert (case.numbers.peclet, case.numbers.tau_c, case.model) == (1e5, 1e-3, "semi-algebraic")
    assert case.title == "a map"


def test_toml_round_trip():
    sweep = Sweep.from_toml_text(TOML)
    assert Sweep.from_toml_text(sweep.to_toml()) == sweep


def test_list_takes_values_together():
    sweep = Sweep(
        **tables(
            mode="list",
            parameters={"numbers.peclet": [1e4, 1e6], "numbers": {"tau_c": np.array([1e-4, 1e-2])}},
        )
    )
    assert sweep.shape == (2,)
    assert sweep.values(1) == {"numbers.peclet": 1e6, "numbers.tau_c": 1e-2}


def test_case_in_place_of_tables():
    case = tbf.Case(**data())
    sweep = Sweep(case=case, parameters={"run.rtol": [1e-6, 1e-7]})
    assert tbf.Case(**sweep.table(0)) == case
    assert tbf.Case(**sweep.table(1)).run.rtol == 1e-7


def test_key_reaches_into_a_list():
    sweep = Sweep(
        **tables(parameters={"initial.charge[0].sine": [-1.0, 2.0], "numbers": [NUMBERS]})
    )
    assert tbf.Case(**sweep.table(1)).initial.charge[0].sine == 2.0
    assert sweep.case["initial"]["charge"][0]["sine"] == -1.0


NUMBERS = data()["numbers"]


@pytest.mark.parametrize(
    ("spacing", "expected"),
    [("linear", [0.1, 0.2, 0.3, 0.4]), ("logarithmic", [0.1, 0.158740105197, 0.251984209979, 0.4])],
)
def test_range(spacing, expected):
    assert ValueRange(first=0.1, last=0.4, count=4, spacing=spacing).values() == expected


def test_short_names_of_coordinates_unless_taken():
    keys = ("numbers.peclet", "initial.charge", "grid.points", "suspension.gas.points", "model")
    names = coordinate_names(keys)
    assert list(names.values()) == ["peclet", *keys[1:4], "model"]


# ------------------------------------------------------------------ refused


@pytest.mark.parametrize(
    ("parameters", "sentence"),
    [
        ({"numbers.peclt": [1.0]}, "numbers.peclt is not a known key; known are "),
        ({"modle": ["full"]}, "modle is not a known key"),
        ({"model": ["full", "semialgebraic"]}, "model is 'semialgebraic', but must be "),
        ({"numbers.peclet": [1e6, -1.0]}, "numbers.peclet is -1.0, but must be a positive"),
        ({"numbers.peclet": []}, "parameters.'numbers.peclet' is [], but must be a list of"),
        ({"numbers.peclet": 1e6}, "parameters.'numbers.peclet' is 1000000.0, but must be a list"),
        ({"numbers.peclet": [1.0, 1.0]}, "parameters.'numbers.peclet' has a value twice."),
        (
            {"numbers.peclet": {"first": 1.0, "last": 2.0, "cout": 3}},
            "parameters.'numbers.peclet'.cout is not a known key; known are first, last, count, ",
        ),
        (
            {"numbers.peclet": {"first": 0.0, "last": 2.0, "count": 3, "spacing": "logarithmic"}},
            "parameters.'numbers.peclet'.first is 0.0, but must be positive with logarithmic",
        ),
        (
            {"numbers.peclet": {"first": 1.0, "last": 2.0, "count": 1}},
            "parameters.'numbers.peclet'.count is 1, but must be at least 2",
        ),
        ({"numbers.peclet": [1e6], "numbers": {"peclet": [1e5]}}, "is given twice."),
        ({"title.text": ["a"]}, "parameters.'title.text' is no dotted key of a case."),
        ({"initial.charge[1].sine": [1.0]}, "is an entry the case has not."),
        ({"numbers..peclet": [1.0]}, "parameters.'numbers..peclet' is no dotted key of a case."),
        (
            {
                "numbers.peclet": {"first": 1.0, "last": 2.0, "count": 1000},
                "run.rtol": {"first": 1e-8, "last": 1e-6, "count": 1000},
            },
            "parameters has 1,000,000 members, but must have at most 100,000.",
        ),
        ({}, "parameters has 0 keys, but must have 1 to 16."),
    ],
)
def test_refused_parameters(parameters, sentence):
    given = tables()
    given["case"]["title"] = "a"
    given["case"]["numbers"] |= {"peclet": 1e6, "tau_c": 1e-3}
    with pytest.raises(InputError) as refused:
        Sweep(**given | {"parameters": parameters})
    assert sentence in str(refused.value)
    assert "\n" not in str(refused.value)


def test_nearest_name_is_proposed():
    assert refusal(parameters={"numbers.peclt": [1.0]}).endswith("Did you mean 'peclet'?")
    assert refusal(mode="gird").endswith("Did you mean 'grid'?")


def test_lists_of_unequal_length():
    sentence = refusal(
        mode="list", parameters={"numbers.peclet": [1e5], "numbers.tau_c": [1e-3, 1e-2]}
    )
    assert "unequal length ('numbers.peclet' 1, 'numbers.tau_c' 2)" in sentence


def test_last_value_of_every_parameter_is_checked():
    assert refusal(parameters={"numbers.peclet": [1e5], "numbers.tau_c": [1e-3, math.nan]})


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("t = 1", "sweep is missing (a table with parameters"),
        ("sweep = 1", "sweep is 1, but must be a table."),
        ("[sweep]\nmodel = ['full']", "model is not a known key; known are case, parameters, mode"),
        ("[sweep.case]\n[sweep.parameters]\nmodel = ['full']", "sweep.case is not a known key"),
        ("[sweep.parameters]\nmodel = ['full']", "numbers is missing"),
    ],
)
def test_refused_files(tmp_path, text, sentence):
    (tmp_path / "sweep.toml").write_text(text)
    with pytest.raises(InputError) as refused:
        Sweep.from_toml(tmp_path / "sweep.toml")
    assert str(refused.value).startswith(sentence)


def test_combinations_are_not_refused_beforehand():
    # 16 waves fit into 64 points, not into 16
    modes = [[{"mode": [1], "sine": 1.0}], [{"mode": [16], "sine": 1.0}]]
    sweep = Sweep(
        **tables(
            parameters={"grid.points": [[64], [16]], "initial.charge": modes, "numbers": [NUMBERS]}
        )
    )
    with pytest.raises(InputError):
        tbf.Case(**sweep.table(3))
