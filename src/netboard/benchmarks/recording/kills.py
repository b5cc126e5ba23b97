"""A real logger is killed while it records at the rate of a session, and its file is checked."""

import hashlib
import signal
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from netboard.base.tick import TICK, TICK_SECONDS
from netboard.benchmarks.recording.feeding import Feeder
from netboard.network.protocol.codec import decode
from netboard.network.protocol.records import TickRecord
from netboard.recording.files.reader import Recording
from netboard.recording.format.summary import find_gaps
from netboard.recording.recovery.recover import recover

SHORTEST, LONGEST = 0.05, 1.5
"""Shortest and longest time from the first record to the kill, which is random [s]."""


@dataclass(frozen=True)
class Killed:
    """Files left by a killed logger.

    - `lost_seconds`: duration of the ticks that were not recovered [s].
    - `seconds`: duration of the recovery [s].
    """

    faults: tuple[str, ...]
    lost_seconds: float
    seconds: float


def kill_one(folder: Path, log: list[list[bytes]], chance: np.random.Generator) -> Killed:
    """Feed a logger, kill it, recover its file, and compare it with the records sent.

    - `log`: the records of each millisecond, more than are sent.
    """
    with Feeder(folder, log) as feeder:
        feeder.wait_for_logger()
        feeder.feed(float(chance.uniform(SHORTEST, LONGEST)))
        feeder.process.send_signal(signal.SIGKILL)
        feeder.process.wait()
        made = feeder.ticks
        feeder.port.pump(time.monotonic_ns())  # an acknowledgement may be on its way
        acknowledged = feeder.port.ring.acknowledged
    parts = list((folder / "recordings").glob("*.part"))
    if not parts:
        faults = ("records were acknowledged, and there is no file",) if acknowledged else ()
        return Killed(faults, made * TICK_SECONDS, 0.0)
    return _look_at(parts[0], log, made, acknowledged)


def _look_at(part: Path, log: list[list[bytes]], made: int, acknowledged: int) -> Killed:
    """Recover a part and check it."""
    faults = []
    before = hashlib.sha256(part.read_bytes()).digest()
    began = time.perf_counter()
    report = recover(part)
    seconds = time.perf_counter() - began
    if hashlib.sha256(part.read_bytes()).digest() != before:
        faults.append("the source was changed")
    with Recording(report.output) as recording:
        recording.check()
        rows = recording.ticks()
    count = len(rows)
    if rows["tick"].tolist() != list(range(count)) or find_gaps(rows["tick"]):
        faults.append("the recovered ticks have a hole")
    elif rows.tobytes() != b"".join(map(_row_of, log[:count])):
        faults.append("a tick is not what it was")
    if sum(report.messages.values()) < acknowledged:
        faults.append(f"{acknowledged} records were acknowledged, {sum(report.messages.values())} are there")
    return Killed(tuple(faults), (made - count) * TICK_SECONDS, seconds)


def _row_of(records: list[bytes]) -> bytes:
    """Return the tick of a millisecond."""
    record = decode(records[0])
    assert isinstance(record, TickRecord)
    assert len(record.row) == TICK.itemsize
    return record.row
