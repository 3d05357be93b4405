"""The binary collision: what it conserves, how charge is passed over, and the units of its laws."""

import math
from types import SimpleNamespace

import numpy as np
import pint
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from triboflux import collision
from triboflux.collision import collide

EPSILON_0 = 8.8541878128e-12
numbers = st.floats(-3.0, 3.0)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)


@st.composite
def collisions(draw):
    """Two approaching particles with charges in a field, and a collision rule."""
    c1, c2, direction = draw(vectors), draw(vectors), draw(vectors)
    assume(np.linalg.norm(direction) > 0.1)
    direction = direction / np.linalg.norm(direction)
    assume(abs((c1 - c2) @ direction) > 1e-3)
    if (c1 - c2) @ direction < 0.0:
        direction = -direction
    rule = {
        "restitution": draw(st.floats(0.0, 1.0)),
        "exponent": draw(st.floats(0.0, 2.0)),
        "charge_transfer": draw(st.floats(0.0, 0.5)),
        "field_transfer": draw(st.floats(0.0, 2.0)),
        "field": draw(vectors),
    }
    return SimpleNamespace(
        velocities=(c1, c2), charges=(draw(numbers), draw(numbers)), direction=direction, rule=rule
    )


def after(drawn):
    return collide(drawn.velocities, drawn.charges, drawn.direction, **drawn.rule)


@given(collisions())
def test_pair_keeps_its_momentum_and_charge(drawn):
    outcome = after(drawn)
    assert_allclose(outcome.velocity_1 + outcome.velocity_2, sum(drawn.velocities), atol=1e-14)
    assert outcome.charge_1 + outcome.charge_2 == pytest.approx(sum(drawn.charges), abs=1e-12)


@given(collisions())
def test_approach_is_reversed_and_slip_stays(drawn):
    outcome, k = after(drawn), drawn.direction
    before = drawn.velocities[0] - drawn.velocities[1]
    later = outcome.velocity_1 - outcome.velocity_2
    assert later @ k == pytest.approx(-drawn.rule["restitution"] * (before @ k), abs=1e-13)
    assert_allclose(later - (later @ k) * k, before - (before @ k) * k, atol=1e-13)


@given(collisions())
def test_energy_lost(drawn):
    outcome = after(drawn)
    approach = (drawn.velocities[0] - drawn.velocities[1]) @ drawn.direction
    before = 0.5 * sum(c @ c for c in drawn.velocities)
    later = 0.5 * (
        outcome.velocity_1 @ outcome.velocity_1 + outcome.velocity_2 @ outcome.velocity_2
    )
    lost = 0.25 * (1.0 - drawn.rule["restitution"] ** 2) * approach**2
    assert before - later == pytest.approx(lost, abs=1e-12)


@given(collisions())
def test_order_of_the_particles_does_not_matter(drawn):
    """So the field has to be that of a point with a place of its own: the contact point."""
    outcome = after(drawn)
    (c1, c2), (xi1, xi2) = drawn.velocities, drawn.charges
    swapped = collide((c2, c1), (xi2, xi1), -drawn.direction, **drawn.rule)
    assert_allclose(swapped.velocity_2, outcome.velocity_1, atol=1e-14)
    assert_allclose(swapped.velocity_1, outcome.velocity_2, atol=1e-14)
    assert swapped.charge_2 == pytest.approx(outcome.charge_1, abs=1e-13)
    assert swapped.charge_1 == pytest.approx(outcome.charge_2, abs=1e-13)


@given(collisions(), st.floats(0.0, 2.0 * math.pi))
def test_turning_everything_turns_the_outcome(drawn, angle):
    cosine, sine = math.cos(angle), math.sin(angle)
    turn = np.array([[cosine, -sine, 0.0], [0.0, 0.0, 1.0], [sine, cosine, 0.0]])
    rule = drawn.rule | {"field": turn @ drawn.rule["field"]}
    c1, c2 = drawn.velocities
    turned = collide((turn @ c1, turn @ c2), drawn.charges, turn @ drawn.direction, **rule)
    outcome = after(drawn)
    assert_allclose(turned.velocity_1, turn @ outcome.velocity_1, atol=1e-13)
    assert turned.charge_1 == pytest.approx(outcome.charge_1, abs=1e-12)


@given(
    collisions(),
    st.floats(1e-6, 1e-2),
    st.floats(100.0, 9000.0),
    st.floats(1e5, 1e12),
    st.floats(0.0, 0.5),
)
def test_charge_passed_over_is_what_the_field_at_the_contact_moves(
    drawn, diameter, density, youngs_modulus, poisson_ratio
):
    """(2.10)-(2.13): the contact area times the field of the mean charge and of both particles."""
    mass = density * math.pi / 6.0 * diameter**3
    k, field = drawn.direction, 1e5 * drawn.rule["field"]
    charges = tuple(1e-13 * charge for charge in drawn.charges)
    length = collision.contact_length(mass, diameter, youngs_modulus, poisson_ratio)
    outcome = collide(
        drawn.velocities,
        charges,
        k,
        restitution=1.0,
        charge_transfer=collision.charge_transfer(length, diameter),
        field_transfer=collision.field_transfer(length, diameter, EPSILON_0),
        field=field,
    )
    approach = (drawn.velocities[0] - drawn.velocities[1]) @ k
    compliance = 30.0 * mass * (1.0 - poisson_ratio**2) / (32.0 * youngs_modulus * diameter**0.5)
    area = math.pi * diameter / 2.0 * compliance ** (2 / 5) * approach ** (4 / 5)
    local = field - (charges[1] - charges[0]) / (math.pi * EPSILON_0 * diameter**2) * k
    moved = EPSILON_0 * area * (local @ k)
    size = EPSILON_0 * area * np.linalg.norm(field) + max(map(abs, charges))
    assert outcome.charge_1 == pytest.approx(charges[0] - moved, abs=1e-13 * size + 1e-30)
    assert outcome.charge_2 == pytest.approx(charges[1] + moved, abs=1e-13 * size + 1e-30)


