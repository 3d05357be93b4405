"""The explorer behind its page: fields to cases, work in turn, messages, downloads, refusals."""

import asyncio
import runpy
import socket
import sys
import threading

import numpy as np
import pytest

from tests.in_process import call, sentence_of
from triboflux.case import MODEL_NAMES, Case
from triboflux.closures import NAMES as CLOSURES
from triboflux.compare import DEFAULT_MODELS
from triboflux.errors import InputError
from triboflux.explorer import answer, chart, downloads, fields, inputs, live, server, worker
from triboflux.explorer.session import Session
from triboflux.model_errors import CHEAPEST_FIRST
from triboflux.presets import NAMES as PRESETS
from triboflux.suspension import Suspension

NUMBERS, POWDER = ({"kind": kind, "models": ["full"]} for kind in ("numbers", "suspension"))


def with_texts(values, **texts):
    return values | {"fields": {name.replace("__", "."): text for name, text in texts.items()}}


def test_untouched_fields_are_a_case():
    for values in (NUMBERS, POWDER):
        read = inputs.read(values)
        assert read.errors == {}
        assert read.case.model == "full"
        assert (read.case.suspension is None) == (values is NUMBERS)


@pytest.mark.parametrize("name", PRESETS)
def test_texts_of_a_preset_are_the_preset(name):
    texts = fields.preset_texts(name)
    case = inputs.read(POWDER | {"preset": name, "fields": texts}).case
    mine, preset = case.suspension.model_dump(), Suspension(preset=name).model_dump()
    for field, value in preset.items():
        assert mine[field] == (pytest.approx(value, rel=1e-5) if type(value) is float else value)


def test_each_wrong_field_has_its_own_sentence():
    texts = {"numbers__peclet": "<b>", "numbers__tau_c": "-1", "title": "a\nb"}
    read = inputs.read(with_texts(NUMBERS, **texts, initial__waves="63"))
    assert read.case is None
    assert set(read.errors) == {"numbers.peclet", "numbers.tau_c", "title"} | {"initial.waves"}
    for name in ("numbers.peclet", "numbers.tau_c", "title"):
        with pytest.raises(InputError) as refused:
            Case(**inputs._tables("numbers", fields.starts() | {name: read.texts[name]}, NUMBERS))
        assert read.errors[name] == str(refused.value)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("suspension.diameter", "3 kg"),
        ("suspension.diameter", "inf um"),
        ("suspension.charge_scale", "__import__('os')"),
        ("suspension.drag", "newton"),
        ("suspension.solid_fraction", "0.9"),
        ("run.t_end", "soon"),
        ("grid.points", "1e9"),
        ("initial.waves", "1e400"),
        ("title", "x" * 301),
    ],
)
def test_wrong_texts_are_marked_at_their_field(name, text):
    read = inputs.read(POWDER | {"fields": {name: text}})
    assert list(read.errors) == [name]
    assert read.case is None


def test_a_bare_number_is_in_the_unit_of_its_field():
    read = inputs.read(POWDER | {"fields": {"suspension.diameter": "250"}})
    assert read.case.suspension.diameter == pytest.approx(250e-6)


def test_from_one_to_three_models():
    for models in ([], list(MODEL_NAMES[:4]), "full", None):
        assert "models" in inputs.read({"models": models}).errors
    assert inputs.read({"models": ["gradient", "full"]}).models == ("full", "gradient")


def test_anything_may_come_from_a_browser():
    messages = [None, 3, "x", {}, {"kind": "__init__"}, {"kind": "download", "what": "../x"}]
    messages += [{"kind": "budget", "frame": "x", "model": []}, {"kind": "preset", "preset": 3}]
    told = []
    session = Session(told.append)
    for message in messages:
        session.handle(message)
    session.handle({"kind": "inputs", "asked": "x", "values": {"fields": 3, "models": {}}})
    session.end()
    assert [message["kind"] for message in told] == ["failure", "checked"]


def test_pickers_hold_what_is_registered():
    told = []
    session = Session(told.append)
    session.handle({"kind": "hello"})
    session.end()
    (setup,) = told
    assert list(setup["models"]) == list(MODEL_NAMES)
    assert setup["usual_models"] == list(DEFAULT_MODELS)
    assert list(setup["closures"]) == list(CLOSURES)
    assert setup["presets"] == list(PRESETS)
    assert all(setup["models"].values())


def test_lines_of_python_make_the_same_case(tmp_path):
    texts = {"title": "'''+__import__('os').abort()+\"", "numbers__tau_p": "inf"}
    for values in (NUMBERS, POWDER | {"preset": "polyethylene"}):
        case = inputs.read(with_texts(values, **texts)).case
        lines, _, rest = downloads.python_lines(case).partition("result =")
        assert rest.startswith(" tbf.solve(case)\n")
        file = tmp_path / "lines.py"
        file.write_text(lines)
        assert runpy.run_path(str(file))["case"] == case


