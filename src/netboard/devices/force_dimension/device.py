"""Backend ``force_dimension``: omega, delta, sigma and lambda devices, and a Falcon, through Force Dimension's SDK.

A servo thread reads the device and renders the force at the rate of the SDK, 4 kHz at most
(`netboard.devices.force_dimension.servo`). The device returns the servo's latest reading and sets its next force. The
SDK's frame is the scene's: x towards the person, y right, z up, in SI units (CHAI3D uses it unchanged).

A device is ready while its controller has the forces on, no force has been cut, and the grip is inside the workspace.
The controller switches the forces off by itself, such as above a velocity; they are switched on again after a pause
with no force commanded, unless a person did it with the device's own button. Any error of the SDK means that the device
is lost.

Options (``agents.<side>.options``): see `ForceDimensionOptions`. How to set it up: docs/how-to/force-dimension.md.
"""

import atexit
import logging
from collections.abc import Mapping
from dataclasses import dataclass
from math import dist
from typing import Annotated, NamedTuple, final

from pydantic import StrictBool

from netboard.base.config import Config, Side
from netboard.base.errors import ConfigError, DeviceError, DeviceLost, DeviceNotFound, DeviceTimeout
from netboard.base.settings import FORBID_UNKNOWN_KEYS, about
from netboard.base.system.monotonic import monotonic_ns
from netboard.base.tick import NEVER_NS
from netboard.devices.contract.device import Box, Device, DeviceInfo, Found, Reading
from netboard.devices.force_dimension.api import Dhd, DhdError, DhdStatus, ForceOff, load
from netboard.devices.force_dimension.servo import DhdServo, ServoFault
from netboard.participants.body.device_forces import within

log = logging.getLogger(__name__)

STALL_NS = 50_000_000
"""Timeout after which a servo without new positions counts as stalled [ns]."""

FIRST_TICK_NS = 1_000_000_000
"""Timeout of a started servo's first ticks, and of the zero force before it ends [ns]."""

REST_NS = 1_000_000_000
"""Time without a commanded force after which forces that the controller has switched off are switched on again [ns]."""

BY_HAND = frozenset({ForceOff.BUTTON, ForceOff.DEADMAN})
"""Causes that a person ends, with the device's own button."""

CONTINUOUS_SHARE = 0.25
"""Ratio of continuous to peak force; no source states one, so it is that of the Falcon's backend [1]."""

NO_SERIAL = "Falcon"
"""Serial number of a Falcon, which the SDK cannot read."""


class ModelLimits(NamedTuple):
    """Limits of a model."""

    max_force: float  # [N]
    radius: float  # of the workspace [m]
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of the workspace [m]


OMEGA = ModelLimits(12.0, 0.075)
LAMBDA_7 = ModelLimits(12.0, 0.1125)
FALCON = 60

MODELS: Mapping[int, ModelLimits] = {
    33: OMEGA,  # omega.3
    34: OMEGA,  # omega.6, right
    36: OMEGA,  # omega.6, left
    35: OMEGA,  # omega.7, right
    37: OMEGA,  # omega.7, left
    63: ModelLimits(20.0, 0.15),  # delta.3
    104: ModelLimits(12.0, 0.075, (0.01, -0.02, 0.0)),  # sigma.7, right
    105: ModelLimits(12.0, 0.075, (0.01, 0.02, 0.0)),  # sigma.7, left
    108: LAMBDA_7,  # lambda.7, right
    109: LAMBDA_7,  # lambda.7, left
    # CHAI3D has no entry for the next four; these are its limits of an unknown model.
    203: OMEGA,  # lambda.3
    131: OMEGA,  # lambda.6, right
    132: OMEGA,  # lambda.6, left
    206: OMEGA,  # sigma.3
    FALCON: ModelLimits(8.0, 0.04),
}
"""Limits by the SDK's system type. Types: dhdc.h 3.17.5. Forces, radii, centres: CHAI3D 3.3, CDeltaDevices.cpp."""


@dataclass(frozen=True, slots=True)
class ForceDimensionOptions:
    """Options of a Force Dimension device."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    serial: Annotated[str, about("serial number of the device, a whole number; empty: the only one")] = ""
    library: Annotated[str, about("file of the vendor's library; empty to look for libdhd.so.3")] = ""
    gravity: Annotated[StrictBool, about("true: the SDK compensates the weight of the device")] = True
    force_timeout_ms: Annotated[float, about("age at which the servo loop zeroes a force", "ms", ge=2, le=200)] = 20.0
    resolution: Annotated[float, about("smallest change of position; 0.01 mm for an omega.3", "m", ge=0, le=0.01)] = (
        0.01e-3
    )


_open: "set[ForceDimension]" = set()
"""Open devices of this process."""


@atexit.register
def release_all() -> None:
    """Release all devices: at the interpreter's exit, too, no force may stay, nor a thread in freed memory."""
    for device in tuple(_open):
        device._release()


