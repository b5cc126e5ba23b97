"""Log lines: none is lost silently, and none delays a loop."""

import contextlib
import io
import logging
import os
import sys
from threading import Thread

import pytest

from netboard.base.terminal import logs

linux = pytest.mark.skipif(sys.platform != "linux", reason="what Linux offers")


def test_frequent_messages_are_logged_at_a_limited_rate(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    seldom = logs.RateLimitedLog(logging.getLogger("test"))
    for number in range(1000):
        seldom.log(f"number {number}")
    monkeypatch.setattr(logs, "LOG_INTERVAL_S", 0.0)
    seldom.log("the end")
    assert [record.message for record in caplog.records] == ["number 0", "the end (the last of 1000)"]


@linux
def test_a_terminal_that_accepts_nothing_delays_no_log_line_and_gets_all_of_them_later() -> None:
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    filled = 0
    with contextlib.suppress(BlockingIOError):
        while True:
            filled += os.write(writing, b"x")
    os.set_blocking(writing, True)
    log = logging.getLogger("test.background")
    log.propagate = False
    with os.fdopen(writing, "w") as terminal:
        background = logs.BackgroundLog(terminal)
        log.addHandler(background)
        for number in range(3):
            log.error("line %d", number)  # would wait for ever in this thread
        assert os.read(reading, filled) == b"x" * filled
        background.flush()
        assert os.read(reading, 100).splitlines() == [b"line 0", b"line 1", b"line 2"]
        log.removeHandler(background)
        background.close()
    os.close(reading)


def test_log_lines_beyond_the_limit_and_a_closed_terminal_are_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(logs, "MAX_LOG_LINES", 2)
    monkeypatch.setattr(logs, "FLUSH_S", 0.01)
    reading, writing = os.pipe()
    os.close(reading)
    line = logging.LogRecord("test", logging.ERROR, __file__, 1, "a line", None, None)
    with os.fdopen(writing, "w") as terminal:
        for stream in (terminal, None):
            background = logs.BackgroundLog(stream)
            for _ in range(100):
                background.emit(line)
            background.flush()
            background.close()
        terminal.buffer.raw.close()  # type: ignore[attr-defined]  # what is buffered cannot be written any more


def test_no_log_line_of_a_burst_before_the_end_is_lost_silently() -> None:
    """A pipe that is read only when the queue is full."""
    reading, writing = os.pipe()
    received: list[bytes] = []

    def read() -> None:
        while part := os.read(reading, 2**20):
            received.append(part)

    reader = Thread(target=read)
    with os.fdopen(writing, "w") as terminal:
        background = logs.BackgroundLog(terminal)
        for number in range(2 * logs.MAX_LOG_LINES):
            text = f"{number} {'x' * 200}"
            background.emit(logging.LogRecord("test", logging.ERROR, __file__, 1, text, None, None))
        reader.start()
        background.flush()
        background.close()
    reader.join()
    os.close(reading)
    *lines, last = b"".join(received).decode().splitlines()
    dropped = int(last.removesuffix(" log lines were dropped: the terminal was stopped, or too slow"))
    assert dropped > 0
    assert len(lines) + dropped == 2 * logs.MAX_LOG_LINES


def test_step_of_the_wall_clock_does_not_change_the_time_of_a_log_line(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = io.StringIO()
    monkeypatch.setattr("sys.stderr", terminal)
    root = logging.getLogger()
    before, level = root.handlers[:], root.level
    root.handlers.clear()
    try:
        logs.log_to_stderr("server")
        line = logging.makeLogRecord({"msg": "a line", "levelno": logging.INFO, "relativeCreated": -3.6e6})
        root.handle(line)
        root.handlers[0].flush()
    finally:
        root.handlers[0].close()
        root.handlers[:] = before
        root.setLevel(level)
    milliseconds, unit, rest = terminal.getvalue().split(maxsplit=2)
    assert int(milliseconds) >= 0
    assert (unit, rest) == ("ms", "server  a line\n")


def test_log_line_that_cannot_be_formatted_is_no_error_of_the_loop() -> None:
    terminal = io.StringIO()
    background = logs.BackgroundLog(terminal)
    background.handle(logging.LogRecord("test", logging.ERROR, __file__, 1, "%d samples", ("no",), None))
    background.flush()
    background.close()
    assert terminal.getvalue().startswith("'%d samples' ('no',): TypeError(")
