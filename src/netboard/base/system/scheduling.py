"""A thread's priority and CPUs, and a process's memory and timers, for loops in real time.

POSIX (Linux): SCHED_FIFO, CPU affinity, mlockall, timer slack, and PM QoS against deep sleep. Windows: the highest
thread priority below its real-time class, CPU affinity, and no power saving for this process, which also keeps the
resolution of its timers; it can lock no memory. Each function raises `OSError` where the system refuses or lacks it.
"""

import errno
import os
import sys
from collections.abc import Callable, Collection
from contextlib import suppress
from ctypes import byref, c_size_t, sizeof
from pathlib import Path
from typing import Protocol

from netboard.base.system.c_library import libc
from netboard.base.system.windows import Kernel32, PowerThrottling, kernel32

if sys.platform != "win32":
    import resource

MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4
"""Flags of mlockall on Linux."""

PR_SET_TIMERSLACK = 29
"""Linux prctl option: the delay by which the kernel may wake a sleeping thread later, to coalesce timers."""

DMA_LATENCY_FILE = Path("/dev/cpu_dma_latency")
"""Linux PM QoS: while this file is open, cores use only sleep states with at most the written wake-up latency."""

MAX_WAKE_UP_LATENCY_US = 2
"""Largest wake-up latency; it permits the lightest sleep state, while 0 would make idle cores spin [us]."""

HIGH_PRIORITY_CLASS = 0x0080
"""Windows class whose threads have priorities 13 to 15 of 31; the next one would precede the system's own threads."""

TIME_CRITICAL, ABOVE_NORMAL = 15, 1
"""Priority of a loop in this class, and of a thread that works for it."""

PROCESS_POWER_THROTTLING = 4
THROTTLE_SPEED, THROTTLE_TIMERS = 1, 4
"""EXECUTION_SPEED and IGNORE_TIMER_RESOLUTION."""


class Scheduling(Protocol):
    """What one kind of system offers. ``priority``: that of SCHED_FIFO."""

    policy: int | None
    """Number of the policy with which a library may start threads in real time; None without one."""

    def permit(self, priority: int) -> None:
        """Check that this thread may have a priority, and leave it with normal scheduling."""

    def set_priority(self, priority: int, *, beside: bool = False) -> None:
        """Give this thread a priority, or the one below it; threads that it starts have normal scheduling."""

    def set_thread(self, thread: int, priority: int) -> None:
        """Give a thread of a library a priority. ``thread``: the system's number of it."""

    def as_here(self) -> Callable[[], None]:
        """Return what makes another thread as real-time as this one."""

    def cpus(self) -> set[int]:
        """Return the CPUs that this thread may use; empty if the system does not tell."""

    def stay_on(self, cpus: Collection[int]) -> None:
        """Restrict this thread to these CPUs; on Linux also those that it starts from now on."""

    def lock_memory(self) -> None:
        """Lock all pages that this process uses in memory, now and later."""

    def wake_in_time(self) -> None:
        """Let timers wake this thread as soon as they can."""

    def keep_awake(self) -> None:
        """Let no core save power at the cost of this process, until it ends."""


