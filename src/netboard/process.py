"""What a process owes its machine and its operator: it stops when asked, keeps a steady loop, says what it does.

Nothing here is fatal: what a system does not offer or allow is said in one line, and the process goes on without it.
"""

import ctypes
import gc
import logging
import os
import platform
import signal
import sys
from types import FrameType, TracebackType
from typing import Self

_STOP_NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")
STOP_SIGNALS = tuple(getattr(signal, name) for name in _STOP_NAMES if hasattr(signal, name))
"""What asks a process to stop cleanly, on one system or another."""

NAME = f"{platform.node()}:{os.getpid()}"
"""How this process is told from all others, for peers and people."""

MCL_CURRENT, MCL_FUTURE = 1, 2
"""Flags of mlockall on Linux."""

WITH_PARENT = "NETBOARD_STOP_WITH_PARENT"
"""Set in the environment of a process that shall not outlive the one that started it."""

log = logging.getLogger(__name__)


class Stopping:
    """While entered, turns stop signals into an answer instead of an interruption: ``stopping()`` tells.

    A second signal does not wait for a clean end: it interrupts as usual.
    """

    def __init__(self) -> None:
        self._asked = False
        self._parent = os.getppid() if os.environ.get(WITH_PARENT) else None
        self._before: dict[int, object] = {}

    def __call__(self) -> bool:
        """Whether the process has been asked to stop, or has lost the parent it shall not outlive."""
        return self._asked or (self._parent is not None and os.getppid() != self._parent)

    def __enter__(self) -> Self:
        for number in STOP_SIGNALS:
            self._before[number] = signal.signal(number, self._ask)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._restore()

    def _ask(self, number: int, frame: FrameType | None) -> None:
        self._asked = True
        self._restore()

    def _restore(self) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)  # type: ignore[arg-type]
        self._before.clear()


def steady_loop() -> None:
    """Make ready for a steady loop: what exists now is never collected again, and no collection interrupts it.

    The thread switch interval is shortened too, so that a library's thread cannot hold the loop up for 5 ms.
    """
    gc.collect()
    gc.freeze()
    gc.disable()
    sys.setswitchinterval(5e-4)


def real_time(priority: int) -> None:
    """Ask for real-time scheduling of this process and the threads it starts from now on; say what came of it.

    Parameters
    ----------
    priority : int
        SCHED_FIFO priority.
    """
    if not hasattr(os, "sched_setscheduler"):
        log.info("real-time scheduling is not offered on %s; going on without it", sys.platform)
        return
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as error:
        log.info("real-time scheduling refused (%s); going on without it", error.strerror)
    else:
        log.info("real-time scheduling: SCHED_FIFO %d", priority)


def lock_memory() -> None:
    """Ask that no page of this process is ever taken out of memory, now or later; say what came of it."""
    if sys.platform != "linux":
        log.info("memory is not locked on %s; going on without it", sys.platform)
        return
    if ctypes.CDLL(None, use_errno=True).mlockall(MCL_CURRENT | MCL_FUTURE):
        log.info("locking memory refused (%s); going on without it", os.strerror(ctypes.get_errno()))
    else:
        log.info("memory locked")


def speak(name: str) -> None:
    """Let log lines go to standard error, each with the name of the process.

    Parameters
    ----------
    name : str
        Such as ``agent left``.
    """
    logging.basicConfig(level=logging.INFO, format=f"%(relativeCreated)8d ms  {name}  %(message)s", force=True)
