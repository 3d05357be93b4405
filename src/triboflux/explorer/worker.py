"""A thread that does a page's work off the event loop, the newest wish first."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TypeAlias

from triboflux.explorer.live import CancelledError

Check: TypeAlias = Callable[[], None]
Work: TypeAlias = Callable[[Check], None]

LIVE, DETAIL, FILE, MAP = range(4)
"""Lanes, the most urgent first. A lane holds one piece of work: the newest replaces the others."""

_INTERRUPTS = {LIVE: (LIVE, MAP), DETAIL: (MAP,), FILE: (MAP,), MAP: (MAP,)}
"""Which running work a new one of a lane makes stale."""
_RESUMED = (DETAIL, FILE)
"""Lanes after whose work a map that they interrupted goes on."""
# compilers recurse deeply, and some systems give new threads little stack
_STACK = 2**26


class Worker:
    """Does one piece of work at a time in a thread of its own.

    Parameters
    ----------
    failed : callable
        Called with what a piece of work raised, but for `CancelledError`.
    """

    def __init__(self, failed: Callable[[Exception], None]) -> None:
        self._failed = failed
        self._waiting: dict[int, Work] = {}
        self._running: int | None = None
        self._current: Work | None = None
        self._stale = False
        self._ended = False
        self._news = threading.Condition()
        usual = threading.stack_size(_STACK)
        self._thread = threading.Thread(target=self._loop, daemon=True)
        self._thread.start()
        threading.stack_size(usual)

    def submit(self, lane: int, work: Work) -> None:
        """Ask for a piece of work, in place of what waits in the same lane.

        Parameters
        ----------
        lane : int
            `LIVE`, `DETAIL`, `FILE` or `MAP`.
        work : callable
            Called in the thread with a function that raises `CancelledError` once the work is
            stale; it has to call that often.
        """
        with self._news:
            self._waiting[lane] = work
            if lane == LIVE:
                self._waiting.pop(MAP, None)
            if self._running in _INTERRUPTS[lane]:
                self._stale = True
                if lane in _RESUMED and self._current is not None:
                    self._waiting.setdefault(MAP, self._current)
            self._news.notify()

    def cancel(self) -> None:
        """Make everything stale that runs or waits."""
        with self._news:
            self._waiting.clear()
            self._stale = True

    def end(self) -> None:
        """Let the thread end."""
        self.cancel()
        with self._news:
            self._ended = True
            self._news.notify()

    def _check(self) -> None:
        if self._stale:
            raise CancelledError("cancelled")

    def _loop(self) -> None:
        while True:
            with self._news:
                self._running = self._current = None
                self._news.wait_for(lambda: self._waiting or self._ended)
                if self._ended:
                    return
                lane = min(self._waiting)
                self._current = work = self._waiting.pop(lane)
                self._running, self._stale = lane, False
            try:
                work(self._check)
            except CancelledError:
                pass
            except Exception as error:  # a page must go on after any failure of one run
                self._failed(error)
