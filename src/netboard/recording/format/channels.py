"""Channels of a recording, the fields of their messages, and the conversion of records to bytes and back.

This table defines the format. FORMAT.md and the JSON schemas inside every recording are generated from it, and a test
compares it with `netboard.base.tick.TICK` and the record messages of the log channel. Channel ids are fixed: 1, 2, ...
in the order of `CHANNELS`. Every message is a flat map keyed by field name: msgpack, and JSON for viewers (``/plot``).

Ticks are the bulk of a recording, so they are stored in columnar batches (`netboard.recording.format.batches`). One
tick in `PLOTTED_EVERY` is also stored as a map, for viewers.
"""

import json
from dataclasses import dataclass, fields
from typing import Any, TypeVar

import msgpack
import numpy as np

from netboard.base.errors import RecordingError, WireError
from netboard.base.safeguards import Safeguard
from netboard.base.tick import RENDERED, TICK
from netboard.network.protocol.codec import decode, message_of
from netboard.network.protocol.records import (
    BLOCK_BEGAN,
    BackfillRecord,
    ClockRecord,
    EventRecord,
    FrameRecord,
    TickRecord,
)
from netboard.recording.format.claims import MAX_ITEMS, require_details
from netboard.recording.format.predictions import CONSTANTS, PREDICTIONS
from netboard.task.trials.state_machine import Cause, Phase

FORMAT_VERSION = "4"
"""Format version; it increases when readers of the previous version would misread a file."""

Record = TickRecord | EventRecord | ClockRecord | FrameRecord | BackfillRecord
"""Records on the log channel."""

R = TypeVar("R", EventRecord, ClockRecord, FrameRecord, BackfillRecord)


@dataclass(frozen=True, slots=True)
class Field:
    """One value in a message."""

    name: str
    kind: str  # ``integer``, ``number``, ``string``, ``bytes``; ``texts`` (a map of strings), ``numbers`` (a list)
    text: str
    unit: str
    differences: int = 0  # order of the differences that a batch stores instead of the values

    def schema(self) -> dict[str, Any]:
        """Return the JSON schema of the value; its description ends with the unit."""
        described = {"description": f"{self.text} [{self.unit}]" if self.unit else self.text}
        if self.kind == "texts":
            return {"type": "object", "additionalProperties": {"type": "string"}, **described}
        if self.kind == "numbers":
            return {"type": "array", "items": {"type": "number"}, **described}
        if self.kind == "bytes":
            return described  # JSON has no such type
        return {"type": self.kind, **described}


_DECODING = {"folded": True, "constants": CONSTANTS, "predictions": PREDICTIONS}
"""What a reader must know to decode the columns of a batch, beside the columns themselves."""

DTYPES = {"integer": np.dtype(np.int64), "number": np.dtype(np.float64), "string": np.dtype(object)}
"""NumPy dtype of each kind of column in a table."""

_NUMPY = {"integer": "<i8", "number": "<f8"}


@dataclass(frozen=True, slots=True)
class Channel:
    """One stream in a recording."""

    topic: str
    schema_name: str
    about: str
    sequence: str
    publish_time: str
    fields: tuple[Field, ...]
    columns: tuple[Field, ...] = ()  # columns of the rows in a batch, in order; empty for other messages
    encoding: str = "msgpack"  # or json, which has no text for a number that is not finite: such a field is left out

    def schema(self) -> bytes:
        """Return the JSON schema of the messages; for a batch, with all that is needed to decode its columns."""
        columns = [
            {
                "name": field.name,
                "type": _NUMPY[field.kind],
                "differences": field.differences,
                "unit": field.unit,
                "description": field.text,
            }
            for field in self.columns
        ]
        return json.dumps(
            {
                "$schema": "https://json-schema.org/draft/2020-12/schema",
                "title": self.schema_name,
                "description": self.about,
                "type": "object",
                "properties": {field.name: field.schema() for field in self.fields},
                "required": [field.name for field in self.fields if self.encoding != "json" or field.kind != "number"],
                "additionalProperties": False,
                **({"columns": columns, **_DECODING} if columns else {}),
            }
        ).encode()


def _numbered(members: Any) -> str:
    return ", ".join(f"{member.value} {member.name.lower()}" for member in members)


_SAFEGUARDS = f"sum of {_numbered(Safeguard)}"

_TICK_TEXTS: dict[str, tuple[str, str]] = {
    "tick": ("number of the tick, from 0", "1"),
    "time_ns": ("nominal server time of the tick", "ns"),
    "command": ("an operator's command or a fault, coded like event", "1"),
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
    "perturbed_ticks": ("ticks of the attempt's perturbation so far, 0 before it", "1"),
    "perturbation": ("force of a perturbation during the tick, + = up, on the ball + = right; 0 for none", "N"),
    "event": (f"what changed the phase at this tick: {_numbered(Cause)}", "1"),
    "late_ns": (
        "start of the tick after its deadline; negative: before the deadline, because all samples had arrived",
        "ns",
    ),
}

