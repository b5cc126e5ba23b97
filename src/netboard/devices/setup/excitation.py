"""The run from which a stylus is identified: a soft spring leads it up and down, slowly first, then faster.

The other end of the spring moves in a chirp, so the stylus stays about where it was, whatever its mass and friction,
and feels every speed up to the limit at some time: slow movements tell friction, fast ones mass, those between damping.
Each turn of the chirp is larger or smaller than the one before, for otherwise friction and damping look alike. Across,
a spring as soft keeps it where it was.
"""

from dataclasses import dataclass, replace
from math import cos, exp, log, pi, sin, tau

import numpy as np

from netboard.base.errors import DeviceError
from netboard.base.tables.rig import Safety as Limits
from netboard.devices.contract.device import Device, Reading
from netboard.devices.safety.chain import Vector
from netboard.devices.setup.identification import Identified, Motion, identify
from netboard.devices.setup.loop import Beats, Driver, Progress, Track

AXIS = 2
"""The axis of the task: up and down [1]."""


@dataclass(frozen=True, slots=True)
class Chirp:
    """How the stylus is led.

    Attributes
    ----------
    seconds : float
        For how long [s].
    slowest, fastest : float
        Frequency at its begin and at its end [Hz].
    swing : float
        Largest movement to either side [m].
    speed : float
        Largest speed of the leading end [m/s].
    stiffness, damping : float
        Of the spring [N/m, N s/m].
    max_force : float
        Limit of the force [N].
    max_speed : float
        Speed of the stylus above which the force is cut [m/s].
    """

    seconds: float = 12.0
    slowest: float = 0.5
    fastest: float = 8.0
    swing: float = 0.02
    speed: float = 0.25
    stiffness: float = 100.0
    damping: float = 2.0
    max_force: float = 2.0
    max_speed: float = 1.0

    def lead(self, t: float) -> float:
        """Where the leading end is [m] at a time [s]; the phase is that of a logarithmic sweep (Farina 2000)."""
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
    """Make the limits of the run: the chirp's, or the rig's own where those are tighter."""
    most = min(chirp.max_force, own.max_force)
    return replace(
        own,
        max_force=most,
        max_speed=min(chirp.max_speed, own.max_speed),
        arm_gate=min(own.arm_gate, most),
    )


def run(device: Device, beats: Beats, chirp: Chirp, own: Limits, progress: Progress = lambda _: None) -> Track:
    """Lead the stylus of an open device along the chirp.

    Raises
    ------
    DeviceError
        If the device has no motors, has no room, or fails; or if the safety chain takes the force away.
    """
    if device.info.max_force <= 0.0:
        raise DeviceError(f"the {device.info.model} cannot be identified: it has no motors")
    home: list[Vector] = []

    def force(t: float, reading: Reading) -> Vector:
        if not home:
            home.append((reading.x, reading.y, reading.z))
            _check_room(device, home[0], chirp)
        k, c = chirp.stiffness, chirp.damping
        x, y, z = home[0]
        return (
            k * (x - reading.x) - c * reading.vx,
            k * (y - reading.y) - c * reading.vy,
            k * (z + chirp.lead(t) - reading.z) - c * reading.vz,
        )

    return Driver(device, beats, limits_of(chirp, own)).drive(chirp.seconds, force, progress)


def _check_room(device: Device, home: Vector, chirp: Chirp) -> None:
    """Refuse where the stylus would be led out of the workspace."""
    box = device.info.workspace
    room = 2.0 * chirp.swing
    x, y, z = home
    if box is not None and not (box.holds(x, y, z - room) and box.holds(x, y, z + room)):
        raise DeviceError(
            f"the stylus needs {room * 1e3:.0f} mm of room up and down, and is at a height of {z * 1e3:.0f} mm in a "
            f"workspace from {box.z_min * 1e3:.0f} to {box.z_max * 1e3:.0f} mm: hold it in the middle"
        )


def motion_of(track: Track, axis: int = AXIS) -> Motion:
    """One axis of a run; positions that were read twice count once."""
    fresh = np.concatenate([[True], np.diff(track.time) > 0.0])
    return Motion(track.time[fresh], track.place[fresh, axis], track.written, track.force[:, axis])


def identified(track: Track, held: bool) -> Identified:
    """Identify the stylus from a run."""
    return identify(motion_of(track), held)