@final
class ForceDimension(Device):
    """A Force Dimension device."""

    def __init__(self, side: Side, config: Config) -> None:
        super().__init__(side, config)
        self._options = self.read_options(ForceDimensionOptions)
        if self._options.serial and not self._options.serial.isdecimal():
            found = f"found {self._options.serial!r}, expected a whole number"
            raise ConfigError(f"[agents.{side}.options] serial: {found}")
        self._dhd: Dhd | None = None
        self._servo: DhdServo | None = None
        self._device: int | None = None
        self._limits = OMEGA
        self._lost = False
        self._off = 0
        self._pushed_ns = NEVER_NS  # when a force was last commanded [ns]

    @classmethod
    def present(cls, config: Config) -> tuple[Found, ...]:
        """List the devices that no program uses, by opening them one by one without force."""
        agents = (config.agents.left, config.agents.right)
        given = [agent.options for agent in agents if agent.device == "force_dimension"]
        dhd = load(next((str(options["library"]) for options in given if options.get("library")), ""))
        found = []
        for index in range(max(dhd.calls.dhdGetDeviceCount(), 0)):
            device = dhd.calls.dhdOpenID(index)
            if device < 0 or device in dhd.open_here:  # an open device has its own number again
                continue
            found.append(Found(dhd.name(device), dhd.serial(device)))
            dhd.calls.dhdClose(device)
        return tuple(found)

    def _open(self) -> DeviceInfo:
        self._lost, self._off, self._pushed_ns = False, 0, NEVER_NS
        self._dhd = dhd = load(self._options.library)
        self._device = device = _opened(dhd, self._options.serial)
        dhd.open_here.add(device)
        _open.add(self)
        try:
            info = self._described(dhd, device)
            self._set_up(dhd, device)
            self._servo = servo = DhdServo(dhd, device, round(self._options.force_timeout_ms * 1e6))
            servo.start()
            running = servo.wait_ticks(2, FIRST_TICK_NS)
            self._judge(servo.faults())
            if not running:
                raise DeviceTimeout("the servo loop of the device does not run; does another program use the device?")
        except BaseException:
            self._release()
            raise
        return info

    def _described(self, dhd: Dhd, device: int) -> DeviceInfo:
        """Return the properties of the device; refuse a model whose limits are unknown."""
        kind = dhd.calls.dhdGetSystemType(device)
        if kind not in MODELS:
            known = ", ".join(map(str, sorted(MODELS)))
            raise DeviceError(f"the device {dhd.name(device)!r} is of system type {kind}, expected one of {known}")
        serial = dhd.serial(device) or (NO_SERIAL if kind == FALCON else "")
        if not serial:
            raise DeviceError(f"the device does not report its serial number: {dhd.last_error()}")
        self._limits = limits = MODELS[kind]
        low, high = ([c + sign * limits.radius for c in limits.centre] for sign in (-1, 1))
        return DeviceInfo(
            model=dhd.name(device) or f"Force Dimension, system type {kind}",
            serial=serial,
            max_force=limits.max_force,
            continuous_force=CONTINUOUS_SHARE * limits.max_force,
            resolution=self._options.resolution,
            workspace=Box(*low, *high),
            details={
                "sdk_version": dhd.version,
                "controller_version": dhd.number("dhdGetVersion", device, ""),
                "effector_mass": dhd.number("dhdGetEffectorMass", device, "kg"),
                "gravity_compensation": "on" if self._options.gravity else "off",
            },
        )

    def _set_up(self, dhd: Dhd, device: int) -> None:
        """Check that the device can be used, set its limits, and switch its forces on with zero force."""
        status = dhd.status(device)
        if status is None:
            raise DeviceError(f"the device does not report its status: {dhd.last_error()}")
        if not status[DhdStatus.POWER]:
            raise DeviceError("the device has no power: switch it on")
        if status[DhdStatus.ERROR]:
            raise DeviceError("the controller of the device reports an error: switch it off and on again")
        if status[DhdStatus.RESET]:
            raise DeviceError(
                "the device is not calibrated: put the grip into its rest position (the calibration pole into its pit) "
                "until the light stops blinking, and start the agent again; docs/how-to/force-dimension.md"
            )
        _must(dhd, dhd.calls.dhdSetMaxForce(self._limits.max_force, device), "limiting the force")
        _must(dhd, dhd.calls.dhdSetGravityCompensation(self._options.gravity, device), "setting gravity compensation")
        _must(dhd, dhd.calls.dhdSetForce(0.0, 0.0, 0.0, device), "setting a zero force")
        _must(dhd, dhd.calls.dhdEnableForce(1, device), "switching the forces on")

    def _read(self, now_ns: int) -> Reading:
        assert self._servo is not None
        servo, sample = self._servo, self._servo.sample
        servo.take()
        self._judge(servo.faults())
        _, stamp_ns, position, velocity, buttons, off, cut = sample[0].item()
        if now_ns - stamp_ns > STALL_NS:
            self._lost = True
            raise DeviceTimeout(f"the servo loop of the device has stalled for {(now_ns - stamp_ns) * 1e-6:.0f} ms")
        self._watch(off, now_ns)
        inside = dist(position, self._limits.centre) <= self._limits.radius
        (x, y, z), (vx, vy, vz) = position, velocity
        return Reading(min(stamp_ns, now_ns), x, y, z, vx, vy, vz, buttons, off == 0 and not cut and inside)

    def _watch(self, off: int, now_ns: int) -> None:
        """Report that the controller has switched the forces off, and switch them on again after a pause."""
        if off and not self._off:
            log.warning("the device has switched its forces off: %s", _cause(off).name.lower())
            self._pushed_ns = max(self._pushed_ns, now_ns)
        self._off = off
        if off and _cause(off) not in BY_HAND and now_ns - self._pushed_ns > REST_NS:
            assert self._dhd is not None
            self._pushed_ns = now_ns
            self._dhd.calls.dhdEnableForce(1, self._device)

    def _write(self, fx: float, fy: float, fz: float) -> None:
        assert self._servo is not None
        if fx or fy or fz:
            self._pushed_ns = max(self._pushed_ns, monotonic_ns())
        self._servo.put(*within(self._limits.max_force, fx, fy, fz))

    def _close(self) -> None:
        lost = self._lost
        if not self._release() and not lost:
            raise DeviceLost("the device did not confirm the zero force before it was released")

    def _release(self) -> bool:
        """Release the device, if there is one; return whether it is known to have taken a zero force."""
        dhd, servo, device = self._dhd, self._servo, self._device
        self._servo = self._device = None
        _open.discard(self)
        if dhd is None or device is None:
            return True
        if self._lost:
            dhd.calls.dhdStop(device)  # before any wait: a transfer may hang, and a force be on the motors
        taken = servo is None or servo.close(FIRST_TICK_NS)
        dhd.calls.dhdStop(device)  # brakes, so that the arm does not drop
        dhd.calls.dhdClose(device)
        dhd.open_here.discard(device)
        return taken

    def _judge(self, faults: list[ServoFault]) -> None:
        """Report the device lost if a call of the servo has failed."""
        if not faults:
            return
        assert self._dhd is not None
        self._lost = True
        words = "; ".join(f"{fault.function}: {self._dhd.error(fault.code)}" for fault in faults)
        kind = DeviceTimeout if all(fault.code == DhdError.ERROR_TIMEOUT for fault in faults) else DeviceLost
        raise kind(f"the Force Dimension device failed: {words}")


