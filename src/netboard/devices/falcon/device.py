"""Backend ``falcon``: the Novint Falcon over USB, without the manufacturer's driver.

Written from published knowledge of the protocol and tested only on a simulated device; see docs/how-to/falcon.md.

Scene axes: out of the screen is the Falcon's z (towards the person), right its x, up its y. The origin is
`netboard.devices.falcon.kinematics.CENTRE`. Each force is sent at once. The Falcon's answer, with its encoder counts,
is read at the next reading, whose time stamp is the time at which the frame was sent.

A motor command is the torque about its arm's axis times `FalconOptions.torque_scale`, with inverted sign. The scale of
10000 per N m is the one with which libnifalcon's authors reproduced the commands of the manufacturer's library, which
takes newtons. They capped a command at 4095, here `MAX_COMMAND`. Ten centimetres in front of the base this cap is a
lateral force of 8.7 to 8.9 N; the manufacturer specifies 8.9 N (two pounds). Both values are therefore plausible, but
need a test with a spring balance. (The present libnifalcon has a limit of 30 N m instead, a command of 300000, which no
frame can carry.) If a command exceeds the cap, all three are scaled, so that the force keeps its direction.

The encoders have no zero until the grip has been pulled out and pushed in. Until then the lamp is red, the device is
not ready, and it renders no force.
"""

import contextlib
from dataclasses import dataclass
from math import hypot, isfinite
from typing import Annotated, final

from netboard.base.config import Config, Side
from netboard.base.settings import FORBID_UNKNOWN_KEYS, about
from netboard.base.system.monotonic import monotonic_ns
from netboard.devices.contract.device import Box, Device, DeviceInfo, Found, Reading
from netboard.devices.contract.registry import BACKENDS
from netboard.devices.contract.velocity import Velocimeter
from netboard.devices.falcon import firmware, ftdi, kinematics
from netboard.devices.falcon.kinematics import CENTRE, REACH, Vector
from netboard.devices.falcon.serial_protocol import GREEN, HOME, RED, FalconLine, FalconReply

((FALCON, (NAME, _)),) = BACKENDS["falcon"].usb.items()
"""USB id and name of the device."""

MAX_FORCE = 8.9
"""Peak force that the manufacturer specifies: two pounds [N]."""

ROUNDING = 0.01
"""Margin for the rounding to whole commands; the motors render this much less than `MAX_FORCE` [N]."""

CONTINUOUS_SHARE = 0.25
"""Ratio of continuous to peak force. The manufacturer specifies none; this is a Touch's, rounded down [1]."""

MAX_COMMAND = 4095
"""Largest motor command [1]."""

