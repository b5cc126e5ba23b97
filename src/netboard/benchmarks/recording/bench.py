"""``netboard bench recording``: the cost of recording a dyad, and of reading an hour of its recording.

A real session with displays is run first; everything else uses its recording.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import zstandard
from numpy.typing import NDArray

from netboard.base.config import Config
from netboard.benchmarks.harness.results import Folder, ResultPart, Value
from netboard.benchmarks.harness.running import Tell, timed
from netboard.benchmarks.recording.feeding import live_log
from netboard.benchmarks.recording.headroom import headroom_part
from netboard.benchmarks.recording.hours import (
    FOUR,
    HOUR,
    BenchSession,
    Written,
    bytes_by_channel,
    decode_upstream,
    read_columns,
    read_messages,
    read_trial,
    write_hour,
    write_messages,
)
from netboard.benchmarks.recording.stalls import record_stalls, stalls_part
from netboard.recording.files.reader import Recording
from netboard.recording.format.batches import pack
from netboard.recording.format.channels import TICK_FIELDS
from netboard.recording.format.predictions import PREDICTIONS, constants_of

MINUTE = 60_000
"""Ticks in a minute [1]."""

COLUMNS_SECONDS, TRIAL_SECONDS, HOUR_GB = 5.0, 0.05, 0.25
"""Targets: reading an hour into columns [s], reading one trial of it [s], and its size [GB]."""

TURNS = 3
"""Repetitions of reading the columns, of which the median counts [1]."""

GROWTH_MB = 64.0
"""Memory growth allowed to a writer for its lists of the file's contents [MB]."""

BATCH = 200
"""Ticks in a batch [1]."""

SAMPLED = 100
"""Batches whose columns are measured, spread over the recording [1]."""

LISTED_BYTES = 0.05
"""A column that costs less, alone and in addition to the others, is not listed [1]."""

_WORD = 8


@dataclass(frozen=True)
class BenchEffort:
    """How much is measured.

    - `stall_seconds`: duration of each kind of interference with the logger [s].
    - `load_seconds`, `rates`: duration at each rate, and the rates as multiples of one dyad's [s, 1].
    """

    ticks: int
    stall_seconds: float
    load_seconds: float
    rates: tuple[int, ...]


WHOLE, QUICK = BenchEffort(HOUR, 20.0, 6.0, (1, 5, 10, 15, 20, 30, 40, 60, 80)), BenchEffort(150_000, 3.0, 2.0, (1, 20))


