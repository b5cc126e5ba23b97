"""Imperfections of real devices: motor heating and delayed readings.

The simulated device creates them only if the configuration asks for them.
"""

from collections import deque
from math import exp

COOL = 0.8
"""Hot motors recover below this temperature, as a fraction of the limit [1]."""


class Heat:
    """Motor temperature as a first-order system driven by the squared force.

    Temperature is relative to the room, in units of the motors' limit: the continuous force, held indefinitely, brings
    it to 1. Above 1 the motors are hot until they have cooled to `COOL`.

    Parameters
    ----------
    continuous : float
        Continuous force of the motors [N].
    time : float
        Time constant [s].
    """

    def __init__(self, continuous: float, time: float) -> None:
        self.temperature = 0.0
        self.warm = False
        self._continuous = continuous
        self._time = time

    def live(self, seconds: float, force: float) -> None:
        """Advance the time under a constant force."""
        end = (force / self._continuous) ** 2
        self.temperature = end + (self.temperature - end) * exp(-seconds / self._time)
        self.warm = self.temperature > (COOL if self.warm else 1.0)


class Late:
    """Delay line for positions, with linear interpolation between samples.

    Parameters
    ----------
    delay_ns : int
        Delay [ns].
    """

    def __init__(self, delay_ns: int) -> None:
        self._delay_ns = delay_ns
        self._taken: deque[tuple[int, tuple[float, float, float]]] = deque()

    def take(self, now_ns: int, place: tuple[float, float, float]) -> tuple[float, float, float]:
        """Store the current position and return the delayed one; at the start, return the first position."""
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
