"""What the command line needs around a computation: progress, interruption, compilation cache."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Generator
from concurrent.futures import Future, wait
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from triboflux.files import discard_partial_files

if TYPE_CHECKING:
    from rich.progress import Progress as RichProgress
    from rich.progress import TaskID

    from triboflux.progress import OutputProgress, Progress
    from triboflux.sweep import SweepProgress

EXIT_INTERRUPTED = 130
_PATIENCE = 1.0
_STACK = 2**26

Outcome = TypeVar("Outcome")


@contextmanager
def interruptible(consequence: str | Callable[[], str]) -> Generator[None, None, None]:
    """Turn Ctrl-C into one line on stderr and exit code 130.

    Parameters
    ----------
    consequence : str or callable
        What the line says about files, or what returns that.
    """
    try:
        yield
    except KeyboardInterrupt as interrupt:
        discard_partial_files()
        told = consequence if isinstance(consequence, str) else consequence()
        print(f"interrupted: {told}", file=sys.stderr, flush=True)
        # JAX may still be computing in other threads, under which an orderly exit pulls the rug
        os._exit(interrupt.args[0] if interrupt.args else EXIT_INTERRUPTED)


class Interruption:
    """Notes that the process was asked to stop, by Ctrl-C or SIGTERM; a context manager.

    Called, it tells whether that is so; whoever calls it promises to save its work and end then.
    Asked once more, or before there is anything to save, the process stops at once, by a
    KeyboardInterrupt whose argument is the exit code.
    """

    def __init__(self) -> None:
        self._awaited = False
        self._before: dict[int, Any] = {}
        self.exit_code: int | None = None

    def __enter__(self) -> Interruption:
        """Take the signals."""
        for number in (signal.SIGINT, signal.SIGTERM):
            self._before[number] = signal.signal(number, self._note)
        return self

    def __exit__(self, *error: object) -> None:
        """Give the signals back."""
        for number, before in self._before.items():
            signal.signal(number, before)

    def __call__(self) -> bool:
        """Return whether the process was asked to stop."""
        self._awaited = True
        return self.exit_code is not None

    def _note(self, number: int, frame: object) -> None:
        at_once = not self._awaited or self.exit_code is not None
        self.exit_code = 128 + number
        if at_once:
            raise KeyboardInterrupt(self.exit_code)
        print(
            "interrupted: finishing the running segment of steps to write a checkpoint; once more "
            "stops at once",
            file=sys.stderr,
            flush=True,
        )


def in_background(work: Callable[[], Outcome]) -> Outcome:
    """Do some work in another thread and wait for it.

    Python runs signal handlers in the main thread between two of its instructions. While that
    thread compiles or computes it has none for seconds, or it has one in a place where JAX drops
    exceptions. A thread that only waits can be interrupted at once.

    Parameters
    ----------
    work : callable
        What to do.

    Returns
    -------
    object
        What ``work`` returns; what it raises is raised here.
    """
    outcome: Future[Outcome] = Future()

    def do() -> None:
        try:
            outcome.set_result(work())
        except BaseException as error:
            outcome.set_exception(error)

    # compilers recurse deeply, and some systems give new threads little stack
    usual = threading.stack_size(_STACK)
    threading.Thread(target=do, daemon=True).start()
    threading.stack_size(usual)
    # in short waits, because some systems deliver no signal during a long one
    while not wait([outcome], timeout=0.1).done:
        pass
    return outcome.result()


class ProgressBar:
    """A bar on stderr with time left and peak charge, shown after a second only.

    Parameters
    ----------
    since : float
        When the work began, on `time.monotonic`'s clock, in seconds.
    """

    def __init__(self, since: float) -> None:
        self._since = since
        self._bar: RichProgress | None = None
        self._task: TaskID | None = None

    def __call__(self, progress: Progress | SweepProgress | OutputProgress) -> None:
        """Show how far a run, a sweep or a conversion is.

        Parameters
        ----------
        progress : Progress, SweepProgress or OutputProgress
            What `solve`, `sweep` or a writer of all output times reports.
        """
        if self._bar is None and time.monotonic() - self._since < _PATIENCE:
            return
        if self._bar is None:
            self._bar = _rich_bar()
            self._bar.start()
        if self._task is None:
            self._task = self._bar.add_task("", total=1.0, peak="")
        self._bar.update(
            self._task,
            completed=progress.fraction,
            peak=self._text(progress),
        )

    def _text(self, progress: Any) -> str:
        """Return what stands beside the bar."""
        return f"t {progress.time:.4g}  peak charge {progress.peak_charge:.4f}"

    def close(self) -> None:
        """Remove the bar from the terminal."""
        if self._bar is not None:
            self._bar.stop()


class MembersBar(ProgressBar):
    """The same for a sweep: how many members are done, and how many of them not well."""

    def _text(self, progress: Any) -> str:
        not_ok = f", {progress.not_ok} not ok" if progress.not_ok else ""
        return f"{progress.done} of {progress.total}{not_ok}"


class OutputsBar(ProgressBar):
    """The same for a result that is converted: how many of its times are written."""

    def _text(self, progress: Any) -> str:
        return f"{progress.done} of {progress.total} times"


def _rich_bar() -> RichProgress:
    """Return an empty bar that vanishes when it stops."""
    from rich import progress
    from rich.console import Console

    return progress.Progress(
        progress.BarColumn(),
        progress.TaskProgressColumn(),
        progress.TimeRemainingColumn(),
        progress.TextColumn("{task.fields[peak]}"),
        console=Console(stderr=True),
        transient=True,
    )


@contextmanager
def progress_bar(
    *, quiet: bool, kind: type[ProgressBar] = ProgressBar
) -> Generator[Callable[[Any], None] | None, None, None]:
    """Give a callback that draws progress, or None where there is nobody to see it.

    Parameters
    ----------
    quiet : bool
        Draw nothing.
    kind : type of ProgressBar
        Which bar.

    Yields
    ------
    callable or None
        For ``solve(..., on_progress=...)`` or ``sweep(..., on_progress=...)``.
    """
    if quiet or not sys.stderr.isatty():
        yield None
        return
    bar = kind(since=time.monotonic())
    try:
        yield bar
    finally:
        bar.close()


def cache_folder() -> Path | None:
    """Return the folder for compiled programs, or None if they shall not be kept.

    ``TRIBOFLUX_CACHE_DIR`` names it, or says ``off``; otherwise it is the platform's folder for
    caches.
    """
    chosen = os.environ.get("TRIBOFLUX_CACHE_DIR")
    if chosen:
        return None if chosen.lower() == "off" else Path(chosen)
    if os.name == "nt":
        base = os.environ.get("LOCALAPPDATA") or str(Path.home() / "AppData" / "Local")
    else:
        base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "triboflux" / "jax"


def use_compilation_cache() -> None:
    """Let JAX keep its compiled programs on disk, if a folder can be had.

    To be called before anything imports Equinox.

    A run without the cache is only slower, so failing to get one is no error. Whoever has told JAX
    itself where to keep them (``JAX_COMPILATION_CACHE_DIR``) is obeyed.
    """
    # JAX keeps no program that calls back into Python, as Equinox's run-time checks do by default.
    # Those that the solver contains guard times and tolerances, which a `Case` has validated.
    os.environ.setdefault("EQX_ON_ERROR", "nan")
    if "JAX_COMPILATION_CACHE_DIR" in os.environ and "TRIBOFLUX_CACHE_DIR" not in os.environ:
        return
    try:
        folder = cache_folder()
        if folder is None:
            return
        folder.mkdir(parents=True, exist_ok=True)
        if not os.access(folder, os.W_OK | os.X_OK):
            return
    except (OSError, RuntimeError):  # RuntimeError: no home folder
        return
    import jax

    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
    # a disk that fills up while the run goes on shall not disturb its output
    warnings.filterwarnings("ignore", message="Error (reading|writing) persistent compilation")
