"""What a recording holds: its channels, the fields of their messages, and how a record becomes bytes and back.

This table is the format; FORMAT.md and the JSON schemas inside every recording are made from it, and a test holds it
against `netboard.tick.TICK` and the record messages of the log channel. Channel ids are fixed: 1, 2, ... in the order
of `CHANNELS`. Every message is a flat msgpack map with the names of the fields as keys.

Ticks are the many, so they have a fixed layout: keys in order, every value in msgpack's nine-byte int64 or float64
form. Any msgpack decoder reads them, their bits survive untouched (a not-a-number's payload too), and a whole chunk of
them turns into rows by moving bytes.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import msgpack
import numpy as np
from numpy.typing import NDArray

from netboard.errors import RecordingError, WireError
from netboard.experiment.machine import Cause, Phase
from netboard.tick import TICK
from netboard.wire.codec import decode
from netboard.wire.messages import ClockRecord, EventRecord, FrameRecord, Safeguard, TickRecord

FORMAT_VERSION = "2"
"""Grows when a reader of the version before would misread a file."""

Record = TickRecord | EventRecord | ClockRecord | FrameRecord
"""What the log channel carries."""


@dataclass(frozen=True, slots=True)
class Field:
    """One value of a message.

    Attributes
    ----------
    name : str
        Key in the message.
    kind : str
        ``integer``, ``number``, ``string`` or ``texts`` (a map from string to string).
    text : str
        What it is.
    unit : str
        SI symbol, ``1`` for a pure number, empty for text.
    """

    name: str
    kind: str
    text: str
    unit: str

    def schema(self) -> dict[str, Any]:
        """JSON schema of the value; the description ends with the unit."""
        described = {"description": f"{self.text} [{self.unit}]" if self.unit else self.text}
        if self.kind == "texts":
            return {"type": "object", "additionalProperties": {"type": "string"}, **described}
        return {"type": self.kind, **described}


@dataclass(frozen=True, slots=True)
class Channel:
    """One stream of a recording.

    Attributes
    ----------
    topic : str
        Name of the MCAP channel.
    schema_name : str
        Name of its schema.
    about : str
        What it carries, in one line.
    sequence, publish_time : str
        What these two stamps of a message are.
    fields : tuple of Field
        The fields of a message, in order.
    """

    topic: str
    schema_name: str
    about: str
    sequence: str
    publish_time: str
    fields: tuple[Field, ...]

    def schema(self) -> bytes:
        """JSON schema of the channel's messages."""
        return json.dumps(
            {
                "$schema": "https://json-schema.org/draft/2020-12/schema",
                "title": self.schema_name,
                "description": self.about,
                "type": "object",
                "properties": {field.name: field.schema() for field in self.fields},
                "required": [field.name for field in self.fields],
                "additionalProperties": False,
            }
        ).encode()


def _numbered(members: Any) -> str:
    return ", ".join(f"{member.value} {member.name.lower()}" for member in members)


_SAFEGUARDS = f"sum of {_numbered(Safeguard)}"

_TICK_TEXTS: dict[str, tuple[str, str]] = {
    "tick": ("number of the tick, from 0", "1"),
    "time_ns": ("nominal server time of the tick", "ns"),
    "command": ("an operator's command or a fault, coded as event is", "1"),
    "z": ("height of the board's centre at the start of the tick", "m"),
    "vz": ("rate of z", "m/s"),
    "theta": ("tilt of the board, + = right end up", "rad"),
    "omega": ("rate of theta", "rad/s"),
    "p": ("ball along the board, + = right", "m"),
    "vp": ("rate of p", "m/s"),
    "completion": ("completion time of the last successful trial, 0 before the first", "s"),
    "phase": (f"phase of the trial: {_numbered(Phase)}", "1"),
    "target": ("side of the target: -1 left, +1 right", "1"),
    "trial": ("number of the trial in the block, from 1", "1"),
    "attempt": ("number of the attempt at this trial, from 1; 0 if it was skipped to in a pause", "1"),
    "successes": ("successful trials in the block", "1"),
    "failures": ("failed attempts in the block", "1"),
    "counted": ("ticks level (levelling) or inside the target (holding)", "1"),
    "run_ticks": ("ticks since the release", "1"),
    "mark_ticks": ("run_ticks when the ball came into the target", "1"),
    "extra": ("trials that operators have added to the block", "1"),
    "block_ticks": ("ticks that the block has taken, without pauses", "1"),
    "event": (f"what changed the phase at this tick: {_numbered(Cause)}", "1"),
    "late_ns": ("how late the tick began; negative: before its deadline, all samples being there", "ns"),
}

