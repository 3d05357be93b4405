"""What a run's numbers say about its physics and its resolution."""

from __future__ import annotations

from typing import TYPE_CHECKING

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from triboflux import closures, models
from triboflux.breaches import broken_limit
from triboflux.calculus import FourierCalculus
from triboflux.errors import InputError
from triboflux.fields import tensor_of
from triboflux.grid import Grid
from triboflux.hierarchy import RANKS, VOLUME, components, moves
from triboflux.mass_coordinate import along_m, along_x
from triboflux.models.model import Model
from triboflux.models.terms import evaluate
from triboflux.moments import Moments

if TYPE_CHECKING:
    import xarray as xr
    from jaxtyping import Array

    from triboflux.case import Case
    from triboflux.result import Result

# The spectrum of a resolved field has decayed to this part of its largest coefficient.
RESOLVED = 1e-6


def model_of(result: Result) -> Model:
    """Return the model that a result was made with."""
    case = result.case
    return models.build(
        case.model,
        case.numbers,
        case.closures,
        dimensions=case.grid.dimensions,
        exponent=case.exponent,
    )


def budget(result: Result, time: float | None = None) -> xr.Dataset:
    """Return every named term of each equation at an output time; Figs. 4-5 of the paper.

    Parameters
    ----------
    result : Result
        Of any model.
    time : float, optional
        One of the result's output times, in its units; the nearest is taken, the last by default.

    Returns
    -------
    xarray.Dataset
        Variables ``charge(charge_term, x…)``, ``covariance(covariance_term, component, x…)``,
        ``variance(variance_term, x…)`` and, of a tensor, one for each component, such as
        ``covariance_flux_xy(covariance_flux_term, x…)``; dimensionless, scaled by the moment's
        scale times √Θ/L.
        Their sum over the terms is the time derivative, along with the mean velocity where the
        model has one. Coordinates give each term's group and equation.

    Raises
    ------
    InputError
        If the time lies outside the run.
    """
    import xarray as xr

    times = result.dataset["time"].values
    at = times[-1] if time is None else float(time)
    slack = 1e-9 * max(abs(times[-1]), 1e-300)
    if not times[0] - slack <= at <= times[-1] + slack:
        raise InputError(
            f"time: {at:g} is not allowed; the result covers {times[0]:g} to {times[-1]:g}."
        )
    nearest = int(np.argmin(np.abs(times - at)))
    snapshot = result.to_scaled().dataset.isel(time=nearest)
    model, case = model_of(result), result.case
    grid = Grid(case.grid.points, case.grid.lengths)
    fields = {name: _moment(snapshot, name) for name in model.evolves}
    moving, length = moves(model.name), case.grid.lengths[0]
    at_rest = along_m(fields, length) if moving else fields
    state = Moments(**{name: jnp.asarray(values) for name, values in at_rest.items()})
    values = _all_terms(jax.tree.map(jnp.asarray, model), grid, state)
    if moving:
        values = along_x(values, length, at_rest[VOLUME])
    variables, coordinates = {}, {}
    for moment in model.evolves:
        terms = [term for term in model.terms if term.moment == moment]
        axis = f"{moment}_term"
        parts = np.asarray(values[moment])
        for name, place in components(moment, grid.dimensions).items():
            variables[name] = ((axis, *snapshot[name].dims), parts[(slice(None), *place)])
        coordinates[axis] = [term.name for term in terms]
        coordinates[f"{moment}_group"] = (axis, [term.group for term in terms])
        coordinates[f"{moment}_equation"] = (axis, [term.equation for term in terms])
    kept = {name: snapshot[name] for name in snapshot.coords}
    return xr.Dataset(variables, coords={**kept, **coordinates})


def _moment(snapshot: xr.Dataset, moment: str) -> np.ndarray:
    """Return a moment from its variables at one time."""
    if RANKS[moment] < 2:
        return snapshot[moment].values
    return tensor_of(snapshot, moment, snapshot.sizes["component"])


@eqx.filter_jit
def _all_terms(model: Model, grid: Grid, fields: Moments) -> dict[str, Array]:
    """Return the values of every term on the points, stacked for each moment."""
    calculus = FourierCalculus(grid)
    state = jax.tree.map(grid.to_spectral, fields)
    stacked: dict[str, list[Array]] = {moment: [] for moment in model.evolves}
    for term in model.terms:
        value = getattr(evaluate((term,), calculus, state), term.moment)
        stacked[term.moment].append(grid.to_fields(value))
    return {moment: jnp.stack(values) for moment, values in stacked.items()}