def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Measure everything, on the disk of the folder of results."""
    place, effort = folder.path, QUICK if quick else WHOLE
    (place / "session").mkdir(exist_ok=True)
    recorded, periods = record_stalls(place / "session", effort.stall_seconds, tell)
    yield stalls_part(recorded, periods)
    yield headroom_part(place / "headroom", live_log(5000), effort.rates, effort.load_seconds, tell)
    session = BenchSession(recorded)
    yield size_part(session, place, min(MINUTE, effort.ticks), tell)
    yield columns_part(session.rows, session.config)
    path = place / "hour.mcap"
    path.unlink(missing_ok=True)
    yield writing_part(write_hour(session, path, effort.ticks, tell))
    yield reading_part(session, path, place, effort.ticks, tell)
    path.unlink()


def size_part(session: BenchSession, folder: Path, ticks: int, tell: Tell) -> ResultPart:
    """Tabulate the bytes that each kind of record takes."""
    tell("bytes by channel", 0.5)
    found = bytes_by_channel(session, folder, ticks)
    single, count = folder / "single.mcap", min(ticks, len(session.rows))
    bytes_alone = write_messages(session, single, count) / count
    single.unlink()
    whole = sum(found.values())
    rows: list[tuple[Value, ...]] = [(topic, size, size * HOUR / 1e9) for topic, size in found.items()]
    part = ResultPart(
        "size",
        f"Where the bytes go: {ticks} ticks of a session with two displays, and all that came with them",
        "channel | bytes a tick [1] | an hour [GB]",
        [
            *rows,
            ("all", whole, whole * HOUR / 1e9),
            ("beside: ticks alone, a message each", bytes_alone, bytes_alone * HOUR / 1e9),
        ],
    )
    part.claim(
        f"an hour of a dyad takes at most {HOUR_GB:g} GB", whole * HOUR / 1e9 <= HOUR_GB, f"{whole * HOUR / 1e9:.3f} GB"
    )
    return part


def columns_part(rows: NDArray[Any], config: Config) -> ResultPart:
    """Tabulate what each column costs, the most expensive first: bytes saved without it, and its bytes by itself.

    A column that equals others, or follows from them, costs nothing in addition, so the costs of all columns do not add
    up to the total.
    """
    starts = np.linspace(0, len(rows) - BATCH, min(SAMPLED, len(rows) // BATCH)).astype(np.int64)
    constants = constants_of(config)
    batches = [
        np.frombuffer(pack(rows[start : start + BATCH], constants), np.uint8).reshape(len(TICK_FIELDS), -1)
        for start in starts
    ]
    whole = _bytes_a_tick(batches)
    found = []
    for place, field in enumerate(TICK_FIELDS):
        beside = whole - _bytes_a_tick([np.delete(batch, place, axis=0) for batch in batches])
        alone = _bytes_a_tick([batch[place] for batch in batches])
        if max(beside, alone - _empty()) > LISTED_BYTES:
            found.append((field.name, "yes" if field.name in PREDICTIONS else "no", field.differences, beside, alone))
    found.sort(key=lambda row: -row[3])
    return ResultPart(
        "columns",
        f"What each column of {len(batches)} batches costs; {len(TICK_FIELDS) - len(found)} others cost nothing",
        "column | predicted | differences | beside the others: bytes a tick [1] | alone: bytes a tick [1]",
        [*found, ("all", "", "", whole, whole)],
    )


def _bytes_a_tick(batches: list[NDArray[np.uint8]]) -> float:
    """Return the compressed size of some columns [1]."""
    compressor = zstandard.ZstdCompressor()
    return sum(len(compressor.compress(batch.tobytes())) for batch in batches) / (BATCH * len(batches))


def _empty() -> float:
    """Return the compressed size of a column of zeros by itself [1]."""
    return _bytes_a_tick([np.zeros(BATCH * _WORD, np.uint8)])


def writing_part(written: Written) -> ResultPart:
    """Tabulate the cost of writing, and the time the writer waits for the disk."""
    waits = [1e3 * float(value) for value in np.percentile(written.flushes, (50, 99, 99.9))]
    waited = float(written.flushes.sum())
    part = ResultPart(
        "writing",
        f"Writing {written.ticks} ticks and all that comes with them, with {len(written.flushes)} syncs",
        "writer | a tick, syncs included [us] | without [us] | sync, 50 % [ms] | 99 % [ms] | 99.9 % [ms] | "
        "longest [ms] | memory grown [MB] | file [GB]",
        [
            (
                "one dyad",
                1e6 * written.seconds / written.ticks,
                1e6 * (written.seconds - waited) / written.ticks,
                *waits,
                1e3 * float(written.flushes.max()),
                written.grown / 1e6,
                written.size / 1e9,
            )
        ],
    )
    part.claim(
        f"memory grows by less than {GROWTH_MB:g} MB", written.grown < GROWTH_MB * 1e6, f"{written.grown / 1e6:.1f} MB"
    )
    return part


def reading_part(session: BenchSession, path: Path, folder: Path, ticks: int, tell: Tell) -> ResultPart:
    """Measure several ways of reading a long recording."""
    tell("reading", 0.9)
    reads = (partial(read_trial, path), partial(read_columns, path), partial(read_columns, path, FOUR))
    trial, whole, four = (median(timed(read) for _ in range(TURNS)) for read in reads)
    tell("reading with the upstream library", 0.95)
    decoded, all_messages = timed(lambda: decode_upstream(path)), timed(lambda: read_messages(path))
    minute, single = min(MINUTE, len(session.rows)), folder / "single.mcap"
    write_messages(session, single, minute)
    each = timed(lambda: read_messages(single)) * ticks / minute
    single.unlink()
    with Recording(path) as recording:
        size = path.stat().st_size
        messages = sum(recording.counts.values())
    hours = ticks / HOUR
    part = ResultPart(
        "reading",
        f"Reading {ticks} ticks ({size / 1e9:.3f} GB, {messages} ticks and messages), the file in the system's cache",
        "what | time [s] | an hour [s]",
        [
            ("all columns", whole, whole / hours),
            ("four columns", four, four / hours),
            (f"one trial of {read_trial(path)} ticks, opened anew", trial, trial),
            ("upstream reader, msgpack and numpy: all columns", decoded, decoded / hours),
            ("upstream reader and msgpack: every message, no columns", all_messages, all_messages / hours),
            ("the same where each tick is a message (from a minute)", each, each / hours),
        ],
    )
    part.claim(
        f"an hour is in columns within {COLUMNS_SECONDS:g} s", whole / hours < COLUMNS_SECONDS, f"{whole / hours:.2f} s"
    )
    part.claim(
        f"a trial is out of it within {1e3 * TRIAL_SECONDS:g} ms", trial < TRIAL_SECONDS, f"{1e3 * trial:.1f} ms"
    )
    return part
