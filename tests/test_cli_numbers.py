"""The commands that start from a powder: numbers, export, and runs told in SI."""

import dataclasses
import io
import json
import math
import os
import re
import subprocess
import sys
import tomllib

import numpy as np
import pytest

from tests.cases import data
from tests.processes import command, surroundings, triboflux
from triboflux import assessment_text, cli, presets
from triboflux.assessment import assess
from triboflux.case import Case
from triboflux.model_errors import ModelError, measure
from triboflux.numbers import from_suspension
from triboflux.result import load
from triboflux.suspension import Suspension

POWDER = """
title = "Powder"
closures = "derived"

[suspension]
diameter = "500 um"
density = "2.5 g/cm^3"
youngs_modulus = "2 MPa"
softened_modulus = true
poisson_ratio = 0.22
restitution = 0.97
solid_fraction = 0.1
granular_temperature = "4e-4 m^2/s^2"
domain_length = "20 cm"
charge_scale = "2 pC"
drag = "none"

[grid]
points = [16]

[run]
t_end = "3 s"
"""
WATCHED = """
import sys
from triboflux.cli import main
try:
    main()
finally:
    heavy = ("diffrax", "equinox", "jax", "matplotlib", "netCDF4", "pint", "sympy", "xarray")
    print([name for name in heavy if name in sys.modules], file=sys.stderr)
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "powder.toml").write_text(POWDER)
    (tmp_path / "typed.toml").write_text(Case(**data()).to_toml())
    return tmp_path


@pytest.fixture
def call(folder, monkeypatch, capfd):
    """Return a function that runs the command line in this process."""
    monkeypatch.chdir(folder)

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["triboflux", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        told = capfd.readouterr()
        return ended.value.code, told.out, told.err

    return run


@pytest.fixture
def refused(call, folder):
    """Return a function that returns the sentence of a refusal that left nothing behind."""

    def run(*arguments):
        before = {path: path.read_bytes() for path in folder.iterdir()}
        code, out, err = call(*arguments)
        assert (code, out) == (1, "")
        assert err.startswith("error: ")
        assert err.count("\n") == 1
        assert err[:-1].isprintable()
        assert {path: path.read_bytes() for path in folder.iterdir()} == before
        return err[:-1].removeprefix("error: ")

    return run


def edited(folder, old, new):
    assert old in POWDER
    (folder / "bad.toml").write_text(POWDER.replace(old, new))
    return "bad.toml"


# ------------------------------------------------------------------ numbers


def strictly(text):
    def refuse(constant):
        raise AssertionError(f"{constant} is no JSON")

    return json.loads(text, parse_constant=refuse)


@pytest.mark.parametrize("closures", ["derived", "published"])
def test_json_holds_everything_in_full_precision(call, folder, closures):
    code, out, err = call("numbers", "powder.toml", "--format", "json", "--closures", closures)
    assert (code, err) == (0, "")
    found = strictly(out)
    powder = Suspension.from_toml(folder / "powder.toml")
    expected = assess(powder, closures)
    assert found["closures"] == closures
    assert Suspension(**found["suspension"]) == powder
    assert found["numbers"].pop("tau_p") is None
    numbers = expected.numbers.model_dump()
    assert numbers.pop("tau_p") == math.inf
    assert found["numbers"] == numbers
    for told, quantity in zip(found["coefficients"], expected.coefficients, strict=True):
        value = None if quantity.value == math.inf else quantity.value
        assert told == vars(quantity) | {"value": value}
    assert (found["regime"], found["model"]) == (expected.regime, expected.model)
    assert found["reasons"] == list(expected.reasons)
    assert found["origin"] == expected.origin
    assert found["errors"] == [vars(each) for each in expected.errors]
    assert found["warnings"] == list(expected.warnings)
    assert found["warnings"]


def test_toml_is_the_table_of_a_case(call, folder):
    for closures in ("published", "derived"):
        code, out, err = call("numbers", "powder.toml", "--format", "toml", "--closures", closures)
        assert (code, err) == (0, "")
        assert set(tomllib.loads(out)) == {"closures", "numbers"}
        typed = Case.from_toml_text(f"{out}\n[grid]\npoints = [16]\n[run]\nt_end = 0.3\n")
        text = POWDER.replace('"derived"', f'"{closures}"').replace('"3 s"', "0.3")
        powder = Case.from_toml_text(text)
        # everything that a run depends on
        assert typed.numbers == powder.numbers
        assert typed.closures == powder.closures
        assert (typed.run, typed.grid, typed.exponent) == (powder.run, powder.grid, powder.exponent)
        assert typed.suspension is None


def test_tables_show_everything_uncut(call, folder):
    code, out, err = call("numbers", "powder.toml")
    assert (code, err) == (0, "")
    found = assess(Suspension.from_toml(folder / "powder.toml"))
    assert "…" not in out
    lines = out.splitlines()
    for quantity in found.coefficients:
        told = [line for line in lines if line.split("  ")[0] == quantity.symbol]
        assert any(quantity.meaning in line and quantity.equation in line for line in told)
    for name, value in found.numbers.model_dump().items():
        told = [line for line in lines if line.startswith(f"{name} ")]
        assert any(f" {value:.6g} " in line for line in told)
    assert f"Regime: {found.regime}" in lines
    assert f"Model:  {found.model}" in lines
    for reason in found.reasons:
        assert f"- {reason}" in lines
    for warning in found.warnings:
        assert f"warning: {warning}" in lines
    assert len(found.warnings) > 1
    assert max(map(len, lines)) > 100


@pytest.mark.parametrize("origin", ["table", "computed"])
def test_errors_of_the_models_are_a_table(origin, tmp_path):
    powder = presets.glass_beads()
    spread = 1.5 if origin == "table" else 1.0
    errors = (
        ModelError("collisional", "ok", 0.2, 0.2 / spread, 0.2 * spread),
        ModelError("gradient", "ok", 0.001, 0.001 / spread, 0.001 * spread),
        ModelError("algebraic", "beside entries without error (nonphysical)"),
        ModelError("semi-algebraic", "ok", 1e-5, 1e-5 / spread, 1e-5 * spread),
    )
    found = dataclasses.replace(assess(powder), errors=errors, origin=origin)
    with (tmp_path / "told.txt").open("w", encoding="utf-8") as file:
        assessment_text.write(found, powder, "table", file, closures="derived")
    text = (tmp_path / "told.txt").read_text(encoding="utf-8")
    lines = [line.split() for line in text.splitlines()]
    ranges = {"collisional": "13 % to 30 %", "gradient": "0.067 % to 0.15 %"}
    ranges["semi-algebraic"] = "< 0.01 % to < 0.01 %"
    for model, value in {
        "collisional": "20 %",
        "gradient": "0.1 %",
        "semi-algebraic": "< 0.01 %",
    }.items():
        told = ranges[model] if origin == "table" else ""
        assert [model, *value.split(), *told.split()] in lines
    assert ["algebraic", *"beside entries without error (nonphysical)".split()] in lines


@pytest.mark.slow
def test_errors_are_computed_on_demand(folder):
    # the powder of the other tests has too strong a field for any run
    (folder / "beads.toml").write_text('[suspension]\npreset = "glass-beads"\n')
    done = triboflux("numbers", "beads.toml", "--compute", "--format", "json", folder=folder)
    assert done.returncode == 0, done.stderr
    found = strictly(done.stdout)
    assert found["origin"] == "computed"
    exact = measure(from_suspension(Suspension.from_toml(folder / "beads.toml")))
    assert [m["model"] for m in found["errors"]] == [m.model for m in exact.models]
    for told, each in zip(found["errors"], exact.models, strict=True):
        assert told["status"] == each.status
        assert told["error"] == told["low"] == told["high"]
        assert told["error"] == pytest.approx(each.error, rel=1e-6)


def test_quiet_tables(call):
    _, out, _ = call("numbers", "powder.toml", "--quiet")
    assert "warning" not in out
    assert "\n- " not in out
    assert "Model:  " in out


class Terminal(io.TextIOWrapper):
    """A terminal in memory."""

    mode = name = "w"

    def __init__(self):
        super().__init__(io.BytesIO(), encoding="utf-8")

    def isatty(self):
        return True


@pytest.mark.parametrize("columns", [40, 80])
def test_narrow_terminals_fold_and_lose_nothing(monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setenv("TERM", "xterm")
    powder = presets.polyethylene()
    found = assess(powder)
    terminal = Terminal()
    assessment_text.write(found, powder, "table", terminal, closures="derived")
    terminal.flush()
    text = re.sub(r"\x1b\[[0-9;]*m", "", terminal.buffer.getvalue().decode())
    assert "…" not in text
    assert max(map(len, text.splitlines())) <= columns
    told = "".join(text.split())
    for warning in found.warnings:
        assert "".join(warning.split()) in told


def test_files_that_only_differ_in_their_other_tables(call, folder):
    _, whole, _ = call("numbers", "powder.toml")
    (folder / "alone.toml").write_text(POWDER[POWDER.index("[susp") : POWDER.index("[grid]")])
    _, alone, _ = call("numbers", "alone.toml")
    assert whole == alone


def test_wrong_unit_from_the_command_line(folder):
    edited(folder, '"500 um"', '"3 kg"')
    before = sorted(folder.iterdir())
    for arguments in (
        ("numbers", "bad.toml"),
        ("export", "bad.toml", "--language", "c", "-o", "out.h"),
        ("run", "bad.toml", "-o", "out.nc"),
    ):
        done = triboflux(*arguments, folder=folder, code=WATCHED)
        assert done.returncode == 1
        assert done.stdout == ""
        assert done.stderr.splitlines() == [
            "error: suspension.diameter: '3 kg' is a mass, expected a length (such as '500 um').",
            "['pint']",
        ]
        assert sorted(folder.iterdir()) == before


@pytest.mark.parametrize("words", [("numbers",), ("export", "--language", "c")])
@pytest.mark.parametrize(
    ("old", "new", "start", "end"),
    [
        ("diameter", "diametr", "suspension.diametr is not a known key; ", "mean 'diameter'?"),
        ('diameter = "500 um"', "", "suspension.diameter is missing (particle diameter, ", "')."),
        ('"500 um"', "nan", "suspension.diameter is nan, but must be a ", "number."),
        ('"500 um"', "-1", "suspension.diameter is -1, but must be from 1e-09 ", "to 1 m."),
        ("= 0.1", "= 0.7", "suspension.solid_fraction is 0.7, but must be ", "packing, 0.64."),
        ("[suspension]", "[suspensoin]", "suspensoin is not a known key; ", "mean 'suspension'?"),
        ('"none"', '"stoke"', "suspension.drag is 'stoke', but must be ", "mean 'stokes'?"),
        ("[suspension]", "a = [", "case file 'bad.toml' is not valid TOML: ", "."),
    ],
)
def test_refused_suspensions(refused, folder, words, old, new, start, end):
    name, *options = words
    sentence = refused(name, edited(folder, old, new), *options)
    assert sentence.startswith(start)
    assert sentence.endswith(end)


@pytest.mark.parametrize("words", [("numbers",), ("export", "--language", "c")])
def test_files_without_a_suspension(refused, words):
    name, *options = words
    assert refused(name, "typed.toml", *options) == (
        "suspension is missing (a table with the particles, the gas and the box)."
    )
    assert refused(name, "none.toml", *options) == "case file 'none.toml' does not exist."
    assert refused(name, ".", *options).endswith("is a folder, but must be a TOML file.")


def test_unknown_format_and_closures(refused):
    assert refused("numbers", "powder.toml", "--format", "tmol") == (
        "format is 'tmol', but must be one of table, json, toml. Did you mean 'toml'?"
    )
    for words in (("numbers",), ("export", "--language", "c")):
        name, *options = words
        sentence = refused(name, "powder.toml", *options, "--closures", "publishd")
        assert "'publishd'" in sentence
        assert sentence.endswith("Did you mean 'published'?")


@pytest.mark.parametrize("name", ["numbers", "export"])
def test_help_has_an_example_and_imports_nothing_heavy(folder, name):
    done = triboflux(name, "--help", folder=folder, code=WATCHED)
    assert done.returncode == 0
    assert f"Example: triboflux {name} examples/polyethylene.toml" in done.stdout
    assert done.stderr == "[]\n"


def test_numbers_start_without_the_solver(folder):
    done = triboflux("numbers", "powder.toml", folder=folder, code=WATCHED)
    assert done.returncode == 0
    assert done.stderr == "['pint']\n"
    # nothing needs pint where everything is a number in SI
    powder = Suspension.from_toml(folder / "powder.toml")
    text = "\n".join(
        f"{k} = {json.dumps(v)}" for k, v in powder.model_dump(exclude_none=True).items()
    )
    (folder / "si.toml").write_text(f"[suspension]\n{text}\n")
    plain = triboflux("numbers", "si.toml", folder=folder, code=WATCHED)
    assert plain.stdout == done.stdout
    assert plain.stderr == "[]\n"


def test_terminal_without_greek_letters(folder):
    done = triboflux(
        "numbers", "powder.toml", folder=folder, environment={"PYTHONIOENCODING": "ascii"}
    )
    assert done.returncode == 0
    assert "sigma_p" in done.stdout
    assert done.stdout.isascii()


@pytest.mark.skipif(os.name == "nt", reason="needs a POSIX shell")
def test_reader_that_stops_reading(folder):
    process = subprocess.Popen(
        command("numbers", "powder.toml", code=WATCHED),
        cwd=folder,
        env=surroundings(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    process.stdout.close()
    assert process.stderr.read() == "['pint']\n"
    process.stderr.close()
    assert process.wait(30) == 1


# ------------------------------------------------------------------ export


@pytest.mark.parametrize("language", ["c", "fortran", "openfoam"])
def test_export_prints_or_writes_the_same(call, folder, language):
    from triboflux.export import export

    code, printed, err = call("export", "powder.toml", "--language", language)
    assert (code, err) == (0, "")
    assert printed == export(Suspension.from_toml(folder / "powder.toml"), language)
    out = folder / "out.txt"
    code, told, err = call("export", "powder.toml", "--language", language, "-o", out)
    assert (code, told, err) == (0, f"written to '{out}'\n", "")
    assert out.read_text() == printed
    assert printed.isascii()
    _, published, _ = call("export", "powder.toml", "--language", language, "--closures=published")
    assert published != printed
    assert call("export", "powder.toml", "--language", language, "-o", "b.h", "-q")[1:] == ("", "")
    assert sorted(p.name for p in folder.iterdir()) == [
        "b.h",
        "out.txt",
        "powder.toml",
        "typed.toml",
    ]


def test_export_replaces_only_what_it_may(call, refused, folder):
    (folder / "old.h").write_text("precious")
    export = ("export", "powder.toml", "--language", "c", "-o")
    assert refused(*export, "old.h").startswith(
        "output 'old.h' exists and is replaced only with --overwrite"
    )
    assert refused(*export, "powder.toml", "--overwrite") == (
        "output 'powder.toml' is the suspension's own file."
    )
    assert refused(*export, "none/out.h") == "output folder 'none' does not exist."
    assert refused(*export, ".") == "output '.' is a folder, but must be a file."
    code, _, _ = call(*export, "old.h", "--overwrite")
    assert code == 0
    assert (folder / "old.h").read_text().startswith("/*")


def test_unknown_language(refused):
    assert refused("export", "powder.toml", "--language", "fotran", "-o", "out.f90") == (
        "language is 'fotran', but must be one of c, fortran, openfoam. Did you mean 'fortran'?"
    )


def test_language_has_to_be_said(call):
    code, out, err = call("export", "powder.toml")
    assert (code, out) == (2, "")
    assert "--language" in err


# ------------------------------------------------------------------ runs in SI


def test_units_are_refused_before_computing(folder):
    before = sorted(folder.iterdir())
    done = triboflux("run", "typed.toml", "-o", "out.nc", "--units", "si", folder=folder)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.splitlines() == [
        "error: units is 'si', but SI needs the scales of a case with a table [suspension]; this "
        "one has [numbers].",
        "[]",
    ]
    assert sorted(folder.iterdir()) == before


def test_unknown_units(refused):
    for name in ("typed.toml", "powder.toml"):
        assert refused("run", name, "-o", "out.nc", "--units", "scald") == (
            "units is 'scald', but must be 'scaled' or 'si'. Did you mean 'scaled'?"
        )


def test_texts_in_a_case_of_numbers(refused, folder):
    text = (folder / "typed.toml").read_text()
    (folder / "bad.toml").write_text(text.replace("t_end = 1.0", 't_end = "20 ms"'))
    assert refused("run", "bad.toml", "-o", "out.nc") == (
        "run.t_end is '20 ms', but must be a number in a case with a table [numbers]; units need "
        "the scales of a table [suspension]."
    )


def test_run_in_si(folder):
    """A wave of 1 pC on glass beads falls to 0.5 pC, as the gradient model says."""
    (folder / "glass.toml").write_text(
        """
        [suspension]
        preset = "glass-beads"
        charge_scale = "20 fC"
        [grid]
        points = [64]
        lengths = ["10 cm"]
        [initial]
        charge = [{ mode = [1], sine = "-10 fC" }]
        [run]
        t_end = "100 s"
        stop_at_peak_charge = "5 fC"
        """
    )
    done = triboflux("run", "glass.toml", "-o", "out.nc", "--units", "si", folder=folder)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("ok: ")
    assert " s, peak charge 5e-15 C, steps " in done.stdout
    result = load(folder / "out.nc")
    assert result.units == "si"
    dataset = result.dataset
    assert [dataset[name].units for name in ("time", "x", "charge", "field")] == [
        *("s", "m", "C", "V m-1")
    ]
    assert float(dataset["peak_charge"][0]) == pytest.approx(1e-14, rel=1e-9)
    assert float(dataset["peak_charge"][-1]) == pytest.approx(5e-15, rel=1e-6)
    np.testing.assert_allclose(dataset["charge"].sum("x"), 0.0, atol=1e-26)
    np.testing.assert_allclose(dataset["x"], np.arange(64) / 64 * 0.1, rtol=1e-12)
    # (5.2) with C = (S E - P grad Q)/R, in SI; the force of the field on the variance is weak
    found = {q.symbol: q.value for q in assess(result.case.suspension).coefficients}
    wave = 2 * math.pi / 0.1
    conduction = 1 / found["epsilon_0/sigma"]
    gain = 2.168 * 0.97 * math.sqrt(1e-3) / 5e-4  # J_(2+a)/J_(1+a) e sqrt(Theta)/d
    covariance = (1e-3 + gain * found["D_p"]) * wave**2 + gain * conduction
    rate = (1 + found["eta_coll"]) * covariance * found["1/R"]
    rate += found["D_p"] * wave**2 + conduction
    assert float(dataset["time"][-1]) == pytest.approx(math.log(2) / rate, rel=0.02)
    assert sorted(p.name for p in folder.iterdir()) == [
        *("glass.toml", "out.nc", "powder.toml", "typed.toml")
    ]


def test_a_file_names_its_own_closures(tmp_path):
    (tmp_path / "powder.toml").write_text('closures = "published"\n[suspension]\npreset = "pmma"\n')

    def used(*options):
        done = triboflux("numbers", "powder.toml", "--format", "toml", *options, folder=tmp_path)
        return tomllib.loads(done.stdout)["closures"]

    assert used() == "published"
    assert used("--closures", "derived") == "derived"
