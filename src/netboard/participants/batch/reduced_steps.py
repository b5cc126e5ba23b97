"""Kernels of many scenes at reduced fidelity: longer steps, fused arithmetic, and devices without encoders.

A step of `LONGEST` ticks or fewer takes the place of single ticks. The equations of board and ball, and RK4, are the
stage's own, compiled with fused multiply-adds and a shorter sine. A hand is integrated by the trapezoidal rule, with
Coulomb friction and stops; board and agent get its true height and velocity. Trials advance once a step. All of it is
in lanes, scene by scene without a branch.

Rule 1: nothing here verifies to the bit, and no recording is made of it. Rule 2: a scene gets the same bits alone and
among others on one machine.
"""

from collections.abc import Callable
from functools import cache
from math import inf
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Numbers, Records, borrowed, fast, inlined, kernel, relaxed
from netboard.base.tick import TICK_SECONDS
from netboard.participants.batch.arrays import LANES
from netboard.participants.batch.spaces import BOUND
from netboard.physics.arithmetic.simd import Packed, lanes_at, larger, put, smaller, where_within
from netboard.physics.arithmetic.trig import sincos
from netboard.physics.hands.extrapolation import moving
from netboard.physics.methods.one_step import rk4
from netboard.physics.scene.parameters import Parts
from netboard.stage.stage import MAX_TILT

LONGEST = 5
"""Longest integration step [ticks]."""

(Z, VZ, THETA, OMEGA, P, VP, PHASE, COUNTED, RUN, TARGET, TICKS, POTENTIAL) = range(12)
"""Rows of a scene: state, phase and counters of its trial [ticks], side of the target, ticks so far, potential."""

HEIGHT, SPEED, PUSH, STIFFNESS, KEPT, GAIN = range(12, 24, 2)
"""Rows of a hand, left and right: height and velocity; force at height 0 and stiffness of what it does [N, N/m]; share
of the velocity that a step keeps [1], and velocity that a step adds per force [m/s/N]."""

ROWS = 24

IDLE, LEVELLING, RUNNING, HOLDING, SUCCEEDED, FAILED = range(-1, 5)
"""Phases of a trial; IDLE is before the first tick."""

SEEN_AT, SEEN_PHASE, SEEN_Z, SEEN_THETA, SEEN_P, SEEN_TARGET = range(6)
"""Rows of a view: its tick, negative before the first one, and what it shows."""

VIEW_ROWS = 6

_KEPT: dict[Any, Any] = {function: function for function in (lanes_at, put, larger, smaller, where_within)}


class ReducedArrays(NamedTuple):
    """Scenes in groups of `LANES`; g is the number of groups."""

    rows: NDArray[np.float64]  # (g, ROWS, LANES)
    following: NDArray[np.float64]  # (agents, g, LANES) tick of the next view
    seen: NDArray[np.float64]  # (agents, g, views + 1, VIEW_ROWS, LANES) newest first
    every: NDArray[np.float64]  # (agents,) ticks between two views
    hands: NDArray[np.float64]  # (2, 4) 1 / mass, damping, friction and stop of each [1/kg, N s/m, N, m]


@inlined
def _short_sincos(x: Packed) -> tuple[Any, Any]:
    """Return sine and cosine within 2e-4 up to `MAX_TILT`, and 3e-7 up to 45 degrees: their Taylor polynomials."""
    y = x * x
    sine = x * (1.0 + y * (-1.0 / 6.0 + y * (1.0 / 120.0 + y * (-1.0 / 5040.0))))
    return sine, 1.0 + y * (-0.5 + y * (1.0 / 24.0 + y * (-1.0 / 720.0 + y * (1.0 / 40320.0))))


_SHARED = _KEPT | {sincos: relaxed(_short_sincos, {})}
"""What the kernel has in place of functions that it would call: lanes as they are, and a shorter sine."""


