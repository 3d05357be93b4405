"""The exported source: compiled, run and compared with Python, and what it looks like."""

import hashlib
import os
import random
import re
import shutil
import subprocess
import sys

import pytest

from tests.processes import surroundings
from tests.sized import Sized
from triboflux import closures, export, presets, radial_distribution
from triboflux.collision import HERTZ_EXPONENT
from triboflux.errors import InputError
from triboflux.export_text import dimension_set
from triboflux.rates import closure_rates, suspension_transport

NAMES = tuple(export.COEFFICIENTS)
LAWS = {
    "carnahan-starling": presets.glass_beads,
    "lun-savage": presets.polyethylene,
    "ma-ahmadi": presets.pharmaceutical_fine,
    "unity": presets.pmma,
}
"""Every law of the radial distribution with a preset, so that constants differ too."""


def particles(law):
    own = radial_distribution.LAWS[law].maximum_packing
    return LAWS[law](radial_distribution=law, maximum_packing=own)


# --- what the package computes --------------------------------------------------------------------


def expected(suspension, closure_name, state, kind=float):
    """Return the coefficients at a state; `kind` makes every number of it."""
    s = suspension
    density, temperature, restitution = map(kind, state[:3])
    law = radial_distribution.LAWS[s.radial_distribution]
    c = closures.values_for(closure_name, restitution)
    transport = suspension_transport(
        c,
        HERTZ_EXPONENT,
        diameter=s.diameter,
        number_density=density,
        granular_temperature=temperature,
        radial_distribution=law.function(density * s.volume, s.maximum_packing),
        charge_transfer=s.charge_transfer,
        field_transfer=s.field_transfer,
    )
    rates = closure_rates(
        c,
        restitution=restitution,
        diameter=kind(s.diameter),
        velocity=temperature**0.5,
        collision_time=1.0 / transport.collision_rate,
        drag_rate=kind(1.0 / state[3]),
        dispersion=transport.dispersion,
        conduction=transport.conductivity / density,
    )
    kinetic = temperature / rates.variance_flux_destruction
    found = rates._asdict() | {
        "triboconductivity": transport.conductivity,
        "dispersion": transport.dispersion,
        "collision_time": 1.0 / transport.collision_rate,
        "charge_exchange_time": 1.0 / rates.charge_exchange,
        "variance_dispersion": rates.variance_collisional_dispersion + kinetic,
        "transferred_fraction": transport.transferred_fraction,
    }
    return {name: found[name] for name in NAMES}


def random_states(suspension):
    """Return states from dilute to nearly packed, over decades of Theta, with and without drag."""
    draw = random.Random(2023)
    fractions = [10.0 ** draw.uniform(-6.0, -0.01) for _ in range(100)] + [0.999] * 20
    return [
        (
            fraction * suspension.maximum_packing / suspension.volume,
            10.0 ** draw.uniform(-10.0, 4.0),
            draw.choice([0.0, 1.0, draw.random(), draw.random()]),
            draw.choice([float("inf"), 10.0 ** draw.uniform(-6.0, 3.0)]),
        )
        for fraction in fractions
    ]


def assert_equal(rows, suspension, closure_name, states):
    """Compare rows of results with Python, relative to the sum of the magnitudes of terms."""
    assert len(rows) == len(states)
    for row, state in zip(rows, states, strict=True):
        values = expected(suspension, closure_name, state)
        sizes = expected(suspension, closure_name, state, Sized)
        for name, found in zip(NAMES, row, strict=True):
            assert abs(found - values[name]) <= 1e-12 * sizes[name].size, (name, state)


# --- what compilers make of it --------------------------------------------------------------------

STRICT = ("-Wall", "-Wextra", "-Werror")
PACKAGES = {"gcc": "gcc", "g++": "g++", "gfortran": "gfortran"}

C_DRIVER = f"""
#include <stdio.h>
#include "coefficients.h"
#include "coefficients.h"

int main(void)
{{
    double n, theta, e, tau_p;
    while (scanf("%lf %lf %lf %lf", &n, &theta, &e, &tau_p) == 4) {{
        const triboflux_coefficients c = triboflux_evaluate(n, theta, e, tau_p);
        printf("{"%.17g " * len(NAMES)}\\n", {", ".join(f"c.{name}" for name in NAMES)});
    }}
    return 0;
}}
"""

FORTRAN_DRIVER = """
program driver
  use, intrinsic :: iso_fortran_env, only: real64
  use triboflux_coefficients, only: coefficients, evaluate
  implicit none
  real(real64) :: x(4, {count})
  type(coefficients) :: c({count})

  read (*, *) x
  c = evaluate(x(1, :), x(2, :), x(3, :), x(4, :))
  write (*, '({width}es25.16e3)') c
end program driver
"""

