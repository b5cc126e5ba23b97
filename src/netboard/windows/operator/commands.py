"""The operator's commands: label, key, and when each is possible. Pure: one table, no Qt.

Each row decides whether its command is possible now, and gives the reason if not, before the server has to refuse it.
The emergency stop is not in the table: it is always possible.
"""

from collections.abc import Callable
from dataclasses import dataclass

from netboard.network.protocol.control import Status
from netboard.nodes.ports.emergency import LACKING, RELEASE, STOP
from netboard.windows.operator.lamps import ACTIVE, replayed

STOP_KEYS = ("Esc", "Space")
"""Keys of the emergency stop; in a text field, Space writes a space."""

FREE = (STOP, "take", "note")
"""Commands of consoles that are not the commander."""

REPLAYED = ("pause", "resume", "next", "end")
"""Commands that a replay accepts too."""

Refused = Callable[[Status], str]
"""A function that returns why a command is not possible now; empty if it is."""


@dataclass(frozen=True, slots=True)
class Wish:
    """One command of the operator."""

    name: str
    label: str
    key: str
    tip: str
    refused: Refused
    twice: bool = False


def _always(_status: Status) -> str:
    return ""


def _in(*phases: str) -> Refused:
    """Allow a command only in some phases."""
    return lambda status: "" if status.phase in phases else f"not while {status.phase}"


def _halted(status: Status) -> str:
    return "the emergency stop is to be released first: Ctrl+R" if LACKING in status.waiting_for else ""


def _arm(status: Status) -> str:
    if halted := _halted(status):
        return halted
    return "the devices are armed already" if status.armed else ""


def _start(status: Status) -> str:
    if status.phase != "idle":
        return f"not while {status.phase}"
    return _halted(status) if status.opened else "the session's form is to be filled in first: F3"


def _resume(status: Status) -> str:
    return _in("paused")(status) or _halted(status)


def _open(status: Status) -> str:
    return "the session is open already" if status.opened else _in("idle")(status)


def _opened(status: Status) -> str:
    return "" if status.opened else "no session is open"


def _judged(status: Status) -> str:
    return "" if status.outcomes else "there has been no attempt yet"


WISHES: tuple[Wish, ...] = (
    Wish("arm", "Arm", "F1", "Let the devices have forces.", _arm),
    Wish("start", "Start", "F2", "Begin the block.", _start),
    Wish("open", "Session form", "F3", "Who takes part: fill in, and open the session.", _open),
    Wish("note", "Note", "F4", "Write a note: its time is that of the first letter.", _always),
    Wish("pause", "Pause now", "F5", "Stop the trial at once; it is begun anew.", _in(*ACTIVE)),
    Wish("pause_after_trial", "Pause after trial", "F6", "Let this trial end, then pause.", _in(*ACTIVE)),
    Wish("resume", "Resume", "F7", "Go on with the trial.", _resume),
    Wish("abort", "Abort trial", "F8", "Give up this attempt, and try again.", _in("levelling", "running", "holding")),
    Wish("repeat", "Repeat trial", "F9", "One more trial at the end, for the marked one or the last.", _judged),
    Wish("veto", "No repeat", "Shift+F9", "Take back the repeat of the marked trial, or the last.", _judged),
    Wish("skip", "Skip trial", "F10", "Count this trial as done.", _in(*ACTIVE, "paused"), twice=True),
    Wish(
        "stop_after_block",
        "Stop after block",
        "F12",
        "End the session when this block is over.",
        _in(*ACTIVE, "paused"),
    ),
    Wish(
        "disarm", "Disarm", "Shift+F1", "Let no device have a force.", lambda s: "" if s.armed else "nothing is armed"
    ),
    Wish("next", "Next block", "Ctrl+N", "Give up what is left of this block.", _opened, twice=True),
    Wish("end", "End session", "Ctrl+E", "End the session here; it can be resumed.", _opened, twice=True),
    Wish("take", "Take command", "T", "From now on this console commands.", _always),
)
"""The commands, in the order of their buttons."""

RELEASING = Wish(
    RELEASE,
    "Release the stop",
    "Ctrl+R",
    "End the emergency stop: devices may be armed again.",
    lambda status: "" if LACKING in status.waiting_for else "there is no emergency stop",
    twice=True,
)
"""Release of the emergency stop; its button is beside that of the stop."""


def refusal(wish: Wish, status: Status | None, own: str) -> str:
    """Return why a command is not possible now; empty if it is."""
    if status is None:
        return "the server is not there"
    if replayed(status):
        return "" if wish.name in REPLAYED else "this is a replay"
    if wish.name == "take" and status.commander == own:
        return "you command already"
    if status.commander not in ("", own) and wish.name not in FREE:
        return f"{status.commander} commands: press T to take over"
    return wish.refused(status)
