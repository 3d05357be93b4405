"""Drag of the gas on one particle of a suspension, as the time in which it stops the particle.

Each law returns the drag rate 1/τ_p = F/(m |v_r|), with F the mean force on a particle of mass m
that moves at the speed |v_r| relative to the gas. In terms of the momentum exchange coefficient
of two-fluid models with the gas pressure shared by both phases it is K/(α ρ_p).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

from triboflux.errors import require_one_of

HIGHEST_VISCOUS_REYNOLDS_NUMBER = 1000.0
"""Above it the drag coefficient of a sphere is taken as constant."""
CONSTANT_DRAG_COEFFICIENT = 0.44
DENSE_GAS_FRACTION = 0.8
"""Below this gas fraction the law of Gidaspow is Ergun's."""


class DragState(NamedTuple):
    """What the drag laws depend on.

    Attributes
    ----------
    diameter : float
        Particle diameter d, m.
    density : float
        Density ρ_p of the particle's material, kg/m³.
    solid_fraction : float
        α, dimensionless.
    gas_density : float
        ρ_g, kg/m³.
    gas_viscosity : float
        μ, Pa s.
    speed : float
        |v_r|, speed of a particle relative to the gas, m/s; positive.
    """

    diameter: float
    density: float
    solid_fraction: float
    gas_density: float
    gas_viscosity: float
    speed: float

    @property
    def gas_fraction(self) -> float:
        """1 - α, dimensionless."""
        return 1.0 - self.solid_fraction

    @property
    def reynolds_number(self) -> float:
        """ρ_g |v_r| d/μ of one particle, dimensionless."""
        return self.gas_density * self.speed * self.diameter / self.gas_viscosity


def none(state: DragState) -> float:
    """Return 0: the gas is not felt.

    Parameters
    ----------
    state : DragState
        Not used by this law.

    Returns
    -------
    float
        1/s.
    """
    return 0.0


def stokes(state: DragState) -> float:
    """Return the drag rate of one sphere in creeping flow, 18 μ/(ρ_p d²).

    Parameters
    ----------
    state : DragState
        Particle and gas.

    Returns
    -------
    float
        1/s.
    """
    from fluids.drag import Stokes

    return _sphere(state, Stokes(state.reynolds_number))


def schiller_naumann(state: DragState) -> float:
    """Return the drag rate of one sphere at any Reynolds number.

    Parameters
    ----------
    state : DragState
        Particle and gas.

    Returns
    -------
    float
        1/s.
    """
    return _sphere(state, drag_coefficient(state.reynolds_number))


def wen_yu(state: DragState) -> float:
    """Return the drag rate of a sphere among others, for solid fractions below about 0.2.

    Parameters
    ----------
    state : DragState
        Particle and gas.

    Returns
    -------
    float
        1/s.
    """
    coefficient = drag_coefficient(state.gas_fraction * state.reynolds_number)
    return _sphere(state, coefficient) * state.gas_fraction**-1.65


def ergun(state: DragState) -> float:
    """Return the drag rate in a packed bed, from its pressure drop.

    Parameters
    ----------
    state : DragState
        Particle and gas.

    Returns
    -------
    float
        1/s.
    """
    from fluids.packed_bed import Ergun

    gradient = Ergun(
        dp=state.diameter,
        voidage=state.gas_fraction,
        vs=state.gas_fraction * state.speed,
        rho=state.gas_density,
        mu=state.gas_viscosity,
    )
    return state.gas_fraction * gradient / (state.solid_fraction * state.density * state.speed)


def gidaspow(state: DragState) -> float:
    """Return the drag rate of Wen & Yu in a dilute, of Ergun in a dense suspension.

    The two do not meet where they change, at a gas fraction of 0.8: there the rate of Ergun is
    larger by a factor between 1.02 (at a Reynolds number near 5) and 3.7 (near 1250); it is 1.15 in
    creeping flow.

    Parameters
    ----------
    state : DragState
        Particle and gas.

    Returns
    -------
    float
        1/s.
    """
    return ergun(state) if state.gas_fraction < DENSE_GAS_FRACTION else wen_yu(state)


def drag_coefficient(reynolds_number: float) -> float:
    """Return the drag coefficient of a sphere by Schiller & Naumann (1933), 0.44 above Re = 1000.

    Parameters
    ----------
    reynolds_number : float
        Dimensionless, positive.

    Returns
    -------
    float
        Dimensionless.
    """
    if reynolds_number > HIGHEST_VISCOUS_REYNOLDS_NUMBER:
        return CONSTANT_DRAG_COEFFICIENT
    return 24.0 / reynolds_number * (1.0 + 0.15 * reynolds_number**0.687)


def _sphere(state: DragState, coefficient: float) -> float:
    """Return the drag rate of a sphere with a drag coefficient."""
    return 0.75 * coefficient * state.gas_density * state.speed / (state.density * state.diameter)


class DragLaw(NamedTuple):
    """One drag law.

    Attributes
    ----------
    name : str
        As in `LAWS`.
    rate : callable
        Of a `DragState`, 1/τ_p in 1/s.
    source : str
        Where it was published.
    validity : str
        Where it holds.
    """

    name: str
    rate: Callable[[DragState], float]
    source: str
    validity: str


_ERGUN = "S. Ergun, Chem. Eng. Prog. 48 (1952) 89"
_WEN_YU = "C. Y. Wen & Y. H. Yu, Chem. Eng. Prog. Symp. Ser. 62 (1966) 100"

LAWS: Mapping[str, DragLaw] = MappingProxyType(
    {
        law.name: law
        for law in (
            DragLaw("none", none, "no drag", "heavy particles in a thin gas"),
            DragLaw(
                "stokes",
                stokes,
                "G. G. Stokes, Trans. Camb. Phil. Soc. 9 (1851) 8",
                "one sphere, Re below about 0.3",
            ),
            DragLaw(
                "schiller-naumann",
                schiller_naumann,
                "L. Schiller & A. Naumann, Z. Ver. Dtsch. Ing. 77 (1933) 318",
                "one sphere, Re below about 800; 0.44 from 1000 on",
            ),
            DragLaw("wen-yu", wen_yu, _WEN_YU, "solid fractions below about 0.2"),
            DragLaw(
                "gidaspow",
                gidaspow,
                f"D. Gidaspow, Multiphase Flow and Fluidization (1994); {_WEN_YU}; {_ERGUN}",
                "every solid fraction, with a jump at 0.2",
            ),
        )
    }
)
"""The laws by name."""

NAMES = tuple(LAWS)
"""Names of the laws."""


def drag_time(name: str, state: DragState) -> float:
    """Return the drag time τ_p by a law's name.

    Parameters
    ----------
    name : str
        One of `NAMES`.
    state : DragState
        Particle and gas.

    Returns
    -------
    float
        s; inf without drag.

    Raises
    ------
    InputError
        If there is no such law.
    """
    require_one_of("drag", name, NAMES)
    rate = LAWS[name].rate(state)
    return 1.0 / rate if rate > 0.0 else math.inf
