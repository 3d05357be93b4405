"""The page as Panel serves it: a template, and a bridge of messages to a session."""

from __future__ import annotations

import threading
from functools import partial
from importlib import resources
from typing import Any

import panel as pn
from panel.custom import JSComponent

from triboflux.explorer.session import Session


class Bridge(JSComponent):
    """Carries messages between the page and its session; the page itself draws everything."""

    _esm = """
    export function render({model}) {
      window.tribofluxModel = model
      window.dispatchEvent(new Event("triboflux"))
    }
    """

    def __init__(self, **params: Any) -> None:
        super().__init__(**params)
        document = pn.state.curdoc
        assert document is not None
        self._document = document
        self._session = Session(self.tell)
        pn.state.on_session_destroyed(lambda _: self._session.end())

    def _handle_msg(self, data: Any) -> None:
        """Take a message of the page."""
        self._session.handle(data)

    def tell(self, message: dict[str, Any]) -> None:
        """Send a message to the page, from any thread."""
        if threading.current_thread() is threading.main_thread():
            self._send_msg(message)
        else:
            self._document.add_next_tick_callback(partial(self._send_msg, message))


def page() -> pn.Template:
    """Return the page for one more visitor."""
    assets = resources.files("triboflux.explorer") / "assets"
    template = pn.Template((assets / "page.html").read_text(encoding="utf-8"))
    template.add_panel("bridge", Bridge(height=0, width=0, margin=0))
    return template
