"""Netboard's methods under comparison: one-step methods with several step lengths, and collocation.

The hands at the method's nodes and the method's tables are computed before the timed run. States are known at the ends
of steps only, so steps longer than the grid of the reference coincide with fewer of its points.
"""

from collections.abc import Callable
from functools import cache, partial
from math import gcd
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evidence.physics.collocation import Tables, gauss_nodes, make_collocation, make_tables
from evidence.physics.work_precision import OURS, Solution, Solver
from netboard.benchmarks.physics.problem import SPACING, Array, Problem, drives_at, multiples, node_times
from netboard.physics.methods.catalogue import METHODS, NUMBER, Method
from netboard.physics.methods.march import TimeGrid, make_grid, make_march, run
from netboard.physics.scene.parameters import SCENE, Parts

STEPS = (0.020, 0.010, 0.005, 0.004, 0.002, 0.001, 0.0005, 0.00025)
"""Step lengths of the one-step methods [s]."""

QUICK_STEPS = (0.005, 0.004, 0.002, 0.001, 0.0005)
QUICK_METHODS = ("semi_implicit", "rk4", "dop853")

COLLOCATION = {
    4: ((0.1, 0.05, 0.04, 0.02, 0.01, 0.004, 0.002), (1e-4, 1e-6, 1e-9, 1e-12)),
    8: ((0.1, 0.05, 0.04, 0.02, 0.01, 0.005, 0.004, 0.002), (1e-5, 1e-8, 1e-11, 1e-14)),
    16: ((0.1, 0.05, 0.04, 0.02, 0.01), (1e-11, 1e-14)),
}
"""By the number of nodes: step lengths, and the change of position at which the iteration ends [s, m]."""

QUICK_COLLOCATION = {8: ((0.1, 0.05, 0.04, 0.02, 0.01, 0.005), (1e-5, 1e-8, 1e-11, 1e-14))}

OPENING, OPENING_STEPS = 0.1, (0.005, 0.0025, 0.002)
"""Opening of a cold run, in which the initial transient decays: its duration and its shorter steps [s]."""


def meeting(h: float) -> tuple[int, int]:
    """Return after how many steps, and how many points of the reference, the two grids coincide again."""
    step, spacing = round(h * 1e6), round(SPACING * 1e6)
    common = step * spacing // gcd(step, spacing)
    return common // step, common // spacing


# --- one-step methods --------------------------------------------------------------------------------------------


def one_step_solvers(problem: Problem, quick: bool) -> list[Solver]:
    """Return netboard's one-step methods, each with all step lengths."""
    steps = QUICK_STEPS if quick else STEPS
    return [
        Solver(
            OURS,
            method.name,
            f"{h * 1e3:g} ms",
            partial(_solve, problem, method, h),
            _march(problem, method, h, False),
            inputs=False,
            dense=_march(problem, method, h, True) if h <= SPACING else None,
        )
        for method in METHODS
        if method.name in (QUICK_METHODS if quick else NUMBER.keys() - {"exact"})  # that one is for a level board
        for h in steps
        if _divides(h, problem.duration)
    ]


def _divides(h: float, duration: float) -> bool:
    """Return whether a run is a whole number of steps."""
    return abs(round(duration / h) * h - duration) < 1e-9


def _hands(problem: Problem, method: Method, h: float) -> tuple[TimeGrid, Array]:
    """Return the grid of steps, and the drives of the hands at the method's nodes."""
    count = round(problem.duration / h)
    grid = make_grid(method.name, np.full(count, h), np.ones(count, np.int64), problem.parts, 6, problem.scene)
    return grid, drives_at(problem.waves, node_times(multiples(count, h), h, method.nodes))


def _solve(problem: Problem, method: Method, h: float) -> Solution:
    """Solve by a one-step method; keep the states at points of the reference."""
    grid, hands = _hands(problem, method, h)
    states = run(method.name, problem.first, hands, grid, problem.parts, problem.scene)
    every, stride = meeting(h)
    return Solution(np.ascontiguousarray(states[::every]), stride, len(hands), hands.shape[0] * hands.shape[1])


def one_step_solution(problem: Problem, method: str, h: float) -> Array:
    """Solve a problem by a one-step method with a step that divides the spacing of the reference."""
    return _solve(problem, METHODS[NUMBER[method]], h).states


