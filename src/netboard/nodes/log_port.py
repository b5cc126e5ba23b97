"""The server's end of the lossless log: a ring of records, and a cursor for every logger.

Rules: a record gets its number when it is made and keeps it; a logger that was away asks for what it misses and gets it
as long as the ring holds it; what the ring no longer holds is counted and said, never passed over. Nothing here waits:
what a logger's queue does not take now is sent later.
"""

from netboard import sockets
from netboard.errors import WireError
from netboard.wire.codec import decode, encode
from netboard.wire.messages import (
    Goodbye,
    Hello,
    LogAck,
    LogEnd,
    LogRequest,
    Message,
    Refusal,
    Welcome,
)
from netboard.wire.ring import LogRing
from netboard.wire.session import Liveness, admit

BATCHES = 4
"""Batches a logger is sent in one go: a long backlog must not hold up a tick [1]."""

BATCH_RECORDS = 256
BATCH_BYTES = 65_536

GONE_NS = 2_000_000_000
"""A logger that has said nothing for so long is gone [ns]."""

MOST_LOGGERS = 8


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
        self._socket = socket
        self._welcome = encode(welcome)
        self._cursors: dict[bytes, int | None] = {}
        self._alive: dict[bytes, Liveness] = {}
        self._ended = False
        self._told_end: set[bytes] = set()

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
        while (received := sockets.receive_from(self._socket)) is not None:
            self._take(*received)
            if received[0] in self._alive:
                self._alive[received[0]].hear(now_ns)
        for logger, cursor in list(self._cursors.items()):
            if self._alive[logger].gone(now_ns):
                self._forget(logger)
            elif cursor is not None:
                self._feed(logger, cursor)

    def end(self) -> None:
        """No record follows: the loggers are told as soon as they have them all."""
        self._ended = True

    @property
    def done(self) -> bool:
        """Whether everything is safely on disk, or there is nobody to bring it to."""
        return self.loggers == 0 or self.backlog == 0

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

    def _take(self, logger: bytes, frame: bytes) -> None:
        try:
            message = decode(frame)
        except WireError as error:
            self._refuse(logger, str(error))
            return
        match message:
            case Hello():
                self._greet(logger, message)
            case _ if logger not in self._cursors:
                self._refuse(logger, "say hello first")
            case LogRequest(first=first):
                self._cursors[logger] = self.ring.start(first)
                self._told_end.discard(logger)
            case LogAck(durable=durable, free_bytes=free_bytes):
                self.ring.acknowledge(durable)
                self.free_bytes = free_bytes
            case Goodbye():
                self._forget(logger)
            case _:
                self._refuse(logger, f"a logger does not send {type(message).__name__}")

    def _greet(self, logger: bytes, hello: Hello) -> None:
        try:
            admit(hello)
        except WireError as error:
            self._refuse(logger, str(error))
            return
        if hello.role != "logger":
            self._refuse(logger, f"this is the log channel, not one for a {hello.role}")
        elif len(self._cursors) >= MOST_LOGGERS and logger not in self._cursors:
            self._refuse(logger, "too many loggers")
        elif sockets.send_to(self._socket, logger, self._welcome):
            self._cursors[logger] = None
            self._alive[logger] = Liveness(GONE_NS)

    def _forget(self, logger: bytes) -> None:
        del self._cursors[logger], self._alive[logger]
        self._told_end.discard(logger)

    def _refuse(self, logger: bytes, reason: str) -> None:
        sockets.send_to(self._socket, logger, encode(Refusal(reason)))
