"""What is written into the journal of a session: one JSON object in a line for everything that a resumed session needs.

The first line is the `Header`. Every other line is an entry. A line that a power cut has torn can only be the last one;
it is left out and reported. Anything else that is not as it was written is an error that names file and line.

`netboard.task.journal.progress` tells from entries where a session stands; `netboard.recording.recovery.journal_file`
keeps the file.
"""

import json
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, TypeAlias

from pydantic import TypeAdapter, ValidationError

from netboard.base.errors import RecordingError
from netboard.base.settings import NO_EXTRAS

FORMAT = 1
"""Version of the journal's format; it grows when a reader of the version before would misread a line [1]."""

Outcome: TypeAlias = Literal["success", "fell", "timed_out", "aborted", "paused", "skipped"]
"""What becomes of an attempt."""


@dataclass(frozen=True, slots=True)
class Header:
    """What a journal is about: its first line.

    Attributes
    ----------
    format : int
        `FORMAT` [1].
    study : str
        Name of the study.
    study_digest : str
        SHA-256 of its text, in hexadecimal.
    plan_digest : str
        SHA-256 of what the plan made of it for this dyad.
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
        Version of netboard.
    config_digest : str
        `netboard.base.config.digest` of the rig's configuration.
    """

    __pydantic_config__ = NO_EXTRAS
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


@dataclass(frozen=True, slots=True)
class Opened:
    """The session's form is complete.

    Attributes
    ----------
    run : str
        Id of this run of the server.
    form : dict of str
        The form.
    """

    __pydantic_config__ = NO_EXTRAS
    run: str
    form: dict[str, str]


@dataclass(frozen=True, slots=True)
class Resumed:
    """Another run of the server goes on with the session.

    Attributes
    ----------
    run : str
        Its id.
    """

    __pydantic_config__ = NO_EXTRAS
    run: str


@dataclass(frozen=True, slots=True)
class BlockBegan:
    """A block begins, or goes on.

    Attributes
    ----------
    block : int
        Its number in the plan [1].
    trial, attempt : int
        With which trial and attempt [1].
    run : str
        Id of the run of the server, and so of its recordings.
    tick : int
        Tick of that run [1].
    """

    __pydantic_config__ = NO_EXTRAS
    block: int
    trial: int
    attempt: int
    run: str
    tick: int


@dataclass(frozen=True, slots=True)
class AttemptBegan:
    """An attempt begins: the board is to be levelled. Without an `AttemptEnded` it counts as incomplete.

    Attributes
    ----------
    block, trial, attempt : int
        Its numbers, which no other attempt of the session will have [1].
    run : str
        Id of the run of the server.
    tick : int
        Tick of that run [1].
    """

    __pydantic_config__ = NO_EXTRAS
    block: int
    trial: int
    attempt: int
    run: str
    tick: int


@dataclass(frozen=True, slots=True)
class AttemptEnded:
    """What has become of an attempt.

    Attributes
    ----------
    block, trial, attempt : int
        Its numbers [1].
    outcome : str
        One of `Outcome`.
    completion : float or None
        Completion time of a success [s].
    flags : tuple of str
        Why it is doubtful: words of `netboard.task.trials.quality.WORDS`.
    repeats : int
        The trial that it repeats, 0 for none [1].
    again : bool
        Whether the rule has the trial repeated at the end of the block.
    run : str
        Id of the run of the server.
    tick : int
        Tick of that run at which it ended [1].
    block_ticks : int
        Ticks that the block has taken so far [1].
    """

    __pydantic_config__ = NO_EXTRAS
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
class Repeat:
    """An operator wants a trial once more at the end of its block.

    Attributes
    ----------
    block, trial : int
        Which [1].
    """

    __pydantic_config__ = NO_EXTRAS
    block: int
    trial: int


@dataclass(frozen=True, slots=True)
class Veto:
    """An operator takes the repeat of a trial back.

    Attributes
    ----------
    block, trial : int
        Which trial's [1].
    """

    __pydantic_config__ = NO_EXTRAS
    block: int
    trial: int


@dataclass(frozen=True, slots=True)
class BlockEnded:
    """A block is over, or was stopped.

    Attributes
    ----------
    block : int
        Its number [1].
    how : str
        ``finished``: all trials, or the time, are over; ``given_up``: what is left of it will not be done;
        ``stopped``: it can go on.
    """

    __pydantic_config__ = NO_EXTRAS
    block: int
    how: Literal["finished", "stopped", "given_up"]


