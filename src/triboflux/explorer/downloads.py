"""What the page gives to take away: the case, the result, the figure, and lines of Python."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from triboflux.case import Case
from triboflux.compare import compare
from triboflux.explorer.live import ModelRun
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


def toml(run: ModelRun) -> Download:
    """Return the case of a model's own run, for ``triboflux run``."""
    text = _own(run).case.to_toml()
    return Download("case.toml", "application/toml", text.encode())


def netcdf(run: ModelRun, units: str) -> Download:
    """Return a model's own run as ``triboflux run`` would write it."""
    result = _own(run).to_si() if units == "si" else _own(run)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "result.nc"
        result.to_netcdf(path)
        return Download("result.nc", "application/x-netcdf", path.read_bytes())


def python(run: ModelRun) -> Download:
    """Return the lines of Python that make a model's own run."""
    return Download("result.py", "text/x-python", python_lines(_own(run).case).encode())


def figure(
    run: ModelRun,
    case: Case,
    models: tuple[str, ...],
    units: str,
    time: int,
    check: Callable[[], None],
) -> Download:
    """Return a figure of the package as PNG.

    Parameters
    ----------
    run : ModelRun
        Drawn at one of its times if no other model is chosen.
    case : Case
        Compared with all chosen models otherwise.
    models : tuple of str
        The chosen models.
    units : str
        ``"scaled"`` or ``"si"``.
    time : int
        Index of the output time.
    check : callable
        Raises `CancelledError` if nobody waits any longer.
    """
    if len(models) > 1:
        from triboflux.compare_figure import compare_figure  # imports Matplotlib

        comparison = compare(case, models, on_progress=lambda _: check())
        drawn = compare_figure(comparison.to_si() if units == "si" else comparison)
    else:
        own = _own(run)
        last = own.dataset.sizes["time"] - 1
        drawn = (own.to_si() if units == "si" else own).plot(min(time, last))
    file = io.BytesIO()
    drawn.savefig(file, format="png", facecolor="white")
    return Download("figure.png", "image/png", file.getvalue())


def _own(run: ModelRun) -> Result:
    assert run.own is not None
    return run.own


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
        inner = ", ".join(f"{key!r}: {_literal(entry)}" for key, entry in value.items())  # pyright: ignore[reportUnknownVariableType]
        return f"{{{inner}}}"
    if isinstance(value, tuple | list):
        return f"[{', '.join(map(_literal, value))}]"  # pyright: ignore[reportUnknownArgumentType]
    if isinstance(value, float) and value in (float("inf"), float("-inf")):
        return f'float("{value}")'
    return repr(value)
