"""heyoka (https://bluescarni.github.io/heyoka.py): an adaptive Taylor method, compiled for the problem.

It is the fastest library in the comparison, and with 80 bits it gives the reference. The hands are part of its
expressions, so their cost cannot be subtracted by counting calls. It follows from a second system with constant drives,
run for the same number of steps.
"""

from collections.abc import Callable, Sequence
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evidence.physics.reference import derivatives, push_and_turn
from evidence.physics.work_precision import Solution, Solver
from netboard.base.tables.scene import Physics
from netboard.benchmarks.physics.problem import STATE_NAMES, Problem

LIBRARY = "heyoka"
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-14)
COARSE = (1e-3, 1e-6, 1e-9, 1e-12)
TIGHTEST = 1e-19
"""Tolerance of the reference, about the last bit of 80 [1]."""

_ALONE = (0.0, 0.0, 0.0, 0.0, 1e-3, 0.0)
"""First state of a run without hands: the ball a little off the centre, so that no term vanishes."""


def installed() -> bool:
    """Return whether the library is installed."""
    return find_spec(LIBRARY) is not None


def precise(problem: Problem) -> NDArray[np.longdouble]:
    """Solve a problem with 80 bits."""
    integrator = _make(problem, TIGHTEST, np.longdouble)
    states: NDArray[np.longdouble] = integrator.propagate_grid(problem.times.astype(np.longdouble))[-1]
    return states


def solvers(problem: Problem, coarse: bool) -> list[Solver]:
    """Return the solvers under comparison."""
    return [_solver(problem, tolerance) for tolerance in (COARSE if coarse else TOLERANCES)]


def precise_along(
    physics: Physics, start: tuple[float, ...], drives: NDArray[np.longdouble], lengths: NDArray[np.longdouble]
) -> NDArray[np.longdouble]:
    """Solve with 80 bits under drives that are cubics in each interval; return the states at the ends of intervals.

    - `drives` (shape (n, 2, 4)): cubics of the left and of the right drive from the start of each interval [SI].
    - `lengths` (shape (n,)): of the intervals [s].
    """
    import heyoka

    t, x = heyoka.time, heyoka.make_vars(*STATE_NAMES)
    push, turn = heyoka.par[3], heyoka.par[7]
    for k in (2, 1, 0):  # powers of 0 are not finite in heyoka
        push, turn = heyoka.par[k] + t * push, heyoka.par[4 + k] + t * turn
    rates = derivatives(physics, x, push, turn, heyoka.sin, heyoka.cos)
    first: NDArray[Any] = np.array(start, dtype=np.longdouble)
    kind = {"tol": np.longdouble(TIGHTEST), "fp_type": np.longdouble}
    integrator = heyoka.taylor_adaptive([*zip(x, rates, strict=True)], state=first, **kind)
    left, right = drives[:, 0], drives[:, 1]
    states = np.empty((len(lengths) + 1, len(start)), dtype=np.longdouble)
    states[0] = first
    for i, both in enumerate(np.concatenate([left + right, right - left], axis=1)):
        integrator.time = np.longdouble(0)
        integrator.pars[:] = both
        integrator.propagate_until(lengths[i])
        states[i + 1] = integrator.state
    return states


def _make(problem: Problem, tolerance: float, kind: type = float, hands: bool = True) -> Any:
    """Compile an integrator; without hands, their drives are parameters with value 0."""
    import heyoka

    x = heyoka.make_vars(*STATE_NAMES)
    push, turn = heyoka.par[0], heyoka.par[1]
    if hands:
        push, turn = push_and_turn(problem.waves.tolist(), heyoka.time, heyoka.sin)
    rates = derivatives(problem.physics, x, push, turn, heyoka.sin, heyoka.cos)
    first: NDArray[Any] = np.array(problem.first if hands else _ALONE, dtype=kind)
    return heyoka.taylor_adaptive([*zip(x, rates, strict=True)], state=first, tol=kind(tolerance), fp_type=kind)


def _solver(problem: Problem, tolerance: float) -> Solver:
    """Return a solver; its integrators are compiled when it first runs."""
    made: dict[str, Any] = {}

    def integrator() -> Any:
        if "whole" not in made:
            made["whole"] = _make(problem, tolerance)
        return _rewound(made["whole"], problem.first)

    def alone() -> object:
        return made["alone"]()

    def bare() -> int:
        steps: int = integrator().propagate_until(problem.duration)[3]
        return steps

    def dense() -> NDArray[np.float64]:
        states: NDArray[np.float64] = integrator().propagate_grid(problem.times)[-1]
        return states

    def solve() -> Solution:
        states = np.ascontiguousarray(dense())
        steps = bare()
        alone = _make(problem, tolerance, hands=False)
        made["alone"] = partial(_run_alone, alone, problem.duration, problem.duration / steps)
        return Solution(states, 1, steps, 0)

    return Solver(LIBRARY, "Taylor", f"tol {tolerance:.0e}", solve, bare, True, alone, dense=dense)


def runs_along(problem: Problem, tolerance: float, grids: Sequence[NDArray[np.float64]]) -> list[Callable[[], object]]:
    """Return a run for each grid of times at which states are kept; for an empty grid, without states."""
    integrator = _make(problem, tolerance)

    def run(times: NDArray[np.float64]) -> object:
        rewound = _rewound(integrator, problem.first)
        return rewound.propagate_grid(times) if len(times) else rewound.propagate_until(problem.duration)

    return [partial(run, times) for times in grids]


def _rewound(integrator: Any, state: tuple[float, ...]) -> Any:
    integrator.time = 0.0
    integrator.state[:] = state
    return integrator


def _run_alone(integrator: Any, duration: float, longest: float) -> object:
    """Run an integrator without hands, in steps no longer than those it made with them."""
    return _rewound(integrator, _ALONE).propagate_until(duration, max_delta_t=longest)
