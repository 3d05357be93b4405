"""The shipped table of errors: its entries, its coordinates, and what is read between entries."""

import dataclasses
import math
from importlib import resources

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks import suitability_table as generator
from triboflux import closures, model_table, numbers, presets
from triboflux.closures import collision_integral
from triboflux.errors import InputError
from triboflux.model_errors import CHEAPEST_FIRST, FLOOR, ModelError, ModelErrors, measure
from triboflux.model_table import Coordinates, Entries, ModelTable
from triboflux.rates import scaled_rates

SHIPPED = model_table.load()
PLACE = Coordinates(lag=0.02, energy_ratio=30.0, exchange=5.0, drag=2.0, solid_fraction=0.05)


# ------------------------------------------------------------------ entries


def entries_with(name, status, count, seed=3):
    """Return index and coordinates of some entries whose semi-algebraic model has a status."""
    entries = SHIPPED.entries[name]
    found = np.argwhere(entries.status[-1] == SHIPPED.statuses.index(status))
    chosen = np.random.default_rng(seed).choice(len(found), count, replace=False)
    for index in map(tuple, found[chosen]):
        axes = zip(entries.axes, index, strict=True)
        yield index, Coordinates(*(float(axis[i]) for axis, i in axes))


@pytest.mark.slow
@pytest.mark.parametrize("name", closures.PAPERS_EQUATIONS)
def test_entries_are_those_that_a_run_gives(name):
    entries = SHIPPED.entries[name]
    for index, place in entries_with(name, "ok", 4):
        found = measure(model_table.numbers_at(place, name), name)
        for number, model in enumerate(found.models):
            status = SHIPPED.statuses[entries.status[(number, *index)]]
            assert model.status == status, place
            if model.error is not None:
                stored = 10 ** (entries.logarithm[(number, *index)] / 1000)
                assert stored == pytest.approx(max(model.error, FLOOR), rel=5e-3), place


@pytest.mark.parametrize("name", closures.PAPERS_EQUATIONS)
def test_entries_without_error_are_those_where_the_variance_grows(name):
    for _, place in entries_with(name, "F <= 0", 20):
        made = model_table.numbers_at(place, name)
        rates = scaled_rates(closures.by_name(name, made.restitution), made)
        assert rates.variance_destruction < 0.0
        assert measure(made, name).status == "F <= 0"
    if name == "published":
        for _, place in entries_with(name, model_table.IMPOSSIBLE, 5):
            assert model_table.numbers_at(place, name) is None


def test_table_was_made_by_the_generator_of_the_repository():
    for name, entries in SHIPPED.entries.items():
        for axis, expected in zip(entries.axes, generator.AXES[name], strict=True):
            np.testing.assert_array_equal(axis, expected)
        assert entries.logarithm.shape == entries.status.shape
        assert entries.logarithm.min() >= 1000 * math.log10(FLOOR)
    assert set(SHIPPED.entries) == set(closures.PAPERS_EQUATIONS)
    assert SHIPPED.about["command"] == "python -m benchmarks.suitability_table --write"
    assert SHIPPED.statuses[0] == "ok"


def test_file_is_small_and_holds_no_objects():
    path = resources.files("triboflux") / model_table.FILE
    assert len(path.read_bytes()) < 300_000
    with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
        assert all(array.dtype.kind in "iufU" for array in arrays.values())


def test_saved_tables_are_read_again(tmp_path, monkeypatch):
    SHIPPED.save(tmp_path / model_table.FILE)
    original = (resources.files("triboflux") / model_table.FILE).read_bytes()
    assert (tmp_path / model_table.FILE).read_bytes() == original


# ------------------------------------------------------------------ coordinates


@pytest.mark.parametrize("name", closures.NAMES)
def test_coordinates_by_their_definitions(name):
    s = presets.pharmaceutical_carrier()
    made = numbers.from_suspension(s, name)
    e, fraction, g0 = s.restitution, s.solid_fraction, s.contact_radial_distribution
    lambda_1 = 12 if name == "published" else 1 / 12
    tau_xi = lambda_1 * made.peclet / made.length_ratio**2
    swap = (3 - e) / 5 if name == "published" else (2 - 2.8 * e) / 6
    by_velocity = (1 + e) / (3 * made.tau_c) + 1 / made.tau_p
    relaxation = 1 / (by_velocity + swap / tau_xi)
    reference = (1 - fraction / 2) / (1 - fraction) ** 3
    found = model_table.coordinates(made, name)
    assert found == pytest.approx(
        (
            2 * math.pi * relaxation,
            made.energy_ratio,
            1 / (4 * math.pi**2 * tau_xi * relaxation),
            by_velocity * made.tau_c * (g0 / e) / (1.9 / 3 * reference / 0.9),
            fraction,
        ),
        rel=1e-4 if name == "published" else 1e-9,  # its constants are rounded
    )


