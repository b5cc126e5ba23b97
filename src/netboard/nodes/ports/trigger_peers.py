"""The trigger boxes among the peers of the control channel: triggers go out at once, reports are kept until taken.

A trigger is one frame without a wait: a box whose queue is full, or that is gone, misses it, and the server records so.
Reports carry times of the peer's own clock, which are converted here.
"""

from collections import deque
from collections.abc import Iterable
from typing import NamedTuple, TypeAlias

from netboard.base.errors import WireError
from netboard.network.protocol.codec import encode
from netboard.network.protocol.triggers import BoxState, InputPulse, PulseReport, Trigger
from netboard.network.transport import endpoints
from netboard.nodes.ports.peer import ProbedPeer
from netboard.nodes.ports.refusals import TOO_MANY_MESSAGES

TRIGGER_ROLE = "trigger"

Report: TypeAlias = PulseReport | InputPulse | BoxState

MAX_REPORTS = 256
"""Reports that may wait to be taken [1]."""


class TimedReport(NamedTuple):
    """A report with what is known of its sender's clock."""

    who: bytes
    report: Report
    offset_ns: int  # the peer's clock minus the server's
    bound_ns: int


class TriggerPeers:
    """The trigger boxes that are connected."""

    def __init__(self, router: endpoints.Router) -> None:
        self.present: list[bytes] = []
        self._router = router
        self._reports: deque[TimedReport] = deque()

    def send(self, trigger: Trigger, to: Iterable[bytes]) -> int:
        """Send a trigger to some of the boxes; return how many take it [1]."""
        frame = encode(trigger)
        return sum(self._router.send(name, frame) for name in to)

    def take(self, name: bytes, peer: ProbedPeer, report: Report) -> None:
        """Keep a report."""
        if len(self._reports) >= MAX_REPORTS:
            raise WireError(f"{TOO_MANY_MESSAGES}: {MAX_REPORTS} reports wait already")
        self._reports.append(TimedReport(name, report, peer.clock.offset_ns, peer.clock.bound_ns))

    def reports(self) -> list[TimedReport]:
        """Return the reports since the last call."""
        found = list(self._reports)
        self._reports.clear()
        return found
