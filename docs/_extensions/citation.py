"""How to cite, from CITATION.cff."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from triboflux import __version__

FILE = Path(__file__).resolve().parents[2] / "CITATION.cff"


def citation() -> str:
    """Return the software and the paper as text and as BibTeX."""
    record = yaml.safe_load(FILE.read_text(encoding="utf-8"))
    (paper,) = record["references"]
    authors = " and ".join(f"{a['family-names']}, {a['given-names']}" for a in paper["authors"])
    names = [author["family-names"] for author in paper["authors"]]
    listed = f"{', '.join(names[:-1])} & {names[-1]}"
    software = record["authors"][0]["name"]
    return "\n".join(
        [
            f"{record['message']}",
            "",
            f"- {software}. *{record['title']}*, version {__version__}. {record['license']}.",
            f"- {listed} ({paper['year']}). {paper['title']}. *{paper['journal']}*.",
            "",
            "```bibtex",
            *_entry(
                "software",
                record["title"],
                author=f"{{{software}}}",
                title=record["title"],
                version=__version__,
            ),
            "",
            *_entry(
                "article",
                f"{names[0].lower()}{paper['year']}",
                author=authors,
                title=paper["title"],
                journal=paper["journal"],
                year=paper["year"],
            ),
            "```",
        ]
    )


def _entry(kind: str, key: str, **fields: Any) -> list[str]:
    lines = [f"  {name} = {{{value}}}," for name, value in fields.items()]
    return [f"@{kind}{{{key},", *lines, "}"]
