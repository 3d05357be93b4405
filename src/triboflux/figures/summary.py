"""The page that sets the paper's statements about its figures beside what was measured."""

from __future__ import annotations

from html import escape
from typing import Any

from triboflux import __version__
from triboflux.figures.cases import CLOSURES
from triboflux.figures.statements import Finding, Statement, heading, statements

_TITLE = "The figures of Montilla, Ansart & Simonin (2023), computed anew"
_INTRODUCTION = (
    "Written by triboflux {version}. Every number below was measured on the results beside this "
    "page when it was written. “published” are the closure coefficients that the paper "
    "prints, “derived” those that follow from its own collision model. All quantities "
    "are dimensionless as in the paper; t* is the time at which the largest charge has halved."
)
_VERDICTS = {True: "agrees", False: "differs", None: "measured"}
_STYLE = """
body { font: 16px/1.45 sans-serif; max-width: 62em; margin: 2em auto; padding: 0 1em;
       color: #111; background: #fff; }
img { max-width: 100%; height: auto; }
table { border-collapse: collapse; width: 100%; margin: 1em 0 3em; font-size: 0.9em; }
th, td { border: 1px solid #999; padding: 0.4em 0.6em; text-align: left; vertical-align: top; }
th { background: #eee; }
.agrees { color: #005a8c; } .differs { color: #a03c00; }
"""


def pages(data: dict[int, Any]) -> tuple[str, str]:
    """Return the page as Markdown and as HTML.

    Parameters
    ----------
    data : dict
        What was computed for every figure, by number.
    """
    found = {number: statements(number, data) for number in data}
    return _markdown(found), _html(found)


def _markdown(found: dict[int, list[Statement]]) -> str:
    lines = [f"# {_TITLE}", "", _INTRODUCTION.format(version=__version__), ""]
    for number, rows in found.items():
        title = f"Fig. {number}: {heading(number)}"
        lines += [f"## {title}", "", f"![{title}](fig{number}.png)", ""]
        lines += [f"| The paper | {' | '.join(CLOSURES)} |", "|---" * (1 + len(CLOSURES)) + "|"]
        for row in rows:
            cells = (row.paper, *(_markdown_cell(row.findings[c]) for c in CLOSURES))
            lines.append("| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |")
        lines.append("")
    return "\n".join(lines)


def _markdown_cell(finding: Finding) -> str:
    return f"**{_VERDICTS[finding.agrees]}**: {finding.measured}"


def _html(found: dict[int, list[Statement]]) -> str:
    parts = [
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
        f"<title>{escape(_TITLE)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>",
        f"<h1>{escape(_TITLE)}</h1>",
        f"<p>{escape(_INTRODUCTION.format(version=__version__))}</p>",
    ]
    head = "".join(f"<th>{escape(name)}</th>" for name in ("The paper", *CLOSURES))
    for number, rows in found.items():
        title = escape(f"Fig. {number}: {heading(number)}")
        parts += [
            f'<h2 id="fig{number}">{title}</h2>',
            f'<p><a href="fig{number}.pdf"><img src="fig{number}.png" alt="{title}"></a></p>',
            f"<table>\n<tr>{head}</tr>",
        ]
        for row in rows:
            cells = "".join(_html_cell(row.findings[closures]) for closures in CLOSURES)
            parts.append(f"<tr><td>{escape(row.paper)}</td>{cells}</tr>")
        parts.append("</table>")
    return "\n".join([*parts, "</body>\n</html>\n"])


def _html_cell(finding: Finding) -> str:
    verdict = _VERDICTS[finding.agrees]
    return f'<td><b class="{verdict}">{verdict}</b>: {escape(finding.measured)}</td>'
