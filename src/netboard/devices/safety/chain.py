"""The safety chain between each requested force and the motor. Pure; time is an argument.

The chain is compiled: it lies between the arrival of a force and the motor, in a loop that sleeps most of the time, and
a step in plain Python takes 30 us there. ``tests/devices/reference_chain.py`` is the same chain in plain Python.

The chain does not rely on the server, the network, the device's readings or the caller. Its state is a `Guard`, its
transitions are the edges of `TABLE`, and only three states let a force through. After arming, the arming gate holds the
force at zero until the requested vertical force is below `arm_gate`.

Rule 1: the force never exceeds the clamp, and never changes faster than the slew limit. A late step allows no larger
change than a step of `MAX_STEP_NS`.
Rule 2: a fault is the only exception to the slew limit. If a number is not finite or the device is lost, neither can be
trusted with a gradual decrease, so the force is zero at once.
Rule 3: a force that was cut returns only by the ramp. After a short outage the ramp starts from the remaining gain.
After a velocity cut it starts from zero, behind the gate. After a long outage, a fault or disarming, only
`SafetyChain.arm` starts it.
Rule 4: staleness affects only the vertical force, which comes over the network. The agent computes the lateral force
itself. That force is ramped, clamped, slewed and cut like the other, but it does not fade while the network is silent.
Rule 5: the mean force over about `MEAN_TIME` never exceeds the motors' continuous force. As the mean approaches that
limit, the clamp decreases towards it. A larger force would overheat the motors or trigger the driver's own cutoff.
Rule 6: the gate requires only a small vertical force. The lateral force is a spring that is ramped up gently.
"""

from enum import IntEnum
from math import isfinite, sqrt
from typing import NamedTuple

import numpy as np

from netboard.base.compiled import Records, inlined, kernel
from netboard.base.safeguards import Safeguard
from netboard.base.tables.rig import Safety as Limits
from netboard.base.tick import NEVER_NS

MAX_STEP_NS = 2_000_000
"""Upper bound of the step duration wherever the force may grow [ns]."""

MEAN_TIME = 10.0
"""Time constant of the mean force, assumed, because vendors publish none of their motors [s]."""

MARGIN = 0.1
"""The clamp decreases while the mean is within this fraction of its limit [1]."""

Vector = tuple[float, float, float]

ZERO: Vector = (0.0, 0.0, 0.0)


