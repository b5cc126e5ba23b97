"""Kernels of many scenes at once: devices, board and ball as lanes of vector registers, trials and policies one by one.

They are the kernels of `netboard.stage.stage`, `netboard.participants.body` and the seats, with an axis of scenes. A
group of `LANES` scenes runs all the ticks of a step before the next group, so that its state stays in the processor's
cache. What a scene does not need is not computed: forces without haptic feedback, rows of ticks without a recording.

Rule 1: a scene gets the same bits alone, among others, and in the server: a recording of it verifies.
Rule 2: hands move along the vertical; a policy's lateral target and force have no effect.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Records, borrowed, inlined, kernel
from netboard.base.safeguards import Safeguard
from netboard.base.tick import START_NS, TICK_NS
from netboard.participants.batch.arrays import BOTH, LANES, Partner, SceneArrays, Viewers
from netboard.participants.batch.sensing import make_sense
from netboard.participants.body.device_forces import within as within_limit
from netboard.participants.body.stylus import let_go_unless_possible, pulled
from netboard.participants.body.velocity_window import SAMPLES, SLACK, make_windowed
from netboard.participants.policy import Decide
from netboard.participants.seat.body import BEFORE, LEAD_NS, STEPS, delayed_force
from netboard.participants.seat.closed_loop import felt_of
from netboard.physics.arithmetic.simd import lanes_at, nearest, put, where_within, within
from netboard.physics.arithmetic.vectors import TINY, State
from netboard.stage.curtain import glimpse
from netboard.stage.stage import MAX_TILT, TickKernels
from netboard.stage.trial_steps import decide as decide_trial
from netboard.task.trials.state_machine import Cause, is_free

TARGET, STIFFNESS, DAMPING, FORCE = range(4)
"""Rows of what hands do: equilibrium height, impedance, and force [m, N/m, N s/m, N]."""

_START, _HELD, _FELL, _TIMED_OUT, _FAULT = (
    int(cause) for cause in (Cause.START, Cause.HELD, Cause.FELL, Cause.TIMED_OUT, Cause.FAULT)
)
_ARMED, _CLAMPED = int(Safeguard.ARMED), int(Safeguard.CLAMPED)

ENDED_IN_SUCCESS, ENDED_IN_FAILURE = 1, 2
"""How the trial of a scene has ended; 0 before [1]."""

_LARGEST = float(np.finfo(np.float64).max)

_both_windows = make_windowed(BOTH)


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
    places = lanes_at(sc.place, at, BOTH)
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


@cache
def make_begin(decide: Decide) -> Callable[..., None]:
    """Compile how the partners of some scenes act before the first tick."""

    @kernel
    def begin(sc: SceneArrays, partner: Partner, scenes: NDArray[np.int64]) -> None:
        for i in scenes:
            g, j = i // LANES, i % LANES
            o = _observe(partner, sc, g, j, -1)
            decide(partner.seat.state[i], partner.seat.constants[0], o, partner.actions[i])
            _take(partner, sc, g, j)

    return begin


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


@inlined
def _calm_plausible(room: NDArray[np.float64]) -> bool:
    """Set negligible numbers of the states to 0, as `calm` does, if all states of the group are plausible."""
    x, _ = lanes_of(room)
    total: Any = x[0] + x[1] + x[2] + x[3] + x[4] + x[5]
    tilt: Any = x[2]
    if not (within(total, _LARGEST) and within(tilt, MAX_TILT)):
        return False
    for row in range(6):
        value = lanes_at(room, row * LANES, LANES)
        put(room, row * LANES, where_within(abs(value), TINY, np.inf, value, 0.0))
    return True


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
        plausible = _calm_plausible(room)
        for j in range(LANES):
            i = g * LANES + j
            s, row, tick = sc.states[i], sc.rows[j], sc.ticks[i]
            x: State = (room[0, j], room[1, j], room[2, j], room[3, j], room[4, j], room[5, j])
            if plausible:
                s["z"], s["vz"], s["theta"], s["omega"], s["p"], s["vp"] = x
            else:
                settle(s, row, x, row["event"], rules)
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
        decide(seat.state[i], seat.constants[0], o, partner.actions[i])
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
    sense_all, couple_all = make_sense(kernels, FELT, PARTNER, ROBOT, RECORD), _make_couple(kernels)
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
