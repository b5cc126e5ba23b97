"""Operators' commands: who may give them, and whether each is accepted.

Several consoles may watch, but only the commander's commands count. The commander is the first operator to give a
command, until it leaves or another operator takes over. Anyone may stop all forces or leave a note.
Pure: it decides from the `Situation` that it is given; the session carries the decision out.
"""

import json
from dataclasses import asdict, dataclass

from netboard.base.config import require_short_names
from netboard.base.errors import ConfigError
from netboard.base.settings import check, parse_json
from netboard.base.tables.experiment import Session
from netboard.network.protocol.control import REPLAY_COMMANDS
from netboard.nodes.ports import emergency
from netboard.nodes.ports.control_port import CommandRequest
from netboard.nodes.ports.waiting import in_words
from netboard.nodes.server.pseudonyms import require_given_pseudonyms
from netboard.task.trials.state_machine import BALL_FREE, TABLE, WHEN, Cause, Phase

CAUSES = {
    "start": Cause.START,
    "pause": Cause.PAUSE,
    "resume": Cause.RESUME,
    "abort": Cause.ABORT,
    "stop": Cause.STOP,
    "skip": Cause.SKIP,
    "repeat": Cause.REPEAT,
    "repeat_lost": Cause.REPEAT,
    "veto": Cause.VETO,
}
"""Commands that the trial state machine carries out."""

OPEN_TO_ALL = (emergency.STOP, "note", "take")
"""Commands that any operator may give, commander or not."""

BEFORE_OPENING = ("open", "confirm", "end", emergency.STOP, emergency.RELEASE, "note", "take", "arm", "disarm")
"""Commands that are allowed before the session is open."""

SAFE_WHEN_LATE = (emergency.STOP, "note", "pause", "disarm")
"""Commands that are carried out even if they arrive long after they were given, or with words that mean nothing."""

PAUSE_AFTER = "pause_after_trial"

WITH_ARGUMENT = ("open", "confirm", "repeat", "veto")
"""Other commands that have an argument."""

MAX_TICK = 2**63
"""Numbers of ticks are below this, so that they fit 64 bits [1]."""


@dataclass(frozen=True, slots=True)
class Situation:
    """The state of the session when a command arrives."""

    phase: Phase
    missing: tuple[str, ...]
    last: bool
    plan: bool


@dataclass(frozen=True, slots=True)
class Decision:
    """The decision on a command."""

    accepted: bool
    reason: str = ""
    cause: Cause = Cause.NONE


