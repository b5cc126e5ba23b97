"""Recovers an unfinished or damaged recording into a new file; the source is never changed.

Chunks are found by their signature and accepted by their checksum, so a destroyed length or record costs at most its
own chunk. Data between two valid chunks that are not complete records are reported as damage.
"""

import mmap
import os
import re
import struct
import zlib
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Header, Metadata
from numpy.typing import NDArray

from netboard.base.config import parse
from netboard.base.errors import ConfigError, RecordingError
from netboard.base.tick import TICK
from netboard.network.protocol.records import EventRecord
from netboard.recording.files.locate import EMPTY, recovered_path, require_file
from netboard.recording.files.provenance import CONFIG_NAME, LIBRARY, MetadataName, config_sha256, damaged_numbers
from netboard.recording.format import older
from netboard.recording.format.batches import Layout, TickStream
from netboard.recording.format.channels import CHANNELS, FORMAT_VERSION, IDS, TICKS, Stamped, block_config, read_record
from netboard.recording.format.chunks import (
    MAGIC,
    RECORD_HEAD,
    UNSOUND,
    Entry,
    has_right_length,
    messages,
    unpack_chunk,
)
from netboard.recording.format.claims import MAX_RECORD_BYTES, SearchEffort, whole_number
from netboard.recording.format.disk import lock
from netboard.recording.format.partfile import PartFile
from netboard.recording.format.predictions import UNKNOWN, constants_of
from netboard.recording.format.summary import Gap, find_gaps


def _stored(name: str) -> bytes:
    """Return a name as MCAP stores it: after its length."""
    return struct.pack("<I", len(name)) + name.encode()


_SIGNATURE = struct.pack("<I", 4) + b"zstd"
_TO_SIGNATURE = RECORD_HEAD.size + 8 + 8 + 8 + 4  # MCAP: start and end time, size and CRC of a chunk come before
_COPIED_METADATA = (MetadataName.OPENED, MetadataName.FIRST, MetadataName.END, MetadataName.RECOVERY)
_RECOVERABLE = ("2", "3", FORMAT_VERSION)
_CHUNK_BYTES = 2**18

_NAMED = re.compile(b"|".join(re.escape(_stored(name)) for name in (*MetadataName, CONFIG_NAME)))
"""Names, as stored, of the records outside chunks with which reading continues after damage."""

_NAMED_RECORDS = ((Opcode.METADATA, RECORD_HEAD.size), (Opcode.ATTACHMENT, RECORD_HEAD.size + 16))
"""Their opcodes, and the place of the name in each."""

_TOPICS = {number: topic for topic, number in IDS.items()}
_COPIED = frozenset(IDS) - {TICKS, "/plot"}  # `TickStream` writes both anew
_LAYOUT, _LAYOUT_3 = Layout(CHANNELS[0].schema()), Layout(older.schema_3())


class Span(NamedTuple):
    """A range of bytes in a file."""

    start: int
    stop: int


@dataclass(frozen=True, slots=True)
class Damage:
    """An unusable part of a file."""

    offset: int
    length: int
    reason: str


@dataclass(frozen=True, slots=True)
class RecoveryReport:
    """What was recovered from a file, and what was not."""

    source: Path
    output: Path
    chunks: int
    messages: dict[str, int]
    first_tick: int | None
    last_tick: int | None
    missing: tuple[Gap, ...]
    damage: tuple[Damage, ...]
    finished: bool
    has_config: bool

    @property
    def lost_bytes(self) -> int:
        """Number of unusable bytes [1]."""
        return sum(damage.length for damage in self.damage)


def require_finished(path: Path) -> None:
    """Refuse a file that is being written: a copy of its beginning would later pass for the whole recording."""
    require_file(path)
    try:
        with path.open("rb") as file:
            lock(file.fileno(), shared=True)
    except BlockingIOError:
        raise RecordingError(f"{path}: is still being written; recover it after its session has ended") from None
    except OSError:
        return  # a file system without locks, or a file that cannot be read


