"""Budgets: every term of every equation, their sum, and what the paper says of their sizes."""

import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr

import triboflux
from tests.cases import data, fake_result
from tests.fields import CASE_B, EVERYTHING, smooth_state
from tests.paper_runs import CASES, changed, paper_run
from triboflux import diagnostics
from triboflux.case import Case
from triboflux.diagnostics import budget, model_of
from triboflux.errors import InputError
from triboflux.grid import Grid
from triboflux.moments import Moments
from triboflux.result import Result

MOMENTS = ("charge", "covariance", "variance")
# Name, group and equation of every term; the groups are those of Figs. 4-5.
NAMED = {
    "charge": [
        ("kinetic flux", "kinetic flux", "(5.2)"),
        ("triboconductivity", "triboconductivity", "(5.2)"),
        ("collisional dispersion", "collisional dispersion", "(5.2)"),
    ],
    "covariance": [
        ("production by charge gradient", "production", "(5.3)"),
        ("production by electric field", "production", "(5.3)"),
        ("electric force", "electric force", "(5.3)"),
        ("destruction", "destruction", "(5.3)"),
        ("dispersion", "dispersion", "(3.7)"),
        ("dispersion of the divergence", "dispersion", "(3.7)"),
    ],
    "variance": [
        (
            "production by charge gradient",
            "production by covariance and charge gradient",
            "(5.4)",
        ),
        ("production by electric field", "production by electric field", "(5.4)"),
        ("destruction", "destruction", "(5.4)"),
        ("collisional dispersion", "collisional dispersion", "(5.4)"),
        ("kinetic dispersion", "kinetic dispersion", "(5.4)"),
    ],
}
BOXES = {1: ((24,), (0.8,)), 2: ((16, 18), (1.0, 2.0))}


def smooth_result(dimensions):
    """Return a result with every mechanism on and smooth fields at its last time."""
    points, lengths = BOXES[dimensions]
    case = Case(
        **data(
            numbers=EVERYTHING,
            grid={"points": points, "lengths": lengths},
            initial={},
        )
    )
    result = fake_result(case)
    state = smooth_state(Grid(points, lengths), highest=2)
    for name in MOMENTS:
        result.dataset[name][-1] = np.asarray(getattr(state, name))
    return result


def derivative(field, axis, lengths):
    """Return a derivative along an axis of space, the last ones, by plain Fourier transforms."""
    axis -= len(lengths)
    points = field.shape[axis]
    k = 2 * np.pi * np.fft.fftfreq(points, 1 / points) / lengths[axis]
    k = k.reshape([-1 if i == axis % len(lengths) else 1 for i in range(len(lengths))])
    return np.fft.ifft(1j * k * np.fft.fft(field, axis=axis), axis=axis).real


def terms_by_hand(charge, covariance, variance, lengths, c):
    """Return the terms of section 5.1 in vector form, in the order of the budget."""
    axes = range(len(lengths))
    k = np.meshgrid(
        *(
            2 * np.pi * np.fft.fftfreq(n, 1 / n) / length
            for n, length in zip(charge.shape, lengths, strict=True)
        ),
        indexing="ij",
    )
    squared = sum(component**2 for component in k)
    squared.flat[0] = np.inf
    potential = np.fft.fftn(charge) / squared
    field = np.stack([np.fft.ifftn(-1j * component * potential).real for component in k])

    def gradient(f):
        return np.stack([derivative(f, axis, lengths) for axis in axes])

    def divergence(f):
        return sum(derivative(f[axis], axis, lengths) for axis in axes)

    def laplacian(f):
        return sum(derivative(derivative(f, axis, lengths), axis, lengths) for axis in axes)

    return {
        "charge": [
            -c.flux * divergence(covariance),
            -c.triboconductivity * divergence(field),
            c.dispersion * laplacian(charge),
        ],
        "covariance": [
            -c.gradient_production * gradient(charge),
            c.field_production * field,
            c.electric_force * variance * field,
            -c.covariance_destruction * covariance,
            c.covariance_dispersion * laplacian(covariance),
            c.divergence_dispersion * gradient(divergence(covariance)),
        ],
        "variance": [
            -2.0 * np.sum(covariance * gradient(charge), axis=0),
            c.variance_field_production * np.sum(field**2, axis=0),
            -c.variance_destruction * variance,
            c.variance_collisional_dispersion * laplacian(variance),
            laplacian(variance) / c.variance_flux_destruction,
        ],
    }


