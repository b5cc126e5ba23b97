"""A finished recording as an MCAP file: index, checksums, chunks, metadata and attachments.

Opening a file reads only its index; chunks are read on demand. An hour of ticks has 18 000 chunks, and a reader who
wants one trial needs only a few. A damaged file raises a `RecordingError` that says what is wrong and what to do. This
module knows MCAP; it does not know ticks or sessions.
"""

import os
import struct
import zlib
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from io import SEEK_END, BytesIO
from pathlib import Path
from threading import Lock
from typing import NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)

from netboard.base.errors import RecordingError, unreadable
from netboard.recording.files.locate import EMPTY, recovery_advice, require_file
from netboard.recording.format.chunks import MAGIC, RECORD_HEAD, UNSOUND, unpack_chunk
from netboard.recording.format.claims import (
    MAX_CHUNK_BYTES,
    MAX_RECORD_BYTES,
    MAX_STAMP_NS,
    MetadataRecord,
    require_chunk,
    shown,
)

_FOOTER = struct.Struct("<BQQQI")
_DATA_END = struct.Struct("<BQI")
# An entry of the index: times, offset, length and size of its list of channels; a channel and where its messages are
# listed; the length of these lists and of the name of the compression; compressed and uncompressed size.
_ENTRY_HEAD, _ENTRY_CHANNEL = struct.Struct("<QQQQI"), struct.Struct("<HQ")
_ENTRY_NAME, _ENTRY_SIZES = struct.Struct("<QI"), struct.Struct("<QQ")
_MAX_BYTES: dict[int, int] = {
    Opcode.HEADER: MAX_RECORD_BYTES,
    Opcode.METADATA: MAX_RECORD_BYTES,
    Opcode.ATTACHMENT: MAX_RECORD_BYTES,
    Opcode.CHUNK: MAX_CHUNK_BYTES + MAX_RECORD_BYTES,  # data that do not compress are a little larger then
}
"""Largest size of the records that the index names, by kind [bytes]."""
_NOT_IN_INDEX = frozenset((Opcode.HEADER, Opcode.CHUNK, Opcode.DATA_END, Opcode.FOOTER))


class ChunkEntry(NamedTuple):
    """What the index says of a chunk; ``channels``: those with messages in it, empty if it does not say."""

    message_start_time: int
    message_end_time: int
    chunk_start_offset: int
    chunk_length: int
    channels: tuple[int, ...]
    compressed_size: int
    uncompressed_size: int

    @classmethod
    def read(cls, body: bytes) -> "ChunkEntry":
        """Parse an entry; the upstream library makes a Python object of each number, which takes much longer."""
        start, end, offset, length, size = _ENTRY_HEAD.unpack_from(body)
        after = _ENTRY_HEAD.size + size
        channels = tuple(number for number, _ in _ENTRY_CHANNEL.iter_unpack(body[_ENTRY_HEAD.size : after]))
        _, name = _ENTRY_NAME.unpack_from(body, after)
        sizes = _ENTRY_SIZES.unpack_from(body, after + _ENTRY_NAME.size + name)
        return cls(start, end, offset, length, channels, *sizes)


