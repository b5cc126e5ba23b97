"""Messages of operators: commands, the session's status, the outcomes of attempts.

A message is data only; `netboard.network.protocol.messages` holds the rules for all of them.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple

from netboard.task.journal.outcome import AttemptOutcome

REPLAY_OF = "replay of "
"""Beginning of the notice of a replay, and of no other."""

FORM_AWAITED = "questionnaire: waiting for "
"""Part of the notice while a session waits for answers at the displays, and of no other."""

SESSION_COMMANDS = {
    "start": "start the block",
    "pause": "interrupt the trial at once; it starts again",
    "resume": "continue after a pause",
    "abort": "stop this attempt and repeat it",
    "stop": "end the block now",
    "emergency_stop": "set all forces to zero",
    "emergency_release": "allow forces again",
    "take": "become the commander",
    "open": "open the session with a form as JSON",
    "confirm": "in a real session, confirm a stand-in for a device or a screen in words",
    "arm": "allow the devices to render forces",
    "disarm": "set all forces to zero until the devices are armed again",
    "pause_after_trial": "pause when this attempt is over",
    "repeat": "add the last trial, or the one named, at the end of the block",
    "repeat_lost": "add all trials of the block that the analysis will exclude, at the end of the block",
    "veto": "cancel a repeat",
    "skip": "count this trial as done without a success",
    "skip_form": "go on without the answers that are still missing",
    "stop_after_block": "end the session after this block",
    "next": "skip the rest of the block",
    "end": "end the session and the server; it can be resumed",
    "note": "add a note to the recording",
}
"""Commands of a live session, and what each does, for the help of ``netboard control``."""

_REPLAY_ONLY = {
    "play": "continue; at the end, from the start",
    "seek": "go to a time (12.5), trial 5 or tick 900",
    "speed": "set the speed relative to real time (0.5)",
    "loop": "repeat a part (on, off, trial 5, or start and end)",
    "step": "go by ticks (10, or back 10)",
    "previous": "go back to a trial or another mark",
}

REPLAY_COMMANDS: tuple[str, ...] = tuple(_REPLAY_ONLY)
"""Commands that only a replay carries out."""

SHARED_COMMANDS = ("pause", "resume", "next", "end")
"""Commands of a live session that also apply to a replay."""

COMMANDS: tuple[str, ...] = (*SESSION_COMMANDS, *REPLAY_COMMANDS)
"""Every command: what the protocol allows and what ``netboard control`` takes."""

COMMAND_HELP = (
    f"{' '.join(f'{name}: {does}.' for name, does in SESSION_COMMANDS.items())} "
    f"A replay takes {', '.join(SHARED_COMMANDS)}, and: "
    f"{' '.join(f'{name}: {does}.' for name, does in _REPLAY_ONLY.items())}"
)
"""What all commands do, in one paragraph."""

if TYPE_CHECKING:
    CommandName = str
else:
    CommandName = Literal[COMMANDS]
"""Type of a command's name."""


class LinkStatus(NamedTuple):
    """Connection of one peer: an item of `Status.links`."""

    peer: str
    name: str
    version: str
    age: float
    round_trip: float
    clock_bound: float
    drift_ppm: float
    rate: float
    lost: int


class LoopStatus(NamedTuple):
    """Latency of one agent: an item of `Status.loops`."""

    peer: str
    late: float
    limit: float


class RecordingStatus(NamedTuple):
    """File of one logger: an item of `Status.recordings`."""

    file: str
    age: float
    written_bytes: int
    free_bytes: int


class StationStatus(NamedTuple):
    """Device of one side: an item of `Status.stations`."""

    side: str
    age: float
    safeguards: int
    rendered: float
    lost_ticks: int
    clipped_ticks: int


class DeviceStatus(NamedTuple):
    """What one hand holds: an item of `Status.devices`."""

    side: str
    kind: str
    model: str
    serial: str
    text: str


