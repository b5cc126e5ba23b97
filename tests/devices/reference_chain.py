"""The safety chain between each requested force and the motor. Pure; time is an argument.

The chain does not rely on the server, the network, the device's readings or the caller. Its state is a `Guard`, its
transitions are the edges of `TABLE`, and only three states let a force through. After arming, the arming gate holds the
force at zero until the requested vertical force is below `arm_gate`.

Rule 1: the force never exceeds the clamp, and never changes faster than the slew limit. A late step allows no larger
change than a step of `LONGEST_STEP_NS`.
Rule 2: a fault is the only exception to the slew limit. If a number is not finite or the device is lost, neither can be
trusted with a gradual decrease, so the force is zero at once.
Rule 3: a force that was cut returns only by the ramp. After a short outage the ramp starts from the remaining gain.
After a velocity cut it starts from zero, behind the gate. After a long outage, a fault or disarming, only `Safety.arm`
starts it.
Rule 4: staleness affects only the vertical force, which comes over the network. The agent computes the lateral force
itself. That force is ramped, clamped, slewed and cut like the other, but it does not fade while the network is silent.
Rule 5: the mean force over about `MEAN_TIME` never exceeds the motors' continuous force. As the mean approaches that
limit, the clamp decreases towards it. A larger force would overheat the motors or trigger the driver's own cutoff.
Rule 6: the gate requires only a small vertical force. The lateral force is a spring that is ramped up gently.
"""

from enum import IntEnum
from math import hypot, isfinite
from typing import NamedTuple

from netboard.base.tables.rig import Safety as Limits
from netboard.network.protocol.motion import Safeguard

LONGEST_STEP_NS = 2_000_000
"""Upper bound of the step duration wherever the force may grow [ns]."""

MEAN_TIME = 10.0
"""Time constant of the mean force [s]."""

MARGIN = 0.1
"""The clamp decreases while the mean is within this fraction of its limit [1]."""

# Plain integers: arithmetic with enum flags costs more than the rest of a step.
_NONE = 0
_ARMED, _RAMPING, _CLAMPED, _SLEWED = map(
    int, (Safeguard.ARMED, Safeguard.RAMPING, Safeguard.CLAMPED, Safeguard.SLEWED)
)
_STALE, _TOO_FAST, _WORN = map(int, (Safeguard.STALE, Safeguard.TOO_FAST, Safeguard.WORN))

Vector = tuple[float, float, float]

ZERO: Vector = (0.0, 0.0, 0.0)


class Guard(IntEnum):
    """State of the safety chain."""

    DISARMED = 0  # no force
    WAITING = 1  # armed, no force yet: waits for a small, fresh wanted force and a slow stylus
    RAMPING = 2  # the force grows towards the wanted force
    ARMED = 3  # the force is the wanted force, within the limits
    HOLDING = 4  # the vertical force is stale and fades
    RELEASING = 5  # the force decreases to zero at the slew limit, then disarmed
    FAULT = 6  # no force; disarm before arming again


class Trip(IntEnum):
    """Triggers of a state change."""

    NONE = 0
    ARM = 1  # requested
    DISARM = 2  # requested
    FAULT = 3  # a number was not finite, the device is lost, or an emergency stop
    TOO_FAST = 4  # the stylus exceeds the velocity limit
    EXPIRED = 5  # no fresh force for longer than the disarm time
    STALE = 6  # no fresh force for longer than the stale time
    FRESH = 7  # fresh forces again
    CALM = 8  # fresh, small and slow, and no earlier force remains
    FULL = 9  # the ramp is complete
    GONE = 10  # the force has reached zero


