"""The server's ports handle any message from any peer at any time, and their reports can be recorded."""

import random
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from fake_router import WELCOME, WELCOMES, FakeRouter, hello
from motion_rig import MotionRig

from evidence.faults.malformed_frames import MalformedFrames, valid_frames
from fakes import STATUS, Answers, FakeClock
from netboard.base.config import SIDES
from netboard.base.tick import TICK
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
MESSAGES = 1500
MS, SECOND = 1_000_000, 1_000_000_000
TIME_STEPS_NS = (0, 0, 0, 1, MS, MS, 20 * MS, 60 * MS, 600 * MS, 3 * SECOND)
INTEGERS = (0, 1, -1, 5, 1000, 2**40, 2**60, 2**63 - 1, -(2**63))


def well_formed_message(rng: random.Random, now_ns: int) -> Message:
    """Return a well-formed message, whose contents may be valid or not."""

    def number() -> int:
        return rng.choice((*INTEGERS, now_ns, now_ns - MS, rng.randrange(100)))

    def quantity() -> float:
        return rng.choice((0.0, 0.01, -1e300, float("nan"), float("inf")))

    role, side = rng.choice(("agent", "display", "logger", "console")), rng.choice(("left", "right", ""))
    makers: tuple[Callable[[], Message], ...] = (
        lambda: hello(role, side if role in ("agent", "display") else "", rng.choice(("x", "y\n" * 2000))),
        lambda: hello(role, side),
        lambda: Goodbye("done"),
        lambda: Stylus(
            *(number(), number()),
            *(quantity() for _ in range(6)),
            *(number(), rng.choice((1, 255, -1)), quantity()),
            *(number() for _ in range(5)),
        ),
        lambda: Pong(number(), number(), number()),
        lambda: Frames(rng.choice(("left", "right")), ((number(), number(), number()),) * 3, number()),
        lambda: LogRequest(number()),
        lambda: LogAck(number(), number(), "", number()),
        lambda: Command(rng.choice(("start", "stop", "abort")), "", number()),
        StatusRequest,
    )
    return rng.choice(makers)()


def random_messages(rng: random.Random, clock: FakeClock) -> Iterator[tuple[bytes, Message | bytes]]:
    """Yield peers with a well-formed or malformed message each, and advance the clock."""
    malformed = MalformedFrames(valid_frames(rng.randrange(1000)), rng.randrange(1000))
    while True:
        clock.now_ns += rng.choice(TIME_STEPS_NS)
        message = next(malformed) if rng.random() < 0.3 else well_formed_message(rng, clock.now_ns)
        yield rng.choice(PEERS), message


def require_recordable(news: list[tuple[str, dict[str, str]]], records: list[ClockRecord]) -> None:
    """Encode the port's events and clock records as the server does."""
    for name, details in news:
        encode(EventRecord(0, 0, 0, name, details))
    for record in records:
        encode(record)
    news.clear()


@pytest.mark.parametrize("seed", SEEDS)
def test_motion_port_handles_any_message(seed: int) -> None:
    rng, clock = random.Random(seed), FakeClock()
    with sockets.open_context() as context:
        rig = MotionRig(context)
        port, router = rig.port, rig.router
        row = np.zeros(1, TICK)
        for tick, (peer, message) in enumerate(islice(random_messages(rng, clock), MESSAGES)):
            router.send_from(peer, message)
            rig.drain(clock, clock.now_ns)
            port.refusals.poll(clock.now_ns)
            port.fill(row.view(np.int64), tick, clock.now_ns, 0)
            assert np.isfinite(row["left_sent_z"] + row["right_sent_z"]) or not (row["left_live"] and row["right_live"])
            port.send_heartbeat(tick)
            port.force(row.view(np.int64), row.view(np.int64))
            router.received_by(peer)
            if tick % 5 == 0:
                port.expire(clock.now_ns)
                port.find_missing(clock.now_ns, SIDES)
                encode(replace(STATUS, links=tuple(port.links(clock.now_ns))))
                require_recordable(port.news, port.clock_records(tick))
            registered = [agent.peer for agent in port.agents.values() if agent.hello is not None]
            assert len(set(registered)) == len(registered)
            assert port.empty == (not registered)


@pytest.mark.parametrize("seed", SEEDS)
def test_control_port_handles_any_message(seed: int) -> None:
    rng, clock, router = random.Random(seed), FakeClock(), FakeRouter(room=50)
    port = ControlPort(router, WELCOMES)  # type: ignore[arg-type]
    for tick, (peer, message) in enumerate(islice(random_messages(rng, clock), MESSAGES)):
        router.send_from(peer, message)
        port.drain(clock)
        port.pump(clock.now_ns)
        if tick % 5 == 0:
            encode(replace(STATUS, links=tuple(port.links(clock.now_ns))))
            require_recordable(port.news, port.clock_records(tick))
            port.answer(Answers())
            for frame in port.take_frames(3):
                encode(frame)
            router.sent.clear()
        assert {request.command.name for request in port.requests} <= set(COMMANDS)


@pytest.mark.parametrize("seed", SEEDS)
def test_log_port_handles_any_message(seed: int, tmp_path: Path) -> None:
    rng, clock, router = random.Random(seed), FakeClock(), FakeRouter(room=50)
    port = LogPort(router, WELCOME, 500, Spill(tmp_path / "a.spill", WELCOME, 10**6), clock)  # type: ignore[arg-type]
    for tick, (peer, message) in enumerate(islice(random_messages(rng, clock), MESSAGES)):
        port.append(encode(TickRecord(b"x" * 100)))
        router.send_from(peer, message)
        port.read_if_needed(clock.now_ns)
        port.pump(clock.now_ns)
        if tick % 5 == 0:
            encode(replace(STATUS, links=tuple(port.links(clock.now_ns))))
            require_recordable(port.news, port.clock_records(tick))
            router.sent.clear()
        assert 0 <= port.ring.acknowledged <= port.ring.next
        assert port.ring.next == tick + 1
    port.end()
    port.close()
