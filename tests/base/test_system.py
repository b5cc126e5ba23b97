"""What POSIX and Windows do in different ways: the same tests for both, for Windows on a stand-in, and there itself."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from netboard.base.system.device_files import set_up_windows_port
from netboard.base.system.keys import WINDOWS_ARROWS, WindowsKeys
from netboard.base.system.locks import lock, windows_lock
from netboard.base.system.scheduling import WindowsScheduling
from netboard.base.system.supervision import (
    CTRL_C_EXIT,
    PosixSupervision,
    WindowsSupervision,
    description,
    supervision,
)
from netboard.base.system.windows import Kernel32
from netboard.nodes.operator.keyboard import ARROWS
from windows_stand_in import StandInKernel32


class Locking(NamedTuple):
    """How one kind of system locks and closes a file."""

    lock: Callable[..., None]
    close: Callable[[int], None]


@pytest.fixture
def stand_in() -> StandInKernel32:
    return StandInKernel32()


@pytest.fixture(params=["this system", "windows, stand-in"])
def locking(request: pytest.FixtureRequest, stand_in: StandInKernel32) -> Locking:
    if request.param == "this system":
        return Locking(lock, os.close)
    api = stand_in.api()
    return Locking(
        lambda descriptor, shared: windows_lock(descriptor, shared=shared, api=api, handle_of=lambda it: it),
        stand_in.close_file,
    )


@pytest.fixture
def opened(tmp_path: Path, locking: Locking) -> Iterator[Callable[[str], int]]:
    """Opens a file of a name, as another process would; all are closed at the end."""
    found: list[int] = []

    def open_one(name: str) -> int:
        found.append(os.open(tmp_path / name, os.O_RDWR | os.O_CREAT))
        return found[-1]

    yield open_one
    for descriptor in found:
        try:
            os.fstat(descriptor)
        except OSError:  # the test has closed it
            continue
        os.close(descriptor)


def test_a_writers_lock_excludes_all_others_until_its_file_is_closed(
    locking: Locking, opened: Callable[[str], int]
) -> None:
    writer, other = opened("journal"), opened("journal")
    locking.lock(writer, shared=False)
    locking.lock(opened("another"), shared=False)
    for shared in (False, True):
        with pytest.raises(BlockingIOError):
            locking.lock(other, shared=shared)
    locking.close(writer)
    locking.lock(other, shared=False)


def test_shared_locks_exclude_a_writer_only(locking: Locking, opened: Callable[[str], int]) -> None:
    readers = [opened("part") for _ in range(2)]
    for reader in readers:
        locking.lock(reader, shared=True)
    writer = opened("part")
    with pytest.raises(BlockingIOError):
        locking.lock(writer, shared=False)
    for reader in readers:
        locking.close(reader)
    locking.lock(writer, shared=False)


def test_a_locked_file_can_be_read_and_written(locking: Locking, opened: Callable[[str], int]) -> None:
    writer, reader = opened("part"), opened("part")
    locking.lock(writer, shared=False)
    os.write(writer, b"a chunk")
    assert os.read(reader, 100) == b"a chunk"


# --- processes ---------------------------------------------------------------------------------------------------


def test_no_child_outlives_its_parent_and_one_that_can_stop_by_itself_has_the_time(stand_in: StandInKernel32) -> None:
    launcher = WindowsSupervision(stand_in.api())
    stand_in.process = os.getpid()
    stand_in.running.add(stand_in.process)
    launcher.keep_none()
    launcher.keep_none()  # again, for another set of processes
    assert len(stand_in.jobs) == 1
    for number in (1, 2, 3):
        stand_in.start(number)
    stand_in.process = 1
    parent_ended = WindowsSupervision(stand_in.api()).watch_parent(os.getpid())
    assert not parent_ended()
    stand_in.end(os.getpid())
    assert parent_ended()
    assert {1, 2, 3} <= stand_in.running  # number 1 sends zero force, and ends
    stand_in.end(1)
    assert not {1, 2, 3} & stand_in.running


def test_children_that_are_still_starting_end_with_their_parent(stand_in: StandInKernel32) -> None:
    stand_in.process = os.getpid()
    stand_in.running.add(stand_in.process)
    WindowsSupervision(stand_in.api()).keep_none()
    stand_in.start(1)
    stand_in.end(os.getpid())
    assert 1 not in stand_in.running


def test_parent_that_has_ended_before_it_could_be_watched_has_ended(stand_in: StandInKernel32) -> None:
    assert WindowsSupervision(stand_in.api()).watch_parent(77)()


class FakeProcess:
    """A process that may have a console."""

    def __init__(self, console: bool) -> None:
        self.console = console
        self.received: list[object] = []

    def send_signal(self, number: int) -> None:
        if not self.console:
            raise OSError("the handle is invalid")
        self.received.append(number)

    def terminate(self) -> None:
        self.received.append("terminated")


@pytest.mark.parametrize("console", [True, False])
def test_request_to_stop_is_ctrl_break_where_there_is_a_console(
    stand_in: StandInKernel32, monkeypatch: pytest.MonkeyPatch, console: bool
) -> None:
    monkeypatch.setattr(signal, "CTRL_BREAK_EVENT", 1, raising=False)
    process: Any = FakeProcess(console)
    WindowsSupervision(stand_in.api()).ask_to_stop(process)
    assert process.received == [1 if console else "terminated"]


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_posix_child_leads_a_session_and_is_asked_to_stop_by_sigterm() -> None:
    script = "import os, time; print(os.getsid(0) == os.getpid(), flush=True); time.sleep(60)"
    command = [sys.executable, "-c", script]
    with subprocess.Popen(command, stdout=subprocess.PIPE, **PosixSupervision().new_group()) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"True\n"
        PosixSupervision().ask_to_stop(process)
        assert process.wait(20) == PosixSupervision.terminated


def test_ends_of_processes_are_described() -> None:
    assert description(-9) == "was killed by signal 9"
    assert description(2) == "ended with exit code 2"
    assert description(CTRL_C_EXIT) == "was ended by Ctrl-Break"
    assert isinstance(supervision, WindowsSupervision if sys.platform == "win32" else PosixSupervision)


# --- real time ---------------------------------------------------------------------------------------------------


def test_loop_precedes_the_thread_that_works_for_it(stand_in: StandInKernel32) -> None:
    windows = WindowsScheduling(stand_in.api())
    windows.permit(60)
    assert stand_in.granted == {}
    windows.set_priority(60)
    of_loop = stand_in.granted["priority"]
    follow = windows.as_here()
    windows.set_priority(60, beside=True)
    assert stand_in.granted["priority"] < of_loop
    follow()
    assert stand_in.granted == {"class": 0x80, "priority": of_loop}


def test_windows_cpus_are_read_and_set(stand_in: StandInKernel32) -> None:
    windows = WindowsScheduling(stand_in.api())
    assert windows.cpus() == {0, 2, 3}
    windows.stay_on([3, 2])
    assert stand_in.granted["mask"] == 0b1100
    with pytest.raises(OSError, match="SetThreadAffinityMask: Windows error 87"):
        windows.stay_on({1})


def test_windows_neither_slows_the_process_nor_coarsens_its_timers(stand_in: StandInKernel32) -> None:
    WindowsScheduling(stand_in.api()).wake_in_time()
    assert stand_in.granted["throttling"] == (5, 0)


def test_windows_refuses_in_words_what_it_does_not_offer(stand_in: StandInKernel32) -> None:
    windows = WindowsScheduling(stand_in.api())
    for refused in (windows.lock_memory, windows.keep_awake, lambda: windows.set_thread(7, 65)):
        with pytest.raises(OSError, match="not offered on win32"):
            refused()


# --- ports, keys, prototypes -------------------------------------------------------------------------------------


def test_windows_serial_port_has_115200_baud(stand_in: StandInKernel32) -> None:
    set_up_windows_port(12, stand_in.api())
    assert int.from_bytes(stand_in.serial[4:8], "little") == 115_200
    assert [name for name, *_ in stand_in.calls] == ["BuildCommDCBW", "SetCommState"]


class Console:
    """A console in which keys were pressed."""

    def __init__(self, typed: str) -> None:
        self.typed = list(typed)

    def kbhit(self) -> bool:
        return bool(self.typed)

    def getwch(self) -> str:
        return self.typed.pop(0)


def test_windows_console_gives_the_codes_of_a_posix_terminal() -> None:
    keys = WindowsKeys(Console("q"))
    keys.begin(all_keys=True)
    assert keys.read(0.0, 64) == b"q"
    assert keys.read(0.0, 64) is None
    keys.end()
    assert set(WINDOWS_ARROWS.values()) == set(ARROWS)
    assert WindowsKeys(Console("\xe0H\xe0M\x00;")).read(0.0, 64) == b"\x1b[A\x1b[C\0"
    assert WindowsKeys(Console("abc")).read(0.0, 2) == b"ab"


def test_function_without_a_prototype_is_refused(stand_in: StandInKernel32) -> None:
    api = stand_in.api()
    with pytest.raises(AttributeError, match=r"Beep: has no entry in netboard\.base\.system\.windows\.PROTOTYPES"):
        api.succeed("Beep", 1, 2)
    assert isinstance(api, Kernel32)
