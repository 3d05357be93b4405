"""The explorer's page in Chromium: what it shows is what the command line computes."""

import tomllib

import numpy as np
import pytest

from tests.explorer import CHROMIUM, Page, needs_chromium, served
from tests.in_process import call
from triboflux.case import CLOSURE_NAMES, MODEL_NAMES
from triboflux.errors import OutOfRangeError
from triboflux.explorer import inputs
from triboflux.result import load
from triboflux.solve import solve

pytestmark = [needs_chromium, pytest.mark.slow]

HOSTILE = "<img src=x onerror=alert(1)>{{7*7}}"


@pytest.fixture(scope="module")
def address():
    with served() as (server, found):
        yield found
    output, errors = server.communicate(timeout=30)
    # Ctrl-C is how a server is stopped
    assert server.returncode == 0
    assert output == "stopped\n"
    assert errors == ""


@pytest.fixture(scope="module")
def browser():
    api = pytest.importorskip("playwright.sync_api")
    with api.sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield started
        started.close()


@pytest.fixture(scope="module")
def shared(browser, address):
    """Give one page to the tests that leave it as they found it: by numbers, answered."""
    page = Page(browser, address)
    page.by_numbers(peclet="1e6", tau_c="1e-3")
    page.page.wait_for_timeout(100)
    page.done()
    yield page
    page.close()


@pytest.fixture
def page(shared):
    with_numbers = {"peclet": "1e6", "tau_c": "1e-3"}
    shared.by_numbers(**with_numbers)
    for box in shared.page.locator("input[name=model]").all():
        box.set_checked(box.get_attribute("value") in ("full", "semi-algebraic", "gradient"))
    shared.page.select_option("#closures", "derived")
    shared.page.wait_for_timeout(100)
    shared.done()
    return shared


def test_pickers_follow_the_registries(page):
    boxes = page.page.locator("input[name=model]")
    values = boxes.evaluate_all("nodes => nodes.map(node => node.value)")
    assert values == list(MODEL_NAMES)
    options = page.page.locator("#closures option")
    assert options.evaluate_all("nodes => nodes.map(node => node.value)") == list(CLOSURE_NAMES)


def test_numbers_on_the_page_and_files_are_those_of_the_command_line(page, tmp_path):
    with page.answered():
        page.field("numbers.tau_c").fill("2e-3")
    case = page.download("toml", tmp_path)
    theirs = load(page.download("netcdf", tmp_path))
    ran = call("run", case, "-o", tmp_path / "mine.nc", "--quiet")
    assert (ran.code, ran.errors) == (0, "")
    mine = load(tmp_path / "mine.nc")
    assert mine.case == theirs.case
    assert mine.case.numbers.tau_c == 2e-3
    for name in ("charge", "field", "covariance", "variance", "peak_charge"):
        np.testing.assert_allclose(theirs.dataset[name], mine.dataset[name], rtol=1e-12, atol=1e-14)
    end = mine.dataset.isel(time=-1)
    assert f"t* = {float(end['time']):.4g}: peak charge fell to 0.5" in page.text("#when")
    page.page.click("summary:has-text('The profiles in numbers')")
    row = page.page.locator("#profile-table tbody tr").first.inner_text().split("\t")
    assert row[0].strip() == "full"
    for name, cell in zip(("charge", "field", "covariance", "variance"), row[1:], strict=True):
        shown = [float(number) for number in cell.split("…")]
        ranges = [float(end[name].min()), float(end[name].max())]
        np.testing.assert_allclose(shown, ranges, rtol=1e-3)
    # the profiles themselves are told in words, too
    label = page.page.locator("#panels svg").first.get_attribute("aria-label")
    assert "full from -0.5 to 0.5" in label
    assert page.download("figure", tmp_path).read_bytes().startswith(b"\x89PNG")
    lines = page.download("python", tmp_path).read_text()
    assert "tau_c': 0.002" in lines


