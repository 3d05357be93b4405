"""Benchmarks of the package beside other solvers; run them from the root of the repository."""
