"""Work-precision comparison: cost over error of netboard's methods and of other libraries on the same problem.

All solvers have the same equations, start, hands and reference. The error of a signal is the largest one at the points
of a grid over the whole run, divided by the signal's largest value (E: the worst of the four). Warm-up and compilation
are timed separately. Repeats are interleaved: every solver has a turn before any has its next, so that a busy machine
affects all. Costs are of minima; medians are kept too. "Physics" leaves out what it takes to evaluate the
hands, "whole" has it for all, "dense" is physics with the states kept at all points of the grid: without, a method with
long steps is asked only for the points that its steps meet.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from math import exp, inf, isnan, log
from operator import attrgetter
from statistics import median
from time import perf_counter

import numpy as np

from netboard.benchmarks.physics.problem import SPACING, Problem, Reference, drives_at, errors_of
from netboard.benchmarks.physics.solver import OURS, Contender, Solution, timed

TARGETS = tuple(10.0**-i for i in range(2, 13))
"""Errors E at which costs are compared [1]."""

SLICE = 0.004
"""Shortest duration of a turn; a fast solver runs several times in it [s]."""

_EVALUATIONS = 10_000


@dataclass(frozen=True)
class Row:
    """Error and cost of a solver on a problem.

    - `calls`: number of evaluations of the hands; 0 if unknown [1].
    - `errors`: largest error of each of `SIGNALS` [m, rad, m, N].
    - `scaled`: E: the worst of them over the signal's largest value [1].
    - `warm_up`: duration of the first run, with compilation [s].
    - `physics`, `physics_median`: cost without evaluating the hands, of the fastest and of the median run, for a second
      of simulated time [us].
    - `whole`, `whole_median`: the same with evaluating the hands [us].
    - `dense`: as `physics`, of a run that also keeps the states 2 ms apart; infinite if the method has none [us].
    - `spacing`: distance of the points at which errors are measured [s].
    - `step_ns`: `physics` for each step; 0 if the number of steps is unknown [ns].
    """

    problem: str
    family: str
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


Cost = Callable[[Row], float]


# --- measuring ---------------------------------------------------------------------------------------------------


def input_cost(problem: Problem) -> float:
    """Return the cost of one evaluation of the hands in compiled code."""
    times = np.linspace(0.0, problem.duration, _EVALUATIONS)
    drives_at(problem.waves, times)
    return min(timed(lambda: drives_at(problem.waves, times)) for _ in range(20)) / _EVALUATIONS * 1e9


def measure(
    problem: Problem,
    reference: Reference,
    contenders: Sequence[Contender],
    repeats: int,
    budget: float,
    progress: Callable[[str], object] = lambda name: None,
) -> list[Row]:
    """Solve a problem with each solver, and time them in turns."""
    solutions, warm_ups = [], []
    for contender in contenders:
        progress(f"{problem.name}: {contender.family} {contender.method}")
        start = perf_counter()
        solutions.append(contender.solve())
        contender.bare()
        warm_ups.append(perf_counter() - start)
    ns = input_cost(problem)
    progress(f"{problem.name}: timing")
    walls = in_turns([contender.bare for contender in contenders], repeats, budget)
    alone = _of_some([contender.alone for contender in contenders], repeats, budget)
    dense = _of_some([contender.dense for contender in contenders], repeats, budget)
    return [
        _row(problem, reference, contender, solution, warm_up, Times(wall, lonely, gridded), ns)
        for contender, solution, warm_up, wall, lonely, gridded in zip(
            contenders, solutions, warm_ups, walls, alone, dense, strict=True
        )
    ]


@dataclass(frozen=True)
class Times:
    """Wall times of a solver: nothing kept, without hands, with the states of all points; empty if not run [s]."""

    bare: list[float]
    alone: list[float]
    dense: list[float]


def _of_some(runs: Sequence[Callable[[], object] | None], repeats: int, budget: float) -> list[list[float]]:
    """Time the runs that exist, in turns."""
    some = [run for run in runs if run is not None]
    for run in some:
        run()
    taken = iter(in_turns(some, repeats, budget))
    return [[] if run is None else next(taken) for run in runs]


def in_turns(runs: Sequence[Callable[[], object]], repeats: int, budget: float) -> list[list[float]]:
    """Time runs, each once before any is timed again."""
    times: list[list[float]] = [[] for _ in runs]
    for turn in range(repeats):
        for run_, taken in zip(runs, times, strict=True):
            if turn == 0 or sum(taken) < budget:
                taken.append(timed(run_))
                slice_ = taken[-1]
                while slice_ < SLICE:
                    taken.append(timed(run_))
                    slice_ += taken[-1]
    return times


def _row(
    problem: Problem,
    reference: Reference,
    contender: Contender,
    solution: Solution,
    warm_up: float,
    times: Times,
    ns: float,
) -> Row:
    """Collect the results of a solver."""
    errors = errors_of(problem, reference, solution.states, solution.stride)
    scale = 1e6 / problem.duration
    hands = solution.calls * (ns if isnan(contender.input_ns) else contender.input_ns) * 1e-9

    def costs(of: Callable[[list[float]], float]) -> tuple[float, float]:
        took = of(times.bare) / contender.share
        if not contender.inputs:
            return took * scale, (took + hands) * scale
        physics = of(times.alone) if times.alone else max(took - hands, 0.0)
        return physics * scale, took * scale

    physics, whole = costs(min)
    physics_median, whole_median = costs(median)
    return Row(
        problem=problem.name,
        family=contender.family,
        method=contender.method,
        setting=contender.setting,
        held=contender.held,
        steps=solution.steps,
        calls=solution.calls,
        errors=tuple(errors.tolist()),
        scaled=float((errors / reference.scales).max()),
        turns=len(times.bare),
        warm_up=warm_up,
        physics=physics,
        physics_median=physics_median,
        whole=whole,
        whole_median=whole_median,
        dense=physics + (min(times.dense) - min(times.bare)) * scale if times.dense else inf,
        spacing=solution.stride * SPACING,
        step_ns=physics / scale / solution.steps * 1e9 if solution.steps else 0.0,
    )


# --- comparing ---------------------------------------------------------------------------------------------------


COSTS: dict[str, Cost] = {name: attrgetter(name) for name in ("physics", "whole", "dense")}
"""Costs that are compared, by the name of the field."""

PHYSICS = COSTS["physics"]


def frontier(rows: Iterable[Row], cost: Cost = PHYSICS) -> list[Row]:
    """Return the runs that no other beats in both error and cost (Pareto)."""
    best: list[Row] = []
    for row in sorted(rows, key=lambda row: (cost(row), row.scaled)):
        if cost(row) < inf and row.scaled < (best[-1].scaled if best else inf):
            best.append(row)
    return best


def cost_at(rows: Iterable[Row], error: float, cost: Cost = PHYSICS) -> float:
    """Return what an error costs with one method, between its settings by a straight line of logarithms [us].

    It is that of the cheapest if that is better than asked for, infinite if none is as good.
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
    """Return what an error costs with the best of several methods."""
    ordered = sorted(rows, key=lambda row: (row.family, row.method))
    curves = (list(curve) for _, curve in groupby(ordered, key=lambda row: (row.family, row.method)))
    return min((cost_at(curve, error, cost) for curve in curves), default=inf)


