"""The interface of every haptic device: open, read, write, close.

Rule 1: a backend implements the four ``_`` methods in its device's own frame; this module decides everything else.
Rule 2: `Device.read` returns positions in the scene's frame (x out of the screen, y right, z up), in SI units. They are
shifted and scaled by the device's profile, if it has one, then lowered by the agent's ``zero``. Readings of a backend
that is ``in_scene`` are in that frame already.
Rule 3: zero force is written before a device is released, on every path. `Device.close` may be called twice.
Rule 4: a device limits forces only to what its motors can deliver; the limits that protect people are in
`netboard.devices.safety.chain`.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import isfinite
from pathlib import Path
from typing import NamedTuple, Self, TypeVar, final

import numpy as np

from netboard.base import settings
from netboard.base.compiled import machine_code
from netboard.base.config import Config, Side
from netboard.base.device_kind import DeviceKind
from netboard.base.errors import DeviceError
from netboard.devices.contract import profile, velocity
from netboard.devices.contract.access import PLACEMENT, CompiledAccess, in_scene_frame, placed_access
from netboard.devices.contract.estimators import Estimator
from netboard.devices.contract.profile import Profile
from netboard.participants.body.device_models import resolved

O = TypeVar("O")  # noqa: E741


class Box(NamedTuple):
    """Box-shaped workspace of a stylus, in the scene's frame."""

    # Far, left, lower corner; x is out of the screen, y right, z up [m].
    x_min: float
    y_min: float
    z_min: float
    # Opposite corner [m].
    x_max: float
    y_max: float
    z_max: float

    def holds(self, x: float, y: float, z: float) -> bool:
        """Return True if the point is inside; NaN coordinates never are."""
        return self.x_min <= x <= self.x_max and self.y_min <= y <= self.y_max and self.z_min <= z <= self.z_max

    def within(self, other: "Box | None") -> "Box":
        """Return the intersection with another box; None stands for all of space."""
        if other is None:
            return self
        return Box(*map(max, self[:3], other[:3]), *map(min, self[3:], other[3:]))


class Found(NamedTuple):
    """A connected device, open or not."""

    model: str  # manufacturer's name of the model
    serial: str  # serial number; empty if reading it would require opening the device


@dataclass(frozen=True, slots=True)
class DeviceInfo:
    """Properties of a device."""

    model: str  # manufacturer's name of the model
    serial: str  # serial number, which distinguishes the two devices of a rig
    max_force: float  # peak force of the motors; 0 for a device without haptic feedback [N]
    continuous_force: float  # force that the motors can deliver continuously [N]
    resolution: float  # smallest measurable change of position; 0 if unknown [m]
    # Region in which forces are reliable, relative to the device's own origin; None if unknown. For an open device:
    # intersected with the workspace in its profile.
    workspace: Box | None = None
    # Other properties worth recording, such as the firmware, with units. For an open device: includes the profile in
    # force.
    details: Mapping[str, str] = field(default_factory=dict)
    # Apparent mass at the stylus and damping in the scene's frame; None without a profile [kg, N s/m].
    mass: float | None = None
    damping: float | None = None


class Reading(NamedTuple):
    """One sample of a stylus."""

    stamp_ns: int  # time of the position, on the clock of the ``now_ns`` argument [ns]
    # Position: out of the screen, right, up [m].
    x: float
    y: float
    z: float
    # Velocity, as estimated by the device or its backend [m/s].
    vx: float
    vy: float
    vz: float
    buttons: int  # bit mask of pressed buttons
    # True if forces may be rendered: the device is calibrated, held by a hand and inside the usable workspace.
    ready: bool


