"""What the presets are and what the models make of them: the tables of docs/suspension.md.

Run from the root of the repository; nothing is written without ``--write``::

    python -m benchmarks.presets --write     # about half a minute
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from benchmarks.timing import ROOT, table, write_section
from triboflux import drag, presets, radial_distribution
from triboflux.assessment import Assessment, assess
from triboflux.model_errors import CHEAPEST_FIRST, OK, ModelError, measure, percent
from triboflux.suspension import Suspension
from triboflux.units import format_quantity

PAGE = ROOT / "docs" / "suspension.md"
UNITS = {
    "diameter": "m",
    "density": "kg/m^3",
    "youngs_modulus": "Pa",
    "gas_density": "kg/m^3",
    "gas_viscosity": "Pa s",
    "granular_temperature": "m^2/s^2",
    "domain_length": "m",
    "charge_scale": "C",
}
SHOWN = ("sigma_p", "D_p", "eta_coll", "tau_c", "tau_xi", "tau_p", "1/R", "epsilon_0/sigma", "l")


def suspensions() -> dict[str, Suspension]:
    """Return every preset as it comes."""
    return {name: Suspension(preset=name) for name in presets.NAMES}


def values_table() -> str:
    """Return the fields of all presets with their sources, one row for each cited value."""
    rows = [
        (name, f"`{field}`", _shown(field, getattr(suspension, field)), source)
        for name, suspension in suspensions().items()
        for field, source in presets.SOURCES[name].items()
        if source != presets.DEFAULT
    ]
    return table(("preset", "field", "value", "source"), rows)


def _shown(field: str, value: object) -> str:
    """Return a value of a field with its unit."""
    if isinstance(value, float):
        return format_quantity(value, UNITS.get(field, ""))
    return str(value).lower() if isinstance(value, bool) else str(value)


def models_table() -> str:
    """Return coefficients, numbers, regime and proposed model, one column for each preset."""
    found = {name: assess(suspension) for name, suspension in suspensions().items()}
    rows: list[Sequence[str]] = []
    for symbol in SHOWN:
        rows.append((f"`{symbol}`", *(_coefficient(each, symbol) for each in found.values())))
    for number in type(next(iter(found.values())).numbers).model_fields:
        values = (getattr(each.numbers, number) for each in found.values())
        rows.append((f"`numbers.{number}`", *(f"{value:.4g}" for value in values)))
    rows.append(("regime", *(each.regime for each in found.values())))
    rows.append(("model", *(each.model for each in found.values())))
    rows.append(("warnings", *(str(len(each.warnings)) for each in found.values())))
    return table(("", *found), rows)


def _coefficient(assessment: Assessment, symbol: str) -> str:
    """Return one coefficient with its unit."""
    (quantity,) = (q for q in assessment.coefficients if q.symbol == symbol)
    return format_quantity(quantity.value, quantity.unit)


def laws_table() -> str:
    """Return the laws of radial distribution and of drag with their sources."""
    rows = [
        *(("radial_distribution", law) for law in radial_distribution.LAWS.values()),
        *(("drag", law) for law in drag.LAWS.values()),
    ]
    return table(
        ("field", "name", "holds for", "source"),
        ((f"`{field}`", f"`{law.name}`", law.validity, law.source) for field, law in rows),
    )


def errors_table() -> str:
    """Return the errors of the reduced models for every preset, computed and from the table."""
    rows: list[Sequence[str]] = []
    for name, suspension in suspensions().items():
        told = assess(suspension)
        exact = {each.model: each for each in measure(told.numbers).models}
        cells = (_errors(exact[each.model], each) for each in told.errors)
        rows.append((name, *cells, told.model))
    return table(("preset", *CHEAPEST_FIRST, "proposed"), rows)


def _errors(exact: ModelError, told: ModelError) -> str:
    """Return a computed error and, in brackets, that of the table; or why there is none."""
    first, second = (percent(e.error) if e.status == OK else e.status for e in (exact, told))
    return first if first == second else f"{first} ({second})"


SECTIONS = {
    "values": values_table,
    "models": models_table,
    "laws": laws_table,
    "errors": errors_table,
}


def main() -> None:
    """Print the tables, and write them with ``--write``."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--write", action="store_true", help="fill docs/suspension.md")
    write = parser.parse_args().write
    for name, text in ((name, section()) for name, section in SECTIONS.items()):
        print(f"{text}\n")
        if write:
            write_section(name, text, PAGE)


if __name__ == "__main__":
    main()
