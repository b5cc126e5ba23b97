"""``make evidence ARGS=recovery``: recovery of recordings that were cut, altered, or left by a killed logger.

In each case the source must be unchanged, every undamaged chunk must be restored to the bit, every loss must be
reported, and the recovered file must pass the integrity check. Any violation is a fault, with exit code 1.
"""

import hashlib
import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import Config
from netboard.base.errors import RecordingError
from netboard.base.tick import TICK, TICK_SECONDS
from netboard.benchmarks.harness.results import Folder, ResultPart, Value
from netboard.benchmarks.harness.running import Tell
from netboard.benchmarks.recording.feeding import Feeder, live_log
from netboard.benchmarks.recording.specimen import Piece, Specimen, make_specimen
from netboard.network.protocol.codec import decode
from netboard.network.protocol.records import TickRecord
from netboard.nodes.ports.record_store import BATCH_RECORDS
from netboard.recording.files.reader import Recording
from netboard.recording.format.chunks import MAGIC
from netboard.recording.format.summary import find_gaps
from netboard.recording.recovery.recover import RecoveryReport, recover

MAX_DAMAGE = 4096
"""Longest stretch that is set to zero: one disk sector [bytes]."""

MIN_KILL_TIME, MAX_KILL_TIME = 0.05, 1.5
"""Shortest and longest time from the first record to the kill of a logger, which is random [s]."""


@dataclass(frozen=True)
class DamagedCopy:
    """A damaged copy of a recording.

    - `start`, `stop`: range of the changed bytes; that of a cut ends with the file [1].
    """

    data: bytes
    start: int
    stop: int


@dataclass(frozen=True)
class Recovery:
    """Result for one damaged file, or for the file of one killed logger.

    - `lost`: ticks of the damaged file, or sent to the logger, that are not in the recovered file [1].
    - `seconds`: duration of the recovery [s].
    """

    faults: tuple[str, ...]
    lost: int
    refused: bool
    seconds: float


def cuts_of_last_chunk(specimen: Specimen, step: int) -> Iterator[DamagedCopy]:
    """Yield copies cut within the last chunk with ticks, at every byte or every `step` bytes."""
    piece = [piece for piece in specimen.pieces if piece.ticks[1]][-1]
    for at in range(piece.start, piece.stop, step):
        yield _cut(specimen, at)


def cuts(specimen: Specimen, count: int, chance: np.random.Generator) -> Iterator[DamagedCopy]:
    """Yield copies cut at random places."""
    for at in chance.integers(len(MAGIC), len(specimen.data), count):
        yield _cut(specimen, int(at))


def byte_changes(specimen: Specimen, count: int, chance: np.random.Generator) -> Iterator[DamagedCopy]:
    """Yield copies with one byte changed at random."""
    for at in chance.integers(0, len(specimen.data), count):
        data = bytearray(specimen.data)
        data[at] ^= int(chance.integers(1, 256))
        yield DamagedCopy(bytes(data), int(at), int(at) + 1)


def zero_stretches(specimen: Specimen, count: int, chance: np.random.Generator) -> Iterator[DamagedCopy]:
    """Yield copies with a random stretch set to zero."""
    for at in chance.integers(0, len(specimen.data), count):
        stop = min(len(specimen.data), int(at) + int(chance.integers(1, MAX_DAMAGE)))
        yield DamagedCopy(specimen.data[:at] + bytes(stop - at) + specimen.data[stop:], int(at), stop)


def _cut(specimen: Specimen, at: int) -> DamagedCopy:
    return DamagedCopy(specimen.data[:at], at, len(specimen.data))


def recover_one(specimen: Specimen, damaged: DamagedCopy, folder: Path) -> Recovery:
    """Recover a damaged file and check the result completely."""
    source, output = folder / "harmed.mcap.part", folder / "recovered.mcap"
    output.unlink(missing_ok=True)
    source.write_bytes(damaged.data)
    faults: list[str] = []
    began = time.perf_counter()
    try:
        report, seconds = _recovered(source, output, faults)
    except RecordingError:
        # Allowed only if the damage hides the type or the version of the file, which its first bytes state.
        known = damaged.start >= specimen.pieces[0].start
        unexpected = ("a recording was refused whose beginning is sound",) if known else ()
        return Recovery(unexpected, len(specimen.rows), True, time.perf_counter() - began)
    try:
        numbers = _read(specimen, output, faults)
    except RecordingError as error:
        return Recovery((*faults, f"the recovered file is not sound: {error}"), len(specimen.rows), False, seconds)
    _check_losses(specimen, damaged, report, numbers, faults)
    had = sum(stop - first for first, stop in (p.ticks for p in specimen.pieces if p.start < len(damaged.data)))
    return Recovery(tuple(faults), had - len(numbers), False, seconds)


