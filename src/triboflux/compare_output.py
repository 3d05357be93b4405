"""A comparison of models as a table, JSON or CSV, and as files."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from triboflux import case_checks
from triboflux.case import Case
from triboflux.compare import compare, require_models, with_changes
from triboflux.comparison import FIELDS, RelativeErrors
from triboflux.errors import InputError, require_one_of, shown_path
from triboflux.files import require_folder, require_writable, written_at_once
from triboflux.initial_state import require_file
from triboflux.memory import require_memory
from triboflux.tables import WIDE
from triboflux.terminal import in_background, interruptible, progress_bar, use_compilation_cache

if TYPE_CHECKING:
    from triboflux.comparison import Comparison, ComparisonRow

FORMATS = ("table", "json", "csv")
SUFFIXES = (".png", ".pdf", ".nc")
"""Endings of the files that a comparison is written to."""

_MISSING = "-"


@dataclasses.dataclass(frozen=True)
class Options:
    """What the command line says besides the case.

    Attributes
    ----------
    models : str
        Names with commas between them.
    output : pathlib.Path
        As in `output_paths`.
    closures : str or None
        Closure set in place of the case's own.
    units : str
        ``"scaled"`` or ``"si"``.
    form : str
        One of `FORMATS`.
    overwrite : bool
        Replace existing files.
    quiet : bool
        No progress, warnings and names of files.
    """

    models: str
    output: Path
    closures: str | None
    units: str
    form: str
    overwrite: bool
    quiet: bool


def command(case_file: Path, options: Options) -> bool:
    """Compare models in the background, write the files, and print the table on stdout.

    Parameters
    ----------
    case_file : pathlib.Path
        The case.
    options : Options
        What to do with it.

    Returns
    -------
    bool
        Whether all models ended well.

    Raises
    ------
    InputError
        If anything is not allowed, before JAX is imported where that can be known.
    TribofluxError
        If no model's run ended well, or a file can't be written.
    """
    bar = progress_bar(quiet=options.quiet)
    with interruptible("nothing was written"):
        require_one_of("format", options.form, FORMATS)
        models = [name.strip() for name in options.models.split(",")]
        names = require_models([name for name in models if name])
        case = _case(case_file, options)
        paths = output_paths(
            options.output, f"{case_file.stem}_models", overwrite=options.overwrite
        )
        _require_start(case, paths)
        require_memory(case)
        with bar as on_progress:

            def work() -> Comparison:
                use_compilation_cache()
                found = compare(case, names, on_progress=on_progress)
                found = found.to_si() if options.units == "si" else found
                write_files(found, paths, overwrite=options.overwrite)
                return found

            comparison = in_background(work)
        sys.stdout.write(text(comparison, options.form))
    if not options.quiet:
        for warning in comparison.warnings:
            print(f"warning: {warning}", file=sys.stderr)
        for path in paths:
            print(f"written: {shown_path(path)}", file=sys.stderr)
    return all(row.status == "ok" for row in comparison.rows)


def _case(case_file: Path, options: Options) -> Case:
    """Return the case with the closures asked for, if it has scales for the units asked for."""
    case = Case.from_toml(case_file)
    if options.closures is not None:
        case = with_changes(case, closures=options.closures)
    case_checks.check_units(case, options.units)
    return case


def _require_start(case: Case, paths: Sequence[Path]) -> None:
    """Refuse a case whose initial file is missing or would be replaced."""
    require_file(case)
    start = case.initial.file
    if start is not None and any(path.exists() and path.samefile(start) for path in paths):
        raise InputError(f"output {shown_path(start)} is the case's own initial.file.")


def output_paths(output: Path, stem: str, *, overwrite: bool) -> list[Path]:
    """Return where a comparison is to be written, having checked that it can be.

    Parameters
    ----------
    output : pathlib.Path
        A folder, made by `write_files` if absent; or a file with one of `SUFFIXES`, whose name the
        others get with their own endings.
    stem : str
        Name of the files in a folder.
    overwrite : bool
        Accept existing files.

    Returns
    -------
    list of pathlib.Path
        One for each of `SUFFIXES`.

    Raises
    ------
    InputError
        If the path is neither, its folder is missing, or a file exists.
    """
    try:
        is_folder = output.is_dir() or not output.suffix
        if not is_folder and output.suffix not in SUFFIXES:
            raise InputError.about(
                "output",
                f"is {shown_path(output)}, but must be a folder or end in {', '.join(SUFFIXES)}",
            )
        folder, name = (output, stem) if is_folder else (output.parent, output.stem)
        paths = [folder / f"{name}{suffix}" for suffix in SUFFIXES]
        if not folder.exists() and is_folder:
            require_folder(folder.parent)
            return paths
    except OSError:
        raise InputError(f"output {shown_path(output)} is no possible file name.") from None
    for path in paths:
        require_writable(path, overwrite=overwrite)
    return paths


def write_files(comparison: Comparison, paths: Sequence[Path], *, overwrite: bool) -> None:
    """Write the figure as PNG and PDF and the data as NetCDF, all of them or none.

    Parameters
    ----------
    comparison : Comparison
        What to write.
    paths : sequence of pathlib.Path
        From `output_paths`.
    overwrite : bool
        Replace existing files.

    Raises
    ------
    InputError
        If a file exists by now.
    TribofluxError
        If writing fails.
    """
    from triboflux.compare_figure import compare_figure
    from triboflux.figures.style import save

    figure = compare_figure(comparison)
    folder = paths[0].parent
    made = not folder.exists()
    if made:
        folder.mkdir()
    try:
        with ExitStack() as stack:
            for path in paths:
                # the files get their names together, when all of them are complete
                partial = stack.enter_context(written_at_once(path, overwrite=overwrite))
                if path.suffix == ".nc":
                    comparison.to_netcdf(partial)
                else:
                    save(figure, partial)
    except BaseException:
        if made:
            folder.rmdir()
        raise


def text(comparison: Comparison, form: str) -> str:
    """Return the table of a comparison as text.

    Parameters
    ----------
    comparison : Comparison
        What to tell.
    form : str
        One of `FORMATS`.

    Raises
    ------
    InputError
        If the format is unknown.
    """
    require_one_of("format", form, FORMATS)
    return {"table": as_table, "json": as_json, "csv": as_csv}[form](comparison)


def as_json(comparison: Comparison) -> str:
    """Return the table as JSON with numbers in full precision; null stands for what is missing."""
    rows: list[dict[str, Any]] = []
    for row in comparison.rows:
        record = dataclasses.asdict(row)
        errors = row.errors or {}
        record["errors"] = {
            name: None if found is None else {"max": found.largest, "L2": found.rms}
            for name, found in ((name, errors.get(name)) for name in FIELDS)
        }
        rows.append(record)
    document = {
        "title": comparison.case.title,
        "closures": comparison.case.closures,
        "reference": comparison.reference,
        "time": comparison.time,
        "units": comparison.units,
        "models": rows,
    }
    return json.dumps(document, indent=2, allow_nan=False) + "\n"


def as_csv(comparison: Comparison) -> str:
    """Return the table as comma-separated values with a header; what is missing is empty."""
    given = {
        "reference": comparison.reference,
        "time": comparison.time,
        "units": comparison.units,
    }
    records: list[dict[str, Any]] = []
    for row in comparison.rows:
        record = dataclasses.asdict(row)
        del record["errors"]
        for name in FIELDS:
            found = (row.errors or {}).get(name) or RelativeErrors(None, None)
            record |= {f"{name}_error_max": found.largest, f"{name}_error_L2": found.rms}
        records.append(given | record)
    file = io.StringIO()
    writer = csv.DictWriter(file, list(records[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(records)
    return file.getvalue()


def as_table(comparison: Comparison) -> str:
    """Return how the runs ended and, below it, the errors, for 80 columns."""
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    file = io.StringIO()
    # a number that is cut off is worth nothing, so a narrow terminal breaks the lines itself
    console = Console(file=file, width=WIDE, highlight=False, markup=False, emoji=False)

    def table(heads: Sequence[str], rows: Sequence[Sequence[str]], texts: int) -> None:
        drawn = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, collapse_padding=True)
        for number, head in enumerate(heads):
            justify = "left" if number < texts else "right"
            drawn.add_column(Text(head), justify=justify, no_wrap=True)
        for row in rows:
            drawn.add_row(*map(Text, row))
        console.print(drawn)

    si = comparison.units == "si"
    second, coulomb = (" (s)", " (C)") if si else ("", "")
    time = f"t = {_time(comparison.time)}{' s' if si else ''}"
    closures = f"{comparison.case.closures} closures"
    title = comparison.case.title
    console.print(Text(f"{title}; {closures}\n" if title else f"{closures.capitalize()}\n"))
    heads = ("model", "status", f"t*{second}", f"peak charge{coulomb}", "seconds", "steps")
    table(heads, [_ending(row, comparison) for row in comparison.rows], 2)
    console.print(
        Text(
            "\nt*: when a stop rule ended the model's own run, to which seconds (without\n"
            f"compilation) and steps (+ rejected ones) belong; peak charge at {time}.\n"
        )
    )
    console.print(
        Text(f"Relative error at {time}, against {comparison.reference} at the same time\n")
    )
    heads = ("model", *(f"{name} {norm}" for name in _SHORT_NAMES for norm in ("max", "L2")))
    others = [row for row in comparison.rows if row.model != comparison.reference]
    table(heads, [_error_cells(row) for row in others], 1)
    for sentence in _notes(comparison):
        console.print(Text(sentence))
    return file.getvalue()


_SHORT_NAMES = ("Q", "E", "C", "V")
"""Symbols of `FIELDS` in the same order."""


def _ending(row: ComparisonRow, comparison: Comparison) -> list[str]:
    """Return the cells of the first table."""
    stops = comparison.case.run.stop_at_peak_charge, comparison.case.run.stop_at_rate
    stop = _MISSING if row.stop_time is None else _time(row.stop_time)
    if row.stop_time is None and row.status == "ok" and stops != (None, None):
        stop = f"> {_number(row.end_time)}"
    steps = _MISSING if row.steps is None else f"{row.steps}+{row.rejected}"
    seconds = _MISSING if row.seconds is None else f"{row.seconds:.3f}"
    return [row.model, row.status, stop, _number(row.peak_charge), seconds, steps]


def _error_cells(row: ComparisonRow) -> list[str]:
    """Return the cells of the table of errors."""
    found = [(row.errors or {}).get(name) or RelativeErrors(None, None) for name in FIELDS]
    errors = [error for pair in found for error in pair]
    return [row.model, *(_MISSING if error is None else _short(error) for error in errors)]


def _notes(comparison: Comparison) -> list[str]:
    """Return sentences about the symbols and about the models that failed."""
    notes = [
        "\nQ charge, E field, C covariance, V variance; max: largest deviation over the\n"
        "largest value, L2: the same of root mean squares; -: the model has none."
    ]
    scaled = " (scaled)" if comparison.units == "si" else ""
    for row in comparison.rows:
        if row.status != "ok" or "; run on" in row.reason:
            notes.append(f"{row.model}, {row.status}{scaled}: {row.reason}".rstrip(".") + ".")
    return notes


def _number(value: float | None) -> str:
    return _MISSING if value is None else f"{value:.6g}"


def _time(value: float) -> str:
    return f"{value:#.6g}".rstrip(".")


def _short(error: float) -> str:
    """Return two digits in at most six characters."""
    if 0.01 <= error < 100.0:
        return f"{error:#.2g}".rstrip(".")
    return f"{error:.1e}".replace("e-0", "e-").replace("e+0", "e+") if error else "0"
