"""Runs one device in a loop without a server: reads it without force, or drives it through the safety chain.

Time comes from `LoopClock`, so that a test can run a virtual device in simulated time. Readings and rendered forces are
stored in a `DeviceRun`. Rule 1: a run without force writes nothing. Rule 2: every force passes the safety chain, and on
every exit path the force goes to zero first.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from netboard.base import clock
from netboard.base.clock import Pacer
from netboard.base.errors import DeviceError
from netboard.base.tables.rig import Safety as Limits
from netboard.base.tick import TICK_NS
from netboard.devices.contract.device import Device, Reading
from netboard.devices.safety.chain import ZERO, Guard, SafetyChain, Vector

Floats = NDArray[np.float64]
Progress = Callable[[float], None]
"""Callback for the completed fraction of a run [1]."""

ARMING_SECONDS = 15.0
"""Timeout for arming the safety chain [s]."""


class LoopClock(Protocol):
    """Clock of a 1 kHz loop."""

    def now(self) -> int:
        """Current time [ns]."""

    def wait(self) -> int:
        """Sleep until the next tick is due and return the time then [ns]."""


class RealTime:
    """Clock in real time."""

    def __init__(self) -> None:
        self._pacer = Pacer(clock.now_ns() + TICK_NS)

    def now(self) -> int:
        """Current time [ns]."""
        return clock.now_ns()

    def wait(self) -> int:
        """Sleep until the next tick is due and return the time then [ns]."""
        self._pacer.wait()
        return clock.now_ns()


@dataclass(frozen=True, slots=True)
class DeviceRun:
    """Readings and forces of a run."""

    begun: Floats  # time at which each reading was requested [s]
    took: Floats  # duration of each reading [s]
    time: Floats  # time stamp of each position [s]
    # Position and velocity of the stylus, in the device's own frame [m, m/s].
    place: Floats
    velocity: Floats
    buttons: NDArray[np.int64]
    ready: NDArray[np.bool_]
    written: Floats  # time at which each force was written [s]
    force: Floats  # force rendered from that time on [N]


Row = tuple[int, int, Reading, int, Vector]
"""Start and end of a reading, the reading, time of writing the force, the force."""


def track_of(rows: list[Row]) -> DeviceRun:
    """Convert the rows of a loop to arrays; time starts at the first reading."""
    zero = rows[0][0] if rows else 0
    begun, ended, readings, written, forces = zip(*rows, strict=True) if rows else ((), (), (), (), ())

    def seconds(times: tuple[int, ...]) -> Floats:
        return np.asarray((np.array(times, np.int64) - zero) * 1e-9, np.float64)

    return DeviceRun(
        begun=seconds(begun),
        took=seconds(ended) - seconds(begun),
        time=seconds(tuple(r.stamp_ns for r in readings)),
        place=np.array([(r.x, r.y, r.z) for r in readings], np.float64).reshape(-1, 3),
        velocity=np.array([(r.vx, r.vy, r.vz) for r in readings], np.float64).reshape(-1, 3),
        buttons=np.array([r.buttons for r in readings], np.int64),
        ready=np.array([r.ready for r in readings], np.bool_),
        written=seconds(written),
        force=np.array(forces, np.float64).reshape(-1, 3),
    )


def smallest_step(place: Floats) -> float:
    """Return the smallest difference between observed positions; infinite if there is only one."""
    steps = np.diff(np.unique(place))
    return float(steps[steps > 1e-9].min(initial=np.inf))


def watch(device: Device, loop_clock: LoopClock, seconds: float, progress: Progress = lambda _: None) -> DeviceRun:
    """Read a device each millisecond without writing force."""
    rows: list[Row] = []
    total = round(seconds * 1e9 / TICK_NS)
    for k in range(total):
        begun = loop_clock.wait()
        reading = device.read(begun)
        ended = loop_clock.now()
        rows.append((begun, ended, reading, ended, ZERO))
        if k % 100 == 0:
            progress(k / total)
    return track_of(rows)


class Driver:
    """Drives a device through the safety chain."""

    def __init__(self, device: Device, loop_clock: LoopClock, limits: Limits) -> None:
        self._device, self._clock = device, loop_clock
        self._limits = limits
        self._safety = SafetyChain(limits, device.info.max_force, device.info.continuous_force)

    def drive(
        self, seconds: float, force: Callable[[float, Reading], Vector], progress: Progress = lambda _: None
    ) -> DeviceRun:
        """Arm the device, render forces for a duration, then release them.

        ``force``: wanted force on the hand [N], called with the time since arming [s] and a reading.
        """
        if self._device.info.max_force <= 0.0:
            raise DeviceError(f"the {self._device.info.model} renders no force: it has no motors")
        rows: list[Row] = []
        total = round(seconds * 1e9 / TICK_NS)
        try:
            self._arm()
            for k in range(total):
                rows.append(self._step(partial(force, k * TICK_NS * 1e-9)))
                if self._safety.guard is not Guard.ARMED:
                    raise DeviceError(self._why(rows[-1][2]))
                if k % 100 == 0:
                    progress(k / total)
            self._release()
        finally:
            self._device.write(*ZERO)
        return track_of(rows)

    def _arm(self) -> None:
        """Pass gate and ramp with zero wanted force."""
        self._safety.arm()
        for _ in range(round(ARMING_SECONDS * 1e9 / TICK_NS)):
            reading = self._step(lambda _: ZERO)[2]
            if self._safety.guard is Guard.ARMED:
                return
            if self._safety.guard not in (Guard.WAITING, Guard.RAMPING):
                break
        raise DeviceError(self._why(reading))

    def _release(self) -> None:
        """Reduce the force to zero at the slew limit."""
        self._safety.disarm()
        while self._safety.guard is Guard.RELEASING:
            self._step(lambda _: ZERO)

    def _step(self, force: Callable[[Reading], Vector]) -> Row:
        """Read, limit and write once."""
        begun = self._clock.wait()
        reading = self._device.read(begun)
        ended = self._clock.now()
        mine = self._device.agent
        if reading.buttons & mine.stop_buttons:
            self._safety.stop()
        elif not reading.ready or not self._has_consent(reading):
            self._safety.disarm()
        velocity = (reading.vx, reading.vy, reading.vz)
        limited = self._safety.step(ended, force(reading), ended, velocity)
        self._device.write(limited.fx, limited.fy, limited.fz)
        return begun, ended, reading, self._clock.now(), (limited.fx, limited.fy, limited.fz)

    def _has_consent(self, reading: Reading) -> bool:
        wanted = self._device.agent.consent_buttons
        return reading.buttons & wanted == wanted

    def _why(self, reading: Reading) -> str:
        """Explain why there is no force."""
        if reading.buttons & self._device.agent.stop_buttons:
            return "the force was cut: a stop button of the stylus is pressed (stop_buttons)"
        if not self._has_consent(reading):
            return (
                "there is no force while a button that must be held down is not (consent_buttons); if no hand may hold "
                "the stylus, set consent_buttons = 0 for this command"
            )
        box = self._device.info.workspace
        if box is not None and not box.holds(reading.x, reading.y, reading.z):
            return "the stylus is outside of the workspace: bring it to the middle and try again"
        if not reading.ready:
            return (
                "the device is not ready for forces: take the stylus out of its holder, home or calibrate the device, "
                "or let its motors cool down; then try again"
            )
        if self._safety.guard is Guard.FAULT:
            return "the force was cut: the device returned readings that are not finite"
        speed = float(np.linalg.norm((reading.vx, reading.vy, reading.vz)))
        return (
            f"the force was cut: the stylus moved at {speed:.2f} m/s, the limit is {self._limits.max_speed:g} m/s; "
            "try again with less force"
        )