def _recovered(source: Path, output: Path | None, faults: list[str]) -> tuple[RecoveryReport, float]:
    """Recover a file and check that it is not changed; return the report and the duration [s]."""
    before = hashlib.sha256(source.read_bytes()).digest()
    began = time.perf_counter()
    report = recover(source, output)
    seconds = time.perf_counter() - began
    if hashlib.sha256(source.read_bytes()).digest() != before:
        faults.append("the source was changed")
    return report, seconds


def _checked_ticks(path: Path) -> NDArray[Any]:
    """Return the ticks of a recovered file, which must pass the integrity check."""
    with Recording(path) as recording:
        recording.check()
        return recording.ticks()


def _read(specimen: Specimen, output: Path, faults: list[str]) -> "set[int]":
    """Read a recovered file, and check that its ticks equal those written, bit for bit."""
    rows = _checked_ticks(output)
    numbers = rows["tick"]
    if numbers.size and (numbers.min() < 0 or numbers.max() >= len(specimen.rows)):
        faults.append("a tick that never was")
    elif rows.tobytes() != specimen.rows[numbers].tobytes():
        faults.append("a tick that is not what it was")
    return set(numbers.tolist())


def _check_losses(
    specimen: Specimen, damaged: DamagedCopy, report: RecoveryReport, numbers: "set[int]", faults: list[str]
) -> None:
    """Check that the undamaged part is present and that every loss is reported."""
    for piece in specimen.pieces:
        touched = piece.start < damaged.stop and damaged.start < piece.stop
        there = numbers.issuperset(range(*piece.ticks))
        if not touched and not there:
            faults.append(f"the chunk at {piece.start} is lost, and was not damaged")
        if touched and not there and not _is_reported(piece, damaged, report):
            faults.append(f"the chunk at {piece.start} is lost, and nothing was said")
    if report.missing != find_gaps(np.array(sorted(numbers), np.int64)):
        faults.append("the missing ticks are not those that were named")
    if numbers and (report.first_tick, report.last_tick) != (min(numbers), max(numbers)):
        faults.append("first and last tick are not those that were named")


def _is_reported(piece: Piece, damaged: DamagedCopy, report: RecoveryReport) -> bool:
    """Return whether the loss of a chunk was reported, by its offset and length or as a missing end."""
    end = min(piece.stop, len(damaged.data))
    if end <= piece.start:
        return not report.finished
    at = max(piece.start, min(damaged.start, end - 1))
    return any(part.offset <= at < part.offset + part.length for part in report.damage)


def kill_one(folder: Path, log: list[list[bytes]], chance: np.random.Generator) -> Recovery:
    """Feed a logger, kill it, recover its file, and compare it with the records sent.

    - `log`: the records of each millisecond, more than are sent.
    """
    with Feeder(folder, log) as feeder:
        feeder.wait_for_logger()
        feeder.feed(float(chance.uniform(MIN_KILL_TIME, MAX_KILL_TIME)))
        feeder.process.send_signal(signal.SIGKILL)
        feeder.process.wait()
        made = feeder.ticks
        feeder.port.pump(time.monotonic_ns())  # an acknowledgement may be on its way
        acknowledged = feeder.port.ring.acknowledged
    part = next((folder / "recordings").glob("*.part"), None)
    if part is None:
        faults = ["records were acknowledged, and there is no file"] if acknowledged else []
        return Recovery(tuple(faults), made, False, 0.0)
    faults = []
    report, seconds = _recovered(part, None, faults)
    rows = _checked_ticks(report.output)
    count, messages = len(rows), sum(report.messages.values())
    if rows["tick"].tolist() != list(range(count)) or find_gaps(rows["tick"]):
        faults.append("the recovered ticks have a hole")
    elif rows.tobytes() != b"".join(map(_row_of, log[:count])):
        faults.append("a tick is not what it was")
    if messages < acknowledged:
        faults.append(f"{acknowledged} records were acknowledged, {messages} are there")
    return Recovery(tuple(faults), made - count, False, seconds)


def _row_of(records: list[bytes]) -> bytes:
    """Return the tick of a millisecond."""
    record = decode(records[0])
    assert isinstance(record, TickRecord)
    assert len(record.row) == TICK.itemsize
    return record.row


TICKS, QUICK_TICKS = 1250, 650
"""Ticks of the recording that is damaged, in full and short form [1]."""

CASES, QUICK_CASES = 1000, 60
KILLS, QUICK_KILLS = 100, 4
QUICK_STEP = 400
"""Distance between cuts of the last chunk in the short form [bytes]."""

SEED = 7
_RAM_DISK = Path("/dev/shm")