class Guard(IntEnum):
    """State of the safety chain."""

    DISARMED = 0  # no force
    WAITING = 1  # armed, no force: waits for a small, fresh wanted force and a slow stylus, and lapses in a long outage
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
    Guard.WAITING: {
        Trip.CALM: Guard.RAMPING,
        Trip.EXPIRED: Guard.RELEASING,
        Trip.DISARM: Guard.RELEASING,
        Trip.FAULT: Guard.FAULT,
    },
    Guard.RAMPING: {
        Trip.FULL: Guard.ARMED,
        Trip.STALE: Guard.HOLDING,
        Trip.EXPIRED: Guard.RELEASING,
        Trip.TOO_FAST: Guard.WAITING,  # a force that returned by itself would drive a free stylus in a limit cycle
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


CHAIN = np.dtype(
    [
        ("guard", "<i8"),
        ("cause", "<i8"),  # safeguard bits of the fault that ended the force
        ("now_ns", "<i8"),  # time of the last step, or NEVER_NS
        ("vertical_gain", "<f8"),
        ("lateral_gain", "<f8"),
        ("fx", "<f8"),  # force of the last step [N]
        ("fy", "<f8"),
        ("fz", "<f8"),
        ("mean", "<f8"),  # mean force [N]
        ("clamp", "<f8"),  # limits; those not explained here as in netboard.base.tables.rig.Safety
        ("mean_limit", "<f8"),  # of the mean force [N]
        ("max_slew", "<f8"),
        ("max_speed", "<f8"),
        ("stale_after_ms", "<f8"),
        ("fade_ms", "<f8"),
        ("disarm_after_ms", "<f8"),
        ("hold_damping", "<f8"),
        ("arm_time", "<f8"),
        ("arm_gate", "<f8"),
    ]
)
"""State and limits of a chain, as its kernels see them."""

_LIMITS = [
    "max_slew",
    "max_speed",
    "stale_after_ms",
    "fade_ms",
    "disarm_after_ms",
    "hold_damping",
    "arm_time",
    "arm_gate",
]

_NEXT = np.array([[TABLE[guard].get(trip, -1) for trip in Trip] for guard in Guard])
"""`TABLE` as the kernels see it: the next state for each state and trigger, -1 for none."""

_IS_LIVE = np.array([guard in LIVE for guard in Guard])

# Plain integers, which numba folds into the kernels below as constants.
_DISARMED, _RAMPS, _HOLDS, _FAILED = map(int, (Guard.DISARMED, Guard.RAMPING, Guard.HOLDING, Guard.FAULT))
_FAIL, _TRIP_TOO_FAST, _EXPIRE = int(Trip.FAULT), int(Trip.TOO_FAST), int(Trip.EXPIRED)
_GO_STALE, _FRESHEN, _CALM, _FULL, _GO = map(int, (Trip.STALE, Trip.FRESH, Trip.CALM, Trip.FULL, Trip.GONE))
_ARMED, _RAMPING, _CLAMPED, _SLEWED = map(
    int, (Safeguard.ARMED, Safeguard.RAMPING, Safeguard.CLAMPED, Safeguard.SLEWED)
)
_STALE, _TOO_FAST, _WORN, _NOT_FINITE = map(
    int, (Safeguard.STALE, Safeguard.TOO_FAST, Safeguard.WORN, Safeguard.NOT_FINITE)
)


@inlined
def _norm(x: float, y: float, z: float) -> float:
    """Return the length of a vector."""
    return sqrt(x * x + y * y + z * z)


@kernel
def trip(chain: Records, trigger: int) -> bool:
    """Follow the edge of the table for a trigger, if there is one; return True if there is."""
    c = chain[0]
    then = _NEXT[c["guard"], trigger]
    if then < 0:
        return False
    c["guard"] = then
    if not _IS_LIVE[then]:
        c["vertical_gain"] = c["lateral_gain"] = 0.0
    if then == _DISARMED:
        c["cause"] = 0
    return True


@kernel
def fail(chain: Records, cause: int) -> None:
    """Enter the fault state with zero force at once."""
    c = chain[0]
    c["cause"] |= cause
    trip(chain, _FAIL)
    c["fx"] = c["fy"] = c["fz"] = 0.0


@kernel
def _watch(chain: Records, age_ms: float, too_fast: bool, fz: float) -> bool:
    """Follow the first edge of the table that the current conditions trigger; return False if there is none."""
    c = chain[0]
    stale, expired = age_ms > c["stale_after_ms"], age_ms > c["disarm_after_ms"]
    grown = min(c["vertical_gain"], c["lateral_gain"]) >= 1.0
    gone = c["fx"] == 0.0 and c["fy"] == 0.0 and c["fz"] == 0.0
    # In order of priority: a step follows one edge at most.
    return (
        (too_fast and trip(chain, _TRIP_TOO_FAST))
        or (expired and trip(chain, _EXPIRE))
        or (trip(chain, _GO_STALE) if stale else trip(chain, _FRESHEN))
        or (grown and trip(chain, _FULL))
        or (gone and trip(chain, _GO))
        or (gone and not stale and not too_fast and abs(fz) < c["arm_gate"] and trip(chain, _CALM))
    )


@inlined
def _force_limit(c: np.void) -> float:
    """Return the current force limit: the clamp, or less while the mean is near its limit [N]."""
    if c["mean"] <= (1.0 - MARGIN) * c["mean_limit"]:
        return float(c["clamp"])
    reserve = MARGIN * c["mean_limit"]  # 0 for the smallest of all floats, too
    share = max(c["mean_limit"] - c["mean"], 0.0) / reserve if reserve > 0.0 else 0.0
    return float(c["mean_limit"] + (c["clamp"] - c["mean_limit"]) * share)


@inlined
def _fade_or_grow(c: np.void, dt: float) -> None:
    """Update the gains: decrease the vertical gain while stale, otherwise increase both."""
    if c["guard"] == _HOLDS:
        c["vertical_gain"] = max(0.0, c["vertical_gain"] - dt / (c["fade_ms"] * 1e-3))
        return
    growth = min(dt, MAX_STEP_NS * 1e-9) / c["arm_time"]
    c["vertical_gain"] = min(1.0, c["vertical_gain"] + growth)
    c["lateral_gain"] = min(1.0, c["lateral_gain"] + growth)


@inlined
def _damped(c: np.void, fz: float, vz: float) -> float:
    """Add damping to a vertical force that fades.

    The damping never exceeds the force that it accompanies. So it adds no force where there was none, and both end
    together.
    """
    most = abs(fz)
    return float(fz - min(max(c["hold_damping"] * vz, -most), most))


@kernel
def _aim(chain: Records, dt: float, fx: float, fy: float, fz: float, vz: float) -> tuple[float, float, float, int]:
    """Return the wanted force under gains and limits, and the safeguards that this takes; only in a live state."""
    c = chain[0]
    bits = _ARMED | (_RAMPING if c["guard"] == _RAMPS else 0)
    _fade_or_grow(c, dt)
    fx, fy, fz = c["lateral_gain"] * fx, c["lateral_gain"] * fy, c["vertical_gain"] * fz
    if c["guard"] == _HOLDS:
        fz = _damped(c, fz, vz)
    size, most = _norm(fx, fy, fz), _force_limit(c)
    if size > most:
        share = most / size
        fx, fy, fz = share * fx, share * fy, share * fz
        bits |= (_CLAMPED if size > c["clamp"] else 0) | (_WORN if most < c["clamp"] else 0)
    return fx, fy, fz, bits


@kernel
def _slew(chain: Records, dt: float, fx: float, fy: float, fz: float) -> int:
    """Move the force towards the target, within the slew limit."""
    c = chain[0]
    most = c["max_slew"] * min(dt, MAX_STEP_NS * 1e-9)
    dx, dy, dz = fx - c["fx"], fy - c["fy"], fz - c["fz"]
    size = _norm(dx, dy, dz)
    if size <= most:
        c["fx"], c["fy"], c["fz"] = fx, fy, fz
        return 0
    share = most / size
    c["fx"] += share * dx
    c["fy"] += share * dy
    c["fz"] += share * dz
    return _SLEWED


@kernel
def limit(
    chain: Records, now_ns: int, fx: float, fy: float, fz: float, fresh_ns: int, vx: float, vy: float, vz: float
) -> int:
    """Limit one wanted force; return the safeguards. The limited force is in the chain. See `SafetyChain.step`."""
    c = chain[0]
    before_ns = c["now_ns"]
    dt = 0.0 if before_ns == NEVER_NS else max(now_ns - before_ns, 0) * 1e-9
    c["now_ns"] = max(now_ns, before_ns)  # a caller whose clock steps back gains no ramp or slew from it
    if not (isfinite(fx) and isfinite(fy) and isfinite(fz) and isfinite(vx) and isfinite(vy) and isfinite(vz)):
        fail(chain, _NOT_FINITE)
    age_ms = max(now_ns - fresh_ns, 0) * 1e-6  # NEVER_NS is long ago, too
    # In a fault there is no force to cut, and the speed may be infinite.
    too_fast = c["guard"] != _FAILED and _norm(vx, vy, vz) > c["max_speed"]
    _watch(chain, age_ms, too_fast, fz)
    bits = c["cause"] | (_TOO_FAST if too_fast else 0) | (_STALE if c["guard"] == _HOLDS else 0)
    if _IS_LIVE[c["guard"]]:
        fx, fy, fz, taken = _aim(chain, dt, fx, fy, fz, vz)
        bits |= taken
    else:
        fx = fy = fz = 0.0
    if c["guard"] not in (_FAILED, _DISARMED):
        bits |= _slew(chain, dt, fx, fy, fz)
    # Exponential, not a window: when a smaller force leaves a window, its mean rises however the force is clamped.
    c["mean"] += (_norm(c["fx"], c["fy"], c["fz"]) - c["mean"]) * min(dt / MEAN_TIME, 1.0)
    return int(bits)


class Limited(NamedTuple):
    """A limited force on the hand, ready for the device [N], and what the chain did: `Safeguard` bits."""

    fx: float
    fy: float
    fz: float
    safeguards: int


class SafetyChain:
    """The safety chain of one device; the device's peak and continuous force bound the configured limits [N]."""

    def __init__(self, limits: Limits, max_device_force: float, continuous_device_force: float) -> None:
        self.chain = np.zeros(1, CHAIN)
        c = self.chain[0]
        c["guard"], c["now_ns"] = Guard.DISARMED, NEVER_NS
        c["clamp"] = min(limits.max_force, max_device_force)
        c["mean_limit"] = min(limits.mean_force, continuous_device_force, c["clamp"])
        for name in _LIMITS:
            c[name] = getattr(limits, name)

    def keep_mean_of(self, before: "SafetyChain") -> None:
        """Continue the mean force of the same motors, as when a lost device is back: they are still warm."""
        # With the time of the last step, so that the next one lets the mean decay over the time of the loss.
        for name in ("mean", "now_ns"):
            self.chain[0][name] = before.chain[0][name]

    @property
    def guard(self) -> Guard:
        """State of the chain."""
        return Guard(self.chain[0]["guard"])

    def arm(self) -> bool:
        """Request forces; return whether the chain was disarmed, and now waits for the gate, then ramps."""
        return trip(self.chain, int(Trip.ARM))

    def disarm(self) -> None:
        """Ramp the force down at the slew limit; in the fault state, clear the fault. Only `arm` enables it again."""
        trip(self.chain, int(Trip.DISARM))

    def stop(self) -> None:
        """Perform an emergency stop; the force is zero at once."""
        fail(self.chain, int(Safeguard.STOPPED))

    def device_lost(self) -> None:
        """Report a lost device; the force is zero at once."""
        fail(self.chain, int(Safeguard.DEVICE_LOST))

    def step(self, now_ns: int, wanted: Vector, fresh_ns: int | None, velocity: Vector) -> Limited:
        """Limit one wanted force; return the force to write.

        ``wanted``: x, y from the fixture, z from the server's latest command [N]. ``fresh_ns``: when that command was
        received, or the server's message that there is none; None before the first. ``velocity``: of the stylus [m/s].
        """
        bits = limit(self.chain, now_ns, *wanted, NEVER_NS if fresh_ns is None else fresh_ns, *velocity)
        c = self.chain[0]
        return Limited(float(c["fx"]), float(c["fy"]), float(c["fz"]), bits)