TABLE: dict[Guard, dict[Trip, Guard]] = {
    Guard.DISARMED: {Trip.ARM: Guard.WAITING, Trip.FAULT: Guard.FAULT},
    Guard.WAITING: {Trip.CALM: Guard.RAMPING, Trip.DISARM: Guard.RELEASING, Trip.FAULT: Guard.FAULT},
    Guard.RAMPING: {
        Trip.FULL: Guard.ARMED,
        Trip.STALE: Guard.HOLDING,
        Trip.EXPIRED: Guard.RELEASING,
        Trip.TOO_FAST: Guard.WAITING,
        Trip.DISARM: Guard.RELEASING,
        Trip.FAULT: Guard.FAULT,
    },
    Guard.ARMED: {
        Trip.STALE: Guard.HOLDING,
        Trip.EXPIRED: Guard.RELEASING,
        Trip.TOO_FAST: Guard.WAITING,
        Trip.DISARM: Guard.RELEASING,
        Trip.FAULT: Guard.FAULT,
    },
    Guard.HOLDING: {
        Trip.FRESH: Guard.RAMPING,
        Trip.EXPIRED: Guard.RELEASING,
        Trip.TOO_FAST: Guard.WAITING,
        Trip.DISARM: Guard.RELEASING,
        Trip.FAULT: Guard.FAULT,
    },
    Guard.RELEASING: {Trip.GONE: Guard.DISARMED, Trip.FAULT: Guard.FAULT},
    Guard.FAULT: {Trip.DISARM: Guard.DISARMED},
}
"""All state transitions."""

LIVE = (Guard.RAMPING, Guard.ARMED, Guard.HOLDING)
"""States in which a wanted force reaches the motor."""


class Limited(NamedTuple):
    """A limited force, ready for the device.

    Attributes
    ----------
    fx, fy, fz : float
        Force on the hand [N].
    safeguards : int
        Actions and state of the chain: `Safeguard` bits.
    """

    fx: float
    fy: float
    fz: float
    safeguards: int


