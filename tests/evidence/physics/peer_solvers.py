"""Solvers of ordinary differential equations for Python: scipy, CVODE (by scikit-sundae) and diffrax.

scipy and CVODE call a compiled right-hand side; diffrax compiles the whole loop from the equations. All are timed
without intermediate output, and run a second time with dense output for the error.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from evidence.physics.reference import derivatives, make_right_side, new_rate, push_and_turn
from evidence.physics.work_precision import Solution, Solver
from netboard.benchmarks.harness.running import timed
from netboard.benchmarks.physics.problem import Array, Model, Problem, drive_waves

SCIPY = {
    "RK45": (1e-3, 1e-5, 1e-7, 1e-9),
    "DOP853": (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-12),
    "LSODA": (1e-4, 1e-6, 1e-8, 1e-10, 1e-12),
    "Radau": (1e-4, 1e-6, 1e-8),
    "BDF": (1e-4, 1e-6, 1e-8),
}
CVODE = {"Adams": (1e-4, 1e-6, 1e-8, 1e-10, 1e-12), "BDF": (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)}
DIFFRAX = {
    "Tsit5": (1e-3, 1e-5, 1e-7, 1e-9, 1e-11),
    "Dopri8": (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13),
    "Kvaerno5": (1e-4, 1e-6, 1e-8),
}
COARSE: dict[str, tuple[float, ...]] = {"DOP853": (1e-6,), "LSODA": (1e-6, 1e-10)}
"""Solvers of a quick run."""

_ABSOLUTE = 0.01
"""Absolute tolerance over the relative one; the states are between 0.01 and 1 [1]."""

_MANY = 10_000_000
_EVALUATIONS = 10_000


def scipy_solvers(problem: Problem, coarse: bool) -> list[Solver]:
    """Return the solvers of scipy."""
    return _solvers("scipy", COARSE if coarse else SCIPY, partial(_solve_scipy, problem, new_rate(problem)))


def cvode_solvers(problem: Problem, coarse: bool) -> list[Solver]:
    """Return the solvers of CVODE."""
    right_side = make_right_side(problem.parts)
    waves, scene = problem.waves, problem.scene

    def rate(t: float, x: Array, out: Array) -> None:
        right_side(t, x, waves, scene, out)

    chosen = {name: tolerances[: 1 if coarse else None] for name, tolerances in CVODE.items()}
    return _solvers("CVODE", chosen, partial(_solve_cvode, problem, rate))


def diffrax_solvers(problem: Problem, coarse: bool) -> list[Solver]:
    """Return the solvers of diffrax."""
    found = _solvers("diffrax", DIFFRAX, partial(_solve_diffrax, problem))
    return [replace(one, input_ns=_diffrax_input_ns()) for one in found[: 1 if coarse else None]]


def _solvers(
    library: str, methods: Mapping[str, tuple[float, ...]], solve: Callable[[str, float, bool], Any]
) -> list[Solver]:
    """Return a solver for each method and tolerance; `solve` keeps the states or not."""
    return [
        Solver(
            library,
            method,
            f"rtol {tolerance:.0e}",
            partial(solve, method, tolerance, True),
            partial(solve, method, tolerance, False),
            inputs=True,
        )
        for method, tolerances in methods.items()
        for tolerance in tolerances
    ]


def _solve_scipy(problem: Problem, rate: Any, method: str, tolerance: float, keep: bool) -> Solution | None:
    solution = solve_ivp(
        rate,
        (0.0, problem.times[-1]),
        problem.first,
        method=method,
        t_eval=problem.times if keep else None,
        rtol=tolerance,
        atol=_ABSOLUTE * tolerance,
    )
    if not keep:
        return None
    return Solution(np.ascontiguousarray(solution.y.T), 1, 0, solution.nfev)


def _solve_cvode(problem: Problem, rate: Any, method: str, tolerance: float, keep: bool) -> Solution | None:
    from sksundae import cvode

    solver = cvode.CVODE(rate, method=method, rtol=tolerance, atol=_ABSOLUTE * tolerance, max_num_steps=_MANY)
    first = np.array(problem.first)
    if not keep:
        solver.init_step(0.0, first)
        solver.step(problem.times[-1])
        return None
    solution = solver.solve(problem.times, first)
    return Solution(np.ascontiguousarray(solution.y), 1, 0, int(solution.nfev))


def _solve_diffrax(problem: Problem, method: str, tolerance: float, keep: bool) -> Solution | None:
    states, steps, stages = _diffrax_solver(problem.model, method, keep)(
        np.array(problem.first), problem.times, tolerance
    )
    if not keep:
        states.block_until_ready()
        return None
    return Solution(np.array(states), 1, int(steps), int(steps) * stages)


@cache
def _diffrax_solver(model: Model, method: str, keep: bool) -> Callable[..., tuple[Any, Any, int]]:
    """Compile a solver of diffrax for a model, with any initial state, times and tolerance."""
    import diffrax
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    physics = Problem(model, "cold").physics
    waves = drive_waves(physics).tolist()
    solver = getattr(diffrax, method)()

    def rate(t: Any, x: Any, _: Any) -> Any:
        push, turn = push_and_turn(waves, t, jnp.sin)
        return jnp.stack(derivatives(physics, x, push, turn, jnp.sin, jnp.cos))

    def solve(first: Any, times: Any, tolerance: Any) -> Any:
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(rate),
            solver,
            times[0],
            times[-1],
            None,
            first,
            saveat=diffrax.SaveAt(ts=times) if keep else diffrax.SaveAt(t1=True),
            stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=_ABSOLUTE * tolerance),
            max_steps=_MANY,
        )
        return solution.ys, solution.stats["num_steps"]

    stages: int = len(solver.tableau.c) + 1 if hasattr(solver, "tableau") else 1
    compiled = jax.jit(solve)
    return lambda first, times, tolerance: (*compiled(first, times, tolerance), stages)


@cache
def _diffrax_input_ns() -> float:
    """Return the cost of one evaluation of the hands compiled by jax [ns]."""
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    waves = Problem("paper", "cold").waves.tolist()

    def evaluate(count: Any) -> Any:
        def add(i: Any, sums: Any) -> Any:
            push, turn = push_and_turn(waves, 1e-3 * i, jnp.sin)
            return sums[0] + push, sums[1] + turn

        return jax.lax.fori_loop(0, count, add, (0.0, 0.0))

    compiled = jax.jit(evaluate)

    def evaluations() -> None:
        compiled(_EVALUATIONS)[0].block_until_ready()

    evaluations()
    return min(timed(evaluations) for _ in range(5)) / _EVALUATIONS * 1e9
