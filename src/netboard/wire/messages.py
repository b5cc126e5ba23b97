"""Every message of the protocol, one frozen dataclass each.

A message is data only; `netboard.wire.codec` turns it into bytes and back. Field order is wire order, so fields are
only ever appended, and `PROTOCOL_VERSION` grows when one is. All times are nanoseconds of the sender's monotonic clock
unless a field says "server time"; all other quantities are SI. PROTOCOL.md says who sends what to whom, when.
"""

from dataclasses import dataclass
from enum import IntFlag

PROTOCOL_VERSION = 4

BLOCK_BEGAN = "block_began"
"""Name of the event with which a block begins; its detail ``config`` is the block's configuration. All records from it
on belong to that block: a logger begins another file with it."""

REPLAY_OF = "replay of "
"""With this the notice of a replay begins, and no other."""


class Safeguard(IntFlag):
    """What the agent's safety chain did since the sample before, and the state it is in.

    Attributes
    ----------
    ARMED
        Forces from the server are rendered.
    RAMPING
        Armed a moment ago: they are rendered in part.
    CLAMPED
        A force was larger than the limit.
    SLEWED
        A force changed faster than the limit.
    STALE
        The last force is too old: it fades.
    TOO_FAST
        The stylus was faster than the limit: no force.
    NOT_FINITE
        A force or a reading was not a finite number: no force.
    DEVICE_LOST
        The device does not answer.
    WORN
        The motors have given so much for so long that less is allowed for a while.
    STOPPED
        An emergency stop at the device: no force.
    NOT_READY
        The device is not calibrated, not in a hand or outside of its workspace: no force.
    """

    ARMED = 1
    RAMPING = 2
    CLAMPED = 4
    SLEWED = 8
    STALE = 16
    TOO_FAST = 32
    NOT_FINITE = 64
    DEVICE_LOST = 128
    WORN = 256
    STOPPED = 512
    NOT_READY = 1024


# --- meeting -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Hello:
    """First message of every peer on every channel that has a way back.

    Attributes
    ----------
    role : str
        ``agent``, ``display``, ``logger``, ``console`` or ``listener``.
    side : str
        ``left`` or ``right`` for agents and displays, else empty.
    protocol : int
        The sender's `PROTOCOL_VERSION` [1].
    name : str
        Host and process, for people.
    version : str
        Version of the sender's software.
    details : dict of str
        What else is worth recording: device model, serial number, limits.
    """

    role: str
    side: str
    protocol: int
    name: str
    version: str
    details: dict[str, str]


@dataclass(frozen=True, slots=True)
class Welcome:
    """The server's answer to an accepted `Hello`; it comes again, to everybody, when a block begins.

    Attributes
    ----------
    session : str
        Unique id of this run of the server.
    protocol : int
        The server's `PROTOCOL_VERSION` [1].
    server_ns : int
        Server time when this was sent [ns].
    config : str
        The resolved configuration of the block, as TOML.
    """

    session: str
    protocol: int
    server_ns: int
    config: str


@dataclass(frozen=True, slots=True)
class Refusal:
    """The server's answer to what it does not accept.

    Attributes
    ----------
    reason : str
        One sentence for people.
    """

    reason: str


@dataclass(frozen=True, slots=True)
class Goodbye:
    """Either side leaves on purpose.

    Attributes
    ----------
    reason : str
        One sentence for people.
    """

    reason: str


@dataclass(frozen=True, slots=True)
class Ping:
    """The server asks a peer for its time, a few times a second, on the log and control channels.

    Attributes
    ----------
    sent_ns : int
        Server time when it was sent: t0 of a clock probe [ns].
    """

    sent_ns: int


@dataclass(frozen=True, slots=True)
class Pong:
    """The peer's answer to a `Ping`, at once.

    Attributes
    ----------
    ping_ns : int
        The ping's ``sent_ns`` [ns].
    received_ns : int
        When it was received: t1 of a clock probe [ns].
    sent_ns : int
        When this was sent: t2 of a clock probe [ns].
    """

    ping_ns: int
    received_ns: int
    sent_ns: int