@inlined
def _moved_hand(rows: NDArray[np.float64], side: int, friction: float, stop: float, h: float) -> tuple[Any, Any, Any]:
    """Advance a hand by a step of the trapezoidal rule; return its height and velocity before it, and acceleration."""
    z, v = lanes_at(rows, (HEIGHT + side) * LANES, LANES), lanes_at(rows, (SPEED + side) * LANES, LANES)
    push, stiffness = lanes_at(rows, (PUSH + side) * LANES, LANES), lanes_at(rows, (STIFFNESS + side) * LANES, LANES)
    kept, gain = lanes_at(rows, (KEPT + side) * LANES, LANES), lanes_at(rows, (GAIN + side) * LANES, LANES)
    free = kept * v + gain * (push - stiffness * z)
    sliding = gain * friction
    after = free - smaller(larger(free, -sliding), sliding)
    reached = z + (0.5 * h) * (v + after)
    put(rows, (SPEED + side) * LANES, where_within(reached, -stop, stop, after, 0.0))
    put(rows, (HEIGHT + side) * LANES, smaller(larger(reached, -stop), stop))
    return z, v, (after - v) * (1.0 / h)


@inlined
def _advanced_trial(rows: NDArray[np.float64], length: float, rules: np.void) -> tuple[Any, Any]:
    """Advance the trials of a group, whose next step has a length [ticks]; return the phases, and where balls roll."""
    phase, p = lanes_at(rows, PHASE * LANES, LANES), lanes_at(rows, P * LANES, LANES)
    counted, run = lanes_at(rows, COUNTED * LANES, LANES), lanes_at(rows, RUN * LANES, LANES) + length
    off = p - lanes_at(rows, TARGET * LANES, LANES) * rules["target_distance"]
    z, theta = lanes_at(rows, Z * LANES, LANES), lanes_at(rows, THETA * LANES, LANES)
    omega = lanes_at(rows, OMEGA * LANES, LANES)
    longer = counted + length
    level = where_within(omega, -rules["level_rate"], rules["level_rate"], longer, 0.0)
    level = where_within(theta, -rules["level_angle"], rules["level_angle"], level, 0.0)
    level = where_within(z, -rules["level_height"], rules["level_height"], level, 0.0)
    limit = float(rules["limit_ticks"]) if rules["limit_ticks"] > 0 else inf
    half, fall = rules["half_width"], rules["fall_distance"]
    waited = where_within(level, float(rules["level_ticks"]), inf, RUNNING, LEVELLING)
    held = where_within(longer, float(rules["hold_ticks"]), inf, SUCCEEDED, HOLDING)
    ran = where_within(off, -half, half, HOLDING, where_within(run, limit, inf, FAILED, RUNNING))
    rolling = where_within(phase, RUNNING, RUNNING, ran, where_within(off, -half, half, held, RUNNING))
    rolling = where_within(p, -fall, fall, rolling, FAILED)
    begun = where_within(phase, LEVELLING, LEVELLING, waited, where_within(phase, RUNNING, HOLDING, rolling, phase))
    then = where_within(phase, IDLE, IDLE, LEVELLING, begun)
    counted = where_within(phase, LEVELLING, LEVELLING, level, longer)
    put(rows, COUNTED * LANES, where_within(then - phase, 0.0, 0.0, counted, 0.0))
    put(rows, RUN * LANES, where_within(phase, RUNNING, HOLDING, run, 0.0))
    put(rows, PHASE * LANES, then)
    return phase, where_within(then, RUNNING, HOLDING, 1.0, 0.0)


@inlined
def _state_of(rows: NDArray[np.float64]) -> tuple[Any, ...]:
    """Load the state of a group."""
    return (
        lanes_at(rows, Z * LANES, LANES),
        lanes_at(rows, VZ * LANES, LANES),
        lanes_at(rows, THETA * LANES, LANES),
        lanes_at(rows, OMEGA * LANES, LANES),
        lanes_at(rows, P * LANES, LANES),
        lanes_at(rows, VP * LANES, LANES),
    )


