"""The count of frames: what was received, painted and dropped. Pure: time is an argument.

A view is dropped if a newer one replaced it before it was painted, or if it was painted later than `late_ns` after it
was received. A view that changes nothing on the screen needs no frame and is neither.
"""

from netboard.config import Side
from netboard.wire.messages import Frames


class FrameTally:
    """Count of one station.

    Parameters
    ----------
    station : str
        ``left`` or ``right``.
    late_ns : int
        A frame painted later than this after its view came is counted as dropped [ns].

    Attributes
    ----------
    painted : int
        Frames painted since the start [1].
    dropped : int
        Views dropped since the start [1].
    """

    def __init__(self, station: Side, late_ns: int) -> None:
        self.station = station
        self.late_ns = late_ns
        self.painted = 0
        self.dropped = 0
        self._waiting: tuple[int, int] | None = None
        self._shown: list[tuple[int, int, int]] = []
        self._reported = 0

    def wait(self, tick: int, received_ns: int) -> None:
        """Note that a view is to be painted.

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
        self.dropped += now_ns - received_ns > self.late_ns
        self._shown.append((tick, received_ns, now_ns))
        return True

    def report(self) -> Frames | None:
        """Take the frames shown since the report before; None if there is nothing to report."""
        if not self._shown and self.dropped == self._reported:
            return None
        frames = Frames(self.station, tuple(self._shown), self.dropped)
        self._shown.clear()
        self._reported = self.dropped
        return frames
