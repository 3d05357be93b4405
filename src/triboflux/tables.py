"""The audit of the closure coefficients as a table on a terminal, JSON, CSV or LaTeX."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import math
import re
import sys
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, TextIO

from triboflux.closures import HERTZ_EXPONENT
from triboflux.errors import require_one_of

if TYPE_CHECKING:
    from triboflux.audit import AuditRow

FORMATS = ("table", "json", "csv", "latex")
WIDE = 10_000
"""Columns of an output that is no terminal: more than any line of a table."""
_NARROWEST, _SAMPLED_WIDTH = 80, 22
"""Columns below which a terminal breaks the lines itself, and what a sampled column adds."""
_ROUND_OFF = 1e-12
"""Relative error below which a sampled value is exact in every sample."""


@contextmanager
def sampling_bar(*, quiet: bool) -> Generator[Callable[[float], None] | None, None, None]:
    """Give a callback that draws on stderr how far a sampling is, or None where nobody sees it.

    Parameters
    ----------
    quiet : bool
        Draw nothing.

    Yields
    ------
    callable or None
        For ``audit(..., on_progress=...)``.
    """
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("sampling", total=1.0)
        yield lambda fraction: bar.update(task, completed=fraction)


def write(
    rows: Sequence[AuditRow], form: str, file: TextIO, *, restitution: float, exponent: float
) -> None:
    """Write an audit to an open text file.

    A terminal gets a table that fits its width; any other file gets lines of the length they need.

    Parameters
    ----------
    rows : sequence of AuditRow
        From `triboflux.audit.audit`.
    form : str
        One of `FORMATS`.
    file : text file
        Where to write.
    restitution, exponent : float
        What the audit was made for, dimensionless.

    Raises
    ------
    InputError
        If the format is unknown.
    """
    require_one_of("format", form, FORMATS)
    if form == "table":
        _write_table(rows, file, restitution, exponent)
    else:
        file.write(_TEXTS[form](rows, restitution, exponent))


def as_json(rows: Sequence[AuditRow], restitution: float, exponent: float) -> str:
    """Return an audit as JSON with numbers in full precision; null stands for what is missing."""
    document = {
        "restitution": restitution,
        "exponent": exponent,
        "coefficients": _records(rows),
    }
    return json.dumps(document, indent=2, allow_nan=False) + "\n"


def as_csv(rows: Sequence[AuditRow], restitution: float, exponent: float) -> str:
    """Return an audit as comma-separated values with a header; what is missing is empty."""
    text = io.StringIO()
    given = {"restitution": restitution, "exponent": exponent}
    records = [given | record for record in _records(rows)]
    writer = csv.DictWriter(text, list(records[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(records)
    return text.getvalue()


def as_latex(rows: Sequence[AuditRow], restitution: float, exponent: float) -> str:
    """Return an audit as a complete ``tabular`` environment that needs no package."""
    with_samples = _has_samples(rows)
    head = ["Symbol", "Coefficient", "Exact form", "Exact", "Printed", "Ratio", "Verdict"]
    head += [*(["Sampled"] if with_samples else []), "Equation", "Note"]
    alignment = "lllrrrl" + ("r" if with_samples else "") + r"lp{0.4\textwidth}"
    lines = [
        f"% e = {restitution:g}, a = {exponent:g}; printed by Montilla, Ansart & Simonin (2023)",
        rf"\begin{{tabular}}{{{alignment}}}",
        r"\hline",
        rf"{' & '.join(head)} \\",
        r"\hline",
    ]
    for row in rows:
        cells = [
            latex(row.symbol),
            latex(row.name.replace("_", " ")),
            f"${latex_math(row.formula)}$",
            *map(_latex_number, (_number(row.exact), _printed(row), _number(row.ratio))),
            row.verdict,
            *([_latex_number(_sampled(row)).replace("±", r"\pm")] if with_samples else []),
            row.equation,
            latex(row.note),
        ]
        lines.append(rf"{' & '.join(cells)} \\")
    return "\n".join([*lines, r"\hline", r"\end{tabular}", ""])


_TEXTS: dict[str, Callable[[Sequence[AuditRow], float, float], str]] = {
    "json": as_json,
    "csv": as_csv,
    "latex": as_latex,
}


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"


def _printed(row: AuditRow) -> str:
    """Return the paper's value, with its own digits where it prints a plain number."""
    plain = row.printed_formula is not None and re.fullmatch(r"[0-9.]+", row.printed_formula)
    return (row.printed_formula or "") if plain else _number(row.printed)


