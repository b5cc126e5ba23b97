"""Safety chain in plain Python: the reference for the compiled one, with the same rules but other code."""

from math import isfinite, sqrt

from netboard.base.safeguards import Safeguard
from netboard.base.tables.rig import Safety as Limits
from netboard.devices.safety.chain import (
    LIVE,
    MARGIN,
    MAX_STEP_NS,
    MEAN_TIME,
    TABLE,
    ZERO,
    Guard,
    Limited,
    Trip,
    Vector,
)

_NONE = 0
_ARMED, _RAMPING, _CLAMPED, _SLEWED = map(
    int, (Safeguard.ARMED, Safeguard.RAMPING, Safeguard.CLAMPED, Safeguard.SLEWED)
)
_STALE, _TOO_FAST, _WORN = map(int, (Safeguard.STALE, Safeguard.TOO_FAST, Safeguard.WORN))


def size_of(vector: Vector) -> float:
    """Length of a vector, with the rounding of the compiled chain."""
    x, y, z = vector
    return sqrt(x * x + y * y + z * z)


class ReferenceSafety:
    """The safety chain of one device, as its rules state it."""

    def __init__(self, limits: Limits, max_device_force: float, continuous_device_force: float) -> None:
        self._limits = limits
        self._clamp = min(limits.max_force, max_device_force)
        self._mean_limit = min(limits.mean_force, continuous_device_force, self._clamp)
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
        """Request forces; whether the chain was disarmed."""
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
        """Limit one wanted force, as `netboard.devices.safety.chain.SafetyChain.step` does."""
        dt = 0.0 if self._now_ns is None else max(now_ns - self._now_ns, 0) * 1e-9
        # A caller whose clock steps back gains no ramp or slew from it.
        self._now_ns = now_ns if self._now_ns is None else max(now_ns, self._now_ns)
        if not all(map(isfinite, (*wanted, *velocity))):
            self._fail(Safeguard.NOT_FINITE)
        age = None if fresh_ns is None else max(now_ns - fresh_ns, 0) * 1e-6
        too_fast = self._guard is not Guard.FAULT and size_of(velocity) > self._limits.max_speed
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
            size, most = size_of(target), self._most()
            if size > most:
                target = _times(most / size, target)
                bits |= _CLAMPED if size > self._clamp else _NONE
                bits |= _WORN if most < self._clamp else _NONE
        else:
            target = ZERO
        if self._guard not in (Guard.FAULT, Guard.DISARMED):
            bits |= self._slew(dt, target)
        self._mean += (size_of(self._force) - self._mean) * min(dt / MEAN_TIME, 1.0)
        return Limited(*self._force, bits)

    def _most(self) -> float:
        """Return the current force limit: the clamp, or less while the mean is near its limit [N]."""
        if self._mean <= (1.0 - MARGIN) * self._mean_limit:
            return self._clamp
        reserve = MARGIN * self._mean_limit
        share = max(self._mean_limit - self._mean, 0.0) / reserve if reserve > 0.0 else 0.0
        return self._mean_limit + (self._clamp - self._mean_limit) * share

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
        growth = min(dt, MAX_STEP_NS * 1e-9) / limits.arm_time
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
        most = self._limits.max_slew * min(dt, MAX_STEP_NS * 1e-9)
        change = (target[0] - self._force[0], target[1] - self._force[1], target[2] - self._force[2])
        size = size_of(change)
        if size <= most:
            self._force = target
            return _NONE
        last, share = self._force, most / size
        self._force = (last[0] + share * change[0], last[1] + share * change[1], last[2] + share * change[2])
        return _SLEWED


def _times(scale: float, vector: Vector) -> Vector:
    return scale * vector[0], scale * vector[1], scale * vector[2]
