"""``make evidence ARGS=decisions``: times that the robot partners take to decide, once a millisecond as in an agent.

The kernel is called from Python each millisecond, and sleeps in between, so that its data are as cold as in an agent.
The time includes the call. Each ninth call has a new view of a ball that rolls and a board that tilts.
"""

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import composed, kernel, machine_code
from netboard.base.config import SIDES, Config, Side
from netboard.base.tick import TICK_SECONDS
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Tell
from netboard.participants.body.stylus import ACTION
from netboard.participants.policy import OBSERVATION, Policy
from netboard.participants.seat.partners import POLICIES, make_partner
from netboard.task.trials.state_machine import Phase

SECONDS, QUICK_SECONDS = 20.0, 0.5
"""Time for which each robot decides [s]."""

WARM = 200
"""First calls, which are not counted [1]."""

VIEW_TICKS = 9
"""Ticks between two views [1]."""

PERCENTILES = (50.0, 99.0, 99.9)


def _decide(state: Any, constants: Any, observation: Any, actions: Any) -> None:
    """Placeholder for the kernel of a policy, which `composed` replaces."""
    raise NotImplementedError


def _decided(states: Any, constants: Any, observations: Any, actions: Any) -> None:
    """Let a policy decide, in arrays of one record."""
    _decide(states[0], constants[0], observations[0], actions)


def kernel_of(policy: Policy) -> Callable[..., None]:
    """Compile the kernel of a policy."""
    found: Callable[..., None] = composed(_decided, kernel, _decide=policy.decide)
    return found


def observe(observation: NDArray[Any], tick: int, side: Side) -> None:
    """Write what a policy knows at a tick: a new view each ninth time."""
    now, place = tick * TICK_SECONDS, SIDES.index(side)
    wave = 0.02 * np.sin(2.0 * np.pi * 0.5 * now)
    observation["tick"], observation["time"], observation["start"] = tick, now, now
    observation["z"][0, place] = observation["height"][0, place] = wave
    observation["felt"] = -0.3 + 10.0 * wave
    if tick % VIEW_TICKS == 0:
        phase = Phase.LEVELLING if tick % 4000 < 400 else Phase.RUNNING
        hands = (wave, np.nan) if side == "left" else (np.nan, wave)
        observation["seen"] = (now, phase, 0.5 * wave, wave, -5.0 * wave, 0.15, *hands)


def times_of(policy: Policy, seconds: float) -> NDArray[np.float64]:
    """Return the times of its decisions, once a millisecond [s]."""
    state, actions, observation = policy.initial((1, 1)), np.zeros(len(SIDES), ACTION), np.zeros(1, OBSERVATION)
    observation["seen"]["time"] = np.nan
    arguments = state, policy.constants, observation, actions
    decide = machine_code(kernel_of(policy), *arguments)
    found = np.zeros(WARM + round(seconds / TICK_SECONDS))
    due = time.perf_counter()
    for tick in range(len(found)):
        due += TICK_SECONDS
        time.sleep(max(0.0, due - time.perf_counter()))
        observe(observation, tick, policy.sides[0])
        began = time.perf_counter_ns()
        decide(*arguments)
        found[tick] = 1e-9 * (time.perf_counter_ns() - began)
    return found[WARM:]


def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Time the decisions of each robot that needs no file."""
    seconds = QUICK_SECONDS if quick else SECONDS
    part = ResultPart(
        "decisions",
        f"Time of a decision, called once a millisecond for {seconds:g} s, with the call from Python",
        ("partner", *(f"{q:g} % [us]" for q in PERCENTILES), "longest [us]"),
    )
    names = [name for name, target in POLICIES.items() if ".robots." in target]
    for step, name in enumerate(names):
        tell(name, step / len(names))
        times = 1e6 * times_of(make_partner(name, Config(), "right"), seconds)
        part.add(name, *np.percentile(times, PERCENTILES).tolist(), float(times.max()))
    yield part
