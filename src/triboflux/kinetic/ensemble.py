"""One ensemble of simulated particles: its parameters, its state and its steps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from triboflux import closures
from triboflux.case_kinetic import Kinetic
from triboflux.errors import InputError
from triboflux.kinetic.cells import (
    COLUMNS,
    accelerate,
    cell_charges,
    cell_sums,
    electric_field,
    hold,
    local_motion,
    move,
    sort,
)
from triboflux.kinetic.collisions import agitate, collide

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from triboflux.case import Case

_FEWEST_IN_CELL = 20
_CELLS_IN_DIAMETER = 8
_CELLS_IN_DILUTE_BOX = 128
_LONGEST_STEP = 20
_NO_FIELD = np.zeros(2)
_COLLISIONS_IN_STEP, _PATH_IN_STEP, _SWING_IN_STEP = 0.25, 0.02, 0.1


@dataclass(frozen=True)
class Parameters:
    """What the particles of a case obey.

    Attributes
    ----------
    points, cells : int
        Output cells, and collision cells.
    length : float
        Of the box, scaled by L.
    diameter : float
        Distance of colliding centres, scaled by the length of the box; 0 for dilute particles.
    collision_rate : float
        Collisions of a particle per time in equilibrium, scaled by √Θ/L.
    restitution, exponent : float
        Of the collision law.
    charge_transfer, field_transfer : float
        γ and β of (2.15), scaled by Θ^(-a/2), and by that and n L/ε0.
    energy_ratio : float
        Strength of the field's force; 0 without.
    drag_rate : float
        1/τ_p, scaled by √Θ/L.
    time_step : float
        Longest one, scaled by L/√Θ.
    thermostat : str
        One of `triboflux.case_kinetic.THERMOSTATS`.
    """

    points: int
    cells: int
    length: float
    diameter: float
    collision_rate: float
    restitution: float
    exponent: float
    charge_transfer: float
    field_transfer: float
    energy_ratio: float
    drag_rate: float
    time_step: float
    thermostat: str

    @classmethod
    def of(cls, case: Case) -> Parameters:
        """Return the parameters of a case, from its numbers and its table ``[kinetic]``.

        γ and β follow from the Péclet number and τ_σ by the exact relations of kinetic theory,
        whatever closure set the case names; model and closures have no effect.

        Parameters
        ----------
        case : Case
            In one dimension.

        Raises
        ------
        InputError
            If the case has more dimensions, or too few particles for its grid or cells.
        """
        if case.grid.dimensions != 1:
            raise InputError.about(
                "grid.points",
                f"has {case.grid.dimensions} entries, but must have one: particles are simulated "
                "in one space dimension",
            )
        n, options = case.numbers, case.kinetic or Kinetic()
        exact = closures.derived(n.restitution, case.exponent)
        # gamma times Pe, which stays finite without dispersion
        collisional = n.tau_c < math.inf
        transfer = exact["transferred_fraction"] * n.tau_c * n.length_ratio**2 if collisional else 0
        length = case.grid.lengths[0]
        diameter = 0.0 if options.dilute else 1.0 / (n.length_ratio * length)
        return cls(
            points=case.grid.points[0],
            cells=_cells(case, options, diameter),
            length=length,
            diameter=diameter,
            collision_rate=1.0 / n.tau_c,
            restitution=n.restitution,
            exponent=case.exponent,
            charge_transfer=transfer / n.peclet,
            field_transfer=transfer / (n.length_ratio * n.tau_sigma),
            energy_ratio=n.energy_ratio if options.mean_field else 0.0,
            drag_rate=1.0 / n.tau_p,
            time_step=_time_step(case, options),
            thermostat=options.thermostat,
        )


def _cells(case: Case, options: Kinetic, diameter: float) -> int:
    """Return the number of collision cells, a multiple of the output cells."""
    points = case.grid.points[0]
    most = options.particles // _FEWEST_IN_CELL
    if most < points:
        raise InputError.about(
            "kinetic.particles",
            f"is {options.particles}, but must be at least {_FEWEST_IN_CELL * points}, "
            f"{_FEWEST_IN_CELL} for each of the {points} points of the grid",
        )
    if options.cells is None:
        wanted = _CELLS_IN_DIAMETER / diameter if diameter else _CELLS_IN_DILUTE_BOX
        return points * max(1, min(math.ceil(wanted / points), most // points))
    if options.cells % points or options.cells > most:
        raise InputError.about(
            "kinetic.cells",
            f"is {options.cells}, but must be a multiple of the grid's {points} points and at most "
            f"{most}, so that {_FEWEST_IN_CELL} of the {options.particles} particles are in each",
        )
    return options.cells


def _time_step(case: Case, options: Kinetic) -> float:
    """Return the longest time step."""
    n = case.numbers
    limits = [_COLLISIONS_IN_STEP * min(n.tau_c, n.tau_p), _PATH_IN_STEP * case.grid.lengths[0]]
    if options.mean_field and n.energy_ratio > 0.0:
        limits.append(_SWING_IN_STEP / math.sqrt(n.energy_ratio))
    usual = min(limits)
    if options.time_step is None:
        return usual
    if options.time_step > _LONGEST_STEP * usual:
        raise InputError.about(
            "kinetic.time_step",
            f"is {options.time_step:g}, but must be at most {_LONGEST_STEP * usual:.4g}, "
            f"{_LONGEST_STEP} times the usual step; longer ones give nothing of use",
        )
    return options.time_step


class Ensemble:
    """Particles that are simulated together.

    Parameters
    ----------
    parameters : Parameters
        What they obey.
    particles : numpy.ndarray
        Shape ``(particles, 5)``: position, three velocities, charge, as
        `triboflux.kinetic.cells` tells; taken over, not copied.
    generator : numpy.ndarray
        Four 64-bit words, not all zero: the state of the random numbers; taken over.
    """

    def __init__(
        self, parameters: Parameters, particles: NDArray[np.float64], generator: NDArray[np.uint64]
    ) -> None:
        self.parameters = parameters
        self.particles = particles
        self.generator = generator
        self.collisions = 0
        self.steps = 0
        self.largest_probability = 0.0
        self._spare = np.empty((len(particles), COLUMNS))
        self._start = np.zeros(parameters.cells + 1, dtype=np.int64)

    def advance(self, steps: int, time_step: float) -> None:
        """Fly half a step, accelerate, collide, accelerate, and fly half a step, again and again.

        A thermostat acts before and after the collisions alike, so that the error of the step is of
        second order with it, too.

        Parameters
        ----------
        steps : int
            How many.
        time_step : float
            Of each, scaled by L/√Θ.
        """
        half = 0.5 * time_step / self.parameters.length
        p = self.parameters
        forced = p.energy_ratio > 0.0 or p.drag_rate > 0.0
        held = p.thermostat != "none" and (forced or p.restitution < 1.0)
        flight = half
        for _ in range(steps):
            charge = self._sort(flight)
            self._interact(charge, time_step, forced=forced, held=held)
            if held:
                move(self.particles, half)
                hold(self.particles, self._local_motion())
            else:
                # the two halves of a flight that nothing interrupts
                flight = 2.0 * half
            self.steps += 1
        if not held:
            move(self.particles, half)

    def _interact(
        self, charge: NDArray[np.float64], time: float, *, forced: bool, held: bool
    ) -> None:
        """Accelerate, collide, accelerate, with half of what a thermostat does on either side."""
        p, half = self.parameters, 0.5 * time
        warm = p.thermostat == "full"
        field = _NO_FIELD
        if forced or p.field_transfer > 0.0:
            field = self._field(charge)
        if forced:
            self._accelerate(half, field)
        motion = self._local_motion() if held else None
        if held:
            hold(self.particles, motion)
        # What collisions and drag take, random forces give back, which know nothing of charges:
        # half of it before collisions, as far as it is known then, so that these see the right Θ.
        lossy = warm and (p.restitution < 1.0 or p.drag_rate > 0.0)
        if lossy:
            expected = (1.0 - p.restitution**2) * p.collision_rate * half / 3.0
            self._agitate(expected - math.expm1(-time * p.drag_rate))
        if p.collision_rate > 0.0:
            self._collide(time, field)
        if lossy:
            # so much that drag will make it 1
            self._agitate(math.exp(time * p.drag_rate) - self._temperature())
        if held:
            # the second half of the step will do what the first half did
            hold(self.particles, motion)
        if forced:
            self._accelerate(half, self._field(cell_charges(self.particles, self._start)))

    def _temperature(self) -> float:
        """Return the mean square of a velocity component."""
        velocity = self.particles[:, 1:4]
        return float(np.einsum("ij,ij->", velocity, velocity)) / (3.0 * len(velocity))

    def _local_motion(self) -> NDArray[np.float64]:
        """Return what a thermostat takes away: mean velocities, and the heat of the field."""
        p = self.parameters
        return local_motion(self.particles, p.points, p.thermostat == "full" and p.energy_ratio > 0)

    def _agitate(self, variance: float) -> None:
        if variance > 0.0:
            agitate(self.particles, self.generator, variance)

    def _collide(self, time: float, field: NDArray[np.float64]) -> None:
        p = self.parameters
        law = (p.diameter, p.restitution, p.charge_transfer, p.field_transfer, p.exponent)
        rate = 0.25 * math.sqrt(math.pi) * p.collision_rate
        forward = self.steps % 2 == 0
        number, largest = collide(
            self.particles, self._start, self.generator, field, time, rate, law, forward
        )
        self.collisions += number
        self.largest_probability = max(self.largest_probability, largest)

    def sums(self) -> NDArray[np.float64]:
        """Return counts, means and products of deviations, of shape ``(len(SUMS), points)``."""
        return self.sums_and_field()[0]

    def sums_and_field(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return what `sums` does, and the electric field on all faces of the collision cells."""
        charge = self._sort(0.0)
        sums = cell_sums(self.particles, self._start, self.parameters.points)
        return sums, self._field(charge)

    def _sort(self, by: float) -> NDArray[np.float64]:
        """Let particles fly for a time in box lengths over √Θ, order them, and return charges."""
        charge: NDArray[np.float64] = sort(self.particles, self._spare, self._start, by)
        self.particles, self._spare = self._spare, self.particles
        return charge

    def _field(self, charge: NDArray[np.float64]) -> NDArray[np.float64]:
        field: NDArray[np.float64] = electric_field(
            charge, len(self.particles), self.parameters.length
        )
        return field

    def _accelerate(self, time: float, field: NDArray[np.float64]) -> None:
        p = self.parameters
        # the exact motion under a constant force and drag
        slowed = math.exp(-time * p.drag_rate)
        acting = -math.expm1(-time * p.drag_rate) / p.drag_rate if p.drag_rate else time
        accelerate(self.particles, self._start, field, acting * p.energy_ratio, slowed)
