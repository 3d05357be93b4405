"""Cost of a step on growing boxes, beside that of its Fourier transforms alone.

Both are taken from compiled loops, from what more repetitions cost more: a program that makes one
step spends a third of its time on fetching memory, which a run does once.
"""

from __future__ import annotations

from collections.abc import Callable
from math import log2, prod
from time import process_time
from typing import Any

from benchmarks.boxes import MODES
from benchmarks.timing import table
from examples.full_model_by_hand import PAPER_CASES

SIZES = ((128, 128), (256, 256), (512, 512), (32, 32, 32), (64, 64, 64))
STEP, FEW, MANY, REPEATS, ALLOWED = 0.01, 1, 4, 5, 1.5


def transforms_of(jaxpr: Any) -> dict[tuple[str, tuple[int, ...]], int]:
    """Return how often a program makes each transform, by kind and shape of what it is given.

    Parameters
    ----------
    jaxpr : jax.extend.core.Jaxpr
        The program; loops of fixed length count their body as often as it is run.
    """
    found: dict[tuple[str, tuple[int, ...]], int] = {}
    for equation in jaxpr.eqns:
        if equation.primitive.name == "fft":
            kind = str(equation.params["fft_type"]).rpartition(".")[2]
            key = (kind, tuple(equation.invars[0].aval.shape))
            found[key] = found.get(key, 0) + 1
        times = equation.params.get("length", 1) if equation.primitive.name == "scan" else 1
        for value in equation.params.values():
            inner = getattr(value, "jaxpr", value)
            if hasattr(inner, "eqns"):
                for key, count in transforms_of(inner).items():
                    found[key] = found.get(key, 0) + times * count
    return found


def programs(points: tuple[int, ...]) -> tuple[Callable[[int], Any], Callable[[int], Any], int]:
    """Return functions that make so many steps, or only their transforms, and the latter's fields.

    Parameters
    ----------
    points : tuple of int
        Points per dimension.
    """
    import equinox as eqx
    import jax
    import jax.numpy as jnp
    import numpy as np
    from jax import lax

    from triboflux import models
    from triboflux.grid import Grid
    from triboflux.integrate import begin, semilinear_term
    from triboflux.integrators.exponential import ExponentialRungeKutta5
    from triboflux.moments import Moments
    from triboflux.numbers import Numbers

    d = len(points)
    grid, solver = Grid(points, (1.0,) * d), ExponentialRungeKutta5()
    mesh = np.meshgrid(*grid.coordinates(), indexing="ij")
    charge = np.zeros(points)
    for wave, sine, cosine in MODES[d]:
        phase = 2.0 * np.pi * sum(m * x for m, x in zip(wave, mesh, strict=True))
        charge += sine * np.sin(phase) + cosine * np.cos(phase)
    state = Moments(jnp.asarray(charge), jnp.zeros((d, *points)), jnp.zeros(points))
    model = models.build("full", Numbers(**PAPER_CASES["B"]), "derived", dimensions=d)
    model = jax.tree.map(jnp.asarray, model)
    start = begin(model, state, grid).coefficients

    def one(model: Any, y: Any, cache: Any) -> Any:
        term, zero = semilinear_term(model, grid), jnp.zeros(())
        return solver.step(term, zero, jnp.asarray(STEP), y, None, cache, False)[:2]

    def steps(model: Any, y: Any, cache: Any, count: Any) -> Any:
        # the error estimate is carried along, so that it is not left out
        begun = (y, jax.tree.map(jnp.zeros_like, y))
        return lax.fori_loop(0, count, lambda _, now: one(model, now[0], cache), begun)

    cache = eqx.filter_jit(
        lambda model, y: solver.init(semilinear_term(model, grid), 0.0, jnp.asarray(STEP), y, None)
    )(model, start)
    # As every step of a run but the few that change the length: the functions are at hand.
    traced = eqx.filter_make_jaxpr(one)(model, start, cache)[0]
    counted = transforms_of(traced.jaxpr)
    fields = sum(count * prod(shape[: len(shape) - d]) for (_, shape), count in counted.items())
    compiled = eqx.filter_jit(steps)
    loops = [(_loop(kind, shape, points), count) for (kind, shape), count in counted.items()]

    def make_steps(count: int) -> None:
        jax.block_until_ready(compiled(model, start, cache, jnp.asarray(count)))

    def make_transforms(count: int) -> None:
        for run, each in loops:
            run(count * each)

    return make_steps, make_transforms, fields


def _loop(kind: str, shape: tuple[int, ...], points: tuple[int, ...]) -> Callable[[int], Any]:
    """Return a compiled loop that makes a transform so many times, and nothing else but copies."""
    import jax
    import jax.numpy as jnp
    from jax import lax

    axes = tuple(range(-len(points), 0))

    def transform(values: Any) -> Any:
        if "IRFFT" in kind:
            return jnp.fft.irfftn(values, s=points, axes=axes)
        return jnp.fft.rfftn(values, axes=axes)

    # two inputs in turn: the transform of one would be made once for the whole loop
    inputs = jnp.full((2, *shape), 0.5, complex if "IRFFT" in kind else float)

    @jax.jit
    def run(inputs: Any, count: Any) -> Any:
        first = jnp.zeros_like(transform(inputs[0]))
        return lax.fori_loop(0, count, lambda i, _: transform(inputs[i % 2]), first)

    return lambda count: jax.block_until_ready(run(inputs, count))


def report() -> str:
    """Measure and return the table."""
    rows = []
    for points in SIZES:
        step, transforms, fields = programs(points)
        seconds: dict[tuple[int, int], list[float]] = {}
        for turn in range(REPEATS + 1):
            for kind, run in enumerate((step, transforms)):
                for count in (FEW, MANY):
                    began = process_time()
                    run(count)
                    if turn:  # the first one compiles
                        seconds.setdefault((kind, count), []).append(process_time() - began)
        whole, needed = (
            (min(seconds[kind, MANY]) - min(seconds[kind, FEW])) / (MANY - FEW) for kind in (0, 1)
        )
        ratio, size = whole / needed, prod(points)
        word = "met" if ratio <= ALLOWED else f"missed by a factor {ratio / ALLOWED:.2g}"
        scaled = 1e9 * whole / (size * log2(size))
        name = " × ".join(map(str, points))
        rows.append([name, str(fields), f"{1e3 * whole:.3g}", f"{1e3 * needed:.3g}"])
        rows[-1] += [f"{ratio:.2f}", word if size >= 256**2 else "—", f"{scaled:.3g}"]
    header = ["points", "fields transformed", "a step, CPU ms", "its transforms alone, CPU ms"]
    return table([*header, "ratio", "at most 1.5", "ns a step, over N log2 N"], rows)
