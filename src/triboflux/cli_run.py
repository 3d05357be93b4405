"""The commands that run one case: with a transport model, and with simulated particles."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from triboflux.cli_options import EXIT_NOT_OK, EXIT_REFUSED, Overwrite, Quiet
from triboflux.errors import InputError, shown_path

# everything else is imported inside the commands, so that help and refusals come at once
if TYPE_CHECKING:
    from triboflux.case import Case
    from triboflux.result import Result

commands = typer.Typer()

CaseFile = Annotated[Path, typer.Argument(metavar="CASE.toml", help="The case to run.")]
Output = Annotated[
    Path, typer.Option("--output", "-o", metavar="OUT.nc", help="NetCDF file to write.")
]
Units = Annotated[str, typer.Option(metavar="scaled|si", help="Units of the fields in the result.")]
Resume = Annotated[bool, typer.Option("--resume", help="Go on from the checkpoint of this output.")]
CheckpointMinutes = Annotated[
    float, typer.Option(metavar="M", help="Minutes between two checkpoints.")
]
CheckpointSteps = Annotated[
    int | None, typer.Option(metavar="N", help="Steps between two checkpoints, besides.")
]


@dataclass(frozen=True)
class _Options:
    """What both commands hand to the functions that write a file."""

    units: str
    overwrite: bool
    resume: bool
    checkpoint_minutes: float
    checkpoint_steps: int | None


@commands.command(epilog="Example: triboflux run case.toml -o result.nc --overwrite")
def run(
    case_file: CaseFile,
    output: Output,
    units: Units = "scaled",
    resume: Resume = False,
    checkpoint_minutes: CheckpointMinutes = 5.0,
    checkpoint_steps: CheckpointSteps = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Run one case and write its result.

    A run that is interrupted or fails leaves OUT.nc.checkpoint, from which --resume goes on.

    Exit code 0: the run ended well. 1: refused or failed. 2: wrong usage. 3: the result is written,
    but its status is not ok. 130, 143: interrupted by Ctrl-C, terminated.
    """
    from triboflux.memory import require_memory

    def check(case: Case) -> None:
        require_memory(case, streamed=True)

    def compute(*args: Any, **choices: Any) -> Result:
        from triboflux.terminal import use_compilation_cache

        use_compilation_cache()
        from triboflux.solve import solve_to_file

        return solve_to_file(*args, **choices)

    options = _Options(units, overwrite, resume, checkpoint_minutes, checkpoint_steps)
    _run(case_file, output, options, check, compute, quiet=quiet)


@commands.command(epilog="Example: triboflux kinetic examples/particles.toml -o particles.nc")
def kinetic(
    case_file: CaseFile,
    output: Output,
    units: Units = "scaled",
    workers: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Threads; one per core if absent.")
    ] = None,
    resume: Resume = False,
    checkpoint_minutes: CheckpointMinutes = 5.0,
    checkpoint_steps: CheckpointSteps = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Simulate the particles of one case and write the moments with their standard errors.

    The table [kinetic] of the case says how many particles there are and what is held fixed. A
    simulation that is interrupted or fails leaves OUT.nc.checkpoint, from which --resume goes on.

    Exit codes are those of run.
    """
    from triboflux.memory import require_memory_for_particles

    def check(case: Case) -> None:
        require_memory_for_particles(case)

    def compute(*args: Any, **choices: Any) -> Result:
        from triboflux.kinetic.simulation import simulate_to_file

        return simulate_to_file(*args, workers=workers, **choices)

    options = _Options(units, overwrite, resume, checkpoint_minutes, checkpoint_steps)
    _run(case_file, output, options, check, compute, quiet=quiet)


def _run(
    case_file: Path,
    output: Path,
    options: _Options,
    check: Callable[[Case], None],
    compute: Callable[..., Result],
    *,
    quiet: bool,
) -> None:
    """Read a case, refuse what can be refused at once, compute in the background and report."""
    from triboflux import case_checks
    from triboflux.case import Case
    from triboflux.checkpoint import InterruptionError, Schedule, path_beside
    from triboflux.files import require_writable
    from triboflux.initial_state import require_file
    from triboflux.terminal import Interruption, in_background, interruptible, progress_bar

    kept = path_beside(output)

    def consequence() -> str:
        return f"{shown_path(kept)} stays" if kept.exists() else "nothing was written"

    with Interruption() as interruption, interruptible(consequence):
        case = Case.from_toml(case_file)
        case_checks.check_units(case, options.units)
        require_writable(output, overwrite=options.overwrite)
        if output.exists() and output.samefile(case_file):
            raise InputError(f"output {shown_path(output)} is the case file itself.")
        Schedule(options.checkpoint_minutes, options.checkpoint_steps)
        require_file(case)
        check(case)
        if options.resume and not kept.exists() and not quiet:
            print("note: there is no checkpoint, the run begins at its start", file=sys.stderr)
        with progress_bar(quiet=quiet) as on_progress:

            def work() -> Result:
                watching = {"on_progress": on_progress, "interrupted": interruption}
                return compute(case, output, **asdict(options), **watching)

            try:
                result = in_background(work)
            except InterruptionError as error:
                print(f"interrupted: {error}", file=sys.stderr)
                raise typer.Exit(interruption.exit_code or EXIT_REFUSED) from None
    if not quiet:
        _report(result, output)
    if result.status != "ok":
        raise typer.Exit(EXIT_NOT_OK)


def _report(result: Result, output: Path) -> None:
    """Print how a run ended, and its warnings."""
    si = result.units == "si"
    # the sentences of a run speak of scaled values
    scaled = " (scaled)" if si else ""
    for warning in result.warnings:
        print(f"warning{scaled}: {warning}", file=sys.stderr)
    stats, dataset = result.stats, result.dataset
    time_unit, charge_unit = (" s", " C") if si else ("", "")
    if "collisions" in stats:
        cost = f"steps {stats['steps']}, collisions {stats['collisions']:.4g}"
    else:
        cost = f"steps {stats.get('accepted')} accepted and {stats.get('rejected')} rejected"
    print(
        f"{result.status}: {result.stop_reason}{scaled}; "
        f"t = {float(dataset['time'][-1]):.7g}{time_unit}, "
        f"peak charge {float(dataset['peak_charge'][-1]):.7g}{charge_unit}, "
        f"{cost}; written to {shown_path(output)}"
    )
