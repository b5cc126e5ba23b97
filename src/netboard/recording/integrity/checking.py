"""Integrity check of one file: all findings, and one result.

`complete`: the bytes are as written, no number is missing, times and clocks are plausible, the trials are as planned.
`complete with listed losses`: data are missing, and the file itself lists them. `damaged`: the file has changed, was
not finished, or contradicts itself. To tell what can be saved of a damaged file, it is recovered into a temporary
folder. Nothing is written beside a recording.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import SIDES, Config, parse
from netboard.base.errors import ConfigError, NetboardError, RecordingError
from netboard.network.protocol.records import BLOCK_BEGAN, ClockRecord, EventRecord, FrameRecord
from netboard.recording.files.reader import Recording
from netboard.recording.format.backfill import unknown_ticks
from netboard.recording.format.channels import CHANNELS, FORMAT_VERSION
from netboard.recording.format.summary import find_gaps
from netboard.recording.integrity.account import OF_THE_SERVER, Stretch, cause_of_loss, parts_of
from netboard.recording.integrity.clock_check import check_clocks
from netboard.recording.integrity.planned import journal_findings, plan_findings
from netboard.recording.integrity.severity import Finding, Grade, Report, numbers_in_words
from netboard.recording.integrity.time_check import check_time, lost_after
from netboard.recording.integrity.trial_check import check_measured, check_trials
from netboard.recording.integrity.walk import ACTIVE, Walk, walk
from netboard.recording.recovery.recover import Report as Recovered
from netboard.recording.recovery.spilled import recover_any
from netboard.stage.stage import Stage, make_stage
from netboard.task.trials.state_machine import Phase

Tell = Callable[[int], object]
"""Callback for the number of further ticks read [1]."""

TICKS = CHANNELS[0].topic
"""Topic of the ticks."""

Streams = tuple[Sequence[EventRecord], Sequence[ClockRecord], Sequence[EventRecord]]
"""Events, clock probes and log messages of the logger."""


def check(path: Path, replay: bool = False, tell: Tell = lambda ticks: None) -> Report:
    """Check one file.

    Parameters
    ----------
    path : Path
        A recording, an unfinished one (``.part``) or a server's spill (``.spill``).

    Returns
    -------
    Report
        The findings. A faulty file gives findings, never an exception.
    """
    try:
        with Recording(path) as recording:
            return _check(recording, replay, tell)
    except RecordingError as error:
        return _unreadable(path, str(error))


def _unreadable(path: Path, why: str) -> Report:
    """Report what can be saved of a file that cannot be read completely."""
    findings = [Finding("file", Grade.DAMAGE, why)]
    ticks = 0
    try:
        with TemporaryDirectory() as folder:
            saved = recover_any(path, Path(folder) / "recovered.mcap")
    except (NetboardError, OSError) as error:
        findings.append(Finding("file", Grade.DAMAGE, f"nothing can be recovered: {error}"))
    else:
        ticks = sum(one.messages[TICKS] for one in saved)
        findings += [Finding("file", Grade.DAMAGE, _recoverable(one)) for one in saved]
    return Report(path, tuple(findings), ticks)


def _recoverable(saved: Recovered) -> str:
    """Describe what can be saved."""
    ticks = saved.messages[TICKS]
    span = f"{ticks} ticks" + (f", {saved.first_tick} to {saved.last_tick}" if ticks else "")
    text = f"recoverable: {span}, and {sum(saved.messages.values()) - ticks} other records"
    lost = f"; {saved.lost_bytes} bytes are lost" if saved.lost_bytes else ""
    return text + lost + ("" if saved.has_config else "; the configuration is lost")


def _check(recording: Recording, replay: bool, tell: Tell) -> Report:
    """Check a readable file."""
    recording.check()
    config: Config | None = None
    stage: Stage | None = None
    findings = [_bytes(recording)]
    try:
        config = parse(recording.config_text, "its configuration")
        if replay and recording.metadata["format"] == "1":
            findings.append(Finding("replay", Grade.LOSS, "format 1 lacks what is needed to compute its ticks again"))
        elif replay:
            stage = make_stage(config)
            stage.warm()
    except (ConfigError, RecordingError) as error:
        findings.append(Finding("configuration", Grade.DAMAGE, str(error)))
    seen = walk(_told(recording.batches(as_sent=True), tell), None if config is None else config.block, stage)
    events, probes, remarks = recording.events(), recording.clocks(), recording.remarks()
    findings += check_numbers(recording, seen, (events, probes, remarks))
    findings += check_frames(recording.frames())
    findings += check_losses(recording, events, remarks)
    findings += check_rendered(recording)
    findings += check_time(recording, seen, events, remarks)
    if config is not None:
        findings += check_clocks(probes, config.network.clock_bound_ms, seen.active_ns)
        findings += check_configuration(recording, config, events)
        if recording.metadata.get("imported") == "measured":
            findings += check_measured(seen, recording.attempts())
        elif "what_if" not in recording.metadata:
            findings += check_trials(config, seen, recording.attempts(), _continues(recording))
            findings += plan_findings(recording.path, config)
            findings += journal_findings(recording, config, seen)
    findings += replayed(seen)
    return Report(recording.path, tuple(findings), seen.count, seen.verdict, seen.computing)


def _told(portions: Iterable[NDArray[Any]], tell: Tell) -> Iterator[NDArray[Any]]:
    for rows in portions:
        yield rows
        tell(len(rows))


def _bytes(recording: Recording) -> Finding:
    size = recording.path.stat().st_size
    return Finding("file", Grade.SOUND, f"{size} bytes, every checksum is right")


def _continues(recording: Recording) -> bool:
    """Return True if another file continues the same block."""
    said = recording.metadata
    for path in parts_of(recording.path):
        if path != recording.path:
            try:
                with Recording(path) as other:
                    same = all(other.metadata.get(key) == said.get(key) for key in ("session", "block"))
                    if same and (other.first_record or 0) > (recording.first_record or 0):
                        return True
            except RecordingError:
                continue
    return False


# --- numbers -----------------------------------------------------------------------------------------------------


def check_numbers(recording: Recording, seen: Walk, streams: Streams) -> Iterator[Finding]:
    """Check that no stream misses a number without a note, and that all numbers are in order.

    Parameters
    ----------
    streams : (events, clock probes, remarks)
        The other streams numbered by the server or the logger.
    """
    noted = [remark.details for remark in streams[2] if remark.name == "log_lost"]
    excused = "what_if" in recording.metadata or bool(recording.recovery.get("damage"))
    problems = [*_wrong_totals(recording, seen)]
    if seen.disordered:
        where = numbers_in_words(np.array(seen.disordered))
        problems.append(f"{len(seen.disordered)} ticks come after one with the same or a higher number: {where}")
    noted_after = lost_after(streams[2])
    unexplained = [gap for gap in seen.gaps if not excused and noted_after[gap.first - 1] < gap.count]
    if unexplained:
        count = sum(gap.count for gap in unexplained)
        where = numbers_in_words(np.array([gap.first for gap in unexplained]))
        problems.append(f"{count} ticks are missing without a word of the logger, from tick {where} on")
    lost = sum(int(details["count"]) for details in noted)
    events, probes, remarks = ([record.seq for record in records] for records in streams)
    for name, seqs in (("events", events), ("clock probes", probes), ("remarks", remarks)):
        numbers = np.array(seqs, np.int64)
        missing = sum(gap.count for gap in find_gaps(numbers))
        if missing > lost and not excused:
            problems.append(f"{missing} {name} are missing without a word of the logger")
        if np.any(np.diff(numbers) <= 0):
            problems.append(f"the numbers of the {name} are not in order")
    yield from (Finding("numbers", Grade.DAMAGE, problem) for problem in problems)
    if not problems:
        words = ", ".join(f"{count} on {topic}" for topic, count in recording.counts.items() if count)
        yield Finding("numbers", Grade.SOUND, f"in order: {words or 'no record at all'}")


def _wrong_totals(recording: Recording, seen: Walk) -> Iterator[str]:
    """Compare the totals read with those in the file and with the log-channel numbers; yield the differences."""
    if seen.count != recording.counts[TICKS]:
        yield f"{seen.count} ticks were read, and the file says it has {recording.counts[TICKS]}"
    end = recording.end
    if not {"records", "lost", "next_record"} <= end.keys() or recording.first_record is None:
        return
    written = sum(recording.counts[topic] for topic in OF_THE_SERVER)
    if not recording.recovery and written != int(end["records"]):
        yield f"{written} records are there, and {end['records']} were written"
    span = int(end["next_record"]) - recording.first_record
    if span != int(end["records"]) + int(end["lost"]):
        yield (
            f"records {recording.first_record} to {int(end['next_record']) - 1} of the log channel are {span}, and "
            f"{end['records']} were written and {end['lost']} noted as lost"
        )


def check_frames(frames: Sequence[FrameRecord]) -> Iterator[Finding]:
    """Check the frame numbers reported by displays, whose reports may be lost on the way."""
    for station in sorted({frame.station for frame in frames}):
        numbers = np.array([frame.seq for frame in frames if frame.station == station], np.int64)
        if missing := sum(gap.count for gap in find_gaps(numbers)):
            text = f"{missing} frames of the {station} display were never reported"
            yield Finding("numbers", Grade.LOSS, text)


def check_losses(
    recording: Recording, events: Sequence[EventRecord], remarks: Sequence[EventRecord]
) -> Iterator[Finding]:
    """List the losses that the file itself notes."""
    causes = [event for event in events if event.name == "log_lost"]
    for remark in remarks:
        if remark.name == "log_lost":
            first, count = int(remark.details["first"]), int(remark.details["count"])
            cause = cause_of_loss(Stretch(first, first + count - 1), causes) or "the server no longer had them"
            after = remark.details.get("after_tick", "?")
            yield Finding("numbers", Grade.LOSS, f"{count} records were lost after tick {after}: {cause}")
    if recording.recovery:
        what = recording.recovery.get("damage") or "nothing but what was not on disk yet"
        yield Finding("file", Grade.LOSS, f"recovered from {recording.recovery.get('source', '?')}; lost: {what}")
    ended = recording.end.get("ended", "")
    if ended != "complete" and not (recording.recovery and not ended):
        yield Finding("file", Grade.LOSS, f"ends before its session: {ended or 'nobody said why'}")
    if "what_if" in recording.metadata:
        text = f"no recording of people: computed from {recording.metadata.get('source', '?')} with "
        yield Finding("file", Grade.LOSS, f"{text}{recording.metadata['what_if']}; between attempts nothing is there")


def check_rendered(recording: Recording) -> Iterator[Finding]:
    """Count the ticks with an unknown rendered force: within a trial they are a loss."""
    columns = recording.columns("phase", *(f"{side}_rendered" for side in SIDES))
    active = ACTIVE[np.clip(columns["phase"], 0, len(Phase) - 1)]
    for side in SIDES:
        rendered = columns[f"{side}_rendered"]
        count, in_trials = unknown_ticks(rendered), unknown_ticks(rendered, active)
        if count:
            grade = Grade.LOSS if in_trials else Grade.SOUND
            told = f"{in_trials} of them in trials" if in_trials else "none of them in a trial"
            yield Finding("forces", grade, f"what the {side} device rendered is unknown at {count} ticks, {told}")


# --- configuration and replay ------------------------------------------------------------------------------------


def check_configuration(recording: Recording, config: Config, events: Sequence[EventRecord]) -> Iterator[Finding]:
    """Compare the attached configuration with its hash in the metadata and with the server's event."""
    said, session = recording.metadata, config.session
    told = [event.details["config"] for event in events if event.name == BLOCK_BEGAN and "config" in event.details]
    expected = {"dyad": session.dyad, "name": session.name, "study": session.study, "block": str(config.block.number)}
    wrong = [
        f"{key} {said[key]!r}, expected {value!r}" for key, value in expected.items() if said.get(key, value) != value
    ]
    # Files of older versions are read with the keys of the current one.
    if told and told[-1] != recording.config_text and said.get("format") == FORMAT_VERSION:
        wrong.append("the server began the block with another configuration")
    if wrong:
        yield Finding("configuration", Grade.DAMAGE, f"does not go with the rest of the file: {'; '.join(wrong)}")
    else:
        twice = ", and the one the server began the block with" if told else ""
        yield Finding("configuration", Grade.SOUND, f"has the checksum that was noted{twice}")


def replayed(seen: Walk) -> Iterator[Finding]:
    """Report the result of verifying every tick."""
    verdict = seen.verdict
    if verdict is None:
        return
    if not verdict.identical:
        text = f"tick {verdict.tick}, {verdict.field}: recorded {verdict.recorded!r}, computed {verdict.computed!r}"
        yield Finding("replay", Grade.DAMAGE, f"not identical: {text}")
    elif not verdict.checked:
        yield Finding("replay", Grade.LOSS, "no tick to compute again")
    else:
        times = verdict.checked * 1e-3 / seen.computing
        text = f"all {verdict.checked} ticks are identical to the bit, computed {times:.0f} times as fast as real time"
        yield Finding("replay", Grade.SOUND, text)
