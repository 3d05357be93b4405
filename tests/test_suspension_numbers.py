"""From a suspension in SI to the seven numbers and back, with the relations hidden between them."""

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from triboflux import drag, numbers, presets, radial_distribution
from triboflux.errors import InputError
from triboflux.numbers import Numbers
from triboflux.suspension import Suspension

EPS = 2.0**-52
CLOSURES = ("derived", "published")

# What `to_suspension` computes; everything else it takes over from the reference.
COMPUTED = (
    "restitution",
    "domain_length",
    "solid_fraction",
    "youngs_modulus",
    "charge_scale",
    "gas_viscosity",
)


@pytest.fixture(params=presets.NAMES)
def preset(request):
    return Suspension(preset=request.param)


def unlike(suspension):
    """Return a suspension that differs in everything that the numbers decide."""
    return Suspension(
        **suspension.model_dump()
        | {
            "restitution": 0.5 * suspension.restitution,
            "domain_length": 1.0,
            "solid_fraction": 0.01 * suspension.maximum_packing,
            "youngs_modulus": 1e9,
            "charge_scale": 1e-12,
            "gas_viscosity": 1e-5,
        }
    )


def relative(found, expected):
    """Return the relative difference, 0 between equal infinities and zeros."""
    return 0.0 if found == expected else abs(found / expected - 1.0)


# ------------------------------------------------------------------ definitions


@pytest.mark.parametrize(
    ("closures", "carried"),
    [("derived", 2**1.8 * math.sqrt(math.pi) * math.gamma(1.4) / 3), ("published", 1.825)],
)
def test_numbers_are_defined_as_in_the_paper(preset, closures, carried):
    s = preset
    theta, d, length, e0 = s.granular_temperature, s.diameter, s.domain_length, s.permittivity
    m = s.density * math.pi * d**3 / 6
    n = 6 * s.solid_fraction / (math.pi * d**3)
    g0 = s.contact_radial_distribution
    hertz = (30 * m * (1 - s.poisson_ratio**2) / (32 * s.youngs_modulus * math.sqrt(d))) ** (2 / 5)
    beta, gamma = e0 * math.pi * d / 2 * hertz, hertz / (2 * d)
    sigma = carried * d**3 * beta * g0 * n**2 * theta**0.9  # (2.25)
    dispersion = carried * d**4 * gamma * g0 * n * theta**0.9  # (2.26)
    tau_c = 1 / (4 * math.sqrt(math.pi) * n * g0 * d**2 * math.sqrt(theta))  # (3.5)
    field = n * s.charge_scale * length / e0
    expected = {
        "peclet": length * math.sqrt(theta) / dispersion,  # (5.13)
        "tau_sigma": e0 * math.sqrt(theta) / (sigma * length),  # (5.14)
        "tau_c": tau_c * math.sqrt(theta) / length,  # (5.15)
        "tau_p": s.drag_time * math.sqrt(theta) / length,  # (5.16)
        "energy_ratio": (e0 * field**2 / 2) / (n * m * theta / 2),  # (5.17)
        "length_ratio": length / d,  # (5.18)
        "restitution": s.restitution,  # (5.19)
    }
    found = numbers.from_suspension(s, closures).model_dump()
    assert found == pytest.approx(expected, rel=1e-13, abs=0.0)
    transport = numbers.transport_of(s, closures)
    assert transport.conductivity == pytest.approx(sigma, rel=1e-13, abs=0.0)
    assert transport.dispersion == pytest.approx(dispersion, rel=1e-13, abs=0.0)
    assert 1 / transport.collision_rate == pytest.approx(tau_c, rel=1e-13, abs=0.0)
    assert transport.transferred_fraction == pytest.approx(gamma * theta**0.4, rel=1e-13, abs=0.0)


@pytest.mark.parametrize("closures", CLOSURES)
def test_hidden_relations(preset, closures):
    s, n = preset, numbers.from_suspension(preset, closures)
    assert n.tau_sigma == pytest.approx(
        n.peclet / n.length_ratio**2 / (6 * s.solid_fraction), rel=1e-13
    )
    contacts = 24 * s.contact_radial_distribution * s.solid_fraction
    assert n.tau_c == pytest.approx(math.sqrt(math.pi) / (contacts * n.length_ratio), rel=1e-13)


