"""XDF 1.0 export, as LabRecorder would write it from the streams of `netboard lsl`.

Each recording gives a file with the same streams: same names, channels, values and time stamps, bit for bit. The
imaginary recorder ran on the server's computer, so its clock offsets to the streams are zero. Every sample has its own
time stamp; lost ticks are a gap. At most a few seconds of a recording are in memory. The format:
https://github.com/sccn/xdf/wiki/Specifications
"""

import struct
import uuid
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
from numpy.typing import NDArray

from netboard.network.protocol.records import EventRecord
from netboard.recording.export.factors import design_note
from netboard.recording.export.formats import Progress, reporting
from netboard.recording.export.lsl_streams import (
    COLUMNS,
    EVENTS,
    MARKERS,
    STREAMS,
    TICKS,
    Stream,
    description,
    event_text,
    put,
    samples,
    seconds,
)
from netboard.recording.export.trigger_pulses import onset_ns
from netboard.recording.files.reader import Recording

MAGIC = b"XDF:"

FILE_HEADER, STREAM_HEADER, SAMPLES, CLOCK_OFFSET, BOUNDARY, STREAM_FOOTER = range(1, 7)
"""Chunk tags."""

BOUNDARY_MARK = bytes.fromhex("43a546dccbf5410fb30ed5467383cbe4")
"""Marker by which a reader resynchronises in a damaged file."""

PORTION = 5000
"""Approximate ticks per batch; after each follows a clock offset, as in LabRecorder every 5 s [1]."""

CHUNK = 500
"""Samples per chunk, as in LabRecorder every 0.5 s [1]."""

BOUNDARY_PORTIONS = 2
"""Batches between boundary chunks, as in LabRecorder every 10 s [1]."""

_SAMPLE = np.dtype([("stamped", "u1"), ("stamp", "<f8"), ("values", "<f8", (len(COLUMNS),))])
"""Binary layout of a tick sample."""

_STAMPED = 8
"""Length of a time stamp, written before it [bytes]."""

_NAMES = uuid.UUID("5e4c0b9e-3f0b-4a51-8f0c-6f2d6b1f6a55")
"""Namespace of the stream ids, which are derived from the session id."""


@dataclass
class _Written:
    """Content of a stream's footer."""

    count: int = 0
    first: float = 0.0
    last: float = 0.0

    def add(self, stamps: NDArray[np.float64]) -> None:
        """Count samples that have been written."""
        if not self.count:
            self.first = float(stamps[0])
        self.last = float(stamps[-1])
        self.count += len(stamps)


class _Writer:
    """Writer of the chunks of one file."""

    def __init__(self, file: BinaryIO, recording: Recording) -> None:
        self._file = file
        self._written = {stream.name: _Written() for stream in STREAMS}
        self._offsets: list[float] = []
        file.write(MAGIC)
        header = Element("info")
        put(header, version="1.0", datetime=recording.metadata.get("opened_utc", ""))
        self._chunk(FILE_HEADER, _xml(header))
        design = design_note(recording.config)
        for number, stream in enumerate(STREAMS, start=1):
            self._chunk(STREAM_HEADER, _xml(_information(stream, recording.metadata, design)), number)

    def ticks(self, ticks: NDArray[Any]) -> None:
        """Write ticks."""
        rows = np.empty(len(ticks), _SAMPLE)
        rows["stamped"] = _STAMPED
        rows["stamp"] = seconds(ticks["time_ns"])
        rows["values"] = samples(ticks)
        for start in range(0, len(rows), CHUNK):
            part = rows[start : start + CHUNK]
            self._chunk(SAMPLES, _length(len(part)) + part.tobytes(), _number(TICKS))
        self._written[TICKS.name].add(rows["stamp"])

    def events(self, events: Sequence[EventRecord]) -> None:
        """Write events, one chunk per event and stream."""
        for event in events:
            stamp = seconds(np.array([onset_ns(event)]))
            for stream, text in ((MARKERS, event.name), (EVENTS, event_text(event))):
                data = text.encode()
                sample = bytes([_STAMPED]) + stamp.astype("<f8").tobytes() + _length(len(data)) + data
                self._chunk(SAMPLES, _length(1) + sample, _number(stream))
                self._written[stream.name].add(stamp)

    def clock_offset(self, at: float) -> None:
        """Write a clock offset of zero for each stream."""
        self._offsets.append(at)
        for stream in STREAMS:
            self._chunk(CLOCK_OFFSET, struct.pack("<dd", at, 0.0), _number(stream))

    def boundary(self) -> None:
        """Write a boundary marker."""
        self._chunk(BOUNDARY, BOUNDARY_MARK)

    def footers(self) -> None:
        """Write the footers of all streams."""
        for stream in STREAMS:
            written = self._written[stream.name]
            footer = Element("info")
            put(footer, first_timestamp=repr(written.first), last_timestamp=repr(written.last))
            put(footer, sample_count=str(written.count))
            offsets = SubElement(footer, "clock_offsets")
            for at in self._offsets:
                put(SubElement(offsets, "offset"), time=repr(at), value="0")
            self._chunk(STREAM_FOOTER, _xml(footer), _number(stream))

    def _chunk(self, tag: int, content: bytes, stream: int | None = None) -> None:
        head = struct.pack("<H", tag) if stream is None else struct.pack("<HI", tag, stream)
        self._file.write(_length(len(head) + len(content)) + head + content)


