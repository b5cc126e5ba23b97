"""``netboard bench environments``: environment steps per second of processor time, beside Gymnasium's vector CartPole.

A step is 10 ticks of 1 ms: actions in, observations, rewards and ends out, with the resets that follow. Actions are
small and random, drawn before the timing. The lower bound is the integration of board and ball alone in strict
arithmetic, with the kernel and the groups of scenes that the environments have. `fidelity` measures how far the
environments at reduced fidelity differ from the strict ones.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from time import process_time
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Records, kernel
from netboard.base.config import Config
from netboard.benchmarks.environments import fidelity
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Options, Tell, run
from netboard.participants.batch.arrays import LANES
from netboard.participants.batch.spaces import REDUCED
from netboard.participants.batch.stepping import lanes_of, put_state
from netboard.participants.environments.vector import BoardVectorEnv
from netboard.stage.stage import TickKernels, make_stage

COUNTS = (1, 64, 4096)
"""Numbers of boards [1]."""

SECONDS, QUICK_SECONDS = 4.0, 0.8
"""Processor time of a measurement [s]."""

TURNS = 3
"""Turns of each measurement, of which the fastest counts; a measurement is repeated after all others [1]."""

AMPLITUDE = 0.2
"""Largest action [1]."""

TICKS = 10
"""Ticks in a step [1]."""


@dataclass(frozen=True)
class Case:
    """One kind of environment."""

    name: str
    keys: dict[str, Any]
    force: str


CASES = (
    Case("one agent, both hands, haptics off, reduced fidelity", {"seat": "both", "fidelity": REDUCED}, "none"),
    Case("one agent, both hands, haptics off", {"seat": "both"}, "none"),
    Case("one agent beside a hand held still, haptics off", {"seat": "left", "other": "still"}, "none"),
    Case("one agent beside a simulated participant, haptics off", {"seat": "left", "other": "person"}, "none"),
    Case("one agent beside a simulated participant, haptics on", {"seat": "left", "other": "person"}, "full"),
)


def main(options: Options) -> None:
    """Run the benchmark."""
    run("environments", study, options, bar=False)


def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Measure each kind and number of boards, CartPole, and the lower bound."""
    seconds = QUICK_SECONDS if quick else SECONDS
    tell("compiling", 0.0)
    steppers = {(case.name, count): board_stepper(case, count) for case in CASES for count in COUNTS} | {
        ("Gymnasium's vector CartPole, 1 Euler step", COUNTS[-1]): cartpole_stepper(COUNTS[-1])
    }
    rates = dict.fromkeys(steppers, 0.0)
    for turn in range(TURNS):
        tell(f"turn {turn + 1} of {TURNS}", turn / TURNS)
        for key, step in steppers.items():
            rates[key] = max(rates[key], key[1] * calls_per_second(step, seconds / TURNS))
    bound = bound_per_tick(seconds)
    part = ResultPart("speed", "Steps per second of processor time", "environment | boards | steps/s | ns per step")
    for (name, count), rate in rates.items():
        part.add(name, count, rate, 1e9 / rate)
    part.add(
        f"lower bound in strict arithmetic: board and ball alone, {TICKS} ticks",
        COUNTS[-1],
        1e9 / (bound * TICKS),
        bound * TICKS,
    )
    most = {case.name: rates[case.name, COUNTS[-1]] for case in CASES}
    for case, goal in ((CASES[0], 10e6), (CASES[-1], 1e6)):
        claim = f"{case.name}: at least {goal / 1e6:g} million steps per second with {COUNTS[-1]} boards"
        part.claim(claim, most[case.name] >= goal, f"{most[case.name] / 1e6:.2f} million")
    yield part
    tell("training at both fidelities", 1.0)
    yield from fidelity.study()


def calls_per_second(call: Callable[[], object], seconds: float) -> float:
    """Return how often a call runs in a second of processor time [1/s]."""
    calls, start = 0, process_time()
    while (taken := process_time() - start) < seconds:
        call()
        calls += 1
    return calls / taken


def board_stepper(case: Case, count: int) -> Callable[[], object]:
    """Return a step of some boards, compiled and under way."""
    config = Config()
    config = replace(config, block=replace(config.block, force=case.force))
    boards = BoardVectorEnv(count, config=config, copy=False, **case.keys)
    boards.reset(seed=1)
    shape = (16, *boards.action_space.shape)
    actions = np.random.default_rng(1).uniform(-AMPLITUDE, AMPLITUDE, shape).astype(np.float32)
    return in_turn(boards, actions)


def cartpole_stepper(count: int) -> Callable[[], object]:
    """Return a step of Gymnasium's vector CartPole."""
    poles = gymnasium.make_vec("CartPole-v1", num_envs=count, vectorization_mode="vector_entry_point")
    poles.reset(seed=1)
    return in_turn(poles, np.random.default_rng(1).integers(0, 2, (16, count)))


def in_turn(environments: Any, actions: NDArray[Any]) -> Callable[[], object]:
    """Return a step with one action after the other."""
    place = 0

    def step() -> None:
        nonlocal place
        environments.step(actions[place])
        place = (place + 1) % len(actions)

    step()
    return step


@cache
def make_motion(kernels: TickKernels) -> Callable[..., None]:
    """Compile the motion of board and ball alone, in groups."""
    roll = kernels.roll

    @kernel
    def motion(rooms: NDArray[np.float64], book: Records, tables: NDArray[np.float64], count: int) -> None:
        for g in range(len(rooms)):
            room = rooms[g]
            x, hands = lanes_of(room)
            for _ in range(count):
                x = roll(x, hands, tables, book[0]["scene"])
            put_state(room, 0, x)

    return motion


def bound_per_tick(seconds: float) -> float:
    """Return the processor time of the motion of board and ball of one scene in a tick [ns]."""
    stage = make_stage(Config())
    motion, count = make_motion(stage.kernels), COUNTS[-1]
    rooms = np.zeros((count // LANES, 27, LANES))
    call = partial(motion, rooms, stage.book, stage.tables, TICKS)
    call()

    def again() -> None:
        rooms[:] = 0.0  # a ball that rolled for ever would leave the range of tilts
        call()

    return 1e9 / (calls_per_second(again, seconds) * count * TICKS)
