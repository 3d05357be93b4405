"""Where the members of a sweep are computed: on local processes or on a Dask cluster.

Both hand the same texts to the same function, `triboflux.sweep_member.compute`. Dask's types are
not complete, hence Any for its clients and futures.
"""

from __future__ import annotations

import itertools
import json
import os
import queue
import re
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Generator, Iterable, Iterator
from typing import Any, TypeAlias

from triboflux.errors import InputError, TribofluxError, shown
from triboflux.sweep_member import ONE_THREAD, READY, compute, decisive_versions, failure

Task: TypeAlias = tuple[int, str]
Outcome: TypeAlias = tuple[int, dict[str, Any]]

MOST_WORKERS = 1024
_TICK = 0.25
_CONNECT = 10.0
_IN_FLIGHT = 4
# Not by name and path, because a worker must import what this process would.
_SERVE = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from triboflux.sweep_member import serve; serve()"
)
_DIED = "its worker process died"
_ADDRESS = re.compile(r"(tcp|tls|ws|wss|ucx)://[^\s/]+")


def require_runner(workers: int | None, scheduler: str | None) -> None:
    """Refuse a number of workers or an address that can't be; raises InputError."""
    if workers is not None and scheduler is not None:
        raise InputError.about("workers", "is given beside scheduler, which has its own workers")
    if workers is not None and not 1 <= workers <= MOST_WORKERS:
        raise InputError.about("workers", f"is {workers}, but must be from 1 to {MOST_WORKERS}")
    if scheduler is not None and not _ADDRESS.fullmatch(scheduler):
        problem = f"is {shown(scheduler)}, but must be an address such as tcp://host:8786"
        raise InputError.about("scheduler", problem)


def usable_cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def task(table: dict[str, Any]) -> str:
    """Return the text that a worker gets for a member.

    Parameters
    ----------
    table : dict
        The tables of its case.
    """
    return json.dumps({"case": table, "versions": decisive_versions()})


# ------------------------------------------------------------------ local processes


