"""The formats of the audit."""

import csv
import io
import json
import re

import pytest
from matplotlib.mathtext import MathTextParser

from triboflux import audit, tables
from triboflux.errors import InputError

GIVEN = {"restitution": 1.0, "exponent": 0.8}
ROWS = audit.audit()
OTHER = audit.audit(0.9, 0.5)
SAMPLED = audit.audit(samples=2000)


class Paper(io.TextIOWrapper):
    """A text file in memory that says whether it is a terminal."""

    mode = name = "w"

    def __init__(self, terminal=False):
        super().__init__(io.BytesIO(), encoding="utf-8", newline="")
        self.terminal = terminal

    def isatty(self):
        return self.terminal

    def text(self):
        self.flush()
        return self.buffer.getvalue().decode()


def written(rows, form, *, terminal=False, **given):
    file = Paper(terminal)
    tables.write(rows, form, file, **(GIVEN | given))
    return file.text()


def no_constant(name):
    raise AssertionError(f"{name} is no JSON")


@pytest.mark.parametrize(
    ("rows", "given"),
    [(ROWS, GIVEN), (OTHER, {"restitution": 0.9, "exponent": 0.5}), (SAMPLED, GIVEN)],
)
def test_json_and_csv_hold_every_number_in_full(rows, given):
    document = json.loads(written(rows, "json", **given), parse_constant=no_constant)
    assert {name: document[name] for name in given} == given
    records = document["coefficients"]
    lines = list(csv.DictReader(io.StringIO(written(rows, "csv", **given))))
    assert len(records) == len(lines) == len(rows)
    for row, record, line in zip(rows, records, lines, strict=True):
        sampled = rows is SAMPLED
        assert ("sampled" in record) == ("error" in record) == sampled
        assert list(line) == [*given, *record]
        assert {name: float(line[name]) for name in given} == given
        for name, value in record.items():
            assert value == getattr(row, name)
            if value is None:
                assert line[name] == ""
            else:
                assert type(value)(line[name]) == value


def test_table_that_is_piped_depends_on_nothing(monkeypatch):
    plain = written(ROWS, "table")
    monkeypatch.setenv("COLUMNS", "30")
    assert written(ROWS, "table") == plain
    assert "\x1b" not in plain
    assert "…" not in plain
    lines = plain.splitlines()
    for row in ROWS:
        start = f"{row.symbol} "
        line = next(line for line in lines if line.startswith(start))
        assert row.name.replace("_", " ") in line
        assert f" {row.exact:.6g} " in line
        assert row.verdict in line
        told = [line for line in lines if line.startswith(f"{row.symbol} = {row.formula}; ")]
        assert len(told) == 1
        assert row.equation in told[0]
        assert told[0].endswith(row.note)
    assert "21.90 " in plain


@pytest.mark.parametrize("columns", ["80", "20", "300"])
@pytest.mark.parametrize("rows", [ROWS, SAMPLED])
def test_table_on_a_terminal_cuts_nothing_off(monkeypatch, columns, rows):
    monkeypatch.setenv("COLUMNS", columns)
    monkeypatch.setenv("TERM", "xterm")
    text = re.sub(r"\x1b\[[0-9;]*m", "", written(rows, "table", terminal=True))
    assert "…" not in text
    width = max(80 if rows is ROWS else 102, int(columns))
    assert max(map(len, text.splitlines())) <= width
    for row in rows:
        for value in (row.exact, row.ratio):
            assert value is None or f"{value:.6g}" in text
        assert row.verdict in text


def test_column_of_what_is_not_printed():
    text = written(OTHER, "table", exponent=0.5, restitution=0.9)
    assert text.count("none for a = 0.5") == len(OTHER)
    assert written(ROWS, "table").count("none") == sum(row.printed is None for row in ROWS)


def test_sampled_column():
    text = written(SAMPLED, "table")
    for row in SAMPLED:
        if row.error and row.error > 1e-8:
            value, error = re.search(
                rf"{re.escape(row.verdict)} +(\S+) ± (\S+)", line_of(text, row)
            ).groups()
            assert float(error) == pytest.approx(row.error, rel=0.051)
            assert float(value) == pytest.approx(row.sampled, abs=0.051 * row.error)


def line_of(text, row):
    return next(line for line in text.splitlines() if line.startswith(f"{row.symbol} "))


@pytest.mark.parametrize("rows", [ROWS, OTHER, SAMPLED])
def test_latex_is_a_complete_tabular(rows):
    lines = written(rows, "latex").splitlines()
    assert lines[0].startswith("% e = 1, a = 0.8;")
    alignment = re.fullmatch(r"\\begin\{tabular\}\{([lr]+p)\{0\.4\\textwidth\}\}", lines[1])
    columns = len(alignment[1])
    assert columns == (10 if rows is SAMPLED else 9)
    assert (lines[2], lines[4], lines[-2:]) == ("\\hline", "\\hline", ["\\hline", "\\end{tabular}"])
    body = [lines[3], *lines[5:-2]]
    assert len(body) == 1 + len(rows)
    parser = MathTextParser("path")
    for line in body:
        assert line.endswith(r" \\")
        cells = line.removesuffix(r" \\").split(" & ")
        assert len(cells) == columns
        for cell in cells:
            assert cell.count("{") == cell.count("}")
            pieces = cell.split("$")
            assert len(pieces) % 2 == 1
            for math in pieces[1::2]:
                parser.parse(f"${math}$")
            # outside math mode nothing is left that TeX would take for a command or an index
            assert not re.search(r"[_^#~&{}]|(?<!\\)%", "".join(pieces[0::2]))
            assert "".join(pieces).isascii()


@pytest.mark.parametrize(
    ("formula", "expected"),
    [
        ("J_(1+a)/6", "J_{1+a}/6"),
        ("72 J_1 J_(1+2a)/J_(1+a)^2", r"72\,J_{1}\,J_{1+2a}/J_{1+a}^2"),
        ("lambda_1.2/lambda_2.3 = 1/12", r"\lambda_{1.2}/\lambda_{2.3}=1/12"),
        ("rho_1", r"\rho_{1}"),
        ("lambda''", r"\lambda''"),
    ],
)
def test_formulas_in_latex(formula, expected):
    assert tables.latex_math(formula) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("lambda_2.3, and lambda_2.4.", r"$\lambda_{2.3}$, and $\lambda_{2.4}$."),
        ("K1, 1/tau_xi", r"$K_{1}$, 1/$\tau_\xi$"),
        ("R_p,jk in D_ij", r"$R_{p,jk}$ in $D_{ij}$"),
        ("gamma Theta^(a/2)", r"$\gamma$ $\Theta^{a/2}$"),
        ("5 % of #1 & a_b", r"5 \% of \#1 \& a\_b"),
        ("Drag of Kernels", "Drag of Kernels"),
    ],
)
def test_prose_in_latex(text, expected):
    assert tables.latex(text) == expected


def test_unknown_format_proposes_the_nearest():
    with pytest.raises(InputError) as caught:
        written(ROWS, "latx")
    assert str(caught.value) == (
        "format is 'latx', but must be one of table, json, csv, latex. Did you mean 'latex'?"
    )


def test_bar_is_drawn_for_a_terminal_only(capsys, monkeypatch):
    with tables.sampling_bar(quiet=False) as nobody:
        assert nobody is None
    monkeypatch.setattr("sys.stderr", Paper(terminal=True))
    with tables.sampling_bar(quiet=True) as quiet:
        assert quiet is None
    with tables.sampling_bar(quiet=False) as callback:
        callback(0.5)
