"""The tick clock of a session: deadlines one millisecond apart, and how a late loop catches up.

A tick runs as soon as both sides' new samples have arrived, at most half a millisecond before its deadline; otherwise
it runs at its deadline. While the session is idle, due ticks run together, 20 times a second, and twice a second if
it has no peer. Pure: time is an argument.
"""

from netboard.base.clock import CATCH_UP_TICKS
from netboard.base.tick import LATE_NS, TICK_NS

EARLIEST_NS = TICK_NS // 2
"""Earliest start of a tick before its deadline [ns]."""

IDLE_TICKS = 50
"""Ticks that run together while the session is idle [1]."""

NO_PEER_TICKS = 500
"""Ticks that run together while the session is idle and has no peer at all [1]."""


class TickClock:
    """Counts the ticks by their deadlines.

    ``due_ns``: deadline of the next tick [ns]. ``wake_ns``: when the session wants to run next if no message arrives
    first [ns].
    """

    def __init__(self) -> None:
        self.due_ns = self.wake_ns = 0
        self.late_ticks = 0
        self.gap = ""  # notice that the deadlines have moved, which spoils a trial; empty once taken

    def begin(self, due_ns: int) -> None:
        """Set the deadline of the first tick [ns]."""
        self.due_ns = self.wake_ns = due_ns

    def is_due(self, now_ns: int, complete: bool) -> bool:
        """Return whether the next tick can run now [ns]; `complete` says that both sides' new samples are in."""
        return now_ns >= self.due_ns or (complete and now_ns >= self.due_ns - EARLIEST_NS)

    def due_count(self, now_ns: int) -> int:
        """Return the number of ticks due at a time [ns]; less than one if none is."""
        return (now_ns - self.due_ns) // TICK_NS + 1

    def advance(self, count: int) -> None:
        """Move the deadline on by this many ticks [1]."""
        self.due_ns += count * TICK_NS

    def began(self, late_ns: int) -> None:
        """Count a tick that began this long after its deadline [ns], if that is a deadline miss."""
        self.late_ticks += late_ns > LATE_NS

    def skip_backlog(self, now_ns: int, idle: bool) -> int:
        """Move the deadlines if the loop was held up too long; return by how much [ns]."""
        behind_ns = now_ns - self.due_ns
        # An idle session runs its ticks in groups, so being behind by a group is no stall.
        if behind_ns <= (CATCH_UP_TICKS + (NO_PEER_TICKS if idle else 0)) * TICK_NS:
            return 0
        # Whole ticks: the agents' sampling stays in phase, and a check of the recording takes other jumps for damage.
        moved_ns = behind_ns - behind_ns % TICK_NS
        self.due_ns += moved_ns
        self.gap = f"the server stalled for {moved_ns / TICK_NS:.0f} ms"
        return moved_ns

    def take_gap(self) -> str:
        """Return the notice of a gap, and clear it."""
        gap, self.gap = self.gap, ""
        return gap

    def sleep(self, idle: bool, complete: bool, alone: bool = False) -> None:
        """Set when the session runs next. ``alone``: it has no peer, which must not wait for it."""
        if idle:
            self.wake_ns = self.due_ns + ((NO_PEER_TICKS if alone else IDLE_TICKS) - 1) * TICK_NS
        elif complete:
            self.wake_ns = self.due_ns - EARLIEST_NS
        else:
            self.wake_ns = self.due_ns
