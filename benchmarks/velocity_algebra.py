"""The collision coefficients of the velocities' moments by computer algebra, for symbolic e.

The integrals are those of `benchmarks.collision_algebra`, with moments of the velocity alone for ψ
and, for f, a Maxwellian disturbed in R_ij = ⟨c_i c_j⟩ or in S_ijk = ⟨c_i c_j c_k⟩: the factor is
1 + R'_ij H_ij/2 + S_ijk H_ijk/6 with Hermite's tensors H. Disturbances of both particles count
where the gas is uniform. Where R or S has derivatives at x, only that of particle 2 does, which is
at x + d k and sees k_l ∂_l R or k_k k_l ∂_k∂_l R/2.

An answer to such a cause is an isotropic tensor, a combination of products of Kronecker deltas. Its
factors follow from its contractions with the same products (`factors`). A contraction does not
change when all vectors are rotated together, so that it may be evaluated at k = (0,0,1) alone::

    python -m benchmarks.velocity_algebra     # prints every form, in seconds
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import TypeAlias

import numpy as np
import sympy
from numpy.typing import NDArray
from sympy import Expr, Matrix, S

from benchmarks.collision_algebra import (
    VELOCITY_1,
    VELOCITY_2,
    E,
    J,
    K,
    average,
    maxwellian_moment,
)
from triboflux.collision import collide

Index: TypeAlias = tuple[int, ...]
Cause: TypeAlias = Callable[[Index], Expr]
Structure: TypeAlias = tuple[str, int]
"""Pairs of indices with a delta each, and how many terms the symmetric operator is written in."""

AXES = range(3)


@cache
def after() -> tuple[Matrix, Matrix]:
    """Return both velocities after the collision."""
    charges = (S.Zero, S.Zero)
    outcome = collide(
        (VELOCITY_1, VELOCITY_2), charges, K, restitution=E, exponent=S.One, charge_transfer=S.Zero
    )
    # The rule's only floating-point numbers are 0.5 and 1.0, which are exact.
    velocities = (outcome.velocity_1, outcome.velocity_2)
    first, second = (sympy.nsimplify(v, rational=True) for v in velocities)
    return first, second


def monomial(velocity: Matrix, index: Index) -> Expr:
    """Return c_i c_j ... for the indices given."""
    return sympy.Mul(*(velocity[i] for i in index))


def change(index: Index) -> Expr:
    """Return by how much c_i c_j ... of particle 1 changes."""
    return monomial(after()[0], index) - monomial(VELOCITY_1, index)


def hermite(velocity: Matrix, index: Index) -> Expr:
    """Return what a Maxwellian is multiplied with per unit of R'_ij or S_ijk: H_ij/2 or H_ijk/6."""
    if len(index) == 2:
        return (monomial(velocity, index) - int(index[0] == index[1])) / 2
    i, j, k = index
    lower = sum(velocity[a] * int(b == c) for a, b, c in ((i, j, k), (j, i, k), (k, i, j)))
    return (monomial(velocity, index) - lower) / 6


def of_both(index: Index) -> Expr:
    """Return the disturbance of both particles in a uniform gas."""
    return hermite(VELOCITY_1, index) + hermite(VELOCITY_2, index)


def of_partner(index: Index) -> Expr:
    """Return the disturbance of particle 2."""
    return hermite(VELOCITY_2, index)