_SIDE_TEXTS: dict[str, tuple[str, str]] = {
    "live": ("1: the {} sample is fresh; 0: none, or too old, or not finite", "1"),
    "seq": ("number of the {} stylus sample, -1 for none", "1"),
    "stamp_ns": ("when that sample was read, server time", "ns"),
    "sent_z": ("height of the {} stylus as sent", "m"),
    "sent_vz": ("rate of sent_z", "m/s"),
    "other": ("force on the {} hand in another session, commanded in the condition unrelated; else 0", "N"),
    "z": ("height of the {} stylus as last used, part of the state", "m"),
    "seen_ns": ("when the newest {} sample was read, 0 before the first, part of the state", "ns"),
    "seen_vz": ("rate of the {} stylus in it, part of the state", "m/s"),
    "az": ("change of that rate since the previous sample over the time between them; 0 if they are far apart", "m/s2"),
    "used_z": ("height of the {} stylus used: extrapolated to the tick and clipped", "m"),
    "used_vz": ("rate used with it", "m/s"),
    "used_az": ("acceleration used with it, constant during the tick", "m/s2"),
    "coupling": ("force of the {} coupling on the board, + = up", "N"),
    "force": (
        "commanded force on the {} hand, + = up, before the delay [block] force_delay_ms; 0 if none is commanded",
        "N",
    ),
    "x": ("{} stylus, out of the screen, as sent", "m"),
    "y": ("{} stylus, to the right, as sent", "m"),
    "rendered": ("vertical force that the {} agent last wrote to its device, + = up; NaN where it is unknown", "N"),
    "safeguards": (f"actions of the {{}} agent's safety chain: {_SAFEGUARDS}", "1"),
    "buttons": ("bit mask of the pressed buttons of the {} stylus", "1"),
    "loop_ns": ("time from reading the {} stylus to rendering the force computed from it; 0: none yet", "ns"),
    "lead_ns": ("time from the arrival of the {} sample to the deadline of a tick", "ns"),
}


_DIFFERENCES = {
    **dict.fromkeys(("z", "theta", "p", "coupling", "force", "rendered"), 4),
    **dict.fromkeys(("vz", "omega", "vp", "sent_z", "side_z", "used_z", "stamp_ns", "seen_ns", "lead_ns"), 1),
}
"""Order of the difference that makes smooth columns smallest, measured on recordings."""

_NOISE = frozenset({"late_ns", "loop_ns", "command", "event"})
"""Integers that differencing does not make smaller."""


def _differences(name: str, kind: str) -> int:
    side, _, rest = name.partition("_")
    quantity = name if side not in ("left", "right") else "side_z" if rest == "z" else rest
    return _DIFFERENCES.get(quantity, int(kind == "integer" and quantity not in _NOISE))


def _tick_field(name: str) -> Field:
    """Describe one column of `netboard.base.tick.TICK`."""
    side, _, rest = name.partition("_")
    if side in ("left", "right"):
        text, unit = _SIDE_TEXTS[rest]
        text = text.format(side)
    else:
        text, unit = _TICK_TEXTS[name]
    kind = "integer" if TICK[name].kind == "i" else "number"
    return Field(name, kind, text, unit, _differences(name, kind))


_EVENT_FIELDS = (
    Field("seq", "integer", "number of the event, from 0", "1"),
    Field("tick", "integer", "tick at which it took effect, -1 for none", "1"),
    Field("time_ns", "integer", "server time (on /logger: log time)", "ns"),
    Field("name", "string", "what happened, in snake case", ""),
    Field("details", "texts", "details of the event, by name", ""),
)

TICK_FIELDS = tuple(_tick_field(name) for name in TICK.names or ())
"""Columns of a tick, in the order of `netboard.base.tick.TICK`."""

PLOTTED_EVERY = 20
"""Decimation of the ticks for viewers: one in this many [1]."""

_PLOTTED = ["tick", "z", "theta", "p", "phase", "target", "trial", "attempt", "late_ns"]
_PLOTTED_OF_A_SIDE = ("used_z", "force", "rendered")

PLOTTED = tuple(
    field for field in TICK_FIELDS if field.name in _PLOTTED or field.name.partition("_")[2] in _PLOTTED_OF_A_SIDE
)
"""Fields of a tick that viewers show."""

