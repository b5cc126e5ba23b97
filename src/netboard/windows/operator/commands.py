"""The operator's commands: label, key, and when each is possible. Pure: one table, no Qt.

Each row decides whether its command is possible now, and gives the reason if not, before the server has to refuse it.
The emergency stop is not in the table: it is always possible.
"""

from collections.abc import Callable
from dataclasses import dataclass

from netboard.network.protocol.control import FORM_AWAITED, SHARED_COMMANDS, Status
from netboard.nodes.ports.emergency import AWAITING_RELEASE, RELEASE, STOP
from netboard.nodes.ports.waiting import in_words
from netboard.task.trials.state_machine import WHEN, Phase
from netboard.windows.operator.lamps import ACTIVE, OVER, replayed

STOP_KEYS = ("Esc", "Space")
"""Keys of the emergency stop; in a text field, Space writes a space."""

CONFIRM_KEY = "Shift+F3"
"""Key of the field in which stand-ins are confirmed in words."""

SKIP_FORM_KEY = "Ctrl+F10"
"""Key that skips a questionnaire whose answers do not come."""

FOR_EVERY_CONSOLE = (STOP, "take", "note")
"""Commands of consoles that are not the commander."""

Refusal = Callable[[Status], str]
"""A function that returns why a command is not possible now; empty if it is."""


@dataclass(frozen=True, slots=True)
class OperatorCommand:
    """One command of the operator."""

    name: str
    label: str
    key: str
    tip: str
    refusal: Refusal
    confirm: bool = False  # whether it needs a second press


def _always(_status: Status) -> str:
    return ""


def _in(*phases: str) -> Refusal:
    """Allow a command only in some phases."""
    return lambda status: "" if status.phase in phases else f"not possible {WHEN[Phase[status.phase.upper()]]}"


def _halted(status: Status) -> str:
    return "release the emergency stop first: Ctrl+R" if AWAITING_RELEASE in status.waiting_for else ""


def _arm(status: Status) -> str:
    if halted := _halted(status):
        return halted
    return "the devices are armed already" if status.armed else ""


def _go_on(status: Status) -> str:
    if halted := _halted(status):
        return halted
    if not status.armed:
        return "arm the devices first: F1"
    missing = in_words(status.waiting_for) if not status.rest else ""  # the operator need not await the end of a rest
    return missing and f"waiting for {missing}"


def _start(status: Status) -> str:
    if status.phase == "idle" and not status.opened:
        return "fill in the session form first: F3"
    return _in("idle")(status) or _go_on(status)


def _resume(status: Status) -> str:
    return _in("paused")(status) or _go_on(status)


def _open(status: Status) -> str:
    return "the session is open already" if status.opened else _in("idle")(status)


def _opened(status: Status) -> str:
    return "" if status.opened else "no session is open"


def _next(status: Status) -> str:
    if status.opened and status.block >= status.blocks:
        return "this is the last block: end the session (Ctrl+E)"
    if status.phase in ACTIVE:
        return "not possible in a trial: pause first (F5)"
    return _opened(status)


def _stop_after_block(status: Status) -> str:
    return _opened(status) if status.study else "there is no plan, only this block"


def _repeat(status: Status) -> str:
    free = status.phase in ("running", "holding", "finished")
    done = range(1, status.trial + free)
    if not done:
        return "no trial of this block is done yet"
    return "" if set(done) - set(status.repeats) else "all trials done so far are already marked for a repeat"


def _repeat_lost(status: Status) -> str:
    return "" if status.lost else "this block has no lost trial to repeat"


def _skip_form(status: Status) -> str:
    return "" if FORM_AWAITED in status.notice else "no questionnaire waits for answers"


def _veto(status: Status) -> str:
    return "" if status.repeats else "no repeat is waiting"