class _Worker:
    """One worker process and the pipes to it."""

    def __init__(self) -> None:
        self._errors = tempfile.TemporaryFile()
        self.process = subprocess.Popen(
            [sys.executable, "-c", _SERVE, json.dumps([path or os.getcwd() for path in sys.path])],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            env={**ONE_THREAD, **os.environ},
            text=True,
            encoding="ascii",
            # Ctrl-C in a terminal is for the parent alone
            start_new_session=os.name == "posix",
        )

    def start(self) -> None:
        """Wait until it has imported everything; raises TribofluxError if it can't."""
        assert self.process.stdout is not None
        if self.process.stdout.readline().strip() != READY:
            raise TribofluxError(f"a worker process does not start: {self._last_line()}.")

    def ask(self, text: str) -> str | None:
        """Return the answer to a task, or None if the process died over it."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        try:
            self.process.stdin.write(text + "\n")
            self.process.stdin.flush()
        except OSError:
            return None
        answer = self.process.stdout.readline()
        return answer if answer.endswith("\n") else None

    def epitaph(self) -> str:
        """Return how it died."""
        code = self.process.wait()
        if code < 0:
            return f"{_DIED} ({signal.Signals(-code).name})"
        return f"{_DIED} (exit code {code}: {self._last_line()})"

    def close(self) -> None:
        """End it at once, whatever it does."""
        self.process.kill()
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout, self._errors):
            assert pipe is not None
            try:
                pipe.close()
            except OSError:  # what was not written has no reader any more
                pass

    def _last_line(self) -> str:
        self._errors.seek(0)
        lines = self._errors.read()[-4000:].decode("utf-8", "replace").split("\n")
        told = [line for line in lines if line.strip()]
        return shown(told[-1][:200], 220)[1:-1].rstrip(".") if told else "it said nothing"


class _Pool:
    """Threads that each feed one worker process and replace it when it dies."""

    def __init__(self, tasks: Iterable[Task], count: int) -> None:
        self.outcomes: queue.SimpleQueue[Outcome | BaseException | None] = queue.SimpleQueue()
        self._tasks = iter(tasks)
        self._lock = threading.Lock()
        self._workers: set[_Worker] = set()
        self._closed = False
        self._threads = [threading.Thread(target=self._feed, daemon=True) for _ in range(count)]
        for thread in self._threads:
            thread.start()

    def _feed(self) -> None:
        """Give tasks to a worker until there are none."""
        worker = None
        try:
            while (given := self._next()) is not None:
                index, text = given
                worker = worker or self._hired()
                answer = worker.ask(text)
                if answer is not None:
                    self.outcomes.put((index, json.loads(answer)))
                    continue
                if self._closed:
                    break
                self.outcomes.put((index, failure(worker.epitaph())))
                self._dismiss(worker)
                worker = None
        except BaseException as error:
            self.outcomes.put(error)
        finally:
            if worker is not None:
                self._dismiss(worker)
            self.outcomes.put(None)

    def _next(self) -> Task | None:
        with self._lock:
            return None if self._closed else next(self._tasks, None)

    def _hired(self) -> _Worker:
        with self._lock:
            if self._closed:
                raise TribofluxError("the sweep was stopped.")
            worker = _Worker()
            self._workers.add(worker)
        try:
            worker.start()
        except BaseException:
            self._dismiss(worker)
            raise
        return worker

    def _dismiss(self, worker: _Worker) -> None:
        with self._lock:
            self._workers.discard(worker)
        worker.close()

    def close(self) -> None:
        """End all workers and threads."""
        with self._lock:
            self._closed = True
            for worker in self._workers:
                worker.process.kill()
        for thread in self._threads:
            thread.join()


def on_processes(tasks: Iterable[Task], count: int) -> Generator[Outcome | None, None, None]:
    """Compute members on local processes of one thread each.

    Parameters
    ----------
    tasks : iterable of tuple of int and str
        Number and text of each member, taken as they are needed.
    count : int
        Number of processes.

    Yields
    ------
    tuple of int and dict, or None
        Number and record of a member, as they come; None when nothing came for a while. A member
        whose process dies has a record that says so.

    Raises
    ------
    TribofluxError
        If a worker process does not start.
    """
    pool = _Pool(tasks, count)
    try:
        working = count
        while working:
            try:
                outcome = pool.outcomes.get(timeout=_TICK)
            except queue.Empty:
                yield None
                continue
            if isinstance(outcome, BaseException):
                raise outcome
            if outcome is None:
                working -= 1
            else:
                yield outcome
    finally:
        pool.close()


# ------------------------------------------------------------------ Dask


def connected(address: str) -> Any:
    """Return a client of a Dask scheduler, a context manager.

    Parameters
    ----------
    address : str
        Of the scheduler.

    Raises
    ------
    InputError
        If it can't be reached.
    """
    from distributed import Client

    try:
        return Client(address, timeout=_CONNECT, set_as_default=False)
    except (OSError, ValueError, RuntimeError) as error:
        reason = shown(str(error).partition("\n")[0][:150], 160)[1:-1].rstrip(".")
        raise InputError.about("scheduler", f": {address} can't be reached: {reason}") from None


def on_cluster(tasks: Iterable[Task], client: Any) -> Generator[Outcome | None, None, None]:
    """Compute members on the workers of a Dask cluster.

    Parameters
    ----------
    tasks : iterable of tuple of int and str
        Number and text of each member, taken as they are needed.
    client : distributed.Client
        From `connected`.

    Yields
    ------
    tuple of int and dict, or None
        As `on_processes`.

    Raises
    ------
    TribofluxError
        If the scheduler is lost, or its workers can't do the work.
    """
    suspects: list[Task] = []
    for given, record in _submitted(client, iter(tasks), None):
        if given is not None and record is None:
            suspects.append(given)
        else:
            yield None if given is None or record is None else (given[0], record)
    # A worker's death falls on all members that it had. Alone, each shows whether it is to blame.
    for given, record in _submitted(client, iter(suspects), 1):
        if given is None:
            yield None
        else:
            yield given[0], failure(_DIED) if record is None else record


def _submitted(
    client: Any, tasks: Iterator[Task], most: int | None
) -> Generator[tuple[Task | None, dict[str, Any] | None], None, None]:
    """Yield tasks with their records, without one if workers died, or nothing after a while."""
    finished: queue.SimpleQueue[Any] = queue.SimpleQueue()
    under_way: dict[Any, tuple[Any, Task]] = {}
    try:
        while True:
            # all workers have something to do, and a new one finds something
            wanted = most or max(8, _IN_FLIGHT * sum(client.nthreads().values()))
            for given in itertools.islice(tasks, max(0, wanted - len(under_way))):
                future = client.submit(compute, given[1], pure=False)
                under_way[future.key] = future, given
                future.add_done_callback(finished.put)
            if not under_way:
                return
            try:
                ended = finished.get(timeout=_TICK)
            except queue.Empty:
                yield None, None
                continue
            for future in (ended, *_emptied(finished)):
                _, given = under_way.pop(future.key)
                yield given, _record_of(future)
    finally:
        client.cancel([future for future, _ in under_way.values()])


def _emptied(ready: queue.SimpleQueue[Any]) -> Iterator[Any]:
    """Yield what is in a queue now."""
    while True:
        try:
            yield ready.get_nowait()
        except queue.Empty:
            return


def _record_of(future: Any) -> dict[str, Any] | None:
    """Return a member's record, or None if its worker died."""
    from distributed import KilledWorker

    try:
        return json.loads(future.result())
    except KilledWorker:
        return None
    except TribofluxError:
        raise
    # the member's own exceptions are in its record, so this is the cluster's
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt | SystemExit):
            raise
        reason = f"{type(error).__name__}: {str(error).partition(chr(10))[0]}"[:200]
        raise TribofluxError(
            f"the Dask cluster failed: {shown(reason, 220)[1:-1].rstrip('.')}."
        ) from error
