"""The equations that the peers integrate are those of the package."""

import jax.numpy as jnp
import numpy as np
import pytest

from benchmarks.peers.modal import Modal
from examples.full_model_by_hand import coefficients
from triboflux import models
from triboflux.calculus import FourierCalculus
from triboflux.grid import Grid
from triboflux.moments import Moments
from triboflux.numbers import Numbers

NUMBERS = {"peclet": 3e4, "tau_c": 0.02, "tau_p": 0.3, "tau_sigma": 2.0}
NUMBERS |= {"energy_ratio": 120.0, "length_ratio": 150.0, "restitution": 0.9}
MODES = ((1, -0.7, 0.2), (3, 0.3, -0.1))


@pytest.fixture(params=["derived", "published"])
def systems(request):
    """Return the peers' system and the package's model on the same points."""
    modal = Modal(coefficients(request.param, NUMBERS), 25, MODES)
    return modal, models.build("full", Numbers(**NUMBERS), request.param), Grid((25,), (1.0,))


def random_unknowns(modal):
    """Return unknowns with every coefficient in use."""
    return np.random.default_rng(5).normal(size=modal.size) / 10.0


def as_moments(coefficients):
    """Return one-sided complex coefficients as the package keeps them."""
    q, c, v = (jnp.stack([f.real, f.imag]) for f in coefficients)
    return Moments(q, c[None], v)


def test_the_peers_right_hand_side_is_ours(systems):
    modal, model, grid = systems
    y = random_unknowns(modal)
    found = as_moments(modal.moments(modal.rates(0.0, y)))
    expected = model.right_hand_side(FourierCalculus(grid), as_moments(modal.moments(y)))
    for name in ("charge", "covariance", "variance"):
        ours = np.asarray(getattr(expected, name))
        scale = np.abs(ours).max()
        np.testing.assert_allclose(getattr(found, name), ours, rtol=0, atol=1e-13 * scale)


def test_the_peers_jacobian_is_that_of_their_right_hand_side(systems):
    modal, *_ = systems
    y, step = random_unknowns(modal), 1e-6
    columns = []
    for unit in np.eye(modal.size):
        # The equations are quadratic: central differences are exact but for round-off.
        ahead, behind = modal.rates(0.0, y + step * unit), modal.rates(0.0, y - step * unit)
        columns.append((ahead - behind) / (2.0 * step))
    expected, found = np.stack(columns, axis=1), modal.jacobian(0.0, y)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 * np.abs(expected).max())
    # The three diagonals are those of the exact Jacobian where only the mean variance is there.
    lone = np.zeros(modal.size)
    lone[2] = y[2]
    exact, band = modal.jacobian(0.0, lone), modal.band(0.0, lone)
    np.testing.assert_allclose(band[1], np.diag(exact), rtol=1e-14)
    np.testing.assert_allclose(band[0, 1:], np.diag(exact, 1), rtol=1e-14)
    np.testing.assert_allclose(band[2, :-1], np.diag(exact, -1), rtol=1e-14)
    filled = np.diag(np.diag(exact)) + np.diag(band[0, 1:], 1) + np.diag(band[2, :-1], -1)
    np.testing.assert_allclose(exact, filled, rtol=0, atol=1e-13 * np.abs(exact).max())


def test_the_peers_start_from_the_charge_asked_for(systems):
    modal, _, grid = systems
    (x,) = grid.coordinates()
    charge = sum(s * np.sin(2 * np.pi * m * x) + c * np.cos(2 * np.pi * m * x) for m, s, c in MODES)
    coefficients = modal.moments(modal.start)
    np.testing.assert_allclose(np.fft.irfft(coefficients[0] * 25, 25), charge, atol=1e-14)
    np.testing.assert_array_equal(modal.unknowns(coefficients), modal.start)
