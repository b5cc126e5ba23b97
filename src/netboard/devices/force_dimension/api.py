"""ctypes interface of Force Dimension's haptic SDK (DHD), as its header dhdc.h of version 3.17.5 declares it.

The library is loaded when a device is opened, from the vendor's install path or the path in the options; netboard ships
no part of it. Every function has its types declared. A function returns a negative number after an error; the SDK keeps
the last error of each thread, so it is asked for in the thread that made the call.
"""

import ctypes
import os
import re
import sys
from ctypes import POINTER, byref, c_byte, c_char_p, c_double, c_int, c_ubyte, c_uint, c_ushort, c_void_p
from enum import IntEnum
from pathlib import Path
from typing import Any

from netboard.base.errors import DeviceNotFound


class DhdError(IntEnum):
    """Error codes, ``dhd_errors`` in the header."""

    NO_ERROR = 0
    ERROR = 1
    ERROR_COM = 2
    ERROR_DHC_BUSY = 3
    ERROR_NO_DRIVER_FOUND = 4
    ERROR_NO_DEVICE_FOUND = 5
    ERROR_NOT_AVAILABLE = 6
    ERROR_TIMEOUT = 7
    ERROR_GEOMETRY = 8
    ERROR_EXPERT_MODE_DISABLED = 9
    ERROR_NOT_IMPLEMENTED = 10
    ERROR_OUT_OF_MEMORY = 11
    ERROR_DEVICE_NOT_READY = 12
    ERROR_FILE_NOT_FOUND = 13
    ERROR_CONFIGURATION = 14
    ERROR_INVALID_INDEX = 15
    ERROR_DEPRECATED = 16
    ERROR_NULL_ARGUMENT = 17
    ERROR_REDUNDANT_FAIL = 18
    ERROR_NOT_ENABLED = 19
    ERROR_DEVICE_IN_USE = 20
    ERROR_INVALID = 21
    ERROR_NO_REGULATION = 22


class DhdStatus(IntEnum):
    """Places of the states that netboard reads, in the array of `Dhd.status`."""

    POWER = 0
    RESET = 3
    FORCE = 5
    ERROR = 9


class ForceOff(IntEnum):
    """Causes for which the device's controller has switched the forces off."""

    NONE = 0
    BUTTON = 1
    VELOCITY = 2
    WATCHDOG = 3
    SOFTWARE = 4
    USBDISCN = 5
    DEADMAN = 6


STATUSES = 32
"""Room for states; the header has 17 [1]."""

_DOUBLE = POINTER(c_double)

PROTOTYPES: dict[str, tuple[Any, ...]] = {
    "dhdErrorGetLast": (c_int,),
    "dhdErrorGetLastStr": (c_char_p,),
    "dhdErrorGetStr": (c_char_p, c_int),
    "dhdGetSDKVersion": (None, *(POINTER(c_int),) * 4),
    "dhdGetDeviceCount": (c_int,),
    "dhdOpenID": (c_int, c_byte),
    "dhdOpenSerial": (c_int, c_int),
    "dhdClose": (c_int, c_byte),
    "dhdStop": (c_int, c_byte),
    "dhdGetSerialNumber": (c_int, POINTER(c_ushort), c_byte),
    "dhdGetSystemType": (c_int, c_byte),
    "dhdGetSystemName": (c_char_p, c_byte),
    "dhdGetVersion": (c_int, _DOUBLE, c_byte),
    "dhdGetEffectorMass": (c_int, _DOUBLE, c_byte),
    "dhdGetStatus": (c_int, POINTER(c_int), c_byte),
    "dhdEnableForce": (c_int, c_ubyte, c_byte),
    "dhdSetGravityCompensation": (c_int, c_int, c_byte),
    "dhdSetMaxForce": (c_int, c_double, c_byte),
    "dhdGetPosition": (c_int, _DOUBLE, _DOUBLE, _DOUBLE, c_byte),
    "dhdGetLinearVelocity": (c_int, _DOUBLE, _DOUBLE, _DOUBLE, c_byte),
    "dhdGetButtonMask": (c_uint, c_byte),
    "dhdSetForce": (c_int, c_double, c_double, c_double, c_byte),
}
"""Return and argument types of every function that netboard or its servo calls; the last argument is the device."""

