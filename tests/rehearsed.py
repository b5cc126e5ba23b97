"""A short rehearsed block as rows, and files made of it: sound, or with one kind of damage."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import Config, resolve
from netboard.base.tables.experiment import Block
from netboard.base.tables.simulated import Participant
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.records import ClockRecord, EventRecord, TickRecord
from netboard.participants.seat.block import Rehearsal
from netboard.recording.files.offline_writer import event_of
from netboard.recording.files.provenance import provenance
from netboard.recording.files.writer import RecordingWriter

SESSION = "0123456789abcdef"
UTC_NS = 1_790_000_000_000_000_000
MS = 1_000_000


def config() -> Config:
    default = Config()
    return replace(default, block=Block(trials=2, first_target="left", seed=3))


@cache
def _rows() -> NDArray[Any]:
    people = {"A": Participant(), "B": Participant()}
    # Copies, because pieces are views of a ring buffer that is overwritten.
    return np.concatenate([rows.copy() for rows in Rehearsal(config(), people).pieces()])


def rows() -> NDArray[Any]:
    """Return a copy of the ticks of two complete trials."""
    return _rows().copy()


def write(
    path: Path,
    ticks: NDArray[Any],
    settings: Config | None = None,
    clocks: Sequence[ClockRecord] = (),
    ended: str = "complete",
    metadata: dict[str, str] | None = None,
    text: str | None = None,
) -> Path:
    """Write ticks, with the events that are in them, as a finished recording."""
    writer = writer_of(path, settings or config(), metadata or {}, text)
    last = fill(writer, ticks, clocks)
    writer.finish(last, ended)
    return path


def writer_of(path: Path, settings: Config, metadata: dict[str, str], text: str | None = None) -> RecordingWriter:
    resolved = resolve(settings) if text is None else text
    whole = provenance(Welcome(SESSION, 1, 7, resolved), settings, 1, UTC_NS, 42) | metadata
    return RecordingWriter(path, whole, resolved, settings.recording, UTC_NS)


def fill(writer: RecordingWriter, ticks: NDArray[Any], clocks: Sequence[ClockRecord] = (), events: int = 0) -> int:
    """Write ticks, their events and clock probes; return the log time after the last."""
    number = writer.next_record or 0
    now = UTC_NS
    records: list[TickRecord | EventRecord | ClockRecord] = []
    for row in ticks:
        records.append(TickRecord(row.tobytes()))
        if row["event"]:
            records.append(EventRecord(events, int(row["tick"]), int(row["time_ns"]), *event_of(row)))
            events += 1
    for record in [*records, *clocks]:
        now += MS // 2
        writer.write(record, number, now)
        number += 1
        if writer.is_due(now):
            writer.flush(now)
    return now


def probes(count: int, drift_ppm: float = 20.0, peer: str = "agent.left") -> list[ClockRecord]:
    """Probes of a clock that runs evenly, by a closed form: one a second, 100 us there and 60 us back, bound 200 us."""
    made = []
    for k in range(count):
        t0 = 10**12 + k * 10**9
        offset = 5_000_000 + round(k * drift_ppm * 1e3)
        t1 = t0 + 100_000 + offset
        t2, t3 = t1 + 10_000, t0 + 170_000
        middle = ((t1 - t0) + (t2 - t3)) // 2
        made.append(ClockRecord(k, peer, t0, t1, t2, t3, middle, 80_000, drift_ppm))
    return made
