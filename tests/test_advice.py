"""Which model is proposed, from errors that are known, near 5 %, or not known."""

import pytest

from triboflux import advice, model_table
from triboflux.advice import advice_from, advise
from triboflux.errors import InputError
from triboflux.model_errors import CHEAPEST_FIRST, ModelError, ModelErrors
from triboflux.model_table import Coordinates, numbers_at

PLACE = Coordinates(lag=0.02, energy_ratio=30.0, exchange=5.0, drag=2.0, solid_fraction=0.05)


def errors(*values, spread=1.0):
    """Return errors of the models, the cheapest first; a text is a status."""
    return ModelErrors(
        "ok",
        models=tuple(
            ModelError(model, value)
            if isinstance(value, str)
            else ModelError(model, "ok", value, value / spread, value * spread)
            for model, value in zip(CHEAPEST_FIRST, values, strict=True)
        ),
    )


@pytest.mark.parametrize(
    ("values", "model"),
    [
        ((0.05, 0.04, 0.03, 0.02), "collisional"),
        ((0.051, 0.05, 0.03, 0.02), "gradient"),
        ((0.9, 0.06, 0.05, 0.02), "algebraic"),
        ((0.9, 0.06, 0.06, 0.05), "semi-algebraic"),
        ((0.9, 0.8, "nonphysical", 0.01), "semi-algebraic"),
        ((0.9, 0.8, "nonphysical", 0.06), "full"),
        (("refused", "refused", "refused", "refused"), "full"),
        # a collisional model does not rest on the algebraic covariance, a gradient model does
        ((0.01, 0.02, "nonphysical", 0.2), "collisional"),
        ((0.9, 0.02, "nonphysical", 0.2), "full"),
    ],
)
def test_the_cheapest_model_within_the_tolerance(values, model):
    proposed = advice_from(errors(*values), "computed")
    assert proposed.model == model
    reasons = proposed.reasons
    assert not any("--compute" in reason for reason in reasons)
    if model == "full":
        assert reasons[-1] == "No reduced model is within 5 % of the full one."
    else:
        error = values[CHEAPEST_FIRST.index(model)]
        told = f"The {model} model is the cheapest within 5 %: its error is {100 * error:.2g} %."
        assert reasons[-1] == told


def test_luck_is_told():
    reasons = advice_from(errors(1.0, 0.02, "nonphysical", 0.2), "computed").reasons
    assert reasons[0] == (
        "The gradient model's error of 2 % is luck: the semi-algebraic model, which leaves out "
        "less, has 20 %."
    )


def test_what_the_table_leaves_open_is_told():
    near = errors(0.9, 0.04, "beside entries without error (nonphysical)", 0.01, spread=1.5)
    proposed = advice_from(near, "table")
    assert proposed.model == "semi-algebraic"
    assert proposed.reasons == (
        "The semi-algebraic model is the cheapest within 5 %: its error is 1 % (0.67 % to 1.5 %).",
        "The table leaves open whether gradient or algebraic is, too; `triboflux numbers "
        "--compute` runs all models for exactly this case.",
    )
    # what is dearer than the proposed model does not matter, nor what is surely wrong
    surely = advice_from(errors(0.9, 0.01, 0.05, 0.01, spread=1.5), "table")
    assert len(surely.reasons) == 1


def test_table_and_runs_agree_about_a_case():
    numbers = numbers_at(PLACE)
    found = advise(numbers)
    assert found.origin == "table"
    expected = model_table.load().interpolated(PLACE, "derived")
    assert [m.error for m in found.errors] == pytest.approx([m.error for m in expected.models])


def test_beyond_the_table_the_full_model_is_on_the_safe_side(monkeypatch):
    numbers = numbers_at(PLACE._replace(energy_ratio=2e3))
    found = advise(numbers)
    assert (found.model, found.errors, found.origin) == ("full", (), "none")
    assert found.reasons == (
        "The table of the models' errors does not answer: energy_ratio is 2e+03, and the table "
        "goes from 0.1 to 1e+03. The full model is on the safe side; `triboflux numbers --compute` "
        "runs all models for exactly this case.",
    )
    asked = []

    def pretend(given, name):
        asked.append((given, name))
        return errors(0.9, 0.03, "nonphysical", 0.001)

    monkeypatch.setattr(advice, "measure", pretend)
    found = advise(numbers, "published", compute=True)
    assert (found.model, found.origin) == ("gradient", "computed")
    assert asked == [(numbers, "published")]
    unlucky = ModelErrors("diverged", "the full model: the step size collapsed at t = 1")
    monkeypatch.setattr(advice, "measure", lambda *_: unlucky)
    found = advise(numbers, compute=True)
    assert (found.model, found.origin) == ("full", "none")
    assert found.reasons == (
        "No reduced model can be judged: the full model: the step size collapsed at t = 1.",
    )


@pytest.mark.parametrize("compute", [False, True])
def test_no_model_is_judged_where_the_variance_grows(compute):
    numbers = numbers_at(PLACE._replace(lag=0.3, exchange=10.0))
    found = advise(numbers, "published", compute=compute)
    assert (found.model, found.errors, found.origin) == ("full", (), "none")
    (reason,) = found.reasons
    assert reason.startswith("F = -")
    assert reason.endswith("would grow by itself: no model is judged against the full one.")


def test_unknown_closures():
    with pytest.raises(InputError, match="publishd"):
        advise(numbers_at(PLACE), "publishd")
