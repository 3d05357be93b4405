"""What the figures share: sizes, letters, colours, and profiles over a periodic box."""

# Matplotlib leaves the types of its keyword arguments open.
# pyright: reportUnknownMemberType=false

from __future__ import annotations

import math
from collections.abc import Generator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, MultipleLocator

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from numpy.typing import NDArray
    from xarray import DataArray

    from triboflux.result import Result

DOTS_PER_INCH = 200
"""Of the PNG files."""

WIDTH = 180.0
"""Width of a figure that spans a journal's page, in millimetres."""

COLUMN = 90.0
"""Width of a figure that fits one of two columns, in millimetres."""

# Okabe & Ito's colours, which the colour-blind tell apart.
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILION, PURPLE, GREY = "#0072B2", "#D55E00", "#CC79A7", "0.6"
BROWN, WINE = "#7A4B14", "#882255"

ZERO: dict[str, Any] = {"color": "0.85", "linewidth": 0.5, "zorder": 0}
"""Line at zero."""

INITIAL: dict[str, Any] = {"color": GREY, "linewidth": 0.7}
"""Initial charge."""

CLOSURE_LINES: dict[str, dict[str, Any]] = {
    "published": {"color": BLUE, "linestyle": "-"},
    "derived": {"color": VERMILION, "linestyle": (0, (5, 2))},
}
"""Colour and, for print in grey, dashes of a closure set."""

_SETTINGS: dict[Any, Any] = {
    "font.size": 8.5,
    "axes.labelsize": 8.5,
    "axes.titlesize": 8.5,
    "figure.titlesize": 8.5,
    "legend.fontsize": 8.5,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "figure.constrained_layout.h_pad": 0.06,
    "figure.constrained_layout.w_pad": 0.06,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "lines.linewidth": 1.4,
    "axes.formatter.use_mathtext": True,
    "axes.formatter.limits": (-3, 4),
}


@contextmanager
def page(height: float, width: float = WIDTH) -> Generator[Figure, None, None]:
    """Give an empty figure, and the settings under which it is to be drawn.

    Parameters
    ----------
    height, width : float
        In millimetres; as wide as a page by default.

    Yields
    ------
    matplotlib.figure.Figure
        Not known to pyplot.
    """
    with mpl.rc_context(_SETTINGS):
        figure = Figure(
            figsize=(width / 25.4, height / 25.4), dpi=DOTS_PER_INCH, layout="constrained"
        )
        FigureCanvasAgg(figure)
        yield figure


def finish_panel(ax: Axes, title: str, label: str, length: float, ticks: int = 4) -> None:
    """Give a panel over the box its title, label, ticks and line at zero.

    Parameters
    ----------
    ax : Axes
        The panel.
    title, label : str
        Above it on the left, and along its vertical axis.
    length : float
        Of the box, in the units of the horizontal axis.
    ticks : int
        Intervals between ticks on the horizontal axis.
    """
    ax.axhline(0.0, **ZERO)
    ax.margins(x=0.0)
    # Ticks that depend on the panel's height would outgrow the room that the layout gave them.
    ax.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    ax.xaxis.set_major_locator(MultipleLocator(length / ticks))
    # A power of ten on the left would push the title up.
    ax.yaxis.set_offset_position("right")
    ax.set_title(title, loc="left")
    ax.set_ylabel(label)


def centred(values: DataArray, length: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return positions from one end of the box to the other, 0 in the middle, and values there.

    Parameters
    ----------
    values : xarray.DataArray
        Over ``x``, which goes from 0 to the length of the box; a vector's first component is taken.
    length : float
        Of the box, in the units of ``x``.
    """
    if "component" in values.dims:
        values = values.isel(component=0)
    x, y = values["x"].values, values.values
    beyond = int(np.count_nonzero(x >= length / 2.0))
    x, y = np.roll(np.where(x < length / 2.0, x, x - length), beyond), np.roll(y, beyond)
    # The box is periodic, so its end is its beginning.
    return np.append(x, x[0] + length), np.append(y, y[0])


def profile(
    result: Result, variable: str, time: int = -1
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a variable of a result in one dimension as `centred` does.

    Parameters
    ----------
    result : Result
        In one dimension.
    variable : str
        Of its dataset.
    time : int
        Index of the output, the last by default.
    """
    return centred(result.dataset[variable].isel(time=time), result.case.grid.lengths[0])


def save(figure: Figure, path: Path) -> None:
    """Write a figure; the same figure gives the same file."""
    undated = {"CreationDate": None} if path.suffix == ".pdf" else None
    figure.savefig(path, dpi=DOTS_PER_INCH, metadata=undated)


def power_of_ten(value: float) -> str:
    """Return a number, as a power of ten if it is one and is far from 1.

    Parameters
    ----------
    value : float
        Any number, infinity included.
    """
    exponent = round(math.log10(value)) if 0.0 < value < math.inf else 0
    is_power = math.isclose(value, 10.0**exponent, rel_tol=1e-12)
    return f"$10^{{{exponent}}}$" if is_power and abs(exponent) > 2 else f"{value:g}"


def shown_number(value: float) -> str:
    """Return a number with four digits, as a power of ten where that is shorter.

    Parameters
    ----------
    value : float
        Any number, infinity included.
    """
    text = power_of_ten(float(f"{value:.4g}"))
    mantissa, exponential, exponent = text.partition("e")
    return f"${mantissa}\\times 10^{{{int(exponent)}}}$" if exponential else text


def shown_time(value: float) -> str:
    """Return a time with five digits."""
    return f"{value:#.5g}".rstrip(".")