class Container:
    """A finished MCAP file, open for reading by any number of threads."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock = Lock()
        require_file(path)
        try:
            self._file = path.open("rb")
        except OSError as error:
            raise unreadable(path, error) from error
        try:
            self._open()
        except BaseException:
            self._file.close()
            raise

    def _open(self) -> None:
        self._check_ends()
        with self.sound():
            # Check this first: every offset and length below comes from the index.
            start, stop = self._check_index()
            self._index: dict[int, list[bytes]] = {}
            for opcode, body in _walk(self._read(start, stop - start)):
                self._index.setdefault(opcode, []).append(body)
            if _NOT_IN_INDEX & self._index.keys():
                raise RecordingError("another file begins in its index")
            self.profile = Header.read(_stream(self._record(len(MAGIC), Opcode.HEADER))).profile
            listed = [MetadataIndex.read(_stream(body)) for body in self._index.get(Opcode.METADATA_INDEX, ())]
            places = dict.fromkeys(at.offset for at in listed)
            named = [Metadata.read(_stream(self._record(at, Opcode.METADATA))) for at in places]
            _require_once([record.name for record in named], "metadata")
        self.metadata: dict[str, dict[str, str]] = {
            record.name: MetadataRecord(record.name, record.metadata) for record in named
        }

    def _check_ends(self) -> None:
        """Raise an error for a file that is not a recording, or not a finished one."""
        size = self._file.seek(0, SEEK_END)
        if not size:
            raise RecordingError(f"{self.path}: {EMPTY}")
        if self._read(0, len(MAGIC)) != MAGIC:
            raise RecordingError(f"{self.path}: not an MCAP file")
        end = self._read(max(size - len(MAGIC), len(MAGIC)), len(MAGIC))
        if self.path.suffix == ".part" or end != MAGIC:
            what = "is unfinished or cut short, or has other bytes after its end"
            raise RecordingError(f"{self.path}: {what}; {recovery_advice(self.path)}")

    @contextmanager
    def sound(self) -> Iterator[None]:
        """Convert the exceptions that a damaged file causes into a `RecordingError` that names the file."""
        try:
            yield
        except (*UNSOUND, ValueError, RecordingError, OSError) as error:
            if isinstance(error, RecordingError) and str(error).startswith(f"{self.path}: "):
                raise  # it names the file already
            reason = str(error) or type(error).__name__
            raise RecordingError(f"{self.path}: is damaged ({reason}); {recovery_advice(self.path)}") from error

    def _read(self, offset: int, length: int) -> bytes:
        with self._lock:
            self._file.seek(offset)
            return self._file.read(length)

    def _record(self, offset: int, opcode: int) -> bytes:
        """Return the content of the record of a kind at an offset that the index names."""
        found, length = RECORD_HEAD.unpack(self._read(offset, RECORD_HEAD.size))
        if found != opcode:
            raise RecordingError(f"its index names a record at {offset} that is not there")
        if length > os.fstat(self._file.fileno()).st_size:  # reading it would fill the memory first
            raise RecordingError("a record is longer than the file")
        if length > _MAX_BYTES[opcode]:
            raise RecordingError(f"a record of {length} bytes at {offset}, expected at most {_MAX_BYTES[opcode]}")
        return self._read(offset + RECORD_HEAD.size, length)

    @cached_property
    def channels(self) -> dict[str, int]:
        """Channel id by topic. Other MCAP tools may renumber the channels [1]."""
        found = {channel.topic: channel.id for channel in self._channel_records}
        if len(set(found.values())) != len(self._channel_records):
            raise RecordingError(f"{self.path}: its index lists two channels of one topic or number")
        return found

    @cached_property
    def schemas(self) -> dict[str, bytes]:
        """Schema by topic."""
        with self.sound():
            found = [Schema.read(_stream(body)) for body in self._index.get(Opcode.SCHEMA, ())]
        data = {schema.id: schema.data for schema in found}
        return {channel.topic: data.get(channel.schema_id, b"") for channel in self._channel_records}

    @cached_property
    def _channel_records(self) -> list[Channel]:
        with self.sound():
            return [Channel.read(_stream(body)) for body in self._index.get(Opcode.CHANNEL, ())]

    @cached_property
    def counts(self) -> dict[str, int]:
        """Number of messages by topic [1]."""
        by_channel: dict[int, int] = {}
        with self.sound():
            for body in self._index.get(Opcode.STATISTICS, ()):
                by_channel = Statistics.read(_stream(body)).channel_message_counts
        return {topic: by_channel.get(number, 0) for topic, number in self.channels.items()}

    def attachment(self, name: str) -> bytes | None:
        """Return the attachment with this name, or None if there is none."""
        with self.sound():
            found = [AttachmentIndex.read(_stream(index)) for index in self._index.get(Opcode.ATTACHMENT_INDEX, ())]
            _require_once([at.name for at in found], "attachment")
            for at in found:
                if at.name == name:
                    body = self._record(at.offset, Opcode.ATTACHMENT)
                    (crc,) = struct.unpack("<I", body[-4:])
                    if crc and zlib.crc32(body[:-4]) != crc:
                        raise RecordingError(f"the checksum of its {name} is wrong")
                    stored = Attachment.read(_stream(body))
                    if stored.name != name or len(stored.data) != at.data_size:
                        raise RecordingError(f"its index contradicts its {name}")
                    return bytes(stored.data)
        return None

    def chunk(self, offset: int) -> bytes:
        """Read the chunk at a file offset, verify its checksum and return its records."""
        with self.sound():
            return unpack_chunk(self._record(offset, Opcode.CHUNK))

    def chunks_with(self, topic: str) -> list[int]:
        """Return the offsets of the chunks with messages on a topic, in file order."""
        number = self.channels.get(topic)
        if number is None or self.counts.get(topic, 1) == 0:
            return []  # parsing the index of an hour takes 0.1 s
        return [
            index.chunk_start_offset for index in self.chunk_indexes if not index.channels or number in index.channels
        ]

    @cached_property
    def chunk_indexes(self) -> list[ChunkEntry]:
        """The entries of the index for the chunks, in file order; no two chunks share a byte."""
        with self.sound():
            found = [ChunkEntry.read(body) for body in self._index.get(Opcode.CHUNK_INDEX, ())]
            found.sort(key=lambda chunk: chunk.chunk_start_offset)
            starts = [chunk.chunk_start_offset for chunk in found] + [os.fstat(self._file.fileno()).st_size]
            for chunk, following in zip(found, starts[1:], strict=True):
                if chunk.chunk_start_offset + chunk.chunk_length > following:
                    raise RecordingError("its index lists chunks that overlap")
                require_chunk(chunk.uncompressed_size, min(chunk.compressed_size, chunk.chunk_length))
                if max(chunk.message_start_time, chunk.message_end_time) > MAX_STAMP_NS:
                    raise RecordingError("its index has a time stamp beyond the year 2262")
        return found

    def require_index(self) -> None:
        """Raise an error if the index lacks the entries that locate messages; the file would seem to have none."""
        with self.sound():
            statistics = self._index.get(Opcode.STATISTICS)
            if not statistics:
                raise RecordingError("its index has no statistics")
            needed = (Opcode.CHANNEL, Opcode.CHUNK_INDEX)
            if Statistics.read(_stream(statistics[0])).message_count and not all(one in self._index for one in needed):
                raise RecordingError("its index lists no channels or no chunks")

    def check(self) -> None:
        """Verify the checksum of the whole file, metadata included, if its writer stored one."""
        with self.sound():
            data_end = self._check_index()[0] - _DATA_END.size
            opcode, length, crc = _DATA_END.unpack(self._read(data_end, _DATA_END.size))
            if (opcode, length) != (Opcode.DATA_END, 4) or (crc and self._crc(0, data_end) != crc):
                raise RecordingError("the checksum of the file is wrong")

    def _check_index(self) -> tuple[int, int]:
        """Verify the checksum of the index, if its writer stored one, and return its start and end offsets."""
        end = self._file.seek(0, SEEK_END) - len(MAGIC)
        footer = max(0, end - _FOOTER.size)
        opcode, length, start, _, crc = _FOOTER.unpack(self._read(footer, _FOOTER.size))
        if (opcode, length) != (Opcode.FOOTER, 20) or (crc and self._crc(start, end - 4) != crc):
            raise RecordingError("the checksum of its index is wrong")
        if not start:
            raise RecordingError("it has no index")
        if start > footer:
            raise RecordingError("its index begins after its end")
        return int(start), footer

    def _crc(self, start: int, stop: int) -> int:
        crc = 0
        while start < stop and (block := self._read(start, min(stop - start, 2**20))):
            crc = zlib.crc32(block, crc)
            start += len(block)
        return crc

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def _require_once(names: Sequence[str], what: str) -> None:
    """Refuse records of which two have the same name, as those of two recordings."""
    for name, count in Counter(names).items():
        if count > 1:
            raise RecordingError(f"it has {count} records of {what} {shown(name)}")


def _stream(body: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(body))


def _walk(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of each record."""
    position = 0
    while position < len(data):
        opcode, length = RECORD_HEAD.unpack_from(data, position)
        position += RECORD_HEAD.size + length
        yield opcode, data[position - length : position]