@dataclass(frozen=True, slots=True)
class Note:
    """A note of the operator.

    Attributes
    ----------
    text : str
        What it says.
    run : str
        Id of the run of the server.
    tick : int
        Tick of that run at the first key press [1].
    """

    __pydantic_config__ = NO_EXTRAS
    text: str
    run: str
    tick: int


@dataclass(frozen=True, slots=True)
class Ended:
    """The server ends on purpose. The session can be resumed if blocks are left.

    Attributes
    ----------
    reason : str
        Why, for people.
    """

    __pydantic_config__ = NO_EXTRAS
    reason: str


Entry: TypeAlias = (
    Opened | Resumed | BlockBegan | AttemptBegan | AttemptEnded | Repeat | Veto | BlockEnded | Note | Ended
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
    "note": Note,
    "ended": Ended,
}
"""What the key ``entry`` of a line says, and what the line is then."""

_NAMES = {kind: name for name, kind in KINDS.items()}


_ADAPTERS: dict[str, TypeAdapter[Any]] = {name: TypeAdapter(kind) for name, kind in KINDS.items()}


_WRITER = json.JSONEncoder(ensure_ascii=False, allow_nan=False, separators=(",", ":"))


def line_of(entry: Header | Entry, at: str) -> bytes:
    """Write an entry.

    Parameters
    ----------
    entry : Header or Entry
        What to write.
    at : str
        When, for people: it means nothing to `read_lines`.

    Returns
    -------
    bytes
        The line, with its line feed.

    Raises
    ------
    ValueError
        If a number is not finite: our own mistake.
    """
    said = {name: getattr(entry, name) for name in type(entry).__slots__}
    text = _WRITER.encode({"entry": _NAMES[type(entry)], "at": at, **said})
    return text.encode(errors="replace") + b"\n"


class Lines(NamedTuple):
    """What a journal says.

    Attributes
    ----------
    header : Header
        What it is about.
    entries : tuple of Entry
        In order.
    sound : int
        Length of what can be read, in bytes [1].
    torn : bytes
        A last line that was not written to its end.
    """

    header: Header
    entries: tuple[Entry, ...]
    sound: int
    torn: bytes


def read_lines(data: bytes, source: str) -> Lines:
    """Read a journal.

    Parameters
    ----------
    data : bytes
        The whole file.
    source : str
        Its name, for error messages.

    Raises
    ------
    RecordingError
        If a line is damaged that is not the last one, or says something that this version does not know.
    """
    lines = data.split(b"\n")
    torn = lines.pop()
    if not torn and lines and _json(lines[-1]) is None:
        torn = lines.pop() + b"\n"
    found = [_read(line, f"{source}, line {number}") for number, line in enumerate(lines, start=1)]
    if not found:
        raise RecordingError(f"{source}: holds no whole line, so nothing was done in it: delete it and begin anew")
    header, *entries = found
    if not isinstance(header, Header):
        raise RecordingError(f'{source}, line 1: found "{_NAMES[type(header)]}", expected the header of a journal')
    for number, entry in enumerate(entries, start=2):
        if isinstance(entry, Header):
            raise RecordingError(f"{source}, line {number}: a second header")
    return Lines(header, tuple(entries), len(data) - len(torn), torn)


def _json(line: bytes) -> dict[str, Any] | None:
    """Read a JSON object; None if it is none."""
    try:
        said = json.loads(line)
    except ValueError:
        return None
    return said if isinstance(said, dict) else None


def _read(line: bytes, where: str) -> Any:
    """Read a line."""
    said = _json(line)
    if said is None:
        raise RecordingError(f"{where}: is damaged: found {_shortened(line)}, expected one JSON object")
    name = said.pop("entry", None)
    said.pop("at", None)
    if name == "header" and said.get("format") != FORMAT:
        raise RecordingError(
            f"{where}: has format version {said.get('format')}, this netboard reads version {FORMAT}; "
            f"go on with netboard {said.get('netboard', 'of its own version')}"
        )
    if not isinstance(name, str) or name not in KINDS:
        raise RecordingError(f"{where}: found the entry {name!r}, expected one of {', '.join(KINDS)}")
    try:
        return _ADAPTERS[name].validate_json(json.dumps(said), strict=True)
    except ValidationError as error:
        problem = error.errors()[0]
        key = ".".join(map(str, problem["loc"]))
        raise RecordingError(f"{where}: {name}: {key}: {problem['msg'].lower()}") from None


def _shortened(line: bytes) -> str:
    text = line.decode(errors="replace")
    return repr(text if len(text) <= 40 else text[:40] + "...")