# ------------------------------------------------------------------ budgets


@pytest.mark.parametrize("dimensions", [1, 2])
def test_every_term_is_the_one_written_by_hand(dimensions):
    result = smooth_result(dimensions)
    terms = budget(result)
    last = result.dataset.isel(time=-1)
    model = model_of(result)
    fields = [last[name].values for name in MOMENTS]
    expected = terms_by_hand(*fields, BOXES[dimensions][1], model.coefficients)
    for name in MOMENTS:
        assert terms[name].dims == (f"{name}_term", *last[name].dims)
        for (label, _, _), values in zip(NAMED[name], expected[name], strict=True):
            found = terms[name].sel({f"{name}_term": label}).values
            size = np.max(np.abs(values))
            assert size > 0.0
            np.testing.assert_allclose(found, values, rtol=0, atol=1e-12 * size, err_msg=label)


def test_terms_have_name_group_and_equation():
    terms = budget(smooth_result(2))
    for name in MOMENTS:
        labels = [terms[f"{name}_{what}"].values for what in ("term", "group", "equation")]
        assert list(zip(*labels, strict=True)) == NAMED[name]
        assert len(set(labels[0])) == len(labels[0])
    assert set(terms.coords) >= {"time", "component", "x", "y"}


def test_sum_of_terms_is_the_right_hand_side():
    result = smooth_result(2)
    terms = budget(result)
    grid = Grid(*BOXES[2])
    calculus = diagnostics.FourierCalculus(grid)
    last = result.dataset.isel(time=-1)
    state = Moments(*(grid.to_spectral(jnp.asarray(last[name].values)) for name in MOMENTS))
    rates = model_of(result).right_hand_side(calculus, state)
    for name in MOMENTS:
        expected = np.asarray(grid.to_fields(getattr(rates, name)))
        size = float(np.abs(terms[name]).max())
        total = terms[name].sum(f"{name}_term")
        np.testing.assert_allclose(total, expected, rtol=0, atol=1e-14 * size)


def by_differences(dataset, name, step):
    """Return the time derivative at the third of five times from one output to the next."""
    before2, before, _, after, after2 = (dataset[name].values[i] for i in range(5))
    return (before2 - 8 * before + 8 * after - after2) / (12 * step)


def test_sum_of_terms_is_the_measured_rate_of_change():
    step = 2e-3
    times = tuple(0.1 + step * i for i in range(-2, 3))
    result = paper_run(2, "published", run__outputs=(*times, 0.15), run__rtol=1e-9)
    terms = budget(result, time=0.1)
    assert float(terms["time"]) == pytest.approx(0.1)
    for name in MOMENTS:
        measured = by_differences(result.dataset, name, step)
        total = terms[name].sum(f"{name}_term").values
        np.testing.assert_allclose(total, measured, rtol=0, atol=1e-5 * np.max(np.abs(measured)))


def oblique_case(**run):
    """Return a case in two dimensions without any symmetry."""
    modes = [
        {"mode": [1, 2], "sine": 0.6},
        {"mode": [2, -1], "cosine": 0.5},
        {"mode": [1, 0], "sine": 0.3},
    ]
    return Case(
        closures="derived",
        numbers=CASE_B,
        grid={"points": [32, 32], "lengths": [1.0, 1.5]},
        initial={"charge": modes},
        run=run,
    )


def test_sum_of_terms_is_the_measured_rate_of_change_in_two_dimensions():
    step = 1e-3
    times = tuple(0.05 + step * i for i in range(-2, 3))
    result = triboflux.solve(oblique_case(t_end=0.06, outputs=times, rtol=1e-8, atol=1e-11))
    terms = budget(result, time=0.05)
    for name in MOMENTS:
        measured = by_differences(result.dataset, name, step)
        total = terms[name].sum(f"{name}_term").values
        np.testing.assert_allclose(total, measured, rtol=0, atol=1e-4 * np.max(np.abs(measured)))