def test_default_closures_are_derived(preset):
    assert numbers.from_suspension(preset) == numbers.from_suspension(preset, "derived")
    assert numbers.from_suspension(preset) != numbers.from_suspension(preset, "published")


@pytest.mark.parametrize(
    "function", [numbers.from_suspension, numbers.transport_of, lambda s, c: _back(s, closures=c)]
)
def test_unknown_closures(function):
    with pytest.raises(InputError, match=r"'publishd'.*Did you mean 'published'\?$"):
        function(presets.pmma(), "publishd")


def test_numbers_outside_their_range_are_refused():
    with pytest.raises(InputError, match=r"^energy_ratio is 2\.2\d+e\+49, but must be zero or"):
        numbers.from_suspension(
            presets.pmma(granular_temperature=1e-14, charge_scale=1e-3, domain_length=1e5)
        )


# ------------------------------------------------------------------ round trip


def _back(suspension, reference=None, closures="derived"):
    found = numbers.from_suspension(suspension, closures if closures in CLOSURES else "derived")
    return numbers.to_suspension(found, reference or suspension, closures)


@pytest.mark.parametrize("closures", CLOSURES)
@pytest.mark.parametrize("other", [False, True])
def test_round_trip_of_every_preset(preset, closures, other):
    back = _back(preset, unlike(preset) if other else preset, closures)
    for name, value in preset.model_dump().items():
        assert relative(getattr(back, name), value) < 1e-12, name
    again = numbers.from_suspension(back, closures).model_dump()
    expected = numbers.from_suspension(preset, closures).model_dump()
    assert again == pytest.approx(expected, rel=1e-12, abs=0)


def logarithmic(low, high):
    # a value at the very end may come back outside, by round-off
    return st.floats(math.log(low) + 1e-9, math.log(high) - 1e-9).map(math.exp)


@st.composite
def suspensions(draw):
    """Draw suspensions from the whole range of every field that has a say in the numbers."""
    packing = draw(st.floats(0.01, 0.7405) | st.none())
    law = draw(st.sampled_from(radial_distribution.NAMES))
    largest = packing or radial_distribution.LAWS[law].maximum_packing
    # evenly, towards an empty box, and towards packing
    filling = draw(
        st.floats(0.001, 0.999)
        | logarithmic(1e-15, 1.0)
        | logarithmic(1e-9, 1.0).map(lambda gap: 1.0 - 0.999 * gap)
    )
    return Suspension(
        diameter=draw(logarithmic(1e-9, 1.0)),
        density=draw(logarithmic(1.0, 3e4)),
        youngs_modulus=draw(logarithmic(1e3, 2e12)),
        poisson_ratio=draw(st.floats(-0.999, 0.5)),
        restitution=draw(st.floats(0.0, 1.0)),
        gas_density=draw(logarithmic(1e-6, 1e3)),
        gas_viscosity=draw(logarithmic(1e-7, 1e-2)),
        permittivity=draw(logarithmic(8.8e-12, 1e-7)),
        solid_fraction=largest * filling,
        granular_temperature=draw(logarithmic(1e-14, 1e6)),
        domain_length=draw(logarithmic(1e-6, 1e5)),
        charge_scale=draw(logarithmic(1e-24, 1e-3)),
        radial_distribution=law,
        drag=draw(st.sampled_from(drag.NAMES)),
        slip_velocity=draw(st.just(0.0) | logarithmic(1e-6, 1e3)),
        **({} if packing is None else {"maximum_packing": packing}),
    )


def steepness(s):
    """Return a bound of d log g0/d log(solid fraction), by which round-off of the latter grows.

    Lun & Savage's law has 2.5 a_m x/(1 - x) with x = a/a_m, Ma & Ahmadi's 3 from its series and
    0.68 * 3 x^3/(1 - x^3) <= 0.68/(1 - x), Carnahan & Starling's 3 a/(1 - a) <= 9.
    """
    return 10.0 + 2.0 / (1.0 - s.solid_fraction / s.maximum_packing)