SCALAR_STUB = """
#ifndef scalar_H
#define scalar_H

#include <cmath>

namespace Foam
{
typedef int label;
typedef double scalar;
inline scalar sqrt(const scalar s) { return ::sqrt(s); }
inline scalar pow(const scalar s, const scalar e) { return ::pow(s, e); }
inline scalar pow(const scalar s, const int e) { return ::pow(s, e); }
inline scalar pow(const int s, const scalar e) { return ::pow(s, e); }
}

#endif
"""

LIST_STUB = """
#ifndef UList_H
#define UList_H

#include "scalar.H"

#define forAll(list, i) for (Foam::label i = 0; i < (list).size(); i++)

namespace Foam
{
template<class T>
class UList
{
    T* first;
    label length;

public:

    UList(T* const v, const label size) : first(v), length(size) {}
    label size() const { return length; }
    T& operator[](const label i) { return first[i]; }
    const T& operator[](const label i) const { return first[i]; }
};
}

#endif
"""
"""What the header takes of OpenFOAM, with the same declarations."""

OPENFOAM_DRIVER = f"""
#include <cstdio>
#include "coefficients.H"
#include "coefficients.H"

using namespace Foam;

int main()
{{
    scalar triboflux::coefficients::* const members[] =
    {{
        {", ".join(f"&triboflux::coefficients::{name}" for name in NAMES)}
    }};
    scalar x[4][COUNT], y[COUNT];
    for (label i = 0; i < COUNT; i++)
    {{
        if (std::scanf("%lf %lf %lf %lf", &x[0][i], &x[1][i], &x[2][i], &x[3][i]) != 4) return 1;
        const triboflux::coefficients c =
            triboflux::evaluate(x[0][i], x[1][i], x[2][i], x[3][i]);
        for (const auto& member : members) std::printf("%.17g ", c.*member);
    }}
    const UList<scalar> n(x[0], COUNT), theta(x[1], COUNT), tauP(x[3], COUNT);
    UList<scalar> result(y, COUNT);
    for (const auto& member : members)
    {{
        triboflux::fill(n, theta, x[2][0], tauP, member, result);
        for (const scalar value : y) std::printf("%.17g ", value);
    }}
    return 0;
}}
"""
"""Prints rows of `evaluate`, then columns of `fill` with the first restitution."""


def compiler(name):
    """Return a compiler, skip the test without it, and fail instead where CI runs."""
    found = shutil.which(name)
    if found is None:
        sentence = f"{name} is not installed: apt-get install {PACKAGES[name]}"
        if os.environ.get("CI"):
            pytest.fail(sentence)
        pytest.skip(sentence)
    return found


def compiled_and_run(folder, files, command, states):
    """Return the numbers that a program prints, given states."""
    for name, text in files.items():
        (folder / name).write_text(text, encoding="ascii")
    program = folder / "driver"
    options = {"cwd": folder, "capture_output": True, "text": True, "timeout": 60}
    built = subprocess.run([*command, *STRICT, "-o", program], check=False, **options)
    assert built.returncode == 0, built.stderr
    table = "\n".join(" ".join(map(repr, state)) for state in states) + "\n"
    ran = subprocess.run([program], input=table, check=False, **options)
    assert ran.returncode == 0, ran.stderr
    return [float(word) for word in ran.stdout.split()]


def rows_of(numbers):
    return [numbers[i : i + len(NAMES)] for i in range(0, len(numbers), len(NAMES))]


every_choice = pytest.mark.parametrize(
    ("law", "closure_name"), [(law, name) for law in LAWS for name in closures.PAPERS_EQUATIONS]
)


def test_every_law_is_compiled():
    assert set(LAWS) == set(radial_distribution.NAMES)


@every_choice
def test_c(tmp_path, law, closure_name):
    command = [compiler("gcc"), "-std=c99", "-pedantic", "driver.c", "-lm"]
    suspension = particles(law)
    states = random_states(suspension)
    header = export.export(suspension, "c", closure_name)
    files = {"coefficients.h": header, "driver.c": C_DRIVER}
    found = compiled_and_run(tmp_path, files, command, states)
    assert_equal(rows_of(found), suspension, closure_name, states)


@every_choice
def test_fortran(tmp_path, law, closure_name):
    command = [compiler("gfortran"), "-std=f2008", "coefficients.f90", "driver.f90"]
    suspension = particles(law)
    states = random_states(suspension)
    files = {
        "coefficients.f90": export.export(suspension, "fortran", closure_name),
        "driver.f90": FORTRAN_DRIVER.format(count=len(states), width=len(NAMES)),
    }
    found = compiled_and_run(tmp_path, files, command, states)
    assert_equal(rows_of(found), suspension, closure_name, states)


