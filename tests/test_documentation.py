"""Every block of code in the documents runs, or at least is understood by what would run it."""

import argparse
import importlib
import os
import re
import runpy
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path
from unittest import mock

import pytest
from typer.main import get_command

import triboflux
from tests.in_process import call
from tests.processes import surroundings
from triboflux import cli
from triboflux.case import Case
from triboflux.errors import InputError
from triboflux.suspension import Suspension
from triboflux.sweep import Sweep

ROOT = Path(__file__).resolve().parents[1]
PAGES = [
    "README.md",
    "CONTRIBUTING.md",
    *sorted(str(path.relative_to(ROOT)) for path in (ROOT / "docs").rglob("*.md")),
]
QUICK = {"closures", "compare", "convert", "export", "numbers", "run"}
"""Commands that are run; the others take longer, have tests of their own, and are only parsed."""


def blocks(language):
    """Return the pages with blocks of a language, and these."""
    found = {
        page: re.findall(rf"^```{language}\n(.*?)^```", text(page), re.DOTALL | re.MULTILINE)
        for page in PAGES
    }
    return {page: parts for page, parts in found.items() if parts}


def text(page):
    return (ROOT / page).read_text(encoding="utf-8")


def shell_lines():
    """Return every distinct command of the pages, the comment behind it left out."""
    lines = [
        shlex.split(line.removeprefix(".venv/bin/"), comments=True)
        for parts in blocks("sh").values()
        for part in parts
        for line in part.splitlines()
    ]
    return [list(words) for words in dict.fromkeys(tuple(words) for words in lines if words)]


def quick(words):
    """Tell whether a command can be run here: soon, and on files that there are."""
    if words[0] != "triboflux" or words[1] not in QUICK or "--samples" in words:
        return False
    return all((ROOT / word).exists() for word in words if word.endswith(".toml"))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Return an empty folder to work in that has the examples, as a clone does."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    return tmp_path


# ------------------------------------------------------------------ Python


@pytest.mark.parametrize("page", blocks("python"))
def test_python_of_the_pages_runs(page, folder):
    import matplotlib.pyplot as plt

    script = folder / "page.py"
    script.write_text("\n".join(blocks("python")[page]), encoding="utf-8")
    if page.startswith("docs/tutorials"):
        # what a tutorial does not execute itself needs a machine that is not here
        compile(script.read_text(encoding="utf-8"), page, "exec")
        return
    runpy.run_path(str(script))
    plt.close("all")


# ------------------------------------------------------------------ commands


def parse(words):
    """Let the command line take the words apart as it would before it runs the command."""
    program = get_command(cli.app)
    context = program.make_context("triboflux", list(words))
    rest = [*context._protected_args, *context.args]
    name, command, rest = program.resolve_command(context, rest)
    return command.make_context(name, rest, parent=context)


class ParsedError(Exception):
    """A program would begin to work now."""


def parse_module(words):
    """Run ``python -m MODULE ...`` up to where its arguments are parsed."""
    understood = argparse.ArgumentParser.parse_args

    def parse_args(self, *arguments, **options):
        understood(self, *arguments, **options)
        raise ParsedError

    module, *arguments = words
    imported = sys.modules.pop(module, None)  # else running it anew is warned of
    try:
        with (
            mock.patch.object(sys, "argv", [module, *arguments]),
            mock.patch.object(argparse.ArgumentParser, "parse_args", parse_args),
            pytest.raises(ParsedError),
        ):
            runpy.run_module(module, run_name="__main__")
    finally:
        if imported is not None:
            sys.modules[module] = imported


def check_line(words):
    """Fail unless a command exists and understands its arguments."""
    match words:
        case ["triboflux", *arguments]:
            parse(arguments)
        case ["python", "-m", *rest]:
            parse_module(rest)
        case ["dask", command, *arguments]:
            main = importlib.import_module(f"distributed.cli.dask_{command}").main
            main.make_context(command, arguments)
        case ["pip", "install", "-e", requirement]:
            extras = tomllib.loads(text("pyproject.toml"))["project"]["optional-dependencies"]
            assert requirement.removeprefix(".[").removesuffix("]") in extras
        case ["make", target]:
            assert re.search(rf"^{target}:", text("Makefile"), re.MULTILINE), target
        case _:
            pytest.fail(f"nothing here knows how to check: {shlex.join(words)}")
    for word in words:
        if word.startswith("examples/"):
            assert (ROOT / word).is_file(), word


