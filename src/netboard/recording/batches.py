"""Ticks on their way into a recording and out of it: batches of columns.

A batch holds the columns of its ticks one after the other, and of each column first the lowest byte of all values, then
the next one, up to the highest: bytes that are alike lie side by side, which halves what is left after compression, and
whole columns turn into arrays by moving bytes. Every bit survives, a not-a-number's payload too.

On its way in one tick in `PLOTTED_EVERY` goes into the channel for viewers as well, and what is needed to list the
attempts is kept, so that nobody has to read an hour to find a trial.
"""

import json
from dataclasses import asdict
from math import isnan, nan
from typing import Any

import msgpack
import numpy as np
from numpy.typing import NDArray

from netboard.errors import RecordingError
from netboard.recording.channels import IDS, PLOTTED, PLOTTED_EVERY, Stamped, unpack
from netboard.recording.partfile import PartFile
from netboard.recording.summary import Attempt, find_attempts
from netboard.tick import TICK

ATTEMPTS_NAME = "netboard.attempts.json"
"""The attachment that lists the attempts."""

PLACES_NAME = "netboard.places"
"""The attachment that tells where ticks are."""

PLACES = np.dtype([("chunk", "<i8"), ("first", "<i8"), ("last", "<i8"), ("count", "<i8")])
"""One chunk with ticks: its offset in the file, number of its first and last tick, and how many there are."""

_SHARE_OF_CHUNK = 0.75
_ROW_BYTES = np.dtype((np.void, TICK.itemsize))
_WORD = 8
_KEYS = ("phase", "trial", "attempt")


def pack(rows: NDArray[Any]) -> bytes:
    """Turn ticks into the columns of a batch.

    Parameters
    ----------
    rows : ndarray of TICK, shape (n,)
        The ticks.
    """
    return np.ascontiguousarray(_bytes_of(rows).T).tobytes()


def _bytes_of(rows: NDArray[Any]) -> NDArray[np.uint8]:
    return rows.view(np.uint8).reshape(len(rows), TICK.itemsize)


class Layout:
    """How the batches of a file become ticks.

    Parameters
    ----------
    schema : bytes
        The schema of its channel.

    Raises
    ------
    RecordingError
        If it does not say what the columns are, or one has another type than here.
    """

    def __init__(self, schema: bytes) -> None:
        try:
            columns = [(str(column["name"]), str(column["type"])) for column in json.loads(schema)["columns"]]
        except (ValueError, KeyError, TypeError) as error:
            raise RecordingError(f"the schema of its ticks says nothing of their columns ({error})") from None
        self._count = len(columns)
        self._names = [name for name, _ in columns]
        for name, kind in columns:
            if name in (TICK.names or ()) and np.dtype(kind) != TICK[name]:
                raise RecordingError(f"its column {name} has the type {kind}, expected {TICK[name].str}")
        self._as_here = self._names == list(TICK.names or ())

    def planes(self, message: bytes) -> NDArray[np.uint8]:
        """Read a message: the planes of its columns, shape (columns, 8, n).

        Raises
        ------
        RecordingError
            If it is no batch, or not one of this layout.
        """
        values = unpack(message)
        data, count = values.get("columns"), values.get("count")
        if not isinstance(data, bytes) or not isinstance(count, int) or len(data) != self._count * _WORD * count:
            raise RecordingError("a batch of ticks whose length contradicts what it says of itself")
        return np.frombuffer(data, np.uint8).reshape(self._count, _WORD, count)

    def rows(self, planes: NDArray[np.uint8], out: NDArray[Any]) -> None:
        """Turn planes into ticks; a column that the file does not have is 0.

        Parameters
        ----------
        planes : ndarray of uint8, shape (columns, 8, n)
            The columns.
        out : ndarray of TICK, shape (n,)
            Where the ticks go.
        """
        count = planes.shape[2]
        if self._as_here:
            _bytes_of(out)[:] = planes.reshape(-1, count).T
            return
        for place, name in enumerate(self._names):
            if name in (TICK.names or ()):
                out[name] = _values(planes[place], TICK[name])


def _values(planes: NDArray[np.uint8], kind: np.dtype[Any]) -> NDArray[Any]:
    return np.ascontiguousarray(planes.T).view(kind)[:, 0]


