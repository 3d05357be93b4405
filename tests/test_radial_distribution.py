"""Contact values g0: exact relations, virial coefficients, molecular dynamics, packing."""

import math

import numpy as np
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from triboflux.errors import InputError
from triboflux.radial_distribution import (
    LAWS,
    NAMES,
    carnahan_starling,
    check_fraction,
    ma_ahmadi,
    radial_distribution,
)

ALPHA = sp.Symbol("alpha", positive=True)

# Hard spheres: Z = 1 + 4 alpha g0, with the virial coefficients B2 to B5 in units of the volume
# of a sphere (Clisby & McCoy, J. Stat. Phys. 122 (2006) 15).
VIRIAL = (4.0, 10.0, 18.3648, 28.2245)

# Molecular dynamics of hard spheres: volume over that of closest packing, and Z; Erpenbeck &
# Wood, J. Stat. Phys. 35 (1984) 321.
DYNAMICS = ((3.0, 3.0311), (2.0, 5.8502), (1.6, 10.194))


def series(name):
    law = LAWS[name]
    g0 = law.function(ALPHA, law.maximum_packing)
    expanded = sp.series(g0, ALPHA, 0, 4).removeO()
    return [float(expanded.coeff(ALPHA, k)) for k in range(4)]


def test_laws_are_the_four_of_the_documentation():
    assert NAMES == ("carnahan-starling", "lun-savage", "ma-ahmadi", "unity")
    for name, law in LAWS.items():
        assert law.name == name
        assert law.source and law.validity


@pytest.mark.parametrize("name", ["carnahan-starling", "ma-ahmadi"])
def test_dilute_expansion_has_the_virial_coefficients(name):
    """The first is exact; the second and third of Carnahan & Starling are rounded to integers."""
    expected = [b / 4.0 for b in VIRIAL]
    found = series(name)
    assert found[:2] == pytest.approx(expected[:2], rel=1e-12)
    assert found[2:] == pytest.approx(expected[2:], rel=0.03 if name != "ma-ahmadi" else 1e-3)


def test_lun_savage_has_the_first_virial_coefficient_at_any_packing():
    packing = sp.Symbol("alpha_m", positive=True)
    g0 = LAWS["lun-savage"].function(ALPHA, packing)
    slope = sp.simplify(sp.diff(g0, ALPHA).subs(ALPHA, 0))
    assert float(slope) == 2.5


def test_carnahan_starling_gives_their_equation_of_state():
    alpha = ALPHA
    compressibility = (1 + alpha + alpha**2 - alpha**3) / (1 - alpha) ** 3
    g0 = sp.nsimplify(carnahan_starling(alpha))
    assert sp.simplify(1 + 4 * alpha * g0 - compressibility) == 0


@pytest.mark.parametrize(("volume", "compressibility"), DYNAMICS)
@pytest.mark.parametrize(("name", "error"), [("carnahan-starling", 5e-3), ("ma-ahmadi", 2e-2)])
def test_dense_fluid_agrees_with_molecular_dynamics(name, error, volume, compressibility):
    alpha = math.pi * math.sqrt(2.0) / 6.0 / volume
    assert 1.0 + 4.0 * alpha * radial_distribution(name, alpha) == pytest.approx(
        compressibility, rel=error
    )


@pytest.mark.parametrize("name", NAMES)
def test_laws_that_diverge_do_so_at_the_maximum_packing(name):
    law = LAWS[name]
    far = law.function(law.maximum_packing * (1.0 - 1e-9), law.maximum_packing)
    assert (far > 1e5) == law.diverges


@pytest.mark.parametrize("name", NAMES)
@given(st.floats(1e-9, 0.99), st.floats(1e-9, 0.99))
def test_laws_are_at_least_one_and_grow(name, first, second):
    packing = LAWS[name].maximum_packing
    low, high = (radial_distribution(name, packing * x) for x in sorted((first, second)))
    assert 1.0 <= low <= high * (1.0 + 1e-15)


@pytest.mark.parametrize("name", NAMES)
def test_laws_take_floats_arrays_and_symbols(name):
    law = LAWS[name]
    fractions = np.linspace(0.0, 0.6, 5)
    array = law.function(fractions, law.maximum_packing) * np.ones(5)
    g0 = law.function(ALPHA, law.maximum_packing)
    for fraction, value in zip(fractions, array, strict=True):
        assert value == pytest.approx(law.function(float(fraction), law.maximum_packing))
        assert value == pytest.approx(float(sp.sympify(g0).subs(ALPHA, fraction)))


def test_every_law_is_one_without_particles():
    for law in LAWS.values():
        assert law.function(0.0, law.maximum_packing) == 1.0


@pytest.mark.parametrize("fraction", [0.0, -0.1, 0.64356, 0.7, math.nan, math.inf])
def test_fractions_out_of_range(fraction):
    with pytest.raises(InputError, match=rf"^solid_fraction is {fraction}, but must be .*0\.64356"):
        radial_distribution("ma-ahmadi", fraction)


@pytest.mark.parametrize("packing", [0.0, 0.75, math.nan])
def test_packings_out_of_range(packing):
    with pytest.raises(InputError, match=rf"^maximum_packing is {packing}, but must be above 0"):
        check_fraction(0.1, packing)


def test_packing_can_be_given():
    assert radial_distribution("ma-ahmadi", 0.65, 0.7) == ma_ahmadi(0.65, 0.7)


def test_unknown_law_proposes_the_nearest():
    with pytest.raises(
        InputError, match=r"^radial_distribution is 'lun-savge', .* 'lun-savage'\?$"
    ):
        radial_distribution("lun-savge", 0.1)
