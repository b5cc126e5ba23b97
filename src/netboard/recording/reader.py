"""Reads a finished recording: its metadata, its configuration, and its streams as arrays and records.

A file that is not a finished, sound recording of a format this version knows is refused with a `RecordingError` that
says what is wrong with it and what to do. Every chunk's checksum is verified when the chunk is read.
"""

import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from io import SEEK_END, BytesIO
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Attachment, ChunkIndex, Metadata
from numpy.typing import NDArray

from netboard.errors import RecordingError
from netboard.recording.channels import FORMAT_VERSION, IDS, decode_ticks, unpack
from netboard.recording.chunks import MAGIC, RECORD_HEAD, UNSOUND, payloads, unpack_chunk
from netboard.recording.partfile import PROFILE
from netboard.recording.provenance import (
    CONFIG_NAME,
    METADATA,
    METADATA_END,
    METADATA_FIRST,
    METADATA_RECOVERY,
    config_sha256,
)
from netboard.recording.summary import Attempt, Gap, find_attempts, find_gaps
from netboard.tick import TICK
from netboard.wire.messages import ClockRecord, EventRecord, FrameRecord

_RECORD_LIMIT = 2**30
_FOOTER = struct.Struct("<BQQQI")
_DATA_END = struct.Struct("<BQI")
_ROW_BYTES = np.dtype((np.void, TICK.itemsize))

T = TypeVar("T", EventRecord, ClockRecord, FrameRecord)


