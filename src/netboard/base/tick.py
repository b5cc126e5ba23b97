"""Record of a tick: inputs, state before it, outputs, and service data of the server.

One row of `TICK` is one tick, in memory, on the log channel and, field by field, in a recording. Every field has 64
bits, so a row is also an array of words. The state in row k+1 is the result of row k, so a replay can start at any row.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

TICK_NS = 1_000_000
"""Length of a tick [ns]."""

TICK_SECONDS = 1e-3
"""Length of a tick [s]."""

NEVER_NS = -(2**62)
"""Time of what has never happened; it is longer ago than any timeout [ns]."""

START_NS = 1_000_000_000
"""Time of the first tick of a block that is not live [ns]."""

LATE_NS = TICK_NS // 2
"""A tick that starts later than this after its deadline is a deadline miss: half a tick [ns]."""

LEAD_NS = 300_000
"""Target of the agents for the arrival of a sample before its tick's deadline; absorbs most jitter [ns]."""

HEARTBEAT_TICKS = 4
"""Ticks between two heartbeats of the server while no forces are sent, so that no force becomes stale [1]."""

KNOWN_NS = 3 * TICK_NS
"""Largest time between a tick and the sample that reports its rendered force [ns]."""

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
                (f"{side}_az", "<f8"),  # acceleration from the last two samples [m/s2]
            )
        ),
        ("completion", "<f8"),  # completion time of the last successful trial, 0 before the first [s]
        ("phase", "<i8"),  # netboard.task.trials.state_machine.Phase
        ("target", "<i8"),  # side of the target: -1 left, +1 right
        ("trial", "<i8"),  # number of the trial in the block, from 1
        ("attempt", "<i8"),  # number of the attempt at this trial, from 1; 0 after a skip in a pause
        ("successes", "<i8"),  # successful trials in the block
        ("failures", "<i8"),  # failed attempts in the block
        ("counted", "<i8"),  # ticks level (levelling) or inside the target (holding)
        ("run_ticks", "<i8"),  # ticks since the release
        ("mark_ticks", "<i8"),  # run_ticks when the ball came into the target
        ("extra", "<i8"),  # trials that operators have added to the block
        ("block_ticks", "<i8"),  # ticks that the block has taken, without pauses
        ("perturbed_ticks", "<i8"),  # ticks of the attempt's perturbation so far, 0 before it
    ]
)
"""State of the stage: all that a tick needs of the past."""

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
                (f"{side}_other", "<f8"),  # force of another session, with force = "unrelated"; else 0 [N]
            )
        ),
    ]
)
"""Inputs of a tick."""

OUTPUT = np.dtype(
    [
        ("event", "<i8"),  # Cause that changed the phase at this tick, 0 for none
        ("perturbation", "<f8"),  # force of a perturbation during the tick, 0 for none [N]
        *(
            field
            for side in _BOTH
            for field in (
                (f"{side}_used_z", "<f8"),  # stylus height used: extrapolated to the tick and clipped [m]
                (f"{side}_used_vz", "<f8"),  # its rate used [m/s]
                (f"{side}_used_az", "<f8"),  # its acceleration used, constant during the tick [m/s2]
                (f"{side}_coupling", "<f8"),  # force of the coupling on the board, + = up [N]
                (f"{side}_force", "<f8"),  # commanded force before any delay, + = up [N]
            )
        ),
    ]
)
"""Outputs of a tick."""

SERVICE = np.dtype(
    [
        ("late_ns", "<i8"),  # start after the deadline; negative: before it, if all samples have arrived [ns]
        *(
            field
            for side in _BOTH
            for field in (
                (f"{side}_x", "<f8"),  # the lateral position as sent [m]
                (f"{side}_y", "<f8"),
                (f"{side}_rendered", "<f8"),  # vertical force the agent last handed to the device; NaN: not known [N]
                (f"{side}_safeguards", "<i8"),  # actions of its safety chain, as in RENDERED
                (f"{side}_buttons", "<i8"),  # bit mask of pressed buttons
                (f"{side}_loop_ns", "<i8"),  # stylus read to rendering of the force computed from it [ns]
                (f"{side}_lead_ns", "<i8"),  # how long before the deadline of a tick the sample arrived [ns]
            )
        ),
    ]
)
"""Service data of the server; the stage neither reads nor writes it."""


def _concatenated(*parts: np.dtype[Any]) -> np.dtype[Any]:
    """Return a packed record type with the fields of all parts, in order."""
    return np.dtype([(name, part[name]) for part in parts for name in part.names or ()])


RENDERED = np.dtype(
    [
        ("seq", "<i8"),  # number of the sample
        ("stamp_ns", "<i8"),  # when it was read, on the agent's clock [ns]
        ("rendered", "<f8"),  # vertical force handed to the device since the sample before [N]
        ("safeguards", "<i8"),  # actions of the safety chain since then (netboard.base.safeguards.Safeguard)
    ]
)
"""Data of each sample that an agent keeps for ticks without one (`netboard.network.protocol.motion.Backfill`)."""

TICK = _concatenated(INPUT, STATE, OUTPUT, SERVICE)
"""One row of the tick stream, in memory, on the log channel and (by name) in a recording."""

TICK_WORDS = {name: place for place, name in enumerate(TICK.names or ())}
"""Place of each field among the words of a row."""

ROW_BYTES = np.dtype((np.void, TICK.itemsize))
"""A row as plain bytes, for moving rows: numpy moves and compares structured types field by field."""


def joined(portions: Iterable[NDArray[Any]]) -> NDArray[Any]:
    """Concatenate rows of ticks."""
    return np.concatenate([np.empty(0, ROW_BYTES), *(rows.view(ROW_BYTES) for rows in portions)]).view(TICK)
