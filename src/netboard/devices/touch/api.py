"""ctypes interface of the vendor's haptic device library (3D Systems OpenHaptics, HDAPI).

The library is loaded when a device is opened, from the vendor's install path or the path in the options; netboard ships
no part of it. Every function has its types declared. Constants are named without the prefix ``HD_``.

Rule 1: functions that may block are called through `Library.calls`, which releases the interpreter lock (GIL).
Rule 2: a callback of the servo thread uses `Library.ticks`, which keeps the lock: releasing and reacquiring it costs up
to a thread switch interval, and a tick makes nine calls. No other thread may use it.
Rule 3: the library parses numbers in its own files by the C locale, and a decimal comma breaks them. So the locale is
set first.
"""

import ctypes
import locale
import os
import sys
from ctypes import POINTER, c_char_p, c_double, c_int32, c_ubyte, c_uint16, c_uint32, c_ulong, c_void_p
from enum import IntEnum, IntFlag
from pathlib import Path
from typing import Any, NamedTuple

from netboard.base.errors import DeviceNotFound

STDCALL = sys.platform == "win32" and ctypes.sizeof(c_void_p) == 4
"""True where the library uses the stdcall convention: on 32-bit Windows only."""

INVALID_HANDLE = 0xFFFFFFFF
"""Handle of no device."""

ERRORS_LOST = 0xFFFF_0000
"""Code of the error, netboard's own, that stands for errors that were lost; it is fatal, as one of those may be."""

MAX_PRIORITY, DEFAULT_PRIORITY = 65535, 32767
"""Priorities of callbacks; within a tick, higher ones run first."""

MAX_ERRORS = 64
"""Limit of errors taken off the stack at a time, in case the library never stops reporting [1]."""


class Error(IntEnum):
    """Error codes."""

    SUCCESS = 0x0000
    INVALID_ENUM = 0x0100
    INVALID_VALUE = 0x0101
    INVALID_OPERATION = 0x0102
    INVALID_INPUT_TYPE = 0x0103
    BAD_HANDLE = 0x0104
    WARM_MOTORS = 0x0200
    EXCEEDED_MAX_FORCE = 0x0201
    EXCEEDED_MAX_FORCE_IMPULSE = 0x0202
    EXCEEDED_MAX_VELOCITY = 0x0203
    FORCE_ERROR = 0x0204
    DEVICE_FAULT = 0x0300
    DEVICE_ALREADY_INITIATED = 0x0301
    COMM_ERROR = 0x0302
    COMM_CONFIG_ERROR = 0x0303
    TIMER_ERROR = 0x0304
    ILLEGAL_BEGIN = 0x0400
    ILLEGAL_END = 0x0401
    FRAME_ERROR = 0x0402
    INVALID_PRIORITY = 0x0500
    SCHEDULER_FULL = 0x0501
    INVALID_LICENSE = 0x0600


class Parameter(IntEnum):
    """Parameters of a device that netboard reads or writes. Lengths are in mm."""

    CURRENT_BUTTONS = 0x2000
    CURRENT_INKWELL_SWITCH = 0x2002
    CURRENT_POSITION = 0x2050
    CURRENT_VELOCITY = 0x2051
    VERSION = 0x2500
    DEVICE_MODEL_TYPE = 0x2501
    DEVICE_DRIVER_VERSION = 0x2502
    DEVICE_VENDOR = 0x2503
    DEVICE_SERIAL_NUMBER = 0x2504
    DEVICE_FIRMWARE_VERSION = 0x2505
    MAX_WORKSPACE_DIMENSIONS = 0x2550
    USABLE_WORKSPACE_DIMENSIONS = 0x2551
    CALIBRATION_STYLE = 0x2555
    UPDATE_RATE = 0x2600
    NOMINAL_MAX_STIFFNESS = 0x2602
    NOMINAL_MAX_FORCE = 0x2603
    NOMINAL_MAX_CONTINUOUS_FORCE = 0x2604
    SOFTWARE_VELOCITY_LIMIT = 0x2606
    SOFTWARE_FORCE_IMPULSE_LIMIT = 0x2607
    FORCE_RAMPING_RATE = 0x2608
    NOMINAL_MAX_DAMPING = 0x2609
    CURRENT_FORCE = 0x2700


class Capability(IntEnum):
    """Capabilities that can be enabled and disabled; the last two are parameters as well."""

    FORCE_OUTPUT = 0x4000
    MAX_FORCE_CLAMPING = 0x4001
    FORCE_RAMPING = 0x4002
    SOFTWARE_FORCE_LIMIT = 0x4003
    ONE_FRAME_LIMIT = 0x4004
    SOFTWARE_VELOCITY_LIMIT = 0x2606
    SOFTWARE_FORCE_IMPULSE_LIMIT = 0x2607


class Calibration(IntEnum):
    """Calibration state of a device."""

    CALIBRATION_OK = 0x5000
    CALIBRATION_NEEDS_UPDATE = 0x5001
    CALIBRATION_NEEDS_MANUAL_INPUT = 0x5002


class Style(IntFlag):
    """Calibration methods."""

    CALIBRATION_ENCODER_RESET = 1
    CALIBRATION_AUTO = 2
    CALIBRATION_INKWELL = 4


class After(IntEnum):
    """Return value of a callback: run again or not."""

    CALLBACK_DONE = 0
    CALLBACK_CONTINUE = 1


class ErrorInfo(ctypes.Structure):
    """HDErrorInfo, which the library returns by value."""

    _fields_ = (("code", c_uint32), ("internal", c_int32), ("handle", c_uint32))