_SIDE_TEXTS: dict[str, tuple[str, str]] = {
    "live": ("1: the {} sample is fresh; 0: none, or too old, or not finite", "1"),
    "seq": ("number of the {} stylus sample, -1 for none", "1"),
    "stamp_ns": ("when that sample was read, server time", "ns"),
    "sent_z": ("height of the {} stylus as sent", "m"),
    "sent_vz": ("rate of sent_z", "m/s"),
    "other": ("force on a {} hand in another session, which is felt where unrelated forces are; else 0", "N"),
    "z": ("height of the {} stylus as last used, part of the state", "m"),
    "seen_ns": ("when the newest {} sample was read, 0 before the first, part of the state", "ns"),
    "seen_vz": ("rate of the {} stylus in it, part of the state", "m/s"),
    "az": ("its change since the sample before, over the time between; 0 if they are far apart", "m/s2"),
    "used_z": ("height of the {} stylus used: extrapolated to the tick and clipped", "m"),
    "used_vz": ("rate used with it", "m/s"),
    "used_az": ("acceleration used with it, kept through the tick", "m/s2"),
    "coupling": ("force of the {} coupling on the board, + = up", "N"),
    "force": ("force to be felt by the {} hand, + = up; told [block] force_delay_ms later; 0 where nothing is", "N"),
    "x": ("{} stylus, out of the screen, as sent", "m"),
    "y": ("{} stylus, to the right, as sent", "m"),
    "rendered": ("vertical force the {} agent last handed to its device, + = up", "N"),
    "safeguards": (f"what the {{}} agent's safety chain did: {_SAFEGUARDS}", "1"),
    "buttons": ("bit mask of the pressed buttons of the {} stylus", "1"),
    "loop_ns": ("{} stylus read to rendering of the answer to it, 0 for none yet", "ns"),
    "lead_ns": ("how long before the deadline of a tick the {} sample arrived", "ns"),
}


def _tick_field(name: str) -> Field:
    """Describe one column of `netboard.tick.TICK`."""
    side, _, rest = name.partition("_")
    if side in ("left", "right"):
        text, unit = _SIDE_TEXTS[rest]
        text = text.format(side)
    else:
        text, unit = _TICK_TEXTS[name]
    return Field(name, "integer" if TICK[name].kind == "i" else "number", text, unit)


_EVENT_FIELDS = (
    Field("seq", "integer", "number of the event, from 0", "1"),
    Field("tick", "integer", "tick at which it took effect, -1 for none", "1"),
    Field("time_ns", "integer", "server time (on /logger: log time)", "ns"),
    Field("name", "string", "what happened, in snake case", ""),
    Field("details", "texts", "anything worth knowing", ""),
)

CHANNELS = (
    Channel(
        "/tick",
        "netboard.Tick",
        "everything that went into a tick, the state it found, what came out and what the server noted beside it",
        "number of the tick",
        "nominal server time of the tick",
        tuple(_tick_field(name) for name in TICK.names or ()),
    ),
    Channel(
        "/event",
        "netboard.Event",
        "something happened",
        "number of the event",
        "server time of the event",
        _EVENT_FIELDS,
    ),
    Channel(
        "/clock",
        "netboard.Clock",
        "one raw clock probe of a peer, and the estimate made with it",
        "number of the probe",
        "t3_ns",
        (
            Field("seq", "integer", "number of the probe, from 0", "1"),
            Field("peer", "string", "agent.left and so on", ""),
            Field("t0_ns", "integer", "sent by the server, server time", "ns"),
            Field("t1_ns", "integer", "received by the peer, its own time", "ns"),
            Field("t2_ns", "integer", "sent by the peer, its own time", "ns"),
            Field("t3_ns", "integer", "received by the server, server time", "ns"),
            Field("offset_ns", "integer", "estimated peer clock minus server clock", "ns"),
            Field("bound_ns", "integer", "bound of the estimate's error", "ns"),
            Field("drift_ppm", "number", "rate of the peer's clock minus the server's, NaN while unknown", "1e-6"),
        ),
    ),
    Channel(
        "/frame",
        "netboard.Frame",
        "one frame that a display has shown",
        "number of the frame at its station",
        "painted_ns",
        (
            Field("seq", "integer", "number of the frame at its station, from 0", "1"),
            Field("station", "string", "left or right", ""),
            Field("tick", "integer", "tick of the view", "1"),
            Field("received_ns", "integer", "when the view was received, the display's clock", "ns"),
            Field("painted_ns", "integer", "when it was painted, the display's clock", "ns"),
            Field("dropped", "integer", "dropped views so far", "1"),
        ),
    ),
    Channel(
        "/logger",
        "netboard.Remark",
        "what the logger itself has to say, above all about records it never got",
        "number of the remark, from 0",
        "log time",
        _EVENT_FIELDS,
    ),
)
"""The channels of a recording, in the order of their ids."""

IDS = {channel.topic: number for number, channel in enumerate(CHANNELS, start=1)}
"""MCAP channel (and schema) id of each topic."""


def _tick_layout() -> tuple[NDArray[np.uint8], NDArray[np.intp]]:
    """Lay out a tick message: its bytes with zeros for values, and where each byte of a `TICK` row goes in it."""
    packer = msgpack.Packer()
    message = bytearray(packer.pack_map_header(len(TICK.names or ())))
    places = np.empty(TICK.itemsize, np.intp)
    for name, (dtype, offset, *_) in (TICK.fields or {}).items():
        message += msgpack.packb(name) + (b"\xd3" if dtype.kind == "i" else b"\xcb")
        # A row is little-endian, msgpack is big-endian.
        places[offset : offset + 8] = np.arange(len(message) + 7, len(message) - 1, -1)
        message += bytes(8)
    return np.frombuffer(bytes(message), np.uint8), places