places = st.builds(
    Coordinates,
    *(st.floats(*ends).map(lambda x: 10.0**x) for ends in ((-4, 0), (-1, 3), (-3, 1), (0, 2))),
    st.floats(-4, math.log10(0.6)).map(lambda x: 10.0**x),
)


@given(places, st.sampled_from(closures.PAPERS_EQUATIONS))
def test_numbers_have_the_coordinates_that_they_are_made_for(place, name):
    made = model_table.numbers_at(place, name)
    if made is None:
        assert name == "published"
        return
    assert model_table.coordinates(made, name) == pytest.approx(place, rel=1e-6)
    assert made.restitution == 0.9


def test_numbers_of_entries_are_those_of_a_suspension():
    made = model_table.numbers_at(PLACE)
    powder = numbers.to_suspension(made, presets.glass_beads())
    again = numbers.from_suspension(powder)
    assert again.model_dump() == pytest.approx(made.model_dump(), rel=1e-6)
    # f = kappa tau_c (L/d)^2/Pe, small
    kappa = 6 * collision_integral(1.0) / collision_integral(1.8)
    assert kappa * made.tau_c * made.length_ratio**2 / made.peclet < 0.01


# ------------------------------------------------------------------ between entries

AXES = Coordinates(
    *(10.0 ** np.array(x) for x in ([-2, -1, 1], [0, 1], [-1, 0, 1], [0, 2], [-3, -1]))
)
SHAPE = (len(CHEAPEST_FIRST), *map(len, AXES))


def made_up(powers, blocked=(), factor=2.0):
    """Return a table whose errors are 1e-2 times powers of the coordinates, with holes."""
    logs = np.meshgrid(*(np.log10(axis) for axis in AXES), indexing="ij")
    one = -2.0 + sum(power * log for power, log in zip(powers, logs, strict=True))
    steps = np.round(1000 * one).astype(np.int16)
    status = np.zeros(SHAPE, dtype=np.uint8)
    for index in blocked:
        status[:, *index] = 1
    spread = {"derived": dict.fromkeys(CHEAPEST_FIRST, factor)}
    entries = Entries(AXES, np.broadcast_to(steps, SHAPE).copy(), status)
    return ModelTable({"derived": entries}, ("ok", "F <= 0"), spread, {})


def inside(x):
    """Return the place at parts x of the logarithmic widths of the whole table."""
    return Coordinates(
        *(float(a[0] * (a[-1] / a[0]) ** part) for a, part in zip(AXES, x, strict=True))
    )


@given(st.tuples(*[st.floats(0, 1)] * 5))
def test_powers_are_interpolated_exactly(x):
    powers = (0.5, -0.25, 0.125, 0.3, -0.2)
    place = inside(x)
    found = made_up(powers).interpolated(place, "derived")
    expected = 1e-2 * math.prod(c**power for c, power in zip(place, powers, strict=True))
    for model in found.models:
        assert model.error == pytest.approx(expected, rel=1e-2)  # stored in steps
        assert (model.low, model.high) == pytest.approx((model.error / 2, model.error * 2))


@given(st.tuples(*[st.floats(0.01, 0.99)] * 5), st.integers(0, 2), st.integers(0, 2))
def test_nothing_is_interpolated_across_an_entry_without_error(x, lag, exchange):
    """An error that depends on a hole would change with what is stored there."""
    place = inside(x)
    hole = (lag, 1, exchange, 0, 1)
    tables = [made_up((0.0,) * 5, blocked=[hole]) for _ in range(2)]
    tables[1].entries["derived"].logarithm[:, *hole] = 1000
    found = [each.interpolated(place, "derived") for each in tables]
    assert found[0] == found[1]
    tables[1].entries["derived"].status[:] = 0
    without = tables[1].interpolated(place, "derived")
    touched = without.models[0].error != pytest.approx(1e-2, rel=1e-9)
    assert (found[0].status == model_table.BESIDE) == touched
    if touched:
        assert "F <= 0" in found[0].reason
        assert found[0].models == ()


