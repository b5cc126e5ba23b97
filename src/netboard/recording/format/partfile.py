"""A recording while it is written: ``NAME.mcap.part``, which becomes ``NAME.mcap`` when it is whole.

Rules that hold here: no file is ever overwritten; a chunk holds at most so many bytes and goes to the operating system
the moment it is closed, so that a killed process loses one chunk at most; `sync` makes everything written survive a
power cut, and keeps room behind the end, so that a full disk is noticed while the index still fits; only `finish`
gives the final name. Whatever a disk does, what was whole before stays whole. This module knows MCAP and disks, and
nothing of ticks or sessions.
"""

import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType, Writer

from netboard.base.errors import RecordingError
from netboard.recording.format.channels import CHANNELS, Stamped
from netboard.recording.format.disk import allocate, sync_directory

PROFILE = "netboard"
"""Profile in the MCAP header of a recording."""

_MESSAGE_HEAD = 31
"""Bytes of an MCAP message beside its data."""

_DELETED, _MOVED = "was deleted", "was moved away"

_RESERVE = 8 * 2**20
"""Room kept behind the end, for what is written until the next look and for the index, in bytes [1]."""

_RESERVE_FOR_CHUNK = 512
"""And for the index of each chunk, in bytes [1]."""


def part_path(path: Path) -> Path:
    """Name of a recording that is not finished yet."""
    return path.with_name(path.name + ".part")


@contextmanager
def _disk(path: Path) -> Iterator[None]:
    """Turn what the disk refuses into a `RecordingError` that names the file."""
    try:
        yield
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written: {error.strerror or error}") from error


def publish(part: Path, path: Path) -> None:
    """Give a finished file its name, never over an existing one."""
    try:
        os.link(part, path)
    except FileExistsError:
        raise RecordingError(f"{path}: exists already; the finished recording stays in {part.name}") from None
    except OSError:
        # A file system without hard links. Renaming is atomic too, but on POSIX replaces silently: look first.
        if path.exists():
            raise RecordingError(f"{path}: exists already; the finished recording stays in {part.name}") from None
        part.rename(path)
    else:
        part.unlink()
    sync_directory(path.parent)


