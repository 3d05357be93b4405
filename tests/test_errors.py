"""The sentences: one line, printable, short, whatever was given."""

import copy
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from triboflux.errors import InputError, OutOfRangeError, dotted, nearest, shown


def test_nearest_proposes_similar_names_only():
    assert nearest("ful", ("full", "gradient")) == " Did you mean 'full'?"
    assert nearest("FULL", ("full", "gradient")) == " Did you mean 'full'?"
    assert nearest("zzz", ("full", "gradient")) == ""
    assert nearest("full" * 10_000, ("full",)) == ""


@given(st.recursive(st.text() | st.integers() | st.floats(), st.lists))
def test_shown_values_fit_on_a_line(value):
    text = shown(value)
    assert len(text) <= 60
    assert text.isprintable()


def test_shown_survives_extremes():
    nested: list = []
    for _ in range(10 * sys.getrecursionlimit()):
        nested = [nested]
    assert len(shown(nested)) <= 60
    assert shown(1 << 100_000) == "an integer of 100001 bits"
    assert shown("a\x00\u202eb") == r"'a\x00\u202eb'"


def test_dotted_names():
    assert dotted(("initial", "charge", 0, "mode")) == "initial.charge[0].mode"
    assert dotted(("initial",), "charge[0]") == "initial.charge[0]"
    assert dotted(("points",), "[1]") == "points[1]"
    assert dotted(("a\nb",)) == r"'a\nb'"


def test_a_problem_after_a_colon():
    error = InputError.about("", ": '3 kg' is a mass", hint=" Sure?")
    assert str(error) == "'3 kg' is a mass. Sure?"
    again = InputError.about(dotted(("a", "b")), error.problem, others=2)
    assert str(again) == "a.b: '3 kg' is a mass (and 2 more problems)."


def test_errors_keep_their_class_and_survive_copying():
    error = OutOfRangeError.about("numbers", "is odd", others=1)
    assert isinstance(error, OutOfRangeError)
    twin = copy.deepcopy(error)
    assert (str(twin), twin.field) == ("numbers is odd (and 1 more problem).", "numbers")


def test_input_errors_are_value_errors():
    with pytest.raises(ValueError, match=r"^all is lost$"):
        raise InputError("all is lost")
