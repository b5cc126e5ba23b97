"""Batches of ticks: the columnar encoding in which a recording stores its ticks.

A batch stores its ticks by column, and each column by byte plane: the lowest byte of all values first, the highest
last. Similar bytes are then neighbours, which halves the compressed size, and decoding a column only moves bytes.
Before that, smooth columns are replaced by differences of first or higher order, taken on the bits read as integers.
The encoding is lossless, down to the payload of a NaN.

While ticks are written, one in `PLOTTED_EVERY` also goes to the channel for viewers, and an index of attempts and
chunks is built. A reader can then find a trial without reading the whole recording.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from math import isnan, nan
from typing import Any

import msgpack
import numpy as np
from numpy.typing import NDArray

from netboard.base.errors import RecordingError
from netboard.base.tick import TICK, TICK_NS
from netboard.recording.format.channels import IDS, PLOTTED, PLOTTED_EVERY, TICK_FIELDS, Stamped, unpack
from netboard.recording.format.partfile import PartFile
from netboard.recording.format.summary import Attempt, find_attempts

ATTEMPTS_NAME = "netboard.attempts.json"
"""Attachment that lists the attempts."""

PLACES_NAME = "netboard.places"
"""Attachment that locates the ticks."""

PLACES = np.dtype([("chunk", "<i8"), ("first", "<i8"), ("last", "<i8"), ("count", "<i8")])
"""One chunk with ticks: its file offset, its first and last tick number, and its tick count."""

_SHARE_OF_CHUNK = 0.75
_ROW_BYTES = np.dtype((np.void, TICK.itemsize))
_WORD = 8
_BITS = np.dtype("<i8")
_KEYS = ("phase", "trial", "attempt")


def pack(rows: NDArray[Any]) -> bytes:
    """Encode ticks as the columns of a batch."""
    words = words_of(rows).T.copy()
    for smooth in _rounds(_ORDERS):
        words[smooth, 1:] = np.diff(words[smooth], axis=1)
    return words.view(np.uint8).reshape(*words.shape, _WORD).transpose(0, 2, 1).tobytes()


def words_of(rows: NDArray[Any]) -> NDArray[np.int64]:
    """View ticks, or some of their fields, as 64-bit integers of shape (n, columns)."""
    return rows.view(_BITS).reshape(len(rows), rows.dtype.itemsize // _WORD)


def _joined(planes: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Join the byte planes of columns into 64-bit integers, pairwise in three steps (faster than bytewise)."""
    words: NDArray[Any] = planes
    for kind, bits in ((np.uint16, 8), (np.uint32, 16), (np.uint64, 32)):
        words = words[:, 0::2].astype(kind) | np.left_shift(words[:, 1::2], bits, dtype=kind)
    return words[:, 0].view(np.int64)


def _rounds(orders: NDArray[np.int64]) -> Iterator[NDArray[np.intp]]:
    """Yield the columns to difference in each pass."""
    for times in range(1, 1 + max(orders, default=0)):
        yield np.flatnonzero(orders >= times)


_ORDERS = np.array([field.differences for field in TICK_FIELDS])


class Layout:
    """Column layout of the batches in a file, and their decoder."""

    def __init__(self, schema: bytes) -> None:
        try:
            columns = json.loads(schema)["columns"]
            self._names = [str(column["name"]) for column in columns]
            self._orders = np.array([int(column["differences"]) for column in columns], np.int64)
            kinds = [str(column["type"]) for column in columns]
        except (ValueError, KeyError, TypeError) as error:
            raise RecordingError(f"the schema of its ticks does not describe their columns ({error})") from None
        for name, kind in zip(self._names, kinds, strict=True):
            if name in (TICK.names or ()) and np.dtype(kind) != TICK[name]:
                raise RecordingError(f"its column {name} has the type {kind}, expected {TICK[name].str}")

    def planes(self, message: bytes) -> NDArray[np.uint8]:
        """Decompose a message into the byte planes of its columns, shape (columns, 8, n)."""
        values = unpack(message)
        data, count = values.get("columns"), values.get("count")
        if not isinstance(data, bytes) or not isinstance(count, int) or len(data) != len(self._names) * _WORD * count:
            raise RecordingError("a batch of ticks whose length contradicts its header")
        return np.frombuffer(data, np.uint8).reshape(len(self._names), _WORD, count)

    def places(self, names: Sequence[str]) -> NDArray[np.int64]:
        """Return the column indices of these names, -1 for a column that the file does not have [1]."""
        return np.array([self._names.index(name) if name in self._names else -1 for name in names], np.int64)

    def read(self, planes: NDArray[np.uint8], places: NDArray[np.int64], out: NDArray[np.int64]) -> None:
        """Decode columns into `out`; leave a column that the file does not have unchanged."""
        if np.array_equal(places, np.arange(len(planes))):
            # Selecting columns would copy the planes; skip it when all are wanted.
            out[:] = self._summed(planes, self._orders).T
            return
        there = np.flatnonzero(places >= 0)
        out[:, there] = self._summed(planes[places[there]], self._orders[places[there]]).T

    @staticmethod
    def _summed(planes: NDArray[np.uint8], orders: NDArray[np.int64]) -> NDArray[np.int64]:
        words = _joined(planes)
        for smooth in _rounds(orders):
            words[smooth] = np.cumsum(words[smooth], axis=1)
        return words


