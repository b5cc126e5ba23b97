"""Descriptions of the task and its events, shared by all export formats that are standards."""

from netboard.task.trials.state_machine import Cause

TASK_TEXT = (
    "Two people, or one with both hands, move the two ends of a virtual board up and down, each with a haptic stylus, "
    "and roll a virtual ball into a target at the one side and then at the other, where it must stay. A trial begins "
    "with levelling the board; an attempt at it lasts from the release of the ball to success, fall or time limit."
)
"""Description of the task."""

_HAPPENED = (
    (Cause.START, "start", "the operator starts the block"),
    (Cause.LEVEL, "release", "the board was level for long enough: the ball is released"),
    (Cause.ENTERED, "entered", "the ball came into the target"),
    (Cause.LEFT, "left", "the ball left the target"),
    (Cause.HELD, "success", "the ball stayed in the target for the hold time"),
    (Cause.FELL, "fell", "the ball fell off the board"),
    (Cause.TIMED_OUT, "timed_out", "the attempt took too long"),
    (Cause.NEXT, "next_trial", "the next trial, or the next attempt at this one, follows"),
    (Cause.LAST, "block_over", "the block had all its trials, or its time"),
    (Cause.PAUSE, "pause", "the operator pauses"),
    (Cause.RESUME, "resume", "the operator goes on"),
    (Cause.ABORT, "abort", "the operator gives up the attempt"),
    (Cause.SKIP, "skip", "the operator skips the trial"),
    (Cause.REPEAT, "repeat", "the operator adds a trial to the end of the block"),
    (Cause.VETO, "veto", "the operator takes one of those back"),
    (Cause.STOP, "stop", "the operator ends the block"),
    (Cause.FAULT, "fault", "a peer was missing, or a value was not finite: paused"),
)

HAPPENED = {int(cause): name for cause, name, _ in _HAPPENED}
"""Names of all phase changes, by the code in a tick's ``event``."""

HAPPENED_TEXTS = {name: text for _, name, text in _HAPPENED} | {"unknown": "something this netboard does not know"}
"""Descriptions of these names."""

ROLE_TEXT = "what the trial is for: practice, familiarisation, baseline, test, or catch"
"""Description of the trial role."""

ATTEMPT_TEXTS = {
    "trial": "number of the trial in the block, from 1",
    "attempt": "number of the attempt at this trial, from 1",
    "target": "side of the target",
    "outcome": (
        "what became of the attempt: success, fell, timed_out, or the command or fault that ended it; unfinished if "
        "the recording ends first"
    ),
    "completion_time": "from the release to the ball's coming into the target to stay, of a success",
    "catch_trial": "true: a catch trial, in which nothing is felt",
    "role": ROLE_TEXT,
    "flags": "why the attempt is doubtful, by rules that were fixed before: words with spaces between",
}
"""Descriptions of the columns on attempts."""
