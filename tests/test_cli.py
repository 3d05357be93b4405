"""The command line as a user meets it: mostly real processes, with their exit codes."""

import pytest

from tests.cases import data
from tests.processes import triboflux
from triboflux import __version__
from triboflux.case import Case


def refused(*arguments, folder):
    """Return the one sentence of a refusal, having checked that it cost and left nothing."""
    before = sorted(folder.rglob("*"))
    done = triboflux(*arguments, folder=folder)
    assert done.returncode == 1
    assert done.stdout == ""
    sentence, imported = done.stderr.splitlines()
    assert imported == "[]"
    assert sentence.isprintable()
    assert sentence.startswith("error: ")
    assert "Traceback" not in done.stderr
    assert sorted(folder.rglob("*")) == before
    return sentence.removeprefix("error: ")


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "case.toml").write_text(Case(**data()).to_toml())
    return tmp_path


def edited(folder, old, new):
    text = (folder / "case.toml").read_text()
    assert old in text
    (folder / "bad.toml").write_text(text.replace(old, new))
    return refused("run", "bad.toml", "-o", "out.nc", folder=folder)


@pytest.mark.parametrize(
    ("old", "new", "start", "end"),
    [
        ("tau_c", "tauc", "numbers.tauc is not a known key;", "Did you mean 'tau_c'?"),
        ("[run]", "[runn]", "runn is not a known key;", "Did you mean 'run'?"),
        (
            '"full"',
            '"fulll"',
            "model is 'fulll', but must be 'self-consistent-flow' or 'self-consistent'",
            "'full'?",
        ),
        ("tau_c = 0.1", "tau_c = -0.1", "numbers.tau_c is -0.1, but must be a positive", "inf."),
        ("tau_p = inf", "tau_p = -inf", "numbers.tau_p is -inf, but must be a positive", "inf."),
        ("restitution = 1.0", "restitution = 1.2", "numbers.restitution is 1.2, but", "0 to 1."),
        ("32", "0", "grid.points is [0], but must have entries from 4", "1048576."),
        ("sine = -1.0", "sine = nan", "initial.charge[0].sine is nan, but must be a", "number."),
        ("t_end = 1.0", "t_end = nan", "run.t_end is nan, but must be a", "number."),
        ("t_end = 1.0", "t_end = 0", "run.t_end is 0, but must be finite and above", "0."),
        ("t_end = 1.0", "t_end = -1e300", "run.t_end is -1e+300, but must be finite and", "0."),
        ('title = ""', 'title = "\\u001b[31m"', "title is '\\x1b[31m', but must be one", "ters."),
        ('title = ""', "title = '\x00'", "case file 'bad.toml' contains the control", "line 1."),
        (
            "mode = [\n    1,\n]",
            "mode = [0]\nadded = 1",
            "initial.charge[0].added is not a known key;",
            "cosine.",
        ),
    ],
)
def test_bad_values(folder, old, new, start, end):
    sentence = edited(folder, old, new)
    assert sentence.startswith(start)
    assert sentence.endswith(end)


def test_net_charge(folder):
    sentence = edited(
        folder, "cosine = 0.0", "cosine = 0.0\n[[initial.charge]]\nmode=[0]\ncosine=1"
    )
    assert sentence.startswith("initial.charge has a net charge of 1.0, but must be neutral")


def test_file_of_ten_megabytes(folder):
    with (folder / "big.toml").open("wb") as file:
        file.write(b'title = "a"\n')
        file.truncate(10_000_000)
    sentence = refused("run", "big.toml", "-o", "out.nc", folder=folder)
    assert sentence == "case file 'big.toml' has 10,000,000 bytes, but may have at most 1,048,576."


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", b"\x00" * 100, b"PK\x03\x04" * 50, b""])
def test_files_that_are_no_case(folder, content):
    (folder / "bad.toml").write_bytes(content)
    refused("run", "bad.toml", "-o", "out.nc", folder=folder)


def test_unreadable_case(folder):
    def told(path):
        return refused("run", path, "-o", "out.nc", folder=folder)

    assert told("none.toml") == "case file 'none.toml' does not exist."
    assert told(".") == "case file '.' is a folder, but must be a TOML file."
    assert told("case.toml/x.toml").startswith("case file 'case.toml/x.toml' can't be read: ")
    assert told("n" * 300).startswith("case file 'nnn")


def test_impossible_output(folder):
    def told(path):
        return refused("run", "case.toml", "-o", path, folder=folder)

    (folder / "old.nc").write_text("precious")
    assert told("none/out.nc") == "output folder 'none' does not exist."
    assert told("old.nc/out.nc") == "output folder 'old.nc' is not a folder."
    assert told(".") == "output '.' is a folder, but must be a file."
    assert told("old.nc").startswith("output 'old.nc' exists and is replaced only with --overwrite")
    assert (folder / "old.nc").read_text() == "precious"
    itself = refused("run", "case.toml", "-o", "./case.toml", "--overwrite", folder=folder)
    assert itself == "output 'case.toml' is the case file itself."


def test_grid_that_cannot_fit(folder):
    (folder / "bad.toml").write_text(
        Case(**data(grid__points=[2**20] * 3, initial__charge=[])).to_toml()
    )
    sentence = refused("run", "bad.toml", "-o", "out.nc", folder=folder)
    assert sentence.startswith("grid.points is [1048576, 1048576, 1048576], which needs about ")
    assert "GiB" in sentence


def test_missing_initial_state(folder):
    (folder / "bad.toml").write_text(
        Case(**data(initial__charge=[], initial__file="none.nc")).to_toml()
    )
    sentence = refused("run", "bad.toml", "-o", "out.nc", folder=folder)
    assert sentence == f"initial.file is '{folder / 'none.nc'}', which is no existing file."


def test_reproduce_needs_its_folder(folder):
    sentence = refused("reproduce", "-o", "none/deep", folder=folder)
    assert sentence == "output folder 'none' does not exist."


@pytest.mark.parametrize(
    "arguments",
    [
        ("run",),
        ("run", "case.toml"),
        ("run", "case.toml", "-o", "out.nc", "--fast"),
        ("reproduce", "--figure", "10", "-o", "."),
        ("simulate",),
    ],
)
def test_wrong_usage_exits_with_two(folder, arguments):
    done = triboflux(*arguments, folder=folder)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert done.stderr.splitlines()[-1] == "[]"


@pytest.mark.parametrize("arguments", [("--help",), ("run", "--help"), ("reproduce", "--help")])
def test_help_has_an_example_and_imports_nothing_heavy(folder, arguments):
    done = triboflux(*arguments, folder=folder)
    assert done.returncode == 0
    assert "Example: triboflux " in done.stdout
    assert done.stderr == "[]\n"


def test_help_imports_nothing_heavy(folder):
    done = triboflux("--help", folder=folder)
    assert done.returncode == 0
    assert done.stderr == "[]\n"


def test_version(folder):
    done = triboflux("--version", folder=folder)
    assert (done.returncode, done.stdout) == (0, f"triboflux {__version__}\n")
    assert done.stderr == "[]\n"
    verbose = triboflux(
        "--version", "--verbose", folder=folder, code="import triboflux.__main__ as m; m.main()"
    )
    assert verbose.returncode == 0
    for package in ("python", "jax", "diffrax", "equinox", "numpy", "xarray", "netCDF4", "devices"):
        assert f"\n{package} " in verbose.stdout
