"""The styluses as a tick uses them: plausible, extrapolated to its deadline, and as drives of the board.

A tick gets the newest sample of each hand, which is older than its deadline, or none. The functions here update the
state of the stage (`netboard.base.tick.STATE`) and the row of the tick.
"""

import numpy as np

from netboard.base.compiled import inlined
from netboard.base.tables.declared import EXTRAPOLATIONS, require
from netboard.physics.arithmetic.simd import larger, smaller
from netboard.physics.arithmetic.vectors import State
from netboard.physics.hands.extrapolation import ACCELERATION_HORIZON, VELOCITY_HORIZON, moving, reached, resting

MIN_SAMPLE_INTERVAL = 0.25e-3
"""Samples closer than this give no acceleration: their difference in velocity is noise [s]."""

MAX_STYLUS_HEIGHT = 1.0
"""A stylus further from its origin is impossible, as after a mistake in a unit [m]."""

MAX_STYLUS_SPEED = 10.0
"""A faster sample is implausible and ignored [m/s]."""

MAX_STYLUS_ACCELERATION = 50.0
"""Estimated accelerations, which are noisy, are clipped to this magnitude [m/s2].

A stylus that oscillates by +-75 mm at 4 Hz reaches 47 m/s2. Within `ACCELERATION_HORIZON` this limit shifts it 0.6 mm.
"""

KNOWN_EXTRAPOLATIONS = ("zoh", "cv", "ca")
"""Extrapolations that the kernels implement; their number is their place."""

require("the extrapolation in netboard/stage/styluses.py", KNOWN_EXTRAPOLATIONS, EXTRAPOLATIONS)


@inlined
def _slope(vz: float, stamp_ns: int, seen_vz: float, seen_ns: int) -> float:
    """Return the acceleration of a stylus from its two newest samples; 0 if these are too close or too far apart."""
    gap = (stamp_ns - seen_ns) * 1e-9
    if MIN_SAMPLE_INTERVAL <= gap <= ACCELERATION_HORIZON:
        return min(max((vz - seen_vz) / gap, -MAX_STYLUS_ACCELERATION), MAX_STYLUS_ACCELERATION)
    return 0.0


@inlined
def _used(
    live: int, z: float, vz: float, az: float, age: float, last: float, limit: float, hold: int
) -> tuple[float, float, float]:
    """Return height, rate and acceleration of a stylus at the tick; without a sample the last height, at rest."""
    if live == 0:
        return last, 0.0, 0.0
    if hold == 1:
        az = 0.0
    if hold != 0:
        z, vz = reached(z, vz, az, age, ACCELERATION_HORIZON, VELOCITY_HORIZON)
    if abs(z) > limit:
        return limit if z > 0.0 else -limit, 0.0, 0.0
    return z, vz, az


@inlined
def used_lanes(z: float, vz: float, seen_vz: float, gap: float, age: float, hold: int) -> tuple[float, float, float]:
    """Return height, rate and acceleration of lanes of live samples in range, as `sense_left` uses them [m, m/s, m/s2].

    Parameters
    ----------
    z, vz : lanes
        Height and rate of the samples [m, m/s].
    seen_vz : lanes
        Rate of the samples before [m/s].
    gap, age : float
        Time since the samples before, and from the samples to the tick [s].
    """
    az = smaller(larger((vz - seen_vz) / gap, -MAX_STYLUS_ACCELERATION), MAX_STYLUS_ACCELERATION)
    if hold == 1:
        az = az - az
    if hold != 0:
        z, vz = reached(z, vz, az, age, ACCELERATION_HORIZON, VELOCITY_HORIZON)
    return z, vz, az


@inlined
def sense_left(s: np.void, row: np.void, limit: float, hold: int) -> None:
    """Update state and row from the left stylus. Records have constant field names in kernels: one for each side."""
    z, vz, stamp_ns = row["left_sent_z"], row["left_sent_vz"], row["left_stamp_ns"]
    live = row["left_live"] != 0 and np.isfinite(z) and abs(vz) <= MAX_STYLUS_SPEED
    if live and stamp_ns != s["left_seen_ns"]:
        s["left_az"] = _slope(vz, stamp_ns, s["left_seen_vz"], s["left_seen_ns"])
        s["left_seen_ns"], s["left_seen_vz"] = stamp_ns, vz
    age = (row["time_ns"] - stamp_ns) * 1e-9
    used = _used(live, z, vz, s["left_az"], age, s["left_z"], limit, hold)
    row["left_used_z"], row["left_used_vz"], row["left_used_az"] = used
    s["left_z"] = used[0]


@inlined
def sense_right(s: np.void, row: np.void, limit: float, hold: int) -> None:
    """Update state and row from the right stylus."""
    z, vz, stamp_ns = row["right_sent_z"], row["right_sent_vz"], row["right_stamp_ns"]
    live = row["right_live"] != 0 and np.isfinite(z) and abs(vz) <= MAX_STYLUS_SPEED
    if live and stamp_ns != s["right_seen_ns"]:
        s["right_az"] = _slope(vz, stamp_ns, s["right_seen_vz"], s["right_seen_ns"])
        s["right_seen_ns"], s["right_seen_vz"] = stamp_ns, vz
    age = (row["time_ns"] - stamp_ns) * 1e-9
    used = _used(live, z, vz, s["right_az"], age, s["right_z"], limit, hold)
    row["right_used_z"], row["right_used_vz"], row["right_used_az"] = used
    s["right_z"] = used[0]


@inlined
def drives(row: np.void, hold: int, scene: np.void) -> State:
    """Return the drives of both hands during the tick, as polynomials in time [SI]."""
    left_z, left_vz, right_z, right_vz = (
        row["left_used_z"],
        row["left_used_vz"],
        row["right_used_z"],
        row["right_used_vz"],
    )
    k_left, c_left, k_right, c_right = scene["k_left"], scene["c_left"], scene["k_right"], scene["c_right"]
    if hold == 0:
        return (*resting(left_z, left_vz, k_left, c_left), *resting(right_z, right_vz, k_right, c_right))
    left = moving(left_z, left_vz, row["left_used_az"], k_left, c_left)
    right = moving(right_z, right_vz, row["right_used_az"], k_right, c_right)
    return (*left, *right)
