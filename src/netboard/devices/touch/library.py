"""The vendor's library within a process: one scheduler, one error stack, and the devices that share them.

Most processes have one device. Two devices share the scheduler, which is stopped while a device is added or removed. A
`TouchRig` registers the open devices; nothing else starts or stops the scheduler.

Rule 1: a device is released in this order, on every path, including the interpreter's exit: zero force, scheduler
stopped, callback unscheduled, device disabled.
Rule 2: while a device's servo runs, the device is queried only in the servo thread, where no other device is current.
Rule 3: every wait has a timeout, because the servo may have stalled.
Rule 4: what the servo thread was given is never freed: nothing tells when it has left a callback.
"""

import atexit
import logging
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from ctypes import c_void_p
from dataclasses import dataclass, field

import numpy as np

from netboard.base.errors import DeviceError, DeviceNotFound, DeviceTimeout
from netboard.base.system.monotonic import monotonic_ns
from netboard.base.tick import NEVER_NS
from netboard.devices.touch.access import LIBRARY
from netboard.devices.touch.api import (
    CALLBACK,
    DEFAULT_PRIORITY,
    INVALID_HANDLE,
    MAX_PRIORITY,
    After,
    Fault,
    Library,
    load,
)
from netboard.devices.touch.servo import SETTLE_TICKS, Servo, ServoCallback, wait_ticks

log = logging.getLogger(__name__)

SETTLE_NS = 50_000_000
"""Timeout for a zero force to reach the motors, after which the scheduler is stopped anyway [ns]."""

ANSWER_S = 1.0
"""Timeout of a query in the servo thread [s]."""


@dataclass
class OpenDevice:
    """An initialised device."""

    name: str  # name in the library; empty for its default device
    handle: int
    servo: Servo | None = None
    scheduled: int | None = None
    faults: deque[Fault] = field(default_factory=deque)


