"""The trial state machine: phases and their transitions, as one table.

Rule 1: every change of phase is an edge of `TABLE`; nothing else changes a phase.
Rule 2: the state machine reads board and ball only through `sense`, and acts on them only through an `Action`, which
the stage executes. It has no clock: it counts ticks.
Rule 3: a cause without an edge in the present phase changes nothing.
Rule 4: edges with `Action.EXTEND` or `Action.SHORTEN` change the length of the block. They stay in their phase and
leave the trial alone, so a cause sensed at the same tick takes effect too.
Rule 5: a block that is over can be reopened by a repeat; the server allows that only while no other block has begun.

The diagram in the documentation is drawn from `TABLE`.
"""

from enum import IntEnum
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import inlined, kernel
from netboard.base.config import Config
from netboard.base.tables.declared import require
from netboard.base.tables.experiment import Block, Task
from netboard.base.tables.scene import Geometry
from netboard.base.tables.triggers import TRIAL_EVENTS
from netboard.base.tick import TICK_SECONDS


class Phase(IntEnum):
    """Phase of a trial."""

    IDLE = 0  # before the block
    LEVELLING = 1  # ball fixed opposite the target, waiting for a level board
    RUNNING = 2  # ball free, outside the target
    HOLDING = 3  # ball free, inside the target
    SUCCEEDED = 4  # for one tick
    FAILED = 5  # for one tick
    PAUSED = 6  # by the operator or by a fault
    FINISHED = 7  # the block is over


WHEN = {
    Phase.IDLE: "before the block",
    Phase.LEVELLING: "while the board is levelled",
    Phase.RUNNING: "while the ball is free",
    Phase.HOLDING: "while the ball is held",
    Phase.SUCCEEDED: "after a success",
    Phase.FAILED: "after a failure",
    Phase.PAUSED: "during a pause",
    Phase.FINISHED: "after the block",
}
"""Each phase as a time, in words for operators."""


class Cause(IntEnum):
    """Cause of a transition: sensed, commanded by the operator, or reported by the server."""

    NONE = 0
    LEVEL = 1  # the board has been level for long enough
    ENTERED = 2  # the ball's centre entered the target
    LEFT = 3  # it left the target again
    HELD = 4  # it stayed inside for the hold time
    FELL = 5  # the ball fell off the board
    TIMED_OUT = 6  # the attempt exceeded the time limit
    NEXT = 7  # another trial follows
    LAST = 8  # the block is over: all its trials are done, or its time has passed
    START = 9  # operator; the stage accepts this cause and all below as commands
    PAUSE = 10  # operator
    RESUME = 11  # operator
    ABORT = 12  # operator: give up this attempt, repeat the trial
    STOP = 13  # operator: end the block here
    FAULT = 14  # server: a peer is missing, or a value was not finite
    REPEAT = 15  # operator: one more trial at the end of the block
    VETO = 16  # operator: one added trial less
    SKIP = 17  # operator: count this trial as done, without success


require("netboard/task/trials/state_machine.py: Cause", [c.name.lower() for c in Cause if c], TRIAL_EVENTS)

Outcome: TypeAlias = Literal["success", "fell", "timed_out", "aborted", "paused", "emergency_stop", "skipped"]
"""Outcome of an attempt."""

OUTCOMES: dict[Cause, Outcome] = {
    Cause.HELD: "success",
    Cause.FELL: "fell",
    Cause.TIMED_OUT: "timed_out",
    Cause.ABORT: "aborted",
    Cause.STOP: "aborted",
    Cause.PAUSE: "paused",
    Cause.FAULT: "paused",
    Cause.SKIP: "skipped",
    Cause.LAST: "skipped",  # an attempt under way at the end of the block: the last trial was skipped
}
"""Outcome of an attempt, by the cause that ends it; the server knows if the fault was an `EMERGENCY_STOP`."""

EMERGENCY_STOP: Outcome = "emergency_stop"
"""Outcome of an attempt that an emergency stop ended."""

STAGE_FAULT = "the stage: a value was not finite, or the board stood upright"
"""Reason of a fault that the stage itself detected."""


class Action(IntEnum):
    """Action of the stage on a transition."""

    NONE = 0
    PREPARE = 1  # ball at rest opposite the target, counters to zero
    RELEASE = 2  # the ball is free, the trial's clock starts
    MARK = 3  # store the time: the hold may have begun
    SUCCEED = 4  # count the success; the stored time is the completion time
    FAIL = 5  # count the failure
    ADVANCE = 6  # the target changes side, the next trial is prepared
    RETRY = 7  # the same trial is prepared again
    HALT = 8  # the ball is fixed where it is, the attempt does not count
    EXTEND = 9  # one more trial than the block has
    SHORTEN = 10  # one added trial less
    PASS = 11  # as `ADVANCE`, but no attempt begins yet: the next one is the first
    REOPEN = 12  # `EXTEND` and `PASS`: the block goes on with a repeat


