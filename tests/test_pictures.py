"""Figures, animations and words of a result, and how it looks in a notebook."""

import base64
import io
import os
import subprocess
from html.parser import HTMLParser

import numpy as np
import pytest
from matplotlib.animation import FFMpegWriter
from matplotlib.collections import PolyCollection
from PIL import Image

from tests.cases import data, fake_result
from tests.test_convert import kinetic_result, result_in
from triboflux import presets
from triboflux.case import Case
from triboflux.errors import InputError, TribofluxError
from triboflux.figures import pictures
from triboflux.result import Result


def result_in_si(points):
    fields = data(suspension=presets.glass_beads(), grid__points=points, initial={})
    del fields["numbers"]
    return fake_result(Case(**fields)).to_si()


# --------------------------------------------------------------------- figures


def test_profiles_show_the_state_in_the_middle_of_the_box():
    result = result_in(1)
    axes = result.plot(1).axes
    for ax, name in zip(axes, ("charge", "field", "covariance", "variance"), strict=True):
        values = np.ravel(result.dataset[name][1])
        line = ax.get_lines()[-2]  # the last one is at zero
        np.testing.assert_allclose(line.get_xdata(), np.arange(-3, 4) / 6, atol=1e-15)
        np.testing.assert_array_equal(line.get_ydata(), np.append(np.roll(values, 3), values[3]))
    np.testing.assert_array_equal(
        axes[0].get_lines()[0].get_ydata()[:-1], np.roll(result.dataset["charge"][0], 3)
    )


def test_profiles_of_particles_have_two_standard_errors_to_both_sides():
    result = kinetic_result()
    figure = result.plot()
    assert figure.get_suptitle().startswith("Simulation of charged particles, ")
    (band,) = (part for part in figure.axes[0].collections if isinstance(part, PolyCollection))
    values, error = (
        result.dataset[name][-1].values for name in ("charge", "charge_standard_error")
    )
    found = band.get_paths()[0].get_extents()
    assert found.y0 == pytest.approx((values - 2 * error).min())
    assert found.y1 == pytest.approx((values + 2 * error).max())


def test_a_model_without_variance_says_so():
    whole = result_in(1, model="gradient").dataset
    figure = Result(whole.drop_vars(["variance", "realizability_margin"])).plot()
    assert [text.get_text() for text in figure.axes[3].texts] == ["the gradient model has none"]


def test_maps_show_charge_and_size_of_the_field():
    result = result_in(2)
    charge, field = (ax.get_images()[0].get_array() for ax in result.plot(0).axes[:2])
    state = result.dataset.isel(time=0)
    np.testing.assert_array_equal(charge[:-1, :-1], np.roll(state["charge"].T, (2, 3), (0, 1)))
    np.testing.assert_array_equal(charge[-1], charge[0])
    size = np.sqrt((state["field"] ** 2).sum("component"))
    np.testing.assert_allclose(field[:-1, :-1], np.roll(size.T, (2, 3), (0, 1)))


def test_a_box_is_cut_through_its_largest_charge_and_the_caption_says_where():
    result = result_in_si([6, 5, 4])
    result.dataset["charge"][-1, 2, 1, 3] = 1e-9
    figure = result.plot()
    image = figure.axes[0].get_images()[0].get_array()
    np.testing.assert_array_equal(
        image[:-1, :-1], np.roll(result.dataset["charge"][-1, :, :, 3].T, (2, 3), (0, 1))
    )
    place = float(result.dataset["z"][3]) - result.case.suspension.domain_length
    assert f"Plane $z = {place:.4g}$ m, through the largest charge" in figure.get_suptitle()
    assert figure.axes[0].get_xlabel() == "$x$ (m)"


@pytest.mark.parametrize("dimensions", [1, 2])
@pytest.mark.parametrize("value", [np.nan, 0.0, np.inf])
def test_states_without_a_range_are_drawn(dimensions, value):
    result = result_in(dimensions)
    for name in ("charge", "field"):
        result.dataset[name][:] = value
    result.plot().savefig(io.BytesIO(), dpi=30)
    assert pictures.description(result)


def test_there_is_no_such_time():
    with pytest.raises(InputError, match=r"^time is 3, but must be a whole number from -3 to 2\."):
        result_in(1).plot(3)


# ------------------------------------------------------------------ animations


@pytest.mark.parametrize("dimensions", [1, 3])
def test_a_gif_has_a_frame_for_each_time(tmp_path, dimensions):
    result, seen = result_in(dimensions), []
    pictures.animate(result, tmp_path / "out.gif", fps=4.0, on_progress=seen.append)
    with Image.open(tmp_path / "out.gif") as image:
        assert image.n_frames == 3
        assert image.info["duration"] == 250
        frames = []
        for number in range(3):
            image.seek(number)
            frames.append(np.asarray(image.convert("L"), dtype=float))
    assert not np.array_equal(frames[0], frames[1])
    assert not np.array_equal(frames[1], frames[2])
    assert [step.fraction for step in seen] == [1 / 3, 2 / 3, 1.0]
    assert os.listdir(tmp_path) == ["out.gif"]


