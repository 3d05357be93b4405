"""One page in a browser: what it asks, what it is told, and the thread that works for it."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from triboflux.case import CLOSURE_NAMES, Case
from triboflux.errors import InputError, TribofluxError, require_one_of
from triboflux.explorer import answer, chart, downloads, profiles
from triboflux.explorer.fields import described, position, preset_texts
from triboflux.explorer.inputs import MOST_MODELS, Inputs, read
from triboflux.explorer.live import ModelRun, advice_of, runs
from triboflux.explorer.worker import DETAIL, FILE, LIVE, MAP, Check, Worker
from triboflux.presets import NAMES as PRESETS

if TYPE_CHECKING:
    from collections.abc import Callable

    from triboflux.progress import Progress
    from triboflux.result import Result

    Message = dict[str, Any]

_PROGRESS_EVERY = 0.15
"""Seconds between two messages about how far a run is."""
_MAP_EVERY = 0.25
"""Seconds between two messages about the map while it is computed."""


class Session:
    """What a page asks and is told; it knows nothing of browsers.

    Parameters
    ----------
    send : callable
        Takes a message for the page, from any thread.
    """

    def __init__(self, send: Callable[[Message], None]) -> None:
        self._send = send
        self._worker = Worker(self._tell_failure)
        self._asked = 0
        self._case: Case | None = None
        self._inputs: Inputs | None = None
        self._values: dict[str, Any] = {}
        self._found: dict[str, ModelRun] = {}
        self._plane = ""
        self._cells: dict[tuple[int, int], tuple[str, str]] = {}
        self._guard = threading.Lock()

    def end(self) -> None:
        """Let the thread of the page end."""
        self._worker.end()

    def handle(self, message: object) -> None:
        """Do what a message from the page asks; anything unknown is ignored."""
        if not isinstance(message, Mapping):
            return
        table = cast("Mapping[str, Any]", message)
        handlers: dict[str, Callable[[Mapping[str, Any]], None]] = {
            "hello": self._greet,
            "inputs": self._ask,
            "preset": self._fill,
            "cancel": self._cancel,
            "budget": self._budget,
            "download": self._download,
        }
        handler = handlers.get(str(table.get("kind")))
        if handler is not None:
            handler(table)

    def _tell(self, kind: str, **content: Any) -> None:
        self._send({"kind": kind, **content})

    def _tell_failure(self, error: Exception) -> None:
        told = str(error) if isinstance(error, TribofluxError) else f"This failed: {error!r}."
        self._tell("failure", sentence=told, asked=self._asked)

    def _greet(self, _: Mapping[str, Any]) -> None:
        self._tell(
            "setup",
            fields=described(),
            models=answer.model_words(),
            closures=answer.closure_words(),
            presets=list(PRESETS),
            most_models=MOST_MODELS,
            axes={kind: chart.choices(kind) for kind in chart.USUAL_AXES},
            usual_axes={kind: list(names) for kind, names in chart.USUAL_AXES.items()},
        )

    def _fill(self, message: Mapping[str, Any]) -> None:
        try:
            texts = preset_texts(str(message.get("preset")))
        except InputError as error:
            self._tell("failure", sentence=str(error), asked=self._asked)
            return
        self._tell("texts", fields=texts)

    def _cancel(self, _: Mapping[str, Any]) -> None:
        self._worker.cancel()
        self._tell("cancelled", asked=self._asked)

    def _ask(self, message: Mapping[str, Any]) -> None:
        """Read the inputs; tell what is wrong at once, and run what is right."""
        self._asked = asked = int(message.get("asked", 0))
        values = dict(cast("Mapping[str, Any]", message.get("values") or {}))
        inputs = read(values)
        errors = dict(inputs.errors)
        try:
            require_one_of("closures", values.get("closures", "derived"), CLOSURE_NAMES)
        except InputError as error:
            errors["closures"] = str(error)
        texts = cast("dict[str, str]", values.get("fields") or {})
        places = {name: place for name, place in _positions(texts).items() if place is not None}
        self._tell("checked", asked=asked, errors=errors, positions=places)
        if inputs.case is None or errors:
            self._worker.cancel()
            return
        self._inputs, self._values, self._case = inputs, values, inputs.case
        self._worker.submit(LIVE, partial(self._run, asked, inputs, values))

    def _run(self, asked: int, inputs: Inputs, values: Mapping[str, Any], check: Check) -> None:
        """Run all models, and tell about each as soon as it is there."""
        case = inputs.case
        assert case is not None
        began = time.perf_counter()
        units = "si" if values.get("units") == "si" and case.suspension is not None else "scaled"
        known = answer.at_once(case)
        self._tell("known", asked=asked, **known)
        found: dict[str, ModelRun] = {}
        reference: Result | None = None
        last = 0.0

        def on_progress(model: str, progress: Progress) -> None:
            nonlocal last
            now = time.perf_counter()
            if now - last > _PROGRESS_EVERY:
                last = now
                self._tell(
                    "progress",
                    asked=asked,
                    model=model,
                    fraction=progress.fraction,
                    time=progress.time,
                    steps=progress.steps,
                )

        for run in runs(case, inputs.models, check=check, on_progress=on_progress):
            check()
            found[run.model] = run
            if reference is None:
                assert run.own is not None
                reference = _in(run.own, units)
                line = profiles.line_of(reference)
                times = reference.dataset["time"].values
                self._tell(
                    "frame",
                    asked=asked,
                    times=times.tolist(),
                    x=profiles.positions(reference, line),
                    axis=line.axis,
                    panels=profiles.panels(reference),
                    units=units,
                    place={name: int(i) for name, i in line.place.items()},
                )
            self._tell("run", asked=asked, **_told(run))
            if run.model in inputs.models and run.shown is not None:
                drawn = profiles.frames(_in(run.shown, units), line, times)
                self._tell("profiles", asked=asked, model=run.model, values=drawn)
                self._found = found
        advice = answer.advice_words(advice_of(case, found), case, found)
        shown = [found[name] for name in inputs.models]
        warnings = list(dict.fromkeys([*known["warnings"], *answer.run_warnings(shown)]))
        self._found = found
        self._tell(
            "done",
            asked=asked,
            advice=advice,
            warnings=warnings,
            seconds=time.perf_counter() - began,
        )
        self._worker.submit(MAP, partial(self._chart, asked, case, values))

    def _chart(self, asked: int, case: Case, values: Mapping[str, Any], check: Check) -> None:
        """Compute what is missing of the map, around the current case first."""
        kind = "suspension" if case.suspension is not None else "numbers"
        axes = chart.axes_of(kind, values.get("axes"))
        plane = chart.plane_of(case, axes)
        if plane != self._plane:
            self._plane, self._cells = plane, {}
        texts = {name: str(text) for name, text in values["fields"].items()}
        point = chart.point_of(texts, axes)

        def tell() -> None:
            self._tell(
                "map",
                asked=asked,
                axes=[{"name": a.name, "values": list(a.values)} for a in axes],
                cells=[[i, j, *cell] for (i, j), cell in self._cells.items()],
                point=point,
                origin="table" if kind == "suspension" else "computed",
            )

        tell()
        told = time.perf_counter()
        for place in chart.nearest_first(axes, point):
            if place in self._cells:
                continue
            check()
            self._cells[place] = chart.judge(case, axes, place, check)
            if time.perf_counter() - told > _MAP_EVERY:
                tell()
                told = time.perf_counter()
        tell()

    def _budget(self, message: Mapping[str, Any]) -> None:
        model, frame = str(message.get("model")), int(message.get("frame", -1))
        self._worker.submit(DETAIL, partial(self._tell_budget, self._asked, model, frame))

    def _tell_budget(self, asked: int, model: str, frame: int, check: Check) -> None:
        run, reference = self._found.get(model), self._found.get("full")
        if run is None or run.shown is None or reference is None or reference.own is None:
            return
        check()
        times = reference.own.dataset["time"].values
        time_of_page = float(times[min(max(frame, 0), times.size - 1)])
        if time_of_page > float(run.shown.dataset["time"].values[-1]):
            return
        line = profiles.line_of(reference.own)
        found = profiles.budget_of(run.shown, line, time_of_page)
        self._tell("budget", asked=asked, **found)

    def _download(self, message: Mapping[str, Any]) -> None:
        what, model = str(message.get("what")), str(message.get("model"))
        frame = int(message.get("frame", -1))
        if what in downloads.KINDS:
            self._worker.submit(FILE, partial(self._tell_file, what, model, frame))

    def _tell_file(self, what: str, model: str, frame: int, check: Check) -> None:
        run, inputs = self._found.get(model), self._inputs
        if run is None or run.own is None or inputs is None or inputs.case is None:
            self._tell("failure", sentence="There is no result to download.", asked=self._asked)
            return
        suspended = inputs.case.suspension is not None
        units = "si" if self._values.get("units") == "si" and suspended else "scaled"
        if what == "toml":
            file = downloads.toml(run)
        elif what == "netcdf":
            file = downloads.netcdf(run, units)
        elif what == "python":
            file = downloads.python(run)
        else:
            case = run.own.case
            file = downloads.figure(run, case, inputs.models, units, frame, check)
        content = np.frombuffer(file.content, dtype=np.uint8)
        self._tell("file", name=file.name, type=file.kind, content=content)


def _in(result: Result, units: str) -> Result:
    return result.to_si() if units == "si" else result


def _told(run: ModelRun) -> dict[str, Any]:
    """Return what the page says about a run."""
    return {
        "model": run.model,
        "status": run.status,
        "reason": run.reason,
        "stop_time": run.stop_time,
        "error": run.error,
    }


def _positions(texts: Mapping[str, str]) -> dict[str, float | None]:
    """Return where the texts stand on the sliders."""
    from triboflux.explorer.fields import FIELDS

    return {
        name: position(name, texts[name])
        for name, field in FIELDS.items()
        if field.low is not None and isinstance(texts.get(name), str)
    }
