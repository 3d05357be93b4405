"""The cases behind the paper's figures, and their runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import resources
from typing import TYPE_CHECKING, Any

from triboflux.case import Case
from triboflux.errors import InputError, TribofluxError
from triboflux.files import temporary_folder
from triboflux.suitability import suitability
from triboflux.sweep import SweepProgress

if TYPE_CHECKING:
    import xarray as xr

    from triboflux.result import Result
    from triboflux.solve import Progress

CLOSURES = ("published", "derived")
"""The closure sets that a reproduced figure compares, the paper's own first."""

FREQUENT, RARE = 1, 2
"""Numbers of the figures that introduce the paper's two cases, of frequent and rare collisions."""

CASE_OF_FIGURE = {1: 1, 2: 2, 3: 2, 4: 1, 5: 2, 7: 1, 8: 2}
"""Which of the two cases a figure shows; Fig. 6 shows both."""

MAP = 9
"""Number of the figure that is made of maps, not of runs of the two cases."""

PAPER_TIMES = {1: "48", 2: "0.16"}
"""The times that the paper quotes for its two cases, scaled by L/√Θ."""


def paper_case(number: int, closures: str = "published", model: str = "full") -> Case:
    """Return one of the paper's two cases.

    Parameters
    ----------
    number : int
        Of the figure that introduces it: 1 where collisions are frequent, 2 where they are rare.
    closures : str
        Name of the closure set, ``published`` being the paper's own.
    model : str
        Name of the model.

    Returns
    -------
    Case
        The case in ``examples/fig1.toml`` or ``examples/fig2.toml``, with these closures and this
        model.

    Raises
    ------
    InputError
        If there is no such case, closure set or model.
    """
    if number not in PAPER_TIMES:
        raise InputError.about(
            "figure", f"is {number!r}, but must be one of {', '.join(map(str, PAPER_TIMES))}"
        )
    file = resources.files("triboflux") / "cases" / f"fig{number}.toml"
    case = Case.from_toml_text(file.read_text(encoding="utf-8"))
    return changed(case, closures=closures, model=model)


def changed(case: Case, **changes: Any) -> Case:
    """Return a case with some of its entries replaced, validated anew.

    Parameters
    ----------
    case : Case
        To start from.
    **changes
        Entries of the case; a mapping replaces entries of a table.
    """
    data: dict[str, Any] = case.model_dump()
    for name, value in changes.items():
        data[name] = data[name] | value if isinstance(value, dict) else value
    return Case(**data)


def until(case: Case, time: float) -> Case:
    """Return a case that runs to a given time, whatever becomes of the peak charge.

    Parameters
    ----------
    case : Case
        With output times.
    time : float
        The new end.
    """
    outputs = case.run.outputs
    assert isinstance(outputs, tuple)
    # As many output times and a stop value as before let the run share the compiled program; the
    # end is recorded in any case.
    times = [*(t for t in outputs if t < time), time][: len(outputs)]
    return changed(case, run={"t_end": time, "outputs": tuple(times), "stop_at_peak_charge": 1e-9})


class Runs:
    """Results of cases, each computed once, and maps of errors.

    Parameters
    ----------
    workers : int, optional
        Number of local processes for a map; one per usable core by default.
    """

    def __init__(self, workers: int | None = None) -> None:
        self._workers = workers
        self._results: dict[str, Result] = {}
        self._on_progress: Callable[[Any], None] | None = None
        self._part, self._parts = 0, 1

    def expect(self, parts: int, on_progress: Callable[[Any], None] | None) -> None:
        """Report the progress of the next runs as fractions of all of them.

        Parameters
        ----------
        parts : int
            How many results or maps will be asked for.
        on_progress : Callable or None
            Called with a `triboflux.solve.Progress`, for maps with a
            `triboflux.sweep.SweepProgress`.
        """
        self._part, self._parts, self._on_progress = 0, parts, on_progress

    def __call__(self, case: Case, accepted: tuple[str, ...] = ("ok",)) -> Result:
        """Return the result of a case.

        Parameters
        ----------
        case : Case
            To be run, unless it has been.
        accepted : tuple of str
            Statuses that are no failure.

        Raises
        ------
        TribofluxError
            If the run fails.
        """
        key = case.to_toml()
        if key not in self._results:
            from triboflux.solve import solve  # imports JAX, which drawing does not need

            self._results[key] = solve(case, on_progress=self._callback())
        result = self._results[key]
        if result.status not in accepted:
            raise TribofluxError(
                f"the run with {case.closures} closures ended as {result.status}: "
                f"{result.stop_reason}."
            )
        self._part += 1
        return result

    def _callback(self) -> Callable[[Progress], None] | None:
        """Return a callback for one run that reports the fraction of all of them."""
        on_progress, part, parts = self._on_progress, self._part, self._parts
        if on_progress is None:
            return None
        return lambda now: on_progress(replace(now, fraction=(part + now.fraction) / parts))

    def map(
        self, case: Case, reduced: str, axes: Sequence[tuple[str, Sequence[float]]]
    ) -> xr.Dataset:
        """Return the error of a reduced model over two numbers; its runs are not kept.

        Parameters
        ----------
        case : Case
            Everything else.
        reduced : str
            The model to judge.
        axes : pair of (str, sequence of float)
            See `triboflux.suitability.suitability`.

        Raises
        ------
        TribofluxError
            If workers fail.
        """
        size = math.prod(len(values) for _, values in axes)
        on_progress, before, total = self._on_progress, self._part * size, self._parts * size

        def report(now: SweepProgress) -> None:
            if on_progress is not None:
                done = before + round(now.fraction * size)
                on_progress(SweepProgress(done, total, now.not_ok))

        with temporary_folder() as folder:
            found = suitability(
                case,
                reduced,
                axes,
                store_folder=folder,
                workers=self._workers,
                on_progress=report,
            )
        self._part += 1
        return found
