"""Descriptions of the task and its events, shared by all export formats that are standards."""

from netboard.task.trials.state_machine import Cause

TASK_TEXT = (
    "Two people, or one with both hands, move the two ends of a virtual board up and down, each with a haptic stylus, "
    "and roll a virtual ball into a target on one side and then on the other, where it must stay. A trial begins "
    "with levelling the board; each attempt lasts from the release of the ball to success, fall or time limit."
)

KEYWORDS = ("haptics", "dyad", "joint action", "motor control")
"""Keywords for searches."""

_PHASE_CHANGES = (
    (Cause.START, "start", "the operator starts the block"),
    (Cause.LEVEL, "release", "the board was level for long enough: the ball is released"),
    (Cause.ENTERED, "entered", "the ball entered the target"),
    (Cause.LEFT, "left", "the ball left the target"),
    (Cause.HELD, "success", "the ball stayed in the target for the hold time"),
    (Cause.FELL, "fell", "the ball fell off the board"),
    (Cause.TIMED_OUT, "timed_out", "the attempt took too long"),
    (Cause.NEXT, "next_trial", "the next trial, or the next attempt at this one, follows"),
    (Cause.LAST, "block_over", "all trials of the block are done, or its time is over"),
    (Cause.PAUSE, "pause", "the operator pauses"),
    (Cause.RESUME, "resume", "the operator resumes"),
    (Cause.ABORT, "abort", "the operator aborts the attempt"),
    (Cause.SKIP, "skip", "the operator skips the trial"),
    (Cause.REPEAT, "repeat", "the operator adds a trial to the end of the block"),
    (Cause.VETO, "veto", "the operator cancels such a repeat"),
    (Cause.STOP, "stop", "the operator ends the block"),
    (Cause.FAULT, "fault", "paused: a peer was missing, or a value was not finite"),
)

EVENT_NAMES = {int(cause): name for cause, name, _ in _PHASE_CHANGES}
"""Names of all phase changes, by the code in a tick's ``event``."""

EVENT_TEXTS = {name: text for _, name, text in _PHASE_CHANGES} | {"unknown": "unknown to this version of netboard"}
"""Descriptions of these names."""

PARTNER_TEXT = "what moved the other end: own (the other hand), person, still, or the name of a robot partner"

PERTURBATION_TEXT = (
    "force of the perturbation in the trial, at the place in [perturbation] of the configuration: + = towards the "
    "target on the ball, up on board and styluses; 0: none"
)

ROLE_TEXT = "what the trial is for: practice, familiarisation, baseline, test, or catch"

ATTEMPT_TEXTS = {
    "trial": "number of the trial in the block, from 1",
    "attempt": "number of the attempt at this trial, from 1",
    "target": "side of the target",
    "outcome": (
        "outcome of the attempt: success, fell, timed_out, or the command or fault that ended it; unfinished if "
        "the recording ends first"
    ),
    "completion_time": "of a success: from the release until the ball enters the target to stay",
    "catch_trial": "true: a catch trial, without haptic feedback",
    "perturbation": PERTURBATION_TEXT,
    "role": ROLE_TEXT,
    "flags": "why the attempt is flagged, by rules that were fixed in advance: words separated by spaces",
}
"""Descriptions of the columns on attempts."""
