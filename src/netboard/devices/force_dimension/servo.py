"""The servo loop of one device in C (``servo.c``), as Python sees it.

It publishes a result (`SAMPLE`) in each tick and renders the force that was set last. A force that is older than the
timeout, or not finite, is cut to zero, and stays cut until a zero force is set. After `DhdServo.close` every force is
cut. What the thread was given is never freed, because a call of the SDK may still be in it.
"""

import ctypes
from collections.abc import Callable
from ctypes import POINTER, byref, c_double, c_int, c_int64, c_size_t, c_void_p
from functools import cache
from pathlib import Path
from time import sleep
from typing import NamedTuple

import numpy as np

from netboard.base import kernel_cache
from netboard.base.errors import DeviceNotFound
from netboard.base.system.monotonic import monotonic_ns
from netboard.devices.force_dimension.api import Dhd
from netboard.devices.servo.compiling import CannotCompile, compiled_library

SOURCE = Path(__file__).with_name("servo.c")

CALLED = (
    *("dhdGetPosition", "dhdGetLinearVelocity", "dhdSetForce", "dhdGetStatus"),
    *("dhdGetButtonMask", "dhdErrorGetLast"),
)
"""Functions of the SDK that the servo calls, in its order."""

SAMPLE = np.dtype(
    [
        ("tick", "<i8"),  # number of the servo's tick, 0 before the first
        ("stamp_ns", "<i8"),  # time at which the position was read [ns]
        ("position", "<f8", (3,)),  # [m]
        ("velocity", "<f8", (3,)),  # [m/s]
        ("buttons", "<i4"),
        ("off", "<i2"),  # 0: forces are on; otherwise 1 + the cause
        ("cut", "<i2"),  # 1: the servo has cut an old force
    ]
)
"""Result of a tick; ``struct sample`` in the source."""

SETTLE_TICKS = 2
"""Number of ticks after which a force that was set has reached the motors [1]."""

POLL_S = 2e-4


class DhdCalls(ctypes.Structure):
    """Addresses of `CALLED`; ``struct library`` in the source."""

    _fields_ = tuple((name, c_void_p) for name in CALLED)


class DhdErrorInfo(ctypes.Structure):
    """An error; ``struct error_info`` in rings.h."""

    _fields_ = (("code", ctypes.c_uint32), ("call", ctypes.c_int32), ("device", ctypes.c_uint32))


class ServoFault(NamedTuple):
    """An error of a call of the servo."""

    code: int
    function: str


@cache
def compiled() -> ctypes.CDLL:
    """Return the servo, compiled or from the cache."""
    try:
        library = ctypes.CDLL(str(compiled_library(kernel_cache.folder(), SOURCE, "-pthread")))
    except CannotCompile as error:
        raise DeviceNotFound(f"the servo of Force Dimension devices {error}; {error.advice}") from error
    except OSError as error:  # such as a folder whose files may not be executed
        raise DeviceNotFound(f"the servo of Force Dimension devices does not load: {error}") from error
    takes = {
        "size": (c_size_t,),
        "prepare": (None, c_void_p, POINTER(DhdCalls), c_int, c_int64),
        "start": (c_int, c_void_p),
        "put": (None, c_void_p, c_double, c_double, c_double),
        "close": (None, c_void_p),
        "stop": (None, c_void_p),
        "ended": (c_int, c_void_p),
        "ticks": (c_int64, c_void_p),
        "take": (c_int, c_void_p, c_void_p),
        "next_fault": (c_int, c_void_p, POINTER(DhdErrorInfo)),
    }
    for name, (returns, *arguments) in takes.items():
        function = getattr(library, f"dhd_servo_{name}")
        function.restype, function.argtypes = returns, arguments
    return library


_given: list[object] = []
"""The memory of every servo, some kilobytes for each opening of a device."""


class DhdServo:
    """A servo thread. ``timeout_ns``: age above which a force is cut to zero [ns]."""

    def __init__(self, dhd: Dhd, device: int, timeout_ns: int) -> None:
        self._c = c = compiled()
        memory = np.zeros(-(-c.dhd_servo_size() // 8), np.int64)
        self._at = memory.ctypes.data
        c.dhd_servo_prepare(self._at, byref(DhdCalls(*map(dhd.address, CALLED))), device, timeout_ns)
        self.sample = np.zeros(1, SAMPLE)
        _given.append(memory)

    def start(self) -> None:
        """Start the thread, with zero force."""
        if error := self._c.dhd_servo_start(self._at):
            raise DeviceNotFound(f"the servo thread of the device cannot be started: error {error}")

    def put(self, fx: float, fy: float, fz: float) -> None:
        """Set the force from the next tick on [N]."""
        self._c.dhd_servo_put(self._at, fx, fy, fz)

    def take(self) -> None:
        """Take the newest result into `sample`; keep the last one if the servo is overwriting it."""
        self._c.dhd_servo_take(self._at, self.sample.ctypes.data)

    def faults(self) -> list[ServoFault]:
        """Return the errors since the last call, oldest first."""
        found, error = [], DhdErrorInfo()
        while self._c.dhd_servo_next_fault(self._at, byref(error)):
            found.append(ServoFault(error.code, CALLED[error.call]))
        return found

    @property
    def ended(self) -> bool:
        """Whether the thread has ended, after an error or `close`."""
        return bool(self._c.dhd_servo_ended(self._at))

    def wait_ticks(self, count: int, timeout_ns: int) -> bool:
        """Wait for this many further ticks; return whether they came in time."""
        target = self._c.dhd_servo_ticks(self._at) + count
        return self._wait(lambda: self._c.dhd_servo_ticks(self._at) >= target, timeout_ns)

    def close(self, timeout_ns: int) -> bool:
        """Render zero force, and end the thread; return whether the motors are known to have taken it."""
        self._c.dhd_servo_close(self._at)
        taken = self.wait_ticks(SETTLE_TICKS, timeout_ns)
        self._c.dhd_servo_stop(self._at)
        return self._wait(lambda: self.ended, timeout_ns) and taken

    def _wait(self, done: Callable[[], bool], timeout_ns: int) -> bool:
        """Wait until something is done, or the thread has ended."""
        deadline_ns = monotonic_ns() + timeout_ns
        while not done():
            if monotonic_ns() > deadline_ns or self.ended:
                return done()
            sleep(POLL_S)
        return True
