"""The count of frames: what came, what was painted, what was dropped. Pure: time is an argument.

The screen can show one frame a refresh, and there is no more to show than the server sends, so one frame is due in the
longer of the two periods. A frame is dropped if the views that were received leave a hole in the server's ticks (they
were lost, or replaced while this process did something else), if it was replaced after its turn and before it was
painted, or if it was painted more than one such period after its view had come.
"""

from collections import deque

from netboard.config import Side
from netboard.tick import TICK_NS
from netboard.wire.messages import Frames

MOST_KEPT = 2000
"""Frames kept while nobody takes the report, no more than one may hold; the oldest are forgotten first [1]."""

MOST_TICKS = 86_400_000
"""Ticks of a day: views further apart are not of one session [1]."""


class FrameTally:
    """Count of one station.

    Parameters
    ----------
    station : str
        ``left`` or ``right``.
    period_ns : int
        One frame is due in this time [ns].

    Attributes
    ----------
    painted : int
        Frames painted since the start [1].
    dropped : int
        Frames dropped since the start [1].
    """

    def __init__(self, station: Side, period_ns: int) -> None:
        self.station = station
        self.period_ns = period_ns
        self.painted = 0
        self.dropped = 0
        self._tick: int | None = None
        self._waiting: tuple[int, int] | None = None
        self._shown: deque[tuple[int, int, int]] = deque(maxlen=MOST_KEPT)
        self._reported = 0

    def receive(self, tick: int) -> None:
        """Note that a view came, and count the frames that should have come since the one before.

        Parameters
        ----------
        tick : int
            Its tick; a smaller one than before, or one of another day, begins a new count [1].
        """
        if self._tick is not None and 0 < tick - self._tick < MOST_TICKS:
            self.dropped += max(0, round((tick - self._tick) * TICK_NS / self.period_ns) - 1)
        self._tick = tick

    def wait(self, tick: int, received_ns: int) -> None:
        """Note that it is a view's turn to be painted.

        Parameters
        ----------
        tick : int
            Its tick [1].
        received_ns : int
            When it was received [ns].
        """
        if self._waiting is not None:
            self.dropped += 1
        self._waiting = (tick, received_ns)

    def paint(self, now_ns: int) -> bool:
        """Note that the window was painted; tell whether a waiting view came to the screen with it.

        Parameters
        ----------
        now_ns : int
            When it was painted [ns].
        """
        if self._waiting is None:
            return False
        tick, received_ns = self._waiting
        self._waiting = None
        self.painted += 1
        self.dropped += now_ns - received_ns > self.period_ns
        self._shown.append((tick, received_ns, now_ns))
        return True

    def report(self) -> Frames | None:
        """Make the report, None if there is nothing to say. It stays the same until `clear` says that it was sent."""
        if not self._shown and self.dropped == self._reported:
            return None
        return Frames(self.station, tuple(self._shown), self.dropped)

    def clear(self) -> None:
        """Forget what was reported."""
        self._shown.clear()
        self._reported = self.dropped