@every_choice
def test_openfoam(tmp_path, law, closure_name):
    suspension = particles(law)
    states = random_states(suspension)
    command = [compiler("g++"), "-std=c++11", "-I.", f"-DCOUNT={len(states)}", "driver.C"]
    files = {
        "coefficients.H": export.export(suspension, "openfoam", closure_name),
        "driver.C": OPENFOAM_DRIVER,
        "scalar.H": SCALAR_STUB,
        "UList.H": LIST_STUB,
    }
    numbers = compiled_and_run(tmp_path, files, command, states)
    half = len(states) * len(NAMES)
    assert_equal(rows_of(numbers[:half]), suspension, closure_name, states)
    filled = numbers[half:]
    fields = [filled[i : i + len(states)] for i in range(0, half, len(states))]
    same = [(n, theta, states[0][2], tau_p) for n, theta, _, tau_p in states]
    assert_equal(list(zip(*fields, strict=True)), suspension, closure_name, same)


@pytest.mark.parametrize("name", PACKAGES)
def test_a_missing_compiler_skips_but_fails_in_ci(monkeypatch, name):
    monkeypatch.setattr(shutil, "which", lambda _: None)
    monkeypatch.delenv("CI", raising=False)
    reason = re.escape(f"{name} is not installed: apt-get install {name}")
    with pytest.raises(pytest.skip.Exception, match=reason):
        compiler(name)
    monkeypatch.setenv("CI", "true")
    with pytest.raises(pytest.fail.Exception, match=reason):
        compiler(name)


# --- what it looks like ---------------------------------------------------------------------------

every_language = pytest.mark.parametrize("language", export.LANGUAGES)
INCLUDED = {
    "c": {"<math.h>"},
    "fortran": {"iso_fortran_env"},
    "openfoam": {'"scalar.H"', '"UList.H"'},
}


@every_language
@every_choice
def test_text(language, law, closure_name):
    text = export.export(particles(law), language, closure_name)
    assert text.isascii()
    assert text.endswith("\n") and not text.endswith("\n\n")
    lines = text.splitlines()
    assert max(map(len, lines)) <= 132
    assert not any(line != line.rstrip() or "\t" in line for line in lines)
    assert not re.search(r"(?<![\w)/])[/~]\w+/|\\", text), "an absolute path"
    found = re.findall(r"^#include (\S+)|^\s*use\b.*:: (\w+)", text, re.MULTILINE)
    assert {first or second for first, second in found} == INCLUDED[language]


@every_language
def test_head_says_what_it_is(language):
    suspension = presets.polyethylene()
    head = export.export(suspension, language, "published")[:2000]
    law = radial_distribution.LAWS[suspension.radial_distribution]
    for words in (
        "with the published closures; a = 0.8",
        "dC/dt = -P grad Q + S E + V E/m - R C - div T",
        "diameter 0.0003625 m, density 935 kg/m^3",
        "2e+06 Pa (softened)",
        law.source.split(",")[0],
        "doi:10.1007/BF01182538",
    ):
        assert words in head
    assert "softened" not in export.export(presets.glass_beads(), language)


@every_language
def test_every_result_and_argument_is_explained(language):
    lines = export.export(presets.polyethylene(), language).splitlines()
    declared = {"c": "double {};", "fortran": "real(real64) :: {}", "openfoam": "scalar {};"}
    for name, about in export.COEFFICIENTS.items():
        place = lines.index(f"    {declared[language].format(name)}")
        comment = lines[place - 1]
        assert f"{about.symbol}, {about.meaning}, {about.unit}; {about.equation}" in comment
        if language == "openfoam":
            assert comment.endswith(f", {dimension_set(about.unit)}")
    for name, (symbol, meaning) in export.ARGUMENTS.items():
        assert any(f"{name}: {symbol}, {meaning}" in line for line in lines)


def test_the_same_text_in_every_process():
    """Symbols are sorted, not taken as their hashes come."""
    code = """
import hashlib
from triboflux import export, presets
for language in export.LANGUAGES:
    text = export.export(presets.polyethylene(), language)
    print(hashlib.sha256(text.encode()).hexdigest())
"""
    here = [
        hashlib.sha256(export.export(presets.polyethylene(), language).encode()).hexdigest()
        for language in export.LANGUAGES
    ]
    seed = "1" if os.environ.get("PYTHONHASHSEED") != "1" else "2"
    there = subprocess.check_output(
        [sys.executable, "-c", code], env=surroundings(PYTHONHASHSEED=seed), text=True
    )
    assert there.split() == here


def test_unknown_names_are_told_with_the_nearest():
    with pytest.raises(InputError) as caught:
        export.export(presets.pmma(), "fotran")
    assert str(caught.value) == (
        "language is 'fotran', but must be one of c, fortran, openfoam. Did you mean 'fortran'?"
    )
    with pytest.raises(InputError, match=r"'exact'.*derived, published") as caught:
        export.export(presets.pmma(), "c", "exact")
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match=r"Did you mean 'published'\?$"):
        export.export(presets.pmma(), "c", "publishd")
