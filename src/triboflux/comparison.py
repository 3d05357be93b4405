"""What a comparison of models holds: states at one time, errors, costs."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from triboflux.netcdf_file import sealed_at_once

# xarray is imported where it is needed, so that refusals come at once
if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from triboflux.case import Case
    from triboflux.result import Result

FIELDS = ("charge", "field", "covariance", "variance")
"""The moments and the electric field whose errors are measured."""

VECTORS = ("field", "covariance")
"""Those of them that have components."""


class RelativeErrors(NamedTuple):
    """Relative error of a field in two norms; None where the reference vanishes.

    Attributes
    ----------
    largest : float or None
        Largest deviation over the largest absolute value of the reference.
    rms : float or None
        Root of the mean square of the deviation over that of the reference: the L2 norm.
    """

    largest: float | None
    rms: float | None


@dataclass(frozen=True)
class ComparisonRow:
    """What a comparison says about one model.

    Attributes
    ----------
    model : str
        Its name.
    status : str
        ``"ok"``, ``"nonphysical"``, ``"diverged"``, or ``"refused"`` if it could not be run.
    reason : str
        Why its run ended, or was refused.
    stop_time : float or None
        When a stop rule of the case ended its own run; None if none did.
    end_time : float or None
        The last time of its own run; None if refused.
    peak_charge : float or None
        Largest absolute charge in the box at the time of the comparison.
    errors : mapping of str to RelativeErrors
        For each of `FIELDS` against the reference at the time of the comparison. Empty if the model
        has no state then; without ``variance`` if it or the reference knows none.
    seconds : float or None
        Shortest time that its own run took, compilation excluded.
    steps, rejected : int or None
        Time steps of its own run that were accepted and rejected.
    """

    model: str
    status: str
    reason: str
    stop_time: float | None = None
    end_time: float | None = None
    peak_charge: float | None = None
    errors: Mapping[str, RelativeErrors] | None = None
    seconds: float | None = None
    steps: int | None = None
    rejected: int | None = None


@dataclass(frozen=True)
class Comparison:
    """Runs of one case with several models.

    Attributes
    ----------
    case : Case
        What was compared; each result's own case differs from it in model and outputs.
    reference : str
        The most complete model whose run ended well; errors are measured against it.
    time : float
        Its last time, at which all are compared; scaled by L/√Θ, or in s after `to_si`.
    rows : tuple of ComparisonRow
        One for each model, the most complete first; scaled, or in SI after `to_si`.
    results : mapping of str to Result
        Each model's own run, as the case's stop rules end it; not for refused models.
    states : mapping of str to Result
        Each model at `time` only; not for models that did not get there.
    """

    case: Case
    reference: str
    time: float
    rows: tuple[ComparisonRow, ...]
    results: Mapping[str, Result]
    states: Mapping[str, Result]

    @property
    def units(self) -> str:
        """``"scaled"``, or ``"si"`` after `to_si`."""
        return self.states[self.reference].units

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences that the user must be told, each with the model that it is about."""
        told: list[str] = []
        for name, result in self.results.items():
            told += [f"{name}: {sentence}" for sentence in result.warnings]
            state = self.states.get(name)
            if state is not None and state.case != result.case:
                told += [
                    f"{name}, run on beyond its own end: {sentence}" for sentence in state.warnings
                ]
        return tuple(told)

    def row(self, model: str) -> ComparisonRow:
        """Return the row of a model that was compared."""
        return next(row for row in self.rows if row.model == model)

    def to_si(self) -> Comparison:
        """Return the same comparison with every time, charge and field in SI.

        Returns
        -------
        Comparison
            Sentences, such as reasons, still speak of scaled values.

        Raises
        ------
        InputError
            If the case has no suspension, hence no scales.
        """
        from triboflux.case_checks import check_units
        from triboflux.scales import Scales

        if self.units == "si":
            return self
        check_units(self.case, "si")
        assert self.case.suspension is not None
        scales = Scales.of(self.case.suspension)

        def times(value: float | None, scale: float) -> float | None:
            return None if value is None else value * scale

        rows = [
            replace(
                row,
                stop_time=times(row.stop_time, scales.time),
                end_time=times(row.end_time, scales.time),
                peak_charge=times(row.peak_charge, scales.charge),
            )
            for row in self.rows
        ]
        return replace(
            self,
            time=self.time * scales.time,
            rows=tuple(rows),
            results={name: result.to_si() for name, result in self.results.items()},
            states={name: state.to_si() for name, state in self.states.items()},
        )

    def to_dataset(self) -> xr.Dataset:
        """Return the states at the common time and the table as one dataset.

        Returns
        -------
        xarray.Dataset
            Fields over ``model``, ``component`` and ``x``, ``y``, ``z``; the table's columns over
            ``model``, its errors over ``model``, ``quantity`` and ``norm``. What does not exist is
            nan. Values are scaled as each variable's ``scale`` says, or in SI.
        """
        import xarray as xr

        from triboflux.dataset import versions

        models = [row.model for row in self.rows]
        reference = self.states[self.reference].dataset.isel(time=-1)
        variables: dict[Any, Any] = {}
        for name in FIELDS:
            known = {
                m: s.dataset[name].isel(time=-1)
                for m, s in self.states.items()
                if name in s.dataset
            }
            if not known:
                continue
            pattern = next(iter(known.values()))
            missing = np.full(pattern.shape, np.nan)
            values = [known[m].values if m in known else missing for m in models]
            variables[name] = (("model", *pattern.dims), np.stack(values), pattern.attrs)
        variables |= self._columns(reference)
        errors = [
            [list(_numbers((row.errors or {}).get(name) or (None, None))) for name in FIELDS]
            for row in self.rows
        ]
        variables["error"] = (
            ("model", "quantity", "norm"),
            np.array(errors),
            {"long_name": f"relative error against the {self.reference} model", "units": "1"},
        )
        coordinates = {name: reference[name] for name in reference.coords}
        return xr.Dataset(
            variables,
            coords=coordinates | {"model": models, "quantity": list(FIELDS), "norm": ["max", "L2"]},
            attrs={
                "title": self.case.title,
                "reference": self.reference,
                "units": self.units,
                "case_toml": self.case.to_toml(),
                "warnings_json": json.dumps(list(self.warnings)),
                "versions_json": json.dumps(versions()),
            },
        )

    def _columns(self, reference: xr.Dataset) -> dict[str, Any]:
        """Return the table's columns but the errors as variables over the models."""
        time, charge = reference["time"].attrs, reference["charge"].attrs
        labels: dict[str, Mapping[str, Any]] = {
            "stop_time": {
                **time,
                "long_name": "time at which a stop rule ended the model's own run",
            },
            "end_time": {**time, "long_name": "last time of the model's own run"},
            "peak_charge": {**charge, "long_name": "largest absolute mean charge in the box"},
            "seconds": {"long_name": "wall time of the own run without compilation", "units": "s"},
            "steps": {"long_name": "accepted time steps of the own run", "units": "1"},
            "rejected": {"long_name": "rejected time steps of the own run", "units": "1"},
        }
        columns: dict[str, Any] = {
            name: (
                "model",
                np.array(_numbers([getattr(row, name) for row in self.rows])),
                attributes,
            )
            for name, attributes in labels.items()
        }
        for name in ("status", "reason"):
            columns[name] = ("model", [getattr(row, name) for row in self.rows])
        return columns

    def to_netcdf(self, path: str | PathLike[str], overwrite: bool = False) -> None:
        """Write `to_dataset` as NetCDF, all of it or nothing.

        Parameters
        ----------
        path : path-like
            The file to write; its folder must exist.
        overwrite : bool
            Replace an existing file.

        Raises
        ------
        InputError
            If the folder is missing or the file exists.
        TribofluxError
            If writing fails; no file is left then.
        """
        with sealed_at_once(path, overwrite=overwrite) as partial:
            self.to_dataset().to_netcdf(  # pyright: ignore[reportUnknownMemberType] -- untyped keywords in xarray
                partial, engine="netcdf4"
            )


def _numbers(values: Sequence[float | int | None]) -> list[float]:
    """Return numbers with nan for what is missing."""
    return [np.nan if value is None else float(value) for value in values]


def relative_errors(
    values: NDArray[np.float64], reference: NDArray[np.float64], *, vector: bool = False
) -> RelativeErrors:
    """Return the relative error of a field on the points of a grid.

    Parameters
    ----------
    values, reference : array
        Shape ``(*points)``, or ``(dimensions, *points)`` for vectors.
    vector : bool
        Whether the first axis holds components, whose Euclidean norm is taken at each point.
    """

    def norms(field: NDArray[np.float64]) -> tuple[float, float]:
        squares = np.sum(field**2, axis=0) if vector else field**2
        return float(np.sqrt(squares.max())), float(np.sqrt(squares.mean()))

    errors = zip(norms(values - reference), norms(reference), strict=True)
    return RelativeErrors(*(error / size if size > 0.0 else None for error, size in errors))
