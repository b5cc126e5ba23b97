"""A recording to be damaged: its bytes, and the ticks in each of its chunks, read with the upstream library.

The expected result after damage follows from this alone, independently of the code that recovers.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.reader import make_reader
from mcap.records import Chunk, Message
from mcap.stream_reader import breakup_chunk
from numpy.typing import NDArray

from netboard.base.config import Config, resolve
from netboard.base.tick import TICK_NS
from netboard.benchmarks.recording.movement import FIRST_MOVEMENT, record
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.records import EventRecord, TickRecord
from netboard.recording.files.provenance import provenance
from netboard.recording.files.writer import RecordingWriter
from netboard.recording.format.channels import IDS

OPENED_NS = 1_790_000_000_000_000_000
SESSION = "5afe5afe5afe5afe"


@dataclass(frozen=True)
class Piece:
    """A chunk of a file.

    - `ticks`: its first tick, and the one after its last; both 0 without ticks [1].
    """

    start: int
    stop: int
    ticks: tuple[int, int]


@dataclass(frozen=True)
class Specimen:
    """A whole recording of ticks 0, 1, 2..."""

    data: bytes
    rows: NDArray[Any]
    pieces: tuple[Piece, ...]


def movement(count: int) -> NDArray[Any]:
    """Ticks of a board that two simulated hands move, numbered from 0."""
    rows = record(Config(), FIRST_MOVEMENT, count)
    rows["tick"] = np.arange(count)
    rows["time_ns"] = 10**12 + np.arange(count) * TICK_NS
    return rows


def open_writer(path: Path, config: Config) -> RecordingWriter:
    """Begin a recording as a logger does."""
    welcome = Welcome(SESSION, 1, 10**12, resolve(config))
    metadata = provenance(welcome, config, 1, OPENED_NS, 0)
    return RecordingWriter(path, metadata, welcome.config, config.recording, OPENED_NS)


def make_specimen(path: Path, count: int) -> Specimen:
    """Write a recording as a logger does, with its flushes."""
    rows = movement(count)
    writer = open_writer(path, Config())
    now, number = OPENED_NS, 0
    for row in rows:
        now += TICK_NS
        writer.write(TickRecord(row.tobytes()), number, now)
        number += 1
        if row["tick"] % 50 == 0:
            event = EventRecord(number, int(row["tick"]), int(row["time_ns"]), "fiftieth", {"tick": str(row["tick"])})
            writer.write(event, number, now)
            number += 1
        if writer.is_due(now):
            writer.flush(now)
    writer.finish(now)
    return Specimen(path.read_bytes(), rows, _pieces(path))


def _pieces(path: Path) -> tuple[Piece, ...]:
    """Return the chunks of a file and their ticks."""
    found = []
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
        for index in sorted(summary.chunk_indexes, key=lambda index: index.chunk_start_offset):
            file.seek(index.chunk_start_offset + 9)
            inside = breakup_chunk(Chunk.read(ReadDataStream(file)), validate_crc=True)
            batches = [
                msgpack.unpackb(one.data)
                for one in inside
                if isinstance(one, Message) and one.channel_id == IDS["/ticks"]
            ]
            first = batches[0]["first"] if batches else 0
            ticks = (first, first + sum(batch["count"] for batch in batches))
            found.append(Piece(index.chunk_start_offset, index.chunk_start_offset + index.chunk_length, ticks))
    return tuple(found)