def test_axes_and_colours_stay_during_an_animation(tmp_path, monkeypatch):
    limits = []
    result = result_in(2)
    grab = pictures.PillowWriter.grab_frame

    def watch(self, **options):
        limits.append([ax.get_images()[0].get_clim() for ax in self.fig.axes[:2]])
        grab(self, **options)

    monkeypatch.setattr(pictures.PillowWriter, "grab_frame", watch)
    result.animate(tmp_path / "out.gif")
    largest = float(abs(result.dataset["charge"]).max())
    assert [found[0] for found in limits] == [(-largest, largest)] * 3
    size = float(np.sqrt((result.dataset["field"] ** 2).sum("component")).max())
    np.testing.assert_allclose([found[1] for found in limits], [(0.0, size)] * 3)


@pytest.mark.skipif(not FFMpegWriter.isAvailable(), reason="needs ffmpeg")
def test_mp4(tmp_path):
    result_in(1).animate(tmp_path / "out.mp4")
    assert (tmp_path / "out.mp4").read_bytes()[4:8] == b"ftyp"


def test_mp4_without_ffmpeg_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(FFMpegWriter, "isAvailable", lambda: False)
    with pytest.raises(InputError, match=r"^an animation in MP4 needs the program ffmpeg, which"):
        result_in(1).animate(tmp_path / "out.mp4")
    assert os.listdir(tmp_path) == []


def test_a_failing_ffmpeg_is_told_and_leaves_nothing(tmp_path, monkeypatch):
    def fail(self, **options):
        raise subprocess.CalledProcessError(183, "ffmpeg")

    monkeypatch.setattr(pictures.PillowWriter, "grab_frame", fail)
    monkeypatch.setattr(pictures.PillowWriter, "finish", lambda self: None)
    with pytest.raises(TribofluxError, match=r"can't be written: ffmpeg ended with exit code 183"):
        result_in(1).animate(tmp_path / "out.gif")
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("fps", [0.0, -1.0, 61.0, float("nan"), float("inf")])
def test_bad_speeds_and_endings_are_refused(tmp_path, fps):
    with pytest.raises(InputError, match=r"^fps is .*, but must be a number from 0\.1 to 60\.$"):
        result_in(1).animate(tmp_path / "out.gif", fps=fps)
    with pytest.raises(InputError, match=r"^path is '.*out\.avi', but must end in \.gif or \.mp4"):
        result_in(1).animate(tmp_path / "out.avi")
    assert os.listdir(tmp_path) == []


# ------------------------------------------------------------------- notebooks


class Page(HTMLParser):
    """Collects elements, attributes and text, and refuses elements that do not match."""

    def __init__(self, text):
        super().__init__()
        self.open, self.elements, self.images, self.text = [], [], [], ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.elements.append(tag)
        if tag == "img":
            self.images.append(dict(attrs))
        else:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data + "\n"


HOSTILE = "<script>alert('1')</script> & \" $x^$"


def test_a_notebook_shows_case_status_warnings_and_figure():
    result = result_in(1, title="A <b>bold</b> & $title")
    page = Page(result._repr_html_())
    for told in ("A <b>bold</b> & $title", "ok: end time", "full model, derived closures"):
        assert told in page.text
    assert "covariance is unrealizable" in page.text
    assert "peclet = 1e+06, tau_c = 0.1, tau_p = inf" in page.text
    (image,) = page.images
    assert image["alt"] == pictures.description(result)
    low, high = result.dataset["charge"][-1].values.min(), result.dataset["charge"][-1].values.max()
    assert f"charge from {low:.4g} to {high:.4g}" in image["alt"]
    kind, _, content = image["src"].partition(",")
    assert kind == "data:image/png;base64"
    assert Image.open(io.BytesIO(base64.b64decode(content))).size[0] > 400


def test_nothing_in_a_notebook_is_taken_for_html():
    fields = data(grid__points=[6], title=HOSTILE)
    result = fake_result(
        Case(**fields), status=HOSTILE, stop_reason=HOSTILE, warnings=[HOSTILE, HOSTILE]
    )
    page = Page(result._repr_html_())
    assert page.text.count(HOSTILE) == 5
    assert set(page.elements) <= {
        "div",
        "p",
        "strong",
        "table",
        "tr",
        "th",
        "td",
        "ul",
        "li",
        "img",
    }


def test_a_notebook_in_si_says_which_sentences_are_scaled():
    page = Page(result_in_si([6])._repr_html_())
    assert "covariance is unrealizable (scaled)" in page.text
    assert " C, " in page.images[0]["alt"]
