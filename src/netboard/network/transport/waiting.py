"""The clock that kernels read, and how they sleep until a socket signals or a time is over.

POSIX: ``clock_gettime`` and ``pselect``, with a set of bits. Windows: the performance counter; and a waitable timer of
high resolution beside an event that the sockets set, because its ``select`` wakes by the system's coarse timer. Such a
timer ends up to half a millisecond late, so the last part of a sleep spins. Its sets are lists of sockets, whose
numbers are large.

Symbols of Windows' functions are added when a kernel for it is made (`windows_symbols`).
"""

import ctypes
import sys
import time
from ctypes import c_int, c_long, c_void_p, cast
from typing import Any

import numpy as np
from llvmlite import binding
from numba import types
from numpy.typing import NDArray

from netboard.base.compiled import Records, kernel
from netboard.base.errors import NetboardError
from netboard.base.system.windows import Kernel32, kernel32

NO_FILE = -1

FILES = 1024
"""Files that a call of POSIX' select can wait for (FD_SETSIZE) [1]."""

SOCKETS = 64
"""Sockets that a call of Windows' select can wait for (FD_SETSIZE) [1]."""

SPIN_NS = 500_000
"""Last part of a sleep on Windows, which spins: what its timers of high resolution may be late by its documentation and
reports; not measured with netboard [ns]."""

