"""The end of a process: clean stop on signals and with its parent, and what its supervisor hears of it."""

import logging
import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from math import inf
from types import FrameType
from typing import Any, Self

from netboard.base.system.c_library import notify
from netboard.base.system.supervision import supervision

log = logging.getLogger(__name__)

_STOP_NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")
STOP_SIGNALS = tuple(getattr(signal, name) for name in _STOP_NAMES if hasattr(signal, name))
"""Signals that request a clean stop, on any system."""

WATCHDOG_INTERVAL_S = 1.0
"""Interval of watchdog messages to the supervisor [s]."""

SUPERVISOR = "NOTIFY_SOCKET"
"""Environment variable with the address of the supervisor's socket (sd_notify)."""

STOP_WITH_PARENT = "NETBOARD_STOP_WITH_PARENT"
"""Environment variable of a process that stops when its parent ends: the number of that parent."""


class ProcessSupervisor:
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
            notify(self._address, message)
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


def _parent_watch() -> Callable[[], bool] | None:
    """Return what tells whether the parent process has ended; None for a process that does not stop with it."""
    parent = os.environ.get(STOP_WITH_PARENT)
    return supervision.watch_parent(int(parent)) if parent else None


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
        self._parent_ended = _parent_watch()
        self._before: dict[int, object] = {}
        self._supervisor = ProcessSupervisor()

    def __call__(self) -> bool:
        """Return whether a stop was requested, or the parent process has ended."""
        if self._parent_ended is not None and self._parent_ended():
            self._parent_ended, self._stop_at = None, time.monotonic() + self._orphaned_s
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
