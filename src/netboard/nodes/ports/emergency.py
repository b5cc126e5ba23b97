"""Emergency stops, and what trips the safety of a device: for the recording, and for the operator to read.

An emergency stop comes from an operator or from a button at a device. It holds for both devices until an operator
releases it, and then a block goes on only when an operator resumes it.
Pure: it is told everything and does nothing but remember.
"""

from netboard.base.config import SIDES, Side
from netboard.network.protocol.motion import Safeguard
from netboard.nodes.ports import samples

STOP, RELEASE = "emergency_stop", "emergency_release"
"""The operator's commands for it, and the names of the events."""

LACKING = "the emergency stop to be released"
"""What a block waits for meanwhile."""

AGAIN_NS = 1_000_000_000
"""The same cause at the same device is told once in so long [ns]."""

WORDS = {
    Safeguard.STALE: "no fresh force from the server",
    Safeguard.TOO_FAST: "the stylus was too fast",
    Safeguard.NOT_FINITE: "a force or a reading was not a number",
    Safeguard.DEVICE_LOST: "the device does not answer",
    Safeguard.WORN: "the motors have given their mean force",
    Safeguard.STOPPED: "emergency stop at the device",
    Safeguard.NOT_READY: "the device is not calibrated, not in a hand, or outside of its workspace",
}
"""What trips a safety chain, in words."""

Event = tuple[str, dict[str, str]]


class Alarm:
    """Remembers whether everything is stopped, and what has tripped."""

    def __init__(self) -> None:
        self.halted = ""
        self._told: dict[tuple[Side, Safeguard], int] = {}

    def halt(self, reason: str) -> list[Event]:
        """Let no device have a force; what is to be recorded."""
        if self.halted:
            return []
        self.halted = reason
        return [(STOP, {"reason": reason})]

    def release(self) -> list[Event]:
        """End an emergency stop; what is to be recorded."""
        if not self.halted:
            return []
        self.halted = ""
        return [(RELEASE, {})]

    def look(self, found: int, safeguards: dict[Side, int], now_ns: int) -> list[Event]:
        """Look at what the samples of a tick say; what is to be recorded."""
        events: list[Event] = []
        for place, side in enumerate(SIDES):
            if found & (samples.TRIPPED << place):
                events += self._tell(side, safeguards[side], now_ns)
            if found & (samples.STOPPED << place):
                events += self.halt(f"emergency stop at the {side} device")
        return events

    def why(self, side: Side, now_ns: int) -> str:
        """What has tripped the safety of a device a moment ago, in brackets; empty if nothing has."""
        causes = [WORDS[cause] for (whose, cause), at in self._told.items() if whose == side and now_ns - at < AGAIN_NS]
        return f" ({', '.join(causes)})" if causes else ""

    def _tell(self, side: Side, bits: int, now_ns: int) -> list[Event]:
        """What has not been told a moment ago."""
        new = [
            cause
            for cause in WORDS
            if bits & cause.value and now_ns - self._told.get((side, cause), -AGAIN_NS) >= AGAIN_NS
        ]
        self._told.update(((side, cause), now_ns) for cause in new)
        return [("safeguard", {"side": side, "cause": WORDS[cause]}) for cause in new]
