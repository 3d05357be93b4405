"""Whole case files, from the text to the result or to the sentence that refuses it."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.whole_cases import ONE, texts, wrong_texts
from tests.whole_runs import COMMANDS, check_run, check_wrong
from triboflux import segments


@pytest.fixture(scope="module", autouse=True)
def short_segments():
    """Make segments of two steps, so that runs can be interrupted."""
    with pytest.MonkeyPatch.context() as changed:
        changed.setattr(segments, "STEPS_SMALL", 2)
        yield


@given(text=texts(ONE), count=st.integers(1, 4))
@settings(max_examples=20)
def test_an_allowed_case_runs_and_keeps_what_it_must(text, count):
    check_run(text, count)


@given(text=texts([((8,), "kinetic")]), count=st.integers(1, 4))
@settings(max_examples=5)
def test_an_allowed_simulation_keeps_what_it_must(text, count):
    check_run(text, count)


@given(wrong=wrong_texts(), command=st.sampled_from(sorted(COMMANDS)))
@settings(max_examples=100)
def test_a_wrong_case_is_one_sentence(wrong, command):
    check_wrong(*wrong, command)


def test_a_moment_that_stays_zero_needs_no_absolute_tolerance():
    text = """
    [numbers]
    peclet = 1e6
    tau_c = 0.1
    tau_p = 1.0
    tau_sigma = 1.0
    energy_ratio = 1.0
    length_ratio = 192.0
    restitution = 1.0
    [grid]
    points = [6, 5]
    [initial]
    variance = [{ mode = [0, 0], cosine = 0.5 }]
    [run]
    t_end = 0.1
    outputs = 3
    atol = 0
    """
    assert check_run(text) == "ok"
