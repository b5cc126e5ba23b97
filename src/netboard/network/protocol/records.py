"""The messages that are recorded, and those that bring them from the server to a logger without loss.

A message is data only; `netboard.network.protocol.messages` holds the rules for all of them.
"""

from dataclasses import dataclass

AGENT_JOINED, AGENT_PRESENT = "agent_joined", "agent_present"
"""Names of the events that describe an agent and its device: it has joined, or it is there as a block begins."""

STOPPED, RELEASED = "emergency_stop", "emergency_release"
"""Events of an emergency stop, and of its release."""

DISPLAY_JOINED, DISPLAY_PRESENT = "display_joined", "display_present"
"""Names of the events that describe a display, likewise."""

STAND_IN_CONFIRMED = "stand_in_confirmed"
"""Name of the event that records which words of an operator confirm a stand-in for a device or a screen."""

BLOCK_BEGAN = "block_began"
"""Name of the event with which a block begins; its detail ``config`` is the block's configuration.

All records from this event on belong to that block, and a logger begins another file with it.
"""


@dataclass(frozen=True, slots=True)
class LogRequest:
    """A logger or a subscriber asks for records.

    Attributes
    ----------
    first : int
        Number of the first record wanted; -1 for the first one that no logger has acknowledged, or, from a subscriber,
        for the next new one [1].
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
        Requested records before `first` that the ring buffer no longer held [1].
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
        Size of that file so far, in bytes [1].
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
    """One tick: one row of `netboard.base.tick.TICK`.

    Attributes
    ----------
    row : bytes
        The row, little-endian, packed.
    """

    row: bytes


@dataclass(frozen=True, slots=True)
class EventRecord:
    """An event.

    Attributes
    ----------
    seq : int
        Number of the event, from 0 [1].
    tick : int
        Tick at which it took effect [1].
    time_ns : int
        Time of the event, server time [ns].
    name : str
        What happened, in snake case.
    details : dict of str
        Further information.
    """

    seq: int
    tick: int
    time_ns: int
    name: str
    details: dict[str, str]


@dataclass(frozen=True, slots=True)
class ClockRecord:
    """One raw clock probe of a peer, and the estimate at that time.

    Attributes
    ----------
    seq : int
        Number of the probe, from 0 [1].
    peer : str
        ``agent.left`` and so on; of the second connection of such a peer ``agent.left#2``.
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


def connection_name(kind: str, number: int) -> str:
    """Return the name of a peer's connection, as in `ClockRecord.peer`.

    Parameters
    ----------
    number : int
        How many connections of its kind there have been, including this one [1].
    """
    return kind if number == 1 else f"{kind}#{number}"


def kind_of_peer(name: str) -> str:
    """Return the role and side of a peer from the name of one of its connections.

    Parameters
    ----------
    name : str
        `ClockRecord.peer`.
    """
    return name.partition("#")[0]


@dataclass(frozen=True, slots=True)
class BackfillRecord:
    """What an agent rendered while its samples did not arrive, as it reported later.

    Attributes
    ----------
    seq : int
        Number of the record, from 0 [1].
    side : str
        ``left`` or ``right``.
    offset_ns : int
        The agent's clock minus the server's, as estimated when the agent reported [ns].
    rows : bytes
        Rows of `netboard.base.tick.RENDERED`, little-endian, packed.
    """

    seq: int
    side: str
    offset_ns: int
    rows: bytes


@dataclass(frozen=True, slots=True)
class FrameRecord:
    """One frame that a display has painted.

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
