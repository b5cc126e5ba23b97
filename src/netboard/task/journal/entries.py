"""Format of a session's journal: one JSON object per line, with everything that is needed to resume the session.

The first line is the `Header`; every other line is an entry. A power cut can tear only the last line; a torn line is
skipped and reported. Any other damage is an error that names file and line.

`netboard.task.journal.progress` derives the progress of the session from the entries;
`netboard.recording.recovery.journal_file` writes the file.
"""

import json
from dataclasses import dataclass, fields
from typing import Any, Literal, NamedTuple, TypeAlias

from pydantic import TypeAdapter, ValidationError

from netboard.base.errors import RecordingError
from netboard.base.settings import FORBID_UNKNOWN_KEYS, parse_json
from netboard.task.trials.state_machine import Outcome

FORMAT = 1
"""Version of the journal's format, incremented when an older reader would misread a line [1]."""


@dataclass(frozen=True, slots=True)
class Header:
    """Header of a journal: its first line.

    Attributes
    ----------
    format : int
        `FORMAT` [1].
    study : str
        Name of the study.
    study_digest : str
        SHA-256 of the study's text, in hexadecimal.
    plan_digest : str
        SHA-256 of the plan of this dyad, in hexadecimal.
    seed : int
        Seed of the plan [1].
    dyad : str
        Pseudonymous id of the dyad.
    name : str
        Label of the session.
    session : int
        Number of the session in the plan, from 1 [1].
    participants : tuple of (str, str)
        Pseudonymous ids of A and B.
    pilot : bool
        Whether it is a pilot run.
    consent : bool
        Whether both participants have consented.
    netboard : str
        Version of netboard that began the session.
    config_digest : str
        `netboard.base.config.digest` of the rig's configuration.
    config : str
        That configuration, in TOML; empty in a journal of an older version.
    study_text : str
        The study in full, in TOML; empty in a journal of an older version.
    """

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    format: int
    study: str
    study_digest: str
    plan_digest: str
    seed: int
    dyad: str
    name: str
    session: int
    participants: tuple[str, str]
    pilot: bool
    consent: bool
    netboard: str
    config_digest: str
    config: str = ""
    study_text: str = ""


@dataclass(frozen=True, slots=True)
class Opened:
    """The session's form is complete.

    Attributes
    ----------
    run : str
        Id of this run of the server.
    form : dict of str
        Values that the operator entered, by field.
    """

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    run: str
    form: dict[str, str]


@dataclass(frozen=True, slots=True)
class Resumed:
    """Another run of the server, with this id, resumes the session."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    run: str


@dataclass(frozen=True, slots=True)
class _Began:
    """The place where a block or an attempt begins.

    Attributes
    ----------
    block, trial, attempt : int
        Numbers of the block in the plan, the trial and the attempt, together unique in the session [1].
    run : str
        Id of the run of the server; its recordings have the same id.
    tick : int
        Tick of that run at which it begins [1].
    """

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    block: int
    trial: int
    attempt: int
    run: str
    tick: int


@dataclass(frozen=True, slots=True)
class BlockBegan(_Began):
    """A block begins, or continues, with this trial and attempt."""


@dataclass(frozen=True, slots=True)
class AttemptBegan(_Began):
    """An attempt begins, with levelling. Without a matching `AttemptEnded` it counts as incomplete."""


@dataclass(frozen=True, slots=True)
class AttemptEnded:
    """An attempt has ended.

    Attributes
    ----------
    block, trial, attempt : int
        Numbers of the attempt, as in `AttemptBegan` [1].
    outcome : str
        A `netboard.task.trials.state_machine.Outcome`.
    completion : float or None
        Completion time; None without a success [s].
    flags : tuple of str
        Flags from `netboard.task.trials.quality.FLAGS`.
    repeats : int
        Number of the trial that this one repeats; 0 for none [1].
    again : bool
        Whether the rule repeats the trial at the end of the block.
    run : str
        Id of the run of the server.
    tick : int
        Tick of that run at which the attempt ended [1].
    block_ticks : int
        Duration of the block so far, in ticks [1].
    """

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    block: int
    trial: int
    attempt: int
    outcome: Outcome
    completion: float | None
    flags: tuple[str, ...]
    repeats: int
    again: bool
    run: str
    tick: int
    block_ticks: int


@dataclass(frozen=True, slots=True)
class _OfTrial:
    """A trial that an operator's request is about.

    Attributes
    ----------
    block, trial : int
        Numbers of the block and the trial [1].
    """

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    block: int
    trial: int


@dataclass(frozen=True, slots=True)
class Repeat(_OfTrial):
    """An operator requests the repeat of a trial at the end of its block."""


@dataclass(frozen=True, slots=True)
class Veto(_OfTrial):
    """An operator cancels the repeat of a trial."""


@dataclass(frozen=True, slots=True)
class BlockEnded:
    """A block is over, or was stopped.

    Attributes
    ----------
    block : int
        Number of the block in the plan, from 1 [1].
    how : str
        ``finished``: all trials are done, or the time limit has passed; ``given_up``: the remaining trials will not be
        done; ``stopped``: the block can continue.
    """

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    block: int
    how: Literal["finished", "stopped", "given_up"]


@dataclass(frozen=True, slots=True)
class FormAwaited:
    """The stations whose answers to the questionnaires of a block are awaited have changed.

    Attributes
    ----------
    block : int
        Number of the block, which is over [1].
    stations : tuple of str
        ``left``, ``right``; empty once nobody is waited for.
    """

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    block: int
    stations: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Note:
    """A note of the operator, with the tick of a run of the server at which its first key was pressed [1]."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    text: str
    run: str
    tick: int


