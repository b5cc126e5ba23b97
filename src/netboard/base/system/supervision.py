"""Processes that this one starts, stops and must not leave behind.

POSIX: each child has a session of its own, so a Ctrl-C in the terminal reaches only this process; SIGTERM asks it to
stop, and it notices the end of its parent by a new parent number. Windows: each child has a process group of its own,
which Ctrl-Break asks to stop; it waits for a handle of its parent. A job ends whatever would be left: the system kills
all its processes when the last handle of it is closed, which only the parent has, and those of its children that can
stop by themselves, until they have.
"""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from ctypes import byref, sizeof
from typing import Any, Protocol

from netboard.base.system.c_library import libc
from netboard.base.system.windows import SYNCHRONIZE, WAIT_OBJECT_0, JobLimits, Kernel32, kernel32

PR_SET_PDEATHSIG = 1
"""Linux prctl option: the signal that the kernel sends to this process when its parent ends."""

JOB_EXTENDED_LIMITS, KILL_ON_JOB_CLOSE = 9, 0x2000
"""JobObjectExtendedLimitInformation, and JOB_OBJECT_LIMIT_KILL_ON_JOB_CLOSE."""

JOB_QUERY = 0x0004
"""Smallest access to a job, by which a handle keeps it open."""

CTRL_C_EXIT = 0xC000013A
"""Exit code that Windows gives a process which Ctrl-Break ends (STATUS_CONTROL_C_EXIT)."""


class Supervision(Protocol):
    """How a process starts, stops and outlives no parent on one kind of system."""

    terminated: int
    """Exit code of a process that a request to stop ended while it was starting [1]."""

    suspend: signal.Signals | None
    resume: signal.Signals | None
    """Signals that suspend and resume a process; None without them."""

    def new_group(self) -> dict[str, Any]:
        """Return the arguments of Popen for a process that Ctrl-C in this one's terminal does not reach."""

    def ask_to_stop(self, process: "subprocess.Popen[bytes]") -> None:
        """Ask a process to stop, without waiting."""

    def keep_none(self) -> None:
        """Let no process that this one starts from now on outlive it."""

    def watch_parent(self, parent: int) -> Callable[[], bool]:
        """Return a function that tells whether the parent of this process has ended. ``parent``: its number."""


class PosixSupervision:
    """Sessions and signals."""

    terminated: int = -int(signal.SIGTERM)
    suspend: signal.Signals | None = getattr(signal, "SIGSTOP", None)
    resume: signal.Signals | None = getattr(signal, "SIGCONT", None)

    def new_group(self) -> dict[str, Any]:
        """Return that the process leads a session."""
        return {"start_new_session": True}

    def ask_to_stop(self, process: "subprocess.Popen[bytes]") -> None:
        """Send SIGTERM."""
        process.terminate()

    def keep_none(self) -> None:
        """Do nothing: each child watches its parent."""

    def watch_parent(self, parent: int) -> Callable[[], bool]:
        """Compare the number of the parent, which changes when it ends."""
        if sys.platform == "linux":
            # A parent that suspended this process, and was killed, cannot resume it.
            libc(lambda libc: libc.prctl(PR_SET_PDEATHSIG, signal.SIGCONT, 0, 0, 0))
        before = os.getppid()
        return lambda: os.getppid() != before


class WindowsSupervision:
    """Process groups, Ctrl-Break and a job."""

    terminated: int = CTRL_C_EXIT
    suspend: signal.Signals | None = None
    resume: signal.Signals | None = None

    def __init__(self, api: Kernel32) -> None:
        self._api = api
        self._jobs: list[int] = []  # handles, open until this process ends

    def new_group(self) -> dict[str, Any]:
        """Return that the process leads a group."""
        return {"creationflags": 0x00000200}  # CREATE_NEW_PROCESS_GROUP

    def ask_to_stop(self, process: "subprocess.Popen[bytes]") -> None:
        """Send Ctrl-Break, whose number Python names on Windows only; a process without a console is ended."""
        try:
            process.send_signal(getattr(signal, "CTRL_BREAK_EVENT"))  # noqa: B009
        except OSError:
            process.terminate()

    def keep_none(self) -> None:
        """Put this process into a job that its children join, and that kills them when the last handle is closed."""
        if self._jobs:
            return
        job = self._api.succeed("CreateJobObjectW", None, _job_name(os.getpid()))
        limits = JobLimits(flags=KILL_ON_JOB_CLOSE)
        self._api.succeed("SetInformationJobObject", job, JOB_EXTENDED_LIMITS, byref(limits), sizeof(limits))
        self._api.succeed("AssignProcessToJobObject", job, self._api.GetCurrentProcess())
        self._jobs.append(job)

    def watch_parent(self, parent: int) -> Callable[[], bool]:
        """Wait for the parent's handle, without time; keep its job open, so that this process can stop by itself."""
        try:
            handle = self._api.succeed("OpenProcess", SYNCHRONIZE, False, parent)
        except OSError:  # it has ended already
            return lambda: True
        if job := self._api.OpenJobObjectW(JOB_QUERY, False, _job_name(parent)):
            self._jobs.append(job)
        return lambda: bool(self._api.WaitForSingleObject(handle, 0) == WAIT_OBJECT_0)


def _job_name(process: int) -> str:
    """Return the name of the job of a process, in this user's log-in session."""
    return f"Local\\netboard-{process}"


supervision: Supervision = WindowsSupervision(kernel32()) if sys.platform == "win32" else PosixSupervision()


def description(code: int) -> str:
    """Return how a process with this exit code ended."""
    if code < 0:
        return f"was killed by signal {-code}"
    return "was ended by Ctrl-Break" if code == CTRL_C_EXIT else f"ended with exit code {code}"
