"""The tables of ``make evidence ARGS=physics``, and the claims that are checked against each."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf

from evidence.physics.peer_mujoco import LIBRARY as MUJOCO
from evidence.physics.peer_mujoco import MANY, STAGES
from evidence.physics.reference import ERRORS, Reference
from evidence.physics.work_precision import (
    OURS,
    TARGETS,
    Comparison,
    Row,
    by_problem,
    cost_at,
    frontier,
    least_cost,
)
from netboard.benchmarks.harness.results import ResultPart, Value
from netboard.benchmarks.physics.problem import Problem

SURE = 1e-11
"""Largest difference of two reference solutions that can resolve an E of 1e-12 [1]."""

STEPS, HELD_STEPS, HELD_ERROR = 100.0, 700.0, 1e-3
"""Claimed ratio of MuJoCo's cost to ours, at any error and for steps of many simulations, and at one error with held
controls [1]."""

AGREEMENT = 1e-9
"""Largest relative difference between the states of simulations that take the same steps [1]."""


@dataclass(frozen=True)
class Checked:
    """A reference solution, and its difference from an independent solution."""

    problem: Problem
    reference: Reference
    check: str
    apart: float


def reference_part(found: Sequence[Checked]) -> ResultPart:
    """List the reference solutions and their differences from independent solutions."""
    worst = max(one.apart for one in found)
    part = ResultPart(
        "reference",
        "Reference solutions, the solvers they were checked by, and the largest values of the signals",
        ("problem", "reference", "check", "its E [1]", *ERRORS),
        [
            (one.problem.name, one.reference.source, one.check, one.apart, *one.reference.scales.tolist())
            for one in found
        ],
    )
    part.claim("two independent solvers agree", worst < SURE, f"to E = {worst:.1e}")
    return part


def runs_part(rows: Iterable[Row]) -> ResultPart:
    """List all runs."""
    return ResultPart(
        "runs",
        "All runs",
        (
            *("problem", "library", "method", "setting", "controls held", "E [1]", *ERRORS),
            *("ns per step", "physics [us/s]", "its median", "whole [us/s]", "its median"),
            *("dense [us/s]", "its median", "spread [1]"),
            *("steps", "evaluations of the hands", "errors every [s]", "turns", "warm-up [s]"),
        ),
        [_all_of(row) for row in rows],
        on_screen=False,
    )


def _all_of(row: Row) -> tuple[Value, ...]:
    who: tuple[Value, ...] = (row.problem, row.library, row.method, row.setting, row.held, row.scaled)
    costs = (row.step_ns, row.physics, row.physics_median, row.whole, row.whole_median)
    kept = (row.dense, row.dense_median, row.spread)
    counts: tuple[Value, ...] = (row.steps, row.calls, row.spacing, row.turns, row.warm_up)
    return who + row.errors + costs + kept + counts


def steps_part(rows: Iterable[Row]) -> ResultPart:
    """List netboard's methods with steps of one tick."""
    return ResultPart(
        "steps",
        "Netboard's methods with steps of 1 ms",
        ("problem", "method", "ns per step", "E [1]", *ERRORS),
        [
            (row.problem, row.method, row.step_ns, row.scaled, *row.errors)
            for row in rows
            if row.library == OURS and row.setting == "1 ms"
        ],
    )


def frontier_part(rows: Sequence[Row]) -> ResultPart:
    """List the Pareto-optimal runs."""
    best = [row for here in by_problem(rows).values() for row in frontier(here) if row.scaled < 1.0]
    return ResultPart(
        "frontier",
        "Pareto frontier: no run has both a smaller error and a lower cost, hands excluded",
        "problem | method | setting | E [1] | errors every [s] | physics [us/s] | whole [us/s]",
        [
            (row.problem, f"{row.library} {row.method}", row.setting, row.scaled, row.spacing, row.physics, row.whole)
            for row in best
        ],
    )


def costs_parts(rows: Sequence[Row]) -> list[ResultPart]:
    """List the cost of each error with each method, for each problem."""
    parts = []
    for problem, here in by_problem(rows).items():
        table: list[tuple[Value, ...]] = []
        for library, method in dict.fromkeys((row.library, row.method) for row in here):
            curve = [row for row in here if (row.library, row.method) == (library, method)]
            costs = [cost_at(curve, error) for error in TARGETS]
            if min(costs) < inf:
                table.append((f"{library} {method}", *(_short(cost) if cost < inf else "-" for cost in costs)))
        parts.append(
            ResultPart(
                f"costs-{problem.replace(', ', '-')}",
                f"{problem}: cost of an error E, hands excluded [us per second of simulated time]",
                ("E [1]", *_HEADS),
                table,
            )
        )
    return parts


