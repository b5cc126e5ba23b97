"""What has changed of late, from one status to the next. Pure: it is told the time.

A status counts from the start of the session; an operator wants to know what happens now: how many ticks were late in
the last ten seconds, how many messages were lost, and how long the disk will last.
"""

from collections import deque
from dataclasses import dataclass, field
from itertools import pairwise
from math import inf, nan

from netboard.network.protocol.control import Status

SPACING = 0.5
"""A status is remembered so often [s]."""

LATELY = 10.0
"""What lamps call of late [s]."""

SPAN = 60.0
"""The growth of a recording is that of so long [s]."""

SHORTEST = 3.0
"""Before so long nothing is said about the growth [s]."""


@dataclass(frozen=True, slots=True)
class Recent:
    """What has happened of late.

    Attributes
    ----------
    minutes : float
        How long the disk will last as the recording grows now; NaN while that is not known [min].
    """

    late_ticks: int = 0
    lost: dict[str, int] = field(default_factory=dict)
    minutes: float = nan


def minutes_left(written: list[tuple[float, int]], free_bytes: int) -> float:
    """How long a disk will last.

    A file that is smaller than it was is another one: a recording begins anew with each block.

    Parameters
    ----------
    written : list of (float, int)
        Time and size of the file that was written then, in bytes [s, 1].

    Returns
    -------
    float
        NaN while it is not known; infinite if nothing is written [min].
    """
    if len(written) < 2 or written[-1][0] - written[0][0] < SHORTEST:
        return nan
    sizes = [size for _, size in written]
    grown = sum(size - before if size >= before else size for before, size in pairwise(sizes))
    span = written[-1][0] - written[0][0]
    return free_bytes / (grown / span) / 60 if grown > 0 else inf


class Memory:
    """Remembers the statuses of a minute."""

    def __init__(self) -> None:
        self._session = ""
        self._past: deque[tuple[float, Status]] = deque()

    def remember(self, now: float, status: Status) -> Recent:
        """Take a status, and tell what has changed of late."""
        if status.session != self._session:
            self._past.clear()
            self._session = status.session
        if not self._past or now - self._past[-1][0] >= SPACING:
            self._past.append((now, status))
        while now - self._past[0][0] > SPAN:
            self._past.popleft()
        before = next(old for at, old in self._past if now - at <= LATELY or old is self._past[-1][1])
        lost_before = {link[0]: link[8] for link in before.links}
        return Recent(
            max(status.late_ticks - before.late_ticks, 0),
            {link[0]: max(link[8] - lost_before.get(link[0], link[8]), 0) for link in status.links},
            self._minutes(now, status),
        )

    def _minutes(self, now: float, status: Status) -> float:
        """How long the disk with the least room lasts [min]."""
        if not status.recordings:
            return nan
        written = [(at, sum(size for _, _, size, _ in old.recordings)) for at, old in [*self._past, (now, status)]]
        return minutes_left(written, min(free for _, _, _, free in status.recordings))