CHANNELS = (
    Channel(
        "/ticks",
        "netboard.Ticks",
        "ticks, each with its inputs, the state before it, its outputs, and service data of the server",
        "number of the first tick in the batch",
        "nominal server time of that tick",
        (
            Field("first", "integer", "number of the first tick in the batch", "1"),
            Field("time_ns", "integer", "nominal server time of that tick", "ns"),
            Field("count", "integer", "number of ticks in the batch", "1"),
            Field("constants", "numbers", "constants of the block that the predictions use, in the schema's order", ""),
            Field(
                "columns",
                "bytes",
                "columns of the ticks in order: predicted, differenced, folded, each as eight byte planes",
                "",
            ),
        ),
        TICK_FIELDS,
    ),
    Channel(
        "/event",
        "netboard.Event",
        "an event of the session",
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
            Field("peer", "string", "name of the peer, such as agent.left; agent.left#2 for its second connection", ""),
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
        "one frame that a display has painted",
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
        "log messages of the logger itself, above all on records that it did not receive",
        "number of the remark, from 0",
        "log time",
        _EVENT_FIELDS,
    ),
    Channel(
        "/plot",
        "netboard.Plot",
        f"one tick in {PLOTTED_EVERY}, for viewers, as JSON with 7 digits; /ticks contains all of it",
        "number of the tick",
        "nominal server time of the tick",
        PLOTTED,
        encoding="json",
    ),
    Channel(
        "/backfill",
        "netboard.Backfill",
        "forces that an agent rendered while its samples did not arrive, as reported after the interruption",
        "number of the record",
        "stamp of its first row, server time",
        (
            Field("seq", "integer", "number of the record, from 0", "1"),
            Field("side", "string", "left or right", ""),
            Field("offset_ns", "integer", "estimated agent clock minus server clock", "ns"),
            Field(
                "rows",
                "bytes",
                "rows of four little-endian words: seq of the sample, stamp_ns on the agent's clock, rendered "
                "(float64, N), safeguards",
                "",
            ),
        ),
    ),
)
"""Channels of a recording, in the order of their ids."""

TICKS = CHANNELS[0].topic
"""Topic of the ticks."""

LOG_TOPICS = ("/ticks", "/event", "/clock", "/frame", "/backfill")
"""Topics whose messages are records of the log channel."""

IDS = {channel.topic: number for number, channel in enumerate(CHANNELS, start=1)}
"""MCAP channel (and schema) id of each topic."""


Payload = bytes | memoryview
"""Bytes of a message, or where they lie in a chunk."""


def unpack(message: Payload) -> dict[str, Any]:
    """Decode a message of a recording into a dict."""
    try:
        values = msgpack.unpackb(message, max_array_len=MAX_ITEMS, max_map_len=MAX_ITEMS, max_ext_len=0)
    except (ValueError, msgpack.exceptions.UnpackException) as error:
        raise RecordingError(f"a message is not msgpack: {error!s:.100}") from error
    if not isinstance(values, dict):
        raise RecordingError(f"a message is a msgpack {type(values).__name__}, not a map")
    return values


def read_record(kind: type[R], message: Payload) -> R:
    """Decode a message that holds a record other than ticks; its fields have the kinds that the record declares."""
    try:
        record = message_of(kind, unpack(message))
    except WireError as error:
        raise RecordingError(f"a damaged record: {error}") from error
    if isinstance(record, EventRecord):
        require_details(record)
    return record


@dataclass(frozen=True, slots=True)
class Stamped:
    """A record ready to be written: channel, time stamps and bytes."""

    topic: str
    sequence: int
    publish_time_ns: int  # time stamp of the source [ns]
    data: bytes


Other = EventRecord | ClockRecord | FrameRecord | BackfillRecord
"""Records other than ticks."""


def _map(record: Other) -> bytes:
    return bytes(msgpack.packb({field.name: getattr(record, field.name) for field in fields(record)}))


def stamped(record: Other) -> Stamped:
    """Convert a record of the log channel, other than a tick, for writing."""
    match record:
        case EventRecord():
            return Stamped("/event", record.seq, record.time_ns, _map(record))
        case ClockRecord():
            return Stamped("/clock", record.seq, record.t3_ns, _map(record))
        case FrameRecord():
            return Stamped("/frame", record.seq, record.painted_ns, _map(record))
        case BackfillRecord():
            stamps = np.frombuffer(record.rows, RENDERED)["stamp_ns"]
            first_ns = int(stamps[0]) - record.offset_ns if stamps.size else 0
            return Stamped("/backfill", record.seq, first_ns, _map(record))


def record_of(frame: bytes) -> Record:
    """Decode a record from the log channel."""
    record = decode(frame)
    if not isinstance(record, Record):
        raise WireError(f"a {type(record).__name__} is not a record")
    if isinstance(record, BackfillRecord) and len(record.rows) % RENDERED.itemsize:
        raise WireError(f"BackfillRecord {record.seq}: not made of whole rows")
    return record


def block_config(record: Record) -> str:
    """Return the configuration of the block that begins with this record, or an empty string if none does."""
    return record.details.get("config", "") if isinstance(record, EventRecord) and record.name == BLOCK_BEGAN else ""


NOT_EXACT = "not_bit_exact"
"""Log message of a recording from a table of ticks that differs from a recording's: where and how."""


def remark(seq: int, name: str, details: dict[str, str], log_time_ns: int) -> Stamped:
    """Make a message of the ``/logger`` channel."""
    return Stamped("/logger", seq, log_time_ns, _map(EventRecord(seq, -1, log_time_ns, name, details)))
