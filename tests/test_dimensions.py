"""Dimensional homogeneity of every coefficient, and of the equations that they are exported for."""

import math
import re
from types import SimpleNamespace

import pint
import pytest
import sympy
from sympy.parsing import sympy_parser

from triboflux import closures, collision, export, presets
from triboflux.dropped_rates import dropped_rates
from triboflux.export_text import dimension_set
from triboflux.rates import closure_rates, suspension_transport

REGISTRY = pint.UnitRegistry()

STATE = {
    "diameter": (3e-4, "m"),
    "density": (1100.0, "kg/m^3"),
    "youngs_modulus": (2.5e9, "Pa"),
    "permittivity": (9e-12, "F/m"),
    "number_density": (2.1e10, "1/m^3"),
    "granular_temperature": (1.5e-3, "m^2/s^2"),
    "drag_time": (0.04, "s"),
    "poisson_ratio": (0.4, ""),
    "restitution": (0.85, ""),
    "radial_distribution": (2.3, ""),
}
"""Particles and their state."""

BASE_UNITS = {"[length]": "mm", "[mass]": "mg", "[time]": "ms", "[current]": "nA"}
"""Not those of SI. One unit of each kind, because fractional powers of two are never the same."""

UNITS = {
    "contact_length": "m^0.2 s^0.8",
    "charge_transfer": "s^0.8/m^0.8",
    "field_transfer": "C s^0.8/(V/m)/m^0.8",
    "collision_rate": "1/s",
    "dispersion": "m^2/s",
    "conductivity": "S/m",
    "transferred_fraction": "",
    "collisional_flux": "",
    "charge_exchange": "1/s",
    "gradient_production": "m^2/s^2",
    "field_production": "C m/s^2/(V/m)",
    "covariance_destruction": "1/s",
    "third_moment": "1/s",
    "third_moment_trace": "1/s",
    "shear": "m^2/s^2",
    "divergence": "m^2/s^2",
    "variance_destruction": "1/s",
    "variance_field_production": "C^2/s/(V/m)^2",
    "variance_collisional_dispersion": "m^2/s",
    "variance_flux_destruction": "1/s",
    "rates.transferred_fraction": "",
}
"""Of everything between a particle's material and the equations, as its documentation says."""

DROPPED_UNITS = {
    "charge_third_moment": "s",
    "covariance_third_moment": "",
    "covariance_dispersion": "m^2/s",
    "third_moment_gradient": "m^4/s^3",
    "third_moment_field": "C^2 m^2/(kg s)",
    "variance_flux": "",
    "variance_flux_gradient": "m^2/s^2",
    "covariance_along_gradient": "",
    "covariance_along_field": "C^2 s^2/(kg m^2)",
    "variance_gradient_production": "m^2/s",
    "variance_mixed_production": "C^2 s/kg",
    "variance_covariance_destruction": "s/m^2",
}
"""The same of the terms that the paper's derivation drops."""


def coefficients(values, closure_name="derived"):
    """Return everything that follows from a state, whatever kind of number it is made of."""
    s = SimpleNamespace(**values)
    mass = s.density * (math.pi / 6.0 * s.diameter**3)
    contact = collision.contact_length(mass, s.diameter, s.youngs_modulus, s.poisson_ratio)
    transfers = {
        "charge_transfer": collision.charge_transfer(contact, s.diameter),
        "field_transfer": collision.field_transfer(contact, s.diameter, s.permittivity),
    }
    c = closures.values_for(closure_name, s.restitution)
    transport = suspension_transport(
        c,
        collision.HERTZ_EXPONENT,
        diameter=s.diameter,
        number_density=s.number_density,
        granular_temperature=s.granular_temperature,
        radial_distribution=s.radial_distribution,
        **transfers,
    )
    given_to_both = {
        "restitution": s.restitution,
        "diameter": s.diameter,
        "velocity": s.granular_temperature**0.5,
        "dispersion": transport.dispersion,
        "conduction": transport.conductivity / s.number_density,
    }
    closed = closure_rates(
        c,
        collision_time=1.0 / transport.collision_rate,
        drag_rate=1.0 / s.drag_time,
        **given_to_both,
    )
    rates = closed._asdict()
    if closure_name == "complete":
        rates |= dropped_rates(c, closed, **given_to_both)._asdict()
    rates["rates.transferred_fraction"] = rates.pop("transferred_fraction")
    return {"contact_length": contact} | transfers | transport._asdict() | rates


def quantities(**changes):
    """Return the state with units, those of `BASE_UNITS`."""
    found = {}
    for name, (value, unit) in (STATE | changes).items():
        quantity = REGISTRY.Quantity(value, unit)
        bases = [
            REGISTRY.Unit(BASE_UNITS[kind]) ** power
            for kind, power in quantity.dimensionality.items()
        ]
        found[name] = quantity.to(math.prod(bases, start=REGISTRY.Unit("")))
    return found


def powers(unit):
    """Return the powers of base dimensions, to round-off of fractional powers."""
    dimension = REGISTRY.Quantity(1.0, unit).dimensionality
    return {name: round(power, 9) for name, power in dimension.items() if abs(power) > 1e-9}