@dataclass(frozen=True)
class Comparison:
    """Cost over error of netboard's methods and of a library.

    - `ours`, `theirs`: least costs; infinite where that error is not reached [us].
    """

    problem: str
    family: str
    what: str
    errors: tuple[float, ...]
    ours: tuple[float, ...]
    theirs: tuple[float, ...]

    @property
    def ratios(self) -> tuple[float | None, ...]:
        """How many times cheaper ours is at each error; None: neither reaches it, infinite: only ours does."""
        return tuple(
            None if a == b == inf else (inf if b == inf else b / a) for a, b in zip(self.ours, self.theirs, strict=True)
        )

    @property
    def beaten(self) -> bool:
        """Ours is cheaper at every error that the peer reaches."""
        return all(ratio is None or ratio > 1.0 for ratio in self.ratios)


def compare(rows: Sequence[Row]) -> list[Comparison]:
    """Compare our methods with each peer, problem by problem, with and without the cost of the hands."""
    found = []
    for problem in dict.fromkeys(row.problem for row in rows):
        here = [row for row in rows if row.problem == problem]
        ours = [row for row in here if row.family == OURS]
        for family in dict.fromkeys(row.family for row in here if row.family != OURS):
            theirs = [row for row in here if row.family == family]
            for what, cost in COSTS.items():
                if what == "dense" and not any(row.dense < inf for row in theirs):
                    continue
                found.append(
                    Comparison(
                        problem,
                        family,
                        what,
                        TARGETS,
                        tuple(least_cost(ours, error, cost) for error in TARGETS),
                        tuple(least_cost(theirs, error, cost) for error in TARGETS),
                    )
                )
    return found