class Safety:
    """The safety chain of one device.

    Parameters
    ----------
    limits : netboard.base.tables.rig.Safety
        Configured limits.
    max_device_force : float
        Peak force of the device; the smaller of this and the configured limit is the clamp [N].
    lasting_device_force : float
        Continuous force of the device; the smaller of this and the configured limit bounds the mean [N].
    """

    def __init__(self, limits: Limits, max_device_force: float, lasting_device_force: float) -> None:
        self._limits = limits
        self._clamp = min(limits.max_force, max_device_force)
        self._lasting = min(limits.mean_force, lasting_device_force, self._clamp)
        self._mean = 0.0
        self._guard = Guard.DISARMED
        self._cause = _NONE
        self._vertical_gain = 0.0
        self._lateral_gain = 0.0
        self._force = ZERO
        self._now_ns: int | None = None

    @property
    def guard(self) -> Guard:
        """State of the chain."""
        return self._guard

    def arm(self) -> bool:
        """Request forces.

        Returns
        -------
        bool
            True if the chain is now armed: it waits for the gate, then ramps. False unless it was disarmed.
        """
        return self._trip(Trip.ARM)

    def disarm(self) -> None:
        """Ramp the force down at the slew limit; in the fault state, clear the fault. Only `arm` enables it again."""
        self._trip(Trip.DISARM)

    def stop(self) -> None:
        """Perform an emergency stop; the force is zero at once."""
        self._fail(Safeguard.STOPPED)

    def device_lost(self) -> None:
        """Report a lost device; the force is zero at once."""
        self._fail(Safeguard.DEVICE_LOST)

    def step(self, now_ns: int, wanted: Vector, fresh_ns: int | None, velocity: Vector) -> Limited:
        """Limit one wanted force.

        Parameters
        ----------
        now_ns : int
            Current time [ns].
        wanted : tuple of float
            Wanted force x, y, z: the fixture's force and the latest commanded force of the server [N].
        fresh_ns : int or None
            Reception time of the server's latest force or of its message that there is none; None before the first
            [ns].
        velocity : tuple of float
            Velocity of the stylus [m/s].

        Returns
        -------
        Limited
            Force to write.
        """
        dt = 0.0 if self._now_ns is None else max(now_ns - self._now_ns, 0) * 1e-9
        # A caller whose clock steps back gains no ramp or slew from it.
        self._now_ns = now_ns if self._now_ns is None else max(now_ns, self._now_ns)
        if not all(map(isfinite, (*wanted, *velocity))):
            self._fail(Safeguard.NOT_FINITE)
        age = None if fresh_ns is None else max(now_ns - fresh_ns, 0) * 1e-6
        too_fast = self._guard is not Guard.FAULT and hypot(*velocity) > self._limits.max_speed
        self._watch(age, too_fast, wanted[2])
        bits = self._cause
        if too_fast:
            bits |= _TOO_FAST
        if self._guard is Guard.HOLDING:
            bits |= _STALE
        return self._render(dt, wanted, velocity[2], bits)

    def _render(self, dt: float, wanted: Vector, vz: float, bits: int) -> Limited:
        """Scale, clamp and slew-limit the force, as the state allows."""
        if self._guard in LIVE:
            bits |= _ARMED
            if self._guard is Guard.RAMPING:
                bits |= _RAMPING
            self._fade_or_grow(dt)
            target = self._scaled(wanted, vz)
            size, most = hypot(*target), self._most()
            if size > most:
                target = _times(most / size, target)
                bits |= _CLAMPED if size > self._clamp else _NONE
                bits |= _WORN if most < self._clamp else _NONE
        else:
            target = ZERO
        if self._guard not in (Guard.FAULT, Guard.DISARMED):
            bits |= self._slew(dt, target)
        self._mean += (hypot(*self._force) - self._mean) * min(dt / MEAN_TIME, 1.0)
        return Limited(*self._force, bits)

    def _most(self) -> float:
        """Return the current force limit: the clamp, or less while the mean is near its limit [N]."""
        if self._mean <= (1.0 - MARGIN) * self._lasting:
            return self._clamp
        share = max(self._lasting - self._mean, 0.0) / (MARGIN * self._lasting)
        return self._lasting + (self._clamp - self._lasting) * share

    def _watch(self, age: float | None, too_fast: bool, fz: float) -> None:
        """Follow the first edge of the table that the current conditions trigger, if any."""
        limits = self._limits
        stale = age is None or age > limits.stale_after_ms
        expired = age is None or age > limits.disarm_after_ms
        grown = min(self._vertical_gain, self._lateral_gain) >= 1.0
        gone = self._force == ZERO
        # In order of priority: a step follows one edge at most.
        present = (
            (Trip.TOO_FAST, too_fast),
            (Trip.EXPIRED, expired),
            (Trip.STALE, stale),
            (Trip.FRESH, not stale),
            (Trip.FULL, grown),
            (Trip.GONE, gone),
            (Trip.CALM, gone and not stale and not too_fast and abs(fz) < limits.arm_gate),
        )
        for trip, is_so in present:
            if is_so and self._trip(trip):
                return

    def _trip(self, trip: Trip) -> bool:
        """Follow the edge of the table for a trigger, if there is one; return True if there is."""
        then = TABLE[self._guard].get(trip)
        if then is None:
            return False
        self._guard = then
        if then not in LIVE:
            self._vertical_gain = self._lateral_gain = 0.0
        if then is Guard.DISARMED:
            self._cause = _NONE
        return True

    def _fail(self, cause: int) -> None:
        """Enter the fault state with zero force at once."""
        self._cause |= cause
        self._trip(Trip.FAULT)
        self._force = ZERO

    def _fade_or_grow(self, dt: float) -> None:
        """Update the gains: decrease the vertical gain while stale, otherwise increase both."""
        limits = self._limits
        if self._guard is Guard.HOLDING:
            self._vertical_gain = max(0.0, self._vertical_gain - dt / (limits.fade_ms * 1e-3))
            return
        growth = min(dt, LONGEST_STEP_NS * 1e-9) / limits.arm_time
        self._vertical_gain = min(1.0, self._vertical_gain + growth)
        self._lateral_gain = min(1.0, self._lateral_gain + growth)

    def _scaled(self, wanted: Vector, vz: float) -> Vector:
        """Return the wanted force under the gains; while the vertical force fades, add damping.

        The damping never exceeds the force that it accompanies. So it adds no force where there was none, and both end
        together.
        """
        fx, fy, fz = self._lateral_gain * wanted[0], self._lateral_gain * wanted[1], self._vertical_gain * wanted[2]
        if self._guard is Guard.HOLDING:
            most = abs(fz)
            fz -= min(max(self._limits.hold_damping * vz, -most), most)
        return fx, fy, fz

    def _slew(self, dt: float, target: Vector) -> int:
        """Move the force towards the target, within the slew limit."""
        most = self._limits.max_slew * min(dt, LONGEST_STEP_NS * 1e-9)
        change = (target[0] - self._force[0], target[1] - self._force[1], target[2] - self._force[2])
        size = hypot(*change)
        if size <= most:
            self._force = target
            return _NONE
        last, share = self._force, most / size
        self._force = (last[0] + share * change[0], last[1] + share * change[1], last[2] + share * change[2])
        return _SLEWED


def _times(scale: float, vector: Vector) -> Vector:
    return scale * vector[0], scale * vector[1], scale * vector[2]
