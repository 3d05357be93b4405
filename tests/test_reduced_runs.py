"""Runs of the reduced models from a case to a result: budgets, warnings, files, units."""

import math

import equinox as eqx
import numpy as np
import pytest
import xarray as xr

import triboflux
from tests.cases import data
from tests.paper_runs import changed, paper_run
from tests.test_result_units import POWDER
from triboflux import closures, models
from triboflux.case import Case
from triboflux.dataset import build_dataset
from triboflux.diagnostics import budget, model_of, unused_initial_warnings
from triboflux.errors import InputError, OutOfRangeError
from triboflux.initial_state import initial_fields
from triboflux.numbers import Numbers
from triboflux.result import Result
from triboflux.scales import Scales

EVOLVED = {
    "semi-algebraic": ("charge", "variance"),
    "algebraic": ("charge",),
    "gradient": ("charge",),
    "collisional": ("charge",),
}
WITHOUT_VARIANCE = ("gradient", "collisional")
# All four run on the derived case A with outputs close together.
STEP, MIDDLE = 0.25, 30.0
TIMES = (*(MIDDLE + STEP * i for i in range(-2, 3)), 40.0)


def case_a(model):
    return paper_run(1, "derived", model=model, run__outputs=TIMES, run__rtol=1e-9)


# --- budgets --------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", EVOLVED)
def test_terms_sum_to_the_measured_rate_of_change(model):
    result = case_a(model)
    terms = budget(result, time=MIDDLE)
    assert set(terms.data_vars) == set(EVOLVED[model])
    for name in EVOLVED[model]:
        far, near, _, next_one, last = (result.dataset[name].values[i] for i in range(5))
        measured = (far - 8 * near + 8 * next_one - last) / (12 * STEP)
        total = terms[name].sum(f"{name}_term").values
        np.testing.assert_allclose(total, measured, rtol=0, atol=2e-5 * np.max(np.abs(measured)))


@pytest.mark.parametrize("model", EVOLVED)
def test_terms_keep_the_groups_of_the_full_model(model):
    terms = budget(case_a(model), time=MIDDLE)
    groups = list(terms["charge_group"].values)
    flux = {"gradient": 2, "collisional": 0}.get(model, 3)
    others = ["triboconductivity", "collisional dispersion"]
    assert groups == ["kinetic flux"] * flux + others
    assert set(terms["charge_equation"].values) == {"(5.2)"}
    if model == "semi-algebraic":
        produced = "production by covariance and charge gradient"
        assert list(terms["variance_group"].values).count(produced) == 3


@pytest.mark.parametrize("model", EVOLVED)
def test_model_of_a_result_is_its_own(model):
    assert model_of(case_a(model)).name == model


def test_the_collisional_model_only_disperses():
    result = case_a("collisional")
    assert not result.dataset["covariance"].any()
    # Q = -sin 2πx exp(-4π² t/Pe).
    decay = np.exp(-4.0 * np.pi**2 * 1e-6 * result.dataset["time"])
    np.testing.assert_allclose(result.dataset["peak_charge"], decay, rtol=1e-12)


# --- warnings -------------------------------------------------------------------------------------


def test_semi_algebraic_case_b_is_not_realizable():
    result = paper_run(2, "published", model="semi-algebraic")
    (told,) = [sentence for sentence in result.warnings if "realizable" in sentence]
    margin = result.dataset["realizability_margin"]
    expected = result.dataset["variance"] - (result.dataset["covariance"] ** 2).sum("component")
    np.testing.assert_array_equal(margin, expected)
    assert f"by up to {-float(margin.min()):.3g}" in told
    # It overestimates the covariance of the full model at its own stop, 1.135.
    assert float(abs(result.dataset["covariance"][-1]).max()) == pytest.approx(1.734, abs=1e-3)
    assert told.endswith("The algebraic covariance does not know this bound.")
    # In case A too, but only where the variance begins at zero and the covariance does not.
    (told,) = paper_run(1, "published", model="semi-algebraic").warnings
    assert "by up to 8.88e-07 at t = 0" in told
    assert "; 0% of the box at the end." in told


@pytest.mark.parametrize("model", WITHOUT_VARIANCE)
def test_without_variance_nothing_is_said_about_it(model):
    result = case_a(model)
    assert "variance" not in result.dataset
    assert "realizability_margin" not in result.dataset
    assert result.warnings == ()
    # The published F is negative here, which concerns only models with a variance.
    numbers = Numbers(peclet=1e5, tau_c=0.1, length_ratio=192.0, restitution=1.0, energy_ratio=1.0)
    closure_set = closures.by_name("published", 1.0, 0.8)
    told = {
        name: models.validity(
            models.build(name, numbers, closure_set).coefficients, closure_set, model_name=name
        )
        for name in (model, "semi-algebraic")
    }
    assert not [sentence for sentence in told[model] if "variance grows" in sentence]
    assert [sentence for sentence in told["semi-algebraic"] if "variance grows" in sentence]


@pytest.mark.parametrize("model", ["full", *EVOLVED])
def test_unused_initial_moments_are_told(model):
    case = Case(
        **data(
            model=model,
            numbers__tau_c=1e-4,
            grid__points=[12],
            initial__variance=[{"mode": [0], "cosine": 0.5}],
            initial__covariance=[{"component": 0, "mode": [1], "cosine": 1e-3}],
        )
    )
    told = unused_initial_warnings(case, models.build(model, case.numbers))
    evolved = ("charge", "covariance", "variance") if model == "full" else EVOLVED[model]
    assert told == [
        f"initial.{name} is not used: the {model} model has no equation for it."
        for name in ("covariance", "variance")
        if name not in evolved
    ]
    if model == "gradient":
        assert list(triboflux.solve(case).warnings) == told