class Recording:
    """A finished recording, open for reading. Use it in a ``with`` block.

    Parameters
    ----------
    path : Path
        The file.

    Attributes
    ----------
    path : Path
        The file.
    metadata : dict of str
        What the file says about session, software and machine.
    end : dict of str
        How it ended; empty for a file that was recovered because it never ended.
    recovery : dict of str
        What was recovered and what was not; empty for a file as it was written.
    first_record : int or None
        Number of its first record on the log channel; None if there was none [1].
    counts : dict of int
        Number of messages, by topic [1].

    Raises
    ------
    RecordingError
        If it is not a finished, sound recording of a known format.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._file = path.open("rb")
        except OSError as error:
            raise RecordingError(f"{path}: cannot be read: {error.strerror}") from error
        try:
            self._open()
        except BaseException:
            self._file.close()
            raise

    def _open(self) -> None:
        self._check_ends()
        with self._sound():
            # First of all: once its checksum is right, every place and length the index gives can be trusted.
            self._check_index()
            self._file.seek(0)
            reader = SeekingReader(self._file, record_size_limit=_RECORD_LIMIT)
            profile = reader.get_header().profile
            summary = reader.get_summary()
            if summary is None:
                raise RecordingError("it has no index")
            named = [Metadata.read(self._record(at.offset, at.length)) for at in summary.metadata_indexes]
            attachments = [Attachment.read(self._record(at.offset, at.length)) for at in summary.attachment_indexes]
        records = {record.name: dict(record.metadata) for record in named}
        if profile != PROFILE or METADATA not in records:
            raise RecordingError(f"{self.path}: an MCAP file, but not a recording of netboard")
        self.metadata = records[METADATA]
        self.end = records.get(METADATA_END, {})
        self.recovery = records.get(METADATA_RECOVERY, {})
        first = records.get(METADATA_FIRST, {}).get("record")
        self.first_record = None if first is None else int(first)
        if (version := self.metadata.get("format")) != FORMAT_VERSION:
            raise RecordingError(
                f"{self.path}: has format version {version}, this netboard reads version {FORMAT_VERSION}; "
                f"read it with netboard {self.metadata.get('netboard', 'of its own version')}"
            )
        self._chunks = sorted(summary.chunk_indexes, key=lambda chunk: chunk.chunk_start_offset)
        # By name: other MCAP tools may number the channels anew.
        self._ids = IDS | {channel.topic: channel.id for channel in summary.channels.values()}
        told = {} if summary.statistics is None else summary.statistics.channel_message_counts
        self.counts = {topic: told.get(number, 0) for topic, number in self._ids.items()}
        self._config: bytes | None = next((found.data for found in attachments if found.name == CONFIG_NAME), None)
        if self._config is not None and config_sha256(self._config) != self.metadata.get("config_sha256"):
            raise RecordingError(f"{self.path}: its configuration is damaged; run: netboard recover {self.path}")

    def _record(self, offset: int, length: int) -> ReadDataStream:
        """Read a record, of which the index says where it is."""
        self._file.seek(offset + RECORD_HEAD.size)
        return ReadDataStream(BytesIO(self._file.read(length - RECORD_HEAD.size)))

    def _check_ends(self) -> None:
        """Tell apart what is not a recording at all from what is an unfinished one."""
        size = self._file.seek(0, SEEK_END)
        self._file.seek(0)
        if self._file.read(len(MAGIC)) != MAGIC:
            raise RecordingError(f"{self.path}: not an MCAP file")
        self._file.seek(max(size - len(MAGIC), len(MAGIC)))
        if self.path.suffix == ".part" or self._file.read(len(MAGIC)) != MAGIC:
            raise RecordingError(f"{self.path}: was not finished, or is cut short; run: netboard recover {self.path}")

    @contextmanager
    def _sound(self) -> Iterator[None]:
        """Turn what a damaged file makes go wrong into a `RecordingError` that names it."""
        try:
            yield
        except (*UNSOUND, ValueError, RecordingError, OSError) as error:
            reason = str(error) or type(error).__name__
            raise RecordingError(f"{self.path}: is damaged ({reason}); run: netboard recover {self.path}") from error

    def check(self) -> None:
        """Verify the checksum of the whole file, metadata included (as far as its writer made one).

        Raises
        ------
        RecordingError
            If one bit of it has changed since it was written.
        """
        with self._sound():
            data_end = self._check_index() - _DATA_END.size
            self._file.seek(data_end)
            opcode, length, crc = _DATA_END.unpack(self._file.read(_DATA_END.size))
            if (opcode, length) != (Opcode.DATA_END, 4) or (crc and self._crc(0, data_end) != crc):
                raise RecordingError("the checksum of its data is wrong")

    def _check_index(self) -> int:
        """Verify the checksum of everything behind the data and return where that begins."""
        end = self._file.seek(0, SEEK_END) - len(MAGIC)
        self._file.seek(max(0, end - _FOOTER.size))
        opcode, length, start, _, crc = _FOOTER.unpack(self._file.read(_FOOTER.size))
        if (opcode, length) != (Opcode.FOOTER, 20) or (crc and self._crc(start, end - 4) != crc):
            raise RecordingError("the checksum of its index is wrong")
        return int(start)

    def _crc(self, start: int, stop: int) -> int:
        crc = 0
        self._file.seek(start)
        while start < stop and (block := self._file.read(min(stop - start, 2**20))):
            crc = zlib.crc32(block, crc)
            start += len(block)
        return crc

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def config_text(self) -> str:
        """The resolved configuration, as TOML.

        Raises
        ------
        RecordingError
            If this file was recovered from one whose configuration was destroyed.
        """
        if self._config is None:
            raise RecordingError(f"{self.path}: its configuration was lost when it was damaged, see its metadata")
        return self._config.decode()

    def ticks(self, first: int | None = None, stop: int | None = None) -> NDArray[Any]:
        """Ticks, all of them or those of some numbers.

        Parameters
        ----------
        first : int, optional
            Number of the first tick wanted; else from the beginning [1].
        stop : int, optional
            Number after the last one wanted; else to the end [1].

        Returns
        -------
        ndarray of TICK, shape (n,)
            The rows, bit for bit as the server sent them.
        """
        # Joined as plain bytes: numpy compares every field of structured types before it joins them.
        parts = [rows.view(_ROW_BYTES) for rows in self._tick_tables(first, stop)]
        return np.concatenate(parts).view(TICK) if parts else np.empty(0, TICK)

    def columns(self, *names: str, first: int | None = None, stop: int | None = None) -> dict[str, NDArray[Any]]:
        """Some columns of the ticks.

        Parameters
        ----------
        *names : str
            Names of fields of `netboard.tick.TICK`.
        first, stop : int, optional
            As for `ticks` [1].

        Returns
        -------
        dict of ndarray, shape (n,)
            Each column, by its name [SI].

        Raises
        ------
        ValueError
            If there is no such field.
        """
        if unknown := set(names) - set(TICK.names or ()):
            raise ValueError(f"ticks have no field {', '.join(sorted(unknown))}")
        rows = self.ticks(first, stop)
        return {name: np.ascontiguousarray(rows[name]) for name in names}

    def batches(self, most: int = 60_000) -> Iterator[NDArray[Any]]:
        """Yield all ticks in order, a portion at a time: for recordings that do not fit into memory.

        Parameters
        ----------
        most : int
            A portion has this many ticks or a few more [1].

        Yields
        ------
        ndarray of TICK, shape (n,)
            The next rows.
        """
        held: list[NDArray[Any]] = []
        for rows in self._tick_tables(None, None):
            held.append(rows.view(_ROW_BYTES))
            if sum(len(part) for part in held) >= most:
                yield np.concatenate(held).view(TICK)
                held.clear()
        if held:
            yield np.concatenate(held).view(TICK)

    def attempts(self) -> tuple[Attempt, ...]:
        """Every attempt at a trial, in order."""
        return find_attempts(self.ticks())

    def _tick_tables(self, first: int | None, stop: int | None) -> Iterator[NDArray[Any]]:
        """Yield the ticks of some numbers, chunk by chunk."""
        for messages in self._by_chunk("/tick"):
            rows = decode_ticks(messages)
            low = 0 if first is None else np.searchsorted(rows["tick"], first)
            high = len(rows) if stop is None else np.searchsorted(rows["tick"], stop)
            yield rows[low:high]

    def events(self) -> tuple[EventRecord, ...]:
        """All events."""
        return self._records("/event", EventRecord)

    def clocks(self) -> tuple[ClockRecord, ...]:
        """All raw clock probes."""
        return self._records("/clock", ClockRecord)

    def frames(self) -> tuple[FrameRecord, ...]:
        """All frames the displays have shown."""
        return self._records("/frame", FrameRecord)

    def remarks(self) -> tuple[EventRecord, ...]:
        """All remarks of the logger itself: above all ``log_lost``, records it never got."""
        return self._records("/logger", EventRecord)

    def _records(self, topic: str, kind: type[T]) -> tuple[T, ...]:
        records: list[T] = []
        for messages in self._by_chunk(topic):
            with self._sound():
                records.extend(kind(**unpack(message)) for message in messages)
        return tuple(records)

    def _by_chunk(self, topic: str) -> Iterator[list[bytes]]:
        """Yield the messages of a stream, one list for each chunk that has any."""
        channel_id = self._ids[topic]
        for index in self._chunks:
            if channel_id in (index.message_index_offsets or self._ids.values()):
                with self._sound():
                    data = unpack_chunk(self._body(index))
                yield payloads(data, channel_id)

    def _body(self, index: ChunkIndex) -> bytes:
        self._file.seek(index.chunk_start_offset + RECORD_HEAD.size)
        return self._file.read(index.chunk_length - RECORD_HEAD.size)

    def gaps(self) -> dict[str, tuple[Gap, ...]]:
        """Missing numbers of every stream, by topic (and station); a stream without gaps is not listed."""
        numbers: dict[str, list[int]] = {"/tick": self.ticks()["tick"].tolist()}
        numbers["/event"] = [event.seq for event in self.events()]
        numbers["/clock"] = [clock.seq for clock in self.clocks()]
        for frame in self.frames():
            numbers.setdefault(f"/frame {frame.station}", []).append(frame.seq)
        found = {stream: find_gaps(np.array(seqs, np.int64)) for stream, seqs in numbers.items()}
        return {stream: gaps for stream, gaps in found.items() if gaps}