def test_time_of_a_budget():
    result = smooth_result(1)
    xr.testing.assert_identical(budget(result), budget(result, time=1.0))
    assert float(budget(result, time=0.6)["time"]) == 0.5
    assert float(budget(result, time=0.0)["time"]) == 0.0
    assert not budget(result, time=0.0).equals(budget(result, time=0.5))
    for time in (-0.1, 1.1, float("nan")):
        sentence = rf"^time: {time:g} is not allowed; the result covers 0 to 1\.$"
        with pytest.raises(InputError, match=sentence):
            budget(result, time=time)


def test_budget_of_a_loaded_result(tmp_path):
    result = smooth_result(2)
    result.to_netcdf(tmp_path / "out.nc")
    xr.testing.assert_identical(budget(triboflux.load(tmp_path / "out.nc")), budget(result))


# ------------------------------------------------------------------ Figs. 4-5 of the paper


def sizes(result, name):
    """Return max |group| of an equation's groups over the box, and that of their sum."""
    terms = budget(result)[name]
    grouped = terms.groupby(f"{name}_group").sum()
    groups = grouped[f"{name}_group"].values
    largest = {str(g): float(np.abs(grouped.sel({f"{name}_group": g})).max()) for g in groups}
    return largest | {"time derivative": float(np.abs(terms.sum(f"{name}_term")).max())}


@pytest.mark.parametrize(("number", "closures"), CASES)
def test_kinetic_flux_transports_the_charge(number, closures):
    size = sizes(paper_run(number, closures), "charge")
    assert size["triboconductivity"] == 0.0
    assert size["collisional dispersion"] < 0.01 * size["kinetic flux"]
    assert size["time derivative"] == pytest.approx(size["kinetic flux"], rel=0.01)


@pytest.mark.parametrize("closures", ["published", "derived"])
def test_kinetic_flux_grows_with_the_collision_time(closures):
    frequent, rare = (sizes(paper_run(n, closures), "charge") for n in (1, 2))
    assert rare["kinetic flux"] > 500 * frequent["kinetic flux"]


@pytest.mark.parametrize("number", [1, 2])
def test_electric_force_and_destruction_rule_the_covariance(number):
    size = sizes(paper_run(number), "covariance")
    others = [size["production"], size["dispersion"]]
    assert min(size["electric force"], size["destruction"]) > 2.5 * max(others)
    assert 0.0 < size["production"] < 0.31 * size["electric force"]


@pytest.mark.parametrize("closures", ["published", "derived"])
def test_covariance_is_quasi_steady_where_collisions_are_frequent(closures):
    frequent, rare = (sizes(paper_run(n, closures), "covariance") for n in (1, 2))
    assert frequent["time derivative"] < 1e-4 * frequent["destruction"]
    assert frequent["dispersion"] < 1e-4 * frequent["destruction"]
    assert rare["time derivative"] > 0.05 * rare["destruction"]
    assert rare["dispersion"] > 0.1 * rare["destruction"]


def test_gradient_feeds_the_covariance_of_the_derived_case():
    # Unlike in the paper: with the exact closures the variance, and with it the force, stays small.
    size = sizes(paper_run(1, "derived"), "covariance")
    assert size["electric force"] < 0.1 * size["production"]
    assert size["production"] == pytest.approx(size["destruction"], rel=0.1)


@pytest.mark.parametrize(("number", "closures"), [(1, "published"), *CASES[2:]])
def test_production_and_kinetic_dispersion_stand_out_in_the_variance(number, closures):
    size = sizes(paper_run(number, closures), "variance")
    main = ("production by covariance and charge gradient", "kinetic dispersion")
    others = [size[n] for n in size if n not in (*main, "time derivative")]
    assert min(size[name] for name in main) > 4 * max(others)
    assert size["collisional dispersion"] < 1e-6 * size["kinetic dispersion"]
    assert size["production by electric field"] == 0.0


def test_model_of_a_result_is_the_one_that_ran():
    case = Case(**data(closures="published", numbers=EVERYTHING | {"restitution": 0.9}))
    model = model_of(Result(fake_result(case).dataset))
    derived = model_of(fake_result(changed(case, closures="derived", exponent=0.5)))
    assert model.name == "full"
    assert float(model.coefficients.dispersion) == 1 / EVERYTHING["peclet"]
    assert model.coefficients.flux != derived.coefficients.flux
