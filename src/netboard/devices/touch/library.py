"""The vendor's library as a process has it: one scheduler, one error stack, and the devices that use them.

Usually a process has one device. Where it has two they share the scheduler, which stands still while a device is added
or taken away: a `Rig` is the register of the open devices, and the only one who starts and stops it.

Rule 1: a device is let go in this order, on every path, also at the interpreter's exit: zero force, scheduler stopped,
callback unscheduled, device disabled.
Rule 2: what is asked of a device while its servo runs is asked in the servo thread, where no other device is current.
Rule 3: no wait is for ever, though the servo may stand still.
"""

import atexit
import logging
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from ctypes import c_void_p
from dataclasses import dataclass, field
from time import monotonic_ns

from netboard.base.errors import DeviceError, DeviceNotFound, DeviceTimeout
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
from netboard.devices.touch.servo import SETTLE_TICKS, Entry, Servo, wait_ticks

log = logging.getLogger(__name__)

SETTLE_NS = 50_000_000
"""A zero force gets so long to reach the motors, then the scheduler is stopped all the same [ns]."""

ANSWER_S = 1.0
"""The servo thread gets so long for what is asked of it [s]."""


@dataclass
class Seat:
    """One initialised device.

    Attributes
    ----------
    name : str
        By which the library knows it; empty for its default device.
    """

    name: str
    handle: int
    servo: Servo | None = None
    scheduled: int | None = None
    faults: deque[Fault] = field(default_factory=deque)


class Rig:
    """The devices of a process, and their scheduler.

    Attributes
    ----------
    since_ns : int or None
        Since when the scheduler runs; None while it stands still [ns].
    """

    def __init__(self, library: Library) -> None:
        self.library = library
        self.since_ns: int | None = None
        self._seats: dict[int, Seat] = {}
        self._changing = threading.RLock()
        self._routing = threading.Lock()
        self._paused = 0
        atexit.register(self.clear)

    def uses(self, name: str) -> bool:
        """Whether a device of that name is in use here."""
        return any(seat.name == name for seat in tuple(self._seats.values()))

    @contextmanager
    def paused(self) -> Iterator[None]:
        """While entered, the scheduler stands still; no other thread adds a device or takes one away."""
        with self._changing:
            self._stop()
            self._paused += 1
            try:
                yield
            finally:
                self._paused -= 1
                self._start()

    def init(self, name: str) -> Seat:
        """Initialise a device, while the scheduler is paused; it is the current one then.

        Parameters
        ----------
        name : str
            By which the library knows it; empty for its default device.
        """
        hd = self.library
        self._note(hd.drain())
        handle = hd.calls.hdInitDevice(name.encode() or None)
        if faults := hd.drain():
            if handle != INVALID_HANDLE and handle not in self._seats:
                hd.calls.hdDisableDevice(handle)
                hd.drain()
            raise DeviceNotFound("; ".join(map(str, faults)))
        if handle == INVALID_HANDLE or handle in self._seats:
            raise DeviceNotFound("the library gives no device, and no error")
        seat = self._seats[handle] = Seat(name, handle)
        hd.calls.hdMakeCurrentDevice(handle)
        return seat

    def schedule(self, seat: Seat, servo: Servo, entry: Entry | None = None) -> None:
        """Let a device's callback run in the servo thread from the end of the present pause on.

        Parameters
        ----------
        entry : Entry or None
            What to schedule in its place, such as a watch over it.
        """
        with self.paused():
            function, data = entry or servo.entry
            scheduled = self.library.calls.hdScheduleAsynchronous(function, data, DEFAULT_PRIORITY)
            self.check("scheduling the servo callback")
            seat.servo, seat.scheduled = servo, scheduled

    def check(self, what: str) -> None:
        """Raise if anything is on the error stack, while the scheduler is paused."""
        if faults := self.library.drain():
            raise DeviceError(f"{what} failed: {'; '.join(map(str, faults))}")

    def ask(self, seat: Seat, what: str, work: Callable[[], int]) -> int:
        """Have something done in the servo thread, with this device as the current one."""
        hd, done = self.library, threading.Event()
        found: list[int] = []
        faults: list[Fault] = []

        def once(data: int | None) -> int:
            hd.ticks.hdMakeCurrentDevice(seat.handle)
            found.append(work())
            faults.extend(hd.drain())
            done.set()
            return After.CALLBACK_DONE

        callback = CALLBACK(once)
        scheduled = hd.calls.hdScheduleAsynchronous(callback, c_void_p(), MAX_PRIORITY)
        if not done.wait(ANSWER_S):
            with self.paused():
                hd.calls.hdUnschedule(scheduled)
            raise DeviceTimeout(f"{what} failed: the servo loop did nothing for {ANSWER_S:g} s")
        self._note([fault for fault in faults if fault.handle in self._seats and fault.handle != seat.handle])
        if mine := [fault for fault in faults if fault.handle not in self._seats or fault.handle == seat.handle]:
            raise DeviceError(f"{what} failed: {'; '.join(map(str, mine))}")
        return found[0]

    def faults(self, seat: Seat) -> list[Fault]:
        """Take the errors that are for a device; those of the others are kept for them."""
        with self._routing:
            for other in tuple(self._seats.values()):
                if other.servo is not None:
                    self._note([self.library.fault(*raw) for raw in other.servo.faults()])
        return [seat.faults.popleft() for _ in range(len(seat.faults))]

    def release(self, seat: Seat) -> bool:
        """Let a device go; nothing happens if that has been done.

        Returns
        -------
        bool
            Whether it was seen to take a zero force; also true if it never had one.
        """
        with self._changing:
            if self._seats.get(seat.handle) is not seat:
                return True
            taken = seat.servo is None or self._zero(seat.servo)
            with self.paused():
                if seat.scheduled is not None:
                    self.library.calls.hdUnschedule(seat.scheduled)
                self.library.calls.hdDisableDevice(seat.handle)
                del self._seats[seat.handle]
                for fault in self.library.drain():
                    if fault.handle in self._seats:
                        self._note([fault])
                    else:
                        log.info("while a device was released: %s", fault)
            return taken

    def clear(self) -> None:
        """Let all devices go."""
        for seat in tuple(self._seats.values()):
            self.release(seat)

    def _zero(self, servo: Servo) -> bool:
        """Put a zero force, and wait until it is in the motors; whether it is."""
        servo.put((0.0, 0.0, 0.0), monotonic_ns())
        return self.since_ns is not None and wait_ticks(servo, SETTLE_TICKS, SETTLE_NS)

    def _note(self, faults: list[Fault]) -> None:
        """Give errors to the devices they are for: to all, where the library does not know."""
        for fault in faults:
            owner = self._seats.get(fault.handle)
            for seat in [owner] if owner else tuple(self._seats.values()):
                seat.faults.append(fault)

    def _stop(self) -> None:
        if self.since_ns is not None:
            self.since_ns = None
            self.library.calls.hdStopScheduler()
            self._note(self.library.drain())

    def _start(self) -> None:
        """Start the scheduler, if anyone needs it and nobody wants it to stand still."""
        if self._paused or not any(seat.scheduled is not None for seat in self._seats.values()):
            return
        self.library.calls.hdStartScheduler()
        self.since_ns = monotonic_ns()
        self._note(self.library.drain())


_rigs: dict[int, Rig] = {}
_making = threading.Lock()


def rig_of(path: str) -> Rig:
    """Return what this process has of a library; it is loaded once."""
    library = load(path)
    with _making:
        known = library.calls._handle  # the same for the same library, however it was named
        if known not in _rigs:
            _rigs[known] = Rig(library)
        return _rigs[known]
