"""The console's texts about a session. Pure: no Qt, no clock.

There is a headline for the current phase, a line for the position in the plan, and a line for what to do next.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from math import isnan

from netboard.base.config import Side
from netboard.base.device_kind import HIDDEN, MOVED_BY_SERVER, DeviceKind
from netboard.base.plural import plural
from netboard.base.process.display_server import unseen
from netboard.base.tables.experiment import Block, Session
from netboard.network.protocol.control import FORM_AWAITED, Status
from netboard.nodes.ports.emergency import AWAITING_ARMING, AWAITING_RELEASE
from netboard.nodes.ports.waiting import in_words
from netboard.nodes.server.stand_ins import AWAITING_WORDS
from netboard.task.journal.lost import WILL_BE_EXCLUDED
from netboard.task.journal.outcome import AttemptOutcome
from netboard.task.trials.exclusion import ExclusionRule
from netboard.task.trials.quality import FLAG_WORDS
from netboard.windows.operator.commands import CONFIRM_KEY, SKIP_FORM_KEY
from netboard.windows.operator.lamps import ACTIVE, OVER, SILENT, Lamp, LampLevel, replayed

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
    "emergency_stop": "emergency stop",
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
class TonedText:
    """A text and its tone."""

    words: str
    tone: Tone = Tone.PLAIN


def headline(status: Status | None, silence: float) -> TonedText:
    """Return the current phase in one or two words."""
    if status is None:
        return TonedText("NO CONNECTION", Tone.WATCH)
    if status.phase == OVER:
        return TonedText("SESSION OVER", Tone.QUIET)
    if silence > SILENT:
        return TonedText("LINK LOST", Tone.BAD)
    if AWAITING_RELEASE in status.waiting_for:
        return TonedText("STOPPED", Tone.BAD)
    if status.phase == "idle":
        return _before(status)
    tone = {"paused": Tone.WATCH, "failed": Tone.WATCH, "succeeded": Tone.GOOD, "finished": Tone.QUIET}
    words = "SESSION FINISHED" if status.phase == "finished" and last_block(status) else PHASES[status.phase]
    return TonedText(words, tone.get(status.phase, Tone.GOOD))


def _before(status: Status) -> TonedText:
    """Return the headline before a block."""
    if not status.opened:
        return TonedText("NOT OPENED", Tone.WATCH)
    if status.rest > 0:
        return TonedText(f"REST {clock(status.rest)}", Tone.PLAIN)
    if status.waiting_for:
        return TonedText("WAITING", Tone.WATCH)
    return TonedText("READY", Tone.PLAIN)


def badge(status: Status | None, silence: float, lamps: Sequence[Lamp]) -> TonedText:
    """Return the one state of the session: its phase, in a colour that agrees with the most severe lamp."""
    line, level = headline(status, silence), max((lamp.level for lamp in lamps), default=LampLevel.OFF)
    if level < LampLevel.WATCH or line.tone is Tone.BAD:
        return line
    tone, needs = (Tone.BAD, "FAULT") if level == LampLevel.BAD else (Tone.WATCH, "CHECK")
    claims = line.tone in (Tone.GOOD, Tone.PLAIN)  # others do not claim that all is well
    return TonedText(f"{line.words}: {needs}" if claims else line.words, tone)


def last_block(status: Status) -> bool:
    """Whether no block follows this one."""
    return status.block >= status.blocks


def progress(status: Status | None) -> str:
    """Return the position within the block."""
    if status is None:
        return ""
    failed = plural(status.failures, "failed attempt") if status.failures else "no failed attempt"
    return f"Trial {min(status.trial, status.trials)} of {status.trials}   ({status.successes} done, {failed})"


def block(status: Status | None) -> str:
    """Return number, label and condition of the block."""
    if status is None:
        return ""
    called = "   ".join(dict.fromkeys(words for words in (status.label, status.condition) if words))
    return f"Block {status.block} of {status.blocks}   {called}"


def ahead(status: Status | None) -> str:
    """Return what comes next in the plan."""
    if status is None or not status.opened:
        return ""
    if last_block(status):
        return "This is the last block"
    return f"Next: {', then '.join(status.ahead)}"


def banner(status: Status | None) -> TonedText:
    """Return whether the session is real, a pilot or a replay, with its name and dyad."""
    if status is None:
        return TonedText("NOT CONNECTED", Tone.QUIET)
    study = f"   study {status.study}" if status.study else ""
    whose = f"session {status.name}   dyad {status.dyad}{study}"
    if replayed(status):
        return TonedText(f"REPLAY \u2013 not live   {whose}   REPLAY", Tone.GOOD)
    if status.pilot:
        return TonedText(f"PILOT \u2013 not for the study   {whose}   PILOT", Tone.WATCH)
    if not status.opened:
        return TonedText(f"not opened   {whose}", Tone.QUIET)
    if not status.real:
        return TonedText(f"NO CONSENT \u2013 not for the study   {whose}   NO CONSENT", Tone.BAD)
    if status.stand_ins:
        return TonedText(f"REAL, with {', '.join(one.words for one in status.stand_ins)}   {whose}", Tone.BAD)
    return TonedText(f"REAL   {whose}", Tone.PLAIN)


def rig(status: Status | None, side: Side, seated: str) -> TonedText:
    """Return who sits at a side, what the hand holds, and whether somebody sees the display."""
    if status is None:
        return TonedText("", Tone.QUIET)
    held = next((device for device in status.devices if device.side == side), None)
    hidden = any(shown.side == side and unseen(shown.platform) for shown in status.displays)
    parts = (
        f"{side.upper()}  {seated}".rstrip(),
        "no agent" if held is None else held.text,
        "display off screen" if hidden else "",
    )
    real = held is None or held.kind in (DeviceKind.HAPTIC, HIDDEN, *MOVED_BY_SERVER)
    return TonedText("\n".join(filter(None, parts)), Tone.PLAIN if real and not hidden else Tone.WATCH)


def seated(session: Session | None, block: Block | None, side: Side) -> str:
    """Return the letter and the pseudonym of the participant whose hand is at a side; empty if none or unknown."""
    if session is None or block is None or getattr(block, side) != "person":
        return ""
    letter = block.performer if block.configuration == "bimanual" else "A" if session.seat_a == side else "B"
    return f"{letter}: {session.participant_a if letter == 'A' else session.participant_b}"


def advice(status: Status | None, where: str, refused: Sequence[str] = (), *, form: bool = False) -> TonedText:
    """Return what the operator should know or do next.

    `refused`: why the server refuses peers now. `form`: whether the session's form is shown.
    """
    if status is None:
        return TonedText(f"Looking for the server: {where}", Tone.WATCH)
    if status.phase == OVER:
        return TonedText("The server has ended the session. The next one appears here as soon as a server runs.")
    if replayed(status):
        return TonedText(status.notice)
    if not status.opened and status.phase == "idle":
        if form:
            return TonedText("Fill in the form, then press Enter to open the session. F3 hides the form")
        return TonedText("No session is open. To show its form, press F3")
    missing = [what for what in status.waiting_for if what != AWAITING_RELEASE and status.phase not in ACTIVE]
    to_confirm = any(what.startswith(AWAITING_WORDS) for what in missing)
    only_arming = not status.armed and all(what.endswith(AWAITING_ARMING) for what in missing)
    parts = (
        status.notice,
        # Often the notice says it already.
        f"waiting for {in_words(missing)}" if missing and "waiting for" not in status.notice else "",
        f"the server refuses a peer: {refused[0]}" if missing and refused else "",
        f"press {CONFIRM_KEY} and write these words" if to_confirm else "",
        "" if missing and not only_arming else _next(status),
        f"planned: {status.pending}" if status.pending else "",
    )
    urgent = status.notice or missing or status.pending
    return TonedText(_sentence("; ".join(filter(None, parts))), Tone.WATCH if urgent else Tone.PLAIN)


def _sentence(words: str) -> str:
    """Begin a line with a capital letter."""
    return words[:1].upper() + words[1:]


def _next(status: Status) -> str:
    """Return the next key to press, if the session waits for the operator."""
    if AWAITING_RELEASE in status.waiting_for:
        return "to release the emergency stop, press Ctrl+R twice"
    which = "it" if len(status.lost) == 1 else f"these {len(status.lost)}"
    repeat = f"to repeat {which}, press Ctrl+F9" if WILL_BE_EXCLUDED in status.notice and status.lost else ""
    if status.phase == "finished":
        form = f"to go on without the answers, press {SKIP_FORM_KEY} twice" if FORM_AWAITED in status.notice else ""
        over = "to end the session, press Ctrl+E twice" if last_block(status) else ""
        end = over or (repeat and "to continue without them, press Ctrl+N twice")
        return "; ".join(filter(None, (form, repeat, end)))
    key, does = {"idle": ("F2", "start the block"), "paused": ("F7", "resume")}.get(status.phase, ("", ""))
    step = does and f"to {does}, press {key if status.armed else f'F1 to arm the devices, then {key}'}"
    return "; ".join(filter(None, (step, repeat)))


def worst(lamps: Sequence[tuple[str, Lamp]]) -> TonedText:
    """Return the text of the most severe lamp, and how many others need attention; each lamp comes with its station."""
    warnings = [(where, lamp) for where, lamp in lamps if lamp.level >= LampLevel.WATCH]
    if not warnings:
        return TonedText("", Tone.QUIET)
    where, lamp = max(warnings, key=lambda named: named[1].level)  # the first of equal severity
    others = len(warnings) - 1
    more = f" ({plural(others, 'other lamp needs', 'other lamps need')} attention)" if others else ""
    named = _sentence(f"{where} {lamp.name.lower()}".strip())
    return TonedText(
        f"{named}: {lamp.words}. {lamp.tip}{more}", Tone.BAD if lamp.level == LampLevel.BAD else Tone.WATCH
    )


def commander(status: Status | None, console: str) -> TonedText:
    """Return who the commander is."""
    if status is None or status.phase == OVER:
        return TonedText("", Tone.QUIET)
    if replayed(status):
        return TonedText("Every console may control a replay", Tone.PLAIN)
    if status.commander == console:
        return TonedText("You are in command", Tone.GOOD)
    if status.commander:
        return TonedText(f"{status.commander} is in command. To take over, press T", Tone.WATCH)
    return TonedText("Nobody is in command: press T, or send a command", Tone.PLAIN)


def attempt_cells(attempt: AttemptOutcome, rule: ExclusionRule) -> tuple[str, ...]:
    """Return the cells of an attempt's row, one per column of `ATTEMPT_HEADS`; `rule`: of the analysis."""
    return (
        str(attempt.block),
        str(attempt.trial),
        str(attempt.attempt),
        OUTCOMES.get(attempt.outcome, attempt.outcome),
        "" if isnan(attempt.completion) else f"{attempt.completion:.2f} s",
        _in_analysis(attempt, rule),
    )


