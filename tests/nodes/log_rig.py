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
from netboard.nodes.ports.log_port import SILENCE_TIMEOUT_NS, LogPort
from netboard.recording.recovery.spill import Spill

L, M = b"logger@1", b"logger@2"

TIMEOUT = 60.0
"""The disk has written what it was given long before [s]."""


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

    def pump(self, peer: bytes, *says: Message) -> list[Message]:
        """What a peer hears after it has said something; clock probes apart."""
        for message in says:
            self.router.say(peer, message)
        self.port.pump(self.clock())
        return [message for message in self.router.heard(peer) if not isinstance(message, Ping)]

    def join(self, peer: bytes, first: int = -1) -> list[Message]:
        """Let a logger come and ask."""
        assert isinstance(self.pump(peer, hello("logger", name=peer.decode()))[0], Welcome)
        return self.pump(peer, LogRequest(first))

    def catch_up(self, peer: bytes, heard: list[Message], last: int, before: Sequence[int] = ()) -> list[int]:
        """Numbers of all records a logger gets until it has one, however long the disk takes."""
        got = [*before, *self.numbers(heard)]

        def arrived() -> bool:
            got.extend(self.numbers(self.pump(peer)))
            return got[-1:] == [last]

        self.until(lambda: got[-1:] == [last] or arrived())
        return got

    def until(self, what: Callable[[], bool]) -> None:
        """Let the spill's thread work until something holds."""
        end = time.monotonic() + TIMEOUT
        while time.monotonic() < end:
            if what():
                return
            if self.spill._thread is not None:
                self.spill._thread.join(1e-4)
        raise AssertionError("waited in vain")

    def fill_spill(self, count: int) -> None:
        """Let a logger come and go, and many records be made after that."""
        self.join(L)
        self.pump(L, LogAck(0, 10**12, "a.mcap", 0))
        self.clock.advance(2 * SILENCE_TIMEOUT_NS * 1e-9)
        for start in range(0, count, 1000):  # which would take a second in earnest
            self.record(min(1000, count - start), pump_each=20)
            self.until(lambda: not self.spill._unwritten or bool(self.spill.trouble))
        assert self.port.loggers == 0

    def names(self) -> list[str]:
        return [name for name, _ in self.port.news]

    def numbers(self, heard: list[Message]) -> list[int]:
        """Numbers of all records in the batches, checking that each is what it says it is."""
        got = []
        for batch in heard:
            assert isinstance(batch, LogBatch)
            for offset, record in enumerate(batch.records):
                tick = decode(record)
                assert isinstance(tick, TickRecord)
                assert int(tick.row) == batch.first + offset
                got.append(batch.first + offset)
        return got


def end(rig: Rig) -> None:
    """Let the spill be done."""
    rig.port.close()
    if rig.spill._thread is not None:
        rig.spill._thread.join(30)
    assert rig.port.store.closed
