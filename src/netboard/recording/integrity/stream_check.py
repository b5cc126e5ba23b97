"""Checks the streams of a recording: numbers, losses, rendered forces, triggers, and times."""

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import chain, pairwise

import numpy as np

from netboard.base.config import SIDES
from netboard.base.plural import plural
from netboard.base.tick import TICK_NS
from netboard.network.protocol.records import EventRecord, FrameRecord
from netboard.network.protocol.triggers import TRIGGER, TRIGGER_LOST
from netboard.recording.files.reader import Recording
from netboard.recording.format.backfill import unknown_ticks
from netboard.recording.format.channels import LOG_TOPICS, NOT_EXACT, TICKS
from netboard.recording.format.summary import find_gaps
from netboard.recording.integrity.account import NumberRange, cause_of_loss
from netboard.recording.integrity.severity import CheckFinding, Severity, numbers_in_words
from netboard.recording.integrity.walk import ACTIVE, Examined
from netboard.task.trials.state_machine import Phase

_MAX_BATCH_NS = 5_000_000_000  # the largest recording.flush_ms


def check_numbers(evidence: Examined) -> Iterator[CheckFinding]:
    """Check that every stream is in order, and that the file notes every missing record."""
    recording = evidence.recording
    problems = [*_wrong_totals(evidence), *_wrong_ticks(evidence), *_wrong_records(evidence)]
    yield from (CheckFinding(Severity.DAMAGE, problem) for problem in problems)
    if not problems:
        words = ", ".join(f"{count} on {topic}" for topic, count in recording.counts.items() if count)
        yield CheckFinding(Severity.SOUND, f"in order: {words or 'no records'}")
    yield from chain(_missing_frames(recording.frames()), _noted_losses(evidence))


def _wrong_totals(evidence: Examined) -> Iterator[str]:
    """Compare the totals read with those in the file and with the log-channel numbers; yield the differences."""
    recording, read = evidence.recording, evidence.seen.count
    if read != recording.counts[TICKS]:
        yield f"{plural(read, 'tick was', 'ticks were')} read, but the file states {recording.counts[TICKS]}"
    end = recording.end
    if not {"records", "lost", "next_record"} <= end.keys() or recording.first_record is None:
        return
    written = sum(recording.counts[topic] for topic in LOG_TOPICS)
    if not recording.recovery and written != int(end["records"]):
        yield f"{written} records are there, and {end['records']} were written"
    span = int(end["next_record"]) - recording.first_record
    if span != int(end["records"]) + int(end["lost"]):
        yield (
            f"records {recording.first_record} to {int(end['next_record']) - 1} of the log channel are {span}, and "
            f"{end['records']} were written and {end['lost']} noted as lost"
        )


def _wrong_ticks(evidence: Examined) -> Iterator[str]:
    """Describe the ticks that are missing although the logger noted no loss; a reader refuses those out of order."""
    seen = evidence.seen
    noted_after = lost_after(evidence.remarks)
    unexplained = [gap for gap in seen.gaps if noted_after[gap.first - 1] < gap.count]
    if unexplained and not evidence.excuses_gaps:
        count = sum(gap.count for gap in unexplained)
        where = numbers_in_words(np.array([gap.first for gap in unexplained]))
        yield f"{plural(count, 'tick is', 'ticks are')} missing without a note by the logger, from tick {where} on"


def _wrong_records(evidence: Examined) -> Iterator[str]:
    """Describe the other numbered streams that have more records missing than noted."""
    lost = lost_after(evidence.remarks).total()
    streams = (("events", evidence.events), ("clock probes", evidence.probes), ("log messages", evidence.remarks))
    for name, records in streams:
        numbers = np.array([record.seq for record in records], np.int64)
        missing = sum(gap.count for gap in find_gaps(numbers))
        if missing > lost and not evidence.excuses_gaps:
            yield f"{missing} {name} are missing without a note by the logger"


def _missing_frames(frames: Sequence[FrameRecord]) -> Iterator[CheckFinding]:
    """List the missing frame numbers of displays, whose reports may be lost on the way."""
    for station in sorted({frame.station for frame in frames}):
        numbers = np.array([frame.seq for frame in frames if frame.station == station], np.int64)
        if missing := sum(gap.count for gap in find_gaps(numbers)):
            yield CheckFinding(Severity.LOSS, f"{missing} frames of the {station} display were never reported")


def _noted_losses(evidence: Examined) -> Iterator[CheckFinding]:
    """List the losses that the logger noted, each with the cause that the server gave."""
    causes = [event for event in evidence.events if event.name == "log_lost"]
    for remark in evidence.remarks:
        if remark.name == "log_lost":
            first, count = int(remark.details["first"]), int(remark.details["count"])
            cause = cause_of_loss(NumberRange(first, first + count - 1), causes) or "the server no longer had them"
            after = remark.details.get("after_tick", "?")
            yield CheckFinding(Severity.LOSS, f"{count} records were lost after tick {after}: {cause}")


def lost_after(remarks: Sequence[EventRecord]) -> Counter[int]:
    """Count the records that the logger noted as lost directly after each tick."""
    lost: Counter[int] = Counter()
    for remark in remarks:
        if remark.name == "log_lost":
            lost[int(remark.details.get("after_tick", -1))] += int(remark.details["count"])
    return lost


