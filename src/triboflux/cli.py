"""The command line: thin commands around the public functions."""

from __future__ import annotations

import io
import platform
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from triboflux import __version__, cli_convert, cli_explore, cli_many, cli_run
from triboflux.cli_options import EXIT_NOT_OK, EXIT_REFUSED, Overwrite, Quiet, Workers
from triboflux.errors import InputError, TribofluxError, require_one_of, shown_path

# everything else is imported inside the commands, so that help and refusals come at once
if TYPE_CHECKING:
    from triboflux.assessment import Assessment
    from triboflux.figures import Reproduction

app = typer.Typer(
    name="triboflux",
    help="Electric charge of particles in gas-solid flow: moment equations on periodic boxes.",
    epilog="Example: triboflux run case.toml -o result.nc",
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def main() -> None:
    """Run the command line and end the process with its exit code."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        # a terminal without the needed letters gets escapes instead of a crash
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        app(prog_name="triboflux")
    except TribofluxError as error:
        _fail(str(error), EXIT_REFUSED)
    except MemoryError:
        _fail("the memory of this machine is too small for this.", EXIT_REFUSED)


def _fail(sentence: str, code: int) -> NoReturn:
    print(f"error: {sentence}", file=sys.stderr)
    sys.exit(code)


app.add_typer(cli_run.commands)
app.add_typer(cli_many.commands)
app.add_typer(cli_convert.commands)
app.add_typer(cli_explore.commands)


@app.callback(invoke_without_command=True)
def about(
    version: Annotated[bool, typer.Option("--version", help="Print the version and stop.")] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", help="With --version: all versions and devices.")
    ] = False,
) -> None:
    """Print versions, for instance for a bug report."""
    if not version:
        return
    print(f"triboflux {__version__}")
    if verbose:
        import jax

        from triboflux.dataset import versions

        for package, number in versions().items():
            if package != "triboflux":
                print(f"{package} {number}")
        print(f"platform {platform.platform()}")
        print(f"devices {', '.join(str(device) for device in jax.devices())}")
    raise typer.Exit


@app.command(epilog="Example: triboflux numbers examples/polyethylene.toml")
def numbers(
    suspension_file: Annotated[
        Path,
        typer.Argument(
            metavar="SUSPENSION.toml", help="A file with a table [suspension], such as a case."
        ),
    ],
    closures: Annotated[
        str | None,
        typer.Option(
            metavar="derived|published|complete",
            help="Closure set; otherwise the file's, or derived.",
        ),
    ] = None,
    compute: Annotated[
        bool,
        typer.Option("--compute", help="Run all models for their errors, instead of the table."),
    ] = False,
    form: Annotated[
        str, typer.Option("--format", metavar="table|json|toml", help="How to print.")
    ] = "table",
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="With tables: no reasons and warnings.")
    ] = False,
) -> None:
    """Print coefficients in SI, the seven numbers, the regime and the model that suits.

    The model is the cheapest whose error is within 5 %, by a table that comes with the program or,
    with --compute, by runs of all models that take some seconds.
    """
    from triboflux import assessment_text
    from triboflux.assessment import assess
    from triboflux.suspension import read_suspension_file
    from triboflux.terminal import in_background, interruptible, use_compilation_cache

    require_one_of("format", form, assessment_text.FORMATS)
    suspension, usual = read_suspension_file(suspension_file)

    def work() -> Assessment:
        if compute:
            use_compilation_cache()
        return assess(suspension, closures or usual, compute=compute)

    with interruptible("nothing was printed"):
        found = in_background(work) if compute else work()
    assessment_text.write(
        found, suspension, form, sys.stdout, closures=closures or usual, sentences=not quiet
    )


@app.command(epilog="Example: triboflux export examples/polyethylene.toml --language c -o charge.h")
def export(
    suspension_file: Annotated[
        Path,
        typer.Argument(
            metavar="SUSPENSION.toml", help="A file with a table [suspension], such as a case."
        ),
    ],
    language: Annotated[
        str, typer.Option(metavar="c|fortran|openfoam", help="Language of the source code.")
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="File to write; otherwise printed."),
    ] = None,
    closures: Annotated[
        str | None,
        typer.Option(
            metavar="derived|published|complete",
            help="Closure set; otherwise the file's, or derived.",
        ),
    ] = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Write the closed coefficients as source code for a CFD program."""
    from triboflux.files import require_writable, written_at_once
    from triboflux.suspension import read_suspension_file

    suspension, usual = read_suspension_file(suspension_file)
    if output is not None:
        require_writable(output, overwrite=overwrite)
        if output.exists() and output.samefile(suspension_file):
            raise InputError(f"output {shown_path(output)} is the suspension's own file.")
    from triboflux.export import export as exported  # imports SymPy

    text = exported(suspension, language, closures or usual)
    if output is None:
        sys.stdout.write(text)
        return
    with written_at_once(output, overwrite=overwrite) as partial:
        partial.write_text(text, encoding="ascii")
    if not quiet:
        print(f"written to {shown_path(output)}")


@app.command(epilog="Example: triboflux reproduce --figure 2 -o figures")
def reproduce(
    folder: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="DIR", help="Folder, made if absent."),
    ],
    figure: Annotated[
        int | None, typer.Option(min=1, max=9, help="Number of the paper's figure; all if absent.")
    ] = None,
    workers: Workers = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Reproduce figures of the paper, with the results behind them.

    Without --figure also summary.md and summary.html, which set what the paper says of each figure
    beside what was measured.
    """
    from triboflux.files import require_folder
    from triboflux.terminal import interruptible

    with interruptible("finished figures are kept, nothing else was written"):
        if not folder.exists():
            require_folder(folder.parent)
            folder.mkdir()
        require_folder(folder)
        from triboflux import figures  # imports Matplotlib

        numbers = None if figure is None else [figure]
        reproduction = figures.Reproduction(folder, numbers, overwrite=overwrite, workers=workers)
        for number in reproduction.numbers:
            paths = _reproduce(reproduction, number, quiet=quiet)
            for path in () if quiet else paths:
                print(path)
        if figure is None:
            for path in reproduction.write_summary():
                if not quiet:
                    print(path)


def _reproduce(reproduction: Reproduction, number: int, *, quiet: bool) -> list[Path]:
    """Write one figure in the background and return its files."""
    from triboflux.figures import MAP
    from triboflux.terminal import (
        MembersBar,
        ProgressBar,
        in_background,
        progress_bar,
        use_compilation_cache,
    )

    kind = MembersBar if number == MAP else ProgressBar
    with progress_bar(quiet=quiet, kind=kind) as on_progress:

        def work() -> list[Path]:
            use_compilation_cache()
            return reproduction.write(number, on_progress)

        return in_background(work)


@app.command(epilog="Example: triboflux compare case.toml --models full,gradient -o figures")
def compare(
    case_file: Annotated[Path, typer.Argument(metavar="CASE.toml", help="The case to run.")],
    models: Annotated[
        str, typer.Option(metavar="A,B,...", help="Models, whatever the case's own is.")
    ] = "full,semi-algebraic,gradient",
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="DIR|FILE",
            help="Folder, made if absent, for CASE_models.png, .pdf and .nc; or one of the files.",
        ),
    ] = Path(),
    closures: Annotated[
        str | None,
        typer.Option(
            metavar="derived|published|complete", help="Closure set; the case's own if absent."
        ),
    ] = None,
    units: Annotated[
        str, typer.Option(metavar="scaled|si", help="Units of the table, figure and data.")
    ] = "scaled",
    form: Annotated[
        str, typer.Option("--format", metavar="table|json|csv", help="How to print the table.")
    ] = "table",
    overwrite: Overwrite = False,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="No progress, warnings and names of files.")
    ] = False,
) -> None:
    """Run a case with several models: a table of their errors and cost, and a figure.

    Errors are relative to the most complete model, at its last time. Exit code 0: all models ended
    well. 1: refused, nothing written. 2: wrong usage. 3: all is written, but some model did not end
    well. 130: interrupted, nothing written.
    """
    from triboflux.compare_output import Options, command

    options = Options(models, output, closures, units, form, overwrite, quiet)
    if not command(case_file, options):
        raise typer.Exit(EXIT_NOT_OK)


@app.command(epilog="Example: triboflux closures --restitution 0.9 --format csv > closures.csv")
def closures(
    restitution: Annotated[
        float, typer.Option(metavar="E", help="Restitution coefficient, from 0 to 1.")
    ] = 1.0,
    exponent: Annotated[
        float, typer.Option(metavar="A", help="Exponent of the charge transfer; 0.8 is Hertz's.")
    ] = 0.8,
    form: Annotated[
        str, typer.Option("--format", metavar="FORMAT", help="table, json, csv or latex.")
    ] = "table",
    samples: Annotated[
        int | None,
        typer.Option(metavar="N", help="Sample N collisions and show what they give, too."),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Compare the exact closure coefficients with those that the paper prints."""
    from triboflux import audit, tables
    from triboflux.terminal import interruptible

    require_one_of("format", form, tables.FORMATS)
    bar = tables.sampling_bar(quiet=quiet or samples is None)
    with interruptible("nothing was printed"), bar as on_progress:
        rows = audit.audit(restitution, exponent, samples=samples, on_progress=on_progress)
    tables.write(rows, form, sys.stdout, restitution=restitution, exponent=exponent)


if __name__ == "__main__":
    main()