# --- motion: agents <-> server, 1 kHz ----------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Stylus:
    """One reading of a stylus, agent to server.

    Attributes
    ----------
    seq : int
        Number of the sample, from 0, without gaps at the source [1].
    stamp_ns : int
        When the device was read [ns].
    x, y, z : float
        Position in the scene's frame: out of the screen, right, up [m].
    vx, vy, vz : float
        Velocity [m/s].
    buttons : int
        Bit mask of pressed buttons [1].
    safeguards : int
        `Safeguard` bits since the sample before [1].
    rendered : float
        Vertical force handed to the device since the sample before, after all limits [N].
    force_tick : int
        Tick of the last `Force` or `Beat` received, -1 for none yet [1].
    force_sent_ns : int
        Its ``sent_ns``, server time: t0 of a clock probe [ns].
    force_received_ns : int
        When it was received: t1 of a clock probe [ns].
    sent_ns : int
        When this message was sent: t2 of a clock probe [ns].
    loop_ns : int
        Stylus read to the rendering of the first answer to it, for the newest such pair; 0 for none yet [ns].
    """

    seq: int
    stamp_ns: int
    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    buttons: int
    safeguards: int
    rendered: float
    force_tick: int
    force_sent_ns: int
    force_received_ns: int
    sent_ns: int
    loop_ns: int


@dataclass(frozen=True, slots=True)
class Force:
    """The vertical force on one hand for one tick, server to agent.

    Attributes
    ----------
    tick : int
        Tick that computed it [1].
    sent_ns : int
        Server time when it was sent [ns].
    stylus_seq : int
        Newest stylus sample it was computed from, -1 for none yet [1].
    force : float
        Force on the hand, + = up [N].
    lead_ns : int
        How long before the deadline of a tick that sample arrived: what the agent sets its phase by [ns].
    """

    tick: int
    sent_ns: int
    stylus_seq: int
    force: float
    lead_ns: int


@dataclass(frozen=True, slots=True)
class Point:
    """The board's control point of one side at one tick, in place of `Force` where agents compute their own.

    Attributes
    ----------
    tick : int
        Tick that it was found at [1].
    sent_ns : int
        Server time when this was sent [ns].
    stylus_seq : int
        Newest stylus sample received, -1 for none yet [1].
    stamp_ns : int
        The time it belongs to, on the agent's clock; 0 while the server does not know that [ns].
    z : float
        Height of the point [m].
    vz : float
        Its rate [m/s].
    k : float
        Stiffness of the coupling between stylus and point [N/m].
    c : float
        Its damping [N s/m].
    lead_ns : int
        How long before the deadline of a tick that sample arrived [ns].
    """

    tick: int
    sent_ns: int
    stylus_seq: int
    stamp_ns: int
    z: float
    vz: float
    k: float
    c: float
    lead_ns: int


@dataclass(frozen=True, slots=True)
class Beat:
    """In place of either where no force is rendered: the server is alive and the hand is to feel nothing vertical.

    Attributes
    ----------
    tick : int
        Tick that sent it [1].
    sent_ns : int
        Server time when it was sent [ns].
    stylus_seq : int
        Newest stylus sample received, -1 for none yet [1].
    lead_ns : int
        How long before the deadline of a tick that sample arrived [ns].
    arm : bool
        Whether the device may be armed: the server knows the agent's clock well enough.
    """

    tick: int
    sent_ns: int
    stylus_seq: int
    lead_ns: int
    arm: bool