def check_end(recording: Recording) -> Iterator[CheckFinding]:
    """List what the whole file lacks: recovered, ended early, or computed instead of recorded."""
    if recording.recovery:
        unwritten = "nothing" if recording.end else "only records that were not yet on disk"
        what = recording.recovery.get("damage") or unwritten
        left_out = recording.recovery.get("left_out")
        also = f"; left out: {left_out}" if left_out else ""
        yield CheckFinding(Severity.LOSS, f"recovered from {recording.recovery.get('source', '?')}; lost: {what}{also}")
    ended = recording.end.get("ended", "")
    if ended != "complete" and not (recording.recovery and not ended):
        yield CheckFinding(Severity.LOSS, f"ends before its session: {ended or 'no cause is noted'}")
    for note in not_exact(recording.remarks()):
        yield CheckFinding(Severity.LOSS, f"imported, not bit-exact: {note}")
    if "what_if" in recording.metadata:
        source, scene = recording.metadata.get("source", "?"), recording.metadata["what_if"]
        text = f"not a recording of people: computed from {source} with {scene}; has no ticks between attempts"
        yield CheckFinding(Severity.LOSS, text)


def not_exact(remarks: Sequence[EventRecord]) -> list[str]:
    """Return where the table of an imported recording differs from a recording's, as found at its import."""
    return [
        '{where}: found "{found}", expected {expected}'.format_map(remark.details)
        for remark in remarks
        if remark.name == NOT_EXACT
    ]


def check_rendered(recording: Recording) -> Iterator[CheckFinding]:
    """Count the ticks with an unknown rendered force: within a trial they are a loss."""
    columns = recording.columns("phase", *(f"{side}_rendered" for side in SIDES))
    active = ACTIVE[np.clip(columns["phase"], 0, len(Phase) - 1)]
    for side in SIDES:
        rendered = columns[f"{side}_rendered"]
        count, in_trials = unknown_ticks(rendered), unknown_ticks(rendered, active)
        if count:
            severity = Severity.LOSS if in_trials else Severity.SOUND
            share = f"{in_trials} of them in trials" if in_trials else "none of them in a trial"
            yield CheckFinding(
                severity, f"the rendered force of the {side} device is unknown at {plural(count, 'tick')}, {share}"
            )


def check_triggers(evidence: Examined) -> Iterator[CheckFinding]:
    """Count the events with a pulse of the trigger box, and those without one: the other recordings lack these."""
    names = Counter(event.name for event in evidence.events)
    if names[TRIGGER]:
        yield CheckFinding(Severity.SOUND, f"{plural(names[TRIGGER], 'event')} had a pulse")
    if names[TRIGGER_LOST]:
        reasons = Counter(event.details.get("reason", "?") for event in evidence.events if event.name == TRIGGER_LOST)
        why = "; ".join(f"{reason} ({count})" for reason, count in reasons.most_common())
        yield CheckFinding(Severity.LOSS, f"{plural(names[TRIGGER_LOST], 'event')} had no pulse: {why}")


def check_time(evidence: Examined) -> Iterator[CheckFinding]:
    """Check that time never decreases, and that ticks are 1 ms apart except where the server reported a stall."""
    stalls_ms: Counter[int] = Counter()
    for event in evidence.events:
        if event.name == "stood_still":
            stalls_ms[event.tick] += int(event.details["milliseconds"])
    problems = [*_wrong_times(evidence, stalls_ms)]
    yield from (CheckFinding(Severity.DAMAGE, problem) for problem in problems)
    if stalls_ms:
        text = f"the server stalled {len(stalls_ms)} times, for {stalls_ms.total()} ms in all"
        yield CheckFinding(Severity.LOSS, text)
    if not problems:
        seconds = evidence.seen.count * 1e-3
        yield CheckFinding(Severity.SOUND, f"ticks are 1 ms apart over {seconds:.3f} s, no time stamp decreases")


def _wrong_times(evidence: Examined, stalls_ms: Counter[int]) -> Iterator[str]:
    """Describe the time stamps that contradict each other or the server's events.

    If records were lost, the server's reports may be among them. A counterfactual recording has the times of its source
    without the source's events.
    """
    seen, events, noted_after = evidence.seen, evidence.events, lost_after(evidence.remarks)
    before = {gap.first + gap.count: gap.first - 1 for gap in seen.gaps}
    unexplained = [
        tick
        for tick, more_ns in seen.jumps
        if more_ns != stalls_ms[tick] * TICK_NS
        and not (_is_stall(more_ns) and (evidence.excuses_gaps or before.get(tick, tick - 1) in noted_after))
    ]
    if unexplained:
        count = plural(len(unexplained), "tick is", "ticks are")
        yield f"{count} not 1 ms after the one before: {numbers_in_words(np.array(unexplained))}"
    back = [b.seq for a, b in pairwise(events) if b.time_ns < a.time_ns]
    if back:
        count = plural(len(back), "event is", "events are")
        yield f"{count} earlier than the one before: {numbers_in_words(np.array(back))}"
    if stepped := _log_time_steps(evidence.recording, stalls_ms.total() * TICK_NS):
        yield f"the log time decreases at {stepped} chunks"


def _is_stall(more_ns: int) -> bool:
    """Return True for a jump that a stalled server makes: forward by whole ticks."""
    return more_ns > 0 and more_ns % TICK_NS == 0


def _log_time_steps(recording: Recording, stalled_ns: int) -> int:
    """Count the chunks that begin before the end of an earlier chunk, by the file's own index.

    Ticks are written in batches, later than events that occurred while the batch grew. This delay does not count, nor
    does the time for which the server stalled: after a stall, earlier loggers dated ``/plot`` that much too late.
    """
    times = recording.chunk_times()
    ended = np.maximum.accumulate(times[:, 1])[:-1]
    return int(np.count_nonzero(times[1:, 0] < ended - _MAX_BATCH_NS - stalled_ns))
