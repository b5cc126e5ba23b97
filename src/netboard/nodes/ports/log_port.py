"""The server's end of the lossless log: the records of a session, and a cursor for every logger.

Rules: a record gets its number when it is made and keeps it; a logger that was away asks for what it misses and gets
it, from the ring or from the spill, a file that takes what the ring must let go while no logger takes it. What neither
holds is counted and said with its cause, never passed over. Nothing here waits: what a logger's queue does not take
now, or a disk has not read yet, is sent later. Listeners come by the same channel, and nothing here asks after them.
No peer can hold up a tick: a few messages are taken and a few batches sent at a time, each peer may send so many
messages a second (`netboard.nodes.ports.rate_limit`), and what a peer may not say is not unpacked.
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
"""Batches that one logger is sent in one go, and all together: a long backlog must not hold up a tick [1]."""

BATCH_RECORDS = 256
BATCH_BYTES = 65_536

GONE_NS = 2_000_000_000
"""A logger that has said nothing for so long is gone; one that has been told the end may still be writing [ns]."""

MARGIN = 4096
"""Records go to the spill so many before the ring lets go of them, or a quarter of the ring if that is less [1]."""

FULL_SHARE = 0.8
"""With this share of the ring held by nobody else, and a spill that takes nothing, the log is nearly full [1]."""

LISTEN_NS = 20_000_000
"""The answer to a ping is listened for so long at every tick [ns]."""

MOST_LOGGERS = 8
MOST_FRAMES = 8
"""Frames taken in one go [1]."""

MAY_SAY: dict[str, frozenset[type[Message]]] = {
    "": frozenset((Hello,)),
    "logger": frozenset((Hello, Goodbye, Pong, LogRequest, LogAck)),
    "listener": frozenset((Hello, Goodbye, Pong, LogRequest)),
}
"""What a peer of each role may say, and a stranger (of no role); what else it says is not unpacked."""


class _Logger:
    """A logger as the server sees it."""

    def __init__(self, peer: Peer) -> None:
        self.peer = peer
        self.cursor: int | None = None
        self.takes = False  # it has asked for records since it came
        self.told_end = False
        self.lost = self.lost_before = 0
        self.writes = ("", 0, 0, 0)  # file; when it last told of it [ns]; bytes written and free


class LogPort:
    """Keeps the records of a session and brings them to the loggers.

    Parameters
    ----------
    clock : callable
        Monotonic time [ns].

    Attributes
    ----------
    trouble : str
        Why a trial that is to be recorded cannot go on, or nothing; as of the last `pump`.
    listeners : Listeners
        Who hears the records, and has no part in keeping them.
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
        """Loggers that are there and have asked for records."""
        return sum(logger.takes for logger in self._loggers.values())

    @property
    def backlog(self) -> int:
        """Records not yet acknowledged as safely on disk."""
        return self.ring.next - self.ring.acknowledged

    @property
    def notice(self) -> str:
        """What an operator should know, or nothing."""
        if self._space_is_low:
            return f"the logger's disk has only {self.free_bytes / 1e9:.1f} GB left"
        if self._spill.next > self.ring.acknowledged and not self.loggers:
            return f"no logger takes the records: they go to {self._spill.path}"
        return ""

    def links(self, now_ns: int) -> list[Link]:
        """Tell how the loggers are connected, and the listeners."""
        loggers = [(*logger.peer.link(now_ns)[:-1], logger.lost) for logger in self._loggers.values()]
        return loggers + self.listeners.links(now_ns)

    def recordings(self, now_ns: int) -> tuple[tuple[str, float, int, int], ...]:
        """Tell what each logger writes, as `Status.recordings` has it."""
        writing = [logger.writes for logger in self._loggers.values()]
        return tuple(
            (file, (now_ns - told_ns) * 1e-9 if told_ns else nan, size, free) for file, told_ns, size, free in writing
        )

    def renew(self, welcome: Welcome) -> None:
        """Another block begins with the next record: its configuration is told to whoever comes from now on.

        A logger is told that of the first record that none has on disk: there it will begin.
        """
        self._welcomes.append((self.ring.next, welcome))
        for name, logger in self._loggers.items():
            if logger.cursor is None or logger.cursor >= self.ring.next:
                self._router.send(name, encode(self._welcome))

    @property
    def _welcome(self) -> Welcome:
        """What a logger is told first."""
        while len(self._welcomes) > 1 and self._welcomes[1][0] <= self.ring.acknowledged:
            del self._welcomes[0]
        return self._welcome_of(self.ring.acknowledged)

    def _welcome_of(self, record: int) -> Welcome:
        """The configuration of the block that a record belongs to."""
        return next(welcome for first, welcome in reversed(self._welcomes) if first <= record)

    def clock_records(self, seq: int) -> list[ClockRecord]:
        """The newest raw probe of each peer with the estimate so far, numbered from `seq`."""
        peers = [*(logger.peer for logger in self._loggers.values()), *self.listeners.peers]
        return self._probes.records(peers, seq)

    def listen(self, now_ns: int) -> None:
        """Take the answer to a ping as soon as it comes, and what was left; at other ticks it costs nothing."""
        if now_ns < self._listen_until_ns or self._unheard:
            self._drain()

    def pump(self, now_ns: int) -> None:
        """Answer the loggers, send them what their queues take, and look after what no logger takes."""
        self._drain()
        self._router.pay()
        self.refusals.look(now_ns)
        for name, logger in list(self._loggers.items()):
            silent = logger.peer.age_ns(now_ns) > GONE_NS and not self._unheard  # what waits may be its word
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
        """No record follows, whatever is appended: the loggers are told as soon as they have them all."""
        self._ended = True
        self.append = lambda record: self.ring.next

    @property
    def done(self) -> bool:
        """Whether everything is safely on disk."""
        return self.backlog == 0

    def close(self) -> None:
        """Let the loggers go; what none of them has on disk goes to the spill, which has `closed` when it is there."""
        for name, logger in self._loggers.items():
            if not logger.told_end:
                self._router.send(name, encode(Goodbye("the session is over")))
        self.listeners.dismiss()
        self._router.close_after_goodbye()
        self._spill.close(self._rest() if self.backlog and self._recorded else None)

    @property
    def closed(self) -> bool:
        """Whether the spill has done its work."""
        return self._spill.closed

    @property
    def shortfall(self) -> str:
        """What is not known to be on a logger's disk, and where it is, or nothing; after `closed`."""
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
        """Take what a peer says."""
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
        logger.cursor = None  # it asks again, now that it is welcome again

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
        """Send the loggers what their queues take, another one first each time; no more than so much together."""
        loggers = list(self._loggers.items())
        self._first_fed = first = (self._first_fed + 1) % max(len(loggers), 1)
        left = MOST_BATCHES
        for name, logger in (*loggers[first:], *loggers[:first]):
            if logger.cursor is not None:
                left -= self._feed(name, logger, logger.cursor, min(BATCHES, left))

    def _feed(self, name: bytes, logger: _Logger, cursor: int, most: int) -> int:
        """Send a logger batches, no more than so many, and after the last one that it was the last; how many [1]."""
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

    # --- what no logger takes ------------------------------------------------------------------------------------

    @property
    def _kept(self) -> int:
        """Number of the first record that is neither on a logger's disk nor in the spill."""
        return max(self.ring.acknowledged, self._spill.next)

    @property
    def _refusal(self) -> str:
        """Why nothing goes to the spill now, or nothing.

        Before a logger has written something, no block can have begun that is to be recorded.
        """
        return self._spill.refusal if self._recorded else "no logger was there yet"

    def _let_go(self) -> None:
        """Put what the ring will soon let go into the spill."""
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
        """Note why the ring has to let go of records that nobody else has."""
        losing = (self._refusal or "the disk does not follow") if self.ring.first > self._kept else ""
        if losing and losing != self._losing:
            self._cause = losing
            if self._recorded:
                self.news.append(("log_losing", {"first": str(self._kept), "cause": losing}))
        self._losing = losing

    def _note_lost(self, logger: _Logger, first: int, count: int) -> None:
        """Say what a logger cannot be given, once even if it asks again."""
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
        """All records that are neither on a logger's disk nor in the spill."""
        while (first := self._kept) < self.ring.next:
            yield self.ring.batch(first, BATCH_RECORDS, BATCH_BYTES)
