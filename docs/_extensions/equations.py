"""The models' equations and coefficients as Markdown, from the lists of terms that are solved.

Symbols are put where a run has numbers, and go through the same functions: what the page shows is
what the program adds up.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import ExitStack
from types import SimpleNamespace
from typing import Any
from unittest import mock

import sympy

from triboflux import closures
from triboflux.audit import audit
from triboflux.dropped_rates import DroppedRates, scaled_dropped_rates
from triboflux.hierarchy import MODELS
from triboflux.models import REGISTRY, Model, Term, build, transport_coefficients
from triboflux.models import coefficients as models_coefficients
from triboflux.models.varying import OFF, TEMPERATURE
from triboflux.numbers import Numbers
from triboflux.rates import ClosureRates, scaled_rates
from triboflux.tables import latex_math

E, L, D, PECLET, TAU_C, TAU_P, TAU_SIGMA, FORCE, TRACE, TAU_XI = sympy.symbols(
    r"e L d \mathrm{Pe} \tau_c \tau_p \tau_\sigma u n_t \tau_\xi", positive=True
)
NUMBERS: Any = SimpleNamespace(
    peclet=PECLET,
    tau_c=TAU_C,
    tau_p=TAU_P,
    tau_sigma=TAU_SIGMA,
    energy_ratio=FORCE,
    length_ratio=L / D,
    restitution=E,
)
"""The seven numbers as symbols, called as in `triboflux.Numbers`."""
_SOME = Numbers(
    peclet=1e3, tau_c=0.1, tau_p=1.0, energy_ratio=1.0, length_ratio=50.0, restitution=0.9
)
"""Some, for a list of terms whose coefficients are not shown."""

RATES = {
    "collisional_flux": (r"\eta", "collisional part of the flux", "(2.27)"),
    "charge_exchange": (r"\tau_\xi^{-1}", "charge exchange", "(3.6)"),
    "gradient_production": ("P", "covariance from the charge gradient", "(3.4)"),
    "field_production": ("S", "covariance from the electric field", "(3.4)"),
    "covariance_destruction": ("R", "destruction of the covariance", "(3.3), (3.4)"),
    "third_moment": ("K_1", "relaxation of ⟨ξ'c'c'⟩", "(3.8)"),
    "third_moment_trace": ("K_2", "relaxation of its trace", "(3.9)"),
    "shear": ("G_1", "of ∂ᵢCⱼ + ∂ⱼCᵢ", "(3.10)"),
    "divergence": ("G_2", "of ∇·C δᵢⱼ", "(3.10)"),
    "variance_destruction": ("F", "destruction of the variance", "(4.2)"),
    "variance_field_production": ("B", "variance from the squared field", "(4.2)"),
    "variance_collisional_dispersion": ("D_c", "collisional dispersion of the variance", "(4.2)"),
    "variance_flux_destruction": ("N", "relaxation of ⟨ξ'ξ'c'⟩", "(4.3)"),
    "transferred_fraction": (
        r"\gamma\Theta^{a/2}",
        "mean part of the charge difference that a collision passes over",
        "(2.14)",
    ),
}
"""Symbol, meaning and equation of what `triboflux.rates` computes."""

DROPPED = {
    "charge_third_moment": ("q", "of ∇·X in the equation of Q, Xᵢ = 2 ∂ⱼTᵢⱼ + ∂ᵢTₘₘ"),
    "covariance_third_moment": ("h", "of −X in the equation of C"),
    "covariance_dispersion": ("s", "of ∇²C + 2 ∇∇·C in the equation of C"),
    "third_moment_gradient": ("t_1", "of 2 ∂ᵢ∂ⱼQ + ∇²Q δᵢⱼ in the equation of T"),
    "third_moment_field": ("t_2", "of −(∂ᵢEⱼ + ∂ⱼEᵢ + ∇·E δᵢⱼ) in the equation of T"),
    "variance_flux": (r"\eta_V", "collisional part of the flux of variance"),
    "variance_flux_gradient": (r"\eta_N", "collisional part of what makes ⟨ξ'ξ'c'⟩ of −∇V"),
    "covariance_along_gradient": ("v_1", "variance from C·∇Q"),
    "covariance_along_field": ("v_2", "variance from −C·E"),
    "variance_gradient_production": ("v_3", "variance from the square of ∇Q"),
    "variance_mixed_production": ("v_4", "variance from −2 E·∇Q"),
    "variance_covariance_destruction": ("v_5", "variance from minus the square of C"),
}
"""Symbol and meaning of what `triboflux.dropped_rates` computes."""

SHORT = {
    "covariance_collision": "r_c",
    "covariance_exchange": r"r_\xi",
    "third_moment_collision": "k_c",
    "third_moment_exchange": r"k_\xi",
    "third_moment_drag": "k_p",
    "third_moment_trace": "k_t",
    "variance_flux_product": r"(\lambda_{3.5}\kappa)",
}
"""Symbols of the closure coefficients that the paper gives no letter."""

_LETTERS = {
    "charge": "Q",
    "covariance": r"\mathbf{C}",
    "variance": "V",
    "covariance_flux": r"\mathbf{T}",
    "covariance_flux_trace": "T_{mm}",
    "granular_temperature_tensor": r"\mathbf{R}",
    "granular_temperature": r"\Theta",
    "dissipated_energy": "W",
    "specific_volume": "1/n",
    "mean_velocity": r"\mathbf{U}",
}
_VECTOR = {
    "E": r"\mathbf{E}",
    "C": r"\mathbf{C}",
    "∇": r"\nabla ",
    "·": r"\cdot ",
    "²": "^2",
    "ᵀ": r"^\mathsf{T}",
    "δ": r"\boldsymbol{\delta}\,",
    "Θ": r"\Theta ",
    "|": r"\vert ",  # a bar would end the cell of a table
}


class _Closures(SimpleNamespace):
    """Closure coefficients as symbols; the trace is left open."""

    complete = False

    exponent = 0.8

    def __getitem__(self, name: str) -> sympy.Symbol:
        return closure(name)

    def trace_dimensions(self, grid_dimensions: int) -> sympy.Symbol:
        return TRACE


def closure(name: str) -> sympy.Symbol:
    """Return the symbol of a closure coefficient."""
    return sympy.Symbol(_closure_symbol(name), positive=True)


def _closure_symbol(name: str) -> str:
    return SHORT.get(name) or latex_math(closures.complete(1.0).coefficients[name].symbol)


def symbolic_model(name: str, *, complete: bool = False) -> Model:
    """Return a model whose coefficients are symbols.

    Parameters
    ----------
    name : str
        A key of the registry.
    complete : bool
        With the terms that the paper's derivation drops.
    """
    made = {
        "scaled_rates": _symbolic_rates(),
        "scaled_dropped_rates": DroppedRates(
            **{key: sympy.Symbol(symbol) for key, (symbol, _) in DROPPED.items()}
        ),
    }
    with ExitStack() as stack:
        for function, rates in made.items():
            patch = mock.patch.object(models_coefficients, function, return_value=rates)
            stack.enter_context(patch)
        closures_of = _Closures(complete=complete)
        return REGISTRY[name](transport_coefficients(NUMBERS, closures_of, 1))


def _symbolic_rates() -> ClosureRates:
    return ClosureRates(**{key: sympy.Symbol(symbol) for key, (symbol, *_) in RATES.items()})


def _latex(expression: Any) -> str:
    exact = sympy.nsimplify(sympy.sympify(expression), rational=True)
    return sympy.latex(sympy.factor_terms(exact), order="none", mul_symbol=r"\,")


def _cell(expression: Any) -> str:
    """Return an expression for a table, its fractions as large as in a formula of its own."""
    return rf"$\displaystyle {_latex(expression)}$"


def _letters(name: str) -> str:
    """Return the program's notation of an operator or a product as LaTeX."""
    return "".join(_VECTOR.get(letter, letter) for letter in name)


