"""Cost of a live tick compared with a lower bound on this machine.

The right-hand side is timed as a chain, in which each evaluation depends on the last (latency), and with independent
evaluations (reciprocal throughput). The lower bound is the latency of four right-hand sides; a step of four stages can
be slightly faster, since a stage does not depend on every result of the one before. The tick is that of
`netboard.stage.stage`: samples, extrapolation, forces, trial, step.
"""

from collections.abc import Callable, Sequence
from functools import cache, partial
from statistics import median
from time import perf_counter_ns
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Records, kernel
from netboard.base.config import SIDES, Config
from netboard.base.tables.experiment import Task
from netboard.base.tables.scene import Geometry, Physics
from netboard.base.tick import TICK, TICK_NS, TICK_SECONDS
from netboard.benchmarks.harness.results import ResultPart
from netboard.benchmarks.harness.running import in_turns, timed
from netboard.benchmarks.physics.problem import STATE_NAMES, Array, Problem, multiples, styluses_at
from netboard.physics.arithmetic.trig import sincos
from netboard.physics.arithmetic.vectors import State
from netboard.physics.methods.catalogue import NUMBER
from netboard.physics.methods.march import make_grid, make_march
from netboard.physics.scene.models import rates
from netboard.physics.scene.parameters import Parts
from netboard.stage.stage import Stage, make_stage
from netboard.task.trials.state_machine import Phase

COUNT = 5_000
"""Right-hand sides, or ticks, in one timing [1]."""

CALLS = 20_000
"""Calls from Python [1]."""

STAGES = 4
"""Right-hand sides in a step of RK4 [1]."""

# Too small to change a sum, but the addition makes each evaluation depend on the last.
_NOTHING = 1e-30


@kernel
def _sincos_chain(theta: float, count: int) -> float:
    s, c = 0.0, 0.0
    for _ in range(count):
        s, c = sincos(theta + _NOTHING * (s + c))
    return s + c