class PartFile:
    """An MCAP file with netboard's channels, growing.

    Parameters
    ----------
    chunk_bytes : int
        Largest size of a chunk before compression, in bytes [1]. A longer message has a chunk of its own.
    """

    def __init__(self, path: Path, library: str, chunk_bytes: int) -> None:
        if path.suffix != ".mcap":
            raise RecordingError(f"{path}: the name of a recording ends in .mcap")
        self.path = path
        self.part = part_path(path)
        self._chunk_bytes = chunk_bytes
        self._pending = 0
        self._chunks = 0
        self._whole = 0
        self._reserved: float = 0
        if path.exists():
            raise RecordingError(f"{path}: exists already, and a recording is never overwritten")
        if self.part.exists():
            raise RecordingError(f"{self.part}: an unfinished recording of this name exists; see `netboard recover`")
        with _disk(self.part):
            self._file = self.part.open("x+b")
        # Chunks are closed by this class alone: the writer's own limit would let a chunk grow past its size.
        self._mcap: Any = Writer(
            self._file, chunk_size=2**62, compression=CompressionType.ZSTD, enable_crcs=True, enable_data_crcs=True
        )
        try:
            with self._writing():
                self._mcap.start(profile=PROFILE, library=library)
                for channel in CHANNELS:
                    schema_id = self._mcap.register_schema(channel.schema_name, "jsonschema", channel.schema())
                    self._mcap.register_channel(channel.topic, "msgpack", schema_id)
                sync_directory(path.parent)
        except RecordingError:
            self.discard()
            raise

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Stop for good at the first refusal of the disk: what was whole before stays as it is."""
        try:
            with _disk(self.part):
                yield
                self._file.flush()
                self._whole = self._file.tell()
        except RecordingError:
            self.abandon()
            raise

    @property
    def is_open(self) -> bool:
        """Whether more can be written."""
        return not self._file.closed

    def free_bytes(self) -> int:
        """Free space where the file is, in bytes."""
        if self.is_open:
            self._require_name()
        with _disk(self.path.parent):
            return shutil.disk_usage(self.path.parent).free

    @property
    def size(self) -> int:
        """How much has been handed to the operating system, in bytes."""
        return self._whole

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write a metadata record, at once and outside any chunk."""
        with self._writing():
            self._mcap.add_metadata(name, dict(values))

    def add_attachment(self, name: str, media_type: str, data: bytes, log_time_ns: int) -> None:
        """Write an attachment, at once and outside any chunk."""
        with self._writing():
            self._mcap.add_attachment(log_time_ns, log_time_ns, name, media_type, data)

    def add(self, channel_id: int, message: Stamped, log_time_ns: int) -> int:
        """Put a message into the chunk in memory; when it is full, the chunk before is closed.

        Returns
        -------
        int
            Where the chunk with the message will begin in the file, in bytes [1].
        """
        size = _MESSAGE_HEAD + len(message.data)
        if self._pending and self._pending + size > self._chunk_bytes:
            self.close_chunk()
        self._mcap.add_message(
            channel_id,
            log_time_ns,
            message.data,
            # MCAP's stamps are unsigned and its sequence has 32 bits; the message itself has the full values.
            max(message.publish_time_ns, 0),
            message.sequence & 0xFFFF_FFFF,
        )
        self._pending += size
        return self._whole

    def close_chunk(self) -> None:
        """Hand the chunk in memory, if any, to the operating system: it survives the end of this process."""
        with self._writing():
            self._mcap.flush()
        self._chunks += self._pending > 0
        self._pending = 0

    def sync(self) -> None:
        """Close the chunk in memory and make everything written so far survive a power cut.

        Raises
        ------
        RecordingError
            If the disk is gone, and the file is closed then; or if the disk is full, or the file was deleted or moved:
            then it is still open, and `finish` saves what was written.
        """
        self.close_chunk()
        with self._writing():
            os.fsync(self._file.fileno())
        self._require_name()
        with _disk(self.part):
            self._reserve()

    def finish(self) -> None:
        """Write the index and give the file its name.

        Raises
        ------
        RecordingError
            If the disk refuses, a file of the final name has appeared meanwhile, or the file was moved.
        """
        self.close_chunk()
        astray = self._astray()
        with self._writing():
            if astray == _DELETED:
                self._save()
            self._mcap.finish()
            self._file.flush()
            self._file.truncate()  # gives back the room behind the end
            os.fsync(self._file.fileno())
        self._file.close()
        if astray == _MOVED:
            raise RecordingError(f"{self.part}: {astray} while it was being written; it is whole, wherever it is now")
        with _disk(self.part):
            publish(self.part, self.path)

    def abandon(self) -> None:
        """Close the part as it is; it can be recovered up to the last whole chunk."""
        if self._file.closed:
            return
        with suppress(OSError):  # the disk that refused to write may refuse this too: recovery finds the end anyway
            os.ftruncate(self._file.fileno(), self._whole)
        # The buffer may hold what the disk has just refused; closing the raw file drops it instead of trying again.
        self._file.raw.close()

    def discard(self) -> None:
        """Delete the part, in which there is nothing yet."""
        self.abandon()
        with _disk(self.part):
            self.part.unlink(missing_ok=True)

    def _require_name(self) -> None:
        """Find out whether the file still has its name."""
        if astray := self._astray():
            raise RecordingError(f"{self.part}: {astray} while it was being written")

    def _astray(self) -> str:
        """What has become of the file's name, or nothing."""
        status = os.fstat(self._file.fileno())
        if status.st_nlink == 0:
            return _DELETED
        try:
            return "" if os.path.samestat(status, self.part.stat()) else _MOVED
        except OSError:
            return _MOVED

    def _save(self) -> None:
        """Write a file anew that was deleted: as long as it is open, its bytes are there."""
        self.part.parent.mkdir(parents=True, exist_ok=True)
        with self.part.open("xb") as new, os.fdopen(os.dup(self._file.fileno()), "rb") as old:
            old.seek(0)
            shutil.copyfileobj(old, new)
            new.flush()
            os.dup2(new.fileno(), self._file.fileno())
        sync_directory(self.part.parent)

    def _reserve(self) -> None:
        """Keep room behind the end, before it is needed."""
        room = _RESERVE + self._chunks * _RESERVE_FOR_CHUNK
        if self._reserved < self._whole + room // 2:
            offered = allocate(self._file.fileno(), self._whole, room)
            self._reserved = self._whole + room if offered else float("inf")
