"""A recording with difficult content for exports: random bits, all outcomes, unusual texts, and a gap.

An export must keep every bit of it, signed zeros, subnormal numbers and the payloads of NaNs included.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import Config, resolve
from netboard.base.tables.rig import RecordingSettings
from netboard.base.tick import TICK
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.records import ClockRecord, EventRecord, FrameRecord, TickRecord
from netboard.recording.files.provenance import provenance
from netboard.recording.files.writer import RecordingWriter
from netboard.recording.format.channels import Record
from netboard.task.trials.state_machine import Cause, Phase

MS = 1_000_000
START_NS = 9_007_199_254_740_993  # no float64 is this number
UTC_NS = 1_790_000_000_000_000_000
ODD = 'a "note", with\nlines; and \u00fc\u4e2d\U0001f3b1\t'
SPECIAL = np.array([0.0, -0.0, np.inf, -np.inf, np.nan, 5e-324, -2.2e-308, 1.7976931348623157e308, 0.1, 1 / 3])
FIXED = {"tick", "time_ns", "phase", "trial", "attempt", "target", "event", "mark_ticks", "run_ticks"}

ATTEMPTS = (  # levelling, release, stop, trial, attempt, cause
    (10, 20, 60, 1, 1, Cause.FELL),
    (61, 80, 150, 1, 2, Cause.HELD),
    (151, 170, 200, 2, 1, Cause.TIMED_OUT),
    (201, 210, 230, 2, 2, Cause.ABORT),
    (230, 250, 300, 2, 3, Cause.NONE),
)


def make_rows(seed: int = 0) -> NDArray[np.void]:
    """Three hundred ticks, of which the hundredth is missing."""
    generator = np.random.default_rng(seed)
    rows = np.frombuffer(bytearray(generator.bytes(300 * TICK.itemsize)), TICK)
    for name in TICK.names or ():
        if TICK[name].kind == "f":
            chosen = generator.random(rows.size) < 0.2
            rows[name][chosen] = generator.choice(SPECIAL, chosen.sum())
        elif name in FIXED:
            rows[name] = 0
    rows["tick"] = np.arange(300)
    rows["time_ns"] = START_NS + rows["tick"] * MS
    for levelling, release, stop, trial, attempt, cause in ATTEMPTS:
        rows["trial"][levelling:stop], rows["attempt"][levelling:stop] = trial, attempt
        rows["phase"][levelling:release], rows["phase"][release:stop] = Phase.LEVELLING, Phase.RUNNING
        rows["run_ticks"][release:stop] = np.arange(stop - release)
        rows["event"][stop - 1] = cause
    rows["phase"][120:150], rows["mark_ticks"][120:150] = Phase.HOLDING, 40
    return np.delete(rows, 100)


def without_payloads(rows: NDArray[np.void]) -> NDArray[np.void]:
    """The same rows with one kind of NaN, as text has it."""
    plain = rows.copy()
    for name in TICK.names or ():
        if TICK[name].kind == "f":
            plain[name][np.isnan(plain[name])] = np.nan
    return plain


def write(
    path: Path,
    rows: NDArray[np.void],
    config: Config | None = None,
    part: int = 1,
    joined: Sequence[tuple[int, dict[str, str]]] = (),
) -> Path:
    """Write a recording of rows, with some records of every other kind. ``joined``: ticks and details of agents."""
    text = resolve(config or Config())
    welcome = Welcome("3f2a9c1e00000000", 1, 7, text)
    writer = RecordingWriter(
        path, provenance(welcome, Config(), part, UTC_NS, 42), text, RecordingSettings(chunk_bytes=8192), UTC_NS
    )
    records: list[Record] = [
        EventRecord(0, -1, START_NS - MS, "note", {"text": ODD}),
        ClockRecord(0, "agent.left", START_NS, 5, 6, START_NS + 1500 * 1000, 2**62 + 1, 3, float("nan")),
        FrameRecord(0, "left", 3, 2**61 + 1, 2**61 + 3, 0),
        *(TickRecord(row.tobytes()) for row in rows),
        *(
            EventRecord(1 + k, tick, START_NS + tick * MS, "agent_joined", said)
            for k, (tick, said) in enumerate(joined)
        ),
        EventRecord(1 + len(joined), 299, START_NS + 250 * MS, "stop", {}),
    ]
    for number, record in enumerate(records):
        writer.write(record, number, UTC_NS + number * MS)
    writer.finish(UTC_NS + len(records) * MS)
    return path


def same_bits(left: NDArray[np.generic], right: NDArray[np.generic]) -> bool:
    """Whether two columns are the same to the bit, -0 and NaN included."""
    assert left.dtype == right.dtype
    return bool(np.array_equal(np.ascontiguousarray(left).view(np.int64), np.ascontiguousarray(right).view(np.int64)))