def assert_units(found):
    """Check that every coefficient is of the unit that it is said to be of."""
    units = UNITS | DROPPED_UNITS if DROPPED_UNITS.keys() <= found.keys() else UNITS
    assert {name: powers(value.units) for name, value in found.items()} == {
        name: powers(unit) for name, unit in units.items()
    }


# --- units ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("closure_name", closures.NAMES)
def test_every_coefficient_is_of_its_unit(closure_name):
    with_units = coefficients(quantities(), closure_name)
    assert (DROPPED_UNITS.keys() <= with_units.keys()) == (closure_name == "complete")
    assert_units(with_units)
    in_si = coefficients({name: value for name, (value, _) in STATE.items()}, closure_name)
    for name, value in in_si.items():
        converted = with_units[name].to_base_units().magnitude
        assert converted == pytest.approx(value, rel=1e-12, abs=0.0), name


@pytest.mark.parametrize("name", STATE)
def test_a_wrong_power_of_any_input_is_seen(name):
    value, unit = STATE[name]
    changed = {name: (value, f"({unit})^2" if unit else "m")}
    with pytest.raises((pint.DimensionalityError, AssertionError)):
        assert_units(coefficients(quantities(**changed)))


# --- the exported equations -----------------------------------------------------------------------

EXPORTED = {
    "triboconductivity": "conductivity",
    "collision_time": "1/collision_rate",
    "charge_exchange_time": "1/charge_exchange",
    "variance_dispersion": "variance_collisional_dispersion",
}
"""What the exported code calls otherwise than the package does."""

SYMBOLS = {
    **{about.symbol: about.unit for about in export.COEFFICIENTS.values()},
    **{"n": "1/m^3", "m": "kg", "t": "s", "E": "V/m"},
    **{"Q": "C", "C": "C m/s", "C_i": "C m/s", "C_j": "C m/s", "V": "C^2"},
    **{"T": "C m^2/s^2", "T_ij": "C m^2/s^2", "D_ij": "C m^2/s^3", "D_mm": "C m^2/s^3"},
    **{"div": "1/m", "grad": "1/m", "d_i": "1/m", "d_j": "1/m", "lap": "1/m^2", "delta_ij": ""},
}
"""Units of what the equations hold."""


@pytest.mark.parametrize("name", export.COEFFICIENTS)
def test_units_of_the_exported_code(name):
    ours = EXPORTED.get(name, name)
    unit = UNITS[ours.removeprefix("1/")]
    expected = powers(f"1/({unit})" if ours.startswith("1/") else unit)
    declared = export.COEFFICIENTS[name].unit
    assert powers(declared) == expected
    bases = ("mass", "length", "time", "temperature", "substance", "current", "luminosity")
    listed = [int(power) for power in dimension_set(declared).strip("[]").split()]
    assert {f"[{base}]": p for base, p in zip(bases, listed, strict=True) if p} == expected


def test_a_dimension_set_of_other_units_fails():
    with pytest.raises(KeyError, match="V"):
        dimension_set("V/m")


def equations():
    """Return the equations on top of the exported code, left side by right side."""
    header = export.source(presets.polyethylene(), "derived").header
    found = (re.fullmatch(r"  (\w+(?:/dt)?) = (.+?),?", line) for line in header)
    return {match[1]: match[2] for match in found if match}


def dimension(expression):
    """Return the powers of base dimensions of an expression, all sums being of one kind."""
    if expression.is_number:
        return powers("")
    if expression.is_Symbol:
        return powers(SYMBOLS[str(expression)])
    parts = [dimension(part) for part in expression.args]
    if expression.is_Add:
        assert all(part == parts[0] for part in parts), expression
        return parts[0]
    if expression.is_Pow:
        return {name: power * expression.exp for name, power in parts[0].items()}
    assert expression.is_Mul
    kinds = {name for part in parts for name in part}
    sums = {name: sum(part.get(name, 0) for part in parts) for name in kinds}
    return {name: power for name, power in sums.items() if power}


def parsed(side):
    """Return one side of an equation as an expression of symbols."""
    plain = re.sub(r"\bd([QCV])/dt", r"\1/t", side).replace("|E|", "E").replace(".", " ")
    names = re.findall(r"[A-Za-z]\w*", plain)
    return sympy_parser.parse_expr(
        plain.replace("^", "**"),
        {name: sympy.Symbol(name) for name in names},
        (*sympy_parser.standard_transformations, sympy_parser.implicit_multiplication),
    )


@pytest.mark.parametrize("left", ["dQ/dt", "dC/dt", "dV/dt", "T_ij", "D_ij"])
def test_every_term_of_the_exported_equations_is_of_one_unit(left):
    right = equations()[left]
    assert dimension(parsed(right)) == dimension(parsed(left))
    for term in sympy.Add.make_args(parsed(right)):
        assert dimension(term) == dimension(parsed(left)), term


@pytest.mark.parametrize(
    ("left", "right", "wrong"),
    [
        ("dQ/dt", "D lap Q", "D grad Q"),
        ("dC/dt", "V E/m", "V E"),
        ("dV/dt", "B |E|^2", "B |E|"),
        ("T_ij", "D_ij/K1", "D_ij"),
        ("D_ij", "G2 div", "G2"),
    ],
)
def test_a_wrong_term_is_seen(left, right, wrong):
    changed = equations()[left].replace(right, wrong)
    assert changed != equations()[left]
    with pytest.raises(AssertionError):
        dimension(parsed(changed))
