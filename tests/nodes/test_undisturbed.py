"""The undisturbed tick in one compiled call equals the single steps: same rows, same forces, to the bit."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fake_router import hello
from motion_rig import MotionRig

from netboard.base.config import Config
from netboard.base.tick import TICK, TICK_NS
from netboard.network.protocol.motion import Force, Safeguard, Stylus
from netboard.network.transport import sockets
from netboard.nodes.server.undisturbed import DONE, RUN, STEPS, run_of
from netboard.stage.stage import make_stage
from netboard.task.trials.state_machine import Cause

NAMES = {"left": b"agent.left@1", "right": b"agent.right@2"}
ROWS = 64
STARTS_AT, TICKS = 5, 700


class TickRunner:
    """A motion port and a stage whose ticks run in one compiled call if possible, or always in single steps."""

    def __init__(self, context: sockets.Context, config: Config, *, compiled: bool) -> None:
        self.stage = make_stage(config)
        self.state = self.stage.initial()
        self.rows = np.zeros(ROWS, TICK)
        self.words = self.rows.view(np.int64).reshape(ROWS, -1)
        self.answered = 0
        self._ticks = run_of(self.stage) if compiled else None
        self._run = np.zeros(1, RUN)
        self._rig = MotionRig(context)
        for side, name in NAMES.items():
            self._rig.router.send_from(name, hello("agent", side))
        self._rig.drain(lambda: 0)
        self.received()

    def received(self) -> list[Any]:
        """The messages sent to both agents."""
        return [self._rig.router.received_by(name) for name in NAMES.values()]

    def tick(self, number: int, due_ns: int, samples: dict[str, Stylus], command: int) -> bytes:
        """Run a tick with these samples, and return its row."""
        port, words = self._rig.port, self.words[number % ROWS]
        for side, sample in samples.items():
            self._rig.router.send_from(NAMES[side], sample)
        self._rig.drain(lambda: due_ns - 300_000, due_ns)
        self._rig.port.fast.record["set_ns"] = due_ns + 7
        found = -1
        if self._ticks is not None and not command:
            parts = (self.state, self.rows, self.words, self.stage.book, self.stage.tables)
            run = self._run[0]
            run["number"], run["due_ns"], run["until"] = number, due_ns, number + 1
            ended = port.run(self._ticks, parts, self._run, self.stage.delay)
            assert ended in (DONE, STEPS)
            self.answered += ended == DONE
            found = int(run["found"])
            if ended == DONE:
                return words.tobytes()
        found = port.fill(words, number, due_ns, 7) if found < 0 else found
        words[(TICK.names or ()).index("command")] = command
        self.stage.advance(self.state, self.rows, number)
        port.force(words, self.stage.commanded_row(self.words, number))
        return words.tobytes()


def samples_at(number: int, rng: np.random.Generator) -> dict[str, Stylus]:
    """The agents' samples before a tick, some of them missing, not finite or from a disarmed device."""
    found = {}
    for side in NAMES:
        kind = rng.integers(40)
        if kind == 0:
            continue
        z, vz = 0.01 * np.sin(number * 0.01 + (side == "left")), 0.1 * np.cos(number * 0.01 + (side == "left"))
        bits = int(Safeguard.ARMED) if kind != 1 else 0
        stylus = Stylus(number, number * TICK_NS, 0.0, 0.0, float(z), 0.0, 0.0, float(vz), 0, bits, 0.1, -1, 0, 0, 0, 0)
        found[side] = replace(stylus, z=float("nan")) if kind == 2 else stylus
    return found


@pytest.mark.parametrize("delay", [0, 3])
def test_compiled_tick_equals_the_single_steps(delay: int) -> None:
    plain = Config()
    config = replace(plain, block=replace(plain.block, force="full", force_delay_ms=delay, trials=2))
    rng, forces = np.random.default_rng(7), 0
    with sockets.open_context() as context:
        runners = [TickRunner(context, config, compiled=compiled) for compiled in (True, False)]
        for number in range(TICKS):
            samples = samples_at(number, rng)
            command = int(Cause.START) if number == STARTS_AT else 0
            rows = [runner.tick(number, (number + 1) * TICK_NS, samples, command) for runner in runners]
            assert rows[0] == rows[1]
            first, second = (runner.received() for runner in runners)
            assert first == second
            forces += sum(isinstance(message, Force) for messages in first for message in messages)
        assert runners[0].state.tobytes() == runners[1].state.tobytes()
        assert 0.7 * TICKS < runners[0].answered < TICKS  # both paths were used
        assert forces == 2 * TICKS