def felt(s):
    """Return -d log(drag time)/d log(viscosity): 1 in creeping flow, 0 at high Reynolds numbers."""
    less, more = (
        s.model_copy(update={"gas_viscosity": s.gas_viscosity * f}) for f in (0.999, 1.001)
    )
    return math.log(less.drag_time / more.drag_time) / math.log(1.001 / 0.999)


@given(suspensions(), st.sampled_from(CLOSURES), st.booleans())
def test_round_trip_over_all_ranges(s, closures, other):
    try:
        found = numbers.from_suspension(s, closures)
    except InputError as error:
        assert error.field in Numbers.model_fields
        assume(False)
    reference = unlike(s) if other else s
    back = numbers.to_suspension(found, reference, closures)
    for name in set(Suspension.model_fields) - set(COMPUTED):
        assert getattr(back, name) == (
            "none" if name == "drag" and s.drag_time == math.inf else getattr(s, name)
        )
    for name in set(COMPUTED) - {"gas_viscosity"}:
        assert relative(getattr(back, name), getattr(s, name)) < 1e-12, name
    # where the gas' viscosity hardly matters, hardly anything can be said about it
    assert relative(back.drag_time, s.drag_time) < 1e-12
    if s.drag != "none" and felt(s) > 1e-9:
        assert relative(back.gas_viscosity, s.gas_viscosity) < 1e-12 / felt(s)

    # near packing, solid fractions that differ by round-off have different collision rates
    allowed = 1e-12 + 8 * EPS * steepness(s)
    again = numbers.from_suspension(back, closures).model_dump()
    for name, value in found.model_dump().items():
        assert relative(again[name], value) < allowed, name


@given(suspensions())
def test_relations_hold_over_all_ranges(s):
    try:
        n = numbers.from_suspension(s)
    except InputError:
        assume(False)
    related = n.peclet / n.length_ratio**2 / (6 * s.solid_fraction)
    assert relative(n.tau_sigma, related) < 1e-13
    contacts = 24 * s.contact_radial_distribution * s.solid_fraction
    assert relative(n.tau_c, math.sqrt(math.pi) / (contacts * n.length_ratio)) < 1e-13


def test_drag_that_does_not_feel_the_viscosity():
    # Reynolds numbers of 3300 and more
    fast = presets.glass_beads(diameter=5e-3, slip_velocity=10.0, solid_fraction=0.1)
    assert fast.drag_state.reynolds_number > 3000
    assert _back(fast).gas_viscosity == fast.gas_viscosity
    slow = fast.model_copy(update={"gas_viscosity": 1e-2})
    found = _back(fast, slow)
    assert found.drag_time == pytest.approx(fast.drag_time, rel=1e-12)


@pytest.mark.parametrize("law", ["schiller-naumann", "wen-yu"])
@pytest.mark.parametrize("reynolds", [990.0, 995.0, 999.9, 1000.1])
def test_viscosity_where_the_drag_coefficient_jumps(law, reynolds):
    s = presets.glass_beads(drag=law, solid_fraction=0.1, slip_velocity=1.0)
    reynolds /= 0.9 if law == "wen-yu" else 1.0
    viscosity = s.drag_state.reynolds_number * s.gas_viscosity / reynolds
    s = s.model_copy(update={"gas_viscosity": viscosity})
    found = _back(s, s.model_copy(update={"gas_viscosity": 1e-5}))
    assert found.drag_time == pytest.approx(s.drag_time, rel=1e-12)


# ------------------------------------------------------------------ numbers that are no suspension

CASE_A = {
    "peclet": 1e6,
    "tau_c": 1e-4,
    "energy_ratio": 300.0,
    "length_ratio": 192.0,
    "restitution": 1.0,
}


def refusal(reference=None, **changes):
    """Return the sentence that refuses case A with changes."""
    with pytest.raises(InputError) as caught:
        numbers.to_suspension(Numbers(**CASE_A | changes), reference or presets.glass_beads())
    assert str(caught.value).isprintable()
    return str(caught.value)


def test_the_papers_case_a_is_no_suspension():
    sentence = refusal()
    start = (
        "tau_sigma is inf, but in a suspension it follows from peclet, length_ratio and the solid "
        "fraction 0.533268 that tau_c implies: "
    )
    assert sentence.startswith(start)
    assert float(sentence.removeprefix(start).removesuffix(".")) == pytest.approx(8.48, abs=0.01)


