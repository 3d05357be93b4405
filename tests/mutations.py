"""Break single lines on purpose and see that the test which guards them fails.

Run with ``python -m tests.mutations``; it writes ``tests/mutations.md``. Every line is broken in a
temporary copy, one at a time. Words after the command select guarantees that contain one of them;
the rows of the others stay as they are.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
COPIED = ("src", "tests", "examples", "benchmarks", "pyproject.toml", "README.md")


class Mutation(NamedTuple):
    guarantee: str
    module: str
    line: str
    broken: str
    test: str


FULL, ISOTROPY, EXPONENTIAL = "models/full", "integrators/isotropy", "integrators/exponential"
MUTATIONS = (
    Mutation(
        "total charge is constant, finite differences",
        "integrators/finite_difference",
        "return scalar - jnp.mean(scalar)",
        "return scalar",
        "test_finite_difference.py::test_total_charge_is_constant",
    ),
    Mutation(
        "total charge is constant, Fourier",
        "models/operators",
        "lambda k: jnp.where(k > 0.0, 1.0, 0.0)",
        "lambda k: jnp.ones_like(k)",
        "test_invariants.py::test_total_charge_is_constant",
    ),
    Mutation(
        "a plane wave equals the one-dimensional solution",
        ISOTROPY,
        "total = _plus(total, _summed(factor, vector, 2))",
        "total = _plus(total, _summed(1.01 * factor, vector, 2))",
        "test_invariants.py::test_a_plane_wave_is_the_solution_of_one_dimension",
    ),
    Mutation(
        "a plane wave of the third-order model equals the one-dimensional solution",
        ISOTROPY,
        "_times(1.5, a)",
        "_times(1.4, a)",
        "test_third_order.py::test_a_plane_wave_is_the_solution_of_one_dimension",
    ),
    Mutation(
        "the equation of the trace is the trace of the equation",
        "models/operators",
        "ISOTROPIC: (IDENTITY, 3.0),",
        "ISOTROPIC: (IDENTITY, 1.0),",
        "test_third_order.py::test_the_equation_of_the_trace_is_the_trace_of_the_equation",
    ),
    Mutation(
        "the term list agrees with the model written by hand: electric force",
        FULL,
        "            c.electric_force,",
        "            -c.electric_force,",
        "test_full_model_by_hand.py::test_fourier_right_hand_side",
    ),
    Mutation(
        "the term list agrees with the model written by hand: gradient production",
        FULL,
        "            -c.gradient_production,",
        "            c.gradient_production,",
        "test_full_model_by_hand.py::test_fourier_right_hand_side",
    ),
    Mutation(
        "the term list agrees with the model written by hand: variance production",
        FULL,
        "            -2.0,",
        "            2.0,",
        "test_full_model_by_hand.py::test_fourier_right_hand_side",
    ),
    Mutation(
        "the trace of a third-order moment has three directions",
        "models/coefficients",
        "n_t = closure_set.trace_dimensions(dimensions)",
        "n_t = dimensions",
        "test_full_model_by_hand.py::test_fourier_right_hand_side",
    ),
    Mutation(
        "closures are the exact ones",
        "closures",
        '"variance_regain": (72.0 * square',
        '"variance_regain": (71.9 * square',
        "test_closures.py",
    ),
    Mutation(
        "sum of terms equals the right-hand side of the integrator",
        "models/operators",
        'GRADIENT = Operator("∇", lambda k: -k',
        'GRADIENT = Operator("∇", lambda k: -1.001 * k',
        "test_linear.py::test_operator_is_the_sum_of_the_linear_terms",
    ),
    Mutation(
        "the linear charge-covariance system is solved exactly",
        "integrators/phi",
        "results = [_multiply(growth, growth) + 2.0 * growth]",
        "results = [0.999999 * _multiply(growth, growth) + 2.0 * growth]",
        "test_exact.py::test_linear_solution_is_that_of_the_solver",
    ),
    Mutation(
        "phi functions are accurate",
        "integrators/phi",
        "total = total + carried[i] / math.factorial(j - i)",
        "total = total + carried[i] / (j - i)",
        "test_phi.py::test_functions_are_accurate_in_norm",
    ),
    Mutation(
        "products are de-aliased",
        "grid",
        "return tuple((n - 1) // 3 for n in self.points)",
        "return tuple((n - 1) // 2 for n in self.points)",
        "test_grid.py::test_products_of_kept_fields_have_no_aliasing",
    ),
    Mutation(
        "order five in time, not stiff",
        EXPONENTIAL,
        "LEVELS = ((0,), (0, 2), (0, 1, 2), (0, 1, 2))",
        "LEVELS = ((0,), (0, 2), (0, 2), (0, 2))",
        "test_exponential.py::test_order_five_on_a_problem_that_is_not_stiff",
    ),
    Mutation(
        "order in time on the slaved covariance",
        EXPONENTIAL,
        "values = term.at_nodes(part, _states(functions, homogeneous, newest))",
        "values = term.at_nodes(part, _states(functions, homogeneous, carry))",
        "test_exponential.py::test_order_on_the_slaved_covariance",
    ),
    Mutation(
        "the error estimate sees moments that nothing depends on",
        EXPONENTIAL,
        "quadrature = jnp.maximum(smooth, stiff)",
        "quadrature = 0.0 * smooth",
        "test_exponential.py::test_error_estimate_sees_a_moment_that_nothing_depends_on",
    ),
    Mutation(
        "dense output keeps the order",
        EXPONENTIAL,
        "functions = _Functions.make(interpolation.linear, step, fraction[None])",
        "functions = _Functions.make(interpolation.linear, step, 0.999 * fraction[None])",
        "test_exponential.py::test_dense_output_keeps_the_order_on_a_problem_that_is_not_stiff",
    ),
    Mutation(
        "functions of the operator are reused",
        EXPONENTIAL,
        "round_off = 8.0 * jnp",
        "round_off = 0.0 * jnp",
        "test_exponential.py::test_functions_are_made_once_for_equal_steps",
    ),
    Mutation(
        "stops are located to the tolerance",
        "integrators/root",
        "near = (change <= self.atol + self.rtol * jnp.abs(last))",
        "near = (change <= 1e-3)",
        "test_controller_and_root.py::test_roots_are_found_to_the_tolerance",
    ),
    Mutation(
        "the peak does not depend on where the points lie",
        "grid",
        "lax.fori_loop(0, 3, newton, start)",
        "start",
        "test_grid.py::test_peak_does_not_depend_on_where_the_points_lie",
    ),
    Mutation(
        "finite differences are of sixth order",
        "integrators/finite_difference",
        "-3.0 / 20.0, 1.0 / 60.0)",
        "-3.0 / 20.0, 1.0 / 61.0)",
        "test_finite_difference.py::test_operators_are_of_sixth_order",
    ),
    Mutation(
        "segments make the steps of a single run",
        "integrate",
        "return jnp.where(carry.next_step > 0.0, carry.next_step, estimate - carry.time)",
        "return jnp.where(carry.next_step > 0.0, 0.5 * carry.next_step, estimate - carry.time)",
        "test_integrate.py::test_segments_make_the_steps_of_a_single_run_bit_for_bit",
    ),
    Mutation(
        "budgets sum to the measured rate of change",
        "diagnostics",
        "value = getattr(evaluate((term,), calculus, state), term.moment)",
        "value = 1.01 * getattr(evaluate((term,), calculus, state), term.moment)",
        "test_budget.py::test_sum_of_terms_is_the_measured_rate_of_change",
    ),
    Mutation(
        "gradients of the stop time",
        "grid",
        "return height(positions[jnp.argmax(jax.vmap(height)(positions))])",
        "return lax.stop_gradient(height(positions[jnp.argmax(jax.vmap(height)(positions))]))",
        "test_grid.py::test_peak_is_differentiable",
    ),
    Mutation(
        "sign of the kinetic flux",
        FULL,
        "-c.flux",
        "c.flux",
        "test_terms.py::test_each_term_of_a_single_wave_by_hand",
    ),
    Mutation(
        "the dispersion of the divergence is no Laplacian",
        "models/operators",
        '"∇∇·", lambda k: -(k**2), _zero,',
        '"∇∇·", lambda k: -(k**2), lambda k: -(k**2),',
        "test_linear.py::test_operator_is_the_sum_of_the_linear_terms",
    ),
    Mutation(
        "directions keep their signs",
        ISOTROPY,
        "return [jnp.asarray(k) * inverse for k in grid.wave_vector()]",
        "return [jnp.abs(jnp.asarray(k)) * inverse for k in grid.wave_vector()]",
        "test_invariants.py::test_a_plane_wave_is_the_solution_of_one_dimension",
    ),
    Mutation(
        "the reference table",
        "rates",
        'destruction = c["covariance_collision"] * collision_rate + drag_rate',
        'destruction = 1.0001 * c["covariance_collision"] * collision_rate + drag_rate',
        "test_reference_table.py::test_five_digits_at_a_tight_tolerance",
    ),
    Mutation(
        "what lies outside the range of validity is refused",
        "models/coefficients",
        "if not float(value) > 0.0:",
        "if float(value) < 0.0:",
        "test_coefficients.py::test_each_quantity_is_looked_at",
    ),
    Mutation(
        "slow modes of a stiff block keep their accuracy",
        "integrators/phi",
        "results = [_multiply(growth, growth) + 2.0 * growth]",
        "results = [(growth + _identity(growth)) - _identity(growth)]\n"
        "    results = [_multiply(results[0], results[0]) + 2.0 * results[0]]",
        "test_phi.py::test_the_slow_eigenvalue_survives_many_doublings",
    ),
    Mutation(
        "Lobatto's nodes",
        EXPONENTIAL,
        "(5.0 + math.sqrt(5.0)) / 10.0",
        "(5.0 + math.sqrt(6.0)) / 10.0",
        "test_exponential.py::test_order_five_on_a_parabolic_problem",
    ),
    Mutation(
        "products that read the slaved covariance come last",
        "models/model",
        "for group in (first, last) if group",
        "for group in (last, first) if group",
        "test_exponential.py::test_the_order_of_the_sweeps_matters_on_the_slaved_covariance",
    ),
    Mutation(
        "the error estimate scales with the sixth power of the step",
        EXPONENTIAL,
        "*map(difference, (-1, -2, -3))",
        "*map(difference, (-2, -3, -3))",
        "test_exponential.py::test_error_estimate_scales_with_the_sixth_power_of_the_step",
    ),
    Mutation(
        "functions of the operator are made anew for another step",
        EXPONENTIAL,
        "jnp.abs(step - solver_state.step) <= round_off",
        "jnp.abs(step - solver_state.step) <= 10.0 * step",
        "test_exponential.py::test_kept_functions_change_nothing",
    ),
    Mutation(
        "a step that is no number ends the run",
        "integrators/controller",
        "collapsed = ~(step > 4.0 * jnp.finfo(step.dtype).eps * jnp.abs(start))",
        "collapsed = step <= 4.0 * jnp.finfo(step.dtype).eps * jnp.abs(start)",
        "test_integrate.py::test_a_state_that_is_no_number_fails_at_once",
    ),
    Mutation(
        "every moment is judged in its own scale",
        "integrators/controller",
        "scale = self.atol + self.rtol * jnp.maximum(self.norm(start), size)",
        "scale = self.atol + self.rtol * (1.0 + self.norm(start))",
        "test_controller_and_root.py::test_every_moment_counts_in_its_own_scale",
    ),
    Mutation(
        "an end of the bracket cannot stay for ever",
        "integrators/root",
        "state.values[0] / 2.0",
        "state.values[0]",
        "test_controller_and_root.py::test_roots_are_found_to_the_tolerance",
    ),
    Mutation(
        "the highest summit is found among several",
        "grid",
        "SUMMITS = 8",
        "SUMMITS = 1",
        "test_grid.py::test_the_highest_point_need_not_lie_below_the_peak",
    ),
    Mutation(
        "the stop lies at the peak between the points",
        "integrate",
        "peak = lax.cond(far, lambda: largest, lambda: grid.peak(y.charge))",
        "peak = largest",
        "test_integrate.py::test_the_peak_at_the_stop_is_the_stop_value",
    ),
    Mutation(
        "gradients of the stop time, through the whole run",
        EXPONENTIAL,
        "y1 = _first(_states(functions, states, polynomials, end))",
        "y1 = _first(_states(functions, states, lax.stop_gradient(polynomials), end))",
        "test_gradients.py::test_gradient_of_the_stop_time_against_central_differences",
    ),
    Mutation(
        "a grid that has become too coarse is left",
        "resolution",
        "> (1.0 - SPECTRUM_END) * kept",
        "> (2.0 - SPECTRUM_END) * kept",
        "test_resolution.py::test_grids_grow_with_the_spectrum_and_change_less_than_the_tolerance",
    ),
)


def fails(mutation: Mutation) -> bool:
    """Return whether the test fails in a copy of the project with the line broken."""
    with tempfile.TemporaryDirectory() as folder:
        for name in COPIED:
            source = ROOT / name
            copy = shutil.copytree if source.is_dir() else shutil.copy2
            copy(source, Path(folder) / name)
        module = Path(folder, "src", "triboflux", f"{mutation.module}.py")
        text = module.read_text()
        if text.count(mutation.line) != 1:
            raise SystemExit(f"{mutation.module}: not exactly once: {mutation.line}")
        module.write_text(text.replace(mutation.line, mutation.broken))
        # Programs compiled before serve again wherever the broken line does not matter.
        cache = ROOT / ".pytest_cache"
        cache.mkdir(exist_ok=True)
        Path(folder, cache.name).symlink_to(cache)
        quiet = ["-x", "-q", "-p", "no:cacheprovider"]
        command = [sys.executable, "-m", "pytest", *quiet, f"tests/{mutation.test}"]
        environment = os.environ | {"PYTHONPATH": str(Path(folder, "src"))}
        done = subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True, check=False
        )
        if done.returncode not in (0, 1):
            raise SystemExit(f"{mutation.test} could not be run:\n{done.stdout}{done.stderr}")
        return done.returncode == 1


def row(mutation: Mutation, outcome: str) -> str:
    code = [part.strip().replace("|", "\\|") for part in (mutation.line, mutation.broken)]
    shown = " → ".join(f"`{' '.join(part.split())}`" for part in code)
    place = f"`{mutation.module}`: {shown}"
    return f"| {mutation.guarantee} | {place} | `{mutation.test}` | {outcome} |"


def main(words: list[str]) -> None:
    result = ROOT / "tests" / "mutations.md"
    known = result.read_text().splitlines() if result.is_file() else []
    rows = []
    for mutation in MUTATIONS:
        start = row(mutation, "").removesuffix(" |")
        if words and not any(word in mutation.guarantee for word in words):
            # Not tried this time: what was found before still holds.
            rows += [line for line in known if line.startswith(start)]
            continue
        outcome = "fails" if fails(mutation) else "**passes**"
        print(f"{outcome:10} {mutation.guarantee}: {mutation.test}", flush=True)
        rows.append(row(mutation, outcome))
    heading = (
        "# Lines broken on purpose\n\n"
        "Written by `python -m tests.mutations`, which breaks one line of a copy of the source\n"
        "at a time and runs the test that has to notice.\n\n"
        "| guarantee | line → broken line | test | outcome |\n|---|---|---|---|\n"
    )
    result.write_text(heading + "\n".join(rows) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
