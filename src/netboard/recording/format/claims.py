"""What a file says of itself, checked before it is used: kinds, counts, sizes, depths.

A recording may come from anyone, and its checksums only prove that it is as its writer made it. Every length, count
and number in it is a claim. The limits are here, with the functions that apply them; readers of chunks, schemas,
attachments, metadata and messages call them before they allocate or loop. A claim beyond a limit raises a
`RecordingError` that says what was found and what was expected. No recording that netboard writes comes near them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from reprlib import Repr
from typing import Annotated, Literal, TypeVar

from pydantic import AllowInfNan, Field, Strict, TypeAdapter, ValidationError

from netboard.base.errors import RecordingError
from netboard.base.settings import parse_json
from netboard.network.protocol.records import EventRecord

MAX_CHUNK_BYTES = 2**26
"""Largest size of a chunk after decompression; [recording] chunk_bytes allows 2**24 [bytes]."""

MAX_EXPANSION = 2**13
"""Largest ratio of the size of a chunk to its compressed size; that of resting hands reaches 430 [1]."""

MAX_RECORD_BYTES = 2**23
"""Largest metadata record, attachment or schema, other than the list of places [bytes]."""

MAX_ITEMS = 4096
"""Most items of a list or map in a message [1]."""

MAX_WHOLE = 2**62
"""Largest magnitude of a whole number: sums and differences of two fit 64 bits [1]."""

MAX_JOINED = 200
"""Most recordings that a wrongly joined file may hold: each is compared with all others [1]."""

MAX_STAMP_NS = 2**63 - 1
"""Largest time stamp: MCAP allows twice as much, arithmetic on arrays does not [ns]."""

MAX_WASTE = 16
"""How often recovery may read each byte of a file in search of chunks and records that turn out to be none [1]."""

T = TypeVar("T")

_SHORT = Repr()
_SHORT.maxstring = _SHORT.maxother = 60

Whole = Annotated[int, Strict(), Field(ge=-MAX_WHOLE, le=MAX_WHOLE)]
Name = Annotated[str, Strict(), Field(min_length=1, max_length=100)]
Seconds = Annotated[float, Strict(), AllowInfNan(False)]


@dataclass(frozen=True, slots=True)
class StoredColumn:
    """A column in the schema of the ticks."""

    name: Name
    type: Literal["<i8", "<f8"]
    differences: Annotated[int, Strict(), Field(ge=0, le=8)]


@dataclass(frozen=True, slots=True)
class StoredLayout:
    """What the schema of the ticks says of their columns."""

    columns: Annotated[list[StoredColumn], Field(min_length=1, max_length=1000)]
    folded: Annotated[bool, Strict()] = False
    constants: Annotated[list[Name], Field(max_length=100)] = field(default_factory=list)
    predictions: Annotated[dict[Name, str], Field(max_length=1000)] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class StoredAttempt:
    """An attempt in the list of attempts."""

    trial: Whole
    attempt: Whole
    target: Whole
    outcome: Name
    began: Whole
    tick: Whole
    stop: Whole
    duration: Seconds
    completion: Seconds | None


LAYOUT = TypeAdapter(StoredLayout)
ATTEMPTS = TypeAdapter(list[StoredAttempt])

_WHOLE_DETAILS: Mapping[str, tuple[str, ...]] = {
    "log_lost": ("first", "count"),
    "log_unreadable": ("number",),
    "stood_still": ("milliseconds",),
    "attempt_ended": ("trial", "attempt"),
}
"""Details of events that are read as whole numbers, by the name of the event."""

_OPTIONAL_DETAILS: Mapping[str, tuple[str, ...]] = {"log_lost": ("after_tick",), "attempt_ended": ("repeats",)}
"""Further ones, which older recordings may lack."""

_NUMBER_DETAILS: Mapping[str, tuple[str, ...]] = {"held": ("completion",)}
"""Details of events that are read as numbers, if they are there."""


def stored_json(adapter: TypeAdapter[T], data: bytes, what: str) -> T:
    """Decode a JSON text of a file; ``what``: its name in the error."""
    if len(data) > MAX_RECORD_BYTES:
        raise RecordingError(f"{what}: found {len(data)} bytes, expected at most {MAX_RECORD_BYTES}")
    try:
        values = parse_json(data)
    except ValueError as error:
        raise RecordingError(f"{what}: not valid JSON: {error!s:.100}") from None
    try:
        return adapter.validate_python(values)
    except ValidationError as error:
        problem = error.errors(include_url=False, include_context=False)[0]
        place = ".".join(map(str, problem["loc"])) or "all of it"
        found = f"{problem['msg'].lower()}, found {_SHORT.repr(problem['input'])}"
        raise RecordingError(f"{what}: {place:.100}: {found}") from None


def whole_number(text: str) -> int | None:
    """Return the whole number that a text of a file states; None if it states none, or one of too many digits."""
    digits = text.removeprefix("-")
    if not (digits.isascii() and digits.isdecimal() and len(digits) <= 19):
        return None
    number = int(text)
    return number if abs(number) <= MAX_WHOLE else None


def is_number(text: str) -> bool:
    """Return whether a text of a file states a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def require_details(event: EventRecord) -> EventRecord:
    """Return an event; refuse it if a detail that is read as a number is none."""
    optional = (name for name in _OPTIONAL_DETAILS.get(event.name, ()) if name in event.details)
    for name in (*_WHOLE_DETAILS.get(event.name, ()), *optional):
        if whole_number(event.details.get(name, "")) is None:
            raise _wrong_detail(event, name, "a whole number")
    for name in _NUMBER_DETAILS.get(event.name, ()):
        if not is_number(event.details.get(name, "0")):
            raise _wrong_detail(event, name, "a number")
    return event


def _wrong_detail(event: EventRecord, name: str, expected: str) -> RecordingError:
    found = _SHORT.repr(event.details.get(name, ""))
    return RecordingError(f"event {event.seq}, {event.name}: {name}: found {found}, expected {expected}")


def require_chunk(size: int, packed: int) -> None:
    """Refuse a chunk that claims too large a size, or to expand by more than any data; sizes in bytes."""
    if size > MAX_CHUNK_BYTES:
        raise RecordingError(f"a chunk of {size} bytes, expected at most {MAX_CHUNK_BYTES}")
    if size > packed * MAX_EXPANSION:
        raise RecordingError(
            f"a chunk that expands from {packed} to {size} bytes, expected {MAX_EXPANSION} times at most"
        )


def shown(text: str) -> str:
    """Return a text of a file as an error quotes it: in one line, without control characters, and not too long."""
    return _SHORT.repr(text)[1:-1]


class SearchEffort:
    """The work of a search through damaged data, bounded by the size of the data [bytes]."""

    def __init__(self, path: Path, size: int) -> None:
        self._path = path
        self._left = MAX_WASTE * size + MAX_CHUNK_BYTES

    def spend(self, length: int) -> None:
        """Count bytes that were read and are no record."""
        self._left -= length
        if self._left < 0:
            raise RecordingError(
                f"{self._path}: claims far more chunks and records than it has room for, as no logger or damage leaves "
                "it; it is not recovered"
            )


class MetadataRecord(dict[str, str]):
    """Values of a metadata record by key; one that is missing is the fault of the file."""

    def __init__(self, name: str, values: Mapping[str, str]) -> None:
        super().__init__(values)
        self._name = name

    def __missing__(self, key: str) -> str:
        raise RecordingError(f"its metadata ({self._name}) lack {key}")
