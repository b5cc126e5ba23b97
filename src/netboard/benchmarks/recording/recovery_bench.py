"""``netboard bench recovery``: recovery of recordings that were cut, altered, or left by a killed logger.

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
from netboard.benchmarks.harness.results import Folder, Part, Value, Verdict
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

MAX_STRETCH = 4096
"""Longest destroyed stretch, in bytes: one disk sector [1]."""

SHORTEST, LONGEST = 0.05, 1.5
"""Shortest and longest time from the first record to the kill of a logger, which is random [s]."""


@dataclass(frozen=True)
class Harm:
    """A damaged copy of a recording.

    - `start`, `stop`: range of the changed bytes; a cut reaches to the end [1].
    """

    data: bytes
    start: int
    stop: int


@dataclass(frozen=True)
class Found:
    """Result for one damaged file, or for the file of one killed logger.

    - `lost`: ticks of the damaged file, or sent to the logger, that are not in the recovered file [1].
    - `seconds`: duration of the recovery [s].
    """

    faults: tuple[str, ...]
    lost: int
    refused: bool
    seconds: float


def cuts_of_last_chunk(whole: Specimen, step: int) -> Iterator[Harm]:
    """Yield copies cut within the last chunk with ticks, at every byte or every `step` bytes."""
    piece = [piece for piece in whole.pieces if piece.ticks[1]][-1]
    for at in range(piece.start, piece.stop, step):
        yield _cut(whole, at)


def cuts(whole: Specimen, count: int, chance: np.random.Generator) -> Iterator[Harm]:
    """Yield copies cut at random places."""
    for at in chance.integers(len(MAGIC), len(whole.data), count):
        yield _cut(whole, int(at))


def flips(whole: Specimen, count: int, chance: np.random.Generator) -> Iterator[Harm]:
    """Yield copies with one byte changed at random."""
    for at in chance.integers(0, len(whole.data), count):
        data = bytearray(whole.data)
        data[at] ^= int(chance.integers(1, 256))
        yield Harm(bytes(data), int(at), int(at) + 1)


def zeroed(whole: Specimen, count: int, chance: np.random.Generator) -> Iterator[Harm]:
    """Yield copies with a random stretch set to zero."""
    for at in chance.integers(0, len(whole.data), count):
        stop = min(len(whole.data), int(at) + int(chance.integers(1, MAX_STRETCH)))
        yield Harm(whole.data[:at] + bytes(stop - at) + whole.data[stop:], int(at), stop)


def _cut(whole: Specimen, at: int) -> Harm:
    return Harm(whole.data[:at], at, len(whole.data))


def try_one(whole: Specimen, harm: Harm, folder: Path) -> Found:
    """Recover a damaged file and check the result completely."""
    source, output = folder / "harmed.mcap.part", folder / "recovered.mcap"
    output.unlink(missing_ok=True)
    source.write_bytes(harm.data)
    faults: list[str] = []
    began = time.perf_counter()
    try:
        report, seconds = _recovered(source, output, faults)
    except RecordingError:
        # Allowed only if the damage hides the type or the version of the file, which its first bytes state.
        known = harm.start >= whole.pieces[0].start
        wrong = ("a recording was refused whose beginning is sound",) if known else ()
        return Found(wrong, len(whole.rows), True, time.perf_counter() - began)
    try:
        numbers = _read(whole, output, faults)
    except RecordingError as error:
        return Found((*faults, f"the recovered file is not sound: {error}"), len(whole.rows), False, seconds)
    _judge(whole, harm, report, numbers, faults)
    had = sum(stop - first for first, stop in (p.ticks for p in whole.pieces if p.start < len(harm.data)))
    return Found(tuple(faults), had - len(numbers), False, seconds)


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


def _read(whole: Specimen, output: Path, faults: list[str]) -> "set[int]":
    """Read a recovered file, and check that its ticks equal those written, bit for bit."""
    rows = _checked_ticks(output)
    numbers = rows["tick"]
    if numbers.size and (numbers.min() < 0 or numbers.max() >= len(whole.rows)):
        faults.append("a tick that never was")
    elif rows.tobytes() != whole.rows[numbers].tobytes():
        faults.append("a tick that is not what it was")
    return set(numbers.tolist())


def _judge(whole: Specimen, harm: Harm, report: RecoveryReport, numbers: "set[int]", faults: list[str]) -> None:
    """Check that the undamaged part is present and that every loss is reported."""
    for piece in whole.pieces:
        touched = piece.start < harm.stop and harm.start < piece.stop
        there = numbers.issuperset(range(*piece.ticks))
        if not touched and not there:
            faults.append(f"the chunk at {piece.start} is lost, and was not damaged")
        if touched and not there and not _told(piece, harm, report):
            faults.append(f"the chunk at {piece.start} is lost, and nothing was said")
    if report.missing != find_gaps(np.array(sorted(numbers), np.int64)):
        faults.append("the missing ticks are not those that were named")
    if numbers and (report.first_tick, report.last_tick) != (min(numbers), max(numbers)):
        faults.append("first and last tick are not those that were named")


def _told(piece: Piece, harm: Harm, report: RecoveryReport) -> bool:
    """Return whether the loss of a chunk was reported, by its offset and length or as a missing end."""
    end = min(piece.stop, len(harm.data))
    if end <= piece.start:
        return not report.finished
    at = max(piece.start, min(harm.start, end - 1))
    return any(part.offset <= at < part.offset + part.length for part in report.damage)


def kill_one(folder: Path, log: list[list[bytes]], chance: np.random.Generator) -> Found:
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
    part = next((folder / "recordings").glob("*.part"), None)
    if part is None:
        faults = ["records were acknowledged, and there is no file"] if acknowledged else []
        return Found(tuple(faults), made, False, 0.0)
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
    return Found(tuple(faults), made - count, False, seconds)


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
"""Distance between cuts of the last chunk in the short form, in bytes [1]."""

SEED = 7
_MEMORY = Path("/dev/shm")

COLUMNS = (
    *("damage", "cases [1]", "recovered [1]", "refused, and said so [1]", "faults [1]"),
    *("lost, 50 % [ms]", "lost, most [ms]", "recovery, 50 % [ms]", "recovery, longest [ms]"),
)


def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[Part]:
    """Damage, kill, recover.

    - `folder`: folder of the killed loggers, on the disk under test.
    """
    # The damaged files are in memory, because thousands of them on a disk would take too long.
    with TemporaryDirectory(dir=_MEMORY if _MEMORY.exists() else None) as scratch:
        yield damage_part(Path(scratch), tell, quick=quick)
    yield kills_part(folder.path / "killed", tell, QUICK_KILLS if quick else KILLS)


def damage_part(scratch: Path, tell: Tell, *, quick: bool) -> Part:
    """Damage a file in four ways, and recover each copy."""
    whole = make_specimen(scratch / "whole.mcap", QUICK_TICKS if quick else TICKS)
    count, chance = QUICK_CASES if quick else CASES, np.random.default_rng(SEED)
    ways: dict[str, Callable[[], Iterator[Harm]]] = {
        "cut in the last chunk" + ("" if quick else ", at every byte"): lambda: cuts_of_last_chunk(
            whole, QUICK_STEP if quick else 1
        ),
        "cut anywhere": lambda: cuts(whole, count, chance),
        "a byte changed": lambda: flips(whole, count, chance),
        "a stretch of zeros": lambda: zeroed(whole, count, chance),
    }
    rows, faults = [], []
    for number, (name, harms) in enumerate(ways.items()):
        found = []
        for done, harm in enumerate(harms()):
            found.append(try_one(whole, harm, scratch))
            tell(f"{name}: {done + 1}", (number + 0.5) / (len(ways) + 1))
        rows.append(_row(name, found))
        faults += [f"{name}: {fault}" for one in found for fault in one.faults]
    part = Part(
        "damage",
        f"A recording of {len(whole.rows)} ticks in {len(whole.pieces)} chunks and {len(whole.data)} bytes, damaged",
        COLUMNS,
        rows,
    )
    part.claim(
        "what was not touched is there to the bit, all loss is said, the source is untouched, the file sound",
        not faults,
        _said(faults, sum(int(row[1]) for row in rows)),
    )
    part.verdicts.append(_chunk_verdict(whole, rows))
    return part


def _chunk_verdict(whole: Specimen, rows: list[tuple[Value, ...]]) -> Verdict:
    """Judge whether a cut or a changed byte costs at most one chunk."""
    longest = max(stop - first for first, stop in (piece.ticks for piece in whole.pieces)) * TICK_SECONDS * 1e3
    worst = max(float(row[6]) for row in rows[:3])
    return Verdict("a cut or a changed byte costs one chunk at most", worst <= longest, f"{worst:g} of {longest:g} ms")


def kills_part(folder: Path, tell: Tell, count: int) -> Part:
    """Kill loggers, and tabulate the ticks lost."""
    log, chance = live_log(round(2e3 * LONGEST)), np.random.default_rng(SEED)
    found = []
    for number in range(count):
        tell(f"logger killed: {number + 1} of {count}", 0.8 + 0.2 * number / count)
        found.append(kill_one(folder, log, chance))
    faults = [fault for one in found for fault in one.faults]
    flush = Config().recording.flush_ms
    allowed = flush + BATCH_RECORDS
    worst = max(one.lost for one in found) * TICK_SECONDS * 1e3
    part = Part(
        "kills",
        f"A logger that takes a session's records over a socket, killed (SIGKILL) within {LONGEST:g} s of the first",
        COLUMNS,
        [_row("logger killed", found)],
    )
    part.claim("all that was acknowledged is there, to the bit and without a hole", not faults, _said(faults, count))
    part.claim(
        f"less is lost than flush_ms ({flush:g} ms) and a batch ({BATCH_RECORDS} records)",
        worst < allowed,
        f"at most {worst:.0f} ms; what is lost is still in the server's ring",
    )
    return part


def _said(faults: list[str], cases: int) -> str:
    return f"no fault in {cases} cases" if not faults else f"{len(faults)} faults, such as: {faults[0]}"


def _row(name: str, found: list[Found]) -> tuple[Value, ...]:
    """Summarise cases: numbers, and the median and the largest of the time lost and of the recovery [ms]."""
    sound = [one for one in found if not one.refused]
    lost, seconds = np.array([one.lost for one in sound]) * TICK_SECONDS, np.array([one.seconds for one in sound])
    times = (1e3 * float(of(values)) for values in (lost, seconds) for of in (np.median, np.max))
    return (name, len(found), len(sound), len(found) - len(sound), sum(len(one.faults) for one in found), *times)
