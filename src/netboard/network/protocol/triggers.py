"""Messages between the server and a trigger box's process: events that give a pulse, and what became of them.

A message is data only; `netboard.network.protocol.messages` holds the rules for all of them.
"""

from dataclasses import dataclass

TRIGGER, TRIGGER_LOST = "trigger", "trigger_lost"
"""Events: a pulse was made for an event of the session, or none was, with the reason."""

TRIGGER_INPUT, TRIGGER_BOX = "trigger_input", "trigger_box"
"""Events: a pulse arrived at the input of the trigger box; the box was lost, or is back."""

PULSE_NS = "pulse_ns"
"""Detail of these events: when the pulse began, server time [ns]."""


@dataclass(frozen=True, slots=True)
class Trigger:
    """An event that gives a pulse, sent as soon as it is decided.

    Attributes
    ----------
    number : int
        Number of the trigger in this run of the server, from 0 [1].
    tick : int
        Tick of the event [1].
    tick_ns : int
        Nominal time of this tick, server time [ns].
    event : str
        Name of the event, one of `netboard.base.tables.triggers.EVENTS`.
    code : int
        Code of the pulse, 1 to 255 [1].
    """

    number: int
    tick: int
    tick_ns: int
    event: str
    code: int


@dataclass(frozen=True, slots=True)
class PulseReport:
    """What became of a trigger; times of 0 mean never.

    Attributes
    ----------
    number : int
        `Trigger.number` of the trigger that it reports on [1].
    received_ns : int
        When the trigger was received, the peer's clock [ns].
    began_ns : int
        When the write of the code had returned, the peer's clock [ns].
    ended_ns : int
        When the write of code 0 had returned, or when the box ends the pulse by itself, the peer's clock [ns].
    edge_ns : int
        When the pulse arrived at the input, with a loop-back, the peer's clock [ns].
    waited_ns : int
        How long it waited for earlier pulses [ns].
    fault : str
        Why there was no pulse, or not all of it; empty if there was.
    """

    number: int
    received_ns: int
    began_ns: int
    ended_ns: int
    edge_ns: int
    waited_ns: int
    fault: str


@dataclass(frozen=True, slots=True)
class InputPulse:
    """A pulse arrived at the input of the box.

    Attributes
    ----------
    code : int
        What the box says of it, 0 to 255 [1].
    time_ns : int
        When it was read, the peer's clock [ns].
    """

    code: int
    time_ns: int


@dataclass(frozen=True, slots=True)
class BoxState:
    """Whether the box is there: sent after each welcome, and when it changes.

    Attributes
    ----------
    ready : bool
        Whether pulses can be made.
    box : str
        What the box is and where, for people.
    simulated : bool
        Whether it stands in for hardware.
    reason : str
        Why it is not ready, one sentence for people; empty if it is.
    """

    ready: bool
    box: str
    simulated: bool
    reason: str
