"""What a session records beside its ticks: events in their order, clock probes, what displays have painted.

Before its form is complete a session is not open, and nothing of it is recorded. Events of that time are held, and
recorded when it opens. Whoever runs the server reads of every event at once.
"""

import logging
from collections.abc import Iterable
from typing import Any

from netboard.base.clock import now_ns
from netboard.network.protocol.codec import encode
from netboard.network.protocol.messages import Message
from netboard.network.protocol.records import ClockRecord, EventRecord, FrameRecord
from netboard.nodes.ports.log_port import LogPort
from netboard.nodes.server.attempts import Ledger
from netboard.stage.curtain import PHASE_NAMES
from netboard.task.trials.state_machine import Cause

log = logging.getLogger(__name__)

SUMMED = "stood_still"
"""Several of these in a row are summed in the log, for a machine that stalls does so again and again."""


class Chronicle:
    """Numbers what is recorded, and brings it to the loggers."""

    def __init__(self, port: LogPort) -> None:
        self.opened = False
        self.probes = 0
        self._port = port
        self._events = 0
        self._held: list[tuple[str, dict[str, str]]] = []
        self._stalls = 0
        self._stalled_ms = 0

    def note(self, tick: int, name: str, details: dict[str, str]) -> None:
        """Record an event, or hold it until the session is open, and tell whoever runs the server."""
        if self.opened:
            self._record_event(tick, name, details)
        else:
            self._held.append((name, details))
        if name == SUMMED:
            self._count_stall(int(details["milliseconds"]))
            return
        self._say_stalls()
        said = " ".join(f"{key}={value}" for key, value in details.items() if key != "config")
        log.info("%s %s", name, "".join(letter if letter.isprintable() else "?" for letter in said))

    def _count_stall(self, milliseconds: int) -> None:
        """Add a stall to those in a row; the log has the first, and their sum at the second, fourth, eighth, ..."""
        self._stalls += 1
        self._stalled_ms += milliseconds
        if self._stalls & (self._stalls - 1) == 0:
            log.info("%s milliseconds=%d times=%d", SUMMED, self._stalled_ms, self._stalls)

    def _say_stalls(self) -> None:
        """Say what the stalls in a row come to, if the last line about them does not, and begin to count anew."""
        if self._stalls & (self._stalls - 1):
            log.info("%s milliseconds=%d times=%d", SUMMED, self._stalled_ms, self._stalls)
        self._stalls = self._stalled_ms = 0

    def catch_up(self, tick: int) -> None:
        """Record what was held while the session was not open, as of a tick [1]."""
        held, self._held = self._held, []
        for name, details in held:
            self._record_event(tick, name, details)

    def record(self, message: Message) -> None:
        """Record anything else, if the session is open."""
        if self.opened:
            self._port.append(encode(message))

    def keep_frames(self, frames: Iterable[FrameRecord], ledger: Ledger) -> None:
        """Record what displays have painted, and let the ledger know."""
        for frame in frames:
            self.record(frame)
            ledger.painted(frame)

    def record_probes(self, probes: Iterable[ClockRecord]) -> None:
        """Record clock probes, which are numbered from `probes` on."""
        for probe in probes:
            self.record(probe)
            self.probes += 1

    def _record_event(self, tick: int, name: str, details: dict[str, str]) -> None:
        self.record(EventRecord(self._events, tick, now_ns(), name, details))
        self._events += 1


def change_of(cause: Cause, row: Any, state: Any) -> dict[str, str]:
    """Write what the trial machine has decided at a tick, as details of an event."""
    details = {
        "from": PHASE_NAMES[int(row["phase"])],
        "to": PHASE_NAMES[int(state["phase"])],
        "trial": str(row["trial"]),
        "attempt": str(row["attempt"]),
        "target": "left" if row["target"] < 0 else "right",
    }
    if cause == Cause.HELD:
        details["completion"] = repr(float(state["completion"]))
    return details
