"""What a session records beside its ticks: numbered events, clock probes and painted frames.

A session is not open, and nothing of it is recorded, until its form is complete. Events before that are held and
recorded when it opens. The log of the server process shows every event at once.
"""

import logging
from collections.abc import Iterable

import numpy as np

from netboard.base.clock import now_ns
from netboard.base.plural import plural
from netboard.base.tables.questionnaires import public_details
from netboard.network.protocol.codec import encode
from netboard.network.protocol.messages import Message
from netboard.network.protocol.records import AGENT_JOINED, ClockRecord, EventRecord, FrameRecord
from netboard.network.protocol.triggers import TRIGGER
from netboard.nodes.ports.log_port import LogPort
from netboard.nodes.server.attempts import Attempts
from netboard.stage.blinding import ABOUT_FORMS, shown_details
from netboard.stage.curtain import PHASE_NAMES
from netboard.task.trials.state_machine import Cause

log = logging.getLogger(__name__)

SUMMED = "stood_still"
"""Event whose consecutive repeats are summed in the process log, because a machine that stalls tends to stall again."""

UNPRINTED = ("config", "policy_parameters")
"""Details of hundreds of words, which only a recording contains."""


class EventLog:
    """Numbers the events of a session and appends them to the log."""

    def __init__(self, port: LogPort) -> None:
        self.opened = False
        self.blinded = False  # whether log lines must not say which partner is at a seat, in the present block
        self.any_blinded = False  # and whether that is so in a block of the session
        self.probes = 0
        self._port = port
        self._events = 0
        self._held: list[tuple[str, dict[str, str]]] = []
        self._stalls = 0
        self._stalled_ms = 0
        self._agents: dict[str, str] = {}  # name of the agent that joined last at each side

    def note(self, tick: int, name: str, details: dict[str, str]) -> None:
        """Log an event, and record it or hold it until the session is open."""
        if self.opened:
            self._record_event(tick, name, details)
        else:
            self._held.append((name, details))
        if name == TRIGGER:  # its event has a line
            return
        if name == SUMMED:
            self._count_stall(int(details["milliseconds"]))
            return
        shown = self._shown(name, details)
        if shown is None:
            return
        self._report_stalls()
        log.info("%s", line_of(name, shown))

    def _shown(self, name: str, details: dict[str, str]) -> dict[str, str] | None:
        """Return the details that the log line of an event may show; None for no line."""
        if name == AGENT_JOINED:
            side, agent = details.get("side", ""), details.get("name", "")
            again = self._agents.get(side) == agent
            self._agents[side] = agent
            if self.blinded and again:  # it is there again, with the device of another partner
                return None
        hidden = self.blinded or (self.any_blinded and name in ABOUT_FORMS)
        return shown_details(name, details) if hidden else details

    def _count_stall(self, milliseconds: int) -> None:
        """Count a stall; log the first of a series, then the sum at the second, fourth, eighth and so on."""
        self._stalls += 1
        self._stalled_ms += milliseconds
        if self._stalls & (self._stalls - 1) == 0:
            log.info("%s milliseconds=%d times=%d", SUMMED, self._stalled_ms, self._stalls)

    def _report_stalls(self) -> None:
        """Log the sum of a series of stalls, unless the last line already gave it, and reset the count."""
        if self._stalls & (self._stalls - 1):
            log.info("%s milliseconds=%d times=%d", SUMMED, self._stalled_ms, self._stalls)
        self._stalls = self._stalled_ms = 0

    def record_held(self, tick: int) -> None:
        """Record the held events, stamped with this tick."""
        held, self._held = self._held, []
        for name, details in held:
            self._record_event(tick, name, details)

    def record(self, message: Message) -> None:
        """Record any other message if the session is open."""
        if self.opened:
            self._port.append(encode(message))

    def record_frames(self, frames: Iterable[FrameRecord], attempts: Attempts) -> None:
        """Record painted frames, and pass them to the attempts."""
        for frame in frames:
            self.record(frame)
            attempts.painted(frame)

    def record_probes(self, probes: Iterable[ClockRecord]) -> None:
        """Record clock probes, which are numbered from `probes` on."""
        for probe in probes:
            self.record(probe)
            self.probes += 1

    def _record_event(self, tick: int, name: str, details: dict[str, str]) -> None:
        self.record(EventRecord(self._events, tick, now_ns(), name, details))
        self._events += 1


def line_of(name: str, details: dict[str, str]) -> str:
    """Return an event as one line of the process log."""
    details = public_details(name, details)
    if name != "refused":
        return f"{name} {printable(details)}"
    who = printable({key: value for key, value in details.items() if key not in ("channel", "reason", "times")})
    channel, times, reason = (printable_line(details.get(key, "")) for key in ("channel", "times", "reason"))
    said = ": ".join(filter(None, (who, reason)))
    return f"refused on the channel {channel}: {said} (so far {plural(int(times or 1), 'time')})"


def printable(details: dict[str, str]) -> str:
    """Return the details of an event as one line, without those that fill the screen."""
    return printable_line(" ".join(f"{key}={value}" for key, value in details.items() if key not in UNPRINTED))


def printable_line(words: str) -> str:
    """Escape text of an unknown peer, so that it cannot control the terminal."""
    return "".join(letter if letter.isprintable() else "?" for letter in words)


def change_of(row: np.void, state: np.void) -> dict[str, str]:
    """Return a decision of the trial state machine as event details."""
    details = {
        "from": PHASE_NAMES[int(row["phase"])],
        "to": PHASE_NAMES[int(state["phase"])],
        "trial": str(row["trial"]),
        "attempt": str(row["attempt"]),
        "target": "left" if row["target"] < 0 else "right",
    }
    if row["event"] == Cause.HELD:
        details["completion"] = repr(float(state["completion"]))
    return details