def told(attempt: Attempt) -> dict[str, Any]:
    """Say an attempt in JSON, which has no not-a-number."""
    values = asdict(attempt)
    return values | {"completion": None if isnan(attempt.completion) else attempt.completion}


def heard(values: dict[str, Any]) -> Attempt:
    """Read an attempt that was said like that."""
    return Attempt(**values | {"completion": nan if values["completion"] is None else values["completion"]})


class TickStream:
    """Ticks on their way into a file.

    Parameters
    ----------
    file : PartFile
        The file.
    chunk_bytes : int
        Largest size of its chunks, in bytes [1].

    Attributes
    ----------
    last : int
        Number of the last tick, -1 before the first [1].
    """

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
        """Take a tick.

        Parameters
        ----------
        row : bytes
            A row of `netboard.tick.TICK`.
        log_time_ns : int
            Log time [ns].

        Raises
        ------
        RecordingError
            If the row is not as long as it must be: server and logger are of different versions.
        """
        if len(row) != TICK.itemsize:
            raise RecordingError(
                f"a tick record of {len(row)} bytes where {TICK.itemsize} are expected: "
                "server and logger are of different versions; install the same netboard on both"
            )
        if not self._held:
            self._held_log_ns = log_time_ns
        self._held.append(row)
        self.last = int.from_bytes(row[:_WORD], "little", signed=True)
        if len(self._held) >= self._most:
            self.close_batch()

    def close_batch(self) -> None:
        """Put the ticks in memory, if any, into the file's chunk."""
        if not self._held:
            return
        rows = np.frombuffer(b"".join(self._held), TICK)
        self._held.clear()
        first, time_ns, log_ns = int(rows["tick"][0]), int(rows["time_ns"][0]), self._held_log_ns
        values = {"first": first, "time_ns": time_ns, "count": len(rows), "columns": pack(rows)}
        chunk = self._file.add(IDS["/ticks"], Stamped("/ticks", first, time_ns, msgpack.packb(values)), log_ns)
        self._note_place(chunk, first, int(rows["tick"][-1]), len(rows))
        for row in rows[rows["tick"] % PLOTTED_EVERY == 0]:
            self._plot(row, log_ns + int(row["time_ns"]) - time_ns)
        self._keep_edges(rows)

    def _note_place(self, chunk: int, first: int, last: int, count: int) -> None:
        """Note where ticks are: one row for each chunk."""
        if self._places and self._places[-1][0] == chunk:
            _, first, _, before = self._places.pop()
            count += before
        self._places.append((chunk, first, last, count))

    def _plot(self, row: Any, log_time_ns: int) -> None:
        message = msgpack.packb({field.name: row[field.name].item() for field in PLOTTED})
        stamp = Stamped("/plot", int(row["tick"]), int(row["time_ns"]), message)
        self._file.add(IDS["/plot"], stamp, min(max(log_time_ns, 0), 2**64 - 1))

    def _keep_edges(self, rows: NDArray[Any]) -> None:
        """Keep the first and the last tick of each phase: attempts are made of nothing else."""
        joined = np.concatenate([self._newest.view(_ROW_BYTES), rows.view(_ROW_BYTES)]).view(TICK)
        changed = np.zeros(len(joined) - 1, bool)
        for name in _KEYS:
            changed |= joined[name][1:] != joined[name][:-1]
        at = np.flatnonzero(changed)
        kept = np.unique(np.concatenate([at, at + 1] if len(self._newest) else [[0], at, at + 1]))
        self._edges.append(joined[kept])
        self._newest = joined[-1:]

    def attempts(self) -> tuple[Attempt, ...]:
        """Every attempt at a trial so far."""
        edges = np.concatenate([rows.view(_ROW_BYTES) for rows in (*self._edges, self._newest)]).view(TICK)
        return find_attempts(edges)

    def finish(self, log_time_ns: int) -> None:
        """Attach what helps to find a tick and a trial.

        Parameters
        ----------
        log_time_ns : int
            Log time [ns].
        """
        self.close_batch()
        self._file.close_chunk()
        listed = json.dumps([told(attempt) for attempt in self.attempts()]).encode()
        self._file.add_attachment(ATTEMPTS_NAME, "application/json", listed, log_time_ns)
        places = np.array(self._places, PLACES).tobytes()
        self._file.add_attachment(PLACES_NAME, "application/octet-stream", places, log_time_ns)