_TEMPLATE, _PLACES = _tick_layout()
_FIXED = np.setdiff1d(np.arange(_TEMPLATE.size), _PLACES)


def encode_tick(row: bytes) -> bytes:
    """Turn a row of `TICK` into the message of the ``/tick`` channel.

    Raises
    ------
    RecordingError
        If the row is not as long as a `TICK`, which means that server and logger are of different versions.
    """
    if len(row) != TICK.itemsize:
        raise RecordingError(
            f"a tick record of {len(row)} bytes where {TICK.itemsize} are expected: "
            "server and logger are of different versions; install the same netboard on both"
        )
    message = _TEMPLATE.copy()
    message[_PLACES] = np.frombuffer(row, np.uint8)
    return message.tobytes()


def decode_ticks(messages: Sequence[bytes]) -> NDArray[Any]:
    """Turn messages of the ``/tick`` channel into rows.

    Parameters
    ----------
    messages : sequence of bytes
        The messages' data.

    Returns
    -------
    ndarray of TICK, shape (n,)
        The rows, bit for bit as they were written.

    Raises
    ------
    RecordingError
        If a message is not a tick.
    """
    joined = np.frombuffer(b"".join(messages), np.uint8)
    if all(len(message) == _TEMPLATE.size for message in messages):
        table = joined.reshape(len(messages), _TEMPLATE.size)
        if np.array_equal(table[:, _FIXED], np.broadcast_to(_TEMPLATE[_FIXED], (len(messages), _FIXED.size))):
            return np.ascontiguousarray(table[:, _PLACES]).view(TICK).reshape(len(messages))
    # Not our writer's layout: another tool wrote the map anew, with its own order of keys or shorter integers.
    return np.array([_row_by_name(message) for message in messages], TICK)


def _row_by_name(message: bytes) -> tuple[Any, ...]:
    values = unpack(message)
    try:
        return tuple(values[name] for name in TICK.names or ())
    except KeyError as missing:
        raise RecordingError(f"a tick without the field {missing}: written by another version of netboard?") from None


def unpack(message: bytes) -> dict[str, Any]:
    """Decode any message of a recording into its map.

    Raises
    ------
    RecordingError
        If it is not a msgpack map.
    """
    try:
        values = msgpack.unpackb(message)
    except (ValueError, msgpack.exceptions.UnpackException) as error:
        raise RecordingError(f"a message is not msgpack: {error}") from error
    if not isinstance(values, dict):
        raise RecordingError(f"a message is a msgpack {type(values).__name__}, not a map")
    return values


@dataclass(frozen=True, slots=True)
class Stamped:
    """A record as it goes into a file: its channel, its stamps and its bytes.

    Attributes
    ----------
    topic : str
        Topic of the channel.
    sequence : int
        The source's number of it [1].
    publish_time_ns : int
        The source's stamp [ns].
    data : bytes
        The msgpack map.
    """

    topic: str
    sequence: int
    publish_time_ns: int
    data: bytes


def _map(record: EventRecord | ClockRecord | FrameRecord) -> bytes:
    return bytes(msgpack.packb({field.name: getattr(record, field.name) for field in fields(record)}))


def stamped(record: Record) -> Stamped:
    """Turn a record of the log channel into what is written.

    Parameters
    ----------
    record : TickRecord, EventRecord, ClockRecord or FrameRecord
        The record.
    """
    match record:
        case TickRecord(row=data):
            message = encode_tick(data)
            row = np.frombuffer(data, TICK)[0]
            return Stamped("/tick", int(row["tick"]), int(row["time_ns"]), message)
        case EventRecord():
            return Stamped("/event", record.seq, record.time_ns, _map(record))
        case ClockRecord():
            return Stamped("/clock", record.seq, record.t3_ns, _map(record))
        case FrameRecord():
            return Stamped("/frame", record.seq, record.painted_ns, _map(record))


def record_of(frame: bytes) -> Record:
    """Read a record as it came over the log channel.

    Parameters
    ----------
    frame : bytes
        An encoded record message.

    Raises
    ------
    WireError
        If it is not one.
    """
    record = decode(frame)
    if not isinstance(record, Record):
        raise WireError(f"a {type(record).__name__} is not a record")
    return record


def remark(seq: int, name: str, details: dict[str, str], log_time_ns: int) -> Stamped:
    """Make a message of the ``/logger`` channel: the logger's own remark.

    Parameters
    ----------
    seq : int
        Number of the remark, from 0 [1].
    name : str
        What, in snake case.
    details : dict of str
        Anything worth knowing.
    log_time_ns : int
        Log time [ns].
    """
    return Stamped("/logger", seq, log_time_ns, _map(EventRecord(seq, -1, log_time_ns, name, details)))
