"""A session as Lab Streaming Layer (LSL) streams: their names, channels and descriptions.

The live LSL outlet and the XDF export share this module, so both produce the same streams. Every tick is a sample of
64-bit floats, bit for bit as in the recording; integers are exact in float64. The time stamp is the record's own server
time [s]. This module is independent of the LSL library and the file format.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from numpy.typing import NDArray

from netboard.network.protocol.records import EventRecord
from netboard.recording.format.channels import CHANNELS, Field

NUMBERS, TEXT = "double64", "string"
"""LSL names of the value types."""

RATE_HZ = 1000.0
"""Nominal rate of the regular stream: one sample per tick [Hz]."""

_SIDE = (
    *("x", "y", "sent_z", "sent_vz", "used_z", "used_vz"),
    *("coupling", "force", "rendered", "live", "safeguards", "buttons"),
)

COLUMNS = (
    *("tick", "phase", "target", "trial", "attempt"),
    *("z", "vz", "theta", "omega", "p", "vp"),
    *(f"{side}_{name}" for side in ("left", "right") for name in _SIDE),
)
"""Tick fields in the stream, by their names in a recording."""

_TYPES = {"m": "Position", "m/s": "Velocity", "rad": "Angle", "rad/s": "AngularVelocity", "N": "Force", "1": "Misc"}
"""LSL channel type by unit."""

_TICK_FIELDS = {field.name: field for field in CHANNELS[0].columns}


@dataclass(frozen=True, slots=True)
class Stream:
    """Definition of one stream."""

    name: str
    type: str
    rate_hz: float  # nominal sample rate; 0 for an irregular stream
    format: str
    text: str
    channels: tuple[Field, ...]


TICKS = Stream(
    "ticks",
    "Haptics",
    RATE_HZ,
    NUMBERS,
    "board, hands and forces at every tick of 1 ms; stamp: nominal time of the tick",
    tuple(_TICK_FIELDS[name] for name in COLUMNS),
)

MARKERS = Stream(
    "markers",
    "Markers",
    0.0,
    TEXT,
    "names of the events; stamp: time of the event",
    (Field("event", "string", "what happened, in snake case", ""),),
)

EVENTS = Stream(
    "events",
    "Events",
    0.0,
    TEXT,
    "the same events in full, each a JSON object with seq, tick, name and details; stamp: time of the event",
    (Field("event", "string", "JSON object: seq, tick, name, details", ""),),
)

STREAMS = (TICKS, MARKERS, EVENTS)


def samples(ticks: NDArray[Any]) -> NDArray[np.float64]:
    """Convert ticks to samples."""
    values = np.empty((len(ticks), len(COLUMNS)))
    for place, name in enumerate(COLUMNS):
        values[:, place] = ticks[name]
    return values


def event_text(event: EventRecord) -> str:
    """Format an event as a sample of `EVENTS`."""
    return remark_text(event.name, event.details, event.seq, event.tick)


def remark_text(name: str, details: Mapping[str, str], seq: int = -1, tick: int = -1) -> str:
    """Format an event of the server, or of the stream itself (without number and tick), as a sample of `EVENTS`."""
    event = {"seq": seq, "tick": tick, "name": name, "details": dict(details)}
    return json.dumps(event, ensure_ascii=False, separators=(",", ":"))


def seconds(times_ns: NDArray[np.int64]) -> NDArray[np.float64]:
    """Convert to LSL time stamps [s], rounding once."""
    return np.asarray(times_ns, np.int64) / 1e9


def description(stream: Stream, notes: Mapping[str, Mapping[str, str]]) -> Element:
    """Return the ``desc`` element of a stream's information."""
    desc = Element("desc")
    put(desc, manufacturer="netboard", description=stream.text, netboard=version("netboard"))
    channels = SubElement(desc, "channels")
    for field in stream.channels:
        channel = SubElement(channels, "channel")
        put(channel, label=field.name)
        if field.unit:
            put(channel, unit=field.unit)
        put(channel, type=_TYPES[field.unit] if field.unit else "Marker", description=field.text)
    for name, values in notes.items():
        put(SubElement(desc, name), **values)
    return desc


def put(to: Element, /, **values: str) -> None:
    """Add elements with texts, by tag."""
    for name, value in values.items():
        SubElement(to, name).text = value