def _source(term: Term) -> str:
    return _LETTERS[term.source] if isinstance(term.source, str) else _letters(term.source.name)


def _applied(term: Term) -> str:
    """Return operator and source as LaTeX."""
    name, source = term.operator.name, _source(term)
    if " + " in source or (" " in source and name != "1"):
        source = f"({source})"
    if name == "1":
        return source
    if name.endswith("E"):  # the field of the charge
        return _letters(name)
    bare = " + " in name and not name.startswith("(")
    operator = f"({_letters(name)})" if bare else _letters(name)
    return f"{operator}{source}"


def _sum(terms: tuple[Term, ...]) -> str:
    parts: list[str] = []
    for term in terms:
        coefficient = sympy.factor_terms(sympy.nsimplify(sympy.sympify(term.coefficient)))
        negative = coefficient.could_extract_minus_sign()
        size = -coefficient if negative else coefficient
        factor = "" if size == 1 else _latex(size)
        if size.is_Add:
            factor = f"({factor})"
        parts.append(f"{'-' if negative else '+'} {factor}\\,{_applied(term)}")
    return " ".join(parts).removeprefix("+ ") or "0"


def equations(name: str = "full") -> str:
    """Return the equations of a model as formulas.

    Parameters
    ----------
    name : str
        A key of the registry.
    """
    model = symbolic_model(name)
    formulas: list[str] = []
    for moment in model.evolves:
        terms = tuple(term for term in model.terms if term.moment == moment)
        formulas.append(f"$$\n\\partial_t {_LETTERS[moment]} = {_sum(terms)}\n$$")
    return "\n\n".join(formulas)