# --- views: server -> displays, at most 120 Hz -------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class View:
    """What one participant may see; nothing else is ever sent to a display.

    Attributes
    ----------
    station : str
        ``left`` or ``right``.
    tick : int
        Tick it shows [1].
    sent_ns : int
        Server time when it was sent [ns].
    phase : str
        Name of the trial's phase (`netboard.experiment.machine.Phase`, lower case), or ``away`` at a station whose
        participant has nothing to do in this block.
    z : float
        Height of the board's centre [m].
    theta : float
        Tilt of the board, + = right end up [rad].
    p : float or None
        Ball position along the board, + = right; None without a ball [m].
    target : float
        Centre of the target along the board [m].
    left, right : float or None
        Height of the left and right stylus; None where the participant may not see it [m].
    trial : int
        Number of the current trial in the block, from 1 [1].
    trials : int
        Successful trials the block asks for [1].
    failures : int
        Failed attempts in the block so far [1].
    completion : float or None
        Completion time of the last successful trial [s].
    best : float or None
        Best completion time of the block so far [s].
    notice : str
        A line for the participant, a word that the display knows a line for (``again``), or empty.
    seq : int
        Number of the view at its station, from 0: what is missing was never shown [1].
    share : float
        How much of the time is over for which the board must be level, or the ball in the target; 0 to 1 [1].
    block, blocks : int
        Number of the block in its plan, from 1, and how many there are [1].
    rest : float or None
        What is left of the rest before the block; None without one [s].
    """

    station: str
    tick: int
    sent_ns: int
    phase: str
    z: float
    theta: float
    p: float | None
    target: float
    left: float | None
    right: float | None
    trial: int
    trials: int
    failures: int
    completion: float | None
    best: float | None
    notice: str
    seq: int
    share: float
    block: int
    blocks: int
    rest: float | None


@dataclass(frozen=True, slots=True)
class Frames:
    """What a display has shown since its last report, display to server on the control channel.

    Attributes
    ----------
    station : str
        ``left`` or ``right``.
    shown : tuple of (int, int, int)
        For each frame: tick of the view, when it was received and when it was painted [1, ns, ns].
    dropped : int
        Refreshes since the start in which a view that had been sent did not come, or a picture that was due was not
        painted [1].
    """

    station: str
    shown: tuple[tuple[int, int, int], ...]
    dropped: int


# --- log: server -> logger, lossless -----------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class LogRequest:
    """A logger, or a listener, asks for records.

    Attributes
    ----------
    first : int
        Number of the first record wanted; -1 for the first one that no logger has acknowledged, and to a listener for
        the next one to come [1].
    """

    first: int


@dataclass(frozen=True, slots=True)
class LogBatch:
    """Records in order, server to logger. Each is the bytes of one of the record messages below.

    Attributes
    ----------
    first : int
        Number of the first record; the rest count up from it [1].
    lost : int
        Records before `first` that were asked for and that the ring no longer held [1].
    records : tuple of bytes
        The encoded records.
    """

    first: int
    lost: int
    records: tuple[bytes, ...]


@dataclass(frozen=True, slots=True)
class LogAck:
    """All records before this one are safely on disk, logger to server.

    Attributes
    ----------
    durable : int
        Number of the first record that is not yet on disk [1].
    free_bytes : int
        Free space where the recording is written, in bytes [1].
    file : str
        Name of the file that is being written.
    file_bytes : int
        How large it is, in bytes [1].
    """

    durable: int
    free_bytes: int
    file: str
    file_bytes: int


@dataclass(frozen=True, slots=True)
class LogEnd:
    """The session is over: no record follows `last`, server to logger.

    Attributes
    ----------
    last : int
        Number of the last record, -1 if there was none [1].
    """

    last: int


@dataclass(frozen=True, slots=True)
class TickRecord:
    """One tick: one row of `netboard.tick.TICK`.

    Attributes
    ----------
    row : bytes
        The row, little-endian, packed.
    """

    row: bytes


@dataclass(frozen=True, slots=True)
class EventRecord:
    """Something happened.

    Attributes
    ----------
    seq : int
        Number of the event, from 0 [1].
    tick : int
        Tick at which it took effect [1].
    time_ns : int
        Server time [ns].
    name : str
        What, in snake case.
    details : dict of str
        Anything worth knowing.
    """

    seq: int
    tick: int
    time_ns: int
    name: str
    details: dict[str, str]


