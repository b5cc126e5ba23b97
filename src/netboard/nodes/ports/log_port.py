"""The server's endpoint of the lossless log: the records of a session, and a cursor for every logger.

Rules: a record gets its number when it is made and keeps it. A logger that was away asks for the records that it
misses, and gets them from the ring or from the spill, a file that takes what leaves the ring while no logger is there.
Records that neither holds are counted and reported with the cause. Nothing here waits: what a logger's queue cannot
take now, or a disk has not read yet, is sent later. Subscribers use the same channel, and nothing here depends on them.
No peer can hold up a tick: a few messages are taken and a few batches sent at a time, the rate of each peer is limited
(`netboard.nodes.ports.rate_limit`), and messages that a peer may not send are not decoded.
"""

from collections.abc import Callable, Iterator
from math import nan

from netboard.base.clock import now_ns
from netboard.base.errors import WireError
from netboard.network.protocol.admission import admit
from netboard.network.protocol.codec import decode, encode, kind_of
from netboard.network.protocol.joining import HELLO_FIRST, Goodbye, Hello, Ping, Pong, Welcome
from netboard.network.protocol.messages import Message
from netboard.network.protocol.record_buffer import LogRing
from netboard.network.protocol.records import ClockRecord, LogAck, LogBatch, LogEnd, LogRequest
from netboard.network.transport import endpoints
from netboard.nodes.ports.arrivals import Comings, News
from netboard.nodes.ports.peer import Link, Peer, Probes
from netboard.nodes.ports.rate_limit import Allowance
from netboard.nodes.ports.refusals import CROWDED, Refusals
from netboard.nodes.ports.subscribers import Listeners
from netboard.recording.format.disk import LOW_BYTES
from netboard.recording.recovery.spill import Spill

BATCHES, MOST_BATCHES = 2, 3
"""Batches sent at once to one logger, and to all: a long backlog must not hold up a tick [1]."""

BATCH_RECORDS = 256
BATCH_BYTES = 65_536

GONE_NS = 2_000_000_000
"""Silence after which a logger is gone, unless it was sent the end of the log and may still be writing [ns]."""

MARGIN = 4096
"""Records are spilled this many before the ring drops them, at most a quarter of the ring [1]."""

FULL_SHARE = 0.8
"""Share of the ring held by nobody else at which a trial stops, if the spill takes nothing [1]."""

LISTEN_NS = 20_000_000
"""Time after a ping for which every tick looks for the answer [ns]."""

MOST_LOGGERS = 8
MOST_FRAMES = 8
"""Frames taken at once [1]."""

MAY_SAY: dict[str, frozenset[type[Message]]] = {
    "": frozenset((Hello,)),
    "logger": frozenset((Hello, Goodbye, Pong, LogRequest, LogAck)),
    "listener": frozenset((Hello, Goodbye, Pong, LogRequest)),
}
"""Messages that a peer of each role may send ("" is an unregistered peer); others are refused without decoding."""


class _Logger:
    """The server's state of a logger."""

    def __init__(self, peer: Peer) -> None:
        self.peer = peer
        self.cursor: int | None = None
        self.takes = False  # it has asked for records since it joined
        self.told_end = False
        self.lost = self.lost_before = 0
        self.writes = ("", 0, 0, 0)  # file; time of its last report [ns]; bytes written and free


