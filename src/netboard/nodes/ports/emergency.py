"""Emergency stops, and trips of a device's safety chain, as events for the recording and text for the operator.

An emergency stop comes from an operator or from a button on a device. It holds for both devices until an operator
releases it; even then a block goes on only when an operator resumes it.
Pure: it gets everything as arguments and only remembers.
"""

from netboard.base.config import SIDES, Side
from netboard.base.safeguards import PARTNER_LET_GO, TRIP_CAUSES, Safeguard
from netboard.network.protocol.records import RELEASED, STOPPED
from netboard.nodes.ports import samples

STOP, RELEASE = STOPPED, RELEASED
"""Commands of the operator, and names of the events."""

AWAITING_ARMING = "device to be armed"
"""What a block waits for, after the name of the side."""

AWAITING_RELEASE = "the emergency stop to be released"
"""What a block waits for until the stop is released."""

REPEAT_INTERVAL_NS = 1_000_000_000
"""Interval within which the same cause at the same device is reported once [ns]."""

Event = tuple[str, dict[str, str]]


class EmergencyStop:
    """State of the emergency stop, and what has tripped."""

    def __init__(self) -> None:
        self.halted = ""
        self.robots: frozenset[Side] = frozenset()  # whose stylus a robot partner holds, as an operator may know
        self._reported_ns: dict[tuple[Side, Safeguard], int] = {}  # when a cause was last reported [ns]

    def halt(self, reason: str) -> list[Event]:
        """Stop both devices; return the events to record."""
        if self.halted:
            return []
        self.halted = reason
        return [(STOP, {"reason": reason})]

    def release(self) -> list[Event]:
        """Release an emergency stop; return the events to record."""
        if not self.halted:
            return []
        self.halted = ""
        return [(RELEASE, {})]

    def poll(self, found: int, safeguards: dict[Side, int], now_ns: int) -> list[Event]:
        """Take the safeguard bits of a tick's samples; return the events to record."""
        events: list[Event] = []
        for place, side in enumerate(SIDES):
            if found & (samples.TRIPPED << place):
                events += self._events_of(side, safeguards[side], now_ns)
            if found & (samples.STOPPED << place):
                events += self.halt(f"emergency stop at the {side} device")
        return events

    def why(self, side: Side, now_ns: int) -> str:
        """Return what has just tripped a device's safety chain, in brackets; empty if nothing has."""
        recent = [key for key, at_ns in self._reported_ns.items() if now_ns - at_ns < REPEAT_INTERVAL_NS]
        causes = [self._text(side, cause) for device, cause in recent if device == side]
        return f" ({', '.join(causes)})" if causes else ""

    def _events_of(self, side: Side, bits: int, now_ns: int) -> list[Event]:
        """Return events for the causes that were not reported within `REPEAT_INTERVAL_NS`."""
        before_ns = now_ns - REPEAT_INTERVAL_NS
        new = [c for c in TRIP_CAUSES if bits & c.value and self._reported_ns.get((side, c), before_ns) <= before_ns]
        self._reported_ns.update(((side, cause), now_ns) for cause in new)
        return [("safeguard", {"side": side, "cause": self._text(side, cause)}) for cause in new]

    def _text(self, side: Side, cause: Safeguard) -> str:
        """Return the text of a cause."""
        return PARTNER_LET_GO if cause == Safeguard.NOT_READY and side in self.robots else TRIP_CAUSES[cause]
