"""The server's end of the lossless log: a ring of records, and a cursor for every logger.

Rules: a record gets its number when it is made and keeps it; a logger that was away asks for what it misses and gets it
as long as the ring holds it; what the ring no longer holds is counted and said, never passed over. Nothing here waits:
what a logger's queue does not take now is sent later.
"""

from netboard import sockets
from netboard.errors import WireError
from netboard.wire.codec import decode, encode
from netboard.wire.messages import (
    PROTOCOL_VERSION,
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

BATCH_RECORDS = 250
BATCH_BYTES = 256 * 1024
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

    def __init__(self, socket: sockets.Socket[bytes], welcome: Welcome, capacity: int) -> None:
        self.ring = LogRing(capacity)
        self.free_bytes = 0
        self._socket = socket
        self._welcome = encode(welcome)
        self._cursors: dict[bytes, int | None] = {}
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

    def pump(self) -> None:
        """Answer the loggers and send them what their queues take."""
        while (received := sockets.receive_from(self._socket)) is not None:
            self._take(*received)
        for logger, cursor in list(self._cursors.items()):
            if cursor is not None:
                self._feed(logger, cursor)

    def end(self) -> None:
        """No record follows: the loggers are told as soon as they have them all."""
        self._ended = True

    @property
    def done(self) -> bool:
        """Whether everything is safely on disk, or there is nobody to bring it to."""
        return self.loggers == 0 or self.backlog == 0

    def _feed(self, logger: bytes, cursor: int) -> None:
        while cursor < self.ring.next:
            batch = self.ring.batch(cursor, BATCH_RECORDS, BATCH_BYTES)
            if not sockets.send_to(self._socket, logger, encode(batch)):
                return
            cursor = batch.first + len(batch.records)
            self._cursors[logger] = cursor
        if self._ended and logger not in self._told_end:
            if sockets.send_to(self._socket, logger, encode(LogEnd(self.ring.next - 1))):
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
                self._cursors[logger] = self.ring.acknowledged if first < 0 else min(first, self.ring.next)
                self._told_end.discard(logger)
            case LogAck(durable=durable, free_bytes=free_bytes):
                self.ring.acknowledge(durable)
                self.free_bytes = free_bytes
            case Goodbye():
                del self._cursors[logger]
            case _:
                self._refuse(logger, f"a logger does not send {type(message).__name__}")

    def _greet(self, logger: bytes, hello: Hello) -> None:
        if hello.role != "logger":
            self._refuse(logger, f"this is the log channel, not one for a {hello.role}")
        elif hello.protocol != PROTOCOL_VERSION:
            self._refuse(logger, f"the server speaks protocol {PROTOCOL_VERSION}, the logger {hello.protocol}")
        elif len(self._cursors) >= MOST_LOGGERS and logger not in self._cursors:
            self._refuse(logger, "too many loggers")
        elif sockets.send_to(self._socket, logger, self._welcome):
            self._cursors[logger] = None

    def _refuse(self, logger: bytes, reason: str) -> None:
        sockets.send_to(self._socket, logger, encode(Refusal(reason)))
