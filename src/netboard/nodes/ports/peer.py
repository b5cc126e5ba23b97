"""A peer as operators see it: identity, connection, clock offset, losses.

The server pings peers that do not send every millisecond, a few times a second.
"""

from collections import Counter
from collections.abc import Collection, Iterable
from math import nan
from typing import Protocol

from netboard.base.errors import WireError
from netboard.network.protocol import admission
from netboard.network.protocol.clock_estimator import UNKNOWN_NS, ClockEstimator
from netboard.network.protocol.control import LinkStatus
from netboard.network.protocol.joining import Hello, Ping, Pong, role_and_side
from netboard.network.protocol.records import ClockRecord, connection_name
from netboard.network.transport.endpoints import MAX_CHARACTERS, Router

PING_NS = 200_000_000
"""Interval between two pings of a peer that answers [ns].

Well below the second of silence after which a logger joins again: its log may be idle for longer.
"""

SILENCE_SHARE = 8
"""A silent peer is pinged at intervals of its silence over this [1].

A process that was suspended answers all waiting pings at once when it goes on, so there should be few of them.
"""

CLOCK_WINDOW_NS = 10_000_000_000
"""The clock offset uses the probes with the shortest round trip in this window [ns]."""

SILENCE_TIMEOUT_NS = 3_000_000_000
"""Silence after which an interruption of the connection is assumed [ns]."""

RATE_NS = 1_000_000_000
"""Shortest window over which a rate is computed [ns]."""


def admit(hello: Hello, router: Router, roles: Collection[str]) -> None:
    """Raise WireError, with the reason, if the sender of the last frame may not join the router's channel."""
    admission.admit(hello, router.channel, roles)
    if reason := router.role_refusal(hello.role, hello.side):
        raise WireError(reason)


def _seconds(span_ns: int) -> float:
    """Convert a duration to seconds; NaN if it is not known."""
    return nan if span_ns == UNKNOWN_NS else span_ns * 1e-9


class CountRate:
    """Turns a growing count into a rate."""

    def __init__(self) -> None:
        self._value = 0.0
        self._count = 0
        self._since_ns = -RATE_NS

    def of(self, count: int, now_ns: int) -> float:
        """Return the current rate [Hz]."""
        span_ns = now_ns - self._since_ns
        if span_ns >= RATE_NS:
            self._value = (count - self._count) / (span_ns * 1e-9)
            self._count, self._since_ns = count, now_ns
        return self._value


def link_status(hello: Hello, clock: ClockEstimator, age_ns: int, rate: float, lost: int) -> LinkStatus:
    """Return the status of a connection."""
    return LinkStatus(
        role_and_side(hello.role, hello.side),
        hello.name[:MAX_CHARACTERS],
        hello.version[:MAX_CHARACTERS],
        age_ns * 1e-9,
        _seconds(clock.round_trip_ns),
        _seconds(clock.bound_ns),
        clock.drift_ppm,
        rate,
        lost,
    )


class Probed(Protocol):
    """A connection whose clock is probed; its name is empty until a probe of it is recorded."""

    @property
    def hello(self) -> Hello | None:
        """How the peer introduced itself."""

    connection: str
    probe: tuple[int, int, int, int] | None
    clock: ClockEstimator


class Probes:
    """Turns the clock probes of a port's peers into records.

    Each connection has its own clock estimate, so the probes carry its name: ``display.left``, then ``display.left#2``
    and so on.
    """

    def __init__(self) -> None:
        self._connections: Counter[str] = Counter()

    def records(self, peers: Iterable[Probed], seq: int) -> list[ClockRecord]:
        """Return the newest raw probe of each peer, numbered from `seq`; each probe is recorded once."""
        records: list[ClockRecord] = []
        for peer in peers:
            if peer.probe is not None and peer.hello is not None:
                peer.connection = peer.connection or self._next(role_and_side(peer.hello.role, peer.hello.side))
                clock = peer.clock
                estimate = clock.offset_ns, clock.bound_ns, clock.drift_ppm
                records.append(ClockRecord(seq + len(records), peer.connection, *peer.probe, *estimate))
                peer.probe = None
        return records

    def _next(self, kind: str) -> str:
        self._connections[kind] += 1
        return connection_name(kind, self._connections[kind])


class ProbedPeer:
    """A peer whose clock is probed by pings. ``now_ns``: time at which it joined [ns]."""

    def __init__(self, hello: Hello, now_ns: int) -> None:
        self.hello = hello
        self.connection = ""
        self.clock = ClockEstimator(CLOCK_WINDOW_NS)
        self.probe: tuple[int, int, int, int] | None = None
        self._last_message_ns = now_ns
        self._messages = 0
        self._rate = CountRate()
        self._asked_ns = now_ns - PING_NS
        self._returned_ns = 0
        self._answered_ns: int | None = None  # time of the newest ping that it has answered

    @property
    def may_be_late(self) -> bool:
        """Whether its messages may be from before an interruption: only the answer to a ping since then excludes it.

        A peer that never answers pings is trusted.
        """
        return self._answered_ns is not None and self._answered_ns < self._returned_ns

    def note_message(self, now_ns: int) -> None:
        """Count a message from the peer; after a silence, a ping is due."""
        if self.age_ns(now_ns) > SILENCE_TIMEOUT_NS:
            self._returned_ns, self._asked_ns = now_ns, now_ns - PING_NS
        self._last_message_ns = now_ns
        self._messages += 1

    def age_ns(self, now_ns: int) -> int:
        """Time since its last message [ns]."""
        return now_ns - self._last_message_ns

    def ping(self, now_ns: int) -> Ping | None:
        """Return a ping if one is due."""
        if now_ns - self._asked_ns < max(PING_NS, self.age_ns(now_ns) // SILENCE_SHARE):
            return None
        self._asked_ns = now_ns
        return Ping(now_ns)

    def answered(self, pong: Pong, now_ns: int) -> None:
        """Take the answer to a ping, unless its stamps are impossible."""
        probe = (pong.ping_ns, pong.received_ns, pong.sent_ns, now_ns)
        self._answered_ns = max(self._answered_ns or 0, pong.ping_ns)
        if self.clock.add(*probe):
            self.probe = probe

    def link(self, now_ns: int, lost: int = 0) -> LinkStatus:
        """Return the state of the connection, with the number of records lost to it [1]."""
        return link_status(self.hello, self.clock, self.age_ns(now_ns), self._rate.of(self._messages, now_ns), lost)
