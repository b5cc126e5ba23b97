"""Triggers of a session: each event with a code goes to the trigger box at once, and what became of it is recorded.

For each such event the recording has another one, `TRIGGER` with the times of the pulse, or `TRIGGER_LOST` with the
reason. The session never waits for a box: a block that requires one does not start without it, and a trial goes on
when it is lost.
"""

from typing import NamedTuple

from netboard.base.plural import plural
from netboard.base.tables.triggers import EventCode, Triggers, code_of, codes_of
from netboard.network.protocol.triggers import (
    PULSE_NS,
    TRIGGER,
    TRIGGER_BOX,
    TRIGGER_INPUT,
    TRIGGER_LOST,
    BoxState,
    InputPulse,
    PulseReport,
    Trigger,
)
from netboard.nodes.ports.peer_events import News
from netboard.nodes.ports.trigger_peers import TimedReport, TriggerPeers

REPORT_NS = 1_000_000_000
"""Time after the end of a pulse, and of those before it, within which a box reports it; else it counts as lost [ns]."""

THE_BOX = "the trigger box"


class _Pending(NamedTuple):
    """A trigger without a report yet."""

    trigger: Trigger
    due_ns: int  # when it counts as lost
    boxes: int  # that have still to report it


class SessionTriggers:
    """The triggers of a session, and the boxes that make pulses of them."""

    def __init__(self, peers: TriggerPeers) -> None:
        self.lost = 0
        self._peers = peers
        self._settings = Triggers()
        self._codes: tuple[EventCode, ...] = ()
        self._number = 0
        self._pending: dict[int, _Pending] = {}
        self._states: dict[bytes, BoxState] = {}
        self._news: News = []

    def begin_block(self, triggers: Triggers) -> None:
        """Take the codes of a block."""
        self._settings = triggers
        self._codes = codes_of(triggers) if triggers.declared else ()

    def event(self, name: str, details: dict[str, str], tick: int, tick_ns: int, now_ns: int) -> None:
        """Send the trigger of an event at a tick, if it has a code."""
        if not self._codes or not (code := code_of(self._codes, name, details)):
            return
        trigger = Trigger(self._number, tick, tick_ns, name, code)
        self._number += 1
        if boxes := self._peers.send(trigger, self._ready or self._peers.present):
            self._pending[trigger.number] = _Pending(trigger, self._due_ns(now_ns), boxes)
        else:
            self._lose(trigger, self.trouble or f"{THE_BOX} takes no messages")

    @property
    def missing(self) -> tuple[str, ...]:
        """What a block that has not begun waits for."""
        return (THE_BOX,) if self._settings.declared and self._settings.required and self.trouble else ()

    @property
    def trouble(self) -> str:
        """Why no pulse can be made now; empty if one can, or none is declared."""
        if not self._settings.declared:
            return ""
        if self._ready:
            return ""
        states = [self._states[name] for name in self._peers.present if name in self._states]
        said = next((state.reason for state in states if state.reason), "netboard trigger is not connected")
        return f"{THE_BOX} is not ready: {said}"

    @property
    def notice(self) -> str:
        """What an operator should know; empty if nothing."""
        lost = f"{plural(self.lost, 'event')} had no pulse" if self.lost else ""
        return "; ".join(filter(None, (self.trouble, lost)))

    @property
    def simulated(self) -> bool:
        """Whether what makes the pulses stands in for hardware."""
        return any(state.simulated for name, state in self._states.items() if name in self._peers.present)

    def awaited(self, now_ns: int) -> bool:
        """Return whether a report is still to come."""
        return any(now_ns < pending.due_ns for pending in self._pending.values())

    def take_news(self, now_ns: int) -> News:
        """Return the events to record: pulses that were made or not, input pulses, and changes of the box."""
        for timed in self._peers.reports():
            match timed.report:
                case PulseReport() as report:
                    self._take_pulse(report, timed)
                case InputPulse(code=code, time_ns=time_ns):
                    self._news.append((TRIGGER_INPUT, {"code": str(code)} | _times(timed, time_ns)))
                case BoxState() as state:
                    self._take_state(timed.who, state)
        for number, pending in list(self._pending.items()):
            if now_ns >= pending.due_ns:
                del self._pending[number]
                self._lose(pending.trigger, f"{THE_BOX} has not reported")
        news, self._news = self._news, []
        return news

    @property
    def _ready(self) -> list[bytes]:
        """The boxes that can make a pulse: another one would report at once that it made none."""
        return [name for name in self._peers.present if name in self._states and self._states[name].ready]

    def _due_ns(self, now_ns: int) -> int:
        """Return when a trigger that is sent now counts as lost: the box makes the pending pulses before it."""
        pulse_ns = int((self._settings.width + self._settings.gap) * 1e9)
        return now_ns + REPORT_NS + (len(self._pending) + 1) * pulse_ns

    def _take_pulse(self, report: PulseReport, timed: TimedReport) -> None:
        """Take what became of a trigger: of several boxes the first pulse counts, or the fault of the last one."""
        if (pending := self._pending.pop(report.number, None)) is None:
            return
        trigger = pending.trigger
        if report.fault and pending.boxes > 1:
            self._pending[report.number] = pending._replace(boxes=pending.boxes - 1)
            return
        if report.fault:
            self._lose(trigger, report.fault)
            return
        times = _times(timed, report.began_ns)
        latency_ns = int(times[PULSE_NS]) - trigger.tick_ns
        details = _of(trigger) | times | {"latency_us": _us(latency_ns), "waited_us": _us(report.waited_ns)}
        details["received_us"] = _us(latency_ns - (report.began_ns - report.received_ns))
        if report.ended_ns:
            details["width_us"] = _us(report.ended_ns - report.began_ns)
        if self._settings.loopback:
            details["loopback_us"] = _us(report.edge_ns - report.began_ns) if report.edge_ns else "lost"
        self._news.append((TRIGGER, details))

    def _take_state(self, who: bytes, state: BoxState) -> None:
        before, self._states[who] = self._states.get(who), state
        if state != before:
            details = {"box": state.box, "ready": str(state.ready).lower(), "reason": state.reason}
            self._news.append((TRIGGER_BOX, {key: value for key, value in details.items() if value}))

    def _lose(self, trigger: Trigger, reason: str) -> None:
        self.lost += 1
        self._news.append((TRIGGER_LOST, _of(trigger) | {"reason": reason}))


def _of(trigger: Trigger) -> dict[str, str]:
    """Return the details that name a trigger's event."""
    return {"event": trigger.event, "event_tick": str(trigger.tick), "code": str(trigger.code)}


def _times(timed: TimedReport, time_ns: int) -> dict[str, str]:
    """Return a time of a box, converted to the server's, with its bound; within it both clocks are taken as one."""
    offset_ns = 0 if abs(timed.offset_ns) <= timed.bound_ns else timed.offset_ns
    return {PULSE_NS: str(time_ns - offset_ns), "bound_us": _us(timed.bound_ns)}


def _us(span_ns: int) -> str:
    """Return a duration in microseconds."""
    return f"{span_ns / 1000:.1f}"