COMMANDS: tuple[OperatorCommand, ...] = (
    OperatorCommand("arm", "Arm", "F1", "Allow the devices to render forces.", _arm),
    OperatorCommand("start", "Start", "F2", "Start the block.", _start),
    OperatorCommand("open", "Session form", "F3", "Enter the participants, and open the session.", _open),
    OperatorCommand(
        "note", "Note", "F4", "Write a note; it is stamped with the time at which you began to type.", _always
    ),
    OperatorCommand("pause", "Pause now", "F5", "Interrupt the trial at once; it starts again.", _in(*ACTIVE)),
    OperatorCommand("pause_after_trial", "Pause after trial", "F6", "Finish this trial, then pause.", _in(*ACTIVE)),
    OperatorCommand("resume", "Resume", "F7", "Continue after a pause.", _resume),
    OperatorCommand(
        "abort",
        "Abort trial",
        "F8",
        "Stop this attempt; the trial starts again.",
        _in("levelling", "running", "holding"),
    ),
    OperatorCommand(
        "repeat", "Repeat trial", "F9", "Repeat the selected or the last trial at the end of the block.", _repeat
    ),
    OperatorCommand(
        "repeat_lost",
        "Repeat lost trials",
        "Ctrl+F9",
        "At the end of this block, repeat its lost trials: those that the analysis will exclude.",
        _repeat_lost,
    ),
    OperatorCommand(
        "veto", "Cancel repeat", "Shift+F9", "Cancel the repeat of the selected trial, or the newest.", _veto
    ),
    OperatorCommand(
        "skip", "Skip trial", "F10", "Count this trial as done without a success.", _in(*ACTIVE, "paused"), confirm=True
    ),
    OperatorCommand(
        "skip_form",
        "Skip questionnaire",
        SKIP_FORM_KEY,
        "Go on without the answers that are still missing; what was filled in is kept.",
        _skip_form,
        confirm=True,
    ),
    OperatorCommand(
        "stop_after_block", "Stop after block", "F12", "End the session after this block.", _stop_after_block
    ),
    OperatorCommand(
        "disarm",
        "Disarm",
        "Shift+F1",
        "Set all forces to zero until you arm again.",
        lambda s: "" if s.armed else "no device is armed",
    ),
    OperatorCommand("next", "Next block", "Ctrl+N", "Skip the rest of this block.", _next, confirm=True),
    OperatorCommand("end", "End session", "Ctrl+E", "End the session now; it can be resumed.", _always, confirm=True),
    OperatorCommand("take", "Take command", "T", "Make this console the commander.", _always),
)
"""The commands, in the order of their buttons."""

RELEASING = OperatorCommand(
    RELEASE,
    "Release the stop",
    "Ctrl+R",
    "Release the emergency stop: devices may be armed again.",
    lambda status: "" if AWAITING_RELEASE in status.waiting_for else "there is no emergency stop",
    confirm=True,
)
"""Release of the emergency stop; its button is beside that of the stop."""


CONFIRMING = OperatorCommand(
    "confirm",
    "Confirm in words",
    CONFIRM_KEY,
    "Confirm a stand-in for a device or a screen: write the words that name it, and press Enter.",
    lambda status: "" if unconfirmed(status) else "nothing is to be confirmed",
)
"""Confirmation of stand-ins; it has a field for the words instead of a button."""


def unconfirmed(status: Status) -> tuple[str, ...]:
    """Return the words with which a real session must be confirmed before a block can start or go on."""
    return tuple(one.words for one in status.stand_ins if not one.confirmed) if status.real else ()


def refusal(command: OperatorCommand, status: Status | None, console: str) -> str:
    """Return why a command of the console with this name is not possible now; empty if it is."""
    if status is None:
        return "no connection to the server"
    if status.phase == OVER:
        return "the session is over"
    if replayed(status):
        return "" if command.name in SHARED_COMMANDS else "this is a replay"
    if command.name == "take" and status.commander == console:
        return "you are in command already"
    if status.commander not in ("", console) and command.name not in FOR_EVERY_CONSOLE:
        return f"{status.commander} is in command: press T to take over"
    return command.refusal(status)