@dataclass(frozen=True, slots=True)
class ClockRecord:
    """One raw clock probe of a peer, and the estimate then.

    Attributes
    ----------
    seq : int
        Number of the probe, from 0 [1].
    peer : str
        ``agent.left`` and so on.
    t0_ns, t3_ns : int
        Sent and received by the server, server time [ns].
    t1_ns, t2_ns : int
        Received and sent by the peer, its own time [ns].
    offset_ns : int
        Estimated peer clock minus server clock [ns].
    bound_ns : int
        Bound of the estimate's error [ns].
    drift_ppm : float
        Rate of the peer's clock minus that of the server's, NaN while unknown [1e-6].
    """

    seq: int
    peer: str
    t0_ns: int
    t1_ns: int
    t2_ns: int
    t3_ns: int
    offset_ns: int
    bound_ns: int
    drift_ppm: float


@dataclass(frozen=True, slots=True)
class FrameRecord:
    """One frame a display has shown.

    Attributes
    ----------
    seq : int
        Number of the frame at its station, from 0 [1].
    station : str
        ``left`` or ``right``.
    tick : int
        Tick of the view [1].
    received_ns, painted_ns : int
        When the view was received and painted, the display's clock [ns].
    dropped : int
        Dropped refreshes so far [1].
    """

    seq: int
    station: str
    tick: int
    received_ns: int
    painted_ns: int
    dropped: int


# --- control: console, demo -> server ----------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Command:
    """An operator's wish. Whoever commands first is the commander; others may watch, and stop everything.

    Attributes
    ----------
    name : str
        One of ``netboard.wire.codec.COMMANDS``.
    argument : str
        What some of them need: a note's text, a form, a reason; else empty.
    number : int
        By which the answer is known [1].
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
        The command's [1].
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
    """Ask the server how it is."""


@dataclass(frozen=True, slots=True)
class Status:
    """How the server is.

    Attributes
    ----------
    session : str
        Id of this run of the server.
    tick : int
        Ticks so far [1].
    phase : str
        Phase of the trial, lower case.
    trial, trials : int
        Current trial, and how many the block asks for [1].
    successes, failures : int
        Trials done and attempts failed in the block [1].
    completions : tuple of float
        Completion times of the successful trials so far [s].
    late_ticks : int
        Ticks that started more than half a tick late [1].
    waiting_for : tuple of str
        Peers still missing.
    peers : tuple of str
        Peers that are there.
    notice : str
        What the operator should know, or empty.
    links : tuple of (str, str, str, float, float, float, float, float, int)
        For each peer that is there: what it is (``agent.left``), host and process, version; time since it was heard
        [s], shortest round trip of late [s], bound of its clock's error [s], its drift [1e-6] (NaN: not known),
        messages a second [Hz], messages lost [1].
    loops : tuple of (str, float, float)
        For each agent that is there: what it is, the delay of its loop of late, from reading the stylus to rendering
        what the server made of that (NaN: not known), and the largest that its device alone is stable with [s, s].
    name, dyad, study : str
        How the session is labelled.
    pilot, consent : bool
        Whether it is a pilot run; whether both participants have consented.
    opened : bool
        Whether the session's form is complete, so that a block may begin and everything is recorded.
    armed : bool
        Whether the operator lets devices have forces.
    commander : str
        Console whose commands count; empty: the next one's.
    block, blocks : int
        Number of the block in its plan, from 1, and how many there are [1].
    label : str
        What people call the block.
    condition : str
        Its configuration and force condition, in words.
    rest : float
        What is left of the rest before the block [s].
    pending : str
        What will be done after this trial or block, or empty.
    outcomes : int
        How many attempts have been judged in this session: what `OutcomesRequest` can ask for [1].
    recordings : tuple of (str, float, int, int)
        For each logger that is there: its file, time since it brought records to disk [s]; bytes written and bytes
        free [1].
    stations : tuple of (str, float, int, float, int, int)
        For each side: its name, age of the newest sample (NaN: none) [s], `Safeguard` bits of the last tenth of a
        second, vertical force rendered [N], and how many ticks of this attempt had no fresh sample, and a force at its
        limit [1].
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
    links: tuple[tuple[str, str, str, float, float, float, float, float, int], ...]
    loops: tuple[tuple[str, float, float], ...]
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
    recordings: tuple[tuple[str, float, int, int], ...]
    stations: tuple[tuple[str, float, int, float, int, int], ...]


