"""The server's endpoint of the lossless log: it sends every logger the records that it lacks.

A logger that was away asks for the records that it misses; `netboard.nodes.ports.record_store` keeps them until a
logger has them on disk. Nothing here waits: what a logger's queue cannot take now is sent later. Subscribers use the
same channel, and nothing here depends on them. No peer can hold up a tick: a few messages are taken and a few batches
sent at a time, the rate of each peer is limited (`netboard.nodes.ports.rate_limit`), and messages that a peer may not
send are not decoded.
"""

from collections.abc import Callable
from math import nan

from netboard.base.clock import now_ns
from netboard.base.errors import WireError
from netboard.network.protocol.codec import decode, encode, kind_of
from netboard.network.protocol.control import LinkStatus, RecordingStatus
from netboard.network.protocol.joining import HELLO_FIRST, Goodbye, Hello, Ping, Pong, Welcome
from netboard.network.protocol.messages import Message, sent_by
from netboard.network.protocol.records import ClockRecord, LogAck, LogEnd, LogRequest
from netboard.network.transport import endpoints
from netboard.nodes.ports.peer import ProbedPeer, Probes, admit
from netboard.nodes.ports.peer_events import News, PeerEvents
from netboard.nodes.ports.rate_limit import RateLimit
from netboard.nodes.ports.record_store import BATCHES, RecordStore
from netboard.nodes.ports.refusals import TOO_MANY_MESSAGES, Refusals
from netboard.nodes.ports.subscribers import SILENCE_TIMEOUT_NS, Subscribers
from netboard.nodes.ports.sync_age import SyncAge
from netboard.recording.format.disk import LOW_BYTES, SLOW_SYNC_S
from netboard.recording.recovery.spill import Spill

MAX_BATCHES = 3
"""Batches sent at once to all loggers [1]."""

PONG_WAIT_NS = 20_000_000
"""Time after a ping for which every tick looks for the answer [ns]."""

MAX_LOGGERS = 8
MAX_FRAMES = 8
"""Frames taken at once [1]."""

ROLES = ("logger", "listener")
ALLOWED_MESSAGES: dict[str, frozenset[type[Message]]] = {
    "": frozenset((Hello,)),
    **{role: sent_by(role) for role in ROLES},
}
"""Messages that a peer of each role may send ("" is an unregistered peer); others are refused without decoding."""


class _Logger:
    """The server's state of a logger."""

    def __init__(self, peer: ProbedPeer) -> None:
        self.peer = peer
        self.welcome: Welcome | None = None  # the last one sent to it
        self.cursor: int | None = None
        self.has_requested = False  # whether it has asked for records since it joined
        self.end_sent = False
        self.lost = self.lost_until = 0
        self.last_report = ("", 0, 0)  # of its last `LogAck`: file; bytes written and free
        self.sync_age = SyncAge()


