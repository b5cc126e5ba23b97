"""Finds what is readable in the bytes of an unfinished, damaged or wrongly joined recording.

Chunks are found by their signature and accepted by their checksum, so a destroyed length or record costs at most its
own chunk. The result is a list of pieces: stretches of bytes without damage, which never reach from one recording into
the next. Every byte is in a piece, or reported as damage, those after the end of a recording included. Which pieces
belong together is decided in `netboard.recording.recovery.assembly`.
"""

import mmap
import os
import re
import struct
import zlib
from bisect import bisect_left
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Header, Metadata

from netboard.base.errors import RecordingError, unreadable
from netboard.recording.files.locate import require_file
from netboard.recording.files.provenance import CONFIG_NAME, MetadataName, damaged_numbers
from netboard.recording.format.chunks import MAGIC, RECORD_HEAD, UNSOUND, has_right_length, unpack_chunk
from netboard.recording.format.claims import MAX_RECORD_BYTES, SearchEffort


def _stored(name: str) -> bytes:
    """Return a name as MCAP stores it: after its length."""
    return struct.pack("<I", len(name)) + name.encode()


_SIGNATURE = struct.pack("<I", 4) + b"zstd"
_TO_SIGNATURE = RECORD_HEAD.size + 8 + 8 + 8 + 4  # MCAP: start and end time, size and CRC of a chunk come before

_KNOWN = re.compile(b"|".join(re.escape(known) for known in (MAGIC, *map(_stored, (*MetadataName, CONFIG_NAME)))))
"""What is found where reading may continue after damage: the beginning of a file, or the name of a record as stored."""

_NAMED_RECORDS = ((Opcode.METADATA, RECORD_HEAD.size), (Opcode.ATTACHMENT, RECORD_HEAD.size + 16))
"""Opcodes of the records with these names, and the place of the name in each."""

_EXPECTED = frozenset(
    (Opcode.HEADER, Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.METADATA, Opcode.ATTACHMENT, Opcode.DATA_END)
)
_IN_INDEX = frozenset(
    (
        *(Opcode.SCHEMA, Opcode.CHANNEL, Opcode.CHUNK_INDEX, Opcode.ATTACHMENT_INDEX, Opcode.METADATA_INDEX),
        *(Opcode.STATISTICS, Opcode.SUMMARY_OFFSET, Opcode.FOOTER),
    )
)
_READERS = {Opcode.HEADER: Header.read, Opcode.METADATA: Metadata.read, Opcode.ATTACHMENT: Attachment.read}
_LENGTHS = {Opcode.DATA_END: 4, Opcode.FOOTER: 20}

Data = mmap.mmap | bytes
"""Content of a file."""


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


@dataclass
class FilePiece:
    """A stretch of a file without damage, or the beginning of one, of at most one recording."""

    start: int
    stop: int  # after its content
    begins: bool = False  # whether another recording begins here; otherwise it may continue the piece before
    has_header: bool = False
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    config: Attachment | None = None
    chunks: list[Span] = field(default_factory=list)
    damage: list[Damage] = field(default_factory=list)  # after its content
    finished: bool = False  # whether the end of its data is there

    @property
    def holds_records(self) -> bool:
        """Whether it holds anything of a recording."""
        return bool(self.metadata or self.config or self.chunks or self.finished)


@contextmanager
def mapped(path: Path) -> Iterator[Data]:
    """Map a file into memory, read-only."""
    require_file(path)
    with ExitStack() as stack:
        try:
            file = stack.enter_context(path.open("rb"))
            size = os.fstat(file.fileno()).st_size
            data = stack.enter_context(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)) if size else b""
        except OSError as error:
            raise unreadable(path, error) from error
        yield data


