"""Cost of a live tick compared with a lower bound on this machine.

The right-hand side is timed as a chain, in which each evaluation depends on the last (latency), and with independent
evaluations (reciprocal throughput). The lower bound is the latency of four right-hand sides; a step of four stages can
be slightly faster, since a stage does not depend on every result of the one before. The tick is that of
`netboard.stage.stage`: samples, extrapolation, forces, trial, step.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from statistics import median
from time import perf_counter_ns
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import kernel
from netboard.base.config import Config
from netboard.base.tables.experiment import Task
from netboard.base.tables.scene import Geometry, Physics
from netboard.base.tick import TICK, TICK_NS, TICK_SECONDS
from netboard.benchmarks.physics.batch import LANES, in_blocks, make_batch, scene_blocks
from netboard.benchmarks.physics.problem import Array, Problem, styluses_at
from netboard.benchmarks.physics.solver import timed
from netboard.benchmarks.physics.work_precision import in_turns
from netboard.physics.arithmetic.trig import sincos
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

MANY, MANY_TICKS = 1024, 20
"""Simulations in a batch, and its ticks in one timing [1]."""

STAGES = 4
"""Right-hand sides in a step of RK4 [1]."""


@dataclass(frozen=True)
class TickCost:
    """Costs of a tick and of its parts, for one model; minima unless stated otherwise.

    - `sincos_latency_ns`, `sincos_ns`: sine and cosine of one angle: latency and reciprocal throughput [ns].
    - `right_side_latency_ns`, `right_side_ns`: the same of the right-hand side [ns].
    - `floor_ns`: lower bound: latency of four right-hand sides [ns].
    - `step_ns`: one RK4 step alone [ns].
    - `tick_ns`: a tick in a compiled loop [ns].
    - `call_ns`, `call_p99_ns`, `call_worst_ns`: a tick called from Python: median, 99th percentile, and worst of many
      [ns].
    - `first_call_ns`: the first tick after warming up [ns].
    - `many_ns`: a tick of `many` simulations, in one call [ns].
    """

    model: str
    sincos_latency_ns: float
    sincos_ns: float
    right_side_latency_ns: float
    right_side_ns: float
    floor_ns: float
    step_ns: float
    tick_ns: float
    call_ns: float
    call_p99_ns: float
    call_worst_ns: float
    first_call_ns: float
    compiled_late: bool
    many: int
    many_ns: float


# Too small to change a sum, but the addition makes each evaluation depend on the last.
_NOTHING = 1e-30


@kernel
def _sincos_chain(theta: float, count: int) -> float:
    s, c = 0.0, 0.0
    for _ in range(count):
        s, c = sincos(theta + _NOTHING * (s + c))
    return s + c


@kernel
def _sincos_beside(angles: Any, out: Any) -> None:
    for i in range(len(angles)):
        s, c = sincos(angles[i])
        out[i] = s + c


@cache
def _make_right_sides(PARTS: Parts) -> tuple[Callable[..., float], Callable[..., None]]:
    """Compile a chain of dependent right-hand sides, and independent ones."""

    @kernel
    def chain(x: Any, left: float, right: float, scene: Any, count: int) -> float:
        turning, rest = 0.0, 0.0
        for _ in range(count):
            y = (x[0], x[1], x[2] + _NOTHING * turning, x[3], x[4], x[5])
            rate = rates(y, left, right, PARTS, scene[0])
            turning = rate[3]
            rest += rate[1] + rate[5]
        return turning + rest

    @kernel
    def beside(states: Any, left: float, right: float, scene: Any, out: Any) -> None:
        for i in range(len(states)):
            x = (states[i, 0], states[i, 1], states[i, 2], states[i, 3], states[i, 4], states[i, 5])
            rate = rates(x, left, right, PARTS, scene[0])
            out[i] = rate[1] + rate[3] + rate[5]

    return chain, beside


def measure_tick(problem: Problem, repeats: int) -> TickCost:
    """Measure the cost of a model's tick and of its parts, interleaved."""
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
        _many(problem),
        lambda: stage.advance(state.copy(), rows, 0, COUNT),
    ]
    for run in runs:
        run()
    *ns, many, tick = [min(taken) / COUNT * 1e9 for taken in in_turns(runs, repeats, 10.0)]
    calls = _calls(stage, problem)
    return TickCost(
        model=problem.model,
        sincos_latency_ns=ns[0],
        sincos_ns=ns[1],
        right_side_latency_ns=ns[2],
        right_side_ns=ns[3],
        floor_ns=STAGES * ns[2],
        step_ns=ns[4],
        tick_ns=tick,
        call_ns=median(calls),
        call_p99_ns=float(np.percentile(calls, 99)),
        call_worst_ns=max(calls),
        first_call_ns=first_call,
        compiled_late=late,
        many=MANY,
        many_ns=many * COUNT / MANY_TICKS,
    )


def _many(problem: Problem) -> Callable[[], object]:
    """Return a function that runs some ticks of a batch of simulations."""
    step = make_batch(problem.parts, 6, False)
    first = in_blocks(np.tile(np.array(problem.first), (MANY, 1)))
    hands, scenes = np.zeros((len(first), 8, LANES)), scene_blocks(problem.scene)

    def ticks() -> None:
        x = first.copy()
        for _ in range(MANY_TICKS):
            step(x, hands, scenes, TICK_SECONDS)

    return ticks


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


def live_rows(problem: Problem) -> NDArray[Any]:
    """Return the input rows of a problem: a new sample of each hand in every tick."""
    rows = np.zeros(round(problem.duration / TICK_SECONDS) + 1, TICK)
    number = np.arange(len(rows))
    z, vz = styluses_at(number * TICK_SECONDS)
    rows["tick"], rows["time_ns"] = number, (number + 2) * TICK_NS
    for i, side in enumerate(("left", "right")):
        rows[f"{side}_live"] = 1
        rows[f"{side}_seq"] = number
        rows[f"{side}_stamp_ns"] = rows["time_ns"]
        rows[f"{side}_sent_z"], rows[f"{side}_sent_vz"] = z[:, i], vz[:, i]
    return rows


def live_state(stage: Stage, problem: Problem) -> NDArray[Any]:
    """Return the initial state of a problem: a running trial with the ball free."""
    state = stage.initial()
    state["phase"] = Phase.RUNNING
    for name, value in zip(("z", "vz", "theta", "omega", "p", "vp"), problem.first, strict=True):
        state[name] = value
    _, before = styluses_at(np.array([-TICK_SECONDS]))
    for i, side in enumerate(("left", "right")):
        state[f"{side}_seen_ns"], state[f"{side}_seen_vz"] = TICK_NS, before[0, i]
    return state


def live_run(problem: Problem, hold: str) -> tuple[Array, Array]:
    """Run a problem by the server's ticks, from samples at 1 kHz; return states and commanded forces [SI, N]."""
    stage, rows = live_stage(problem, hold), live_rows(problem)
    stage.advance(live_state(stage, problem), rows, 0, len(rows))
    states = np.stack([rows[name] for name in ("z", "vz", "theta", "omega", "p", "vp")], axis=1)
    return states, np.stack([rows["left_coupling"], rows["right_coupling"]], axis=1)
