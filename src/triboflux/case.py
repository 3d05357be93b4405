"""One run as validated, immutable data that can be written as TOML and read again."""

from __future__ import annotations

import math
from os import PathLike
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from triboflux import case_checks
from triboflux.case_kinetic import Kinetic
from triboflux.case_text import case_table, case_text, read_case_file
from triboflux.case_units import resolve_suspension
from triboflux.errors import InputError
from triboflux.hierarchy import MODELS, moves
from triboflux.numbers import Numbers
from triboflux.suspension import Suspension
from triboflux.validation import (
    Amplitude,
    Flag,
    InputModel,
    NonNegative,
    Positive,
    Real,
    Reals,
    Text,
    Whole,
    Wholes,
    bounded,
    longest,
    one_of,
    printable,
)

MODEL_NAMES = tuple(MODELS)
"""Names of the transport models, the most complete first."""
MODELS_WITH_VARIANCE = tuple(
    name for name, known in MODELS.items() if "variance" in known.evolves + known.closes
)
"""Those that know the charge variance."""
CLOSURE_NAMES = ("derived", "published", "complete")
"""Names of the closure sets."""


class Mode(InputModel):
    r"""One Fourier mode of a periodic field.

    It contributes :math:`s \sin\theta + c \cos\theta` with
    :math:`\theta = 2\pi \sum_i m_i x_i / \ell_i`.

    Attributes
    ----------
    mode : tuple of int
        Waves along each dimension, :math:`m_i`; they may be negative or zero.
    sine, cosine : float
        Amplitudes :math:`s` and :math:`c` in the scale of the field.
    """

    mode: Wholes = Field(description="a list with one whole number per dimension")
    sine: Amplitude = 0.0
    cosine: Amplitude = 0.0


class ComponentMode(Mode):
    """One Fourier mode of one component of a vector field.

    Attributes
    ----------
    component : int
        0 for x, 1 for y, 2 for z.
    """

    component: Whole = Field(description="0 for x, 1 for y, 2 for z")


class GridSpec(InputModel):
    """A periodic box with equally spaced points.

    Attributes
    ----------
    points : tuple of int
        Number of points along each of 1, 2 or 3 dimensions.
    lengths : tuple of float
        Lengths of the box, scaled by L; ones by default.
    """

    points: Annotated[Wholes, AfterValidator(case_checks.check_points)] = Field(
        description="a list with one number of points per dimension"
    )
    lengths: tuple[Positive, ...] = Field(
        default_factory=lambda data: (1.0,) * len(data.get("points", ()))
    )

    @model_validator(mode="after")
    def _one_length_per_dimension(self) -> GridSpec:
        if len(self.lengths) != len(self.points):
            raise InputError.about(
                "lengths",
                f"has {len(self.lengths)} entries, but must have as many as points, "
                f"{len(self.points)}",
            )
        return self

    @property
    def dimensions(self) -> int:
        """Number of dimensions of the box: 1, 2 or 3."""
        return len(self.points)

    @property
    def size(self) -> int:
        """Number of points of the whole grid."""
        return math.prod(self.points)


_MOST_MODES = 1000


class Initial(InputModel):
    """The state at time 0: sums of Fourier modes, or the last time of a result.

    Attributes
    ----------
    charge : tuple of Mode
        Mean charge, scaled by Q0.
    covariance : tuple of ComponentMode
        Charge-velocity covariance, scaled by Q0 times the root of the granular temperature.
    variance : tuple of Mode
        Charge variance, scaled by Q0 squared.
    file : str or None
        A NetCDF result whose last time gives all three fields.
    neutralising_background : bool
        Accept a net charge and add a uniform background that neutralises it.
    """

    charge: Annotated[tuple[Mode, ...], longest(_MOST_MODES)] = ()
    covariance: Annotated[tuple[ComponentMode, ...], longest(_MOST_MODES)] = ()
    variance: Annotated[tuple[Mode, ...], longest(_MOST_MODES)] = ()
    file: Annotated[Text, printable(4000)] | None = None
    neutralising_background: Flag = False

    @model_validator(mode="after")
    def _one_source(self) -> Initial:
        for name in ("charge", "covariance", "variance"):
            if self.file is not None and getattr(self, name):
                raise InputError.about(
                    name, "is given beside initial.file, but the state comes from one of them only"
                )
        return self


