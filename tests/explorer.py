"""The explorer's server in a process of its own, and its page in a real browser."""

import contextlib
import re
import shutil
import signal
import subprocess
import sys
from urllib.parse import urlsplit

import pytest

from tests.processes import READS_CACHE_ONLY, surroundings

CHROMIUM = shutil.which("chromium")
PATIENCE = 240_000
"""Milliseconds that a first run may take on a busy machine, where everything is compiled."""

needs_chromium = pytest.mark.skipif(
    CHROMIUM is None, reason="no chromium on this machine; .ci/run installs Debian's"
)


@contextlib.contextmanager
def served(*arguments, environment=READS_CACHE_ONLY):
    """Give a running server and its address; it is stopped by Ctrl-C, whatever it computes."""
    server = subprocess.Popen(
        [sys.executable, "-m", "triboflux", "explore", "--no-browser", *arguments],
        env=surroundings(**environment),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        line = server.stdout.readline()
        found = re.search(r"http://127\.0\.0\.1:\d+/", line)
        assert found, (line, server.stderr.read() if server.poll() is not None else "")
        yield server, found[0]
    finally:
        if server.poll() is None:
            server.send_signal(signal.SIGINT)
        try:
            server.wait(timeout=30)
        finally:
            server.kill()


class Page:
    """The page as a person sees it, and a record of everything that must not happen."""

    def __init__(self, browser, address, **options):
        self.context = browser.new_context(viewport={"width": 1280, "height": 900}, **options)
        self.page = self.context.new_page()
        self.wrong, self.hosts = [], set()
        self.page.on("console", self._note)
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on("dialog", lambda dialog: self.wrong.append(f"dialog {dialog.message}"))
        self.page.on("request", lambda request: self.hosts.add(urlsplit(request.url).hostname))
        self.page.on("websocket", lambda socket: self.hosts.add(urlsplit(socket.url).hostname))
        self.page.goto(address)
        self.page.wait_for_selector("#inputs fieldset")

    def _note(self, message):
        if message.type in ("error", "warning"):
            self.wrong.append(message.text)

    def close(self):
        self.context.close()
        assert self.wrong == []
        # what a blob's address names is in the page itself
        assert self.hosts <= {"127.0.0.1", None}

    def done(self):
        """Wait until everything that was asked is answered."""
        self.page.wait_for_function("document.body.dataset.state === 'done'", timeout=PATIENCE)

    def asked(self):
        return int(self.page.evaluate("document.body.dataset.asked ?? 0"))

    @contextlib.contextmanager
    def answered(self):
        """Wait for the answer to what is changed inside."""
        before = self.asked()
        yield
        self.page.wait_for_function(
            f"Number(document.body.dataset.asked) > {before}", timeout=PATIENCE
        )
        self.done()

    def by_numbers(self, **numbers):
        """Describe the case by the seven numbers."""
        self.page.check("input[name=kind][value=numbers]")
        for name, text in numbers.items():
            self.field(f"numbers.{name}").fill(text)

    def field(self, name):
        return self.page.locator(f"[id='field-{name}']")

    def error(self, name):
        return self.page.locator(f"[id='field-{name}-error']")

    def text(self, selector):
        return self.page.locator(selector).inner_text()

    def download(self, what, folder):
        with self.page.expect_download(timeout=PATIENCE) as started:
            self.page.click(f"button[data-what={what}]")
        path = folder / started.value.suggested_filename
        started.value.save_as(path)
        return path