def terms() -> str:
    """Return, for each model of the registry, its equations and the table of its terms.

    The equations of the full model have a place of their own, see `equations`.
    """
    sections: list[str] = []
    for name in REGISTRY:
        sections.append(f"### {name}")
        if TEMPERATURE in MODELS[name].evolves:
            sections.append(
                "Coefficients are those of the local Θ; what they are at Θ = 1 and the rest are "
                "one here."
            )
            shown = [t for t in build(name, _SOME).terms if not t.name.endswith(OFF)]
            sections.append(_table(shown, paper=False, coefficients=False))
            continue
        if name != "full":
            sections.append(equations(name))
        sections.append(_table(symbolic_model(name).terms))
    return "\n\n".join(sections)


def _table(terms: Iterable[Term], *, paper: bool = True, coefficients: bool = True) -> str:
    """Return terms as a table, without their equations' numbers or coefficients if so wanted."""
    columns: dict[str, Callable[[Term], str]] = {
        "equation of": lambda term: f"${_LETTERS[term.moment]}$",
        "term": lambda term: term.name,
        "group in budgets": lambda term: term.group,
        "paper": lambda term: term.equation,
        "operator": lambda term: term.operator.name,
        "source": lambda term: f"${_source(term)}$",
        "coefficient": lambda term: _cell(term.coefficient),
    }
    if not paper:
        del columns["paper"]
    if not coefficients:
        del columns["coefficient"]
    rows = [list(columns), ["---"] * len(columns)]
    rows += [[cell(term) for cell in columns.values()] for term in terms]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def dropped() -> str:
    """Return the terms that the paper's derivation drops, and what stands in front of them."""
    sections: list[str] = []
    for name in ("third-order", "full", "semi-algebraic", "algebraic"):
        found = [term for term in symbolic_model(name, complete=True).terms if _is_dropped(term)]
        if found:
            sections += [f"### {name}, `complete`", _table(found, paper=False)]
    rows = ["| symbol | what | expression |", "| --- | --- | --- |"]
    expressions = dropped_expressions()
    for key, (symbol, meaning) in DROPPED.items():
        rows.append(f"| ${symbol}$ | {meaning} | {_cell(expressions[key])} |")
    return "\n\n".join(["\n".join(rows), *sections])


def dropped_expressions() -> dict[str, sympy.Expr]:
    """Return what stands before the dropped terms, by the coefficients of the other ones."""
    return scaled_dropped_rates(_Closures(), _symbolic_rates(), NUMBERS)._asdict()


def _is_dropped(term: Term) -> bool:
    return term.equation == "dropped"


def rate_expressions() -> dict[str, sympy.Expr]:
    """Return the coefficients of the equations as functions of the seven numbers and 1/τ_ξ."""
    found = scaled_rates(_Closures(), NUMBERS)
    exchange = found.charge_exchange
    expressions = {key: _by_exchange(getattr(found, key), exchange) for key in RATES}
    return expressions | {"charge_exchange": exchange}


def rates() -> str:
    """Return the table of the coefficients of the equations."""
    rows = ["| symbol | what | expression | paper |", "| --- | --- | --- | --- |"]
    for key, expression in rate_expressions().items():
        symbol, meaning, equation = RATES[key]
        rows.append(f"| ${symbol}$ | {meaning} | {_cell(expression)} | {equation} |")
    return "\n".join(rows)


def _by_exchange(expression: sympy.Expr, exchange: sympy.Expr) -> sympy.Expr:
    """Write the terms with the number λ' by 1/τ_ξ, in which it is hidden."""
    number = closure("exchange_time")
    terms = sympy.Add.make_args(sympy.expand(expression))
    return sympy.Add(
        *(term / exchange / TAU_XI if term.has(number) else term for term in terms),
        evaluate=True,
    )


def coefficients() -> str:
    """Return the table of the closure coefficients, exact and printed, for e = 1 and a = 4/5."""
    rows = [
        "| symbol | name | exact form | exact | printed | paper | verdict |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in audit():
        printed = "–" if row.printed is None else f"{row.printed:.4g}"
        cells = (
            f"${_closure_symbol(row.name)}$",
            f"`{row.name}`",
            f"${latex_math(row.formula)}$",
            f"{row.exact:.4g}",
            printed,
            row.equation.replace(" ", "\N{NO-BREAK SPACE}"),
            row.verdict.replace(" ", "\N{NO-BREAK SPACE}"),
        )
        rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows)
