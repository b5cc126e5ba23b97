"""Recovers an unfinished, damaged or wrongly joined recording into new files; the source is never changed.

`netboard.recording.recovery.scan` finds what is readable, `netboard.recording.recovery.assembly` decides which of it is
one recording. This module writes each recording, its ticks in order and each once, and reports what was lost, what was
left out, and whose recordings they are.
"""

import os
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from heapq import merge
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.records import Attachment
from numpy.typing import NDArray

from netboard.base.config import parse
from netboard.base.errors import ConfigError, RecordingError
from netboard.base.plural import plural
from netboard.base.system.locks import lock
from netboard.network.protocol.records import EventRecord
from netboard.recording.files.locate import EMPTY, recovered_path, require_file
from netboard.recording.files.provenance import (
    CONFIG_NAME,
    LIBRARY,
    SEQUENCE,
    MetadataName,
    config_sha256,
    has_every_number,
    recovered_name,
)
from netboard.recording.files.reader import Recording
from netboard.recording.format import older
from netboard.recording.format.batches import TickStream
from netboard.recording.format.channels import (
    FORMAT_VERSION,
    IDS,
    LOG_TOPICS,
    TICKS,
    Stamped,
    block_config,
    read_record,
)
from netboard.recording.format.chunks import ChunkMessage
from netboard.recording.format.claims import shown
from netboard.recording.format.partfile import PartFile, require_new
from netboard.recording.format.predictions import UNKNOWN, constants_of
from netboard.recording.format.summary import Gap, find_gaps
from netboard.recording.recovery.assembly import FoundRecording, Stretch, assemble
from netboard.recording.recovery.chunk_reader import TOPICS, digest
from netboard.recording.recovery.scan import Damage, mapped

_COPIED_METADATA = (MetadataName.OPENED, MetadataName.FIRST, MetadataName.END)
_COPIED = frozenset(IDS) - {TICKS, "/plot"}  # `TickStream` writes both anew
_CHUNK_BYTES = 2**18
_TIMES = {2: "twice"}


@dataclass(frozen=True, slots=True)
class RecoveryReport:
    """What was recovered of a recording in a file, and what was not."""

    source: Path
    output: Path
    chunks: int
    messages: dict[str, int]
    first_tick: int | None
    last_tick: int | None
    missing: tuple[Gap, ...]
    damage: tuple[Damage, ...]  # with which records may be lost
    finished: bool
    has_config: bool
    left_out: tuple[str, ...] = ()  # what the file has besides this recording, in words; nothing is lost with it
    whose: str = ""  # dyad, session and block, in words

    @property
    def lost_bytes(self) -> int:
        """Number of unusable bytes [1]."""
        return sum(damage.length for damage in self.damage)


def require_finished(path: Path) -> None:
    """Refuse a file that is being written: a copy of its beginning would later pass for the whole recording."""
    require_file(path)
    try:
        with path.open("rb") as file:
            lock(file.fileno(), shared=True)
    except BlockingIOError:
        raise RecordingError(f"{path}: is still being written; recover it after its session has ended") from None
    except OSError:
        return  # a file system without locks, or a file that cannot be read


def is_whole(path: Path) -> bool:
    """Return whether a file is one finished recording that all commands can read to its end."""
    try:
        with Recording(path) as recording:
            recording.check()
            recording.attempts()
            recording.remarks()
            for _ in recording.batches(names=("tick",)):
                pass
            recording.gaps()
    except RecordingError:
        return False
    return True


def recover(path: Path, output: Path | None = None) -> RecoveryReport:
    """Recover a file with one recording: return the first report of `recover_all`."""
    return recover_all(path, output)[0]


def recover_all(path: Path, output: Path | None = None) -> tuple[RecoveryReport, ...]:
    """Write a complete recording with all valid data of each recording in an unfinished or damaged file.

    The first one, with which the file begins, is written to `output`, by default `recovered_path`, and others beside it
    under their own names. Raises `ConfigError` if an output exists, and `RecordingError` if the source is not MCAP or
    has another format version, its recordings cannot be told apart, or an output cannot be written; then none is left.
    """
    with mapped(path) as data:
        if not data:
            raise RecordingError(f"{path}: {EMPTY}")
        try:
            found = assemble(path, data)
        except RecordingError as error:
            named = str(error).startswith(f"{path}: ")
            raise RecordingError(str(error) if named else f"{path}: {error}") from None
        if not found:
            raise RecordingError(f"{path}: not an MCAP file, so it cannot be recovered")
        writers: list[_Writer] = []
        for one in found:
            taken = [writer.target for writer in writers]
            writers.append(_Writer(path, len(data), one, _target(path, output, one, taken)))
        return tuple(_write_all(writers))