def _in_analysis(attempt: AttemptOutcome, rule: ExclusionRule) -> str:
    """Return what the analysis will do with an attempt, its other flags, and which trial it repeats."""
    consequence = rule.consequence(attempt.outcome, attempt.flag_list)
    flags = ", ".join(FLAG_WORDS.get(flag, flag.replace("_", " ")) for flag in attempt.flag_list)
    flagged = f"flagged: {flags}" if flags and not consequence else ""
    repeats = f"repeats trial {attempt.repeats}" if attempt.repeats else ""
    return ", ".join(filter(None, (consequence or "counts", flagged, repeats)))


ATTEMPT_HEADS = ("Block", "Trial", "Attempt", "Outcome", "Time", "Analysis")
"""Column headers of the table of attempts."""

WIDEST_CELLS = ("18", "1000", "10", "emergency stop", "3600.00 s")
"""A wide text of each column but the last, which takes the room that is left."""


def attempt_tone(attempt: AttemptOutcome, rule: ExclusionRule) -> Tone:
    """Return the tone of an attempt: lost or flagged, success or other."""
    if attempt.flags:
        return Tone.BAD if attempt.outcome == "success" and rule.reasons(attempt.flag_list) else Tone.WATCH
    return Tone.GOOD if attempt.outcome == "success" else Tone.PLAIN


def clock(seconds: float) -> str:
    """Format a time as minutes and seconds."""
    whole = max(round(seconds), 0)
    return f"{whole // 60}:{whole % 60:02d}"
