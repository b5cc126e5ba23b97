"""Backend ``spacemouse``: a 3Dconnexion SpaceMouse as a stylus without haptic feedback, for trying things out.

Springs hold the cap, which moves by only a millimetre or two, so its displacement is not the stylus position. With
``mode = "rate"`` the cap controls velocity: the further it is pushed, the faster the stylus moves; on release the
stylus stops. With ``mode = "position"`` the cap's displacement is scaled to that of the stylus. A dead zone in the
middle keeps a resting cap from moving the stylus.

Each reading takes all pending reports through hidapi. The axes of a report are x right, y towards the person and z
down; they become y, x and inverted z of the scene's frame. Rotations are not used. The report format is that of
PySpaceMouse's device table; see docs/how-to/spacemouse.md.
"""

import contextlib
from dataclasses import dataclass
from math import copysign, exp
from typing import Annotated, Any, Literal, final

from pydantic import StrictBool

from netboard.base.config import Config, Side
from netboard.base.errors import DeviceLost, DeviceNotFound
from netboard.base.settings import FORBID_UNKNOWN_KEYS, about
from netboard.devices.contract.device import Box, Device, DeviceInfo, Found, Reading
from netboard.devices.contract.registry import BACKENDS
from netboard.devices.contract.selection import only

SPACEMOUSE = BACKENDS["spacemouse"].usb
"""USB ids of the models."""

FULL_SCALE = 350
"""Approximate axis value at the end of the travel [1]."""

MOTION, BUTTONS, LAMP = 1, 3, 4
"""Report numbers: translation (with rotation on some models), buttons, and the lamp (output)."""

MOTION_SIZE = 7
"""Size of a translation report, with its number [B]."""

BUTTON_BYTES = 4
"""Largest size of the button mask of any model [B]."""

MAX_REPORT = 64
"""Buffer size for a report [B]."""

MAX_REPORTS = 64
"""Limit of reports per reading; a cap sends one or two in eight milliseconds [1]."""

MULTI_AXIS = (0x01, 0x08)
"""HID usage of the cap's interface, on systems where hidapi reports usages."""

CATCH_UP_NS = 50_000_000
"""Longest simulated time per reading; a longer pause between readings is cut to this [ns]."""

RELEASE_TIMEOUT_NS = 500_000_000
"""Timeout after which a push counts as released; a pushed cap keeps reporting [ns]."""

LAG = 0.02
"""Time constant of the stylus in position mode, which smooths the steps of the reports [s]."""

