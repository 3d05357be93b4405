"""Realizability and resolution: what a run says about its own numbers."""

import re

import jax.numpy as jnp
import numpy as np
import pytest

import triboflux
from tests.paper_runs import CASES, changed, paper_run
from triboflux.breaches import RealizabilityWatch
from triboflux.diagnostics import resolution_warnings
from triboflux.figures import paper_case
from triboflux.grid import Grid
from triboflux.moments import Moments


def realizability_warnings(grid, times, fields, parts=1):
    """Return what a watch says of outputs that come in so many parts."""
    watch = RealizabilityWatch(grid)
    for chosen in np.array_split(np.arange(len(times)), parts):
        watch.add(times[chosen], {name: values[chosen] for name, values in fields.items()})
    return watch.warnings()


MOMENTS = ("charge", "covariance", "variance")


# ------------------------------------------------------------------ realizability


def onset(result):
    """Return the first output time with a negative margin, and where it is negative then."""
    margin = result.dataset["realizability_margin"]
    first = margin[int(np.argmax((margin < -1e-6).any("x").values))]
    return float(first["time"]), first["x"].values[(first < -1e-6).values]


# Outputs on both sides of the moment when C² first exceeds V.
PUBLISHED = (0.004, 0.008, 0.011, 0.05, 0.1, 0.15)
DERIVED = (0.03, 0.062, 0.066, 0.1, 0.174, 0.18)


@pytest.mark.parametrize(
    ("closures", "outputs", "first", "at_end", "largest", "share"),
    [
        ("published", PUBLISHED, 0.011, 0.791, 0.791, 0.62),
        ("derived", DERIVED, 0.066, 0.151, 0.163, 0.38),
    ],
)
def test_rare_collisions_break_realizability(closures, outputs, first, at_end, largest, share):
    result = paper_run(2, closures, run__outputs=outputs)
    margin = result.dataset["realizability_margin"]
    time, places = onset(result)
    assert time == first
    # at x = 0 and half a box away, where field and covariance are largest
    assert set(np.round(places * 2) / 2) <= {0.0, 0.5, 1.0}
    assert 0.0 in places
    assert -float(margin[-1].min()) == pytest.approx(at_end, abs=1e-3)
    assert -float(margin.min()) == pytest.approx(largest, abs=1e-3)
    broken = float((margin[-1] < 0.0).mean())
    assert broken == pytest.approx(share, abs=0.015)
    assert result.status == "ok"
    (told,) = [sentence for sentence in result.warnings if "realizable" in sentence]
    assert f"from t = {first:g} on" in told
    assert f"by up to {largest:.3f}" in told
    assert f"{broken:.0%} of the box at the end" in told
    assert "\n" not in told
    assert told.endswith(".")


@pytest.mark.parametrize("closures", ["published", "derived"])
def test_frequent_collisions_never_do(closures):
    result = paper_run(1, closures)
    assert float(result.dataset["realizability_margin"].min()) >= 0.0
    assert result.warnings == ()


def test_place_and_time_of_the_worst_breach():
    grid = Grid((4, 6), (1.0, 3.0))
    fields = {"variance": np.full((3, 4, 6), 1.0), "covariance": np.zeros((3, 2, 4, 6))}
    times = np.array([0.0, 0.25, 0.5])
    assert realizability_warnings(grid, times, fields) == []
    fields["covariance"][1, :, 1, 2] = 0.8
    fields["covariance"][2, 1, 3, 4] = -1.1
    (told,) = realizability_warnings(grid, times, fields)
    assert "from t = 0.25 on" in told
    assert "by up to 0.28 at t = 0.25, x = 0.25, 1;" in told
    assert "4% of the box at the end" in told
    fields["covariance"][:] = 0.0
    fields["variance"][2] = -0.5
    assert "100% of the box at the end" in realizability_warnings(grid, times, fields)[0]


def test_round_off_is_no_breach():
    grid = Grid((4,), (1.0,))
    for variance in (np.zeros((1, 4)), np.array([[1.0, 1.0, -1e-9, 1.0]])):
        fields = {"variance": variance, "covariance": np.zeros((1, 1, 4))}
        assert realizability_warnings(grid, np.zeros(1), fields) == []


# ------------------------------------------------------------------ resolution


def test_proposed_resolution_is_enough():
    def spectrum(result):
        return [sentence for sentence in result.warnings if "spectrum" in sentence]

    coarse = triboflux.solve(changed(paper_case(2), grid__points=(16,)))
    (told,) = spectrum(coarse)
    found = re.fullmatch(
        r"the spectrum along x has only decayed to \d\.\de-0\d of its largest coefficient "
        r"at mode 5: "
        r"take about (\d+) points instead of 16\.",
        told,
    )
    proposed = int(found[1])
    assert 16 < proposed < 64
    fine = triboflux.solve(changed(paper_case(2), grid__points=(proposed,)))
    assert spectrum(fine) == []
    reference = float(paper_run(2).dataset["time"][-1])
    error = abs(float(coarse.dataset["time"][-1]) - reference)
    assert abs(float(fine.dataset["time"][-1]) - reference) < 0.01 * error


@pytest.mark.parametrize(("number", "closures"), CASES)
def test_papers_cases_are_resolved(number, closures):
    assert not [w for w in paper_run(number, closures).warnings if "spectrum" in w]


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("moment", MOMENTS)
def test_each_axis_and_moment_is_looked_at(axis, moment):
    grid = Grid((16, 20, 24), (1.0, 1.0, 1.0))
    shapes = {name: (2, *grid.modes) for name in MOMENTS}
    shapes["covariance"] = (3, *shapes["covariance"])
    values = {name: np.zeros(shape) for name, shape in shapes.items()}
    for array in values.values():
        array[..., 0, 1, 1, 1] = 1.0
    index = [1, 1, 1]
    index[axis] = grid.kept[axis]
    values[moment][..., 1, *index] = 1e-5
    moments = Moments(**{name: jnp.asarray(array) for name, array in values.items()})
    (told,) = resolution_warnings(grid, moments)
    assert f"along {'xyz'[axis]} has only decayed to 1.0e-05" in told
    assert f"at mode {grid.kept[axis]}:" in told
    values[moment][..., 1, *index] = 1e-7
    moments = Moments(**{name: jnp.asarray(array) for name, array in values.items()})
    assert resolution_warnings(grid, moments) == []


def test_nothing_is_resolved():
    grid = Grid((16,), (1.0,))
    zero = jnp.zeros((2, *grid.modes))
    assert resolution_warnings(grid, Moments(zero, zero[None], zero)) == []
