"""Backend ``openhaptics``: Touch, Touch X, Phantom and related devices, through the vendor's library.

The vendor's servo thread reads the stylus and renders the force once per millisecond (`netboard.devices.touch.servo`).
The device returns the servo's latest reading and sets its next force, by the kernels of
`netboard.devices.touch.access`. With a servo in C, compiled code may call them without Python.

A device is ready while its stylus is out of the inkwell, no motor has reported an error recently and no force has been
cut. Every reported error is named in a message. Errors caused by a hand or a hot motor make the device temporarily not
ready; all others mean that it is lost.

Options (``agents.<side>.options``): see `OpenHapticsOptions`. How to set it up: docs/how-to/touch.md.
"""

import logging
from dataclasses import dataclass, replace
from typing import Annotated, Literal, final

import numpy as np

from netboard.base.compiled import machine_code
from netboard.base.config import Config, Side
from netboard.base.errors import DeviceLost, DeviceNotFound, DeviceTimeout
from netboard.base.settings import FORBID_UNKNOWN_KEYS, about
from netboard.base.system.monotonic import monotonic_ns
from netboard.base.tick import NEVER_NS
from netboard.devices.contract.access import CompiledAccess
from netboard.devices.contract.device import Device, DeviceInfo, Found, Reading
from netboard.devices.touch import access
from netboard.devices.touch.access import DEVICE, LIBRARY, SAMPLE
from netboard.devices.touch.api import Error, Fault
from netboard.devices.touch.find import calibrate, candidates, describe, enable, find, present
from netboard.devices.touch.library import OpenDevice, TouchRig, rig_of
from netboard.devices.touch.servo import PythonServo, Servo, wait_ticks
from netboard.devices.touch.shim import ShimServo, shim

log = logging.getLogger(__name__)

STALL_NS = 50_000_000
"""Timeout after which a servo without ticks counts as stalled [ns]."""

FIRST_TICK_NS = 1_000_000_000
"""Timeout of a started servo's first tick [ns]."""

REST_NS = 1_000_000_000
"""Time for which the device is not ready after a motor error [ns]."""

REPEAT_INTERVAL_NS = 1_000_000_000
"""Quiet time after which the same error is logged again [ns]."""

TIRED = frozenset(
    {
        Error.WARM_MOTORS,
        Error.EXCEEDED_MAX_FORCE,
        Error.EXCEEDED_MAX_FORCE_IMPULSE,
        Error.EXCEEDED_MAX_VELOCITY,
        Error.FORCE_ERROR,
    }
)
"""Errors after which the library disables the force temporarily and continues."""

LATE = frozenset({Error.TIMER_ERROR})
"""Errors that mean servo deadline misses; all others mean that the device is lost."""


