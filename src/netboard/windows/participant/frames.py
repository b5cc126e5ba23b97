"""The count of frames: what came, what was painted, what was dropped. Pure: time is an argument.

The screen can show one frame a refresh, and there is no more to show than the server sends, so one frame is due in the
longer of the two periods. Dropped is what a participant should have been shown and was not: each such period in which
a new view had been sent and none came (their numbers say so: a view that was not sent, because nothing had changed, is
missed by nobody), and each in which a picture that was asked for was not painted. A view that came and gave way to a
newer one within a period is no drop: the screen could not have shown both.
"""

from collections import deque
from itertools import islice

from netboard.base.config import Side
from netboard.network.protocol.views import MOST_SHOWN, Frames

MOST_KEPT = 2048
"""Frames kept while nobody takes the reports; the oldest are forgotten first [1]."""

MOST_NS = 3600 * 1_000_000_000
"""Views further apart are not of one session [ns]."""


class FrameTally:
    """Count of one station.

    Parameters
    ----------
    period_ns : int
        One frame is due in this time [ns].
    """

    def __init__(self, station: Side, period_ns: int) -> None:
        self.station = station
        self.period_ns = period_ns
        self.painted = 0
        self.dropped = 0
        self._newest: tuple[int, int] | None = None
        self._waiting: tuple[int, int, int] | None = None
        self._shown: deque[tuple[int, int, int]] = deque(maxlen=MOST_KEPT)
        self._reported = 0

    def receive(self, seq: int, sent_ns: int) -> None:
        """Note that a view came, and count the frames that those before it could have made and did not.

        Parameters
        ----------
        seq : int
            Its number; one that is not larger than the one before begins a new count [1].
        """
        if self._newest is not None:
            missing, elapsed = seq - self._newest[0] - 1, sent_ns - self._newest[1]
            if missing > 0 and 0 < elapsed < MOST_NS:
                self.dropped += max(0, min(missing, round(elapsed / self.period_ns) - 1))
        self._newest = seq, sent_ns

    def wait(self, tick: int, received_ns: int, due_ns: int) -> None:
        """Note that a picture was handed to the window."""
        if self._waiting is not None:
            self.dropped += 1
        self._waiting = tick, received_ns, due_ns

    def paint(self, now_ns: int) -> bool:
        """Note that the window was painted; tell whether a waiting picture came to the screen with it."""
        if self._waiting is None:
            return False
        tick, received_ns, due_ns = self._waiting
        self._waiting = None
        self.painted += 1
        self.dropped += max(0, (now_ns - due_ns) // self.period_ns)
        self._shown.append((tick, received_ns, now_ns))
        return True

    def report(self) -> Frames | None:
        """Make the next report, of the oldest frames and as many as one may hold; None if there is nothing to say.

        It stays the same until `clear` says that it was sent.
        """
        if not self._shown and self.dropped == self._reported:
            return None
        return Frames(self.station, tuple(islice(self._shown, MOST_SHOWN)), self.dropped)

    def clear(self) -> None:
        """Forget what was reported; what did not fit is for the next report."""
        for _ in range(min(len(self._shown), MOST_SHOWN)):
            self._shown.popleft()
        self._reported = self.dropped
