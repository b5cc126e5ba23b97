"""Work and precision: what an error costs, method by method, ours beside other libraries' on the same problem.

The rules: the same equations, start, hands and reference for all; the error is the largest at the points of a grid over
the whole run, of each signal, and as a share of the signal's largest value (E: the worst of the four). Warm-up and
compilation are told apart. Repeats are interleaved: every contender has a turn before any has its next, so that a busy
machine is busy for all. Costs are of minima; medians are kept too. "Physics" leaves out what it takes to evaluate the
hands, "whole" has it for all.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby, pairwise
from math import exp, gcd, inf, isnan, log
from statistics import median
from time import perf_counter

import numpy as np

from netboard.methods.catalogue import METHODS, NUMBER, Method
from netboard.methods.march import Grid, make_grid, make_march, run
from netboard.studies.contender import OURS, Contender, Solution, timed
from netboard.studies.problem import SPACING, Array, Problem, Reference, drives_at, errors_of, multiples, node_times

STEPS = (0.020, 0.010, 0.005, 0.004, 0.002, 0.001, 0.0005, 0.00025, 0.000125)
"""Lengths of the one-step methods' steps [s]."""

QUICK_STEPS = (0.005, 0.004, 0.002, 0.001, 0.0005)
QUICK_METHODS = ("semi_implicit", "rk4", "dop853", "etdrk4")

TARGETS = tuple(10.0**-i for i in range(2, 13))
"""Errors E at which costs are compared [1]."""

SLICE = 0.004
"""A turn of a quick contender goes on for so long, so that a minimum is of many [s]."""

LEAST = 2
"""Turns that a slow contender has at the least [1]."""

_EVALUATIONS = 10_000


@dataclass(frozen=True)
class Row:
    """What a contender made of a problem, and at what cost.

    Attributes
    ----------
    problem, family, method, setting : str
        Which.
    held : bool
        Its hands did not change in a step.
    steps : int
        Steps taken; 0 where the library does not say [1].
    calls : int
        How often the hands were evaluated or read; 0 where it cannot be counted [1].
    errors : tuple of float
        Largest error of each of `SIGNALS` [m, rad, m, N].
    scaled : float
        E: the worst of them over the signal's largest value [1].
    turns : int
        How often it was timed [1].
    warm_up : float
        The first run, with whatever it compiled [s].
    physics, physics_median : float
        Cost without evaluating the hands, of the quickest and of the median run, for a second of simulated time [us].
    whole, whole_median : float
        The same with evaluating the hands [us].
    step_ns : float
        `physics` for each step; 0 where the steps are not known [ns].
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
    step_ns: float


Cost = Callable[[Row], float]


# --- our own methods ---------------------------------------------------------------------------------------------


def one_step_contenders(problem: Problem, quick: bool) -> list[Contender]:
    """Return our one-step methods, each with all lengths of step.

    Parameters
    ----------
    problem : Problem
        The problem.
    quick : bool
        Only some of them.

    Returns
    -------
    list of Contender
        Those whose steps fit into the run.
    """
    steps = QUICK_STEPS if quick else STEPS
    return [
        Contender(
            OURS, method.name, f"{h * 1e3:g} ms", partial(_solve, problem, method, h), _Bare(problem, method, h), False
        )
        for method in METHODS
        if _fits(problem, method) and (not quick or method.name in QUICK_METHODS)
        for h in steps
        if h <= problem.duration
    ]


def _fits(problem: Problem, method: Method) -> bool:
    """Say whether a method can do a problem: the exact one needs a board that cannot tilt."""
    return method.name != "exact" or not problem.parts.tilts


def _hands(problem: Problem, method: Method, h: float) -> tuple[Grid, Array]:
    """Return the steps of a run and the hands at the method's nodes in each."""
    count = round(problem.duration / h)
    grid = make_grid(method.name, np.full(count, h), np.ones(count, np.int64), problem.parts, 6, problem.scene)
    return grid, drives_at(problem.waves, node_times(multiples(count, h), h, method.nodes))


def _solve(problem: Problem, method: Method, h: float) -> Solution:
    """Run a method, and keep the states that meet points of the reference."""
    grid, hands = _hands(problem, method, h)
    states = run(method.name, problem.first, hands, grid, problem.parts, problem.scene)
    every, stride = meeting(h)
    return Solution(np.ascontiguousarray(states[::every]), stride, len(grid.lengths), hands.shape[0] * hands.shape[1])


def meeting(h: float) -> tuple[int, int]:
    """Return which steps meet which points of the reference.

    Parameters
    ----------
    h : float
        Length of the step, in whole microseconds [s].

    Returns
    -------
    every, stride : int
        Every so many steps, and every so many points [1].
    """
    step, spacing = round(h * 1e6), round(SPACING * 1e6)
    common = step * spacing // gcd(step, spacing)
    return common // step, common // spacing


class _Bare:
    """A run of a one-step method that keeps nothing; what it reads is made when it first runs.

    Parameters
    ----------
    problem : Problem
        The problem.
    method : Method
        The method.
    h : float
        Length of the step [s].
    """

    def __init__(self, problem: Problem, method: Method, h: float) -> None:
        self._problem, self._method, self._h = problem, method, h
        self._march: Callable[[], object] | None = None

    def __call__(self) -> None:
        if self._march is None:
            problem = self._problem
            grid, hands = _hands(problem, self._method, self._h)
            march = make_march(NUMBER[self._method.name], problem.parts)
            self._march = partial(
                march,
                problem.first,
                hands,
                grid.lengths,
                grid.counts,
                grid.kinds,
                grid.tables,
                problem.scene,
                np.empty((0, 6)),
            )
        self._march()