def _target(path: Path, output: Path | None, found: FoundRecording, taken: Sequence[Path]) -> Path:
    """Return the path of a recording: that of the output for the first, and its own name beside it for others."""
    first = output or recovered_path(path)
    if not taken:
        return first
    nameless = f"{first.stem.removesuffix('.recovered')}_other.recovered.mcap"
    target = first.with_name(recovered_name(found.opened) or nameless)
    stem, number = target.name.removesuffix(".recovered.mcap"), 2
    while target in taken or target.exists():  # as one recovered from another file
        target = target.with_name(f"{stem}_{number}.recovered.mcap")
        number += 1
    return target


def _write_all(writers: "Sequence[_Writer]") -> Iterator[RecoveryReport]:
    """Write all recordings of a file, or none."""
    for writer in writers:
        require_new(writer.target)
    done: list[Path] = []
    try:
        for writer in writers:
            yield writer.write()
            done.append(writer.target)
    except BaseException:
        for path in done:
            path.unlink(missing_ok=True)
        raise


class _TickSlice(NamedTuple):
    """Consecutive ticks of a chunk."""

    stretch: Stretch
    listed: int  # number of the chunk in the stretch
    first: int
    stop: int


class _Writer:
    """Writes one of the recordings in a file."""

    def __init__(self, source: Path, size: int, found: FoundRecording, target: Path) -> None:
        self.target = target
        self._source, self._size, self._found = source, size, found
        self._numbers = np.unique(found.numbers)
        self._config = self._find_config()
        self._counts: Counter[str] = Counter({TICKS: len(self._numbers)})
        for entry in self._others():
            self._counts[TOPICS[entry.channel_id]] += 1

    def _find_config(self) -> Attachment | None:
        """Return the configuration, or its copy in the event with which the server began the block."""
        expected = self._found.opened.get("config_sha256")
        for config in self._found.configs:
            if expected in (None, config_sha256(config.data)):
                return config
        for entry in self._others():
            if TOPICS[entry.channel_id] == "/event" and (text := block_config(read_record(EventRecord, entry.data))):
                return Attachment(entry.log_time_ns, entry.log_time_ns, CONFIG_NAME, "application/toml", text.encode())
        return None

    def write(self) -> RecoveryReport:
        """Write the recording."""
        found, config = self._found, self._config
        damage, left_out = self._losses()
        opened = {"session": "unknown", **found.opened, "format": FORMAT_VERSION}
        recovery = recovery_metadata(self._source, self._size, damage, config is not None, left_out)
        if earlier := found.metadata.get(MetadataName.RECOVERY, {}).get("damage"):
            recovery["damage"] = "; ".join(filter(None, (earlier, recovery["damage"])))
        if config is not None:
            opened["config_sha256"] = config_sha256(config.data)
        self._copy({**found.metadata, MetadataName.OPENED: opened}, recovery)
        return RecoveryReport(
            source=self._source,
            output=self.target,
            chunks=sum(len(stretch.listed) for stretch in found.stretches),
            messages={topic: self._counts[topic] for topic in IDS if topic != "/plot"},
            first_tick=int(self._numbers[0]) if len(self._numbers) else None,
            last_tick=int(self._numbers[-1]) if len(self._numbers) else None,
            missing=find_gaps(self._numbers),
            damage=damage,
            finished=found.finished,
            has_config=config is not None,
            left_out=left_out,
            whose=_whose(opened, config, found),
        )

    def _losses(self) -> tuple[tuple[Damage, ...], tuple[str, ...]]:
        """Return the damage with which records may be lost, and what is left out without a loss."""
        end = self._found.metadata.get(MetadataName.END, {})
        written = sum(self._counts[topic] for topic in LOG_TOPICS)
        sound = self._found.has_header and self._found.finished and has_every_number(self._found.metadata)
        has_all = sound and self._config is not None and end.get("records") == str(written)
        damage = tuple(self._found.damage)
        spared = damage if has_all else ()
        left_out = (
            *_repeats(self._found.again),
            *(f"{part.length} bytes at {part.offset}, {part.reason}" for part in spared),
        )
        return () if has_all else damage, left_out

    def _copy(self, metadata: dict[str, dict[str, str]], recovery: dict[str, str]) -> None:
        """Write the new file."""
        out = PartFile(self.target, LIBRARY, _CHUNK_BYTES, repeatable=True)
        stream = TickStream(out, _CHUNK_BYTES, _constants_of(self._config, self._found.version))
        log_ns = 0
        try:
            for name in _COPIED_METADATA:
                if name in metadata:
                    out.add_metadata(name, metadata[name])
            out.add_metadata(MetadataName.RECOVERY, recovery)
            if self._config is not None:
                out.add_attachment(CONFIG_NAME, self._config.media_type, self._config.data, self._config.log_time)
            for at_ns, entry in self._in_order():
                log_ns = max(log_ns, at_ns)
                if isinstance(entry, ChunkMessage):
                    stamped = Stamped(TOPICS[entry.channel_id], entry.sequence, entry.publish_time_ns, entry.data)
                    out.add(entry.channel_id, stamped, entry.log_time_ns)
                else:
                    rows = entry.stretch.reader.rows(entry.stretch.listed[entry.listed].chunk)
                    stream.extend(rows.ticks[entry.first : entry.stop], rows.log_ns[entry.first : entry.stop])
            stream.finish(log_ns)
            out.finish()
        except BaseException:
            out.abandon()
            raise

    def _in_order(self) -> Iterator[tuple[int, Any]]:
        """Yield ticks and other messages in the order of their log times."""
        others = ((entry.log_time_ns, entry) for entry in self._others())
        return merge(others, self._tick_slices(), key=lambda one: one[0])

    def _others(self) -> Iterator[ChunkMessage]:
        """Yield the messages other than ticks, each once."""
        streams = [_copied(stretch) for stretch in self._found.stretches]
        if len(streams) == 1:
            yield from streams[0]
            return
        seen: set[bytes] = set()
        for entry in merge(*streams, key=lambda entry: entry.log_time_ns):
            if (known := digest(entry)) not in seen:
                seen.add(known)
                yield entry

    def _tick_slices(self) -> Iterator[tuple[int, _TickSlice]]:
        """Yield the ticks in order, each once, as slices of chunks, with the log time of their last."""
        found = self._found
        chunks = [(stretch, k) for stretch in found.stretches for k in range(len(stretch.listed))]
        counts = [len(stretch.listed[k].numbers) for stretch, k in chunks]
        starts = np.cumsum([0, *counts])
        first = np.unique(found.numbers, return_index=True)[1]
        of_chunk = np.searchsorted(starts, first, side="right") - 1
        cuts = np.flatnonzero((np.diff(first) != 1) | (np.diff(of_chunk) != 0)) + 1
        for part in np.split(first, cuts) if len(first) else ():
            number = int(np.searchsorted(starts, part[0], side="right")) - 1
            stretch, k = chunks[number]
            at = _TickSlice(stretch, k, int(part[0] - starts[number]), int(part[-1] - starts[number]) + 1)
            yield int(stretch.reader.rows(stretch.listed[k].chunk).log_ns[at.stop - 1]), at


