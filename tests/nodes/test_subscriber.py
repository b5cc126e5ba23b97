"""A subscriber of the log at a real port in memory: its records, its known losses, and its clock."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fake_router import FakeRouter
from numpy.typing import NDArray

from fakes import FakeClock
from netboard.base.tick import TICK
from netboard.network.protocol.codec import encode
from netboard.network.protocol.joining import Goodbye, Refusal, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.network.protocol.records import ClockRecord, EventRecord, LogBatch, TickRecord
from netboard.nodes.logger.subscriber import EARLY_WELCOME_NS, Subscriber
from netboard.nodes.ports.log_port import LogPort
from netboard.nodes.ports.subscribers import SILENCE_TIMEOUT_NS
from netboard.recording.recovery.spill import Spill

NAME = b"listener@1"
AHEAD_NS = 5_000_000_000


class Server:
    """A server's end of the log, with a session that makes records."""

    def __init__(self, folder: Path, session: str, clock: FakeClock, capacity: int = 1000) -> None:
        welcome = Welcome(session, PROTOCOL_VERSION, clock(), "")
        self.router = FakeRouter()
        self.clock = clock
        self.port = LogPort(self.router, welcome, capacity, Spill(folder / session, welcome, 0), clock)  # type: ignore[arg-type]
        self.ticks = self.events = 0

    def tick(self, count: int) -> None:
        for _ in range(count):
            row = np.zeros(1, TICK)
            row["tick"], row["time_ns"] = self.ticks, self.clock()
            self.port.append(encode(TickRecord(row.tobytes())))
            self.ticks += 1

    def event(self, name: str) -> None:
        self.port.append(encode(EventRecord(self.events, self.ticks, self.clock(), name, {"a": "b"})))
        self.events += 1

    def note_clocks(self) -> None:
        for record in self.port.clock_records(0):
            self.port.append(encode(record))


class PortLink:
    """The log channel to a server's port in memory; each wait advances the clock."""

    def __init__(self, clock: FakeClock) -> None:
        self.server: Server | None = None
        self.clock = clock
        self.cut = False

    def wait(self, seconds: float) -> bool:
        self.clock.advance(seconds)
        if self.server is not None:
            self.server.port.pump(self.clock())
        return True

    def receive(self) -> bytes | None:
        frames = [] if self.server is None or self.cut else self.server.router.sent.get(NAME, [])
        return frames.pop(0) if frames else None

    def send(self, frame: bytes) -> bool:
        if self.server is None or self.cut:
            return False
        self.server.router.send_from(NAME, frame)
        return True


class RecordingSink:
    """Stores what a listener reports."""

    def __init__(self) -> None:
        self.sessions: list[str] = []
        self.clocks: list[tuple[int, int]] = []
        self.lost: list[tuple[int, int]] = []
        self.ticks: list[int] = []
        self.events: list[str] = []

    def begin(self, welcome: Welcome) -> None:
        self.sessions.append(welcome.session)

    def set_clock(self, offset_ns: int, bound_ns: int) -> None:
        self.clocks.append((offset_ns, bound_ns))

    def report_lost(self, first: int, count: int) -> None:
        self.lost.append((first, count))

    def take(self, ticks: NDArray[Any], events: list[EventRecord]) -> None:
        self.ticks += ticks["tick"].tolist()
        self.events += [event.name for event in events]