def test_the_newest_wish_wins():
    started, go, done = threading.Event(), threading.Event(), []

    def long(check):
        started.set()
        go.wait(20)
        check()
        done.append("long")

    failures = []
    thread = worker.Worker(failures.append)
    thread.submit(worker.LIVE, long)
    assert started.wait(20)
    finished = threading.Event()
    thread.submit(worker.MAP, lambda check: finished.set())
    thread.submit(worker.LIVE, lambda check: done.append("older"))
    thread.submit(worker.LIVE, lambda check: done.append("newer"))
    thread.submit(worker.MAP, lambda check: finished.set())
    go.set()
    assert finished.wait(20)
    assert done == ["newer"]
    thread.submit(worker.LIVE, lambda check: 1 / 0)
    thread.submit(worker.FILE, lambda check: started.clear())
    thread.end()
    thread._thread.join(20)
    assert failures == [] or isinstance(failures[0], ZeroDivisionError)


def test_a_map_goes_on_after_what_interrupts_it():
    begun, file, done = threading.Event(), threading.Event(), threading.Event()
    rounds = []

    def map_(check):
        rounds.append(1)
        begun.set()
        if len(rounds) == 1:
            file.wait(20)
        check()
        done.set()

    thread = worker.Worker(pytest.fail)
    thread.submit(worker.MAP, map_)
    assert begun.wait(20)
    thread.submit(worker.FILE, lambda check: rounds.append(2))
    file.set()
    assert done.wait(20)
    thread.end()
    assert rounds == [1, 2, 1]


def test_a_cancelled_run_tells_nothing_more(monkeypatch):
    begun, stopped = threading.Event(), threading.Event()

    def endless(case, check, on_progress=None):
        begun.set()
        try:
            while True:
                check()
        except live.CancelledError:
            stopped.set()
            raise

    monkeypatch.setattr(live, "solved", endless)
    told = []
    session = Session(told.append)
    session.handle({"kind": "inputs", "asked": 1, "values": NUMBERS})
    assert begun.wait(20)
    session.handle({"kind": "cancel"})
    assert stopped.wait(20)
    session.end()
    assert [message["kind"] for message in told] == ["checked", "known", "cancelled"]


def test_map_of_a_powder_asks_the_table_before_it_runs(monkeypatch):
    monkeypatch.setattr(chart, "_run", lambda case, changed, check: chart.Cell("full", "", True))
    monkeypatch.setitem(chart.SIZES, "suspension", (4, 3))
    read = inputs.read(POWDER)
    axes = chart.axes_of("suspension", None)
    cells = {}
    answers = list(chart.judged(read.case, axes, chart.point_of(read.texts, axes), cells, int))
    assert len(cells) == 12
    run = [cell for cell in cells.values() if cell.run]
    assert len(answers) == 12 + len(run)
    assert run
    assert {cell.model for cell in cells.values() if not cell.run} & set(CHEAPEST_FIRST)
    # nothing is computed twice
    assert list(chart.judged(read.case, axes, [None, None], cells, int)) == []


def test_axes_are_fields_with_sliders():
    usual = chart.axes_of("numbers", None)
    for wanted in ("x", [], ["numbers.peclet"] * 2, ["numbers.peclet", "title"], [1, 2]):
        assert chart.axes_of("numbers", wanted) == usual
    wanted = ["numbers.energy_ratio", "numbers.tau_c"]
    assert [axis.name for axis in chart.axes_of("numbers", wanted)] == wanted
    low, high = fields.FIELDS["suspension.diameter"].low, fields.FIELDS["suspension.diameter"].high
    axis = chart.axes_of("suspension", ["suspension.diameter", "suspension.restitution"])[0]
    np.testing.assert_allclose([axis.si(0), axis.si(-1)], [low * 1e-6, high * 1e-6])


def test_what_is_known_at_once_needs_no_run():
    read = inputs.read(POWDER)
    known = answer.at_once(read.case)
    assert known["advice"]["origin"] == "table"
    assert known["advice"]["model"] in MODEL_NAMES
    said = {row["model"]: row["text"] for row in known["advice"]["rows"]}
    assert list(said) == list(MODEL_NAMES)
    # not an error: it leaves out less than what it would be measured against
    assert said["third-order"] == "beyond the reference"
    by_hand = answer.at_once(inputs.read(NUMBERS).case)
    assert by_hand["advice"] is None
    assert len(by_hand["closures"]) == len(known["closures"]) > 20


def test_a_page_that_is_closed_while_it_is_told_something_is_no_failure(caplog):
    from tornado.websocket import WebSocketClosedError

    async def left_unhandled(error):
        asyncio.get_running_loop().set_exception_handler(server.unless_page_closed)
        future = asyncio.get_running_loop().create_future()
        future.set_exception(error)
        del future

    asyncio.run(left_unhandled(WebSocketClosedError()))
    assert not caplog.records
    asyncio.run(left_unhandled(ZeroDivisionError()))
    assert [record.exc_info[0] for record in caplog.records] == [ZeroDivisionError]


def test_port_that_is_taken_is_refused():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        sentence = sentence_of(call("explore", "--no-browser", "--port", port))
    assert f"port {port} can't be used" in sentence
    assert "port is 70000" in sentence_of(call("explore", "--port", 70000))


def test_without_panel_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "panel", None)
    assert "pip install 'triboflux[explorer]'" in sentence_of(call("explore", "--no-browser"))