class Operators:
    """Decides on commands, and remembers the commander and what was asked for later.

    ``pause_after``: pause after the trial that is running.
    """

    def __init__(self, *, opened: bool, armed: bool) -> None:
        self.opened, self.armed = opened, armed
        self.commander, self.name = b"", ""
        self.pause_after = self.end_after = False
        self.pause_by = ""  # name of the operator who asked for the pause after the trial

    @property
    def pending(self) -> str:
        """What has been asked for later, in words for operators."""
        asked = (("pause after this trial", self.pause_after), ("end after this block", self.end_after))
        return ", ".join(words for words, wanted in asked if wanted)

    def leave(self) -> None:
        """Forget the commander."""
        self.commander, self.name = b"", ""

    def decide(self, request: CommandRequest, now: Situation) -> Decision:
        """Decide on a command."""
        command = request.command.name
        if command in REPLAY_COMMANDS:
            return Decision(False, f"cannot {command}: this is a live session, not a replay")
        if request.late and command not in SAFE_WHEN_LATE:
            return Decision(False, f"the connection was interrupted, and {command} may be out of date: send it again")
        if request.command.argument and command not in (*SAFE_WHEN_LATE, *WITH_ARGUMENT):
            return Decision(False, f"{command} has no argument; found {request.command.argument!r}")
        if command == "take" or (command not in OPEN_TO_ALL and not self.commander):
            self.commander, self.name = request.who, request.name
        if command not in OPEN_TO_ALL and request.who != self.commander:
            return Decision(False, f"{self.name} is in command; take over first (take)")
        if not self.opened and command not in BEFORE_OPENING:
            return Decision(False, "the session is not open: fill in its form first (open)")
        if command in CAUSES:
            return self._trial_command(command, now)
        return self._session_command(command, now)

    def _trial_command(self, command: str, now: Situation) -> Decision:
        """Decide on a command for the trial state machine."""
        cause = CAUSES[command]
        if command == "pause" and now.phase == Phase.PAUSED:  # a fault may have been faster than the operator
            return Decision(True, "it is paused already, and waits for resume")
        if cause not in TABLE[now.phase]:
            return Decision(False, _not_now(command, now.phase))
        if command in ("start", "resume"):
            if not self.armed:
                return Decision(False, f"cannot {command}: the devices are not armed (arm)")
            if now.missing:
                return Decision(False, f"cannot {command}: waiting for {in_words(now.missing)}")
        if command == "pause":
            self.pause_after = False
        return Decision(True, cause=cause)

    def _session_command(self, command: str, now: Situation) -> Decision:
        """Decide on a command that the session itself carries out."""
        match command:
            case "open" if self.opened:
                return Decision(False, "the session is open already")
            case "arm" if emergency.AWAITING_RELEASE in now.missing:  # else the release would arm the devices
                return Decision(False, f"cannot arm during an emergency stop: release it first ({emergency.RELEASE})")
            case "arm":
                self.armed = True
            case "disarm":
                self.armed = False
            case command if command == PAUSE_AFTER:
                return self._pause_after(now)
            case "stop_after_block" | "next" if not now.plan:
                return Decision(False, f"cannot {command}: there is no plan, only this block")
            case "stop_after_block":
                self.end_after = not self.end_after
                return Decision(
                    True,
                    "the session ends after this block" if self.end_after else "the session continues after this block",
                )
            case "next" if now.last:
                return Decision(False, "cannot continue to the next block: this is the last one")
            case "next" if now.phase in (Phase.LEVELLING, *BALL_FREE, Phase.SUCCEEDED, Phase.FAILED):
                return Decision(False, "cannot skip the rest of the block during a trial: pause first")
        return Decision(True)

    def _pause_after(self, now: Situation) -> Decision:
        if Cause.PAUSE not in TABLE[now.phase]:
            return Decision(False, _not_now("pause", now.phase))
        if now.phase not in BALL_FREE:
            return Decision(True, cause=Cause.PAUSE)
        self.pause_after, self.pause_by = not self.pause_after, self.name
        return Decision(True, "paused after this trial" if self.pause_after else "no pause after this trial")

    def due(self, phase: Phase) -> Cause:
        """Return the cause that was asked for earlier and is now due, or `Cause.NONE`."""
        if self.pause_after and phase not in BALL_FREE and Cause.PAUSE in TABLE[phase]:
            self.pause_after = False
            return Cause.PAUSE
        return Cause.NONE


def _not_now(command: str, phase: Phase) -> str:
    """Say that a command does nothing in this phase, and list those that do."""
    possible = [name for name, cause in CAUSES.items() if cause in TABLE[phase]]
    return f"cannot {command} {WHEN[phase]}; possible now: {', '.join(possible) or 'end'}"


def form_of(text: str, known: Session) -> Session:
    """Read the form of a session: a JSON object with keys of the configuration's table ``[session]``.

    Raises `ConfigError` if it is not such an object, a value is not allowed, or the run is not a pilot and has no
    consent.
    """
    form = check(Session, asdict(known) | _object(text, "the form"), ("session",))
    require_short_names(form, "the form")
    if not form.ready:
        raise ConfigError("without the consent of both participants, only a pilot run is possible")
    require_given_pseudonyms(form)
    return form


def note_of(text: str, tick: int) -> tuple[str, int]:
    """Read a note: plain text, or a JSON object with ``text`` and the ``tick`` at which the operator began to write."""
    note = _object(text, "the note") if text.lstrip().startswith("{") else {"text": text}
    words, at = note.get("text"), note.get("tick", tick)
    if not isinstance(words, str) or type(at) is not int or not 0 <= at < MAX_TICK:
        raise ConfigError("the note: expected a text and the number of a tick")
    if not words.strip():
        raise ConfigError("the note is empty")
    return words, at


def _object(text: str, what: str) -> dict[str, object]:
    try:
        found = parse_json(text or "{}")
        json.dumps(found, ensure_ascii=False).encode()  # half of a surrogate pair cannot be recorded
    except ValueError as error:
        raise ConfigError(f"{what} is not JSON: {error}") from None
    if not isinstance(found, dict):
        raise ConfigError(f"{what}: expected a JSON object")
    return found
