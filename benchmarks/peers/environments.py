"""The environments that the peers are installed in, apart from the project's own.

Each peer has a file in ``benchmarks/peers/requirements``. What fails to install is reported with
the reason and measured no further.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).parent
FOLDER = Path(os.environ.get("TRIBOFLUX_PEERS", HERE.parents[1] / ".peers"))
"""Where the environments are made."""


class Environment(NamedTuple):
    """Where a peer lives.

    Attributes
    ----------
    module : str
        Of this package, with its solvers.
    requirements : str
        Name of its file of requirements, empty for the project's own environment.
    packages : tuple of str
        Whose versions are told.
    """

    module: str
    requirements: str
    packages: tuple[str, ...]


ENVIRONMENTS = (
    Environment("with_triboflux", "", ("jax", "diffrax")),
    Environment("with_scipy", "", ("scipy", "numba")),
    Environment("with_sundials", "sundials", ("scikit-sundae",)),
    Environment("with_rkstiff", "rkstiff", ("rkstiff",)),
    Environment("with_diffrax", "", ("diffrax",)),
    Environment("with_exponax", "exponax", ("exponax", "jax")),
    Environment("with_py_pde", "py-pde", ("py-pde",)),
    Environment("with_dedalus", "dedalus", ("dedalus",)),
)


def interpreter(environment: Environment) -> Path:
    """Return the Python of an environment, making it if it is not there.

    Parameters
    ----------
    environment : Environment
        Which.

    Raises
    ------
    RuntimeError
        If it cannot be installed, with the last line that pip said.
    """
    if not environment.requirements:
        return Path(sys.executable)
    folder = FOLDER / environment.requirements
    python, done = folder / "bin" / "python", folder / ".installed"
    requirements = HERE / "requirements" / f"{environment.requirements}.txt"
    wanted = requirements.read_text(encoding="utf-8")
    if done.exists() and done.read_text(encoding="utf-8") == wanted:
        return python
    subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True, capture_output=True)
    pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    told = subprocess.run(
        [*pip, "-r", str(requirements)], capture_output=True, text=True, check=False
    )
    if told.returncode != 0:
        lines = [line for line in told.stderr.splitlines() if line.strip()]
        raise RuntimeError(lines[-1] if lines else "pip failed")
    done.write_text(wanted, encoding="utf-8")
    return python