class LogPort:
    """Keeps the records of a session and sends them to the loggers.

    Parameters
    ----------
    clock : callable
        Monotonic time [ns].

    Attributes
    ----------
    trouble : str
        Why a trial that must be recorded cannot go on, or empty; set by `pump`.
    listeners : Listeners
        Subscribers, which get the records but have no part in keeping them.
    """

    def __init__(
        self,
        router: endpoints.Router,
        welcome: Welcome,
        capacity: int,
        spill: Spill,
        clock: Callable[[], int] = now_ns,
    ) -> None:
        self.ring = LogRing(capacity)
        self.append = self.ring.append
        self.trouble = ""
        self.free_bytes = 0
        self.news: News = []
        self.refusals = Refusals(router, self.news)
        self._router = router
        self._allowance = Allowance()
        self._comings = Comings(self.news)
        self._welcomes = [(0, welcome)]
        self._spill = spill
        self._clock = clock
        self._loggers: dict[bytes, _Logger] = {}
        self._listen_until_ns = 0
        self._unheard = False
        self._first_fed = 0
        self._margin = min(MARGIN, capacity // 4)
        self._recorded = False
        self._farewell = ""
        self._losing = ""
        self._cause = ""
        self._spill_trouble = ""
        self._space_is_low = False
        self._ended = False
        self._probes = Probes()
        self.listeners = Listeners(router, self.ring, self._comings)

    @property
    def loggers(self) -> int:
        """Number of connected loggers that have asked for records."""
        return sum(logger.takes for logger in self._loggers.values())

    @property
    def backlog(self) -> int:
        """Number of records not yet acknowledged as safely on disk."""
        return self.ring.next - self.ring.acknowledged

    @property
    def notice(self) -> str:
        """What an operator should know; empty if nothing."""
        if self._space_is_low:
            return f"the logger's disk has only {self.free_bytes / 1e9:.1f} GB left"
        if self._spill.next > self.ring.acknowledged and not self.loggers:
            return f"no logger takes the records: they go to {self._spill.path}"
        return ""

    def links(self, now_ns: int) -> list[Link]:
        """Return the connections of the loggers and the subscribers."""
        loggers = [(*logger.peer.link(now_ns)[:-1], logger.lost) for logger in self._loggers.values()]
        return loggers + self.listeners.links(now_ns)

    def recordings(self, now_ns: int) -> tuple[tuple[str, float, int, int], ...]:
        """Return what each logger writes, as in `Status.recordings`."""
        writing = [logger.writes for logger in self._loggers.values()]
        return tuple(
            (file, (now_ns - told_ns) * 1e-9 if told_ns else nan, size, free) for file, told_ns, size, free in writing
        )

    def renew(self, welcome: Welcome) -> None:
        """Begin a block with the next record, and welcome the loggers that have been sent all records.

        A welcome has the configuration of the first record that no logger has on disk, where a logger begins.
        """
        self._welcomes.append((self.ring.next, welcome))
        for name, logger in self._loggers.items():
            if logger.cursor is None or logger.cursor >= self.ring.next:
                self._router.send(name, encode(self._welcome))

    @property
    def _welcome(self) -> Welcome:
        """Welcome for a logger that joins now."""
        while len(self._welcomes) > 1 and self._welcomes[1][0] <= self.ring.acknowledged:
            del self._welcomes[0]
        return self._welcome_of(self.ring.acknowledged)

    def _welcome_of(self, record: int) -> Welcome:
        """Return the configuration of the block to which a record belongs."""
        return next(welcome for first, welcome in reversed(self._welcomes) if first <= record)

    def clock_records(self, seq: int) -> list[ClockRecord]:
        """Return the newest raw probe of each peer with the current estimate, numbered from `seq`."""
        peers = [*(logger.peer for logger in self._loggers.values()), *self.listeners.peers]
        return self._probes.records(peers, seq)

    def listen(self, now_ns: int) -> None:
        """Read the channel if a ping's answer may come or frames are left; at other ticks this costs nothing."""
        if now_ns < self._listen_until_ns or self._unheard:
            self._drain()

    def pump(self, now_ns: int) -> None:
        """Answer the loggers, send them what their queues take, and spill records that no logger takes."""
        self._drain()
        self._router.pay()
        self.refusals.look(now_ns)
        for name, logger in list(self._loggers.items()):
            silent = logger.peer.age_ns(now_ns) > GONE_NS and not self._unheard  # a message from it may be waiting
            if silent and not logger.told_end:
                self._forget(name, "fell silent", now_ns)
            else:
                self._ping(name, logger)
        self._feed_all()
        self._let_go()
        if self.listeners.pump(self._clock(), ended=self._ended, unheard=self._unheard):
            self._listen_until_ns = self._clock() + LISTEN_NS
        self.trouble = self._find_trouble()

    def batch(self, cursor: int) -> LogBatch | None:
        """Make the next batch for a logger; None while it is being read from the spill."""
        if cursor < self.ring.first and cursor < self._spill.next:
            return self._spill.batch(cursor)
        return self.ring.batch(cursor, BATCH_RECORDS, BATCH_BYTES)

    def end(self) -> None:
        """End the log: later records are dropped, and loggers are sent the end once they have all records."""
        self._ended = True
        # The loggers have been told the last number, or will be: a later record would never be sent.
        self.append = lambda record: self.ring.next

    @property
    def done(self) -> bool:
        """Whether everything is safely on disk."""
        return self.backlog == 0

    def close(self) -> None:
        """Dismiss the loggers, and spill the records that none has on disk; `closed` says when that is done."""
        for name, logger in self._loggers.items():
            if not logger.told_end:
                self._router.send(name, encode(Goodbye("the session is over")))
        self.listeners.dismiss()
        self._router.close_after_goodbye()
        self._spill.close(self._rest() if self.backlog and self._recorded else None)

    @property
    def closed(self) -> bool:
        """Whether the spill has finished."""
        return self._spill.closed

    @property
    def shortfall(self) -> str:
        """Records not known to be on a logger's disk, and where they are; empty if none. Valid once `closed`."""
        if self.done:
            return ""
        said = f"{self.backlog} records are not known to be on disk: no logger took them"
        held = self._spill.held
        if not held:
            return said + (f"; {self._spill.trouble}" if self._spill.trouble else "")
        return f"{said}; {held} records are in {self._spill.path}: netboard recover makes a recording of it"

    # --- loggers -------------------------------------------------------------------------------------------------

    def _drain(self) -> None:
        for _ in range(MOST_FRAMES):
            received = self._router.receive()
            if received is None:
                self._unheard = False
                return
            if received != endpoints.NOBODY:
                self._take(*received, self._clock())
        self._unheard = True

    def _take(self, name: bytes, frame: bytes, now_ns: int) -> None:
        if not self._allowance.takes(name, len(frame), now_ns):
            self.refusals.refuse(name, CROWDED, now_ns)
            return
        try:
            self._hear(name, frame, now_ns)
        except WireError as error:
            self.refusals.refuse(name, str(error), now_ns)

    def _hear(self, name: bytes, frame: bytes, now_ns: int) -> None:
        """Handle a peer's message."""
        logger = self._loggers.get(name)
        if logger is not None:
            logger.peer.hear(now_ns)
        role, kind = "listener" if name in self.listeners else "logger" if logger else "", kind_of(frame)
        if kind not in MAY_SAY[role]:
            raise WireError(f"a {role} does not send {kind.__name__}" if role else HELLO_FIRST)
        match decode(frame):
            case Hello() as hello:
                self._greet(name, hello, now_ns)
            case said if logger is None:
                self.listeners.hear(name, said, now_ns)
            case LogRequest(first=first):
                logger.cursor = self.ring.start(first)
                logger.takes, logger.told_end = True, False
                self._farewell = ""
            case LogAck(durable=durable, free_bytes=free_bytes, file=file, file_bytes=file_bytes):
                logger.writes = file, now_ns, file_bytes, free_bytes
                self._acknowledge(durable, free_bytes)
            case Pong() as pong:
                logger.peer.answered(pong, now_ns)
            case Goodbye(reason=reason):
                self._farewell = reason
                self._forget(name, reason, now_ns)

    def _greet(self, name: bytes, hello: Hello, now_ns: int) -> None:
        admit(hello)
        if hello.role not in ("logger", "listener"):
            raise WireError(f"this is the log channel, not one for a {hello.role}")
        if reason := self._router.forbids(hello.role, hello.side):
            raise WireError(reason)
        if name in (self.listeners if hello.role == "logger" else self._loggers):
            raise WireError(f"it has come as another than a {hello.role}")
        if hello.role == "listener":
            self.listeners.greet(name, hello, self._welcome_of(self.ring.next), now_ns)
            return
        logger = self._loggers.get(name)
        if logger is None and len(self._loggers) >= MOST_LOGGERS:
            self._make_room(now_ns)
        self._router.owe(name, encode(self._welcome))
        if logger is None or logger.peer.hello != hello:
            self._loggers[name] = logger = _Logger(Peer(hello, now_ns))
            self._comings.tell("logger_joined", {"name": hello.name, **hello.details}, now_ns)
        logger.cursor = None  # it asks again after the new welcome

    def _make_room(self, now_ns: int) -> None:
        """Forget a logger that cannot be sent anything: its connection has ended, or it does not read."""
        ping = encode(Ping(now_ns))
        gone = next((name for name in self._loggers if not self._router.send(name, ping)), None)
        if gone is None:
            raise WireError("too many loggers")
        self._forget(gone, "cannot be reached", now_ns)

    def _forget(self, name: bytes, reason: str, now_ns: int) -> None:
        logger = self._loggers.pop(name)
        self._comings.tell("logger_left", {"name": logger.peer.hello.name, "reason": reason}, now_ns)

    def _acknowledge(self, durable: int, free_bytes: int) -> None:
        self._recorded = True
        self.free_bytes = free_bytes
        low = free_bytes < LOW_BYTES
        if low and not self._space_is_low:
            self.news.append(("logger_disk_low", {"free_gb": f"{free_bytes / 1e9:.1f}"}))
        self._space_is_low = low
        if self.ring.acknowledge(durable) and self._spill.next:
            self._spill.forget(self.ring.acknowledged)
            if not self._spill.next:
                self.news.append(("log_spill_taken", {}))

    def _ping(self, name: bytes, logger: _Logger) -> None:
        ping = logger.peer.ping(self._clock())
        if ping is not None and self._router.send(name, encode(ping)):
            self._listen_until_ns = ping.sent_ns + LISTEN_NS

    def _feed_all(self) -> None:
        """Send the loggers what their queues take, at most `MOST_BATCHES` in all; another one goes first each time."""
        loggers = list(self._loggers.items())
        self._first_fed = first = (self._first_fed + 1) % max(len(loggers), 1)
        left = MOST_BATCHES
        for name, logger in (*loggers[first:], *loggers[:first]):
            if logger.cursor is not None:
                left -= self._feed(name, logger, logger.cursor, min(BATCHES, left))

    def _feed(self, name: bytes, logger: _Logger, cursor: int, most: int) -> int:
        """Send a logger at most this many batches, and the end after the last; return how many were sent [1]."""
        sent = 0
        while sent < most and cursor < self.ring.next:
            batch = self.batch(cursor)
            if batch is None or not self._router.send(name, encode(batch)):
                return sent
            if batch.lost:
                self._note_lost(logger, cursor, batch.lost)
            cursor = logger.cursor = batch.first + len(batch.records)
            sent += 1
        over = self._ended and cursor >= self.ring.next and not logger.told_end
        if over and self._router.send(name, encode(LogEnd(self.ring.next - 1))):
            logger.told_end = True
        return sent

    # --- records that no logger takes ----------------------------------------------------------------------------

    @property
    def _kept(self) -> int:
        """Number of the first record that is neither on a logger's disk nor in the spill."""
        return max(self.ring.acknowledged, self._spill.next)

    @property
    def _refusal(self) -> str:
        """Why the spill takes nothing now; empty if it does.

        Before a logger has written anything, no block that must be recorded can have begun.
        """
        return self._spill.refusal if self._recorded else "no logger was there yet"

    def _let_go(self) -> None:
        """Spill the records that will soon leave the ring."""
        ring, spill = self.ring, self._spill
        for _ in range(BATCHES):
            if ring.next - self._kept <= ring.capacity - self._margin or self._refusal:
                break
            if not spill.next:
                spill.introduce(self._welcome_of(self._kept))
                self.news.append(("log_spilling", {"file": str(spill.path)}))
            spill.put(ring.batch(self._kept, BATCH_RECORDS, BATCH_BYTES))
        if spill.trouble != self._spill_trouble:
            self._spill_trouble = spill.trouble
            if self._spill_trouble:
                self.news.append(("log_spill_failed", {"reason": self._spill_trouble}))
        self._watch_losses()

    def _watch_losses(self) -> None:
        """Note why the ring drops records that are nowhere else."""
        losing = (self._refusal or "the disk does not follow") if self.ring.first > self._kept else ""
        if losing and losing != self._losing:
            self._cause = losing
            if self._recorded:
                self.news.append(("log_losing", {"first": str(self._kept), "cause": losing}))
        self._losing = losing

    def _note_lost(self, logger: _Logger, first: int, count: int) -> None:
        """Report records that a logger cannot be given, once even if it asks again."""
        if first < logger.lost_before:
            return
        logger.lost += count
        logger.lost_before = first + count
        acknowledged = logger.lost_before <= self.ring.acknowledged
        cause = "another logger has them on disk" if acknowledged else self._cause or self._spill.trouble
        self.news.append(("log_lost", {"first": str(first), "count": str(count), "cause": cause}))

    def _find_trouble(self) -> str:
        if self._farewell and not self.loggers:
            return f"the logger has left: {self._farewell}"
        full = FULL_SHARE * self.ring.capacity if self._refusal else self.ring.capacity - self._margin // 2
        return "the logger is too far behind" if self.ring.next - self._kept > full else ""

    def _rest(self) -> Iterator[LogBatch]:
        """Yield all records that are neither on a logger's disk nor in the spill."""
        while (first := self._kept) < self.ring.next:
            yield self.ring.batch(first, BATCH_RECORDS, BATCH_BYTES)
