"""The journal of a session: an append-only file from which a session resumes after a crash of anything.

Rules that hold here: a journal is never written over; whoever appends never waits for the disk, which has a thread of
its own; entries are written and synced one by one, in order, so that a power cut can tear the last line only; what is
counted as durable is on disk, and the file's name with it; a disk that refuses is asked again, and what it said is in
`Journal.trouble` until it takes the entry.
"""

import logging
import os
import time
from datetime import UTC, datetime
from pathlib import Path
from queue import SimpleQueue
from threading import Event, Thread
from typing import Self

from netboard.base.config import Config
from netboard.base.errors import RecordingError
from netboard.recording.format.disk import sync_directory
from netboard.task.journal.entries import Entry, Header, line_of, read_lines

RETRY_SECONDS = 0.5
"""A disk that refused is asked again after so long [s]."""

LAST_TRIES = 3
"""And so often once the journal is to be closed [1]."""

CLOSE_SECONDS = 10.0
"""A disk that does not answer holds the end up for so long [s]."""

log = logging.getLogger(__name__)


def journal_path(directory: Path, config: Config) -> Path:
    """Name of the journal of a session."""
    return directory / f"{config.session.dyad}_{config.session.name}.journal.jsonl"


class Journal:
    """An open journal. Make it with `create` or `reopen`.

    Attributes
    ----------
    durable : int
        How many entries, the header not counted, are on disk [1].
    trouble : str
        What the disk said if it did not take the newest entries; empty while all is well.
    """

    def __init__(self, path: Path, handle: int, end: int, durable: int) -> None:
        self.path = path
        self.durable = durable
        self.trouble = ""
        self._handle = handle
        self._end = end
        self._appended = durable
        self._waiting: SimpleQueue[bytes | None] = SimpleQueue()
        self._closing = Event()
        self._thread = Thread(target=self._work, name="journal", daemon=True)
        self._thread.start()

    @classmethod
    def create(cls, path: Path, header: Header) -> Self:
        """Begin a journal; its header is on disk, and so is its name, when this returns.

        Parameters
        ----------
        path : Path
            The file; its folder is made if it is not there.
        """
        line = line_of(header, _now())
        try:
            return cls(path, _new(path, line), len(line), 0)
        except OSError as error:
            if isinstance(error, FileExistsError) and path.exists():
                raise RecordingError(
                    f"{path}: exists already: this session was begun before. Go on with it: netboard server --resume; "
                    "or give the new session another name ([session] name, dyad)"
                ) from None
            raise RecordingError(f"{path}: cannot be written: {error.strerror or error}") from error

    @classmethod
    def reopen(cls, path: Path) -> tuple[Self, Header, tuple[Entry, ...], bytes]:
        """Go on with a journal; a last line that was torn stays until the next entry takes its place.

        Returns
        -------
        (Journal, Header, tuple of Entry, bytes)
            The journal, what it says, and the torn line, empty without one.
        """
        try:
            lines = read_lines(path.read_bytes(), str(path))
            handle = os.open(path, os.O_RDWR | _BINARY)
        except FileNotFoundError:
            raise RecordingError(f"{path}: is not there: this session was not begun, so leave out --resume") from None
        except OSError as error:
            raise RecordingError(f"{path}: cannot be opened: {error.strerror or error}") from error
        if lines.torn:
            log.warning("%s: its last line was torn, and is left out: %r", path, lines.torn)
        return cls(path, handle, lines.sound, len(lines.entries)), lines.header, lines.entries, lines.torn

    @property
    def appended(self) -> int:
        """How many entries there are, on disk or on their way [1]."""
        return self._appended

    def append(self, entry: Entry) -> None:
        """Add an entry; returns at once."""
        line = line_of(entry, _now())
        self._appended += 1
        self._waiting.put(line)

    def close(self) -> None:
        """Wait until everything is on disk, and close; a second time does nothing."""
        if not self._closing.is_set():
            self._waiting.put(None)
            self._closing.set()
        self._thread.join(CLOSE_SECONDS)
        if self.durable < self._appended:
            missing = self._appended - self.durable
            why = self.trouble or f"{self.path}: the disk does not answer"
            raise RecordingError(f"{why}; {missing} of {self._appended} entries are not on disk")

    # --- what the thread does ------------------------------------------------------------------------------------

    def _work(self) -> None:
        while (line := self._waiting.get()) is not None:
            if not self._bring_to_disk(line):
                break
            self.durable += 1
        os.close(self._handle)

    def _bring_to_disk(self, line: bytes) -> bool:
        """Write a line, as often as it takes; False if the disk still refuses while the journal is being closed."""
        last_tries = LAST_TRIES
        while last_tries:
            last_tries -= self._closing.is_set()
            try:
                if os.fstat(self._handle).st_nlink == 0:
                    self._restore()
                _write(self._handle, self._end, line)
            except OSError as error:
                self._complain(f"{self.path}: cannot be written: {error.strerror or error}")
                if self._closing.wait(RETRY_SECONDS):
                    time.sleep(RETRY_SECONDS)
            else:
                self._end += len(line)
                self.trouble = ""
                return True
        return False

    def _restore(self) -> None:
        """Write a file that was deleted anew, from what is still open."""
        log.warning("%s: was deleted, and is written anew", self.path)
        handle = _new(self.path, os.pread(self._handle, self._end, 0))
        os.close(self._handle)
        self._handle = handle

    def _complain(self, trouble: str) -> None:
        if trouble != self.trouble:
            log.error("%s", trouble)
        self.trouble = trouble


_BINARY = getattr(os, "O_BINARY", 0)


def _new(path: Path, data: bytes) -> int:
    """Make a file that is not there, and its folder, and bring it to disk; without success leave nothing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | _BINARY, 0o644)
    try:
        _write(handle, 0, data)
        sync_directory(path.parent)
    except OSError:
        os.close(handle)
        path.unlink(missing_ok=True)
        raise
    return handle


def _write(handle: int, place: int, line: bytes) -> None:
    """Write a line at its place, over what may have been left there by a try before, and bring it to disk."""
    os.lseek(handle, place, os.SEEK_SET)
    rest = memoryview(line)
    while rest:
        rest = rest[os.write(handle, rest) :]
    os.ftruncate(handle, place + len(line))
    os.fsync(handle)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
