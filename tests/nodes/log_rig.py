"""A log port with a fake socket, a clock and a spill, and its peers."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from fake_router import WELCOME, FakeRouter, hello

from fakes import FakeClock
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.joining import Ping, Welcome
from netboard.network.protocol.messages import Message
from netboard.network.protocol.records import LogAck, LogBatch, LogRequest, TickRecord
from netboard.nodes.ports.log_port import LogPort
from netboard.nodes.ports.subscribers import SILENCE_TIMEOUT_NS
from netboard.recording.recovery.spill import Spill

L, M = b"logger@1", b"logger@2"

TIMEOUT = 60.0
"""Timeout, far above the usual time of writing to the disk [s]."""


class Rig:
    """A port with its fake socket, a clock and a spill."""

    def __init__(self, folder: Path, capacity: int = 1000, room: int = 1000, spill_bytes: int = 10**7) -> None:
        self.router = FakeRouter(room)
        self.clock = FakeClock()
        self.spill = Spill(folder / "a.spill", WELCOME, spill_bytes)
        self.port = LogPort(self.router, WELCOME, capacity, self.spill, self.clock)  # type: ignore[arg-type]

    def record(self, count: int, pump_each: int = 0) -> None:
        for k in range(count):
            self.port.append(encode(TickRecord(str(self.port.ring.next).encode())))
            if pump_each and k % pump_each == 0:
                self.port.pump(self.clock())

    def pump(self, peer: bytes, *messages: Message) -> list[Message]:
        """Send messages of a peer, pump the port, and return the peer's answers except clock probes."""
        for message in messages:
            self.router.send_from(peer, message)
        self.port.pump(self.clock())
        return [message for message in self.router.received_by(peer) if not isinstance(message, Ping)]

    def join(self, peer: bytes, first: int = -1) -> list[Message]:
        """Connect a logger and request its records."""
        assert isinstance(self.pump(peer, hello("logger", name=peer.decode()))[0], Welcome)
        return self.pump(peer, LogRequest(first))

    def catch_up(self, peer: bytes, messages: list[Message], last: int, before: Sequence[int] = ()) -> list[int]:
        """Numbers of all records that a logger receives up to the last one, however slow the disk is."""
        received = [*before, *self.numbers(messages)]

        def arrived() -> bool:
            received.extend(self.numbers(self.pump(peer)))
            return received[-1:] == [last]

        self.until(lambda: received[-1:] == [last] or arrived())
        return received

    def until(self, condition: Callable[[], bool]) -> None:
        """Let the spill's thread run until a condition holds."""
        end = time.monotonic() + TIMEOUT
        while time.monotonic() < end:
            if condition():
                return
            if self.spill._thread is not None:
                self.spill._thread.join(1e-4)
        raise AssertionError("timed out")

    def fill_spill(self, count: int) -> None:
        """Connect and disconnect a logger, and create many records after that."""
        self.join(L)
        self.pump(L, LogAck(0, 10**12, "a.mcap", 0))
        self.clock.advance(2 * SILENCE_TIMEOUT_NS * 1e-9)
        for start in range(0, count, 1000):  # which would take a second in real time
            self.record(min(1000, count - start), pump_each=20)
            self.until(lambda: not self.spill._unwritten or bool(self.spill.trouble))
        assert self.port.loggers == 0

    def names(self) -> list[str]:
        return [name for name, _ in self.port.news]

    def numbers(self, messages: list[Message]) -> list[int]:
        """Numbers of all records in the batches; checks that each record has the right number."""
        received = []
        for batch in messages:
            assert isinstance(batch, LogBatch)
            for offset, record in enumerate(batch.records):
                tick = decode(record)
                assert isinstance(tick, TickRecord)
                assert int(tick.row) == batch.first + offset
                received.append(batch.first + offset)
        return received


def close_rig(rig: Rig) -> None:
    """Close the port and wait for the spill."""
    rig.port.close()
    if rig.spill._thread is not None:
        rig.spill._thread.join(30)
    assert rig.port.store.closed
