"""An hour of one dyad: a short real recording, repeated, then written and read in the usual ways.

The records are those of the session with new numbers and times, so columns, noise and rates are real; only the course
of events repeats.
"""

import json
import os
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray

from netboard.base.config import SIDES, parse
from netboard.base.tick import TICK, TICK_NS
from netboard.benchmarks.harness.running import Tell, no_progress
from netboard.benchmarks.loop.usage import read_usage
from netboard.benchmarks.recording.specimen import OPENED_NS, open_writer
from netboard.network.protocol.records import ClockRecord, EventRecord, FrameRecord, TickRecord
from netboard.recording.files.reader import Recording
from netboard.recording.format.channels import CHANNELS, IDS, Record

Numbered = EventRecord | ClockRecord | FrameRecord

HOUR = 3_600_000
"""Ticks in an hour [1]."""

_TIMES = ("time_ns", *(f"{side}_{name}_ns" for side in SIDES for name in ("stamp", "seen")))

FOUR = ("tick", "theta", "p", "late_ns")
"""Columns for the measurement that reads four."""


class BenchSession:
    """A real recording that can be repeated."""

    def __init__(self, path: Path) -> None:
        with Recording(path) as recording:
            self.rows = recording.ticks()
            self.config = parse(recording.config_text)
            events, clocks, frames = recording.events(), recording.clocks(), recording.frames()
        first_ns = int(self.rows["time_ns"][0])
        self._others: dict[int, list[Numbered]] = {}
        dated: list[tuple[Numbered, int]] = [
            *((event, event.tick) for event in events),
            *((clock, (clock.t3_ns - first_ns) // TICK_NS) for clock in clocks),
            *((frame, frame.tick) for frame in frames),
        ]
        for record, tick in dated:
            at = min(max(int(tick) - int(self.rows["tick"][0]), 0), len(self.rows) - 1)
            self._others.setdefault(at, []).append(record)

    def records(self, ticks: int) -> Iterator[Record]:
        """Repeat the recording up to a number of ticks, with continuous numbers."""
        rows, seqs = self.rows.copy(), Counter[type[Numbered]]()
        length_ns = int(rows["time_ns"][-1] - rows["time_ns"][0]) + TICK_NS
        for turn, start in enumerate(range(0, ticks, len(rows))):
            rows["tick"] = start + np.arange(len(rows))
            for name in _TIMES:
                known = self.rows[name] != 0  # 0: there was no sample yet
                rows[name][known] = self.rows[name][known] + turn * length_ns
            for at, row in enumerate(rows[: ticks - start]):
                yield TickRecord(row.tobytes())
                for record in self._others.get(at, ()):
                    yield replace(record, seq=seqs[type(record)])
                    seqs[type(record)] += 1


@dataclass(frozen=True)
class Written:
    """Cost of writing a long recording.

    - `seconds`: time in the writer, without that of preparing the records [s].
    - `flushes` (shape (n,)): time to close and sync each chunk [s].
    - `grown`: growth of memory from the first tenth to the end [B].
    """

    ticks: int
    seconds: float
    flushes: "np.ndarray"
    grown: float
    size: int


def write_hour(session: BenchSession, path: Path, ticks: int, tell: Tell) -> Written:
    """Write an hour, with syncs as by the logger."""
    writer = open_writer(path, session.config)
    now, resident, flushes, spent = OPENED_NS, [], [], 0.0
    for number, record in enumerate(session.records(ticks)):
        started = time.perf_counter()
        now += TICK_NS if isinstance(record, TickRecord) else 0
        writer.write(record, number, now)
        if writer.is_due(now):
            flushing = time.perf_counter()
            writer.flush(now)
            flushes.append(time.perf_counter() - flushing)
            if len(flushes) % max(1, ticks // 20_000) == 0:
                resident.append(read_usage(os.getpid()).resident)
                tell(f"writing: {(now - OPENED_NS) * 1e-9:.0f} s", 0.6)
        spent += time.perf_counter() - started
    writer.finish(now)
    grown = float(resident[-1] - resident[len(resident) // 10])
    return Written(ticks, spent, np.array(flushes), grown, path.stat().st_size)


def read_columns(path: Path, names: tuple[str, ...] = ()) -> None:
    """Read the named columns of a recording, or all."""
    with Recording(path) as recording:
        recording.columns(*names)


def read_trial(path: Path) -> int:
    """Open a recording and read its middle attempt; return the number of its ticks."""
    with Recording(path) as recording:
        attempts = recording.attempts()
        attempt = attempts[len(attempts) // 2]
        return len(recording.ticks(attempt.began, attempt.stop))


def read_messages(path: Path) -> None:
    """Read all messages with the upstream reader and msgpack."""
    with path.open("rb") as file:
        for _, _, message in make_reader(file).iter_messages(log_time_order=False):
            msgpack.unpackb(message.data)


def decode_upstream(path: Path) -> None:
    """Read all columns as FORMAT.md describes without netboard."""
    with path.open("rb") as file, np.errstate(all="ignore"):
        for schema, _, message in make_reader(file).iter_messages(topics=["/ticks"], log_time_order=False):
            assert schema is not None
            layout, batch = json.loads(schema.data), msgpack.unpackb(message.data)
            columns, ticks = (
                layout["columns"],
                dict(zip(layout["constants"], batch["constants"], strict=True), **_HELPERS),
            )
            table = np.frombuffer(batch["columns"], "u1").reshape(len(columns), 8, batch["count"]).transpose(0, 2, 1)
            for column, folded in zip(columns, table.copy().view("<u8")[:, :, 0], strict=True):
                words = (folded >> 1).view("<i8") ^ -(folded & 1).view("<i8")
                for _ in range(column["differences"]):
                    words = words.cumsum()
                ticks[column["name"]] = words.view(column["type"])
            for name, expression in layout["predictions"].items():
                prediction, correction = eval(expression, ticks), ticks.get(name)
                ticks[name] = (
                    prediction
                    if correction is None
                    else (correction.view("<i8") + _bits(prediction)).view(correction.dtype)
                )


_HELPERS: dict[str, Any] = {
    "np": np,
    "before": lambda values: np.concatenate([values[:1] * 0, values[:-1]]),
    "after": lambda values: np.concatenate([values[1:], values[:1] * 0]),
}


def _bits(values: NDArray[Any]) -> NDArray[np.int64]:
    """Return a prediction as integer bits."""
    return np.where(np.isfinite(values), values, values.dtype.type(0)).view(np.int64)


@contextmanager
def _upstream_writer(path: Path, name: str, chunk_size: int, schema: bytes) -> Iterator[Any]:
    """Write a file of one channel, number 1, with the upstream library."""
    with path.open("wb") as file:
        writer: Any = Writer(file, chunk_size=chunk_size, compression=CompressionType.ZSTD)
        writer.start(profile="", library="")
        writer.register_channel(f"/{name}", "msgpack", writer.register_schema(name, "jsonschema", schema))
        yield writer
        writer.finish()


def write_messages(session: BenchSession, path: Path, ticks: int) -> int:
    """Write ticks as one message each, as format 2 did, with the upstream writer; return its size in bytes [1]."""
    with _upstream_writer(path, "tick", 65_536, CHANNELS[0].schema()) as writer:
        for number, row in enumerate(session.rows[:ticks]):
            at = int(row["time_ns"])
            data = msgpack.packb(dict(zip(TICK.names or (), row.tolist(), strict=True)))
            writer.add_message(1, at, data, at, number)
    return path.stat().st_size


def bytes_by_channel(session: BenchSession, folder: Path, ticks: int) -> dict[str, float]:
    """Return the bytes per tick of each channel, found by writing it alone with the upstream writer."""
    whole = folder / "whole.mcap"
    write_hour(session, whole, ticks, no_progress)
    found: dict[str, float] = {}
    for topic in IDS:
        with whole.open("rb") as file:
            messages: list[Any] = [
                m for _, _, m in make_reader(file).iter_messages(topics=[topic], log_time_order=False)
            ]
        found[topic] = _size_alone(messages, folder / "alone.mcap") / ticks
    found["indices, checksums, metadata"] = whole.stat().st_size / ticks - sum(found.values())
    whole.unlink()
    return found


def _size_alone(messages: list[Any], path: Path) -> int:
    """Return the size of some messages in compressed chunks of 0.2 s, in bytes [1]."""
    with _upstream_writer(path, "one", 2**62, b"{}") as writer:
        flushed = 0
        for message in messages:
            if message.log_time - flushed >= 200 * TICK_NS:
                writer.flush()
                flushed = message.log_time
            writer.add_message(1, message.log_time, message.data, message.publish_time, message.sequence)
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    return sum(index.compressed_size for index in summary.chunk_indexes)
