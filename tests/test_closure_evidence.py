"""The table of exact, sampled and printed coefficients says what was found."""

import math

import pytest

from benchmarks import closure_evidence as evidence
from benchmarks.closure_evidence import Row, symbol, with_error
from benchmarks.collision_algebra import A, E
from triboflux import closures
from triboflux.closures import Coefficient
from triboflux.errors import InputError
from triboflux.responses import ADDITIONS
from triboflux.sampling import Estimate


@pytest.fixture(scope="module")
def forms():
    return evidence.exact_forms()


@pytest.fixture
def known_forms(monkeypatch, forms):
    monkeypatch.setattr(evidence, "exact_forms", lambda: forms)


@pytest.mark.parametrize(
    ("value", "error", "shown"),
    [
        (1.825412, 0.000288, "1.82541(29)"),
        (-0.13345, 0.00026, "-0.13345(26)"),
        (0.36677, 0.00996, "0.367(10)"),
        (85.1776, 0.0065, "85.1776(65)"),
        (85.1776, 1.26, "85.2(1.3)"),
        (85.1776, 9.96, "85(10)"),
        (851.776, 12.4, "852(12)"),
        (0.0, 0.00021, "0.00000(21)"),
        (1 / 12, 1e-17, "0.0833333"),
    ],
)
def test_value_with_its_error(value, error, shown):
    assert with_error(Estimate(value, error)) == shown


def row(exact=1.0, sampled=(1.0, 0.001), printed=None, formula="1.0"):
    return Row(
        "dispersion",
        "`J_(1+a)/6`",
        math.nan,
        0.8,
        exact,
        None if sampled is None else Estimate(*sampled),
        None if printed is None else Coefficient("x", printed, formula, ""),
    )


@pytest.mark.parametrize(
    ("example", "verdict"),
    [
        (row(sampled=(1.002, 0.001)), "confirmed, z = +2.0"),
        (row(sampled=(0.995, 0.001)), "NOT CONFIRMED, z = -5.0"),
        (row(sampled=(1.0, 1e-17)), "confirmed in every pair"),
        (row(sampled=(1.002, 1e-17)), "NOT CONFIRMED, z = +2"),
        (row(sampled=None), "drag, not sampled"),
        (row(exact=1.04, sampled=(1.04, 0.001), printed=1.0), "agrees with the print"),
        (
            row(exact=1.06, sampled=(1.06, 0.001), printed=1.0),
            "the print is 60 standard errors away",
        ),
        (row(exact=1.04, sampled=(1.04, 0.001), printed=1.0, formula="(1+e)/2"), "the print is 40"),
        (
            row(sampled=(1.0, 1e-17), printed=144.0, formula="144"),
            "the print is 144 times as large",
        ),
        (row(sampled=None, printed=2.0, formula="2"), "the print is 2 times as large"),
    ],
)
def test_verdict(example, verdict):
    assert verdict in example.verdict()
    assert example.confirmed() == ("NOT" not in verdict)


def test_symbols():
    assert symbol("dispersion") == "λ1.2"
    assert symbol("third_moment_exchange") == "K1, 1/τ_ξ"
    assert symbol("third_moment_shear") == "ρ1"
    assert symbol("variance_flux_product") == "λ3.5 κ"
    assert symbol("exchange_time") == "λ'"
    names = [*closures.complete(1.0).coefficients, *ADDITIONS]
    assert len({symbol(name) for name in names}) == len(names)


def test_forms_are_readable():
    assert evidence.readable(A * E**2 + 1) == "`a e^2 + 1`"


def test_every_coefficient_has_its_rows(known_forms):
    text, rows = evidence.section(1000, 1)
    printed = closures.published(1.0).coefficients.keys() - {"transferred_fraction"}
    names = [*closures.complete(1.0).coefficients, *ADDITIONS]
    for exponent in evidence.EXPONENTS.values():
        some = [row for row in rows if row.exponent == exponent]
        assert list(dict.fromkeys(row.name for row in some)) == names
        by_restitution = [row for row in some if row.name == "covariance_exchange"]
        assert [row.restitution for row in by_restitution] == [1.0, 0.8, 0.5]
        for row in some:
            assert (row.sampled is None) == (row.name == "third_moment_drag")
            has_print = exponent == 0.8 and row.name in printed
            assert (row.printed is not None) == has_print
    tables = [line for line in text.splitlines() if line.startswith("|")]
    assert len(tables) == len(rows) + 4
    assert "1,024 colliding pairs" in text
    assert "`python -m benchmarks.closure_evidence --samples 1000 --seed 1 --write`" in text


def test_section_is_written_between_its_markers(known_forms, monkeypatch, tmp_path, capsys):
    page = tmp_path / "closures.md"
    page.write_text("before\n<!-- begin proof -->\nold\n<!-- end proof -->\nafter\n")
    monkeypatch.setattr(evidence, "PAGE", page)
    assert evidence.main(["--samples", "1000", "--write"]) == 0
    text = page.read_text()
    assert text.startswith("before\n<!-- begin proof -->\nMade by")
    assert text.endswith("<!-- end proof -->\nafter\n")
    assert "old" not in text
    assert capsys.readouterr().out == ""


def test_contradiction_fails(monkeypatch, capsys, forms):
    monkeypatch.setattr(
        evidence, "exact_forms", lambda: forms | {"dispersion": forms["dispersion"] * 2}
    )
    assert evidence.main(["--samples", "1000"]) == 1
    assert "| λ1.2 | `J_(1+a)/3` | any | 3.65082 |" in capsys.readouterr().out


def test_too_few_samples(known_forms):
    with pytest.raises(InputError, match="samples: 10 is not allowed"):
        evidence.main(["--samples", "10"])


def test_page_holds_a_confirmed_table():
    """The documentation's own section, made with more pairs than a test can draw."""
    section = evidence.PAGE.read_text(encoding="utf-8").partition("<!-- begin proof -->")[2]
    section = section.partition("<!-- end proof -->")[0]
    assert "benchmarks.closure_evidence" in section
    assert "NOT CONFIRMED" not in section
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in section.splitlines()]
    values = {}
    for line in cells:
        if len(line) >= 6 and line[2] in ("any", "1"):
            values.setdefault(line[0], float(line[3]))
    known = closures.complete(1.0)
    for name in known.coefficients:
        assert values[symbol(name)] == pytest.approx(known[name], rel=1e-5), name
