"""Keeping what a run computes: checkpoints when they are due, and where to go on from."""

from __future__ import annotations

import time as clock
import uuid
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np

from triboflux import checkpoint
from triboflux.checkpoint import Checkpoint, InterruptionError, Schedule
from triboflux.errors import InputError, TribofluxError, shown_path
from triboflux.files import locked, mark_kept, mark_partial
from triboflux.record_file import RecordFile

if TYPE_CHECKING:
    from triboflux.case import Case


@runtime_checkable
class Records(Protocol):
    """Where outputs go: a list, or a `triboflux.record_file.RecordFile`."""

    def append(self, record: Any, /) -> None:
        """Take the next output: arrays of doubles by their names, the time among them."""
        ...

    def __len__(self) -> int:
        """Return how many there are."""
        ...

    def __getitem__(self, index: Any, /) -> Mapping[str, np.ndarray]:
        """Return one of them."""
        ...


@runtime_checkable
class Position(Protocol):
    """Where a run stands; it is replaced, not changed, when the run goes on."""

    @property
    def steps(self) -> int:
        """Of time, so far."""
        ...

    @property
    def time(self) -> float:
        """Scaled by L/√Θ."""
        ...

    @property
    def recorded(self) -> int:
        """Outputs so far."""
        ...


@runtime_checkable
class Segments(Protocol):
    """A run that is made segment by segment."""

    @property
    def position(self) -> Position:
        """Where it stands."""
        ...

    def layout(self) -> dict[str, tuple[int, ...]]:
        """Return the shape of every array of an output."""
        ...

    def stored(self) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Return all that is needed to go on, as arrays and as what JSON can express."""
        ...

    def restore(self, arrays: Mapping[str, np.ndarray], numbers: Mapping[str, Any]) -> None:
        """Take what was stored; raise an InputError or what a wrong type or key raises."""
        ...


class Keeper:
    """Does not keep anything: the outputs of a run are in memory, and it can't be resumed."""

    def __init__(self) -> None:
        self._records: Any = []
        self._begun = clock.perf_counter()

    def __enter__(self) -> Keeper:
        """Return itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Do nothing."""

    @property
    def records(self) -> Records:
        """The outputs so far."""
        return self._records

    @property
    def seconds(self) -> float:
        """Time that the run has taken so far, interruptions not counted."""
        return clock.perf_counter() - self._begun

    def take(self, segments: Segments) -> None:
        """Begin to keep a run, or put it where it was interrupted."""

    def consider(self) -> None:
        """Write a checkpoint if it is due, or if the run is asked to stop."""