def scan(data: Data, effort: SearchEffort) -> list[FilePiece]:
    """Return the pieces of a file, in order; empty if it is no MCAP file and has no valid chunk."""
    chunks = list(_find_chunks(data, effort))
    if not (chunks or data[: len(MAGIC)] == MAGIC):
        return []
    scanner = _Scanner(data, effort)
    position = 0
    for chunk in chunks:
        scanner.read(Span(position, chunk.start))
        scanner.take_chunk(chunk)
        position = chunk.stop
    scanner.read(Span(position, len(data)))
    return scanner.pieces


def _find_chunks(data: Data, effort: SearchEffort) -> Iterator[Span]:
    """Yield every valid chunk, in order."""
    position = 0
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


def content_of(data: Data, chunk: Span) -> bytes:
    """Return the decompressed records of a chunk."""
    return unpack_chunk(data[chunk.start + RECORD_HEAD.size : chunk.stop])


def _why_unsound(data: Data, chunk: Span) -> str | None:
    """Return why a chunk is invalid, or None if it is valid."""
    try:
        content_of(data, chunk)
    except RecordingError as error:
        return str(error)
    return None


class _Scanner:
    """Collects the pieces of a file."""

    def __init__(self, data: Data, effort: SearchEffort) -> None:
        self.pieces = [FilePiece(0, 0, begins=True)]
        self._data, self._effort = data, effort
        self._known = [found.start() for found in _KNOWN.finditer(data)]
        self._closed = False  # whether the last bytes of a whole file were read, and nothing after them

    def take_chunk(self, chunk: Span) -> None:
        """Add a chunk to the current piece, or begin one."""
        piece = self.pieces[-1]
        if piece.damage or piece.finished:
            piece = self._begin(chunk.start)
        piece.chunks.append(chunk)
        piece.stop = chunk.stop

    def _begin(self, start: int, *, begins: bool = False) -> FilePiece:
        self.pieces.append(FilePiece(start, start, begins=begins))
        self._closed = False
        return self.pieces[-1]

    def read(self, span: Span) -> None:
        """Read the bytes between two chunks."""
        position = span.start
        while position < span.stop:
            position = self._read_at(Span(position, span.stop))

    def _read_at(self, span: Span) -> int:
        """Read what begins at a position; return the position after it."""
        start = span.start
        if _is_beginning(self._data, span):
            if start:
                self._begin(start, begins=True)
            self.pieces[-1].has_header = True
            return start + len(MAGIC)
        if start == 0:
            return self._damaged_beginning(span)
        piece = self.pieces[-1]
        if piece.finished and not self._closed and self._data[start : start + len(MAGIC)] == MAGIC:
            self._closed = True
            return start + len(MAGIC)
        expected = _IN_INDEX if piece.finished and not self._closed else _EXPECTED
        record = _whole_record(self._data, span, expected)
        if isinstance(record, str):
            following = self._next_known(Span(start + 1, span.stop))
            why = f"{record}, after the end of the recording" if self._closed else record
            piece.damage.append(Damage(start, following - start, why))
            return following
        opcode, body = record
        self._take(opcode, body, start)
        stop = start + RECORD_HEAD.size + len(body)
        self.pieces[-1].stop = max(self.pieces[-1].stop, 0 if self.pieces[-1].damage else stop)
        return stop

    def _damaged_beginning(self, span: Span) -> int:
        """Report the first bytes of a file that does not begin as an MCAP file, up to the first that is known."""
        head = Span(min(len(MAGIC), span.stop), span.stop)
        if isinstance(_whole_record(self._data, head, _EXPECTED), str) and self._data[: len(MAGIC)] != MAGIC:
            head = Span(self._next_known(Span(1, span.stop)), span.stop)
        if self._data[: len(MAGIC)] != MAGIC:
            self.pieces[-1].damage.append(Damage(0, head.start, "not the beginning of an MCAP file"))
        return head.start

    def _next_known(self, span: Span) -> int:
        """Return where reading continues after damage, or the end of the span.

        That is at the next beginning of a file, whole metadata record or configuration.
        """
        for place in self._known[bisect_left(self._known, span.start) : bisect_left(self._known, span.stop)]:
            if _is_beginning(self._data, Span(place, span.stop)):
                return place
            for opcode, before in _NAMED_RECORDS:
                start = place - before
                if start >= span.start and self._data[start] == opcode:
                    if not isinstance(_whole_record(self._data, Span(start, span.stop), _EXPECTED), str):
                        return start
                    self._effort.spend(min(RECORD_HEAD.unpack_from(self._data, start)[1], MAX_RECORD_BYTES))
        return span.stop

    def _take(self, opcode: int, body: bytes, start: int) -> None:
        """Add a record outside chunks to the current piece, or begin one."""
        piece = self.pieces[-1]
        if opcode == Opcode.METADATA:
            named = Metadata.read(ReadDataStream(BytesIO(body)))
            if named.name == MetadataName.OPENED and _is_another(piece, named):
                piece = self._begin(start, begins=True)
            elif piece.damage or piece.finished:
                piece = self._begin(start)
            bad = damaged_numbers(named.name, named.metadata)
            piece.metadata[named.name] = {key: value for key, value in named.metadata.items() if key not in bad}
            piece.damage += [Damage(start, len(body), f"metadata: {key} is not a number") for key in bad]
            return
        if opcode == Opcode.ATTACHMENT:
            attachment = Attachment.read(ReadDataStream(BytesIO(body)))
            if attachment.name == CONFIG_NAME:
                piece = self._begin(start) if piece.damage or piece.finished else piece
                piece.config = attachment
        elif opcode == Opcode.DATA_END:
            piece = self._begin(start) if piece.damage or piece.finished else piece
            piece.finished = True


