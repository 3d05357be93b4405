"""Presets: complete, cited, physical, changeable."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from triboflux.errors import InputError
from triboflux.presets import DEFAULT, FUNCTIONS, ILLUSTRATIVE, NAMES, SOURCES
from triboflux.suspension import Suspension

BREAKDOWN_OF_AIR = 3e6


def test_names_for_files_and_functions_for_python():
    assert tuple(FUNCTIONS) == NAMES == tuple(SOURCES)
    for name, function in FUNCTIONS.items():
        assert function.__name__ == name.replace("-", "_")


@pytest.mark.parametrize("name", NAMES)
def test_every_field_has_a_source(name):
    assert tuple(SOURCES[name]) == tuple(Suspension.model_fields)
    preset = FUNCTIONS[name]()
    for field, source in SOURCES[name].items():
        info = Suspension.model_fields[field]
        assert source
        if source == DEFAULT:
            assert not info.is_required()
    # a powder without any published value is none
    assert sum(source not in (DEFAULT, ILLUSTRATIVE) for source in SOURCES[name].values()) >= 3
    assert preset == Suspension(preset=name) == Suspension.from_toml_text(toml(name))


@pytest.mark.parametrize("name", NAMES)
def test_docstrings_cite_and_say_what_is_illustrative(name):
    text = " ".join(FUNCTIONS[name].__doc__.split())
    assert any(word in text for word in ("doi:", "repository ", "arXiv:"))
    # the bed is cited but for its radial distribution, of which the text tells
    assert ("illustrative" in text) == (name != "polyethylene")
    assert f'SOURCES["{name}"]' in text


def toml(name, more=""):
    return f'[suspension]\npreset = "{name}"\n{more}'


def test_cited_values_of_the_bed():
    bed = FUNCTIONS["polyethylene"]()
    assert (bed.diameter, bed.density, bed.youngs_modulus) == (362.5e-6, 935.0, 2e6)
    assert (bed.poisson_ratio, bed.restitution, bed.maximum_packing) == (0.5, 0.8, 0.63)
    assert bed.charge_scale == pytest.approx(1.4e-4 * bed.volume)
    assert bed.drag == "gidaspow"


def test_poisson_ratio_of_glass_follows_from_its_moduli():
    glass = FUNCTIONS["glass-beads"]()
    assert glass.poisson_ratio == pytest.approx(
        glass.youngs_modulus / (2.0 * 29.8e9) - 1.0, abs=5e-3
    )


@pytest.mark.parametrize("name", NAMES)
def test_state_is_physical(name):
    powder = FUNCTIONS[name]()
    charge_density = powder.number_density * powder.charge_scale
    field = charge_density * powder.domain_length / powder.permittivity
    assert field < BREAKDOWN_OF_AIR
    # collisions pass over a small part of the charge
    assert powder.charge_transfer * powder.velocity_scale**0.8 < 0.01
    assert powder.drag_time < 1.0
    assert powder.domain_length > 10.0 * powder.diameter


class TestSoftenedModulus:
    """The mark belongs to the modulus."""

    def test_only_the_bed_has_one(self):
        softened = [name for name in NAMES if FUNCTIONS[name]().softened_modulus]
        assert softened == ["polyethylene"]

    def test_another_modulus_is_not_softened(self):
        changed = FUNCTIONS["polyethylene"](youngs_modulus="1 GPa")
        assert (changed.youngs_modulus, changed.softened_modulus) == (1e9, False)

    def test_unless_it_says_so(self):
        changed = FUNCTIONS["polyethylene"](youngs_modulus="1 MPa", softened_modulus=True)
        assert changed.softened_modulus is True


@given(st.sampled_from(NAMES), st.floats(1e-6, 1e-3))
def test_charge_per_surface_or_volume_is_kept_when_the_diameter_changes(name, diameter):
    preset = FUNCTIONS[name]()
    changed = FUNCTIONS[name](diameter=diameter)
    power = 3.0 if name == "polyethylene" else 2.0
    ratio = (diameter / preset.diameter) ** power
    assert changed.charge_scale == pytest.approx(preset.charge_scale * ratio, rel=1e-12)


@given(st.sampled_from(NAMES), st.floats(0.01, 0.6), st.floats(1e-6, 1.0))
def test_changes_replace_fields_and_leave_the_others(name, fraction, temperature):
    changed = FUNCTIONS[name](solid_fraction=fraction, granular_temperature=temperature)
    expected = FUNCTIONS[name]().model_dump()
    expected |= {"solid_fraction": fraction, "granular_temperature": temperature}
    assert changed.model_dump() == expected


def test_changes_in_a_file():
    text = toml("glass-beads", 'diameter = "0.3 mm"\nsolid_fraction = 0.55')
    glass = Suspension.from_toml_text(text)
    assert glass == FUNCTIONS["glass-beads"](diameter=3e-4, solid_fraction=0.55)


@pytest.mark.parametrize("name", ["polyethilene", "", "x" * 1000, 3, None, ["pmma"]])
def test_unknown_presets(name):
    with pytest.raises(InputError, match=r"^preset is .*, but must be one of polyethylene, "):
        Suspension(preset=name)


def test_unknown_preset_proposes_the_nearest():
    with pytest.raises(InputError, match=r"Did you mean 'pharmaceutical-fine'\?$"):
        Suspension(preset="pharmaceutical_fine")


def test_misspelt_change():
    with pytest.raises(InputError, match=r"^diametr is not a known key.* 'diameter'\?$"):
        FUNCTIONS["pmma"](diametr=1e-4)


def test_relative_permittivity_is_no_permittivity():
    with pytest.raises(InputError, match=r"^permittivity is 2.25, but must be from 8.8e-12 to "):
        FUNCTIONS["polyethylene"](permittivity=2.25)
    assert math.isfinite(FUNCTIONS["polyethylene"](permittivity="20 pF/m").field_transfer)