def recover(path: Path, output: Path | None = None) -> RecoveryReport:
    """Write a complete recording with all valid data of an unfinished or damaged one.

    Raises `ConfigError` if the output exists, and `RecordingError` if the source is not MCAP or has another format
    version, or the output cannot be written.
    """
    target = output or recovered_path(path)
    with mapped(path) as data:
        if not data:
            raise RecordingError(f"{path}: {EMPTY}")
        effort = SearchEffort(path, len(data))
        chunks = list(_find_chunks(data, effort))
        begins = data[: len(MAGIC)] == MAGIC
        if not (begins or chunks):
            raise RecordingError(f"{path}: not an MCAP file, so it cannot be recovered")
        metadata, attached, damage, finished = _survey(data, chunks, effort)
        if not begins:
            damage.insert(0, Damage(0, len(MAGIC), "not the beginning of an MCAP file"))
        found = metadata.setdefault(MetadataName.OPENED, {})
        found.setdefault("session", "unknown")
        version = found.get("format", "")
        if whole_number(version) is not None and version not in _RECOVERABLE:
            raise RecordingError(
                f"{path}: has format version {version}, this netboard recovers versions {', '.join(_RECOVERABLE)}"
            )
        # An invalid version is damage like any other.
        found["format"] = FORMAT_VERSION
        config = attached
        if attached is None or config_sha256(attached.data) != found.get("config_sha256", config_sha256(attached.data)):
            config = _config_of_event(data, chunks)
        if config is not None:
            found["config_sha256"] = config_sha256(config.data)
        recovery = recovery_metadata(path, len(data), damage, config is not None)
        if earlier := metadata.get(MetadataName.RECOVERY, {}).get("damage"):
            recovery["damage"] = "; ".join(filter(None, (earlier, recovery["damage"])))
        metadata[MetadataName.RECOVERY] = recovery
        counts, ticks = _copy(_messages(data, chunks), target, metadata, config, version)
    return RecoveryReport(
        source=path,
        output=target,
        chunks=len(chunks),
        messages={topic: counts[topic] for topic in IDS if topic != "/plot"},
        first_tick=min(ticks, default=None),
        last_tick=max(ticks, default=None),
        missing=find_gaps(np.array(ticks, np.int64)),
        damage=tuple(damage),
        finished=finished,
        has_config=config is not None,
    )


@contextmanager
def mapped(path: Path) -> "Iterator[mmap.mmap | bytes]":
    """Map a file into memory, read-only."""
    require_file(path)
    with ExitStack() as stack:
        try:
            file = stack.enter_context(path.open("rb"))
            size = os.fstat(file.fileno()).st_size
            data = stack.enter_context(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)) if size else b""
        except OSError as error:
            raise RecordingError(f"{path}: cannot be read: {error.strerror}") from error
        yield data


def _find_chunks(data: mmap.mmap | bytes, effort: SearchEffort) -> Iterator[Span]:
    """Yield every valid chunk, in order."""
    position = len(MAGIC)
    while (found := data.find(_SIGNATURE, position + _TO_SIGNATURE)) >= 0:
        start = found - _TO_SIGNATURE
        opcode, length = RECORD_HEAD.unpack_from(data, start)
        stop = start + RECORD_HEAD.size + length
        if opcode == Opcode.CHUNK and stop <= len(data) and has_right_length(data, start, stop):
            if _why_unsound(data, Span(start, stop)) is None:
                yield Span(start, stop)
                position = stop
                continue
            effort.spend(stop - start)
        position = start + 1


def _messages(data: mmap.mmap | bytes, chunks: Sequence[Span]) -> Iterator[Entry]:
    """Iterate over the messages in chunks, in file order."""
    for chunk in chunks:
        yield from messages(unpack_chunk(data[chunk.start + RECORD_HEAD.size : chunk.stop]))


def _why_unsound(data: mmap.mmap | bytes, chunk: Span) -> str | None:
    """Return why a chunk is invalid, or None if it is valid."""
    try:
        unpack_chunk(data[chunk.start + RECORD_HEAD.size : chunk.stop])
    except RecordingError as error:
        return str(error)
    return None


def _survey(
    data: mmap.mmap | bytes, chunks: Sequence[Span], effort: SearchEffort
) -> tuple[dict[str, dict[str, str]], Attachment | None, list[Damage], bool]:
    """Read the data outside chunks: metadata, configuration, damage, and whether the file was finished."""
    metadata: dict[str, dict[str, str]] = {}
    config: Attachment | None = None
    damage: list[Damage] = []
    named_places = [found.start() for found in _NAMED.finditer(data)]
    edges = [len(MAGIC), *(edge for chunk in chunks for edge in chunk), len(data)]
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        position = start
        while position < stop:
            record = _whole_record(data, Span(position, stop))
            if isinstance(record, str):
                following = _next_named(data, Span(position + 1, stop), named_places, effort)
                damage.append(Damage(position, following - position, record))
                position = following
                continue
            opcode, body = record
            if opcode == Opcode.METADATA:
                named = Metadata.read(ReadDataStream(BytesIO(body)))
                bad = damaged_numbers(named.name, named.metadata)
                metadata[named.name] = {key: value for key, value in named.metadata.items() if key not in bad}
                damage += [Damage(position, len(body), f"metadata: {key} is not a number") for key in bad]
            elif opcode == Opcode.ATTACHMENT:
                attachment = Attachment.read(ReadDataStream(BytesIO(body)))
                config = attachment if attachment.name == CONFIG_NAME else config
            elif opcode == Opcode.DATA_END:
                # The rest is the index, which is rebuilt.
                return metadata, config, damage, True
            position += RECORD_HEAD.size + len(body)
    return metadata, config, damage, False


def _next_named(data: mmap.mmap | bytes, span: Span, places: Sequence[int], effort: SearchEffort) -> int:
    """Return the start of the next whole metadata record or configuration in a span, or the end of the span.

    ``places``: where the names of such records are in the file, in order.
    """
    for place in places[bisect_left(places, span.start) : bisect_left(places, span.stop)]:
        for opcode, before in _NAMED_RECORDS:
            start = place - before
            if start >= span.start and data[start] == opcode:
                record = _whole_record(data, Span(start, span.stop))
                if not isinstance(record, str):
                    return start
                effort.spend(min(RECORD_HEAD.unpack_from(data, start)[1], MAX_RECORD_BYTES))
    return span.stop


