"""Functions of Windows that netboard calls, with their prototypes.

The same prototypes call a stand-in in tests. A call that fails raises an `OSError` with the number that Windows gives.
"""

import ctypes
import errno
from collections.abc import Callable
from ctypes import POINTER, c_int, c_int32, c_int64, c_size_t, c_uint8, c_uint32, c_void_p, c_wchar_p
from functools import cache
from typing import Any

BOOL, DWORD, HANDLE = c_int32, c_uint32, c_void_p

PROTOTYPES: dict[str, tuple[Any, ...]] = {
    "AssignProcessToJobObject": (BOOL, HANDLE, HANDLE),
    "BuildCommDCBW": (BOOL, c_wchar_p, c_void_p),
    "CloseHandle": (BOOL, HANDLE),
    "CreateEventW": (HANDLE, c_void_p, BOOL, BOOL, c_wchar_p),
    "CreateJobObjectW": (HANDLE, c_void_p, c_wchar_p),
    "CreateWaitableTimerExW": (HANDLE, c_void_p, c_wchar_p, DWORD, DWORD),
    "GetCurrentProcess": (HANDLE,),
    "GetCurrentThread": (HANDLE,),
    "GetProcessAffinityMask": (BOOL, HANDLE, POINTER(c_size_t), POINTER(c_size_t)),
    "GetThreadPriority": (c_int, HANDLE),
    "LockFileEx": (BOOL, HANDLE, DWORD, DWORD, DWORD, DWORD, c_void_p),
    "OpenJobObjectW": (HANDLE, DWORD, BOOL, c_wchar_p),
    "OpenProcess": (HANDLE, DWORD, BOOL, DWORD),
    "QueryPerformanceCounter": (BOOL, POINTER(c_int64)),
    "QueryPerformanceFrequency": (BOOL, POINTER(c_int64)),
    "SetCommState": (BOOL, HANDLE, c_void_p),
    "SetInformationJobObject": (BOOL, HANDLE, c_int, c_void_p, DWORD),
    "SetPriorityClass": (BOOL, HANDLE, DWORD),
    "SetProcessInformation": (BOOL, HANDLE, c_int, c_void_p, DWORD),
    "SetThreadAffinityMask": (c_size_t, HANDLE, c_size_t),
    "SetThreadPriority": (BOOL, HANDLE, c_int),
    "SetWaitableTimer": (BOOL, HANDLE, POINTER(c_int64), c_int32, c_void_p, c_void_p, BOOL),
    "WaitForMultipleObjects": (DWORD, DWORD, POINTER(HANDLE), BOOL, DWORD),
    "WaitForSingleObject": (DWORD, HANDLE, DWORD),
}
"""Return type and argument types of each function of kernel32."""

SYNCHRONIZE = 0x00100000
"""Access to an object that permits waiting for it only."""

WAIT_OBJECT_0 = 0


class Overlapped(ctypes.Structure):
    """Place in a file (OVERLAPPED)."""

    _fields_ = (("internal", c_size_t), ("high", c_size_t), ("low", DWORD), ("above", DWORD), ("event", HANDLE))


class JobLimits(ctypes.Structure):
    """Limits of a job (JOBOBJECT_EXTENDED_LIMIT_INFORMATION), of which only the flags are used."""

    _fields_ = (
        ("times", c_int64 * 2),
        ("flags", DWORD),
        ("working_set", c_size_t * 2),
        ("processes", DWORD),
        ("affinity", c_size_t),
        ("classes", DWORD * 2),
        ("io", c_int64 * 6),
        ("memory", c_size_t * 4),
    )


class PowerThrottling(ctypes.Structure):
    """Whether the system may save power at the cost of a process (PROCESS_POWER_THROTTLING_STATE)."""

    _fields_ = (("version", DWORD), ("control", DWORD), ("state", DWORD))


SerialSettings = c_uint8 * 28
"""Settings of a serial port (DCB), which Windows fills in itself."""


class Kernel32:
    """The functions of a library by their Windows names.

    ``library``: kernel32, or a stand-in. ``last_error``: the number of the last failure.
    """

    def __init__(self, library: ctypes.CDLL, last_error: Callable[[], int]) -> None:
        self._last_error = last_error
        for name, (returns, *takes) in PROTOTYPES.items():
            function = getattr(library, name)
            function.restype, function.argtypes = returns, takes
            setattr(self, name, function)

    def __getattr__(self, name: str) -> Any:
        """Refuse a function without a prototype, whose arguments would be cut."""
        raise AttributeError(f"{name}: has no entry in {__name__}.PROTOTYPES")

    def succeed(self, name: str, *arguments: Any) -> Any:
        """Call a function; raise `OSError` if it returns zero, which stands for a failure."""
        result = getattr(self, name)(*arguments)
        if not result:
            number = self._last_error()
            raise OSError(_ERRNO.get(number, errno.EIO), f"{name}: Windows error {number}")
        return result


_ERRNO = {5: errno.EACCES, 33: errno.EAGAIN, 87: errno.EINVAL, 997: errno.EAGAIN}
"""Of ERROR_ACCESS_DENIED, ERROR_LOCK_VIOLATION, ERROR_INVALID_PARAMETER and ERROR_IO_PENDING."""


@cache
def kernel32() -> Kernel32:
    """Return Windows' own functions."""
    # By name, because mypy knows them on Windows only.
    load, last_error = (getattr(ctypes, name) for name in ("WinDLL", "get_last_error"))
    return Kernel32(load("kernel32", use_last_error=True), last_error)
