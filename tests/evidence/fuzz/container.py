"""A recording as records of MCAP, to be changed and written again with right lengths, checksums and index."""

import struct
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    McapRecord,
    Message,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)
from mcap.stream_reader import StreamReader, breakup_chunk

from netboard.recording.files.provenance import CONFIG_NAME, MetadataName, config_sha256
from netboard.recording.format.batches import PLACES, PLACES_NAME
from netboard.recording.format.chunks import MAGIC

Lie = Callable[[Any], McapRecord]


@dataclass
class Inside:
    """A chunk: its messages, or what is `stored` in place of them."""

    records: list[Message]
    stored: Chunk | None = None

    def chunk(self, lie: Lie) -> Chunk:
        """Return the chunk, its messages after a lie."""
        if self.stored is not None:
            return self.stored
        data = b"".join(bytes_of(lie(one)) for one in self.records)
        times = [one.log_time for one in self.records] or [0]
        return Chunk("zstd", zstandard.compress(data), max(times), min(times), zlib.crc32(data), len(data))


@dataclass
class Container:
    """The content of a recording; ``places`` has numbers of chunks instead of offsets."""

    records: list[Any] = field(default_factory=list)
    summary: list[McapRecord] = field(default_factory=list)
    places: list[list[int]] = field(default_factory=list)
    repeat: dict[type, int] = field(default_factory=dict)  # how often entries of the index are written, if not once

    @classmethod
    def read(cls, path: Path) -> "Container":
        """Take a recording apart."""
        found, rows = cls(), np.empty(0, PLACES)
        with path.open("rb") as file:
            for record in StreamReader(file, emit_chunks=True).records:
                match record:
                    case DataEnd():
                        break
                    case Chunk():
                        found.records.append(Inside([m for m in breakup_chunk(record) if isinstance(m, Message)]))
                    case Attachment(name=name) if name == PLACES_NAME:
                        rows = np.frombuffer(record.data, PLACES)
                        found.records.append(record)
                    case McapRecord() if not type(record).__name__.endswith("Index"):
                        found.records.append(record)
            found.summary = [
                one
                for one in StreamReader(file, skip_magic=True).records
                if isinstance(one, (Schema, Channel, Statistics))
            ]
        offsets = {offset: number for number, offset in enumerate(np.unique(rows["chunk"]).tolist())}
        with_ticks = [number for number, chunk in enumerate(found.chunks) if found.of("/ticks", [chunk])]
        found.places = [[with_ticks[offsets[row[0]]], *row[1:]] for row in rows.tolist()]
        return found

    @property
    def chunks(self) -> list[Inside]:
        """The chunks, in order."""
        return [one for one in self.records if isinstance(one, Inside)]

    def of(self, topic: str, chunks: Iterable[Inside] | None = None) -> list[Message]:
        """Return the messages of a channel."""
        number = self.channel(topic)
        return [m for chunk in (chunks or self.chunks) for m in chunk.records if m.channel_id == number]

    def channel(self, topic: str) -> int:
        """Return the number of a channel."""
        return next(one.id for one in self.summary if isinstance(one, Channel) and one.topic == topic)

    def attachment(self, name: str) -> Attachment:
        """Return an attachment."""
        return next(one for one in self.records if isinstance(one, Attachment) and one.name == name)

    def metadata(self, name: str) -> dict[str, str]:
        """Return the values of a metadata record."""
        return next(one.metadata for one in self.records if isinstance(one, Metadata) and one.name == name)

    def assembled(self, lie: Lie = lambda record: record) -> bytes:
        """Write the recording; each record goes through a lie, and checksums fit what it says then."""
        data, index, offsets = bytearray(MAGIC), list[McapRecord](), list[int]()
        for one in self.records:
            at = len(data)
            if isinstance(one, Inside):
                offsets.append(at)
            record = lie(self._record(one, offsets, lie))
            data += bytes_of(record)
            entries = list(_entry(record, at, len(data) - at))
            index += [entry for entry in entries for _ in range(self.repeat.get(type(entry), 1))]
        data += bytes_of(lie(DataEnd(zlib.crc32(data))))
        start = len(data)
        data += b"".join(bytes_of(lie(self._counted(one))) for one in [*self.summary, *index])
        footer = bytes_of(lie(Footer(start, 0, 0)))[:-4]
        return bytes(data + footer + struct.pack("<I", zlib.crc32(data[start:] + footer)) + MAGIC)

    def _record(self, one: McapRecord | Inside, offsets: list[int], lie: Lie) -> McapRecord:
        """Return a chunk, or another record, as it is written; the list of places has the offsets of the chunks."""
        if isinstance(one, Inside):
            return one.chunk(lie)
        if isinstance(one, Attachment) and one.name == PLACES_NAME and not one.data.startswith(b"!"):
            return replace(one, data=self._moved_places(offsets))
        return one

    def _moved_places(self, offsets: list[int]) -> bytes:
        rows = [(offsets[row[0]] if 0 <= row[0] < len(offsets) else row[0], *row[1:]) for row in self.places]
        return b"".join(struct.pack("<4q", *(max(-(2**63), min(2**63 - 1, value)) for value in row)) for row in rows)

    def _counted(self, record: McapRecord) -> McapRecord:
        """Return a record of the summary; the statistics count what is there."""
        if not isinstance(record, Statistics):
            return record
        numbers = [one.channel_id for chunk in self.chunks for one in chunk.records]
        counts = {number: numbers.count(number) for number in sorted(set(numbers))}
        return replace(record, message_count=len(numbers), channel_message_counts=counts, chunk_count=len(self.chunks))

    def set_config(self, text: bytes) -> None:
        """Exchange the configuration; its checksum fits."""
        self.attachment(CONFIG_NAME).data = text
        self.metadata(MetadataName.OPENED)["config_sha256"] = config_sha256(text)


def _entry(record: McapRecord, at: int, size: int) -> Iterator[McapRecord]:
    """Yield the entry of a record in the index."""
    match record:
        case Metadata():
            yield MetadataIndex(at, size, record.name)
        case Attachment():
            yield AttachmentIndex(
                at, size, record.log_time, record.create_time, len(record.data), record.name, record.media_type
            )
        case Chunk():
            yield ChunkIndex(
                size,
                at,
                record.compression,
                len(record.data),
                record.message_end_time,
                0,
                {},
                record.message_start_time,
                record.uncompressed_size,
            )


def bytes_of(record: McapRecord) -> bytes:
    """Return a record as bytes; a number that has no room is cut to the bits that have."""
    for bits in (64, 32, 16):
        builder = RecordBuilder()
        try:
            _within(record, bits).write(builder)
        except struct.error:
            continue
        return bytes(builder.end())  # type: ignore[no-untyped-call]
    raise ValueError(f"{record} cannot be written")


def _within(record: McapRecord, bits: int) -> McapRecord:
    numbers = {name: value % 2**bits for name, value in vars(record).items() if isinstance(value, int)}
    return replace(record, **numbers) if bits < 64 or any(value < 0 for value in numbers.values()) else record


def unpacked(message: Message) -> Any:
    """Return a message as values."""
    return msgpack.unpackb(message.data) if not message.data.startswith(b"{") else {}
