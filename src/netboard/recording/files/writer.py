"""Writes a recording: takes numbered records, writes chunks, and reports the first record that is not yet on disk.

Time is an argument, so that the rule when to sync is a pure function of it. A record is *written* once it is in the
chunk in memory, and *durable* after the next `flush`. Only durable records may be acknowledged to the server.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import parse
from netboard.base.errors import RecordingError
from netboard.base.tables.rig import RecordingSettings
from netboard.network.protocol.records import TickRecord
from netboard.recording.files.provenance import CONFIG_NAME, LIBRARY, MetadataName
from netboard.recording.format.batches import TickStream
from netboard.recording.format.channels import IDS, Record, remark, stamped
from netboard.recording.format.disk import DiskUse, Space
from netboard.recording.format.partfile import PartFile
from netboard.recording.format.predictions import constants_of


class RecordingWriter:
    """A recording while it is being written.

    ``path``: final name, ending in ``.mcap``; until `finish` the file is ``NAME.mcap.part``. ``opened_ns``: log time of
    opening [ns]. ``recovery``: the ``netboard.recovery`` metadata record, for a file rebuilt from another one.
    ``repeatable``: the recording can be made again from other files; its unfinished file has a temporary name.
    """

    def __init__(
        self,
        path: Path,
        metadata: Mapping[str, str],
        config_text: str,
        settings: RecordingSettings,
        opened_ns: int,
        recovery: Mapping[str, str] | None = None,
        *,
        repeatable: bool = False,
    ) -> None:
        constants = constants_of(parse(config_text, f"{path} (its configuration)"))
        self.path = path
        self.next_record: int | None = None
        self.durable: int | None = None  # all records before this number are on disk; None before the first
        self.lost = 0
        self._written = 0
        self._remarks = 0
        self._flush_ns = round(settings.flush_ms * 1e6)
        self._flushed_ns = opened_ns
        self._disk_use = DiskUse()
        self._file = PartFile(path, LIBRARY, settings.chunk_bytes, repeatable=repeatable)
        self._ticks = TickStream(self._file, settings.chunk_bytes, constants)
        try:
            self._file.add_metadata(MetadataName.OPENED, metadata)
            if recovery is not None:
                self._file.add_metadata(MetadataName.RECOVERY, recovery)
            self._file.add_attachment(CONFIG_NAME, "application/toml", config_text.encode(), opened_ns)
            self._file.sync()
        except RecordingError:
            self._file.discard()
            raise

    @property
    def is_open(self) -> bool:
        """Whether the file accepts more records."""
        return self._file.is_open

    @property
    def part(self) -> Path:
        """Path of the file until `finish`."""
        return self._file.part

    @property
    def size(self) -> int:
        """Bytes in the file so far [1]."""
        return self._file.size

    def space(self, now_ns: int) -> Space:
        """Return the free space at the recording's location and how long it will last."""
        return self._disk_use.judge(now_ns, self._file.size, self._file.free_bytes())

    def write(self, record: Record, number: int, log_time_ns: int) -> None:
        """Write the next record from the server.

        ``number``: number on the log channel; records arrive in order and without gaps (`note_lost` closes gaps).
        """
        self._begin(number)
        if isinstance(record, TickRecord):
            self._ticks.add(record.row, log_time_ns)
        else:
            message = stamped(record)
            self._file.add(IDS[message.topic], message, log_time_ns)
        self.next_record = number + 1
        self._written += 1

    def write_ticks(self, rows: NDArray[Any], number: int, log_times_ns: NDArray[np.int64]) -> None:
        """Write the records of consecutive ticks, each with its log time [ns]; ``number`` is that of the first."""
        self._begin(number)
        self._ticks.extend(rows, log_times_ns)
        self.next_record = number + len(rows)
        self._written += len(rows)

    def note_lost(self, first: int, count: int, log_time_ns: int) -> None:
        """Record that these records are permanently lost."""
        self._begin(first)
        details = {"first": str(first), "count": str(count), "after_tick": str(self._ticks.last)}
        self.remark("log_lost", details, log_time_ns)
        self.next_record = first + count
        self.lost += count

    def note_unreadable(self, frame: bytes, number: int, reason: str, log_time_ns: int) -> None:
        """Store an unreadable record as raw bytes and count it as lost."""
        self._begin(number)
        self.remark("log_unreadable", {"number": str(number), "reason": reason, "hex": frame.hex()}, log_time_ns)
        self.note_lost(number, 1, log_time_ns)

    def _begin(self, number: int) -> None:
        """Check the number of the next record, and store the first number as metadata."""
        if self.next_record is None:
            self._file.add_metadata(MetadataName.FIRST, {"record": str(number)})
            self.durable = number
        elif number != self.next_record:
            raise ValueError(f"record {number} where {self.next_record} is next")

    def remark(self, name: str, details: dict[str, str], log_time_ns: int) -> None:
        """Write a log message of the logger itself."""
        self._file.add(IDS["/logger"], remark(self._remarks, name, details, log_time_ns), log_time_ns)
        self._remarks += 1

    def is_due(self, now_ns: int) -> bool:
        """Return True if unflushed data have waited for the flush interval."""
        return self.durable != self.next_record and now_ns - self._flushed_ns >= self._flush_ns

    def flush(self, now_ns: int) -> int | None:
        """Put everything written on disk and return `durable`.

        Raises `RecordingError` if the disk is gone: the file is then closed and can be recovered. Or if the disk is
        full, or the file was deleted or moved: the file is then still open, and `finish` saves what was written.
        """
        self._ticks.close_batch()
        self._file.sync()
        self._flushed_ns = now_ns
        self.durable = self.next_record
        return self.durable

    def finish(self, now_ns: int, ended: str = "complete") -> None:
        """Write the index and give the file its final name.

        ``ended``: ``complete`` if the server ended the session; otherwise the reason why the file ends here.
        """
        self._ticks.finish(now_ns)
        end = {"ended": ended, "log_ns": str(now_ns), "records": str(self._written), "lost": str(self.lost)}
        if self.next_record is not None:
            end["next_record"] = str(self.next_record)
        self._file.add_metadata(MetadataName.END, end)
        self._file.finish()
        self.durable = self.next_record

    def abandon(self) -> None:
        """Close the unfinished file and leave it as it is, or delete it if the recording is repeatable."""
        self._file.abandon()
