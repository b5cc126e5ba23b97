"""A recording while it is being written: ``NAME.mcap.part``, renamed to ``NAME.mcap`` when it is complete.

A recording that can be made again from other files has a temporary name instead, and nothing is left of it if it is not
completed. No file is ever overwritten. A chunk has a size limit and goes to the operating system as soon as it is
closed, so a killed process loses at most one chunk. `sync` makes all written data survive a power cut, and reserves
space after the end, so that a full disk is noticed while the index still fits. Only `finish` gives the final name. A
disk error never damages chunks that were already complete. This module handles MCAP and disks, but not ticks or
sessions.
"""

import os
import secrets
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType, Writer

from netboard.base.errors import ConfigError, RecordingError, writing
from netboard.base.files.new import refuse_existing, try_writing
from netboard.base.system.c_library import allocate
from netboard.base.system.locks import lock, sync_directory
from netboard.recording.format.channels import CHANNELS, Stamped
from netboard.recording.format.claims import MAX_STAMP_NS

PROFILE = "netboard"
"""Profile in the MCAP header of a recording."""

_MESSAGE_HEAD = 31
"""Overhead of an MCAP message, in bytes [1]."""

_DELETED, _MOVED = "was deleted", "was moved away"

_RESERVE = 8 * 2**20
"""Space reserved after the end for data until the next `sync` and for the index, in bytes [1]."""

_RESERVE_FOR_CHUNK = 512
"""Additional space for the index entries of each chunk, in bytes [1]."""


def part_path(path: Path) -> Path:
    """Return the path of an unfinished recording."""
    return path.with_name(path.name + ".part")


def publish(part: Path, path: Path) -> None:
    """Give a finished file its final name, never over an existing file."""
    try:
        # Not renamed: on POSIX a hard link cannot replace an existing file, but a rename does.
        os.link(part, path)
    except OSError:
        # The file system has no hard links. Renaming is atomic too, but on POSIX it silently replaces: check first.
        refuse_existing(path)
        part.rename(path)
    else:
        part.unlink()
    sync_directory(path.parent)


def require_new(path: Path) -> None:
    """Refuse a path at which no recording can be begun; for a command, before a long computation."""
    if path.suffix != ".mcap":
        raise ConfigError(f"{path}: the name of a recording ends in .mcap")
    with writing(path):
        refuse_existing(path)
        if not path.parent.is_dir():
            raise ConfigError(f"{path}: cannot be written: there is no folder {path.parent}")
        try_writing(path.parent)


def require_log_time(log_time_ns: int, path: Path) -> None:
    """Refuse a log time that MCAP cannot store: it counts nanoseconds from 1970, and readers have 64 bits for them."""
    if not 0 <= log_time_ns <= MAX_STAMP_NS:
        raise RecordingError(
            f"{path}: cannot store a log time of {log_time_ns / 1e9:.6g} s after 1970, expected a time from 1970 to "
            "2262; set the clock of this computer, or check the times in the data"
        )


