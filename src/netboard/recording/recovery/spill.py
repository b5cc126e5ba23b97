"""Spill file of the server: records that left the log's ring buffer before a logger took them.

No caller waits for the disk, which has a separate thread. File and thread start with the first record. Records that the
spill refuses (the file has reached its size limit, or the disk is too slow) stay in the ring buffer. The file is
deleted once all its records are in recordings. A remaining file describes itself and can be converted to a recording
(`netboard.recording.recovery.recover`).
"""

import logging
import os
import struct
import time
import zlib
from bisect import bisect_right
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import partial
from io import FileIO
from mmap import mmap
from pathlib import Path
from queue import Empty, SimpleQueue
from tempfile import NamedTemporaryFile
from threading import Thread

from netboard.base.config import Config
from netboard.base.errors import WireError
from netboard.base.system.locks import lock
from netboard.network.protocol.codec import decode, encode
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.messages import Message
from netboard.network.protocol.records import EventRecord, LogBatch

MAGIC = b"netboard spill 1\n"
"""First bytes of a spill. Blocks follow: length and CRC-32 of a frame, then the frame."""

OPENED = "spill_opened"
"""Name of the first event, which relates server time (``time_ns``) to UTC (detail ``utc_ns``)."""

MAX_WAITING = 64
"""Limit of blocks in memory that wait for a slow disk [1]."""

READ_AHEAD = 8
MAX_LOADED = 32
"""Blocks that are read from disk in advance, and limit of reloaded blocks kept in memory [1]."""

RETRY_SECONDS = 1.0
"""Interval of retries after a disk error [s]."""

_HEAD = struct.Struct("<II")

log = logging.getLogger(__name__)


def spill_path(config: Config, session: str) -> Path:
    """Return the path of a session's spill, in the first folder of these in which files can be created."""
    name = f"{config.session.name}_{config.session.dyad}_{session[:8]}.spill"
    for folder in (Path(), Path(config.recording.directory), None):  # None: the system's folder for temporary files
        with suppress(OSError), NamedTemporaryFile(dir=folder) as file:
            return Path(file.name).absolute().with_name(name)
    return Path(name)


class _Block:
    """A batch of records, in the file or waiting to be written."""

    __slots__ = ("first", "frame", "offset", "requested", "size", "stop", "unreadable")

    def __init__(self, batch: LogBatch, offset: int) -> None:
        self.first, self.stop, self.offset = batch.first, batch.first + len(batch.records), offset
        self.frame: bytes | None = encode(LogBatch(batch.first, 0, batch.records))  # kept until it is in the file
        self.size = len(self.frame)
        self.requested = self.unreadable = False