# --- measuring ---------------------------------------------------------------------------------------------------


def input_cost(problem: Problem) -> float:
    """Return what it costs compiled code to evaluate the hands once.

    Parameters
    ----------
    problem : Problem
        The problem.

    Returns
    -------
    float
        Of the quickest of many [ns].
    """
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
    """Let contenders solve a problem, and time them in turns.

    Parameters
    ----------
    problem : Problem
        The problem.
    reference : Reference
        Its solution.
    contenders : sequence of Contender
        Who takes part.
    repeats : int
        Turns of each [1].
    budget : float
        Who has taken this long has no further turn [s].
    progress : callable
        Gets the name of who is on.

    Returns
    -------
    list of Row
        One for each contender.
    """
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
    lonely = [contender for contender in contenders if contender.alone is not None]
    alone = dict(zip(lonely, in_turns([one.alone for one in lonely if one.alone], repeats, budget), strict=True))
    return [
        _row(problem, reference, contender, solution, warm_up, wall, alone.get(contender), ns)
        for contender, solution, warm_up, wall in zip(contenders, solutions, warm_ups, walls, strict=True)
    ]


def in_turns(runs: Sequence[Callable[[], object]], repeats: int, budget: float) -> list[list[float]]:
    """Time runs, each once before any is timed again.

    Parameters
    ----------
    runs : sequence of callable
        What to time.
    repeats : int
        Turns of each [1].
    budget : float
        What has taken this long has no further turn [s].

    Returns
    -------
    list of list of float
        Wall times of each [s].
    """
    times: list[list[float]] = [[] for _ in runs]
    for turn in range(repeats):
        for run_, taken in zip(runs, times, strict=True):
            if turn < LEAST or sum(taken) < budget:
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
    wall: list[float],
    alone: list[float] | None,
    ns: float,
) -> Row:
    """Put together what is known of a contender."""
    errors = errors_of(problem, reference, solution.states, solution.stride)
    scale = 1e6 / problem.duration
    hands = solution.calls * (ns if isnan(contender.input_ns) else contender.input_ns) * 1e-9

    def costs(of: Callable[[list[float]], float]) -> tuple[float, float]:
        took = of(wall) / contender.share
        if not contender.inputs:
            return took * scale, (took + hands) * scale
        bare = of(alone) if alone else max(took - hands, 0.0)
        return bare * scale, took * scale

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
        turns=len(wall),
        warm_up=warm_up,
        physics=physics,
        physics_median=physics_median,
        whole=whole,
        whole_median=whole_median,
        step_ns=physics / scale / solution.steps * 1e9 if solution.steps else 0.0,
    )


# --- comparing ---------------------------------------------------------------------------------------------------


def physics_cost(row: Row) -> float:
    """Return what a run costs without evaluating the hands.

    Parameters
    ----------
    row : Row
        The run.

    Returns
    -------
    float
        For a second of simulated time [us].
    """
    return row.physics


def whole_cost(row: Row) -> float:
    """Return what a run costs with evaluating the hands.

    Parameters
    ----------
    row : Row
        The run.

    Returns
    -------
    float
        For a second of simulated time [us].
    """
    return row.whole


def frontier(rows: Iterable[Row], cost: Cost = physics_cost) -> list[Row]:
    """Return the runs that no other beats in both error and cost (Pareto).

    Parameters
    ----------
    rows : iterable of Row
        Runs of one problem.
    cost : callable
        What a run costs.

    Returns
    -------
    list of Row
        From the cheapest to the most exact.
    """
    best: list[Row] = []
    for row in sorted(rows, key=lambda row: (cost(row), row.scaled)):
        if row.scaled < (best[-1].scaled if best else inf):
            best.append(row)
    return best


def cost_at(rows: Iterable[Row], error: float, cost: Cost = physics_cost) -> float:
    """Return what an error costs with one method, between its settings by a straight line of logarithms.

    Parameters
    ----------
    rows : iterable of Row
        Runs of one method on one problem.
    error : float
        E [1].
    cost : callable
        What a run costs.

    Returns
    -------
    float
        The cost; that of the cheapest if it is better than asked for, infinite if none is as good [us].
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


def least_cost(rows: Iterable[Row], error: float, cost: Cost = physics_cost) -> float:
    """Return what an error costs with the best of several methods.

    Parameters
    ----------
    rows : iterable of Row
        Runs of any methods on one problem.
    error : float
        E [1].
    cost : callable
        What a run costs.

    Returns
    -------
    float
        The least of `cost_at` [us].
    """
    ordered = sorted(rows, key=lambda row: (row.family, row.method))
    curves = (list(curve) for _, curve in groupby(ordered, key=lambda row: (row.family, row.method)))
    return min((cost_at(curve, error, cost) for curve in curves), default=inf)


@dataclass(frozen=True)
class Comparison:
    """What errors cost with us and with a peer.

    Attributes
    ----------
    problem, family : str
        Which problem, and which library.
    what : str
        ``physics`` or ``whole``.
    errors : tuple of float
        The values of E [1].
    ours, theirs : tuple of float
        Least costs; infinite where that error is not reached [us].
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
    """Compare our methods with each peer, problem by problem, with and without the cost of the hands.

    Parameters
    ----------
    rows : sequence of Row
        All runs.

    Returns
    -------
    list of Comparison
        Peers in their order.
    """
    found = []
    for problem in dict.fromkeys(row.problem for row in rows):
        here = [row for row in rows if row.problem == problem]
        ours = [row for row in here if row.family == OURS]
        for family in dict.fromkeys(row.family for row in here if row.family != OURS):
            theirs = [row for row in here if row.family == family]
            for what, cost in (("physics", physics_cost), ("whole", whole_cost)):
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
