"""When the pulses of a trigger box begin and end: one at a time, in the order of their events.

A pulse begins at once if the lines are low and have been so for the gap. Otherwise it waits, and its wait is reported:
no code is dropped or merged, also if two events fall into one tick. Only if more than `MAX_WAITING` wait is the newest
refused. Pure: time is an argument [ns].
"""

from collections import deque
from dataclasses import dataclass

from netboard.base.tables.triggers import Triggers

MAX_WAITING = 32
"""Pulses that may wait for those before them [1]."""

EDGE_NS = 20_000_000
"""Longest time from the beginning of a pulse to its arrival at the input, with a loop-back [ns]."""

TOO_MANY = f"{MAX_WAITING} pulses were waiting already"
"""Why a pulse is not made."""


@dataclass
class Pulse:
    """One pulse. Times of 0: not yet, or never [ns]."""

    number: int
    code: int
    wanted_ns: int
    begin_ns: int = 0  # just before the write of its code
    began_ns: int = 0  # just after it
    ended_ns: int = 0
    edge_ns: int = 0
    fault: str = ""

    @property
    def waited_ns(self) -> int:
        """How long it waited for earlier pulses."""
        return self.begin_ns - self.wanted_ns if self.begin_ns else 0


class Pulses:
    """The pulses of one box."""

    def __init__(self, triggers: Triggers) -> None:
        self.done: list[Pulse] = []  # completed or failed, to be taken by the caller
        self._width_ns, self._gap_ns = int(triggers.width * 1e9), int(triggers.gap * 1e9)
        self._reset, self._loopback = triggers.reset, triggers.loopback
        self._waiting: deque[Pulse] = deque()
        self._current: Pulse | None = None
        self._edgeless: deque[Pulse] = deque()  # began, and their edge is awaited
        self._free_ns = 0  # when the next pulse may begin

    def want(self, number: int, code: int, now_ns: int) -> None:
        """Ask for a pulse."""
        pulse = Pulse(number, code, now_ns)
        if len(self._waiting) >= MAX_WAITING:
            self._finish(pulse, TOO_MANY)
        else:
            self._waiting.append(pulse)

    def due(self, now_ns: int) -> int | None:
        """Return the code to write now, 0 to end a pulse, None for no write. Call `wrote` after the write."""
        if self._current is not None and now_ns >= self._end_ns:
            if self._reset:
                return 0
            self._end(self._end_ns)  # the box ends it by itself
        if self._current is None and self._waiting and now_ns >= self._free_ns:
            return self._waiting[0].code
        return None

    def wrote(self, before_ns: int, after_ns: int) -> None:
        """Take the times just before and after the write of the code that was due."""
        if self._current is not None:
            self._end(after_ns)
            return
        self._current = pulse = self._waiting.popleft()
        pulse.begin_ns, pulse.began_ns = before_ns, after_ns
        if self._loopback:
            self._edgeless.append(pulse)

    def edge(self, now_ns: int) -> bool:
        """Take an edge at the input; return whether it is that of a pulse, the oldest one that lacks it."""
        self.expire(now_ns)
        if not self._edgeless:
            return False
        pulse = self._edgeless.popleft()
        pulse.edge_ns = now_ns
        self._complete(pulse)
        return True

    def expire(self, now_ns: int) -> None:
        """Give up the edges that are overdue."""
        while self._edgeless and now_ns - self._edgeless[0].began_ns > EDGE_NS:
            self._complete(self._edgeless.popleft())

    def fail(self, reason: str) -> None:
        """Give up all pulses: the box is gone."""
        under_way = [] if self._current is None or self._current in self._edgeless else [self._current]
        for pulse in (*self._edgeless, *under_way, *self._waiting):
            self._finish(pulse, reason)
        self._waiting.clear()
        self._edgeless.clear()
        self._current = None

    def wake_ns(self) -> int | None:
        """Return when something is due next; None for never."""
        times = [self._edgeless[0].began_ns + EDGE_NS + 1] if self._edgeless else []
        if self._current is not None:
            times.append(self._end_ns)
        elif self._waiting:
            times.append(self._free_ns)
        return min(times, default=None)

    @property
    def _end_ns(self) -> int:
        assert self._current is not None
        return self._current.began_ns + self._width_ns

    def _end(self, now_ns: int) -> None:
        pulse, self._current = self._current, None
        assert pulse is not None
        pulse.ended_ns, self._free_ns = now_ns, now_ns + self._gap_ns
        self._complete(pulse)

    def _complete(self, pulse: Pulse) -> None:
        """Finish a pulse that has ended and awaits no edge."""
        if pulse.ended_ns and pulse not in self._edgeless:
            self._finish(pulse, "")

    def _finish(self, pulse: Pulse, fault: str) -> None:
        pulse.fault = fault
        self.done.append(pulse)
