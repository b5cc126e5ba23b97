"""Kernels by which scenes use the newest samples of their styluses: as drives of boards, in lanes if all are good.

The samples of a group are good if each stylus was used at the last tick and is within its range. Otherwise its scenes
are sensed one by one, as the server does. Both give the same bits.
"""

from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Records, inlined, kernel
from netboard.base.tick import START_NS, TICK_NS
from netboard.participants.batch.arrays import BOTH, LANES, Partner, SceneArrays, Viewers
from netboard.participants.seat.body import LEAD_NS
from netboard.physics.arithmetic.simd import lanes_at, put, within
from netboard.physics.arithmetic.vectors import State
from netboard.stage.stage import TickKernels, keep
from netboard.stage.styluses import MAX_STYLUS_SPEED


@inlined
def _row_inputs(sc: SceneArrays, g: int, j: int, tick: int) -> None:
    """Write the samples and the command of a tick into its row."""
    row, time_ns = sc.rows[j], START_NS + tick * TICK_NS
    row["tick"], row["time_ns"], row["late_ns"] = tick, time_ns, -LEAD_NS
    row["left_live"], row["left_seq"], row["left_stamp_ns"] = 1, tick, time_ns - LEAD_NS
    row["right_live"], row["right_seq"], row["right_stamp_ns"] = 1, tick, time_ns - LEAD_NS
    row["left_sent_z"], row["right_sent_z"] = sc.reading[g, 0, j], sc.reading[g, 1, j]
    row["left_sent_vz"], row["right_sent_vz"] = sc.reading[g, 2, j], sc.reading[g, 3, j]


@inlined
def put_drive(room: NDArray[np.float64], first: int, drive: State) -> None:
    """Store the lanes of a drive; its last coefficient is 0 between two samples of a stylus."""
    put(room, first, drive[0])
    put(room, first + LANES, drive[1])
    put(room, first + 2 * LANES, drive[2])


@inlined
def _write_samples(sc: SceneArrays, g: int) -> None:
    """Write the last samples of a group into the states of its scenes, which sensing one by one needs."""
    for j in range(LANES):
        i = g * LANES + j
        s = sc.states[i]
        s["left_seen_ns"] = s["right_seen_ns"] = START_NS + (sc.ticks[i] - 1) * TICK_NS - LEAD_NS
        s["left_seen_vz"], s["right_seen_vz"] = sc.seen_vz[g, 0, j], sc.seen_vz[g, 1, j]
        s["left_z"], s["right_z"] = sc.used_z[g, 0, j], sc.used_z[g, 1, j]
    sc.smooth[g] = 0


@kernel
def write_samples(sc: SceneArrays, scenes: NDArray[np.int64]) -> None:
    """Write the last samples of the groups of some scenes into the states, before some of these are replaced."""
    for i in scenes:
        if sc.smooth[i // LANES]:
            _write_samples(sc, i // LANES)


@inlined
def _take_samples(sc: SceneArrays, g: int) -> None:
    """Take the last samples of a group from the states of its scenes, if all were used."""
    for j in range(LANES):
        s, row = sc.states[g * LANES + j], sc.rows[j]
        if s["left_seen_ns"] != row["left_stamp_ns"] or s["right_seen_ns"] != row["right_stamp_ns"]:
            return
        sc.seen_vz[g, 0, j], sc.seen_vz[g, 1, j] = s["left_seen_vz"], s["right_seen_vz"]
        sc.used_z[g, 0, j], sc.used_z[g, 1, j] = s["left_z"], s["right_z"]
    sc.smooth[g] = 1


@cache
def _make_sense_group(kernels: TickKernels) -> Callable[..., bool]:
    """Compile how good samples of a group become drives, in lanes; it returns False, and does nothing, for others."""
    sense_lanes, drive = kernels.sense_lanes, kernels.drive

    @inlined
    def sense_group(sc: SceneArrays, g: int, book: Records) -> bool:
        room, scene, limit, at = sc.room, book[0]["scene"], book[0]["settings"]["stylus_range"], g * BOTH
        z, rate = lanes_at(sc.reading, 2 * at, BOTH), lanes_at(sc.reading, 2 * at + BOTH, BOTH)
        if not within(rate, MAX_STYLUS_SPEED):
            return False
        z, vz, az = sense_lanes(z, rate, lanes_at(sc.seen_vz, at, BOTH), TICK_NS * 1e-9, LEAD_NS * 1e-9)
        if not within(z, limit):
            return False
        put(sc.seen_vz, at, rate)
        put(sc.used_z, at, z)
        put(room, 23 * LANES, vz)
        put(room, 25 * LANES, az)
        for side in range(2):
            k, c = (scene["k_right"], scene["c_right"]) if side else (scene["k_left"], scene["c_left"])
            height, first = lanes_at(sc.used_z, at + side * LANES, LANES), (6 + 4 * side) * LANES
            speed, push = lanes_at(room, (23 + side) * LANES, LANES), lanes_at(room, (25 + side) * LANES, LANES)
            put_drive(room, first, drive(height, speed, push, k, c))
        return True

    return sense_group


@cache
def make_sense(kernels: TickKernels, FELT: bool, PARTNER: bool, ROBOT: bool, RECORD: bool) -> Callable[..., None]:
    """Compile how the newest samples of a group become the drives of its boards."""
    sense, sense_group = kernels.sense, _make_sense_group(kernels)

    @inlined
    def keep_shown(sc: SceneArrays, viewers: Viewers, partner: Partner, robot: Partner, i: int, j: int) -> bool:
        tick = sc.ticks[i]
        shown = RECORD or (PARTNER and (tick == partner.following[i] or partner.seat.flags[0] != 0))
        shown = shown or (ROBOT and tick == robot.following[i])
        for a in range(len(viewers.every)):
            shown = shown or tick == viewers.following[a, i]
        if shown:
            keep(sc.rows[j], sc.states[i])
        return shown

    @inlined
    def sense_all(sc: SceneArrays, viewers: Viewers, partner: Partner, robot: Partner, g: int, book: Records) -> None:
        room, scene, limit = sc.room, book[0]["scene"], book[0]["settings"]["stylus_range"]
        if not RECORD and sc.smooth[g] and sense_group(sc, g, book):
            for j in range(LANES):
                if keep_shown(sc, viewers, partner, robot, g * LANES + j, j) or FELT:
                    row = sc.rows[j]
                    row["left_used_z"], row["right_used_z"] = sc.used_z[g, 0, j], sc.used_z[g, 1, j]
                    row["left_used_vz"], row["right_used_vz"] = room[23, j], room[24, j]
            return
        if sc.smooth[g]:
            _write_samples(sc, g)
        for j in range(LANES):
            i = g * LANES + j
            keep_shown(sc, viewers, partner, robot, i, j)
            _row_inputs(sc, g, j, sc.ticks[i])
            hands = sense(sc.states[i], sc.rows[j], limit, scene)
            for k in range(8):
                room[6 + k, j] = hands[k]
        if not RECORD:
            _take_samples(sc, g)

    return sense_all
