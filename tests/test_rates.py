"""The closed coefficients: their scaling, their definitions, and their limits."""

import functools
import math
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.sized import Sized
from triboflux import closures, drag, models, radial_distribution
from triboflux.dropped_rates import dropped_rates
from triboflux.numbers import from_suspension, transport_of
from triboflux.rates import closure_rates, suspension_transport
from triboflux.scales import Scales
from triboflux.suspension import VACUUM_PERMITTIVITY, Suspension

INF = math.inf
close = functools.partial(pytest.approx, rel=1e-12, abs=0.0)

# --- from SI to the scaled equations --------------------------------------------------------------

suspensions = st.builds(
    Suspension,
    diameter=st.floats(1e-5, 5e-3),
    density=st.floats(100.0, 1e4),
    youngs_modulus=st.floats(1e5, 1e12),
    poisson_ratio=st.floats(0.0, 0.5),
    restitution=st.just(0.0) | st.floats(1e-3, 1.0),
    permittivity=st.floats(8.9e-12, 1e-10),
    solid_fraction=st.floats(1e-5, 0.6),
    granular_temperature=st.floats(1e-7, 1e2),
    domain_length=st.floats(1e-3, 10.0),
    charge_scale=st.floats(1e-16, 1e-11),
    radial_distribution=st.sampled_from(radial_distribution.NAMES),
    drag=st.sampled_from(drag.NAMES),
    slip_velocity=st.floats(0.0, 10.0),
)


def scaled(suspension, closure_name, kind):
    """Return the coefficients in SI over their scales; `kind` makes every number of them."""
    s, scale = suspension, Scales.of(suspension)
    transport = transport_of(s, closure_name)
    rates = closure_rates(
        closures.values_for(closure_name, kind(s.restitution)),
        restitution=kind(s.restitution),
        diameter=kind(s.diameter),
        velocity=kind(s.velocity_scale),
        collision_time=kind(1.0 / transport.collision_rate),
        drag_rate=kind(1.0 / s.drag_time),
        dispersion=kind(transport.dispersion),
        conduction=kind(transport.conductivity / s.number_density),
    )
    k1, k2 = rates.third_moment, rates.third_moment_trace
    g1, g2 = rates.shear, rates.divergence
    trace = k1 + 3.0 * k2
    dispersion = scale.time / scale.length**2
    return {
        "flux": 1.0 + rates.collisional_flux,
        # by Gauss' law div E is n Q/epsilon
        "triboconductivity": kind(transport.conductivity / s.permittivity * scale.time),
        "dispersion": kind(transport.dispersion * dispersion),
        "gradient_production": rates.gradient_production
        * (scale.charge / scale.length * scale.time / scale.covariance),
        "field_production": rates.field_production * (scale.field * scale.time / scale.covariance),
        "electric_force": kind(
            scale.variance * scale.field / s.mass * scale.time / scale.covariance
        ),
        "covariance_destruction": rates.covariance_destruction * scale.time,
        "third_moment": k1 * scale.time,
        "third_moment_trace": trace * scale.time,
        "third_moment_coupling": k2 * scale.time,
        "shear": g1 * (1.0 / scale.velocity**2),
        "divergence": g2 * (1.0 / scale.velocity**2),
        "covariance_dispersion": g1 / k1 * dispersion,
        "divergence_dispersion": (g1 + g2 - k2 * (2.0 * g1 + 3.0 * g2) / trace) / k1 * dispersion,
        "variance_destruction": rates.variance_destruction * scale.time,
        "variance_field_production": rates.variance_field_production
        * (scale.field**2 * scale.time / scale.variance),
        "variance_collisional_dispersion": rates.variance_collisional_dispersion * dispersion,
        "variance_flux_destruction": rates.variance_flux_destruction * scale.time,
        "transferred_fraction": rates.transferred_fraction,
    }


@given(suspensions, st.sampled_from(closures.NAMES))
def test_scaled_coefficients_are_those_in_si_over_their_scales(suspension, closure_name):
    closure_set = closures.by_name(closure_name, suspension.restitution)
    numbers = from_suspension(suspension, closure_name)
    found = models.transport_coefficients(numbers, closure_set, 3)
    expected = scaled(suspension, closure_name, float)
    sized = scaled(suspension, closure_name, Sized)
    assert set(vars(found)) == {*expected, "dropped", "granular_temperature"}
    for name, value in expected.items():
        assert abs(getattr(found, name) - value) <= 1e-12 * sized[name].size, name
        assert abs(sized[name].value - value) <= 1e-12 * sized[name].size, name


