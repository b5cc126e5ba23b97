"""When the ticks of a session are done: deadlines a millisecond apart, and what becomes of them if its loop is late.

A tick is done as soon as both sides' new samples are in, at most half a millisecond before its deadline, and else at
its deadline. While there is nothing to be quick for, the ticks that have become due are done together, a few dozen
times a second. Pure: it is told the time, and counts.
"""

from netboard.base.tick import TICK_NS

EARLIEST_NS = TICK_NS // 2
"""A tick is done at most so long before its deadline [ns]."""

LATE_NS = TICK_NS // 2
"""A tick done later than this is counted as late [ns]."""

CATCH_UP_TICKS = 20
"""A session further behind than this moves its deadlines instead of doing its ticks in a burst [1]."""

IDLE_TICKS = 25
"""So many ticks are done together while there is nothing to be quick for [1]."""


class Pace:
    """Counts the ticks by their deadlines.

    Attributes
    ----------
    due_ns : int
        Deadline of the next tick [ns].
    wake_ns : int
        When the session wants to go on, if nothing comes before [ns].
    gap : str
        That the deadlines have been moved, in words, until it is taken: a trial is spoiled by it; else empty.
    """

    def __init__(self) -> None:
        self.due_ns = self.wake_ns = 0
        self.late_ticks = 0
        self.gap = ""

    def begin(self, due_ns: int) -> None:
        """Let the first tick be due at a time [ns]."""
        self.due_ns = self.wake_ns = due_ns

    def is_time(self, now_ns: int, complete: bool) -> bool:
        """Whether the next tick can be done now [ns], where both sides' new samples may be in."""
        return now_ns >= self.due_ns or (complete and now_ns >= self.due_ns - EARLIEST_NS)

    def how_many(self, now_ns: int) -> int:
        """How many ticks have become due [1], as of now [ns]; less than one if none has."""
        return (now_ns - self.due_ns) // TICK_NS + 1

    def did(self, count: int) -> None:
        """So many ticks have been done [1]."""
        self.due_ns += count * TICK_NS

    def began(self, late_ns: int) -> None:
        """A tick has begun so long after its deadline [ns]."""
        self.late_ticks += late_ns > LATE_NS

    def catch_up(self, now_ns: int, idle: bool) -> int:
        """Move the deadlines if the loop was held up for too long; by how much [ns]."""
        behind_ns = now_ns - self.due_ns
        if behind_ns <= (CATCH_UP_TICKS + (IDLE_TICKS if idle else 0)) * TICK_NS:
            return 0
        moved_ns = behind_ns - behind_ns % TICK_NS
        self.due_ns += moved_ns
        self.gap = f"the server stood still for {moved_ns / TICK_NS:.0f} ms"
        return moved_ns

    def take_gap(self) -> str:
        """Tell of the gap, once."""
        gap, self.gap = self.gap, ""
        return gap

    def sleep(self, idle: bool, complete: bool) -> None:
        """Decide when to go on."""
        if idle:
            self.wake_ns = self.due_ns + (IDLE_TICKS - 1) * TICK_NS
        elif complete:
            self.wake_ns = self.due_ns - EARLIEST_NS
        else:
            self.wake_ns = self.due_ns
