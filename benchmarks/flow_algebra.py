"""What collisions over a diameter make of a mean velocity that changes along x, for symbolic e.

The integrals are those of `benchmarks.velocity_algebra`, with k = (0,0,1) and x in all directions.
Particle 2 is at x + d k, where the mean velocity is U + d k_x ∂U/∂x + (d k_x)²/2 ∂²U/∂x², along x.
That shifts its velocities, so that derivatives of the distribution by the velocity are causes::

    python -m benchmarks.flow_algebra     # prints every form, in seconds
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import sympy
from sympy import Expr, Matrix, S

from benchmarks.collision_algebra import VELOCITY_1, VELOCITY_2, average
from benchmarks.velocity_algebra import after, in_collisions

COSINE, SINE = sympy.symbols("mu sigma", real=True)
X = Matrix([SINE, 0, COSINE])
"""Direction of x; k_x is the cosine."""
ANY = Matrix(sympy.symbols("c_1:4", real=True))
"""A velocity."""
LENGTH = sympy.sqrt(sympy.pi)
"""Of d/√Θ in the units of first derivatives, √π d/(√Θ τ_c)."""


def squares(velocity: Matrix) -> tuple[Expr, Expr]:
    """Return c_x c_x and c·c."""
    return velocity.dot(X) ** 2, velocity.dot(velocity)


def changes() -> tuple[Expr, Expr, Expr]:
    """Return by how much c_x, c_x c_x and c·c of particle 1 change."""
    later, before = squares(after()[0]), squares(VELOCITY_1)
    first = (after()[0] - VELOCITY_1).dot(X)
    return first, later[0] - before[0], later[1] - before[1]


def disturbances(velocity: Matrix) -> tuple[Expr, Expr]:
    """Return what R'_xx and R'_yy = R'_zz, each of one, multiply a Maxwellian with."""
    along, whole = squares(velocity)
    return (along - 1) / 2, (whole - along - 2) / 2


def shifted(disturbance: Expr, order: int) -> Expr:
    """Return the factor of the Maxwellian of particle 2 that the n-th power of a shift makes.

    Parameters
    ----------
    disturbance : Expr
        What the Maxwellian is multiplied with besides, a function of `ANY`.
    order : int
        n of (−shift ∂/∂c)ⁿ/n!, for a shift of one along x.
    """
    factor = disturbance
    for _ in range(order):
        slope = sum(along * sympy.diff(factor, c) for along, c in zip(X, ANY, strict=True))
        # the derivative of the Maxwellian is −c times it
        factor = slope - ANY.dot(X) * factor
    its = dict(zip(ANY, VELOCITY_2, strict=True))
    return factor.subs(its, simultaneous=True) * (-1) ** order / sympy.factorial(order)


def answer(observable: Expr, cause: Expr) -> Expr:
    """Return what a moment's change answers to a cause, in units of 1/τ_c, with d and Θ one."""
    product = sympy.Poly(sympy.expand(observable * cause), COSINE, SINE)
    total = S.Zero
    for (cosines, sines), factor in product.terms():
        # the mean over all directions; what is odd vanishes
        if cosines % 2 == sines % 2 == 0:
            within = COSINE**cosines * (1 - COSINE**2) ** (sines // 2)
            total += average(factor) * sympy.integrate(sympy.expand(within), (COSINE, 0, 1))
    return in_collisions(total)


def of_stress(observables: Sequence[Expr]) -> list[list[Expr]]:
    """Return the answers of observables to ∂U/∂x times R'_xx, and times R'_yy = R'_zz."""
    found: list[list[Expr]] = []
    for one, its in zip(disturbances(VELOCITY_1), disturbances(ANY), strict=True):
        cause = COSINE * (one * shifted(S.One, 1) + shifted(its, 1))
        found.append([answer(observable, cause) / LENGTH for observable in observables])
    return found


@cache
def exact_forms() -> dict[str, Expr]:
    """Return every form by its name in `triboflux.velocity_closures.FlowClosures`.

    Besides these, what has to vanish as they are enough for all of the answers.
    """
    momentum, along, energy = changes()
    once, twice = COSINE * shifted(S.One, 1), COSINE**2 * shifted(S.One, 2)
    (own, own_trace), (across, across_trace) = of_stress((along, energy))
    maxwellian, work = (answer(change, once) / LENGTH for change in (along, energy))
    _, its = disturbances(VELOCITY_2)
    pressure = -answer(momentum, COSINE * its) / (2 * LENGTH)
    viscosity = answer(momentum, COSINE * once / 2)
    heating = answer(energy, twice)
    forms = {
        "pressure": pressure,
        "viscosity": viscosity,
        "work_along": own,
        "work_across": across,
        "work": work / 5,
        "heating_along": answer(along, twice),
        "heating": heating,
        # what the moving mean loses by both stresses, less what the fluctuations gain
        "lost_work": -work / 10 - pressure,
        "lost_heating": viscosity - heating / 2,
        "left of the Maxwellian": maxwellian - own - across,
        "left of the trace along x": own_trace - 3 * work / 5,
        "left of the trace across x": across_trace - 2 * work / 5,
    }
    return {name: sympy.factor(form) for name, form in forms.items()}


def main() -> None:
    """Print all forms."""
    for name, form in exact_forms().items():
        print(f"{name:28s} {form}")


if __name__ == "__main__":
    main()