# --- range of validity ----------------------------------------------------------------------------


@pytest.mark.parametrize("model", ["full", *EVOLVED])
@pytest.mark.parametrize(
    ("field", "refused"),
    [
        ("covariance_destruction", ("full", "semi-algebraic", "algebraic", "gradient")),
        ("variance_flux_destruction", ("full", "semi-algebraic")),
        ("third_moment", ("full",)),
        ("third_moment_trace", ("full",)),
        ("shear", ("full",)),
        ("divergence_dispersion", ("full",)),
    ],
)
def test_only_what_a_model_contains_is_checked(model, field, refused):
    closure_set = closures.by_name("derived", 1.0, 0.8)
    numbers = Numbers(**data()["numbers"])
    found = models.build(model, numbers, closure_set).coefficients
    broken = eqx.tree_at(lambda c: getattr(c, field), found, -1e3)
    if model in refused:
        with pytest.raises(OutOfRangeError):
            models.validity(broken, closure_set, model_name=model)
    else:
        assert models.validity(broken, closure_set, model_name=model) == ()


# --- files and units ------------------------------------------------------------------------------


@pytest.mark.parametrize("model", EVOLVED)
def test_a_file_gives_back_what_was_written(model, tmp_path):
    result = case_a(model)
    result.to_netcdf(tmp_path / "out.nc")
    loaded = triboflux.load(tmp_path / "out.nc")
    xr.testing.assert_identical(loaded.dataset, result.dataset)
    assert ("variance" in loaded.dataset) == (model not in WITHOUT_VARIANCE)
    xr.testing.assert_identical(budget(loaded), budget(result))


@pytest.mark.parametrize("model", WITHOUT_VARIANCE)
def test_units_and_back(model, tmp_path):
    case = Case(
        **{
            "model": model,
            "suspension": POWDER,
            "grid": {"points": [8]},
            "initial": {"charge": [{"mode": [1], "sine": 1.0}]},
            "run": {"t_end": 1.0},
        }
    )
    vector = np.random.default_rng(1).normal(size=(2, 1, 8))
    scaled = Result(
        build_dataset(
            case,
            [0.0, 1.0],
            charge=vector[:, 0],
            covariance=0.1 * vector,
            field=vector,
            potential=vector[:, 0],
            peak_charge=[1.0, 0.5],
            status="ok",
            stop_reason="end time",
            stats={},
        )
    )
    in_si = scaled.to_si()
    assert "variance" not in in_si.dataset
    factor = Scales.of(POWDER).covariance
    np.testing.assert_allclose(in_si.dataset["covariance"], 0.1 * factor * vector, rtol=1e-14)
    assert in_si.dataset["covariance"].attrs["units"] == "C m s-1"
    in_si.to_netcdf(tmp_path / "out.nc")
    xr.testing.assert_allclose(
        triboflux.load(tmp_path / "out.nc").to_scaled().dataset, scaled.dataset, rtol=1e-14
    )


def test_a_file_without_variance_starts_what_needs_none(tmp_path):
    path = tmp_path / "out.nc"
    case_a("gradient").to_netcdf(path)
    start = {"file": str(path)}
    for model in ("full", "semi-algebraic"):
        case = changed(case_a("gradient").case, model=model, initial=start)
        told = (
            r"^initial.file is .*out.nc', a result of the gradient model, which knows no "
            rf"variance, but the {model} model starts from one\.$"
        )
        with pytest.raises(InputError, match=told):
            initial_fields(case)
    last = case_a("gradient").dataset["charge"][-1]
    for model in ("algebraic", "gradient", "collisional"):
        charge, covariance, variance = initial_fields(
            changed(case_a("gradient").case, model=model, initial=start)
        )
        np.testing.assert_array_equal(charge, last)
        assert covariance.shape == (1, 128)
        assert not covariance.any()
        assert not variance.any()


def test_a_file_of_a_reduced_model_starts_the_full_one(tmp_path):
    path, result = tmp_path / "out.nc", case_a("semi-algebraic")
    result.to_netcdf(path)
    for model in ("full", "semi-algebraic"):
        case = changed(result.case, model=model, initial={"file": str(path)})
        charge, covariance, variance = initial_fields(case)
        np.testing.assert_array_equal(charge, result.dataset["charge"][-1])
        np.testing.assert_array_equal(variance, result.dataset["variance"][-1])
        np.testing.assert_array_equal(
            covariance, result.dataset["covariance"][-1] if model == "full" else 0.0 * covariance
        )


def test_a_nonphysical_variance_starts_only_what_does_not_use_it(tmp_path):
    path, result = tmp_path / "out.nc", paper_run(1, "published", model="algebraic")
    assert result.status == "nonphysical"
    result.to_netcdf(path)
    start = {"initial": {"file": str(path)}}
    charge, _, variance = initial_fields(changed(result.case, model="gradient", **start))
    assert charge.any()
    assert not variance.any()
    with pytest.raises(InputError, match=r"variance is -.*, but must not be negative anywhere"):
        initial_fields(changed(result.case, model="full", **start))
    singular = result.dataset.copy(deep=True)
    singular["variance"][-1, 3] = math.inf
    Result(singular).to_netcdf(path, overwrite=True)
    with pytest.raises(InputError, match="whose last variance is not finite"):
        initial_fields(changed(result.case, model="full", **start))