def _opened(dhd: Dhd, serial: str) -> int:
    """Open the device with a serial number, or the only one; raise `DeviceNotFound` if which one is meant is open."""
    count = dhd.calls.dhdGetDeviceCount()
    if count < 0:
        raise DeviceNotFound(f"the Force Dimension devices cannot be counted: {dhd.last_error()}")
    wanted = f"with serial number {serial} " if serial else ""
    if not serial and count > 1:
        raise DeviceNotFound(
            f"{count} Force Dimension devices are connected, and which of them is meant is open; set the option serial "
            "in [agents.<side>.options] (netboard devices list shows the serial numbers)"
        )
    device: int = dhd.calls.dhdOpenSerial(int(serial)) if serial else dhd.calls.dhdOpenID(0)
    if device < 0:
        raise DeviceNotFound(
            f"no Force Dimension device {wanted}can be opened ({dhd.last_error()}); {count} connected. Is it plugged "
            "in and switched on, may you open it, and does no other program use it? See docs/how-to/force-dimension.md"
        )
    if device in dhd.open_here:
        raise DeviceNotFound(f"the Force Dimension device {wanted}is in use by this process")
    return device


def _must(dhd: Dhd, result: int, what: str) -> None:
    """Raise an error if a call of the SDK has failed."""
    if result < 0:
        raise DeviceError(f"{what} failed: {dhd.last_error()}")


def _cause(off: int) -> ForceOff:
    """Return why the forces are off; an unknown cause counts as the device's own button, which a person ends."""
    return ForceOff(off - 1) if off - 1 in set(ForceOff) else ForceOff.BUTTON
