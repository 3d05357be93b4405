"""Names, dimensions, scales and units of everything in a dataset."""

from __future__ import annotations

import operator
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from triboflux.case_checks import DIMENSION_NAMES
from triboflux.errors import InputError, shown
from triboflux.hierarchy import MODELS, components, variables

if TYPE_CHECKING:
    import xarray as xr

MODEL_FIELDS = {
    "time": ("time", "L / sqrt(Theta)", "time", "s"),
    "charge": ("mean charge of a particle", "Q0", "charge", "C"),
    "covariance": ("charge-velocity covariance", "Q0 sqrt(Theta)", "covariance", "C m s-1"),
    "variance": ("charge variance", "Q0^2", "variance", "C2"),
    "field": ("electric field", "n Q0 L / epsilon_0", "field", "V m-1"),
    "potential": ("electric potential", "n Q0 L^2 / epsilon_0", "potential", "V"),
    "peak_charge": ("largest absolute mean charge in the box", "Q0", "charge", "C"),
    "realizability_margin": (
        "variance minus squared covariance over granular temperature, negative if impossible",
        "Q0^2",
        "variance",
        "C2",
    ),
    **{name: (f"position along {name}", "L", "length", "m") for name in DIMENSION_NAMES},
}
"""Long name, scale, the scale's name in `Scales`, and SI unit of everything with a dimension."""

_TEMPERATURE = ("Theta", "temperature", "m2 s-2")

PARTICLE_FIELDS = {
    "number_density": ("particles per volume", "n", "number_density", "m-3"),
    "specific_volume": ("volume per particle", "1/n", "specific_volume", "m3"),
    "mean_velocity": ("mean velocity", "sqrt(Theta)", "velocity", "m s-1"),
    "granular_temperature": ("granular temperature", *_TEMPERATURE),
    **{
        name: (f"mean of fluctuating velocities along {name[-2]} and {name[-1]}", *_TEMPERATURE)
        for name in components("granular_temperature_tensor", 3)
    },
    "dissipated_energy": (
        "energy per mass that collisions, contacts and drag have taken",
        *_TEMPERATURE,
    ),
    "covariance_flux_xx": (
        "mean of fluctuating charge times velocity along x squared",
        "Q0 Theta",
        "covariance_flux",
        "C m2 s-2",
    ),
    "covariance_flux_trace": (
        "mean of fluctuating charge times square of the fluctuating velocity",
        "Q0 Theta",
        "covariance_flux",
        "C m2 s-2",
    ),
    "variance_flux": (
        "mean of fluctuating charge squared times fluctuating velocity",
        "Q0^2 sqrt(Theta)",
        "variance_flux",
        "C2 m s-1",
    ),
}
"""The same of what a simulation of particles tells, and models with further moments."""

TENSOR_FIELDS = {
    name: (
        f"mean of fluctuating charge times velocities along {name[-2]} and {name[-1]}",
        "Q0 Theta",
        "covariance_flux",
        "C m2 s-2",
    )
    for name in components("covariance_flux", 3)
    if name not in PARTICLE_FIELDS
}
"""The same of the other components of a third-order moment, where a box has these directions."""

FIELDS = MODEL_FIELDS | PARTICLE_FIELDS | TENSOR_FIELDS
"""All of them."""

_VECTORS = ("covariance", "field", "mean_velocity", "variance_flux")

STANDARD_ERROR = "_standard_error"
"""Ends the name of a variable's standard error over ensembles of particles."""

ANCILLARY = "ancillary_variables"
"""Attribute of a variable that names its standard error, as in the CF conventions."""


def dimensions_of(variable: str, dimensions: int) -> tuple[str, ...]:
    """Return the dimension names of a dataset variable.

    Parameters
    ----------
    variable : str
        Such as ``covariance``.
    dimensions : int
        Number of dimensions of the box.

    Returns
    -------
    tuple of str
        Such as ``("time", "component", "x")``.
    """
    if variable.removesuffix(STANDARD_ERROR) in ("time", "peak_charge"):
        return ("time",)
    vector = ("component",) if variable.removesuffix(STANDARD_ERROR) in _VECTORS else ()
    return ("time", *vector, *DIMENSION_NAMES[:dimensions])


def variables_of(model: str, dimensions: int) -> list[str]:
    """Return the variables and coordinates over time that a result of a model has to hold.

    Parameters
    ----------
    model : str
        Its name.
    dimensions : int
        Number of dimensions of the box.
    """
    known = MODELS[model].evolves + MODELS[model].closes
    without = () if "variance" in known else ("variance", "realizability_margin")
    names = [n for n in MODEL_FIELDS if n not in (*DIMENSION_NAMES, *without)]
    return names + [n for n in variables(model, dimensions) if n not in names]


def labels_of(name: str, *, si: bool = False) -> dict[str, str]:
    """Return the attributes of a variable or coordinate.

    Parameters
    ----------
    name : str
        Such as ``covariance``, or with the ending of a standard error.
    si : bool
        Whether its values are in SI.
    """
    of = name.removesuffix(STANDARD_ERROR)
    long_name, scale, _, unit = FIELDS[of]
    if of != name:
        long_name = f"standard error of the {long_name}, over ensembles"
    return {"long_name": long_name} | ({"units": unit} if si else {"units": "1", "scale": scale})


def unit_of(name: str, *, si: bool) -> str:
    """Return what the values of a variable are multiples of.

    Parameters
    ----------
    name : str
        Such as ``covariance``, or with the ending of a standard error.
    si : bool
        Whether its values are in SI; otherwise the unit is its scale, such as ``Q0``.
    """
    _, scale, _, unit = FIELDS[name.removesuffix(STANDARD_ERROR)]
    return unit if si else scale


def known_variables(dataset: xr.Dataset) -> list[str]:
    """Return the variables of a dataset that are named and shaped as here, in its order.

    Parameters
    ----------
    dataset : xarray.Dataset
        Of a result; whatever else was added to it is left out.
    """
    dimensions = sum(name in dataset.dims for name in DIMENSION_NAMES)
    names = [str(name) for name in dataset.data_vars]
    names = [name for name in names if name.removesuffix(STANDARD_ERROR) in FIELDS]
    return [name for name in names if dataset[name].dims == dimensions_of(name, dimensions)]


def tensor_of(values: Mapping[Any, Any], moment: str, dimensions: int) -> NDArray[np.float64]:
    """Return a symmetric tensor from the variables that hold its components.

    Parameters
    ----------
    values : mapping
        Such as a dataset; arrays of one shape by the names of variables.
    moment : str
        Of rank two in `triboflux.hierarchy.RANKS`.
    dimensions : int
        Of the box.

    Returns
    -------
    numpy.ndarray
        Shape ``[component, component, ...]``.
    """
    rows = {
        place: np.asarray(values[name]) for name, place in components(moment, dimensions).items()
    }
    along = range(dimensions)
    return np.stack([np.stack([rows[min(i, j), max(i, j)] for j in along]) for i in along])


def output_index(dataset: xr.Dataset, time: int) -> int:
    """Return the index of an output time, counted from the beginning.

    Parameters
    ----------
    dataset : xarray.Dataset
        Of a result.
    time : int
        As for a sequence: negative from the end.

    Raises
    ------
    InputError
        If there is no such output.
    """
    count = dataset.sizes["time"]
    try:
        index = operator.index(time)
    except TypeError:
        index = count
    if not -count <= index < count:
        allowed = f"must be a whole number from {-count} to {count - 1}"
        raise InputError.about("time", f"is {shown(time)}, but {allowed}")
    return index % count
