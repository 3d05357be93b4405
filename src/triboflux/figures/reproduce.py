"""Computing and writing the paper's figures, with the data behind them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from matplotlib.figure import Figure

from triboflux.errors import InputError
from triboflux.figures import budgets, closure, comparison, profiles, regions, style
from triboflux.figures.cases import CASE_OF_FIGURE, CLOSURES, MAP, Runs, paper_case
from triboflux.files import require_writable, written_at_once
from triboflux.result import Result
from triboflux.sweep_runners import require_runner

if TYPE_CHECKING:
    import xarray as xr

    from triboflux.solve import Progress
    from triboflux.sweep import SweepProgress

SUMMARIES = ("summary.md", "summary.html")
"""The pages that set what the paper says beside what was measured."""


class Kind(NamedTuple):
    """How one kind of figure is made.

    Attributes
    ----------
    parts : int
        How many results it asks for.
    names : tuple of str
        Of its data files, between ``figN_`` and ``.nc``.
    compute : Callable
        ``(number, runs) -> data``.
    draw : Callable
        ``(number, data) -> figure``.
    contents : Callable
        ``data -> contents of the data files``, in the order of ``names``.
    """

    parts: int
    names: tuple[str, ...]
    compute: Callable[[int, Runs], Any]
    draw: Callable[[int, Any], Figure]
    contents: Callable[[Any], list[Result | xr.Dataset]]


def _profiles_of(number: int, runs: Runs) -> dict[str, Result]:
    return {closures: runs(paper_case(CASE_OF_FIGURE[number], closures)) for closures in CLOSURES}


def _draw_profiles(number: int, data: dict[str, Result]) -> Figure:
    return {1: profiles.figure_one, 2: profiles.figure_two}[number](*data.values())


_PROFILES = Kind(
    len(CLOSURES), CLOSURES, _profiles_of, _draw_profiles, lambda data: list(data.values())
)
_BUDGETS = Kind(
    budgets.PARTS, CLOSURES, budgets.budgets, budgets.draw, lambda data: list(data.values())
)
_CLOSURE = Kind(
    closure.PARTS,
    tuple(f"{letter}_{closures}" for letter in "ab" for closures in CLOSURES),
    lambda _, runs: closure.initial_variances(runs),
    lambda _, data: closure.draw(data),
    lambda data: [start.profile for start in data.values()],
)


_REGIONS = Kind(
    regions.PARTS,
    CLOSURES,
    lambda _, runs: regions.regions(runs),
    lambda _, data: regions.draw(data),
    lambda data: list(data.values()),
)


def _comparison(number: int) -> Kind:
    return Kind(
        comparison.PARTS,
        tuple(f"{c}_{model}" for c in CLOSURES for model in ("full", comparison.MODELS[number])),
        comparison.compare,
        comparison.draw,
        lambda data: [result for pair in data.values() for result in pair[:2]],
    )


KINDS: dict[int, Kind] = {
    1: _PROFILES,
    2: _PROFILES,
    3: _comparison(3),
    4: _BUDGETS,
    5: _BUDGETS,
    6: _CLOSURE,
    7: _comparison(7),
    8: _comparison(8),
    MAP: _REGIONS,
}
"""How each figure is made."""


class Reproduction:
    """Figures of the paper to be written to a folder; no case is run twice.

    Parameters
    ----------
    folder : path-like
        An existing folder. For Fig. 1 it gets ``fig1.png``, ``fig1.pdf`` and the data, such as
        ``fig1_published.nc``.
    numbers : sequence of int, optional
        Of the figures; all of them by default.
    overwrite : bool
        Replace existing files.
    workers : int, optional
        Number of local processes for the maps of Fig. 9; one per usable core by default.

    Raises
    ------
    InputError
        If there is no such figure or number of workers, the folder is missing, or any of the files
        exists.
    """

    def __init__(
        self,
        folder: str | PathLike[str],
        numbers: Sequence[int] | None = None,
        *,
        overwrite: bool = False,
        workers: int | None = None,
    ) -> None:
        require_runner(workers, None)
        self.numbers = tuple(KINDS) if numbers is None else tuple(numbers)
        for number in self.numbers:
            if number not in KINDS:
                raise InputError.about(
                    "figure", f"is {number!r}, but must be one of {', '.join(map(str, KINDS))}"
                )
        self._folder, self._overwrite = Path(folder), overwrite
        self._runs = Runs(workers)
        self._data: dict[int, Any] = {}
        summaries = self._summaries if numbers is None else ()
        for path in (*(p for number in self.numbers for p in self.paths(number)), *summaries):
            require_writable(path, overwrite=overwrite)

    @property
    def _summaries(self) -> tuple[Path, ...]:
        return tuple(self._folder / name for name in SUMMARIES)

    def paths(self, number: int) -> list[Path]:
        """Return the files of a figure.

        Parameters
        ----------
        number : int
            Of the figure.
        """
        endings = (".png", ".pdf", *(f"_{name}.nc" for name in KINDS[number].names))
        return [self._folder / f"fig{number}{ending}" for ending in endings]

    def write(
        self,
        number: int,
        on_progress: Callable[[Progress | SweepProgress], None] | None = None,
    ) -> list[Path]:
        """Compute and draw a figure and write its files.

        Parameters
        ----------
        number : int
            Of the figure.
        on_progress : Callable, optional
            Called with the progress of all runs of the figure together, which is a
            `triboflux.solve.Progress`, for Fig. 9 a `triboflux.sweep.SweepProgress`.

        Returns
        -------
        list of pathlib.Path
            The files, all of which were written; after an error none was.

        Raises
        ------
        TribofluxError
            If a run fails or a file can't be written.
        """
        kind = KINDS[number]
        self._runs.expect(kind.parts, on_progress)
        data = kind.compute(number, self._runs)
        self._data[number] = data
        figure = kind.draw(number, data)
        paths = self.paths(number)
        contents = (figure, figure, *kind.contents(data))
        with ExitStack() as stack:
            for path, content in zip(paths, contents, strict=True):
                # The files get their names together, when all of them are complete.
                partial = stack.enter_context(written_at_once(path, overwrite=self._overwrite))
                _write(content, partial)
        return paths

    def write_summary(self) -> list[Path]:
        """Write what the paper says of its figures beside what was measured, after all figures.

        Returns
        -------
        list of pathlib.Path
            ``summary.md`` and ``summary.html``, both written, or none after an error.

        Raises
        ------
        TribofluxError
            If a file can't be written.
        """
        from triboflux.figures import summary

        texts = summary.pages(self._data)
        with ExitStack() as stack:
            for path, text in zip(self._summaries, texts, strict=True):
                partial = stack.enter_context(written_at_once(path, overwrite=self._overwrite))
                partial.write_text(text, encoding="utf-8")
        return list(self._summaries)


def _write(content: Figure | Result | xr.Dataset, path: Path) -> None:
    """Write a figure or data."""
    if isinstance(content, Figure):
        # Without a date the same result gives the same file.
        undated = {"CreationDate": None} if path.suffix == ".pdf" else None
        content.savefig(path, dpi=style.DOTS_PER_INCH, metadata=undated)
    elif isinstance(content, Result):
        content.to_netcdf(path)
    else:
        compressed = {
            name: {"zlib": True, "complevel": 1}
            for name, variable in content.variables.items()
            if variable.dtype.kind == "f" and variable.ndim
        }
        content.to_netcdf(path, engine="netcdf4", encoding=compressed)


def reproduce(
    number: int,
    folder: str | PathLike[str],
    *,
    overwrite: bool = False,
    workers: int | None = None,
    on_progress: Callable[[Progress | SweepProgress], None] | None = None,
) -> list[Path]:
    """Run the cases behind a figure of the paper with both closure sets, and draw it.

    Parameters
    ----------
    number : int
        Of the figure, from 1 to 9.
    folder : path-like
        An existing folder; see `Reproduction`.
    overwrite : bool
        Replace existing files.
    workers : int, optional
        See `Reproduction`.
    on_progress : Callable, optional
        See `Reproduction.write`.

    Returns
    -------
    list of pathlib.Path
        The files, all of which were written; after an error none was.

    Raises
    ------
    InputError
        If there is no such figure or number of workers, the folder is missing, or a file exists.
    TribofluxError
        If a run fails or a file can't be written.
    """
    reproduction = Reproduction(folder, [number], overwrite=overwrite, workers=workers)
    return reproduction.write(number, on_progress)
