"""Configuration table of the TTL triggers: which events give a pulse with which code, and by which trigger box.

An entry of `codes` is written as an event, or as an event with one of its details, such as ``level haptics=on``. Pure:
what a machine has of trigger boxes is checked by `netboard.devices.triggers.registry`.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, NamedTuple

from pydantic import StrictBool, StrictInt

from netboard.base.nearest import one_of
from netboard.base.settings import FORBID_UNKNOWN_KEYS, about

NO_BOX = "none"
"""Kind of a rig without a trigger box."""

MAX_CODE = 255
"""Largest code: eight lines [1]."""

TRIAL_EVENTS = {
    "level": 1,
    "entered": 2,
    "left": 3,
    "held": 4,
    "fell": 5,
    "timed_out": 6,
    "next": 7,
    "last": 8,
    "start": 9,
    "pause": 10,
    "resume": 11,
    "abort": 12,
    "stop": 13,
    "fault": 14,
    "repeat": 15,
    "veto": 16,
    "skip": 17,
}
"""Events of the trial state machine, with their codes unless others are declared; `netboard.task.trials.state_machine`
compares them with its causes."""

OTHER_EVENTS = (
    "attempt_ended",
    "block_began",
    "command",
    "emergency_release",
    "emergency_stop",
    "perturbation",
)
"""Events of a session that can have a code, too; by default they have none."""

EVENTS = (*TRIAL_EVENTS, *OTHER_EVENTS)
"""All events that can have a code."""


@dataclass(frozen=True, slots=True)
class Triggers:
    """TTL triggers for EEG, EMG, eye trackers and video: events of a session that give a pulse with a code."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    kind: Annotated[
        str, about("kind of the trigger box: none, serial, parallel, labjack, simulated, or a plug-in's", min_length=1)
    ] = NO_BOX
    address: Annotated[
        str,
        about(
            "where the box is: /dev/ttyACM0, /dev/parport0, a LabJack's serial number; empty: where its kind usually is"
        ),
    ] = ""
    baud: Annotated[int, about("speed of a serial box in bits per second", "1", ge=300, le=12_000_000)] = 115_200
    width: Annotated[float, about("duration of a pulse", "s", ge=0.0005, le=1)] = 0.005
    gap: Annotated[float, about("shortest time between two pulses", "s", ge=0, le=1)] = 0.005
    reset: Annotated[
        StrictBool, about("true: netboard ends a pulse by code 0 after the width; false: the box ends it by itself")
    ] = True
    loopback: Annotated[
        StrictBool, about("true: an output line is wired to the input, and each pulse is looked for there")
    ] = False
    required: Annotated[StrictBool, about("true: a block starts only while the trigger box is there")] = True
    codes: Annotated[
        dict[str, StrictInt],
        about("codes 1 to 255 of events, in place of the defaults; 0: no pulse; an event, or as in level haptics=on"),
    ] = field(default_factory=dict)

    @property
    def declared(self) -> bool:
        """Whether the rig has a trigger box."""
        return self.kind != NO_BOX


class EventCode(NamedTuple):
    """The code of an event, or of those events of this name whose detail has a value.

    Attributes
    ----------
    event : str
        One of `EVENTS`.
    detail : str
        Name of a detail, with or without its ``factor_``; empty for every event of this name.
    value : str
        Value that the detail must have, a level without its description; empty without a detail.
    code : int
        Code of the pulse, 0 for none [1].
    """

    event: str
    detail: str
    value: str
    code: int

    def applies(self, event: str, details: Mapping[str, str]) -> bool:
        """Return whether an event has this code; of a level such as ``heavy (2 kg)`` the name is enough."""
        if event != self.event or not self.detail:
            return event == self.event
        found = details.get(self.detail, details.get(f"factor_{self.detail}", ""))
        return found == self.value or found.startswith(f"{self.value} (")


def codes_of(triggers: Triggers) -> tuple[EventCode, ...]:
    """Return the codes of all events in the order in which they are looked up: those with a detail first."""
    declared = [_entry(key, code) for key, code in triggers.codes.items()]
    plain = TRIAL_EVENTS | {entry.event: entry.code for entry in declared if not entry.detail}
    detailed = (entry for entry in declared if entry.detail)
    return (*detailed, *(EventCode(event, "", "", code) for event, code in plain.items()))


def code_of(codes: Sequence[EventCode], event: str, details: Mapping[str, str]) -> int:
    """Return the code of an event, 0 if it gives no pulse [1].

    Parameters
    ----------
    codes : sequence of EventCode
        As `codes_of` returns them.
    """
    return next((entry.code for entry in codes if entry.applies(event, details)), 0)


def _entry(key: str, code: int) -> EventCode:
    """Take one declared code apart."""
    event, _, condition = key.partition(" ")
    detail, _, value = condition.partition("=")
    return EventCode(event, detail.strip(), value.strip(), code)


def contradictions_of_triggers(triggers: Triggers) -> Iterator[str]:
    """Yield a sentence for each code that no event can have."""
    for key, code in triggers.codes.items():
        where, entry = f'[triggers.codes] "{key}"', _entry(key, code)
        if entry.event not in EVENTS:
            yield f"{where}: no event has this name; expected {one_of(entry.event, EVENTS)}"
        elif key != entry.event and not (entry.detail and entry.value):
            yield f'{where}: expected an event, or an event with one of its details, such as "level haptics=on"'
        if not 0 <= code <= MAX_CODE:
            yield f"{where}: found {code}, expected a code from 1 to {MAX_CODE}, or 0 for no pulse"
