"""The generated formulas as text of C, Fortran and OpenFOAM."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable
from typing import TYPE_CHECKING

import sympy
from sympy.printing.fortran import FCodePrinter

if TYPE_CHECKING:
    from triboflux.export import Source

_WIDTH = 96
"""Longest line that is written."""


def as_c(source: Source) -> str:
    """Return a C99 header with an inline function that returns a struct.

    Parameters
    ----------
    source : Source
        From `triboflux.export.source`.
    """
    return "\n".join(
        [
            *_block_comment(_header(source)),
            "#ifndef TRIBOFLUX_COEFFICIENTS_H",
            "#define TRIBOFLUX_COEFFICIENTS_H",
            "",
            "#include <math.h>",
            "",
            "typedef struct {",
            *(
                line
                for name, about in _results(source)
                for line in (f"    /* {about} */", f"    double {name};")
            ),
            "} triboflux_coefficients;",
            "",
            *_block_comment(_arguments_text()),
            "static inline triboflux_coefficients triboflux_evaluate(",
            "    double number_density, double granular_temperature, double restitution,",
            "    double drag_time)",
            "{",
            *_c_constants(source, "double"),
            *_c_body(source, "double"),
            f"    const triboflux_coefficients result = {{{_result_names(source)}}};",
            "    return result;",
            "}",
            "",
            "#endif",
            "",
        ]
    )


def as_openfoam(source: Source) -> str:
    """Return an OpenFOAM header: a function of one cell, and one that fills a field.

    Parameters
    ----------
    source : Source
        From `triboflux.export.source`.
    """
    return "\n".join(
        [
            *_block_comment(_header(source)),
            "#ifndef tribofluxCoefficients_H",
            "#define tribofluxCoefficients_H",
            "",
            '#include "scalar.H"',
            '#include "UList.H"',
            "",
            "namespace Foam",
            "{",
            "namespace triboflux",
            "{",
            "",
            "struct coefficients",
            "{",
            *(
                line
                for (name, about), unit in zip(_results(source), _units(source), strict=True)
                for line in (f"    // {about}, {dimension_set(unit)}", f"    scalar {name};")
            ),
            "};",
            "",
            *_block_comment(_arguments_text()),
            "inline coefficients evaluate",
            "(",
            "    const scalar number_density,",
            "    const scalar granular_temperature,",
            "    const scalar restitution,",
            "    const scalar drag_time",
            ")",
            "{",
            *_c_constants(source, "scalar"),
            *_c_body(source, "scalar"),
            f"    return coefficients{{{_result_names(source)}}};",
            "}",
            "",
            *_block_comment(
                (
                    "Fill one field, for instance the cells of a volScalarField sigma:",
                    "  triboflux::fill",
                    "  (",
                    "      n.primitiveField(), Theta.primitiveField(), e, tauP.primitiveField(),",
                    "      &triboflux::coefficients::triboconductivity, sigma.primitiveFieldRef()",
                    "  );",
                    "and sigma.correctBoundaryConditions() afterwards.",
                )
            ),
            "inline void fill",
            "(",
            "    const UList<scalar>& number_density,",
            "    const UList<scalar>& granular_temperature,",
            "    const scalar restitution,",
            "    const UList<scalar>& drag_time,",
            "    scalar coefficients::* which,",
            "    UList<scalar>& result",
            ")",
            "{",
            "    forAll(result, i)",
            "    {",
            "        result[i] = evaluate",
            "        (",
            "            number_density[i], granular_temperature[i], restitution, drag_time[i]",
            "        ).*which;",
            "    }",
            "}",
            "",
            "} // End namespace triboflux",
            "} // End namespace Foam",
            "",
            "#endif",
            "",
        ]
    )


def as_fortran(source: Source) -> str:
    """Return a Fortran 2008 module with a derived type and an elemental function.

    Parameters
    ----------
    source : Source
        From `triboflux.export.source`.
    """
    steps = ", ".join(line.name for line in source.lines if line.meaning is None)
    return "\n".join(
        [
            *(f"! {line}".rstrip() for line in _header(source)),
            "module triboflux_coefficients",
            "  use, intrinsic :: iso_fortran_env, only: real64",
            "  implicit none",
            "  private",
            "  public :: coefficients, evaluate",
            "",
            "  type :: coefficients",
            *(
                line
                for name, about in _results(source)
                for line in (f"    ! {about}", f"    real(real64) :: {name}")
            ),
            "  end type coefficients",
            "",
            "contains",
            "",
            *(f"  ! {line}" for line in _arguments_text()),
            "  elemental function evaluate( &",
            "      number_density, granular_temperature, restitution, drag_time) result(c)",
            "    real(real64), intent(in) :: number_density, granular_temperature",
            "    real(real64), intent(in) :: restitution, drag_time",
            "    type(coefficients) :: c",
            *(
                f"    real(real64), parameter :: {name} = {_shortest(repr(value), 'd')}"
                for name, value in source.constants.items()
            ),
            f"    real(real64) :: {steps}",
            "",
            *_fortran_body(source),
            "  end function evaluate",
            "",
            "end module triboflux_coefficients",
            "",
        ]
    )


_NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d*(?:[ed][-+]?\d+)?|[ed][-+]?\d+)")
_BASES = {"kg": 0, "m": 1, "s": 2}


def dimension_set(unit: str) -> str:
    """Return a unit in OpenFOAM's notation, ``[mass length time temperature moles current light]``.

    Parameters
    ----------
    unit : str
        Of kg, m, s and C, such as ``"C^2 s/(kg m^3)"``; ``"1"`` for a pure number.

    Raises
    ------
    KeyError
        If there is another unit.
    """
    powers = [0] * 7
    above, _, below = unit.partition("/")
    for part, sign in ((above, 1), (below.strip("()"), -1)):
        for factor in part.split():
            name, _, power = factor.partition("^")
            exponent = sign * int(power or 1)
            if name == "C":
                powers[2] += exponent
                powers[5] += exponent
            elif name != "1":
                powers[_BASES[name]] += exponent
    return f"[{' '.join(map(str, powers))}]"


def _results(source: Source) -> list[tuple[str, str]]:
    """Return name and description of every result."""
    return [
        (line.name, f"{c.symbol}, {c.meaning}, {c.unit}; {c.equation}")
        for line in source.lines
        if (c := line.meaning) is not None
    ]


def _units(source: Source) -> list[str]:
    return [line.meaning.unit for line in source.lines if line.meaning is not None]


def _result_names(source: Source) -> str:
    names = ", ".join(line.name for line in source.lines if line.meaning is not None)
    filled = textwrap.fill(names, _WIDTH - 8, initial_indent=" " * 8, subsequent_indent=" " * 8)
    return f"\n{filled}\n    "


def _arguments_text() -> tuple[str, ...]:
    """Return what the generated function is called with."""
    from triboflux.export import ARGUMENTS

    return tuple(f"{name}: {symbol}, {about}" for name, (symbol, about) in ARGUMENTS.items())


def _block_comment(lines: Iterable[str]) -> list[str]:
    return ["/*", *(f" * {line}".rstrip() for line in lines), " */"]


def _c_constants(source: Source, kind: str) -> list[str]:
    return [f"    const {kind} {name} = {value!r};" for name, value in source.constants.items()]


def _c_body(source: Source, kind: str) -> list[str]:
    """Return the assignments in C."""
    body: list[str] = []
    for line in source.lines:
        code = _shortest(sympy.ccode(_plain(line.expression)), "e")
        body += _wrapped(f"    const {kind} {line.name} = {code};", "")
    return body


def _fortran_body(source: Source) -> list[str]:
    """Return the assignments in Fortran, results being members of the derived type."""
    results = "|".join(line.name for line in source.lines if line.meaning is not None)
    printer = _Unwrapped({"source_format": "free", "standard": 2008})
    body: list[str] = []
    for line in source.lines:
        wide = str(printer.doprint(_plain(line.expression)))
        code = _shortest(wide, "d")
        text = re.sub(rf"\b({results})\b", r"c%\1", f"{line.name} = {code}")
        body += _wrapped(f"    {text}", " &")
    return body


class _Unwrapped(FCodePrinter):
    """A printer that leaves long lines to `_wrapped`, which breaks them at blanks."""

    def _format_code(self, lines: list[str]) -> list[str]:
        return lines


def _plain(expression: sympy.Expr) -> sympy.Basic:
    """Drop factors of 1.0, and give every number the digits that a double needs."""
    numbers = {number: sympy.Float(number, 17) for number in expression.atoms(sympy.Float)}
    whole = {sympy.Float(sign): sympy.Integer(sign) for sign in (1, -1)}
    return expression.xreplace(numbers | whole)


def _shortest(code: str, exponent: str) -> str:
    """Write every number with the fewest digits that give the same double."""

    def shorten(found: re.Match[str]) -> str:
        mantissa, _, power = repr(float(found.group().replace("d", "e"))).partition("e")
        if exponent == "d":
            return f"{mantissa}d{int(power or 0)}"
        return f"{mantissa}e{power}" if power else mantissa

    return _NUMBER.sub(shorten, code)


def _header(source: Source) -> list[str]:
    """Return the comment on top in lines that are not too long."""
    lines: list[str] = []
    for line in source.header:
        indent = " " * (len(line) - len(line.lstrip()) + 2)
        lines += textwrap.wrap(line, _WIDTH - 4, subsequent_indent=indent) or [""]
    return lines


def _wrapped(text: str, continuation: str) -> list[str]:
    """Break a long assignment at blanks."""
    lines = textwrap.wrap(
        text, _WIDTH, subsequent_indent=" " * 8, break_long_words=False, break_on_hyphens=False
    )
    return [*(line + continuation for line in lines[:-1]), lines[-1]]
