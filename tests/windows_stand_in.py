"""Stand-ins for Windows' libraries: they behave as its documentation says, and are called through C prototypes.

A call goes from the implementation for Windows through ctypes, with the declared types, into a C function pointer,
and from there into Python. So this shows that arguments have the declared number, size and order, and what netboard
makes of the answers. It does not show that the declarations are those of Windows, nor that Windows behaves in this way.
"""

import ctypes
import os
import select
import time
from collections.abc import Callable
from ctypes import POINTER, c_int, c_int64, c_long, c_size_t, c_uint, c_uint8, c_void_p, cast
from typing import Any, ClassVar

from netboard.base.system.windows import PROTOTYPES, JobLimits, Kernel32, Overlapped, PowerThrottling

ACCESS_DENIED, LOCK_VIOLATION, INVALID_PARAMETER = 5, 33, 87

COUNTS_PER_S = 10_000_000
"""Frequency of the performance counter on most machines [1/s]."""


class StandIn:
    """A library whose functions are methods of this class; a function without a method returns 1."""

    prototypes: ClassVar[dict[str, tuple[Any, ...]]]

    def __init__(self) -> None:
        self.error = 0
        self.calls: list[tuple[Any, ...]] = []
        self._kept: dict[str, Any] = {}
        for name, (returns, *takes) in self.prototypes.items():
            own: Callable[..., Any] = getattr(type(self), name, lambda self, *arguments: 1)
            made = ctypes.CFUNCTYPE(returns, *takes)(self._logged(name, own))
            self._kept[name] = made

    def _logged(self, name: str, own: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            self.calls.append((name, *arguments))
            return own(self, *arguments)

        return call

    def __getattribute__(self, name: str) -> Any:
        kept = object.__getattribute__(self, "__dict__").get("_kept", {})
        return kept[name] if name in kept else object.__getattribute__(self, name)

    def address(self, name: str) -> int:
        """Address of a function, as kernels call it."""
        return cast(self._kept[name], ctypes.c_void_p).value or 0


class StandInKernel32(StandIn):
    """Files, jobs, processes, threads and clocks of one machine."""

    prototypes: ClassVar[dict[str, tuple[Any, ...]]] = PROTOTYPES

    def __init__(self) -> None:
        super().__init__()
        self.locks: dict[tuple[int, int], list[tuple[int, bool]]] = {}  # of each file: descriptor, and whether shared
        self.process = 100  # number of the process that calls
        self.running = {100}
        self.jobs: dict[str, dict[str, Any]] = {}
        self.handles: dict[int, Any] = {}
        self.granted: dict[str, Any] = {}
        self.serial = b""

    def api(self) -> Kernel32:
        """The functions as netboard has them."""
        return Kernel32(self, lambda: self.error)

    def _handle(self, thing: Any) -> int:
        number = 4 * (len(self.handles) + 1)
        self.handles[number] = (self.process, thing)
        return number

    def _fail(self, error: int) -> int:
        self.error = error
        return 0

    # --- files ---

    def LockFileEx(self, handle: int, flags: int, zero: int, low: int, high: int, place: int) -> int:
        at = cast(place, POINTER(Overlapped)).contents
        if zero or (low, high) != (1, 0) or at.above << 32 | at.low < 2**40:
            return self._fail(INVALID_PARAMETER)
        status = os.fstat(handle)
        held = self.locks.setdefault((status.st_dev, status.st_ino), [])
        shared = not flags & 2
        if any(not (shared and other) for _, other in held):
            return self._fail(LOCK_VIOLATION) if flags & 1 else self._fail(ACCESS_DENIED)
        held.append((handle, shared))
        return 1

    def close_file(self, descriptor: int) -> None:
        """Close a file, with its locks."""
        for held in self.locks.values():
            held[:] = [one for one in held if one[0] != descriptor]
        os.close(descriptor)

    # --- processes ---

    def GetCurrentProcess(self) -> int:
        return 2**64 - 1

    def GetCurrentThread(self) -> int:
        return 2**64 - 2

    def CreateJobObjectW(self, security: int, name: str) -> int:
        job = self.jobs.setdefault(name, {"flags": 0, "members": set()})
        return self._handle(job)

    def OpenJobObjectW(self, access: int, inherit: int, name: str) -> int:
        return self._handle(self.jobs[name]) if name in self.jobs and access else self._fail(2)

    def SetInformationJobObject(self, job: int, kind: int, what: int, size: int) -> int:
        if kind != 9 or size != 144:
            return self._fail(INVALID_PARAMETER)
        self.handles[job][1]["flags"] = cast(what, POINTER(JobLimits)).contents.flags
        return 1

    def AssignProcessToJobObject(self, job: int, process: int) -> int:
        self.handles[job][1]["members"].add(self.process)
        return 1

    def OpenProcess(self, access: int, inherit: int, number: int) -> int:
        return self._handle(number) if number in self.running else self._fail(INVALID_PARAMETER)

    def WaitForSingleObject(self, handle: int, milliseconds: int) -> int:
        return 258 if self.handles[handle][1] in self.running else 0

    def start(self, number: int) -> None:
        """Start a process from the current one, whose jobs it joins."""
        self.running.add(number)
        for job in self.jobs.values():
            if self.process in job["members"]:
                job["members"].add(number)

    def end(self, number: int) -> None:
        """End a process: its handles close, and jobs without handles end their processes if they are told to."""
        self.running.discard(number)
        self.handles = {key: (owner, thing) for key, (owner, thing) in self.handles.items() if owner != number}
        open_jobs = [id(thing) for _, thing in self.handles.values() if isinstance(thing, dict)]
        for job in self.jobs.values():
            if job["flags"] & 0x2000 and id(job) not in open_jobs:
                for member in job["members"] & self.running:
                    self.end(member)

    # --- threads ---

    def SetPriorityClass(self, process: int, level: int) -> int:
        self.granted["class"] = level
        return 1

    def SetThreadPriority(self, thread: int, level: int) -> int:
        if level not in (-15, -2, -1, 0, 1, 2, 15):
            return self._fail(INVALID_PARAMETER)
        self.granted["priority"] = level
        return 1

    def GetThreadPriority(self, thread: int) -> int:
        return int(self.granted.get("priority", 0))

    def GetProcessAffinityMask(self, process: int, own: Any, machine: Any) -> int:
        own[0], machine[0] = 0b1101, 0b1111
        return 1

    def SetThreadAffinityMask(self, thread: int, mask: int) -> int:
        if not mask or mask & ~0b1101:
            return self._fail(INVALID_PARAMETER)
        self.granted["mask"] = mask
        return 0b1101

    def SetProcessInformation(self, process: int, kind: int, what: int, size: int) -> int:
        found = cast(what, POINTER(PowerThrottling)).contents
        if kind != 4 or size != 12 or found.version != 1:
            return self._fail(INVALID_PARAMETER)
        self.granted["throttling"] = (found.control, found.state)
        return 1

    # --- timers, events and clocks ---

    def CreateWaitableTimerExW(self, security: int, name: str, flags: int, access: int) -> int:
        if flags & ~2 or not access & 0x100000:
            return self._fail(INVALID_PARAMETER)
        return self._handle({"timer": 0})

    def CreateEventW(self, security: int, manual: int, initial: int, name: str) -> int:
        return self._handle({"event": bool(initial), "sockets": set()})

    def SetWaitableTimer(self, timer: int, due: Any, period: int, routine: int, argument: int, resume: int) -> int:
        steps = int(due[0])
        if steps >= 0:
            return self._fail(INVALID_PARAMETER)  # a time of day, which netboard never means
        self.handles[timer][1]["timer"] = time.monotonic_ns() - 100 * steps
        return 1

    def WaitForMultipleObjects(self, count: int, handles: Any, all_of_them: int, milliseconds: int) -> int:
        timer, event = (self.handles[handles[k]][1] for k in range(count))
        if event["event"]:
            event["event"] = False  # it resets itself
            return 1
        left = max(0, timer["timer"] - time.monotonic_ns()) * 1e-9
        return 1 if select.select(list(event["sockets"]), [], [], left)[0] else 0

    # --- ports ---

    def BuildCommDCBW(self, text: str, settings: int) -> int:
        room = cast(settings, POINTER(c_uint8 * 28)).contents
        if room[0] != 28:
            return self._fail(INVALID_PARAMETER)
        room[4:8] = list(int(text.split(maxsplit=1)[0].removeprefix("baud=")).to_bytes(4, "little"))
        return 1

    def SetCommState(self, handle: int, settings: int) -> int:
        self.serial = bytes(cast(settings, POINTER(c_uint8 * 28)).contents)
        return 1

    def QueryPerformanceCounter(self, counts: Any) -> int:
        cast(counts, POINTER(c_int64))[0] = time.monotonic_ns() * COUNTS_PER_S // 10**9
        return 1

    def QueryPerformanceFrequency(self, counts: Any) -> int:
        cast(counts, POINTER(c_int64))[0] = COUNTS_PER_S
        return 1


class StandInWinsock(StandIn):
    """Sockets that set an event, and select with lists of sockets."""

    prototypes: ClassVar[dict[str, tuple[Any, ...]]] = {
        "WSAEventSelect": (c_int, c_void_p, c_void_p, c_long),
        "select": (c_int, c_int, *(c_void_p,) * 4),
    }

    def __init__(self, kernel32: "StandInKernel32") -> None:
        super().__init__()
        self._kernel32 = kernel32

    def WSAEventSelect(self, socket: int, event: int, mask: int) -> int:
        if mask != 0x21:
            return -1
        self._kernel32.handles[event][1]["sockets"].add(socket)
        return 0

    def select(self, zero: int, reading: int, writing: int, failing: int, timeout: int) -> int:
        found = cast(reading, POINTER(FdSet)).contents
        wait = cast(timeout, POINTER(c_long * 2)).contents
        assert (writing, failing, list(wait)) == (None, None, [0, 0]), "netboard only looks, and only for reading"
        ready = select.select(list(found.sockets[: found.count]), [], [], 0)[0]
        found.count = len(ready)
        for k, socket in enumerate(ready):
            found.sockets[k] = socket
        return len(ready)


class FdSet(ctypes.Structure):
    """Windows' fd_set of 64-bit systems."""

    _fields_ = (("count", c_uint), ("sockets", c_size_t * 64))


assert ctypes.sizeof(c_size_t) == 8, "prototypes of handles are those of 64-bit systems"
