"""The safety chain: what stands between any wanted force and the motor. Pure; time is an argument.

It trusts nobody: not the server, not the network, not the device's readings, not the caller. Its state is one of
`Guard`, its changes are the edges of `TABLE`, and only three of the states let a force through.

Rule 1: the force is never larger than the clamp, and never changes faster than the slew limit; a late step earns no
larger change than one of `LONGEST_STEP_NS`.
Rule 2: the one exception to the slew limit is a fault. When a number is not finite or the device is lost, neither the
numbers nor the device can be trusted with a way down, and the force is zero at once.
Rule 3: what has been cut comes back only by the ramp. After a short outage the ramp starts from what had not yet faded;
after a speed cut it starts from zero, behind the gate; after a long outage, a fault or a disarming only `Safety.arm`
starts it.
Rule 4: staleness concerns the vertical force, which comes over the network. The lateral force is the agent's own; it is
ramped, clamped, slewed and cut like the other, but it does not fade while the network is silent.
Rule 5: the mean of the force over some `MEAN_TIME` is never larger than what the motors give for ever. As it comes
near, the clamp comes down to that: a force that went on would burn them, or end in the driver's own cut.
Rule 6: the gate asks only for a small vertical force. The lateral one is a spring the hand is brought to gently.
"""

from enum import IntEnum
from math import hypot, isfinite
from typing import NamedTuple

from netboard.base.tables.rig import Safety as Limits
from netboard.network.protocol.motion import Safeguard

LONGEST_STEP_NS = 2_000_000
"""Steps further apart than this count as this long where the force may grow [ns]."""

MEAN_TIME = 10.0
"""The mean force forgets by this time constant [s]."""

MARGIN = 0.1
"""The clamp comes down while the mean is so near to the largest one, as a share of that [1]."""

# Plain integers: arithmetic with flags costs more than all the rest of a step.
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
    WAITING = 1  # armed, no force yet: until the wanted force is small, fresh and the stylus slow
    RAMPING = 2  # force grows to what is wanted
    ARMED = 3  # force is what is wanted, within the limits
    HOLDING = 4  # the vertical force is stale and fades
    RELEASING = 5  # force goes to zero at the slew limit, then disarmed
    FAULT = 6  # no force; must be disarmed before it can be armed


class Trip(IntEnum):
    """What makes the chain change its state."""

    NONE = 0
    ARM = 1  # asked for
    DISARM = 2  # asked for
    FAULT = 3  # a number was not finite, the device is lost, or an emergency stop
    TOO_FAST = 4  # the stylus is
    EXPIRED = 5  # no fresh force for too long
    STALE = 6  # no fresh force for a while
    FRESH = 7  # a fresh force again
    CALM = 8  # fresh, small and slow, and nothing left of an earlier force
    FULL = 9  # the ramp is at its end
    GONE = 10  # the force has come down to zero


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
"""Every change of state there is."""

LIVE = (Guard.RAMPING, Guard.ARMED, Guard.HOLDING)
"""States in which a wanted force reaches the motor."""


class Limited(NamedTuple):
    """What may be written to the device.

    Attributes
    ----------
    fx, fy, fz : float
        Force on the hand [N].
    safeguards : int
        What was done to it, and the state of the chain: `Safeguard` bits.
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
        The limits.
    max_device_force : float
        Largest force the device itself allows; the smaller one of the two is the clamp [N].
    lasting_device_force : float
        Largest force it can give for ever; the smaller one of this and the limit is the largest mean [N].
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
        """Ask for forces.

        Returns
        -------
        bool
            True if the chain is armed now: it waits for the gate, then ramps. False in any other state than disarmed.
        """
        return self._trip(Trip.ARM)

    def disarm(self) -> None:
        """Take the force away, by the slew limit; acknowledges a fault. Only `arm` brings it back."""
        self._trip(Trip.DISARM)

    def stop(self) -> None:
        """Stop in an emergency; the force is zero at once."""
        self._fail(Safeguard.STOPPED)

    def device_lost(self) -> None:
        """Report that the device does not answer any more; the force is zero at once."""
        self._fail(Safeguard.DEVICE_LOST)

    def step(self, now_ns: int, wanted: Vector, fresh_ns: int | None, velocity: Vector) -> Limited:
        """Limit one force.

        Parameters
        ----------
        now_ns : int
            The time [ns].
        wanted : tuple of float
            Wanted force x, y, z: the fixture's, and the last one that came from the server [N].
        fresh_ns : int or None
            When the server's last force, or word that there is none, was received; None before the first [ns].
        velocity : tuple of float
            Velocity of the stylus [m/s].

        Returns
        -------
        Limited
            The force to write.
        """
        dt = 0.0 if self._now_ns is None else max(now_ns - self._now_ns, 0) * 1e-9
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
        """Scale, clamp and slew the force, as the state allows."""
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
        """Largest force now: the clamp, or less where the mean is near its limit [N]."""
        if self._mean <= (1.0 - MARGIN) * self._lasting:
            return self._clamp
        share = max(self._lasting - self._mean, 0.0) / (MARGIN * self._lasting)
        return self._lasting + (self._clamp - self._lasting) * share

    def _watch(self, age: float | None, too_fast: bool, fz: float) -> None:
        """Take the first edge that the present gives cause to, if any."""
        limits = self._limits
        stale = age is None or age > limits.stale_after_ms
        expired = age is None or age > limits.disarm_after_ms
        grown = min(self._vertical_gain, self._lateral_gain) >= 1.0
        gone = self._force == ZERO
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
        """Follow the edge of the table, if there is one."""
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
        """Cut to zero at once."""
        self._cause |= cause
        self._trip(Trip.FAULT)
        self._force = ZERO

    def _fade_or_grow(self, dt: float) -> None:
        """Move the gains: down while stale, up otherwise."""
        limits = self._limits
        if self._guard is Guard.HOLDING:
            self._vertical_gain = max(0.0, self._vertical_gain - dt / (limits.fade_ms * 1e-3))
            return
        growth = min(dt, LONGEST_STEP_NS * 1e-9) / limits.arm_time
        self._vertical_gain = min(1.0, self._vertical_gain + growth)
        self._lateral_gain = min(1.0, self._lateral_gain + growth)

    def _scaled(self, wanted: Vector, vz: float) -> Vector:
        """Wanted force under the gains; with damping while the vertical force fades.

        The damping is never larger than the force it accompanies: where nothing was felt nothing is, and both end
        together.
        """
        fx, fy, fz = self._lateral_gain * wanted[0], self._lateral_gain * wanted[1], self._vertical_gain * wanted[2]
        if self._guard is Guard.HOLDING:
            most = abs(fz)
            fz -= min(max(self._limits.hold_damping * vz, -most), most)
        return fx, fy, fz

    def _slew(self, dt: float, target: Vector) -> int:
        """Go towards the target, no faster than the slew limit."""
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
