"""The servo callback of one device, run by the vendor once per millisecond: read, take the force, write it.

A servo knows only the vendor's frame (x right, y up, z towards the user; mm). In each tick it publishes a
result (`SAMPLE`) and renders the force that was set last, through one slot in each direction. Neither side waits.

Rule 1: a force that is older than the timeout, or not finite, is cut to zero. It stays cut, and every result reports
this, until a zero force is set; so the force cannot return with a step. After `close`, every force is cut.
Rule 2: each tick empties the vendor's error stack and keeps the errors for `faults`. The stack is shared by all devices
of the process, so an error may belong to another one. If too many are kept, an error of netboard's own says so.
Rule 3: a result is published last, so that the errors of its tick are available with it.
"""

import time
from collections import deque
from ctypes import byref, c_double, c_int32, c_ubyte, c_void_p
from math import isfinite
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from netboard.base.system.monotonic import monotonic_ns
from netboard.devices.touch.access import SAMPLE
from netboard.devices.touch.api import CALLBACK, ERRORS_LOST, INVALID_HANDLE, MAX_ERRORS, After, Library, Parameter

Vector = tuple[float, float, float]
Raw = tuple[int, int, int]
"""An error from the stack: code, internal code, handle."""

SETTLE_TICKS = 2
"""Number of ticks after which a force that was set has reached the motors [1]."""

KEPT_FAULTS = 256
"""Number of errors from which on the older ones are lost; ``FAULTS`` in rings.h [1]."""


class ServoCallback(NamedTuple):
    """A callback for the scheduler, and the memory behind its data."""

    function: Any
    data: c_void_p
    memory: Any = None


class Servo(Protocol):
    """The callback of one device, and its two slots."""

    @property
    def entry(self) -> ServoCallback:
        """Callback to schedule."""

    @property
    def sample(self) -> NDArray[Any]:
        """Result that was taken last, an array of one `SAMPLE`."""

    def put(self, force: Vector) -> None:
        """Set the force from the next tick on [N], in the vendor's frame."""

    def close(self) -> None:
        """Render zero force from the next tick on, whatever is set."""

    def take(self) -> None:
        """Take the newest result into `sample`."""

    def faults(self) -> list[Raw]:
        """Return the errors since the last call, oldest tick first."""


class PythonServo:
    """Callback in Python. It needs the interpreter lock, so another busy thread of the process delays it.

    ``timeout_ns``: age above which a force is cut to zero [ns].
    """

    def __init__(self, library: Library, handle: int, timeout_ns: int) -> None:
        self._handle, self._timeout_ns = handle, timeout_ns
        hd = library.ticks
        self._begin, self._end, self._next_error = hd.hdBeginFrame, hd.hdEndFrame, hd.hdGetError
        self._doubles, self._set_doubles = hd.hdGetDoublev, hd.hdSetDoublev
        self._integers, self._booleans = hd.hdGetIntegerv, hd.hdGetBooleanv
        triple = c_double * 3
        self._position, self._velocity, self._out = triple(), triple(), triple()
        self._buttons, self._docked = c_int32(), c_ubyte()
        self._force: tuple[Vector, int] = ((0.0, 0.0, 0.0), 0)
        self._cut = self._closing = False
        self.sample = np.zeros(1, SAMPLE)
        self._result = self.sample[0].item()
        self._ticks = 0
        self._faults: deque[Raw] = deque(maxlen=KEPT_FAULTS - 1)
        self._lost = self._lost_before = 0  # written by the servo thread, and by the reader
        self._entry = ServoCallback(CALLBACK(self._tick), c_void_p())

    @property
    def entry(self) -> ServoCallback:
        """Callback to schedule."""
        return self._entry

    def put(self, force: Vector) -> None:
        """Set the force from the next tick on [N], in the vendor's frame."""
        self._force = (force, monotonic_ns())

    def close(self) -> None:
        """Render zero force from the next tick on, whatever is set."""
        self._closing = True

    def take(self) -> None:
        """Take the newest result into `sample`."""
        self.sample[0] = self._result

    def faults(self) -> list[Raw]:
        """Return the errors since the last call, oldest tick first."""
        found = [self._faults.popleft() for _ in range(len(self._faults))]
        lost, before = self._lost, self._lost_before
        self._lost_before = lost
        return [(ERRORS_LOST, 0, INVALID_HANDLE), *found] if lost != before else found

    def _tick(self, data: int | None) -> int:
        """Run one tick. It never waits, and calls the library without releasing the interpreter lock."""
        self._begin(self._handle)
        stamp_ns = monotonic_ns()
        position, velocity = self._position, self._velocity
        self._doubles(Parameter.CURRENT_POSITION, position)
        self._doubles(Parameter.CURRENT_VELOCITY, velocity)
        self._integers(Parameter.CURRENT_BUTTONS, byref(self._buttons))
        self._booleans(Parameter.CURRENT_INKWELL_SWITCH, byref(self._docked))
        out = self._out
        out[0], out[1], out[2] = self._chosen(stamp_ns)
        self._set_doubles(Parameter.CURRENT_FORCE, out)
        self._end(self._handle)
        for _ in range(MAX_ERRORS):
            error = self._next_error()
            if not error.code:
                break
            self._lost += len(self._faults) == self._faults.maxlen
            self._faults.append((error.code, error.internal, error.handle))
        self._ticks += 1
        self._result = (
            self._ticks,
            stamp_ns,
            (position[0], position[1], position[2]),
            (velocity[0], velocity[1], velocity[2]),
            self._buttons.value,
            self._docked.value != 0,
            self._cut,
        )
        return After.CALLBACK_CONTINUE

    def _chosen(self, at_ns: int) -> Vector:
        """Return the force to render: the latest one, or zero while forces are cut (rule 1)."""
        force, stamp_ns = self._force
        if self._closing or not all(map(isfinite, force)):
            self._cut = True
        elif not any(force):
            self._cut = False
        elif at_ns - stamp_ns > self._timeout_ns:
            self._cut = True
        return (0.0, 0.0, 0.0) if self._cut else force


def wait_ticks(servo: Servo, count: int, patience_ns: int) -> bool:
    """Wait for a number of ticks; return False at the timeout."""
    until_ns = monotonic_ns() + patience_ns
    first = ticks_of(servo)
    while ticks_of(servo) < first + count:
        if monotonic_ns() > until_ns:
            return False
        time.sleep(2e-4)
    return True


def ticks_of(servo: Servo) -> int:
    """Return the number of ticks of a servo so far [1]."""
    servo.take()
    return int(servo.sample[0]["tick"])
