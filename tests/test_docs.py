"""What the documents show: their cases are valid and run, their tables are those of the scripts."""

import re
import tomllib
from pathlib import Path

import pytest

from benchmarks import presets as preset_tables
from benchmarks import suitability_table
from triboflux import model_table
from triboflux.case import Case
from triboflux.case_kinetic import Kinetic
from triboflux.case_text import case_table
from triboflux.solve import solve
from triboflux.suspension import Suspension
from triboflux.sweep import Sweep

ROOT = Path(__file__).resolve().parents[1]


def blocks(page: str) -> list[str]:
    """Return the TOML of a page."""
    return re.findall(r"```toml\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL)


def section(page: str, name: str) -> str:
    """Return what stands between the markers of a section."""
    text = (ROOT / page).read_text(encoding="utf-8")
    return text.partition(f"<!-- begin {name} -->\n")[2].partition(f"\n<!-- end {name} -->")[0]


KINETIC, SWEPT, CASES = ([], [], [])
for block in blocks("README.md"):
    kind = CASES if "[grid]" in block else SWEPT if "[sweep" in block else KINETIC
    kind.append(block)


def test_particles_of_the_readme_are_valid():
    (text,) = KINETIC
    Kinetic(**tomllib.loads(text)["kinetic"])


@pytest.mark.parametrize("text", CASES)
def test_cases_of_the_readme_are_valid(text):
    assert Case.from_toml_text(text).grid.dimensions in (1, 2)


def test_sweep_of_the_readme_is_that_of_the_example():
    (text,) = SWEPT
    example = (ROOT / "examples" / "sweep.toml").read_text(encoding="utf-8")
    assert tomllib.loads(text)["sweep"] == tomllib.loads(example)["sweep"]
    assert Sweep.from_toml_text(example).size == 42


def test_suspensions_of_the_page_are_valid():
    powder, changes = blocks("docs/suspension.md")
    assert Suspension.from_toml_text(powder).maximum_packing == 0.63
    assert set(case_table(changes, ROOT, "changes")["run"]) == {"t_end", "stop_at_peak_charge"}


@pytest.mark.parametrize(
    "path",
    sorted(path for path in (ROOT / "examples").glob("*.toml") if path.stem != "sweep"),
    ids=lambda path: path.name,
)
def test_examples_run(path):
    result = solve(Case.from_toml(path))
    assert result.status == "ok"


@pytest.mark.parametrize("name", preset_tables.SECTIONS)
def test_tables_of_the_suspension_page_are_up_to_date(name):
    assert section("docs/suspension.md", name) == preset_tables.SECTIONS[name]()


@pytest.mark.parametrize("name", suitability_table.SECTIONS)
def test_accuracy_of_the_table_is_that_of_the_shipped_one(name):
    found = suitability_table.SECTIONS[name](model_table.load())
    assert section("docs/suspension.md", name) == found