class Rig:
    """A listener whose clock is ahead of the server's, and its link."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.clock = FakeClock()
        self.link = PortLink(self.clock)
        self.sink = RecordingSink()
        self.subscriber = Subscriber(self.link, self.sink, "a test", lambda: self.clock() + AHEAD_NS)

    def serve(self, session: str, capacity: int = 1000) -> Server:
        self.link.server = Server(self.folder, session, self.clock, capacity)
        return self.link.server

    def step(self, count: int) -> None:
        for _ in range(count):
            self.subscriber.step()


@pytest.fixture
def rig(tmp_path: Path) -> Rig:
    return Rig(tmp_path)


def test_late_listener_receives_records_from_then_on(rig: Rig) -> None:
    server = rig.serve("one")
    server.tick(10)
    rig.step(3)
    server.tick(5)
    server.event("start")
    server.tick(1)
    rig.step(3)
    assert (rig.sink.ticks, rig.sink.events) == ([10, 11, 12, 13, 14, 15], ["start"])
    assert (rig.sink.sessions, rig.sink.lost) == (["one"], [])


def test_listener_waiting_for_the_server_receives_every_record(rig: Rig) -> None:
    rig.step(int(EARLY_WELCOME_NS / 20e6) + 1)
    server = rig.serve("one")
    server.event("block_began")
    server.tick(300)
    rig.step(30)
    assert (rig.sink.ticks, rig.sink.events) == (list(range(300)), ["block_began"])


def test_listener_receives_the_next_session_from_its_start(rig: Rig) -> None:
    rig.serve("one").tick(10)
    rig.step(3)
    rig.link.server = None
    rig.step(100)
    rig.serve("two").tick(7)
    rig.step(100)
    assert rig.sink.sessions == ["one", "two"]
    assert rig.sink.ticks == list(range(7))
    assert rig.sink.lost == []


def test_lost_link_loses_no_record_still_in_the_ring_buffer(rig: Rig) -> None:
    server = rig.serve("one")
    rig.step(3)
    server.tick(10)
    rig.step(3)
    rig.link.cut = True
    server.tick(20)
    rig.step(int(2 * SILENCE_TIMEOUT_NS / 20e6))
    assert len(server.port.subscribers) == 0
    server.router.sent.clear()
    rig.link.cut = False
    server.tick(20)
    rig.step(60)
    assert rig.sink.ticks == list(range(50))
    assert rig.sink.lost == []


def test_missed_records_are_reported(rig: Rig) -> None:
    server = rig.serve("one", capacity=100)
    rig.step(3)
    server.tick(10)
    rig.step(3)
    server.tick(500)
    rig.step(3)
    assert rig.sink.lost == [(10, 400)]
    assert rig.subscriber.lost == 400
    assert rig.sink.ticks == [*range(10), *range(410, 510)]


def test_repeated_records_are_delivered_once(rig: Rig) -> None:
    server = rig.serve("one")
    rig.step(3)
    server.tick(10)
    rig.step(3)
    server.router.send(NAME, encode(server.port.ring.batch(4, 100, 10**6)))
    server.tick(2)
    rig.step(3)
    assert rig.sink.ticks == list(range(12))
    assert rig.sink.lost == []


def test_unreadable_records_are_reported_as_lost(rig: Rig) -> None:
    server = rig.serve("one")
    rig.step(3)
    server.tick(1)
    server.port.append(b"\xc1")
    server.port.append(encode(TickRecord(b"too short")))
    server.tick(1)
    server.router.send(NAME, b"nonsense")
    rig.step(3)
    assert rig.sink.ticks == [0, 1]
    assert rig.sink.lost == [(1, 1), (2, 1)]


def test_clock_record_gives_the_offset_of_the_listener(rig: Rig) -> None:
    server = rig.serve("one")
    rig.step(60)
    server.note_clocks()
    server.port.append(encode(ClockRecord(0, "listener", 1, 2, 3, 4, 77, 1, 0.0)))
    rig.step(3)
    ((offset_ns, bound_ns),) = rig.sink.clocks
    assert abs(offset_ns - AHEAD_NS) <= bound_ns < 30_000_000


def test_records_before_welcome_are_ignored_and_goodbye_triggers_hello(rig: Rig) -> None:
    server = rig.serve("one")
    server.router.send(NAME, encode(LogBatch(0, 0, (encode(TickRecord(np.zeros(1, TICK).tobytes())),))))
    rig.step(1)
    assert rig.sink.ticks == []
    rig.step(3)
    server.router.send(NAME, encode(Goodbye("the session is over")))
    rig.step(40)
    assert len(server.port.subscribers) == 1
    assert rig.sink.sessions == ["one"]


def test_refusal_is_logged_once_and_the_connection_retried(rig: Rig, caplog: pytest.LogCaptureFixture) -> None:
    server = rig.serve("one")
    server.router.forbidden = "the key has been revoked"
    rig.step(200)
    assert [record.message for record in caplog.records if "refused" in record.message] == [
        "the server refused the connection: the key has been revoked"
    ]
    server.router.forbidden = ""
    rig.step(60)
    assert rig.sink.sessions == ["one"]


def test_stopped_listener_sends_goodbye(rig: Rig) -> None:
    server = rig.serve("one")
    rig.step(3)
    rig.subscriber.run(lambda: True)
    server.port.pump(rig.clock())
    assert len(server.port.subscribers) == 0
    assert not [message for message in server.router.received_by(NAME) if isinstance(message, Refusal)]
