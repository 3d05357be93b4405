"""How the loops of the particle simulation are compiled."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from numba import njit


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function on its first call, to run without the interpreter's lock.

    The machine code is kept beside the source. It is renewed when the function's own file changes,
    so compiled functions call only such of the same file.

    Parameters
    ----------
    function : callable
        Of numbers and NumPy arrays.
    """
    # a type checker that wraps all functions of the package is left out: Numba checks by itself
    return njit(nogil=True, cache=True, error_model="numpy")(inspect.unwrap(function))