@pytest.mark.parametrize("words", [w for w in shell_lines() if not quick(w)], ids=shlex.join)
def test_long_commands_of_the_pages_are_understood(words):
    check_line(words)


@pytest.mark.parametrize("words", [["triboflux", "run"], ["triboflux", "chart", "-o", "x", "--z"]])
def test_a_wrong_command_is_noticed(words):
    with pytest.raises(Exception, match=r"Missing|No such option"):
        check_line(words)


def test_quick_commands_of_the_pages_run(folder):
    for words in shell_lines():
        if not quick(words):
            continue
        if words[1] == "convert" and not Path(words[2]).exists():
            check_line(words)  # what it reads was made by a command that is only parsed
            continue
        ended = call(*words[1:])
        assert ended.code == 0, (words, ended.errors)


@pytest.mark.parametrize("command", get_command(cli.app).commands.values(), ids=lambda c: c.name)
def test_examples_in_the_help_are_understood(command):
    line = command.epilog.removeprefix("Example: ").partition(" >")[0]
    check_line(shlex.split(line))


# ------------------------------------------------------------------ TOML


def completed(block, example):
    """Return a block as a whole case: what it leaves out is that of an example."""
    whole = tomllib.loads(text(f"examples/{example}"))
    given = tomllib.loads(block)
    if "suspension" in given and "grid" in given:
        whole.pop("numbers", None)
    return whole | {
        key: whole[key] | value if key in ("run", "initial") and key in whole else value
        for key, value in given.items()
    }


def check_toml(block):
    """Fail unless a block is a suspension, a case, or a valid part of a case or sweep."""
    given = tomllib.loads(block)
    if set(given) == {"suspension"}:
        Suspension.from_toml_text(block)
    elif "sweep" in given:
        import tomli_w

        sweep = Sweep.from_toml_text(tomli_w.dumps(completed(block, "sweep.toml")))
        assert sweep.size > 1
    elif {"grid", "run"} <= set(given):
        Case.from_toml_text(block)
    else:
        # texts with units need a suspension beside them
        example = "polyethylene.toml" if re.search(r'= "[-\d.]+ ', block) else "fig2.toml"
        Case(**completed(block, example))


@pytest.mark.parametrize(
    "block",
    [
        pytest.param(part, id=f"{page}-{number}")
        for page, parts in blocks("toml").items()
        for number, part in enumerate(parts)
    ],
)
def test_toml_of_the_pages_is_valid(block):
    check_toml(block)


@pytest.mark.parametrize(
    "block",
    [
        '[suspension]\npreset = "glas-beads"',
        '[run]\nt_end = "2 kg"',
        "[kinetic]\nparticle = 10",
        '[sweep.parameters]\nnumbers.pecle = [1.0, 2.0]\nmodel = ["full"]',
    ],
)
def test_wrong_toml_is_noticed(block):
    with pytest.raises(InputError):
        check_toml(block)


# ------------------------------------------------------------------ what the site is made of

