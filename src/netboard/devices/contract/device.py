"""What every haptic device is to netboard: open, read, write, close.

Rule 1: a backend implements the four ``_`` methods in its device's own frame; everything else is decided here, once.
Rule 2: positions handed out are in the scene's frame (x out of the screen, y right, z up), in SI units: moved and
scaled as the profile of the device says, if it has one, then lowered by the agent's ``zero``.
Rule 3: zero force is written before a device is released, on every path, and `Device.close` may be called twice.
Rule 4: a device limits nothing but what its motors cannot give; the limits that protect people are in
`netboard.devices.safety.chain`.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import isfinite
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self, TypeVar, final

from netboard.base import settings
from netboard.base.config import Config, Side
from netboard.devices.contract import profile, velocity
from netboard.devices.contract.profile import Profile

O = TypeVar("O")  # noqa: E741


class Box(NamedTuple):
    """Part of space in which a stylus is used, in the scene's frame.

    Attributes
    ----------
    x_min, y_min, z_min : float
        Its near, left, lower corner: out of the screen, right, up [m].
    x_max, y_max, z_max : float
        The opposite one [m].
    """

    x_min: float
    y_min: float
    z_min: float
    x_max: float
    y_max: float
    z_max: float

    def holds(self, x: float, y: float, z: float) -> bool:
        """Whether a point is in it; one that is no number is not."""
        return self.x_min <= x <= self.x_max and self.y_min <= y <= self.y_max and self.z_min <= z <= self.z_max

    def within(self, other: "Box | None") -> "Box":
        """Make the part of it that is in another one too; None stands for all of space."""
        if other is None:
            return self
        return Box(*map(max, self[:3], other[:3]), *map(min, self[3:], other[3:]))


class Found(NamedTuple):
    """A device that is there, whether or not it is open.

    Attributes
    ----------
    model : str
        Maker's name of it.
    serial : str
        Serial number, empty if it cannot be told without opening the device.
    """

    model: str
    serial: str


@dataclass(frozen=True, slots=True)
class DeviceInfo:
    """What a device says of itself.

    Attributes
    ----------
    model : str
        Maker's name of it.
    serial : str
        Serial number, by which the two devices of a rig are told apart.
    max_force : float
        Largest force the motors give for a short time, 0 for a device that cannot be felt [N].
    continuous_force : float
        Largest force they give for ever [N].
    resolution : float
        Smallest change of position it can tell, 0 for none known [m].
    workspace : Box or None
        Where its forces can be trusted, counted from the device's own origin; None if it does not say. Once it is open:
        inside of what its profile says.
    details : mapping of str to str
        Whatever else it says that is worth recording, such as its firmware, with units. Once it is open: with what of
        its profile is in force.
    mass : float or None
        Apparent mass at the stylus, if its profile knows it [kg].
    damping : float or None
        Viscous damping of its mechanism, likewise [N s/m].
    """

    model: str
    serial: str
    max_force: float
    continuous_force: float
    resolution: float
    workspace: Box | None = None
    details: Mapping[str, str] = field(default_factory=dict)
    mass: float | None = None
    damping: float | None = None


class Reading(NamedTuple):
    """One reading of a stylus.

    Attributes
    ----------
    stamp_ns : int
        Time the position belongs to, on the clock of the ``now_ns`` handed in [ns].
    x, y, z : float
        Position: out of the screen, right, up [m].
    vx, vy, vz : float
        Velocity, as the device or its backend estimates it [m/s].
    buttons : int
        Bit mask of pressed buttons [1].
    ready : bool
        True if forces may be rendered: calibrated, taken in hand, inside the usable workspace.
    """

    stamp_ns: int
    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    buttons: int
    ready: bool


class Device(ABC):
    """One haptic device. Backends derive from this class and are final themselves.

    Parameters
    ----------
    side : {"left", "right"}
        Whose device it is.
    config : Config
        The whole configuration; ``config.agents.<side>.options`` is the backend's own.

    Attributes
    ----------
    profile : Profile or None
        What has been measured of it; None until it is open, and for a device that has none.
    """

    def __init__(self, side: Side, config: Config) -> None:
        self.side = side
        self.agent = config.agents.left if side == "left" else config.agents.right
        self.profile: Profile | None = None
        self._profiles = Path(config.agents.profiles)
        self._info: DeviceInfo | None = None
        self._estimator: velocity.Estimator | None = None
        self._placed = True

    @final
    def read_options(self, cls: type[O]) -> O:
        """Read the backend's own options, ``agents.<side>.options`` of the configuration.

        Parameters
        ----------
        cls : type
            Frozen dataclass whose fields are annotated with `netboard.base.settings.about`; by convention the class
            ``Options`` of the backend's module, from which the documentation is made.

        Raises
        ------
        ConfigError
            If an option is unknown, of the wrong type or out of range.
        """
        return settings.check(cls, dict(self.agent.options), ("agents", self.side, "options"))

    @classmethod
    def present(cls, config: Config) -> tuple[Found, ...]:
        """Tell which of its devices the backend's own library shows; no force is rendered.

        Parameters
        ----------
        config : Config
            The whole configuration.

        Returns
        -------
        tuple of Found
            Empty for a backend that cannot tell more than the USB does.

        Raises
        ------
        DeviceError
            If its library is not there, or does not answer.
        """
        return ()

    @final
    def open(self, *, placed: bool = True) -> DeviceInfo:
        """Find the device and start it, with no force; read its profile.

        Parameters
        ----------
        placed : bool
            False: readings stay in the device's own frame, and the profile's workspace does not count. For those who
            measure the device.

        Returns
        -------
        DeviceInfo
            What it says of itself.

        Raises
        ------
        DeviceNotFound
            If it is not there, or its driver is not.
        ConfigError
            If its profile cannot be read.
        ValueError
            If it is open already.
        """
        if self._info is not None:
            raise ValueError("the device is open already")
        info = self._open()
        try:
            self.profile = profile.load(self._profiles, info.serial)
        except BaseException:
            self._close()
            raise
        self._placed = placed
        self._info = _restricted(info, self.profile) if placed else info
        self._estimator = velocity.make(self.agent.velocity, self._info.resolution)
        return self._info

    @property
    @final
    def info(self) -> DeviceInfo:
        """What the open device says of itself.

        Raises
        ------
        ValueError
            If the device is closed.
        """
        if self._info is None:
            raise ValueError("the device is closed")
        return self._info

    @final
    def read(self, now_ns: int) -> Reading:
        """Where the stylus is.

        Parameters
        ----------
        now_ns : int
            The time [ns].

        Returns
        -------
        Reading
            In the scene's frame.

        Raises
        ------
        DeviceLost, DeviceTimeout
            If it does not answer.
        ValueError
            If the device is closed.
        """
        if self._info is None:
            raise ValueError("a closed device cannot be read")
        reading = self._read(now_ns)
        box = self._info.workspace
        if box is not None and reading.ready and not box.holds(reading.x, reading.y, reading.z):
            reading = reading._replace(ready=False)
        if self._estimator is not None:
            vx, vy, vz = self._estimator.update(reading.stamp_ns, reading.x, reading.y, reading.z)
            reading = reading._replace(vx=vx, vy=vy, vz=vz)
        if not self._placed:
            return reading
        if self.profile is not None:
            reading = _mapped(reading, self.profile.placement)
        return reading._replace(z=reading.z - self.agent.zero) if self.agent.zero else reading

    @final
    def write(self, fx: float, fy: float, fz: float) -> None:
        """Set the force on the hand, to be held until the next one.

        Parameters
        ----------
        fx, fy, fz : float
            Force: out of the screen, right, up [N].

        Raises
        ------
        DeviceLost, DeviceTimeout
            If the device does not take it.
        ValueError
            If the device is closed or a force is not finite.
        """
        if self._info is None:
            raise ValueError("no force can be written to a closed device")
        if not isfinite(fx + fy + fz):
            raise ValueError(f"not a force: ({fx}, {fy}, {fz})")
        self._write(fx, fy, fz)

    @final
    def close(self) -> None:
        """Write zero force and release the device; nothing happens if that has been done.

        Raises
        ------
        DeviceLost, DeviceTimeout
            If the device did not take the zero force; it is released all the same.
        """
        if self._info is None:
            return
        self._info = None
        try:
            self._write(0.0, 0.0, 0.0)
        finally:
            self._close()

    def __enter__(self) -> Self:
        if self._info is None:
            self.open()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    @abstractmethod
    def _open(self) -> DeviceInfo:
        """Find and start the device; leave nothing behind if that fails."""

    @abstractmethod
    def _read(self, now_ns: int) -> Reading:
        """Read the open device; z counts from the device's own origin."""

    @abstractmethod
    def _write(self, fx: float, fy: float, fz: float) -> None:
        """Set the force of the motors, limited to what they can give [N]."""

    @abstractmethod
    def _close(self) -> None:
        """Release the device; its force is zero already, if it could be reached."""


def _restricted(info: DeviceInfo, known: Profile | None) -> DeviceInfo:
    """Put what a profile says into what a device says of itself."""
    if known is None:
        return info
    workspace, like = Box(*known.placement.box).within(info.workspace), known.mechanics
    mass, damping = (like.mass, like.damping) if like.identified else (None, None)
    details = {**info.details, **profile.in_words(known)}
    return replace(info, workspace=workspace, details=details, mass=mass, damping=damping)


def _mapped(reading: Reading, place: profile.Placement) -> Reading:
    """Bring a reading from the device's own frame to the scene's."""
    s = place.scale
    return reading._replace(
        x=(reading.x - place.zero_x) * s,
        y=(reading.y - place.zero_y) * s,
        z=(reading.z - place.zero_z) * s,
        vx=reading.vx * s,
        vy=reading.vy * s,
        vz=reading.vz * s,
    )