class PartFile:
    """An unfinished MCAP file with netboard's channels.

    ``chunk_bytes``: maximum size of a chunk before compression, in bytes. A longer message gets its own chunk.
    ``repeatable``: the recording can be made again from other files.
    """

    def __init__(self, path: Path, library: str, chunk_bytes: int, *, repeatable: bool = False) -> None:
        require_new(path)
        self.path = path
        # The leftover of a killed process must not look like a recording to recover, nor block the next try.
        self.part = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part") if repeatable else part_path(path)
        self._repeatable = repeatable
        self._named = path if repeatable else self.part  # the file that an error names
        self._chunk_bytes = chunk_bytes
        self._pending = 0
        self._chunks = 0
        self._whole = 0
        self._reserved: float = 0
        with writing(self._named):
            refuse_existing(self.part, ", or recover it first: netboard recover")
            self._file = self.part.open("x+b")
        self._lock()
        # Only this class closes chunks: the library's own limit would let a chunk grow beyond its size.
        self._mcap: Any = Writer(
            # MCAP has no checksum of a metadata record: that of all data covers it.
            self._file,
            chunk_size=2**62,
            compression=CompressionType.ZSTD,
            enable_crcs=True,
            enable_data_crcs=True,
        )
        try:
            with self._writing():
                self._mcap.start(profile=PROFILE, library=library)
                for channel in CHANNELS:
                    schema_id = self._mcap.register_schema(channel.schema_name, "jsonschema", channel.schema())
                    self._mcap.register_channel(channel.topic, channel.encoding, schema_id)
                sync_directory(path.parent)
        except RecordingError:
            self.discard()
            raise

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Close the file at the first disk error; keep the data that were complete before it."""
        try:
            with writing(self._named):
                yield
                self._file.flush()
                self._whole = self._file.tell()
        except RecordingError:
            self.abandon()
            raise

    @property
    def is_open(self) -> bool:
        """Whether the file accepts more data."""
        return not self._file.closed

    def free_bytes(self) -> int:
        """Free space on the file's disk, in bytes."""
        if self.is_open:
            self._require_name()
        with writing(self.path.parent):
            return shutil.disk_usage(self.path.parent).free

    @property
    def size(self) -> int:
        """Size handed to the operating system so far, in bytes."""
        return self._whole

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write a metadata record immediately, outside any chunk."""
        with self._writing():
            self._mcap.add_metadata(name, dict(values))

    def add_attachment(self, name: str, media_type: str, data: bytes, log_time_ns: int) -> None:
        """Write an attachment immediately, outside any chunk."""
        require_log_time(log_time_ns, self._named)
        with self._writing():
            self._mcap.add_attachment(log_time_ns, log_time_ns, name, media_type, data)

    def add(self, channel_id: int, message: Stamped, log_time_ns: int) -> int:
        """Add a message to the chunk in memory; first close the chunk if the message does not fit.

        Returns the file offset of the chunk that will hold the message, in bytes.
        """
        require_log_time(log_time_ns, self._named)
        size = _MESSAGE_HEAD + len(message.data)
        if self._pending and self._pending + size > self._chunk_bytes:
            self.close_chunk()
        self._mcap.add_message(
            channel_id,
            log_time_ns,
            message.data,
            # MCAP's time stamps are unsigned and its sequence has 32 bits; the message itself has the full values.
            min(max(message.publish_time_ns, 0), MAX_STAMP_NS),
            message.sequence & 0xFFFF_FFFF,
        )
        self._pending += size
        return self._whole

    def close_chunk(self) -> None:
        """Hand the chunk in memory, if any, to the operating system, where it survives the end of this process."""
        with self._writing():
            self._mcap.flush()
        self._chunks += self._pending > 0
        self._pending = 0

    def sync(self) -> None:
        """Close the chunk in memory and make all written data survive a power cut.

        Raises `RecordingError` if the disk is gone: the file is then closed. Or if the disk is full, or the file was
        deleted or moved: the file is then still open, and `finish` saves what was written.
        """
        self.close_chunk()
        with self._writing():
            os.fsync(self._file.fileno())
        self._require_name()
        with writing(self._named):
            self._reserve()

    def finish(self) -> None:
        """Write the index and give the file its final name.

        Raises `RecordingError` if the disk reports an error, a file with the final name has appeared meanwhile, or the
        file was moved.
        """
        self.close_chunk()
        astray = self._astray()
        with self._writing():
            if astray == _DELETED:
                self._save()
            self._mcap.finish()
            self._file.flush()
            self._file.truncate()  # release the reserved space
            os.fsync(self._file.fileno())
        self._file.close()
        if astray == _MOVED:
            raise RecordingError(
                f"{self.part}: {astray} while it was being written; the file itself is complete at its new place"
            )
        with writing(self._named):
            try:
                publish(self.part, self.path)
            except ConfigError as error:
                if self._repeatable:
                    raise
                raise RecordingError(f"{error}; the finished recording stays in {self.part.name}") from None

    def abandon(self) -> None:
        """Close the unfinished file: it can be recovered up to the last complete chunk, or is deleted if repeatable."""
        if not self._file.closed:
            with suppress(OSError):  # a failing disk may fail here too; recovery finds the end without it
                os.ftruncate(self._file.fileno(), self._whole)
            # The buffer may hold data that the disk has just refused; closing the raw file drops it, without a retry.
            self._file.raw.close()
        if self._repeatable:
            self._delete()

    def discard(self) -> None:
        """Delete the part file, which has no data yet."""
        self.abandon()
        self._delete()

    def _delete(self) -> None:
        with writing(self._named):
            self.part.unlink(missing_ok=True)

    def _require_name(self) -> None:
        """Raise an error if the file was deleted or moved."""
        if astray := self._astray():
            raise RecordingError(f"{self.part}: {astray} while it was being written")

    def _astray(self) -> str:
        """Return what happened to the file's name; empty if it is unchanged."""
        status = os.fstat(self._file.fileno())
        if status.st_nlink == 0:
            return _DELETED
        try:
            return "" if os.path.samestat(status, self.part.stat()) else _MOVED
        except OSError:
            return _MOVED

    def _save(self) -> None:
        """Restore a deleted file; its bytes exist as long as it is open."""
        self.part.parent.mkdir(parents=True, exist_ok=True)
        with self.part.open("xb") as new, os.fdopen(os.dup(self._file.fileno()), "rb") as old:
            old.seek(0)
            shutil.copyfileobj(old, new)
            new.flush()
            # Under the old number, because the library's writer keeps the file object.
            os.dup2(new.fileno(), self._file.fileno())
        self._lock()
        sync_directory(self.part.parent)

    def _lock(self) -> None:
        """Let nobody recover the file while it is being written, where the file system has locks."""
        with suppress(OSError):
            lock(self._file.fileno())

    def _reserve(self) -> None:
        """Reserve space after the end before it is needed."""
        room = _RESERVE + self._chunks * _RESERVE_FOR_CHUNK
        if self._reserved < self._whole + room // 2:
            offered = allocate(self._file.fileno(), self._whole, room)
            self._reserved = self._whole + room if offered else float("inf")
