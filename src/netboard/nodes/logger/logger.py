"""The logger: takes every record of a session from the server and writes it to disk.

Records are numbered. Duplicates are dropped, missing records are requested again, and records that the server no longer
has are noted as lost, so a recording has no silent gap. Each block has its own file, which is created with its first
record. Only records that are safely on disk are acknowledged. A restarted logger continues with the first record that
is not acknowledged, in the next part. If the disk runs out of space or disappears, the logger saves what was written,
tells the server why, and ends.
"""

import logging
import shutil
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from netboard.base.clock import now_ns
from netboard.base.config import parse
from netboard.base.errors import ConfigError, NetboardError, WireError
from netboard.base.tables.rig import RecordingSettings
from netboard.base.terminal.shell import shell_command
from netboard.network.protocol.joining import Goodbye, Welcome
from netboard.network.protocol.messages import Message
from netboard.network.protocol.records import LogAck, LogBatch, LogEnd, LogRequest
from netboard.nodes.logger.log_link import Connection, LogEndpoint
from netboard.recording.files.provenance import next_recording, provenance
from netboard.recording.files.writer import RecordingWriter
from netboard.recording.format.channels import block_config, record_of
from netboard.recording.format.disk import Space, require_space, require_writable

log = logging.getLogger(__name__)

ASK_NS = 200_000_000
"""Interval at which missing records are requested again [ns]."""

CHECK_INTERVAL_NS = 1_000_000_000
"""Interval at which the logger checks that the file still exists while nothing arrives [ns]."""


def fit_of(batch: LogBatch, expected: int | None) -> tuple[int, int] | None:
    """Return how a batch fits the records that a logger has.

    ``expected``: number of the next record; None for any. Returns how many records before the batch are lost for good,
    and how many of the batch the logger already has; None if records are missing that the server still has.
    """
    if expected is None:
        return batch.lost, 0
    if batch.first <= expected:
        return 0, expected - batch.first
    if batch.first - batch.lost <= expected:
        return batch.first - expected, 0
    return None