class FileKeeper(Keeper):
    """Keeps a run in a checkpoint and a file of records beside it; a context manager.

    Parameters
    ----------
    path : path-like
        The checkpoint.
    case : Case
        What is run.
    kind : str
        Of the checkpoint, such as ``"solve"``.
    versions : mapping of str to str
        Of the packages that decide the digits of the result.
    name : str
        How to call the run's output in sentences.
    resume : bool
        Go on from the checkpoint if there is one.
    overwrite : bool
        Discard a checkpoint that is not to be resumed.
    schedule : Schedule
        When to write one.
    interrupted : callable, optional
        Asked after every segment whether to stop.

    Raises
    ------
    InputError
        If there is a checkpoint and it is neither resumed nor discarded, if it can't be resumed,
        or if another process writes it.
    TribofluxError
        If writing fails.
    """

    def __init__(
        self,
        path: str | PathLike[str],
        case: Case,
        *,
        kind: str,
        versions: Mapping[str, str],
        name: str,
        resume: bool,
        overwrite: bool,
        schedule: Schedule,
        interrupted: Callable[[], bool] | None,
    ) -> None:
        super().__init__()
        self._path, self._case, self._name = Path(path), case, name
        self._kind, self._versions = kind, versions
        self._resume, self._overwrite, self._schedule = resume, overwrite, schedule
        self._interrupted = interrupted
        self._segments: Segments | None = None
        self._before = 0.0
        self._kept_position: Position | None = None
        self._run = uuid.uuid4().hex
        self._outputs = self._path.with_name(f"{self._path.name}.outputs")
        self._opened = ExitStack()

    def __enter__(self) -> FileKeeper:
        """Lock the checkpoint."""
        with ExitStack() as opened:
            opened.enter_context(locked(self._path, self._name))
            if self._path.exists() and not self._resume and not self._overwrite:
                raise InputError(
                    f"checkpoint {shown_path(self._path)} of an unfinished run exists: continue it "
                    "with --resume (resume=True in Python), or start anew with --overwrite or by "
                    "removing it."
                )
            self._opened = opened.pop_all()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Remove everything after success, and keep everything after anything else."""
        with self._opened:
            if error is None:
                checkpoint.remove(self._path)
                self._records.remove()
                return
            if self._segments is None:
                return
            if self._segments.position is not self._kept_position:
                # what has happened is told, even if this fails for the same reason
                with suppress(TribofluxError, OSError):
                    self._save()
            if not self._path.exists():
                self._records.remove()
            elif isinstance(error, TribofluxError) and not isinstance(error, InterruptionError):
                raise type(error)(f"{str(error).rstrip('.')}; {self._kept()}.") from error

    @property
    def seconds(self) -> float:
        """Time that the run has taken so far, interruptions not counted."""
        return self._before + super().seconds

    def take(self, segments: Segments) -> None:
        """Begin to keep a run, or put it where it was interrupted."""
        if self._resume and self._path.exists():
            self._restore(segments)
        else:
            checkpoint.remove(self._path)
            self._open_records(segments, None)
            self._kept_position = segments.position
        self._segments = segments

    def consider(self) -> None:
        """Write a checkpoint if it is due, or if the run is asked to stop."""
        assert self._segments is not None
        self.consider_stopping()
        if self._schedule.due(self._segments.position.steps):
            self._save()

    def consider_stopping(self) -> None:
        """Write a checkpoint and raise InterruptionError if the run is asked to stop."""
        if self._interrupted is not None and self._interrupted():
            self._save()
            raise InterruptionError(f"{self._kept()}.")

    def _restore(self, segments: Segments) -> None:
        found = checkpoint.read(
            self._path,
            kind=self._kind,
            case_toml=self._case.to_toml(),
            versions=self._versions,
        )
        try:
            segments.restore(found.arrays, found.metadata)
            self._run = str(found.metadata["run"])
            self._before = float(found.metadata["seconds"])
        except (LookupError, TypeError, ValueError) as error:
            raise InputError(
                f"checkpoint {shown_path(self._path)} is damaged: it does not fit its case."
            ) from error
        self._open_records(segments, segments.position.recorded)
        self._kept_position = segments.position
        self._schedule.written(segments.position.steps)

    def _open_records(self, segments: Segments, count: int | None) -> None:
        self._records = self._opened.enter_context(
            RecordFile(self._outputs, segments.layout(), self._run, count)
        )
        if count is None:
            # until there is a checkpoint they are of no use
            mark_partial(self._outputs)
            self._opened.callback(mark_kept, self._outputs)

    def _save(self) -> None:
        assert self._segments is not None
        segments = self._segments
        arrays, numbers = segments.stored()
        metadata: Mapping[str, Any] = {**numbers, "run": self._run, "seconds": self.seconds}
        self._records.synchronise()
        checkpoint.write(
            self._path,
            Checkpoint(self._kind, self._case.to_toml(), self._versions, arrays, metadata),
        )
        mark_kept(self._outputs)
        self._kept_position = segments.position
        self._schedule.written(segments.position.steps)

    def _kept(self) -> str:
        assert self._kept_position is not None
        time = self._kept_position.time
        return (
            f"the run up to t = {time:.6g} is in {shown_path(self._path)} and goes on with "
            "--resume (resume=True in Python)"
        )
