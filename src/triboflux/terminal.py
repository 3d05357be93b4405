"""What the command line needs around a computation: progress, interruption, compilation cache."""

from __future__ import annotations

import os
import sys
import time
import warnings
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress as RichProgress
    from rich.progress import TaskID

    from triboflux.solve import Progress

EXIT_INTERRUPTED = 130
_PATIENCE = 1.0


@contextmanager
def interruptible() -> Generator[None, None, None]:
    """Turn Ctrl-C into one line on stderr and exit code 130."""
    try:
        yield
    except KeyboardInterrupt:
        print("interrupted: nothing was written", file=sys.stderr)
        raise SystemExit(EXIT_INTERRUPTED) from None


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

    def __call__(self, progress: Progress) -> None:
        """Show how far a run is.

        Parameters
        ----------
        progress : triboflux.solve.Progress
            What `solve` reports.
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
            peak=f"t {progress.time:.4g}  peak charge {progress.peak_charge:.4f}",
        )

    def close(self) -> None:
        """Remove the bar from the terminal."""
        if self._bar is not None:
            self._bar.stop()


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
def progress_bar(*, quiet: bool) -> Generator[Callable[[Progress], None] | None, None, None]:
    """Give a callback that draws progress, or None where there is nobody to see it.

    Parameters
    ----------
    quiet : bool
        Draw nothing.

    Yields
    ------
    callable or None
        For ``solve(..., on_progress=...)``.
    """
    if quiet or not sys.stderr.isatty():
        yield None
        return
    bar = ProgressBar(since=time.monotonic())
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

    A run without the cache is only slower, so failing to get one is no error. Whoever has told JAX
    itself where to keep them (``JAX_COMPILATION_CACHE_DIR``) is obeyed.
    """
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