class Logger:
    """Receives the log and writes the recordings.

    ``once``: end with the session instead of waiting for the next one. ``clock``: monotonic time [ns]. ``wall_clock``:
    UTC, read once for each file [ns].
    """

    def __init__(
        self,
        settings: RecordingSettings,
        link: LogEndpoint,
        *,
        once: bool,
        clock: Callable[[], int] = now_ns,
        wall_clock: Callable[[], int] = time.time_ns,
    ) -> None:
        self.finished: list[Path] = []
        self._settings = settings
        self._server = Connection(link, "logger", {}, clock)
        self._once = once
        self._clock = clock
        self._wall_clock = wall_clock
        self._writer: RecordingWriter | None = None
        self._welcome: Welcome | None = None
        self._session = ""
        self._ended = ""
        self._log_time_minus_clock = 0
        self._asked_ns = -ASK_NS
        self._checked_ns = 0
        self._empty_end_seen = False
        self._space_is_low = False

    def run(self, stopping: Callable[[], bool]) -> int:
        """Record until stopped, or with `once` until the session is over.

        Returns the exit code: 0, or 1 if the recording could not be continued.
        """
        try:
            require_writable(Path(self._settings.directory), "[recording] directory")
        except ConfigError as error:  # it may become writable before the session begins
            log.warning("%s", error)
        log.info("waiting for the server")
        try:
            while not (stopping() or (self._once and self._ended)):
                self.step()
            if self._writer is not None:
                self._close("the logger was stopped")
                self._server.send(Goodbye("the logger was stopped"))
        except NetboardError as error:
            log.error("%s", error)
            self._give_up(str(error))
            return 1
        finally:
            if self._writer is not None:
                self._writer.abandon()
        return 0

    def step(self) -> None:
        """Wait briefly for the server, take what has arrived, and do what is due."""
        for message in self._server.messages():
            self._handle(message)
        if self._writer is not None:
            self._keep(self._writer)

    def _keep(self, writer: RecordingWriter) -> None:
        """Flush the file when due; if nothing arrives, check now and then that the file still exists."""
        due = writer.is_due(self._log_time())
        if due:
            writer.flush(self._log_time())
        if due or self._clock() - self._checked_ns >= CHECK_INTERVAL_NS:
            self._acknowledge(writer)

    def _log_time(self) -> int:
        """Return UTC when the file was opened plus the monotonic time since, which is never stepped [ns]."""
        return self._clock() + self._log_time_minus_clock

    def _handle(self, message: Message | None) -> None:
        match message:
            case None:  # the invalid frame may have been a batch
                self._ask()
            case Welcome():
                self._enter(message)
            case LogBatch():
                self._take(message)
            case LogEnd(last=last):
                self._end(last)
            case Goodbye(reason=reason):
                log.info("the server ended the connection: %s", reason)
                self._close(f"the server left: {reason}")

    def _enter(self, welcome: Welcome) -> None:
        """Enter a session, or continue the current one."""
        # A server that has not closed yet welcomes the logger again, which has nothing more to record.
        if welcome.session == self._ended:
            return
        if self._ended and self._once:
            return
        if self._welcome is not None and welcome.session != self._session:
            # Not yet welcomed: the numbers of the old session must not be acknowledged in the new one.
            self._close("the server began another session")
            if self._once:
                return
        self._server.welcomed = True
        if self._writer is None:
            self._welcome, self._session = welcome, welcome.session
            self._folder()
        else:
            self._acknowledge(self._writer)
        self._ask()

    def _folder(self) -> Path:
        """Create the folder of the recordings, and check the free space."""
        directory = Path(self._settings.directory)
        try:
            directory.mkdir(parents=True, exist_ok=True)
            require_space(directory, shutil.disk_usage(directory).free)
        except OSError as error:
            raise NetboardError(f"{directory}: cannot be made: {error.strerror}") from error
        return directory

    def _open(self, welcome: Welcome) -> RecordingWriter:
        config = parse(welcome.config, "the server's configuration")
        directory = self._folder()
        utc_ns, monotonic_ns = self._wall_clock(), self._clock()
        path, part = next_recording(directory, config, welcome.session, utc_ns)
        metadata = provenance(welcome, config, part, utc_ns, monotonic_ns)
        self._log_time_minus_clock = utc_ns - monotonic_ns
        self._writer = writer = RecordingWriter(path, metadata, welcome.config, self._settings, utc_ns)
        self._empty_end_seen = False
        log.info("recording to %s", path)
        self._check_space(writer.space(utc_ns))
        return writer

    def _ask(self) -> None:
        """Request the next record and all that follow."""
        self._asked_ns = self._clock()
        first = None if self._writer is None else self._writer.next_record
        self._server.send(LogRequest(-1 if first is None else first))

    def _ask_again(self) -> None:
        """Request missing records, but not once for every batch that arrives before the answer."""
        if self._clock() - self._asked_ns >= ASK_NS:
            self._ask()

    def _take(self, batch: LogBatch) -> None:
        writer = self._writer
        if writer is None:
            if self._welcome is None or not self._server.welcomed:
                return
            writer = self._open(self._welcome)
        fit = fit_of(batch, writer.next_record)
        if fit is None:
            self._ask_again()
            return
        lost, duplicates = fit
        now = self._log_time()
        if lost:
            first = batch.first - lost
            log.error("records %d to %d are lost: the server no longer has them", first, batch.first - 1)
            writer.note_lost(first, lost, now)
        for number, record in enumerate(batch.records[duplicates:], start=batch.first + duplicates):
            writer = self._write(writer, record, number, now)

    def _write(self, writer: RecordingWriter, frame: bytes, number: int, now: int) -> RecordingWriter:
        """Write a record; return the writer of the next one, which is another after the first record of a block."""
        try:
            record = record_of(frame)
        except WireError as error:
            log.error("record %d cannot be read: %s", number, error)
            writer.note_unreadable(frame, number, str(error), now)
            return writer
        if writer.next_record is not None and (config := block_config(record)):
            writer = self._begin_block(writer, config)
        writer.write(record, number, self._log_time())
        return writer

    def _begin_block(self, writer: RecordingWriter, config: str) -> RecordingWriter:
        """Finish the file of a block, and open that of the next one."""
        assert self._welcome is not None
        self._finish(writer, "complete")
        self._welcome = replace(self._welcome, config=config)
        return self._open(self._welcome)

    def _end(self, last: int) -> None:
        """Finish the recording if it is complete; otherwise request the rest.

        Before the welcome nothing can be acknowledged; the server repeats the end after it.
        """
        if self._welcome is None or not self._server.welcomed:
            return
        following = None if self._writer is None else self._writer.next_record
        # After a request for what no logger has yet, an end without any record means that nothing is left.
        # The logger believes it only the second time.
        nothing_left = last < 0 or (following is None and self._empty_end_seen)
        if nothing_left or (following is not None and following > last):
            self._close("complete")
            self._server.send(Goodbye("the recording is complete"))
            return
        self._empty_end_seen = True
        self._ask()

    def _close(self, ended: str) -> None:
        """End the session: finish its recording, if there is one, and acknowledge it."""
        if self._welcome is None:
            return
        if self._writer is not None:
            self._finish(self._writer, ended)
        self._welcome, self._ended = None, self._session

    def _finish(self, writer: RecordingWriter, ended: str) -> None:
        """Finish a recording and give it its final name."""
        writer.finish(self._log_time(), ended)
        self._writer = None
        self.finished.append(writer.path)
        log.info("finished %s%s", writer.path, "" if ended == "complete" else f" ({ended})")
        self._acknowledge(writer)

    def _give_up(self, reason: str) -> None:
        """Save what can be saved after a fault, and leave."""
        if self._writer is not None and self._writer.is_open:
            try:
                self._close(reason)
            except NetboardError as error:
                log.error("%s", error)
        if self._writer is not None and self._writer.part.exists():
            command = shell_command("netboard", "recover", self._writer.part)
            log.error("the file is complete up to its last chunk: %s", command)
        self._server.send(Goodbye(reason[:1000]))

    def _acknowledge(self, writer: RecordingWriter) -> None:
        self._checked_ns = self._clock()
        space = writer.space(self._log_time())
        if writer.durable is not None and self._server.welcomed:
            self._server.send(LogAck(writer.durable, space.free, writer.path.name, writer.size))
        self._check_space(space)

    def _check_space(self, space: Space) -> None:
        """Warn when space becomes scarce; stop while there is enough to finish the recording."""
        if space.low and not self._space_is_low:
            log.warning("%s: only %s", self._settings.directory, space)
        self._space_is_low = space.low
        if space.out and self._writer is not None:
            raise NetboardError(f"{self._settings.directory}: only {space}: the recording had to end")