@given(st.floats(1e-12, 1.0), st.floats(1e-6, 1e-1), st.floats(1e-13, 1e-9))
def test_ratio_of_both_transfers(length, diameter, permittivity):
    beta = collision.field_transfer(length, diameter, permittivity)
    gamma = collision.charge_transfer(length, diameter)
    assert beta / gamma == pytest.approx(math.pi * permittivity * diameter**2, rel=1e-13, abs=0.0)


def test_arrays_go_through_like_single_pairs():
    generator = np.random.default_rng(0)
    c1, c2, k, field = generator.normal(size=(4, 3, 5))
    k /= np.linalg.norm(k, axis=0)
    k *= np.sign(np.sum((c1 - c2) * k, axis=0))
    charges = generator.normal(size=(2, 5))
    rule = {"restitution": 0.8, "charge_transfer": 0.1, "field_transfer": 0.3}
    together = collide((c1, c2), tuple(charges), k, field=field, **rule)
    for i in range(5):
        alone = collide(
            (c1[:, i], c2[:, i]), tuple(charges[:, i]), k[:, i], field=field[:, i], **rule
        )
        assert_allclose(together.velocity_1[:, i], alone.velocity_1, rtol=1e-14)
        assert together.charge_1[i] == pytest.approx(alone.charge_1, rel=1e-14, abs=0.0)


REGISTRY = pint.UnitRegistry()


def powers(quantity):
    """Return the powers of the base dimensions, which fractional powers leave inexact."""
    dimension = quantity.dimensionality
    return {name: round(power, 9) for name, power in dimension.items() if abs(power) > 1e-9}


def test_units_of_the_transfers():
    quantity = REGISTRY.Quantity
    diameter, velocity = quantity(1e-4, "m"), quantity(0.3, "m/s")
    permittivity, field = quantity(EPSILON_0, "F/m"), quantity(1e5, "V/m")
    length = collision.contact_length(quantity(1e-9, "kg"), diameter, quantity(2e9, "Pa"), 0.3)
    beta = collision.field_transfer(length, diameter, permittivity)
    gamma = collision.charge_transfer(length, diameter)
    impact = velocity**collision.HERTZ_EXPONENT
    assert powers(length * impact) == {"[length]": 1}
    assert powers(beta * field * impact) == powers(quantity(1.0, "C"))
    assert powers(gamma * impact) == {}
    # (2.17) has the permittivity in the denominator
    assert powers(gamma * impact / permittivity) != {}


def test_every_sum_is_of_one_kind():
    """With quantities, pint refuses to add what differs; exponent 1 keeps the powers exact."""
    quantity = REGISTRY.Quantity
    outcome = collide(
        (quantity(np.array([0.1, 0.2, 0.3]), "m/s"), quantity(np.zeros(3), "m/s")),
        (quantity(1e-13, "C"), quantity(-2e-13, "C")),
        np.array([0.6, 0.0, 0.8]),
        restitution=0.9,
        exponent=1,
        charge_transfer=quantity(0.2, "s/m"),
        field_transfer=quantity(1e-18, "C * s / V"),
        field=quantity(np.array([1e4, 0.0, 0.0]), "V/m"),
    )
    assert outcome.velocity_1.check("[length] / [time]")
    total = (outcome.charge_1 + outcome.charge_2).to("C").magnitude
    assert total == pytest.approx(-1e-13, rel=1e-12, abs=0.0)


def test_contact_length_against_hertz():
    """Where kinetic energy has become elastic energy; (2.12) counts the compliance of one sphere.

    Hertz: energy (8/15) M sqrt(R) overlap**(5/2) with R = d/4 and 1/M = (1 - nu²)/Y per sphere;
    the kinetic energy of the approach is m g²/4.
    """
    mass, diameter, modulus, poisson, approach = 2e-9, 1.5e-4, 3e8, 0.35, 0.2
    energy = 0.25 * mass * approach**2
    overlaps = [
        (energy / (8 / 15 * modulus / (spheres * (1 - poisson**2)) * math.sqrt(diameter / 4)))
        ** (2 / 5)
        for spheres in (1, 2)
    ]
    ours = collision.contact_length(mass, diameter, modulus, poisson) * approach**0.8
    assert ours == pytest.approx(overlaps[0], rel=1e-12, abs=0.0)
    assert overlaps[1] / ours == pytest.approx(2 ** (2 / 5), rel=1e-12, abs=0.0)
