"""Recent changes between statuses. Pure: time is an argument.

The counters of a status start with the session, but an operator needs to know what happens now: deadline misses and
lost messages of the last ten seconds, and how long the disk will last.
"""

from collections import deque
from dataclasses import dataclass, field
from itertools import pairwise
from math import inf, nan

from netboard.network.protocol.control import Status

SPACING = 0.5
"""Interval between stored statuses [s]."""

LATELY = 10.0
"""Window of the recent counts [s]."""

SPAN = 60.0
"""Window over which a recording's growth is measured [s]."""

SHORTEST = 3.0
"""Shortest window that gives a growth rate [s]."""


@dataclass(frozen=True, slots=True)
class RecentCounts:
    """Recent counts, and the time left on the disk."""

    late_ticks: int = 0
    lost: dict[str, int] = field(default_factory=dict)
    minutes: float = nan  # time until the disk is full at the present growth; NaN while unknown [min]


def minutes_left(written: list[tuple[float, int]], free_bytes: int) -> float:
    """Estimate the time until a disk is full; NaN while unknown, infinite if nothing is written [min].

    `written` has times, and the file size in bytes at each [s, 1]. A file that has shrunk is a new one, because each
    block starts a new recording.
    """
    if len(written) < 2 or written[-1][0] - written[0][0] < SHORTEST:
        return nan
    sizes = [size for _, size in written]
    grown = sum(size - before if size >= before else size for before, size in pairwise(sizes))
    span = written[-1][0] - written[0][0]
    return free_bytes / (grown / span) / 60 if grown > 0 else inf


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
        lost_before = {link[0]: link[8] for link in before.links}
        return RecentCounts(
            max(status.late_ticks - before.late_ticks, 0),
            {link[0]: max(link[8] - lost_before.get(link[0], link[8]), 0) for link in status.links},
            self._minutes(now, status),
        )

    def _minutes(self, now: float, status: Status) -> float:
        """Time until the disk with the least free space is full [min]."""
        if not status.recordings:
            return nan
        written = [(at, sum(size for _, _, size, _ in old.recordings)) for at, old in [*self._past, (now, status)]]
        return minutes_left(written, min(free for _, _, _, free in status.recordings))