@dataclass(frozen=True, slots=True)
class EmergencyStopped:
    """An emergency stop set all forces to zero at a tick of a run; the reason says who or what stopped."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    reason: str
    run: str
    tick: int


@dataclass(frozen=True, slots=True)
class EmergencyReleased:
    """An operator released an emergency stop at a tick of a run."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    run: str
    tick: int


@dataclass(frozen=True, slots=True)
class Ended:
    """The server ends regularly. The session can be resumed if blocks are left.

    Attributes
    ----------
    reason : str
        Why the server ends, in words.
    """

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    reason: str


Entry: TypeAlias = (
    Opened
    | Resumed
    | BlockBegan
    | AttemptBegan
    | AttemptEnded
    | Repeat
    | Veto
    | BlockEnded
    | FormAwaited
    | Note
    | EmergencyStopped
    | EmergencyReleased
    | Ended
)

KINDS: dict[str, type[Any]] = {
    "header": Header,
    "opened": Opened,
    "resumed": Resumed,
    "block_began": BlockBegan,
    "attempt_began": AttemptBegan,
    "attempt": AttemptEnded,
    "repeat": Repeat,
    "veto": Veto,
    "block_ended": BlockEnded,
    "form_awaited": FormAwaited,
    "note": Note,
    "emergency_stop": EmergencyStopped,
    "emergency_release": EmergencyReleased,
    "ended": Ended,
}
"""Types of lines, by the value of their key ``entry``."""

_NAMES = {kind: name for name, kind in KINDS.items()}


_ADAPTERS: dict[str, TypeAdapter[Any]] = {name: TypeAdapter(kind) for name, kind in KINDS.items()}


_WRITER = json.JSONEncoder(ensure_ascii=False, allow_nan=False, separators=(",", ":"))


def line_of(entry: Header | Entry, at: str) -> bytes:
    """Encode an entry as a line, with its line feed.

    Parameters
    ----------
    at : str
        Time of writing, for human readers; `read_lines` ignores it.

    Raises
    ------
    ValueError
        If a number is not finite, which is a bug of the caller.
    """
    values = {field.name: getattr(entry, field.name) for field in fields(entry)}
    text = _WRITER.encode({"entry": _NAMES[type(entry)], "at": at, **values})
    return text.encode(errors="replace") + b"\n"


class JournalContent(NamedTuple):
    """The content of a journal.

    Attributes
    ----------
    header : Header
        First line.
    entries : tuple of Entry
        All other lines, in order.
    sound : int
        Length of the readable part, in bytes [1].
    torn : bytes
        An incomplete last line; empty for none.
    """

    header: Header
    entries: tuple[Entry, ...]
    sound: int
    torn: bytes


def read_lines(data: bytes, source: str) -> JournalContent:
    """Decode a journal.

    Parameters
    ----------
    data : bytes
        Content of the file.

    Raises
    ------
    RecordingError
        If a line before the last one is damaged, or a line is unknown to this version.
    """
    lines = data.split(b"\n")
    torn = lines.pop()
    if not torn and lines and _json(lines[-1]) is None:
        torn = lines.pop() + b"\n"
    found = [_read(line, f"{source}, line {number}") for number, line in enumerate(lines, start=1)]
    if not found:
        raise RecordingError(
            f"{source}: has no complete line, so nothing was recorded in it; delete it and start the session again"
        )
    header, *entries = found
    if not isinstance(header, Header):
        raise RecordingError(f'{source}, line 1: found "{_NAMES[type(header)]}", expected the header of a journal')
    for number, entry in enumerate(entries, start=2):
        if isinstance(entry, Header):
            raise RecordingError(f"{source}, line {number}: a second header")
    return JournalContent(header, tuple(entries), len(data) - len(torn), torn)


def _json(line: bytes) -> dict[str, Any] | None:
    """Decode a JSON object; return None if the line is none."""
    try:
        values = parse_json(line)
    except ValueError:
        return None
    return values if isinstance(values, dict) else None


def _read(line: bytes, where: str) -> Any:
    """Decode a line; raise RecordingError if it is not valid."""
    values = _json(line)
    if values is None:
        raise RecordingError(f"{where}: is damaged: found {_shortened(line)}, expected one JSON object")
    name = values.pop("entry", None)
    values.pop("at", None)
    if name == "header" and values.get("format") != FORMAT:
        raise RecordingError(
            f"{where}: has format version {values.get('format')}, this netboard reads version {FORMAT}; "
            f"continue with netboard {values.get('netboard', 'of its own version')}"
        )
    if not isinstance(name, str) or name not in KINDS:
        raise RecordingError(f"{where}: found the entry {name!r}, expected one of {', '.join(KINDS)}")
    try:
        return _ADAPTERS[name].validate_json(json.dumps(values), strict=True)
    except ValidationError as error:
        problem = error.errors()[0]
        key = ".".join(map(str, problem["loc"]))
        raise RecordingError(f"{where}: {name}: {key}: {problem['msg'].lower()}") from None


def _shortened(line: bytes) -> str:
    text = line.decode(errors="replace")
    return repr(text if len(text) <= 40 else text[:40] + "...")
