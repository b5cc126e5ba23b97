"""Recent changes between statuses. Pure: time is an argument.

The counters of a status start with the session, but an operator needs to know what happens now: deadline misses and
lost messages of the last ten seconds, who is refused, and how long the disk will last.
"""

from collections import deque
from dataclasses import dataclass, field
from itertools import pairwise
from math import nan

from netboard.network.protocol.control import Status
from netboard.network.protocol.joining import HELLO_FIRST
from netboard.nodes.ports.refusals import TOO_MANY_MESSAGES
from netboard.recording.format.disk import BYTES_PER_SECOND

SPACING = 0.5
"""Interval between stored statuses [s]."""

LATELY = 10.0
"""Window of the recent counts [s]."""

SPAN = 60.0
"""Window over which a recording's growth is measured [s]."""

SHORTEST = 30.0
"""Shortest window that gives a growth rate; before, and for a slower growth, `BYTES_PER_SECOND` is taken [s]."""


PASSING = (HELLO_FIRST, TOO_MANY_MESSAGES)
"""Reasons of refusals that are normal after a restart or a stall."""


@dataclass(frozen=True, slots=True)
class RecentCounts:
    """Recent counts, and the time left on the disk."""

    late_ticks: int = 0
    lost: dict[str, int] = field(default_factory=dict)
    refused: tuple[str, ...] = ()  # reasons for which the server refuses peers, the most frequent first
    minutes: float = nan  # how long recordings can go on until the disk is full; NaN while unknown [min]


def minutes_left(written: list[tuple[float, int]], free_bytes: int) -> float:
    """Estimate how long recordings can go on until a disk is full [min].

    `written` has times, and the file size in bytes at each [s, 1]. A file that has shrunk is a new one, because each
    block starts a new recording. An idle session writes little, so the rate is at least that of running trials.
    """
    sizes = [size for _, size in written]
    grown = sum(size - before if size >= before else size for before, size in pairwise(sizes))
    span = written[-1][0] - written[0][0]
    rate = grown / span if span >= SHORTEST else 0.0
    return free_bytes / max(rate, BYTES_PER_SECOND) / 60


def _refused_since(before: Status, status: Status) -> tuple[str, ...]:
    """Return the reasons of refusals since an older status, the most frequent first.

    Those that a peer ends by itself are left out: after a restart or a stall it registers again.
    """
    known = {(where, why): times for where, why, times in before.refused}
    grown = [(times - known.get((where, why), 0), why) for where, why, times in status.refused]
    return tuple(why for more, why in sorted(grown, reverse=True) if more > 0 and why not in PASSING)


class StatusHistory:
    """The statuses of the last minute."""

    def __init__(self) -> None:
        self._session = ""
        self._past: deque[tuple[float, Status]] = deque()

    def add(self, now: float, status: Status) -> RecentCounts:
        """Store a status, and return the recent changes."""
        if status.session != self._session:
            self._past.clear()
            self._session = status.session
        if not self._past or now - self._past[-1][0] >= SPACING:
            self._past.append((now, status))
        while now - self._past[0][0] > SPAN:
            self._past.popleft()
        before = next(old for at, old in self._past if now - at <= LATELY or old is self._past[-1][1])
        lost_before = {link.peer: link.lost for link in before.links}
        return RecentCounts(
            max(status.late_ticks - before.late_ticks, 0),
            {link.peer: max(link.lost - lost_before.get(link.peer, link.lost), 0) for link in status.links},
            _refused_since(before, status),
            self._minutes(now, status),
        )

    def _minutes(self, now: float, status: Status) -> float:
        """Time until the disk with the least free space is full [min]."""
        if not status.recordings:
            return nan
        past = [*self._past, (now, status)]
        written = [(at, sum(recording.written_bytes for recording in old.recordings)) for at, old in past]
        return minutes_left(written, min(recording.free_bytes for recording in status.recordings))