@given(suspensions)
def test_scaled_coefficients_of_dropped_terms_are_those_in_si_over_their_scales(suspension):
    numbers = from_suspension(suspension, "complete")
    closure_set = closures.complete(suspension.restitution)
    found = models.transport_coefficients(numbers, closure_set, 3).dropped
    expected, sized = (scaled_dropped(suspension, kind) for kind in (float, Sized))
    assert set(found._fields) == set(expected)
    for name, value in expected.items():
        assert abs(getattr(found, name) - value) <= 1e-12 * sized[name].size, name


def scaled_dropped(suspension, kind):
    """Return the coefficients of the dropped terms in SI over their scales."""
    s, scale = suspension, Scales.of(suspension)
    transport = transport_of(s, "complete")
    values = closures.values_for("complete", kind(s.restitution))
    given_to_both = {
        "restitution": kind(s.restitution),
        "diameter": kind(s.diameter),
        "velocity": kind(s.velocity_scale),
        "dispersion": kind(transport.dispersion),
        "conduction": kind(transport.conductivity / s.number_density),
    }
    rates = closure_rates(
        values,
        collision_time=kind(1.0 / transport.collision_rate),
        drag_rate=kind(1.0 / s.drag_time),
        **given_to_both,
    )
    time, length, velocity = scale.time, scale.length, scale.velocity
    charge, field = scale.charge, scale.field
    in_charge, in_variance = time / charge, time / scale.variance
    in_third = time / (charge * velocity**2)
    scales = {
        "charge_third_moment": charge * velocity**2 / length**2 * in_charge,
        "covariance_third_moment": 1.0,
        "covariance_dispersion": time / length**2,
        "third_moment_gradient": charge / length**2 * in_third,
        "third_moment_field": field / length * in_third,
        "variance_flux": 1.0,
        "variance_flux_gradient": 1.0 / velocity**2,
        "covariance_along_gradient": scale.covariance * charge / length * in_variance,
        "covariance_along_field": scale.covariance * field * in_variance,
        "variance_gradient_production": charge**2 / length**2 * in_variance,
        "variance_mixed_production": field * charge / length * in_variance,
        "variance_covariance_destruction": scale.covariance**2 * in_variance,
    }
    found = dropped_rates(values, rates, **given_to_both)._asdict()
    return {name: value * scales[name] for name, value in found.items()}


# --- definitions ----------------------------------------------------------------------------------

states = st.fixed_dictionaries(
    {
        "diameter": st.floats(1e-6, 1e-2),
        "number_density": st.floats(1e3, 1e15),
        "granular_temperature": st.floats(1e-12, 1e4),
        "radial_distribution": st.floats(1.0, 1e3),
        "charge_transfer": st.floats(1e-8, 1.0),
    }
)


def both(closure_set, state, drag_rate=0.0):
    """Return the transport of a suspension and the rates that follow from it."""
    beta = math.pi * VACUUM_PERMITTIVITY * state["diameter"] ** 2 * state["charge_transfer"]
    transport = suspension_transport(
        closure_set, closure_set.exponent, field_transfer=beta, **state
    )
    rates = closure_rates(
        closure_set,
        restitution=closure_set.restitution,
        diameter=state["diameter"],
        velocity=math.sqrt(state["granular_temperature"]),
        collision_time=1.0 / transport.collision_rate,
        drag_rate=drag_rate,
        dispersion=transport.dispersion,
        conduction=transport.conductivity / state["number_density"],
    )
    return transport, rates


@given(state=states, exponent=st.floats(-0.4, 3.0))
def test_transport_and_exchange_by_their_definitions(state, exponent):
    """Equations (2.25) to (2.27), (3.5) and (3.6), with 9/10 = (1 + a)/2."""
    c = closures.derived(0.9, exponent)
    transport, rates = both(c, state)
    s = SimpleNamespace(**state)
    d, n, g0, gamma = s.diameter, s.number_density, s.radial_distribution, s.charge_transfer
    beta = math.pi * VACUUM_PERMITTIVITY * d**2 * gamma
    fraction = gamma * s.granular_temperature ** (exponent / 2)
    power = s.granular_temperature ** ((1 + exponent) / 2)
    tau_c = 1 / (4 * math.sqrt(math.pi) * n * g0 * d**2 * math.sqrt(s.granular_temperature))
    assert transport.conductivity == close(c["triboconductivity"] * d**3 * beta * g0 * n**2 * power)
    assert transport.dispersion == close(c["dispersion"] * d**4 * gamma * g0 * n * power)
    assert rates.collisional_flux == close(c["collisional_flux"] * d**3 * g0 * n * fraction)
    assert 1 / transport.collision_rate == close(tau_c)
    assert rates.charge_exchange == close(c["charge_exchange"] * n * g0 * d**2 * gamma * power)
    assert 1 / rates.charge_exchange == close(d**2 / (12 * transport.dispersion))
    assert transport.transferred_fraction == close(fraction)
    # κ τ_c D/d², which knows γ through D only
    assert rates.transferred_fraction == close(fraction)