def told(attempt: Attempt) -> dict[str, Any]:
    """Convert an attempt to JSON values; NaN becomes None."""
    values = asdict(attempt)
    return values | {"completion": None if isnan(attempt.completion) else attempt.completion}


def heard(values: dict[str, Any]) -> Attempt:
    """Convert the JSON values of an attempt back."""
    return Attempt(**values | {"completion": nan if values["completion"] is None else values["completion"]})


class TickStream:
    """Collects ticks into batches and writes them to a file, with the index of attempts and chunks."""

    def __init__(self, file: PartFile, chunk_bytes: int) -> None:
        self.last = -1
        self._file = file
        self._most = max(1, int(chunk_bytes * _SHARE_OF_CHUNK) // TICK.itemsize)
        self._held: list[bytes] = []
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
        self._held_log_ns = log_time_ns
        self._held.append(row)
        self.last = int.from_bytes(row[:_WORD], "little", signed=True)
        if len(self._held) >= self._most:
            self.close_batch()

    def close_batch(self) -> None:
        """Write the ticks in memory, if any, to the file as a batch."""
        if not self._held:
            return
        rows = np.frombuffer(b"".join(self._held), TICK)
        self._held.clear()
        first, time_ns, log_ns = int(rows["tick"][0]), int(rows["time_ns"][0]), self._held_log_ns
        values = {"first": first, "time_ns": time_ns, "count": len(rows), "columns": pack(rows)}
        chunk = self._file.add(IDS["/ticks"], Stamped("/ticks", first, time_ns, msgpack.packb(values)), log_ns)
        self._note_place(chunk, first, int(rows["tick"][-1]), len(rows))
        for row in rows[rows["tick"] % PLOTTED_EVERY == 0]:
            # By its number: across a stall of the server, tick times differ by more than the log times do.
            self._plot(row, log_ns - (self.last - int(row["tick"])) * TICK_NS)
        self._keep_edges(rows)

    def _note_place(self, chunk: int, first: int, last: int, count: int) -> None:
        """Note the chunk of a batch; batches of one chunk share a row."""
        if self._places and self._places[-1][0] == chunk:
            _, first, _, before = self._places.pop()
            count += before
        self._places.append((chunk, first, last, count))

    def _plot(self, row: Any, log_time_ns: int) -> None:
        message = msgpack.packb({field.name: row[field.name].item() for field in PLOTTED})
        stamp = Stamped("/plot", int(row["tick"]), int(row["time_ns"]), message)
        self._file.add(IDS["/plot"], stamp, min(max(log_time_ns, 0), 2**64 - 1))

    def _keep_edges(self, rows: NDArray[Any]) -> None:
        """Keep the first and last tick of each phase, from which the attempts are derived."""
        joined = np.concatenate([self._newest.view(_ROW_BYTES), rows.view(_ROW_BYTES)]).view(TICK)
        changed = np.zeros(len(joined) - 1, bool)
        for name in _KEYS:
            changed |= joined[name][1:] != joined[name][:-1]
        at = np.flatnonzero(changed)
        kept = np.unique(np.concatenate([at, at + 1] if len(self._newest) else [[0], at, at + 1]))
        self._edges.append(joined[kept])
        self._newest = joined[-1:]

    def attempts(self) -> tuple[Attempt, ...]:
        """Return every attempt at a trial so far."""
        edges = np.concatenate([rows.view(_ROW_BYTES) for rows in (*self._edges, self._newest)]).view(TICK)
        return find_attempts(edges)

    def finish(self, log_time_ns: int) -> None:
        """Attach the list of attempts and the locations of the ticks."""
        self.close_batch()
        self._file.close_chunk()
        listed = json.dumps([told(attempt) for attempt in self.attempts()]).encode()
        self._file.add_attachment(ATTEMPTS_NAME, "application/json", listed, log_time_ns)
        places = np.array(self._places, PLACES).tobytes()
        self._file.add_attachment(PLACES_NAME, "application/octet-stream", places, log_time_ns)