@inlined
def _put_state(rows: NDArray[np.float64], x: tuple[Any, ...]) -> None:
    """Store the state of a group."""
    put(rows, Z * LANES, x[0])
    put(rows, VZ * LANES, x[1])
    put(rows, THETA * LANES, x[2])
    put(rows, OMEGA * LANES, x[3])
    put(rows, P * LANES, x[4])
    put(rows, VP * LANES, x[5])


@inlined
def _between(place: Packed, v: Packed, after: Packed, t: Packed, h: float) -> Any:
    """Return a place at a time within a step, at the beginning of which it and its velocity are given, by parabola."""
    return place + t * (v + t * ((0.5 / h) * (after - v)))


@inlined
def _show(
    sc: ReducedArrays, a: int, g: int, length: int, before: Packed, x: tuple[Any, ...], distance: float, more: int
) -> None:
    """Show an agent the views that are due in the step that a group has made; ``x``: its state before that."""
    rows, seen, following = sc.rows[g], sc.seen[a, g], sc.following[a, g]
    for _ in range(more):
        due = lanes_at(following, 0, LANES)
        late = due - lanes_at(rows, TICKS * LANES, LANES)
        for k in range(seen.shape[0] - 1, 0, -1):
            for row in range(VIEW_ROWS):
                older, newer = lanes_at(seen[k], row * LANES, LANES), lanes_at(seen[k - 1], row * LANES, LANES)
                put(seen[k], row * LANES, where_within(late, 0.0, length - 1.0, newer, older))
        t, h = late * TICK_SECONDS, length * TICK_SECONDS
        phase = where_within(late, 0.0, 0.0, before, lanes_at(rows, PHASE * LANES, LANES))
        z = _between(x[0], x[1], lanes_at(rows, VZ * LANES, LANES), t, h)
        theta = _between(x[2], x[3], lanes_at(rows, OMEGA * LANES, LANES), t, h)
        p = _between(x[4], x[5], lanes_at(rows, VP * LANES, LANES), t, h)
        target = lanes_at(rows, TARGET * LANES, LANES) * distance
        _keep_due(seen[0], SEEN_AT, late, length, due)
        _keep_due(seen[0], SEEN_PHASE, late, length, phase)
        _keep_due(seen[0], SEEN_Z, late, length, z)
        _keep_due(seen[0], SEEN_THETA, late, length, theta)
        _keep_due(seen[0], SEEN_P, late, length, p)
        _keep_due(seen[0], SEEN_TARGET, late, length, target)
        put(following, 0, where_within(late, 0.0, length - 1.0, due + sc.every[a], due))


@inlined
def _keep_due(view: NDArray[np.float64], row: int, late: Packed, length: int, value: Packed) -> None:
    """Write a number of a view where it is due."""
    put(view, row * LANES, where_within(late, 0.0, length - 1.0, value, lanes_at(view, row * LANES, LANES)))


@inlined
def _scored(rows: NDArray[np.float64], distance: float, weights: Numbers) -> Any:
    """Return the rewards of a group; ``weights``: those of `scenes.score`, and the ticks of an episode."""
    phase, before = lanes_at(rows, PHASE * LANES, LANES), lanes_at(rows, POTENTIAL * LANES, LANES)
    off = lanes_at(rows, P * LANES, LANES) - lanes_at(rows, TARGET * LANES, LANES) * distance
    rolling = -smaller(abs(off) * (0.5 / distance), 1.0)
    tilt = smaller(abs(lanes_at(rows, THETA * LANES, LANES)) * (1.0 / 0.2), 1.0)
    height = smaller(abs(lanes_at(rows, Z * LANES, LANES)) * (1.0 / 0.05), 1.0)
    now = where_within(phase, RUNNING, HOLDING, rolling, -1.0 - 0.5 * tilt - 0.5 * height)
    put(rows, POTENTIAL * LANES, where_within(phase, SUCCEEDED, FAILED, before, now))
    rest = larger(weights[5] - lanes_at(rows, TICKS * LANES, LANES), 0.0)
    failed = -weights[4] - weights[0] * rest - weights[2] * (before + 2.0)
    ended = where_within(phase, SUCCEEDED, SUCCEEDED, weights[3], failed)
    return where_within(phase, SUCCEEDED, FAILED, ended, weights[2] * (now - before)) - weights[1]