def _copied(stretch: Stretch) -> Iterator[ChunkMessage]:
    """Yield the messages of a stretch other than ticks, in file order."""
    for entry in chain.from_iterable(stretch.reader.entries(one.chunk) for one in stretch.listed):
        if TOPICS.get(entry.channel_id) in _COPIED:
            yield entry


def _repeats(again: NDArray[np.int64]) -> Iterator[str]:
    """Yield what a file has more than once, in words."""
    if len(again):
        numbers, counts = np.unique(again, return_counts=True)
        most = int(counts.max()) + 1
        holes = np.flatnonzero(np.diff(numbers) > 1)
        where = f"{numbers[0]} to {numbers[-1]}" + (f" in {len(holes) + 1} parts" if len(holes) else "")
        yield (
            f"{plural(len(again), 'tick')} that the file has {_TIMES.get(most, f'up to {most} times')} ({where}), all "
            "identical"
        )


def _whose(opened: dict[str, str], config: Attachment | None, found: FoundRecording) -> str:
    """Return to whom a recording belongs, in words."""
    known = dict(opened)
    if "dyad" not in known and config is not None:
        try:
            parsed = parse(older.config_of(config.data.decode(), found.version))
        except (ConfigError, UnicodeDecodeError):
            pass
        else:
            known |= {"dyad": parsed.session.dyad, "name": parsed.session.name, "block": str(parsed.block.number)}
    named = (("dyad", "dyad"), ("name", "session"), ("block", "block"))
    words = [f"{word} {shown(known[key])}" for key, word in named if key in known]
    if known.get("part", "1") != "1":
        words.append(f"part {shown(known['part'])}")
    whose = ", ".join(words) or "of unknown origin: its metadata are lost"
    return f"{whose}; differs from another one in the file that has the same metadata" if found.conflict else whose


def recovery_metadata(
    path: Path, size: int, damage: Sequence[Damage], has_config: bool, left_out: Sequence[str] = ()
) -> dict[str, str]:
    """Return the recovery metadata of the new file."""
    return {
        "source": os.fsencode(path.name).decode(errors="backslashreplace"),  # a name may be invalid UTF-8
        "source_bytes": str(size),
        "damage": "; ".join(f"{part.length} bytes at {part.offset}: {part.reason}" for part in damage),
        "left_out": "; ".join(left_out),
        SEQUENCE: "one recording, each tick once",
        "config": "recovered" if has_config else "lost",
        "by": LIBRARY,
    }


def _constants_of(config: Attachment | None, version: str) -> dict[str, float]:
    """Return the constants with which the columns of the new file are predicted."""
    if config is None:
        return UNKNOWN
    try:
        return constants_of(parse(older.config_of(config.data.decode(), version)))
    except (ConfigError, UnicodeDecodeError):
        return UNKNOWN
