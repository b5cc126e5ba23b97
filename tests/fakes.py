"""Small real implementations of netboard's surroundings: a clock, an operator, and a log channel."""

import random
from collections import deque
from collections.abc import Callable

from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.control import Outcomes, Status, Trace
from netboard.network.protocol.joining import Goodbye, Hello, Pong, Refusal, Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION, Message
from netboard.network.protocol.record_buffer import LogRing
from netboard.network.protocol.records import LogAck, LogEnd, LogRequest

STATUS = Status(
    session="session",
    tick=1,
    phase="idle",
    trial=1,
    trials=60,
    successes=0,
    failures=0,
    completions=(),
    late_ticks=0,
    waiting_for=(),
    peers=(),
    notice="",
    links=(),
    loops=(),
    name="S01",
    dyad="D01",
    study="",
    pilot=False,
    consent=False,
    opened=True,
    armed=True,
    commander="",
    block=1,
    blocks=1,
    label="",
    condition="dyadic, force full",
    rest=0.0,
    pending="",
    outcomes=0,
    recordings=(),
    stations=(),
    refused=(),
    lost=(),
    repeats=(),
    devices=(),
    displays=(),
    stand_ins=(),
    ahead=(),
)
"""Status of a session that has just begun."""


class Answers:
    """Answers to the requests of operators: a new session without outcomes."""

    def status(self) -> Status:
        return STATUS

    def outcomes(self, first: int) -> Outcomes:
        return Outcomes(first, ())

    def trace(self, after: int) -> Trace:
        return Trace(())


class FakeClock:
    """A monotonic clock that only `advance` moves."""

    def __init__(self, now_ns: int = 1_000_000_000) -> None:
        self.now_ns = now_ns

    def __call__(self) -> int:
        return self.now_ns

    def advance(self, seconds: float) -> None:
        self.now_ns += round(seconds * 1e9)


class FakeLogServer:
    """The server's end of the log channel by PROTOCOL.md: a ring buffer, a cursor, and the end of the session."""

    def __init__(self, session: str, config: str, capacity: int, clock: FakeClock, batch: int = 7) -> None:
        self.ring = LogRing(capacity)
        self.acks: list[LogAck] = []
        self.goodbyes: list[str] = []
        self.pongs: list[Pong] = []
        self.requests: list[int] = []
        self._welcome = Welcome(session, PROTOCOL_VERSION, clock(), config)
        self._batch = batch
        self._cursor: int | None = None
        self._ended = False
        self._end_sent = False
        self.greeted = False

    def append(self, record: Message) -> None:
        self.ring.append(encode(record))

    def end(self) -> None:
        self._ended = True

    def receive_from_logger(self, frame: bytes) -> list[Message]:
        """Answer one frame of the logger."""
        match decode(frame):
            case Pong() as pong:
                self.pongs.append(pong)
            case Hello():
                self.greeted, self._cursor = True, None
                return [self._welcome]
            case _ if not self.greeted:
                return [Refusal("it has not joined yet")]
            case LogRequest(first=first):
                self.requests.append(first)
                self._cursor = self.ring.start(first)
                self._end_sent = False
            case LogAck() as ack:
                self.acks.append(ack)
                assert self.ring.acknowledge(ack.durable)
            case Goodbye(reason=reason):
                self.goodbyes.append(reason)
                self._cursor = None
        return []

    def lose(self) -> None:
        """Drop the logger's connection."""
        self.greeted, self._cursor = False, None

    def pump(self) -> list[Message]:
        """Send what is due."""
        sent: list[Message] = []
        if self._cursor is None:
            return sent
        while self._cursor < self.ring.next:
            batch = self.ring.batch(self._cursor, self._batch, 100_000)
            self._cursor = batch.first + len(batch.records)
            sent.append(batch)
        if self._ended and not self._end_sent:
            self._end_sent = True
            sent.append(LogEnd(self.ring.next - 1))
        return sent


class FakeLogLink:
    """The logger's end of the log channel in memory, over a line that may drop, repeat and reorder frames both ways.

    Each wait advances the clock, calls ``live`` for whatever else happens meanwhile, and lets the server send.
    """

    def __init__(self, server: FakeLogServer | None, clock: FakeClock, live: Callable[[], None] = lambda: None) -> None:
        self.server = server
        self.live = live
        self.drop = self.repeat = self.reorder = 0.0
        self.random = random.Random(1)
        self._clock = clock
        self._inbox: deque[bytes] = deque()

    def wait(self, seconds: float) -> bool:
        self._clock.advance(seconds)
        self.live()
        if self.server is not None:
            self._deliver(self.server.pump())
        return bool(self._inbox)

    def receive(self) -> bytes | None:
        return self._inbox.popleft() if self._inbox else None

    def send(self, frame: bytes) -> bool:
        if self.server is None:
            return False
        for _ in range(self._copies()):
            self._deliver(self.server.receive_from_logger(frame))
        return True

    def inject(self, frame: bytes) -> None:
        """Deliver a frame that the server did not send."""
        self._inbox.append(frame)

    def hang_up(self) -> None:
        """Drop the connection, and the frames in transit to the logger."""
        self._inbox.clear()
        if self.server is not None:
            self.server.lose()

    def _copies(self) -> int:
        if self.random.random() < self.drop:
            return 0
        return 2 if self.random.random() < self.repeat else 1

    def _deliver(self, messages: list[Message]) -> None:
        for message in messages:
            for _ in range(self._copies()):
                self._inbox.append(encode(message))
                if self.random.random() < self.reorder and len(self._inbox) > 1:
                    self._inbox[-1], self._inbox[-2] = self._inbox[-2], self._inbox[-1]
