"""Checks that time stamps in a recording never decrease and that ticks are 1 ms apart unless the server stalled."""

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from mcap.reader import make_reader

from netboard.base.tick import TICK_NS
from netboard.network.protocol.records import EventRecord
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.severity import Finding, Grade, numbers_in_words
from netboard.recording.integrity.walk import Walk

_LONGEST_BATCH_NS = 5_000_000_000


def check_time(
    recording: Recording, seen: Walk, events: Sequence[EventRecord], remarks: Sequence[EventRecord]
) -> Iterator[Finding]:
    """Check that time never decreases, and that ticks are 1 ms apart except where the server reported a stall.

    If records were lost, the server's reports may be among them. A counterfactual has the times of its source without
    the source's events.
    """
    problems = []
    stood_ms: Counter[int] = Counter()
    for event in events:
        if event.name == "stood_still":
            stood_ms[event.tick] += int(event.details["milliseconds"])
    untold = "what_if" in recording.metadata or bool(recording.recovery.get("damage"))
    noted_after = lost_after(remarks)
    before = {gap.first + gap.count: gap.first - 1 for gap in seen.gaps}
    wrong = [
        tick
        for tick, more_ns in seen.jumps
        if more_ns != stood_ms[tick] * TICK_NS
        and not (_goes_on(more_ns) and (untold or before.get(tick, tick - 1) in noted_after))
    ]
    if wrong:
        problems.append(f"{len(wrong)} ticks are not 1 ms after the one before: {numbers_in_words(np.array(wrong))}")
    back = [b.seq for a, b in pairwise(events) if b.time_ns < a.time_ns]
    if back:
        problems.append(f"{len(back)} events are earlier than the one before: {numbers_in_words(np.array(back))}")
    if stepped := _log_time_steps(recording.path):
        problems.append(f"the log time goes back at {stepped} chunks")
    yield from (Finding("time", Grade.DAMAGE, problem) for problem in problems)
    if stood_ms:
        text = f"the server stood still {len(stood_ms)} times, for {stood_ms.total()} ms in all"
        yield Finding("time", Grade.LOSS, text)
    if not problems:
        yield Finding("time", Grade.SOUND, f"ticks are 1 ms apart over {seen.count * 1e-3:.3f} s, no stamp goes back")


def _goes_on(more_ns: int) -> bool:
    """Return True for a jump that a stalled server makes: forward by whole ticks."""
    return more_ns > 0 and more_ns % TICK_NS == 0


def _log_time_steps(path: Path) -> int:
    """Count the chunks that begin before the end of an earlier chunk, by the file's own index.

    Ticks are written in batches, later than events that occurred while the batch grew. This delay does not count.
    """
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    chunks = [] if summary is None else sorted(summary.chunk_indexes, key=lambda chunk: chunk.chunk_start_offset)
    times = np.array([(c.message_start_time, c.message_end_time) for c in chunks], np.int64).reshape(-1, 2)
    ended = np.maximum.accumulate(times[:, 1])[:-1]
    return int(np.count_nonzero(times[1:, 0] < ended - _LONGEST_BATCH_NS))


def lost_after(remarks: Sequence[EventRecord]) -> Counter[int]:
    """Count the records that the logger noted as lost directly after each tick."""
    lost: Counter[int] = Counter()
    for remark in remarks:
        if remark.name == "log_lost":
            lost[int(remark.details.get("after_tick", -1))] += int(remark.details["count"])
    return lost