@cache
def make_steps(FREE: Parts, FIXED: Parts, LENGTH: int, COUNT: int, ALIKE: bool, MORE: int) -> Callable[..., None]:
    """Compile steps of ``COUNT`` integration steps of ``LENGTH`` ticks each.

    ``ALIKE``: a fixed ball loads the board as a free one does, so one integration serves both. ``MORE``: most views
    that can be due in an integration step.
    """
    H = LENGTH * TICK_SECONDS

    def steps(
        sc: ReducedArrays,
        book: Records,
        tables: Numbers,
        weights: Numbers,
        reward: Numbers,
        terminated: NDArray[np.bool_],
        truncated: NDArray[np.bool_],
    ) -> None:
        sc, book, tables, weights = borrowed(sc), borrowed(book), borrowed(tables), borrowed(weights)
        reward, terminated, truncated = borrowed(reward), borrowed(terminated), borrowed(truncated)
        scene, rules = book[0]["scene"], book[0]["rules"]
        for g in range(len(sc.rows)):
            rows = sc.rows[g]
            for _ in range(COUNT):
                x = _state_of(rows)
                phase, free = _advanced_trial(rows, float(LENGTH), rules)
                z, v, a = _moved_hand(rows, 0, sc.hands[0, 2], sc.hands[0, 3], H)
                left = moving(z, v, a, scene["k_left"], scene["c_left"])
                z, v, a = _moved_hand(rows, 1, sc.hands[1, 2], sc.hands[1, 3], H)
                right = moving(z, v, a, scene["k_right"], scene["c_right"])
                x = (x[0], x[1], x[2], x[3], x[4], x[5] * free)
                drives: Any = (left[0], left[1], left[2], z - z, right[0], right[1], right[2], z - z)
                rolled = rk4(x, H, drives, (tables, 0), FREE, scene)
                if ALIKE:
                    rested: tuple[Any, ...] = (rolled[0], rolled[1], rolled[2], rolled[3], x[4], x[5])
                else:
                    rested = rk4(x, H, drives, (tables, 1), FIXED, scene)
                _put_chosen(rows, free, rolled, rested)
                _fail_fallen_boards(rows, x[4])
                for agent in range(len(sc.every)):
                    _show(sc, agent, g, LENGTH, phase, x, rules["target_distance"], MORE)
                put(rows, TICKS * LANES, lanes_at(rows, TICKS * LANES, LANES) + float(LENGTH))
            put(reward, g * LANES, _scored(rows, rules["target_distance"], weights))
            for j in range(LANES):
                ended = rows[PHASE, j] >= SUCCEEDED
                terminated[g * LANES + j] = ended
                truncated[g * LANES + j] = not ended and rows[TICKS, j] >= weights[5]

    return fast(relaxed(steps, _SHARED))


@inlined
def _put_chosen(rows: NDArray[np.float64], free: Packed, rolled: tuple[Any, ...], rested: tuple[Any, ...]) -> None:
    """Store the state of scenes whose ball is free from one tuple, and that of the others from another."""
    put(rows, Z * LANES, where_within(free, 1.0, 1.0, rolled[0], rested[0]))
    put(rows, VZ * LANES, where_within(free, 1.0, 1.0, rolled[1], rested[1]))
    put(rows, THETA * LANES, where_within(free, 1.0, 1.0, rolled[2], rested[2]))
    put(rows, OMEGA * LANES, where_within(free, 1.0, 1.0, rolled[3], rested[3]))
    put(rows, P * LANES, where_within(free, 1.0, 1.0, rolled[4], rested[4]))
    put(rows, VP * LANES, where_within(free, 1.0, 1.0, rolled[5], rested[5]))