_UNDER_WAY: dict[Cause, tuple[Phase, Action]] = {
    Cause.PAUSE: (Phase.PAUSED, Action.HALT),
    Cause.FAULT: (Phase.PAUSED, Action.HALT),
    Cause.ABORT: (Phase.LEVELLING, Action.RETRY),
    Cause.SKIP: (Phase.LEVELLING, Action.ADVANCE),
    Cause.LAST: (Phase.FINISHED, Action.HALT),
    Cause.STOP: (Phase.FINISHED, Action.HALT),
}
"""Edges that interrupt or end an attempt, from the levelling on."""

TABLE: dict[Phase, dict[Cause, tuple[Phase, Action]]] = {
    Phase.IDLE: {Cause.START: (Phase.LEVELLING, Action.PREPARE), Cause.STOP: (Phase.FINISHED, Action.HALT)},
    Phase.LEVELLING: {Cause.LEVEL: (Phase.RUNNING, Action.RELEASE), **_UNDER_WAY},
    Phase.RUNNING: {
        Cause.ENTERED: (Phase.HOLDING, Action.MARK),
        Cause.FELL: (Phase.FAILED, Action.FAIL),
        Cause.TIMED_OUT: (Phase.FAILED, Action.FAIL),
        **_UNDER_WAY,
    },
    Phase.HOLDING: {
        Cause.LEFT: (Phase.RUNNING, Action.NONE),
        Cause.HELD: (Phase.SUCCEEDED, Action.SUCCEED),
        Cause.FELL: (Phase.FAILED, Action.FAIL),
        **_UNDER_WAY,
    },
    Phase.SUCCEEDED: {Cause.NEXT: (Phase.LEVELLING, Action.ADVANCE), Cause.LAST: (Phase.FINISHED, Action.HALT)},
    Phase.FAILED: {Cause.NEXT: (Phase.LEVELLING, Action.RETRY), Cause.LAST: (Phase.FINISHED, Action.HALT)},
    Phase.PAUSED: {
        Cause.RESUME: (Phase.LEVELLING, Action.RETRY),
        Cause.SKIP: (Phase.PAUSED, Action.PASS),
        Cause.LAST: (Phase.FINISHED, Action.HALT),
        Cause.STOP: (Phase.FINISHED, Action.HALT),
    },
    Phase.FINISHED: {Cause.REPEAT: (Phase.PAUSED, Action.REOPEN)},
}
for _phase, _from_there in TABLE.items():
    if _phase != Phase.FINISHED:
        _from_there |= {Cause.REPEAT: (_phase, Action.EXTEND), Cause.VETO: (_phase, Action.SHORTEN)}

BALL_FREE = (Phase.RUNNING, Phase.HOLDING)
"""Phases in which the ball is free; in all others it is fixed."""

RULES = np.dtype(
    [
        ("target_distance", "<f8"),  # target centre to board centre [m]
        ("half_width", "<f8"),  # half width of the target [m]
        ("level_angle", "<f8"),  # [rad]
        ("level_rate", "<f8"),  # [rad/s]
        ("level_height", "<f8"),  # [m]
        ("fall_distance", "<f8"),  # [m]
        ("level_ticks", "<i8"),  # ticks for which the board must be level
        ("hold_ticks", "<i8"),  # ticks for which the ball must stay in the target
        ("limit_ticks", "<i8"),  # time limit of an attempt from the release, in ticks; 0: none
        ("trials", "<i8"),  # trials in the block
        ("block_ticks", "<i8"),  # ticks of the block after which no trial begins; 0: no limit
    ]
)
"""Rules of a trial, as one record for the kernels."""


def ticks(seconds: float) -> int:
    """Return the nearest whole number of ticks in a duration [1].

    Parameters
    ----------
    seconds : float
        Duration, 0 or more [s].
    """
    return round(seconds / TICK_SECONDS)


def pack_rules(task: Task, geometry: Geometry, block: Block) -> NDArray[Any]:
    """Pack the rules of a block for the kernels.

    Parameters
    ----------
    task, geometry, block
        The configuration's tables ``[task]``, ``[geometry]`` and ``[block]``.

    Returns
    -------
    ndarray of RULES, shape (1,)
        The packed record, in SI units and ticks.
    """
    rules = np.zeros(1, RULES)
    rules["target_distance"] = geometry.target_distance
    rules["half_width"] = geometry.target_width / 2
    rules["level_angle"] = np.radians(task.level_angle_deg)
    rules["level_rate"] = np.radians(task.level_rate_deg_s)
    rules["level_height"] = task.level_height
    rules["fall_distance"] = task.fall_distance
    rules["level_ticks"] = ticks(task.level_time)
    rules["hold_ticks"] = ticks(task.hold_time)
    rules["limit_ticks"] = ticks(task.time_limit)
    rules["trials"] = block.trials
    rules["block_ticks"] = ticks(block.duration)
    return rules