COLUMNS = (
    *("damage", "cases [1]", "recovered [1]", "refused, and said so [1]", "faults [1]"),
    *("lost, 50 % [ms]", "lost, most [ms]", "recovery, 50 % [ms]", "recovery, longest [ms]"),
)


def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Recover damaged recordings, and those of killed loggers, which are in `folder`, on the disk under test."""
    # The damaged files are in memory, because thousands of them on a disk would take too long.
    with TemporaryDirectory(dir=_RAM_DISK if _RAM_DISK.exists() else None) as scratch:
        yield damage_part(Path(scratch), tell, quick=quick)
    yield kills_part(folder.path / "killed", tell, QUICK_KILLS if quick else KILLS)


def damage_part(scratch: Path, tell: Tell, *, quick: bool) -> ResultPart:
    """Damage a file in four ways, and recover each copy."""
    specimen = make_specimen(scratch / "whole.mcap", QUICK_TICKS if quick else TICKS)
    count, chance = QUICK_CASES if quick else CASES, np.random.default_rng(SEED)
    ways: dict[str, Callable[[], Iterator[DamagedCopy]]] = {
        "cut in the last chunk" + ("" if quick else ", at every byte"): lambda: cuts_of_last_chunk(
            specimen, QUICK_STEP if quick else 1
        ),
        "cut anywhere": lambda: cuts(specimen, count, chance),
        "a byte changed": lambda: byte_changes(specimen, count, chance),
        "a stretch of zeros": lambda: zero_stretches(specimen, count, chance),
    }
    rows, faults = [], []
    for number, (name, copies) in enumerate(ways.items()):
        found = []
        for done, damaged in enumerate(copies()):
            found.append(recover_one(specimen, damaged, scratch))
            tell(f"{name}: {done + 1}", (number + 0.5) / (len(ways) + 1))
        rows.append(_row(name, found))
        faults += [f"{name}: {fault}" for one in found for fault in one.faults]
    part = ResultPart(
        "damage",
        f"A recording of {len(specimen.rows)} ticks in {len(specimen.pieces)} chunks and {len(specimen.data)} bytes, "
        "damaged",
        COLUMNS,
        rows,
    )
    part.claim(
        "what was not touched is there to the bit, all loss is said, the source is untouched, the file sound",
        not faults,
        _fault_summary(faults, sum(int(row[1]) for row in rows)),
    )
    longest = max(stop - first for first, stop in (piece.ticks for piece in specimen.pieces)) * TICK_SECONDS * 1e3
    worst = max(float(row[6]) for row in rows[:3])
    part.claim("a cut or a changed byte costs one chunk at most", worst <= longest, f"{worst:g} of {longest:g} ms")
    return part


def kills_part(folder: Path, tell: Tell, count: int) -> ResultPart:
    """Kill loggers, and tabulate the ticks lost."""
    log, chance = live_log(round(2e3 * MAX_KILL_TIME)), np.random.default_rng(SEED)
    found = []
    for number in range(count):
        tell(f"logger killed: {number + 1} of {count}", 0.8 + 0.2 * number / count)
        found.append(kill_one(folder, log, chance))
    faults = [fault for one in found for fault in one.faults]
    flush = Config().recording.flush_ms
    allowed = flush + BATCH_RECORDS
    worst = max(one.lost for one in found) * TICK_SECONDS * 1e3
    part = ResultPart(
        "kills",
        "A logger that takes a session's records over a socket, killed (SIGKILL) within "
        f"{MAX_KILL_TIME:g} s of the first",
        COLUMNS,
        [_row("logger killed", found)],
    )
    part.claim(
        "all that was acknowledged is there, to the bit and without a hole", not faults, _fault_summary(faults, count)
    )
    part.claim(
        f"less is lost than flush_ms ({flush:g} ms) and a batch ({BATCH_RECORDS} records)",
        worst < allowed,
        f"at most {worst:.0f} ms; what is lost is still in the server's ring",
    )
    return part


def _fault_summary(faults: list[str], cases: int) -> str:
    return f"no fault in {cases} cases" if not faults else f"{len(faults)} faults, such as: {faults[0]}"


def _row(name: str, found: list[Recovery]) -> tuple[Value, ...]:
    """Summarise cases: numbers, and the median and the largest of the time lost and of the recovery [ms]."""
    sound = [one for one in found if not one.refused]
    lost, seconds = np.array([one.lost for one in sound]) * TICK_SECONDS, np.array([one.seconds for one in sound])
    times = (1e3 * float(of(values)) for values in (lost, seconds) for of in (np.median, np.max))
    return (name, len(found), len(sound), len(found) - len(sound), sum(len(one.faults) for one in found), *times)
