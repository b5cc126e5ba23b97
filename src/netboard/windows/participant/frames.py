"""Counts of painted and dropped frames. Pure: time is an argument.

A frame is due once per period: the longer of the screen's refresh and the server's interval between views. A frame is
dropped for each period in which

- a view was sent but did not arrive (sequence numbers tell; views that the server did not send do not count), or
- a picture was requested but not painted.

A view replaced by a newer one within a period is no drop: the screen could not have shown both.
"""

from collections import deque
from itertools import islice

from netboard.base.config import Side
from netboard.network.protocol.views import MAX_SHOWN, Frames

MAX_KEPT = 2048
"""Frames kept while no report can be sent; the oldest are discarded first [1]."""

MAX_NS = 3600 * 1_000_000_000
"""Views further apart than this belong to different sessions [ns]."""


class FrameTally:
    """Count the frames of one station, of which one is due in each `period_ns` [ns]."""

    def __init__(self, station: Side, period_ns: int) -> None:
        self.station = station
        self.period_ns = period_ns
        self.painted = 0
        self.dropped = 0
        self._newest: tuple[int, int] | None = None
        self._expected: tuple[int, int, int] | None = None
        self._shown: deque[tuple[int, int, int]] = deque(maxlen=MAX_KEPT)
        self._reported = 0

    def receive(self, seq: int, sent_ns: int) -> None:
        """Note that a view arrived, and count the frames lost with missing views; without growth, `seq` starts anew."""
        if self._newest is not None:
            missing, elapsed = seq - self._newest[0] - 1, sent_ns - self._newest[1]
            if missing > 0 and 0 < elapsed < MAX_NS:
                self.dropped += max(0, min(missing, round(elapsed / self.period_ns) - 1))
        self._newest = seq, sent_ns

    def expect(self, tick: int, received_ns: int, due_ns: int) -> None:
        """Note that a picture was handed to the window, which will paint it."""
        if self._expected is not None:
            self.dropped += 1
        self._expected = tick, received_ns, due_ns

    def paint(self, now_ns: int) -> bool:
        """Note that the window was painted; return whether that painted an expected picture."""
        if self._expected is None:
            return False
        tick, received_ns, due_ns = self._expected
        self._expected = None
        self.painted += 1
        self.dropped += max(0, (now_ns - due_ns) // self.period_ns)
        self._shown.append((tick, received_ns, now_ns))
        return True

    def report(self) -> Frames | None:
        """Return the next report, with as many of the oldest frames as one may hold; None if nothing is new.

        Call `clear` once it was sent; until then the report holds the same frames.
        """
        if not self._shown and self.dropped == self._reported:
            return None
        return Frames(self.station, tuple(islice(self._shown, MAX_SHOWN)), self.dropped)

    def clear(self) -> None:
        """Remove the reported frames; those that did not fit stay for the next report."""
        for _ in range(min(len(self._shown), MAX_SHOWN)):
            self._shown.popleft()
        self._reported = self.dropped