def test_the_papers_case_a_with_the_conduction_that_belongs_to_it():
    sentence = refusal()
    belongs = float(sentence.rpartition(": ")[2].removesuffix("."))
    reference = presets.glass_beads()
    typed = Numbers(**CASE_A, tau_sigma=float(f"{belongs:.8g}"))
    found = numbers.to_suspension(typed, reference)
    # alpha g0 = sqrt(pi) (d/L)/(24 tau_c)
    assert found.solid_fraction * found.contact_radial_distribution == pytest.approx(
        3.846, abs=1e-3
    )
    assert found.drag == "none"
    assert (found.diameter, found.domain_length) == pytest.approx((5e-4, 192 * 5e-4))
    again = numbers.from_suspension(found).model_dump()
    assert again == pytest.approx(typed.model_dump(), rel=1e-7)
    assert {k: v for k, v in again.items() if k != "tau_sigma"} == pytest.approx(
        {k: v for k, v in typed.model_dump().items() if k != "tau_sigma"}, rel=1e-12
    )


def test_case_b_would_hardly_conduct():
    # model.md: alpha g0 = 0.00385, tau_sigma about 1.2e3
    sentence = refusal(tau_c=0.1)
    assert float(sentence.rpartition(": ")[2].removesuffix(".")) == pytest.approx(1.2e3, rel=0.03)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"tau_sigma": 9.0}, "tau_sigma is 9.0, but in a suspension it follows from peclet, "),
        (
            {"tau_c": 1e-6},
            "tau_c is 1e-06, but no solid fraction below 0.64 gives it at length_ratio = 192.0.",
        ),
        (
            {"tau_c": math.inf, "peclet": math.inf, "tau_p": 1.0},
            "tau_c is inf, but particles of a suspension collide.",
        ),
        ({"peclet": math.inf}, "peclet is inf, but particles of a suspension collide."),
    ],
)
def test_refused_numbers(changes, sentence):
    assert refusal(**changes).startswith(sentence)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (
            {"energy_ratio": 0.0},
            "energy_ratio is 0.0, from which follows that charge_scale is 0.0, but must be from ",
        ),
        (
            {"length_ratio": 1e-9},
            "length_ratio is 1e-09, from which follows that domain_length is 5.0",
        ),
        ({"peclet": 1.0}, "peclet is 1.0, from which follows that youngs_modulus is "),
        ({"tau_p": 1e-9}, "tau_p is 1e-09, from which follows that gas_viscosity is "),
        ({"tau_p": 1e12}, "tau_p means a drag time of 3.16228e+12 s, which the law 'gidaspow' "),
    ],
)
def test_numbers_of_no_possible_particle_name_what_follows_from_them(changes, sentence):
    reference = presets.glass_beads()
    n = numbers.from_suspension(reference).model_dump() | changes
    n["tau_c"] *= reference.domain_length / reference.diameter / n["length_ratio"]
    n["tau_sigma"] = n["peclet"] / (6 * reference.solid_fraction * n["length_ratio"] ** 2)
    assert refusal(**n).startswith(sentence)


def test_drag_cannot_come_from_a_reference_without_it():
    n = numbers.from_suspension(presets.glass_beads()).model_dump()
    sentence = refusal(presets.glass_beads(drag="none"), **n)
    assert sentence == "tau_p is finite, but the reference suspension has drag = 'none'."


def test_drag_time_that_no_viscosity_gives():
    s = presets.glass_beads(drag="schiller-naumann", slip_velocity=10.0)
    # slower than the drag coefficient of 0.44 at high Reynolds numbers allows
    n = numbers.from_suspension(s)
    slowest = s.model_copy(update={"gas_viscosity": 1e-9}).drag_time
    tau_p = 1.01 * n.tau_p * slowest / s.drag_time
    sentence = refusal(s, **n.model_dump() | {"tau_p": tau_p})
    assert sentence.startswith("tau_p means a drag time of ")
    assert sentence.endswith(" s, which the law 'schiller-naumann' gives at no gas viscosity.")
