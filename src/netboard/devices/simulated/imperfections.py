"""What a real device does and an ideal one does not: its motors get warm, and its readings come late.

Both are parts of the simulated device that are made only where the configuration asks for them.
"""

from collections import deque
from math import exp

COOL = 0.8
"""Warm motors are ready again below this temperature, as a share of the one at which they are warm [1]."""


class Heat:
    """Temperature of motors: of first order, driven by the square of the force.

    It is counted from that of the room, in units of what the motors bear: the continuous force, held for ever, brings
    it to 1. Above that they are warm, until they have cooled down to `COOL`.

    Parameters
    ----------
    continuous : float
        Force that the motors give for ever [N].
    time : float
        Time constant [s].
    """

    def __init__(self, continuous: float, time: float) -> None:
        self.temperature = 0.0
        self.warm = False
        self._continuous = continuous
        self._time = time

    def live(self, seconds: float, force: float) -> None:
        """Let time pass under a constant force."""
        end = (force / self._continuous) ** 2
        self.temperature = end + (self.temperature - end) * exp(-seconds / self._time)
        self.warm = self.temperature > (COOL if self.warm else 1.0)


class Late:
    """Positions as they were a while ago: on the line between the two that were taken before and after.

    Parameters
    ----------
    delay_ns : int
        How long ago [ns].
    """

    def __init__(self, delay_ns: int) -> None:
        self._delay_ns = delay_ns
        self._taken: deque[tuple[int, tuple[float, float, float]]] = deque()

    def take(self, now_ns: int, place: tuple[float, float, float]) -> tuple[float, float, float]:
        """Take the position now and give the one of then; before the first one, that."""
        taken, then_ns = self._taken, now_ns - self._delay_ns
        if not taken or now_ns > taken[-1][0]:
            taken.append((now_ns, place))
        while len(taken) > 1 and taken[1][0] <= then_ns:
            taken.popleft()
        start_ns, start = taken[0]
        if len(taken) == 1 or then_ns <= start_ns:
            return start
        end_ns, end = taken[1]
        share = (then_ns - start_ns) / (end_ns - start_ns)
        x, y, z = (a + share * (b - a) for a, b in zip(start, end, strict=True))
        return x, y, z