_HEADS = tuple(f"{error:.0e}".replace("e-0", "e-") for error in TARGETS)


WHAT = {
    "physics": "hands excluded",
    "whole": "evaluation of the hands included",
    "dense": "hands excluded, states kept every 2 ms",
}
"""Which costs are compared."""


def ratios_parts(comparisons: Sequence[Comparison]) -> list[ResultPart]:
    """Return each library's lowest cost over ours at equal error; claims for the physics alone and dense states."""
    parts = []
    for what, meaning in WHAT.items():
        mine = [one for one in comparisons if one.what == what]
        if not mine:
            continue
        part = ResultPart(
            f"ratios-{what}",
            f"Cost of the other library over the cost of netboard at equal error, {meaning}; "
            "inf: only netboard reaches this error, -: neither does",
            ("E [1]", *_HEADS, "beaten"),
            [(f"{one.problem}: {one.library}", *map(_ratio, one.ratios), one.beaten) for one in mine],
        )
        for library in dict.fromkeys(one.library for one in mine if what != "whole"):
            its = [one for one in mine if one.library == library]
            claim = f"cheaper than {library} at every error that it reaches, {meaning}"
            part.claim(claim, all(one.beaten for one in its), _least(its))
        parts.append(part)
    return parts


def _ratio(ratio: float | None) -> Value:
    return "-" if ratio is None else _short(ratio)


def _short(value: float) -> Value:
    """Round a large number to an integer."""
    return value if value < 100.0 or value == inf else round(value)


def _least(comparisons: Sequence[Comparison]) -> str:
    """Return the smallest ratio, and where it is."""
    all_of = [
        (ratio, error, one.problem)
        for one in comparisons
        for ratio, error in zip(one.ratios, TARGETS, strict=True)
        if ratio is not None
    ]
    if not all_of:
        return "it reaches none of these errors"
    ratio, error, problem = min(all_of)
    return f"smallest ratio {ratio:.3g}, at E = {error:.0e} ({problem})"


def mujoco_part(
    rows: Sequence[Row], comparisons: Sequence[Comparison], many: Mapping[str, tuple[float, float, float]]
) -> ResultPart:
    """Compare netboard with MuJoCo on the Lagrangian problems.

    - `many`: by problem, a step of one of many simulations in MuJoCo and in netboard [ns], and their difference [1].
    """
    part = ResultPart("mujoco", "MuJoCo", "problem | what | MuJoCo | netboard | ratio")
    held = []
    for problem, here in by_problem(rows).items():
        ours = [row for row in here if row.library == OURS]
        our_rk4 = [row for row in ours if row.method == "rk4"]
        theirs = [row for row in here if row.library == MUJOCO]
        if not theirs:
            continue
        staged = min(row.step_ns for row in theirs if row.method == STAGES)
        ns = min(row.step_ns for row in our_rk4 if row.scaled < 1.0)
        part.add(problem, "a step of RK4 on the same equations [ns]", staged, ns, staged / ns)
        staged, ns, _ = many[problem]
        part.add(problem, f"the same, of one of {MANY} simulations at once [ns]", staged, ns, staged / ns)
        cost = least_cost((row for row in theirs if row.held), HELD_ERROR)
        for name, curve in (("our rk4", our_rk4), ("our best", ours)):
            other = least_cost(curve, HELD_ERROR)
            if cost < inf and other < inf:
                part.add(problem, f"E = {HELD_ERROR:.0e}, controls held, {name} [us/s]", cost, other, cost / other)
                held += [cost / other] if curve is ours else []
    mine = [one for one in comparisons if one.library == MUJOCO and one.what == "physics"]
    ratios = [ratio for one in mine for ratio in one.ratios if ratio is not None]
    if ratios:
        claim = f"at equal error at least {STEPS:g} times cheaper than MuJoCo"
        part.claim(claim, min(ratios) >= STEPS, _least(mine))
    if many:
        ratio, apart = min(theirs / ours for theirs, ours, _ in many.values()), max(one[2] for one in many.values())
        claim = f"a step of many simulations at once at least {STEPS:g} times cheaper than in MuJoCo, on one core"
        part.claim(claim, ratio >= STEPS and apart <= AGREEMENT, f"{ratio:.3g} times; states agree to {apart:.1e}")
    if held:
        claim = (
            f"at E = {HELD_ERROR:.0e} at least {HELD_STEPS:g} times cheaper than MuJoCo with controls held in a step"
        )
        part.claim(claim, min(held) >= HELD_STEPS, f"{min(held):.3g} times")
    return part
