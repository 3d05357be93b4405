"""The errors of all reduced models in one case, by running them."""

import pytest

from triboflux import model_errors
from triboflux.model_errors import CHEAPEST_FIRST, measure, percent
from triboflux.model_table import Coordinates, numbers_at
from triboflux.numbers import Numbers
from triboflux.suitability import chart_case, suitability

PLACE = Coordinates(lag=0.05, energy_ratio=30.0, exchange=5.0, drag=2.0, solid_fraction=0.05)


@pytest.mark.slow
def test_errors_are_those_of_the_chart(tmp_path):
    axes = ("numbers.peclet", [1e6, 1e7]), ("numbers.tau_c", [1e-3, 1e-2])
    chart = suitability(chart_case(), axes=axes, store_folder=tmp_path, workers=1)
    for peclet in axes[0][1]:
        point = chart.sel(peclet=peclet, tau_c=1e-2)
        numbers = chart_case().numbers.model_copy(update={"peclet": peclet, "tau_c": 1e-2})
        found = measure(numbers)
        assert found.status == "ok"
        assert found.stop_time == pytest.approx(float(point["stop_time"]), rel=1e-6)
        assert found.models[-1].model == "semi-algebraic"
        assert found.models[-1].error == pytest.approx(float(point["error"]), rel=1e-4)
        assert found.models[-1].error > 0.05


def test_without_field_all_algebraic_covariances_are_the_same():
    found = measure(numbers_at(PLACE._replace(energy_ratio=1e-12)), points=32)
    collisional, *others = found.models
    assert [each.model for each in found.models] == list(CHEAPEST_FIRST)
    assert all(each.error == pytest.approx(others[0].error, rel=1e-3) for each in others)
    assert 1e-4 < others[0].error < 0.1 < collisional.error
    assert all(each.low == each.error == each.high for each in found.models)


def test_an_algebraic_variance_that_is_singular_has_its_status():
    found = measure(Numbers(**chart_case().numbers.model_dump() | {"tau_c": 1e-2}), points=32)
    assert {each.model: each.status for each in found.models} == {
        "collisional": "ok",
        "gradient": "ok",
        "algebraic": "nonphysical",
        "semi-algebraic": "ok",
    }


def test_cases_that_cannot_be_judged(monkeypatch):
    grows = measure(numbers_at(PLACE._replace(lag=0.3, exchange=10.0)), "published")
    assert (grows.status, grows.models) == ("F <= 0", ())
    assert grows.reason.startswith("F = -")
    monkeypatch.setattr(model_errors, "_RELAXATIONS", 1e-3)
    monkeypatch.setattr(model_errors, "_CROSSINGS", 1e-3)
    early = measure(numbers_at(PLACE), points=32)
    assert (early.status, early.models) == ("not halved", ())
    assert early.reason.startswith("the largest charge has not halved by t = 0.")


@pytest.mark.parametrize(
    ("error", "text"),
    [(None, ""), (0.5, "50 %"), (0.01234, "1.2 %"), (1e-4, "< 0.01 %"), (3e-7, "< 0.01 %")],
)
def test_percent(error, text):
    assert percent(error) == text