AT_REST = (0.0, 0.0, 0.0)
Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class SpaceMouseOptions:
    """Options of the SpaceMouse."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    serial: Annotated[str, about("serial number of the device; empty: any")] = ""
    path: Annotated[str, about("USB port (such as 1-2) or hidapi path, if serial numbers are equal; empty: any")] = ""
    mode: Annotated[Literal["rate", "position"], about("rate control (a push sets the velocity) or position")] = "rate"
    speed: Annotated[float, about("speed at full travel, in rate mode", "m/s", gt=0, le=1)] = 0.15
    reach: Annotated[float, about("displacement at full travel, in position mode", "m", gt=0, le=0.5)] = 0.05
    dead_zone: Annotated[float, about("dead zone, as a share of the travel", "1", ge=0, lt=1)] = 0.08
    expo: Annotated[float, about("response curve; 0: linear; 1: cubic, finer in the middle", "1", ge=0, le=1)] = 0.4
    workspace: Annotated[float, about("the stylus stays within +- this", "m", gt=0, le=0.5)] = 0.075
    lamp: Annotated[StrictBool, about("true: the device's lamp is on during use")] = True


@final
class SpaceMouse(Device):
    """A SpaceMouse as a device."""

    def __init__(self, side: Side, config: Config) -> None:
        super().__init__(side, config)
        self._options = self.read_options(SpaceMouseOptions)
        self._hid: Any = None
        self._reset()

    @classmethod
    def present(cls, config: Config) -> tuple[Found, ...]:
        """Check that the library is present; the USB listing already shows the devices."""
        _hidapi()
        return ()

    def _reset(self) -> None:
        """Centre the stylus, with the cap released."""
        self._push = self._place = AT_REST
        self._buttons = 0
        self._time_ns: int | None = None
        self._pushed_ns = 0

    def _open(self) -> DeviceInfo:
        hid = _hidapi()
        found = self._find(hid.enumerate())
        name = SPACEMOUSE[found["vendor_id"], found["product_id"]].name
        device = hid.device()
        try:
            device.open_path(found["path"])
        except OSError as error:
            raise DeviceNotFound(
                f"the {name} at {_path_of(found)} cannot be opened ({error}): another program uses it, or permission "
                "is missing; install deploy/udev/70-netboard.rules, see docs/how-to/spacemouse.md"
            ) from error
        device.set_nonblocking(1)
        self._hid = device
        self._reset()
        self._light(on=True)
        return self._info_of(name, found)

    def _info_of(self, name: str, found: dict[str, Any]) -> DeviceInfo:
        reach = self._options.workspace
        return DeviceInfo(
            model=f"3Dconnexion {name}",
            serial=found["serial_number"] or _path_of(found),
            max_force=0.0,
            continuous_force=0.0,
            resolution=0.0,
            workspace=Box(-reach, -reach, -reach, reach, reach, reach),
            details={"path": _path_of(found), "mode": self._options.mode, "axes": "scene x, y, z = HID y, x, -z"},
        )

    def _find(self, connected: list[dict[str, Any]]) -> dict[str, Any]:
        """Select a device."""
        mice = [one for one in connected if (one["vendor_id"], one["product_id"]) in SPACEMOUSE]
        caps = [one for one in mice if (one["usage_page"], one["usage"]) == MULTI_AXIS]
        mice = caps or _first_interfaces([one for one in mice if one["usage_page"] == 0])
        if not mice:
            raise DeviceNotFound(
                "no SpaceMouse is plugged in, or access to it is not permitted: see docs/how-to/spacemouse.md"
            )
        serial, path = self._options.serial, self._options.path
        fitting = [
            one
            for one in mice
            if serial in ("", one["serial_number"]) and path in ("", _path_of(one), _port_of(_path_of(one)))
        ]
        return only(fitting, mice, "SpaceMouse", {"serial": serial, "path": path}, _described)

    def _read(self, now_ns: int) -> Reading:
        for _ in range(MAX_REPORTS):
            try:
                report = self._hid.read(MAX_REPORT)
            except OSError as error:
                raise DeviceLost(f"the SpaceMouse was disconnected ({error}): was it unplugged?") from error
            if not report:
                break
            self._take(bytes(report), now_ns)
        if now_ns - self._pushed_ns > RELEASE_TIMEOUT_NS:
            self._push = AT_REST
        vx, vy, vz = self._moved(now_ns)
        return Reading(now_ns, *self._place, vx, vy, vz, self._buttons, True)

    def _take(self, report: bytes, now_ns: int) -> None:
        """Process a report; ignore unknown ones."""
        if report[0] == MOTION and len(report) >= MOTION_SIZE:
            right, towards, down = (int.from_bytes(report[k : k + 2], "little", signed=True) for k in (1, 3, 5))
            self._push = (self._share(towards), self._share(right), self._share(-down))
            self._pushed_ns = now_ns
        elif report[0] == BUTTONS:
            self._buttons = int.from_bytes(report[1 : 1 + BUTTON_BYTES], "little")

    def _share(self, count: int) -> float:
        """Return the deflection of an axis, -1 to 1, after dead zone and expo curve."""
        dead, expo = self._options.dead_zone, self._options.expo
        push = min(abs(count) / FULL_SCALE, 1.0)
        beyond = max(push - dead, 0.0) / (1.0 - dead)
        return copysign((1.0 - expo) * beyond + expo * beyond**3, count)

    def _moved(self, now_ns: int) -> Vector:
        """Advance the stylus to now and return its velocity."""
        dt = 0.0 if self._time_ns is None else min(max(now_ns - self._time_ns, 0), CATCH_UP_NS) * 1e-9
        self._time_ns = now_ns
        step = self._steer if self._options.mode == "rate" else self._follow
        (x, vx), (y, vy), (z, vz) = (step(at, push, dt) for at, push in zip(self._place, self._push, strict=True))
        self._place = (x, y, z)
        return vx, vy, vz

    def _steer(self, at: float, push: float, dt: float) -> tuple[float, float]:
        """Move one axis at the commanded velocity, up to the workspace limit; return position and velocity."""
        wall = self._options.workspace
        speed = push * self._options.speed
        at = min(max(at + speed * dt, -wall), wall)
        return at, 0.0 if abs(at) == wall and at * speed > 0.0 else speed

    def _follow(self, at: float, push: float, dt: float) -> tuple[float, float]:
        """Move one axis towards the commanded displacement; return position and velocity."""
        wall = self._options.workspace
        goal = min(max(push * self._options.reach, -wall), wall)
        at = goal + (at - goal) * exp(-dt / LAG)
        return at, (goal - at) / LAG

    def _write(self, fx: float, fy: float, fz: float) -> None:
        """Ignore the force: there are no motors."""

    def _close(self) -> None:
        with contextlib.suppress(OSError):  # a disconnected device has no lamp
            self._light(on=False)
        self._hid.close()

    def _light(self, on: bool) -> None:
        """Switch the lamp; models without one ignore this."""
        if self._options.lamp:
            self._hid.write([LAMP, int(on)])


def _hidapi() -> Any:
    """Import hidapi."""
    try:
        import hid  # noqa: PLC0415
    except ImportError as error:
        raise DeviceNotFound(f"hidapi is not installed ({error}): pip install 'netboard[devices]'") from error
    if not hasattr(hid, "device"):
        raise DeviceNotFound("the package hid is installed, which is not hidapi: pip uninstall hid; pip install hidapi")
    return hid


def _described(found: dict[str, Any]) -> str:
    """Describe a device for an operator who has to select one."""
    name = SPACEMOUSE[found["vendor_id"], found["product_id"]].name
    return f"{name}, serial {found['serial_number']!r}, path {_path_of(found)!r}"


def _first_interfaces(found: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return each device once; without usages, one with several interfaces appears several times in the list."""
    return list({_port_of(_path_of(one)): one for one in reversed(found)}.values())[::-1]


def _port_of(path: str) -> str:
    """Return the part of a path that all interfaces of a device share, such as 1-2 of 1-2:1.0."""
    return path.rpartition(":")[0] or path


def _path_of(found: dict[str, Any]) -> str:
    """Return the path of a device as text."""
    return bytes(found["path"]).decode(errors="replace")