def write(recordings: Sequence[Path], folder: Path, progress: Progress) -> None:
    """Write recordings as XDF files."""
    for path in recordings:
        with Recording(path) as recording, (folder / f"{path.stem}.xdf").open("xb") as file:
            _write_one(recording, file, progress)


def _write_one(recording: Recording, file: BinaryIO, progress: Progress) -> None:
    """Write the ticks and events of a recording in order, with the chunks that a recorder adds in between."""
    writer = _Writer(file, recording)
    events = recording.events()
    portions = reporting(recording.batches(PORTION), recording.path.name, recording.counts["/ticks"], progress)
    written = 0
    for place, ticks in enumerate(portions):
        if place == 0:
            writer.clock_offset(float(seconds(ticks["time_ns"][0])))
        writer.ticks(ticks)
        until_ns = int(ticks["time_ns"][-1])
        following = bisect_right(events, until_ns, written, key=lambda event: event.time_ns)
        writer.events(events[written:following])
        written = following
        writer.clock_offset(float(seconds(ticks["time_ns"][-1])))
        if place % BOUNDARY_PORTIONS == BOUNDARY_PORTIONS - 1:
            writer.boundary()
    writer.events(events[written:])
    writer.boundary()
    writer.footers()


def _information(stream: Stream, metadata: dict[str, str], design: dict[str, str]) -> Element:
    """Return the LSL information of a stream, as far as the recording has it."""
    session = metadata.get("session", "")
    info = Element("info")
    put(
        info,
        name=f"netboard.{stream.name}",
        type=stream.type,
        channel_count=str(len(stream.channels)),
        channel_format=stream.format,
        source_id=f"netboard.{stream.name}@{session}",
        nominal_srate=f"{stream.rate_hz:.12f}",
        version="1.100000000000000",
        uid=str(uuid.uuid5(_NAMES, f"{session}.{stream.name}")),
        session_id="default",
    )
    keys = ("session", "name", "dyad", "study", "block", "blocks", "part", "config_sha256", "opened_utc")
    notes = {
        "clock": {"source": "the server's monotonic clock"},
        "recording": {key: metadata[key] for key in keys if key in metadata},
        "design": design,
    }
    info.append(description(stream, notes))
    return info


def _number(stream: Stream) -> int:
    return STREAMS.index(stream) + 1


def _xml(element: Element) -> bytes:
    indent(element)
    return b'<?xml version="1.0"?>\n' + tostring(element, encoding="unicode").encode()


def _length(count: int) -> bytes:
    """Encode a variable-length integer of the XDF format."""
    if count < 2**8:
        return struct.pack("<BB", 1, count)
    if count < 2**32:
        return struct.pack("<BI", 4, count)
    return struct.pack("<BQ", 8, count)