# Types are not checked here: symbols take the place of numbers.
SYMBOLS = """
import sys
sys.path.insert(0, "docs")
import sympy
from _extensions import commands, equations
from triboflux import closures, dropped_rates, hierarchy, models, numbers, rates
from triboflux.models import varying

values = numbers.Numbers(peclet=900.0, tau_c=0.02, tau_p=0.7, tau_sigma=3.0,
                         energy_ratio=11.0, length_ratio=23.0, restitution=0.8)
chosen = closures.derived(0.8)
found = rates.scaled_rates(chosen, values)
symbols = {sympy.Symbol(s): getattr(found, key) for key, (s, *_) in equations.RATES.items()}
symbols |= {equations.TAU_SIGMA: values.tau_sigma, equations.PECLET: values.peclet,
            equations.FORCE: values.energy_ratio, equations.TRACE: 3}
page = equations.terms()
for name in models.REGISTRY:
    assert f"### {name}\\n" in page
    if "granular_temperature" in hierarchy.MODELS[name].evolves:
        # its coefficients are those of the local temperature, and not shown
        for term in models.build(name, values, chosen).terms:
            shown = f"| {term.name} | {term.group} | {term.operator.name} |"
            assert term.name.endswith(varying.OFF) or shown in page, shown
        continue
    shown = equations.symbolic_model(name).terms
    solved = models.build(name, values, chosen).terms
    assert len(shown) == len(solved) > 0
    for ours, theirs in zip(shown, solved, strict=True):
        assert ours.name == theirs.name
        cells = f"| {ours.name} | {ours.group} | {ours.equation} | {ours.operator.name} |"
        assert cells in page, cells
        value = float(sympy.sympify(ours.coefficient).subs(symbols))
        assert abs(value / float(theirs.coefficient) - 1.0) < 1e-12, (name, ours.name)

whole = closures.complete(0.8)
added = dropped_rates.scaled_dropped_rates(whole, found, values)
symbols |= {sympy.Symbol(s): getattr(added, key) for key, (s, _) in equations.DROPPED.items()}
page = equations.dropped()
for name in models.REGISTRY:
    if "granular_temperature" in hierarchy.MODELS[name].evolves:
        continue
    shown = equations.symbolic_model(name, complete=True).terms
    solved = models.build(name, values, whole).terms
    for ours, theirs in zip(shown, solved, strict=True):
        value = float(sympy.sympify(ours.coefficient).subs(symbols))
        assert abs(value / float(theirs.coefficient) - 1.0) < 1e-12, (name, ours.name)
        if ours.equation == "dropped":
            cells = f"| {ours.name} | {ours.group} | {ours.operator.name} |"
            assert f"### {name}, `complete`" in page
            assert cells in page, cells

numbers_of = {equations.PECLET: values.peclet, equations.TAU_C: values.tau_c,
              equations.TAU_P: values.tau_p, equations.TAU_SIGMA: values.tau_sigma,
              equations.L: values.length_ratio, equations.D: 1.0, equations.E: values.restitution,
              equations.TAU_XI: 1.0 / found.charge_exchange}
for key in whole.coefficients:
    numbers_of[equations.closure(key)] = whole[key]
for key, expression in equations.rate_expressions().items():
    value = float(expression.subs(numbers_of))
    assert abs(value / getattr(found, key) - 1.0) < 1e-12, key
numbers_of |= {sympy.Symbol(s): getattr(found, key) for key, (s, *_) in equations.RATES.items()}
for key, expression in equations.dropped_expressions().items():
    value = float(expression.subs(numbers_of))
    assert abs(value / getattr(added, key) - 1.0) < 1e-12, key
table = equations.coefficients()
for key, row in whole.coefficients.items():
    assert f"| `{key}` |" in table, key
"""


def test_the_theory_page_shows_what_is_solved():
    process = subprocess.run(
        [sys.executable, "-c", SYMBOLS],
        cwd=ROOT,
        env=surroundings(),
        capture_output=True,
        check=False,
        text=True,
        timeout=120,
    )
    assert process.returncode == 0, process.stderr


def test_the_command_line_page_has_every_option():
    from docs._extensions.commands import commands

    page = commands()
    for name, command in get_command(cli.app).commands.items():
        section = page.partition(f"## triboflux {name}\n")[2].partition("\n## ")[0]
        for parameter in command.params:
            shown = parameter.metavar if parameter.param_type_name == "argument" else None
            for option in [shown] if shown else parameter.opts:
                assert option in section, (name, option)


def test_the_reference_has_every_public_name():
    pages = "\n".join(text(page) for page in PAGES if page.startswith(f"docs{os.sep}api"))
    described = set(re.findall(r"^\.\. auto\w+:: triboflux\.(\w+)$", pages, re.MULTILINE))
    assert set(triboflux.__all__) - described == {"__version__"}


@pytest.mark.parametrize(
    ("page", "count"),
    [
        ('<script src="_static/a.js"></script><a href="https://example.org">there</a>', 0),
        ('<script async src="https://example.org/a.js"></script>', 1),
        ('<link href="//example.org/a.css" rel="stylesheet"><img alt="" src="http://a.b/c">', 2),
        ('<link rel="canonical" href="https://example.org/page.html">', 0),
    ],
)
def test_what_a_page_loads_from_elsewhere_is_found(page, count):
    from docs._extensions.offline import foreign

    assert len(foreign(page)) == count
