"""Moment equations of charge transport in gas-solid flow with triboelectric charging.

The names below are imported on first use, so that importing the package stays fast.
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from triboflux import closures, numbers, presets
    from triboflux.case import Case, ComponentMode, GridSpec, Initial, Mode, Run
    from triboflux.case_kinetic import Kinetic
    from triboflux.compare import compare
    from triboflux.comparison import Comparison
    from triboflux.diagnostics import initial_closure
    from triboflux.errors import InputError, OutOfRangeError, TribofluxError
    from triboflux.grid import Grid
    from triboflux.integrate import integrate
    from triboflux.kinetic.simulation import simulate, simulate_to_file
    from triboflux.moments import Moments
    from triboflux.numbers import Numbers
    from triboflux.result import Result, load
    from triboflux.solve import solve, solve_to_file
    from triboflux.suitability import suitability
    from triboflux.suspension import Suspension
    from triboflux.sweep import Sweep, sweep
    from triboflux.sweep_values import ValueRange

__version__ = "0.1.0"

__all__ = [
    "Case",
    "Comparison",
    "ComponentMode",
    "Grid",
    "GridSpec",
    "Initial",
    "InputError",
    "Kinetic",
    "Mode",
    "Moments",
    "Numbers",
    "OutOfRangeError",
    "Result",
    "Run",
    "Suspension",
    "Sweep",
    "TribofluxError",
    "ValueRange",
    "__version__",
    "closures",
    "compare",
    "initial_closure",
    "integrate",
    "load",
    "numbers",
    "presets",
    "simulate",
    "simulate_to_file",
    "solve",
    "solve_to_file",
    "suitability",
    "sweep",
]

_MODULES = ("closures", "numbers", "presets")
"""Modules that are public themselves."""

_HOMES = {
    "Case": "case",
    "Comparison": "comparison",
    "ComponentMode": "case",
    "Grid": "grid",
    "GridSpec": "case",
    "Initial": "case",
    "InputError": "errors",
    "Kinetic": "case_kinetic",
    "Mode": "case",
    "Moments": "moments",
    "Numbers": "numbers",
    "OutOfRangeError": "errors",
    "Result": "result",
    "Run": "case",
    "Suspension": "suspension",
    "Sweep": "sweep",
    "TribofluxError": "errors",
    "ValueRange": "sweep_values",
    "compare": "compare",
    "initial_closure": "diagnostics",
    "integrate": "integrate",
    "load": "result",
    "simulate": "kinetic.simulation",
    "simulate_to_file": "kinetic.simulation",
    "solve": "solve",
    "solve_to_file": "solve",
    "suitability": "suitability",
    "sweep": "sweep",
}
"""The module that each lazily imported name lives in."""


def __getattr__(name: str) -> object:
    """Import a public name on first use (PEP 562)."""
    if name in _MODULES:
        return importlib.import_module(f"triboflux.{name}")
    if name not in _HOMES:
        raise AttributeError(f"module 'triboflux' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"triboflux.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List the public names, imported or not."""
    return sorted(__all__)


class _Package(ModuleType):
    """The package itself, in which `solve` and `integrate` always mean the functions.

    Importing a submodule binds it as an attribute of its package. For the modules named
    like their main function the function is bound instead, whatever was imported first.
    """

    def __setattr__(self, name: str, value: object) -> None:
        if _HOMES.get(name) == name and isinstance(value, ModuleType):
            value = getattr(value, name)
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
