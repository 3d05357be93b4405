"""The part of a case that only the particle simulation reads."""

from __future__ import annotations

from typing import Annotated

from triboflux.validation import Flag, InputModel, Positive, Text, Whole, bounded, one_of

THERMOSTATS = ("full", "mean-velocity", "none")
"""What the particle simulation holds fixed."""


class Kinetic(InputModel):
    r"""How the particles of a case are simulated; the transport models ignore all of it.

    Attributes
    ----------
    particles : int
        Number of particles in each ensemble.
    ensembles : int
        Number of independent simulations, whose scatter gives the standard errors.
    seed : int
        Of all random numbers.
    cells : int or None
        Number of cells in which collision partners are chosen, a multiple of the grid's points. By
        default a cell is an eighth of a diameter wide, or a 128th of the box for dilute particles,
        as long as 20 particles are left in each.
    time_step : float or None
        Scaled by :math:`L/\sqrt\Theta`; by default a quarter of the collision time or of the
        drag time, a fiftieth, or a tenth over the root of the energy ratio, whichever is smallest.
    mean_field : bool
        Accelerate particles by the electric field of all of them.
    thermostat : str
        ``"full"`` holds fixed what the models hold fixed: the local mean velocity is removed after
        each step, energy lost by collisions and drag is returned by random forces that know nothing
        of charges, and energy gained from the field is taken away by scaling velocities.
        ``"mean-velocity"``: only the mean velocity is removed. ``"none"``: particles are free.
    dilute : bool
        Let particles collide at one place instead of a diameter apart.
    """

    particles: Annotated[Whole, bounded(1e3, 1e9)] = 100_000
    ensembles: Annotated[Whole, bounded(2.0, 1e5)] = 8
    seed: Annotated[Whole, bounded(0.0, 1e18)] = 1
    cells: Annotated[Whole, bounded(1.0, 1e7)] | None = None
    time_step: Positive | None = None
    mean_field: Flag = True
    thermostat: Annotated[Text, one_of(THERMOSTATS)] = "full"
    dilute: Flag = False