class Device(ABC):
    """A haptic device. Backends derive from this class and are final.

    Of the configuration, ``agents.<side>.options`` belongs to the backend.
    """

    kind = DeviceKind.UNDECLARED
    """What the backend of another package stands for; that of a built-in one is declared in the registry."""

    in_scene = False
    """Whether readings are in the scene's frame already, so that neither a profile nor the agent's ``zero`` applies."""

    def __init__(self, side: Side, config: Config) -> None:
        self.side = side
        self.agent = config.agents.of(side)
        # Measured properties of the device; None before `open`, and for a device without a profile.
        self.profile: Profile | None = None
        self._profiles = Path(config.agents.profiles)
        self._assumed = resolved(config.virtual)
        self._info: DeviceInfo | None = None
        self._estimator: Estimator | None = None
        self._placement = np.zeros(1, PLACEMENT)
        self._in_scene_frame = machine_code(in_scene_frame, self._placement, 0, *(0.0,) * 6, 0, False)

    @final
    def read_options(self, cls: type[O]) -> O:
        """Read the backend's own options, ``agents.<side>.options`` in the configuration.

        ``cls``: frozen dataclass whose fields are annotated with `netboard.base.settings.about`. By convention it is
        the class ``<Backend>Options`` of the backend's module, from which the documentation is generated. Raises
        `ConfigError` if an option is unknown, has the wrong type or is out of range.
        """
        return settings.check(cls, dict(self.agent.options), ("agents", self.side, "options"))

    @classmethod
    def present(cls, config: Config) -> tuple[Found, ...]:
        """List the connected devices that the backend's own library shows, without rendering force.

        Empty for a backend that knows no more than the USB listing. Raises `DeviceError` if the library is missing or
        does not answer.
        """
        return ()

    @final
    def open(self, *, placed: bool = True, restricted: bool = True) -> DeviceInfo:
        """Find the device, start it with zero force and read its profile.

        Not ``placed``: readings stay in the device's own frame. Not ``restricted``, for calibration: the profile's
        workspace is ignored. Raises `DeviceNotFound` if the device or its driver is missing, `ConfigError` if its
        profile is invalid, and `ValueError` if the device is open already.
        """
        if self._info is not None:
            raise ValueError("the device is open already")
        info = self._open()
        try:
            self.profile = None if self.in_scene else profile.load(self._profiles, info.serial)
        except BaseException:
            self._close()
            raise
        self._info = self._restricted(info) if restricted else info
        self._set_placement(self._info.workspace, placed=placed and not self.in_scene)
        self._estimator = velocity.make(self.agent.velocity, self._info.resolution)
        return self._info

    @property
    @final
    def info(self) -> DeviceInfo:
        """Properties of the open device. Raises `ValueError` if the device is closed."""
        if self._info is None:
            raise ValueError("the device is closed")
        return self._info

    @property
    @final
    def compiled(self) -> CompiledAccess | None:
        """Compiled access to the open device, in the scene's frame; None if its backend has none."""
        own = self._compiled()
        return None if own is None else placed_access(own, self._placement, self._estimator)

    @property
    @final
    def compiled_unopened(self) -> CompiledAccess | None:
        """Access as `compiled`, before the device is opened: to compile for it, never to call it."""
        own, estimator = self._compiled_unopened(), velocity.make(self.agent.velocity, 1.0)
        return None if own is None else placed_access(own, self._placement, estimator)

    @final
    def read(self, now_ns: int) -> Reading:
        """Return the current sample of the stylus.

        The sample is in the scene's frame, at the time ``now_ns`` [ns]. Raises `DeviceLost` or `DeviceTimeout` if the
        device does not answer. Raises `ValueError` if the device is closed.
        """
        if self._info is None:
            raise ValueError("a closed device cannot be read")
        reading = self._read(now_ns)
        if self._estimator is not None:
            vx, vy, vz = self._estimator.update(reading.stamp_ns, reading.x, reading.y, reading.z)
            reading = reading._replace(vx=vx, vy=vy, vz=vz)
        return Reading(*self._in_scene_frame(self._placement, *reading))

    @final
    def write(self, fx: float, fy: float, fz: float) -> None:
        """Set the force on the hand; the device holds it until the next call.

        ``fx``, ``fy``, ``fz``: out of the screen, right, up [N]. Raises `DeviceLost` or `DeviceTimeout` if the device
        does not accept the force. Raises `ValueError` if the device is closed or a force is not finite.
        """
        if self._info is None:
            raise ValueError("no force can be written to a closed device")
        # One test for all three: a NaN or an infinity makes the sum non-finite.
        if not isfinite(fx + fy + fz):
            raise ValueError(f"not a force: ({fx}, {fy}, {fz})")
        self._write(fx, fy, fz)

    @final
    def close(self) -> None:
        """Write zero force and release the device; do nothing if it is closed.

        Raises `DeviceLost` or `DeviceTimeout` if the device did not accept the zero force; it is released nevertheless.
        """
        if self._info is None:
            return
        self._info = None  # first, so that a second call does nothing even if the write fails
        try:
            try:
                self._write(0.0, 0.0, 0.0)
            except DeviceError:  # the loss of a single transfer must not leave the force on
                self._write(0.0, 0.0, 0.0)
        finally:
            self._close()

    def __enter__(self) -> Self:
        if self._info is None:
            self.open()
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _restricted(self, info: DeviceInfo) -> DeviceInfo:
        """Add the properties in the profile to those of the device; a mass not identified is that of ``[virtual]``."""
        known = self.profile
        if known is None:
            return info
        workspace, scale = Box(*known.placement.box).within(info.workspace), known.placement.scale
        own = known.mechanics if known.mechanics.identified else self._assumed
        details = {**info.details, **profile.in_words(known)}
        # Forces are not scaled, so a larger movement in the scene takes a smaller mass.
        return replace(info, workspace=workspace, details=details, mass=own.mass / scale, damping=own.damping / scale)

    def _set_placement(self, workspace: Box | None, *, placed: bool) -> None:
        """Set the transform from the device's own frame to the scene's."""
        place = self.profile.placement if placed and self.profile is not None else profile.Placement()
        p = self._placement[0]
        p["limited"], p["box"] = workspace is not None, workspace or (0.0,) * 6
        p["zero"], p["scale"] = (place.zero_x, place.zero_y, place.zero_z), place.scale
        p["lowered"] = self.agent.zero if placed else 0.0

    def _compiled(self) -> CompiledAccess | None:
        """Return the compiled access in the device's own frame, if there is any."""
        return None

    def _compiled_unopened(self) -> CompiledAccess | None:
        """Return the same, with other arrays of the same types, of a device that was not opened; None if unknown."""
        return None

    @abstractmethod
    def _open(self) -> DeviceInfo:
        """Find and start the device; on failure, release everything."""

    @abstractmethod
    def _read(self, now_ns: int) -> Reading:
        """Read the open device, in its own frame."""

    @abstractmethod
    def _write(self, fx: float, fy: float, fz: float) -> None:
        """Set the motor force, limited to what the motors can deliver [N]."""

    @abstractmethod
    def _close(self) -> None:
        """Release the device; its force is already zero unless it was unreachable."""
