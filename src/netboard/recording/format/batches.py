"""Batches of ticks: the columnar encoding in which a recording stores its ticks.

A batch stores its ticks by column, and each column by byte plane: the lowest byte of all values first, the highest
last. Similar bytes are then neighbours, which halves the compressed size, and decoding a column only moves bytes.
Before that, predictions are subtracted from the columns that follow from others
(`netboard.recording.format.predictions`), smooth columns are replaced by differences of first or higher order, and the
sign moves to the lowest bit. All this is done on the bits read as integers, so it is lossless, down to the payload of a
NaN.

While ticks are written, one in `PLOTTED_EVERY` also goes to the channel for viewers, and an index of attempts and
chunks is built. A reader can then find a trial without reading the whole recording.
"""

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from math import isfinite
from typing import Any

import msgpack
import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import waiting
from netboard.base.errors import RecordingError
from netboard.base.tick import TICK, TICK_NS, TICK_WORDS, joined
from netboard.recording.format.channels import IDS, PLOTTED, PLOTTED_EVERY, TICK_FIELDS, Payload, Stamped, unpack
from netboard.recording.format.claims import ATTEMPTS, LAYOUT, MAX_STAMP_NS, stored_json
from netboard.recording.format.decoding import MOST, SLOTS, Wanted, decode_batch, scratch
from netboard.recording.format.partfile import PartFile
from netboard.recording.format.predictions import CONSTANTS, PREDICTIONS, predict, require_known, uses
from netboard.recording.format.summary import Attempt, find_attempts, or_nan, or_null

ATTEMPTS_NAME = "netboard.attempts.json"
"""Attachment that lists the attempts."""

PLACES_NAME = "netboard.places"
"""Attachment that locates the ticks."""

PLACES = np.dtype([("chunk", "<i8"), ("first", "<i8"), ("last", "<i8"), ("count", "<i8")])
"""One chunk with ticks: its file offset, its first and last tick number, and its tick count."""

WORD = 8
"""Size of a word, in bytes [1]."""

_SHARE_OF_CHUNK = 0.75  # that a batch may take, which leaves room for its plotted ticks and other messages
_BITS = np.dtype("<i8")
_ORDERS = np.array([field.differences for field in TICK_FIELDS])
_DIFFERENCED = [np.flatnonzero(times < _ORDERS) for times in range(_ORDERS.max())]
"""Columns that each pass of differencing takes: those of first order and above, of second and above, and so on."""

_HEAD = 512
"""Bytes of a message in which its columns begin, if they come last [1]."""
_COUNT = struct.Struct(">I")
_COLUMNS_LAST, _NO_COLUMNS = (msgpack.packb("columns") + value for value in (b"\xc6", b"\xc0"))  # bytes, or none

_KEYS = ("phase", "trial", "attempt")
_PLOTTED_NAMES = [field.name for field in PLOTTED]
_PLOTTED_TEXTS = [f'"{field.name}":{"%d" if field.kind == "integer" else "%.7g"}' for field in PLOTTED]


def _plotted(values: Sequence[float]) -> bytes:
    """Return the plotted values of a tick as JSON, without those that are not finite."""
    known = (text % value for text, value in zip(_PLOTTED_TEXTS, values, strict=True) if isfinite(value))
    return f"{{{','.join(known)}}}".encode()


def pack(rows: NDArray[Any], constants: Mapping[str, float]) -> bytes:
    """Encode ticks as the columns of a batch. ``constants``: numbers that predictions use."""
    words = rows.view(_BITS).reshape(len(rows), len(TICK_FIELDS)).T.copy()
    columns = {field.name: column.view(TICK[field.name]) for field, column in zip(TICK_FIELDS, words, strict=True)}
    residuals = words.copy()
    for name, guess in predict(PREDICTIONS, columns, constants, np.zeros(1, np.int64)):
        residuals[TICK_WORDS[name]] -= guess
    for smooth in _DIFFERENCED:
        residuals[smooth, 1:] = np.diff(residuals[smooth], axis=1)
    folded = (residuals << 1) ^ (residuals >> 63)
    return folded.view(np.uint8).reshape(*folded.shape, WORD).transpose(0, 2, 1).tobytes()


