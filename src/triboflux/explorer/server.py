"""The local server of `triboflux explore`: loopback only, one session for each open page."""

from __future__ import annotations

import asyncio
import importlib
import os
import signal
import socket
import sys
import threading
import webbrowser
from functools import partial
from importlib import resources
from typing import TYPE_CHECKING, Any

from triboflux.errors import InputError, TribofluxError

if TYPE_CHECKING:
    from bokeh.server.server import Server

ADDRESS = "127.0.0.1"
"""Only programs of this machine reach it."""

_LARGEST_PORT = 65535
_TURN = 1e-3
_MISSING = (
    "the explorer needs the package panel, which is not installed; "
    "pip install 'triboflux[explorer]' brings it."
)


def command(port: int | None, *, browser: bool, quiet: bool) -> None:
    """Serve the page until Ctrl-C or SIGTERM.

    Parameters
    ----------
    port : int or None
        Any free one if None.
    browser : bool
        Open the page in the browser.
    quiet : bool
        Print nothing.

    Raises
    ------
    InputError
        If the port is not allowed or not free.
    TribofluxError
        If Panel is not installed.
    """
    port = _free(port)
    _require_panel()
    from triboflux.terminal import use_compilation_cache

    use_compilation_cache()
    # messages are sent while another thread computes, and each would wait for its turn
    sys.setswitchinterval(_TURN)
    server = make_server(port)
    address = f"http://{ADDRESS}:{port}/"
    loop = asyncio.get_event_loop()
    loop.set_exception_handler(unless_page_closed)
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, loop.stop)
    server.start()
    warm_up()
    if not quiet:
        print(f"triboflux explorer at {address} (Ctrl-C stops it)", flush=True)
    if browser:
        # a browser may take its time, and the page wants to be served meanwhile
        threading.Thread(target=partial(webbrowser.open, address), daemon=True).start()
    loop.run_forever()
    if not quiet:
        print("stopped", flush=True)
    sys.stderr.flush()
    # JAX may still be computing in other threads, under which an orderly exit pulls the rug
    os._exit(0)


def unless_page_closed(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """Report what a task left unhandled, but for a message to a page that was just closed.

    Parameters
    ----------
    loop : asyncio.AbstractEventLoop
        The server's.
    context : dict
        What asyncio tells about it.
    """
    from tornado.websocket import WebSocketClosedError

    if not isinstance(context.get("exception"), WebSocketClosedError):
        loop.default_exception_handler(context)


def _free(port: int | None) -> int:
    """Return a port that is free, the wanted one if there is one."""
    if port is not None and not 1 <= port <= _LARGEST_PORT:
        problem = f"is {port}, but must be from 1 to {_LARGEST_PORT}"
        raise InputError.about("port", problem)
    with socket.socket() as probe:
        # as the server itself does, so that a port is free again right after its last use
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((ADDRESS, port or 0))
        except OSError as error:
            reason = error.strerror.lower() if error.strerror else "refused"
            problem = f"{port} can't be used: {reason}; take another or leave it out"
            raise InputError.about("port", problem) from None
        return int(probe.getsockname()[1])


def _require_panel() -> None:
    try:
        importlib.import_module("panel")
    except ImportError:
        raise TribofluxError(_MISSING) from None


def make_server(port: int) -> Server:
    """Return the server, not started.

    Parameters
    ----------
    port : int
        A free one.
    """
    from panel.io.server import get_server  # pyright: ignore[reportUnknownVariableType] -- untyped keywords in Panel

    from triboflux.explorer.page import page

    return get_server(
        {"/": page},
        port=port,
        address=ADDRESS,
        # a page of another origin, or a name that was made to point here, gets no session
        websocket_origin=[f"{ADDRESS}:{port}", f"localhost:{port}"],
        static_dirs={"assets": str(resources.files("triboflux.explorer") / "assets")},
        title="triboflux explorer",
        show=False,
        start=False,
        # what a page that was closed had asked for is not kept for long
        unused_session_lifetime_milliseconds=10_000,
        check_unused_sessions_milliseconds=5_000,
    )


def warm_up() -> None:
    """Compile what the first page needs, in the background."""
    from triboflux.explorer.worker import MAP, Worker

    def ignore(_: Exception) -> None:
        """Leave it to the page to meet the same failure and tell it."""

    Worker(ignore).submit(MAP, _warm)


def _warm(check: Any) -> None:
    """Run what a page runs once; the first page begins at the other end, so that both compile."""
    from triboflux.explorer.inputs import read
    from triboflux.explorer.live import JUDGED, runs
    from triboflux.explorer.profiles import Drawing

    inputs = read({"models": ["full"]})
    assert inputs.case is not None
    for run in runs(inputs.case, models=JUDGED[::-1], check=check):
        if run.shown is not None:
            Drawing.of(run.shown).budget(run.shown, 0.0)