def test_models_and_closures_are_switched(page):
    headline = page.text("#headline")
    assert headline == "The semi-algebraic model suits this case."
    with page.answered():
        page.page.uncheck("input[value=semi-algebraic]")
    assert page.page.locator("#legend li").all_inner_texts()[1].startswith("gradient")
    with page.answered():
        page.page.select_option("#closures", "published")
    assert page.text("#when").startswith("The full model ends at t* = 4.845")
    page.page.check("input[value=semi-algebraic]")
    page.page.check("input[value=collisional]")
    page.page.wait_for_selector("#error-models:visible")
    assert page.text("#error-models") == "models are 4, but must be from 1 to 3."
    with page.answered():
        page.page.uncheck("input[value=gradient]")


def test_point_is_dragged_and_moved_by_keys(page):
    page.page.wait_for_selector("#map-plot rect.cell")
    point = page.page.locator("#point")
    point.scroll_into_view_if_needed()
    box = point.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    with page.answered():
        page.page.mouse.move(x, y)
        page.page.mouse.down()
        page.page.mouse.move(x, y - 60, steps=3)
        page.page.mouse.move(x, y - 110, steps=3)
        page.page.mouse.up()
    dragged = float(page.field("numbers.tau_c").input_value())
    assert 1e-2 < dragged < 0.5
    assert float(page.field("numbers.peclet").input_value()) == pytest.approx(1e6, rel=0.05)
    assert page.text("#headline") == "The full model is needed."
    with page.answered():
        point.focus()
        page.page.keyboard.press("ArrowDown")
    assert float(page.field("numbers.tau_c").input_value()) < dragged
    assert "Collision time" in point.get_attribute("aria-valuetext")


def test_wrong_and_hostile_texts_are_told_at_their_field(page):
    before = page.text("#when")
    page.field("numbers.peclet").fill(HOSTILE)
    page.field("numbers.restitution").fill("1.5")
    page.page.wait_for_selector("[id='field-numbers.restitution-error']:visible")
    expected = inputs.read(
        {"models": ["full"], "fields": {"numbers.peclet": HOSTILE, "numbers.restitution": "1.5"}}
    ).errors
    for name in ("numbers.peclet", "numbers.restitution"):
        assert page.error(name).inner_text() == expected[name]
        assert page.field(name).get_attribute("aria-invalid") == "true"
        assert f"field-{name}-error" in page.field(name).get_attribute("aria-describedby")
    assert "<img src=x" in page.error("numbers.peclet").inner_text()
    assert page.page.locator("img").count() == 0
    assert page.text("#when") == before
    with page.answered():
        page.field("numbers.restitution").fill("1")
        page.field("numbers.peclet").fill("1e6")
        page.field("title").fill(HOSTILE)
    assert page.error("numbers.peclet").is_hidden()
    assert page.field("numbers.peclet").get_attribute("aria-invalid") is None


def test_title_of_a_stranger_stays_a_text(page, tmp_path):
    with page.answered():
        page.field("title").fill(HOSTILE)
    case = tomllib.loads(page.download("toml", tmp_path).read_text())
    assert case["title"] == HOSTILE
    assert repr(HOSTILE) in page.download("python", tmp_path).read_text()
    assert page.page.locator("img").count() == 0
    with page.answered():
        page.field("title").fill("")


def test_case_outside_the_range_is_refused_in_a_sentence(page):
    page.by_numbers(peclet="100", tau_c="1")
    page.page.wait_for_selector("#failure:visible")
    texts = {"numbers.peclet": "100", "numbers.tau_c": "1"}
    with pytest.raises(OutOfRangeError) as refused:
        solve(inputs.read({"models": ["full"], "fields": texts}).case)
    assert page.text("#failure") == str(refused.value)
    with page.answered():
        page.by_numbers(peclet="1e6", tau_c="1e-3")
    assert page.page.locator("#failure").is_hidden()


def test_time_is_played_and_budgets_follow(page):
    page.page.wait_for_selector("#budget-plots svg")
    assert page.page.locator("#budget-plots svg").count() == 3
    assert page.page.get_by_text("production by charge gradient").count() >= 2
    page.page.locator("#time").fill("0")
    assert page.text("#time-text") == "t = 0"
    page.page.click("#play")
    assert page.text("#play") == "Pause"
    page.page.wait_for_function("document.getElementById('play').textContent === 'Play'")
    assert page.page.locator("#time").input_value() == "30"
    assert page.text("#time-text") != "t = 0"
    page.page.wait_for_function(
        "document.getElementById('budget-when').textContent ==="
        " 'at ' + document.getElementById('time-text').textContent"
    )