class TouchRig:
    """The open devices of a process, and their scheduler."""

    def __init__(self, library: Library) -> None:
        self.library = library
        self.state = np.zeros(1, LIBRARY)  # of which kernels need to know
        self.state["since_ns"] = NEVER_NS
        self._devices: dict[int, OpenDevice] = {}
        self._changing = threading.RLock()
        self._routing = threading.Lock()
        self._paused = 0
        atexit.register(self.clear)

    @property
    def runs(self) -> bool:
        """Whether the scheduler runs."""
        return bool(self.state[0]["since_ns"] != NEVER_NS)

    def uses(self, name: str) -> bool:
        """Return True if a device with this name is open here."""
        return any(opened.name == name for opened in tuple(self._devices.values()))

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Stop the scheduler within the context, and keep other threads from adding or removing devices."""
        with self._changing:
            self._stop()
            self._paused += 1
            try:
                yield
            finally:
                self._paused -= 1
                self._start()

    def init(self, name: str) -> OpenDevice:
        """Initialise a device and make it current, while the scheduler is paused.

        ``name``: name in the library; empty for its default device.
        """
        hd = self.library
        self._assign(hd.drain())
        handle = hd.calls.hdInitDevice(name.encode() or None)
        if faults := hd.drain():
            if handle != INVALID_HANDLE and handle not in self._devices:
                hd.calls.hdDisableDevice(handle)
                hd.drain()
            raise DeviceNotFound("; ".join(map(str, faults)))
        if handle == INVALID_HANDLE or handle in self._devices:
            raise DeviceNotFound("the library returned no device and no error")
        opened = self._devices[handle] = OpenDevice(name, handle)
        self._count_devices()
        hd.calls.hdMakeCurrentDevice(handle)
        return opened

    def schedule(self, opened: OpenDevice, servo: Servo, entry: ServoCallback | None = None) -> None:
        """Schedule a device's callback in the servo thread, starting at the end of the current pause.

        ``entry``: callback to schedule in place of the servo's, such as a watch around it.
        """
        with self.paused():
            entry = entry or servo.entry
            function, data, _ = entry
            _given.append((servo, entry))
            scheduled = self.library.calls.hdScheduleAsynchronous(function, data, DEFAULT_PRIORITY)
            self.check("scheduling the servo callback")
            opened.servo, opened.scheduled = servo, scheduled

    def check(self, what: str) -> None:
        """Raise an error if the error stack is not empty, while the scheduler is paused."""
        if faults := self.library.drain():
            raise DeviceError(f"{what} failed: {'; '.join(map(str, faults))}")

    def ask(self, opened: OpenDevice, what: str, work: Callable[[], int]) -> int:
        """Run a function in the servo thread, with this device as the current one."""
        hd, done = self.library, threading.Event()
        found: list[int] = []
        faults: list[Fault] = []

        def once(data: int | None) -> int:
            hd.ticks.hdMakeCurrentDevice(opened.handle)
            found.append(work())
            faults.extend(hd.drain())
            done.set()
            return After.CALLBACK_DONE

        callback = CALLBACK(once)
        _given.append(callback)
        scheduled = hd.calls.hdScheduleAsynchronous(callback, c_void_p(), MAX_PRIORITY)
        try:
            if not done.wait(ANSWER_S):
                raise DeviceTimeout(f"{what} failed: the servo loop did nothing for {ANSWER_S:g} s")
        finally:
            if not done.is_set():
                self._unschedule(scheduled, done)
        self._assign([fault for fault in faults if fault.handle in self._devices and fault.handle != opened.handle])
        if failed := [fault for fault in faults if fault.handle not in self._devices or fault.handle == opened.handle]:
            raise DeviceError(f"{what} failed: {'; '.join(map(str, failed))}")
        return found[0]

    def _unschedule(self, scheduled: int, done: threading.Event) -> None:
        """Unschedule a query, unless it is done once the scheduler is stopped."""
        with self.paused():
            if not done.is_set():
                self.library.calls.hdUnschedule(scheduled)

    def faults(self, opened: OpenDevice) -> list[Fault]:
        """Return the errors of a device; those of other devices are kept for them."""
        with self._routing:
            for other in tuple(self._devices.values()):
                if other.servo is not None:
                    self._assign([self.library.fault(*raw) for raw in other.servo.faults()])
            taken = [opened.faults.popleft() for _ in range(len(opened.faults))]
            self._note_kept()
        return taken

    def release(self, opened: OpenDevice) -> bool:
        """Release a device; do nothing if it is released.

        Returns True if the device is known to have taken a zero force, or never had a force.
        """
        with self._changing:
            if self._devices.get(opened.handle) is not opened:
                return True
            taken = opened.servo is None or self._zero(opened.servo)  # before the pause: only a running servo writes it
            with self.paused():
                if opened.scheduled is not None:
                    self.library.calls.hdUnschedule(opened.scheduled)
                self.library.calls.hdDisableDevice(opened.handle)
                del self._devices[opened.handle]
                self._count_devices()
                for fault in self.library.drain():
                    if fault.handle in self._devices:
                        self._assign([fault])
                    else:
                        log.info("while a device was released: %s", fault)
            return taken

    def clear(self) -> None:
        """Release all devices."""
        for opened in tuple(self._devices.values()):
            self.release(opened)

    def _zero(self, servo: Servo) -> bool:
        """Let a servo render zero force only, and wait until that has reached the motors; return whether it has."""
        servo.close()
        return self.runs and wait_ticks(servo, SETTLE_TICKS, SETTLE_NS)

    def _assign(self, faults: list[Fault]) -> None:
        """Assign errors to their devices; an error of unknown origin goes to all."""
        for fault in faults:
            owner = self._devices.get(fault.handle)
            for opened in [owner] if owner else tuple(self._devices.values()):
                opened.faults.append(fault)
        self._note_kept()

    def _note_kept(self) -> None:
        """Note whether errors are kept for a device, so that compiled code leaves them to Python."""
        self.state["kept"] = any(opened.faults for opened in tuple(self._devices.values()))

    def _count_devices(self) -> None:
        self.state["devices"] = len(self._devices)

    def _stop(self) -> None:
        if self.runs:
            self.state["since_ns"] = NEVER_NS
            self.library.calls.hdStopScheduler()
            self._assign(self.library.drain())

    def _start(self) -> None:
        """Start the scheduler if a callback is scheduled and no pause is active."""
        if self._paused or not any(opened.scheduled is not None for opened in self._devices.values()):
            return
        self.library.calls.hdStartScheduler()
        self.state["since_ns"] = monotonic_ns()
        self._assign(self.library.drain())


_given: list[object] = []
"""Everything the servo thread was given, some kilobytes for each opening of a device (rule 4)."""

_rigs: dict[int, TouchRig] = {}
_making = threading.Lock()


def rig_of(path: str) -> TouchRig:
    """Return the rig of a library in this process; the library is loaded once."""
    library = load(path)
    with _making:
        known = library.calls._handle  # identical for the same library under any name
        if known not in _rigs:
            _rigs[known] = TouchRig(library)
        return _rigs[known]
