"""A powder in engineering units, and cases that start from it."""

import math

import pytest

from tests.cases import data
from triboflux import numbers
from triboflux.case import Case
from triboflux.errors import InputError
from triboflux.suspension import Suspension

POWDER = {
    "diameter": "500 um",
    "density": "2.5 g/cm^3",
    "youngs_modulus": "70 GPa",
    "poisson_ratio": 0.22,
    "restitution": 0.97,
    "solid_fraction": 0.1,
    "granular_temperature": "4e-4 m^2/s^2",
    "domain_length": "20 cm",
    "charge_scale": "2 pC",
}
# Hence a velocity of 2 cm/s and a time scale of 10 s.
VELOCITY, LENGTH, TIME, CHARGE = 0.02, 0.2, 10.0, 2e-12
MASS = 2500 * math.pi / 6 * 5e-4**3
SURFACE = math.pi * 5e-4**2

TOML = """
title = "Powder"
closures = "published"

[suspension]
diameter = "500 um"
density = "2.5 g/cm^3"
youngs_modulus = "70 GPa"
poisson_ratio = 0.22
restitution = 0.97
solid_fraction = 0.1
granular_temperature = "4e-4 m^2/s^2"
domain_length = "20 cm"
charge_scale = "2 pC"

[grid]
points = [16]
lengths = ["10 cm"]

[initial]
charge = [{ mode = [1], sine = "-1 pC" }]

[run]
t_end = "3 s"
"""


def from_powder(closures="derived"):
    return numbers.from_suspension(Suspension(**POWDER), closures)


def case(**changes):
    fields = data(**{"suspension": dict(POWDER)} | changes)
    if "numbers" not in changes:
        del fields["numbers"]
    return Case(**fields)


def refusal(**changes):
    """Return the sentence with which a changed case is refused."""
    with pytest.raises(InputError) as caught:
        case(**changes)
    sentence = str(caught.value)
    assert sentence.isprintable()
    assert len(sentence) < 400
    return sentence


def told_by(text):
    with pytest.raises(InputError) as caught:
        Case.from_toml_text(text)
    assert str(caught.value).isprintable()
    return str(caught.value)
