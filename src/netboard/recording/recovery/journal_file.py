"""Journal of a session: an append-only file from which a session resumes after any crash.

A journal is never overwritten, and only one server has it open. Appending does not wait for the disk: a separate thread
writes and syncs the entries one by one, in order, so a power cut can truncate only the last line. An entry that counts
as durable is on disk, and so is the file's directory entry. If the disk reports an error, the thread retries;
`Journal.trouble` holds the message until the entry is written.
"""

import logging
import os
import time
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from queue import SimpleQueue
from threading import Event, Thread
from typing import Self

from netboard.base.config import Config
from netboard.base.errors import ConfigError, RecordingError
from netboard.base.system.locks import lock, sync_directory
from netboard.task.journal.entries import Entry, Header, line_of, read_lines

RETRY_SECONDS = 0.5
"""Interval of retries after a disk error [s]."""

FINAL_ATTEMPTS = 3
"""Number of attempts to write once the journal is closing [1]."""

CLOSE_SECONDS = 10.0
"""Timeout of closing when the disk does not respond [s]."""

ENDING = ".journal.jsonl"

log = logging.getLogger(__name__)


def journal_path(directory: Path, config: Config) -> Path:
    """Return the path of a session's journal."""
    return directory / f"{config.session.dyad}_{config.session.name}{ENDING}"


def started_before(path: Path) -> ConfigError:
    """Return the error for a session that has a journal already."""
    return ConfigError(
        f"{path}: already exists: this session was started before. Continue it with netboard server --resume, or give "
        "the new session another name ([session] name, dyad)"
    )


def other_journals(path: Path, dyad: str) -> list[tuple[Path, Header]]:
    """List the readable journals of the other sessions of a dyad, beside the journal of a session."""
    found = []
    for other in sorted(path.parent.glob(f"{dyad}_*{ENDING}")):
        if other == path:
            continue
        with suppress(OSError, RecordingError), other.open("rb") as file:
            header = read_lines(file.readline(), str(other)).header
            if header.dyad == dyad:
                found.append((other, header))
    return found


class Journal:
    """An open journal. Create it with `create` or `reopen`."""

    def __init__(self, path: Path, handle: int, end: int, durable: int) -> None:
        self.path = path
        self.durable = durable  # number of entries on disk, without the header
        self.trouble = ""  # error message of the disk if the newest entries are not written; otherwise empty
        self._handle = handle
        self._end = end
        self.appended = durable  # number of entries on disk or waiting
        self._waiting: SimpleQueue[bytes | None] = SimpleQueue()
        self._closing = Event()
        # A daemon: a disk that never answers must not keep the process from ending.
        self._thread = Thread(target=self._work, name="journal", daemon=True)
        self._thread.start()

    @classmethod
    def create(cls, path: Path, header: Header) -> Self:
        """Create a journal; on return its header and its directory entry are on disk.

        The folder of the path is created if missing.
        """
        line = line_of(header, _now())
        try:
            return cls(path, _new(path, line), len(line), 0)
        except OSError as error:
            if isinstance(error, FileExistsError) and path.exists():
                raise started_before(path) from None
            raise RecordingError(f"{path}: cannot be written: {error.strerror or error}") from error

    @classmethod
    def reopen(cls, path: Path) -> tuple[Self, Header, tuple[Entry, ...], bytes]:
        """Reopen a journal; a torn last line stays until the next entry overwrites it.

        Returns the journal, its header and entries, and the torn line, empty if there is none.
        """
        try:
            handle = os.open(path, os.O_RDWR | _BINARY)
            try:
                _lock(handle, path)
                with open(handle, "rb", closefd=False) as file:  # a share may lock it for all other handles
                    lines = read_lines(file.read(), str(path))
            except BaseException:
                os.close(handle)
                raise
        except FileNotFoundError:
            raise RecordingError(
                f"{path}: does not exist: this session was never started (leave out --resume), or its form gave it "
                "another name (--set session.name=NAME)"
            ) from None
        except OSError as error:
            raise RecordingError(f"{path}: cannot be opened: {error.strerror or error}") from error
        if lines.torn:
            log.warning("%s: its last line is incomplete and is ignored: %r", path, lines.torn)
        return cls(path, handle, lines.sound, len(lines.entries)), lines.header, lines.entries, lines.torn

    def append(self, entry: Entry) -> None:
        """Append an entry without waiting for the disk."""
        line = line_of(entry, _now())
        self.appended += 1
        self._waiting.put(line)

    def close(self) -> None:
        """Wait until all entries are on disk, then close; do nothing if closed."""
        if not self._closing.is_set():
            self._waiting.put(None)
            self._closing.set()
        self._thread.join(CLOSE_SECONDS)
        if self.durable < self.appended:
            missing = self.appended - self.durable
            why = self.trouble or f"{self.path}: the disk does not answer"
            raise RecordingError(f"{why}; {missing} of {self.appended} entries are not on disk")

    # --- disk thread ---------------------------------------------------------------------------------------------

    def _work(self) -> None:
        while (line := self._waiting.get()) is not None:
            if not self._bring_to_disk(line):
                break
            self.durable += 1
        os.close(self._handle)

    def _bring_to_disk(self, line: bytes) -> bool:
        """Write a line, with retries; return False if the disk still fails while the journal is closing."""
        last_tries = FINAL_ATTEMPTS
        while last_tries:
            last_tries -= self._closing.is_set()
            try:
                if os.fstat(self._handle).st_nlink == 0:
                    self._restore()
                _write(self._handle, self._end, line)
            except OSError as error:
                self._log_once(f"{self.path}: cannot be written: {error.strerror or error}")
                # Once the journal is closing, the wait returns at once.
                if self._closing.wait(RETRY_SECONDS):
                    time.sleep(RETRY_SECONDS)
            else:
                self._end += len(line)
                self.trouble = ""
                return True
        return False

    def _restore(self) -> None:
        """Restore a deleted file from its open handle."""
        log.warning("%s: was deleted; writing it again", self.path)
        os.lseek(self._handle, 0, os.SEEK_SET)
        with open(self._handle, "rb", closefd=False) as deleted:
            handle = _new(self.path, deleted.read(self._end))
        os.close(self._handle)
        self._handle = handle

    def _log_once(self, trouble: str) -> None:
        if trouble != self.trouble:
            log.error("%s", trouble)
        self.trouble = trouble


_BINARY = getattr(os, "O_BINARY", 0)


def _new(path: Path, data: bytes) -> int:
    """Create a file and its folder and sync both; on failure leave nothing behind."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | _BINARY, 0o644)
    try:
        _lock(handle, path)
        _write(handle, 0, data)
        sync_directory(path.parent)
    except OSError:
        os.close(handle)
        path.unlink(missing_ok=True)
        raise
    return handle


def _lock(handle: int, path: Path) -> None:
    """Lock an open journal until it is closed or the process ends: two servers would overwrite each other's entries."""
    try:
        lock(handle)
    except BlockingIOError:
        raise RecordingError(f"{path}: another server runs this session; end it first") from None
    except OSError as error:  # a file system without locks
        log.warning("%s: cannot be locked (%s); do not run this session twice", path, error.strerror)


def _write(handle: int, place: int, line: bytes) -> None:
    """Write a line at its position, over the remains of an earlier attempt, and sync it."""
    os.lseek(handle, place, os.SEEK_SET)
    rest = memoryview(line)
    while rest:
        rest = rest[os.write(handle, rest) :]
    os.ftruncate(handle, place + len(line))
    os.fsync(handle)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
