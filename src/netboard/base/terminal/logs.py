"""Log lines on standard error, written so that no loop waits for a terminal."""

import logging
import sys
import time
from contextlib import suppress
from queue import Full, Queue
from threading import Event, Thread
from typing import TextIO

from netboard.base.process.realtime import beside_loop

STARTED = time.monotonic()
"""Time of the start of this process, or of its first line of netboard [s]."""

LOG_INTERVAL_S = 1.0
"""Interval between log lines of a repeated event [s]."""

MAX_LOG_LINES = 1000
"""Log lines that wait for a terminal that takes none; later ones are dropped [1]."""

FLUSH_S = 1.0
"""Longest wait for such a terminal when the process ends [s]."""


def log_to_stderr(name: str) -> None:
    """Log to standard error, with the time since the start and the name of the process in each line."""
    handler = BackgroundLog(sys.stderr)
    handler.setFormatter(MonotonicFormatter(f"%(relativeCreated)8d ms  {name}  %(message)s"))
    logging.basicConfig(level=logging.INFO, handlers=[handler], force=True)


class MonotonicFormatter(logging.Formatter):
    """Takes the time since the start from a clock that is never stepped; `logging` takes it from the wall clock."""

    def format(self, record: logging.LogRecord) -> str:
        """Return a line."""
        record.relativeCreated = (time.monotonic() - STARTED) * 1e3
        return super().format(record)


class BackgroundLog(logging.Handler):
    """Writes log lines in a thread of its own, so that no loop waits for a terminal.

    A terminal stopped by Ctrl-S, or a pipe that nobody reads, accepts nothing. A server that waited for it would stop
    both hands' forces, and an agent would leave its device with the last force.
    """

    def __init__(self, stream: TextIO | None) -> None:
        super().__init__()
        self._stream = stream
        self._lines: Queue[str | Event | None] = Queue(MAX_LOG_LINES)
        self._dropped = 0
        Thread(target=self._write, name="log", daemon=True).start()

    def emit(self, record: logging.LogRecord) -> None:
        """Pass a line to the thread; drop it if too many wait."""
        try:
            line = self.format(record)
        except (TypeError, ValueError, LookupError) as error:  # a mistake in a message must not end a loop
            line = f"{record.msg!r} {record.args!r}: {error!r}"
        try:
            self._lines.put_nowait(line)
        except Full:
            self._dropped += 1

    def flush(self) -> None:
        """Wait until all lines so far are written, or the terminal has accepted none for some time."""
        written = Event()
        with suppress(Full):
            self._lines.put(written, timeout=FLUSH_S)
            written.wait(FLUSH_S)

    def close(self) -> None:
        """End the thread after the last line."""
        with suppress(Full):
            self._lines.put_nowait(None)
        super().close()

    def _write(self) -> None:
        while (line := self._lines.get()) is not None:
            if isinstance(line, Event):
                self._report_dropped()
                line.set()
                continue
            beside_loop()
            self._put_out(line)
            if self._lines.empty():
                self._report_dropped()

    def _report_dropped(self) -> None:
        """Write how many lines were dropped since the last report."""
        if dropped := self._dropped:
            self._dropped -= dropped
            self._put_out(f"{dropped} log lines were dropped: the terminal was stopped, or too slow")

    def _put_out(self, line: str) -> None:
        """Write a line; lose it if the other end of the pipe, or the stream, was closed."""
        with suppress(OSError, ValueError):
            if self._stream is not None:
                self._stream.write(line + "\n")
                self._stream.flush()


class RateLimitedLog:
    """Logs a repeated event at once, then at most once a second, with the number of times."""

    def __init__(self, log: logging.Logger) -> None:
        self._log = log
        self._count = 0  # events since the last line
        self._logged = -LOG_INTERVAL_S  # time of the last line

    def log(self, text: str) -> None:
        """Log the event, or only count it."""
        self._count += 1
        now = time.monotonic()
        if now - self._logged >= LOG_INTERVAL_S:
            self._log.warning("%s%s", text, f" (the last of {self._count})" if self._count > 1 else "")
            self._logged, self._count = now, 0
