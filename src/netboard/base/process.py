"""What a process owes its machine and its operator: it stops when asked, keeps a steady loop, says what it does.

Real time is asked for in one place, `prepare`, with priorities from one table, `Priority`. Nothing here is fatal: what
a system does not offer or allow is said in one line, and the process goes on without it. docs/how-to/real-time.md
says what each thing is for and how to permit it.
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
import time
from collections.abc import Callable
from enum import IntEnum
from functools import partial
from pathlib import Path
from types import FrameType, TracebackType
from typing import Self

from netboard.base.tables.rig import Realtime

if sys.platform != "win32":
    import resource

_STOP_NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")
STOP_SIGNALS = tuple(getattr(signal, name) for name in _STOP_NAMES if hasattr(signal, name))
"""What asks a process to stop cleanly, on one system or another."""

NAME = f"{platform.node()}:{os.getpid()}"
"""How this process is told from all others, for peers and people."""

SELDOM_S = 1.0
"""What may happen any number of times is said this often [s]."""

OK, OFF = "ok", "off"
"""What came of something asked for: granted, or not asked for. Anything else is why it was refused."""

MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4
"""Flags of mlockall on Linux."""

PR_SET_TIMERSLACK = 29
"""prctl on Linux: how late a sleeping thread may be woken, to wake others with it."""

AWAKE = Path("/dev/cpu_dma_latency")
"""While a process holds this open, no core sleeps so deep that waking takes longer than what was written to it."""

AWAKE_US = 2
"""The lightest sleep of a core is left within this; 0 would let every idle core spin, hot, at the others' cost [us]."""

ALIVE_S = 1.0
"""What started a process is told so often that it is alive [s]."""

SUPERVISOR = "NOTIFY_SOCKET"
"""In the environment of a process that shall tell what started it how it is: where."""

WITH_PARENT = "NETBOARD_STOP_WITH_PARENT"
"""Set in the environment of a process that shall not outlive the one that started it."""

log = logging.getLogger(__name__)


class Priority(IntEnum):
    """SCHED_FIFO priorities of netboard's loops; no others are in use.

    The server goes before the agents, because both wait for it. ZeroMQ's own threads go before their loop, by
    `IO_ABOVE`: what a loop sends is then on its way at once, not after the rest of the tick, even where both share a
    core. Logger, displays and all else are scheduled as usual. Interrupt threads of a PREEMPT_RT kernel have 50.
    """

    AGENT = 50
    SERVER = 60


IO_ABOVE = 5
"""By how much the priority of ZeroMQ's threads is above that of the loop they serve [1]."""


PLACES = ("server", "left", "right")
"""The loops of a rig, in the order in which they get CPUs of their own, from the last one down."""

AUTO = "auto"

PRIORITY = "priority"
_granted: dict[str, int] = {}
"""What `prepare` was granted for the loop of this process."""


class Supervisor:
    """What started this process and watches over it, where that is systemd or speaks as it does (sd_notify)."""

    def __init__(self) -> None:
        address = os.environ.get(SUPERVISOR, "")
        self._address = f"\0{address[1:]}" if address.startswith("@") else address
        self._due = 0.0
        self._ready = False

    def alive(self) -> None:
        """Say that the loop is alive, once a second however often it is called; the first time, that it is ready."""
        if not self._address:
            return
        now = time.monotonic()
        if now >= self._due:
            self._due = now + ALIVE_S
            self._ready = self._tell("WATCHDOG=1" if self._ready else "READY=1") or self._ready

    def stopping(self) -> None:
        """Say that the process is about to end."""
        if self._address:
            self._tell("STOPPING=1")

    def _tell(self, words: str) -> bool:
        """Say something without waiting, and tell whether it was taken; to what is gone, nothing more is said."""
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as to:
                to.setblocking(False)
                to.sendto(words.encode(), self._address)
        except BlockingIOError:  # it has not yet heard what was said before
            return False
        except OSError as error:
            log.warning("cannot tell %s %s (%s)", self._address, words, error.strerror)
            self._address = ""
            return False
        return True


class Stopping:
    """While entered, turns stop signals into an answer instead of an interruption: ``stopping()`` tells.

    A second signal does not wait for a clean end: it interrupts as usual. Every loop asks again and again, so whoever
    asks is alive, and what started the process is told so.
    """

    def __init__(self) -> None:
        self._asked = False
        self._parent = os.getppid() if os.environ.get(WITH_PARENT) else None
        self._before: dict[int, object] = {}
        self._supervisor = Supervisor()

    def __call__(self) -> bool:
        """Whether the process has been asked to stop, or has lost the parent it shall not outlive."""
        stop = self._asked or (self._parent is not None and os.getppid() != self._parent)
        if not stop:
            self._supervisor.alive()
        return stop

    def __enter__(self) -> Self:
        for number in STOP_SIGNALS:
            self._before[number] = signal.signal(number, self._ask)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._restore()
        self._supervisor.stopping()

    def _ask(self, number: int, frame: FrameType | None) -> None:
        self._asked = True
        self._restore()

    def _restore(self) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)  # type: ignore[arg-type]
        self._before.clear()


def steady_loop() -> None:
    """Begin a steady loop: with the priority that `prepare` was granted, and without pauses of Python's own.

    What exists now is never collected again, and no collection interrupts the loop. The thread switch interval is
    shortened too, so that a library's thread cannot hold the loop up for 5 ms.
    """
    gc.collect()
    gc.freeze()
    gc.disable()
    sys.setswitchinterval(5e-4)
    if PRIORITY in _granted:
        _fifo(_granted[PRIORITY])


