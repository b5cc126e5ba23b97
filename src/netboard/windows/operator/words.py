"""The console's texts about a session. Pure: no Qt, no clock.

There is a headline for the current phase, a line for the position in the plan, and a line for what to do next.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from math import isnan

from netboard.network.protocol.control import Status
from netboard.nodes.ports.emergency import AWAITING_ARMING, AWAITING_RELEASE
from netboard.task.journal.outcome import AttemptOutcome
from netboard.windows.operator.lamps import ACTIVE, OVER, SILENT, Lamp, Level, replayed

PHASES = {
    "levelling": "LEVELLING",
    "running": "RUNNING",
    "holding": "HOLDING",
    "succeeded": "SUCCESS",
    "failed": "FAILED",
    "paused": "PAUSED",
    "finished": "BLOCK FINISHED",
}
"""Headlines of the phases; `_before` chooses that of ``idle``."""

OUTCOMES = {
    "success": "success",
    "fell": "ball fell",
    "timed_out": "time limit",
    "aborted": "aborted",
    "paused": "paused",
    "skipped": "skipped",
}
"""Text of each outcome of an attempt."""


class Tone(Enum):
    """Severity of a text; it selects the colour."""

    QUIET = "quiet"
    PLAIN = "plain"
    GOOD = "good"
    WATCH = "watch"
    BAD = "bad"


@dataclass(frozen=True, slots=True)
class Line:
    """A text and its tone."""

    words: str
    tone: Tone = Tone.PLAIN


def headline(status: Status | None, silence: float) -> Line:
    """Return the current phase in one or two words."""
    if status is None:
        return Line("NO CONNECTION", Tone.WATCH)
    if status.phase == OVER:
        return Line("SESSION OVER", Tone.QUIET)
    if silence > SILENT:
        return Line("LINK LOST", Tone.BAD)
    if AWAITING_RELEASE in status.waiting_for:
        return Line("STOPPED", Tone.BAD)
    if status.phase == "idle":
        return _before(status)
    tone = {"paused": Tone.WATCH, "failed": Tone.WATCH, "succeeded": Tone.GOOD, "finished": Tone.QUIET}
    words = "SESSION FINISHED" if status.phase == "finished" and last_block(status) else PHASES[status.phase]
    return Line(words, tone.get(status.phase, Tone.GOOD))


def _before(status: Status) -> Line:
    """Return the headline before a block."""
    if not status.opened:
        return Line("NOT OPENED", Tone.WATCH)
    if status.rest > 0:
        return Line(f"REST {clock(status.rest)}", Tone.PLAIN)
    if status.waiting_for:
        return Line("WAITING", Tone.WATCH)
    return Line("READY", Tone.PLAIN)


def last_block(status: Status) -> bool:
    """Whether no block follows this one."""
    return status.block >= status.blocks


def progress(status: Status | None) -> str:
    """Return the position within the block."""
    if status is None:
        return ""
    failed = f"{status.failures} failed" if status.failures else "none failed"
    return f"Trial {min(status.trial, status.trials)} of {status.trials}   ({status.successes} done, {failed})"


def block(status: Status | None) -> str:
    """Return number, label and condition of the block."""
    if status is None:
        return ""
    called = "   ".join(dict.fromkeys(words for words in (status.label, status.condition) if words))
    return f"Block {status.block} of {status.blocks}   {called}"


def banner(status: Status | None) -> Line:
    """Return whether the session is real, a pilot or a replay, with its name and dyad."""
    if status is None:
        return Line("NOT CONNECTED", Tone.QUIET)
    study = f"   study {status.study}" if status.study else ""
    whose = f"session {status.name}   dyad {status.dyad}{study}"
    if replayed(status):
        return Line(f"REPLAY \u2013 not live   {whose}   REPLAY", Tone.GOOD)
    if status.pilot:
        return Line(f"PILOT \u2013 not for the study   {whose}   PILOT", Tone.WATCH)
    if not status.opened:
        return Line(f"not opened   {whose}", Tone.QUIET)
    return Line(f"REAL   {whose}", Tone.PLAIN)


def advice(status: Status | None, where: str, refused: Sequence[str] = ()) -> Line:
    """Return what the operator should know or do next; `refused`: why the server refuses peers now."""
    if status is None:
        return Line(f"Looking for the server: {where}", Tone.WATCH)
    if status.phase == OVER:
        return Line("The server has ended the session. The next one appears here as soon as a server runs.")
    if replayed(status):
        return Line(status.notice)
    if not status.opened and status.phase == "idle":
        return Line("Fill in the session form: F3")
    missing = [what for what in status.waiting_for if what != AWAITING_RELEASE and status.phase not in ACTIVE]
    only_arming = not status.armed and all(what.endswith(AWAITING_ARMING) for what in missing)
    parts = (
        status.notice,
        # Often the notice says it already.
        "Waiting for " + ", ".join(missing) if missing and "waiting for" not in status.notice else "",
        f"refused: {refused[0]}" if missing and refused else "",
        "" if missing and not only_arming else _next(status),
        f"Next: {status.pending}" if status.pending else "",
    )
    urgent = status.notice or missing or status.pending
    return Line("; ".join(filter(None, parts)), Tone.WATCH if urgent else Tone.PLAIN)


def _next(status: Status) -> str:
    """Return the next key to press, if the session waits for the operator."""
    if AWAITING_RELEASE in status.waiting_for:
        return "release the emergency stop: press Ctrl+R twice"
    if status.phase == "finished" and last_block(status):
        return "end the session: press Ctrl+E twice"
    step = {"idle": "start the block: F2", "paused": "resume: F7"}.get(status.phase, "")
    return step if status.armed or not step else f"arm the devices: F1, then {step}"


def worst(lamps: Sequence[tuple[str, Lamp]]) -> Line:
    """Return the text of the most severe lamp, and how many others need attention; each lamp comes with its station."""
    warnings = [(where, lamp) for where, lamp in lamps if lamp.level >= Level.WATCH]
    if not warnings:
        return Line("", Tone.QUIET)
    where, lamp = max(warnings, key=lambda named: named[1].level)  # the first of equal severity
    others = f" (and {len(warnings) - 1} more)" if len(warnings) > 1 else ""
    named = f"{where.upper()} {lamp.name.lower()}".strip()
    return Line(f"{named}: {lamp.words}{others}. {lamp.tip}", Tone.BAD if lamp.level == Level.BAD else Tone.WATCH)


def commander(status: Status | None, console: str) -> Line:
    """Return who the commander is."""
    if status is None or status.phase == OVER:
        return Line("", Tone.QUIET)
    if replayed(status):
        return Line("Every console may control a replay", Tone.PLAIN)
    if status.commander == console:
        return Line("You are in command", Tone.GOOD)
    if status.commander:
        return Line(f"{status.commander} is in command. Press T to take over", Tone.WATCH)
    return Line("Nobody is in command: press T, or send a command", Tone.PLAIN)


def attempt_cells(attempt: AttemptOutcome) -> tuple[str, ...]:
    """Return the cells of an attempt's row, one per column of `ATTEMPT_HEADS`."""
    return (
        str(attempt.block),
        str(attempt.trial),
        str(attempt.attempt),
        OUTCOMES.get(attempt.outcome, attempt.outcome),
        "" if isnan(attempt.completion) else f"{attempt.completion:.2f} s",
        attempt.flags.replace("_", " ").replace(",", ", "),
        f"trial {attempt.repeats}" if attempt.repeats else "",
    )


ATTEMPT_HEADS = ("Block", "Trial", "Attempt", "Outcome", "Time", "Flags", "Repeats")
"""Column headers of the table of attempts."""


def attempt_tone(attempt: AttemptOutcome) -> Tone:
    """Return the tone of an attempt: flagged, success or other."""
    if attempt.flags:
        return Tone.WATCH
    return Tone.GOOD if attempt.outcome == "success" else Tone.PLAIN


def clock(seconds: float) -> str:
    """Format a time as minutes and seconds."""
    whole = max(round(seconds), 0)
    return f"{whole // 60}:{whole % 60:02d}"
