"""A result in a notebook: its case, how it ended, its warnings and a small figure."""

# Matplotlib leaves the types of its keyword arguments open.
# pyright: reportUnknownMemberType=false

from __future__ import annotations

import base64
import io
from html import escape
from typing import TYPE_CHECKING

from triboflux.dataset import source_of

if TYPE_CHECKING:
    from triboflux.result import Result

_DOTS_PER_INCH = 90


def html(result: Result) -> str:
    """Return a result as HTML that stands alone; all texts are escaped.

    The figure is a PNG within the page, and its text alternative tells the range of each variable.

    Parameters
    ----------
    result : Result
        Scaled or in SI, as it is to be shown.
    """
    from triboflux.figures.pictures import description, plot

    file = io.BytesIO()
    plot(result).savefig(file, format="png", dpi=_DOTS_PER_INCH, facecolor="white")
    image = base64.b64encode(file.getvalue()).decode("ascii")
    rows = "".join(
        f'<tr><th scope="row" style="text-align: left">{escape(name)}</th>'
        f'<td style="text-align: left">{escape(text)}</td></tr>'
        for name, text in _facts(result).items()
    )
    # the sentences of a run speak of scaled values
    scaled = " (scaled)" if result.units == "si" else ""
    told = "".join(f"<li>{escape(sentence)}{scaled}</li>" for sentence in result.warnings)
    warnings = f"<p><strong>Warnings</strong></p><ul>{told}</ul>" if told else ""
    title = escape(result.case.title or "Result of a run without a title")
    return (
        f'<div class="triboflux-result"><p><strong>{title}</strong></p><table>{rows}</table>'
        f'{warnings}<img src="data:image/png;base64,{image}" alt="{escape(description(result))}" '
        'style="max-width: 100%"></div>'
    )


def _facts(result: Result) -> dict[str, str]:
    """Return what the table tells, by the heads of its rows."""
    case, dataset, si = result.case, result.dataset, result.units == "si"
    numbers = {name: getattr(case.numbers, name) for name in type(case.numbers).model_fields}
    size = " × ".join(map(str, case.grid.points))
    end = f"{float(dataset['time'][-1]):.6g}{' s' if si else ' (scaled)'}"
    return {
        "status": f"{result.status}: {result.stop_reason}",
        "made by": source_of(case, dataset.attrs),
        "numbers": ", ".join(f"{name} = {value:.6g}" for name, value in numbers.items()),
        "grid": f"{size} points",
        "times": f"{dataset.sizes['time']} outputs, the last at {end}",
        "units": "SI" if si else "scaled",
    }
