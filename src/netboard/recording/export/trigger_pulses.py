"""Pulses of the trigger box in a recording: those made for events, and those that arrived at its input."""

from collections.abc import Iterator
from typing import NamedTuple

from netboard.network.protocol.records import EventRecord
from netboard.network.protocol.triggers import PULSE_NS, TRIGGER, TRIGGER_INPUT
from netboard.recording.files.reader import Recording

KINDS = {
    TRIGGER: "a TTL pulse for an event of the session, from when the write of its code had returned",
    TRIGGER_INPUT: "a pulse at the input of the trigger box, when it was read",
}
"""The events of a pulse, and the meaning of each."""


class RecordedPulse(NamedTuple):
    """One pulse."""

    time_ns: int  # when it began, server time
    kind: str  # one of `KINDS`
    event: str  # of an event of the session its name, else empty
    code: int
    width: float  # NaN if it is not known [s]
    latency: float  # from the nominal time of the event's tick, NaN of an input pulse [s]


def onset_ns(event: EventRecord) -> int:
    """Return when what an event describes began: of a pulse its beginning, else the event's own time [ns]."""
    written = event.details.get(PULSE_NS, "") if event.name in KINDS else ""
    return int(written) if written.removeprefix("-").isdecimal() else event.time_ns


def pulses_of(recording: Recording) -> Iterator[RecordedPulse]:
    """Yield the pulses of a recording."""
    for event in recording.events():
        if event.name in KINDS:
            width, latency = (_seconds(event, key) for key in ("width_us", "latency_us"))
            code = event.details.get("code", "")
            name = event.details.get("event", "")
            yield RecordedPulse(onset_ns(event), event.name, name, int(code or 0), width, latency)


def _seconds(event: EventRecord, key: str) -> float:
    """Return a detail in microseconds as a duration; NaN if there is none [s]."""
    return round(float(event.details.get(key, "nan")) * 1e3) / 1e9 if key in event.details else float("nan")
