"""Netboard's Taylor method under comparison: one interval without joints, and the hands expanded at each of its steps.

The kernels are those of `netboard simulate`, compiled a second time with fused multiply-adds, and with sines for hands
instead of polynomials. The cost of expanding the hands is measured alone, for as many steps of the same order, and
in turns.
"""

from collections.abc import Callable
from functools import cache, partial
from typing import Any

import numpy as np

from evidence.physics.work_precision import OURS, Solution, Solver
from netboard.base.compiled import borrowed, fast, inlined, relaxed
from netboard.benchmarks.physics.problem import Array, Problem
from netboard.physics.arithmetic.trig import sincos
from netboard.physics.methods.taylor import expand_drives, march_by_series, order_for
from netboard.physics.scene.parameters import Parts
from netboard.physics.scene.series import LEFT, RIGHT, table_of

TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13, 1e-14, 1e-15, 1e-16)
QUICK_TOLERANCES = (1e-3, 1e-6, 1e-9, 1e-12, 1e-15)


@inlined
def expand_waves(waves: Any, i: int, t: float, order: int, table: Any) -> None:
    """Write the coefficients of both drives, which are sums of sines, from a time on."""
    for k in range(order + 1):
        table[LEFT + k], table[RIGHT + k] = 0.0, 0.0
    for j in range(6):
        half, rate = 0.5 * waves[j, 0], waves[j, 1]
        s, c = sincos(rate * t + waves[j, 2])
        s, c, sign = half * s, half * c, -1.0 if j > 2 else 1.0
        for k in range(order + 1):
            table[LEFT + k] += sign * s
            table[RIGHT + k] += s
            step = rate * (1.0 / (k + 1))
            s, c = step * c, -step * s


_march = relaxed(march_by_series, {expand_drives: expand_waves})
_expand = relaxed(expand_waves, {})


@cache
def make_taylor_of_waves(PARTS: Parts) -> Callable[..., tuple[Any, int, float]]:
    """Compile `netboard.physics.methods.taylor.march_by_series` for hands that are sums of sines."""

    @fast
    def march(
        x: Any,
        waves: Any,
        lengths: Any,
        ends: Any,
        moments: Any,
        tolerance: float,
        order: int,
        scene: Any,
        table: Any,
        out: Any,
    ) -> Any:
        waves, table = borrowed(waves), borrowed(table)
        return _march(x, waves, lengths, ends, moments, tolerance, order, PARTS, scene[0], table, out)

    return march


@fast
def _expand_often(waves: Any, count: int, order: int, table: Any) -> None:
    for i in range(count):
        _expand(waves, 0, 1e-3 * i, order, table)


def taylor_solvers(problem: Problem, quick: bool) -> list[Solver]:
    """Return the Taylor method with all tolerances."""
    return [_solver(problem, tolerance) for tolerance in (QUICK_TOLERANCES if quick else TOLERANCES)]


def taylor_run(problem: Problem, tolerance: float) -> Callable[[Array], tuple[Array, int]]:
    """Return a run that keeps the states at the given times, and returns them with the number of steps."""
    order, march, table = order_for(tolerance), make_taylor_of_waves(problem.parts), table_of(6)
    lengths = np.array([problem.duration])

    def run(moments: Array) -> tuple[Array, int]:
        out, ends = np.empty((len(moments), 6)), np.array([len(moments)])
        arguments = problem.waves, lengths, ends, moments, tolerance, order, problem.scene, table, out
        return out, march(problem.first, *arguments)[1]

    return run


def _solver(problem: Problem, tolerance: float) -> Solver:
    run, times = taylor_run(problem, tolerance), problem.times[1:]
    order, table, made = order_for(tolerance), table_of(6), {"steps": 0}

    def solve() -> Solution:
        out, steps = run(times)
        made["steps"] = steps
        return Solution(np.concatenate(([problem.first], out)), 1, steps, steps)

    return Solver(
        OURS,
        "Taylor",
        f"tol {tolerance:.0e}",
        solve,
        partial(run, np.empty(0)),
        inputs=True,
        dense=partial(run, times),
        hands=lambda: _expand_often(problem.waves, made["steps"], order, table),
    )