def test_at_an_entry_only_that_entry_counts():
    hole = (1, 0, 1, 0, 0)
    found = made_up((0.0,) * 5, blocked=[hole])
    at = Coordinates(*(float(axis[i]) for axis, i in zip(AXES, (1, 1, 1, 0, 0), strict=True)))
    assert found.interpolated(at, "derived").models[0].error == pytest.approx(1e-2)
    hit = Coordinates(*(float(axis[i]) for axis, i in zip(AXES, hole, strict=True)))
    assert found.interpolated(hit, "derived").status == model_table.BESIDE


def test_a_model_without_error_does_not_hide_the_others():
    found = made_up((0.0,) * 5)
    entries = found.entries["derived"]
    found = dataclasses.replace(found, statuses=("ok", "nonphysical"))
    entries.status[2, 0] = 1
    models = {m.model: m for m in found.interpolated(inside((0.1,) * 5), "derived").models}
    assert models["algebraic"].status == "beside entries without error (nonphysical)"
    assert models["algebraic"].error is models["algebraic"].high is None
    assert models["gradient"].error == pytest.approx(1e-2)
    entries.status[2] = 1
    models = {m.model: m for m in found.interpolated(inside((0.1,) * 5), "derived").models}
    assert models["algebraic"].status == "nonphysical"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"lag": 11.0}, "2 pi/R is 11, and the table goes from 0.01 to 10"),
        ({"energy_ratio": 11.0}, "energy_ratio is 11, and the table goes from 1 to 10"),
        ({"exchange": 10.1}, "the exchange rate R/(4 pi^2 tau_xi) is 10.1, and the table"),
        ({"solid_fraction": 0.11}, "solid_fraction is 0.11, and the table"),
        ({"drag": 0.69}, "the drag is 0.69, and the table begins at 1"),
    ],
)
def test_outside_there_is_no_error(changes, words):
    place = inside((0.5,) * 5)._replace(**changes)
    found = made_up((0.0,) * 5).interpolated(place, "derived")
    assert (found.status, found.models) == (model_table.OUT_OF_TABLE, ())
    assert found.reason.startswith(words)


@pytest.mark.parametrize("field", Coordinates._fields)
def test_where_nothing_depends_on_a_coordinate_its_end_is_taken(field):
    found = made_up((0.5,) * 5)
    axis = getattr(AXES, field)
    middle = inside((0.5,) * 5)
    first = found.interpolated(middle._replace(**{field: float(axis[0])}), "derived")
    smaller = 0.75 if field == "drag" else 0.0
    assert found.interpolated(middle._replace(**{field: smaller}), "derived") == first
    if field == "drag":
        last = found.interpolated(middle._replace(drag=float(axis[-1])), "derived")
        assert found.interpolated(middle._replace(drag=1e9), "derived") == last


# ------------------------------------------------------------------ the generator


def test_generator_stores_what_was_computed(monkeypatch):
    axes = Coordinates(*(np.array([1.0, 2.0]) for _ in range(5)))
    monkeypatch.setitem(generator.AXES, "derived", axes)
    kinds = [
        ModelErrors("F <= 0", "grows"),
        ModelErrors("ok", models=tuple(ModelError(m, "ok", 0.02) for m in CHEAPEST_FIRST)),
        ModelErrors(
            "ok",
            models=(
                ModelError("collisional", "ok", 1e-9),
                ModelError("gradient", "nonphysical"),
                *(ModelError(m, "ok", 1.0) for m in CHEAPEST_FIRST[2:]),
            ),
        ),
    ]
    found = [kinds[i % 3] for i in range(32)]
    statuses = ["ok"]
    entries = generator.entries("derived", found, statuses)
    assert statuses == ["ok", "F <= 0", "nonphysical"]
    for index, place in enumerate(generator.places("derived")):
        where = np.unravel_index(index, (2,) * 5)
        assert place == tuple(axis[i] for axis, i in zip(axes, where, strict=True))
        codes = [int(c) for c in entries.status[:, *where]]
        steps = [int(c) for c in entries.logarithm[:, *where]]
        assert codes == [[1] * 4, [0] * 4, [0, 2, 0, 0]][index % 3]
        assert steps == [[0] * 4, [-1699] * 4, [-4000, 0, 0, 0]][index % 3]


def test_random_suspensions_are_always_the_same():
    first, second = (
        [numbers.from_suspension(s) for s in generator.suspensions(50)] for _ in range(2)
    )
    assert first == second
    assert len({n.peclet for n in first}) == 50


def test_unknown_closures():
    with pytest.raises(InputError, match="published"):
        model_table.coordinates(model_table.numbers_at(PLACE), "publishd")