@inlined
def _fail_fallen_boards(rows: NDArray[np.float64], p: Packed) -> None:
    """End the trials of boards that have tilted beyond `MAX_TILT`, as a fault of the stage does, with their balls at p.

    A state that is not finite makes the sum NaN, of which `smaller` takes the other: infinity.
    """
    total = lanes_at(rows, Z * LANES, LANES)
    for row in range(VZ, VP + 1):
        total = total + lanes_at(rows, row * LANES, LANES)
    tilt = smaller(inf, abs(lanes_at(rows, THETA * LANES, LANES) + 0.0 * total))
    put(rows, PHASE * LANES, where_within(tilt, 0.0, MAX_TILT, lanes_at(rows, PHASE * LANES, LANES), FAILED))
    for row in range(VP + 1):
        rest = p if row == P else 0.0
        put(rows, row * LANES, where_within(tilt, 0.0, MAX_TILT, lanes_at(rows, row * LANES, LANES), rest))


@kernel
def act(
    sc: ReducedArrays,
    side: int,
    column: int,
    rows: NDArray[np.int64],
    scale: Numbers,
    offset: Numbers,
    usual: Numbers,
    length: float,
    impedance: bool,
    actions: NDArray[np.float32],
) -> None:
    """Let one hand of each scene do what is decided; ``rows``: what the columns of the actions are.

    ``usual``: target, stiffness, damping and force of what is not decided. ``length``: of an integration step [s].
    ``impedance``: whether stiffness or damping is decided; otherwise they are those of `begin`.
    """
    mobility, drag = sc.hands[side, 0], sc.hands[side, 1]
    doing = usual.copy()
    for i in range(len(actions)):
        for k in range(len(rows)):
            value = min(max(float(actions[i, column + k]), -1.0), 1.0)
            doing[rows[k]] = offset[k] + scale[k] * value
        if impedance:
            hold(sc.rows[i // LANES], i % LANES, side, doing, mobility, drag, length)
        else:
            sc.rows[i // LANES, PUSH + side, i % LANES] = doing[1] * doing[0] + doing[3]


@inlined
def hold(
    rows: NDArray[np.float64], j: int, side: int, doing: Numbers, mobility: float, drag: float, length: float
) -> None:
    """Write what a hand does in scene j of a group, with the factors of the trapezoidal rule."""
    target, stiffness, damping, force = doing[0], doing[1], doing[2], doing[3]
    pull = 0.25 * length * length * mobility * stiffness
    brake = 0.5 * length * mobility * (drag + damping)
    inverse = 1.0 / (1.0 + brake + pull)
    rows[PUSH + side, j], rows[STIFFNESS + side, j] = stiffness * target + force, stiffness
    rows[KEPT + side, j], rows[GAIN + side, j] = (1.0 - brake - pull) * inverse, length * mobility * inverse


@kernel
def begin(
    sc: ReducedArrays,
    scenes: NDArray[np.int64],
    targets: NDArray[np.int64],
    distance: float,
    first: NDArray[np.int64],
    doing: Numbers,
    length: float,
) -> None:
    """Begin an episode in some scenes; ``first``: tick of the first view of each agent; ``doing``: `initial_doing`."""
    for k in range(len(scenes)):
        g, j = scenes[k] // LANES, scenes[k] % LANES
        rows = sc.rows[g]
        for row in range(ROWS):
            rows[row, j] = 0.0
        rows[PHASE, j], rows[POTENTIAL, j] = IDLE, -1.0
        rows[TARGET, j], rows[P, j] = targets[k], -targets[k] * distance
        for side in range(2):
            hold(rows, j, side, doing[:, side], sc.hands[side, 0], sc.hands[side, 1], length)
        for agent in range(len(sc.every)):
            sc.following[agent, g, j] = first[agent]
            for view in range(sc.seen.shape[2]):
                for row in range(VIEW_ROWS):
                    sc.seen[agent, g, view, row, j] = -1.0 if row == SEEN_AT else 0.0


@inlined
def _observed(value: Packed, scale: float, known: Packed) -> Any:
    """Return a number as an agent observes it."""
    return smaller(larger(value * (1.0 / scale), -BOUND), BOUND) * known


@cache
def make_observe(VIEWS: int, LEFT: bool, RIGHT: bool, TRUTH: bool) -> Callable[..., None]:
    """Compile what an agent observes: views, own hands and, if it may, the true state."""
    HANDS = (LEFT, RIGHT)

    @kernel
    def observe(
        sc: ReducedArrays,
        a: int,
        view: Numbers,
        hand: Numbers,
        true: Numbers,
        room: NDArray[np.float64],
        out: NDArray[np.float32],
    ) -> None:
        sc, room, out = borrowed(sc), borrowed(room), borrowed(out)
        for g in range(len(sc.rows)):
            rows, seen = sc.rows[g], sc.seen[a, g]
            ticks = lanes_at(rows, TICKS * LANES, LANES)
            pending = lanes_at(sc.following[a, g], 0, LANES) - sc.every[a] - ticks
            at = 0
            for k in range(VIEWS):
                _observe_view(seen, k, pending, ticks, view, room, at)
                at += 8
            for side in range(2):
                if HANDS[side]:
                    one = ticks - ticks + 1.0
                    put(room, at * LANES, _observed(lanes_at(rows, (HEIGHT + side) * LANES, LANES), hand[0], one))
                    put(room, (at + 1) * LANES, _observed(lanes_at(rows, (SPEED + side) * LANES, LANES), hand[1], one))
                    put(room, (at + 2) * LANES, ticks - ticks)
                    at += 3
            if TRUTH:
                one = ticks - ticks + 1.0
                for row in range(6):
                    put(room, (at + row) * LANES, _observed(lanes_at(rows, row * LANES, LANES), true[row], one))
                for side in range(2):
                    z, v = lanes_at(rows, (HEIGHT + side) * LANES, LANES), lanes_at(rows, (SPEED + side) * LANES, LANES)
                    put(room, (at + 6 + 2 * side) * LANES, _observed(z, true[6 + 2 * side], one))
                    put(room, (at + 7 + 2 * side) * LANES, _observed(v, true[7 + 2 * side], one))
            for j in range(min(LANES, len(out) - g * LANES)):
                for k in range(out.shape[1]):
                    out[g * LANES + j, k] = room[k, j]

    return observe


@inlined
def _observe_view(
    seen: NDArray[np.float64],
    k: int,
    pending: Packed,
    ticks: Packed,
    scales: Numbers,
    room: NDArray[np.float64],
    at: int,
) -> None:
    """Write view k of an agent, which does not see yet what is shown of the last tick (``pending`` is -1)."""
    tick = _visible(seen, k, SEEN_AT, pending)
    known = where_within(tick, 0.0, inf, 1.0, 0.0)
    phase = _visible(seen, k, SEEN_PHASE, pending)
    for place in range(3):
        put(room, (at + place) * LANES, where_within(phase, float(place), float(place), known, 0.0))
    for row in range(SEEN_Z, VIEW_ROWS):
        put(room, (at + 1 + row) * LANES, _observed(_visible(seen, k, row, pending), scales[1 + row], known))
    put(room, (at + 7) * LANES, _observed((ticks - tick - 2.0) * TICK_SECONDS, scales[7], known))


@inlined
def _visible(seen: NDArray[np.float64], k: int, row: int, pending: Packed) -> Any:
    """Return a number of the newest view but k that an agent has seen."""
    newest, before = lanes_at(seen[k], row * LANES, LANES), lanes_at(seen[k + 1], row * LANES, LANES)
    return where_within(pending, -1.0, inf, before, newest)
