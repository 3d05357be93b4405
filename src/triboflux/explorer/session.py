"""One page in a browser: what it asks, what it is told, and the thread that works for it."""

from __future__ import annotations

import time
from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from triboflux.case import CLOSURE_NAMES, Case
from triboflux.compare import DEFAULT_MODELS
from triboflux.errors import InputError, TribofluxError, require_one_of
from triboflux.explorer import answer, chart, downloads, profiles
from triboflux.explorer.fields import USUAL_PRESET, described, positions, preset_texts
from triboflux.explorer.inputs import MOST_MODELS, Inputs, read
from triboflux.explorer.live import NOT_JUDGED, REFERENCE, ModelRun, advice_of, runs, solved
from triboflux.explorer.worker import DETAIL, FILE, LIVE, MAP, Check, Worker
from triboflux.presets import NAMES as PRESETS

if TYPE_CHECKING:
    from collections.abc import Callable

    from triboflux.progress import Progress
    from triboflux.result import Result

    Message = dict[str, Any]

_PROGRESS_EVERY = 0.15
"""Seconds between two messages about how far a run is."""
_REST, _PAUSE = 12, 0.025
"""How many pauses, in seconds, before the map is computed."""
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
        self._inputs: Inputs | None = None
        self._values: dict[str, Any] = {}
        self._found: dict[str, ModelRun] = {}
        self._plane = ""
        self._cells: dict[chart.Place, chart.Cell] = {}

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
            usual_preset=USUAL_PRESET,
            usual_models=list(DEFAULT_MODELS),
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
        self._asked = asked = _whole(message.get("asked"))
        values = dict(cast("Mapping[str, Any]", message.get("values") or {}))
        inputs = read(values)
        errors = dict(inputs.errors)
        try:
            require_one_of("closures", values.get("closures", "derived"), CLOSURE_NAMES)
        except InputError as error:
            errors["closures"] = str(error)
        places = positions(inputs.texts)
        self._tell("checked", asked=asked, errors=errors, positions=places)
        if inputs.case is None or errors:
            self._worker.cancel()
            return
        self._inputs, self._values = inputs, values
        self._worker.submit(LIVE, partial(self._run, asked, inputs, values))

    def _run(self, asked: int, inputs: Inputs, values: Mapping[str, Any], check: Check) -> None:
        """Run all models, and tell about each as soon as it is there."""
        case = inputs.case
        assert case is not None
        began = time.perf_counter()
        units = _units(case, values)
        known = answer.at_once(case)
        self._tell("known", asked=asked, **known)
        found: dict[str, ModelRun] = {}
        drawing: profiles.Drawing | None = None
        all_drawn = False
        report = self._reporter(asked)
        for run in runs(case, inputs.models, check=check, on_progress=report):
            check()
            found[run.model] = run
            if drawing is None:
                assert run.shown is not None
                drawing = profiles.Drawing.of(_in(run.shown, units))
                self._tell("frame", asked=asked, **drawing.told())
            self._tell("run", asked=asked, **_told(run, case))
            if run.model in inputs.models and run.shown is not None:
                drawn = drawing.frames(_in(run.shown, units))
                self._tell("profiles", asked=asked, model=run.model, values=drawn)
            if not all_drawn and set(inputs.models) <= set(found):
                all_drawn, self._found = True, found
                self._tell("drawn", asked=asked, seconds=time.perf_counter() - began)
        judged = advice_of(case, found)
        advice = answer.advice_words(judged, case, found)
        if judged.model == NOT_JUDGED and known["advice"] is not None:
            advice = known["advice"] | {"when": advice["when"]}
        shown = [found[name] for name in inputs.models]
        warnings = list(dict.fromkeys([*known["warnings"], *answer.run_warnings(shown)]))
        seconds = time.perf_counter() - began
        self._tell("done", asked=asked, advice=advice, warnings=warnings, seconds=seconds)
        self._worker.submit(MAP, partial(self._chart, asked, inputs, values))

    def _reporter(self, asked: int) -> Callable[[str, Progress], None]:
        """Return a callback that tells the page how far a run is, but not too often."""
        last = time.perf_counter()

        def report(model: str, progress: Progress) -> None:
            nonlocal last
            now = time.perf_counter()
            if now - last > _PROGRESS_EVERY:
                last = now
                self._tell(
                    "progress",
                    asked=asked,
                    model=model,
                    fraction=progress.fraction,
                    steps=progress.steps,
                )

        return report

    def _chart(self, asked: int, inputs: Inputs, values: Mapping[str, Any], check: Check) -> None:
        """Compute what is missing of the map, around the current case first."""
        case = inputs.case
        assert case is not None
        axes = chart.axes_of(chart.kind_of(case), values.get("axes"))
        plane = chart.plane_of(case, axes)
        if plane != self._plane:
            self._plane, self._cells = plane, {}
        point = chart.point_of(inputs.texts, axes)

        def tell() -> None:
            self._tell(
                "map",
                asked=asked,
                axes=[{"name": a.name, "values": list(a.values)} for a in axes],
                cells=[[i, j, *cell] for (i, j), cell in self._cells.items()],
                point=point,
            )

        tell()
        # while a slider moves, the cores are for the profiles
        for _ in range(_REST):
            check()
            time.sleep(_PAUSE)
        told = time.perf_counter()
        for _ in chart.judged(case, axes, point, self._cells, check):
            if time.perf_counter() - told > _MAP_EVERY:
                tell()
                told = time.perf_counter()
        tell()

    def _budget(self, message: Mapping[str, Any]) -> None:
        model, frame = str(message.get("model")), _whole(message.get("frame"))
        self._worker.submit(DETAIL, partial(self._tell_budget, self._asked, model, frame))

    def _tell_budget(self, asked: int, model: str, frame: int, check: Check) -> None:
        run, reference = self._found.get(model), self._found.get(REFERENCE)
        if run is None or run.shown is None or reference is None or reference.shown is None:
            return
        check()
        times = reference.shown.dataset["time"].values
        wanted = float(times[min(max(frame, 0), times.size - 1)])
        if wanted <= float(run.shown.dataset["time"].values[-1]):
            drawing = profiles.Drawing.of(reference.shown)
            self._tell("budget", asked=asked, **drawing.budget(run.shown, wanted))

    def _download(self, message: Mapping[str, Any]) -> None:
        what, model = str(message.get("what")), str(message.get("model"))
        frame = _whole(message.get("frame"))
        if what in downloads.KINDS:
            self._worker.submit(FILE, partial(self._tell_file, what, model, frame))

    def _tell_file(self, what: str, model: str, frame: int, check: Check) -> None:
        run, inputs = self._found.get(model), self._inputs
        if run is None or run.case is None or inputs is None:
            self._tell("failure", sentence="There is no result to download.", asked=self._asked)
            return
        units = _units(run.case, self._values)
        if what == "toml":
            file = downloads.toml(run.case)
        elif what == "python":
            file = downloads.python(run.case)
        elif what == "figure" and len(inputs.models) > 1:
            case = self._found[REFERENCE].case
            assert case is not None
            file = downloads.png(downloads.compared(case, inputs.models, units, check))
        else:
            result = _in(solved(run.case, check), units)
            last = result.dataset.sizes["time"] - 1
            netcdf = what == "netcdf"
            file = (
                downloads.netcdf(result)
                if netcdf
                else downloads.png(result.plot(min(max(frame, 0), last)))
            )
        content = np.frombuffer(file.content, dtype=np.uint8)
        self._tell("file", name=file.name, type=file.kind, content=content)


def _whole(value: object) -> int:
    """Return a whole number as it is, and 0 for anything else."""
    return value if isinstance(value, int) else 0


def _units(case: Case, values: Mapping[str, Any]) -> str:
    """Return the units that the page wants, scaled ones where there are no others."""
    return "si" if values.get("units") == "si" and case.suspension is not None else "scaled"


def _in(result: Result, units: str) -> Result:
    return result.to_si() if units == "si" else result


def _told(run: ModelRun, case: Case) -> dict[str, Any]:
    """Return what the page says about a run."""
    return {
        "model": run.model,
        "status": run.status,
        "reason": run.reason,
        "stop_time": run.stop_time,
        "stop_text": None if run.stop_time is None else answer.stop_text(case, run.stop_time),
        "error": run.error,
    }
