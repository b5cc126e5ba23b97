"""Process behaviour when asked to stop, and reports about the system."""

import contextlib
import errno
import gc
import logging
import math
import os
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from netboard.base.process.realtime import (
    IO_PRIORITY_STEP,
    OFF,
    OK,
    PLACES,
    Priority,
    cpu_set,
    cpus_for,
    io_priority,
    leave_reserved_cpus,
    prepare,
    steady_loop,
)
from netboard.base.process.resources import peak_memory, resident_memory
from netboard.base.process.stopping import (
    STOP_SIGNALS,
    STOP_WITH_PARENT,
    Stopping,
    interrupted_by_stop_signals,
    uninterrupted,
)
from netboard.base.tables.rig import Realtime

linux = pytest.mark.skipif(sys.platform != "linux", reason="what Linux offers")


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize("number", STOP_SIGNALS)
def test_first_stop_signal_is_handled_and_the_next_interrupts_for_cleanup(number: signal.Signals) -> None:
    outside = {each: signal.signal(each, signal.SIG_DFL) for each in STOP_SIGNALS}  # nohup lets a test run ignore one
    with Stopping() as stopping:
        assert not stopping()
        os.kill(os.getpid(), number)
        assert stopping()
        for second in STOP_SIGNALS:  # a closing terminal sends two: neither may end a process that renders a force
            with pytest.raises(KeyboardInterrupt):
                os.kill(os.getpid(), second)
    assert {signal.getsignal(each) for each in STOP_SIGNALS} == {signal.SIG_DFL}
    for each, handler in outside.items():
        signal.signal(each, handler)


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize("number", STOP_SIGNALS)
def test_every_stop_signal_can_interrupt_for_cleanup(number: signal.Signals) -> None:
    outside = signal.signal(number, signal.SIG_DFL)  # a test run in the background may ignore Ctrl-C
    try:
        with pytest.raises(KeyboardInterrupt), interrupted_by_stop_signals():
            os.kill(os.getpid(), number)
        assert signal.getsignal(number) == signal.SIG_DFL
    finally:
        signal.signal(number, outside)


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize("number", STOP_SIGNALS)
@pytest.mark.parametrize("fails", [False, True])
def test_stop_signal_waits_for_the_end_of_what_must_not_be_interrupted(number: signal.Signals, fails: bool) -> None:
    outside = signal.signal(number, signal.SIG_DFL)
    done = []

    def run() -> None:
        with interrupted_by_stop_signals(), uninterrupted():
            os.kill(os.getpid(), number)
            done.append("whole")
            if fails:
                raise OSError("the disk is full")

    try:
        with pytest.raises(KeyboardInterrupt):
            run()
        assert done == ["whole"]
        assert signal.getsignal(number) == signal.SIG_DFL
    finally:
        signal.signal(number, outside)


def test_no_signal_handler_is_set_outside_of_the_main_thread() -> None:
    found = []

    def run() -> None:
        with uninterrupted():
            found.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert found == [signal.getsignal(signal.SIGINT)]


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_closing_terminal_stays_ignored() -> None:
    outside = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup does
    try:
        with interrupted_by_stop_signals():
            os.kill(os.getpid(), signal.SIGHUP)
        with Stopping() as stopping:
            os.kill(os.getpid(), signal.SIGHUP)
            assert not stopping()
    finally:
        signal.signal(signal.SIGHUP, outside)


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize("name", ["SIGTSTP", "SIGTTOU"])
def test_ctrl_z_does_not_suspend_a_process_that_renders_forces(name: str) -> None:
    script = f"""
import os, signal
from netboard.base.process.stopping import no_terminal_suspension
before = signal.getsignal(signal.{name})
with no_terminal_suspension():
    os.kill(os.getpid(), signal.{name})
assert signal.getsignal(signal.{name}) == before
"""
    child = subprocess.Popen([sys.executable, "-c", script], process_group=0)  # a group that the signal can stop
    try:
        assert child.wait(20) == 0
    finally:
        child.kill()
        child.wait()


