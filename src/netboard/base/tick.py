"""What a tick is made of: its inputs, the state it found, its outputs, and what the server noted beside it.

One row of `TICK` is one tick, in memory, on the log channel and, field by field, in a recording. Every field is one
word of 64 bits, so a row is also a row of words. The state in row k+1 is what the stage made of row k: any row can
start a replay.
"""

from typing import Any

import numpy as np

TICK_NS = 1_000_000
"""Length of a tick [ns]."""

TICK_SECONDS = 1e-3
"""Length of a tick [s]."""

START_NS = 1_000_000_000
"""Time of the first tick of a block that is not live [ns]."""

LATE_NS = TICK_NS // 2
"""A tick that began later than this after its deadline is late: half a tick [ns]."""

KNOWN_NS = 3 * TICK_NS
"""What an agent has rendered is known at a tick from a sample that came no further away from it than this [ns]."""

_BOTH = ("left", "right")

STATE = np.dtype(
    [
        ("z", "<f8"),  # height of the board's centre [m]
        ("vz", "<f8"),  # its rate [m/s]
        ("theta", "<f8"),  # tilt, + = right end up [rad]
        ("omega", "<f8"),  # its rate [rad/s]
        ("p", "<f8"),  # ball along the board, + = right [m]
        ("vp", "<f8"),  # its rate [m/s]
        ("left_z", "<f8"),  # height of the left stylus as last used [m]
        ("right_z", "<f8"),  # of the right one [m]
        *(
            field
            for side in _BOTH
            for field in (
                (f"{side}_seen_ns", "<i8"),  # when the newest sample was read, server time; 0 before the first [ns]
                (f"{side}_seen_vz", "<f8"),  # rate of the stylus in it [m/s]
                (f"{side}_az", "<f8"),  # change of that rate since the sample before, over the time between [m/s2]
            )
        ),
        ("completion", "<f8"),  # completion time of the last successful trial, 0 before the first [s]
        ("phase", "<i8"),  # netboard.task.trials.state_machine.Phase
        ("target", "<i8"),  # side of the target: -1 left, +1 right
        ("trial", "<i8"),  # number of the trial in the block, from 1
        ("attempt", "<i8"),  # number of the attempt at this trial, from 1; 0 if it is skipped to in a pause
        ("successes", "<i8"),  # successful trials in the block
        ("failures", "<i8"),  # failed attempts in the block
        ("counted", "<i8"),  # ticks level (levelling) or inside the target (holding)
        ("run_ticks", "<i8"),  # ticks since the release
        ("mark_ticks", "<i8"),  # run_ticks when the ball came into the target
        ("extra", "<i8"),  # trials that operators have added to the block
        ("block_ticks", "<i8"),  # ticks that the block has taken, without pauses
    ]
)
"""Everything `advance` needs to know of the past."""

INPUT = np.dtype(
    [
        ("tick", "<i8"),  # number of the tick, from 0
        ("time_ns", "<i8"),  # its nominal server time [ns]
        ("command", "<i8"),  # netboard.task.trials.state_machine.Cause of an operator's command or fault, 0 for none
        *(
            field
            for side in _BOTH
            for field in (
                (f"{side}_live", "<i8"),  # 1: the sample is fresh; 0: none, or too old, or not finite
                (f"{side}_seq", "<i8"),  # number of the sample, -1 for none
                (f"{side}_stamp_ns", "<i8"),  # when it was read, server time [ns]
                (f"{side}_sent_z", "<f8"),  # height as sent [m]
                (f"{side}_sent_vz", "<f8"),  # its rate as sent [m/s]
                (f"{side}_other", "<f8"),  # force felt in another session, for blocks of such; else 0 [N]
            )
        ),
    ]
)
"""What goes into a tick."""

OUTPUT = np.dtype(
    [
        ("event", "<i8"),  # Cause that changed the phase at this tick, 0 for none
        *(
            field
            for side in _BOTH
            for field in (
                (f"{side}_used_z", "<f8"),  # stylus height used: extrapolated to the tick and clipped [m]
                (f"{side}_used_vz", "<f8"),  # its rate used [m/s]
                (f"{side}_used_az", "<f8"),  # the rate of that used, kept through the tick [m/s2]
                (f"{side}_coupling", "<f8"),  # force of the coupling on the board, + = up [N]
                (f"{side}_force", "<f8"),  # to be felt by the hand, before any delay; 0 where nothing is [N]
            )
        ),
    ]
)
"""What comes out of a tick."""

SERVICE = np.dtype(
    [
        ("late_ns", "<i8"),  # how late the tick began; negative: before its deadline, all samples being there [ns]
        *(
            field
            for side in _BOTH
            for field in (
                (f"{side}_x", "<f8"),  # the lateral position as sent [m]
                (f"{side}_y", "<f8"),
                (f"{side}_rendered", "<f8"),  # vertical force the agent last handed to the device; NaN: not known [N]
                (f"{side}_safeguards", "<i8"),  # what its safety chain did (netboard.network.protocol.motion.Safeguard)
                (f"{side}_buttons", "<i8"),  # bit mask of pressed buttons
                (f"{side}_loop_ns", "<i8"),  # stylus read to rendering of the force computed from it [ns]
                (f"{side}_lead_ns", "<i8"),  # how long before the deadline of a tick the sample arrived [ns]
            )
        ),
    ]
)
"""What the server notes beside a tick; the stage neither reads nor writes it."""


def _concatenated(*parts: np.dtype[Any]) -> np.dtype[Any]:
    """One packed record type with the fields of all parts, in order."""
    return np.dtype([(name, part[name]) for part in parts for name in part.names or ()])


RENDERED = np.dtype(
    [
        ("seq", "<i8"),  # number of the sample
        ("stamp_ns", "<i8"),  # when it was read, on the agent's clock [ns]
        ("rendered", "<f8"),  # vertical force handed to the device since the sample before [N]
        ("safeguards", "<i8"),  # what the safety chain did since then (netboard.network.protocol.motion.Safeguard)
    ]
)
"""What an agent keeps of each sample, for ticks that had none (`netboard.network.protocol.motion.Backfill`)."""

TICK = _concatenated(INPUT, STATE, OUTPUT, SERVICE)
"""One row of the tick stream, in memory, on the log channel and (by name) in a recording."""
