"""Servo callback in C, compiled on first use with the system's compiler and cached beside the compiled kernels.

The source is ``servo_shim.c``; a computer without a compiler uses `netboard.devices.touch.servo.PythonServo`.
"""

import ctypes
from ctypes import POINTER, byref, c_double, c_int, c_int64, c_size_t, c_uint32, c_uint64, c_void_p
from functools import cache
from pathlib import Path

import numpy as np
from llvmlite import binding
from numpy.typing import NDArray

from netboard.base import kernel_cache
from netboard.base.errors import DeviceNotFound
from netboard.devices.servo.compiling import CannotCompile, compiled_library
from netboard.devices.touch.access import SAMPLE, SYMBOL
from netboard.devices.touch.api import CALLBACK, ErrorInfo, Library
from netboard.devices.touch.servo import Raw, ServoCallback, Vector

SOURCE = Path(__file__).with_name("servo_shim.c")

IN_PYTHON = 'set the option servo = "python"'


CALLED = (
    *("hdBeginFrame", "hdEndFrame", "hdGetDoublev", "hdGetIntegerv", "hdGetBooleanv", "hdSetDoublev"),
    "hdGetError",
)
"""Vendor functions that the shim calls, in its order."""


class Calls(ctypes.Structure):
    """Addresses of `CALLED`; ``struct library`` in the shim."""

    _fields_ = tuple((name, c_void_p) for name in CALLED)


class WatchState(ctypes.Structure):
    """State of a watch; ``struct watch`` in the shim."""

    _fields_ = (
        ("callback", c_void_p),
        ("data", c_void_p),
        ("times", c_void_p),
        ("room", c_uint64),
        ("count", c_uint64),
    )


@cache
def shim() -> ctypes.PyDLL:
    """Return the shim, compiled or from the cache."""
    return servo_library(build(kernel_cache.folder()))


def servo_library(path: Path) -> ctypes.PyDLL:
    """Load the shim into this process."""
    try:
        library = ctypes.PyDLL(str(path))
    except OSError as error:  # such as a folder whose files may not be executed
        raise DeviceNotFound(f"the servo callback in C does not load: {error}; {IN_PYTHON}") from error
    library.servo_size.restype = c_size_t
    library.servo_prepare.argtypes = (c_void_p, POINTER(Calls), c_uint32, c_int64)
    library.servo_prepare.restype = None
    library.servo_put.argtypes = (c_void_p, c_double, c_double, c_double)
    library.servo_put.restype = None
    library.servo_close.argtypes = (c_void_p,)
    library.servo_close.restype = None
    library.servo_simulate.argtypes = (c_void_p, c_int64)
    library.servo_simulate.restype = None
    library.servo_take.argtypes = (c_void_p, c_void_p)
    library.servo_take.restype = c_int
    library.servo_next_fault.argtypes = (c_void_p, POINTER(ErrorInfo))
    library.servo_next_fault.restype = c_int
    for name in ("servo_take", "servo_has_fault", "servo_put"):  # kernels call these (`netboard.devices.touch.access`)
        binding.add_symbol(f"{SYMBOL}{name}", ctypes.cast(getattr(library, name), c_void_p).value)
    return library


def build(folder: Path) -> Path:
    """Compile the shim into a folder, unless it is there already."""
    try:
        return compiled_library(folder, SOURCE)
    except CannotCompile as error:
        raise DeviceNotFound(f"the servo callback in C {error}; {error.advice}, or {IN_PYTHON}") from error


class ShimServo:
    """Callback in C. It does not need the interpreter lock.

    ``timeout_ns``: age above which a force is cut to zero [ns]. Kernels take its ``address``, and keep its ``memory``.
    """

    def __init__(self, library: Library, handle: int, timeout_ns: int) -> None:
        made = shim()
        self.memory = np.zeros(-(-made.servo_size() // 8), np.int64)
        self.address = self.memory.ctypes.data
        calls = Calls(*map(library.address, CALLED))
        made.servo_prepare(self.address, byref(calls), handle, timeout_ns)
        self._put, self._take, self._next_fault = made.servo_put, made.servo_take, made.servo_next_fault
        self._simulate, self._close = made.servo_simulate, made.servo_close
        self.sample = np.zeros(1, SAMPLE)
        self._entry = ServoCallback(ctypes.cast(made.servo_tick, CALLBACK), c_void_p(self.address), self.memory)

    @property
    def entry(self) -> ServoCallback:
        """Callback to schedule."""
        return self._entry

    def put(self, force: Vector) -> None:
        """Set the force from the next tick on [N], in the vendor's frame."""
        self._put(self.address, *force)

    def close(self) -> None:
        """Render zero force from the next tick on, whatever is set."""
        self._close(self.address)

    def take(self) -> None:
        """Take the newest result into `sample`; keep the last one if the servo is overwriting it."""
        self._take(self.address, self.sample.ctypes.data)

    def simulate(self, time_ns: int) -> None:
        """Let the servo run in simulated time, which is now this [ns]."""
        self._simulate(self.address, time_ns)

    def faults(self) -> list[Raw]:
        """Return the errors since the last call, oldest tick first."""
        found: list[Raw] = []
        error = ErrorInfo()
        while self._next_fault(self.address, byref(error)):
            found.append((error.code, error.internal, error.handle))
        return found


class Watch:
    """Records call and return times of a callback, in the servo thread and without the interpreter lock.

    ``entry``: callback to watch; None for an empty tick.
    """

    def __init__(self, entry: ServoCallback | None, room: int) -> None:
        self._times = np.zeros((room, 2), np.int64)
        self._inner = entry
        callback = None if entry is None else ctypes.cast(entry.function, c_void_p)
        self._room = WatchState(callback, entry and entry.data, self._times.ctypes.data, room, 0)
        at = c_void_p(ctypes.addressof(self._room))
        self.entry = ServoCallback(ctypes.cast(shim().watch_tick, CALLBACK), at, (self._room, self._times, entry))

    @property
    def times(self) -> NDArray[np.int64]:
        """Start and end of each tick so far, as pairs [ns]."""
        return self._times[: self._room.count].copy()