def deltas(groups: str, pairs: str) -> NDArray[np.int64]:
    """Return a product of Kronecker deltas, summed over all permutations within groups of indices.

    Parameters
    ----------
    groups : str
        Groups of indices, in the order of the array's axes, such as ``"ij l mn"``.
    pairs : str
        Pairs that have a delta, such as ``"il jm np"``.
    """
    names = groups.replace(" ", "")
    factors = [np.eye(3, dtype=np.int64)] * (len(names) // 2)
    product = np.einsum(f"{pairs.replace(' ', ',')}->{names}", *factors)
    total = np.zeros_like(product)
    for parts in itertools.product(*(itertools.permutations(group) for group in groups.split())):
        order = "".join(itertools.chain.from_iterable(parts))
        total += np.einsum(f"{order}->{names}", product)
    return total


def factors(groups: str, cause: Cause, structures: Sequence[Structure]) -> list[Expr]:
    """Return the factors of symmetric operators in what C(c_i c_j ...) answers to a cause.

    Parameters
    ----------
    groups : str
        Indices of ψ, of the derivatives if there are any, and of the cause, such as ``"ij kl mn"``.
    cause : callable
        Disturbance of the pair per unit of the tensor's component.
    structures : sequence of Structure
        The operators. Each is what the pairs make of the tensor, made symmetric in the indices of ψ
        by the sum of so many different terms.

    Returns
    -------
    list of Expr
        In units of J_1, that is of 1/τ_c, with d and Θ one.
    """
    lengths = [len(group) for group in groups.split()]
    ranks = (lengths[0], sum(lengths[1:-1]), lengths[-1])
    tensors = [deltas(groups, pairs) for pairs, _ in structures]
    gram = Matrix([[int(np.sum(a * b)) for b in tensors] for a in tensors])
    orders = math.prod(math.factorial(length) for length in lengths)

    @cache
    def answer(observed: Index, disturbed: Index) -> Expr:
        return average(sympy.expand(change(observed) * cause(disturbed)))

    def contracted(tensor: NDArray[np.int64]) -> Expr:
        total = S.Zero
        for observed in itertools.product(AXES, repeat=ranks[0]):
            for disturbed in itertools.product(AXES, repeat=ranks[2]):
                weight = int(tensor[observed + (2,) * ranks[1] + disturbed])
                if weight:
                    total += weight * answer(tuple(sorted(observed)), tuple(sorted(disturbed)))
        return total

    found = gram.LUsolve(Matrix([contracted(tensor) for tensor in tensors]))
    taylor = math.factorial(ranks[1])
    return [
        in_collisions(sympy.Rational(orders, terms * taylor) * factor)
        for factor, (_, terms) in zip(found, structures, strict=True)
    ]


def in_collisions(response: Expr) -> Expr:
    """Return a response in units of J_1, as a product."""
    return sympy.factor(sympy.simplify((response / J(1)).rewrite(sympy.gamma)))


def energy_responses() -> tuple[Expr, Expr]:
    """Return what −∇Θ drives in the collisional flux of Θ, and ∇²Θ in the loss of it.

    The change of c²/3 of particle 1 is half the difference of both particles' changes, which one
    loses to the other over the distance d, and half their sum, which is lost for good. The flux
    through a point is that of all pairs whose line of centres passes there: with the temperatures
    of both ends, −(d/2) k_l ∫dλ of such changes at x − λ d k and x + (1−λ) d k.
    """
    before = [v.dot(v) / 3 for v in (VELOCITY_1, VELOCITY_2)]
    later = [v.dot(v) / 3 for v in after()]
    mine, its = (end - start for end, start in zip(later, before, strict=True))
    warmer = [(v.dot(v) - 3) / 2 for v in (VELOCITY_1, VELOCITY_2)]
    passed = average(sympy.expand((mine - its) / 2 * (warmer[1] - warmer[0]) / 2))
    lost = average(sympy.expand((mine + its) / 2 * warmer[1]))
    # a third from k_l k_m, halves from the flux and from the expansion to second order
    return in_collisions(passed / 6), in_collisions(lost / 6)


def production_left_over() -> list[Expr]:
    """Return flight and held mean velocity minus −(R_il ∂_l R_jk + ...), which are zero.

    R is a symmetric matrix of symbols with a symbol for each derivative.
    """
    names = [(i, j) for i in AXES for j in AXES if i <= j]
    place = sympy.symbols("x_1:4", real=True)
    fields = {name: sympy.Function(f"R_{name[0]}{name[1]}")(*place) for name in names}

    def variance(i: int, j: int) -> Expr:
        return fields[min(i, j), max(i, j)]

    def slope(axis: int, i: int, j: int) -> Expr:
        return sympy.diff(variance(i, j), place[axis])

    def fourth(i: int, j: int, k: int, axis: int) -> Expr:
        pairs = ((i, j, k, axis), (i, k, j, axis), (i, axis, j, k))
        return sum(variance(a, b) * variance(c, d) for a, b, c, d in pairs)

    force = [sum(slope(axis, axis, i) for axis in AXES) for i in AXES]
    found = []
    for i, j, k in itertools.combinations_with_replacement(AXES, 3):
        flight = -sum(sympy.diff(fourth(i, j, k, axis), place[axis]) for axis in AXES)
        turns = ((i, j, k), (j, i, k), (k, i, j))
        held = sum(force[a] * variance(b, c) for a, b, c in turns)
        said = -sum(variance(a, axis) * slope(axis, b, c) for a, b, c in turns for axis in AXES)
        found.append(sympy.expand(flight + held - said))
    return found


def third_hermite_moments() -> tuple[list[Expr], list[Expr]]:
    """Return ⟨c_l⟩ and ⟨c_l c_m c_n⟩ of a Maxwellian that is disturbed in S_ijk, less S_lmn."""
    velocity = Matrix(sympy.symbols("c_1:4", real=True))
    triples = list(itertools.combinations_with_replacement(AXES, 3))
    values = {t: sympy.Symbol("S_" + "".join(map(str, t))) for t in triples}
    disturbance = sum(
        values[tuple(sorted(index))] * hermite(velocity, index)
        for index in itertools.product(AXES, repeat=3)
    )

    def mean(observable: Expr) -> Expr:
        terms = sympy.Poly(sympy.expand(observable * disturbance), *velocity).terms()
        moments = (
            factor * sympy.Mul(*(maxwellian_moment(p, S.One) for p in powers))
            for powers, factor in terms
        )
        return sympy.expand(sum(moments))

    drift = [mean(velocity[i]) for i in AXES]
    return drift, [mean(monomial(velocity, t)) - values[t] for t in triples]


@cache
def exact_forms() -> dict[str, Expr]:
    """Return every answer, with d and Θ one, in units of 1/τ_c and with the signs of rates."""
    cooling = -average(sympy.expand(sum(change((i, i)) for i in AXES))) / 3
    trace, stress = factors("ij mn", of_both, [("ij mn", 1), ("im jn", 1)])
    third, traces = factors("ijk mnp", of_both, [("im jn kp", 1), ("im np jk", 3)])
    second = factors(
        "ij kl mn",
        of_partner,
        [("kl im jn", 1), ("ik lm jn", 2), ("ij km ln", 1), ("ik jl mn", 1), ("ij kl mn", 1)],
    )
    flux = factors("ij l mnp", of_partner, [("lm in jp", 1), ("ij lm np", 1), ("il jm np", 2)])
    made = factors("ijk l mn", of_partner, [("il jm kn", 3), ("im ln jk", 3), ("il mn jk", 3)])
    pushed = factors("i l mn", of_partner, [("im ln", 1), ("il mn", 1)])
    passed, lost = energy_responses()
    names = ("laplacian", "gradient_divergence", "double_divergence")
    names += ("trace_hessian", "trace_laplacian")
    found = {
        "cooling": in_collisions(cooling),
        "isotropy": -stress,
        "cooling_by_temperature": -(3 * trace + stress),
        "third_moment": -third,
        "third_moment_trace": -traces,
        **{f"transfer_{name}": value for name, value in zip(names, second, strict=True)},
        "transfer_flux": passed,
        "transfer_loss": lost,
        "flux_shift_divergence": -flux[0],
        "flux_shift_heat": -flux[1],
        "flux_shift_heat_gradient": -flux[2],
        "momentum_shift_divergence": -pushed[0],
        "momentum_shift_trace": -pushed[1],
        "production_shift_gradient": -made[0],
        # less what the force does that holds the mean velocity
        "production_shift_divergence": pushed[0] - made[1],
        "production_shift_trace": pushed[1] - made[2],
    }
    return {name: sympy.factor(form) for name, form in found.items()}


def main() -> None:
    """Print all forms."""
    for name, form in exact_forms().items():
        print(f"{name:32s} {form}")


if __name__ == "__main__":
    main()
