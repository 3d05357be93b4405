"""The command that prints the closure coefficients, in processes of its own."""

import csv
import io
import json

import pytest

from tests.processes import triboflux
from triboflux import closures

HEAVY = ("diffrax", "jax", "matplotlib", "netCDF4", "pint", "scipy", "sympy", "xarray")
WATCHED = f"""
import sys
from triboflux.cli import main
try:
    main()
finally:
    print([name for name in {HEAVY} if name in sys.modules], file=sys.stderr)
"""


def printed(folder, *arguments, **environment):
    """Return what the command prints, having checked that it imported nothing heavy."""
    done = triboflux("closures", *arguments, folder=folder, code=WATCHED, environment=environment)
    assert (done.returncode, done.stderr) == (0, "[]\n")
    return done.stdout


def test_table_does_not_depend_on_the_terminal(tmp_path):
    text = printed(tmp_path, COLUMNS="40")
    assert text == printed(tmp_path, COLUMNS="200", LINES="3")
    assert "Closure coefficients for e = 1, a = 0.8" in text
    assert "144  inverted" in text
    assert max(map(len, text.splitlines())) > 100


def test_json(tmp_path):
    document = json.loads(printed(tmp_path, "--format", "json", "--restitution", "0.9"))
    exact = closures.complete(0.9)
    assert document["restitution"] == 0.9
    for row in document["coefficients"]:
        assert row["exact"] == exact[row["name"]]


def test_csv_for_another_exponent_with_samples(tmp_path):
    arguments = ("--format", "csv", "--exponent", "0.5", "--samples", "1000")
    rows = list(csv.DictReader(io.StringIO(printed(tmp_path, *arguments))))
    assert {row["verdict"] for row in rows} == {"not printed"}
    assert {row["exponent"] for row in rows} == {"0.5"}
    assert float(rows[0]["sampled"]) == pytest.approx(float(rows[0]["exact"]), rel=0.2)


def test_latex(tmp_path):
    text = printed(tmp_path, "--format", "latex")
    assert r"\begin{tabular}" in text
    assert r"$\lambda_{2.3}$" in text


def test_terminal_without_the_letters(tmp_path):
    text = printed(tmp_path, "--samples", "1000", PYTHONIOENCODING="ascii")
    assert text.isascii()
    assert r"\xb1" in text


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--restitution", "1.2"), "restitution is 1.2, but must be a number from 0 to 1."),
        (("--restitution", "nan"), "restitution is nan, but must be a number from 0 to 1."),
        (("--exponent", "-0.5"), "exponent is -0.5, but must be a finite number above -0.5."),
        (("--exponent", "inf"), "exponent is inf, but must be a finite number above -0.5."),
        (
            ("--format", "jsno"),
            "format is 'jsno', but must be one of table, json, csv, latex. Did you mean 'json'?",
        ),
        (
            ("--format", "\x1b[31m"),
            r"format is '\x1b[31m', but must be one of table, json, csv, latex.",
        ),
        (
            ("--format", "cvs", "--samples", "3"),
            "format is 'cvs', but must be one of table, json, csv, latex. Did you mean 'csv'?",
        ),
        (("--samples", "3"), "samples: 3 is not allowed; at least 1000 are needed."),
    ],
)
def test_bad_input(tmp_path, arguments, sentence):
    done = triboflux("closures", *arguments, folder=tmp_path)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.splitlines() == [f"error: {sentence}", "[]"]


@pytest.mark.parametrize(
    "arguments", [("--restitution", "elastic"), ("--exponent",), ("--samples", "1.5"), ("extra",)]
)
def test_wrong_usage(tmp_path, arguments):
    done = triboflux("closures", *arguments, folder=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert "Traceback" not in done.stderr


def test_help_has_an_example(tmp_path):
    text = printed(tmp_path, "--help")
    assert "Example: triboflux closures --restitution 0.9" in text
    for option in ("--restitution", "--exponent", "--format", "--samples"):
        assert option in text