@waiting
def unpack_columns(
    planes: NDArray[np.uint8],
    places: NDArray[np.int64],
    orders: NDArray[np.int64],
    folded: bool,
    words: NDArray[np.int64],
    first: int,
) -> None:
    """Decode some columns of a batch: join their byte planes, unfold the signs, and undo the differences.

    ``planes``: uint8 of shape (columns, WORD, n). ``places``: the k columns to read. ``orders``: how often each was
    differenced. ``words``: int64 of shape (k, m), where they are written from ``first`` on.
    """
    count = planes.shape[2]
    for c in range(len(places)):
        p = planes[places[c]]
        b0, b1, b2, b3, b4, b5, b6, b7 = p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7]
        column = words[c, first : first + count]
        for k in range(count):
            # Written out, so that the compiler joins several words at a time.
            word = np.uint64(b0[k]) | np.uint64(b1[k]) << np.uint64(8)
            word |= np.uint64(b2[k]) << np.uint64(16) | np.uint64(b3[k]) << np.uint64(24)
            word |= np.uint64(b4[k]) << np.uint64(32) | np.uint64(b5[k]) << np.uint64(40)
            word |= np.uint64(b6[k]) << np.uint64(48) | np.uint64(b7[k]) << np.uint64(56)
            if folded:
                word = (word >> np.uint64(1)) ^ (np.uint64(0) - (word & np.uint64(1)))
            column[k] = np.int64(word)
        for _ in range(orders[c]):
            total = column[0]
            for k in range(1, count):
                total += column[k]
                column[k] = total


def _columns_apart(message: Payload) -> dict[str, Any] | None:
    """Decode a message whose columns come last, and leave them where they are; None for any other message."""
    head = bytes(message[:_HEAD])
    place = head.find(_COLUMNS_LAST)
    start = place + len(_COLUMNS_LAST) + _COUNT.size
    if place < 0 or start > len(head):
        return None
    try:
        values = unpack(head[:place] + _NO_COLUMNS)
    except RecordingError:  # the mark was within something else
        return None
    (size,) = _COUNT.unpack_from(head, start - _COUNT.size)
    return values | {"columns": memoryview(message)[start:]} if start + size == len(message) else None