@given(state=states)
def test_what_the_printed_numbers_make_of_the_definitions(state):
    c = closures.published(0.9)
    transport, rates = both(c, state)
    s = SimpleNamespace(**state)
    pairs = s.number_density * s.radial_distribution * s.diameter**2 * s.charge_transfer
    # λ' = 12 is inverted, hence the square of 12 between (5.20) and (3.6)
    exchange = c["charge_exchange"] * pairs * s.granular_temperature**0.9
    assert 144 * rates.charge_exchange == close(exchange)
    # λ'' and κ agree with the other numbers to the digits that are printed, or less
    eta = c["collisional_flux"] * pairs * s.diameter * s.granular_temperature**0.4
    assert rates.collisional_flux == pytest.approx(eta, rel=1.2e-3, abs=0.0)
    fraction = transport.transferred_fraction
    assert rates.transferred_fraction == pytest.approx(fraction, rel=3e-4, abs=0.0)


@given(suspensions)
def test_numbers_of_real_particles_are_not_independent(s):
    numbers = from_suspension(s)
    scale, g0 = 1.0 / numbers.length_ratio, s.contact_radial_distribution
    assert numbers.tau_sigma == close(numbers.peclet * scale**2 / (6 * s.solid_fraction))
    assert numbers.tau_c == close(scale * math.sqrt(math.pi) / (24 * g0 * s.solid_fraction))


# --- limits ---------------------------------------------------------------------------------------

STILL = {"restitution": 0.9, "diameter": 3e-4, "velocity": 0.05}


def drag_alone(closure_set):
    """Return what a drag rate of 25 per second adds to the rates."""
    return {
        "covariance_destruction": 25.0,
        "third_moment": 25.0 * closure_set["third_moment_drag"],
        "variance_flux_destruction": 25.0,
    }


@pytest.mark.parametrize("closure_name", closures.NAMES)
def test_drag_adds_to_three_rates(closure_name):
    c = closures.by_name(closure_name, 0.9)
    moving = STILL | {"collision_time": 1e-3, "dispersion": 1e-8, "conduction": 1e-20}
    without = closure_rates(c, drag_rate=1.0 / INF, **moving)._asdict()
    with_drag = closure_rates(c, drag_rate=25.0, **moving)._asdict()
    added = {name: with_drag[name] - without[name] for name in without}
    assert added == pytest.approx(dict.fromkeys(added, 0.0) | drag_alone(c), rel=1e-12)


@pytest.mark.parametrize("closure_name", closures.NAMES)
def test_without_collisions(closure_name):
    c = closures.by_name(closure_name, 0.9)
    none = {"collision_time": INF, "dispersion": 0.0, "conduction": 0.0}
    found = closure_rates(c, drag_rate=25.0, **STILL, **none)._asdict()
    kinetic = {"gradient_production": 0.05**2, "shear": 0.05**2}
    assert found == dict.fromkeys(found, 0.0) | kinetic | drag_alone(c)


@pytest.mark.parametrize("closure_name", closures.NAMES)
def test_ever_fewer_collisions_tend_to_none(closure_name):
    c = closures.by_name(closure_name, 0.9)
    state = {"diameter": 3e-4, "granular_temperature": 0.05**2, "charge_transfer": 0.02}
    rare = state | {"number_density": 1e-6, "radial_distribution": 1.0}
    few = both(c, rare, drag_rate=25.0)[1]._asdict()
    del few["transferred_fraction"]  # of one collision, however rare
    limit = {"gradient_production": 0.05**2, "shear": 0.05**2} | drag_alone(c)
    assert few == pytest.approx(dict.fromkeys(few, 0.0) | limit, rel=1e-9, abs=1e-12)
