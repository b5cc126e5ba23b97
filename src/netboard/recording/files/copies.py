"""Finds recordings of the same ticks, whatever their files are called: each trial must count once.

A recording is a copy if all its ticks are in another one, equal to the bit, and it does not claim to be of another
session: a file under two names, a recovered or re-imported recording beside its original, a block that two loggers
recorded. Two recordings that claim to be the same part of a block and have different ticks are a conflict: only a
person can tell which one is right. What agents reported later may differ, and so may the bits of a NaN, of which a
table of text has only one.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.errors import RecordingError
from netboard.base.tick import TICK
from netboard.recording.files.reader import FILLED, Recording

_COMPARED = tuple(name for name in TICK.names or () if name not in FILLED)
_PORTION = 50_000
"""Ticks that are compared at a time [1]."""

_HEAD = 256
"""Ticks that are compared first, and kept in memory [1]."""

Described = tuple[Path, Mapping[str, str]]
"""A recording with its metadata."""


@dataclass(frozen=True, slots=True)
class Copy:
    """A recording whose ticks are all in another one."""

    path: Path
    of: Path
    why: str

    def __str__(self) -> str:
        """Return a sentence about it."""
        return f"{self.path}: {self.about(self.of)}"

    def about(self, of: Path | str) -> str:
        """Return what it is, with the given name of the other one."""
        return f"is a copy of {of} ({self.why}), so its trials count once"


@dataclass(frozen=True, slots=True)
class Conflict:
    """Two recordings that claim to be the same one, and are not."""

    one: Path
    other: Path
    why: str

    def __str__(self) -> str:
        """Return a sentence about it."""
        return f"{self.one} and {self.other}: {self.why}; keep the right one and move the other away"


class CopiesFound(NamedTuple):
    """The copies and conflicts among recordings."""

    copies: tuple[Copy, ...]
    conflicts: tuple[Conflict, ...]


NO_REPEATS = CopiesFound((), ())


class _Relation(NamedTuple):
    """What the ticks of two recordings have in common."""

    common: int
    equal: int
    differs_at: int | None  # first common tick that differs; None if all are equal

    @property
    def mostly_equal(self) -> bool:
        """Whether most of the common ticks are equal."""
        return 2 * self.equal > self.common

    def with_later(self, later: "_Relation") -> "_Relation":
        """Return the relation with that of the ticks that follow."""
        at = later.differs_at if self.differs_at is None else self.differs_at
        return _Relation(self.common + later.common, self.equal + later.equal, at)


_NOTHING = _Relation(0, 0, None)


class _Candidate:
    """A recording that is compared with others; opened only if it has to be."""

    def __init__(self, place: int, path: Path, metadata: Mapping[str, str]) -> None:
        self.place, self.path, self.metadata = place, path, metadata

    @property
    def block(self) -> tuple[str, ...]:
        """Session and block that it claims to be of; empty if it does not know them."""
        known = tuple(self.metadata.get(key, "") for key in ("session", "block", "config_sha256"))
        return known if all(known[:2]) and known[0] != "unknown" else ()

    @property
    def part(self) -> str:
        """Part of the block that it claims to be."""
        return self.metadata.get("part", "")

    @property
    def is_derived(self) -> bool:
        """Whether it may be a copy of a recording of another session: an imported table of ticks, or lost metadata."""
        return self.metadata.get("imported") == "ticks" or not self.block

    @cached_property
    def identity(self) -> tuple[int, int]:
        """Device and number of its file."""
        status = self.path.stat()
        return status.st_dev, status.st_ino

    @cached_property
    def summary(self) -> tuple[int, range, bool, bool]:
        """Its number of ticks, their range, and whether it was recovered, and is incomplete."""
        with Recording(self.path) as recording:
            ended = recording.end.get("ended") == "complete"
            return recording.counts["/ticks"], recording.tick_range, bool(recording.recovery), not ended

    @cached_property
    def head(self) -> NDArray[Any]:
        """Its first ticks."""
        with Recording(self.path) as recording:
            first = recording.tick_range.start
            return recording.ticks(first, first + _HEAD, as_sent=True)

    @property
    def rank(self) -> tuple[bool, int, bool, bool, int]:
        """Key that sorts the one to keep first: of the same ticks, the original."""
        count, _, recovered, incomplete = self.summary
        return self.is_derived, -count, recovered, incomplete, self.place

    def why(self, of: "_Candidate") -> str:
        """Return how it became a copy."""
        if self.identity == of.identity:
            return "the same file under another name"
        if "imported_from" in self.metadata:
            return f"imported from {self.metadata['imported_from']}, with the same ticks"
        if self.summary[2]:
            return "recovered, with the same ticks"
        return "two loggers recorded the same ticks" if self.part != of.part else "with the same ticks"


def find_repeats(recordings: Iterable[Described]) -> CopiesFound:
    """Find the copies and conflicts among recordings, from their paths and metadata.

    A recording whose ticks cannot be read is left to the reader that needs them.
    """
    candidates = [_Candidate(place, *one) for place, one in enumerate(recordings)]
    copies: dict[Path, Copy] = {}
    conflicts: list[Conflict] = []
    for pair in combinations(candidates, 2):
        if _is_candidate(*pair) and not any(one.path in copies for one in pair):
            found = _compared_if_readable(*pair)
            if isinstance(found, Copy):
                copies[found.path] = found
            elif found is not None:
                conflicts.append(found)
    kept = [one for one in conflicts if not copies.keys() & {one.one, one.other}]
    return CopiesFound(tuple(copies[one.path] for one in candidates if one.path in copies), tuple(kept))


def _is_candidate(one: _Candidate, other: _Candidate) -> bool:
    """Return whether one may be a copy of the other, from what is known without opening them."""
    if one.is_derived or other.is_derived or one.block == other.block:
        return True
    imported = "imported" in one.metadata or "imported" in other.metadata
    return imported and one.metadata.get("config_sha256") == other.metadata.get("config_sha256")


def _compared_if_readable(one: _Candidate, other: _Candidate) -> Copy | Conflict | None:
    """Compare two recordings; None also if one cannot be read."""
    try:
        return _compared(*sorted((one, other), key=lambda candidate: candidate.rank))
    except (RecordingError, OSError):
        return None


def _compared(better: _Candidate, other: _Candidate) -> Copy | Conflict | None:
    """Compare two recordings, that to keep first."""
    if better.identity == other.identity:
        return Copy(other.path, better.path, other.why(better))
    relation = _relation(better, other)
    for outer, inner in ((better, other), (other, better)):
        if relation.differs_at is None and relation.common == inner.summary[0] > 0:
            return Copy(inner.path, outer.path, inner.why(outer))
    one, two = (part.path for part in sorted((better, other), key=lambda part: part.place))
    claims_same = bool(better.block) and (better.block, better.part) == (other.block, other.part)
    if relation.differs_at is not None:
        if claims_same:
            return Conflict(one, two, f"claim to be the same part of a block, and differ at tick {relation.differs_at}")
        if other.is_derived and relation.mostly_equal:
            why = f"have {relation.equal} ticks in common, and others differ, from tick {relation.differs_at} on"
            return Conflict(one, two, why)
    elif claims_same and relation.common:
        why = f"have {relation.common} ticks of the same part of a block in common, and each has others"
        return Conflict(one, two, why)
    return None  # a logger that was restarted repeats the last ticks of the part before


def _relation(one: _Candidate, other: _Candidate) -> _Relation:
    """Compare the ticks that two recordings have in common; only the first ones, if most of these differ."""
    ranges = one.summary[1], other.summary[1]
    first, stop = max(part.start for part in ranges), min(part.stop for part in ranges)
    relation = _common(one.head, other.head)
    if first >= stop or (relation.common and not relation.mostly_equal):
        return relation
    relation = _NOTHING
    with ExitStack() as stack:
        opened = [stack.enter_context(Recording(part.path)) for part in (one, other)]
        for begin in range(first, stop, _PORTION):
            end = min(begin + _PORTION, stop)
            relation = relation.with_later(_common(*(part.ticks(begin, end, as_sent=True) for part in opened)))
    return relation


def _common(one: NDArray[Any], other: NDArray[Any]) -> _Relation:
    """Compare the rows with the same tick numbers."""
    numbers, ours, theirs = np.intersect1d(one["tick"], other["tick"], assume_unique=True, return_indices=True)
    differs = np.zeros(len(numbers), bool)
    for name in _COMPARED:
        a, b = one[name][ours], other[name][theirs]
        equal = a.view(np.int64) == b.view(np.int64)
        differs |= ~(equal | (np.isnan(a) & np.isnan(b))) if TICK[name].kind == "f" else ~equal
    at = np.flatnonzero(differs)
    return _Relation(len(numbers), len(numbers) - len(at), int(numbers[at[0]]) if len(at) else None)


def original_of(path: Path, others: Iterable[Path]) -> Path | None:
    """Return the one of other files that has all ticks of a recording; None if there is none, or it cannot be read."""
    one, *rest = (_Candidate(place, *described) for place, described in enumerate(_readable((path, *others))))
    for other in rest:
        if _is_candidate(one, other):
            found = _compared_if_readable(one, other)
            if isinstance(found, Copy) and found.path == path:
                return found.of
    return None


def repeats_among(paths: Iterable[Path]) -> CopiesFound:
    """Find the copies and conflicts among files, of which some may be unreadable."""
    return find_repeats(_readable(paths))


def _readable(paths: Iterable[Path]) -> Iterator[Described]:
    for path in paths:
        try:
            with Recording(path) as recording:
                yield path, recording.metadata
        except RecordingError:
            continue


def each_recording_once(paths: Sequence[Path]) -> tuple[tuple[Path, ...], tuple[Copy, ...]]:
    """Return the recordings without copies, and the copies; raises `RecordingError` if two are in conflict."""
    found = repeats_among(paths)
    for conflict in found.conflicts:
        raise RecordingError(str(conflict))
    left_out = {copy.path for copy in found.copies}
    return tuple(path for path in paths if path not in left_out), found.copies
