"""What the documents show: their tables are those of the scripts, and examples run."""

import re
import tomllib
from pathlib import Path

import pytest

from benchmarks import presets as preset_tables
from benchmarks import suitability_table
from triboflux import model_table
from triboflux.case import Case
from triboflux.solve import solve
from triboflux.sweep import Sweep

ROOT = Path(__file__).resolve().parents[1]


def blocks(page: str) -> list[str]:
    """Return the TOML of a page."""
    return re.findall(r"```toml\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL)


def section(page: str, name: str) -> str:
    """Return what stands between the markers of a section."""
    text = (ROOT / page).read_text(encoding="utf-8")
    return text.partition(f"<!-- begin {name} -->\n")[2].partition(f"\n<!-- end {name} -->")[0]


def test_sweep_of_the_readme_is_that_of_the_example():
    (text,) = (block for block in blocks("README.md") if "[sweep" in block)
    example = (ROOT / "examples" / "sweep.toml").read_text(encoding="utf-8")
    assert tomllib.loads(text)["sweep"] == tomllib.loads(example)["sweep"]
    assert Sweep.from_toml_text(example).size == 42


@pytest.mark.parametrize("name", ["fig1", "particles"])
def test_examples_run_that_no_page_runs(name):
    result = solve(Case.from_toml(ROOT / "examples" / f"{name}.toml"))
    assert result.status == "ok"


@pytest.mark.parametrize("name", preset_tables.SECTIONS)
def test_tables_of_the_suspension_page_are_up_to_date(name):
    assert section("docs/suspension.md", name) == preset_tables.SECTIONS[name]()


@pytest.mark.parametrize("name", suitability_table.SECTIONS)
def test_accuracy_of_the_table_is_that_of_the_shipped_one(name):
    found = suitability_table.SECTIONS[name](model_table.load())
    assert section("docs/suspension.md", name) == found
