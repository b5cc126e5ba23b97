"""A subscriber to the log: receives every record as it is made, stores nothing and acknowledges nothing.

Records are numbered, so missed records are known and reported. A subscriber that was started before the server receives
the session from its first record; otherwise it receives the records from then on. It reconnects without a timeout. The
records include the server's probes of this machine's clock, which give the offset.
"""

import logging
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from netboard.base.clock import now_ns
from netboard.base.errors import WireError
from netboard.base.tick import TICK
from netboard.network.protocol.joining import Goodbye, Welcome
from netboard.network.protocol.messages import Message
from netboard.network.protocol.records import ClockRecord, EventRecord, LogBatch, LogRequest, TickRecord, kind_of_peer
from netboard.nodes.logger.log_link import Connection, LogEndpoint
from netboard.recording.format.channels import record_of

log = logging.getLogger(__name__)

EARLY_WELCOME_NS = 3_000_000_000
"""A welcome within this time of the start means that the server was already running [ns]."""


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


class Subscriber:
    """Subscribes to the log of one server. ``clock``: monotonic time [ns]."""

    def __init__(
        self, link: LogEndpoint, receiver: RecordReceiver, purpose: str, clock: Callable[[], int] = now_ns
    ) -> None:
        self.lost = 0
        self._receiver, self._clock = receiver, clock
        self._server = Connection(link, "listener", {"for": purpose}, clock)
        self._session = ""
        self._next: int | None = None
        self._began_ns = clock()

    def run(self, stopping: Callable[[], bool]) -> None:
        """Receive until stopped."""
        log.info("waiting for the server")
        while not stopping():
            self.step()
        self._server.send(Goodbye("the listener was stopped"))

    def step(self) -> None:
        """Wait briefly for the server, and take what has arrived."""
        for message in self._server.messages():
            self._handle(message)

    def _handle(self, message: Message | None) -> None:
        match message:
            case Welcome():
                self._enter(message)
            case LogBatch():
                self._take(message)
            case Goodbye(reason=reason):
                log.info("the server ended the connection: %s", reason)
                self._server.welcomed = False

    def _enter(self, welcome: Welcome) -> None:
        """Enter a session, or continue the current one, and request its records."""
        self._server.welcomed = True
        if welcome.session != self._session:
            waited = bool(self._session) or self._clock() - self._began_ns > EARLY_WELCOME_NS
            self._session, self._next = welcome.session, 0 if waited else None
            self._server.answered_ns.clear()
            self._receiver.begin(welcome)
        self._server.send(LogRequest(-1 if self._next is None else self._next))

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
            self._server.problems.log(f"record {number} cannot be read: {error}")
            self._miss(number, 1)
            return
        match record:
            case TickRecord(row=row) if len(row) == TICK.itemsize:
                rows.append(row)
            case TickRecord():
                self._server.problems.log("ticks of another version of netboard: install the same on both machines")
                self._miss(number, 1)
            case EventRecord():
                events.append(record)
            case ClockRecord(peer=peer, t2_ns=sent_ns) if kind_of_peer(peer) == "listener":
                if sent_ns in self._server.answered_ns:
                    self._receiver.set_clock(record.offset_ns, record.bound_ns)

    def _miss(self, first: int, count: int) -> None:
        self.lost += count
        self._receiver.report_lost(first, count)