def first_target(config: Config) -> int:
    """Return the side of the first target of the block: -1 left, +1 right [1].

    A random side is drawn from the block's seed, so it is reproducible.
    """
    match config.block.first_target:
        case "left":
            return -1
        case "right":
            return 1
        case _:
            return int(np.random.default_rng(config.block.seed).choice((-1, 1)))


def _edges() -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Convert `TABLE` to two arrays, next phase and action, indexed [phase, cause]; without an edge the phase stays."""
    successor = np.repeat(np.arange(len(Phase), dtype=np.int64)[:, None], len(Cause), axis=1)
    action = np.zeros((len(Phase), len(Cause)), np.int64)
    for phase, edges in TABLE.items():
        for cause, (then, does) in edges.items():
            successor[phase, cause] = then
            action[phase, cause] = does
    return successor, action


SUCCESSOR, ACTION = _edges()
HAS_EDGE = np.array([[cause in TABLE[phase] for cause in Cause] for phase in Phase])

# Plain integers, because numba compiles them into the kernels below as constants.
_LEVELLING, _RUNNING, _HOLDING = int(Phase.LEVELLING), int(Phase.RUNNING), int(Phase.HOLDING)
_SUCCEEDED, _FAILED = int(Phase.SUCCEEDED), int(Phase.FAILED)
_NONE, _LEVEL, _ENTERED, _LEFT = int(Cause.NONE), int(Cause.LEVEL), int(Cause.ENTERED), int(Cause.LEFT)
_HELD, _FELL, _TIMED_OUT = int(Cause.HELD), int(Cause.FELL), int(Cause.TIMED_OUT)
_NEXT, _LAST, _START, _SKIP = int(Cause.NEXT), int(Cause.LAST), int(Cause.START), int(Cause.SKIP)


@kernel
def is_active(phase: int) -> bool:
    """Return whether a trial is under way, so that haptic feedback is allowed: not before, after or in a pause."""
    return _LEVELLING <= phase <= _FAILED


@inlined
def is_free(phase: float) -> bool:
    """Return whether the ball is free in a phase, as `BALL_FREE` says."""
    return _RUNNING <= phase <= _HOLDING


@kernel
def is_level(z: float, theta: float, omega: float, rules: np.void) -> bool:
    """Return whether the board counts as level.

    Parameters
    ----------
    z : float
        Height of the board's centre [m].
    theta, omega : float
        Tilt of the board and its rate [rad, rad/s].
    """
    flat = abs(theta) <= rules["level_angle"] and abs(z) <= rules["level_height"]
    return bool(flat and abs(omega) <= rules["level_rate"])


@kernel
def is_over(block_ticks: int, rules: np.void) -> bool:
    """Return whether the time limit of the block has passed, so that the current attempt is the last."""
    return bool(0 < rules["block_ticks"] <= block_ticks)


@kernel
def is_last(trial: int, extra: int, block_ticks: int, rules: np.void) -> bool:
    """Return whether this trial is the last of the block."""
    return bool(trial >= rules["trials"] + extra or is_over(block_ticks, rules))


@kernel
def wished(command: int, trial: int, extra: int, block_ticks: int, rules: np.void) -> int:
    """Return the cause of a command: the command itself, except that skipping the last trial ends the block.

    Parameters
    ----------
    command : int
        A `Cause`, or any other number [1].

    Returns
    -------
    int
        A `Cause`; `Cause.NONE` if the number is no command [1].
    """
    if not _START <= command <= _SKIP:
        return _NONE
    return _LAST if command == _SKIP and is_last(trial, extra, block_ticks, rules) else command


@kernel
def sense(
    phase: int,
    p: float,
    centre: float,
    counted: int,
    run_ticks: int,
    trial: int,
    extra: int,
    block_ticks: int,
    rules: np.void,
) -> int:
    """Return the cause that the state of board and ball gives in this phase.

    Parameters
    ----------
    p, centre : float
        Positions of the ball and of the centre of the target, along the board [m].
    counted : int
        Ticks of a level board (levelling) or of the ball in the target (holding), up to and including this one [1].
    run_ticks : int
        Ticks since the release, up to and including this one [1].

    Returns
    -------
    int
        A `Cause` [1].
    """
    if phase == _LEVELLING:
        return _LEVEL if counted >= rules["level_ticks"] else _NONE
    if is_free(phase):
        if abs(p) > rules["fall_distance"]:
            return _FELL
        inside = abs(p - centre) <= rules["half_width"]
        if phase == _HOLDING:
            if not inside:
                return _LEFT
            return _HELD if counted >= rules["hold_ticks"] else _NONE
        if inside:
            return _ENTERED
        if rules["limit_ticks"] > 0 and run_ticks >= rules["limit_ticks"]:
            return _TIMED_OUT
        return _NONE
    if phase == _SUCCEEDED:
        return _LAST if is_last(trial, extra, block_ticks, rules) else _NEXT
    if phase == _FAILED:
        return _LAST if is_over(block_ticks, rules) else _NEXT
    return _NONE
