"""Many cases that differ in some parameters: one store, local processes or a Dask cluster."""

from __future__ import annotations

import copy
import itertools
import math
from collections.abc import Callable, Iterable
from contextlib import ExitStack, closing
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BeforeValidator, Field, model_validator

from triboflux.case import Case
from triboflux.case_text import case_table, read_case_file
from triboflux.errors import InputError, shown, shown_path
from triboflux.sweep_values import MOST_MEMBERS, ValueRange, flattened, plain, put
from triboflux.validation import InputModel, Text, one_of

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["MODES", "Sweep", "SweepProgress", "ValueRange", "sweep"]

MODES = ("grid", "list")
"""Every combination of the values, or the first values together, the second ones, and so on."""
MOST_PARAMETERS = 16


def _case_tables(case: Any) -> Any:
    """Return the tables of a case, which may lack what is swept."""
    if isinstance(case, Case):
        return case_table(case.to_toml(), Path(), "the case")
    return plain(case)


class Sweep(InputModel):
    """A case and the values that some of its parameters take.

    Attributes
    ----------
    case : dict
        The tables of a case, which need not contain what is swept; or a `Case`.
    parameters : dict of str to list
        Values by dotted key, such as ``{"numbers.peclet": [1e4, 1e6]}``; a `ValueRange` or its
        table may stand for a list, nested tables for dotted keys, and ``initial.charge[0].sine``
        reaches into a list.
    mode : str
        ``"grid"``: every combination. ``"list"``: lists of equal length, taken together.

    Raises
    ------
    InputError
        If a key is unknown, a value is not allowed, lists have unequal lengths, or there are too
        many members. Combinations of allowed values that make no case are no error here: these
        members will be refused one by one.
    """

    case: Annotated[dict[str, Any], BeforeValidator(_case_tables)]
    parameters: Annotated[dict[str, list[Any]], BeforeValidator(flattened)] = Field(
        description="a table with dotted keys of the case and their values"
    )
    mode: Annotated[Text, one_of(MODES)] = "grid"

    @model_validator(mode="after")
    def _members_are_cases(self) -> Sweep:
        if not 1 <= len(self.parameters) <= MOST_PARAMETERS:
            problem = f"has {len(self.parameters)} keys, but must have 1 to {MOST_PARAMETERS}"
            raise InputError.about("parameters", problem)
        lengths = {key: len(values) for key, values in self.parameters.items()}
        if self.mode == "list" and len(set(lengths.values())) > 1:
            told = ", ".join(f"{shown(key)} {length}" for key, length in lengths.items())
            problem = f"has lists of unequal length ({told}), but mode 'list' takes equal ones"
            raise InputError.about("parameters", problem)
        if self.size > MOST_MEMBERS:
            problem = f"has {self.size:,} members, but must have at most {MOST_MEMBERS:,}"
            raise InputError.about("parameters", problem)
        for values, key in zip(self.parameters.values(), self.parameters, strict=True):
            if self.mode == "grid" and len({shown(value, 4000) for value in values}) < len(values):
                raise InputError.about(f"parameters.{shown(key)}", "has a value twice")
        for index in self._probes():
            Case(**self.table(index))
        return self

    def _probes(self) -> Iterable[int]:
        """Return members that contain every value: with the first of the others in a grid."""
        if self.mode == "list":
            return range(self.size)
        strides = [math.prod(self.shape[i + 1 :]) for i in range(len(self.shape))]
        return itertools.chain.from_iterable(
            range(0, stride * count, stride)
            for stride, count in zip(strides, self.shape, strict=True)
        )

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each parameter of a grid; one number for a list."""
        lengths = tuple(map(len, self.parameters.values()))
        return lengths if self.mode == "grid" else lengths[:1]

    @property
    def size(self) -> int:
        """Number of members."""
        return math.prod(self.shape)

    def values(self, index: int) -> dict[str, Any]:
        """Return the swept values of one member.

        Parameters
        ----------
        index : int
            From 0; in a grid the last parameter varies fastest.
        """
        if self.mode == "list":
            return {key: values[index] for key, values in self.parameters.items()}
        found: dict[str, Any] = {}
        for key, values in reversed(self.parameters.items()):
            index, place = divmod(index, len(values))
            found[key] = values[place]
        return dict(reversed(found.items()))

    def table(self, index: int) -> dict[str, Any]:
        """Return the tables of one member's case, not validated.

        Parameters
        ----------
        index : int
            As in `values`.
        """
        table = copy.deepcopy(self.case)
        for key, value in self.values(index).items():
            put(table, key, value)
        return table

    @classmethod
    def from_toml(cls, path: str | PathLike[str]) -> Sweep:
        """Read a sweep from a TOML file: a case with a further table ``[sweep]``.

        Parameters
        ----------
        path : path-like
            The file, at most 1 MiB of UTF-8. A relative ``initial.file`` is relative to its folder.

        Returns
        -------
        Sweep
            The validated sweep.

        Raises
        ------
        InputError
            If the file can't be read, is not TOML, or the sweep is not allowed.
        """
        text, name = read_case_file(path)
        return cls._from_tables(case_table(text, Path(path).absolute().parent, name))

    @classmethod
    def from_toml_text(cls, text: str, folder: str | PathLike[str] = ".") -> Sweep:
        """Read a sweep from TOML in a string.

        Parameters
        ----------
        text : str
            The TOML document, at most 1 MiB.
        folder : path-like
            What a relative ``initial.file`` is relative to.

        Returns
        -------
        Sweep
            The validated sweep.

        Raises
        ------
        InputError
            If the text is not TOML or the sweep is not allowed.
        """
        return cls._from_tables(case_table(text, Path(folder), "the sweep"))

    @classmethod
    def _from_tables(cls, tables: dict[str, Any]) -> Sweep:
        if "sweep" not in tables:
            raise InputError.about(
                "sweep", "is missing (a table with parameters, and mode if it is 'list')"
            )
        own = tables.pop("sweep")
        if not isinstance(own, dict):
            raise InputError.about("sweep", f"is {shown(own)}, but must be a table")
        given: dict[str, Any] = {**own}
        if "case" in given:
            raise InputError.about("sweep.case", "is not a known key; the case surrounds the sweep")
        return cls(case=tables, **given)

    def to_toml(self) -> str:
        """Write the sweep as TOML, ranges as lists; `from_toml_text` returns an equal sweep."""
        import tomli_w  # only writers need it, readers start faster

        own = {"mode": self.mode, "parameters": self.parameters}
        return tomli_w.dumps({**self.case, "sweep": own})


@dataclass(frozen=True)
class SweepProgress:
    """How far a sweep is.

    Attributes
    ----------
    done, total : int
        Members in the store, and members of the sweep.
    not_ok : int
        Those in the store whose status is not ok.
    """

    done: int
    total: int
    not_ok: int

    @property
    def fraction(self) -> float:
        """Part of the members that the store has, from 0 to 1."""
        return self.done / self.total


def sweep(
    members: Sweep,
    store: str | PathLike[str],
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    retry: bool = False,
    on_progress: Callable[[SweepProgress], None] | None = None,
) -> xr.Dataset:
    """Run every member of a sweep that its store does not have yet.

    The store is a Zarr group. Members are recorded as they come, each by one atomic step, so a
    sweep that was interrupted in whatever way goes on where it stood when it is called again. What
    the store holds depends on neither the order nor the place in which members are computed.

    Members are computed one at a time by processes of one thread. `jax.vmap` over a batch of like
    members is about ten times slower than the same program called for one after the other: all
    make as many steps as the one that needs most, and what is kept while the step stays the same is
    computed anew at every step. ``python -m benchmarks.sweep`` measures it.

    Parameters
    ----------
    members : Sweep
        What to run. `run.outputs` of its case has no effect: the end of each run is kept.
    store : path-like
        Folder of the Zarr group; made if absent.
    workers : int, optional
        Number of local processes; by default one per usable core.
    scheduler : str, optional
        Address of a Dask scheduler, such as ``tcp://host:8786``, whose workers are used in place of
        local processes. They need the same versions as this process.
    retry : bool
        Run members again that failed, by an exception or the death of their process.
    on_progress : Callable, optional
        Called with a `SweepProgress` once or more a second.

    Returns
    -------
    xarray.Dataset
        The store, opened: over the parameters in a grid, over ``member`` in a list.
        Variables ``status`` (``"ok"``, ``"nonphysical"``, ``"diverged"`` as in `Result`,
        ``"refused"`` for input such as numbers out of range, ``"failed"``; empty while missing),
        ``stop_reason`` (why the run ended, was refused or failed), ``warnings`` (one a line),
        ``stop_time``, ``peak_charge``, ``accepted`` and ``rejected`` (steps), and ``charge``,
        ``covariance``, ``variance`` on the points at the stop time; nan where there is none.

    Raises
    ------
    InputError
        If the store holds another sweep, is written by another process, or the scheduler can't be
        reached.
    TribofluxError
        If workers don't start, differ in version, or are lost; the store can be resumed.
    """
    import xarray as xr

    from triboflux.sweep_runners import (
        connected,
        on_cluster,
        on_processes,
        require_runner,
        task,
        usable_cores,
    )
    from triboflux.sweep_store import SweepStore, readable

    require_runner(workers, scheduler)
    with ExitStack() as stack:
        client = None if scheduler is None else stack.enter_context(connected(scheduler))
        held = stack.enter_context(SweepStore(store, members))
        missing = held.missing(retry=retry)
        tasks = ((index, task(members.table(index))) for index in missing)
        count = min(workers or usable_cores(), len(missing))
        outcomes = on_processes(tasks, count) if client is None else on_cluster(tasks, client)
        stack.enter_context(closing(outcomes))
        for outcome in outcomes:
            if outcome is not None:
                held.add(*outcome)
            held.flush(patiently=True)
            if on_progress is not None:
                on_progress(SweepProgress(held.done, members.size, held.not_ok))
    with readable(f"store {shown_path(store)}"):
        return xr.open_zarr(Path(store))  # pyright: ignore[reportUnknownMemberType] -- untyped keywords in xarray