def initial_closure(case: Case) -> xr.Dataset:
    """Return the moments that the algebraic model makes of the initial charge; Fig. 6 of the paper.

    Nothing is integrated, and a variance that is negative or singular is returned as it comes out
    of (7.8) and (7.9).

    Parameters
    ----------
    case : Case
        Of the model ``"algebraic"``.

    Returns
    -------
    xarray.Dataset
        The variables of a result, ``charge``, ``covariance``, ``variance``, ``field`` and others,
        labelled and scaled as there but without a time. The attribute ``nonphysical`` says which
        limit the closure breaks and where; it is empty if none.

    Raises
    ------
    InputError
        If the case asks for another model, or its initial state is not allowed.
    OutOfRangeError
        If the numbers are outside the range of validity of the closures.
    """
    from triboflux.dataset import build_dataset
    from triboflux.initial_state import initial_moments
    from triboflux.integrate import begin

    if case.model != "algebraic":
        raise InputError.about(
            "model", f"is '{case.model}', but must be 'algebraic', which alone closes the variance"
        )
    closure_set = closures.by_name(case.closures, case.numbers.restitution, case.exponent)
    model = models.build(case.model, case.numbers, closure_set, dimensions=case.grid.dimensions)
    models.validity(
        model.coefficients, closure_set, case.run.allow_out_of_range, model_name=case.model
    )
    model = jax.tree.map(jnp.asarray, model)
    grid = Grid(case.grid.points, case.grid.lengths)
    state = Moments(**{name: jnp.asarray(f) for name, f in initial_moments(case).items()})
    carry = begin(model, state, grid)
    fields, margin = _closed(model, grid, carry.coefficients)
    rows = {name: np.asarray(values)[None] for name, values in fields.items()}
    dataset = build_dataset(
        case,
        [0.0],
        charge=rows["charge"],
        covariance=rows["covariance"],
        field=rows["field"],
        potential=rows["potential"],
        peak_charge=rows["peak_charge"],
        variance=rows["variance"],
        status="",
        stop_reason="",
        stats={},
        attributes={
            "trace_dimensions": models.trace_dimensions(case.model, closure_set, grid.dimensions),
            "nonphysical": broken_limit(model, grid, carry) if float(margin) <= 0.0 else "",
        },
    ).isel(time=0, drop=True)
    # It is not the outcome of a run.
    kept = ("title", "units", "case_toml", "versions_json", "trace_dimensions", "nonphysical")
    dataset.attrs = {name: dataset.attrs[name] for name in kept}
    return dataset


@eqx.filter_jit
def _closed(model: Model, grid: Grid, coefficients: Moments) -> tuple[dict[str, Array], Array]:
    """Return the fields of a result, and the margin of the model's limits."""
    calculus = FourierCalculus(grid)
    values = model.fields(calculus, coefficients)
    fields = {
        "charge": values.charge,
        "covariance": values.covariance,
        "variance": values.variance,
        "field": grid.to_fields(calculus.electric_field(coefficients.charge)),
        "potential": grid.to_fields(calculus.potential(coefficients.charge)),
        "peak_charge": grid.peak(coefficients.charge),
    }
    return fields, model.margin(calculus, coefficients)


def unused_initial_warnings(case: Case, model: Model) -> list[str]:
    """Say which initial moments a case gives that its model does not start from.

    Parameters
    ----------
    case : Case
        With modes; a file holds all moments and is no reason to warn.
    model : Model
        The one it asks for.
    """
    given = {name: getattr(case.initial, name) for name in ("covariance", "variance")}
    return [
        f"initial.{name} is not used: the {model.name} model has no equation for it."
        for name, modes in given.items()
        if modes and name not in model.evolves
    ]


def resolution_warnings(grid: Grid, coefficients: Moments) -> list[str]:
    """Say along which axes the spectrum has not decayed at the grid's end, and what would do.

    Parameters
    ----------
    grid : Grid
        Of the coefficients.
    coefficients : Moments
        Fourier coefficients of the final state.
    """
    warnings = []
    for axis, (points, kept) in enumerate(zip(grid.points, grid.kept, strict=True)):
        tail = max(
            _tail(np.asarray(getattr(coefficients, name)), grid, axis)
            for name in RANKS
            if getattr(coefficients, name) is not None
        )
        if tail > RESOLVED:
            name = "xyz"[axis]
            # An exponential spectrum falls by the same factor per mode.
            factor = min(np.log(RESOLVED) / np.log(min(tail, 0.3)), 8.0)
            proposed = 2 * int(np.ceil(max(factor, 1.25) * points / 2.0))
            warnings.append(
                f"the spectrum along {name} has only decayed to {tail:.1e} of its largest "
                f"coefficient at mode {kept}: take about {proposed} points instead of {points}."
            )
    return warnings


def _tail(coefficients: np.ndarray, grid: Grid, axis: int) -> float:
    """Return the largest coefficient in the last tenth of the modes along an axis."""
    d = grid.dimensions
    numbers = np.broadcast_to(np.abs(grid.mode_numbers()[axis]), grid.modes)
    size = np.abs(coefficients).reshape(-1, *coefficients.shape[-d:]).max(axis=0)
    largest = size.max()
    # Symmetric states occupy every second mode or fewer; the last of them has to be seen.
    spacing = np.gcd.reduce(numbers[size > 1e-12 * largest])
    last = numbers >= min(np.ceil(0.9 * grid.kept[axis]), grid.kept[axis] - spacing + 1)
    outer = size[last]
    return float(outer.max() / largest) if largest > 0.0 and outer.size else 0.0
