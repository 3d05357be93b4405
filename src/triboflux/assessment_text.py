"""What `triboflux numbers` prints: an assessment for a terminal, as JSON or as TOML."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, TextIO

from triboflux.errors import require_one_of
from triboflux.model_errors import OK, ModelError, percent
from triboflux.tables import WIDE
from triboflux.units import format_quantity

if TYPE_CHECKING:
    from rich.table import Table

    from triboflux.assessment import Assessment
    from triboflux.suspension import Suspension

FORMATS = ("table", "json", "toml")

MEANINGS = {
    "peclet": ("Pe = L sqrt(Theta)/D", "(5.13)"),
    "tau_sigma": ("tau_sigma* = epsilon_0 sqrt(Theta)/(sigma L)", "(5.14)"),
    "tau_c": ("tau_c* = tau_c sqrt(Theta)/L", "(5.15)"),
    "tau_p": ("tau_p* = tau_p sqrt(Theta)/L", "(5.16)"),
    "energy_ratio": ("u = n Q0^2 L^2/(epsilon_0 m Theta)", "(5.17)"),
    "length_ratio": ("L/d", "(5.18)"),
    "restitution": ("e", "(5.19)"),
}
"""Definition and equation of each of the seven numbers."""
_ORIGINS = {
    "table": "Error of the charge against the full model, from the table",
    "computed": "Error of the charge against the full model, computed",
}


def write(
    assessment: Assessment,
    suspension: Suspension,
    form: str,
    file: TextIO,
    *,
    closures: str,
    sentences: bool = True,
) -> None:
    """Write an assessment to an open text file.

    Parameters
    ----------
    assessment : Assessment
        From `triboflux.assessment.assess`.
    suspension : Suspension
        What was assessed.
    form : str
        One of `FORMATS`.
    file : text file
        Where to write; a terminal gets tables of its width, anything else whole lines.
    closures : str
        Name of the closure set that was used.
    sentences : bool
        Whether reasons and warnings follow the tables.

    Raises
    ------
    InputError
        If the format is unknown.
    """
    require_one_of("format", form, FORMATS)
    if form == "json":
        file.write(as_json(assessment, suspension, closures))
    elif form == "toml":
        file.write(as_toml(assessment, closures))
    else:
        _write_tables(assessment, file, closures, sentences=sentences)


def as_json(assessment: Assessment, suspension: Suspension, closures: str) -> str:
    """Return an assessment as JSON in full precision; null stands for an infinite time.

    Parameters
    ----------
    assessment : Assessment
        From `triboflux.assessment.assess`.
    suspension : Suspension
        What was assessed; its values in SI are repeated.
    closures : str
        Name of the closure set that was used.
    """
    document = {
        "closures": closures,
        "suspension": suspension.model_dump(exclude_none=True),
        **dataclasses.asdict(assessment),
        "numbers": assessment.numbers.model_dump(),
    }
    return json.dumps(_finite(document), indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def as_toml(assessment: Assessment, closures: str) -> str:
    """Return the table ``[numbers]`` of a case.

    Parameters
    ----------
    assessment : Assessment
        From `triboflux.assessment.assess`.
    closures : str
        Name of the closure set that was used.
    """
    import tomli_w

    table = {"closures": closures, "numbers": assessment.numbers.model_dump()}
    return tomli_w.dumps(table)


def _finite(value: Any) -> Any:
    """Replace every infinite number by None."""
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}  # pyright: ignore[reportUnknownVariableType] -- of JSON
    if isinstance(value, list | tuple):
        return [_finite(inner) for inner in value]  # pyright: ignore[reportUnknownVariableType] -- of JSON
    return None if isinstance(value, float) and math.isinf(value) else value


def _write_tables(assessment: Assessment, file: TextIO, closures: str, *, sentences: bool) -> None:
    """Write coefficients, numbers, the proposal and the warnings for people."""
    from rich.console import Console
    from rich.text import Text

    width = None if file.isatty() else WIDE
    console = Console(file=file, width=width, highlight=False, markup=False, emoji=False)
    console.print(
        _table(
            f"Coefficients with {closures} closures",
            ("symbol", "meaning", "value", "equation"),
            (
                (q.symbol, q.meaning, format_quantity(q.value, q.unit), q.equation)
                for q in assessment.coefficients
            ),
        )
    )
    numbers = assessment.numbers.model_dump()
    console.print(
        _table(
            "The seven numbers",
            ("name", "definition", "value", "equation"),
            (
                (name, definition, f"{numbers[name]:.6g}", equation)
                for name, (definition, equation) in MEANINGS.items()
            ),
        )
    )
    if assessment.errors:
        console.print(
            _table(
                _ORIGINS[assessment.origin],
                ("model", "value", "range"),
                (
                    (each.model, percent(each.error), _range(each))
                    if each.status == OK
                    else (each.model, "", each.status)
                    for each in assessment.errors
                ),
            )
        )
    console.print(Text(f"Regime: {assessment.regime}"))
    console.print(Text(f"Model:  {assessment.model}"))
    if not sentences:
        return
    for reason in assessment.reasons:
        console.print(Text(f"- {reason}"))
    for warning in assessment.warnings:
        console.print(Text(f"warning: {warning}"))


def _range(error: ModelError) -> str:
    """Return the range of an error, nothing if it is known exactly."""
    known = error.low == error.high
    return "" if known else f"{percent(error.low)} to {percent(error.high)}"


def _table(title: str, names: Iterable[str], rows: Iterable[tuple[str, ...]]) -> Table:
    """Return a plain table in which nothing is cut off."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(
        title=Text(title),
        title_justify="left",
        box=box.SIMPLE_HEAD,
        show_edge=False,
        pad_edge=False,
    )
    for name in names:
        table.add_column(name, overflow="fold", justify="right" if name == "value" else "left")
    for row in rows:
        table.add_row(*map(Text, row))
    return table