def test_signal_handlers_are_restored_without_a_signal() -> None:
    before = [signal.getsignal(number) for number in STOP_SIGNALS]
    with Stopping() as stopping:
        assert not stopping()
    assert [signal.getsignal(number) for number in STOP_SIGNALS] == before


@pytest.mark.slow
def test_steady_loop_disables_the_garbage_collector(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("netboard.base.process.realtime._granted", {})
    interval = sys.getswitchinterval()
    try:
        steady_loop()
        assert not gc.isenabled()
        assert gc.get_freeze_count() > 0
    finally:
        gc.unfreeze()
        gc.enable()
        sys.setswitchinterval(interval)


class Machine:
    """A fake machine that logs all requests, and grants them or refuses with an error."""

    def __init__(self, answer: int = 0) -> None:
        self.answer = answer
        self.asked: list[object] = []

    def grant(self, *request: object) -> None:
        self.asked.append(request)
        if self.answer:
            raise OSError(self.answer, os.strerror(self.answer))

    def prctl(self, *request: int) -> int:
        return self._library(request)

    def mlockall(self, *request: int) -> int:
        return self._library(request)

    def _library(self, request: object) -> int:
        self.asked.append(request)
        return -1 if self.answer else 0


def on(machine: Machine, monkeypatch: pytest.MonkeyPatch, folder: Path) -> Machine:
    """Redirect all requests to the fake machine."""
    monkeypatch.setattr("netboard.base.process.realtime._granted", {})
    monkeypatch.setattr("netboard.base.system.scheduling.os.sched_setscheduler", machine.grant)
    monkeypatch.setattr("netboard.base.system.scheduling.os.sched_setaffinity", machine.grant)
    monkeypatch.setattr("netboard.base.system.scheduling.os.sched_getaffinity", lambda process: {0, 1, 2, 3})
    monkeypatch.setattr("netboard.base.system.scheduling.os.geteuid", lambda: 0)
    monkeypatch.setattr("netboard.base.system.c_library.ctypes.CDLL", lambda name, use_errno: machine)
    monkeypatch.setattr("netboard.base.system.c_library.ctypes.get_errno", lambda: machine.answer)
    monkeypatch.setattr("netboard.base.system.scheduling.DMA_LATENCY_FILE", folder / "cpu_dma_latency")
    return machine


ASKED = ("scheduling", "cpus", "memory", "timer_slack", "core_sleep")


@linux
def test_all_real_time_settings_are_requested_and_granted(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    machine = on(Machine(), monkeypatch, tmp_path)
    (tmp_path / "cpu_dma_latency").touch()
    with caplog.at_level(logging.INFO):
        came = prepare(Realtime(), Priority.SERVER, "2-3")
    assert came == dict.fromkeys(ASKED, OK)
    assert caplog.messages == ["real time: scheduling ok, cpus ok, memory ok, timer_slack ok, core_sleep ok"]
    fifo = (0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(60))
    assert machine.asked[:2] == [fifo, (0, os.SCHED_OTHER | os.SCHED_RESET_ON_FORK, os.sched_param(0))]
    assert (0, {2, 3}) in machine.asked
    assert (tmp_path / "cpu_dma_latency").read_bytes() == (2).to_bytes(4, sys.byteorder)
    assert io_priority(came, Priority.SERVER) == Priority.SERVER + IO_PRIORITY_STEP
    for name in ("gc.collect", "gc.freeze", "gc.disable"):
        monkeypatch.setattr(f"netboard.base.process.realtime.{name}", lambda: None)
    monkeypatch.setattr("netboard.base.process.realtime.sys.setswitchinterval", machine.grant)
    steady_loop()
    assert machine.asked[-1] == fifo


@linux
def test_refused_settings_are_logged_in_one_line_each_and_not_fatal(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    on(Machine(errno.EPERM), monkeypatch, tmp_path)
    with caplog.at_level(logging.INFO):
        came = prepare(Realtime(), Priority.AGENT, "1")
    assert set(came) == set(ASKED)
    assert not {OK, OFF} & set(came.values())
    assert "real time: scheduling refused (Operation not permitted); continuing without it" in caplog.messages
    assert "real time: core_sleep refused (No such file or directory); continuing without it" in caplog.messages
    assert len([line for line in caplog.messages if "refused" in line]) == len(ASKED)
    assert io_priority(came, Priority.AGENT) is None


def test_disabled_settings_are_not_requested(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    machine = Machine() if sys.platform != "linux" else on(Machine(), monkeypatch, tmp_path)
    came = prepare(Realtime(scheduling=False, lock_memory=False), Priority.AGENT, "")
    assert came == dict.fromkeys(ASKED, OFF)
    assert machine.asked == []


@pytest.mark.skipif(sys.platform == "win32", reason="Windows' own choice is made when the module is imported")
def test_unsupported_platform_is_reported(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    monkeypatch.setattr("netboard.base.system.scheduling.sys.platform", "plan9")
    with caplog.at_level(logging.INFO):
        came = prepare(Realtime(), Priority.AGENT, "0")
    assert set(came.values()) == {"not offered on plan9"}


@linux
def test_memory_is_not_locked_under_a_memlock_limit(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    machine = on(Machine(), monkeypatch, tmp_path)
    monkeypatch.setattr("netboard.base.system.scheduling.os.geteuid", lambda: 1000)
    monkeypatch.setattr("netboard.base.system.scheduling.resource.getrlimit", lambda which: (8_000_000, 8_000_000))
    came = prepare(Realtime(scheduling=False), Priority.AGENT, "")
    assert came["memory"] == "the limit is 8 MB, expected none"
    assert machine.asked == []


@linux
@pytest.mark.parametrize(
    ("have", "expected"),
    [({0}, ["", "", ""]), ({0, 1}, ["1", "", ""]), ({0, 1, 2}, ["2", "1", "0"]), ({1, 4, 5, 9}, ["9", "5", "4"])],
)
def test_each_loop_gets_its_own_cpu_if_there_are_enough(
    monkeypatch: pytest.MonkeyPatch, have: set[int], expected: list[str]
) -> None:
    monkeypatch.setattr("netboard.base.system.scheduling.os.sched_getaffinity", lambda which: have, raising=False)
    assert [cpus_for(loop, Realtime()) for loop in PLACES] == expected
    named = Realtime(server_cpus="0-1", agent_cpus="")
    assert [cpus_for(loop, named) for loop in PLACES] == ["0-1", "", ""]


@linux
def test_no_cpu_is_chosen_without_cpu_affinity(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr("netboard.base.system.scheduling.os.sched_getaffinity", raising=False)
    assert [cpus_for(loop, Realtime()) for loop in PLACES] == ["", "", ""]


@linux
def test_other_processes_leave_the_cpus_of_the_loops(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    machine = on(Machine(), monkeypatch, tmp_path)
    leave_reserved_cpus(Realtime())
    leave_reserved_cpus(Realtime(server_cpus="0-1", agent_cpus="2,3"))
    assert machine.asked == []
    leave_reserved_cpus(Realtime(server_cpus="2", agent_cpus=""))
    assert machine.asked == [(0, {0, 1, 3})]


def test_cpu_list_is_parsed() -> None:
    assert cpu_set("") == set()
    assert cpu_set("2") == {2}
    assert cpu_set("0,2-4,7") == {0, 2, 3, 4, 7}


@pytest.mark.parametrize("cpus", ["3-", "-", "1-2-3"])
def test_invalid_cpu_list_is_refused(cpus: str) -> None:
    with pytest.raises(OSError, match="expected CPUs such as 0,2-3"):
        cpu_set(cpus)


@pytest.fixture
def supervisor(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[socket.socket]:
    """The socket of a service manager, which receives the notifications of the process."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(str(tmp_path / "notify"))
        listening.setblocking(False)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        yield listening


def notifications(supervisor: socket.socket) -> list[bytes]:
    words = []
    try:
        while True:
            words.append(supervisor.recv(100))
    except BlockingIOError:
        return words


@linux
def test_stop_polling_notifies_ready_then_watchdog_then_stopping(
    supervisor: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [100.0]
    monkeypatch.setattr("netboard.base.process.stopping.time.monotonic", lambda: now[0])
    with Stopping() as stopping:
        assert notifications(supervisor) == []
        stopping()
        stopping()
        assert notifications(supervisor) == [b"READY=1"]
        for now[0] in (100.9, 101.0, 101.1, 102.1):
            stopping()
        assert notifications(supervisor) == [b"WATCHDOG=1", b"WATCHDOG=1"]
    assert notifications(supervisor) == [b"STOPPING=1"]


@linux
def test_notifications_are_repeated_after_a_full_supervisor_socket(
    supervisor: socket.socket, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    now = [100.0]
    monkeypatch.setattr("netboard.base.process.stopping.time.monotonic", lambda: now[0])
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as other, caplog.at_level(logging.INFO):
        other.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            while other.sendto(b"busy", supervisor.getsockname()):
                pass
        stopping = Stopping()
        stopping()
        assert set(notifications(supervisor)) == {b"busy"}
        for now[0] in range(101, 1101):
            stopping()
        words = notifications(supervisor)
        assert (words[0], set(words[1:])) == (b"READY=1", {b"WATCHDOG=1"})
        now[0] += 1
        stopping()
        assert notifications(supervisor) == [b"WATCHDOG=1"]
    assert caplog.messages == []


@linux
def test_no_watchdog_notification_after_a_stop_signal(supervisor: socket.socket) -> None:
    with Stopping() as stopping:
        os.kill(os.getpid(), signal.SIGTERM)
        assert stopping()
        assert notifications(supervisor) == []


@linux
def test_missing_supervisor_is_logged_once(
    supervisor: socket.socket, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "notify").unlink()
    with caplog.at_level(logging.INFO), Stopping() as stopping:
        stopping()
    assert caplog.messages == [f"cannot send READY=1 to {tmp_path / 'notify'} (No such file or directory)"]


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX processes")
def test_process_stops_with_its_parent_if_requested(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(STOP_WITH_PARENT, "1")
    with Stopping() as stopping:
        assert not stopping()
        with Stopping(600.0) as lasting:
            monkeypatch.setattr(os, "getppid", lambda: 1)
            assert stopping()
            assert not lasting()
    monkeypatch.delenv(STOP_WITH_PARENT)
    with Stopping() as stopping:
        assert not stopping()


@linux
def test_suspended_process_stops_after_its_parent_was_killed(tmp_path: Path) -> None:
    """A benchmark suspends its processes for a while, and may be killed meanwhile."""
    child = """
import sys, time
from netboard.base.process.stopping import Stopping
with Stopping() as stopping:
    print("ready", flush=True)
    while not stopping():
        time.sleep(0.01)
print("stopped", flush=True)
"""
    parent = f"""
import os, signal, subprocess, sys
child = subprocess.Popen([sys.executable, "-c", {child!r}], stdout=subprocess.PIPE, start_new_session=True)
print(child.pid, flush=True)
child.stdout.readline()
os.kill(child.pid, signal.SIGSTOP)
os.waitid(os.P_PID, child.pid, os.WSTOPPED)
os.kill(os.getpid(), signal.SIGKILL)
"""
    environment = os.environ | {STOP_WITH_PARENT: "1"}
    with subprocess.Popen([sys.executable, "-c", parent], stdout=subprocess.PIPE, env=environment) as started:
        assert started.stdout is not None
        number = int(started.stdout.readline())
        handle = os.pidfd_open(number)
    try:
        ended, _, _ = select.select([handle], [], [], 20)
        assert ended
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.kill(number, signal.SIGKILL)
        os.close(handle)


@pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")
def test_resident_memory_equals_the_resident_pages() -> None:
    pages = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1])
    assert resident_memory() == pytest.approx(pages * os.sysconf("SC_PAGE_SIZE"), rel=0.05)
    assert resident_memory(os.getpid()) <= peak_memory()
    assert math.isnan(resident_memory("no process"))
