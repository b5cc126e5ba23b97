"""What every haptic device is to netboard: open, read, write, close.

Rule 1: a backend implements the four ``_`` methods in its device's own frame; everything else is decided here, once.
Rule 2: positions handed out are in the scene's frame (x out of the screen, y right, z up; z = 0 where the agent's
``zero`` says), in SI units.
Rule 3: zero force is written before a device is released, on every path, and `Device.close` may be called twice.
Rule 4: a device limits nothing but what its motors cannot give; the limits that protect people are in
`netboard.devices.safety`.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import isfinite
from types import TracebackType
from typing import NamedTuple, Self, final

from netboard.config import Config, Side


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
        Largest force the motors give for a short time [N].
    continuous_force : float
        Largest force they give for ever [N].
    resolution : float
        Smallest change of position it can tell, 0 for none known [m].
    """

    model: str
    serial: str
    max_force: float
    continuous_force: float
    resolution: float


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
    """

    def __init__(self, side: Side, config: Config) -> None:
        self.side = side
        self.agent = config.agents.left if side == "left" else config.agents.right
        self._info: DeviceInfo | None = None

    @final
    def open(self) -> DeviceInfo:
        """Find the device and start it, with no force.

        Returns
        -------
        DeviceInfo
            What it says of itself.

        Raises
        ------
        DeviceNotFound
            If it is not there, or its driver is not.
        ValueError
            If it is open already.
        """
        if self._info is not None:
            raise ValueError("the device is open already")
        self._info = self._open()
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
