"""Time of a process: the monotonic clock and the 1 kHz pacer.

Time is an integer number of nanoseconds of the clock of `netboard.base.system.monotonic`, never stepped. The pacer
keeps absolute deadlines: a deadline miss does not move the next deadline, so that lateness never adds up. A loop that
falls far behind does not run a burst of ticks to catch up: it moves its deadlines and says by how much.
"""

import time

from netboard.base.system import monotonic
from netboard.base.tick import TICK_NS

CATCH_UP_TICKS = 20
"""A loop further behind than this moves its deadlines instead of running ticks in a burst [1]."""


def now_ns() -> int:
    """Return the monotonic time of this machine [ns]."""
    return monotonic.monotonic_ns()  # looked up at each call, because a test replaces the clock of this module


class Pacer:
    """Absolute-time ticks of 1 ms."""

    def __init__(self, start_ns: int) -> None:
        # When the present tick was due; before the first `wait`, one tick before it [ns].
        self.due_ns = start_ns - TICK_NS
        self.moved_ns = 0  # by how much the deadlines have been moved since the start [ns]

    def shift(self, span_ns: int) -> None:
        """Shift this and all later ticks by a duration; negative for earlier [ns]."""
        self.due_ns += span_ns

    def wait(self) -> int:
        """Sleep until the next deadline and return the time since it [ns]."""
        self.due_ns += TICK_NS
        now = now_ns()
        if now < self.due_ns:
            time.sleep((self.due_ns - now) * 1e-9)
            now = now_ns()
        late = now - self.due_ns
        if late > CATCH_UP_TICKS * TICK_NS:
            missed = late - late % TICK_NS
            self.due_ns += missed
            self.moved_ns += missed
            late -= missed
        return late
