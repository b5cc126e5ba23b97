"""A subscriber to the log: receives every record as it is made, stores nothing and acknowledges nothing.

Records are numbered, so missed records are known and reported. A subscriber that was started before the server receives
the session from its first record; otherwise it receives the records from then on. It reconnects without a timeout. The
records include the server's probes of this machine's clock, which give the offset.
"""

import logging
from collections import deque
from collections.abc import Callable
from importlib.metadata import version
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from netboard.base.clock import now_ns
from netboard.base.errors import WireError
from netboard.base.process import NAME, RateLimitedLog
from netboard.base.tick import TICK
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.joining import Goodbye, Hello, Ping, Pong, Refusal, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.network.protocol.records import (
    ClockRecord,
    EventRecord,
    LogBatch,
    LogRequest,
    TickRecord,
    kind_of_peer,
)
from netboard.nodes.logger.log_link import BURST, HELLO_INTERVAL_NS, SILENCE_TIMEOUT_NS, WAIT_SECONDS, Link
from netboard.recording.format.channels import record_of

log = logging.getLogger(__name__)

EARLY_WELCOME_NS = 3_000_000_000
"""A welcome within this time of the start means that the server was already running [ns]."""

ANSWERS = 64
"""Answers to the server's probes that are remembered: those of 10 s or more [1]."""


class RecordReceiver(Protocol):
    """Receiver of a subscriber's records."""

    def begin(self, welcome: Welcome) -> None:
        """Begin another session of the server."""

    def set_clock(self, offset_ns: int, bound_ns: int) -> None:
        """Take the offset of this machine's clock from the server's, and its error bound [ns]."""

    def report_lost(self, first: int, count: int) -> None:
        """Take the number of the first missed record, and how many were missed [1]."""

    def take(self, ticks: NDArray[Any], events: list[EventRecord]) -> None:
        """Take ticks and events, in order."""


class Listener:
    """Subscribes to the log of one server. ``clock``: monotonic time [ns]."""

    def __init__(self, link: Link, receiver: RecordReceiver, purpose: str, clock: Callable[[], int] = now_ns) -> None:
        self.lost = 0
        self._link, self._receiver, self._clock = link, receiver, clock
        self._hello = Hello("listener", "", PROTOCOL_VERSION, NAME, version("netboard"), {"for": purpose})
        self._session = ""
        self._next: int | None = None
        self._welcomed = False
        self._began_ns = clock()
        self._last_message_ns = self._greeted_ns = self._began_ns - SILENCE_TIMEOUT_NS
        self._answers: deque[int] = deque(maxlen=ANSWERS)
        self._refused = ""
        self._nonsense = RateLimitedLog(log)

    def run(self, stopping: Callable[[], bool]) -> None:
        """Receive until stopped."""
        log.info("waiting for the server")
        while not stopping():
            self.step()
        self._send(Goodbye("the listener was stopped"))

    def step(self) -> None:
        """Wait briefly for the server, and take what has arrived."""
        self._link.wait(WAIT_SECONDS)
        for _ in range(BURST):
            frame = self._link.receive()
            if frame is None:
                break
            self._last_message_ns = self._clock()
            try:
                self._handle(decode(frame))
            except WireError as error:
                self._nonsense.log(f"invalid message from the server: {error}")
        self._greet()

    def _greet(self) -> None:
        """Send `Hello` to a server that has not answered yet or has fallen silent."""
        now = self._clock()
        silent = now - self._last_message_ns >= SILENCE_TIMEOUT_NS
        if (silent or not self._welcomed) and now - self._greeted_ns >= HELLO_INTERVAL_NS:
            self._greeted_ns = now
            self._welcomed = False
            self._send(self._hello)

    def _handle(self, message: Message) -> None:
        match message:
            case Ping(sent_ns=ping_ns):
                answer = Pong(ping_ns, self._last_message_ns, self._clock())
                self._answers.append(answer.sent_ns)
                self._send(answer)
            case Welcome():
                self._enter(message)
            case LogBatch():
                self._take(message)
            case Goodbye(reason=reason):
                log.info("the server ended the connection: %s", reason)
                self._welcomed = False
            case Refusal(reason=reason):
                self._welcomed = False
                if reason != self._refused:
                    self._refused = reason
                    log.warning("the server refused the connection: %s", reason)

    def _enter(self, welcome: Welcome) -> None:
        """Enter a session, or continue the current one, and request its records."""
        self._welcomed, self._refused = True, ""
        if welcome.session != self._session:
            waited = bool(self._session) or self._clock() - self._began_ns > EARLY_WELCOME_NS
            self._session, self._next = welcome.session, 0 if waited else None
            self._answers.clear()
            self._receiver.begin(welcome)
        self._send(LogRequest(-1 if self._next is None else self._next))

    def _take(self, batch: LogBatch) -> None:
        if not self._session:
            return
        expected = batch.first if self._next is None else self._next
        if batch.first > expected:
            self._miss(expected, batch.first - expected)
        rows: list[bytes] = []
        events: list[EventRecord] = []
        for number, frame in enumerate(batch.records, start=batch.first):
            if number >= expected:
                self._sort(number, frame, rows, events)
        self._next = max(expected, batch.first + len(batch.records))
        if rows or events:
            self._receiver.take(np.frombuffer(b"".join(rows), TICK), events)

    def _sort(self, number: int, frame: bytes, rows: list[bytes], events: list[EventRecord]) -> None:
        """Add a record to the ticks or events, or use it as a clock probe."""
        try:
            record = record_of(frame)
        except WireError as error:
            self._nonsense.log(f"record {number} cannot be read: {error}")
            self._miss(number, 1)
            return
        match record:
            case TickRecord(row=row) if len(row) == TICK.itemsize:
                rows.append(row)
            case TickRecord():
                self._nonsense.log("ticks of another version of netboard: install the same on both machines")
                self._miss(number, 1)
            case EventRecord():
                events.append(record)
            case ClockRecord(peer=peer, t2_ns=sent_ns) if kind_of_peer(peer) == "listener" and sent_ns in self._answers:
                self._receiver.set_clock(record.offset_ns, record.bound_ns)

    def _miss(self, first: int, count: int) -> None:
        self.lost += count
        self._receiver.report_lost(first, count)

    def _send(self, message: Message) -> None:
        self._link.send(encode(message))