class Run(InputModel):
    r"""When to stop, what to keep, how accurately to integrate.

    Times are scaled by :math:`L/\sqrt\Theta`.

    Attributes
    ----------
    t_end : float
        Latest end of the run.
    stop_at_peak_charge : float or None
        Stop when the largest absolute charge has fallen to this value, scaled by Q0.
    stop_at_rate : float or None
        Stop when the state changes more slowly than this.
    outputs : int or tuple of float
        Number of equally spaced output times, or increasing output times.
    rtol, atol : float
        Relative and absolute tolerance of a time step.
    adaptive_points : bool
        Work on fewer points than the grid's for as long as they resolve the state; see
        `triboflux.resolution`. Runs with bounds that are looked for on the points, those of the
        algebraic model and of `realizability_bound`, always work on the grid's.
    realizability_bound : float or None
        Stop, with status ``"nonphysical"``, when |C|² − V, which no joint distribution of charges
        and velocities lets rise above zero, has risen to this value anywhere, scaled by Q0².
    allow_out_of_range : bool
        Run although the closures are outside their range of validity.
    """

    t_end: Annotated[Real, bounded(0.0, math.inf, open_ends=True)] = Field(
        description="the time at which the run ends, positive and finite"
    )
    stop_at_peak_charge: Positive | None = None
    stop_at_rate: Positive | None = None
    outputs: Annotated[int | Reals, BeforeValidator(case_checks.parse_outputs)] = 20
    rtol: Annotated[Real, bounded(1e-12, 1e-1)] = 1e-6
    atol: NonNegative = 1e-9
    adaptive_points: Flag = True
    realizability_bound: Positive | None = None
    allow_out_of_range: Flag = False

    @model_validator(mode="after")
    def _outputs_before_the_end(self) -> Run:
        if isinstance(self.outputs, tuple) and self.outputs[-1] > self.t_end:
            raise InputError.about(
                "outputs",
                f"ends at {self.outputs[-1]!r}, but its times must not exceed t_end, "
                f"{self.t_end!r}",
            )
        return self

    @property
    def output_times(self) -> tuple[float, ...]:
        """The times of the outputs, equally spaced if only their number is given."""
        if isinstance(self.outputs, tuple):
            return self.outputs
        if self.outputs == 1:
            return (0.0,)
        step = self.t_end / (self.outputs - 1)
        return (*(i * step for i in range(self.outputs - 1)), self.t_end)


class Case(InputModel):
    """Everything that defines one run.

    Attributes
    ----------
    title : str
        One line of at most 200 printable characters.
    model : str
        Name of the transport model, one of `MODEL_NAMES`.
    closures : str
        Name of the closure set, one of `CLOSURE_NAMES`.
    exponent : float
        Exponent of the impact velocity in the charge that a contact passes over, dimensionless;
        4/5 for Hertz contacts, the only one that the published closures know.
    suspension : Suspension or None
        Particles, gas and state in SI; `numbers` follows from it. Every number of the case keeps
        its scaled meaning, but lengths, times, charges and amplitudes may then also be texts with
        units, such as ``t_end = "20 ms"``.
    numbers : Numbers
        The seven dimensionless numbers.
    grid : GridSpec
        The periodic box.
    initial : Initial
        The state at time 0; zero by default.
    run : Run
        Stop rules, outputs and tolerances.
    kinetic : Kinetic or None
        Particles of a simulation; `solve` ignores it.

    Raises
    ------
    InputError
        If anything is missing, unknown or not allowed.
    """

    title: Annotated[Text, printable(200)] = ""
    model: Annotated[Text, one_of(MODEL_NAMES)] = "full"
    closures: Annotated[Text, one_of(CLOSURE_NAMES)] = "derived"
    exponent: Annotated[Real, bounded(-0.5, 4.0, open_ends=True)] = 0.8
    suspension: Suspension | None = None
    numbers: Numbers = Field(
        description="a table with the dimensionless numbers; or give a table suspension, in SI"
    )
    grid: GridSpec = Field(description="a table with points and lengths")
    initial: Initial = Field(default_factory=Initial)
    run: Run = Field(description="a table with at least t_end")
    kinetic: Kinetic | None = None

    @model_validator(mode="before")
    @classmethod
    def _numbers_follow(cls, data: Any) -> Any:
        return resolve_suspension(data, CLOSURE_NAMES)

    @model_validator(mode="after")
    def _parts_fit(self) -> Case:
        case_checks.check_closures(self)
        case_checks.check_realizability_bound(self, MODELS_WITH_VARIANCE)
        case_checks.check_dimensions(self, one=moves(self.model))
        case_checks.check_modes(self)
        case_checks.check_neutrality(self)
        case_checks.check_variance(self)
        return self

    @classmethod
    def from_toml(cls, path: str | PathLike[str]) -> Case:
        """Read a case from a TOML file.

        Parameters
        ----------
        path : path-like
            The file, at most 1 MiB of UTF-8. A relative ``initial.file`` in it is relative to
            its folder.

        Returns
        -------
        Case
            The validated case.

        Raises
        ------
        InputError
            If the file can't be read, is not TOML, or the case is not allowed.
        """
        text, name = read_case_file(path)
        folder = Path(path).absolute().parent
        return cls(**case_table(text, folder, name))

    @classmethod
    def from_toml_text(cls, text: str, folder: str | PathLike[str] = ".") -> Case:
        """Read a case from TOML in a string.

        Parameters
        ----------
        text : str
            The TOML document, at most 1 MiB.
        folder : path-like
            What a relative ``initial.file`` is relative to.

        Returns
        -------
        Case
            The validated case.

        Raises
        ------
        InputError
            If the text is not TOML or the case is not allowed.
        """
        return cls(**case_table(text, Path(folder), "the case"))

    def to_toml(self) -> str:
        """Write the case as TOML; `from_toml_text` returns an equal case.

        Returns
        -------
        str
            The TOML document, with every default spelled out.
        """
        derived = set[str]() if self.suspension is None else {"numbers"}
        data: dict[str, Any] = self.model_dump(exclude_none=True, exclude=derived)
        return case_text(data)
