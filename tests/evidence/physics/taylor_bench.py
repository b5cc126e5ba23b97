"""``make evidence ARGS=taylor``: the Taylor method beside heyoka and MuJoCo, where states are kept, and under stress.

All solvers run in turns in one process, so that a busy machine slows all of them. Costs are processor time; ratios are
those of medians, or medians of the ratios of each turn. Parts: errors and costs with states kept every 2 ms and
without; costs by the distance of the states; simulations of sampled hands, beside `dop853`; trials of the paper's task,
beside 80 bits; many simulations in the lanes of registers; scenes and hands that make steps difficult.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from math import inf
from statistics import median
from time import process_time

import numpy as np

from evidence.physics import figures, peer_heyoka
from evidence.physics.bench import PEERS, find_reference
from evidence.physics.netboard_methods import one_step_solvers
from evidence.physics.netboard_taylor import taylor_run, taylor_solvers
from evidence.physics.parts import ratios_parts, runs_part
from evidence.physics.taylor_lanes import lanes_part
from evidence.physics.taylor_stress import stress_part
from evidence.physics.taylor_trials import QUICK_TRIALS, TRIALS, trials_part
from evidence.physics.work_precision import MEDIANS, Row, Solver, compare, measure
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Tell, in_turns
from netboard.benchmarks.physics.problem import MODELS, STARTS, Array, Problem, multiples, styluses_at
from netboard.physics.hands.sampled import Hands
from netboard.physics.simulation import Steps, choose_steps, simulate

REPEATS, QUICK_REPEATS = 15, 4
BUDGET = 0.3
"""Time after which a solver is not repeated again [s]."""

SPACINGS = (0.02, 0.01, 0.005, 0.002, 0.001, 0.0005)
"""Distances of the states that are kept [s]."""

LEVELS = (1e-4, 1e-8, 1e-12)
"""Tolerances of both Taylor methods in the comparison by distance [1]."""

TRIAL = 3.0
"""Duration of the simulations of sampled hands [s]."""

CLAIM = 1e-9
"""Claimed error of a simulation of sampled hands, relative to the range of each signal [1]."""


def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Run all parts of the study, and draw the runs."""
    repeats = QUICK_REPEATS if quick else REPEATS
    problems = [Problem(model, start) for model in MODELS for start in STARTS]
    rows: list[Row] = []
    for i, problem in enumerate(problems):
        share = 0.7 * i / len(problems)
        tell(f"{problem.name}: reference", share)
        reference = find_reference(problem).reference
        rows += measure(problem, reference, _solvers(problem, quick), repeats, BUDGET, tell, share)
    comparisons = compare(rows, MEDIANS)
    yield runs_part(rows)
    yield costs_part(rows)
    yield from (part for part in ratios_parts(comparisons) if part.name != "ratios-whole")
    tell("by distance of the states", 0.7)
    if PEERS["heyoka"].available:
        yield spacing_part(problems, repeats)
    tell("sampled hands", 0.8)
    yield sampled_part(repeats)
    tell("trials of the paper's task", 0.85)
    yield trials_part(QUICK_TRIALS if quick else TRIALS)
    tell("simulations in lanes", 0.88)
    yield lanes_part(repeats)
    tell("stress", 0.9)
    yield stress_part()
    figures.draw(rows, folder, signals=False)


def _solvers(problem: Problem, quick: bool) -> list[Solver]:
    found = taylor_solvers(problem, quick) + one_step_solvers(problem, True)
    for name in ("heyoka", "mujoco"):
        if PEERS[name].available:
            found += PEERS[name].solvers(problem, quick)
    return found


def costs_part(rows: Sequence[Row]) -> ResultPart:
    """List errors and costs of the two Taylor methods."""
    part = ResultPart(
        "costs",
        "Taylor methods: error E, and median cost of a second with states kept every 2 ms and without, hands excluded; "
        "spread: interquartile range over the median",
        "problem | library | tolerance | E [1] | steps | a step [ns] | without states [us/s] | with them [us/s] | "
        "spread [1]",
    )
    for row in rows:
        if row.method == "Taylor":
            cells = row.scaled, row.steps, row.step_ns, row.physics_median, row.dense_median, row.spread
            part.add(row.problem, row.library, row.setting.removeprefix("tol "), *cells)
    return part


