"""Reads a finished recording: metadata, configuration, and its streams as arrays and records.

Ticks without a sample are filled in from what the agents reported later (`netboard.recording.format.backfill`), unless
the caller asks for the ticks as they were sent.

A file that is unfinished, damaged or of an unknown format version raises a `RecordingError` that says what is wrong and
what to do. The checksum of a chunk is verified when the chunk is read.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from pathlib import Path
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import SIDES, Config, parse
from netboard.base.errors import RecordingError
from netboard.base.tick import ROW_BYTES, TICK
from netboard.network.protocol.records import BackfillRecord, ClockRecord, EventRecord, FrameRecord
from netboard.recording.files.container import Container
from netboard.recording.files.locate import recovery_advice, repair_advice
from netboard.recording.files.provenance import CONFIG_NAME, SEQUENCE, MetadataName, config_sha256, damaged_numbers
from netboard.recording.format import older
from netboard.recording.format.backfill import Backfilled
from netboard.recording.format.batches import ATTEMPTS_NAME, PLACES, PLACES_NAME, WORD, BatchLayout, attempts_of
from netboard.recording.format.channels import FORMAT_VERSION, IDS, TICKS, read_record
from netboard.recording.format.chunks import payloads_of
from netboard.recording.format.claims import MAX_WHOLE, shown
from netboard.recording.format.partfile import PROFILE
from netboard.recording.format.sequence import EVIDENCE, NUMBERED, misnumbered, misplaced, misplaced_chunk, several
from netboard.recording.format.summary import Attempt, Gap, find_attempts, find_gaps

_ROW_BY_ROW = ("1", "2")
"""Format versions with one message for each tick."""

READABLE = (*_ROW_BY_ROW, "3", FORMAT_VERSION)
"""Format versions that this module reads."""

_PORTION = 60_000
_WORDS = np.dtype("<i8")

_THREADS = 2
_MIN_SHARE, _MAX_SHARE = 8, 24
"""Threads that decode batches, and the least and the most batches that one takes at a time [1]."""

T = TypeVar("T", EventRecord, ClockRecord, FrameRecord, BackfillRecord)

EVENTS = "/event"

FILLED = tuple(f"{side}_{name}" for side in SIDES for name in ("rendered", "safeguards"))
_FILLING = (*FILLED, "time_ns")


class Recording:
    """A finished recording, open for reading. Use it in a ``with`` statement.

    Parameters
    ----------
    path : Path or str
        The file.

    Attributes
    ----------
    path : Path
        Path of the file, as given.
    metadata : dict of str
        Metadata on session, software and computer.
    end : dict of str
        How the recording ended; empty for a recovered file that has no end record.
    recovery : dict of str
        What was and was not recovered; empty for an original file.
    first_record : int or None
        Log-channel number of the first record; None if there is none [1].

    Raises
    ------
    RecordingError
        If the file is not one finished, undamaged recording of a known format: also if records are in it twice, or
        those of another recording.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self._file = Container(self.path)
        self._events_seen: dict[int, list[memoryview]] = {}  # of chunks that were read for their ticks, by offset
        try:
            self._open()
        except BaseException:
            self._file.close()
            raise

    def _open(self) -> None:
        records = self._file.metadata
        if self._file.profile != PROFILE or MetadataName.OPENED not in records:
            raise RecordingError(f"{self.path}: an MCAP file, but not a recording of netboard")
        self._file.require_index()
        for name, values in records.items():
            for key in damaged_numbers(name, values):
                raise RecordingError(
                    f"{self.path}: is damaged (metadata {name}, {key}: found '{shown(values[key])}', expected a whole "
                    f"number); {recovery_advice(self.path)}"
                )
        self.metadata = records[MetadataName.OPENED]
        self.end = records.get(MetadataName.END, {})
        self.recovery = records.get(MetadataName.RECOVERY, {})
        first = records.get(MetadataName.FIRST, {}).get("record")
        self.first_record = None if first is None else int(first)
        self._version = self.metadata.get("format", "")
        if self._version not in READABLE:
            raise RecordingError(
                f"{self.path}: has format version {shown(self._version)}, this netboard reads versions "
                f"{', '.join(READABLE)}; read it with netboard "
                f"{shown(self.metadata.get('netboard', 'of its own version'))}"
            )
        self._in_batches = self._version not in _ROW_BY_ROW
        self._config = self._file.attachment(CONFIG_NAME)
        if self._config is not None and config_sha256(self._config) != self.metadata.get("config_sha256"):
            raise RecordingError(f"{self.path}: its configuration is damaged; {recovery_advice(self.path)}")
        if self._file.attachment(PLACES_NAME) is not None:
            self._require_sequence(misplaced_chunk(self._places))
        if self.recovery and SEQUENCE not in self.recovery:
            self._require_sequence(several(self.columns(*EVIDENCE), self.events(), self.metadata, self.end))

    def _require_sequence(self, why: str) -> None:
        """Raise an error if there is a reason why the records are not one recording."""
        if why:
            raise RecordingError(
                f"{self.path}: is not one recording: {why}, so it has records twice, or those of another recording; "
                f"{repair_advice(self.path, self.recovery.get('source', ''))}"
            )

    def check(self) -> None:
        """Verify the checksum of the whole file, metadata included, if its writer stored one.

        Raises
        ------
        RecordingError
            If any bit has changed since the file was written.
        """
        self._file.check()

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    @property
    def config_text(self) -> str:
        """The resolved configuration as TOML, in the keys of this version.

        Raises
        ------
        RecordingError
            If the file was recovered and the configuration was lost.
        """
        if self._config is None:
            raise RecordingError(f"{self.path}: its configuration was lost when it was damaged, see its metadata")
        with self._file.sound():
            return older.config_of(self._config.decode(), self._version)

    @cached_property
    def config(self) -> Config:
        """The resolved configuration; the same errors as `config_text`, or ConfigError if it is invalid."""
        return parse(self.config_text, f"{self.path} (its configuration)")

    @cached_property
    def counts(self) -> dict[str, int]:
        """Number of ticks, and number of messages of the other streams, by topic [1]."""
        messages = self._file.counts
        others = {topic: messages.get(topic, 0) for topic in IDS if topic != TICKS}
        return {TICKS: int(self._places["count"].sum()), **others}

    @property
    def tick_range(self) -> range:
        """Tick numbers from the first tick to the last; some between may be missing."""
        places = self._places
        return range(int(places["first"][0]), int(places["last"][-1]) + 1) if len(places) else range(0)

    def ticks(self, first: int | None = None, stop: int | None = None, *, as_sent: bool = False) -> NDArray[Any]:
        """Return all ticks, or those in a range of tick numbers.

        Parameters
        ----------
        first : int, optional
            First tick number; by default the first tick of the recording [1].
        stop : int, optional
            Tick number after the last one; by default the end of the recording [1].
        as_sent : bool
            True: leave out what agents reported later.

        Returns
        -------
        ndarray of TICK, shape (n,)
            The rows, bit for bit as the server sent them, except for the filled-in values.
        """
        rows = self._rows(self._places_in(first, stop), as_sent=as_sent)
        wanted = _in_range(rows["tick"], rows["tick"], first, stop)
        return rows if wanted.all() else rows.view(ROW_BYTES)[wanted].view(TICK)

    def columns(self, *names: str, first: int | None = None, stop: int | None = None) -> dict[str, NDArray[Any]]:
        """Return columns of the ticks.

        Parameters
        ----------
        *names : str
            Fields of `netboard.base.tick.TICK`; none means all, returned as views of one table.
        first, stop : int, optional
            As in `ticks` [1].

        Returns
        -------
        dict of ndarray, shape (n,)
            The columns by name, in the units of `netboard.base.tick.TICK` [SI].

        Raises
        ------
        ValueError
            If a field does not exist.
        """
        if not names:
            rows = self.ticks(first, stop)
            return {name: rows[name] for name in TICK.names or ()}
        _refuse_unknown(names)
        fills = bool(self._backfilled and set(names) & set(FILLED))
        asked = dict.fromkeys((*names, "tick", *(_FILLING if fills else ())))
        found = self._read_columns(tuple(asked), self._places_in(first, stop))
        if fills and self._backfilled:
            self._backfilled.fill(found)
        wanted = _in_range(found["tick"], found["tick"], first, stop)
        return {name: found[name] if wanted.all() else found[name][wanted] for name in names}

    def batches(
        self, most: int = _PORTION, names: Sequence[str] = (), *, as_sent: bool = False
    ) -> Iterator[NDArray[Any]]:
        """Yield all ticks in order, one batch at a time, for recordings that do not fit into memory.

        Parameters
        ----------
        most : int
            Size of a batch in ticks; a batch may be slightly larger [1].
        names : sequence of str
            Fields of `netboard.base.tick.TICK` to read, which is faster than all; none means all.
        as_sent : bool
            True: leave out what agents reported later.

        Yields
        ------
        ndarray of TICK, shape (n,)
            The next rows, with the requested fields.

        Raises
        ------
        ValueError
            If a field does not exist.
        """
        _refuse_unknown(names)
        portions = np.cumsum(self._places["count"]) // most
        for portion in np.unique(portions):
            yield self._rows(self._places[portions == portion], names, as_sent=as_sent)

    def portions(self, names: Sequence[str]) -> Iterator[dict[str, NDArray[Any]]]:
        """Yield columns of all ticks as they were sent, in order, a few thousand ticks at a time.

        They are decoded in this thread alone: a process for each core reads faster without further threads.

        Parameters
        ----------
        names : sequence of str
            Fields of `netboard.base.tick.TICK`.

        Yields
        ------
        dict of ndarray, shape (n,)
            The next rows of the columns by name [SI].

        Raises
        ------
        ValueError
            If a field does not exist.
        """
        _refuse_unknown(names)
        for k in range(0, len(self._places), _MIN_SHARE):
            yield self._decoded(self._places[k : k + _MIN_SHARE], names)

    def attempts(self) -> tuple[Attempt, ...]:
        """Return every attempt at a trial, in order."""
        listed = self._file.attachment(ATTEMPTS_NAME)
        if listed is None:
            return find_attempts(self.ticks())
        with self._file.sound():
            found = attempts_of(listed)
            first, last = self._places["first"].min(initial=MAX_WHOLE), self._places["last"].max(initial=-1)
            if any(not first <= one.began <= one.tick < one.stop <= last + 1 for one in found):
                raise RecordingError("its list of attempts names ticks that it does not have")
            return found

    @cached_property
    def _places(self) -> NDArray[Any]:
        """Location of the ticks, one row for each batch (in older formats, for each chunk)."""
        listed = self._file.attachment(PLACES_NAME)
        if listed is not None:
            with self._file.sound():
                return self._checked_places(np.frombuffer(listed, PLACES))
        found = []
        for offset in self._file.chunks_with(TICKS if self._in_batches else older.TOPIC):
            numbers = self._decode([offset], ("tick",))["tick"]
            if len(numbers):
                found.append((offset, numbers[0], numbers[-1], len(numbers)))
        return np.array(found, PLACES)

    def _checked_places(self, places: NDArray[Any]) -> NDArray[Any]:
        """Return the list of places; refuse one that claims more ticks than its chunks have room for."""
        room = {chunk.chunk_start_offset: chunk.uncompressed_size for chunk in self._file.chunk_indexes}
        row = len(self._layout) * WORD
        numbers = range(MAX_WHOLE)
        before = -1
        for chunk, first, last, count in places.tolist():
            if chunk <= before or not 0 < count * row <= room.get(chunk, 0):
                raise RecordingError("its list of places contradicts its index")
            if first not in numbers or last not in numbers:
                raise RecordingError("its list of places has an impossible tick number")
            before = chunk
        return places

    def _places_in(self, first: int | None, stop: int | None) -> NDArray[Any]:
        """Return the locations of the batches that overlap a range of tick numbers."""
        return self._places[_in_range(self._places["first"], self._places["last"], first, stop)]

    @cached_property
    def _backfilled(self) -> Backfilled | None:
        """What agents reported later on ticks without a sample; None if they reported nothing."""
        records = self.backfills()
        with self._file.sound():
            return Backfilled(records) if records else None

    def _rows(self, places: NDArray[Any], names: Sequence[str] = (), *, as_sent: bool = False) -> NDArray[Any]:
        """Return the ticks at these locations, or the named fields of them."""
        backfilled = None if as_sent or (names and not set(names) & set(FILLED)) else self._backfilled
        if backfilled is None:
            return self._read_rows(places, names)
        rows = self._read_rows(places, tuple(dict.fromkeys((*names, *_FILLING))) if names else ())
        backfilled.fill(rows)
        return rows if not names else rows[list(names)].astype([(name, TICK[name]) for name in names])

    def _read_rows(self, places: NDArray[Any], names: Sequence[str] = ()) -> NDArray[Any]:
        """Return the ticks at these locations as they are stored."""
        kind = np.dtype([(name, TICK[name]) for name in names]) if names else TICK
        stored = kind.names or ()
        rows = np.zeros(int(places["count"].sum()), kind)
        words = rows.view(_WORDS).reshape(len(rows), len(stored))

        def put(at: slice, found: dict[str, NDArray[Any]]) -> None:
            # Row by row: written one by one, the columns would touch all memory once for each of them.
            words[at] = np.stack([column.view(_WORDS) for column in found.values()]).T

        self._read(stored, places, put)
        return rows

    def _read_columns(self, names: Sequence[str], places: NDArray[Any]) -> dict[str, NDArray[Any]]:
        columns = {name: np.zeros(int(places["count"].sum()), TICK[name]) for name in names}

        def put(at: slice, found: dict[str, NDArray[Any]]) -> None:
            for name, column in found.items():
                columns[name][at] = column

        self._read(names, places, put)
        return columns

    def _read(self, names: Sequence[str], places: NDArray[Any], put: Callable[[slice, Any], None]) -> None:
        """Decode columns of the ticks at these locations, a few batches at a time and in parallel.

        ``put``: called with the place of some ticks among all of them, and with their columns by name.
        """
        stops = np.cumsum(places["count"])
        share = min(max(_MIN_SHARE, -(-len(places) // _THREADS)), _MAX_SHARE)

        def work(k: int) -> None:
            found = self._decoded(part := places[k : k + share], names)
            stop = int(stops[k + len(part) - 1])
            put(slice(stop - int(part["count"].sum()), stop), found)

        with ThreadPoolExecutor(_THREADS) as pool:
            for _ in pool.map(work, range(0, len(places), share)):
                pass

    def _decoded(self, places: NDArray[Any], names: Sequence[str]) -> dict[str, NDArray[Any]]:
        """Decode columns of the ticks at these locations; refuse ticks that the list of places does not name."""
        with self._file.sound():
            found = self._decode(places["chunk"].tolist(), tuple(dict.fromkeys((*names, "tick"))))
            if any(len(column) != places["count"].sum() for column in found.values()):
                raise RecordingError(
                    f"{self.path}: its list of places contradicts the chunk at {int(places['chunk'][0])}"
                )
            self._require_sequence(misplaced(found["tick"], int(places["first"][0]), int(places["last"][-1])))
        return {name: found[name] for name in names}

    @cached_property
    def _layout(self) -> BatchLayout:
        with self._file.sound():
            return BatchLayout(self._file.schemas.get(TICKS, b""))

    def _decode(self, offsets: Sequence[int], names: Sequence[str]) -> dict[str, NDArray[Any]]:
        with self._file.sound():
            if self._in_batches:
                return self._layout.decode(
                    [message for offset in offsets for message in self._payloads(offset, TICKS)], names
                )
            messages = [message for offset in offsets for message in self._payloads(offset, older.TOPIC)]
            rows = older.ticks_of(messages, self._version)
        return {name: rows[name] for name in names}

    def _payloads(self, offset: int, topic: str) -> list[memoryview]:
        """Return the messages of a chunk on a topic; of a chunk with ticks, keep the events for later."""
        if topic == EVENTS and offset in self._events_seen:
            return self._events_seen[offset]
        topics = [one for one in dict.fromkeys((topic, EVENTS)) if one in self._file.channels]
        found = payloads_of(self._file.chunk(offset), [self._file.channels[one] for one in topics])
        by_topic = dict(zip(topics, found, strict=True))
        if topic != EVENTS and by_topic.get(EVENTS):
            self._events_seen[offset] = [memoryview(bytes(event)) for event in by_topic[EVENTS]]  # not the whole chunk
        return by_topic[topic]

    def events(self) -> tuple[EventRecord, ...]:
        """All events."""
        return self._events

    @cached_property
    def _events(self) -> tuple[EventRecord, ...]:
        return self._records(EVENTS, EventRecord)

    def clocks(self) -> tuple[ClockRecord, ...]:
        """All raw clock probes."""
        return self._records("/clock", ClockRecord)

    def frames(self) -> tuple[FrameRecord, ...]:
        """All frames that the displays have shown."""
        return self._records("/frame", FrameRecord)

    def backfills(self) -> tuple[BackfillRecord, ...]:
        """All reports of agents on ticks without a sample."""
        return self._records("/backfill", BackfillRecord) if "/backfill" in self._file.channels else ()

    def remarks(self) -> tuple[EventRecord, ...]:
        """All messages of the logger itself, above all ``log_lost``: records that it never received."""
        return self._records("/logger", EventRecord)

    def _records(self, topic: str, kind: type[T]) -> tuple[T, ...]:
        records: list[T] = []
        for offset in self._file.chunks_with(topic):
            with self._file.sound():
                records.extend(read_record(kind, message) for message in self._payloads(offset, topic))
        if topic in NUMBERED:
            self._require_sequence(misnumbered([record.seq for record in records], topic))
        return tuple(records)

    def chunk_times(self) -> NDArray[np.int64]:
        """Return log times of the first and last message in each chunk, in file order, shape (chunks, 2) [ns]."""
        times = [(one.message_start_time, one.message_end_time) for one in self._file.chunk_indexes]
        return np.array(times, np.int64).reshape(-1, 2)

    def gaps(self) -> dict[str, tuple[Gap, ...]]:
        """Return the missing sequence numbers of each stream with gaps, by topic (and station)."""
        numbers = {"/event": [event.seq for event in self.events()], "/clock": [clock.seq for clock in self.clocks()]}
        numbers["/backfill"] = [backfill.seq for backfill in self.backfills()]
        for frame in self.frames():
            numbers.setdefault(f"/frame {frame.station}", []).append(frame.seq)
        found = {TICKS: find_gaps(self.columns("tick")["tick"])}
        found |= {stream: find_gaps(np.array(seqs, np.int64)) for stream, seqs in numbers.items()}
        return {stream: gaps for stream, gaps in found.items() if gaps}


def _refuse_unknown(names: Sequence[str]) -> None:
    """Raise an error if a name is not a field of a tick."""
    if unknown := set(names) - set(TICK.names or ()):
        raise ValueError(f"ticks have no field {', '.join(sorted(unknown))}")


def _in_range(
    begins: NDArray[np.int64], ends: NDArray[np.int64], first: int | None, stop: int | None
) -> NDArray[np.bool_]:
    """Return whether spans of tick numbers, each from its begin to its end, overlap a range of them."""
    wanted = np.ones(len(begins), bool)
    if first is not None:
        wanted &= ends >= first
    if stop is not None:
        wanted &= begins < stop
    return wanted
