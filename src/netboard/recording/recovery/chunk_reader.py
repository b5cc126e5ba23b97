"""Reads the chunks of a file that is being recovered: its ticks as rows, and its other messages."""

import hashlib
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.errors import RecordingError
from netboard.base.tick import TICK, joined
from netboard.recording.format import older
from netboard.recording.format.batches import BatchLayout
from netboard.recording.format.channels import CHANNELS, FORMAT_VERSION, IDS, TICKS
from netboard.recording.format.chunks import ChunkMessage, messages
from netboard.recording.format.sequence import EVIDENCE
from netboard.recording.recovery.scan import Data, Span, content_of

TOPICS = {number: topic for topic, number in IDS.items()}
"""Topic by channel id."""

RECOVERABLE = ("2", "3", FORMAT_VERSION)
"""Format versions that can be recovered."""

_LAYOUTS = BatchLayout(CHANNELS[0].schema()), BatchLayout(older.schema_4())
_LAYOUTS_3 = (BatchLayout(older.schema_3()),)
"""Layouts that the batches of the current format and of format 3 can have."""

_KEPT = 4  # chunks in memory


class Rows(NamedTuple):
    """The ticks of a chunk in the order of their numbers, each once, with the log time of the batch of each [ns]."""

    ticks: NDArray[Any]
    log_ns: NDArray[np.int64]
    again: NDArray[np.int64]  # numbers of the ticks that it has once more, identical to the bit
    rising: bool  # whether they were in this order


class Listed(NamedTuple):
    """What is kept in memory of the ticks of a chunk."""

    chunk: Span
    columns: dict[str, NDArray[np.int64]]  # those of `EVIDENCE`
    again: NDArray[np.int64]
    rising: bool
    offset_ns: int | None  # difference of log time and server time at its last tick; None without ticks

    @property
    def numbers(self) -> NDArray[np.int64]:
        """Numbers of its ticks, rising."""
        return self.columns["tick"]


class ChunkReader:
    """Reads the chunks of a file; those read last are kept."""

    def __init__(self, data: Data, version: str) -> None:
        self.version = version
        self._data = data
        self.entries = lru_cache(_KEPT)(self._entries)
        self.rows = lru_cache(_KEPT)(self._rows)

    def _entries(self, chunk: Span) -> tuple[ChunkMessage, ...]:
        """Return the messages of a chunk."""
        return tuple(messages(content_of(self._data, chunk)))

    def _rows(self, chunk: Span) -> Rows:
        """Return the ticks of a chunk; raise `RecordingError` if two different ones have the same number."""
        batches = [
            (entry.log_time_ns, self._decode(entry.data))
            for entry in self.entries(chunk)
            if TOPICS.get(entry.channel_id) == TICKS
        ]
        ticks = joined([rows for _, rows in batches])
        log_ns = np.repeat(np.array([at for at, _ in batches], np.int64), [len(rows) for _, rows in batches])
        numbers, first, place = np.unique(ticks["tick"], return_index=True, return_inverse=True)
        once = joined([ticks])[first]
        if len(numbers) < len(ticks) and not same_bits(ticks, once[place]):
            raise RecordingError(f"the chunk at {chunk.start} has different ticks with the same number")
        again = np.delete(ticks["tick"], first)
        return Rows(once, log_ns[first], again, rising=bool(np.all(np.diff(ticks["tick"]) > 0)))

    def listed(self, chunk: Span) -> Listed:
        """Return what is kept of a chunk."""
        ticks, log_ns, again, rising = self.rows(chunk)
        offset_ns = int(log_ns[-1] - ticks["time_ns"][-1]) if len(ticks) else None
        return Listed(chunk, {name: ticks[name].copy() for name in EVIDENCE}, again, rising, offset_ns)

    def _decode(self, message: bytes) -> NDArray[Any]:
        if self.version == "2":
            return older.ticks_of([message], self.version)
        known = _LAYOUTS_3 if self.version == "3" else _LAYOUTS
        layout = next((one for one in known if one.fits(message)), known[0])
        columns = layout.decode([message], TICK.names or ())
        rows = np.zeros(len(columns["tick"]), TICK)
        for name, column in columns.items():
            rows[name] = column
        return rows


def same_bits(one: NDArray[Any], other: NDArray[Any]) -> bool:
    """Return whether two arrays of ticks are equal to the bit."""
    return one.tobytes() == other.tobytes()


def digest(entry: ChunkMessage) -> bytes:
    """Return a digest of a message without its log time."""
    head = f"{entry.channel_id} {entry.sequence} {entry.publish_time_ns} ".encode()
    return hashlib.blake2b(head + entry.data, digest_size=16).digest()
