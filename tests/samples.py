"""Recordings for tests: rows of random bits, records of every kind, and a file of them."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import Config
from netboard.base.tables.rig import RecordingSettings
from netboard.base.tick import TICK
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.records import ClockRecord, EventRecord, FrameRecord, TickRecord
from netboard.recording.files.provenance import provenance
from netboard.recording.files.writer import RecordingWriter

SESSION = "3f2a9c1e00000000"
CONFIG_TEXT = '[session]\nname = "S01"\n'
OPENED_NS = 1_790_000_000_000_000_000
MS = 1_000_000

SPECIAL = np.array([0.0, -0.0, np.inf, -np.inf, np.nan, 5e-324, -2.2e-308, 1.7976931348623157e308])


def random_rows(count: int, seed: int = 0) -> NDArray[Any]:
    """Ticks 0, 1, ... whose every other field is random bits: any float64, not-a-numbers with payload included."""
    generator = np.random.default_rng(seed)
    rows = np.frombuffer(bytearray(generator.bytes(count * TICK.itemsize)), TICK)
    for name in TICK.names:
        if TICK[name].kind == "f":
            chosen = generator.random(count) < 0.2
            rows[name][chosen] = generator.choice(SPECIAL, chosen.sum())
    rows["tick"] = np.arange(count)
    rows["time_ns"] = 10**12 + np.arange(count) * MS
    return rows


def records(rows: NDArray[Any]) -> list[TickRecord | EventRecord | ClockRecord | FrameRecord]:
    """A log stream: the ticks, and now and then an event, a probe and a frame, numbered after their tick."""
    stream: list[TickRecord | EventRecord | ClockRecord | FrameRecord] = []
    for row in rows:
        k = int(row["tick"])
        stream.append(TickRecord(row.tobytes()))
        if k % 10 == 3:
            stream.append(EventRecord(k // 10, k, 10**12 + k * MS, "trial_started", {"trial": str(k), "wörd": "ü"}))
        if k % 10 == 5:
            stream.append(ClockRecord(k // 10, "agent.left", k, k + 2**40, k + 2**40 + 5, k + 300, 2**40, -1, 2.5))
        if k % 10 == 7:
            stream.append(FrameRecord(k // 10, "right", k, 5 * k, 5 * k + 3, 2))
    return stream


def metadata(config_text: str = CONFIG_TEXT) -> dict[str, str]:
    return provenance(Welcome(SESSION, 1, 7, config_text), Config(), 1, OPENED_NS, 42)


def new_writer(path: Path, settings: RecordingSettings | None = None) -> RecordingWriter:
    settings = settings or RecordingSettings(flush_ms=200.0)  # several chunks, although the sample is short
    return RecordingWriter(path, metadata(), CONFIG_TEXT, settings, OPENED_NS)


def fill(writer: RecordingWriter, rows: NDArray[Any], first: int = 0) -> int:
    """Write all records, 1 ms apart, flushing when due; return the log time after the last."""
    now = OPENED_NS
    for number, record in enumerate(records(rows), start=first):
        now += MS
        writer.write(record, number, now)
        if writer.is_due(now):
            writer.flush(now)
    return now


def write_recording(path: Path, rows: NDArray[Any], settings: RecordingSettings | None = None) -> Path:
    """Write a finished recording."""
    writer = new_writer(path, settings)
    writer.finish(fill(writer, rows))
    return path