HELP = "install Force Dimension's SDK, or name the file in the option library; docs/how-to/force-dimension.md"


class Dhd:
    """The vendor's library, loaded. ``path``: path of the library, or a name by which the system finds it."""

    def __init__(self, path: str) -> None:
        self.path = path
        self.calls = ctypes.CDLL(path, winmode=0)  # 0: Windows also searches PATH
        for name, (returns, *takes) in PROTOTYPES.items():
            function = getattr(self.calls, name)
            function.restype, function.argtypes = returns, takes
        self.open_here: set[int] = set()  # devices that this process has open

    def address(self, name: str) -> c_void_p:
        """Return the address of a function."""
        return ctypes.cast(getattr(self.calls, name), c_void_p)

    def last_error(self) -> str:
        """Describe the last error of this thread."""
        return self.described(self.calls.dhdErrorGetLast(), self.calls.dhdErrorGetLastStr())

    def error(self, code: int) -> str:
        """Describe an error."""
        return self.described(code, self.calls.dhdErrorGetStr(code))

    @staticmethod
    def described(code: int, text: bytes | None) -> str:
        """Return an error's name, code and the library's own text."""
        known = f"DHD_{DhdError(code).name}" if code in set(DhdError) else "unknown error"
        return f"{known} ({code}): {(text or b'no description').decode(errors='replace')}"

    @property
    def version(self) -> str:
        """Version of the SDK."""
        parts = [c_int() for _ in range(4)]
        self.calls.dhdGetSDKVersion(*map(byref, parts))
        return ".".join(str(part.value) for part in parts)

    def serial(self, device: int) -> str:
        """Return the serial number of an open device; empty if the SDK cannot read it, as of a Falcon."""
        number = c_ushort()
        return "" if self.calls.dhdGetSerialNumber(byref(number), device) < 0 else str(number.value)

    def name(self, device: int) -> str:
        """Return the name of an open device's model."""
        text: bytes | None = self.calls.dhdGetSystemName(device)
        return (text or b"").decode(errors="replace").strip()

    def number(self, function: str, device: int, unit: str) -> str:
        """Return a property of a device with its unit, or why it is missing."""
        value = c_double()
        if getattr(self.calls, function)(byref(value), device) < 0:
            return f"not reported: {self.last_error()}"
        return f"{value.value:g} {unit}".strip()

    def status(self, device: int) -> list[int] | None:
        """Return the states of a device; None after an error."""
        states = (c_int * STATUSES)()
        return None if self.calls.dhdGetStatus(states, device) < 0 else list(states)


def places() -> list[str]:
    """Return the search paths: the system's own rules, then the SDK's folder, then the usual place of a copy."""
    if sys.platform == "win32":
        base = os.environ.get("FDSDK")
        return ["dhd64.dll", *((str(Path(base, "bin", "dhd64.dll")),) if base else ())]
    folders = [Path("/usr/local/lib")]
    if base := os.environ.get("FDSDK"):
        folders = [*sorted(Path(base, "lib", "release").glob("*")), *folders]
    found = [at for folder in folders for at in sorted(folder.glob("libdhd.so.3*"), key=_version, reverse=True)]
    return ["libdhd.so.3", "libdhd.so", *map(str, found)]


def _version(library: Path) -> list[int]:
    """Return the version in the name of a library: 3.17 is newer than 3.9."""
    return [int(number) for number in re.findall(r"\d+", library.name)]


_loaded: dict[int, Dhd] = {}


def load(path: str = "") -> Dhd:
    """Load the library, once per process.

    Raises `DeviceNotFound` if the library is missing or invalid; the message says where it was searched for and what to
    install.
    """
    why = []
    for place in [path] if path else places():
        try:
            library = Dhd(place)
        except (OSError, AttributeError) as error:
            why.append(f"{place} ({error})")
            continue
        return _loaded.setdefault(library.calls._handle, library)
    raise DeviceNotFound(f"Force Dimension's library cannot be loaded: tried {', '.join(why)}; {HELP}")