REST: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class FalconOptions:
    """Options of the Falcon."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    serial: Annotated[str, about("USB serial number of the device; empty: any")] = ""
    path: Annotated[str, about("USB port of the device, such as 1-2, if serial numbers are equal; empty: any")] = ""
    firmware: Annotated[
        str, about("file with Novint's firmware, loaded if the device has none; never part of netboard")
    ] = ""
    torque_scale: Annotated[float, about("motor command for a torque of an arm", "1/(N m)", gt=0, le=20000)] = 10000.0


@final
class Falcon(Device):
    """A Novint Falcon as a device."""

    def __init__(self, side: Side, config: Config) -> None:
        super().__init__(side, config)
        self._options = self.read_options(FalconOptions)
        self._chip: ftdi.Chip | None = None

    @classmethod
    def present(cls, config: Config) -> tuple[Found, ...]:
        """Check that the libraries are present; the USB listing already shows the devices."""
        ftdi.plugged_in(FALCON)
        return ()

    def require_files(self) -> None:
        """Refuse a file that is not the firmware, if one is named."""
        if self._options.firmware:
            firmware.image_of(self._options.firmware)

    def _open(self) -> DeviceInfo:
        found = ftdi.find(FALCON, NAME, self._options.serial, self._options.path)
        serial = ftdi.serial_of(found) or f"USB {found.bus}-{found.address}"
        chip = ftdi.Chip(found, NAME)
        with contextlib.ExitStack() as undo:
            undo.callback(chip.close)
            self._link = FalconLine(chip)
            loaded = firmware.ensure(chip, self._link, self._options.firmware)
            self._start()
            undo.pop_all()
        self._chip = chip
        return self._described(serial, loaded)

    def _start(self) -> None:
        """Reset the grip's position and request the first answer."""
        self._force = REST
        self._place, self._angles = CENTRE, kinematics.inverse(CENTRE)
        self._encoders: tuple[int, int, int] | None = None
        self._found = self._homed = self._ready = False
        self._stamp_ns = 0
        columns = kinematics.jacobian(self._angles, CENTRE)
        self._resolution = kinematics.ANGLE_PER_COUNT * max(hypot(*column) for column in columns)
        self._velocimeter = Velocimeter(self._resolution)
        self._warm()
        self._ask()
        self._locate(self._link.answer())

    def _warm(self) -> None:
        """Compile (or load) the kernels of the 1 kHz loop, so that the first tick is not late."""
        kinematics.forward(self._angles, CENTRE)
        kinematics.torques(self._angles, CENTRE, REST)
        Velocimeter(self._resolution).update(0, *CENTRE)

    def _described(self, serial: str, loaded: str) -> DeviceInfo:
        details = {
            "firmware": loaded,
            "torque_scale": f"{self._options.torque_scale!r} 1/(N m)",
            "largest_command": f"{MAX_COMMAND} 1",
            "angle_per_count": f"{kinematics.ANGLE_PER_COUNT!r} rad",
            "axes": "scene x, y, z = Falcon z, x, y",
            "origin": f"{CENTRE[2]!r} m in front of the base",
        }
        return DeviceInfo(
            model="Novint Falcon",
            serial=serial,
            max_force=MAX_FORCE,
            continuous_force=MAX_FORCE * CONTINUOUS_SHARE,
            resolution=self._resolution,
            workspace=Box(-REACH, -REACH, -REACH, REACH, REACH, REACH),
            details=details,
        )

    def _read(self, now_ns: int) -> Reading:
        entered_ns = monotonic_ns()
        if not self._link.awaited:
            self._ask()
        self._locate(self._link.answer())
        age_ns = max(entered_ns - self._link.sent_ns, 0)
        # Later than the one before, because the velocity needs time between two positions; and never in the future.
        self._stamp_ns = min(max(now_ns - age_ns, self._stamp_ns + 1), now_ns)
        right, up, out = self._place
        x, y, z = out - CENTRE[2], right, up
        vx, vy, vz = self._velocimeter.update(self._stamp_ns, x, y, z)
        return Reading(self._stamp_ns, x, y, z, vx, vy, vz, self._buttons, self._ready)

    def _write(self, fx: float, fy: float, fz: float) -> None:
        self._force = (fy, fz, fx)
        self._ask()

    def _close(self) -> None:
        if self._chip is not None:
            self._chip.close()
            self._chip = None

    def _locate(self, answer: FalconReply) -> None:
        """Compute the grip's position from the encoders; keep the previous one if they give no valid pose."""
        if answer.homed != self._homed:
            self._homed = answer.homed
            self._velocimeter = Velocimeter(self._resolution)
        self._buttons = answer.buttons
        if answer.encoders != self._encoders:
            self._encoders = answer.encoders
            self._found = self._search(kinematics.angles_of(answer.encoders))
        self._ready = self._found and self._homed

    def _search(self, angles: Vector) -> bool:
        """Find the grip, starting at the previous position, then at the centre; False if no pose fits."""
        for guess in (self._place, CENTRE):
            place = kinematics.forward(angles, guess)
            if isfinite(place[0]):
                self._angles, self._place = angles, place
                return True
        return False

    def _ask(self) -> None:
        """Send the force, which requests the encoders."""
        if self._ready:
            self._link.send(self._commands(), GREEN)
        else:
            self._link.send((0, 0, 0), RED if self._homed else RED | HOME)

    def _commands(self) -> tuple[int, int, int]:
        """Return the motor commands that render the force at the grip's position."""
        size = hypot(*self._force)
        share = min(1.0, (MAX_FORCE - ROUNDING) / size) if size > 0.0 else 1.0
        a, b, c = kinematics.torques(self._angles, self._place, self._force)
        scale = -share * self._options.torque_scale
        most = abs(scale) * max(abs(a), abs(b), abs(c))
        if most > MAX_COMMAND:
            scale *= MAX_COMMAND / most
        return round(scale * a), round(scale * b), round(scale * c)