@dataclass(frozen=True, slots=True)
class OpenHapticsOptions:
    """Options of a device of OpenHaptics."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    serial: Annotated[str, about("serial number of the device; empty for the one by that name, or the only one")] = ""
    name: Annotated[str, about("name of the device in the vendor's set-up tool; empty: the default names")] = ""
    library: Annotated[str, about("file of the vendor's library; empty to look for libHD.so or HD.dll")] = ""
    servo: Annotated[
        Literal["auto", "c", "python"],
        about(
            "what runs in the servo thread: c needs a C compiler; it does not wait for the interpreter, and only with "
            "it can the agent's ticks run in compiled code; auto is c where it can be compiled, otherwise python"
        ),
    ] = "auto"
    force_timeout_ms: Annotated[float, about("age at which the servo loop zeroes a force", "ms", ge=2, le=200)] = 20.0
    resolution: Annotated[float, about("size of one encoder step at the stylus", "m", ge=0, le=0.01)] = 0.055e-3


SERVOS: dict[str, type[PythonServo] | type[ShimServo]] = {"python": PythonServo, "c": ShimServo}
"""Implementations of the servo, by the option ``servo``."""


def servo_kind(option: str) -> str:
    """Return the key of `SERVOS` for the option ``servo``; log why ``auto`` is not C."""
    if option != "auto":
        return option
    try:
        shim()
    except DeviceNotFound as error:
        log.warning("the servo callback and the agent's ticks run in Python, which is slower: %s", error)
        return "python"
    return "c"


@final
class OpenHaptics(Device):
    """An OpenHaptics device."""

    def __init__(self, side: Side, config: Config) -> None:
        super().__init__(side, config)
        self._options = self.read_options(OpenHapticsOptions)
        self._rig: TouchRig | None = None
        self._opened: OpenDevice | None = None
        self._servo: Servo | None = None
        self._lost = False
        self._state = np.zeros(1, DEVICE)
        self._reported_ns: dict[int, int] = {}
        library, sample = np.zeros(1, LIBRARY), np.zeros(1, SAMPLE)
        self._has_stalled = machine_code(access.has_stalled, library, self._state, sample, 0)
        self._reading_of = machine_code(access.reading_of, library, self._state, sample, 0)
        self._to_motors = machine_code(access.to_motors, self._state, 0.0, 0.0, 0.0)

    @classmethod
    def present(cls, config: Config) -> tuple[Found, ...]:
        """List the devices that the vendor's library shows and no program uses, without rendering force."""
        agents = (config.agents.left, config.agents.right)
        given = [agent.options for agent in agents if agent.device == "openhaptics"]
        rig = rig_of(next((str(options["library"]) for options in given if options.get("library")), ""))
        names = [str(options["name"]) for options in given if options.get("name")]
        return present(rig, list(dict.fromkeys([*names, *candidates("")])))

    def _open(self) -> DeviceInfo:
        self._lost, self._reported_ns = False, {}
        self._state["rested_ns"], self._state["stall_ns"] = NEVER_NS, STALL_NS
        kind = servo_kind(self._options.servo)
        self._rig = rig = rig_of(self._options.library)
        try:
            with rig.paused():
                self._opened = opened = find(rig, self._options.serial, self._options.name)
                info = describe(rig.library, opened, self._options.resolution)
                timeout_ns = round(self._options.force_timeout_ms * 1e6)
                self._servo = servo = SERVOS[kind](rig.library, opened.handle, timeout_ns)
                rig.schedule(opened, servo)
            self._first_ticks(rig, servo, opened)
            # Before the force is switched on: calibrating makes the position jump (OpenHaptics Programmer's Guide).
            calibrate(rig, opened)
            with rig.paused():
                self._judge(rig.faults(opened), monotonic_ns())  # of the calibration, too
                limits = enable(rig, opened)
            self._first_ticks(rig, servo, opened)
        except BaseException:
            self._release()
            raise
        self._state["max_force"] = info.max_force
        self._state["servo"] = servo.address if isinstance(servo, ShimServo) else 0
        return replace(info, details={**info.details, "servo": kind, **limits})

    def _first_ticks(self, rig: TouchRig, servo: Servo, opened: OpenDevice) -> None:
        """Wait until the servo runs, and check its errors."""
        running = wait_ticks(servo, 2, FIRST_TICK_NS)
        self._judge(rig.faults(opened), monotonic_ns())
        if not running:
            raise DeviceTimeout(
                "the servo loop of the haptic device does not run; does another program use the device?"
            )

    def _read(self, now_ns: int) -> Reading:
        assert self._rig is not None
        assert self._opened is not None
        assert self._servo is not None
        library, sample = self._rig.state, self._servo.sample
        # Before the errors: those of a tick are there when its result is, so none of them can be missed.
        self._servo.take()
        self._judge(self._rig.faults(self._opened), now_ns)
        if self._has_stalled(library, self._state, sample, now_ns):
            self._lost = True
            late_ms = (now_ns - int(sample[0]["stamp_ns"])) * 1e-6
            raise DeviceTimeout(f"the servo loop of the haptic device has stalled for {late_ms:.0f} ms")
        return Reading(*self._reading_of(library, self._state, sample, now_ns))

    def _write(self, fx: float, fy: float, fz: float) -> None:
        assert self._servo is not None
        self._servo.put(self._to_motors(self._state, fx, fy, fz))

    def _compiled(self) -> CompiledAccess | None:
        rig, servo = self._rig, self._servo
        if rig is None or not isinstance(servo, ShimServo):
            return None
        parts = rig.state, self._state, servo.sample, servo.memory
        return CompiledAccess(parts, access.read, access.write, access.live)

    def _compiled_unopened(self) -> CompiledAccess | None:
        if servo_kind(self._options.servo) != "c":
            return None
        shim()  # loads the functions that the kernels call
        parts = np.zeros(1, LIBRARY), self._state, np.zeros(1, SAMPLE), np.zeros(1, np.int64)
        return CompiledAccess(parts, access.read, access.write, access.live)

    def _close(self) -> None:
        lost = self._lost
        if not self._release() and not lost:
            raise DeviceLost("the haptic device did not confirm the zero force before it was released")

    def _release(self) -> bool:
        """Release the device, if there is one; return whether it is known to have taken a zero force."""
        opened, self._opened, self._servo = self._opened, None, None
        self._state["servo"] = 0
        return opened is None or self._rig is None or self._rig.release(opened)

    def _judge(self, faults: list[Fault], now_ns: int) -> None:
        """Process errors of the library: make the device not ready for a while, or report it lost."""
        fatal = [fault for fault in faults if fault.code not in TIRED]
        for fault in faults:
            if now_ns - self._reported_ns.get(fault.code, -REPEAT_INTERVAL_NS) >= REPEAT_INTERVAL_NS:
                log.warning("the haptic device reports %s", fault)
            self._reported_ns[fault.code] = now_ns
        if faults:
            self._state["rested_ns"] = now_ns + REST_NS
        if fatal:
            self._lost = True
            kind = DeviceTimeout if all(fault.code in LATE for fault in fatal) else DeviceLost
            raise kind(f"the haptic device failed: {'; '.join(map(str, fatal))}")