def spacing_part(problems: Sequence[Problem], repeats: int) -> ResultPart:
    """Compare both Taylor methods at equal tolerance, by the distance of the states that they keep."""
    part = ResultPart(
        "spacing",
        "States kept: cost of heyoka over the cost of netboard's Taylor method, both with their own hands: median "
        "of the turns; spread: largest interquartile range over the median",
        ("problem", "tolerance of both", "no states", *(f"every {one * 1e3:g} ms" for one in SPACINGS), "spread [1]"),
    )
    smallest = inf
    for problem in problems:
        grids = [np.empty(0), *(multiples(round(problem.duration / spacing) + 1, spacing) for spacing in SPACINGS)]
        for level in LEVELS:
            ours: list[Callable[[], object]] = [partial(taylor_run(problem, level), grid[1:]) for grid in grids]
            theirs = peer_heyoka.runs_along(problem, level, grids)
            for one in (*ours, *theirs):
                one()
            found = [_ratio_of(our, their, repeats) for our, their in zip(ours, theirs, strict=True)]
            ratios = [ratio for ratio, _ in found]
            part.add(problem.name, f"{level:.0e}", *ratios, max(spread for _, spread in found))
            smallest = min(smallest, *ratios)
    part.claim("cheaper than heyoka at every distance of the states", smallest > 1.0, f"smallest ratio {smallest:.3g}")
    return part


def _ratio_of(ours: Callable[[], object], theirs: Callable[[], object], repeats: int) -> tuple[float, float]:
    """Return the median of the ratios of all turns, theirs over ours, and their interquartile range over it [1]."""
    turns = [[median(taken) for taken in in_turns([ours, theirs], 1, BUDGET, process_time)] for _ in range(repeats)]
    low, middle, high = np.quantile([their / our for our, their in turns], (0.25, 0.5, 0.75)).tolist()
    return middle, (high - low) / middle


def sampled_part(repeats: int) -> ResultPart:
    """Compare the automatic choice of `netboard simulate` with dop853 in equal steps, on hands sampled at 1 kHz."""
    part = ResultPart(
        "sampled",
        "Simulations of hands sampled at 1 kHz, from rest: median cost with all of `simulate`, and largest error over "
        "a signal's range",
        "model | rows every [ms] | taylor [us/s] | dop853 [us/s] | ratio | error, taylor [1] | error, dop853 [1]",
    )
    worst, times = 0.0, np.arange(round(TRIAL * 1000) + 1) / 1000
    hands = Hands(times, *styluses_at(times))
    for model in MODELS:
        problem = Problem(model, "cold")
        automatic = choose_steps(problem.physics)
        fixed, fine = (Steps("dop853", step, 1, automatic.fastest) for step in (0.0005, 0.000125))
        for dt in (0.002, 0.001, 0.0002):
            runs = [
                partial(simulate, hands, problem.physics, problem.first, dt=dt, steps=steps)
                for steps in (automatic, fixed)
            ]
            exact = simulate(hands, problem.physics, problem.first, dt=dt, steps=fine)
            errors = [_error(run().states, exact.states) for run in runs]
            ours, other = (median(taken) / TRIAL * 1e6 for taken in in_turns(runs, repeats, BUDGET, process_time))
            part.add(model, dt * 1e3, ours, other, other / ours, *errors)
            worst = float(np.maximum(worst, errors[0]))  # NaN if any is
    part.claim("errors of sampled hands below 1e-09 of each range", worst < CLAIM, f"{worst:.2g}")
    return part


def _error(found: Array, expected: Array) -> float:
    """Return the largest difference over the range of its signal."""
    return float((np.abs(found - expected).max(axis=0) / np.ptp(expected, axis=0)).max())