def test_everything_is_reached_and_used_by_keyboard(page, tmp_path):
    reached = set()
    page.page.evaluate("document.body.focus(); window.scrollTo(0, 0)")
    page.page.locator("#theme").focus()
    for _ in range(80):
        page.page.keyboard.press("Tab")
        reached.add(
            page.page.evaluate(
                "(({id, dataset, name, value}) => id || dataset.what || `${name} ${value}`)"
                "(document.activeElement)"
            )
        )
    wanted = {f"field-numbers.{name}" for name in ("peclet", "tau_c", "restitution", "tau_sigma")}
    wanted |= {"field-numbers.peclet-slider", "field-title", "field-grid.points", "closures"}
    wanted |= {"play", "time", "point", "axis-0", "axis-1", "budget-model", "download-model"}
    wanted |= {"toml", "netcdf", "figure", "python"} | {f"model {name}" for name in MODEL_NAMES}
    assert wanted <= reached
    page.page.locator("#play").focus()
    page.page.keyboard.press("Enter")
    assert page.text("#play") == "Pause"
    page.page.keyboard.press("Space")
    assert page.text("#play") == "Play"
    with page.answered():
        page.page.locator("[id='field-numbers.tau_c-slider']").focus()
        page.page.keyboard.press("ArrowRight")
    assert float(page.field("numbers.tau_c").input_value()) > 1e-3
    page.page.locator("button[data-what=toml]").focus()
    with page.page.expect_download() as started:
        page.page.keyboard.press("Enter")
    assert started.value.suggested_filename == "case.toml"


def test_two_tabs_know_nothing_of_each_other(page, browser, address):
    other = Page(browser, address, color_scheme="dark")
    other.page.set_viewport_size({"width": 390, "height": 844})
    # the table's answer is there before anything is run
    other.page.wait_for_selector("#rows table")
    other.by_numbers(tau_c="1e-2")
    with page.answered():
        page.field("numbers.tau_c").fill("1e-4")
    other.page.wait_for_timeout(100)
    other.done()
    assert other.text("#headline") == "The full model is needed."
    assert page.text("#headline") == "The algebraic model suits this case."
    # nothing is cut off where the page is narrow, and dark is dark
    assert other.page.evaluate("document.documentElement.scrollWidth") <= 390
    colour = "getComputedStyle(document.body).backgroundColor"
    channels = [int(part) for part in other.page.evaluate(colour)[4:-1].split(",")]
    assert max(channels) < 60
    other.page.click("#theme")
    assert min(int(part) for part in other.page.evaluate(colour)[4:-1].split(",")) > 200
    other.close()


def test_powder_with_presets_and_units(page):
    with page.answered():
        page.page.check("input[name=kind][value=suspension]")
        page.page.select_option("#preset", "polyethylene")
    assert page.field("suspension.diameter").input_value() == "362.5 um"
    assert " s" in page.text("#time-text")
    assert page.page.locator("#panels .unit").first.text_content() == "in C"
    page.page.wait_for_selector("#map-plot rect.cell")
    assert "by the table of the package" in page.text("#map-words")
    with page.answered():
        page.field("suspension.diameter").fill("0.5 mm")
    mass = page.page.locator("#coefficients tr:has-text('mass of a particle')").inner_text()
    assert "61.2 µg" in mass.replace("ug", "µg")
    page.field("suspension.diameter").fill("3 kg")
    page.page.wait_for_selector("[id='field-suspension.diameter-error']:visible")
    assert "is a mass, expected a length" in page.error("suspension.diameter").inner_text()
    with page.answered():
        page.field("suspension.diameter").fill("362.5 um")


def test_long_run_shows_progress_and_is_cancelled(browser, address):
    page = Page(browser, address)
    page.done()
    answer = page.text("#when")
    # so many that it is not over before a busy machine gets to look
    page.page.select_option("[id='field-grid.points']", "256")
    page.page.select_option("[id='field-grid.dimensions']", "2")
    page.page.wait_for_selector("#busy:visible")
    assert page.page.locator("progress").is_visible()
    page.page.click("#cancel")
    page.page.wait_for_selector("#busy", state="hidden")
    assert "Cancelled" in page.page.locator("#status").text_content()
    assert page.text("#when") == answer
    page.close()
