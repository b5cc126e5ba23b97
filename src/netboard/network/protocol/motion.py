"""Messages of agents: the motion of a hand, the force on it, and the commands of simulated hands.

Agents and server exchange the first of these a thousand times a second. After an interruption the server asks an agent
what it has rendered meanwhile (`BackfillRequest`, `Backfill`). The last three do not pass through the server: they go
from the brain of a simulated bimanual participant to its other hand, and between a player's display and the agent of
its side. A message is data only; `netboard.network.protocol.messages` holds the rules for all of them.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Stylus:
    """One sample of a stylus, agent to server.

    Attributes
    ----------
    seq : int
        Number of the sample, from 0, without gaps at the source [1].
    stamp_ns : int
        When the device was read [ns].
    x, y, z : float
        Position in the scene's frame: out of the screen, right, up [m].
    vx, vy, vz : float
        Velocity in the same frame [m/s].
    buttons : int
        Bit mask of pressed buttons [1].
    safeguards : int
        `Safeguard` bits since the sample before [1].
    rendered : float
        Vertical force given to the device since the sample before, after all limits [N].
    force_tick : int
        Tick of the last `Force`, `Point` or `Heartbeat` received, -1 for none yet [1].
    force_sent_ns : int
        Its ``sent_ns``, server time: t0 of a clock probe [ns].
    force_received_ns : int
        When it was received: t1 of a clock probe [ns].
    sent_ns : int
        When this message was sent: t2 of a clock probe [ns].
    loop_ns : int
        Sample-to-force latency: from reading the stylus to rendering the first answer to that sample, for the newest
        such pair; 0 for none yet [ns].
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
    """The commanded vertical force on one hand for one tick, server to agent.

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
        Time from the arrival of that sample to the deadline of its tick, to which the agent adjusts its sampling [ns].
    """

    tick: int
    sent_ns: int
    stylus_seq: int
    force: float
    lead_ns: int


@dataclass(frozen=True, slots=True)
class Point:
    """The board's control point of one side at one tick, instead of `Force` where agents compute their own force.

    Attributes
    ----------
    tick : int
        Tick that computed it [1].
    sent_ns : int
        Server time when this was sent [ns].
    stylus_seq : int
        Newest stylus sample received, -1 for none yet [1].
    stamp_ns : int
        Time of the point on the agent's clock; 0 while the offset of that clock is unknown [ns].
    z : float
        Height of the point [m].
    vz : float
        Vertical velocity of the point [m/s].
    k : float
        Stiffness of the virtual coupling between stylus and point [N/m].
    c : float
        Its damping [N s/m].
    lead_ns : int
        Time from the arrival of that sample to the deadline of its tick [ns].
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
class Heartbeat:
    """Heartbeat while no force is rendered: the server is alive, and the commanded force is zero.

    Attributes
    ----------
    tick : int
        Tick that sent it [1].
    sent_ns : int
        Server time when it was sent [ns].
    stylus_seq : int
        Newest stylus sample received, -1 for none yet [1].
    lead_ns : int
        Time from the arrival of that sample to the deadline of its tick [ns].
    arm : bool
        Whether the device may be armed: the server knows the agent's clock well enough.
    """

    tick: int
    sent_ns: int
    stylus_seq: int
    lead_ns: int
    arm: bool


BACKFILL_ROWS = 64
"""Largest number of rows in a `Backfill` [1]."""


@dataclass(frozen=True, slots=True)
class BackfillRequest:
    """The server asks an agent what it rendered while its samples did not arrive.

    Attributes
    ----------
    first : int
        Number of the first sample in question [1].
    stop : int
        Number after the last one [1].
    """

    first: int
    stop: int


@dataclass(frozen=True, slots=True)
class Backfill:
    """An agent's answer to a `BackfillRequest`, or the first part of it.

    Attributes
    ----------
    first : int
        `BackfillRequest.first` of the request that it answers [1].
    next : int
        Number from which the server requests the rest; the request's `stop` if there is no more [1].
    rows : bytes
        Rows of `netboard.base.tick.RENDERED`, little-endian, packed: those of the samples before `next` that the agent
        still remembers, `BACKFILL_ROWS` at most.
    """

    first: int
    next: int
    rows: bytes


@dataclass(frozen=True, slots=True)
class Move:
    """Movement of a simulated participant's other hand.

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


@dataclass(frozen=True, slots=True)
class Pointer:
    """Where the player points in the display's window: the target of this side's hand.

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
    """Force that a player's hand would feel.

    Attributes
    ----------
    side : str
        The hand that is played.
    force : float
        Vertical force on the hand, after all limits, + = up [N].
    """

    side: str
    force: float
