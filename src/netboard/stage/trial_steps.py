"""The trial in a tick: the trial state machine run over the state of the stage, with its counters and actions.

The table of phases, causes and actions is `netboard.task.trials.state_machine`.
"""

import numpy as np

from netboard.base.compiled import inlined
from netboard.base.tick import TICK_SECONDS
from netboard.task.trials.state_machine import (
    ACTION,
    HAS_EDGE,
    SUCCESSOR,
    Action,
    Cause,
    Phase,
    is_active,
    is_level,
    sense,
    wished,
)

# Plain integers, which numba folds into the kernels below as constants.
_NONE, _REPEAT, _VETO = int(Cause.NONE), int(Cause.REPEAT), int(Cause.VETO)
_LEVELLING, _RUNNING, _HOLDING = int(Phase.LEVELLING), int(Phase.RUNNING), int(Phase.HOLDING)
_PREPARE, _RELEASE, _MARK, _SUCCEED = int(Action.PREPARE), int(Action.RELEASE), int(Action.MARK), int(Action.SUCCEED)
_FAIL, _ADVANCE, _RETRY, _HALT = int(Action.FAIL), int(Action.ADVANCE), int(Action.RETRY), int(Action.HALT)
_EXTEND, _SHORTEN, _PASS = int(Action.EXTEND), int(Action.SHORTEN), int(Action.PASS)
_REOPEN = int(Action.REOPEN)


@inlined
def _place_ball(s: np.void, rules: np.void) -> None:
    """Put the ball at rest opposite the target."""
    s["p"] = -s["target"] * rules["target_distance"]
    s["vp"] = 0.0


@inlined
def _act(s: np.void, action: int, rules: np.void) -> None:
    """Apply an action of the trial state machine to the state."""
    if action == _RELEASE:
        s["run_ticks"] = 0
    elif action == _MARK:
        s["mark_ticks"] = s["run_ticks"]
    elif action == _SUCCEED:
        s["successes"] += 1
        s["completion"] = s["mark_ticks"] * TICK_SECONDS
    elif action == _FAIL:
        s["failures"] += 1
    elif action == _PREPARE:
        _place_ball(s, rules)
    elif action in (_ADVANCE, _PASS, _REOPEN):
        s["extra"] += action == _REOPEN
        s["target"] = -s["target"]
        s["trial"] += 1
        s["attempt"] = 1 if action == _ADVANCE else 0
        _place_ball(s, rules)
    elif action == _RETRY:
        s["attempt"] += 1
        _place_ball(s, rules)
    elif action == _HALT:
        s["vp"] = 0.0
    elif action in (_EXTEND, _SHORTEN):
        s["extra"] = s["extra"] + 1 if action == _EXTEND else max(s["extra"] - 1, 0)
        return
    s["counted"] = 0


@inlined
def _count(s: np.void, rules: np.void) -> None:
    """Update the tick counters: of the block, since the release, while level, inside the target."""
    phase = s["phase"]
    if is_active(phase):
        s["block_ticks"] += 1
    if phase == _LEVELLING:
        s["counted"] = s["counted"] + 1 if is_level(s["z"], s["theta"], s["omega"], rules) else 0
    elif phase == _RUNNING:
        s["run_ticks"] += 1
    elif phase == _HOLDING:
        s["run_ticks"] += 1
        s["counted"] += 1


@inlined
def take_transition(s: np.void, cause: int, rules: np.void) -> int:
    """Take the transition for a cause and return the cause; return 0 if there is none [1].

    Parameters
    ----------
    cause : int
        A `netboard.task.trials.state_machine.Cause` [1].
    """
    phase = s["phase"]
    if not HAS_EDGE[phase, cause]:
        return _NONE
    s["phase"] = SUCCESSOR[phase, cause]
    _act(s, ACTION[phase, cause], rules)
    return cause


@inlined
def decide(s: np.void, command: int, rules: np.void) -> int:
    """Run the trial state machine; return the cause of the transition taken, 0 for none [1].

    Parameters
    ----------
    command : int
        The command of the tick, a `netboard.task.trials.state_machine.Cause`; 0 for none [1].
    """
    _count(s, rules)
    phase, cause = s["phase"], _NONE
    if command != _NONE:  # nearly all ticks have none, and tables take long
        cause = take_transition(s, wished(command, s["trial"], s["extra"], s["block_ticks"], rules), rules)
        # A repeat or a veto leaves the phase as it is, so what the ball does still counts in this tick.
        if cause not in (_NONE, _REPEAT, _VETO):
            return cause
    centre = s["target"] * rules["target_distance"]
    trial, extra, block_ticks = s["trial"], s["extra"], s["block_ticks"]
    sensed = sense(phase, s["p"], centre, s["counted"], s["run_ticks"], trial, extra, block_ticks, rules)
    return cause if sensed == _NONE else take_transition(s, sensed, rules) or cause
