"""Subscribers to the log: peers that are sent the records but are never waited for.

Rules: a subscriber gets records only from the ring, one batch at a time, and after the loggers. Records that it does
not take in time are lost to it, and each batch says how many. It acknowledges nothing, and no decision depends on it:
whether records are safe, a trial may go on, or a session may end.
"""

from netboard.base.errors import WireError
from netboard.network.protocol.codec import encode
from netboard.network.protocol.control import LinkStatus
from netboard.network.protocol.joining import Goodbye, Hello, Pong, Welcome
from netboard.network.protocol.messages import Message
from netboard.network.protocol.record_buffer import LogRing
from netboard.network.protocol.records import LogEnd, LogRequest
from netboard.network.transport import endpoints
from netboard.nodes.ports.peer import ProbedPeer
from netboard.nodes.ports.peer_events import PeerEvents

MAX_SUBSCRIBERS = 4

MAX_RECORDS = 128
MAX_BYTES = 65_536
"""Bytes of a batch: some ten times what is recorded between two batches [1]."""

SILENCE_TIMEOUT_NS = 2_000_000_000
"""Silence after which a subscriber or a logger is gone [ns]."""


class _Subscriber:
    """The server's state of a subscriber."""

    def __init__(self, peer: ProbedPeer) -> None:
        self.peer = peer
        self.cursor: int | None = None
        self.lost = 0
        self.end_sent = False


class Subscribers:
    """The subscribers of a session."""

    def __init__(self, router: endpoints.Router, ring: LogRing, peer_events: PeerEvents) -> None:
        self._router = router
        self._ring = ring
        self._peer_events = peer_events
        self._subscribers: dict[bytes, _Subscriber] = {}

    def __contains__(self, name: object) -> bool:
        return name in self._subscribers

    def __len__(self) -> int:
        return len(self._subscribers)

    @property
    def peers(self) -> list[ProbedPeer]:
        """The connected subscribers."""
        return [subscriber.peer for subscriber in self._subscribers.values()]

    def links(self, now_ns: int) -> list[LinkStatus]:
        """Return the state of their connections."""
        return [subscriber.peer.link(now_ns, subscriber.lost) for subscriber in self._subscribers.values()]

    def greet(self, name: bytes, hello: Hello, welcome: Welcome, now_ns: int) -> None:
        """Register a subscriber if there is room; one that is already registered goes on where it was."""
        known = self._subscribers.get(name)
        if known is None and len(self._subscribers) >= MAX_SUBSCRIBERS:
            raise WireError("too many listeners")
        self._router.send_or_queue(name, encode(welcome))
        if known is None or known.peer.hello != hello:
            self._subscribers[name] = _Subscriber(ProbedPeer(hello, now_ns))
            self._peer_events.add_with_details(hello, "listener_joined", {"name": hello.name}, now_ns)

    def handle(self, name: bytes, message: Message, now_ns: int) -> None:
        """Handle a subscriber's message."""
        subscriber = self._subscribers[name]
        subscriber.peer.note_message(now_ns)
        match message:
            case LogRequest(first=first):
                subscriber.cursor = self._ring.next if first < 0 else self._ring.start(first)
            case Pong():
                subscriber.peer.answered(message, now_ns)
            case Goodbye(reason=reason):
                self._forget(name, reason, now_ns)

    def pump(self, now_ns: int, *, ended: bool, unhandled: bool = False) -> bool:
        """Send each subscriber what its queue takes; return whether one was pinged.

        While frames are still `unhandled`, no subscriber counts as silent.
        """
        pinged = False
        for name, subscriber in list(self._subscribers.items()):
            if subscriber.peer.age_ns(now_ns) > SILENCE_TIMEOUT_NS and not unhandled:
                self._forget(name, "fell silent", now_ns)
                continue
            ping = subscriber.peer.ping(now_ns)
            pinged |= ping is not None and self._router.send(name, encode(ping))
            if subscriber.cursor is not None:
                subscriber.cursor = self._feed(name, subscriber, subscriber.cursor, ended)
        return pinged

    def dismiss(self) -> None:
        """Say goodbye to all subscribers."""
        for name in self._subscribers:
            self._router.send(name, encode(Goodbye("the session is over")))

    def _feed(self, name: bytes, subscriber: _Subscriber, cursor: int, ended: bool) -> int:
        """Send the next batch, and `LogEnd` after the last one; return the number of the record that follows."""
        if cursor < self._ring.next:
            batch = self._ring.batch(cursor, MAX_RECORDS, MAX_BYTES)
            if self._router.send(name, encode(batch)):
                subscriber.lost += batch.lost
                cursor = batch.first + len(batch.records)
        elif ended and not subscriber.end_sent:
            subscriber.end_sent = self._router.send(name, encode(LogEnd(self._ring.next - 1)))
        return cursor

    def _forget(self, name: bytes, reason: str, now_ns: int) -> None:
        subscriber = self._subscribers.pop(name)
        self._router.drop_queued(name)
        self._peer_events.add("listener_left", {"name": subscriber.peer.hello.name, "reason": reason}, now_ns)
