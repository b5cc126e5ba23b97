"""Process set-up: clean stop on signals, real-time scheduling, systemd notifications.

`prepare` is the only place that requests real-time features, with priorities from the table `Priority`. Nothing here is
fatal: a feature that the system does not offer or allow is logged in one line, and the process continues without it.
docs/how-to/real-time.md explains each feature and how to permit it.
"""

import ctypes
import errno
import gc
import logging
import os
import platform
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from enum import IntEnum
from functools import partial
from math import inf
from pathlib import Path
from types import FrameType
from typing import Any, Self

from netboard.base.errors import ConfigError
from netboard.base.tables.rig import Realtime

if sys.platform != "win32":
    import resource

_STOP_NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")
STOP_SIGNALS = tuple(getattr(signal, name) for name in _STOP_NAMES if hasattr(signal, name))
"""Signals that request a clean stop, on any system."""

NAME = f"{platform.node()}:{os.getpid()}"
"""Identity of this process: host and process number."""

OK, OFF = "ok", "off"
"""Result of a request: granted, or not requested; any other text is the reason of a refusal."""

MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4
"""Flags of mlockall on Linux."""

PR_SET_PDEATHSIG = 1
"""Linux prctl option: the signal that the kernel sends to this process when its parent ends."""

PR_SET_TIMERSLACK = 29
"""Linux prctl option: the delay by which the kernel may wake a sleeping thread later, to coalesce timers."""

DMA_LATENCY_FILE = Path("/dev/cpu_dma_latency")
"""Linux PM QoS: while this file is open, cores use only sleep states with at most the written wake-up latency."""

MAX_WAKE_UP_LATENCY_US = 2
"""Largest wake-up latency; it permits the lightest sleep state, while 0 would make idle cores spin [us]."""

WATCHDOG_INTERVAL_S = 1.0
"""Interval of watchdog messages to the supervisor [s]."""

SUPERVISOR = "NOTIFY_SOCKET"
"""Environment variable with the address of the supervisor's socket (sd_notify)."""

STOP_WITH_PARENT = "NETBOARD_STOP_WITH_PARENT"
"""Environment variable of a process that stops when its parent ends."""

log = logging.getLogger(__name__)


class Priority(IntEnum):
    """SCHED_FIFO priorities of netboard's loops; no others are in use.

    The server precedes the agents, because both wait for it. ZeroMQ's threads precede their loop by `IO_PRIORITY_STEP`,
    so that messages leave at once and not after the rest of the tick, even on a shared core. Logger, displays and all
    others have normal scheduling. Interrupt threads of a PREEMPT_RT kernel have 50.
    """

    AGENT = 50
    SERVER = 60


IO_PRIORITY_STEP = 5
"""Priority of ZeroMQ's threads above that of their loop [1]."""


PLACES = ("server", "left", "right")
"""Loops of a rig, in the order in which they get CPUs of their own, from the highest CPU number down."""

AUTO = "auto"

PRIORITY = "priority"
_granted: dict[str, int] = {}
"""Priority that `prepare` was granted for the loop of this process."""


class Supervisor:
    """Supervisor of this process: systemd, or any other that uses sd_notify."""

    def __init__(self) -> None:
        address = os.environ.get(SUPERVISOR, "")
        self._address = f"\0{address[1:]}" if address.startswith("@") else address
        self._due = 0.0
        self._ready = False

    def alive(self) -> None:
        """Report that the process is ready, then that it is alive, at most once a second."""
        if not self._address:
            return
        now = time.monotonic()
        if now >= self._due:
            self._due = now + WATCHDOG_INTERVAL_S
            self._ready = self._notify("WATCHDOG=1" if self._ready else "READY=1") or self._ready

    def stopping(self) -> None:
        """Report that the process is stopping."""
        if self._address:
            self._notify("STOPPING=1")

    def _notify(self, message: str) -> bool:
        """Send a message without blocking; return whether it was accepted. Stop sending when the supervisor is gone."""
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as to:
                to.setblocking(False)
                to.sendto(message.encode(), self._address)
        except BlockingIOError:  # the socket is full
            return False
        except OSError as error:
            log.warning("cannot send %s to %s (%s)", message, self._address, error.strerror)
            self._address = ""
            return False
        return True


def _stop_signals() -> list[signal.Signals]:
    """Return the stop signals, without that of a closing terminal if `nohup` lets this process ignore it."""
    return [one for one in STOP_SIGNALS if one.name != "SIGHUP" or signal.getsignal(one) is not signal.SIG_IGN]


@contextmanager
def _handled(numbers: Iterable[signal.Signals], handler: Any) -> Iterator[None]:
    """Let a handler have these signals until the end."""
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, former in before.items():
            signal.signal(number, former)


