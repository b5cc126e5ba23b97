"""The server's ports, told anything by anybody at any time: they never fail, and what they tell can be recorded."""

import random
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from fake_router import WELCOME, FakeRouter, hello
from motion_rig import MotionRig

from fakes import STATUS, Answers, FakeClock
from netboard.base.config import SIDES
from netboard.base.tick import TICK
from netboard.benchmarks.faults.mutants import Mutants, true_frames
from netboard.network.protocol.codec import encode
from netboard.network.protocol.control import COMMANDS, Command, StatusRequest
from netboard.network.protocol.joining import Goodbye, Pong
from netboard.network.protocol.messages import Message
from netboard.network.protocol.motion import Stylus
from netboard.network.protocol.records import ClockRecord, EventRecord, LogAck, LogRequest, TickRecord
from netboard.network.protocol.views import Frames
from netboard.network.transport import sockets
from netboard.nodes.ports.control_port import ControlPort
from netboard.nodes.ports.log_port import LogPort
from netboard.recording.recovery.spill import Spill

PEERS = (b"agent.left@1", b"b", b"\x01\xff\n", b"agent.left@2")
SEEDS = range(12)
WORDS = 1500
MS, SECOND = 1_000_000, 1_000_000_000
SPANS = (0, 0, 0, 1, MS, MS, 20 * MS, 60 * MS, 600 * MS, 3 * SECOND)
BIG = (0, 1, -1, 5, 1000, 2**40, 2**60, 2**63 - 1, -(2**63))


def plausible(chance: random.Random, now_ns: int) -> Message:
    """A message that is right in form, and may be right in fact."""

    def number() -> int:
        return chance.choice((*BIG, now_ns, now_ns - MS, chance.randrange(100)))

    def quantity() -> float:
        return chance.choice((0.0, 0.01, -1e300, float("nan"), float("inf")))

    role, side = chance.choice(("agent", "display", "logger", "console")), chance.choice(("left", "right", ""))
    makers: tuple[Callable[[], Message], ...] = (
        lambda: hello(role, side if role in ("agent", "display") else "", chance.choice(("x", "y\n" * 2000))),
        lambda: hello(role, side),
        lambda: Goodbye("done"),
        lambda: Stylus(
            *(number(), number()),
            *(quantity() for _ in range(6)),
            *(number(), chance.choice((1, 255, -1)), quantity()),
            *(number() for _ in range(5)),
        ),
        lambda: Pong(number(), number(), number()),
        lambda: Frames(chance.choice(("left", "right")), ((number(), number(), number()),) * 3, number()),
        lambda: LogRequest(number()),
        lambda: LogAck(number(), number(), "", number()),
        lambda: Command(chance.choice(("start", "stop", "abort")), "", number()),
        StatusRequest,
    )
    return chance.choice(makers)()


def said(chance: random.Random, clock: FakeClock) -> Iterator[tuple[bytes, Message | bytes]]:
    """Who says what, as time goes by."""
    mutants = Mutants(true_frames(chance.randrange(1000)), chance.randrange(1000))
    while True:
        clock.now_ns += chance.choice(SPANS)
        word = next(mutants) if chance.random() < 0.3 else plausible(chance, clock.now_ns)
        yield chance.choice(PEERS), word


def recordable(news: list[tuple[str, dict[str, str]]], records: list[ClockRecord]) -> None:
    """Record it all as the server does."""
    for name, details in news:
        encode(EventRecord(0, 0, 0, name, details))
    for record in records:
        encode(record)
    news.clear()


@pytest.mark.parametrize("seed", SEEDS)
def test_the_motion_port(seed: int) -> None:
    chance, clock = random.Random(seed), FakeClock()
    with sockets.open_context() as context:
        rig = MotionRig(context)
        port, router = rig.port, rig.router
        row = np.zeros(1, TICK)
        for tick, (peer, word) in enumerate(islice(said(chance, clock), WORDS)):
            router.say(peer, word)
            rig.drain(clock, clock.now_ns)
            port.refusals.look(clock.now_ns)
            port.fill(row.view(np.int64), tick, clock.now_ns, 0)
            assert np.isfinite(row["left_sent_z"] + row["right_sent_z"]) or not (row["left_live"] and row["right_live"])
            port.beat(tick, clock.now_ns)
            port.force(row.view(np.int64), row.view(np.int64))
            router.heard(peer)
            if tick % 5 == 0:
                port.expire(clock.now_ns)
                port.lacks(clock.now_ns, SIDES)
                encode(replace(STATUS, links=tuple(port.links(clock.now_ns))))
                recordable(port.news, port.clock_records(tick))
            registered = [agent.peer for agent in port.agents.values() if agent.hello is not None]
            assert len(set(registered)) == len(registered)
            assert port.empty == (not registered)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_control_port(seed: int) -> None:
    chance, clock, router = random.Random(seed), FakeClock(), FakeRouter(room=50)
    port = ControlPort(router, WELCOME)  # type: ignore[arg-type]
    for tick, (peer, word) in enumerate(islice(said(chance, clock), WORDS)):
        router.say(peer, word)
        port.drain(clock)
        port.pump(clock.now_ns)
        if tick % 5 == 0:
            encode(replace(STATUS, links=tuple(port.links(clock.now_ns))))
            recordable(port.news, port.clock_records(tick))
            port.answer(Answers())
            for frame in port.take_frames(3):
                encode(frame)
            router.sent.clear()
        assert {request.command.name for request in port.requests} <= set(COMMANDS)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_log_port(seed: int, tmp_path: Path) -> None:
    chance, clock, router = random.Random(seed), FakeClock(), FakeRouter(room=50)
    port = LogPort(router, WELCOME, 500, Spill(tmp_path / "a.spill", WELCOME, 10**6), clock)  # type: ignore[arg-type]
    for tick, (peer, word) in enumerate(islice(said(chance, clock), WORDS)):
        port.append(encode(TickRecord(b"x" * 100)))
        router.say(peer, word)
        port.listen(clock.now_ns)
        port.pump(clock.now_ns)
        if tick % 5 == 0:
            encode(replace(STATUS, links=tuple(port.links(clock.now_ns))))
            recordable(port.news, port.clock_records(tick))
            router.sent.clear()
        assert 0 <= port.ring.acknowledged <= port.ring.next
        assert port.ring.next == tick + 1
    port.end()
    port.close()
