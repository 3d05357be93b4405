"""Integrators in time and the finite-difference cross-check."""
