"""The command line in processes of its own."""

import os
import subprocess
import sys
from pathlib import Path

HEAVY = ("diffrax", "jax", "matplotlib", "netCDF4", "pint", "xarray")

# Runs the command line, then tells on the last line of stderr which heavy packages were imported.
WATCHED = f"""
import sys
from triboflux.cli import main
try:
    main()
finally:
    print([name for name in {HEAVY} if name in sys.modules], file=sys.stderr)
"""


# For a process that will be killed: what it leaves of a half-written entry of JAX's cache would
# make all later writing fail.
READS_CACHE_ONLY = {"JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "1e9"}


def surroundings(**changes):
    """Return the environment for a process in another folder that imports what this one does."""
    root = Path(__file__).resolve().parents[1]
    paths = os.pathsep.join([str(root), str(root / "src")])
    return os.environ | {"PYTHONPATH": paths} | changes


def command(*arguments, code=WATCHED):
    return [sys.executable, "-c", code, *map(str, arguments)]


def triboflux(*arguments, folder, code=WATCHED, environment=None):
    """Run the command line in a folder and return the finished process."""
    return subprocess.run(
        command(*arguments, code=code),
        cwd=folder,
        env=surroundings(**(environment or {})),
        capture_output=True,
        check=False,
        text=True,
        timeout=300,
    )