class BatchLayout:
    """Column layout of the batches in a file, and their decoder."""

    def __init__(self, schema: bytes) -> None:
        described = stored_json(LAYOUT, schema, "the schema of its ticks")
        columns = described.columns
        self._names = [column.name for column in columns]
        self._orders = np.array([column.differences for column in columns], np.int64)
        self._kinds = {column.name: np.dtype(column.type) for column in columns}
        self._constants = tuple(described.constants)
        if len(set(self._names) | set(self._constants)) != len(columns) + len(self._constants):
            raise RecordingError("the schema of its ticks has two columns or constants of one name")
        if "tick" not in self._kinds:
            raise RecordingError("the schema of its ticks has no column tick")
        self._predictions = require_known(described.predictions, (*self._names, *self._constants))
        self._folded = described.folded
        # Else a file of another version, whose predictions numpy evaluates.
        self._is_compiled = (
            self._folded
            and self._constants == CONSTANTS
            and list(self._predictions.items()) == list(PREDICTIONS.items())
            and set(self._names) == set(TICK.names or ())
        )
        self._known: dict[tuple[str, ...], Wanted] = {}
        for name, kind in self._kinds.items():
            if name in (TICK.names or ()) and kind != TICK[name]:
                raise RecordingError(f"its column {name} has the type {kind.str}, expected {TICK[name].str}")

    def __len__(self) -> int:
        """Return the number of columns."""
        return len(self._names)

    def fits(self, message: Payload) -> bool:
        """Return whether a batch has as many columns as this layout."""
        values = unpack(message)
        data, count = values.get("columns"), values.get("count")
        return isinstance(data, bytes) and type(count) is int and len(data) == len(self._names) * WORD * count

    def decode(self, messages: Sequence[Payload], names: Sequence[str]) -> dict[str, NDArray[Any]]:
        """Decode columns of some batches; a column that the file does not have is zero."""
        batches = [self._batch(message) for message in messages]
        counts = np.array([planes.shape[2] for planes, _ in batches], np.int64)
        if self._is_compiled and max(counts, default=0) <= MOST:
            return self._decode_compiled(batches, int(counts.sum()), tuple(names))
        needed = self._needed(names)
        there = np.flatnonzero([name in needed for name in self._names])
        starts = np.cumsum(counts) - counts
        words = np.empty((len(there), counts.sum()), np.int64)
        for (planes, _), start in zip(batches, starts, strict=True):
            unpack_columns(planes, there, self._orders[there], self._folded, words, start)
        stored = [self._names[place] for place in there]
        columns = {name: column.view(self._kinds[name]) for name, column in zip(stored, words, strict=True)}
        predictions = {name: text for name, text in self._predictions.items() if name in needed}
        if predictions and batches:
            constants = self._spread([constants for _, constants in batches], counts)
            for name, guess in predict(predictions, columns, constants, starts):
                columns[name].view(np.int64)[:] += guess
        zero = np.zeros(int(counts.sum()), np.int64)
        return {name: columns[name] if name in columns else zero.view(TICK[name]) for name in names}

    def _decode_compiled(
        self, batches: Sequence[tuple[NDArray[np.uint8], list[float]]], count: int, names: tuple[str, ...]
    ) -> dict[str, NDArray[Any]]:
        """Decode columns of batches that together have a number of ticks."""
        wanted = self._wanted(names)
        columns, first = np.empty((len(names), count), np.int64), 0
        for planes, constants in batches:
            decode_batch(planes, wanted, np.array(constants), scratch.words, columns, first)
            first += planes.shape[2]
        return {name: column.view(TICK[name]) for name, column in zip(names, columns, strict=True)}

    def _wanted(self, names: tuple[str, ...]) -> Wanted:
        """Return what the compiled decoder needs to know of these columns."""
        if names in self._known:
            return self._known[names]
        needed = self._needed(names)
        places = np.flatnonzero([name in needed for name in self._names])
        slots = np.array([SLOTS[self._names[place]] for place in places], np.int64)
        predicted = np.array([name in needed for name in PREDICTIONS])
        outputs = np.array([SLOTS[name] for name in names], np.int64)
        return self._known.setdefault(names, Wanted(places, self._orders[places], slots, predicted, outputs))

    def _spread(self, constants: Sequence[list[float]], counts: NDArray[np.int64]) -> dict[str, Any]:
        """Return the constants by name: a number each if all batches have the same, or else one for each row."""
        if all(one == constants[0] for one in constants):
            return dict(zip(self._constants, map(np.float64, constants[0]), strict=True))
        return dict(zip(self._constants, np.repeat(constants, counts, axis=0).T, strict=True))

    def _needed(self, names: Sequence[str]) -> set[str]:
        """Return these columns, and everything from which they are predicted."""
        needed = set(names)
        for name in reversed(self._predictions):
            if name in needed:
                needed |= uses(self._predictions[name])
        return needed

    def _batch(self, message: Payload) -> tuple[NDArray[np.uint8], list[float]]:
        """Decompose a message into the byte planes of its columns, shape (columns, 8, n), and its constants."""
        values = _columns_apart(message) or unpack(message)
        data, count, constants = values.get("columns"), values.get("count"), values.get("constants", [])
        if (
            not isinstance(data, bytes | memoryview)
            or type(count) is not int
            or not len(data) == len(self._names) * WORD * count > 0
        ):
            raise RecordingError("a batch of ticks whose length contradicts its header")
        if not isinstance(constants, list) or [type(one) for one in constants] != [float] * len(self._constants):
            raise RecordingError("a batch of ticks whose constants contradict the schema")
        return np.frombuffer(data, np.uint8).reshape(len(self._names), WORD, count), constants


def attempt_values(attempt: Attempt) -> dict[str, Any]:
    """Convert an attempt to JSON values; NaN becomes None."""
    values = asdict(attempt)
    return values | {"completion": or_null(attempt.completion)}


def attempts_of(listed: bytes) -> tuple[Attempt, ...]:
    """Convert the JSON list of attempts back."""
    found = stored_json(ATTEMPTS, listed, "its list of attempts")
    return tuple(Attempt(**asdict(one) | {"completion": or_nan(one.completion)}) for one in found)


