"""Converts a server's spill to recordings, one per block, as loggers would have written them.

A record in the log marks the start of each block and holds its configuration, which suffices to separate the blocks.
The spill itself is not changed.
"""

import mmap
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from netboard.base.config import parse
from netboard.base.errors import RecordingError, WireError
from netboard.base.tick import TICK
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.records import (
    BackfillRecord,
    ClockRecord,
    EventRecord,
    FrameRecord,
    LogBatch,
    TickRecord,
)
from netboard.recording.files.locate import recovered_path
from netboard.recording.files.provenance import provenance
from netboard.recording.files.reader import Recording
from netboard.recording.files.writer import RecordingWriter
from netboard.recording.format.channels import block_config, record_of, stamped
from netboard.recording.format.claims import MAX_STAMP_NS, MAX_WHOLE, whole_number
from netboard.recording.format.summary import find_gaps
from netboard.recording.recovery.recover import RecoveryReport, recover_all, recovery_metadata
from netboard.recording.recovery.scan import Damage, mapped
from netboard.recording.recovery.spill import MAGIC, OPENED, read_spill


def recover_any(path: Path, output: Path | None = None) -> tuple[RecoveryReport, ...]:
    """Recover an unfinished or damaged recording (`recover_all`), or a spill: one recording per block in it.

    ``output``: output file; by default `recovered_path`. For a spill it is the first block's. Raises `ConfigError`
    if an output exists, and `RecordingError` if nothing can be recovered or an output cannot be written; no output is
    left behind then.
    """
    with mapped(path) as data:
        if data[: len(MAGIC)] != MAGIC:
            return recover_all(path, output)
        return _Blocks(path, data, output).write()


class _Blocks:
    """The recordings of a spill while they are written."""

    def __init__(self, path: Path, data: "mmap.mmap | bytes", output: Path | None) -> None:
        self._path, self._data, self._output = path, data, output
        self._welcome, self._opened, self._damage = _introduction(path, data)
        self._now = self._utc_ns = _opened_utc(path, self._opened)
        self._made: list[RecordingWriter] = []
        self._finished: list[RecordingWriter] = []
        self._batches: list[int] = []

    def write(self) -> tuple[RecoveryReport, ...]:
        """Write all recordings."""
        with self._all_or_nothing():
            self._open(self._welcome.config)
            for _, _, message in read_spill(self._data):
                if isinstance(message, LogBatch):
                    self._batches[-1] += 1
                    self._write_batch(message)
            self._finish()
        return tuple(self._report(writer, batches) for writer, batches in zip(self._made, self._batches, strict=True))

    @contextmanager
    def _all_or_nothing(self) -> Iterator[None]:
        try:
            yield
        except BaseException:
            for writer in self._made:
                writer.abandon()
                if writer in self._finished:  # otherwise a file of that name is somebody else's
                    writer.path.unlink(missing_ok=True)
            raise

    def _open(self, config_text: str) -> None:
        """Start the recording of a block."""
        config = parse(config_text, f"{self._path} (its configuration)")
        welcome = replace(self._welcome, config=config_text)
        target = self._path_of(config.block.number if config.block.blocks > 1 else None)
        writer = RecordingWriter(
            target,
            provenance(welcome, config, 0, self._now, self._opened.time_ns + self._now - self._utc_ns)
            | {"part": "spill"},
            config_text,
            config.recording,
            self._now,
            recovery_metadata(self._path, len(self._data), self._damage, True),
            repeatable=True,
        )
        self._made.append(writer)
        self._batches.append(0)

    def _path_of(self, block: int | None) -> Path:
        """Return the path of a block's recording, or of the only one."""
        whole = self._output or recovered_path(self._path)
        if block is None or (self._output is not None and not self._made):
            return whole
        stem = whole.name.removesuffix(".mcap").removesuffix(".recovered")
        return whole.with_name(f"{stem}_block{block:02d}{whole.name[len(stem) :]}")

    def _finish(self) -> None:
        self._made[-1].finish(self._now, "no logger took it from the server")
        self._finished.append(self._made[-1])

    def _write_batch(self, batch: LogBatch) -> None:
        """Write the records of a batch as a logger would have written them."""
        writer = self._made[-1]
        expected = writer.next_record
        if not (expected or 0) <= batch.first <= MAX_WHOLE:
            before = -1 if expected is None else expected - 1
            raise RecordingError(f"{self._path}: its records come out of order: {batch.first} after {before}")
        if expected is not None and batch.first > expected:
            writer.note_lost(expected, batch.first - expected, self._now)
        for number, frame in enumerate(batch.records, start=batch.first):
            self._write_record(frame, number)

    def _write_record(self, frame: bytes, number: int) -> None:
        writer = self._made[-1]
        try:
            record = record_of(frame)
        except WireError as error:
            writer.note_unreadable(frame, number, str(error), self._now)
            return
        if not isinstance(record, FrameRecord | BackfillRecord):  # time stamps of these two refer to the past
            self._now = min(max(self._now, _server_ns(record) + self._utc_ns - self._opened.time_ns), MAX_STAMP_NS)
        if writer.next_record is not None and (config := block_config(record)):
            self._finish()
            self._open(config)
        self._made[-1].write(record, number, self._now)

    def _report(self, writer: RecordingWriter, batches: int) -> RecoveryReport:
        with Recording(writer.path) as recording:
            ticks = recording.columns("tick")["tick"]
            return RecoveryReport(
                source=self._path,
                output=writer.path,
                chunks=batches,
                messages={topic: count for topic, count in recording.counts.items() if topic != "/plot"},
                first_tick=int(ticks.min()) if ticks.size else None,
                last_tick=int(ticks.max()) if ticks.size else None,
                missing=find_gaps(ticks),
                damage=tuple(self._damage),
                finished=True,
                has_config=True,
            )


def _introduction(path: Path, data: "mmap.mmap | bytes") -> tuple[Welcome, EventRecord, list[Damage]]:
    """Read the start of a spill and find its damaged blocks."""
    welcome: Welcome | None = None
    opened: EventRecord | None = None
    damage = []
    for start, stop, message in read_spill(data):
        match message:
            case None:
                damage.append(Damage(start, stop - start, "a damaged block"))
            case Welcome():
                welcome = message
            case EventRecord(name=name) if name == OPENED:
                opened = message
    if welcome is None or opened is None:
        raise RecordingError(f"{path}: the beginning of this spill is damaged; the rest cannot be read")
    return welcome, opened, damage


def _opened_utc(path: Path, opened: EventRecord) -> int:
    """Return the wall-clock time at which a spill was opened [ns]."""
    utc_ns = whole_number(opened.details.get("utc_ns", ""))
    if utc_ns is None or utc_ns < 0:
        raise RecordingError(f"{path}: the beginning of this spill does not say when it was opened")
    return utc_ns


def _server_ns(record: TickRecord | EventRecord | ClockRecord) -> int:
    if isinstance(record, TickRecord):
        return int(np.frombuffer(record.row, TICK)["time_ns"][0]) if len(record.row) == TICK.itemsize else 0
    return stamped(record).publish_time_ns