class DisplayStatus(NamedTuple):
    """How a station's display is drawn: an item of `Status.displays`."""

    side: str
    platform: str


class StandInStatus(NamedTuple):
    """What stands in for a haptic device or a screen: an item of `Status.stand_ins`."""

    words: str
    confirmed: bool


class RefusalCount(NamedTuple):
    """Refusals for one reason: an item of `Status.refused`."""

    channel: str
    reason: str
    times: int


class TracePoint(NamedTuple):
    """One tick: an item of `Trace.points`."""

    tick: int
    left: float
    right: float
    board: float
    tilt: float
    ball: float
    left_force: float
    right_force: float


@dataclass(frozen=True, slots=True)
class Command:
    """A command of an operator. The first to send one is the commander; others may watch, or trigger an emergency stop.

    Attributes
    ----------
    name : str
        One of ``netboard.network.protocol.control.COMMANDS``.
    argument : str
        Argument of the command: a note's text, a form, a reason; empty for commands without one.
    number : int
        Number that identifies the answer [1].
    """

    name: str
    argument: str
    number: int


@dataclass(frozen=True, slots=True)
class Reply:
    """The server's answer to a `Command`.

    Attributes
    ----------
    number : int
        `Command.number` of the command that it answers [1].
    accepted : bool
        Whether it is, or will be, carried out.
    reason : str
        Why not; or what will be done, and when. One sentence for people.
    """

    number: int
    accepted: bool
    reason: str


@dataclass(frozen=True, slots=True)
class StatusRequest:
    """Ask the server for its status."""


@dataclass(frozen=True, slots=True)
class Status:
    """Status of the server.

    Attributes
    ----------
    session : str
        Id of this run of the server.
    tick : int
        Ticks so far [1].
    phase : str
        Phase of the trial, lower case.
    trial, trials : int
        Current trial, and number of trials that the block requires [1].
    successes, failures : int
        Trials done and attempts failed in the block [1].
    completions : tuple of float
        Completion times of the successful trials so far; of the newest, if there are more than 10,000 [s].
    late_ticks : int
        Deadline misses: ticks that started more than half a tick late [1].
    waiting_for : tuple of str
        Peers still missing.
    peers : tuple of str
        Connected peers, each by role and side, as in ``agent.left``.
    notice : str
        What the operator should know, or empty.
    links : tuple of LinkStatus
        For each connected peer: its role (``agent.left``), host and process, version (64 characters of each); time
        since its last message [s], shortest recent round-trip time [s], bound of its clock's error [s], its drift
        [1e-6] (NaN: unknown), messages a second [Hz], messages lost [1].
    loops : tuple of LoopStatus
        For each connected agent: its role, its recent sample-to-force latency, from reading the stylus to rendering the
        force computed from it (NaN: unknown), and the largest latency with which its device is stable without a hand
        [s, s]. None in a blinded block.
    name, dyad, study : str
        Labels of the session: its name, dyad and study.
    pilot, consent : bool
        Whether it is a pilot run; whether both participants have consented.
    opened : bool
        Whether the session's form is complete, so that a block may begin and everything is recorded.
    armed : bool
        Whether the operator permits forces of the devices.
    commander : str
        Console whose commands are accepted; empty: the next one that commands.
    block, blocks : int
        Number of the block in its plan, from 1, and number of blocks [1].
    label : str
        Label of the block; empty in a blinded block.
    condition : str
        Its configuration and force condition, in words.
    rest : float
        Remaining rest before the block [s].
    pending : str
        What will be done after this trial or block, or empty.
    outcomes : int
        Number of attempts in this session that have an outcome, which `OutcomesRequest` can request [1].
    recordings : tuple of RecordingStatus
        For each connected logger: its file, longest time in the last 5 s until a record was on its disk (NaN: no file
        yet) [s]; bytes written and bytes free [1].
    stations : tuple of StationStatus
        For each side: its name, age of the newest sample (NaN: none) [s], `Safeguard` bits of the last tenth of a
        second, vertical force rendered (NaN: not known) [N], and how many ticks of this attempt had no fresh sample,
        and a force at its limit [1].
    refused : tuple of RefusalCount
        Most frequent refusals since the server started: channel (``handshake``: before a peer was admitted), reason,
        and number [1].
    lost : tuple of int
        Trials of the block that the analysis will exclude, and that no other trial repeats [1].
    repeats : tuple of int
        Trials whose repeats at the end of the block have not begun [1].
    devices : tuple of DeviceStatus
        For each hand that a device or the server moves: its side; kind of the device (``haptic``, ``input``,
        ``pointer``, ``simulated``, ``playback``, ``robot``, ``undeclared``), ``still`` where the server moves it, or
        ``hidden`` in a blinded block; model and serial number (64 characters of each); and all of it in words.
    displays : tuple of DisplayStatus
        For each station with a display: its side, and Qt's name of the platform that draws it (``offscreen``: nobody
        sees it).
    stand_ins : tuple of StandInStatus
        For each stand-in for a haptic device or a screen: the words that confirm it, and whether an operator has
        confirmed them. A real session waits for the confirmation.
    ahead : tuple of str
        Next blocks of the plan in order, each by its label or its condition; at most 3.
    """

    session: str
    tick: int
    phase: str
    trial: int
    trials: int
    successes: int
    failures: int
    completions: tuple[float, ...]
    late_ticks: int
    waiting_for: tuple[str, ...]
    peers: tuple[str, ...]
    notice: str
    links: tuple[LinkStatus, ...]
    loops: tuple[LoopStatus, ...]
    name: str
    dyad: str
    study: str
    pilot: bool
    consent: bool
    opened: bool
    armed: bool
    commander: str
    block: int
    blocks: int
    label: str
    condition: str
    rest: float
    pending: str
    outcomes: int
    recordings: tuple[RecordingStatus, ...]
    stations: tuple[StationStatus, ...]
    refused: tuple[RefusalCount, ...]
    lost: tuple[int, ...]
    repeats: tuple[int, ...]
    devices: tuple[DeviceStatus, ...]
    displays: tuple[DisplayStatus, ...]
    stand_ins: tuple[StandInStatus, ...]
    ahead: tuple[str, ...]

    @property
    def real(self) -> bool:
        """Whether the data of the session count: with consent, no pilot, and no replay."""
        return self.consent and not self.pilot and not self.notice.startswith(REPLAY_OF)


