"""Assembles the pieces of a damaged or wrongly joined file into recordings.

A file may hold a recording twice, parts of it twice, or several recordings one after the other. A recording is known by
its metadata: session, block and part, and when it was opened. A piece without them belongs to a recording if all ticks
that both have are equal to the bit, or, without a common tick, if it directly follows and nothing contradicts: its
clock, the time of its block, and the number of its records. Otherwise it is a recording of its own. So no tick is
taken twice, none is taken into another recording, and none is lost.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Attachment
from numpy.typing import NDArray

from netboard.base.errors import RecordingError
from netboard.base.tick import TICK
from netboard.recording.files.provenance import MetadataName
from netboard.recording.format.channels import IDS
from netboard.recording.format.claims import MAX_JOINED, SearchEffort, whole_number
from netboard.recording.format.sequence import EVIDENCE, NUMBERED, Excerpt, contradiction, excerpt_of
from netboard.recording.recovery.chunk_reader import RECOVERABLE, ChunkReader, Listed, digest, same_bits
from netboard.recording.recovery.scan import Damage, Data, FilePiece, scan

_NUMBERED = frozenset(IDS[topic] for topic in NUMBERED)

_IDENTITY = ("session", "block", "part", "opened_log_ns")
"""Metadata by which a recording is known."""


class Stretch:
    """Consecutive chunks of a piece with rising tick numbers, or a piece without chunks."""

    def __init__(self, piece: FilePiece, reader: ChunkReader, listed: Sequence[Listed]) -> None:
        self.piece, self.reader, self.listed = piece, reader, listed
        self._starts = np.cumsum([0, *(len(one.numbers) for one in listed)])

    @cached_property
    def numbers(self) -> NDArray[np.int64]:
        """Numbers of its ticks."""
        return self._column("tick")

    def _column(self, name: str) -> NDArray[np.int64]:
        return np.concatenate([np.empty(0, np.int64), *(one.columns[name] for one in self.listed)])

    @cached_property
    def excerpt(self) -> Excerpt | None:
        """What its ticks say of clock and block; None without ticks."""
        if not len(self.numbers):
            return None
        offsets = [one.offset_ns for one in self.listed if one.offset_ns is not None]
        return excerpt_of({name: self._column(name) for name in EVIDENCE}, offsets)

    @cached_property
    def noted(self) -> dict[tuple[int, int], bytes]:
        """Digest of each message with a number of its own, by channel and number."""
        return {
            (entry.channel_id, entry.sequence): digest(entry)
            for one in self.listed
            for entry in self.reader.entries(one.chunk)
            if entry.channel_id in _NUMBERED
        }

    def rows_of(self, numbers: NDArray[np.int64]) -> NDArray[Any]:
        """Return the ticks with these numbers, which it has."""
        at = np.searchsorted(self.numbers, numbers)
        chunk = np.searchsorted(self._starts, at, side="right") - 1
        rows = np.empty(len(numbers), TICK)
        for k in np.unique(chunk):
            rows[chunk == k] = self.reader.rows(self.listed[k].chunk).ticks[at[chunk == k] - self._starts[k]]
        return rows


@dataclass(eq=False)
class FoundRecording:
    """One of the recordings in a file."""

    stretches: list[Stretch] = field(default_factory=list)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    configs: list[Attachment] = field(default_factory=list)
    damage: list[Damage] = field(default_factory=list)
    has_header: bool = False
    finished: bool = False
    conflict: bool = False  # whether another one in the file has the same metadata and different ticks

    @property
    def opened(self) -> dict[str, str]:
        """The metadata with which it was opened; empty if they are lost."""
        return self.metadata.get(MetadataName.OPENED, {})

    @property
    def version(self) -> str:
        """Its format version, as found."""
        return self.stretches[0].reader.version

    @property
    def numbers(self) -> NDArray[np.int64]:
        """Numbers of all ticks in file order; some may be there several times."""
        return np.concatenate([stretch.numbers for stretch in self.stretches])

    @property
    def again(self) -> NDArray[np.int64]:
        """Numbers of the ticks that the file has once more, each as often as it has them."""
        numbers = self.numbers
        repeated = np.delete(numbers, np.unique(numbers, return_index=True)[1])
        return np.concatenate([repeated, *(one.again for stretch in self.stretches for one in stretch.listed)])

    def add(self, stretch: Stretch, *, with_records: bool) -> None:
        """Add a stretch; ``with_records``: and what its piece has outside chunks."""
        self.stretches.append(stretch)
        if with_records:
            piece = stretch.piece
            self.has_header |= piece.has_header
            self._add(piece.metadata, [piece.config] if piece.config else [], piece.damage, piece.finished)

    def absorb(self, other: "FoundRecording") -> None:
        """Take over all of another one, which has the same ticks."""
        self.stretches += other.stretches
        self._add(other.metadata, other.configs, other.damage, other.finished)

    def _add(
        self, metadata: dict[str, dict[str, str]], configs: list[Attachment], damage: list[Damage], finished: bool
    ) -> None:
        self.metadata = {**metadata, **self.metadata}
        self.configs += configs
        self.damage += damage
        self.finished |= finished


class _Comparison:
    """Comparison of a stretch with a recording."""

    def __init__(self, found: FoundRecording, stretch: Stretch) -> None:
        self._found, self._stretch = found, stretch
        self.differs = False  # whether anything that both have is not the same
        self._shares_ticks = shares_messages = False
        for one in found.stretches:
            common = one.noted.keys() & stretch.noted.keys()
            shares_messages |= bool(common)
            self.differs |= any(one.noted[key] != stretch.noted[key] for key in common)
            if _reach_each_other(one, stretch):
                self._compare_ticks(one)
        self.overlaps = self._shares_ticks or (shares_messages and not self._contradicts)

    def _compare_ticks(self, one: Stretch) -> None:
        """Compare the ticks that both have, a chunk at a time."""
        for part in self._stretch.listed:
            shared = part.numbers[np.isin(part.numbers, one.numbers)]
            self._shares_ticks |= bool(len(shared))
            if len(shared) and not self.differs:
                ours = self._stretch.reader.rows(part.chunk).ticks
                ours = ours[np.isin(ours["tick"], shared)]
                self.differs = not same_bits(ours, one.rows_of(shared))

    @property
    def follows(self) -> bool:
        """Whether the stretch can be of the recording, although they have nothing in common."""
        records = self._found.metadata | self._stretch.piece.metadata
        return not (self._found.finished or self._contradicts or _miscounts(records))

    @property
    def _contradicts(self) -> bool:
        """Whether clock or block of their ticks, of which they share none, are not those of one recording."""
        ours = self._stretch.excerpt
        excerpts = [one.excerpt for one in self._found.stretches if one.excerpt is not None]
        return ours is not None and any(contradiction(ours, theirs) for theirs in excerpts)


def _reach_each_other(one: Stretch, other: Stretch) -> bool:
    """Return whether the ranges of two stretches overlap."""
    if not (len(one.numbers) and len(other.numbers)):
        return False
    return bool(one.numbers[0] <= other.numbers[-1] and other.numbers[0] <= one.numbers[-1])


def _miscounts(metadata: dict[str, dict[str, str]]) -> bool:
    """Return whether the records that a file states at its end are not those from its first one on."""
    first, end = metadata.get(MetadataName.FIRST, {}), metadata.get(MetadataName.END, {})
    if "record" not in first or not {"records", "lost", "next_record"} <= end.keys():
        return False
    return int(end["next_record"]) - int(first["record"]) != int(end["records"]) + int(end["lost"])


def assemble(path: Path, data: Data) -> list[FoundRecording]:
    """Return the recordings in a file, that with which it begins first; none if it is no MCAP file.

    Raises `RecordingError` if ticks of several recordings cannot be told apart.
    """
    return _Assembly(path, data).recordings


class _Assembly:
    """The recordings in a file while its pieces are read."""

    def __init__(self, path: Path, data: Data) -> None:
        pieces = scan(data, SearchEffort(path, len(data)))
        opened = [piece.metadata[MetadataName.OPENED] for piece in pieces if MetadataName.OPENED in piece.metadata]
        self._version = opened[0].get("format", "") if opened else ""
        self._data = data
        self._found: list[FoundRecording] = []
        self._last: FoundRecording | None = None  # to which the piece before belongs
        self._begins = False  # whether a recording has begun since, of which nothing is readable yet
        self._before: list[Damage] = []  # damage before the first recording
        for piece in pieces:
            self._take(piece)
        self._join_nameless()
        if pieces and not self._found:  # the beginning of a file, without a record
            self._new().add(Stretch(pieces[0], ChunkReader(data, self._version), []), with_records=False)
        self.recordings = sorted(self._found, key=lambda found: not (found.opened and len(found.numbers)))
        if self.recordings:
            self.recordings[0].damage[:0] = self._before

    def _take(self, piece: FilePiece) -> None:
        """Add a piece to the recordings."""
        self._begins |= piece.begins
        if not piece.holds_records:
            (self._last.damage if self._last else self._before).extend(piece.damage)
            return
        for number, stretch in enumerate(self._stretches(piece)):
            named = number == 0 and MetadataName.OPENED in piece.metadata
            found = self._named(stretch) if named else self._nameless(stretch)
            self._begins = False
            if found is None:
                why = "outside chunks of another recording, whose ticks are not there"
                piece.damage.insert(0, Damage(piece.start, piece.stop - piece.start, why))
                self._take(replace(piece, metadata={}, config=None, finished=False))
                return
            found.add(stretch, with_records=number == 0)
            self._last = found

    def _stretches(self, piece: FilePiece) -> Iterator[Stretch]:
        """Split a piece where its tick numbers fall."""
        version = piece.metadata.get(MetadataName.OPENED, {}).get("format", self._version)
        if whole_number(version) is not None and version not in RECOVERABLE:
            raise RecordingError(
                f"has format version {version}, this netboard recovers versions {', '.join(RECOVERABLE)}"
            )
        # An invalid version is damage like any other.
        reader = ChunkReader(self._data, version)
        listed: list[Listed] = []
        last: int | None = None
        for chunk in piece.chunks:
            one = reader.listed(chunk)
            if len(one.numbers):
                if last is not None and one.numbers[0] <= last:
                    yield Stretch(piece, reader, listed)
                    listed = []
                last = int(one.numbers[-1])
            listed.append(one)
        yield Stretch(piece, reader, listed)

    def _named(self, stretch: Stretch) -> FoundRecording:
        """Return the recording that a stretch says it belongs to, or a new one."""
        opened = stretch.piece.metadata[MetadataName.OPENED]
        same = [found for found in self._found if _same_identity(found.opened, opened)]
        for found in same:
            if not _Comparison(found, stretch).differs:
                return found
        return self._new(conflict=bool(same))

    def _nameless(self, stretch: Stretch) -> FoundRecording | None:
        """Return the recording to which a stretch without metadata of its own belongs, perhaps a new one.

        None for records outside chunks that belong to none.
        """
        for found in sorted(self._found, key=lambda one: one is not self._last):
            seen = _Comparison(found, stretch)
            follows = found is self._last and not self._begins
            if not seen.differs and (seen.overlaps or (follows and seen.follows)):
                return found
        if self._last is not None and not stretch.listed:
            return None
        if self._last is not None and not all(one.rising for one in stretch.listed):
            raise RecordingError(
                "has ticks of several recordings in one chunk, which cannot be told apart; recover the file from "
                "which an older netboard made it"
            )
        return self._new()

    def _new(self, *, conflict: bool = False) -> FoundRecording:
        if len(self._found) == MAX_JOINED:
            raise RecordingError(f"claims to hold more than {MAX_JOINED} recordings; it is not recovered")
        self._found.append(FoundRecording(conflict=conflict))
        return self._found[-1]

    def _join_nameless(self) -> None:
        """Join each recording without metadata to the one that has ticks of all its stretches, if there is one."""
        for nameless in [found for found in self._found if not found.opened]:
            for found in self._found:
                seen = [_Comparison(found, stretch) for stretch in nameless.stretches] if found.opened else []
                if seen and all(one.overlaps and not one.differs for one in seen):
                    found.absorb(nameless)
                    self._found.remove(nameless)
                    break


def _same_identity(one: dict[str, str], other: dict[str, str]) -> bool:
    """Return whether two recordings were opened as the same one, as far as their metadata are known."""
    known = [key for key in _IDENTITY if key in one and key in other]
    return "session" in known and all(one[key] == other[key] for key in known)
