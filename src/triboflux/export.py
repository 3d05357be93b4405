"""Source code of the closed coefficients for CFD programs, written from the same formulas."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import sympy

from triboflux import __version__, closures, export_text, radial_distribution
from triboflux.errors import InputError, require_one_of
from triboflux.rates import closure_rates, suspension_transport

if TYPE_CHECKING:
    from triboflux.suspension import Suspension

LANGUAGES = ("c", "fortran", "openfoam")


class Meaning(NamedTuple):
    """What the comment says about a result.

    Attributes
    ----------
    symbol : str
        The field's notation.
    meaning : str
        In words.
    unit : str
        SI unit, in base units and coulombs; ``"1"`` for a pure number.
    equation : str
        Of the paper.
    """

    symbol: str
    meaning: str
    unit: str
    equation: str


class Line(NamedTuple):
    """One assignment of the generated function.

    Attributes
    ----------
    name : str
        What is assigned to.
    expression : sympy.Expr
        Of arguments, constants and names of earlier lines.
    meaning : Meaning or None
        What it is, if it is a result.
    """

    name: str
    expression: sympy.Expr
    meaning: Meaning | None


COEFFICIENTS = {
    "triboconductivity": Meaning("sigma", "triboconductivity", "C^2 s/(kg m^3)", "(2.25)"),
    "dispersion": Meaning("D", "collisional dispersion of charge", "m^2/s", "(2.26)"),
    "collisional_flux": Meaning("eta", "collisional part of the flux", "1", "(2.27)"),
    "collision_time": Meaning("tau_c", "time between collisions", "s", "(3.5)"),
    "charge_exchange_time": Meaning("tau_xi", "charge exchange time", "s", "(3.6)"),
    "gradient_production": Meaning("P", "covariance from grad Q", "m^2/s^2", "(3.4)"),
    "field_production": Meaning("S", "covariance from E", "C^2/kg", "(3.4)"),
    "covariance_destruction": Meaning("R", "destruction of covariance", "1/s", "(3.4)"),
    "third_moment": Meaning("K1", "relaxation of <xi'c'c'>", "1/s", "(3.8)"),
    "third_moment_trace": Meaning("K2", "relaxation of its trace", "1/s", "(3.9)"),
    "shear": Meaning("G1", "of d_i C_j + d_j C_i in -D_ij", "m^2/s^2", "(3.10)"),
    "divergence": Meaning("G2", "of div C delta_ij in -D_ij", "m^2/s^2", "(3.10)"),
    "variance_destruction": Meaning("F", "destruction of variance", "1/s", "(4.2)"),
    "variance_field_production": Meaning("B", "variance from |E|^2", "C^4 s^3/(kg^2 m^2)", "(4.2)"),
    "variance_dispersion": Meaning(
        "Dv", "dispersion of variance, collisional and kinetic", "m^2/s", "(4.2), (4.3)"
    ),
    "transferred_fraction": Meaning(
        "gamma Theta^(a/2)", "mean fraction of the charge difference passed over", "1", "(2.14)"
    ),
}
"""What the generated function returns, by name."""

ARGUMENTS = {
    "number_density": ("n", "particles per volume, 1/m^3; above 0, below the maximum packing"),
    "granular_temperature": ("Theta", "m^2/s^2; above 0"),
    "restitution": ("e", "coefficient of restitution, from 0 to 1"),
    "drag_time": ("tau_p", "s; infinity without drag"),
}
"""Symbol and meaning of what the generated function is called with."""


class Source(NamedTuple):
    """Everything that a language needs.

    Attributes
    ----------
    header : tuple of str
        Lines of the comment on top, without comment signs.
    constants : dict
        Values of the suspension by name.
    lines : tuple of Line
        The body of the function, in order.
    """

    header: tuple[str, ...]
    constants: dict[str, float]
    lines: tuple[Line, ...]


def export(suspension: Suspension, language: str, closure_name: str = "derived") -> str:
    """Return source code that computes the coefficients in SI from the local state.

    The code is self-contained. Its function takes number density, granular temperature,
    restitution and drag time; particles and radial distribution are those of the suspension.

    Parameters
    ----------
    suspension : Suspension
        Its state and domain are not used.
    language : str
        One of `LANGUAGES`.
    closure_name : str
        ``"derived"`` or ``"published"``. The published set keeps λ' = 12, as runs with it do.

    Returns
    -------
    str
        A C header with an inline function, a Fortran module, or an OpenFOAM header.

    Raises
    ------
    InputError
        If the language or the closure set is unknown, or the set is ``"complete"``, whose
        additional terms are not coefficients of the paper's equations.
    """
    writers: dict[str, Callable[[Source], str]] = {
        "c": export_text.as_c,
        "fortran": export_text.as_fortran,
        "openfoam": export_text.as_openfoam,
    }
    require_one_of("language", language, LANGUAGES)
    if closure_name == "complete":
        raise InputError.about(
            "closures",
            "is 'complete', which is not written as source code; allowed are "
            f"{', '.join(closures.PAPERS_EQUATIONS)}",
        )
    return writers[language](source(suspension, closure_name))


def source(suspension: Suspension, closure_name: str) -> Source:
    """Return the formulas of the coefficients, by letting symbols through those of the package.

    Parameters
    ----------
    suspension : Suspension
        Gives the constants.
    closure_name : str
        ``"derived"`` or ``"published"``.
    """
    s = suspension
    constants = {
        "diameter": s.diameter,
        "volume": s.volume,
        "charge_transfer": s.charge_transfer,
        "field_transfer": s.field_transfer,
        "maximum_packing": s.maximum_packing,
    }
    symbol = {
        name: sympy.Symbol(name, positive=True)
        for name in (*ARGUMENTS, *constants, *COEFFICIENTS, "solid_fraction", "velocity")
    }
    g0 = sympy.Symbol("radial_distribution", positive=True)
    law = radial_distribution.LAWS[s.radial_distribution]
    transport = suspension_transport(
        closures.values_for(closure_name, symbol["restitution"]),
        closures.HERTZ_EXPONENT,
        diameter=symbol["diameter"],
        number_density=symbol["number_density"],
        granular_temperature=symbol["velocity"] ** 2,
        radial_distribution=g0,
        charge_transfer=symbol["charge_transfer"],
        field_transfer=symbol["field_transfer"],
    )
    rates = closure_rates(
        closures.values_for(closure_name, symbol["restitution"]),
        restitution=symbol["restitution"],
        diameter=symbol["diameter"],
        velocity=symbol["velocity"],
        collision_time=symbol["collision_time"],
        drag_rate=1.0 / symbol["drag_time"],
        dispersion=symbol["dispersion"],
        conduction=symbol["triboconductivity"] / symbol["number_density"],
    )
    kinetic = symbol["granular_temperature"] / rates.variance_flux_destruction
    found: dict[str, Any] = {
        **rates._asdict(),
        "triboconductivity": transport.conductivity,
        "dispersion": transport.dispersion,
        "collision_time": 1.0 / transport.collision_rate,
        "charge_exchange_time": 1.0 / rates.charge_exchange,
        "variance_dispersion": rates.variance_collisional_dispersion + kinetic,
        "transferred_fraction": transport.transferred_fraction,
    }
    steps: dict[str, Any] = {
        "solid_fraction": symbol["number_density"] * symbol["volume"],
        "radial_distribution": law.function(symbol["solid_fraction"], symbol["maximum_packing"]),
        "velocity": sympy.sqrt(symbol["granular_temperature"]),
    }
    lines = [Line(name, sympy.sympify(steps[name]), None) for name in steps]
    # in the order in which they need each other
    lines += [Line(name, sympy.sympify(found[name]), COEFFICIENTS[name]) for name in COEFFICIENTS]
    lines, needed = _without_unused(lines)
    used = {name: value for name, value in constants.items() if name in needed}
    return Source(_header(s, closure_name), used, tuple(lines))


def _without_unused(lines: list[Line]) -> tuple[list[Line], set[str]]:
    """Return the lines without steps that no result needs, and the names that they need.

    Compilers warn of unused variables, such as the solid fraction where g0 is 1.
    """
    kept: list[Line] = []
    needed: set[str] = set()
    for line in reversed(lines):
        if line.meaning is not None or line.name in needed:
            kept.insert(0, line)
            needed |= {str(name) for name in line.expression.free_symbols}
    return kept, needed


def _header(suspension: Suspension, closure_name: str) -> tuple[str, ...]:
    """Return what the comment on top says."""
    s = suspension
    law = radial_distribution.LAWS[s.radial_distribution]
    return (
        "Closed coefficients of charge transport in gas-solid flow, in SI.",
        f"Written by triboflux {__version__} with the {closure_name} closures; a = "
        f"{closures.HERTZ_EXPONENT:g}.",
        "",
        "Equation numbers are those of Montilla, Ansart & Simonin, J. Fluid Mech. (2023).",
        "For uniform n and Theta, with Q the mean charge, C = <xi'c'>, V = <xi'xi'>, m the mass:",
        "  dQ/dt = -(1 + eta) div C - div(sigma E)/n + D lap Q",
        "  dC/dt = -P grad Q + S E + V E/m - R C - div T",
        "  dV/dt = -2 C.grad Q - F V + B |E|^2 + Dv lap V",
        "  T_ij = D_ij/K1 - K2/(K1 (K1 + 3 K2)) D_mm delta_ij,",
        "  D_ij = -G1 (d_i C_j + d_j C_i) - G2 div C delta_ij",
        "",
        "Nothing is checked: the closures hold where R, K1, K1 + 3 K2, G1 and Dv are positive, and "
        "gamma Theta^(a/2) is well below 1/2.",
        "",
        f"Particles: diameter {s.diameter:g} m, density {s.density:g} kg/m^3, mass {s.mass:.6g} "
        "kg,",
        f"  Young's modulus {s.youngs_modulus:g} Pa{' (softened)' if s.softened_modulus else ''}, "
        f"Poisson's ratio {s.poisson_ratio:g}; permittivity {s.permittivity:g} F/m.",
        f"Radial distribution at contact: {law.name}, {law.source};",
        f"  {law.validity}.",
    )
