"""Measurements of the package beside SciPy's integrators, run from the root of the repository."""

import os

# Threads only disturb matrices as small as the peers'; NumPy reads this when it is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
