"""How kernels read the clock and sleep: the same tests for POSIX and for Windows, elsewhere on a stand-in."""

import os
import socket
import sys
from collections.abc import Callable, Iterator
from ctypes import CDLL
from typing import Any, NamedTuple

import numpy as np
import pytest

from netboard.base.clock import now_ns
from netboard.network.transport import waiting
from netboard.network.transport.waiting import NO_FILE, POSIX_FIELDS, WINDOWS_FIELDS
from windows_stand_in import COUNTS_PER_S, StandInKernel32, StandInWinsock

LONG_NS = 60_000_000_000
"""Longer than any test may sleep [ns]."""


class System(NamedTuple):
    """The kernels of one kind of system, and a record for them."""

    record: Any
    resolution_ns: int
    machine_ns: Callable[[Any], int]
    forget_files: Callable[[Any], None]
    await_file: Callable[[Any, int], None]
    has_signalled: Callable[[Any, int], bool]
    sleep: Callable[[Any, int], None]
    leave_stale_event: Callable[[], None]


@pytest.fixture(scope="module")
def kernel32() -> Iterator[StandInKernel32]:
    """The stand-ins of this process: machine code keeps the addresses that it was first linked with."""
    kernel32 = StandInKernel32()
    winsock = StandInWinsock(kernel32)
    waiting.windows_symbols(kernel32.api(), winsock, CDLL(None))
    yield kernel32
    assert {name for name, *_ in winsock.calls} == {"WSAEventSelect", "select"}


@pytest.fixture(params=["this system"] if sys.platform == "win32" else ["this system", "windows, stand-in"])
def system(request: pytest.FixtureRequest) -> System:
    if request.param == "windows, stand-in":
        return windows_with(request.getfixturevalue("kernel32"))
    record = np.zeros(1, np.dtype(waiting.FIELDS, align=True))
    waiting.prepare(record[0])
    kernels = (waiting.machine_ns, waiting.forget_files, waiting.await_file)
    others = (waiting.has_signalled, waiting.sleep_until_signalled)
    return System(record, 10**9 // COUNTS_PER_S, *kernels, *others, lambda: None)


def windows_with(kernel32: StandInKernel32) -> System:
    """Windows' kernels, with these functions."""
    names = ("machine_ns", "forget_files", "await_file", "has_signalled", "sleep_until_signalled")
    kernels = [getattr(waiting, f"windows_{name}") for name in names]
    record = np.zeros(1, np.dtype(WINDOWS_FIELDS, align=True))
    waiting.windows_prepare(record[0], kernel32.api())

    def leave_stale_event() -> None:
        kernel32.handles[int(record[0]["handles"][1])][1]["event"] = True

    return System(record, 10**9 // COUNTS_PER_S, *kernels, leave_stale_event)


@pytest.fixture
def pairs() -> Iterator[list[tuple[socket.socket, socket.socket]]]:
    """Pairs of connected sockets."""
    made = [socket.socketpair() for _ in range(3)]
    yield made
    for pair in made:
        for end in pair:
            end.close()


def test_clock_is_that_of_python(system: System) -> None:
    before = now_ns()
    read = system.machine_ns(system.record)
    assert before - system.resolution_ns <= read <= now_ns()


def test_sleep_ends_with_the_time(system: System) -> None:
    for span_ns in (0, 200_000, 3_000_000):
        system.forget_files(system.record)
        began = now_ns()
        system.sleep(system.record, span_ns)
        assert now_ns() - began >= span_ns - system.resolution_ns


def test_sleep_ends_with_a_signal_and_says_whose_it_was(system: System, pairs: list[Any]) -> None:
    files = [reading.fileno() for reading, _ in pairs]
    for signalling in ({1}, {0, 2}):
        for number in signalling:
            pairs[number][1].send(b"x")
        system.forget_files(system.record)
        for file in (*files, NO_FILE):
            system.await_file(system.record, file)
        system.sleep(system.record, LONG_NS)
        assert {k for k, file in enumerate(files) if system.has_signalled(system.record, file)} == signalling
        assert not system.has_signalled(system.record, NO_FILE)
        for number in signalling:
            pairs[number][0].recv(1)


def test_sleep_without_a_signal_finds_none(system: System, pairs: list[Any]) -> None:
    file = pairs[0][0].fileno()
    system.forget_files(system.record)
    system.await_file(system.record, file)
    system.sleep(system.record, 2_000_000)
    assert not system.has_signalled(system.record, file)


def test_forgotten_file_ends_no_sleep(system: System, pairs: list[Any]) -> None:
    forgotten, other = pairs[0][0].fileno(), pairs[1][0].fileno()
    system.await_file(system.record, forgotten)
    pairs[0][1].send(b"x")
    system.forget_files(system.record)
    system.await_file(system.record, other)
    system.sleep(system.record, 2_000_000)
    assert not system.has_signalled(system.record, other)


def test_event_of_a_frame_that_has_been_read_ends_no_sleep(system: System, pairs: list[Any]) -> None:
    system.forget_files(system.record)
    system.await_file(system.record, pairs[0][0].fileno())
    system.leave_stale_event()
    began = now_ns()
    system.sleep(system.record, 5_000_000)
    assert now_ns() - began >= 5_000_000 - system.resolution_ns


def test_windows_waits_for_as_many_sockets_as_select_takes() -> None:
    record = np.zeros(1, np.dtype(WINDOWS_FIELDS, align=True))
    for file in range(1000, 1000 + 2 * waiting.SOCKETS):
        waiting.windows_await_file(record, file)
    assert record[0]["wanted"][0] == waiting.SOCKETS
    assert record[0]["wanted"][waiting.SOCKETS] == 1000 + waiting.SOCKETS - 1


def test_fields_of_posix_keep_their_layout() -> None:
    """Kernels from the cache of a version before would read others."""
    assert os.name != "posix" or waiting.FIELDS is POSIX_FIELDS