# By name, because mypy knows WINFUNCTYPE and WinDLL on Windows only.
CALLBACK = (getattr(ctypes, "WINFUNCTYPE") if STDCALL else ctypes.CFUNCTYPE)(c_uint32, c_void_p)  # noqa: B009
"""HDSchedulerCallback."""

PROTOTYPES: dict[str, tuple[Any, ...]] = {
    "hdInitDevice": (c_uint32, c_char_p),
    "hdDisableDevice": (None, c_uint32),
    "hdMakeCurrentDevice": (None, c_uint32),
    "hdBeginFrame": (None, c_uint32),
    "hdEndFrame": (None, c_uint32),
    "hdGetError": (ErrorInfo,),
    "hdGetErrorString": (c_char_p, c_uint32),
    "hdEnable": (None, c_uint32),
    "hdIsEnabled": (c_ubyte, c_uint32),
    "hdGetBooleanv": (None, c_uint32, POINTER(c_ubyte)),
    "hdGetIntegerv": (None, c_uint32, POINTER(c_int32)),
    "hdGetDoublev": (None, c_uint32, POINTER(c_double)),
    "hdSetDoublev": (None, c_uint32, POINTER(c_double)),
    "hdGetString": (c_char_p, c_uint32),
    "hdCheckCalibration": (c_uint32,),
    "hdUpdateCalibration": (None, c_uint32),
    "hdStartScheduler": (None,),
    "hdStopScheduler": (None,),
    # The handle has 64 bits on Linux; without a declared type ctypes would cut it to an int.
    "hdScheduleAsynchronous": (c_ulong, CALLBACK, c_void_p, c_uint16),
    "hdUnschedule": (None, c_ulong),
}
"""Return type and argument types of every function that netboard calls."""

HELP = "install 3D Systems' Touch driver and OpenHaptics, or name the file in the option library; docs/how-to/touch.md"


class Fault(NamedTuple):
    """One error from the library's stack."""

    # Error code of the library, and of the layer below it.
    code: int
    internal: int
    handle: int
    text: str

    def __str__(self) -> str:
        if self.code == ERRORS_LOST:
            return self.text
        known = f"HD_{Error(self.code).name}" if self.code in set(Error) else "an unknown error"
        return f"{known} (0x{self.code:04x}, internal {self.internal}, handle {self.handle}): {self.text}"


class Library:
    """The vendor's library, loaded. ``path``: path of the library, or a name by which the system finds it."""

    def __init__(self, path: str) -> None:
        self.path = path
        how = getattr(ctypes, "WinDLL") if STDCALL else ctypes.CDLL  # noqa: B009
        self.calls: ctypes.CDLL = how(path, winmode=0)  # 0: Windows also searches PATH
        self.ticks: ctypes.CDLL = self.calls if STDCALL else ctypes.PyDLL(path, winmode=0)
        for library in (self.calls, self.ticks):
            for name, (returns, *takes) in PROTOTYPES.items():
                function = getattr(library, name)
                function.restype, function.argtypes = returns, takes

    def address(self, name: str) -> c_void_p:
        """Return the address of a function."""
        return ctypes.cast(getattr(self.calls, name), c_void_p)

    def drain(self) -> list[Fault]:
        """Take all errors off the stack, newest first."""
        faults: list[Fault] = []
        while len(faults) < MAX_ERRORS and (info := self.calls.hdGetError()).code != Error.SUCCESS:
            faults.append(self.fault(info.code, info.internal, info.handle))
        return faults

    def fault(self, code: int, internal: int, handle: int) -> Fault:
        """Convert an error to a `Fault` with its message."""
        if code == ERRORS_LOST:
            return Fault(code, internal, handle, "more errors at once than can be kept, so some are lost")
        text: bytes | None = self.calls.hdGetErrorString(code)
        return Fault(code, internal, handle, (text or b"no description").decode(errors="replace"))

    def doubles(self, what: Parameter, count: int) -> tuple[float, ...]:
        """Read this many numbers from the current device."""
        room = (c_double * count)()
        self.calls.hdGetDoublev(what, room)
        return tuple(room)

    def integer(self, what: Parameter) -> int:
        """Read an integer from the current device."""
        room = c_int32()
        self.calls.hdGetIntegerv(what, room)
        return room.value

    def string(self, what: Parameter) -> str:
        """Read a string from the current device."""
        text: bytes | None = self.calls.hdGetString(what)
        return (text or b"").decode(errors="replace").strip()


def places() -> list[str]:
    """Return the search paths of the library: the system's own rules, then the vendor's environment variable."""
    name = "HD.dll" if sys.platform == "win32" else "libHD.so"
    base = os.environ.get("OH_SDK_BASE")
    return [name, *((str(Path(base, "lib", name)),) if base else ())]


def load(path: str = "") -> Library:
    """Load the library.

    Raises `DeviceNotFound` if the library is missing or invalid; the message says where it was searched for and what to
    install.
    """
    use_plain_numbers()
    why = []
    for place in [path] if path else places():
        try:
            return Library(place)
        except (OSError, AttributeError) as error:
            why.append(f"{place} ({error})")
    raise DeviceNotFound(f"the vendor's library for this device cannot be loaded: tried {', '.join(why)}; {HELP}")


def use_plain_numbers() -> None:
    """Set the C library's decimal separator to a point, whatever the user's locale."""
    locale.setlocale(locale.LC_NUMERIC, "C")
