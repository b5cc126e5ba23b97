"""What a process does when it is asked to stop, and what it says of the system."""

import gc
import logging
import os
import signal
import sys

import pytest

from netboard.process import (
    MCL_CURRENT,
    MCL_FUTURE,
    STOP_SIGNALS,
    WITH_PARENT,
    Stopping,
    lock_memory,
    real_time,
    steady_loop,
)


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize("number", STOP_SIGNALS)
def test_a_stop_signal_is_an_answer_and_a_second_one_interrupts_as_usual(number: signal.Signals) -> None:
    before = signal.getsignal(number)
    with Stopping() as stopping:
        assert not stopping()
        os.kill(os.getpid(), number)
        assert stopping()
        assert signal.getsignal(number) == before
    assert signal.getsignal(number) == before


def test_without_a_signal_the_handlers_are_put_back() -> None:
    before = [signal.getsignal(number) for number in STOP_SIGNALS]
    with Stopping() as stopping:
        assert not stopping()
    assert [signal.getsignal(number) for number in STOP_SIGNALS] == before


def test_a_steady_loop_is_not_interrupted_by_the_collector() -> None:
    interval = sys.getswitchinterval()
    try:
        steady_loop()
        assert not gc.isenabled()
        assert gc.get_freeze_count() > 0
    finally:
        gc.unfreeze()
        gc.enable()
        sys.setswitchinterval(interval)


class Refusing:
    """An operating system that does not grant real-time scheduling."""

    SCHED_FIFO = 1

    @staticmethod
    def sched_param(priority: int) -> int:
        return priority

    @staticmethod
    def sched_setscheduler(process: int, policy: int, parameter: int) -> None:
        raise PermissionError(1, "Operation not permitted")


def test_refused_real_time_scheduling_is_one_line_and_not_fatal(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("netboard.process.os", Refusing)
    with caplog.at_level(logging.INFO):
        real_time(50)
    assert caplog.messages == ["real-time scheduling refused (Operation not permitted); going on without it"]


def test_a_system_without_real_time_scheduling_is_said_too(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("netboard.process.os", object())
    with caplog.at_level(logging.INFO):
        real_time(50)
    assert "not offered" in caplog.text


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX processes")
def test_a_process_that_shall_not_outlive_its_parent_stops_when_it_is_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(WITH_PARENT, "1")
    with Stopping() as stopping:
        assert not stopping()
        monkeypatch.setattr(os, "getppid", lambda: 1)
        assert stopping()
    monkeypatch.delenv(WITH_PARENT)
    with Stopping() as stopping:
        assert not stopping()


class Library:
    """A C library whose mlockall answers as it is told."""

    def __init__(self, answer: int) -> None:
        self.answer = answer

    def mlockall(self, flags: int) -> int:
        assert flags == MCL_CURRENT | MCL_FUTURE
        return self.answer


@pytest.mark.skipif(sys.platform != "linux", reason="mlockall of Linux")
@pytest.mark.parametrize(
    ("answer", "said"),
    [(0, "memory locked"), (-1, "locking memory refused (Operation not permitted); going on without it")],
)
def test_locked_memory_is_said_and_refusal_is_not_fatal(
    answer: int, said: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("netboard.process.ctypes.CDLL", lambda name, use_errno: Library(answer))
    monkeypatch.setattr("netboard.process.ctypes.get_errno", lambda: 1)
    with caplog.at_level(logging.INFO):
        lock_memory()
    assert caplog.messages == [said]