def _march(problem: Problem, method: Method, h: float, keep: bool) -> Callable[[], object]:
    """Prepare a run that keeps all states, or none."""

    def prepared() -> Callable[[], object]:
        grid, hands = _hands(problem, method, h)
        march = make_march(NUMBER[method.name], problem.parts)
        steps = grid.lengths, grid.counts, grid.kinds, grid.tables
        return partial(march, problem.first, hands, *steps, problem.scene, np.empty((len(hands) + 1 if keep else 0, 6)))

    return _prepared_once(prepared)


def _prepared_once(prepare: Callable[[], Callable[[], object]]) -> Callable[[], object]:
    """Return a run that is prepared at its first call."""
    prepared = cache(prepare)

    def run_prepared() -> object:
        return prepared()()

    return run_prepared


# --- collocation -------------------------------------------------------------------------------------------------


def collocation_solvers(problem: Problem, quick: bool) -> list[Solver]:
    """Return exponential collocation with several numbers of nodes, step lengths and tolerances."""
    found = []
    for nodes, (steps, tolerances) in (QUICK_COLLOCATION if quick else COLLOCATION).items():
        for h in steps:
            for tolerance in tolerances:
                if _divides(h, problem.duration):
                    found.append(_collocation(problem, nodes, ((h, problem.duration),), tolerance))
                rest = problem.duration - OPENING
                if problem.start == "cold" and nodes == 8 and h > max(OPENING_STEPS) and rest > 0 and _divides(h, rest):
                    found += [
                        _collocation(problem, nodes, ((short, OPENING), (h, rest)), tolerance)
                        for short in OPENING_STEPS
                    ]
    return found


Segments = tuple[tuple[float, float], ...]
"""Step lengths, and the duration over which each is used [s, s]."""


def _collocation(problem: Problem, nodes: int, segments: Segments, tolerance: float) -> Solver:
    opening = ", short steps first" if len(segments) > 1 else ""
    setting = " then ".join(f"{h * 1e3:g} ms" for h, _ in segments) + f", tol {tolerance:.0e}"
    chain = partial(_chain, problem, nodes, segments, tolerance)
    return Solver(
        OURS,
        f"collocation {nodes}{opening}",
        setting,
        partial(_collocate, problem, nodes, segments, tolerance),
        _prepared_once(partial(chain, keep=False)),
        inputs=False,
        dense=_prepared_once(partial(chain, keep=True)) if max(h for h, _ in segments) <= SPACING else None,
    )


def _collocate(problem: Problem, nodes: int, segments: Segments, tolerance: float) -> Solution:
    """Solve by collocation; keep the states at equally spaced points of the reference."""
    outs = _chain(problem, nodes, segments, tolerance, keep=True)()
    stride = meeting(segments[-1][0])[1]
    steps = sum(round(length / h) for h, length in segments)
    kept = [outs[0][:1]]
    for (h, _), out in zip(segments, outs, strict=True):
        kept.append(out[1:][stride // meeting(h)[1] - 1 :: stride // meeting(h)[1]])
    return Solution(np.concatenate(kept), stride, steps, steps * nodes)


def _chain(
    problem: Problem, nodes: int, segments: Segments, tolerance: float, *, keep: bool
) -> Callable[[], list[NDArray[Any]]]:
    """Prepare a run of all segments, each of which starts from the last state of the one before."""
    march = make_collocation(problem.parts, 6, nodes)
    inner = tuple(float(node) for node in gauss_nodes(nodes))
    runs, outs, begin = [], [], 0.0
    for h, length in segments:
        count = round(length / h)
        hands = drives_at(problem.waves, node_times(begin + multiples(count, h), h, inner))
        tables = _tables(problem.parts, problem.scene.tobytes(), h, nodes)
        every = meeting(h)[0] if keep else count
        outs.append(np.empty((count // every + 1, 6)))
        arguments = (hands, tolerance / (h * h), *vars(tables).values(), problem.scene, every, outs[-1])
        runs.append(arguments)
        begin += length

    def chain() -> list[NDArray[Any]]:
        x = problem.first
        for arguments, out in zip(runs, outs, strict=True):
            march(x, *arguments)
            x = tuple(out[-1].tolist())
        return outs

    return chain


@cache
def _tables(parts: Parts, scene: bytes, h: float, nodes: int) -> Tables:
    return make_tables(parts, np.frombuffer(scene, SCENE)[0], 6, h, nodes)