def _is_another(piece: FilePiece, opened: Metadata) -> bool:
    """Return whether the metadata with which a recording is opened do not belong to what was read of a piece."""
    there = piece.metadata.get(MetadataName.OPENED)
    return bool(piece.chunks or piece.finished) if there is None else there != opened.metadata


def _is_beginning(data: Data, span: Span) -> bool:
    """Return whether an MCAP file begins at the start of a span: its magic bytes, and a header."""
    head = Span(span.start + len(MAGIC), span.stop)
    return (
        data[span.start : head.start] == MAGIC
        and data[head.start : head.start + 1] == bytes([Opcode.HEADER])
        and not isinstance(_whole_record(data, head, _EXPECTED), str)
    )


def _whole_record(data: Data, span: Span, expected: frozenset[int]) -> tuple[int, bytes] | str:
    """Return opcode and body of the record at the start of a span, or why it is invalid."""
    if span.stop - span.start < RECORD_HEAD.size:
        return "a record cut short"
    opcode, length = RECORD_HEAD.unpack_from(data, span.start)
    stop = span.start + RECORD_HEAD.size + length
    if opcode not in expected:
        return "not a record"
    if stop > span.stop:
        return "a chunk cut short" if opcode == Opcode.CHUNK else "a record cut short"
    if opcode in _READERS and length > MAX_RECORD_BYTES:
        return f"a damaged record: {length} bytes, expected at most {MAX_RECORD_BYTES}"
    if opcode == Opcode.CHUNK:
        return _why_unsound(data, Span(span.start, stop)) or "a damaged chunk"
    body = data[span.start + RECORD_HEAD.size : stop]
    if len(body) != _LENGTHS.get(Opcode(opcode), len(body)):
        return "a damaged record: wrong length"
    if opcode in _READERS:
        stream = ReadDataStream(BytesIO(body))
        try:
            _READERS[Opcode(opcode)](stream)
        except UNSOUND as error:
            return f"a damaged record: {error}"
        if stream.count != len(body):
            return "a damaged record: wrong length"
    if opcode == Opcode.ATTACHMENT and zlib.crc32(body[:-4]) != int.from_bytes(body[-4:], "little"):
        return "a damaged record: wrong checksum"
    return opcode, body
