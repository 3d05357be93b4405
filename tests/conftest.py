"""Sets up JAX, run-time type checks and Hypothesis before any test imports triboflux."""

import gc
import itertools
import os
from pathlib import Path

CACHE = Path(__file__).resolve().parents[1] / ".pytest_cache" / "jax"

# JAX and the numerical libraries read these once, when they are imported. Test processes share the
# cores between them, so each keeps to one thread. Command lines that a test starts inherit this.
os.environ |= {
    "JAX_PLATFORMS": "cpu",
    "NPROC": "1",  # the size of the thread pool of JAX on a CPU
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MPLBACKEND": "Agg",
    "JAX_COMPILATION_CACHE_DIR": str(CACHE),
    "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.5",
    # A limit (2 GB) is also what makes JAX lock the cache between processes.
    "JAX_COMPILATION_CACHE_MAX_SIZE": "2000000000",
}

import jax  # noqa: E402
from hypothesis import settings  # noqa: E402
from jaxtyping import install_import_hook  # noqa: E402

# Not by environment variable: a command line started by a test has to choose float64 by itself.
jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_rank_promotion", "raise")

install_import_hook("triboflux", "beartype.beartype")

# The first example of a test may compile for seconds, hence no deadline.
settings.register_profile("ci", derandomize=True, database=None, deadline=None, print_blob=True)
settings.register_profile("local", deadline=None)
settings.load_profile("ci" if os.environ.get("CI") else "local")

MOST_MAPPINGS = 20_000
"""Pieces of memory that a test process may hold; Linux allows 65,530 by default.

Each compiled program takes some, and JAX crashes where it gets no more.
"""
_tests = itertools.count(1)


def pytest_runtest_teardown() -> None:
    """Drop compiled programs before there are too many of them."""
    mappings = Path("/proc/self/maps")
    if next(_tests) % 20 == 0 and mappings.read_bytes().count(b"\n") > MOST_MAPPINGS:
        jax.clear_caches()
        gc.collect()