@dataclass(frozen=True, slots=True)
class OutcomesRequest:
    """Ask what has become of the attempts of this session.

    Attributes
    ----------
    first : int
        Number of the first one wanted, from 0 [1].
    """

    first: int


@dataclass(frozen=True, slots=True)
class Outcomes:
    """What has become of some attempts, in order.

    Attributes
    ----------
    first : int
        Number of the first one [1].
    attempts : tuple of (int, int, int, str, float, str, int)
        For each: block, trial, attempt [1]; ``success``, ``fell``, ``timed_out``, ``aborted``, ``paused``, ``skipped``,
        or ``incomplete`` where the server ended in it; its completion time (NaN: none) [s]; why it is doubtful, words
        divided by commas, or empty; and the trial that it repeats, 0 for none [1].
    """

    first: int
    attempts: tuple[tuple[int, int, int, str, float, str, int], ...]


@dataclass(frozen=True, slots=True)
class TraceRequest:
    """Ask for what has happened of late, to draw it.

    Attributes
    ----------
    after : int
        Ticks after this one are wanted, as far as the server remembers: a second or so [1].
    """

    after: int


@dataclass(frozen=True, slots=True)
class Trace:
    """Every fifth tick of late.

    Attributes
    ----------
    points : tuple of (int, float, float, float, float, float, float, float)
        For each: tick [1]; height of the left and the right stylus and of the board's centre [m]; tilt [rad]; ball
        position, NaN without one [m]; vertical force on the left and the right hand, as rendered [N].
    """

    points: tuple[tuple[int, float, float, float, float, float, float, float], ...]


# --- nerve: the brain of a simulated bimanual participant -> the agent with the other hand ------------------------


@dataclass(frozen=True, slots=True)
class Move:
    """What a simulated participant's other hand shall do.

    Attributes
    ----------
    side : str
        The hand that moves.
    delay : float
        Time from receiving this to the start of the movement; negative for one that is under way [s].
    duration : float
        How long it takes [s].
    displacement : float
        How far the hand goes, + = up [m].
    """

    side: str
    delay: float
    duration: float
    displacement: float


# --- pointer and felt: a played display <-> the agent of its own side, on the station's machine ------------------


@dataclass(frozen=True, slots=True)
class Pointer:
    """Where the player points in the display's window: there the hand of this side goes.

    Attributes
    ----------
    side : str
        The hand that is played.
    z : float or None
        Height of the pointer in the scene's frame; None before the player has pointed anywhere [m].
    """

    side: str
    z: float | None


@dataclass(frozen=True, slots=True)
class Felt:
    """What a played hand would feel.

    Attributes
    ----------
    side : str
        The hand that is played.
    force : float
        Vertical force on the hand, after all limits, + = up [N].
    """

    side: str
    force: float


Message = (
    Hello
    | Welcome
    | Refusal
    | Goodbye
    | Ping
    | Pong
    | Stylus
    | Force
    | Point
    | Beat
    | View
    | Frames
    | LogRequest
    | LogBatch
    | LogAck
    | LogEnd
    | TickRecord
    | EventRecord
    | ClockRecord
    | FrameRecord
    | Command
    | Reply
    | StatusRequest
    | Status
    | OutcomesRequest
    | Outcomes
    | TraceRequest
    | Trace
    | Move
    | Pointer
    | Felt
)