class TickStream:
    """Collects ticks into batches and writes them to a file, with the index of attempts and chunks.

    ``constants``: those of the block, for the predictions.
    """

    def __init__(self, file: PartFile, chunk_bytes: int, constants: dict[str, float]) -> None:
        self.last = -1
        self._file = file
        self._constants = constants
        # By default 550 ticks: more than those of a flush interval, which are then one batch in one chunk.
        self._most = max(1, int(chunk_bytes * _SHARE_OF_CHUNK) // TICK.itemsize)
        self._held: list[bytes] = []
        self._count = 0
        self._held_log_ns = 0
        self._places: list[tuple[int, int, int, int]] = []
        self._edges: list[NDArray[Any]] = []
        self._newest = np.empty(0, TICK)

    def add(self, row: bytes, log_time_ns: int) -> None:
        """Add a tick.

        Raises `RecordingError` if the row has the wrong length: server and logger have different versions.
        """
        if len(row) != TICK.itemsize:
            raise RecordingError(
                f"a tick record of {len(row)} bytes where {TICK.itemsize} are expected: "
                "server and logger are of different versions; install the same netboard on both"
            )
        self._hold(row, 1, int.from_bytes(row[:WORD], "little", signed=True), log_time_ns)

    def extend(self, rows: NDArray[Any], log_times_ns: NDArray[np.int64]) -> None:
        """Add ticks, each with its log time [ns]."""
        while len(rows):
            now = min(len(rows), self._most - self._count)
            self._hold(rows[:now].tobytes(), now, int(rows["tick"][now - 1]), int(log_times_ns[now - 1]))
            rows, log_times_ns = rows[now:], log_times_ns[now:]

    def _hold(self, rows: bytes, count: int, last: int, log_time_ns: int) -> None:
        """Keep the rows of at most a batch in memory, and write the batch once it is full."""
        self._held.append(rows)
        self._count += count
        self.last, self._held_log_ns = last, log_time_ns
        if self._count >= self._most:
            self.close_batch()

    def close_batch(self) -> None:
        """Write the ticks in memory, if any, to the file as a batch."""
        if not self._held:
            return
        rows = np.frombuffer(b"".join(self._held), TICK)
        self._held.clear()
        self._count = 0
        first, time_ns, log_ns = int(rows["tick"][0]), int(rows["time_ns"][0]), self._held_log_ns
        columns = pack(rows, self._constants)
        values = {
            "first": first,
            "time_ns": time_ns,
            "count": len(rows),
            "constants": [self._constants[name] for name in CONSTANTS],
            "columns": columns,
        }
        chunk = self._file.add(IDS["/ticks"], Stamped("/ticks", first, time_ns, msgpack.packb(values)), log_ns)
        self._note_place(chunk, first, int(rows["tick"][-1]), len(rows))
        for row in rows[rows["tick"] % PLOTTED_EVERY == 0]:
            self._plot(row, log_ns)
        self._keep_edges(rows)

    def _note_place(self, chunk: int, first: int, last: int, count: int) -> None:
        """Note the chunk of a batch; batches of one chunk share a row."""
        if self._places and self._places[-1][0] == chunk:
            _, first, _, before = self._places.pop()
            count += before
        self._places.append((chunk, first, last, count))

    def _plot(self, row: Any, newest_ns: int) -> None:
        """Write a row for viewers. ``newest_ns``: log time of the newest tick [ns]."""
        tick = int(row["tick"])
        stamp = Stamped("/plot", tick, int(row["time_ns"]), _plotted(row[_PLOTTED_NAMES].tolist()))
        # By its number: across a stall of the server, tick times differ by more than the log times do.
        log_time_ns = newest_ns - (self.last - tick) * TICK_NS
        self._file.add(IDS["/plot"], stamp, min(max(log_time_ns, 0), MAX_STAMP_NS))

    def _keep_edges(self, rows: NDArray[Any]) -> None:
        """Keep the first and last tick of each phase, from which the attempts are derived."""
        both = joined((self._newest, rows))
        changed = np.zeros(len(both) - 1, bool)
        for name in _KEYS:
            changed |= both[name][1:] != both[name][:-1]
        at = np.flatnonzero(changed)
        kept = np.unique(np.concatenate([at, at + 1] if len(self._newest) else [[0], at, at + 1]))
        self._edges.append(both[kept])
        self._newest = both[-1:]

    def attempts(self) -> tuple[Attempt, ...]:
        """Return every attempt at a trial so far."""
        return find_attempts(joined((*self._edges, self._newest)))

    def finish(self, log_time_ns: int) -> None:
        """Attach the list of attempts and the locations of the ticks."""
        self.close_batch()
        self._file.close_chunk()
        listed = json.dumps([attempt_values(attempt) for attempt in self.attempts()]).encode()
        self._file.add_attachment(ATTEMPTS_NAME, "application/json", listed, log_time_ns)
        places = np.array(self._places, PLACES).tobytes()
        self._file.add_attachment(PLACES_NAME, "application/octet-stream", places, log_time_ns)