class LogPort:
    """Keeps the records of a session and sends them to the loggers. ``clock``: monotonic time [ns]."""

    def __init__(
        self, router: endpoints.Router, welcome: Welcome, capacity: int, spill: Spill, clock: Callable[[], int] = now_ns
    ) -> None:
        self.trouble = ""  # why a trial that must be recorded cannot continue, or empty; set by `pump`
        self.free_bytes = 0
        self.news: News = []
        self.store = RecordStore(capacity, spill, welcome, self.news)
        self.ring = self.store.ring
        self.append = self.ring.append
        self.refusals = Refusals(router, self.news)
        self._router = router
        self._rate_limit = RateLimit()
        self._peer_events = PeerEvents(self.news)
        self._clock = clock
        self._loggers: dict[bytes, _Logger] = {}
        self._pong_until_ns = 0
        self._unhandled = False
        self._first_fed = 0
        self._leave_reason = ""
        self._fell_silent = False  # whether the last logger has left so, and none has come since
        self._space_is_low = False
        self._ended = False
        self._probes = Probes()
        # Subscribers, which get the records but have no part in keeping them.
        self.subscribers = Subscribers(router, self.ring, self._peer_events)

    @property
    def empty(self) -> bool:
        """Whether no logger and no subscriber is registered."""
        return not self._loggers and not self.subscribers

    @property
    def loggers(self) -> int:
        """Number of connected loggers that have asked for records."""
        return sum(logger.has_requested for logger in self._loggers.values())

    @property
    def notice(self) -> str:
        """What an operator should know; empty if nothing."""
        if self._parting:
            return self._parting
        if self._space_is_low:
            return f"the logger's disk has only {self.free_bytes / 1e9:.1f} GB left"
        if self.loggers:
            wait = self._wait
            slow = f"the logger's disk is slow: records reach it after {wait:.1f} s, and a power cut loses that much"
            return "; ".join(filter(None, (slow if wait > SLOW_SYNC_S else "", self._several)))
        spilled_to = self.store.spilled_to
        spilled = f"no logger is connected: the server writes the records to {spilled_to}" if spilled_to else ""
        return "; ".join(filter(None, (self._silence, spilled)))

    @property
    def _several(self) -> str:
        """Which loggers record the session, if there are several: each makes a recording of every block."""
        names = [logger.peer.hello.name for logger in self._loggers.values() if logger.has_requested]
        listed = ", ".join(name[: endpoints.MAX_CHARACTERS] for name in names)
        return f"{len(names)} loggers record every block, each in its own file: {listed}" if len(names) > 1 else ""

    @property
    def _parting(self) -> str:
        """Why the last logger has left, if it said so and none has come since."""
        return f"the logger has left: {self._leave_reason}" if self._leave_reason and not self.loggers else ""

    @property
    def _silence(self) -> str:
        """That the last logger left without a word, if none has come since."""
        return "the logger fell silent: its disk or its network hangs" if self._fell_silent and not self.loggers else ""

    def links(self, now_ns: int) -> list[LinkStatus]:
        """Return the connections of the loggers and the subscribers."""
        loggers = [logger.peer.link(now_ns, logger.lost) for logger in self._loggers.values()]
        return loggers + self.subscribers.links(now_ns)

    def recordings(self, now_ns: int) -> tuple[RecordingStatus, ...]:
        """Return what each logger writes."""
        return tuple(self._recording(logger, now_ns) for logger in self._loggers.values())

    def _recording(self, logger: _Logger, now_ns: int) -> RecordingStatus:
        file, size, free = logger.last_report
        return RecordingStatus(file, logger.sync_age.longest(now_ns) if file else nan, size, free)

    @property
    def _wait(self) -> float:
        """Longest recent wait of records for the fastest logger's disk, 0 without a logger [s]."""
        now_ns = self._clock()
        return min((logger.sync_age.longest(now_ns) for logger in self._loggers.values()), default=0.0)

    def renew(self, welcome: Welcome) -> None:
        """Begin a block with the next record, and welcome the loggers that have been sent all records."""
        self.store.begin_block(welcome)
        for name, logger in self._loggers.items():
            if logger.cursor is None or logger.cursor >= self.ring.next:
                logger.welcome = self.store.welcome()
                self._router.send(name, encode(logger.welcome))

    def clock_records(self, seq: int) -> list[ClockRecord]:
        """Return the newest raw probe of each peer with the current estimate, numbered from `seq`."""
        peers = [*(logger.peer for logger in self._loggers.values()), *self.subscribers.peers]
        return self._probes.records(peers, seq)

    def must_read(self, now_ns: int) -> bool:
        """Return whether the channel must be read after each tick: a `Pong` is due soon, or frames are left."""
        return now_ns < self._pong_until_ns or self._unhandled

    def read_if_needed(self, now_ns: int) -> None:
        """Read the channel if it must be read after each tick."""
        if self.must_read(now_ns):
            self._drain()

    def pump(self, now_ns: int) -> None:
        """Answer the loggers, send them what their queues take, and spill records that no logger takes."""
        self._drain()
        self._router.send_queued()
        self.refusals.poll(now_ns)
        for name, logger in list(self._loggers.items()):
            silent = logger.peer.age_ns(now_ns) > SILENCE_TIMEOUT_NS
            # An unhandled message may be from it; after the end of the log it may still be writing.
            if silent and not self._unhandled and not logger.end_sent:
                self._forget(name, "fell silent", now_ns)
                self._fell_silent = True
            else:
                self._ping(name, logger)
                logger.sync_age.note(self.ring.next, now_ns)
        self._feed_all()
        self.store.spill()
        if self.subscribers.pump(self._clock(), ended=self._ended, unhandled=self._unhandled):
            self._pong_until_ns = self._clock() + PONG_WAIT_NS
        self.trouble = self._find_trouble()

    def end(self) -> None:
        """End the log: later records are dropped, and loggers are sent the end once they have all records."""
        self._ended = True
        # The loggers have received the last number, or will: a later record would never be sent.
        self.append = lambda record: self.ring.next

    @property
    def done(self) -> bool:
        """Whether everything is safely on disk."""
        return self.store.backlog == 0

    def close(self) -> None:
        """Dismiss the loggers, and spill the records that none has on disk; `closed` says when that is done."""
        for name, logger in self._loggers.items():
            if not logger.end_sent:
                self._router.send(name, encode(Goodbye("the session is over")))
        self.subscribers.dismiss()
        self._router.close_after_goodbye()
        self.store.close()

    # --- loggers -------------------------------------------------------------------------------------------------

    def _drain(self) -> None:
        for _ in range(MAX_FRAMES):
            received = self._router.receive()
            if received is None:
                self._unhandled = False
                return
            if received != endpoints.REFUSED:
                self._take(*received, self._clock())
        self._unhandled = True

    def _take(self, name: bytes, frame: bytes, now_ns: int) -> None:
        if not self._rate_limit.allows(name, len(frame), now_ns):
            self.refusals.refuse(name, TOO_MANY_MESSAGES, now_ns)
            return
        try:
            self._handle(name, frame, now_ns)
        except WireError as error:
            self.refusals.refuse(name, str(error), now_ns)

    def _handle(self, name: bytes, frame: bytes, now_ns: int) -> None:
        logger = self._loggers.get(name)
        if logger is not None:
            logger.peer.note_message(now_ns)
        role, kind = "listener" if name in self.subscribers else "logger" if logger else "", kind_of(frame)
        if kind not in ALLOWED_MESSAGES[role]:
            raise WireError(f"a {role} does not send {kind.__name__}" if role else HELLO_FIRST)
        match decode(frame):
            case Hello() as hello:
                self._greet(name, hello, now_ns)
            case message if logger is None:
                self.subscribers.handle(name, message, now_ns)
            case LogRequest(first=first) if first < 0 and self.store.welcome() is not logger.welcome:
                self._send_welcome(name, logger)  # another logger has brought the rest of its block to disk meanwhile
            case LogRequest(first=first):
                logger.cursor = self.ring.start(first)
                logger.has_requested, logger.end_sent = True, False
                self._leave_reason, self._fell_silent = "", False
            case LogAck(durable=durable, free_bytes=free_bytes, file=file, file_bytes=file_bytes):
                logger.last_report = file, file_bytes, free_bytes
                logger.sync_age.durable(durable, now_ns)
                self._acknowledge(durable, free_bytes)
            case Pong() as pong:
                logger.peer.answered(pong, now_ns)
                if len(self._loggers) == 1 and not self.subscribers:  # no other answer can be on its way
                    self._pong_until_ns = 0
            case Goodbye(reason=reason):
                self._leave_reason = reason
                self._forget(name, reason, now_ns)

    def _greet(self, name: bytes, hello: Hello, now_ns: int) -> None:
        admit(hello, self._router, ROLES)
        if name in (self.subscribers if hello.role == "logger" else self._loggers):
            raise WireError(f"it joined as another peer than a {hello.role}")
        if hello.role == "listener":
            self.subscribers.greet(name, hello, self.store.welcome_of(self.ring.next), now_ns)
            return
        logger = self._loggers.get(name)
        if logger is None and len(self._loggers) >= MAX_LOGGERS:
            self._make_room(now_ns)
        if logger is None or logger.peer.hello != hello:
            self._loggers[name] = logger = _Logger(ProbedPeer(hello, now_ns))
            self._peer_events.add_with_details(hello, "logger_joined", {"name": hello.name}, now_ns)
        self._send_welcome(name, logger)

    def _send_welcome(self, name: bytes, logger: _Logger) -> None:
        """Welcome a logger to the block of the first record that no logger has on disk; it then asks for records."""
        logger.welcome, logger.cursor = self.store.welcome(), None
        self._router.send_or_queue(name, encode(logger.welcome))

    def _make_room(self, now_ns: int) -> None:
        """Forget a logger that cannot be sent anything: its connection has ended, or it does not read."""
        ping = encode(Ping(now_ns))
        gone = next((name for name in self._loggers if not self._router.send(name, ping)), None)
        if gone is None:
            raise WireError("too many loggers")
        self._forget(gone, "cannot be reached", now_ns)

    def _forget(self, name: bytes, reason: str, now_ns: int) -> None:
        logger = self._loggers.pop(name)
        self._router.drop_queued(name)
        self._peer_events.add("logger_left", {"name": logger.peer.hello.name, "reason": reason}, now_ns)

    def _acknowledge(self, durable: int, free_bytes: int) -> None:
        self.free_bytes = free_bytes
        low = free_bytes < LOW_BYTES
        if low and not self._space_is_low:
            self.news.append(("logger_disk_low", {"free_gb": f"{free_bytes / 1e9:.1f}"}))
        self._space_is_low = low
        self.store.acknowledge(durable)

    def _ping(self, name: bytes, logger: _Logger) -> None:
        ping = logger.peer.ping(self._clock())
        if ping is not None and self._router.send(name, encode(ping)):
            self._pong_until_ns = ping.sent_ns + PONG_WAIT_NS

    def _feed_all(self) -> None:
        """Send the loggers what their queues take, at most `MAX_BATCHES` in all; another one goes first each time."""
        loggers = list(self._loggers.items())
        self._first_fed = first = (self._first_fed + 1) % max(len(loggers), 1)
        left = MAX_BATCHES
        for name, logger in (*loggers[first:], *loggers[:first]):
            if logger.cursor is not None:
                left -= self._feed(name, logger, logger.cursor, min(BATCHES, left))

    def _feed(self, name: bytes, logger: _Logger, cursor: int, most: int) -> int:
        """Send a logger at most this many batches, and `LogEnd` after the last; return how many were sent [1]."""
        sent = 0
        while sent < most and cursor < self.ring.next:
            batch = self.store.batch(cursor)
            if batch is None or not self._router.send(name, encode(batch)):
                return sent
            if batch.lost:
                self._note_lost(logger, cursor, batch.lost)
            cursor = logger.cursor = batch.first + len(batch.records)
            sent += 1
        over = self._ended and cursor >= self.ring.next and not logger.end_sent
        if over and self._router.send(name, encode(LogEnd(self.ring.next - 1))):
            logger.end_sent = True
        return sent

    def _note_lost(self, logger: _Logger, first: int, count: int) -> None:
        """Report records that no longer exist for a logger, once even if it asks again."""
        if first >= logger.lost_until:
            logger.lost += count
            logger.lost_until = first + count
            self.store.report_lost(first, count)

    def _find_trouble(self) -> str:
        if self._parting or not self.store.behind:
            return self._parting
        slow = f"records reach its disk after {wait:.1f} s" if (wait := self._wait) > SLOW_SYNC_S else ""
        reason = self._silence or slow
        return "the logger is too far behind" + (f" ({reason})" if reason else "")
