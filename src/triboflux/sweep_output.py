"""What the command ``sweep`` shows."""

from __future__ import annotations

from pathlib import Path

from triboflux.errors import shown_path
from triboflux.sweep import Sweep, SweepProgress, sweep
from triboflux.terminal import MembersBar, in_background, interruptible, progress_bar


def command(
    sweep_file: Path,
    store: Path,
    *,
    workers: int | None,
    scheduler: str | None,
    retry: bool,
    quiet: bool,
) -> bool:
    """Run a sweep under a progress bar and print a summary.

    Parameters
    ----------
    sweep_file : pathlib.Path
        Its TOML file.
    store : pathlib.Path
        Its store.
    workers, scheduler, retry
        As in `triboflux.sweep.sweep`.
    quiet : bool
        Draw and print nothing.

    Returns
    -------
    bool
        Whether every member is ok.
    """
    kept = f"what is finished is kept in {shown_path(store)}; the same command goes on from there"
    with interruptible(kept):
        members = Sweep.from_toml(sweep_file)
        with progress_bar(quiet=quiet, kind=MembersBar) as draw:
            last: list[SweepProgress] = []

            def on_progress(progress: SweepProgress) -> None:
                last[:] = [progress]
                if draw is not None:
                    draw(progress)

            dataset = in_background(
                lambda: sweep(
                    members,
                    store,
                    workers=workers,
                    scheduler=scheduler,
                    retry=retry,
                    on_progress=on_progress,
                )
            )
        status = [str(text) for text in dataset["status"].values.ravel()]
    if not quiet:
        counts = {text: status.count(text) for text in sorted(set(status), key=_place)}
        told = ", ".join(f"{count} {text}" for text, count in counts.items())
        done = "" if last else "nothing was missing; "
        print(f"{len(status)} members: {told}; {done}written to {shown_path(store)}")
    return all(text == "ok" for text in status)


def _place(status: str) -> tuple[bool, str]:
    """Sort ok first."""
    return status != "ok", status