@contextmanager
def interrupted_by_stop_signals() -> Iterator[None]:
    """Let every stop signal interrupt as Ctrl-C does, so that a device gets zero force, and no unfinished file is left.

    A closing terminal that `nohup` lets this process ignore stays ignored.
    """
    with _handled(_stop_signals(), signal.default_int_handler):
        yield


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Hold stop signals back until the end; in the main thread, the only one that they interrupt.

    A blocked signal would be taken by another thread, and interrupt the main thread all the same.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    held: list[int] = []
    try:
        with _handled(_stop_signals(), lambda number, _: held.append(number)):
            yield
    finally:
        if held:
            signal.raise_signal(held[0])


@contextmanager
def no_terminal_suspension() -> Iterator[None]:
    """Ignore Ctrl-Z, and a terminal that suspends background processes that write to it.

    A suspended agent would leave its device with the last force.
    """
    names = ("SIGTSTP", "SIGTTOU")
    with _handled([getattr(signal, name) for name in names if hasattr(signal, name)], signal.SIG_IGN):
        yield


class Stopping:
    """Context in which a stop signal sets a flag instead of interrupting; calling the instance returns the flag.

    A second signal interrupts as Ctrl-C does, whichever it is: a closing terminal sends two, and an agent that ended at
    once would leave its device with the last force. A closing terminal that `nohup` lets this process ignore stays
    ignored. Every loop polls the flag, so each call also reports to the supervisor that the process is alive.

    ``orphaned_s``: how long the process goes on after its parent has ended [s].
    """

    def __init__(self, orphaned_s: float = 0.0) -> None:
        self._requested = False
        self._orphaned_s, self._stop_at = orphaned_s, inf
        self._parent = os.getppid() if os.environ.get(STOP_WITH_PARENT) else None
        if self._parent is not None and sys.platform == "linux":
            # A parent that suspended this process, and was killed, cannot resume it.
            _libc(lambda libc: libc.prctl(PR_SET_PDEATHSIG, signal.SIGCONT, 0, 0, 0))
        self._before: dict[int, object] = {}
        self._supervisor = Supervisor()

    def __call__(self) -> bool:
        """Return whether a stop was requested, or the parent process has ended."""
        if self._parent is not None and os.getppid() != self._parent:
            self._parent, self._stop_at = None, time.monotonic() + self._orphaned_s
        stop = self._requested or time.monotonic() >= self._stop_at
        if not stop:
            self._supervisor.alive()
        return stop

    def __enter__(self) -> Self:
        for number in _stop_signals():
            self._before[number] = signal.signal(number, self._request)
        return self

    def __exit__(self, *error: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)  # type: ignore[arg-type]
        self._before.clear()
        self._supervisor.stopping()

    def _request(self, number: int, frame: FrameType | None) -> None:
        self._requested = True
        for each in self._before:
            signal.signal(each, signal.default_int_handler)


def steady_loop() -> None:
    """Start a real-time loop: with the priority that `prepare` was granted, and without garbage collection.

    The thread switch interval is shortened, so that a thread of a library cannot delay the loop by 5 ms.
    """
    # A full collection of 800 000 objects takes 130 to 140 ms.
    gc.collect()
    gc.freeze()
    gc.disable()
    sys.setswitchinterval(5e-4)
    if PRIORITY in _granted:
        _fifo(_granted[PRIORITY])


def beside_loop() -> None:
    """Set up a thread that works for a loop, at the priority below it.

    With normal scheduling, the thread could be kept from its core while it holds Python's lock, and the loop with it.
    """
    if PRIORITY in _granted:
        _fifo(_granted[PRIORITY] - 1)


def prepare(wanted: Realtime, priority: int, cpus: str) -> dict[str, str]:
    """Request the real-time features of a loop, before anything else is created; log refusals.

    Scheduling is tested here and starts with `steady_loop`, because compiling may take a minute and must not block the
    rest of the machine.

    ``cpus``: CPUs it may run on, as in ``0,2-3``; empty for any. Returns the result of each request: `OK`, `OFF`, or
    the reason of a refusal.
    """
    requests: dict[str, Callable[[], None] | None] = {
        "scheduling": partial(_schedule, priority) if wanted.scheduling else None,
        "cpus": partial(_stay_on, cpus) if cpus else None,
        "memory": _lock_memory if wanted.lock_memory else None,
        "timer_slack": _wake_in_time if wanted.scheduling else None,
        "core_sleep": _keep_awake if wanted.scheduling else None,
    }
    results = {what: OFF if request is None else _tried(what, request) for what, request in requests.items()}
    log.info("real time: %s", ", ".join(f"{what} {result}" for what, result in results.items() if result in {OK, OFF}))
    return results


def cpus_for(loop: str, wanted: Realtime) -> str:
    """Return the CPUs for one of the `PLACES`, for `prepare`.

    By default a loop shares one CPU with ZeroMQ's thread, because waking another CPU for each message takes longer.
    Agents leave the choice to the system if there is not one CPU for each loop.
    """
    cpus = wanted.server_cpus if loop == PLACES[0] else wanted.agent_cpus
    if cpus != AUTO:
        return cpus
    have = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
    enough = 2 if loop == PLACES[0] else len(PLACES)
    return str(have[-1 - PLACES.index(loop)]) if len(have) >= enough else ""


