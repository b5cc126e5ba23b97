"""``netboard bench recovery``: recovery of recordings that were cut, altered, or left by a killed logger.

In each case the source must be unchanged, every undamaged chunk must be restored to the bit, every loss must be
reported, and the recovered file must pass the integrity check. Any violation is a fault, with exit code 1.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from netboard.base.config import Config
from netboard.base.tick import TICK_SECONDS
from netboard.benchmarks.harness.results import Folder, Part, Value, Verdict
from netboard.benchmarks.harness.running import Tell
from netboard.benchmarks.recording.damage import (
    LONGEST,
    Found,
    Harm,
    cuts,
    cuts_of_last_chunk,
    flips,
    kill_one,
    try_one,
    zeroed,
)
from netboard.benchmarks.recording.feeding import live_log
from netboard.benchmarks.recording.specimen import Specimen, make_specimen
from netboard.nodes.ports.record_store import BATCH_RECORDS

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
