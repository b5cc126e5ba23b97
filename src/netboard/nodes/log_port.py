"""The server's end of the lossless log: a ring of records, and a cursor for every logger.

Rules: a record gets its number when it is made and keeps it; a logger that was away asks for what it misses and gets it
as long as the ring holds it; what the ring no longer holds is counted and said, never passed over. Nothing here waits:
what a logger's queue does not take now is sent later.
"""

from netboard import sockets
from netboard.errors import WireError
from netboard.nodes.refusals import Refusals
from netboard.wire.codec import decode, encode
from netboard.wire.messages import (
    Goodbye,
    Hello,
    LogAck,
    LogEnd,
    LogRequest,
    Message,
    Welcome,
)
from netboard.wire.ring import LogRing
from netboard.wire.session import Liveness, admit

BATCHES = 4
"""Batches a logger is sent in one go: a long backlog must not hold up a tick [1]."""

BATCH_RECORDS = 256
BATCH_BYTES = 65_536

GONE_NS = 2_000_000_000
"""A logger that has said nothing for so long is gone; one that has been told the end may still be writing [ns]."""

MOST_LOGGERS = 8
MOST_FRAMES = 16
"""Frames taken in one go [1]."""


class LogPort:
    """Keeps the records of a session and brings them to the loggers.

    Parameters
    ----------
    socket : zmq.Socket
        ROUTER of the log channel.
    welcome : Welcome
        What a logger is told first.
    capacity : int
        Records the ring holds.
    """

    def __init__(self, socket: sockets.Socket, welcome: Welcome, capacity: int) -> None:
        self.ring = LogRing(capacity)
        self.free_bytes = 0
        self.news: list[tuple[str, dict[str, str]]] = []
        self._socket = socket
        self._welcome = encode(welcome)
        self._cursors: dict[bytes, int | None] = {}
        self._alive: dict[bytes, Liveness] = {}
        self._ended = False
        self._told_end: set[bytes] = set()
        self._refusals = Refusals(socket, self.news)

    @property
    def loggers(self) -> int:
        """Loggers that are there and have asked for records."""
        return sum(cursor is not None for cursor in self._cursors.values())

    @property
    def backlog(self) -> int:
        """Records not yet acknowledged as safely on disk."""
        return self.ring.next - self.ring.acknowledged

    def append(self, record: Message) -> None:
        """Keep a record for the loggers."""
        self.ring.append(encode(record))

    def pump(self, now_ns: int) -> None:
        """Answer the loggers and send them what their queues take."""
        for _ in range(MOST_FRAMES):
            received = sockets.receive_from(self._socket)
            if received is None:
                break
            self._take(*received, now_ns)
            if received[0] in self._alive:
                self._alive[received[0]].hear(now_ns)
        for logger, cursor in list(self._cursors.items()):
            if self._alive[logger].gone(now_ns) and logger not in self._told_end:
                self._forget(logger, "fell silent")
            elif cursor is not None:
                self._feed(logger, cursor)

    def end(self) -> None:
        """No record follows: the loggers are told as soon as they have them all."""
        self._ended = True

    @property
    def done(self) -> bool:
        """Whether everything is safely on disk."""
        return self.backlog == 0

    def _feed(self, logger: bytes, cursor: int) -> None:
        for _ in range(BATCHES):
            if cursor >= self.ring.next:
                break
            batch = self.ring.batch(cursor, BATCH_RECORDS, BATCH_BYTES)
            if not sockets.send_to(self._socket, logger, encode(batch)):
                return
            cursor = self._cursors[logger] = batch.first + len(batch.records)
        over = self._ended and cursor >= self.ring.next and logger not in self._told_end
        if over and sockets.send_to(self._socket, logger, encode(LogEnd(self.ring.next - 1))):
            self._told_end.add(logger)

    def _take(self, logger: bytes, frame: bytes, now_ns: int) -> None:
        try:
            message = decode(frame)
        except WireError as error:
            self._refusals.refuse(logger, str(error), now_ns)
            return
        match message:
            case Hello():
                self._greet(logger, message, now_ns)
            case _ if logger not in self._cursors:
                self._refusals.refuse(logger, "say hello first", now_ns)
            case LogRequest(first=first):
                self._cursors[logger] = self.ring.start(first)
                self._told_end.discard(logger)
            case LogAck(durable=durable, free_bytes=free_bytes):
                self.ring.acknowledge(durable)
                self.free_bytes = free_bytes
            case Goodbye(reason=reason):
                self._forget(logger, reason)
            case _:
                self._refusals.refuse(logger, f"a logger does not send {type(message).__name__}", now_ns)

    def _greet(self, logger: bytes, hello: Hello, now_ns: int) -> None:
        try:
            admit(hello)
        except WireError as error:
            self._refusals.refuse(logger, str(error), now_ns)
            return
        if hello.role != "logger":
            self._refusals.refuse(logger, f"this is the log channel, not one for a {hello.role}", now_ns)
        elif len(self._cursors) >= MOST_LOGGERS and logger not in self._cursors:
            self._refusals.refuse(logger, "too many loggers", now_ns)
        elif sockets.send_to(self._socket, logger, self._welcome):
            if logger not in self._cursors:
                self.news.append(("logger_joined", {"name": hello.name}))
            self._cursors[logger] = None
            self._alive[logger] = Liveness(GONE_NS)

    def _forget(self, logger: bytes, reason: str) -> None:
        del self._cursors[logger], self._alive[logger]
        self._told_end.discard(logger)
        self.news.append(("logger_left", {"peer": logger.decode(errors="replace"), "reason": reason}))
