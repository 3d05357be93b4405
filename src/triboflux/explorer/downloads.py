"""What the page gives to take away: the case, the result, the figure, and lines of Python."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from triboflux.case import Case
from triboflux.compare import compare

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from triboflux.result import Result

KINDS = ("toml", "netcdf", "figure", "python")
"""What can be asked for."""


@dataclass(frozen=True)
class Download:
    """A file for the browser to keep.

    Attributes
    ----------
    name : str
        Of the file.
    kind : str
        Its media type.
    content : bytes
        What is in it.
    """

    name: str
    kind: str
    content: bytes


def toml(case: Case) -> Download:
    """Return a case for ``triboflux run``."""
    return Download("case.toml", "application/toml", case.to_toml().encode())


def netcdf(result: Result) -> Download:
    """Return a result as ``triboflux run`` would write it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "result.nc"
        result.to_netcdf(path)
        return Download("result.nc", "application/x-netcdf", path.read_bytes())


def python(case: Case) -> Download:
    """Return the lines of Python that solve a case."""
    return Download("result.py", "text/x-python", python_lines(case).encode())


def png(figure: Figure) -> Download:
    """Return a figure of the package."""
    file = io.BytesIO()
    figure.savefig(file, format="png", facecolor="white")  # pyright: ignore[reportUnknownMemberType] -- untyped keywords in Matplotlib
    return Download("figure.png", "image/png", file.getvalue())


def compared(case: Case, models: tuple[str, ...], units: str, check: Callable[[], None]) -> Figure:
    """Return the package's figure of several models at the same time.

    Parameters
    ----------
    case : Case
        To be run with all of them.
    models : tuple of str
        At least two.
    units : str
        ``"scaled"`` or ``"si"``.
    check : callable
        Raises `CancelledError` if nobody waits any longer.
    """
    from triboflux.compare_figure import compare_figure  # imports Matplotlib

    comparison = compare(case, models, on_progress=lambda _: check())
    return compare_figure(comparison.to_si() if units == "si" else comparison)


def python_lines(case: Case) -> str:
    """Return a program that solves a case.

    Every text in it is a literal of Python, so nothing that a user typed becomes code.

    Parameters
    ----------
    case : Case
        Of any kind.
    """
    derived = set[str]() if case.suspension is None else {"numbers"}
    tables = case.model_dump(exclude_none=True, exclude_defaults=True, exclude=derived)
    arguments = "\n".join(f"    {name}={_literal(value)}," for name, value in tables.items())
    return (
        "import triboflux as tbf\n\n"
        f"case = tbf.Case(\n{arguments}\n)\n"
        "result = tbf.solve(case)\n"
        "print(result.status, result.stop_reason, float(result.dataset.time[-1]))\n"
        'result.to_netcdf("result.nc", overwrite=True)\n'
    )


def _literal(value: Any) -> str:
    """Return a value as a literal of Python; inf has none of its own."""
    if isinstance(value, dict):
        table = cast("dict[str, Any]", value)
        inner = ", ".join(f"{key!r}: {_literal(entry)}" for key, entry in table.items())
        return f"{{{inner}}}"
    if isinstance(value, tuple | list):
        return f"[{', '.join(map(_literal, cast('list[Any]', value)))}]"
    if isinstance(value, float) and value in (float("inf"), float("-inf")):
        return f'float("{value}")'
    return repr(value)