def io_priority(results: dict[str, str], priority: int) -> int | None:
    """Return the SCHED_FIFO priority of ZeroMQ's threads, by the results of `prepare`; None for normal scheduling."""
    return priority + IO_PRIORITY_STEP if results["scheduling"] == OK else None


def leave_reserved_cpus(wanted: Realtime) -> None:
    """Leave the CPUs reserved for server and agents, if there are others; for processes without deadlines."""
    if taken := ",".join(cpus for cpus in (wanted.server_cpus, wanted.agent_cpus) if cpus not in {"", AUTO}):
        _tried("cpus", partial(_stay_off, taken))


def cpu_set(cpus: str) -> set[int]:
    """Read a list of CPUs, such as ``0,2-3``."""
    numbers: set[int] = set()
    for part in filter(None, cpus.split(",")):
        first, dash, last = part.partition("-")
        try:
            numbers |= set(range(int(first), int(last if dash else first) + 1))
        except ValueError:
            raise OSError(errno.EINVAL, f"found {cpus}, expected CPUs such as 0,2-3") from None
    return numbers


def _tried(what: str, request: Callable[[], None]) -> str:
    """Make a request; log a refusal, which is not fatal."""
    try:
        request()
    except OSError as error:
        log.info("real time: %s refused (%s); continuing without it", what, error.strerror)
        return str(error.strerror)
    return OK


def _only_on(*systems: str) -> None:
    """Raise an error on other systems."""
    if sys.platform not in systems:
        raise OSError(errno.ENOSYS, f"not offered on {sys.platform}")


def _schedule(priority: int) -> None:
    """Request SCHED_FIFO for this thread, from the start of its loop on."""
    _only_on("linux")
    _fifo(priority)
    # The flag stays: Linux lets only a privileged thread clear it (sched(7)), and would refuse the rest with it.
    os.sched_setscheduler(0, os.SCHED_OTHER | os.SCHED_RESET_ON_FORK, os.sched_param(0))
    _granted[PRIORITY] = priority


def _fifo(priority: int) -> None:
    """Set SCHED_FIFO for this thread; threads that it starts have normal scheduling (ZeroMQ's set their own)."""
    os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))


def _stay_on(cpus: str) -> None:
    """Restrict this thread, and those it starts from now on, to these CPUs."""
    _only_on("linux")
    os.sched_setaffinity(0, cpu_set(cpus))


def _stay_off(cpus: str) -> None:
    """Exclude these CPUs for this thread and those it starts from now on, if others are left."""
    _only_on("linux")
    if others := os.sched_getaffinity(0) - cpu_set(cpus):
        os.sched_setaffinity(0, others)


def _lock_memory() -> None:
    """Lock all pages that this process uses in memory, now and later.

    Pages that it never uses are not loaded: most of the compiler's library, and of the threads' stacks.
    """
    _only_on("linux")
    limit, _ = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    if limit != resource.RLIM_INFINITY and os.geteuid() != 0:
        # A limit might suffice now, but an allocation beyond it would fail in the middle of a session.
        raise OSError(errno.ENOMEM, f"the limit is {limit / 1e6:.0f} MB, expected none")
    _libc(lambda libc: libc.mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT))


def allow_files() -> None:
    """Allow this process as many open files as the system lets it have: each connection of a server is one."""
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


def _wake_in_time() -> None:
    """Set the timer slack to its minimum; the default is 50 us. It matters only without real-time scheduling."""
    _only_on("linux")
    _libc(lambda libc: libc.prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0))


def _keep_awake() -> None:
    """Disable deep sleep states of all cores until this process ends, by keeping the file open."""
    _only_on("linux")
    handle = os.open(DMA_LATENCY_FILE, os.O_WRONLY)
    os.write(handle, MAX_WAKE_UP_LATENCY_US.to_bytes(4, sys.byteorder))


def _libc(call: Callable[[ctypes.CDLL], int]) -> None:
    """Call the C library."""
    if call(ctypes.CDLL(None, use_errno=True)):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))


def peak_memory() -> float:
    """Return the peak memory of this process; NaN if the system does not report it [bytes]."""
    return _memory("self", "VmHWM:")


def resident_memory(process: int | str = "self") -> float:
    """Return the resident memory of a process; NaN if the system does not report it [bytes]."""
    return _memory(process, "VmRSS:")


def _memory(process: int | str, kind: str) -> float:
    status = Path(f"/proc/{process}/status")
    lines = status.read_text(encoding="utf-8").splitlines() if status.exists() else []
    return next((float(line.split()[1]) * 1024 for line in lines if line.startswith(kind)), float("nan"))


def home_folder() -> Path:
    """Return the user's home folder; raise ConfigError if there is none, as for an unnamed user of a container."""
    try:
        return Path.home()
    except RuntimeError:
        raise ConfigError("this user has no home folder; set the environment variable HOME") from None
