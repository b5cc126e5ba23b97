"""Kernels of many scenes at once: devices, board and ball as lanes of vector registers, trials and policies one by one.

They are the kernels of `netboard.stage.stage`, `netboard.participants.body` and the seats, with an axis of scenes. A
group of `LANES` scenes runs all the ticks of a step before the next group, so that its state stays in the processor's
cache. What a scene does not need is not computed: forces without haptic feedback, rows of ticks without a recording.

Rule 1: a scene gets the same bits alone, among others, and in the server: a recording of it verifies.
Rule 2: hands move along the vertical; a policy's lateral target and force have no effect.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Records, Words, borrowed, inlined, kernel
from netboard.base.safeguards import Safeguard
from netboard.base.tick import START_NS, TICK_NS
from netboard.participants.body.device_forces import within as within_limit
from netboard.participants.body.stylus import let_go_unless_possible, pulled
from netboard.participants.body.velocity_window import SAMPLES, SLACK, make_windowed
from netboard.participants.policy import Decide
from netboard.participants.seat.body import BEFORE, LEAD_NS, STEPS, delayed_force
from netboard.participants.seat.closed_loop import Seat, felt_of
from netboard.physics.arithmetic.simd import lanes_at, nearest, put, within
from netboard.physics.arithmetic.vectors import State
from netboard.stage.curtain import glimpse
from netboard.stage.stage import TickKernels, keep
from netboard.stage.styluses import MAX_STYLUS_SPEED
from netboard.stage.trial_steps import decide as decide_trial
from netboard.task.trials.state_machine import Cause, is_free

LANES = 16
"""Scenes in a group [1]. Two registers of eight: their chains of operations overlap, and both fit the registers."""

TARGET, STIFFNESS, DAMPING, FORCE = range(4)
"""Rows of what hands do: equilibrium height, impedance, and force [m, N/m, N s/m, N]."""

_START, _HELD, _FELL, _TIMED_OUT, _FAULT = (
    int(cause) for cause in (Cause.START, Cause.HELD, Cause.FELL, Cause.TIMED_OUT, Cause.FAULT)
)
_ARMED, _CLAMPED = int(Safeguard.ARMED), int(Safeguard.CLAMPED)

ENDED_IN_SUCCESS, ENDED_IN_FAILURE = 1, 2
"""How the trial of a scene has ended; 0 before [1]."""

_BOTH = 2 * LANES  # styluses of a group

_both_windows = make_windowed(_BOTH)


class SceneArrays(NamedTuple):
    """Many scenes; n is a multiple of `LANES`, and g the number of groups."""

    states: Any  # (n,) STATE
    ticks: NDArray[np.int64]  # (n,) ticks so far
    ended: NDArray[np.int64]  # (n,) how the trial has ended
    place: NDArray[np.float64]  # (g, 2, LANES) heights of both styluses [m]
    v: NDArray[np.float64]  # their velocities [m/s]
    motor: NDArray[np.float64]  # vertical motor forces that act [N]
    commanded: NDArray[np.float64]  # and those commanded next [N]
    smooth: NDArray[np.int64]  # (g,) 1: each stylus was used at the last tick; the next two then stand for the states
    seen_vz: NDArray[np.float64]  # (g, 2, LANES) velocities of the last samples [m/s]
    used_z: NDArray[np.float64]  # heights as last used [m]
    reading: NDArray[np.float64]  # (g, 4, LANES) heights, then velocities, as the encoders read them [m, m/s]
    doing: NDArray[np.float64]  # (g, 4, 2, LANES) what the hands do
    stamps: NDArray[np.int64]  # (g, SAMPLES) times of the positions below [ns]
    places: NDArray[np.float64]  # (g, SAMPLES, 2 LANES) newest positions [m]
    queue: NDArray[np.float64]  # (n, 2, ticks) forces for a force delay [N]
    rows: Any  # (LANES,) TICK: room for a tick of one group
    words: Words  # the same memory as words
    numbers: NDArray[np.float64]  # and as numbers
    room: NDArray[np.float64]  # (27, LANES) room for state, drives and used rates of one group
    mechanics: Any  # (2,) MECHANICS of both sides
    device: NDArray[np.float64]  # encoder step and largest force [m, N]


class Viewers(NamedTuple):
    """What the seats of some agents are shown, for each agent and scene."""

    curtain: Any  # (agents,) CURTAIN
    every: NDArray[np.int64]  # (agents,) ticks between two views
    following: NDArray[np.int64]  # (agents, n) tick of the next view
    seen: Any  # (agents, n, views + 1) SEEN, newest first; the first may be of the last tick, and not yet seen


class Partner(NamedTuple):
    """A policy in a seat of each scene: at the other seat, or the robot through which an agent acts."""

    seat: Seat  # of n scenes
    actions: Any  # (n, 2) ACTION
    following: NDArray[np.int64]  # (n,) tick of the next view


@inlined
def _move_hands(sc: SceneArrays, g: int, side: int, steps: int) -> None:
    """Integrate the styluses of one side for some steps."""
    at = (2 * g + side) * LANES
    do = 8 * g * LANES + side * LANES
    stiffness, damping = lanes_at(sc.doing, do + 2 * LANES, LANES), lanes_at(sc.doing, do + 4 * LANES, LANES)
    target, force = lanes_at(sc.doing, do, LANES), lanes_at(sc.doing, do + 6 * LANES, LANES)
    push = stiffness * target + force + lanes_at(sc.motor, at, LANES)
    place, v = lanes_at(sc.place, at, LANES), lanes_at(sc.v, at, LANES)
    place, v = pulled(place, v, push, stiffness, damping, sc.mechanics[side], steps)
    put(sc.place, at, place)
    put(sc.v, at, v)


@inlined
def _read(sc: SceneArrays, g: int) -> None:
    """Read the heights of all styluses of a group, and estimate their velocities."""
    step, at = sc.device[0], 2 * g * LANES
    places = lanes_at(sc.place, at, _BOTH)
    if step > 0.0:
        places = nearest(places / step) * step
    _, v = _both_windows(sc.stamps[g], sc.places[g], SAMPLES, SLACK * step, sc.stamps[g, 0] + TICK_NS, places)
    put(sc.reading, 2 * at, places)
    put(sc.reading, 2 * at + 2 * LANES, v)


@inlined
def _load(sc: SceneArrays, first: int) -> None:
    """Put board, ball and the last samples of a group into its lanes."""
    room = sc.room
    for j in range(LANES):
        s = sc.states[first + j]
        room[0, j], room[1, j], room[2, j], room[3, j] = s["z"], s["vz"], s["theta"], s["omega"]
        room[4, j], room[5, j] = s["p"], s["vp"]


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
def _row_service(sc: SceneArrays, g: int, j: int) -> None:
    """Write what the devices have rendered into the row of a tick."""
    row = sc.rows[j]
    row["left_lead_ns"], row["right_lead_ns"] = LEAD_NS, LEAD_NS
    row["left_loop_ns"], row["right_loop_ns"] = LEAD_NS, LEAD_NS
    row["left_rendered"], row["right_rendered"] = sc.motor[g, 0, j], sc.motor[g, 1, j]
    clamped = sc.motor[g, 0, j] != sc.commanded[g, 0, j], sc.motor[g, 1, j] != sc.commanded[g, 1, j]
    row["left_safeguards"] = _ARMED | _CLAMPED if clamped[0] else _ARMED
    row["right_safeguards"] = _ARMED | _CLAMPED if clamped[1] else _ARMED


@inlined
def _see(curtain: np.void, sc: SceneArrays, j: int, tick: int, seen: np.void) -> None:
    """Write what a seat is shown of a tick, which it sees at the next one."""
    when = (START_NS + (tick + 1) * TICK_NS) * 1e-9
    glimpse(curtain, sc.words[j], sc.numbers[j], when, seen)


@inlined
def _observe(partner: Partner, sc: SceneArrays, g: int, j: int, tick: int) -> Any:
    """Let the partner observe its hands."""
    seat, time_ns = partner.seat, START_NS + tick * TICK_NS
    o = seat.observation[g * LANES + j]
    o["tick"], o["time"], o["start"] = tick, time_ns * 1e-9, (time_ns - LEAD_NS) * 1e-9
    for side in range(2):
        if seat.hands[side]:
            o["height"][side], o["force"][side] = sc.place[g, side, j], sc.motor[g, side, j]
            o["z"][side], o["vz"][side] = sc.reading[g, side, j], sc.reading[g, 2 + side, j]
    return o


@inlined
def _show_truth(truth: np.void, sc: SceneArrays, g: int, j: int) -> None:
    """Show the true state of board, ball and both styluses, as the row of the tick has it."""
    row = sc.rows[j]
    truth["z"], truth["vz"], truth["theta"], truth["omega"] = row["z"], row["vz"], row["theta"], row["omega"]
    truth["p"], truth["vp"] = row["p"], row["vp"]
    truth["left_z"], truth["left_vz"] = sc.place[g, 0, j], sc.v[g, 0, j]
    truth["right_z"], truth["right_vz"] = sc.place[g, 1, j], sc.v[g, 1, j]


@inlined
def _take(partner: Partner, sc: SceneArrays, g: int, j: int) -> None:
    """Let the hands of the partner do what it has decided."""
    for side in range(2):
        if partner.seat.hands[side]:
            action = partner.actions[g * LANES + j, side]
            let_go_unless_possible(action)
            sc.doing[g, TARGET, side, j], sc.doing[g, FORCE, side, j] = action["target"][2], action["force"][2]
            sc.doing[g, STIFFNESS, side, j], sc.doing[g, DAMPING, side, j] = action["stiffness"], action["damping"]


@inlined
def lanes_of(room: NDArray[np.float64]) -> tuple[State, State]:
    """Load state and drives of a group."""
    x = (
        lanes_at(room, 0, LANES),
        lanes_at(room, LANES, LANES),
        lanes_at(room, 2 * LANES, LANES),
        lanes_at(room, 3 * LANES, LANES),
        lanes_at(room, 4 * LANES, LANES),
        lanes_at(room, 5 * LANES, LANES),
    )
    hands = (
        lanes_at(room, 6 * LANES, LANES),
        lanes_at(room, 7 * LANES, LANES),
        lanes_at(room, 8 * LANES, LANES),
        lanes_at(room, 9 * LANES, LANES),
        lanes_at(room, 10 * LANES, LANES),
        lanes_at(room, 11 * LANES, LANES),
        lanes_at(room, 12 * LANES, LANES),
        lanes_at(room, 13 * LANES, LANES),
    )
    return x, hands


@inlined
def put_state(room: NDArray[np.float64], first: int, x: State) -> None:
    """Store the lanes of a state, from a row on."""
    put(room, first * LANES, x[0])
    put(room, (first + 1) * LANES, x[1])
    put(room, (first + 2) * LANES, x[2])
    put(room, (first + 3) * LANES, x[3])
    put(room, (first + 4) * LANES, x[4])
    put(room, (first + 5) * LANES, x[5])


@inlined
def put_drive(room: NDArray[np.float64], first: int, drive: State) -> None:
    """Store the lanes of a drive; its last coefficient is 0 between two samples of a stylus."""
    put(room, first, drive[0])
    put(room, first + LANES, drive[1])
    put(room, first + 2 * LANES, drive[2])


@cache
def make_begin(decide: Decide) -> Callable[..., None]:
    """Compile how the partners of some scenes act before the first tick."""

    @kernel
    def begin(sc: SceneArrays, partner: Partner, scenes: NDArray[np.int64]) -> None:
        for i in scenes:
            g, j = i // LANES, i % LANES
            o = _observe(partner, sc, g, j, -1)
            decide(partner.seat.state[i], partner.seat.constants[i], o, partner.actions[i])
            _take(partner, sc, g, j)

    return begin


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
        room, scene, limit, at = sc.room, book[0]["scene"], book[0]["settings"]["stylus_range"], g * _BOTH
        z, rate = lanes_at(sc.reading, 2 * at, _BOTH), lanes_at(sc.reading, 2 * at + _BOTH, _BOTH)
        if not within(rate, MAX_STYLUS_SPEED):
            return False
        z, vz, az = sense_lanes(z, rate, lanes_at(sc.seen_vz, at, _BOTH), TICK_NS * 1e-9, LEAD_NS * 1e-9)
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
def _make_sense(kernels: TickKernels, FELT: bool, PARTNER: bool, ROBOT: bool, RECORD: bool) -> Callable[..., None]:
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


@cache
def _make_couple(kernels: TickKernels) -> Callable[..., None]:
    """Compile the forces of the couplings of a group."""
    couple = kernels.couple

    @inlined
    def couple_all(sc: SceneArrays, book: Records) -> None:
        x, hands = lanes_of(sc.room)
        on_left, on_right = couple((x[0], x[1], x[2], x[3]), hands, book[0]["scene"])
        put(sc.room, 14 * LANES, on_left)
        put(sc.room, 15 * LANES, on_right)

    return couple_all


@cache
def _make_decide(kernels: TickKernels, FORCES: bool) -> Callable[..., tuple[int, int]]:
    """Compile the trial state machines of a group; they return how many balls are free, and how many fixed."""
    perturb, command, pushes = kernels.perturb, kernels.command, kernels.pushes
    push_scene = _make_push(kernels)

    @inlined
    def decide_all(sc: SceneArrays, g: int, book: Records) -> tuple[int, int]:
        room, rules, packed = sc.room, book[0]["rules"], book[0]["rendering"]
        rolling = 0
        for j in range(LANES):
            i = g * LANES + j
            s, row = sc.states[i], sc.rows[j]
            row["phase"], row["trial"] = s["phase"], s["trial"]
            perturb(s, row, book[0]["perturbing"])
            if FORCES:
                command(s, row, (room[14, j], room[15, j]), packed)
            row["command"] = _START if sc.ticks[i] == 0 else 0
            cause = decide_trial(s, row["command"], rules)
            row["event"] = cause
            if cause == _HELD:
                sc.ended[i] = ENDED_IN_SUCCESS
            elif cause in (_FELL, _TIMED_OUT):
                sc.ended[i] = ENDED_IN_FAILURE
            free = is_free(s["phase"])
            room[4, j], room[5, j], room[16, j] = s["p"], s["vp"] if free else 0.0, 1.0 if free else -1.0
            if pushes:
                push_scene(sc, row, j, free, book)
            rolling += 1 if free else 0
        return rolling, LANES - rolling

    return decide_all


@cache
def _make_push(kernels: TickKernels) -> Callable[..., None]:
    """Compile the perturbation of ball or board in one scene of a group."""
    push = kernels.push

    @inlined
    def push_scene(sc: SceneArrays, row: np.void, j: int, free: bool, book: Records) -> None:
        room = sc.room
        x: State = (room[0, j], room[1, j], room[2, j], room[3, j], room[4, j], room[5, j])
        left: State = (room[6, j], room[7, j], room[8, j], room[9, j])
        right: State = (room[10, j], room[11, j], room[12, j], room[13, j])
        x, hands = push(x, (*left, *right), row, free, book[0]["scene"])
        for k in range(6):
            room[k, j] = x[k]
        for k in range(8):
            room[6 + k, j] = hands[k]

    return push_scene


@cache
def _make_move(kernels: TickKernels) -> Callable[..., None]:
    """Compile the motion of board and ball of a group, in which some balls may be free and others fixed."""
    roll, rest = kernels.roll, kernels.rest

    @inlined
    def move_board(sc: SceneArrays, rolling: int, resting: int, book: Records, tables: NDArray[np.float64]) -> None:
        room, scene = sc.room, book[0]["scene"]
        x, hands = lanes_of(room)
        if resting == 0:
            put_state(room, 0, roll(x, hands, tables, scene))
        elif rolling == 0:
            put_state(room, 0, rest(x, hands, tables, scene))
        else:
            put_state(room, 17, roll(x, hands, tables, scene))
            put_state(room, 0, rest(x, hands, tables, scene))
            for k in range(6):
                for j in range(LANES):
                    if room[16, j] > 0.0:
                        room[k, j] = room[17 + k, j]

    return move_board


@cache
def _make_finish(
    kernels: TickKernels, decide: Decide, told: Decide, FELT: bool, PARTNER: bool, ROBOT: bool, RECORD: bool
) -> Callable[..., None]:
    """Compile the end of a tick of a group: states are stored, forces act, policies decide, and seats see."""
    settle, attend, attend_told = kernels.settle, _make_attend(decide), _make_attend(told)

    @inlined
    def finish_all(
        sc: SceneArrays,
        viewers: Viewers,
        partner: Partner,
        robot: Partner,
        g: int,
        book: Records,
        record: Records,
        slot: int,
    ) -> None:
        room, rules, catch = sc.room, book[0]["rules"], book[0]["rendering"]["catch"]
        for j in range(LANES):
            i = g * LANES + j
            s, row, tick = sc.states[i], sc.rows[j], sc.ticks[i]
            settle(
                s, row, (room[0, j], room[1, j], room[2, j], room[3, j], room[4, j], room[5, j]), row["event"], rules
            )
            room[0, j], room[1, j], room[2, j], room[3, j] = s["z"], s["vz"], s["theta"], s["omega"]
            room[4, j], room[5, j] = s["p"], s["vp"]
            if row["event"] == _FAULT:
                sc.ended[i] = ENDED_IN_FAILURE
            if RECORD:
                _row_service(sc, g, j)
            if FELT:
                left = delayed_force(sc.queue[i, 0], tick, row["left_force"], row["trial"], row["phase"], catch)
                right = delayed_force(sc.queue[i, 1], tick, row["right_force"], row["trial"], row["phase"], catch)
                sc.commanded[g, 0, j], sc.commanded[g, 1, j] = left, right
            if PARTNER:
                attend(partner, sc, g, j, tick)
            if ROBOT:
                attend_told(robot, sc, g, j, tick)
            for a in range(len(viewers.every)):
                if tick == viewers.following[a, i]:
                    viewers.following[a, i] += viewers.every[a]
                    seen = viewers.seen[a, i]
                    for k in range(len(seen) - 1, 0, -1):
                        seen[k] = seen[k - 1]
                    _see(viewers.curtain[a], sc, j, tick, seen[0])
            if RECORD:
                record[i, slot] = row
            sc.ticks[i] = tick + 1

    return finish_all


@cache
def _make_attend(decide: Decide) -> Callable[..., None]:
    """Compile how the partner of a scene attends to a tick: it observes, decides, and then sees the tick."""

    @inlined
    def attend(partner: Partner, sc: SceneArrays, g: int, j: int, tick: int) -> None:
        i, seat, row = g * LANES + j, partner.seat, sc.rows[j]
        o = _observe(partner, sc, g, j, tick)
        o["felt"] = felt_of(seat, sc.commanded[g, seat.hands[1], j], row["trial"], row["phase"])
        if seat.flags[0]:
            _show_truth(o["truth"], sc, g, j)
        decide(seat.state[i], seat.constants[i], o, partner.actions[i])
        _take(partner, sc, g, j)
        if tick == partner.following[i]:
            partner.following[i] += seat.timing[0]
            _see(seat.curtain[0], sc, j, tick, o["seen"])

    return attend


@cache
def make_steps(
    kernels: TickKernels, decide: Decide, told: Decide, FELT: bool, PARTNER: bool, ROBOT: bool, RECORD: bool
) -> Callable[..., None]:
    """Compile the ticks of many scenes: of a kind of block, around a policy at the other seat, with or without rows.

    ``told``: kernel of the robot through which an agent acts, if one does.
    """
    FORCES = FELT or RECORD
    sense_all, couple_all = _make_sense(kernels, FELT, PARTNER, ROBOT, RECORD), _make_couple(kernels)
    decide_all, move_board = _make_decide(kernels, FORCES), _make_move(kernels)
    finish_all = _make_finish(kernels, decide, told, FELT, PARTNER, ROBOT, RECORD)

    @inlined
    def move_hands(sc: SceneArrays, g: int, side: int) -> None:
        if FELT:
            _move_hands(sc, g, side, BEFORE)
            for j in range(LANES):
                sc.motor[g, side, j] = within_limit(sc.device[1], 0.0, 0.0, sc.commanded[g, side, j])[2]
            _move_hands(sc, g, side, STEPS - BEFORE)
        else:
            _move_hands(sc, g, side, STEPS)

    @kernel
    def steps(
        sc: SceneArrays,
        viewers: Viewers,
        partner: Partner,
        robot: Partner,
        book: Records,
        tables: NDArray[np.float64],
        count: int,
        record: Records,
    ) -> None:
        sc, viewers, partner, robot = borrowed(sc), borrowed(viewers), borrowed(partner), borrowed(robot)
        book, tables, record = borrowed(book), borrowed(tables), borrowed(record)
        for g in range(len(sc.place)):
            _load(sc, g * LANES)
            for slot in range(count):
                for side in range(2):
                    move_hands(sc, g, side)
                _read(sc, g)
                sense_all(sc, viewers, partner, robot, g, book)
                if FORCES:
                    couple_all(sc, book)
                rolling, resting = decide_all(sc, g, book)
                move_board(sc, rolling, resting, book, tables)
                finish_all(sc, viewers, partner, robot, g, book, record, slot)

    return steps
