"""Where the energy of a run goes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from triboflux.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

    from triboflux.result import Result


def energy_balance(result: Result) -> xr.Dataset:
    """Return kinetic energy, that of the field, and what is lost, over the output times.

    Parameters
    ----------
    result : Result
        Of a model that evolves the granular temperature.

    Returns
    -------
    xarray.Dataset
        ``kinetic``, ``field``, ``dissipated`` and their sum ``total``, means over the box per mass
        of particles, scaled by Θ at time 0, and ``drift``, by how much of itself the total has
        changed since the first output; all ``(time)``. The field's energy is u |E|²/2, and that of
        a mean velocity is kinetic.

    Raises
    ------
    InputError
        If the model holds the granular temperature fixed.
    """
    import xarray as xr

    scaled = result.to_scaled()
    dataset, case = scaled.dataset, scaled.case
    if "dissipated_energy" not in dataset:
        raise InputError.about(
            "model",
            f"is '{case.model}', but must be one of those that have an energy, 'self-consistent' "
            "or 'self-consistent-flow'",
        )
    space = [name for name in dataset["charge"].dims if name != "time"]
    squared = (dataset["field"] ** 2).sum("component").mean(space)
    kinetic, density = 1.5 * dataset["granular_temperature"], 1.0
    if "mean_velocity" in dataset:
        kinetic = kinetic + 0.5 * (dataset["mean_velocity"] ** 2).sum("component")
        density = dataset["number_density"]
    parts = {
        "kinetic": (density * kinetic).mean(space),
        "field": 0.5 * case.numbers.energy_ratio * squared,
        "dissipated": (density * dataset["dissipated_energy"]).mean(space),
    }
    total = sum(parts.values(), start=xr.zeros_like(squared))
    balance = xr.Dataset(parts | {"total": total, "drift": total / total[0] - 1.0})
    for name in balance.data_vars:
        balance[name].attrs = {"units": "1"} | ({} if name == "drift" else {"scale": "Theta"})
    return balance
