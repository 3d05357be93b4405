"""The seven dimensionless numbers: what is accepted, and the sentence for what is not."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from triboflux.errors import InputError
from triboflux.numbers import Numbers

GOOD = {
    "peclet": 1e6,
    "tau_c": 0.1,
    "energy_ratio": 300.0,
    "length_ratio": 192.0,
    "restitution": 1.0,
}


def refusal(**changes: object) -> str:
    with pytest.raises(InputError) as caught:
        Numbers(**(GOOD | changes))
    return str(caught.value)


def test_drag_and_conduction_are_off_by_default():
    numbers = Numbers(**GOOD)
    assert numbers.tau_p == numbers.tau_sigma == math.inf


def test_numbers_are_immutable():
    with pytest.raises(ValueError, match="frozen"):
        Numbers(**GOOD).peclet = 3.0


@pytest.mark.parametrize("name", ["peclet", "tau_c", "tau_p", "tau_sigma", "length_ratio"])
@pytest.mark.parametrize("value", [0, -1.5, -math.inf, math.nan, "1", True, None, [1.0], 1e31])
def test_coefficients_must_be_positive_numbers(name, value):
    sentence = refusal(**{name: value})
    assert sentence.startswith(f"{name} is ")
    assert "must be a" in sentence
    assert sentence.count("\n") == 0


@pytest.mark.parametrize("name", ["energy_ratio", "length_ratio"])
def test_ratios_must_be_finite(name):
    assert refusal(**{name: math.inf}).startswith(f"{name} is inf, but must be")


def test_energy_ratio_may_be_zero_but_not_negative():
    assert Numbers(**GOOD | {"energy_ratio": 0}).energy_ratio == 0.0
    assert refusal(energy_ratio=-1.0).startswith(
        "energy_ratio is -1.0, but must be zero or positive"
    )


@pytest.mark.parametrize("value", [-0.01, 1.01, math.nan, math.inf])
def test_restitution_outside_zero_to_one(value):
    assert refusal(restitution=value).startswith(f"restitution is {value}, but must be a number")


@given(st.floats(0, 1))
def test_restitution_from_zero_to_one(value):
    assert Numbers(**GOOD | {"restitution": value}).restitution == value


class TestWithoutCollisions:
    """An infinite collision time leaves nothing for the collisional mechanisms to do."""

    def test_accepted_with_drag_alone(self):
        numbers = Numbers(**GOOD | {"tau_c": math.inf, "peclet": math.inf, "tau_p": 2.0})
        assert numbers.tau_c == math.inf

    @pytest.mark.parametrize(
        ("changes", "field"),
        [
            ({"tau_p": 1.0}, "peclet is 1000000.0"),
            ({"tau_p": 1.0, "peclet": math.inf, "tau_sigma": 3.0}, "tau_sigma is 3.0"),
            ({"peclet": math.inf}, "tau_p is inf"),
        ],
    )
    def test_refused_otherwise(self, changes, field):
        sentence = refusal(tau_c=math.inf, **changes)
        assert sentence.startswith(field)
        assert "tau_c = inf" in sentence


def test_misspelt_number_is_told_before_the_missing_one():
    data = dict(GOOD)
    data["tauc"] = data.pop("tau_c")
    with pytest.raises(InputError, match=r"^tauc is not a known key; .*Did you mean 'tau_c'\?$"):
        Numbers(**data)


def test_missing_number_says_what_it_is():
    data = dict(GOOD)
    del data["peclet"]
    with pytest.raises(InputError, match=r"^peclet is missing .*inf"):
        Numbers(**data)


def test_further_problems_are_counted():
    assert refusal(tau_c=-1, peclet=-1, restitution=2).endswith(" (and 2 more problems).")
    assert refusal(tau_c=-1, peclet=-1).endswith(" (and 1 more problem).")


def test_array_scalars_are_numbers():
    numpy = pytest.importorskip("numpy")
    numbers = Numbers(**GOOD | {"tau_c": numpy.float32(0.5), "peclet": numpy.array(10)})
    assert (numbers.tau_c, numbers.peclet) == (0.5, 10.0)