@dataclass(frozen=True, slots=True)
class OutcomesRequest:
    """Ask for the outcomes of this session's attempts.

    Attributes
    ----------
    first : int
        Number of the first one wanted, from 0 [1].
    """

    first: int


@dataclass(frozen=True, slots=True)
class Outcomes:
    """Outcomes of some attempts, in order.

    Attributes
    ----------
    first : int
        Number of the first one [1].
    attempts : tuple of AttemptOutcome
        For each: block, trial, attempt [1]; ``success``, ``fell``, ``timed_out``, ``aborted``, ``paused``,
        ``emergency_stop``, ``skipped``, or ``incomplete`` where the server ended in it; its completion time (NaN: none)
        [s]; its quality flags, separated by commas, or empty; and the trial that it repeats, 0 for none [1].
    """

    first: int
    attempts: tuple[AttemptOutcome, ...]


@dataclass(frozen=True, slots=True)
class TraceRequest:
    """Ask for the most recent ticks, to plot them.

    Attributes
    ----------
    after : int
        Ticks after this one are requested; the server keeps about one second [1].
    """

    after: int


@dataclass(frozen=True, slots=True)
class Trace:
    """Every fifth of the most recent ticks.

    Attributes
    ----------
    points : tuple of TracePoint
        For each: tick [1]; height of the left and the right stylus and of the board's centre [m]; tilt [rad]; ball
        position, NaN without one [m]; vertical force on the left and the right hand, as rendered, NaN where unknown
        [N].
    """

    points: tuple[TracePoint, ...]