class PosixScheduling:
    """Linux; other POSIX systems offer none of it here."""

    policy: int | None = getattr(os, "SCHED_FIFO", None)

    def permit(self, priority: int) -> None:
        """Take the priority, and give it back."""
        self.set_priority(priority)
        # The flag stays: Linux lets only a privileged thread clear it (sched(7)), and would refuse the rest with it.
        os.sched_setscheduler(0, os.SCHED_OTHER | os.SCHED_RESET_ON_FORK, os.sched_param(0))

    def set_priority(self, priority: int, *, beside: bool = False) -> None:
        """Set SCHED_FIFO (ZeroMQ's threads set their own)."""
        _only_on_linux()
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority - beside))

    def set_thread(self, thread: int, priority: int) -> None:
        """Set SCHED_FIFO."""
        _only_on_linux()
        os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority))

    def as_here(self) -> Callable[[], None]:
        """Copy the policy, if the other thread may have it."""
        if not hasattr(os, "sched_getscheduler"):
            return lambda: None
        policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)

        def follow() -> None:
            with suppress(PermissionError):
                os.sched_setscheduler(0, policy, parameters)

        return follow

    def cpus(self) -> set[int]:
        """Return its affinity."""
        return set(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else set()

    def stay_on(self, cpus: Collection[int]) -> None:
        """Set the affinity."""
        _only_on_linux()
        os.sched_setaffinity(0, cpus)

    def lock_memory(self) -> None:
        """Call mlockall. Pages never used are not loaded: most of the compiler's library, and of threads' stacks."""
        _only_on_linux()
        limit, _ = resource.getrlimit(resource.RLIMIT_MEMLOCK)
        if limit != resource.RLIM_INFINITY and os.geteuid() != 0:
            # A limit might suffice now, but an allocation beyond it would fail in the middle of a session.
            raise OSError(errno.ENOMEM, f"the limit is {limit / 1e6:.0f} MB, expected none")
        libc(lambda libc: libc.mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT))

    def wake_in_time(self) -> None:
        """Set the timer slack to its minimum; the default is 50 us. It matters only without real-time scheduling."""
        _only_on_linux()
        libc(lambda libc: libc.prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0))

    def keep_awake(self) -> None:
        """Disable deep sleep states of all cores, by keeping the file open."""
        _only_on_linux()
        handle = os.open(DMA_LATENCY_FILE, os.O_WRONLY)
        os.write(handle, MAX_WAKE_UP_LATENCY_US.to_bytes(4, sys.byteorder))


class WindowsScheduling:
    """Thread priorities within the class of high priority, which needs no privilege."""

    policy: int | None = None

    def __init__(self, api: Kernel32) -> None:
        self._api = api

    def permit(self, priority: int) -> None:
        """Do nothing: it needs no privilege."""

    def set_priority(self, priority: int, *, beside: bool = False) -> None:
        """Set the class of the process and the priority of this thread, of which there are two."""
        self._api.succeed("SetPriorityClass", self._api.GetCurrentProcess(), HIGH_PRIORITY_CLASS)
        level = ABOVE_NORMAL if beside else TIME_CRITICAL
        self._api.succeed("SetThreadPriority", self._api.GetCurrentThread(), level)

    def set_thread(self, thread: int, priority: int) -> None:
        """Refuse: libzmq does not name its threads there."""
        raise OSError(errno.ENOSYS, "not offered on win32")

    def as_here(self) -> Callable[[], None]:
        """Copy the priority of this thread."""
        level = self._api.GetThreadPriority(self._api.GetCurrentThread())
        return lambda: self._api.succeed("SetThreadPriority", self._api.GetCurrentThread(), level)

    def cpus(self) -> set[int]:
        """Return the CPUs of this process, of its processor group."""
        own, all_cpus = c_size_t(), c_size_t()
        self._api.succeed("GetProcessAffinityMask", self._api.GetCurrentProcess(), byref(own), byref(all_cpus))
        return {cpu for cpu in range(own.value.bit_length()) if own.value >> cpu & 1}

    def stay_on(self, cpus: Collection[int]) -> None:
        """Set the mask of this thread's CPUs."""
        self._api.succeed("SetThreadAffinityMask", self._api.GetCurrentThread(), sum(1 << cpu for cpu in set(cpus)))

    def lock_memory(self) -> None:
        """Refuse: Windows locks single ranges of memory only."""
        raise OSError(errno.ENOSYS, "not offered on win32")

    def wake_in_time(self) -> None:
        """Let the system neither slow this process down nor coarsen its timers, in the background too."""
        calm = PowerThrottling(version=1, control=THROTTLE_SPEED | THROTTLE_TIMERS)
        process = self._api.GetCurrentProcess()
        self._api.succeed("SetProcessInformation", process, PROCESS_POWER_THROTTLING, byref(calm), sizeof(calm))

    def keep_awake(self) -> None:
        """Refuse: Windows lets no process bound the sleep of its cores; set its power plan instead."""
        raise OSError(errno.ENOSYS, "not offered on win32")


def _only_on_linux() -> None:
    """Raise an error on other systems."""
    if sys.platform != "linux":
        raise OSError(errno.ENOSYS, f"not offered on {sys.platform}")


scheduling: Scheduling = WindowsScheduling(kernel32()) if sys.platform == "win32" else PosixScheduling()