def _config_of_event(data: mmap.mmap | bytes, chunks: Sequence[Span]) -> Attachment | None:
    """Return the copy of the configuration in the event with which the server began the block; None without one."""
    for entry in _messages(data, chunks):
        if _TOPICS.get(entry.channel_id) == "/event" and (text := block_config(read_record(EventRecord, entry.data))):
            return Attachment(entry.log_time_ns, entry.log_time_ns, CONFIG_NAME, "application/toml", text.encode())
    return None


_EXPECTED = frozenset(
    (Opcode.HEADER, Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.METADATA, Opcode.ATTACHMENT, Opcode.DATA_END)
)
_READERS = {Opcode.HEADER: Header.read, Opcode.METADATA: Metadata.read, Opcode.ATTACHMENT: Attachment.read}


def _whole_record(data: mmap.mmap | bytes, span: Span) -> tuple[int, bytes] | str:
    """Return opcode and body of the record at the start of a span, or why it is invalid."""
    if span.stop - span.start < RECORD_HEAD.size:
        return "a record cut short"
    opcode, length = RECORD_HEAD.unpack_from(data, span.start)
    stop = span.start + RECORD_HEAD.size + length
    if opcode not in _EXPECTED:
        return "not a record"
    if stop > span.stop:
        return "a chunk cut short" if opcode == Opcode.CHUNK else "a record cut short"
    if opcode in _READERS and length > MAX_RECORD_BYTES:
        return f"a damaged record: {length} bytes, expected at most {MAX_RECORD_BYTES}"
    if opcode == Opcode.CHUNK:
        return _why_unsound(data, Span(span.start, stop)) or "a damaged chunk"
    body = data[span.start + RECORD_HEAD.size : stop]
    if opcode in _READERS:
        stream = ReadDataStream(BytesIO(body))
        try:
            _READERS[opcode](stream)
        except UNSOUND as error:
            return f"a damaged record: {error}"
        if stream.count != len(body):
            return "a damaged record: wrong length"
    if opcode == Opcode.ATTACHMENT and zlib.crc32(body[:-4]) != int.from_bytes(body[-4:], "little"):
        return "a damaged record: wrong checksum"
    return opcode, body


def recovery_metadata(path: Path, size: int, damage: Sequence[Damage], has_config: bool) -> dict[str, str]:
    """Return the recovery metadata of the new file."""
    return {
        "source": os.fsencode(path.name).decode(errors="backslashreplace"),  # a name may be invalid UTF-8
        "source_bytes": str(size),
        "damage": "; ".join(f"{part.length} bytes at {part.offset}: {part.reason}" for part in damage),
        "config": "recovered" if has_config else "lost",
        "by": LIBRARY,
    }


def _copy(
    entries: Iterable[Entry],
    target: Path,
    metadata: dict[str, dict[str, str]],
    config: Attachment | None,
    version: str,
) -> tuple[Counter[str], list[int]]:
    """Write the new file; return message counts by topic, and the ticks."""
    counts: Counter[str] = Counter()
    numbers: list[int] = []
    out = PartFile(target, LIBRARY, _CHUNK_BYTES, repeatable=True)
    stream = TickStream(out, _CHUNK_BYTES, _constants_of(config, version))
    log_ns = 0
    try:
        for name in _COPIED_METADATA:
            if name in metadata:
                out.add_metadata(name, metadata[name])
        if config is not None:
            out.add_attachment(CONFIG_NAME, config.media_type, config.data, config.log_time)
        for entry in entries:
            log_ns = max(log_ns, entry.log_time_ns)
            topic = _TOPICS.get(entry.channel_id, "")
            if topic == TICKS:
                rows = _rows_of(entry.data, version)
                for row in rows:
                    stream.add(row.tobytes(), entry.log_time_ns)
                counts[topic] += len(rows)
                numbers += rows["tick"].tolist()
            elif topic in _COPIED:
                stamped = Stamped(topic, entry.sequence, entry.publish_time_ns, entry.data)
                out.add(entry.channel_id, stamped, entry.log_time_ns)
                counts[topic] += 1
        stream.finish(log_ns)
        out.finish()
    except BaseException:
        out.abandon()
        raise
    return counts, numbers


def _rows_of(message: bytes, version: str) -> NDArray[Any]:
    if version == "2":
        return older.ticks_of([message], version)
    columns = (_LAYOUT_3 if version == "3" else _LAYOUT).decode([message], TICK.names or ())
    rows = np.zeros(len(columns["tick"]), TICK)
    for name, column in columns.items():
        rows[name] = column
    return rows


def _constants_of(config: Attachment | None, version: str) -> dict[str, float]:
    """Return the constants with which the columns of the new file are predicted."""
    if config is None:
        return UNKNOWN
    try:
        return constants_of(parse(older.config_of(config.data.decode(), version)))
    except (ConfigError, UnicodeDecodeError):
        return UNKNOWN
