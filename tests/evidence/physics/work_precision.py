"""Work-precision comparison: cost over error of netboard's methods and of other libraries on the same problem.

All solvers have the same equations, start, hands and reference. The error of a signal is the largest one at the points
of a grid over the whole run, divided by the signal's largest value (E: the worst of the four). Warm-up and compilation
are timed separately. Costs are processor time, and repeats are interleaved, so that a busy machine affects all solvers
alike. Costs are minima over the repeats; medians and quartiles are kept too. To evaluate the movement of the hands
costs more than the physics, so each solver counts how often it evaluates the hands, or reads them from a table:
"physics" excludes that cost, "whole" includes it, and "dense" is "physics" with the states kept at all points of the
grid; otherwise a method with long steps yields states at fewer points.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from math import exp, inf, isnan, log, nan
from operator import attrgetter
from statistics import median
from time import perf_counter, process_time

import numpy as np

from evidence.physics.reference import Reference, errors_of
from netboard.benchmarks.harness.running import Tell, in_turns, no_progress, timed
from netboard.benchmarks.physics.problem import SPACING, Array, Problem, drives_at

OURS = "netboard"


@dataclass(frozen=True)
class Solution:
    """A solver's solution of a problem.

    - `states` (shape (n, 6)): at every `stride`-th of `Problem.times` [SI].
    - `calls`: number of evaluations of the hands, or of reads from a table [1].
    """

    states: Array
    stride: int
    steps: int
    calls: int


@dataclass(frozen=True)
class Solver:
    """A solver with one setting.

    - `solve`: solves the problem once and keeps the states, for the error.
    - `bare`: solves it without keeping states, for the cost.
    - `inputs`: `bare` evaluates the hands; otherwise it reads them from a table, or they are constant.
    - `alone`: the same number of steps without hands, if their cost cannot be separated otherwise.
    - `dense`: solves the problem and keeps the states at all of `Problem.times`, if the method can.
    - `input_ns`: cost of one evaluation of the hands, if it differs from that of compiled code [ns].
    - `hands`: evaluates the hands as often as `bare` does, and nothing else, if that cost is to be measured in turns.
    """

    library: str
    method: str
    setting: str
    solve: Callable[[], Solution]
    bare: Callable[[], object]
    inputs: bool
    alone: Callable[[], object] | None = None
    held: bool = False
    dense: Callable[[], object] | None = None
    share: float = 1.0
    input_ns: float = nan
    hands: Callable[[], object] | None = None


TARGETS = tuple(10.0**-i for i in range(2, 13))
"""Errors E at which costs are compared [1]."""

_EVALUATIONS = 10_000


@dataclass(frozen=True)
class Row:
    """Error and cost of a solver on a problem.

    - `calls`: number of evaluations of the hands; 0 if unknown [1].
    - `errors`: largest error of each of `SIGNALS` [m, rad, m, N].
    - `scaled`: E: the worst of them over the signal's largest value [1].
    - `warm_up`: duration of the first run, with compilation [s].
    - `physics`, `physics_median`: cost per second of simulated time without the evaluation of the hands, minimum and
      median [us].
    - `whole`, `whole_median`: the same with evaluating the hands [us].
    - `dense`, `dense_median`: as `physics`, for a run that also keeps the states every 2 ms; infinite if the method
      cannot [us].
    - `spread`: interquartile range of the timings over their median, without states [1].
    - `spacing`: distance of the points at which errors are measured [s].
    - `step_ns`: `physics` for each step; 0 if the number of steps is unknown [ns].
    """

    problem: str
    library: str
    method: str
    setting: str
    held: bool
    steps: int
    calls: int
    errors: tuple[float, ...]
    scaled: float
    turns: int
    warm_up: float
    physics: float
    physics_median: float
    whole: float
    whole_median: float
    dense: float
    spacing: float
    step_ns: float
    dense_median: float
    spread: float


Cost = Callable[[Row], float]


# --- measurement ---------------------------------------------------------------------------------------------------


def input_cost(problem: Problem) -> float:
    """Return the cost of one evaluation of the hands in compiled code."""
    times = np.linspace(0.0, problem.duration, _EVALUATIONS)
    drives_at(problem.waves, times)
    return min(timed(lambda: drives_at(problem.waves, times), process_time) for _ in range(20)) / _EVALUATIONS * 1e9


def measure(
    problem: Problem,
    reference: Reference,
    solvers: Sequence[Solver],
    repeats: int,
    budget: float,
    tell: Tell = no_progress,
    share: float = 0.0,
) -> list[Row]:
    """Solve a problem with each solver, and time them, interleaved."""
    solutions, warm_ups = [], []
    for solver in solvers:
        tell(f"{problem.name}: {solver.library} {solver.method}", share)
        start = perf_counter()
        solutions.append(solver.solve())
        solver.bare()
        warm_ups.append(perf_counter() - start)
    ns = input_cost(problem)
    tell(f"{problem.name}: timing", share)
    runs = [run for one in solvers for run in (one.bare, one.alone, one.dense, one.hands)]
    taken = _of_some(runs, repeats, budget)
    found = zip(solvers, solutions, warm_ups, *(taken[kind::4] for kind in range(4)), strict=True)
    return [_row(problem, reference, ns, *one) for one in found]


def _of_some(runs: Sequence[Callable[[], object] | None], repeats: int, budget: float) -> list[list[float]]:
    """Time the runs that exist, all in turns: a difference of two costs then holds for one state of the machine."""
    some = [run for run in runs if run is not None]
    for run in some:
        run()
    taken = iter(in_turns(some, repeats, budget, process_time))
    return [[] if run is None else next(taken) for run in runs]


def _row(
    problem: Problem,
    reference: Reference,
    ns: float,
    solver: Solver,
    solution: Solution,
    warm_up: float,
    bare: list[float],
    alone: list[float],
    dense: list[float],
    hands: list[float],
) -> Row:
    """Return error and cost from processor times without states, without hands, with dense states, and of hands alone.

    Lists are empty where a solver has no such run.

    - `ns`: cost of one evaluation of the hands in compiled code [ns].
    """
    errors = errors_of(problem, reference, solution.states, solution.stride)
    scale = 1e6 / problem.duration
    evaluated = solution.calls * (ns if isnan(solver.input_ns) else solver.input_ns) * 1e-9

    def costs(of: Callable[[list[float]], float]) -> tuple[float, float]:
        took = of(bare) / solver.share
        if not solver.inputs:
            return took * scale, (took + evaluated) * scale
        physics = of(alone) if alone else max(took - (of(hands) if hands else evaluated), 0.0)
        return physics * scale, took * scale

    physics, whole = costs(min)
    physics_median, whole_median = costs(median)
    return Row(
        problem=problem.name,
        library=solver.library,
        method=solver.method,
        setting=solver.setting,
        held=solver.held,
        steps=solution.steps,
        calls=solution.calls,
        errors=tuple(errors.tolist()),
        scaled=float((errors / reference.scales).max()),
        turns=len(bare),
        warm_up=warm_up,
        physics=physics,
        physics_median=physics_median,
        whole=whole,
        whole_median=whole_median,
        dense=physics + (min(dense) - min(bare)) * scale if dense else inf,
        spacing=solution.stride * SPACING,
        step_ns=physics / scale / solution.steps * 1e9 if solution.steps else 0.0,
        dense_median=physics_median + (median(dense) - median(bare)) * scale if dense else inf,
        spread=float(np.subtract(*np.quantile(bare, (0.75, 0.25)))) / median(bare),
    )


# --- comparison ---------------------------------------------------------------------------------------------------


COSTS: dict[str, Cost] = {name: attrgetter(name) for name in ("physics", "whole", "dense")}
"""Costs that are compared, by the name of the field."""

MEDIANS: dict[str, Cost] = {name: attrgetter(f"{name}_median") for name in COSTS}
"""Their medians."""

PHYSICS = COSTS["physics"]


def by_problem(rows: Iterable[Row]) -> dict[str, list[Row]]:
    """Return the rows of each problem."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(row.problem, []).append(row)
    return found


