"""How long the explorer takes to start and to answer a slider, and its pictures for the documents.

Run from the root of the repository, with Chromium on the path; nothing is written without a flag::

    python -m benchmarks.explorer            # one to two minutes
    python -m benchmarks.explorer --write    # fills docs/explorer.md
    python -m benchmarks.explorer --images   # draws docs/images/explorer-*.png

Times are those that a person at the page meets: from the start of the command, or from the event of
the slider to the frame in which the browser shows the profiles of all drawn models. They contain
the 40 ms for which the page waits whether the slider moves on.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any, NamedTuple

from benchmarks.timing import ROOT, machine_facts, table, write_section

PAGE = ROOT / "docs" / "explorer.md"
IMAGES = ROOT / "docs" / "images"
REACH = 0.3
"""Seconds in which a slider is to be answered in one dimension, once warm."""

_SLIDERS = {
    "powder, granular temperature": ("suspension", "suspension.granular_temperature"),
    "seven numbers, collision time": ("numbers", "numbers.tau_c"),
}
_MOVE = """
async ([name, part]) => {
  const slider = document.getElementById(`field-${name}-slider`)
  const shown = () => Number(document.body.dataset.drawn ?? 0)
  const done = () => Number(document.body.dataset.asked ?? 0)
  const until = (count) => new Promise((resolve) => {
    const look = () => count() > before ? resolve() : setTimeout(look, 1)
    look()
  })
  const before = done()
  const began = performance.now()
  slider.value = Math.round(1000 * part)
  slider.dispatchEvent(new Event("input", {bubbles: true}))
  await until(shown)
  await new Promise(requestAnimationFrame)
  const drawn = performance.now() - began
  await until(done)
  return [drawn / 1000, (performance.now() - began) / 1000]
}
"""


class Start(NamedTuple):
    """Seconds from the start of the command, and from the start of loading the page to the rest.

    Attributes
    ----------
    served : float
        Until the address is printed.
    usable : float
        Until the inputs are there, and the model that suits by the table.
    drawn : float
        Until the profiles of the three drawn models are there.
    """

    served: float
    usable: float
    drawn: float


@contextmanager
def chromium() -> Iterator[Any]:
    """Give a browser."""
    from playwright.sync_api import sync_playwright

    from tests.explorer import CHROMIUM

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


def start(browser: Any, cache: dict[str, str]) -> Start:
    """Start the command and load the page once."""
    from tests.explorer import PATIENCE, Page, served

    began = perf_counter()
    with served(environment=cache) as (_, address):
        printed = perf_counter() - began
        page = Page(browser, address)
        page.page.wait_for_selector("#rows table")
        usable = perf_counter() - began
        page.page.wait_for_function("document.body.dataset.drawn > 0", timeout=PATIENCE)
        drawn = perf_counter() - began
        page.done()
        page.close()
    return Start(printed, usable, drawn)


def answers(
    browser: Any, cache: dict[str, str], count: int
) -> dict[str, list[tuple[float, float, float]]]:
    """Move sliders of a warm page and return seconds until drawn, until judged, and of CPU."""
    import psutil

    from tests.explorer import Page, served

    found: dict[str, list[tuple[float, float, float]]] = {}
    with served(environment=cache) as (server, address):
        page = Page(browser, address)
        page.done()
        process = psutil.Process(server.pid)
        for label, (kind, name) in _SLIDERS.items():
            page.page.check(f"input[name=kind][value={kind}]")
            page.page.wait_for_timeout(3000)
            page.done()
            found[label] = []
            for number in range(count + 3):
                part = 0.4 + 0.2 * (number * 0.618 % 1.0)
                before = sum(process.cpu_times()[:2])
                drawn, judged = page.page.evaluate(_MOVE, [name, part])
                cpu = sum(process.cpu_times()[:2]) - before
                # a model may be compiled for its first run of a kind
                if number >= 3:
                    found[label].append((drawn, judged, cpu))
        page.close()
    return found


def report(browser: Any, count: int) -> str:
    """Return tables of all that is measured, as Markdown."""
    with TemporaryDirectory() as folder:
        # programs are kept there as they are in the user's folder
        cache = {"TRIBOFLUX_CACHE_DIR": folder}
        starts = {"the very first": start(browser, cache), "every later one": start(browser, cache)}
        moved = answers(browser, cache, count)
    rows = [[name, *(f"{seconds:.1f}" for seconds in times)] for name, times in starts.items()]
    parts = [
        table(["start of `triboflux explore`, seconds until", *Start._fields], rows),
        table(
            ["slider, milliseconds until", "drawn", "slowest of 20", "all models judged", "CPU"],
            [
                [
                    label,
                    *(
                        f"{1e3 * value:.0f}"
                        for value in (
                            median(drawn for drawn, _, _ in times),
                            max(drawn for drawn, _, _ in times),
                            median(judged for _, judged, _ in times),
                            median(cpu for _, _, cpu in times),
                        )
                    ),
                ]
                for label, times in moved.items()
            ],
        ),
        f"{machine_facts()} By `python -m benchmarks.explorer --write`.{_disturbed()}",
    ]
    return "\n\n".join(parts)


def _disturbed() -> str:
    """Return a sentence if other programs kept the cores busy, as they would any page."""
    load, cores = os.getloadavg()[1], os.cpu_count() or 1
    if load <= cores:
        return ""
    return (
        f" The load average was {load:.0f} on {cores} cores: others ran meanwhile, and times "
        "are longer than they are alone; the CPU time is not."
    )


def draw(browser: Any, folder: Path) -> None:
    """Write the pictures of the documents: a wide light page by numbers, a narrow dark one."""
    from tests.explorer import PATIENCE, Page, served

    with served(environment={}) as (_, address):
        wide = Page(browser, address)
        wide.by_numbers(tau_c="8e-3")
        wide.page.uncheck("input[value=gradient]")
        wide.page.check("input[value=collisional]")
        wide.page.wait_for_timeout(1000)
        wide.done()
        wide.page.locator("#time").fill("22")
        words = "document.getElementById('map-words').textContent"
        wide.page.wait_for_function(f"{words} && !/So far/.test({words})", timeout=PATIENCE)
        wide.page.set_viewport_size({"width": 1280, "height": 1690})
        wide.page.evaluate("document.getElementById('inputs').scrollTo(0, 0)")
        wide.page.wait_for_timeout(500)
        wide.page.screenshot(path=folder / "explorer-wide.png")
        wide.close()
        narrow = Page(browser, address, color_scheme="dark")
        narrow.page.set_viewport_size({"width": 390, "height": 844})
        narrow.done()
        narrow.page.screenshot(path=folder / "explorer-narrow.png")
        narrow.close()


def main() -> None:
    """Measure, and write what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="fill docs/explorer.md")
    parser.add_argument("--images", action="store_true", help="draw docs/images/explorer-*.png")
    options = parser.parse_args()
    with chromium() as browser:
        if options.images:
            draw(browser, IMAGES)
            return
        text = report(browser, count=20)
    print(text)
    if options.write:
        write_section("explorer times", text, PAGE)


if __name__ == "__main__":
    main()
