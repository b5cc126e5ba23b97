"""Excitation run for identification: a soft spring moves the stylus up and down in a chirp.

The far end of the spring moves in the chirp, so the stylus stays near its starting point, whatever its mass and
friction, and passes through all speeds up to the limit. Slow movements reveal friction, fast ones mass, intermediate
ones damping. The amplitude varies from cycle to cycle, because otherwise friction and damping could not be separated.
An equally soft spring holds the stylus laterally.
"""

from dataclasses import dataclass, replace
from math import cos, dist, exp, log, pi, sin, tau

import numpy as np

from netboard.base.errors import ConfigError, DeviceError
from netboard.base.tables.rig import Safety as Limits
from netboard.devices.contract.device import Device, Reading
from netboard.devices.safety.chain import Vector
from netboard.devices.setup.identification import AxisRun, Identified, identify
from netboard.devices.setup.loop import DeviceRun, Driver, LoopClock, Progress

AXIS = 2
"""Axis of the task: vertical [1]."""

MIN_SLEW = 100.0
"""Smallest slew limit with which the spring is stable: its force changes at up to 90 N/s, and a late one oscillates."""


@dataclass(frozen=True, slots=True)
class Chirp:
    """Parameters of the chirp."""

    seconds: float = 12.0  # [s]
    # Frequency at the start and at the end [Hz].
    slowest: float = 0.5
    fastest: float = 8.0
    swing: float = 0.02  # largest amplitude [m]
    speed: float = 0.25  # largest speed of the spring's far end [m/s]
    # Stiffness and damping of the spring [N/m, N s/m].
    stiffness: float = 100.0
    damping: float = 2.0
    max_force: float = 2.0  # force limit [N]
    max_speed: float = 1.0  # speed limit of the stylus, above which the force is cut [m/s]

    def lead(self, t: float) -> float:
        """Return the position of the spring's far end [m] at a time [s].

        The phase is a logarithmic sweep (Farina 2000).
        """
        if not 0.0 <= t <= self.seconds:
            return 0.0
        rate = log(self.fastest / self.slowest) / self.seconds
        hz = self.slowest * exp(rate * t)
        phase = tau * (hz - self.slowest) / rate
        size = min(self.swing, self.speed / (tau * hz)) * (0.6 - 0.4 * cos(phase / 3.0))
        edge = min(1.0, 2.0 * t, 2.0 * (self.seconds - t))
        size *= sin(0.5 * pi * edge) ** 2
        return size * sin(phase)


def limits_of(chirp: Chirp, own: Limits) -> Limits:
    """Return the safety limits of the run: the chirp's, or the rig's where those are tighter.

    Raises `ConfigError` if the rig's slew limit is too small for the spring.
    """
    if own.max_slew < MIN_SLEW:
        raise ConfigError(
            f"[safety] max_slew: found {own.max_slew:g}, expected at least {MIN_SLEW:g} N/s to identify a device: "
            "the spring that moves the stylus would oscillate"
        )
    most = min(chirp.max_force, own.max_force)
    return replace(own, max_force=most, max_speed=min(chirp.max_speed, own.max_speed), arm_gate=min(own.arm_gate, most))


def run(device: Device, clock: LoopClock, chirp: Chirp, own: Limits, progress: Progress = lambda _: None) -> DeviceRun:
    """Move the stylus of an open device along the chirp.

    Raises `DeviceError` if the device has no motors, has too little room or fails; or if the stylus leaves that room or
    the safety chain cuts the force.
    """
    home: list[Vector] = []

    def force(t: float, reading: Reading) -> Vector:
        if not home:
            home.append((reading.x, reading.y, reading.z))
            _check_room(device, home[0], chirp)
        k, c = chirp.stiffness, chirp.damping
        x, y, z = home[0]
        if (moved := dist(home[0], reading[1:4])) > 2.0 * chirp.swing:
            raise DeviceError(
                f"the stylus moved {moved * 1e3:.0f} mm away from where it started, more than the spring should move "
                "it; the force is zero again: see that nothing pushes the stylus, and that it does not oscillate"
            )
        return (
            k * (x - reading.x) - c * reading.vx,
            k * (y - reading.y) - c * reading.vy,
            k * (z + chirp.lead(t) - reading.z) - c * reading.vz,
        )

    return Driver(device, clock, limits_of(chirp, own)).drive(chirp.seconds, force, progress)


def _check_room(device: Device, home: Vector, chirp: Chirp) -> None:
    """Raise an error if the chirp would leave the workspace."""
    box = device.info.workspace
    room = 2.0 * chirp.swing
    x, y, z = home
    if box is not None and not (box.holds(x, y, z - room) and box.holds(x, y, z + room)):
        raise DeviceError(
            f"the stylus needs {room * 1e3:.0f} mm of room up and down, and is at a height of {z * 1e3:.0f} mm in a "
            f"workspace from {box.z_min * 1e3:.0f} to {box.z_max * 1e3:.0f} mm: hold it in the middle"
        )


def motion_of(track: DeviceRun, axis: int = AXIS) -> AxisRun:
    """Return one axis of a run without repeated readings."""
    fresh = np.concatenate([[True], np.diff(track.time) > 0.0])
    return AxisRun(track.time[fresh], track.place[fresh, axis], track.written, track.force[:, axis])


def identified(track: DeviceRun, held: bool) -> Identified:
    """Identify the stylus mechanics from a run."""
    return identify(motion_of(track), held)