def frontier(rows: Iterable[Row], cost: Cost = PHYSICS) -> list[Row]:
    """Return the runs that no other beats in both error and cost (Pareto)."""
    best: list[Row] = []
    for row in sorted(rows, key=lambda row: (cost(row), row.scaled)):
        if cost(row) < inf and row.scaled < (best[-1].scaled if best else inf):
            best.append(row)
    return best


def cost_at(rows: Iterable[Row], error: float, cost: Cost = PHYSICS) -> float:
    """Return the cost of an error with one method, interpolated between its settings on logarithmic axes [us].

    It is the lowest cost if that run has a smaller error, and infinite if no run reaches the error.
    """
    curve = frontier(rows, cost)
    if not curve or curve[-1].scaled > error:
        return inf
    if curve[0].scaled <= error:
        return cost(curve[0])
    for worse, better in pairwise(curve):
        if better.scaled <= error:
            share = log(error / worse.scaled) / log(better.scaled / worse.scaled)
            return exp((1.0 - share) * log(cost(worse)) + share * log(cost(better)))
    return inf


def least_cost(rows: Iterable[Row], error: float, cost: Cost = PHYSICS) -> float:
    """Return the cost of an error with the best of several methods."""
    ordered = sorted(rows, key=lambda row: (row.library, row.method))
    curves = (list(curve) for _, curve in groupby(ordered, key=lambda row: (row.library, row.method)))
    return min((cost_at(curve, error, cost) for curve in curves), default=inf)


@dataclass(frozen=True)
class Comparison:
    """Cost over error of netboard's methods and of a library.

    - `ratios`: least costs at each of `TARGETS`, theirs over ours; None: neither reaches it, infinite: only ours [1].
    """

    problem: str
    library: str
    what: str
    ratios: tuple[float | None, ...]

    @property
    def beaten(self) -> bool:
        """Whether ours is cheaper at every error that the peer reaches."""
        return all(ratio is None or ratio > 1.0 for ratio in self.ratios)


def compare(rows: Sequence[Row], costs: Mapping[str, Cost] = COSTS) -> list[Comparison]:
    """Compare netboard with each library on each problem, with and without the cost of the hands."""
    found = []
    for problem, here in by_problem(rows).items():
        ours = [row for row in here if row.library == OURS]
        for library in dict.fromkeys(row.library for row in here if row.library != OURS):
            theirs = [row for row in here if row.library == library]
            for what, cost in costs.items():
                if what != "dense" or any(cost(row) < inf for row in theirs):
                    ratios = (
                        ratio(least_cost(ours, error, cost), least_cost(theirs, error, cost)) for error in TARGETS
                    )
                    found.append(Comparison(problem, library, what, tuple(ratios)))
    return found


def ratio(ours: float, theirs: float) -> float | None:
    """Return a ratio of costs; None if both are infinite."""
    if theirs == inf:
        return None if ours == inf else inf
    return theirs / ours