POSIX_FIELDS: list[Any] = [
    ("clock", "<i8", (2,)),  # struct timespec
    ("sleep", "<i8", (2,)),  # struct timespec: the longest time to sleep
    ("file", "<i4"),  # number of the file that signals a frame
    ("files", "<u8", (FILES // 64,)),  # fd_set: a bit for each file to wait for, or that has signalled
    ("highest", "<i4"),  # number of the highest of these files
]
"""Fields of a record with which kernels read the clock and wait for files."""

WINDOWS_FIELDS: list[Any] = [
    ("clock", "<i8", (2,)),  # performance counter, and its frequency
    ("sleep", "<i8", (2,)),  # struct timeval of select; or when the timer ends
    ("file", "<i8"),
    ("files", "<i8", (SOCKETS + 1,)),  # fd_set: how many sockets, and their numbers; those that have signalled
    ("wanted", "<i8", (SOCKETS + 1,)),  # the same: those to wait for
    ("handles", "<i8", (2,)),  # of a timer, and of an event that the sockets set
]
"""The same for Windows."""

_INT, _POINTER = types.int32, types.intp


def c_function(name: str, returns: Any, *arguments: Any) -> Any:
    """Make a function of the C library, or of an added symbol, callable from kernels; addresses are integers."""
    return types.ExternalFunction(name, returns(*arguments))


# --- POSIX -------------------------------------------------------------------------------------------------------

_clock_gettime = c_function("clock_gettime", _INT, _INT, _POINTER)
_pselect = c_function("pselect", _INT, _INT, _POINTER, _POINTER, _POINTER, _POINTER, _POINTER)


_CLOCK = int(getattr(time, "CLOCK_UPTIME_RAW", getattr(time, "CLOCK_MONOTONIC", 1)))
"""The clock of `netboard.base.system.monotonic`."""


@kernel
def posix_machine_ns(fast: Records) -> int:
    """Return the time of this machine [ns]."""
    clock = fast[0]["clock"]
    _clock_gettime(_CLOCK, clock.ctypes.data)
    return int(clock[0] * 1_000_000_000 + clock[1])


@kernel
def clear(target: NDArray[np.uint8]) -> None:
    """Set all elements of an array to zero."""
    for k in range(len(target)):
        target[k] = 0


@kernel
def posix_forget_files(fast: Records) -> None:
    """Wait for no file."""
    fast[0]["highest"] = NO_FILE
    clear(fast[0]["files"])


@kernel
def posix_await_file(fast: Records, file: int) -> None:
    """Wait for one more file; `NO_FILE` for none."""
    path = fast[0]
    if file != NO_FILE:
        path["highest"] = max(path["highest"], file)
        path["files"][file // 64] |= np.uint64(1) << np.uint64(file % 64)


@kernel
def posix_has_signalled(fast: Records, file: int) -> bool:
    """Return whether a file that was waited for has signalled."""
    return bool(file != NO_FILE and fast[0]["files"][file // 64] >> np.uint64(file % 64) & np.uint64(1))


@kernel
def posix_sleep_until_signalled(fast: Records, longest_ns: int) -> None:
    """Sleep until one of the files signals, a signal of the system comes, or the time is over [ns]."""
    path = fast[0]
    files, longest = path["files"], path["sleep"]
    longest[0], longest[1] = longest_ns // 1_000_000_000, longest_ns % 1_000_000_000
    if _pselect(path["highest"] + 1, files.ctypes.data, 0, 0, longest.ctypes.data, 0) <= 0:
        clear(files)


# --- Windows -----------------------------------------------------------------------------------------------------

_counter = c_function("netboard_QueryPerformanceCounter", _INT, _POINTER)
_frequency = c_function("netboard_QueryPerformanceFrequency", _INT, _POINTER)
_set_timer = c_function("netboard_SetWaitableTimer", _INT, _POINTER, _POINTER, _INT, _POINTER, _POINTER, _INT)
_wait_many = c_function("netboard_WaitForMultipleObjects", types.uint32, _INT, _POINTER, _INT, types.uint32)
_event_select = c_function("netboard_WSAEventSelect", _INT, _POINTER, _POINTER, _INT)
_select = c_function("netboard_select", _INT, _INT, _POINTER, _POINTER, _POINTER, _POINTER)

_OF_KERNEL32 = ("QueryPerformanceCounter", "QueryPerformanceFrequency", "SetWaitableTimer", "WaitForMultipleObjects")
_OF_WINSOCK = ("WSAEventSelect", "select")
_OF_RUNTIME = ("memcmp", "memcpy", "strncpy")
_FOREVER = 0xFFFFFFFF
_READ_OR_CLOSED = 0x01 | 0x20
_HIGH_RESOLUTION, _ALL_ACCESS = 0x00000002, 0x1F0003


@kernel
def windows_machine_ns(fast: Records) -> int:
    """Return the time of this machine, converted as Python does [ns]."""
    clock = fast[0]["clock"]
    _counter(clock.ctypes.data)
    _frequency(clock.ctypes.data + 8)
    counts, rate = clock[0], clock[1]
    return int(counts // rate * 1_000_000_000 + counts % rate * 1_000_000_000 // rate)


@kernel
def windows_forget_files(fast: Records) -> None:
    """Wait for no file."""
    fast[0]["wanted"][0] = 0
    fast[0]["files"][0] = 0


@kernel
def windows_await_file(fast: Records, file: int) -> None:
    """Wait for one more file, if there is room; `NO_FILE` for none."""
    wanted = fast[0]["wanted"]
    if file != NO_FILE and wanted[0] < SOCKETS:
        wanted[0] += 1
        wanted[wanted[0]] = file


@kernel
def windows_has_signalled(fast: Records, file: int) -> bool:
    """Return whether a file that was waited for has signalled."""
    files, found = fast[0]["files"], False
    for k in range(1, files[0] + 1):
        found |= files[k] == file
    return found


@kernel
def _look(fast: Records) -> bool:
    """Find which of the wanted files can be read, without waiting; return whether one can."""
    path = fast[0]
    files, wanted, none = path["files"], path["wanted"], path["sleep"]
    for k in range(wanted[0] + 1):
        files[k] = wanted[k]
    none[0] = none[1] = 0
    if wanted[0] == 0 or _select(0, files.ctypes.data, 0, 0, none.ctypes.data) <= 0:
        files[0] = 0
    return bool(files[0] != 0)


@kernel
def windows_sleep_until_signalled(fast: Records, longest_ns: int) -> None:
    """Sleep until one of the files signals or the time is over [ns]; the last part spins."""
    path = fast[0]
    wanted, handles, due = path["wanted"], path["handles"], path["sleep"]
    until_ns = windows_machine_ns(fast) + longest_ns
    for k in range(1, wanted[0] + 1):
        _event_select(wanted[k], handles[1], _READ_OR_CLOSED)  # sets the event at once if there is something to read
    while not _look(fast):  # the event may be left from what has been read since
        left_ns = until_ns - windows_machine_ns(fast)
        if left_ns <= 0:
            return
        if left_ns > SPIN_NS:
            due[0] = (SPIN_NS - left_ns) // 100  # negative: from now on, in steps of 100 ns
            _set_timer(handles[0], due.ctypes.data, 0, 0, 0, 0)
            _wait_many(2, handles.ctypes.data, 0, _FOREVER)


def windows_symbols(library: Kernel32, winsock: ctypes.CDLL, runtime: ctypes.CDLL) -> None:
    """Make Windows' functions known to kernels, by addresses in these libraries."""
    winsock.WSAEventSelect.argtypes = (c_void_p, c_void_p, c_long)
    winsock.select.argtypes = (c_int, *(c_void_p,) * 4)
    for names, source, prefix in (
        (_OF_KERNEL32, library, "netboard_"),
        (_OF_WINSOCK, winsock, "netboard_"),
        (_OF_RUNTIME, runtime, ""),
    ):
        for name in names:
            binding.add_symbol(f"{prefix}{name}", cast(getattr(source, name), c_void_p).value)


def windows_prepare(record: np.void, library: Kernel32) -> None:
    """Make the timer and the event of a record; they last as long as the process, as its loop does."""
    record["handles"][0] = library.succeed("CreateWaitableTimerExW", None, None, _HIGH_RESOLUTION, _ALL_ACCESS)
    record["handles"][1] = library.succeed("CreateEventW", None, False, False, None)


# --- the choice --------------------------------------------------------------------------------------------------


def prepare(record: np.void) -> None:
    """Prepare a record with `FIELDS` for the kernels of this system."""
    if sys.platform == "win32":
        windows_prepare(record, kernel32())


def waitable(file: int) -> int:
    """Return the number of a socket's file, or raise an error if it cannot be waited for."""
    if sys.platform != "win32" and file >= FILES:
        raise NetboardError(f"file {file} of this process is a socket; only the first {FILES} can be waited for")
    return file


if sys.platform == "win32":
    FIELDS, FILE = WINDOWS_FIELDS, "<i8"
    machine_ns, forget_files, await_file = windows_machine_ns, windows_forget_files, windows_await_file
    has_signalled, sleep_until_signalled = windows_has_signalled, windows_sleep_until_signalled
    windows_symbols(kernel32(), getattr(ctypes, "WinDLL")("ws2_32"), ctypes.CDLL("msvcrt"))  # noqa: B009
else:
    FIELDS, FILE = POSIX_FIELDS, "<i4"
    machine_ns, forget_files, await_file = posix_machine_ns, posix_forget_files, posix_await_file
    has_signalled, sleep_until_signalled = posix_has_signalled, posix_sleep_until_signalled