def prepare(wanted: Realtime, priority: int, cpus: str) -> dict[str, str]:
    """Ask the machine for what a steady loop needs, before anything else is made; say what was refused.

    Scheduling is tried here and begins with `steady_loop`: making ready, which may take a minute of compiling, must
    not hold up the rest of the machine.

    Parameters
    ----------
    cpus : str
        CPUs it may run on, as in ``0,2-3``; empty for any.

    Returns
    -------
    dict of str to str
        What came of each: `OK`, `OFF`, or why it was refused.
    """
    asked: dict[str, Callable[[], None] | None] = {
        "scheduling": partial(_schedule, priority) if wanted.scheduling else None,
        "cpus": partial(_stay_on, cpus) if cpus else None,
        "memory": _lock_memory if wanted.lock_memory else None,
        "timer_slack": _wake_in_time if wanted.scheduling else None,
        "core_sleep": _keep_awake if wanted.scheduling else None,
    }
    came = {what: OFF if how is None else _tried(what, how) for what, how in asked.items()}
    log.info("real time: %s", ", ".join(f"{what} {how}" for what, how in came.items() if how in {OK, OFF}))
    return came


def cpus_for(loop: str, wanted: Realtime) -> str:
    """CPUs for one of the `PLACES`, as `prepare` wants them.

    By itself a loop gets one CPU, with ZeroMQ's thread: they hand each other every message, and another CPU has to be
    woken for that. The agents leave the choice to the system where there is not one for each loop of a rig.
    """
    cpus = wanted.server_cpus if loop == PLACES[0] else wanted.agent_cpus
    if cpus != AUTO:
        return cpus
    have = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
    enough = 2 if loop == PLACES[0] else len(PLACES)
    return str(have[-1 - PLACES.index(loop)]) if len(have) >= enough else ""


def io_priority(came: dict[str, str], priority: int) -> int | None:
    """SCHED_FIFO priority of ZeroMQ's threads for what came of `prepare`; None to leave them as they are."""
    return priority + IO_ABOVE if came["scheduling"] == OK else None


def make_way(wanted: Realtime) -> None:
    """Stay off the CPUs that are set aside for server and agents, where others are left; for all who may wait."""
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


def _tried(what: str, ask: Callable[[], None]) -> str:
    """Ask for something; a refusal is said and not fatal."""
    try:
        ask()
    except OSError as error:
        log.info("real time: %s refused (%s); going on without it", what, error.strerror)
        return str(error.strerror)
    return OK


def _only_on(*systems: str) -> None:
    """Refuse what other systems do not offer."""
    if sys.platform not in systems:
        raise OSError(errno.ENOSYS, f"not offered on {sys.platform}")


def _schedule(priority: int) -> None:
    """Ask for SCHED_FIFO for this thread, from the beginning of its loop on."""
    _only_on("linux")
    _fifo(priority)
    os.sched_setscheduler(0, os.SCHED_OTHER | os.SCHED_RESET_ON_FORK, os.sched_param(0))
    _granted[PRIORITY] = priority


def _fifo(priority: int) -> None:
    """Schedule this thread in real time; what it starts begins as usual (ZeroMQ's thread asks for itself)."""
    os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))


def _stay_on(cpus: str) -> None:
    """Keep this thread, and those it starts from now on, on some CPUs."""
    _only_on("linux")
    os.sched_setaffinity(0, cpu_set(cpus))


def _stay_off(cpus: str) -> None:
    """Keep this thread, and those it starts from now on, off some CPUs, if others are left."""
    _only_on("linux")
    if others := os.sched_getaffinity(0) - cpu_set(cpus):
        os.sched_setaffinity(0, others)


def _lock_memory() -> None:
    """Ask that no page that this process has used is ever taken out of memory, now or later.

    Pages that it has never used stay where they are: most of a compiler's library, and of the threads' stacks.
    """
    _only_on("linux")
    limit, _ = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    if limit != resource.RLIM_INFINITY and os.geteuid() != 0:
        # It might be enough for now; but beyond it, asking for more memory would fail in the middle of a session.
        raise OSError(errno.ENOMEM, f"the limit is {limit / 1e6:.0f} MB, expected none")
    _libc(lambda libc: libc.mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT))


def _wake_in_time() -> None:
    """Ask to be woken exactly when due, not up to 50 us later; matters only without real-time scheduling."""
    _only_on("linux")
    _libc(lambda libc: libc.prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0))


def _keep_awake() -> None:
    """Keep every core from sleeping deep until this process ends: the file stays open."""
    _only_on("linux")
    handle = os.open(AWAKE, os.O_WRONLY)
    os.write(handle, AWAKE_US.to_bytes(4, sys.byteorder))


def _libc(call: Callable[[ctypes.CDLL], int]) -> None:
    """Call the C library."""
    if call(ctypes.CDLL(None, use_errno=True)):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))


def peak_memory() -> float:
    """Most memory that this process has ever held, in bytes; NaN where the system does not say [1]."""
    status = Path("/proc/self/status")
    lines = status.read_text(encoding="utf-8").splitlines() if status.exists() else []
    return next((float(line.split()[1]) * 1024 for line in lines if line.startswith("VmHWM:")), float("nan"))


def speak(name: str) -> None:
    """Let log lines go to standard error, each with the name of the process."""
    logging.basicConfig(level=logging.INFO, format=f"%(relativeCreated)8d ms  {name}  %(message)s", force=True)


class Seldom:
    """Says what may happen any number of times: at once, and then once a second at most, with the number of times."""

    def __init__(self, log: logging.Logger) -> None:
        self._log = log
        self._times = 0
        self._said = -SELDOM_S

    def say(self, text: str) -> None:
        """Say it, or only count it."""
        self._times += 1
        now = time.monotonic()
        if now - self._said >= SELDOM_S:
            self._log.warning("%s%s", text, f" (the last of {self._times})" if self._times > 1 else "")
            self._said, self._times = now, 0