class Spill:
    """Records in a file, in order, for loggers that connect later.

    The file is created on demand, and never over an existing file. ``welcome``: a fresh copy of the first message to
    the session's loggers; it is stored in the file. ``max_bytes``: size limit of the file in bytes; 0 disables it.
    """

    def __init__(self, path: Path, welcome: Welcome, max_bytes: int) -> None:
        self.path = path
        self.trouble = ""
        self._opened = EventRecord(0, -1, welcome.server_ns, OPENED, {"utc_ns": str(time.time_ns())})
        self._max_bytes = max_bytes
        self._blocks: list[_Block] = []
        self.introduce(welcome)
        self._file: FileIO | None = None
        # Queues between the threads: blocks to write (None deletes the file), blocks to read, blocks read.
        self._unwritten: deque[_Block | None] = deque()
        self._deletions = self._deleted = 0
        self._wanted: SimpleQueue[list[_Block] | None] = SimpleQueue()
        self._loaded: deque[_Block] = deque()
        self._rest: Iterable[LogBatch] = ()
        self._thread: Thread | None = None

    def introduce(self, welcome: Welcome) -> None:
        """Set the first message of the file, unless the file has data."""
        if not self._blocks:
            self._introduction = MAGIC + block_of(encode(welcome)) + block_of(encode(self._opened))
            self._end = len(self._introduction)

    @property
    def next(self) -> int:
        """Number after the last stored record; 0 if empty [1]."""
        return self._blocks[-1].stop if self._blocks else 0

    @property
    def held(self) -> int:
        """Number of stored records [1]."""
        return sum(block.stop - block.first for block in self._blocks)

    @property
    def refusal(self) -> str:
        """Reason why no records are accepted now; empty if they are."""
        if not self._max_bytes:
            return "network.log_spill_mb is 0"
        if self._end >= self._max_bytes:
            return f"{self.path} has grown to network.log_spill_mb"
        if len(self._unwritten) >= MAX_WAITING:
            return self.trouble or f"{self.path}: the disk is too slow"
        return ""

    def put(self, batch: LogBatch) -> None:
        """Store records that follow the previous ones, possibly after a gap; call only without a `refusal`."""
        self._add(batch)
        self._wake([])

    def batch(self, cursor: int) -> LogBatch | None:
        """Return the next batch for a logger, or None if it must be read from disk first.

        ``cursor``: number of the first record not yet sent to the logger; less than `next`.
        """
        while len(self._loaded) > MAX_LOADED:
            used = self._loaded.popleft()
            used.frame, used.requested = None, False
        at = bisect_right(self._blocks, cursor, key=lambda block: block.stop)
        while at < len(self._blocks) and self._blocks[at].unreadable:
            del self._blocks[at]  # leaves a gap; the next batch counts its records as lost
        ahead = self._blocks[at : at + READ_AHEAD]
        if not ahead:
            return None
        frame = ahead[0].frame
        if frame is None:
            self._request(ahead)
            return None
        whole = decode(frame)
        assert isinstance(whole, LogBatch)
        first = max(cursor, whole.first)
        return LogBatch(first, first - cursor, whole.records[first - whole.first :])

    def forget(self, before: int) -> None:
        """Discard records before a number; delete the file when none are left."""
        had_records = bool(self._blocks)
        del self._blocks[: bisect_right(self._blocks, before, key=lambda block: block.stop)]
        if had_records and not self._blocks:
            self._end = len(self._introduction)
            self._unwritten.append(None)
            self._deletions += 1
            self._wake([])

    def close(self, rest: Iterable[LogBatch] | None = None) -> None:
        """Complete the file; no records may be stored or requested afterwards. `closed` is true when it is done.

        ``rest``: last records to store; the thread takes them at its own pace.
        """
        if rest is not None and self._max_bytes:
            self._rest = rest
        elif self._thread is None:
            return
        self._wake(None)

    @property
    def closed(self) -> bool:
        """Whether the thread has ended or never started: all stored records are in the file."""
        return self._thread is None or not self._thread.is_alive()

    def _add(self, batch: LogBatch) -> None:
        block = _Block(batch, self._end + _HEAD.size)
        self._end = block.offset + block.size
        self._blocks.append(block)
        self._unwritten.append(block)

    def _request(self, blocks: list[_Block]) -> None:
        missing = [block for block in blocks if block.frame is None and not block.requested]
        for block in missing:
            block.requested = True
        if missing:
            self._wake(missing)

    def _wake(self, wanted: list[_Block] | None) -> None:
        if self._thread is None:
            # A daemon: a disk that never answers must not keep the process from ending.
            self._thread = Thread(target=self._work, name="spill", daemon=True)
            self._thread.start()
        self._wanted.put(wanted)

    # --- disk thread ---------------------------------------------------------------------------------------------

    def _work(self) -> None:
        while True:
            try:
                wanted = self._wanted.get(timeout=RETRY_SECONDS if self._unwritten else None)
            except Empty:
                wanted = []
            if wanted is None:
                self._finish()
                return
            for block in wanted:
                self._read(block)
            self._write()

    def _write(self) -> None:
        """Write the waiting blocks, as far as the disk accepts them."""
        while self._deleted < self._deletions:
            while self._unwritten.popleft() is not None:
                pass
            self._delete()
            self._deleted += 1
        while self._unwritten and (block := self._unwritten[0]) is not None:
            try:
                self._write_block(block)
            except OSError as error:
                self._log_once(error.strerror or str(error))
                return
            self.trouble = ""
            block.frame = None
            self._unwritten.popleft()

    def _write_block(self, block: _Block) -> None:
        assert block.frame is not None
        if self._file is None:
            self._file = FileIO(self.path, "x+", opener=partial(os.open, mode=0o600))  # only its owner may read it
            with suppress(OSError):  # nobody recovers it meanwhile, where the file system has locks
                lock(self._file.fileno())
        place, data = block.offset - _HEAD.size, block_of(block.frame)
        # The introduction is written together with the first block: a spill without records leaves no file.
        if place == len(self._introduction):
            place, data = 0, self._introduction + data
        self._file.seek(place)
        _write_all(self._file, data)

    def _read(self, block: _Block) -> None:
        if self._file is None:
            return  # the block was deleted meanwhile
        try:
            self._file.seek(block.offset - _HEAD.size)
            data = self._file.read(_HEAD.size + block.size)
        except OSError as error:
            self._log_once(error.strerror or str(error))
            data = b""
        frame = data[_HEAD.size :]
        if data != block_of(frame):
            self._log_once(f"records {block.first} to {block.stop - 1} cannot be read again")
            block.unreadable = True
            return
        block.frame = frame
        self._loaded.append(block)

    def _finish(self) -> None:
        self._write()
        for batch in self._rest:
            if self._unwritten:
                break
            self._add(batch)
            self._write()
        for block in filter(None, self._unwritten):
            self._blocks.remove(block)
        if not self._blocks or self._file is None:
            self._delete()
            return
        try:
            os.fsync(self._file.fileno())
        except OSError as error:
            self._log_once(error.strerror or str(error))
        if os.fstat(self._file.fileno()).st_nlink == 0:
            self._log_once("was deleted")
            self._blocks.clear()
        self._file.close()

    def _delete(self) -> None:
        if self._file is None:
            return
        self._file.close()
        self._file = None
        try:
            self.path.unlink(missing_ok=True)
        except OSError as error:
            self._log_once(error.strerror or str(error))

    def _log_once(self, trouble: str) -> None:
        if self.trouble != trouble:
            log.error("%s: %s", self.path, trouble)
        self.trouble = trouble


def read_spill(data: "mmap | bytes") -> Iterator[tuple[int, int, Message | None]]:
    """Yield the blocks of a spill.

    Start and end of each, and its content: a `Welcome`, the event `OPENED`, then `LogBatch` messages; None for a
    damaged block.
    """
    position = len(MAGIC)
    while position < len(data):
        end = len(data)
        message: Message | None = None
        if position + _HEAD.size <= end:
            length, crc = _HEAD.unpack_from(data, position)
            end = min(end, position + _HEAD.size + length)
            frame = data[position + _HEAD.size : end]
            if len(frame) == length and zlib.crc32(frame) == crc:
                with suppress(WireError):  # an undecodable block is damaged
                    message = decode(frame)
        yield position, end, message
        position = end


def block_of(frame: bytes) -> bytes:
    """Return a frame as a spill stores it."""
    return _HEAD.pack(len(frame), zlib.crc32(frame)) + frame


def _write_all(file: FileIO, data: bytes) -> None:
    view = memoryview(data)
    while view:
        view = view[file.write(view) :]
