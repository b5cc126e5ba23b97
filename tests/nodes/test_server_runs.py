"""Undisturbed ticks in one compiled call equal the single steps, to the bit, and end when Python is due."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fake_router import hello
from motion_rig import MotionRig

from netboard.base.clock import CATCH_UP_TICKS, now_ns
from netboard.base.config import Config
from netboard.base.safeguards import Safeguard
from netboard.base.tables.perturbations import Perturbation
from netboard.base.tick import HEARTBEAT_TICKS, TICK, TICK_NS
from netboard.network.protocol import fixed
from netboard.network.protocol.joining import Goodbye
from netboard.network.protocol.motion import Force, Heartbeat, Stylus
from netboard.network.transport import sockets
from netboard.network.transport.fastpath import MACHINE_CLOCK
from netboard.nodes.server.server_runs import DONE, IN_TRIAL, INTERRUPTED, MESSAGE, RUN, STEPS, WAITING, WAITS, run_of
from netboard.nodes.server.tick_clock import EARLIEST_NS
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
        self.answered, self._forces = 0, config.block.haptics
        self._ticks = run_of(self.stage) if compiled else None
        self._run = np.zeros(1, RUN)
        self.rig = self._rig = MotionRig(context)
        for side, name in NAMES.items():
            self._rig.router.send_from(name, hello("agent", side))
        self._rig.drain(lambda: 0)
        self.received()

    def received(self) -> list[Any]:
        """The messages sent to both agents."""
        return [self._rig.router.received_by(name) for name in NAMES.values()]

    def send(self, seq: int) -> None:
        """Send a sample of each agent in its fixed form, with the stylus at rest and the device armed."""
        numbers = (seq, seq * TICK_NS, *(0.0,) * 6, 0, int(Safeguard.ARMED), 0.0, -1, *(0,) * 4)
        words = np.frombuffer(fixed.packer_of(Stylus).pack(*numbers), np.int64)
        frame = np.zeros(fixed.STYLUS.size, np.uint8)
        fixed.write(frame, fixed.STYLUS, words)
        for name in NAMES.values():
            self.rig.router.send_from(name, frame.tobytes())

    @property
    def progress(self) -> Any:
        """The run, a record of RUN."""
        return self._run[0]

    def run(self, number: int, due_ns: int, until: int, *, sleeps: bool = False, in_trial: bool = True) -> int:
        """Run ticks in one call, and return why it has ended."""
        assert self._ticks is not None
        run = self.progress
        run["number"], run["due_ns"], run["until"], run["sleeps"] = number, due_ns, until, sleeps
        run["forces"], (run["relevant"], run["fine"]) = self._forces and in_trial, IN_TRIAL if in_trial else WAITING
        scene = (self.state, self.rows, self.words, self.stage.book, self.stage.tables)
        return self._rig.port.undisturbed_ticks(self._ticks, scene, self._run, self.stage.delay)()

    def tick(self, number: int, due_ns: int, samples: dict[str, Stylus], command: int) -> bytes:
        """Run a tick with these samples, and return its row."""
        port, words = self._rig.port, self.words[number % ROWS]
        for side, sample in samples.items():
            self._rig.router.send_from(NAMES[side], sample)
        self._rig.drain(lambda: due_ns - 300_000, due_ns)
        self._rig.port.fast.record["simulated_ns"] = due_ns + 7
        found = -1
        if self._ticks is not None and not command:
            ended = self.run(number, due_ns, number + 1)
            assert ended in (DONE, STEPS)
            self.answered += ended == DONE
            found = int(self.progress["found"])
            if ended == DONE:
                return words.tobytes()
        found = port.fill(words, number, due_ns, 7) if found < 0 else found
        words[(TICK.names or ()).index("command")] = command
        self.stage.advance(self.state, self.rows, number)
        if self._forces:
            port.force(words, self.stage.commanded_row(self.words, number))
        else:
            port.send_heartbeat(number)
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


@pytest.mark.parametrize(
    ("force", "delay", "catch"), [("full", 0, ()), ("full", 3, ()), ("full", 3, (1,)), ("none", 0, ())]
)
def test_compiled_tick_equals_the_single_steps(force: Any, delay: int, catch: tuple[int, ...]) -> None:
    plain = Config()
    config = replace(plain, block=replace(plain.block, force=force, force_delay_ms=delay, catch=catch, trials=2))
    rng, sent = np.random.default_rng(7), 0
    with sockets.open_context() as context:
        runners = [TickRunner(context, config, compiled=compiled) for compiled in (True, False)]
        for number in range(TICKS):
            samples = samples_at(number, rng)
            command = int(Cause.START) if number == STARTS_AT else 0
            rows = [runner.tick(number, (number + 1) * TICK_NS, samples, command) for runner in runners]
            assert rows[0] == rows[1]
            first, second = (runner.received() for runner in runners)
            assert first == second
            kind = Force if force == "full" else Heartbeat
            sent += sum(isinstance(message, kind) for messages in first for message in messages)
        assert runners[0].state.tobytes() == runners[1].state.tobytes()
        assert 0.7 * TICKS < runners[0].answered < TICKS  # both paths were used
        assert sent == 2 * TICKS / (1 if force == "full" else HEARTBEAT_TICKS)


DUE_NS = 11 * TICK_NS
"""Deadline of the next tick in simulated time [ns]."""


@pytest.fixture
def felt() -> Iterator[TickRunner]:
    """A trial with haptic feedback whose next tick, number 10, is due at `DUE_NS`."""
    with trial_of(Config()) as runner:
        yield runner


@contextmanager
def trial_of(config: Config) -> Iterator[TickRunner]:
    """Begin a trial of a block with haptic feedback."""
    with sockets.open_context() as context:
        runner = TickRunner(context, replace(config, block=replace(config.block, force="full")), compiled=True)
        for number in range(10):
            command = int(Cause.START) if number == STARTS_AT else 0
            runner.send(number)
            runner.tick(number, (number + 1) * TICK_NS, {}, command)
        runner.received()
        yield runner


def at(runner: TickRunner, now: int) -> None:
    """Set the simulated time [ns]."""
    runner.rig.port.fast.record["simulated_ns"] = now


def test_run_waits_for_the_samples_that_a_tick_needs(felt: TickRunner) -> None:
    at(felt, DUE_NS - 400_000)
    assert felt.run(10, DUE_NS, 20) == WAITS
    assert (felt.progress["number"], felt.progress["wake_ns"]) == (10, DUE_NS)
    felt.send(10)
    assert felt.run(10, DUE_NS, 20) == WAITS  # for the samples of the tick after
    assert felt.progress["number"] == 11
    assert felt.progress["wake_ns"] == felt.progress["due_ns"] == DUE_NS + TICK_NS
    assert [[message.tick for message in messages] for messages in felt.received()] == [[10], [10]]


def test_tick_whose_samples_come_early_waits_until_it_may_begin(felt: TickRunner) -> None:
    felt.send(10)
    at(felt, DUE_NS - 600_000)
    assert felt.run(10, DUE_NS, 20) == WAITS
    assert (felt.progress["number"], felt.progress["wake_ns"]) == (10, DUE_NS - EARLIEST_NS)


def test_tick_runs_at_its_deadline_without_new_samples(felt: TickRunner) -> None:
    at(felt, DUE_NS)
    assert felt.run(10, DUE_NS, 20) == WAITS
    assert felt.progress["number"] == 11
    assert felt.rows["left_seq"][10] == 9  # the newest that there is


def test_run_ends_before_the_tick_at_which_other_work_is_due(felt: TickRunner) -> None:
    at(felt, DUE_NS + 3 * TICK_NS)
    assert felt.run(10, DUE_NS, 12) == DONE
    assert (felt.progress["number"], felt.progress["late_ticks"]) == (12, 2)
    assert felt.run(12, DUE_NS + 2 * TICK_NS, 12) == DONE
    assert felt.progress["number"] == 12


def test_run_that_is_too_late_ends_before_a_tick_begins(felt: TickRunner) -> None:
    at(felt, DUE_NS + (CATCH_UP_TICKS + 1) * TICK_NS)
    assert felt.run(10, DUE_NS, 20) == INTERRUPTED
    assert felt.progress["number"] == 10


def test_message_of_an_agent_ends_a_run(felt: TickRunner) -> None:
    at(felt, DUE_NS - 400_000)
    felt.rig.router.send_from(NAMES["left"], Goodbye("switched off"))
    assert felt.run(10, DUE_NS, 20) == MESSAGE
    felt.rig.port.read_other_frame(DUE_NS, DUE_NS)
    assert felt.rig.port.agents["left"].hello is None
    at(felt, DUE_NS)
    assert felt.run(10, DUE_NS, 20) == STEPS  # the tick has no sample of the left hand


def test_message_that_follows_early_samples_is_read(felt: TickRunner) -> None:
    felt.send(10)
    at(felt, DUE_NS - 600_000)
    assert felt.run(10, DUE_NS, 20) == WAITS  # both samples are there, but the tick may not begin yet
    felt.rig.router.send_from(NAMES["left"], Goodbye("switched off"))
    felt.send(11)
    assert felt.run(10, DUE_NS, 20) == MESSAGE
    felt.rig.port.read_other_frame(DUE_NS, DUE_NS)
    assert felt.rig.port.agents["left"].hello is None


def test_frame_of_an_unregistered_peer_ends_a_run(felt: TickRunner) -> None:
    at(felt, DUE_NS - 400_000)
    felt.rig.router.send_from(b"stranger@1", hello("agent", "left"))
    assert felt.run(10, DUE_NS, 20) == INTERRUPTED
    assert felt.rig.port.unhandled


def test_run_between_trials_sends_no_force_and_needs_no_sample(felt: TickRunner) -> None:
    at(felt, DUE_NS + 60 * TICK_NS)  # longer than a sample counts
    assert felt.run(10, DUE_NS + 60 * TICK_NS, 11) == STEPS
    assert felt.run(10, DUE_NS + 60 * TICK_NS, 11, in_trial=False) == DONE
    assert felt.received() == [[], []]
    at(felt, DUE_NS + 64 * TICK_NS)
    assert felt.run(11, DUE_NS + 60 * TICK_NS, 16, in_trial=False) == DONE
    assert [[(type(m), m.tick, m.arm) for m in messages] for messages in felt.received()] == [
        [(Heartbeat, 12, False)]
    ] * 2


def run_until(runner: TickRunner, field: str) -> int:
    """Run up to 20 ticks at a time until a field of the newest row is set; return the number of the next tick."""
    number, most = 10, 10 + 2 * round(Config().task.level_time * 1000)
    while not runner.rows[field][(number - 1) % ROWS]:
        assert number < most
        runner.send(number)
        at(runner, (number + 1) * TICK_NS)
        assert runner.run(number, (number + 1) * TICK_NS, number + 20) in (DONE, WAITS)
        number = int(runner.progress["number"])
    return number


def test_event_ends_a_run(felt: TickRunner) -> None:
    number = run_until(felt, "event")
    assert felt.progress["until"] == number


def test_beginning_of_a_perturbation_ends_a_run() -> None:
    """Its event has the tick at which it begins, and its trigger is sent at once."""
    pushed = replace(Config(), perturbation=Perturbation(at="ball", time=0.013, trials=(1,)))
    with trial_of(pushed) as runner:
        number = run_until(runner, "perturbation")
        assert runner.progress["until"] == number
        assert runner.rows["perturbed_ticks"][(number - 1) % ROWS] == 0


def test_run_sleeps_between_its_ticks(felt: TickRunner) -> None:
    at(felt, MACHINE_CLOCK)
    felt.send(10)
    begun = now_ns()
    assert felt.run(10, begun + TICK_NS, 18, sleeps=True) == DONE
    assert now_ns() - begun >= 7 * TICK_NS
    assert felt.progress["number"] == 18
    assert (felt.rows["late_ns"][11:18] >= 0).all()  # no sample came, so each began at its deadline
    assert [len(messages) for messages in felt.received()] == [8, 8]


def test_watched_socket_ends_the_sleep_of_a_run(felt: TickRunner) -> None:
    reader, writer = os.pipe()
    os.write(writer, b"x")
    at(felt, MACHINE_CLOCK)
    felt.rig.port.fast.watch(reader)
    assert felt.run(10, now_ns() + 5 * TICK_NS, 20, sleeps=True) == INTERRUPTED
    assert felt.progress["number"] == 10
    for file in (reader, writer):
        os.close(file)