def _has_samples(rows: Sequence[AuditRow]) -> bool:
    return any(row.sampled is not None for row in rows)


def _records(rows: Sequence[AuditRow]) -> list[dict[str, str | float | None]]:
    """Return the rows as mappings, without the sampled values where there are none at all."""
    left_out = () if _has_samples(rows) else ("sampled", "error")
    return [
        {name: value for name, value in dataclasses.asdict(row).items() if name not in left_out}
        for row in rows
    ]


def _sampled(row: AuditRow) -> str:
    """Return a sampled value with its error, both to the second digit of the error."""
    if row.sampled is None or row.error is None:
        return ""
    if row.error <= _ROUND_OFF * abs(row.sampled):
        return _number(row.sampled)
    digits = max(1 - math.floor(math.log10(row.error)), 0)
    return f"{row.sampled:.{digits}f} ± {row.error:.2g}"


def _write_table(
    rows: Sequence[AuditRow], file: TextIO, restitution: float, exponent: float
) -> None:
    """Write a table of the numbers and, below it, the forms and notes."""
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    with_samples = _has_samples(rows)
    width = WIDE
    if file.isatty():
        narrowest = _NARROWEST + (_SAMPLED_WIDTH if with_samples else 0)
        width = max(Console(file=file).width, narrowest)
    console = Console(file=file, width=width, highlight=False, markup=False, emoji=False)
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, collapse_padding=True)
    # A number or a name that is cut off is worth nothing: names fold and the rest keeps its width.
    table.add_column("symbol", no_wrap=True)
    table.add_column("name", overflow="fold")
    for name in ("exact", "printed", "ratio"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    if with_samples:
        table.add_column("sampled", justify="right", no_wrap=True)
    none = "none" if exponent == HERTZ_EXPONENT else f"none for a = {exponent:g}"
    for row in rows:
        numbers = _number(row.exact), _printed(row) or none, _number(row.ratio)
        cells = [row.symbol, row.name.replace("_", " "), *numbers, row.verdict]
        table.add_row(*map(Text, [*cells, _sampled(row)] if with_samples else cells))
    console.print(Text(f"Closure coefficients for e = {restitution:g}, a = {exponent:g}\n"))
    console.print(table)
    console.print(Text("\nExact forms, equations and notes\n"))
    for row in rows:
        console.print(Text(f"{row.symbol} = {row.formula}; {row.equation}. {row.note}".rstrip()))


_GREEK = "lambda|rho|chi|tau|kappa|gamma|sigma|xi|Theta"
_SYMBOL = re.compile(
    rf"\b(?:{_GREEK})(?:_[0-9.]*[0-9]|_[a-z]+)?'*(?:\^\([^()]*\))?"  # lambda_2.3, lambda'', tau_xi
    r"|\b[DJKR](?:_\([^()]*\)|_[a-z]+(?:,[a-z]+)?|_?[0-9]+)"  # J_(1+a), R_p,jk, K1
)
_ESCAPED = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    **{character: f"\\{character}" for character in "&%$#_{}"},
}


def latex_math(formula: str) -> str:
    """Return a closed form in the notation of the closures as LaTeX for math mode.

    Parameters
    ----------
    formula : str
        For instance ``"J_(2+a)(a e^2+3e^2+2e-1)/(120 J_(1+a))"``.
    """
    greek = re.sub(rf"({_GREEK})", r"\\\1", formula)
    groups = re.sub(r"([_^])\(([^()]*)\)", r"\1{\2}", greek)
    indices = re.sub(r"_([0-9.]*[0-9]|[a-z]+(?:,[a-z]+)?)", r"_{\1}", groups)
    numbered = re.sub(r"\b(K)([0-9])", r"\1_{\2}", indices)
    return numbered.replace(" = ", "=").replace(" ", r"\,")


def latex(text: str) -> str:
    """Return prose in the notation of the closures as LaTeX, its symbols in math mode.

    Parameters
    ----------
    text : str
        A note, a symbol or a name.
    """
    parts: list[str] = []
    end = 0
    for found in _SYMBOL.finditer(text):
        parts += [_escaped(text[end : found.start()]), f"${latex_math(found.group())}$"]
        end = found.end()
    return "".join([*parts, _escaped(text[end:])])


def _escaped(text: str) -> str:
    return "".join(_ESCAPED.get(character, character) for character in text)


def _latex_number(number: str) -> str:
    """Return a number as shown in the table in math mode, or a dash."""
    mantissa, exponential, power = number.partition("e")
    if exponential:
        return rf"${mantissa}\times10^{{{int(power)}}}$"
    return f"${mantissa}$" if mantissa else "--"