@kernel
def _sincos_beside(angles: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    for i in range(len(angles)):
        s, c = sincos(angles[i])
        out[i] = s + c


@cache
def _make_right_sides(PARTS: Parts) -> tuple[Callable[..., float], Callable[..., None]]:
    """Compile a chain of dependent right-hand sides, and independent ones."""

    @kernel
    def chain(x: State, left: float, right: float, scene: Records, count: int) -> float:
        turning, rest = 0.0, 0.0
        for _ in range(count):
            y = (x[0], x[1], x[2] + _NOTHING * turning, x[3], x[4], x[5])
            rate = rates(y, left, right, PARTS, scene[0])
            turning = rate[3]
            rest += rate[1] + rate[5]
        return turning + rest

    @kernel
    def beside(
        states: NDArray[np.float64], left: float, right: float, scene: Records, out: NDArray[np.float64]
    ) -> None:
        for i in range(len(states)):
            x = (states[i, 0], states[i, 1], states[i, 2], states[i, 3], states[i, 4], states[i, 5])
            rate = rates(x, left, right, PARTS, scene[0])
            out[i] = rate[1] + rate[3] + rate[5]

    return chain, beside


FLOOR = "lower bound: latency of four right-hand sides"
STEP, LIVE_TICK = "one RK4 step alone", "the server's tick: samples, extrapolation, forces, trial, step"
CALL, FIRST_CALL = "called from Python: median", "first tick after warming up"


def measure_tick(problem: Problem, repeats: int) -> tuple[dict[str, float], bool]:
    """Measure the cost of a model's tick and of its parts, interleaved.

    - returns costs, minima unless stated otherwise [ns]; and whether the first tick compiled anything.
    """
    chain, beside = _make_right_sides(problem.parts)
    states, out = np.tile(np.array(problem.first), (COUNT, 1)), np.empty(COUNT)
    stage, first_call, late = _first_tick(problem)
    state, rows = live_state(stage, problem), live_rows(problem)[:COUNT]
    lengths, ones = np.full(COUNT, TICK_SECONDS), np.ones(COUNT, np.int64)
    grid = make_grid("rk4", lengths, ones, problem.parts, 6, problem.scene)
    march, still = make_march(NUMBER["rk4"], problem.parts), np.zeros((COUNT, 8))
    runs: list[Callable[[], object]] = [
        partial(_sincos_chain, 0.1, COUNT),
        partial(_sincos_beside, np.full(COUNT, 0.1), out),
        partial(chain, problem.first, 0.1, 0.2, problem.scene, COUNT),
        partial(beside, states, 0.1, 0.2, problem.scene, out),
        lambda: march(problem.first, still, lengths, ones, grid.kinds, grid.tables, problem.scene, np.empty((0, 6))),
        lambda: stage.advance(state.copy(), rows, 0, COUNT),
    ]
    for run in runs:
        run()
    latency, throughput, right_latency, right_throughput, step, tick = (
        min(taken) / COUNT * 1e9 for taken in in_turns(runs, repeats, 10.0)
    )
    calls = _calls(stage, problem)
    costs = {
        "sine and cosine: latency": latency,
        "sine and cosine: reciprocal throughput": throughput,
        "right-hand side: latency": right_latency,
        "right-hand side: reciprocal throughput": right_throughput,
        FLOOR: STAGES * right_latency,
        STEP: step,
        LIVE_TICK: tick,
        CALL: median(calls),
        "called from Python: 99th percentile": float(np.percentile(calls, 99)),
        "called from Python: worst": max(calls),
        FIRST_CALL: first_call,
    }
    return costs, late


MAX_FLOORS, MAX_CALL = 2.0, 1000.0
"""Largest cost of a tick: compiled, over its lower bound; called from Python [1, ns]."""


def tick_part(problems: Sequence[Problem], repeats: int) -> ResultPart:
    """Measure the cost of a live tick and of its parts, and check it."""
    found = [measure_tick(problem, repeats) for problem in problems]
    part = ResultPart("tick", "Cost of a live tick [ns]", ("what", *(problem.model for problem in problems)))
    for name in found[0][0]:
        part.add(name, *(costs[name] for costs, _ in found))
    for problem, (costs, late) in zip(problems, found, strict=True):
        floors, alone = costs[LIVE_TICK] / costs[FLOOR], costs[LIVE_TICK] / costs[STEP]
        part.claim(
            f"{problem.model}: a tick costs at most {MAX_FLOORS:g} times the lower bound",
            floors <= MAX_FLOORS,
            f"{floors:.2f} times, and {alone:.2f} times its RK4 step alone",
        )
        part.claim(
            f"{problem.model}: a tick called from Python takes at most {MAX_CALL:g} ns",
            costs[CALL] <= MAX_CALL,
            f"{costs[CALL]:.0f} ns, the median",
        )
        part.claim(f"{problem.model}: the first tick compiles nothing", not late, f"{costs[FIRST_CALL] / 1e3:.0f} us")
    return part


def _first_tick(problem: Problem) -> tuple[Stage, float, bool]:
    """Warm a stage up and time its first tick; return stage, time [ns] and whether the tick compiled anything."""
    stage = live_stage(problem)
    stage.warm()
    before = _signatures(stage)
    state, rows = live_state(stage, problem), live_rows(problem)[:1]
    took = timed(lambda: stage.advance(state, rows)) * 1e9
    return stage, took, _signatures(stage) != before


def _signatures(stage: Stage) -> int:
    """Return the number of argument types for which the ticks are compiled."""
    return len(getattr(stage.ticks, "signatures", ()))


def _calls(stage: Stage, problem: Problem) -> list[int]:
    """Time single ticks called from Python [ns]."""
    state, rows, taken = live_state(stage, problem), live_rows(problem), []
    advance, clock = stage.advance, perf_counter_ns
    for i in range(CALLS):
        start = clock()
        advance(state, rows, i)
        taken.append(clock() - start)
    return taken


# --- the problem in live ticks ---------------------------------------------------------------------------


def live_stage(problem: Problem, hold: str = "ca") -> Stage:
    """Return the stage of a problem, with a task in which the trial never ends."""
    physics: Any = {"model": problem.model, "hold": hold}
    return make_stage(
        Config(physics=Physics(**physics), geometry=Geometry(target_distance=2.0), task=Task(fall_distance=5.0))
    )


def sampled_rows(z: Array, vz: Array, first_ns: int, age_ns: int) -> NDArray[Any]:
    """Return the input rows of ticks, each with a new sample of both hands.

    - `z`, `vz` (shape (n, 2)): heights and velocities of the left and the right stylus [m, m/s].
    - `first_ns`: time of the first tick [ns].
    - `age_ns`: age of the samples when a tick begins [ns].
    """
    rows = np.zeros(len(z), TICK)
    rows["tick"] = np.arange(len(z))
    rows["time_ns"] = first_ns + rows["tick"] * TICK_NS
    for i, side in enumerate(SIDES):
        rows[f"{side}_live"] = 1
        rows[f"{side}_seq"] = rows["tick"]
        rows[f"{side}_stamp_ns"] = rows["time_ns"] - age_ns
        rows[f"{side}_sent_z"], rows[f"{side}_sent_vz"] = z[:, i], vz[:, i]
    return rows


def live_rows(problem: Problem, age_ns: int = 0) -> NDArray[Any]:
    """Return the input rows of a problem."""
    times = multiples(round(problem.duration / TICK_SECONDS) + 1, TICK_SECONDS) - age_ns * 1e-9
    return sampled_rows(*styluses_at(times), 2 * TICK_NS, age_ns)


def live_state(stage: Stage, problem: Problem, age_ns: int = 0) -> NDArray[Any]:
    """Return the initial state of a problem: a running trial with the ball free."""
    state = stage.initial()
    state["phase"] = Phase.RUNNING
    for name, value in zip(STATE_NAMES, problem.first, strict=True):
        state[name] = value
    _, before = styluses_at(np.array([-TICK_SECONDS - age_ns * 1e-9]))
    for i, side in enumerate(SIDES):
        state[f"{side}_seen_ns"], state[f"{side}_seen_vz"] = TICK_NS - age_ns, before[0, i]
    return state
