"""The scales by which results in SI differ from the scaled ones."""

import functools

import pytest

from triboflux import presets
from triboflux.numbers import from_suspension
from triboflux.scales import Scales

# charges and fields are far below and above the absolute tolerance that is the default
close = functools.partial(pytest.approx, rel=1e-13, abs=0.0)


@pytest.fixture(params=presets.NAMES)
def suspension(request):
    return presets.FUNCTIONS[request.param]()


def test_scales_are_what_the_equations_are_divided_by(suspension):
    s, scale = suspension, Scales.of(suspension)
    assert (scale.length, scale.charge) == (s.domain_length, s.charge_scale)
    assert scale.velocity**2 == close(s.granular_temperature)
    # a particle crosses the domain in one unit of time
    assert scale.time * scale.velocity == close(scale.length)
    assert scale.charge_rate * scale.time == close(scale.charge)
    # the covariance is <xi' c'>, the variance <xi' xi'>; (5.9) prints Q0 Theta for the first
    assert scale.covariance / scale.velocity == close(scale.charge)
    assert scale.variance / scale.charge == close(scale.charge)
    # Gauss' law, epsilon div E = n Q, and E = -grad phi
    density = s.number_density * scale.charge
    assert s.permittivity * scale.field / scale.length == close(density)
    assert scale.potential / scale.length == close(scale.field)


def test_energy_ratio_is_electric_over_kinetic_energy(suspension):
    scale, numbers = Scales.of(suspension), from_suspension(suspension)
    electric = scale.charge * scale.potential
    kinetic = suspension.mass * scale.velocity**2
    assert numbers.energy_ratio == close(electric / kinetic)
